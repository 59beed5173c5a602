# SPDX-License-Identifier: Apache-2.0
"""Missions on targets, in closed loop: the same bits, or to within what words round; and whatever goes wrong is said,
and leaves nothing behind.

FLEDGE_FLY_WHOLE=1 flies the scenarios to their ends, as `./fledge fly` does.
"""

import math
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.cli.runs import alone
from fledge.targets import TARGETS, Job, build, fly, loop
from fledge.targets.rehearsal import rehearse
from fledge.targets.linux import Linux
from tests.circles import long_after
from tests.needs import flies_on, skip_unless_on
from tests.waiting import wait_for

pytestmark = pytest.mark.spread

WHOLE = bool(os.environ.get("FLEDGE_FLY_WHOLE"))
CONVERTERS = build.ROOT / "missions/nadir_spin/converters.toml"


def targets():
    for name in TARGETS:
        yield pytest.param(name, marks=flies_on(name))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of one mission, for the tests that need no other: built once."""
    return tmp_path_factory.mktemp("fly")


def everywhere():
    return ",".join(name for name, target in TARGETS.items() if not target.missing())


# --- the same bits ---------------------------------------------------------------------------------

# Where a mission flies, if not everywhere: one is enough for what targets have in common.
C_AND_SCRIPT = ("desktop", "linux", "aarch64", "cfs", "leon3", "leon3-cfs", "micropython", "leon3-micropython")
OTHER_CODE = ("desktop", "cfs", "leon3", "micropython")     # an app, the other byte order, a script
FILTERS = ("desktop", "aarch64", "cfs", "leon3", "micropython")     # more arithmetic, whose bits a compiler may change
MISSIONS = {"desaturation": ("20s", OTHER_CODE), "earth_imager": ("20s", OTHER_CODE),
            "learned_pointing": ("20s", OTHER_CODE), "orbit_raising": ("20s", OTHER_CODE),
            "relative_orbit": ("20s", OTHER_CODE), "star_slew": ("20s", FILTERS), "sun_safe": ("20s", FILTERS),
            "two_body_pointing": ("3min", C_AND_SCRIPT),
            "nadir_spin": ("3min", TARGETS)}


@pytest.mark.parametrize("mission", long_after(1, MISSIONS, "builds and flies on many targets"))
def test_flight_puts_out_the_same_bits_on_every_target(mission, folder, capsys):
    out = folder / mission
    span, places = MISSIONS[mission]
    span, places = ([], TARGETS) if WHOLE else (["--for", span], places)
    names = [name for name in everywhere().split(",") if name in places]
    assert cli.main(["fly", mission, *span, "--on", ",".join(names), "--out", str(out)]) == 0, capsys.readouterr()
    rows = [line.split() for line in capsys.readouterr().out.partition("  heap")[0].splitlines()[2:]]
    assert [row[0] for row in rows] == names
    assert len({row[1] for row in rows}) == 1 and int(rows[0][1]) > 40
    assert len({row[2] for row in rows}) == 1 and len(rows[0][2]) == 16
    assert all(row[3] == "none" for row in rows[1:])

    # And once more without the table: every output, at every step.
    desktop = Archive(out / "desktop.mcap")
    outputs = [t for t in desktop.topics if t.startswith("/flight/")]
    assert len(outputs) >= 5
    for name in names[1:]:
        target = Archive(out / f"{name}.mcap")
        assert target.complete and list(target.topics) == outputs
        assert compare(desktop, target, outputs) == []


@pytest.mark.long("builds and flies a board")
def test_offsets_rates_modes_and_events_cross_a_board_too(tmp_path):
    from fledge.export.run_test import FLIGHT, WORLD

    mission = tmp_path / "modes"
    mission.mkdir()
    (mission / "flight.py").write_text(FLIGHT)
    (mission / "world.py").write_text(WORLD)
    duration = "40min" if WHOLE else "8min"
    assert cli.main(["fly", str(mission), "--for", duration, "--on", "linux", "--out", str(tmp_path / "out")]) == 0
    sequence = Archive(tmp_path / "out/linux.mcap")["control.torque.head.sequence"]
    assert 0 < sequence[-1] < len(sequence)           # there was a mode in which it rested


@pytest.mark.long("builds and flies on all targets")
def test_an_input_of_several_outputs_takes_the_same_bits_everywhere(tmp_path, capsys):
    """Three laws, one set of wheels: by mode, newest, first and best."""
    from fledge.export.run_test import CHOICES, CHOICES_WORLD

    mission = tmp_path / "choices"
    mission.mkdir()
    (mission / "flight.py").write_text(CHOICES)
    (mission / "world.py").write_text(CHOICES_WORLD)
    names = [name for name in everywhere().split(",") if name in OTHER_CODE]
    arguments = ["fly", str(mission), "--for", "3min", "--on", ",".join(names), "--out", str(tmp_path / "out")]
    assert cli.main(arguments) == 0, capsys.readouterr()
    desktop = Archive(tmp_path / "out/desktop.mcap")
    for name in names[1:]:
        assert compare(desktop, Archive(tmp_path / f"out/{name}.mcap"),
                       [t for t in desktop.topics if t.startswith("/flight/")]) == []


@pytest.mark.long("builds and flies on targets")
def test_latency_and_random_draws_cross_a_board_too(tmp_path):
    """The measurements of a sensor with noise, and the commands of flight, one exchange late."""
    mission = tmp_path / "late"
    shutil.copytree(build.ROOT / "missions/nadir_spin", mission)
    world = (mission / "world.py").read_text()
    for wire in ("w.nav.attitude  >> f.tracking.attitude", "f.motor.command >> w.wheels.command"):
        assert wire in world
        world = world.replace(wire, f"({wire}).latency(1)")
    assert "world.Navigation()" in world
    world = world.replace("world.Navigation()", "world.Navigation(rate_noise=[1e-5] * 3, attitude_noise=[1e-4] * 3)")
    (mission / "world.py").write_text(world)
    for seed in ("7", "8"):
        assert cli.main(["fly", str(mission), "--for", "2min", "--seed", seed, "--on", "linux", "--out",
                         str(tmp_path / f"out{seed}")]) == 0
    assert compare(*(Archive(tmp_path / f"out{seed}/linux.mcap") for seed in ("7", "8"))) != []


@pytest.mark.long("builds and flies on targets")
def test_parameters_that_a_scenario_changes_cross_a_board_too(tmp_path, capsys):
    """Parameters that a scenario changes between its runs reach a target of the other byte order."""
    on = "linux,sparc64" if not TARGETS["sparc64"].missing() else "linux"
    span = [] if WHOLE else ["--for", "61min"]
    assert cli.main(["fly", "two_body_pointing", "near_conjunction", *span, "--on", on, "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    for name in ("desktop", *on.split(",")):
        record = Archive(tmp_path / f"{name}.mcap")
        late = record.time("guidance.status") > 3600.0
        status = record["guidance.status.secondary"]
        assert (status[~late] == 2).all() and (status[late][:60] == 1).all()     # the Sun is given up
    board = (tmp_path / "c/two_body_pointing_mission_board.toml").read_text()
    assert 'carries   = "commands"' in board and 'carries   = "telemetry"' in board


@pytest.mark.long("builds and flies on targets by radio")
def test_a_ground_speaks_with_a_target_by_radio(tmp_path, capsys):
    """A pass: what was lost on the way up never comes to the target; the checks see its telemetry by radio, too."""
    code = cli.main(["fly", "earth_imager", "contact", "--on", "linux", "--out", str(tmp_path)])
    assert code == 0, capsys.readouterr()
    assert len((tmp_path / "script.txt").read_text().splitlines()) == 1
    assert len((tmp_path / "linux.telemetry.txt").read_text().splitlines()) > 1000


PLAYS = """
from fledge.units import s

def all(sim):
    f = sim.flight
    f.commands.arm("off", False)
    f.settled.armed = False
    sim.run(5 * s)
    f.enter("rest")
    f.commands.noop()
    sim.run(5.3 * s)
    f.vehicle.I_B = [700, 700, 801]                 # of the configuration
    f.switch.rates = [0, 0, 0.01]
    sim.run(5 * s)
    f.control.K = 3
    f.commands.send(f.commands.packets.write("flight.control", K=-3)[0])    # breaks a rule
    f.commands.write("control", K_I=0.02)
    f.commands.read(f.control, "K")
    f.commands.mode("point")
    again = f.commands.packets.noop()
    f.commands.send(again)
    f.commands.send(again)                          # it comes twice
    sim.run(4 * s)
    f.commands.load(f.control, f.control)
    f.commands.send(f.commands.packets.load("flight.control", bytes(104))[0])
    f.commands.reset()                              # in the middle of a block
    f.commands.send(f.commands.packets.load("flight.control", bytes(104))[-1])
    f.commands.send(f.commands.packets.packet(2, b"\\0\\1", version=1))
    f.commands.send(f.commands.packets.packet(2, b"\\0\\7"))
    f.commands.publish(f.wheels)
    sim.run(7 * s)
    f.start.armed = False
    f.commands.send(b"nonsense")
    f.commands.telemetry("flight.control.torque", every=3)
    sim.run(5 * s)
    f.commands.reset_counters()
    sim.run(1 * s)

def at_random(sim):
    import random

    draw, f = random.Random(21), sim.flight
    c = f.commands
    for _ in range(60):
        for _ in range(draw.randrange(4)):
            what = draw.randrange(9)
            if what == 0:
                c.mode(draw.choice(["wait", "point", "rest"]))
            elif what == 1:
                c.write("control", K=draw.uniform(1, 5), P=draw.uniform(20, 60))
            elif what == 2:
                c.write("switch", rates=[draw.uniform(-0.01, 0.01) for _ in range(3)])
            elif what == 3:
                c.write("vehicle", I_B=[draw.uniform(650, 700), 700, draw.uniform(750, 800)])
            elif what == 4:
                c.arm(draw.choice(list(f.events)), draw.random() < 0.6)
            elif what == 5 and draw.random() < 0.3:
                c.reset()
            elif what == 6:
                c.publish(draw.choice(["vehicle", "wheels"]))
            elif what == 7:
                f.enter(draw.choice(["wait", "point", "rest"]))
                f.spin.omega_RR0_R0 = [draw.uniform(0, 0.002), 0, 0]
            else:
                wrong = bytearray(c.packets.write("flight.control", K=draw.uniform(-1, 5))[0])
                wrong[draw.randrange(len(wrong))] ^= draw.choice([0, 1, 128])
                c.send(bytes(wrong))
        sim.run(draw.choice([0.05, 0.3, 0.7, 1, 1.37, 4]) * s)

def downlink(sim):
    f = sim.flight
    f.commands.telemetry()
    f.commands.telemetry("flight.switch.reference", every=3)
    sim.run(5 * s)
    f.commands.telemetry("flight.spin.reference", on=False)
    f.commands.telemetry("housekeeping", every=10)
    sim.run(5 * s)

def world(sim):
    sim.run(5 * s)
    sim.world.nav.rate_noise = [1e-5] * 3
    sim.run(5 * s)

def event(sim):
    tick = sim.world.at(60 * s, lambda: None)
    sim.run(5 * s)
    tick.armed = False
    sim.run(5 * s)

def both(sim):
    sim.world.nav.rate_noise = [1e-5] * 3
    sim.world.at(2 * s, lambda: setattr(sim.world.nav, "rate_noise", [1e-3] * 3))
    sim.flight.vehicle.I_B = [700, 700, 801]
    sim.flight.commands.write("control", P=40)
    sim.run(5 * s)
    sim.flight.control.K = 3
    sim.run(5 * s)

def steps(sim):
    sim.run(5 * s)
    sim.step()

def fails(sim):
    sim.run(5 * s)
    assert False, "it was not good"

def nothing(sim):
    pass
"""


def plays(folder):
    """The folder of a mission with these scenarios."""
    from fledge.export.run_test import FLIGHT, WORLD

    mission = folder / "plays"
    mission.mkdir()
    (mission / "flight.py").write_text(FLIGHT)
    (mission / "world.py").write_text(WORLD)
    (mission / "scenarios.py").write_text(PLAYS)
    return mission


@pytest.mark.long("builds and flies on all targets")
def test_what_a_scenario_changes_is_commanded_on_every_target(tmp_path, capsys):
    """Modes, configuration, parameters, events, a reset, and wrong commands: the same bits and the same reports."""
    from fledge.commands import Code, Reason
    from fledge.targets.job import Job

    on = [name for name in ("linux", "aarch64", "sparc64", "cfs", "leon3", "leon3-cfs", "micropython",
                            "leon3-micropython", "cortex-m7", "riscv64") if not TARGETS[name].missing()]
    mission, out = plays(tmp_path), tmp_path / "out"
    assert cli.main(["fly", str(mission), "all", "--on", ",".join(on), "--out", str(out)]) == 0, capsys.readouterr()
    sim = fledge.load(mission)
    sim.scenarios["all"]()

    def shown(reports):
        """Without sequences: those of a target count what the scenario changed otherwise, too."""
        return [report._replace(sequence=0, detail=0 if report.reason == Reason.SEQUENCE else report.detail)
                for report in reports]

    expected = shown(sim.flight.commands.reports)
    assert {done.reason for done in expected} == {Reason.OK, Reason.RULE, Reason.LENGTH, Reason.VERSION, Reason.PLACE,
                                                  Reason.NOT_STAGED, Reason.SEQUENCE}
    assert sum(report.reason == Reason.SEQUENCE for report in expected) == 1
    assert {report.code for report in expected if report.executed} == {code for code in Code if code <= Code.TELEMETRY}
    job = Job(str(mission), "all", folder=out)
    direct = {Code.MODE: 1, Code.WRITE: 3, Code.ARM: 2}     # what it changed otherwise, as commands
    for name in on:
        answers = shown(job.parts[0].reports(name))
        for report in expected:
            assert report in answers
            answers.remove(report)
        for code, n in direct.items():
            assert sum(report.code == code for report in answers) == 2 * n
        assert len(answers) == 12 and all(report.good for report in answers)


@pytest.mark.long("builds and flies on a target")
def test_what_is_set_before_the_first_run_is_kept_beside_changes_between_runs(tmp_path, capsys):
    """In the world, at a time in the world, in flight, and by command."""
    on = ["fly", str(plays(tmp_path)), "both", "--on", "linux", "--out", str(tmp_path / "out")]
    assert cli.main(on) == 0, capsys.readouterr()
    with Archive(tmp_path / "out/linux.mcap") as record:
        rates = np.abs(np.diff(record["tracking.error.omega_BR_B"], axis=0)).max(axis=1)
        noisy = record.time("tracking.error")[1:] > 2
        assert np.nanmedian(rates[noisy]) > 5e-4 > 2 * np.nanmedian(rates[~noisy])


@pytest.mark.parametrize("play, complaint", [
    ("world", "changes world.nav between its runs; a target takes only parameters of flight"),
    ("event", "asks for a mode or arms an event of world between its runs; a target takes only those of flight"),
    ("steps", "the scenario steps does more than run"),
    ("fails", "the scenario fails fails on the desktop: it was not good"),
    ("nothing", "the scenario nothing runs nothing"),
])
def test_changes_that_no_target_takes_are_refused(play, complaint, tmp_path, capsys):
    mission = plays(tmp_path)
    assert cli.main(["fly", str(mission), play, "--out", str(tmp_path / "out")]) == (1 if play == "fails" else 2)
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.long("random commands on targets")
def test_random_commands_right_and_wrong_at_random_times_give_the_same_bits(tmp_path, capsys):
    """Some of them before the first run, some of them wrong in one bit."""
    on = "linux,micropython,sparc64" if not TARGETS["sparc64"].missing() else "linux,micropython"
    assert cli.main(["fly", str(plays(tmp_path)), "at_random", "--on", on, "--out", str(tmp_path / "out")]) == 0, \
        capsys.readouterr()
    script = (tmp_path / "out/script.txt").read_text().splitlines()
    assert len(script) > 60 and script[0].startswith("-1 ") and int(script[-1].split()[0]) > 50 * 10**9


@pytest.mark.long("builds and flies on targets")
def test_commands_reach_a_process_on_the_desktops_code_beside_targets(tmp_path, capsys):
    """Configuration that crosses, parameters and a reset, each process on either side."""
    from fledge.export.source_test import MISSION

    mission = tmp_path / "two"
    mission.mkdir()
    (mission / "mission.py").write_text(MISSION)
    (mission / "scenarios.py").write_text("""
def changes(sim):
    fast, slow = sim.flights
    fast.top.rates = [1, 2, 4]
    slow.commands.write("own", rates=[3, 2, 2])
    sim.run(3)
    fast.still.sigma_RN = [0.3, 0.2, 0.1]
    slow.turn.rates = [1, 1, 1]
    sim.run(2.6)
    slow.commands.reset()
    fast.commands.write("top", rates=[3, 0, 0])
    sim.run(3)
""")
    other = "sparc64" if not TARGETS["sparc64"].missing() else "linux"
    for on in ("fast=linux", f"slow={other}", f"fast={other},slow=linux"):
        out = tmp_path / on
        assert cli.main(["fly", str(mission), "changes", "--on", on, "--out", str(out)]) == 0, capsys.readouterr()
        rows = [line for line in capsys.readouterr().out.splitlines() if " on " in line]
        assert len(rows) == 4 and all(" none " in row for row in rows[2:])


@pytest.mark.long("builds and flies on all targets")
def test_telemetry_is_what_the_record_has(tmp_path):
    """Each packet of each output, its rate and its header; machines of both byte orders send the same bytes."""
    from fledge import export
    from fledge.commands import decoded, read_script

    on = [name for name in ("linux", "aarch64", "sparc64", *OTHER_CODE[1:], "cortex-m7", "riscv64")
          if not TARGETS[name].missing()]
    out = str(tmp_path / "out")
    assert cli.main(["fly", str(plays(tmp_path)), "downlink", "--on", ",".join(on), "--out", out]) == 0
    mission = export.read(fledge.load(tmp_path / "plays"))
    dictionary = export.dictionary(mission)
    links = [(tmp_path / f"out/{name}.telemetry.txt").read_text() for name in on]
    assert links == links[:1] * len(on)
    sim = fledge.load(tmp_path / "plays")
    sim.flight.commands.take_packets()
    sim.mission.scenarios["downlink"](sim)
    assert [packet for _, packet in sim.flight.commands.take_packets()] == [
        packet for _, packet in read_script(links[0])]
    for name in on:
        packets = read_script((tmp_path / f"out/{name}.telemetry.txt").read_text())
        record, sequences = Archive(tmp_path / f"out/{name}.mcap"), {}
        for t, raw in packets:
            stream, sequence, length, seconds, part, spare = struct.unpack(">HHHIHI", raw[:16])
            assert sequence == 0xC000 + sequences.get(stream, 0) and length == len(raw) - 7
            assert abs(seconds + part / 65536 - t / 1e9) < 1 / 65536 or stream == 0x881
            assert spare == 0
            sequences[stream] = sequences.get(stream, 0) + 1
        contents = [(t, decoded(dictionary, raw)) for t, raw in packets]
        for place, output in enumerate(dictionary.outputs):
            times = record.time_ns(export.host.topic(output.path))
            written = np.diff(record[f"{output.path}.head.sequence"], prepend=0) != 0
            written = [int(t) for t, new in zip(times, written) if new]
            if output.path == "flight.switch.reference":
                written = written[2::3]
            if output.path == "flight.spin.reference":
                written = [t for t in written if t <= 5 * 10**9]
            sent = [(t, telemetry) for t, telemetry in contents if telemetry.path == output.path]
            assert [t for t, _ in sent] == written and sequences.get(0x882 + place, 0) == len(written)
            for t, telemetry in sent:
                now = int(np.searchsorted(times, t))
                for field, value in telemetry.content.items():
                    if field != "head" and not isinstance(value, (dict, str)) and not isinstance(
                            np.asarray(value).flat[0], (dict, str)):
                        assert np.array_equal(record[f"{output.path}.{field}"][now], value)
                assert telemetry.content["head"]["sequence"] == record[f"{output.path}.head.sequence"][now]
        assert sequences[0x882 + [o.path for o in dictionary.outputs].index("flight.tracking.error")] > 50
        housekeeping = [(t, telemetry.content) for t, telemetry in contents if telemetry.path == "housekeeping"]
        assert [t for t, _ in housekeeping][-1] > 9 * 10**9 and all(content["t"] == t for t, content in housekeeping)
        assert housekeeping[0][1]["accepted"] == 2 and housekeeping[-1][1]["executed"] == 4
        assert dictionary.modes[housekeeping[-1][1]["mode"]] == "point"


# --- several flight processes ----------------------------------------------------------------------

@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Two flight processes that read one another, and no world."""
    from fledge.export.source_test import MISSION

    folder = tmp_path_factory.mktemp("several") / "two"
    folder.mkdir()
    (folder / "mission.py").write_text(MISSION)
    return folder


@pytest.mark.long("builds for two targets")
def test_each_flight_process_flies_on_a_target_of_its_own(two, capsys):
    far = "linux" if TARGETS["sparc64"].missing() else "sparc64"
    out = two.parent / "out"
    assert cli.main(["fly", str(two), "--free", "--for", "30s", "--on", f"linux,slow={far}", "--out", str(out)]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if " on " in line]
    assert [row[:4] for row in rows] == [["fast", "on", "desktop", "121"], ["slow", "on", "desktop", "31"],
                                         ["fast", "on", "linux", "121"], ["slow", "on", "linux", "31"],
                                         ["fast", "on", "desktop", "121"], ["slow", "on", far, "31"]]
    assert [row[4] for row in rows[:2]] == [row[4] for row in rows[2:4]] == [row[4] for row in rows[4:]]
    assert all(row[5] == "none" for row in rows[2:])
    for record in ("fast/linux", "slow/linux", "fast/node", f"slow/{far}"):
        assert len(Archive(out / f"{record}.mcap").time_ns("turn.reference")) in (121, 31)


@pytest.mark.long("builds and flies on targets")
def test_configuration_that_crosses_arrives_when_it_is_published(tmp_path):
    """At the next instant of the process that has it: there at once for the process that runs later, and at the next
    instant of one that ran before."""
    mission = tmp_path / "crossing"
    mission.mkdir()
    (mission / "mission.py").write_text('''
from fledge import flight as fsw


def build(sim):
    early, middle, late = sim.add_flight("early"), sim.add_flight("middle"), sim.add_flight("late")
    middle.still = fsw.InertialPointing(sigma_RN=[0.1, 0.2, 0.3])
    for f, every in ((early, 0.1), (middle, 0.5), (late, 0.25)):
        f.turn = fsw.EulerRotation()
        f.connect(middle.still.reference >> f.turn.base)
        f.task("work", every=every, run=[f.turn])
''')
    (mission / "scenarios.py").write_text('''
def change(sim):
    sim.run(1.8)
    sim.process("middle").still.sigma_RN = [0.3, 0.2, 0.1]
    sim.run(1.2)
''')
    assert cli.main(["fly", str(mission), "--on", "linux,micropython", "--out", str(tmp_path / "out")]) == 0
    for process, first in (("early", 2.1), ("middle", 2.0), ("late", 2.0)):
        for target in ("linux", "micropython"):
            with Archive(tmp_path / f"out/{process}/{target}.mcap") as record:
                turned = record["turn.reference.sigma_RN"][:, 0] > 0.2
                assert record.time("turn.reference")[np.argmax(turned)] == first and turned[-1]


@pytest.mark.long("builds for two targets")
def test_a_difference_in_one_process_is_seen_in_the_others(two, capsys, monkeypatch):
    real = Linux.build

    def spoiled(self, part):
        source = next((path for path in part.written if path.name == "two_slow.c"), None)
        if source:
            source.write_text(source.read_text().replace("turn.par.rates = vec3(3.0,", "turn.par.rates = vec3(3.5,"))
        return real(self, part)

    monkeypatch.setattr(Linux, "build", spoiled)
    assert cli.main(["fly", str(two), "--free", "--for", "5s", "--on", "slow=linux", "--out",
                     str(two.parent / "other")]) == 1
    fast, slow = (line for line in capsys.readouterr().out.splitlines()[4:6])
    # Both in the first second: slow at 0 s writes what fast reads from 0.25 s on.
    assert "fast on desktop" in fast and "t = 0.25 s  fast.top." in fast
    assert "slow on linux" in slow and "t = 0 s  slow.turn." in slow


def test_without_a_scenario(folder, capsys):
    out = str(folder / "single_spiral")
    assert cli.main(["fly", "single_spiral", "--free", "--out", out]) == 2
    assert "--free is without a scenario, and needs --for" in capsys.readouterr().err
    assert cli.main(["fly", "single_spiral", "--free", "--for", "1min", "--on", "linux", "--out", out]) == 0


def test_a_difference_is_found_and_reported(folder, capsys, monkeypatch):
    """The target gets another gain than the desktop has."""
    real = Linux.build

    def spoiled(self, job):
        source = next(path for path in job.written if path.name == "nadir_spin.c")
        text = source.read_text()
        assert "control.par.K = 2.531;" in text
        source.write_text(text.replace("control.par.K = 2.531;", "control.par.K = 2.5310000000000006;"))
        return real(self, job)

    monkeypatch.setattr(Linux, "build", spoiled)
    assert cli.main(["fly", "nadir_spin", "--for", "20s", "--on", "linux", "--out", str(folder / "other")]) == 1
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("  linux"))
    assert "t = 0 s  flight.control.torque.torque_B[" in row and " ulp" in row


# --- words that round ------------------------------------------------------------------------------

def derived(mission, scenario, converters, after, end):
    """How far rounding may move the attitude error, by the board's counts.

    Closed loop: what rounding does to the attitude is bounded by the loop's own stiffness. The control law cancels all
    but I dw' + P dw + K dsigma = d per axis, where dsigma' = dw / 4. For one that is not oscillatory (here damping
    ratios are 1.00 and 1.07) the response to a torque d never turns back, so that no bounded d moves sigma by more than
    |d| / K. d is what rounding adds, at most half a count of each number:

        K q_sigma/2 + P q_omega/2                 feedback of attitude and rate
        + sum over the wheels |a_i| q_u/2         the torques that come out
        + |omega| sum |a_i| J q_Omega/2           the gyroscopic torque, by the wheels' speeds
        + (|H| + |I omega|) q_omega/2             ... and by the rate

    and flight itself sees sigma with q_sigma/2. The sampled loop, far slower than its 0.5 s, gets 5 %.
    """
    from registers.description import read
    half = {field.carries.rsplit(".", 1)[1]: field.scale / 2 for snorkel in read(converters).snorkels
            for field in snorkel.fields if field.carries}
    assert set(half) == {"sigma_BN", "omega_BN_B", "Omega", "u"}

    sim = rehearse(mission, scenario, 1.0).start
    K, P, J, inertia = sim.flight.control.K, sim.flight.control.P[0][0], sim.flight.wheels.J[0], 800.0
    for moment in (700.0, 800.0):
        assert P / (2 * math.sqrt(K / 4 * moment)) > 0.999
    sim.run(float(after))
    rates = sim.record(sim.world.craft.state, sim.world.wheels.speeds, every=1)
    sim.run(until=float(end))
    rate = np.linalg.norm(rates["state.omega_BN_B"], axis=1).max()
    momentum = J * np.abs(rates["speeds.Omega"]).sum(axis=1).max()
    axis = np.abs(np.array(sim.flight.wheels.axes_B)[:4]).sum(axis=0).max()
    d = (K * half["sigma_BN"] + P * half["omega_BN_B"] + axis * half["u"] + rate * axis * J * half["Omega"]
         + (momentum + inertia * rate) * half["omega_BN_B"])
    return 1.05 * (d / K + half["sigma_BN"])


@pytest.mark.long("builds and flies boards of four missions")
@pytest.mark.parametrize("mission, scenario", [("nadir_spin", "spin"), ("rectangular_raster", "raster"),
                                               ("asterisk_scan", "narrow"),
                                               ("two_body_pointing", "earth_and_sun")])
def test_through_converters_it_is_the_same_to_within_their_counts(mission, scenario, tmp_path, capsys):
    """The board's file has the bound, which flights keep on machines of both byte orders, whose bits are the same; and
    the scenario's checks hold."""
    from registers.description import read
    converters = build.ROOT / "missions" / mission / "converters.toml"
    bound, = read(converters).bounds
    assert bound.field == "flight.tracking.error.sigma_BR" and bound.scenario in (None, scenario)
    # The bound is for the whole scenario, the test for a part of it.
    assert 1.0 <= bound.at_most / derived(mission, scenario, converters, bound.after, 160 * 60) < 1.05

    end = 160 * 60 if WHOLE else bound.after + 600
    two = "linux,sparc64" if not TARGETS["sparc64"].missing() else "linux"
    assert cli.main(["fly", mission, "--on", two, "--board", str(converters), "--out", str(tmp_path),
                     *([] if WHOLE else ["--for", f"{end}s"])]) == 0, capsys.readouterr()
    out = capsys.readouterr().out
    desktop, linux = (Archive(tmp_path / f"{name}.mcap") for name in ("desktop", "linux"))
    late = linux.time("error") >= bound.after
    worst = np.abs(linux["error.sigma_BR"] - desktop["error.sigma_BR"])[late].max()
    assert 0 < worst <= bound.at_most
    assert out.count(f"tracking.error.sigma_BR up to {worst:.3g}, within {bound.at_most:g}") == two.count(",") + 1
    assert "beyond the range" not in out
    assert out.endswith(f"  passed   desktop, {two.replace(',', ', ')}\n")
    assert ("  checks   none" in out) != WHOLE


@pytest.mark.long("builds and flies a board")
def test_a_bound_may_be_given_or_tightened_in_the_command(tmp_path, capsys):
    through = ["fly", "nadir_spin", "--on", "linux", "--board", str(CONVERTERS), "--out", str(tmp_path), "--for", "60s"]
    assert cli.main([*through, "--within", "tracking.error.sigma_BR=1e-12"]) == 1
    out = capsys.readouterr().out
    assert "BEYOND 1e-12" in out
    assert out.endswith("  failed   linux: tracking.error.sigma_BR is beyond its bound (passed: desktop)\n")
    assert cli.main([*through, "--within", "tracking.error.sigma_BR=1e-2"]) == 0
    assert capsys.readouterr().out.endswith("  passed   desktop, linux\n")
    assert cli.main([*through, "--within", "tracking.error.sigma_BR=1e-12", "--settled", "61s"]) == 2
    assert "--settled 61 s is after the end of the flight, 60 s" in capsys.readouterr().err
    assert cli.main([*through, "--settled", "1s"]) == 2 and "--settled is for --within" in capsys.readouterr().err

    board = tmp_path / "tight.toml"
    text = CONVERTERS.read_text()
    at_most = re.search("at_most *= *(.*)", text)[1]
    board.write_text(text.replace(at_most, "1e-12").replace("after ", "after = 0.0 #"))
    through[5] = str(board)
    assert cli.main(through) == 1
    assert "tracking.error.sigma_BR up to" in (out := capsys.readouterr().out) and "BEYOND 1e-12" in out
    line = text[:text.index('field    = "flight.tracking')].count("\n") + 1
    board.write_text(text.replace("flight.tracking.error.sigma_BR", "flight.tracking.error.sigma"))
    assert cli.main(through) == 2
    assert f"tight.toml:{line}: flight puts out no field flight.tracking.error.sigma" in capsys.readouterr().err
    board.write_text(text.replace(at_most, "-1"))
    assert cli.main(through) == 2
    assert f"tight.toml:{line + 1}: `at_most` is at least 0; it is -1; write" in capsys.readouterr().err


# --- what goes wrong -------------------------------------------------------------------------------

def started(folder, *more):
    """`fledge fly`, long enough to be disturbed, in a process of its own."""
    return subprocess.Popen([sys.executable, "-m", "fledge.cli", "fly", "nadir_spin", "--on", "linux", "--out",
                             str(folder), *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            env=loop.environment())


def processes(folder):
    """(id, command line) of all that name the folder, and no fly itself."""
    running = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            words = (path / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if any(str(folder).encode() in word for word in words) and b"fly" not in words:
            running.append((int(path.name), words))
    return running


def target_of(folder, process):
    """The id of the target's process, once it flies."""
    part = folder / "linux.mcap.part"
    running = []

    def flies():
        running[:] = [pid for pid, words in processes(folder) if words[0].endswith(b"/linux/nadir_spin")]
        return running and part.exists() and part.stat().st_size > 100_000
    wait_for(flies, process)
    return running[0]


def nothing_is_left(folder):
    return wait_for(lambda: not processes(folder))


@pytest.mark.long("interrupts flights on targets")
@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupt_leaves_nothing_behind(folder, which):
    out = folder / "nadir_spin"
    process = started(out)
    try:
        target_of(out, process)
        process.send_signal(which)
        process.communicate()
        assert process.returncode == (130 if which == signal.SIGINT else -signal.SIGKILL)
    finally:
        process.kill()
        process.wait()
    assert nothing_is_left(out)
    if which == signal.SIGINT:
        assert not (out / "linux.mcap").exists()
    elif (out / "linux.mcap").exists():  # the board's node was asked to end before the target was
        assert Archive(out / "linux.mcap").complete


@pytest.mark.long("builds and flies on targets")
def test_a_target_that_dies_is_reported_and_leaves_nothing_behind(folder):
    out = folder / "nadir_spin"
    process = started(out)
    try:
        os.kill(target_of(out, process), signal.SIGKILL)
        printed, complaint = process.communicate()
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 1 and printed.endswith("  failed   linux: did not fly (passed: desktop)\n")
    assert "linux: the flight of nadir_spin ended early: " in complaint
    assert "flight: fledge_board_node: flight on the board ended in the tick at " in complaint
    assert nothing_is_left(out)
    assert not (out / "linux.mcap").exists()
    part = Archive(out / "linux.mcap.part")               # and yet it can be read
    assert len(part.time_ns("motor.command")) > 30


def test_two_do_not_build_in_one_folder(folder, capsys):
    with alone(folder / "nadir_spin"):
        assert cli.main(["fly", "nadir_spin", "--for", "1s", "--out", str(folder / "nadir_spin")]) == 2
    assert "another fledge command writes into " in capsys.readouterr().err


def test_on_a_terminal_it_shows_how_far_it_is(folder, monkeypatch):
    """The times that the bar gets rise to the end."""
    seen = []
    monkeypatch.setattr(loop.Progress, "reaches", lambda self, t: seen.append(t))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    job = Job("nadir_spin", duration=600.0, folder=folder / "nadir_spin")
    fly(job, {"flight": TARGETS["linux"]}, "linux")
    assert seen and seen == sorted(seen) and seen[-1] <= 600 * 10**9


@pytest.mark.parametrize("arguments, complaint", [
    (["nadir_spin", "--on", "desktop,vax"], "there is no target 'vax'; there are desktop, the run in one program"),
    (["nadir_spin", "--on", ","], "--on names no target; there are desktop, aarch64"),
    (["nadir_spin", "spn"], "the mission nadir_spin has no scenario 'spn'; did you mean 'spin'? it has spin"),
    (["nadir_spin", "--within", "x=1"], "--within is for boards with words that round"),
    (["nadir_spin", "--board", str(CONVERTERS), "--within", "x=1"], "--within: flight puts out no field x"),
    (["nadir_spin", "--board", "no_such.toml"], "no_such.toml"),
    (["nadir_spin", "--board", "registers/testing/boards/io_board_a.toml"], "no board has a clock"),
    (["nadir_spin", "--for", "soon"], "expected a duration"),
    (["nadir_spin", "--on", "flght=linux"], "nadir_spin has no flight process 'flght'; it has flight"),
    (["nadir_spin", "--on", "world=linux"], "nadir_spin has no flight process 'world'; it has flight"),
    (["nadir_spin", "--on", "flight=vax"], "there is no target 'vax'"),
    (["nadir_spin", "--on", "flight=linux,flight=cfs"], "--on gives flight two targets, linux and cfs; give one"),
    (["nadir_spin", "--board", f"wrld={CONVERTERS}"], "nadir_spin has no flight process 'wrld'; it has flight"),
    (["constellation", "--board", str(CONVERTERS)], "write PROCESS=FILE, with one of sat0_flight, sat1_flight, sat2"),
    (["constellation", "--join", "--on", "linux"], "name one target with --on, as in sat0_flight=linux; found 4"),
    (["nadir_spin", "--board", str(CONVERTERS), "--within", "wrld.tracking.error.sigma_BR=1"],
     "--within: flight puts out no field wrld.tracking.error.sigma_BR"),
    (["nadir_spin", "--join", "--on", "linux,aarch64"], "--join: name one target with --on; found 2"),
    (["nadir_spin", "--on", "linux", "--trace", "x"],
     "--trace is for one of leon3, leon3-cfs, leon3-micropython, leon3-rtems, as"),
    (["nadir_spin", "--on", "linux", "--cfs", "."], "--cfs is for --on cfs"),
    (["nadir_spin", "--on", "linux", "--keys", "x"], "--keys is for --join"),
    (["nadir_spin", "--on", "linux", "--for", "5s", "--report"], "--report is about a whole scenario; leave out --for"),
])
def test_what_cannot_be_flown_is_refused_before_anything_is_written(arguments, complaint, tmp_path, capsys):
    if "linux,aarch64" in arguments:
        skip_unless_on("aarch64")
    out = tmp_path / "out"
    assert cli.main(["fly", *arguments, "--out", str(out)]) == 2
    assert complaint in capsys.readouterr().err
    assert not out.exists()


def test_the_help_and_the_page_name_every_target(capsys):
    with pytest.raises(SystemExit):
        cli.main(["fly", "--help"])
    help_text, page = capsys.readouterr().out, (build.ROOT / "docs/targets.md").read_text(encoding="utf-8")
    about = help_text.rpartition("--on TARGETS")[2].partition("--for")[0]
    about = re.sub(r"-\s+", "-", about)     # long names are broken
    for name in TARGETS:
        assert re.search(rf"\b{name}\b", about)
        assert f"\n| `{name}` |" in page


# --- as a part of a run elsewhere ------------------------------------------------------------------

@pytest.mark.long("builds and flies on targets")
@pytest.mark.parametrize("encrypted", [False, True])
def test_it_joins_a_run_whose_controller_is_elsewhere(folder, tmp_path, encrypted):
    """As on a real board: the controller and the world are others' programs, over TCP, with keys."""
    keys = []
    if encrypted:
        assert cli.main(["keys", "new", "--keys", str(tmp_path / "keys"), "controller", "world", "flight"]) == 0
        keys = ["--keys", str(tmp_path / "keys")]
        assert cli.main(["keys", "allow", *keys, "world", "flight"]) == 0
    controller = subprocess.Popen([build.native("fledge_controller", "cosim"), "--simulation", "nadir_spin", "--until",
                                   "30", "--node", "world", "--node", "flight", "--address", "tcp://127.0.0.1:*",
                                   *keys], stdout=subprocess.PIPE, text=True)
    world = None
    try:
        address = controller.stdout.readline().split()[-1]
        world = subprocess.Popen([sys.executable, "-m", "fledge.cli", "node", "nadir_spin", "world", "--address",
                                  address, *keys], stdout=subprocess.DEVNULL, env=loop.environment())
        out = folder / "nadir_spin"
        assert cli.main(["fly", "nadir_spin", "--on", "linux", "--join", address, *keys, "--out", str(out)]) == 0
        assert world.wait() == 0
        controller.communicate()
        assert controller.returncode == 0
    finally:
        for process in (controller, world):
            if process:
                process.kill()
                process.wait()
    sim = fledge.load("nadir_spin")
    sim.record(sim.flight.motor.command, sim.flight.tracking.error, every=0.5)
    sim.archive(tmp_path / "desktop.mcap")
    sim.run(30.0)
    sim.close_archive()
    assert compare(Archive(tmp_path / "desktop.mcap"), Archive(out / "linux.mcap"),
                   ["motor.command", "tracking.error"]) == []


@pytest.mark.long("builds and flies once more, as a node")
def test_it_flies_in_a_simulation_from_a_file(folder, tmp_path):
    """As a node of `fledge up`, which tells it by the environment where to go."""
    (tmp_path / "sim.toml").write_text(f'''
simulation = "nadir_spin"
until = 20
address = "ipc://@fledge-fly-test-{os.getpid()}"
[[node]]
name = "world"
mission = "nadir_spin"
process = "world"
[[node]]
name = "flight"
command = ["{sys.executable}", "-m", "fledge.cli", "fly", "nadir_spin", "--join", "--out", "{folder}/nadir_spin"]
''')
    done = subprocess.run([sys.executable, "-m", "fledge.cli", "up", "sim.toml"], cwd=tmp_path, capture_output=True,
                          text=True, env=loop.environment())
    assert done.returncode == 0, done.stdout + done.stderr
    with Archive(folder / "nadir_spin/linux.mcap") as record:
        assert len(record.time_ns("motor.command")) == 41
