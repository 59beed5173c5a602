# SPDX-License-Identifier: Apache-2.0
"""Mission folders: found, executed afresh, and with errors that show the user's own line."""

import gc
import json
import os
import re
import subprocess
import sys
import textwrap

import pytest

import fledge
from fledge import MissionError, SetupError

ENVIRONMENT = {**os.environ, "PYTHONPATH": ":".join(p for p in sys.path if p)}
FLIGHT = """
    "A body that looks down."
    from fledge import flight as fsw

    LIMIT = 3

    def build(f):
        f.guidance = fsw.HillPointing()
        f.task("gnc", every=1, run=[f.guidance])
"""
WORLD = """
    from fledge import Orbit, world
    from .flight import LIMIT

    def build(w, f):
        w.craft = world.Spacecraft(I_B=LIMIT, gravity=[world.EARTH], orbit=Orbit(world.EARTH, altitude=500e3))
        w.nav = world.Navigation()
        w.connect(w.craft.state >> w.nav.truth, w.nav.orbit >> f.guidance.orbit)
        w.task("dynamics", every=1, run=[w.craft, w.nav])
"""
SCENARIOS = '''
    from fledge.units import minute

    def orbit(sim):
        """Once around."""
        log = sim.record(sim.flight.guidance.reference, every=10)
        sim.run(2 * minute)
        log.plot("sigma_RN")
        assert helper(sim) == 120, "the clock is wrong"

    def helper(sim):
        return sim.time

    def _hidden(sim):
        pass

    def failing(sim):
        sim.record(sim.flight.guidance.reference)
        sim.run(1)
        assert sim.time > 5, "too early"
'''


def write(folder, flight=FLIGHT, world=WORLD, scenarios=SCENARIOS):
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (("flight", flight), ("world", world), ("scenarios", scenarios)):
        (folder / f"{name}.py").write_text(textwrap.dedent(text))
    return folder


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write(tmp_path / "missions" / "looker")


def test_found_by_name_and_by_path(here):
    assert fledge.load("looker").name == fledge.load(here).name == "looker"
    assert set(fledge.missions()) >= {"looker", "nadir_spin"}
    assert fledge.sim.load("looker").mission.folder == here


def test_an_unknown_mission_lists_the_known(here):
    with pytest.raises(SetupError, match="no mission 'loker'; did you mean 'looker'. there are looker,.* nadir_spin"):
        fledge.load("loker")
    (here.parent / "half").mkdir()
    for name in (here.parent / "half", "half"):
        with pytest.raises(SetupError, match=r"^there is no mission in \S*half: the folder is there, but neither "
                                             "flight.py, what flies, nor mission.py is in it$"):
            fledge.load(name)
    with pytest.raises(SetupError, match="^there is no mission in some/where: there is no such folder$"):
        fledge.load("some/where")


def test_scenarios_and_their_summaries(here):
    sim = fledge.load("looker")
    assert list(sim.scenarios) == ["orbit", "helper", "failing"]
    assert sim.mission.summaries() == {"": "A body that looks down.", "orbit": "Once around.", "helper": "",
                                       "failing": ""}
    sim.plots = False
    sim.scenarios["orbit"]()
    assert sim.time == 120


def test_a_file_in_another_encoding_is_named_with_its_line(here):
    about = fledge.load("looker").mission
    for name in ("flight", "scenarios"):
        path = here / f"{name}.py"
        before = path.read_bytes()
        text = before + b"\n# gr\xfcn\n"
        path.write_bytes(text)
        line = f"looker/{name}.py, line {len(text.splitlines())}: 0xFC is no UTF-8; save the file as UTF-8"
        with pytest.raises(fledge.MissionError, match=re.escape(line)):
            fledge.load("looker")
        assert about.summaries()[""].endswith(line)
        path.write_bytes(before)


def test_a_mission_made_by_mission_py_needs_no_flight_py(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "missions" / "pair"
    folder.mkdir(parents=True)
    (folder / "mission.py").write_text(textwrap.dedent("""
        "Two that look down."
        from fledge import flight as fsw
        from fledge.units import rad, s

        from .both import PERIOD

        def build(sim):
            for name in ("left", "right"):
                f = sim.add_flight(name)
                f.turn = fsw.EulerRotation(rates=[1, 2, 3] * rad / s)
                f.task("gnc", every=PERIOD, run=[f.turn])
            sim.process("left").connect(sim.process("right").turn.reference >> sim.process("left").turn.base,
                                        sim.process("left").turn.reference >> sim.process("right").turn.base)
    """))
    (folder / "both.py").write_text("PERIOD = 2")
    sim = fledge.load("pair")
    sim.run(4)
    assert [process.name for process in sim.flights] == ["left", "right"]
    assert sim.mission.summaries() == {"": "Two that look down."} and "pair" in fledge.missions()


def test_two_simulations_share_nothing(here):
    a, b = fledge.load("looker"), fledge.load("looker")
    a.run(3)
    assert b.time == 0 and a.flight.guidance is not b.flight.guidance
    assert a.mission.scenarios["orbit"].__globals__ is not b.mission.scenarios["orbit"].__globals__
    # And a file that changed is read again, however quickly.
    write(here, flight=FLIGHT.replace("LIMIT = 3", "LIMIT = 4"))
    assert fledge.load("looker").world.craft.I_B[0, 0] == 4


def test_what_was_executed_is_forgotten_with_its_simulation(here):
    before = set(sys.modules)
    sim = fledge.load("looker")
    assert set(sys.modules) - before
    del sim
    gc.collect()
    assert not [n for n in set(sys.modules) - before if n.startswith("_mission_")]


@pytest.mark.parametrize(
    "old, new, text",
    [
        ("f.guidance = fsw.HillPointing()", "f.guidance = fws.HillPointing()",
         "missions/looker/flight.py, line 8: NameError: name 'fws' is not defined\n"
         "    f.guidance = fws.HillPointing()"),
        ("f.guidance = fsw.HillPointing()", "f.guidance = fsw.HillPointing(",
         "missions/looker/flight.py, line 8: '(' was never closed\n    f.guidance = fsw.HillPointing("),
        ("f.guidance = fsw.HillPointing()", "f.guidance = fsw.EulerRotation(rates=[1, 2])",
         "missions/looker/flight.py, line 8: EulerRotation.rates: expected shape (3), in rad/s; found shape (2)\n"
         "    f.guidance = fsw.EulerRotation(rates=[1, 2])"),
        ("from fledge import flight as fsw", "from fledge.units import furlong",
         "missions/looker/flight.py, line 3: ImportError: fledge.units has no unit 'furlong'; the units are m, km"),
        ("def build(f)", "def built(f)", "missions/looker/flight.py: expected a function build(f)"),
    ],
)
def test_an_error_in_a_file_shows_its_line(here, old, new, text):
    write(here, flight=FLIGHT.replace(old, new))
    with pytest.raises(MissionError) as error:
        fledge.load("looker")
    assert text in str(error.value) and "fledge/" not in str(error.value).split("\n")[0]


def test_an_error_in_world_names_the_line_that_called(here):
    write(here, world=WORLD.replace("altitude=500e3", "altitude=500e3, e=2"))
    with pytest.raises(MissionError, match=r"world.py, line 6: Orbit: expected a and e.*altitude, e\n +w.craft ="):
        fledge.load("looker")


# --- the command line ------------------------------------------------------------------------------

def cli(*arguments, cwd):
    return subprocess.run([sys.executable, "-m", "fledge.cli", *map(str, arguments)], cwd=cwd, text=True,
                          capture_output=True, env=ENVIRONMENT)


def test_run_leaves_a_record_and_plots(here, tmp_path):
    done = cli("run", "looker", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("looker, orbit: Once around.\n  flown    120 s in ")
    folder = tmp_path / "runs" / "looker" / "orbit"
    assert sorted(p.name for p in folder.iterdir()) == ["run.mcap", "sigma_RN.png", "summary.json"]
    archive = fledge.Archive(folder / "run.mcap")
    run = archive.metadata["run"]
    assert run["mission"] == "looker" and run["scenario"] == "orbit" and run["seed"] == "0"
    assert "attitude_noise was left at 0 rad" in run["assumptions"]
    assert archive.metadata["end"] == {"outcome": "passed", "ended": "120 s"}
    assert archive["sigma_RN"].shape == (13, 3)
    first = (folder / "run.mcap").read_bytes()
    assert cli("run", "looker", "--no-plots", "--out", "again", cwd=tmp_path).returncode == 0
    assert (tmp_path / "again" / "run.mcap").read_bytes() == first
    assert sorted(p.name for p in (tmp_path / "again").iterdir()) == ["run.mcap", "summary.json"]


def test_a_failed_check_is_honest_and_leaves_its_record(here, tmp_path):
    done = cli("run", "looker", "failing", cwd=tmp_path)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert done.stderr == ("fledge: looker, failing: failed: missions/looker/scenarios.py, line 20: too early\n"
                           "    assert sim.time > 5, \"too early\"\n")
    archive = fledge.Archive(tmp_path / "runs" / "looker" / "failing" / "run.mcap")
    assert archive.complete and archive.metadata["end"]["outcome"].startswith("failed")
    assert "Traceback" in cli("run", "looker", "failing", "--debug", cwd=tmp_path).stderr


@pytest.mark.long("flies with strict checks several times")
def test_strict_fails_a_run_with_a_finding(here, tmp_path):
    assert cli("run", "looker", "--strict", cwd=tmp_path).returncode == 0
    write(here, world=WORLD.replace("run=[w.craft, w.nav]", "run=[w.nav, w.craft]"))
    lenient, strict = cli("run", "looker", cwd=tmp_path), cli("run", "looker", "--strict", "--report", cwd=tmp_path)
    text = ("world.nav.truth reads world.craft.state a step late: task world.dynamics runs world.nav before "
            "world.craft; let it run world.craft first")
    assert lenient.returncode == 0 and f"  health   {text}\n" in lenient.stdout and "passed" in lenient.stdout
    assert strict.returncode == 1 and text in strict.stderr and "passed" not in strict.stdout
    folder = tmp_path / "runs" / "looker" / "orbit"
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["outcome"].startswith("failed: --strict") and summary["time"] == 120
    assert [finding["kind"] for finding in summary["health"]] == ["late"] and summary["health"][0]["text"] == text
    assert fledge.Archive(folder / "run.mcap").metadata["end"]["outcome"].startswith("failed: --strict")
    assert fledge.Archive(folder / "run.mcap").metadata["health"] == {"late world.nav.truth": text}
    assert text in (folder / "report.html").read_text()


def test_the_end_of_a_run_between_two_instants_is_shown(here, tmp_path):
    done = cli("run", "looker", "--for", "10.5s", cwd=tmp_path)
    assert done.returncode == 0
    assert "no task runs at the end, the state is that of 10 s" in done.stdout and "flown    10.5 s in" in done.stdout


def test_flying_freely(here, tmp_path):
    done = cli("run", "looker", "--for", "1min", "--seed", "7", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    archive = fledge.Archive(tmp_path / "runs" / "looker" / "free" / "run.mcap")
    assert {"/flight/guidance/reference", "/world/craft/state"} <= set(archive.topics)
    assert archive.metadata["run"]["seed"] == "7" and archive.time("craft.state")[-1] == 60


def test_a_late_run_says_so(here, tmp_path):
    (here / "world.py").write_text((here / "world.py").read_text()
                                   + "    w.at(1, lambda: __import__('time').sleep(0.05))\n")
    done = cli("run", "looker", "--for", "10s", "--pace", "1000", cwd=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    assert re.search(r"  pace     \d+ of 11 instants were late, by up to \d+\.\d ms", done.stdout)


@pytest.mark.parametrize(
    "arguments, text",
    [
        (["run", "loker"], "fledge: there is no mission 'loker'; did you mean 'looker'? there are looker, "),
        (["run", "looker", "obrit"], "looker has no scenario 'obrit'; did you mean 'orbit'? it has orbit, helper, "
         "failing"),
        (["run", "looker", "--for", "soon"], "--for: expected a duration such as 90s, 10min or 2h; found 'soon'"),
        (["run", "looker", "--for", "1e400"], "--for: expected at most 1e9 s, which are 31 years; found '1e400'"),
        (["plot", "nothing"], "fledge: there is no record 'nothing'; none has been made yet: ./fledge run MISSION"),
        (["flie"], "invalid choice: 'flie' (choose from list, run, "),
        (["bench", "nothing"], "there is no bench 'nothing'; there are"),
        (["run", "looker", "--seed", "-1"], "fledge: seed: expected a whole number from 0 to 2^64 - 1; found -1"),
        (["run", "looker", "--pace", "-1"], "argument --pace: expected a number >= 0; found '-1'"),
        (["run", "looker", "--out", "missions/looker/flight.py"],
         "fledge: missions/looker/flight.py: it is a file; give a folder"),
        (["convert", "x"], "one of the arguments --csv --hdf5 --mat --oem --aem --stk --spk --about is required"),
    ],
)
def test_wrong_commands(here, tmp_path, arguments, text):
    done = cli(*arguments, cwd=tmp_path)
    assert done.returncode == 2 and text in done.stderr and "Traceback" not in done.stderr


def test_a_file_that_is_no_archive(here, tmp_path):
    (tmp_path / "bad.mcap").write_text("hello, this is not it")
    done = cli("plot", "bad.mcap", cwd=tmp_path)
    assert done.returncode == 2 and "fledge: bad.mcap: not an MCAP file" in done.stderr


@pytest.mark.long("a dozen commands")
def test_list_plot_and_convert(here, tmp_path):
    shown = cli("list", "--ports", cwd=tmp_path).stdout
    for part in ("looker A body that looks down.", " orbit Once around.", "MrpFeedback Track a",
                 ">> reference AttReference", "Spacecraft A rigid body, the hub", "world.MARS"):
        assert part in re.sub(" +", " ", shown)
    assert cli("run", "looker", "--no-plots", cwd=tmp_path).returncode == 0
    folder = tmp_path / "runs" / "looker" / "orbit"
    assert cli("plot", "looker", "sigma_RN", cwd=tmp_path).stdout == "runs/looker/orbit/sigma_RN.png\n"
    assert cli("plot", folder / "run.mcap", "--out", "plots", cwd=tmp_path).returncode == 0
    assert {p.name for p in (tmp_path / "plots").iterdir()} == {
        "flight.guidance.reference.png", "world.craft.state.png"}   # the state, for the view, though none records it
    assert cli("convert", "looker", "--csv", "--out", "csv", cwd=tmp_path).returncode == 0
    table = (tmp_path / "csv" / "flight.guidance.reference.csv").read_text().split("\n")
    assert table[0].startswith("time [s],sigma_RN[0]") and len(table) == 15
    for name in ("run", "list", "plot", "convert", "bench"):
        text = cli(name, "--help", cwd=tmp_path).stdout
        assert f"example: ./fledge {name}" in text


@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="a promise of the release build")
def test_starting_is_quick_and_small():
    """A run of nadir_spin imports nothing that it does not use, which would be most of the time; 40 MB are enough."""
    late = ("ast", "ctypes", "dataclasses", "dis", "hashlib", "inspect", "json", "linecache", "matplotlib", "numpy",
            "pandas", "pickle", "pint", "subprocess", "textwrap", "tokenize", "traceback", "fledge.commands",
            "fledge.frames", "fledge.mission.commands", "fledge.mission.provenance", "introspect.model")
    code = ("import sys; before = set(sys.modules); import fledge\n"
            "sim = fledge.load('nadir_spin'); sim.reset(); sim.run(1)\n"
            # Not getrusage, whose peak includes the parent's before exec.
            "peak = [line for line in open('/proc/self/status') if line.startswith('VmHWM')][0].split()[1]\n"
            f"print(int(peak) / 1024, *(set(sys.modules) - before).intersection({late}))")
    peak, *found = subprocess.run([sys.executable, "-c", code], text=True, capture_output=True, check=True,
                                  env=ENVIRONMENT).stdout.split()
    assert not found and float(peak) < 40


def test_import_alone_loads_nothing_else():
    code = "import fledge, sys; print(*[m in sys.modules for m in ('numpy', '_core', 'fledge.units')])"
    out = subprocess.run([sys.executable, "-c", code], text=True, capture_output=True, check=True,
                         env=ENVIRONMENT).stdout
    assert out == "False False False\n"


def test_a_text_is_no_parameter_whose_default_is_a_number():
    with pytest.raises(fledge.SetupError, match="constellation: its parameter spacecraft is a number, as 4; found the "
                                                "text '3 of them'"):
        fledge.load("constellation", spacecraft="3 of them")
