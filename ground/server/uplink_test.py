# SPDX-License-Identifier: Apache-2.0
"""How commands of a server leave: the headers of a database, frames with COP-1, a radio."""
import asyncio
import shutil
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from functools import reduce
from operator import xor
from threading import Event

import pytest

import fledge
from fledge.ground.server.room import Room
from fledge.ground.server.settings import read
from fledge.ground.server.verifying_test import DATABASE, Craft, Desk, command, stages
from fledge.ground.server.web_test import console, flown
from fledge.errors import SetupError
from fledge.export.run_test import FLIGHT, WORLD
from fledge.ground.scripts.framed_test import FULL, LINK
from tests.waiting import PATIENCE, wait_for

FRAMES = "spacecraft:68,command_channel:1,telemetry_channel:0,cop1:1,cltu:1,segments:1"
PASSING = '''
from fledge import Orbit, world
from fledge.units import Hz, K, deg, kg, km, m, rad, s


def build(w, f):
    w.craft = world.Spacecraft(mass=10 * kg, I_B=[1, 1, 1] * kg * m**2, gravity=[world.EARTH],
                               orbit=Orbit(world.EARTH, altitude=500 * km, f=-40 * deg))
    w.nav = world.Navigation()
    w.station = world.GroundStation(body=world.EARTH, latitude=0 * deg, longitude=0 * deg, mask=5 * deg)
    w.radio = world.Radio(station=w.station, down_frequency=2.2e9 * Hz, up_frequency=2.0e9 * Hz, down_eirp_dBW=0,
                          up_eirp_dBW=40, down_g_t_dBK=15, up_g_t_dBK=-25, down_rate=64e3 / s, up_rate=4e3 / s)
    w.connect(w.craft.state >> [w.nav.truth, w.station.truth, w.radio.truth], w.nav.orbit >> f.hill.orbit)
    w.task("world", every=1 * s, run=[w.craft, w.nav, w.station, w.radio])
'''
OTHER = """<MetaCommand name="Other" abstract="true"><CommandContainer name="Other"><EntryList>
<FixedValueEntry binaryValue="1865C0000000" sizeInBits="48"/></EntryList></CommandContainer></MetaCommand>
{}</MetaCommandSet>""".format(command("APART", 0x0A, "", "Other", [("n", "n")]).replace(
    '"0A" sizeInBits="8"', '"0A00" sizeInBits="16"').replace('containerRef="Base"', 'containerRef="Other"'))
HILL = '''
from fledge import flight as fsw
from fledge.units import s


def build(f):
    f.hill = fsw.HillPointing()
    f.task("gnc", every=0.5 * s, run=[f.hill])
'''


def mission(folder, flight, world):
    folder.mkdir()
    (folder / "flight.py").write_text(flight)
    (folder / "world.py").write_text(world)


# --- headers -----------------------------------------------------------------------------------------

@pytest.mark.parametrize(("header", "heads"), [
    ("ccsds", ["1864c0000003", "1864c0010003", "1864c0000003"]), ("none", ["1864c0000000"] * 2 + ["1865c0000000"]),
    ("cfs", ["1864c0000003", "1864c0010003", "1864c0000003"])])
def test_the_header_is_filled_in_as_the_file_says(tmp_path, header, heads):
    async def test():
        craft = await Craft.begin()
        more = DATABASE.replace('"03" sizeInBits="8"', '"0300" sizeInBits="16"').replace("</MetaCommandSet>", OTHER)
        (tmp_path / "sat.xml").write_text(more)
        text = (f'[[craft]]\nname = "sat"\ndatabase = "sat.xml"\nroot = "/Sat/Packet"\nheader = "{header}"\n'
                f'link = "{craft.link}"\n')
        async with console(tmp_path, text) as c:
            await c.until("crafts", lambda rows: rows[0]["link"]["up"])
            desk, got = Desk(c, craft), []
            for name, n in (("OWN", 0x1234), ("OWN", 5), ("APART", 6)):
                number, packet = await desk.send(name, n=n)
                row = next(sent for sent in await c.get("crafts/sat/sent") if sent["id"] == number)
                assert bytes.fromhex(row["hex"]) == packet
                got.append(packet)
            preview = await c.post("crafts/sat/preview", {"name": "/Sat/OWN", "arguments": {"n": 0x1234}})
            assert preview["hex"] == got[0].hex()      # whose sequence is 0, too
            if header == "cfs":
                why = await c.post("crafts/sat/send", {"name": "/Sat/NEVER"}, 400)
                assert "8 bytes at least" in why["error"]
        craft.wire.close()
        heads[2] = heads[2].replace("1864", "1865")
        assert [raw[:6].hex() for raw in got] == heads
        assert [raw[6] for raw in got] == [3, 3, 10] and [raw[8:].hex() for raw in got] == ["1234", "0005", "0006"]
        checks = [reduce(xor, raw) for raw in got]
        assert checks == [0xFF] * 3 if header == "cfs" else [raw[7] for raw in got] == [0] * 3

    asyncio.run(asyncio.wait_for(test(), PATIENCE))


# --- frames -----------------------------------------------------------------------------------------

class Flown:
    """Flight behind a socket, with a link that loses units. lost: how many that go up. limit: how often the ground
    sends a frame; few are too few where the machine keeps flight from its answer for some seconds."""

    def __init__(self, sim, limit=255):
        self.sim, self.lost, self._over = sim, 0, Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.02)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind(("127.0.0.1", 0))
            self._to = other.getsockname()
        self.link = f"udp://127.0.0.1:{self._socket.getsockname()[1]}?listen={self._to[1]}&timer=1&limit={limit}"
        self._pool = ThreadPoolExecutor(1)     # keeps an exception of its thread for __exit__

    def __enter__(self):
        self._flight = self._pool.submit(self._fly)
        return self

    def __exit__(self, *_):
        self._over.set()
        self._pool.shutdown()
        self._socket.close()
        self._flight.result()

    def _fly(self):
        commands = self.sim.flight.commands
        commands.take_units()
        while not self._over.is_set():
            try:
                unit = self._socket.recv(1 << 16)
                if self.lost:
                    self.lost -= 1
                else:
                    commands.send_unit(unit)
            except TimeoutError:
                pass
            self.sim.run(0.1)
            for datagram in commands.take_units():
                self._socket.sendto(datagram.packet, self._to)


async def commanded(c, flown, name, noop, arguments):
    """Two commands, of the second of which a frame is lost."""
    await c.verified(name, noop, {}, "delivered")
    flown.lost = 1
    await c.verified(name, *arguments, "delivered")
    assert not flown.lost


async def executed(c, name):
    """All commands have all their stages."""
    for row in await c.until(f"crafts/{name}/sent", lambda rows: all(len(row["stages"]) == 4 for row in rows)):
        assert sorted(stages(row)) == [(stage, True) for stage in ("accepted", "completed", "delivered", "released")]


MINE = '[[craft]]\nmission = "./plays"\nlink = "{}"\n'
FOREIGN = ('folder = "other"\n[[craft]]\nname = "sat"\ndatabase = "foreign.xml"\nheader = "cfs"\n'
           f'link = "{{}}&frames={FRAMES}"\n')


@flown
async def test_a_frame_that_is_lost_goes_again_and_the_link_says_when_it_is_there(tmp_path):
    mission(tmp_path / "plays", FLIGHT + LINK.format(more=FULL), WORLD)
    with Flown(fledge.load(tmp_path / "plays")) as flight:
        async with console(tmp_path, MINE.format(flight.link)) as c:
            await commanded(c, flight, "plays", "flight.noop", ("flight.write.control.K", {"K": 3}))
            await executed(c, "plays")
            assert flight.sim.flight.control.K == 3 and flight.sim.flight.commands.counters.executed == 2
            craft = c.room.crafts["plays"]
            assert craft.connection.link.cop1["state"] == "active" and craft.describe()["link"]["clcws"] > 0
    # The same by its database alone, and by frames that the address names.
    shutil.copy(tmp_path / "runs/ground/databases/plays.xml", tmp_path / "foreign.xml")
    with Flown(fledge.load(tmp_path / "plays")) as flight:
        async with console(tmp_path, FOREIGN.format(flight.link)) as c:
            await c.until("crafts", lambda rows: rows[0]["link"]["up"])
            await commanded(c, flight, "sat", "flight.noop", ("flight.write.control.K", {"K": 3}))
            await executed(c, "sat")
            assert flight.sim.flight.control.K == 3 and flight.sim.flight.commands.counters.executed == 2


def test_a_command_before_all_else_has_a_time(tmp_path):
    mission(tmp_path / "plays", FLIGHT + LINK.format(more=FULL), WORLD)
    with Flown(fledge.load(tmp_path / "plays")) as flight:
        (tmp_path / "ground.toml").write_text(MINE.format(flight.link))
        room, begin = Room(read(tmp_path / "ground.toml")), time.time_ns()
        try:
            craft = room.crafts["plays"]
            sent = craft.call(lambda: craft.commanding.send("operator", "flight.noop", {}, False))
            room.start()
            assert int(sent.result(PATIENCE)["t_ns"]) >= begin
            wait_for(lambda: len(sent.result()["stages"]) > 1)
            assert stages(sent.result())[1] == ("delivered", True)
            assert all(int(row["t_ns"]) >= begin for row in room.journal.rows("events"))
        finally:
            room.close()


@pytest.mark.long("waits until COP-1 gives up")
@flown
async def test_a_frame_that_never_arrives_is_given_up(tmp_path):
    mission(tmp_path / "plays", FLIGHT + LINK.format(more=FULL), WORLD)
    with Flown(fledge.load(tmp_path / "plays")) as flight:
        async with console(tmp_path, MINE.format(flight.link)):
            shutil.copy(tmp_path / "runs/ground/databases/plays.xml", tmp_path / "foreign.xml")
    for name, text in (("plays", MINE), ("sat", FOREIGN)):
        with Flown(fledge.load(tmp_path / "plays"), limit=3) as flight:
            async with console(tmp_path, text.format(flight.link)) as c:
                await c.until("crafts", lambda rows: rows[0]["link"]["up"])
                flight.lost = 10**6
                row = await c.verified(name, "flight.noop", {}, "failed")
                assert stages(row) == [("released", True), ("failed", False)]
                assert "gave it up" in row["stages"][-1]["text"]


# --- radio -------------------------------------------------------------------------------------------

@flown
async def test_commands_and_telemetry_of_a_flown_mission_pass_its_radio(tmp_path):
    mission(tmp_path / "passing", HILL, PASSING)
    text = '[[craft]]\nmission = "./passing"\nradio = "radio"\nspeed = 0.01\n'
    async with console(tmp_path, text) as c:
        craft = c.room.crafts["passing"]
        radio = craft.simulation.world.radio
        await c.post("crafts/passing/run", {"action": "pause"})
        number = (await c.post("crafts/passing/send", {"name": "flight.noop"}))["id"]      # below the horizon
        await c.post("crafts/passing/run", {"action": "step", "seconds": 480, "speed": 0})
        row = await c.row("passing", number, "failed")
        assert "no report of its execution within 60 s" in row["stages"][-1]["text"] and stages(row)[1:] == [
            ("failed", False)]
        await c.until("crafts/passing/run", lambda run: run["state"] == "paused" and int(run["t_ns"]) >= 480 * 10**9)
        assert radio.up.lock and radio.up_traffic.lost == 1
        number = (await c.post("crafts/passing/send", {
            "name": "flight.telemetry", "arguments": {"output": "all"}}))["id"]
        await c.post("crafts/passing/run", {"action": "step", "seconds": 30})
        row = await c.row("passing", number)
        took = [int(stage["t_ns"]) - int(row["t_ns"]) for stage in row["stages"]]
        assert took[-1] > 2 * radio.up.light_time * 1e9 > 0
        await c.until("crafts/passing/run", lambda run: run["state"] == "paused" and int(run["t_ns"]) >= 510 * 10**9)
        # What comes at the last instant, the radio has not counted yet.
        assert radio.up_traffic.received == 1 and craft.telemetry.packets > 10
        assert 0 <= craft.telemetry.packets - radio.down_traffic.received <= 2


def test_a_radio_that_the_world_has_not_is_refused(tmp_path):
    mission(tmp_path / "passing", HILL, PASSING)
    (tmp_path / "ground.toml").write_text('[[craft]]\nmission = "./passing"\nradio = "radoi"\n')
    with pytest.raises(SetupError, match="passing: the world of passing has no radio 'radoi'.*radio"):
        Room(read(tmp_path / "ground.toml"))
