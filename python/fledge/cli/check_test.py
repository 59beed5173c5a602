# SPDX-License-Identifier: Apache-2.0
"""A mission that cannot fly is refused by every command, with one list that has the lines which composed it."""

import pytest

import fledge
from fledge import cli
from fledge.disk import ROOT

WRONG = {
    "flight.py": """\
from fledge import flight as fsw
from fledge.units import N, m


def build(f):
    f.guidance = fsw.HillPointing()
    f.tracking = fsw.TrackingError()
    f.control  = fsw.MrpFeedback(K=2 * N * m)
    f.spare    = fsw.TrackingError()
    f.connect(f.guidance.reference >> f.tracking.reference, f.tracking.error >> f.control.error)
    f.task("gnc", every=1, run=[f.guidance, f.tracking, f.control])
    f.mode("rest", [])
    f.mode("point", ["gnc"], after="rset")
""",
    "world.py": """\
from fledge import Orbit, world


def build(w, f):
    sky = world.Sky("2025-06-01", center=world.EARTH)
    w.field = world.Magnetism(body=world.EARTH, sky=sky, coefficients="absent.COF")
    w.wheels = world.ReactionWheels(axes_B=[[1, 0, 0]], J=1e-3, u_max=0.1)
    w.thrust = world.ExternalForce()
    w.craft = world.Spacecraft(I_B=3, parts=[w.wheels, w.thrust], gravity=[world.EARTH],
                               orbit=Orbit(world.EARTH, altitude=500e3))
    w.nav = world.Navigation()
    w.connect(w.craft.state >> w.nav.truth, w.nav.orbit >> f.guidance.orbit)
    w.connect(w.nav.attitude >> f.tracking.attitude)
    w.task("dynamics", every=1, run=[w.craft, w.nav])
""",
    "scenarios.py": """\
def bare(sim):
    print("the scenario begins")
    sim.run(10)
"""}

# (file, line, how the text begins), by file and line; the field of a file that is absent, and the mass that is 0, are
# found by the models themselves.
FOUND = [
    ("flight.py", 8, "flight.control.P is required: gain on the rate error [N m s]"),
    ("flight.py", 8, "flight.control.vehicle is not wired, nor fed by hand; outputs of its type VehicleData: (none)"),
    ("flight.py", 9, "flight.spare is in no task: name it in the `run` of one, or leave it out"),
    ("flight.py", 9, "flight.spare.attitude is not wired"),
    ("flight.py", 9, "flight.spare.reference is not wired"),
    ("flight.py", 13, "mode flight.point is entered after rset; the modes of flight are rest and point"),
    ("world.py", 6, "world.field is in no task"),
    ("world.py", 6, "world.field.truth is not wired"),
    ("world.py", 6, "world.field.coefficients: absent.COF: cannot be opened"),
    ("world.py", 9, "world.craft.mass is 0, but one of its parts adds forces: give the spacecraft its mass"),
]
GIVING = """
def giving(sim):
    sim.flight.control.P = 5
    sim.feed(sim.flight.control.vehicle, I_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    sim.run(10)
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    """A function that writes a mission in the current folder, of these files."""
    monkeypatch.chdir(tmp_path)

    def write(files):
        folder = tmp_path / "missions/open"
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (folder / name).write_text(text)

    return write


# What its law lacks, a scenario may give.
OPEN = {
    "flight.py": """\
from fledge import flight as fsw


def build(f):
    f.guidance = fsw.HillPointing()
    f.tracking = fsw.TrackingError()
    f.control = fsw.MrpFeedback(K=2)
    f.connect(f.guidance.reference >> f.tracking.reference, f.tracking.error >> f.control.error)
    f.task("gnc", every=1, run=[f.guidance, f.tracking, f.control])
""",
    "world.py": """\
from fledge import Orbit, world


def build(w, f):
    w.craft = world.Spacecraft(I_B=3, gravity=[world.EARTH], orbit=Orbit(world.EARTH, altitude=500e3))
    w.nav = world.Navigation()
    w.connect(w.craft.state >> w.nav.truth, w.nav.orbit >> f.guidance.orbit, w.nav.attitude >> f.tracking.attitude)
    w.task("dynamics", every=1, run=[w.craft, w.nav])
"""}
WHOLE = OPEN | {"flight.py": OPEN["flight.py"].replace("MrpFeedback(K=2)", "MrpFeedback(K=2, P=5)") + """\
    f.vehicle = fsw.VehicleConfig(I_B=3)
    f.connect(f.vehicle.vehicle >> f.control.vehicle)
"""}


def test_all_problems_stand_in_one_list_by_the_lines_that_made_them(write):
    write(WRONG)
    sim = fledge.load("open")
    problems = sim.problems
    assert [(file, line) for file, line, _ in problems] == [(f"missions/open/{file}", line) for file, line, _ in FOUND]
    assert all(text.startswith(begin) for (*_, text), (*_, begin) in zip(problems, FOUND))
    with pytest.raises(fledge.CompositionError) as refused:
        sim.run(1)
    assert str(refused.value).splitlines() == [f"{file}, line {line}: {text}" for file, line, text in problems]
    assert sim.problems == problems and sim.time_ns == -1 and isinstance(refused.value, fledge.SetupError)


COMMANDS = ["run open", "run open --report --outputs all.mcap", "run open --check-replay", "run open --for 10s",
            "fly open", "verify open", "faults open", "export c open", "node open flight", "montecarlo open --runs 4",
            "montecarlo open --only 1", "up missions/open/up.toml"]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_tells_it_once_and_leaves_nothing(write, tmp_path, capsys, command):
    write(WRONG | {
        "requirements.py": "from fledge.requirements import always\n\n\ndef first(r):\n    r.every = 1\n"
                           "    error = r.signal('flight.tracking.error.sigma_BR').norm()\n"
                           "    r.require('A-1', 'It points.', always(error < 1))\n",
        "dispersions.py": "def release(d):\n    d.duration = 10\n    d.every = 1\n"
                          "    d['world.craft.sigma_BN'] = d.attitude()\n"
                          "    d.retain('flight.tracking.error.sigma_BR')\n",
        "faults.py": "def matrix(m):\n    pass\n",
        "up.toml": 'until = 10\n[[node]]\nmission = "open"\nprocess = "flight"\n'})
    before = set(tmp_path.rglob("*"))
    assert cli.main(command.split()) == 2
    captured = capsys.readouterr()
    lines = captured.err[captured.err.index("fledge: the mission cannot fly:\n"):].splitlines()
    assert [line.split(": ")[0] for line in lines[1:]] == [
        f"  missions/open/{file}, line {line}" for file, line, _ in FOUND]
    assert len(lines) == 1 + len(FOUND)
    assert "the scenario begins" not in captured.out or not command.startswith(("run", "verify"))
    assert not any(word in captured.out + captured.err for word in ("flown", "unknown", "record  ", "Traceback"))
    assert {path for path in tmp_path.rglob("*") if "__pycache__" not in path.parts} == before


def test_what_a_scenario_gives_is_not_missing(write, capsys):
    write(OPEN | {"scenarios.py": GIVING})
    assert [line for _, line, _ in fledge.load("open").problems] == [7, 7]
    assert cli.main(["check", "open"]) == 0
    assert capsys.readouterr().out == (
        "open: world 2 models in 1 task, flight 3 modules in 1 task, 1 scenario: can fly\n")
    assert cli.main(["run", "open"]) == 0
    assert "flown    10 s" in capsys.readouterr().out
    write({"scenarios.py": WRONG["scenarios.py"] + GIVING})
    assert cli.main(["check", "open"]) == 2
    assert capsys.readouterr().err.splitlines()[3:] == ["  giving can fly: what is missing, the scenario gives"]
    assert cli.main(["run", "open", "giving"]) == 0
    assert cli.main(["show", "open", "--text"]) == 0
    assert "without what a scenario may give, the mission cannot fly:\n  missions/open/flight.py, line 7: " \
        in capsys.readouterr().err
    write({"scenarios.py": GIVING.replace("P = 5", "K = -5")})
    for command in ("run", "check"):
        assert cli.main([command, "open"]) == 2
        assert "missions/open/scenarios.py, line 3: flight.control.K must be > 0 N m" in capsys.readouterr().err


@pytest.mark.parametrize("file, text, error", [
    ("requirements.py", "def first(r):\n    r.nothing()\n", "missions/open/requirements.py, line 2: "),
    ("dispersions.py", "def release(d):\n    d.duration = 0\n", "missions/open/dispersions.py, line 2: "),
    ("faults.py", "def matrix(m):\n    m.begni = 3\n", "missions/open/faults.py, line 2: "),
    ("board.toml", "snorkel = 3\n", "board.toml:1: "),
    ("control_room.toml", '[[craft]]\nname = "a b"\n', "control_room.toml:2: "),
    ("up.toml", 'until = 1\n[[node]]\nmission = "opne"\nprocess = "flight"\n', "up.toml:3: "),
    ("ground.toml", "accepted_within = 0\n", "ground.toml:1: "),
    ("broken.toml", "x = \n", "broken.toml:1: "),
])
def test_check_reads_all_files_of_the_mission(write, capsys, file, text, error):
    write(WHOLE | {file: text})
    assert cli.main(["check", "open"]) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("fledge: open can fly; ") and error in shown


def test_check_says_of_a_worked_mission_what_it_has(capsys):
    assert cli.main(["check", str(ROOT / "missions/sun_safe")]) == 0
    assert capsys.readouterr().out == ("sun_safe: world 7 models in 1 task, flight 8 modules in 1 task, 2 scenarios, "
                                       "3 requirements, 3 campaigns, faults.py: can fly\n")


def test_an_error_before_the_first_instant_reports_no_run(write, tmp_path, capsys):
    write(WHOLE | {"scenarios.py": "def early(sim):\n    sim.nothing()\n"})
    assert cli.main(["run", "open", "--report"]) == 1
    captured = capsys.readouterr()
    assert captured.err.startswith("fledge: open, early: missions/open/scenarios.py, line 2: AttributeError: ")
    assert captured.out == "open, early\n" and not (tmp_path / "runs").exists()
