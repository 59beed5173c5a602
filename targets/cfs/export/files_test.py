# SPDX-License-Identifier: Apache-2.0
"""Files of an exported app are in cFE's file system, by CFDP from the ground's end, over the bus of the pocket cFE."""
import pytest

import fledge
from fledge import export, ground
from fledge.commands import Timed
from fledge.export.run_test import FLIGHT, WORLD
from fledge.ground.scripts.files import Files
from fledge.ground.scripts.links import Link
from fledge.targets.cfs import export as cfs
from fledge.targets.cfs.testing import Core, command, linked
from fledge.units import minute, s

pytestmark = pytest.mark.long("builds apps with cFE's interface, flies each")

STEP = 100_000_000


class Bus(Link):
    """The software bus as the ground sees it: a wake-up is a step of flight's time, of the wake-ups alone."""

    def __init__(self, core, ids):
        self.core, self.now = core, 0
        self.wakeup, self.request = (command(ids[f"NAV_{name}_MID"], 0) for name in ("WAKEUP", "SEND_HK"))
        self.housekeeping = f"TLM {ids['NAV_HK_TLM_MID']:04x}"

    @property
    def t(self):
        return self.now

    def send(self, packet):
        self.core.send(packet)

    def receive(self, until):
        lines = []
        while self.now < until and not lines:
            self.now += STEP
            begin = len(self.core.seen)
            self.core.send(self.wakeup)
            self.core.send(self.request)            # whose answer comes behind what the wake-up brings
            self.core.until(self.housekeeping)
            lines = [Timed(self.now, bytes.fromhex(line[4:])) for line in self.core.seen[begin:-1]
                     if line.startswith("TLM ")]
        return lines


@pytest.fixture
def connected(tmp_path):
    """The craft, and the folder that is /cf."""
    mission = tmp_path / "carries"
    mission.mkdir()
    (mission / "flight.py").write_text(FLIGHT + '    f.files = fsw.Files(entity=2, ground=1, rate=40000 / s, '
                                       'allowed=7)\n    f.task("files", every=100 * ms, run=[f.files])\n')
    (mission / "world.py").write_text(WORLD)
    read = export.read(fledge.load(mission))
    app = cfs.App("nav")
    cfs.write(read, app, tmp_path / "nav")
    program = linked.build([(app, tmp_path / "nav")], tmp_path / "run", options=["-O0", "-DNAV_TIME_FROM_MET=0"])
    core = Core(program, listen="0x08C0-0x08E0")
    try:
        core.until("NAV flies carries")
        with ground.Craft(Bus(core, app.ids(read)), export.dictionary(read, 0x18C0, 0x08C0, "little")) as craft:
            craft.files = Files(craft, rate=40_000)
            yield craft, tmp_path / "run/cf"
    finally:
        core.kill()


def test_files_are_in_a_folder_of_cfe(connected, tmp_path):
    craft, cf = connected
    plan = tmp_path / "plan"
    plan.write_bytes(bytes(range(256)) * 40)
    craft.put(plan, to="next", within=1 * minute)
    assert (cf / "nav/next").read_bytes() == plan.read_bytes()
    (cf / "nav/science").write_bytes(plan.read_bytes()[::-1])
    craft.fetch("science", to=tmp_path / "got", within=1 * minute)
    assert (tmp_path / "got").read_bytes() == plan.read_bytes()[::-1]
    (cf / "nav/old").mkdir()
    craft.put(plan, to="old/plan", within=1 * minute)
    craft.put(plan, to="next", within=1 * minute)               # in the place of the one that is there
    assert craft.directory() == ["next", "old/", "science"] and craft.directory("old") == ["plan"]
    craft.command("remove_file", "old/plan").completed()
    assert craft.directory("old") == []

    craft.command("dump_table", "flight.control", "table").completed()
    craft.command("load_table", "flight.control", "table").completed()
    sent = craft.command("send_file", "table").started()
    assert sent.completed(within=1 * minute).progress == 100
    assert craft.files.received[-1].read_bytes() == (cf / "nav/table").read_bytes()
    for name in ("../cfe_es_startup.scr", "/x", "a//b", "./x", "n" * 60):
        with pytest.raises(ground.NoAnswer, match="the file store refused it"):
            craft.put(plan, to=name, within=1 * minute)
    with pytest.raises(ground.NoAnswer, match="there is no such directory on board"):
        craft.directory("none")
    for name in ("none", "old"):
        with pytest.raises(ground.NoAnswer, match="refused remove_file|refused file remove"):
            craft.command("remove_file", name).completed()
    lost = craft.put(plan, to="lost")
    craft.listen(0.2 * s)
    lost.cancel()
    craft.listen(2 * s)
    assert {path.name for path in (cf / "nav").rglob("*")} == {"next", "old", "science", "table"}


def test_without_its_folder_the_files_are_in_flights_memory(connected, tmp_path):
    craft, cf = connected
    (cf / "nav").rmdir()
    (cf / "nav").write_bytes(b"")
    core = craft.link.core
    core.write("restart NAV")
    core.until("NAV 45: There is no folder /cf/nav: files are in flight's memory")
    core.until("NAV flies carries")
    (tmp_path / "plan").write_bytes(b"plan")
    craft.put(tmp_path / "plan", within=1 * minute)
    assert craft.directory() == ["plan"] and (cf / "nav").read_bytes() == b""
