# SPDX-License-Identifier: Apache-2.0
"""What a script may not compose: refused with its line where it flies, and on the desktop."""

import subprocess

import pytest

from fledge import export, flight
from fledge.errors import SetupError
from fledge.export import c_source, commands
from fledge.targets.micropython.export.tables import emit_tables
from fledge.disk import write_files
from fledge.mission.simulation import Simulation
from fledge.objects.testing import kinds
from fledge.targets import build
from fledge.targets.micropython import toolchain

BASE = """from fledge import flight as fsw
from fledge.units import deg, m, s


def build(f):
    f.noise = fsw.Noise(seed=5)
    f.flags = fsw.Flags()
    f.other = fsw.Noise()
    f.sink = fsw.Sink()
    f.connect(f.flags.kinds >> f.sink.kinds)
    gnc = f.task("gnc", every=1 * s, run=[f.noise, f.sink])
    f.mode(tasks=[], name="idle")
    work = f.mode("work", [gnc])
    k = f.watch(f.noise.kinds)
    first = f.event("first", when=(k.x > 1 * m) & ~(k.phase == "SAFE"), enter=work)
    assert [f.name, gnc.name, f.gnc.name, f.work.name, f.active_mode] == ["flight", "gnc", "gnc", "work", "idle"]
    assert [fsw.Quality.GOOD, fsw.Quality.QUALITY_GOOD, fsw.EventSeverity.LOW] == [3, 3, 2]
    assert [f.first is first, first.name, first.armed, first.fired_at] == [True, "first", True, None]
"""
END = '    f.task("rest", every=1 * s, run=[f.other])\n'
LINE = BASE.count("\n") + 1
THERE = "only where it flies"    # the desktop does not refuse it, or only when it exports

CASES = [
    ("f.connect(f.noise.kinds >> f.sink.kinds)", "flight.noise.kinds >> flight.sink.kinds: the input is wired already"),
    ("f.connect(f.noise.kinds >> f.other.hint, 3)",
     "flight.connect: expected wires, as in a.output >> b.input; found 3"),
    ("f.connect(fsw.Noise().kinds >> f.other.hint)", "give both modules their names first"),
    ("f.connect((f.noise.kinds >> f.other.hint).latency(1))", "a latency is for wires between processes", THERE),
    ("f.connect(fsw.best(f.noise.kinds, f.flags.kinds) >> f.sink.kinds)",
     "flight.noise.kinds >> flight.sink.kinds: the input is wired already"),
    ("fsw.newest(f.noise.kinds, f.flags.kinds, f.noise.kinds)",
     "newest(flight.noise.kinds, flight.flags.kinds, flight.noise.kinds): flight.noise.kinds stands in it twice"),
    ("fsw.first(f.noise.kinds)", "first(flight.noise.kinds): expected two outputs or more"),
    ("fsw.best(f.noise, f.other)", "best: expected outputs, as in best(a.torque, b.torque); found flight.noise"),
    ("fsw.by_mode(f.noise.kinds, f.other.kinds)", "name the modes, as in by_mode(safe=a.torque, point=b.torque)",
     THERE),
    ("f.connect((fsw.newest(f.noise.kinds, f.flags.kinds) >> f.other.hint).latency(1))",
     "flight.noise.kinds >> flight.other.hint: a latency is for wires between processes", THERE),
    ('f.task("empty", every=1, run=[])', "task flight.empty runs nothing"),
    ('f.task("gnc", every=1, run=[f.other])', "task flight.gnc is already there"),
    ('f.task("late", every=1, run=[f.other, f.sink])', "runs flight.sink, which is already in a task"),
    ('f.task("late", every=1, run=[f.other, f.other])', "runs flight.other, which is already in a task"),
    ('f.task("late", every=0 * s, run=[f.other])', "task flight.late: every must be > 0"),
    ('f.task("late", every=1, offset=-1, run=[f.other])', "task flight.late: offset must be >= 0"),
    ('f.task("late", every=1 * m, run=[f.other])', "task flight.late: every: expected a time"),
    ('f.task("late", every=1, run=[f.other.kinds])', "run takes modules of the process; found"),
    ('f.task("late", run=[f.other])', "'every' argument required"),
    ('f.mode("more", ["gnc", "nothing"])', "mode flight.more names the task nothing; the process has gnc"),
    ('f.mode("more", [f.noise])', "mode flight.more takes tasks by handle or name; found"),
    ('f.mode("idle", [])', "mode flight.idle: it is already there"),
    ('f.mode("task", [])', "mode flight.task: this name is taken by the process itself"),
    ('f.start_in("nothing")', "there is no mode nothing; the process has idle, work"),
    ('f.event("e", when=3, enter=work)',
     "event flight.e: when takes a condition, as in watch(port).field < 1; found 3"),
    ('f.event("e", when=k.x > 1, until=2, enter=work)', "event flight.e: until takes a condition"),
    ('f.event("e", when=k.x > 1)', "event flight.e does nothing"),
    ('f.event("e", when=k.x > 1, enter=work, count=0)', "event flight.e: the count must be >= 1"),
    ('f.event("e", when=k.x > 1, enter=work, hold=-1 * s)', "event flight.e: hold must be >= 0"),
    ('f.event("e", when=k.x > 1, until=k.x < 0, once=True, enter=work)', "leave out until"),
    ('f.event("e", when=k.x > 1, enter="nothing")',
     "event flight.e enters the mode nothing; the process has idle, work"),
    ('f.event("e", when=k.x > 1, enter=work, modes=["idle", "x"])', "event flight.e looks in the mode x"),
    ('f.event("e", when=k.x > 1, arm=3)', "event flight.e takes events by handle or name; found 3"),
    ('f.event("e", when=k.x > 1, do=print)', "flight's events are data"),
    ('f.event("e", when=k.x > 1, set=[f.watch(f.flags).x])', "set takes pairs of a field and a value"),
    ('f.event("e", when=k.x > 1, set=[(f.watch(f.flags).x, 3 * s)])', "flight.flags.x"),
    ('f.event("e", when=k.x > 1, set=[(f.watch(f.other.kinds).x, float("inf"))])', "numbers that are finite"),
    ('f.event("e", when=k.x > 1, set=[(f.watch(f.noise).state, 1)])', "an event sets parameters and outputs"),
    ('f.event("e", when=k.x > 1, set=[(f.watch(f.noise).v[3], 1)])', "[3]: expected 1 whole numbers, below 3"),
    ('f.event("e", when=k.x > 1, set=[(f.watch(f.noise).v.norm(), 1)])', "set an element of it, or the whole field"),
    ('f.event("first", when=k.x > 1, enter=work)', "event flight.first: it is already there"),
    ("fsw.Quality.WELL", "Quality has no 'WELL'; it has QUALITY_NONE, QUALITY_STALE"),
    ("f.watch(3)", "watch: expected a port or module; found 3"),
    ("k.nothing > 1", "flight.noise.kinds has no 'nothing'; it has"),
    ("k.x.nothing > 1", "flight.noise.kinds.x is a number or array"),
    ("k.parts.share > 1", "flight.noise.kinds.parts is an array of Part; pick one"),
    ("k.parts[3].share > 1", "[3]: expected 1 whole numbers, below 3"),
    ("k.grid[1].norm() > 1", "[1]: expected 2 whole numbers, below 2 3"),
    ("k.grid[1, -1] > 1", "expected 2 whole numbers"),
    ("k > 1", "flight.noise.kinds: compare one of its fields: "),
    ("k.v > 1", "flight.noise.kinds.v is an array: compare an element, norm() or max_abs()"),
    ("k.x.norm() > 1", "flight.noise.kinds.x: norm() is for arrays"),
    ("k.label == 'a'", "flight.noise.kinds.label is a text; compare a number"),
    ("k.x > 3 * s", "flight.noise.kinds.x"),
    ("k.x > 'a'", "flight.noise.kinds.x"),
    ("k.x > k.rate", "the first is in m, the second in rad/s"),
    ("k.since > k.i64", "the first is in ns, the second in -"),
    ("k.x > k.x", "this compares a field with itself"),
    ("k.x > float('inf')", "expected a finite number"),
    ("k.phase == 'NOTHING'", "flight.noise.kinds.phase"),
    ("k.phase == k.phases[5]", "expected 1 whole numbers, below 3"),
    ("bool(k.x)", "flight.noise.kinds.x is only known when the mission runs"),
    ("k.x > 1 and k.x < 2", "a condition is only known when the mission runs"),
    ("f.watch(fsw.Noise().kinds).x > 1", "is in no module of flight yet", THERE),
    ("c = k.x > 0\n    for i in range(70): c = (k.x > i) & c", "a condition nests more than 64 deep"),
    ("f.nothing", "the process flight has no 'nothing'; it has noise, flags, other, sink"),
    ("f.noise = fsw.Noise()", "flight.noise is already there"),
    ("f.more = fsw.Noise()", "flight.more: the exported mission has no module of this name", THERE),
    ("f.first = fsw.Noise()", "flight.first is already a mode or an event"),
    ("f.connect = fsw.Noise()", "flight.connect: this name is taken by the process itself"),
    ("f.more = 3", "flight.more: expected a module; found 3"),
    ("f.reset_by(f.noise.hint)", "flight.reset_by: expected an input of a module of this process, a ComputerReset"),
    # What is complete only after the script.
    ("f.connect(fsw.by_mode(idle=f.noise.kinds, busy=f.other.kinds) >> f.other.hint)",
     "the script has a wire for the mode flight.busy, which is not there", THERE),
    ("f.connect(fsw.newest(f.noise.kinds, f.flags.kinds) >> f.other.hint)",
     "the script has inputs that choose an output of flight.flags, which is in no task", THERE),
    # What the tables do not have.
    ('f.mode("more", [])', "the script does not make, at its place, the mode flight.more", THERE),
    ('f.event("more", when=k.x > 1, enter=work)',
     "the script does not make, at its place, the event flight.more", THERE),
]


def text_of(statement):
    return f"{BASE}    {statement}\n{END}"


@pytest.fixture(scope="module")
def refusals(tmp_path_factory):
    """What the target says of each case, and of the mission itself."""
    root, types = kinds()
    flight.TYPES.update(types)
    sim = Simulation("cases")
    exec(text_of("pass"), space := {})
    space["build"](sim.flight)
    mission = export.read(sim)
    folder = tmp_path_factory.mktemp("process")
    library = toolchain.library()
    tables = emit_tables(mission, "case", False, ["world", "flight"], named=["EventSeverity"])["cases_script.c"]
    assert tables.count('.module = "case"') == 1
    texts = {f"case_{i}.py": text_of(statement) for i, statement in enumerate(["pass", *(c[0] for c in CASES)])}
    write_files({**c_source.emit(mission), **commands.emit_commands(mission),
                 "cases_script.c": tables.replace('.module = "case"', ".module = script_module").replace(
                     "const ScriptMission", "extern char script_module[];\nconst ScriptMission"),
                 "cases_frozen.c": toolchain.freeze(texts, library)}, folder)
    roots = [folder, root, build.ROOT]
    program = build.program(
        folder / "program", "cases",
        [build.ROOT / "targets/micropython/testing/process.c", *folder.glob("cases*.c"),
         *build.module_sources(mission, roots), *build.math_sources(), *(build.ROOT / path for path in build.COMMAND)],
        roots, library.compiler, library.flags, [library.archive, "-no-pie", "-lm"])
    done = subprocess.run([program, str(len(texts))], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_the_mission_itself_is_composed(refusals):
    assert refusals[0] == "composed" and len(refusals) == 2 + len(CASES)


def test_configuration_that_the_script_changes_in_flight_is_published_at_the_next_instant(refusals):
    assert refusals[-1] == "0 2.5"


def test_each_is_refused_with_its_line(refusals):
    for i, (statement, why, *_) in enumerate(CASES, 1):
        where = (f"case_{i}.py, line {LINE + statement.count(chr(10))}: " if not why.startswith("the script") else "")
        assert refusals[i].startswith(where) and why in refusals[i], (statement, refusals[i])


def test_the_desktop_refuses_it_too():
    flight.TYPES.update(kinds()[1])
    for statement, _, *only in CASES:
        sim = Simulation("cases")
        exec(text_of(statement), space := {})
        if only != [THERE]:
            with pytest.raises((SetupError, TypeError, ValueError, AttributeError)):
                space["build"](sim.flight)
                pytest.fail(f"the desktop takes {statement}")
