# SPDX-License-Identifier: Apache-2.0
"""The exported text: clean, the same each time, laid out as by hand; subsets; what is refused."""

import re
import subprocess

import pytest

import fledge
from fledge import SetupError, cli, export, flight
from fledge.export import names
from fledge.export.read import included
from fledge.export.run_test import FLIGHT, WORLD, first_difference
from fledge.export.testing import COMPILERS, ROOT, STRICT, Compiled
from tests.circles import long_after
from tests.needs import needs

ALL = sorted(fledge.missions())
MISSIONS = [name for name in ALL if not fledge.missions()[name].several]


@pytest.fixture(scope="module")
def exported():
    return {name: sources_of(fledge.load(name)) for name in ALL}


def sources_of(sim):
    """The files of all flight processes."""
    return {file: text for mission in export.read_all(sim) for file, text in export.emit_c(mission).items()}


@pytest.fixture()
def modes(tmp_path):
    return mission_of(tmp_path, FLIGHT)


def mission_of(tmp_path, flight, world=WORLD):
    folder = tmp_path / "modes"
    folder.mkdir(exist_ok=True)
    (folder / "flight.py").write_text(flight)
    (folder / "world.py").write_text(world)
    return folder


@pytest.mark.long("compiles all missions' code")
@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_mission_compiles_without_a_warning(exported, compiler, tmp_path):
    sources = []
    for name, files in exported.items():
        for file, text in files.items():
            (tmp_path / file).write_text(text)
            sources += [file] if file.endswith(".c") else []
    subprocess.run([compiler, *STRICT, "-O2", "-I", ROOT, "-c", *sources], check=True, cwd=tmp_path)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("standard", ["-std=c99", "-std=c11"])
def test_the_common_header_is_clean_where_it_is_not_used(compiler, standard, tmp_path):
    (tmp_path / "t.c").write_text('#include "targets/mission.h"\n\nextern int t;\nint t = 1;\n')
    subprocess.run([compiler, *STRICT, standard, "-I", ROOT, "-c", "t.c"], check=True, cwd=tmp_path)


@pytest.mark.parametrize("name", ALL)
def test_the_same_mission_gives_the_same_bytes(exported, name):
    assert sources_of(fledge.load(name, seed=7)) == exported[name]


@pytest.mark.long("formats exported code of all missions")
@needs("clang-format")
def test_it_is_laid_out_by_the_rules_of_this_repository(exported, modes, tmp_path):
    texts = [*exported.values(), export.emit_c(export.read(fledge.load(modes)))]
    for file, text in (item for files in texts for item in files.items()):
        done = subprocess.run(["clang-format", f"--assume-filename={ROOT}/targets/{file}"], input=text, text=True,
                              capture_output=True, check=True)
        changed = [line for line in text.splitlines() if line not in done.stdout.splitlines()]
        assert len(changed) <= len(text.splitlines()) // 50, changed
        assert max(map(len, text.splitlines())) <= 120


def test_generated_code_is_small(exported, tmp_path):
    for file, text in exported["nadir_spin"].items():
        (tmp_path / file).write_text(text)
    subprocess.run(["gcc", *STRICT, "-Os", "-I", ROOT, "-c", "nadir_spin.c"], check=True, cwd=tmp_path)
    size = subprocess.run(["size", "nadir_spin.o"], check=True, cwd=tmp_path, capture_output=True, text=True).stdout
    text, data, bss = map(int, size.splitlines()[1].split()[:3])
    assert text + data < 4096 and bss == 0          # the list of messages holds addresses, hence data


def test_c_beside_a_header_that_a_module_includes_comes_along(tmp_path):
    """Also from there on, from another root, and named from its own folder; but not what every program has."""
    texts = {"own/flight/law.h": "flight/part.h", "own/flight/law.c": "flight/math/vec.h", "own/flight/alone.c": "",
             "own/flight/part.h": "flight/head.h", "own/flight/part.c": "deep/near.h", "own/flight/head.h": "",
             "theirs/flight/deep/near.h": "flight/part.h", "theirs/flight/deep/near.c": "",
             "theirs/flight/math/vec.h": "", "theirs/flight/math/vec.c": "", "theirs/flight/part.c": "flight/alone.h"}
    for path, other in texts.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(f'#  include "{other}"\n' if other else "")
    assert included(["flight/law"], [tmp_path / "own", tmp_path / "theirs"]) == {
        "flight/law.c", "flight/part.c", "flight/deep/near.c"}


# --- subsets ---------------------------------------------------------------------------------------

def test_a_subset_reads_the_rest_of_flight_as_it_reads_the_world(modes, tmp_path):
    sim = fledge.load(modes)
    mission = export.read(sim, tasks=["control"])
    assert [m.path for m in mission.modules] == ["flight.vehicle", "flight.wheels", "flight.control", "flight.motor"]
    assert [m.path for m in mission.inputs] == ["flight.tracking.error", "world.wheels.speeds"]
    assert [m.member for m in mission.inputs] == ["in.flight_tracking_error", "in.wheels_speeds"]
    assert [m.path for m in mission.outputs if m.direction == "out"] == ["flight.motor.command"]
    assert {"the task track", "the task guide", "the task turn it", "the event settled"} <= set(mission.left_out)
    assert [e.name for e in mission.events] == ["late"]


@pytest.mark.long("flies a minute beside the desktop, at all instants")
def test_a_subset_flies_as_it_does_on_the_desktop_in_the_mode_that_runs_it(tmp_path):
    sim = fledge.load(mission_of(tmp_path, FLIGHT.replace('start_in("wait")', 'start_in("point")')))
    mission = export.read(sim, tasks=["control"])
    c = Compiled(mission, tmp_path / "c")
    sim.flight.settled.armed = False
    assert first_difference(sim, mission, c, lambda s: s.run(60.0), all_instants=True) is None


def test_all_tasks_by_name_are_all(modes):
    whole = export.emit_c(export.read(fledge.load(modes)))
    assert export.emit_c(export.read(fledge.load(modes), tasks=["turn it", "track", "control", "guide"])) == whole


# --- several processes -----------------------------------------------------------------------------

MISSION = '''
"""Two computers."""
from fledge import flight as fsw, units as u


def build(sim):
    fast, slow = sim.add_flight("fast"), sim.add_flight("slow")
    fast.still = fsw.InertialPointing(sigma_RN=[0.1, 0.2, 0.3])
    fast.turn = fsw.EulerRotation(rates=[1, 2, 3] * u.rad / u.s)
    fast.top = fsw.EulerRotation(rates=[1, 2, 3] * u.rad / u.s)
    slow.turn = fsw.EulerRotation(rates=[3, 2, 1] * u.rad / u.s)
    slow.own = fsw.EulerRotation(rates=[3, 2, 1] * u.rad / u.s)
    fast.connect(fast.still.reference >> fast.turn.base, (fast.turn.reference >> slow.turn.base).stale_after(0.5),
                 slow.turn.reference >> fast.top.base, (fast.still.reference >> slow.own.base).stale_after(0.5))
    fast.task("work", every=0.25, run=[fast.turn, fast.top])
    slow.task("work", every=1, run=[slow.turn, slow.own])
'''


@pytest.fixture()
def two(tmp_path):
    folder = tmp_path / "two"
    folder.mkdir()
    (folder / "mission.py").write_text(MISSION)
    return folder


def test_a_wire_from_another_flight_process_is_an_input(two):
    fast, slow = export.read_all(fledge.load(two))
    assert (fast.name, slow.name, fast.struct(), slow.title) == ("two_fast", "two_slow", "TwoFast", "two slow")
    assert fast.about == "Two computers."
    assert [(m.path, m.name, m.latency, m.ends) for m in fast.inputs + slow.inputs] == [
        ("slow.turn.reference", "slow_turn_reference", "next_instant", ["fast.top.base"]),
        ("fast.turn.reference", "fast_turn_reference", "same_instant", ["slow.turn.base"]),
        ("fast.still.reference", "fast_still_reference", "same_instant", ["slow.own.base"])]
    assert [w.stale_after for wires in slow.wires.values() for w in wires] == [500_000_000, 0]  # configuration never is
    assert [(m.path, m.direction) for m in fast.outputs] == [("fast.still.reference", "out"),
                                                             ("fast.turn.reference", "out"),
                                                             ("fast.turn.euler", "inside"),
                                                             ("fast.top.reference", "inside"),
                                                             ("fast.top.euler", "inside")]
    assert export.emit_c(export.read(fledge.load(two), "slow")) == export.emit_c(slow)


@pytest.mark.parametrize("compiler", long_after(1, COMPILERS, "another compiler"))
def test_a_flight_that_exchanges_nothing_compiles(two, compiler, tmp_path):
    inside = ("fast.connect(fast.still.reference >> [fast.turn.base, fast.top.base], slow.own.reference >> "
              "slow.turn.base, "
              "slow.turn.reference >> slow.own.base)\n    fast.task")
    (two / "mission.py").write_text(re.sub(r"fast.connect\(.*?\)\n    fast.task", inside, MISSION, flags=re.DOTALL))
    for mission in export.read_all(fledge.load(two)):
        assert not mission.inputs and {m.direction for m in mission.outputs} == {"inside"}
        folder = tmp_path / mission.name
        written = export.write(mission, folder, export.emit_board(mission) | export.emit_host(mission)
                               | export.emit_commands(mission))
        sources = [path for path in written if path.suffix == ".c"]
        assert len(sources) == 6
        subprocess.run([compiler, *STRICT, "-O2", "-I", ROOT, "-I", folder, "-c", *sources], check=True, cwd=folder)


@pytest.mark.parametrize("old, new, says", [
    (", (fast.still.reference >> slow.own.base)", "", "mission.py, line 12: slow.own.base"),
    ("(fast.still.reference >> slow.own.base)", "(fast.turn.reference >> slow.own.base).latency(1)",
     "line 9: fast.turn.reference reaches slow with two latencies, by slow.turn.base and slow.own.base")])
def test_a_fault_of_a_process_names_its_line(two, old, new, says):
    text = MISSION.replace(">> slow.own.base).stale_after(0.5)", ">> slow.own.base)")
    assert old in text
    (two / "mission.py").write_text(text.replace(old, new))
    with pytest.raises(SetupError, match=re.escape(says)):
        export.read_all(fledge.load(two))


def test_a_process_without_a_task_is_refused():
    sim = fledge.Simulation("idle", empty=True)
    sim.add_flight("only").still = flight.InertialPointing(sigma_RN=[0.1, 0.2, 0.3])
    with pytest.raises(SetupError, match="idle: only has no task, so there is nothing to fly"):
        export.read(sim)


# --- what is refused -------------------------------------------------------------------------------

@pytest.mark.parametrize("old, new, says", [
    ("f.guidance.reference >> f.switch.base,", "", r"flight\.py, line 11: flight\.switch\.base"),
    ("I_B=[700, 700, 800] * kg * m**2", "", r"flight\.py, line 8: flight\.vehicle\.I_B"),
    ("f.tracking.error     >> f.control.error", "(f.tracking.error >> f.control.error).latency(1)",
     r"flight\.py, line \d+: flight\.tracking\.error >> flight\.control\.error has a latency of one exchange"),
])
def test_a_mission_that_cannot_be_exported_says_why(old, new, says, tmp_path):
    assert old in FLIGHT
    with pytest.raises(SetupError, match=says):
        export.read(fledge.load(mission_of(tmp_path, FLIGHT.replace(old, new))))


def test_a_fault_of_the_world_is_reported_with_its_own_file(tmp_path):
    world = WORLD.replace("w.craft.state   >> [w.nav.truth, w.slow.truth],", "w.craft.state >> w.nav.truth,")
    with pytest.raises(SetupError, match=r"world\.py, line 12: world\.slow\.truth"):
        export.read(fledge.load(mission_of(tmp_path, FLIGHT, world)))


def test_an_event_that_looks_into_the_world_is_refused_where_it_is_written(tmp_path):
    cheat = '    f.event("cheat", when=f.watch(w.craft.state).r_BN_N[0] > 1, enter=f.rest)\n'
    sim = fledge.load(mission_of(tmp_path, FLIGHT, WORLD + cheat))
    line = WORLD.count("\n") + 1
    with pytest.raises(SetupError, match=rf"world\.py, line {line}: event flight\.cheat looks at world\.craft"):
        export.read(sim)


def test_a_mission_that_has_run_is_refused():
    sim = fledge.load("nadir_spin")
    sim.run(1.0)
    with pytest.raises(SetupError, match="export it before it runs; it stands at 1 s"):
        export.read(sim)


@pytest.mark.parametrize("arguments, says", [
    (["nadir_spin", "--tasks", "gcn"], "nadir_spin has no task 'gcn'; flight has gnc"),
    (["nadir_spni"], "there is no mission 'nadir_spni'"),
    (["constellation", "--set", "spacecraft=3"], "constellation has 3 flight processes; choose one: sat0_flight, "),
    (["constellation", "--process", "sat9"], "constellation has no flight process 'sat9'; it has sat0_flight, sat1_fl"),
    (["nadir_spin", "--process", "world"], "nadir_spin has no flight process 'world'; it has flight")])
def test_the_command_writes_nothing_where_it_refuses(arguments, says, tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main(["export", "c", *arguments, "--out", str(out)]) == 2
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_the_command_writes_both_files_and_leaves_the_same_ones_alone(tmp_path, capsys):
    arguments = ["export", "c", "nadir_spin", "--out", str(tmp_path)]
    assert cli.main(arguments) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["nadir_spin.c", "nadir_spin.h"]
    before = {p: p.stat().st_mtime_ns for p in tmp_path.iterdir()}
    assert cli.main(arguments) == 0
    assert before == {p: p.stat().st_mtime_ns for p in tmp_path.iterdir()}
    assert str(tmp_path / "nadir_spin.h") in capsys.readouterr().out


# --- names -----------------------------------------------------------------------------------------

def test_names_become_identifiers_and_stay_apart():
    assert names.distinct(["a b", "a-b", "int", "3d", "é"]) == {"a b": "a_b", "a-b": "a_b_2", "int": "int_",
                                                                "3d": "n3d", "é": "unnamed"}
    assert names.distinct(["a", "A"], ["a_2"]) == {"a": "a", "A": "A_3"}
    assert names.camel("two_body") == "TwoBody"


TAKEN = ["inertial_pointing", "mission", "math", "string", "head", "tick", "exec", "vec3", "semaphore", "sem", "run"]


@pytest.mark.parametrize("name, given", [*((name, f"{name}_mission") for name in TAKEN), ("Nadir-2", "nadir_2"),
                                         ("double", "double_"), ("class", "class"), ("orbit", "orbit"),
                                         ("euler_rotation", "euler_rotation")])
def test_a_mission_has_a_name_of_its_own(name, given, tmp_path):
    """In C of both standards, and in C++, which includes the headers."""
    sim = fledge.Simulation(name)
    f = sim.flight
    for member in ("new", "this", "template", "errno", "linux", "union"):
        setattr(f, member, flight.InertialPointing(sigma_RN=[0.1, 0.2, 0.3]))
    f.task("init", every=1, run=[f.new, f.this])
    f.task("new", every=1, run=[f.template, f.errno, f.linux, f.union])
    f.event("namespace", when=f.watch(f.new.reference).head.quality >= 2, arm="namespace")
    mission = export.read(sim)
    assert mission.name == given
    for file, text in export.emit_c(mission).items():
        (tmp_path / file).write_text(text)
    for compiler in (["gcc", *STRICT], ["gcc", "-std=gnu11"], ["g++", "-x", "c++", "-include", f"{given}.h"]):
        source = f"{given}.c" if "c++" not in compiler else "/dev/null"
        subprocess.run([*compiler, "-fsyntax-only", "-I.", "-I", ROOT, source], check=True, cwd=tmp_path)


@pytest.mark.parametrize("name, snake", [("MrpFeedback", "mrp_feedback"), ("IMUFilter", "imu_filter"),
                                         ("Sun2Axis", "sun2_axis"), ("A", "a")])
def test_functions_are_named_after_the_struct(name, snake):
    assert names.snake(name) == snake


# --- the documentation -----------------------------------------------------------------------------

def test_the_listings_in_the_documentation_are_what_is_written(exported):
    text = (ROOT / "docs/export.md").read_text(encoding="utf-8").partition("## nadir_spin")[2]
    listings = re.findall(r"```c\n(.*?)\n```", text, re.DOTALL)
    written = "".join(exported["nadir_spin"].values())
    assert len(listings) == 3
    for part in (part for listing in listings for part in listing.split("\n}\n\n")):
        assert part in written
