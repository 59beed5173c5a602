# SPDX-License-Identifier: Apache-2.0
"""Missions under MicroPython: what its interpreter refuses is said with its line, the desktop's bits, and records that
tell nothing of where they were made. fly_test.py flies all targets, random_test.py random missions."""

import shutil
import subprocess
from types import SimpleNamespace

import pytest

import fledge
from fledge import cli, export
from fledge.targets import TARGETS, table
from fledge.targets.flown import heap_of
from fledge.targets.micropython import program
from fledge.targets.micropython.export import compose
from tests.needs import flies_on

LEON3 = pytest.param("leon3-micropython", marks=flies_on("leon3-micropython"))
FLIGHT = '''"""Small."""
from fledge import flight as fsw
from fledge.units import s


def build(f):
    f.rest = fsw.InertialPointing(sigma_RN=[0.1, 0, 0])
    f.task("gnc", every=1 * s, run=[f.rest])
'''


def mission(folder, text=FLIGHT):
    folder = folder / "small"
    folder.mkdir()
    (folder / "flight.py").write_text(text)
    return folder


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """What is composed of a small mission, its process, and its program for this machine."""
    sim = fledge.load(mission(tmp_path_factory.mktemp("composed")))
    composed = compose(sim, export.read(sim))
    folder = tmp_path_factory.mktemp("built")
    return composed, sim.flight, program.export(composed, sim.flight, folder)


# --- the export ------------------------------------------------------------------------------------

def test_the_same_mission_gives_the_same_bytes(small, tmp_path, capsys):
    composed, _, built = small
    (mission(tmp_path) / "unused.py").write_text("import numpy\n")
    assert cli.main(["export", "micropython", str(tmp_path / "small"), "--out", str(tmp_path / "out")]) == 0
    assert "without symbols" in capsys.readouterr().out
    ours = {path.name: path.read_bytes() for path in (built.parent / "c").iterdir()}
    assert ours == {path.name: path.read_bytes() for path in (tmp_path / "out/c").iterdir()} and len(ours) > 10


@pytest.mark.long("flies on two targets")
@pytest.mark.parametrize("target", ["micropython", LEON3])
def test_what_the_script_computes_of_the_world_is_frozen(tmp_path, capsys, target):
    text = FLIGHT.replace("import flight as fsw\n", "import flight as fsw, world\n").replace(
        "import s", "import day, hour, km, s").replace("    f.task", """
    sky = world.Sky("2015-03-02T12:00:00", world.EARTH)
    f.moon = fsw.ChebyshevEphemeris(**world.fit_ephemeris(sky, world.MOON, within=1 * km, duration=8 * day))
    f.sun = fsw.ChebyshevEphemeris(**world.fit_ephemeris(sky, world.SUN, within=1 * km, start=1 * hour,
                                                         duration=9 * day))
    turn = world.fit_orientation(sky, world.MARS, within=1 * km, duration=1 * day)
    f.spin = fsw.InertialSpin(omega_RR0_R0=[0, 0, turn["rate"]])
    f.connect(f.rest.reference >> f.spin.base)
    f.task""", 1).replace("[f.rest]", "[f.rest, f.moon, f.sun, f.spin]")
    folder = mission(tmp_path, text)
    assert cli.main(["fly", str(folder), "--on", target, "--for", "5s", "--out", str(tmp_path / "out")]) == 0
    assert f"passed   desktop, {target}" in capsys.readouterr().out


def test_the_program_composes_and_flies_by_itself(small):
    _, _, built = small
    done = subprocess.run([built, "--clock", "--priority", "0", "--for", "0.01"], capture_output=True, text=True)
    assert done.returncode == 0 and "\nheap 0:" in done.stdout, done.stderr
    described = subprocess.run([built, "--describe"], capture_output=True, text=True, check=True).stdout.splitlines()
    assert "module rest InertialPointing" in described and "runs gnc rest" in described


@pytest.mark.parametrize("old, new, message", [
    ("[0.1, 0, 0]", "[0.1, 0, 0][0:3:2]", "flight.py, line 7: "),       # a slice with a step
    ("1 * s,", "len('x'.removeprefix('y')) * s,", "flight.py, line 8: AttributeError"),
    ("    f.rest", "    from fledge import world\n    sky = world.Sky('2026-01-01', world.EARTH)\n    a, b = sky."
     "orientation(world.EARTH)\n    f.rest", "flight.py, line 9: this unpacks a value of the world or of another "
     "process, which is not known on the target"),
    ("    f.rest", "    f'{1:>{2}}'; match = 1\n    match match:\n        case 1: pass\n    f.rest", "flight.py"),
])
def test_what_fails_there_is_refused_with_its_line(old, new, message, tmp_path, capsys):
    folder = mission(tmp_path, FLIGHT.replace(old, new))
    assert cli.main(["export", "micropython", str(folder), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error, error


def test_what_it_composes_otherwise_is_refused(small):
    composed, _, built = small
    other = fledge.load("nadir_spin").flight
    with pytest.raises(export.ExportError, match="under MicroPython it composes something else"):
        program.check(composed, other, built)
    sim = fledge.load(composed.scripts.files["small/flight.py"].parent)
    sim.flight.rest.sigma_RN = [0.2, 0, 0]
    mission = export.read(sim)
    with pytest.raises(export.ExportError, match=r"flight\.rest\.par\.sigma_RN.* has other bits"):
        program.check(compose(sim, mission), sim.flight, built)


def test_a_scenario_may_begin_in_another_mode_than_the_script(tmp_path):
    folder = mission(tmp_path, FLIGHT + '''    f.mode("rests", [])
    f.mode("works", ["gnc"])
''')
    own, sim = export.read(fledge.load(folder)), fledge.load(folder)
    sim.flight.start_in("works")
    built = program.export(compose(sim, export.read(sim), own), sim.flight, tmp_path / "out")
    described = subprocess.run([built, "--describe"], capture_output=True, text=True, check=True).stdout
    assert "\nstart works\n" in described


@pytest.mark.parametrize("words, message", [
    (["--tasks", "gnc"], "--tasks is for `export c`"),
    (["--app", "nav"], "--app is for `export cfs`"),
])
def test_options_of_other_exports_are_refused(words, message, capsys):
    assert cli.main(["export", "micropython", "nadir_spin", *words]) == 2
    assert message in capsys.readouterr().err


# --- flights ---------------------------------------------------------------------------------------

@pytest.mark.long("builds a co-simulation")
def test_a_scenario_sets_it_up_and_a_process_flies_with_others(tmp_path, capsys):
    """Modes, events, commands between runs, latency, wires between computers, and a base that the scenario chooses."""
    far = "micropython" if TARGETS["leon3-micropython"].missing() else "leon3-micropython"
    assert cli.main(["fly", "formation", "sensed", "--for", "30s", "--on",
                     f"chief=micropython,deputy={far},chief_guidance=linux", "--out", str(tmp_path)]) == 0
    assert "memory.base.par.source" in (tmp_path / f"deputy/{far}/c/formation_deputy.c").read_text()     # its set-up
    assert capsys.readouterr().out.count("  none ") == 3


# --- records ---------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The folder of a flight on this machine and on a board."""
    folder = tmp_path_factory.mktemp("flown")
    on = ",".join(name for name in ("micropython", "leon3-micropython") if not TARGETS[name].missing())
    assert cli.main(["fly", "inertial_spin", "--for", "1min", "--on", on, "--out", str(folder)]) == 0
    return folder


@pytest.mark.long("flies on two targets")
@pytest.mark.parametrize("target", ["micropython", LEON3])
def test_plot_compare_and_convert_cannot_tell_where_a_run_was_made(target, flown, tmp_path, capsys):
    programs = {}
    for name in ("desktop", target):
        shutil.copy(flown / f"{name}.mcap", tmp_path / "run.mcap")
        out = tmp_path / name
        assert cli.main(["plot", str(tmp_path / "run.mcap"), "spin.reference.sigma_RN", "error.sigma_BR", "--out",
                         str(out)]) == 0
        assert cli.main(["convert", str(tmp_path / "run.mcap"), "--csv", "--out", str(out)]) == 0
        programs[name] = {file.name: file.read_bytes() for file in sorted(out.iterdir())}
    assert programs["desktop"] == programs[target] and len(programs[target]) > 8
    assert sum(name.endswith(".png") for name in programs[target]) == 1
    capsys.readouterr()
    assert cli.main(["compare", str(flown / "desktop.mcap"), str(flown / f"{target}.mcap"), "--topics", "flight"]) == 0


# --- the figures -----------------------------------------------------------------------------------

def test_the_heap_and_the_updates_of_a_script_are_reported():
    assert heap_of("0:100:300 4:100:300 8:120:310") == (100, 120, 310) and heap_of("") is None
    flat = SimpleNamespace(heap=(4096, 4096, 5120), steps=7, script=("flight.slew 7 updates of the script",))
    grown = SimpleNamespace(heap=(4096, 5120, 5120), steps=7, script=())
    assert table.scripts([("a", flat, "", ""), ("b", grown, "", ""), ("c", None, "", "")]) == [
        "heap     a: 4.0 KiB after the start, at most 5.0 KiB; flat for 7 steps",
        "script   a: flight.slew 7 updates of the script",
        "heap     b: 4.0 KiB after the start, at most 5.0 KiB; IT GREW to 5.0 KiB"]
