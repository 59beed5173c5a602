# SPDX-License-Identifier: Apache-2.0
"""A co-simulation whose packets pass the world's radio: the same as in one simulation, bit by bit."""
import json
import re
import signal
import subprocess
import sys
from urllib.request import Request, urlopen

import numpy as np
import pytest

import fledge
from fledge import cli, cosim, ground
from fledge.archive import Archive
from fledge.errors import SetupError
from fledge.units import ms, s
from tests.circles import long_after
from tests.needs import skip_unless_on
from tests.waiting import wait_for

MISSION = '''
from fledge import Orbit, flight as fsw, world
from fledge.units import Hz, deg, kg, km, m, ms, s


def build(sim):
    w, f = sim.add_world("world"), sim.add_flight("flight")
    f.hill = fsw.HillPointing()
    f.files = fsw.Files(entity=2, ground=1, rate=2000, segment=100, allowed=15, ack_timer=2 * s, nak_timer=2 * s, crc=1)
    f.task("gnc", every=500 * ms, run=[f.hill])
    f.task("files", every=500 * ms, run=[f.files])
    w.craft = world.Spacecraft(mass=10 * kg, I_B=[1, 1, 1] * kg * m**2, gravity=[world.EARTH],
                               orbit=Orbit(world.EARTH, altitude=500 * km, f=-26 * deg))
    w.nav = world.Navigation()
    w.station = world.GroundStation(body=world.EARTH, latitude=0 * deg, longitude=0 * deg, mask=5 * deg)
    w.radio = world.Radio(
        station=w.station, down_frequency=2.2e9 * Hz, up_frequency=2.0e9 * Hz, down_eirp_dBW=-29, up_eirp_dBW=-1.5,
        down_g_t_dBK=15, up_g_t_dBK=-25, down_rate=20e3 / s, up_rate=4e3 / s)
    w.connect(w.craft.state >> [w.nav.truth, w.station.truth, w.radio.truth], w.nav.orbit >> f.hill.orbit)
    w.task("world", every=100 * ms, run=[w.craft, w.nav, w.station, w.radio])
'''
SCRIPT = '''
from fledge import ground
from fledge.units import s, minute


def run(craft, script):
    with script.step("before the pass"):
        early = craft.command("noop")
        script.hold(60 * s)
        script.check(not early.reports, "no answer comes")
    with script.step("pass"):
        script.hold(260.3 * s)
        craft.command("telemetry", "flight.hill.reference", every=3)
        craft.command("telemetry", "housekeeping", every=4)
        seen = craft.wait(lambda t: t.flight.hill.reference.head.t > 0, within=60 * s)
        script.value("reference", seen.flight.hill.reference.sigma_RN)
        craft.put("plan", to="plan", within=3 * minute)
        craft.fetch("plan", to="back", within=3 * minute)
    with script.step("set"):
        craft.listen(6 * minute)
        try:
            craft.command("noop").completed(within=10 * s)
        except ground.NoAnswer:
            script.value("missed", [craft.missed, craft.refused])
'''
UP = """
simulation = "pass"
until = 1100
join = 300
exchange = true
watch = ["/world/radio/down_traffic", "/world/radio/up_traffic", "/world/radio/down"]

[[node]]
mission = "./passing"
process = "world"
free = true

[[node]]
mission = "./passing"
process = "flight"
free = true
target = "{target}"

[[{kind}]]
name = "ground"
{command}
"""
NODE = ('command = ["{python}", "-m", "fledge.cli", "ground", "run", "script.py", "--yes", "--out", "there", "--to", '
        '"cosim:flight?radio=world.radio&every={every}", "--mission", "./passing"]')


@pytest.fixture()
def place(tmp_path, monkeypatch):
    (tmp_path / "passing").mkdir()
    (tmp_path / "passing/mission.py").write_text(MISSION)
    (tmp_path / "script.py").write_text(SCRIPT)
    (tmp_path / "plan").write_bytes(bytes(range(256)) * 8)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def up(place, name="up.toml", target="linux", every=0.5):
    (place / name).write_text(UP.format(target=target, kind="node",
                                        command=NODE.format(python=sys.executable, every=every)))
    return cli.main(["up", name])


def entries(folder):
    return [json.loads(line) for line in (folder / "script.jsonl").read_text().splitlines()][1:]


@pytest.mark.parametrize("target", long_after(1, ["linux", "leon3"], "flies on the LEON3 by radio"))
def test_the_same_commands_telemetry_and_traffic_as_in_one_simulation(target, place, capfd):
    skip_unless_on(target)
    assert up(place, target=target) == 0, capfd.readouterr()
    assert (place / "back").read_bytes() == (place / "plan").read_bytes()
    (place / "back").unlink()
    sim = fledge.load("./passing")
    log = sim.record(sim.world.radio.down_traffic, sim.world.radio.up_traffic, every=100 * ms)
    ground.perform(sim, place / "script.py", radio="world.radio")
    sim.run(1100 * s - sim.time * s)
    assert cli.main(["ground", "run", "script.py", "--to", "./passing", "--radio", "world.radio", "--out", "here",
                     "--yes"]) == 0
    assert (place / "back").read_bytes() == (place / "plan").read_bytes()
    assert entries(place / "there") == entries(place / "here") and len(entries(place / "here")) > 20

    exchange = Archive(place / "runs/pass/exchange.mcap")
    for way in ("down", "up"):
        topic = f"/world/radio/{way}_traffic"
        for name in ("sent", "received", "lost", "damaged", "dropped", "bytes"):
            times, values = exchange.time_ns(topic), exchange[f"radio.{way}_traffic.{name}"]
            here = log[f"radio.{way}_traffic.{name}"][np.searchsorted(np.round(log.time * 1e9), times)]
            assert (values == here)[times > 0].all(), (way, name)
        assert values[-1] > 0
    assert sim.world.radio.down_traffic.damaged > 0 and sim.world.radio.up_traffic.damaged > 0
    assert sim.world.radio.down_traffic.lost > 0 and sim.world.radio.up_traffic.lost == 2


@pytest.mark.long("a co-simulation, twice")
def test_a_rewind_has_what_is_on_its_way(place, capfd):
    (place / "sim.toml").write_text("keep_every = 107\n" + UP.format(target="linux", kind="node", command=NODE.format(
        python=sys.executable, every=0.5)).replace("exchange = true", ""))
    assert cli.main(["up", "sim.toml"]) == 0, capfd.readouterr()
    for t in ("323.3s", "326s"):
        assert cli.main(["rewind", "runs/pass", "--to", t]) == 0, capfd.readouterr()
        assert (place / f"runs/pass@{t}/exchange.mcap").read_bytes() == (place / "runs/pass/exchange.mcap").read_bytes()


@pytest.mark.long("a co-simulation by radio")
def test_a_command_of_the_console_goes_by_radio(place):
    (place / "sim.toml").write_text("pace = 1\n" + UP.format(
        target="linux", kind="asynchronous", command='serve = "room.toml"'))
    (place / "room.toml").write_text('port = 0\nfolder = "room"\n[[craft]]\nmission = "./passing"\n'
                                     'link = "cosim:flight?radio=world.radio"\n')
    log = place / "runs/pass/log/ground.log"

    with open(place / "up.log", "w") as printed, subprocess.Popen(
            [sys.executable, "-m", "fledge.cli", "up", "sim.toml"], stdout=printed, stderr=printed) as run:
        try:
            address = wait_for(lambda: log.exists() and re.search(r"http://\S+/", log.read_text()), run)[0]

            def ask(path, content=None):
                body = None if content is None else json.dumps(content).encode()
                return json.loads(urlopen(Request(f"{address}api/{path}", body, headers)).read())

            headers = {}
            headers["X-Fledge-CSRF"] = ask("session")["csrf"]
            wait_for(lambda: ask("crafts")[0]["link"]["up"], run)
            begin = int(ask("crafts/passing/run")["t_ns"]) / 1e9
            ask("crafts/passing/run", {"action": "step", "seconds": 330 - begin, "speed": 0})
            wait_for(lambda: ask("crafts/passing/run")["state"] == "paused", run)
            for _ in range(3):      # a wrong bit may cost one of them
                ask("crafts/passing/send", {"name": "flight.noop", "arguments": {}})
            ask("crafts/passing/run", {"action": "go", "speed": 10})
            wait_for(lambda: any(stage["stage"] == "completed" for row in ask("crafts/passing/sent")
                                 for stage in row["stages"]), run)
        finally:
            run.send_signal(signal.SIGINT)
            run.wait()
    exchange = Archive(place / "runs/pass/exchange.mcap")
    assert exchange["radio.up_traffic.received"].max() == 3 and exchange["radio.down_traffic.received"].max() >= 2


@pytest.mark.long("starts the command for each mistake")
def test_what_does_not_fit_the_radio_is_refused(place, capfd):
    assert up(place, every=2) == 1
    assert "what comes by radio comes every 0.5 s, with flight's instants; write every=0.5" in capfd.readouterr().out
    with pytest.raises(SetupError, match="passing has no radio 'world.rdio'; did you mean 'world.radio'"):
        ground.connect(fledge.load("./passing"), radio="world.rdio")
    with pytest.raises(SetupError, match=r"a radio of flight, which steps every 0.5 s: let world step at these"):
        slow = (place / "passing/mission.py").read_text().replace("every=100 * ms", "every=1 * s")
        (place / "passing/mission.py").write_text(slow)
        cosim.split(fledge.load("./passing"), "world")
