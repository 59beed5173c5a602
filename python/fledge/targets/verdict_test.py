# SPDX-License-Identifier: Apache-2.0
"""The last line of `fledge fly`: every target of the command, and what is wrong with it."""

import re
import signal

import pytest

import fledge
from fledge import cli
from fledge.archive import Archive
from fledge.commands import Code, Reason, Report, Stage
from fledge.export.run_test import FLIGHT, WORLD
from fledge.targets import TARGETS, Job, Part
from fledge.targets.linux import Linux
from fledge.targets.micropython import MicroPython
from fledge.targets.playback import stand_in


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fly")


def last(capsys):
    captured = capsys.readouterr()
    return captured.out.splitlines()[-1], captured


# --- targets that do not fly -----------------------------------------------------------------------

@pytest.mark.long("flies on another target")
def test_a_target_that_is_not_installed_is_in_the_last_line_and_the_others_fly(folder, capsys, monkeypatch):
    monkeypatch.setattr(TARGETS["aarch64"], "needs", ("no-such-compiler",))
    assert cli.main(["fly", "nadir_spin", "--for", "5s", "--on", "aarch64,linux", "--out", str(folder / "nadir")]) == 1
    line, output = last(capsys)
    assert line == "  failed   aarch64: did not fly (passed: desktop, linux)"
    assert "  aarch64: fly: aarch64 needs no-such-compiler, not installed here; as root, run: apt-get " in output.err
    assert re.search(r"\n  linux +11 ", output.out) and Archive(folder / "nadir/linux.mcap").complete
    for alone in (["--build"], ["--join"]):
        assert cli.main(["fly", "nadir_spin", "--on", "aarch64", *alone, "--out", str(folder / "nadir")]) == 2
        assert "aarch64 needs no-such-compiler" in capsys.readouterr().err


def test_a_target_that_refuses_the_mission_is_in_the_last_line(folder, capsys, monkeypatch):
    def refuses(self, part):
        raise fledge.SetupError("this board has no sensor")

    monkeypatch.setattr(type(TARGETS["sparc64"]), "build", refuses)
    monkeypatch.setattr(TARGETS["sparc64"], "needs", ())
    assert cli.main(["fly", "nadir_spin", "--for", "5s", "--on", "sparc64,linux", "--out", str(folder / "nadir")]) == 1
    line, output = last(capsys)
    assert line == "  failed   sparc64: did not fly (passed: desktop, linux)"
    assert "  sparc64: this board has no sensor\n" in output.err


def test_scripts_are_refused_before_anything_flies(mission, tmp_path, capsys, monkeypatch):
    """The rehearsal of the scenario is a flight, too: it writes a file here. The second of two processes is wrong."""
    (mission / "flight.py").rename(mission / "one.py")
    (mission / "two.py").write_text((mission / "one.py").read_text() + "\nimport numpy\n")
    (mission / "world.py").rename(mission / "truth.py")
    (mission / "mission.py").write_text("from . import one, truth, two\n\ndef build(sim):\n" + "".join(
        f"    f = sim.add_flight('{name}')\n    {name}.build(f)\n    truth.build(sim.add_world('w_{name}'), f)\n"
        for name in ("one", "two")))
    begun = tmp_path / "begun"
    (mission / "scenarios.py").write_text(
        f"def long(sim):\n    sim.run(1)\n    open({str(begun)!r}, 'w').close()\n    sim.run(1)\n")
    real, checks = MicroPython.check, []

    def check(self, part):
        try:
            real(self, part)
        except fledge.SetupError as failure:
            checks.append((begun.exists(), str(failure)))
            raise

    monkeypatch.setattr(MicroPython, "check", check)
    assert cli.main(["fly", str(mission), "--on", "micropython", "--out", str(tmp_path / "out")]) == 1
    assert begun.exists() and checks == [(False, f"{mission}/two.py, line "
                                          f"{len((mission / 'two.py').read_text().splitlines())}: numpy is not on the "
                                          "target: lists with units are arrays there, and math has the functions")]
    assert last(capsys)[0] == "  failed   micropython: did not fly (passed: desktop)"


def test_a_flight_that_stops_early_is_no_pass(folder, capsys, monkeypatch):
    """Its program ends as if all were well."""
    real = Linux.build

    def spoiled(self, part):
        source = next(path for path in part.written if path.name == "nadir_spin.c")
        text = source.read_text()
        name = re.search(r"^void (\w+_tick)\(", text, re.MULTILINE)[1]
        ends = re.sub(rf"^(void {name}\([^)]*\)\n{{)", r"\1\n    if (t >= 5500000000) exit(0);", text,
                      flags=re.MULTILINE)
        assert ends != text
        source.write_text("#include <stdlib.h>\n" + ends)
        return real(self, part)

    monkeypatch.setattr(Linux, "build", spoiled)
    assert cli.main(["fly", "nadir_spin", "--for", "10s", "--on", "linux", "--out", str(folder / "early")]) == 1
    assert last(capsys)[0].startswith("  failed   linux: d")


def test_a_scenario_that_fails_on_the_desktop_is_flown_nowhere(mission, tmp_path, capsys):
    (mission / "scenarios.py").write_text("def bad(sim):\n    sim.run(1)\n    assert sim.mode == 'point'\n")
    assert cli.main(["fly", str(mission), "--on", "linux", "--out", str(tmp_path / "out")]) == 1
    line, output = last(capsys)
    assert line == "  failed   desktop: the scenario's checks do not hold; linux: did not fly"
    assert "fledge: the scenario bad fails on the desktop: " in output.err


REQUIREMENT = '''
from fledge.requirements import always
from fledge.units import deg, s

def rate(r):
    r.require("RATE-1", "It never turns.", always(r.signal("flight.tracking.error.omega_BR_B").norm() < 1e-9 * deg / s))
'''


@pytest.mark.parametrize("targets", ["desktop", pytest.param("linux", marks=pytest.mark.long("builds and flies"))])
def test_a_violated_requirement_has_one_verdict_in_all_commands(mission, tmp_path, capsys, monkeypatch, targets):
    """With its numbers; and on all targets that put out the same bits."""
    monkeypatch.chdir(tmp_path)
    (mission / "scenarios.py").write_text("def turns(sim):\n    sim.run(5)\n    assert sim.time == 5\n")
    (mission / "requirements.py").write_text(REQUIREMENT)
    violated = []
    for command, on in (("run", []), ("fly", ["--on", targets]), ("verify", ["--on", targets])):
        assert cli.main([command, str(mission), *on]) == 1
        violated.append(capsys.readouterr().out)
    number, = re.findall(r"\n           RATE-1 violated, by (.*), at (.*) s, norm", violated[0])
    both = ["desktop", "linux"][:1 + (targets == "linux")]
    assert f"\n  required {', '.join(both)}: 1 violated\n           RATE-1 violated, by {number[0]}" in violated[1]
    assert violated[1].endswith(f"  failed   {'; '.join(f'{name}: violates RATE-1' for name in both)}\n")
    assert re.search(rf"RATE-1 +violated +-{re.escape(number[0])} +turns on {targets}, t = {number[1]} s", violated[2])


@pytest.mark.long("builds and flies on targets")
def test_ctrl_c_keeps_what_other_targets_flew(folder, capsys, monkeypatch):
    def interrupted(self, part, options, timeout):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(type(TARGETS["sparc64"]), "prepared", interrupted)
    monkeypatch.setattr(TARGETS["sparc64"], "needs", ())
    assert cli.main(["fly", "nadir_spin", "--for", "5s", "--on", "linux,sparc64,aarch64", "--out",
                     str(folder / "nadir")]) == 130
    line, output = last(capsys)
    assert line == "  failed   sparc64: did not fly; aarch64: did not fly (passed: desktop, linux)"
    assert re.search(r"\n  linux +11 .* none ", output.out)


# --- commands that were refused --------------------------------------------------------------------

COMMANDS = '''
from fledge.units import N, m, s

def vain(sim):
    """It sends what flight refuses."""
    sim.run(3 * s)
    flight = sim.flight.commands
    for packet in flight.packets.write("flight.control", K=-2.0):
        flight.send(packet)
    flight.send(flight.packets.packet(14, bytes(8)))
    sim.run(2 * s)
    assert not any(one.executed and one.good for one in flight.reports) or sim.flight.control.K == 2.5

def changed(sim):
    sim.run(3 * s)
    sim.flight.control.K = 3 * N * m
    sim.run(2 * s)

def memory(sim):
    """It reads what no record has."""
    sim.run(10 * s)
    assert sim.flight.switch.running == 1
'''


@pytest.fixture
def mission(tmp_path):
    modes = tmp_path / "modes"
    modes.mkdir()
    for name, text in (("flight.py", FLIGHT), ("world.py", WORLD), ("scenarios.py", COMMANDS)):
        (modes / name).write_text(text)
    return modes


@pytest.mark.long("builds and flies on a target")
def test_a_refused_command_is_reported_in_words(mission, tmp_path, capsys):
    """One that the scenario itself sends in vain, on the desktop too, is no failure."""
    assert cli.main(["fly", str(mission), "vain", "--on", "linux", "--out", str(tmp_path / "out")]) == 0, (
        capsys.readouterr().err)
    line, output = last(capsys)
    assert line == "  passed   desktop, linux"
    for name in ("desktop", "linux"):
        assert re.search(rf"\n  refused  {name}: write flight.control.K, at 3.* s: the parameters would break a rule: "
                         r"flight.control.K must be .*> 0 N m\n", output.out), output.out
        assert f"\n  refused  {name}: evaluate, " in output.out


@pytest.mark.long("builds and flies on a target")
def test_a_command_that_only_flight_refuses_fails_it(mission, tmp_path, capsys, monkeypatch):
    """What a scenario changes becomes a command; flight has not changed then, whatever its outputs are."""
    real = Part.reports

    def refuses(self, target):
        sequence = int.from_bytes(self.script[-1].packet[2:4], "big") & 0x3FFF
        return [*real(self, target), Report(3 * 10**9, sequence, Code.WRITE, Stage.DONE, Reason.BUSY, 0, b"")]

    monkeypatch.setattr(Part, "reports", refuses)
    assert cli.main(["fly", str(mission), "changed", "--on", "linux", "--out", str(tmp_path / "out")]) == 1
    line, output = last(capsys)
    assert line == "  failed   linux: a command was refused (passed: desktop)"
    assert ("\n  refused  linux: write flight.control.K, at 3 s: the commands that wait for the next instant leave no "
            "room\n" in output.out)


def test_every_reason_has_words(mission):
    part = Job(str(mission), "changed").parts[0]
    dictionary = part.job.start.flight.commands.dictionary
    packet = part.script[-1].packet
    for reason in list(Reason)[1:]:
        text = dictionary.refusal(Report(-1, 0, Code.WRITE, Stage.ACCEPTED, reason, 0, b""), packet)
        assert re.fullmatch(r"write flight.control.K, before the first instant: [a-z].{15,}", text)


# --- checks that read memory -----------------------------------------------------------------------

@pytest.mark.long("builds and flies on a target")
def test_a_check_of_memory_is_refused_on_a_target_and_names_the_output(mission, tmp_path, capsys):
    assert cli.main(["fly", str(mission), "memory", "--on", "linux", "--out", str(tmp_path / "out")]) == 1
    line, output = last(capsys)
    assert line == "  failed   linux: the scenario's checks cannot be judged by its record (passed: desktop)"
    assert ("flight.switch.running is memory of a module, which the record of a target does not have. A check reads "
            "outputs: flight.switch.reference has sigma_RN, " in output.err)

    sim = fledge.load(str(mission))
    stand_in(sim, {"flight": Archive(tmp_path / "out/linux.mcap")})
    sim.run(5)
    for twin in (sim, sim.clone()):
        with pytest.raises(fledge.SetupError, match="flight.switch.running is memory of a module"):
            twin.flight.switch.running
        assert "running  not known here" in re.sub("  +", "  ", repr(twin.flight.switch))
        assert twin.flight.switch.reference.sigma_RN.any() and twin.world.nav.attitude.sigma_BN.any()
