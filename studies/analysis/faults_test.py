# SPDX-License-Identifier: Apache-2.0
"""The faults of a mission, flown from the middle of a scenario, have the effects that whole flights with them have."""
import csv
import json
import re
import shutil

import numpy as np
import pytest

import fledge
from fledge import attitude, cli
from fledge.analysis.faults import fly
from fledge.analysis.matrix import Fault, Matrix
from fledge.analysis.page import EFFECTS
from fledge.targets import build
from fledge.units import deg, minute, s

REQUIREMENTS = '''# SPDX-License-Identifier: Apache-2.0
"""What the safe mode must do."""
from fledge.requirements import after, always, angle, implies, turned
from fledge.units import deg, minute


def sun(r):
    """The Sun."""
    sun_B = turned(r.signal("world.craft.state.sigma_BN"), r.signal("world.light.light.s_N"))
    off = angle(sun_B, [1, 0, 0])
    r.require("SUN-1", "The panels face the Sun.", always(implies(after(4 * minute), off < 5 * deg)))
'''
SCENARIOS = '''# SPDX-License-Identifier: Apache-2.0
"""Short ones."""
from fledge.units import minute


def short(sim):
    """Ten minutes without a planned fault."""
    sim.world.adc_a.faults = []
    sim.run(3 * minute)
    sim.run(7 * minute)


def other(sim):
    """With checks of its own."""
    short(sim)
    assert sim.flight.sun.status.faulty == 0, "a converter is blamed"
'''


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    """sun_safe for ten minutes, with a requirement and without a faults.py."""
    folder = tmp_path_factory.mktemp("missions") / "short_safe"
    shutil.copytree(build.ROOT / "missions/sun_safe", folder, ignore=shutil.ignore_patterns("*_test.py", "faults.py"))
    (folder / "requirements.py").write_text(REQUIREMENTS)
    (folder / "scenarios.py").write_text(SCENARIOS)
    return folder


@pytest.fixture(scope="module")
def without(mission):
    """The same without requirements."""
    folder = shutil.copytree(mission, mission.parent / "unrequired")
    (folder / "requirements.py").unlink()
    return folder


def whole(mission, unit, begin, **fault):
    """The simulation after the scenario, with a fault that was planned from its start on."""
    sim = fledge.load(mission)
    sim.plots = False
    getattr(sim.world, unit).faults = [{"begin": begin, **fault}]
    sim.scenarios["short"]()
    return sim


def test_a_child_flies_what_a_planned_fault_flies(mission):
    """A fault of which delays and drop-outs need the past, one with a random stream, and a plain one."""
    faults = [Fault("world.gyro", "DELAY", {"size": 4.0}), Fault("world.gyro", "BABBLE", {"size": 0.02}),
              Fault("world.gyro", "DROPOUT"), Fault("world.gyro", "BIAS", {"size": 0.01, "channels": 0b100})]
    flights = fly(Matrix(mission), ["short"], faults, begin=[5 * minute], jobs=2)
    undisturbed = whole(mission, "gyro", 5 * minute, kind="NONE").world.craft.state.sigma_BN
    for fault, flight in zip(faults, flights, strict=True):
        sim = whole(mission, "gyro", 5 * minute, kind=fault.kind, **fault.fields)
        off = attitude.angle(attitude.relative(np.array(sim.world.craft.state.sigma_BN), np.array(undisturbed)))
        assert flight.faults == [fault] and flight.off_end == pytest.approx(np.degrees(off), rel=1e-12)
        assert flight.off_end > 0 and flight.effect != "none"


def test_nothing_follows_from_a_fault_of_no_size(mission):
    """Neither the fork nor the fault's presence changes a bit."""
    flight, = fly(Matrix(mission), ["short"], [Fault("world.gyro", "BIAS", {"size": 0.0})], begin=[100 * s])
    assert (flight.effect, flight.detected, flight.back, flight.off) == ("none", None, 0.0, 0.0)


def test_a_converter_is_isolated_as_itself(mission):
    """As sun_safe_test.py finds: after twenty updates, the first of them at the begin."""
    matrix = Matrix(mission)
    matrix.isolates("flight.sun.status.faulty", {"world.adc_a": 0b01, "world.adc_b": 0b10})
    faults = matrix.faults(["world.adc_a", "world.adc_b"], ["HIGH"])
    a, b, both = fly(matrix, faults=faults, double=True, begin=[200 * s])
    for flight, unit in ((a, "world.adc_a"), (b, "world.adc_b")):
        assert 9.5 <= flight.isolated < 25 and flight.as_ == unit and flight.wrongly == []
        assert flight.detected is not None and flight.detected <= flight.isolated
        assert flight.effect == "tolerated" and flight.back == 0.0
    assert both.faults == faults and both.isolated is None and both.detected is not None     # neither can be blamed
    matrix.isolating = {"flight.sun.status.faulty": {"world.adc_a": 0b10, "world.adc_b": 0b01}}
    a, = fly(matrix, faults=faults[:1], begin=[200 * s])
    assert a.isolated is None and a.wrongly == ["world.adc_b"]


def test_what_is_violated_and_when_it_holds_again(mission):
    """A gyro is wrong for a minute, or for ever: flight leaves the Sun, and finds it again."""
    matrix = Matrix(mission)
    fault = Fault("world.gyro", "BIAS", {"size": float(np.radians(1.5)), "channels": 0b100})
    long, short = [fly(matrix, faults=[fault], begin=[5 * minute], lasts=lasts)[0] for lasts in (0, 60 * s)]
    assert long.effect == short.effect == "violated" and list(long.violated) == ["SUN-1"] and long.back is None
    sim = fledge.load(mission)
    log = sim.record(sim.world.craft.state, sim.world.light.light, every=0.1 * s)
    sim.world.gyro.faults = [{"kind": "BIAS", "begin": 5 * minute, "lasts": 60 * s, **fault.fields}]
    sim.scenarios["short"]()
    b1 = attitude.mrp_to_dcm(log["state.sigma_BN"])[:, 0]
    off = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", b1, log["light.s_N"]), -1, 1)))
    assert 5 < off[log.time > 300].max() < 180 and off[-1] < 5
    assert short.back == pytest.approx(log.time[(off >= 5) & (log.time >= 300)].max() - 300, abs=0.15)
    assert short.violated["SUN-1"].startswith(f"{5 - off[log.time >= 240].max():.3g}"[:4])


def test_without_requirements_the_checks_of_the_scenario_decide(without):
    fault = Fault("world.adc_a", "HIGH")
    short, other = [fly(Matrix(without), [name], [fault], begin=[200 * s])[0] for name in ("short", "other")]
    assert short.effect == "unjudged" and short.text == ""     # it has neither a check
    assert other.effect == "violated" and other.text.endswith("a converter is blamed") and other.back is None


def test_the_command_writes_a_table(mission, tmp_path, capsys, monkeypatch):
    words = ["faults", str(mission), "--unit", "world.gyro", "--unit", "world.css", "--begin", "200s,5min", "--jobs",
             "2", "--out", str(tmp_path)]
    monkeypatch.setattr("fledge.progress.FIRST", 1e-3)
    assert cli.main(words) == 0
    output = capsys.readouterr().out
    assert re.search(r"\n  takes    about \d+ s for 32 flights, as those without a fault took; less with --for, ",
                     output)
    with (tmp_path / "faults.csv").open() as file:
        rows = list(csv.DictReader(file))
    page = (tmp_path / "report.html").read_text()
    flights = json.loads((tmp_path / "results.json").read_text())["flights"]
    assert len(rows) == len(flights) == page.count('<tr class="') == 2 * 2 * 8
    assert {(row["unit"], row["kind"], row["begin [s]"]) for row in rows} == {
        (unit, kind, begin) for unit in ("world.gyro", "world.css") for begin in ("200.0", "300.0")
        for kind in ("HIGH", "LOW", "BABBLE", "BIAS", "DRIFT", "DROPOUT", "DELAY", "DEAD")}
    assert {row["effect"] for row in rows} >= {"violated", "tolerated"}
    shown = re.findall(r'<tr class="(\w+)( hidden)?"', page)       # the worst in front
    assert shown == sorted(shown, key=lambda row: (not row[1], list(EFFECTS).index(row[0])))
    assert [effect for effect, _ in shown] != [row["effect"] for row in rows]
    for effect in ("violated", "tolerated"):
        assert f"{sum(row['effect'] == effect for row in rows)}" in output
    assert "http" not in page.replace("http-equiv", "") and str(mission.parent) not in page.partition("<main>")[0]


def test_a_limit_ends_each_flight(mission):
    """A limit before the violation leaves it out; a fault that begins after the limit is refused."""
    matrix, fault = Matrix(mission), Fault("world.gyro", "DEAD")
    calls = []
    short, = fly(matrix, faults=[fault], begin=[260 * s], limit=261 * s, progress=lambda *of: calls.append(of))
    whole, = fly(matrix, faults=[fault], begin=[260 * s])
    assert (short.effect, whole.effect) == ("tolerated", "violated") and 0 < short.off_end < whole.off_end
    assert calls[0][:2] == (0, 1) and 0 < calls[0][2] < 60 and calls[-1][:2] == (0, 1)
    with pytest.raises(fledge.SetupError, match="260 s is not within the scenario short, which flies 200 s"):
        fly(matrix, faults=[fault], begin=[260 * s], limit=200 * s)


@pytest.mark.parametrize("words, wrong", [
    (["--unit", "world.gyros"], "there is no unit 'world.gyros' that takes faults; did you mean 'world.gyro'?"),
    (["--kind", "DEATH"], "there is no kind of fault 'DEATH'; did you mean 'DEAD'?"),
    (["--scenario", "shot"], "has no scenario 'shot'; did you mean 'short'?"),
    (["--begin", "1h"], "3600 s is not within the scenario short, which flies 600 s"),
    (["--begin", "soon"], "--begin: expected a duration"),
    (["--jobs", "0"], "jobs must be >= 1")])
def test_wrong_words_are_refused(mission, tmp_path, capsys, words, wrong):
    assert cli.main(["faults", str(mission), "--out", str(tmp_path), *words]) == 2
    assert wrong in capsys.readouterr().err


@pytest.mark.parametrize("line, wrong", [
    ('m.fault("world.gyro", "BIAS", sise=1)', "sise"),
    ('m.fault("world.gyro", "WRONG")', "world.gyro has no fault of the kind 'WRONG'"),
    ('m.without("world.giro")', "did you mean 'world.gyro'?"),
    ('m.detects("world.craft.state.sigma_BN")', "world.craft.state.sigma_BN is no output of flight"),
    ('m.detects("flight.safe.error.sigma_BR")', "expected a whole number"),
    ('m.isolates("flight.sun.status.faulty", {"world.adc_a": 0})', "expected bits"),
    ('m.nominal("SUN-2")', "there is no requirement 'SUN-2'; did you mean 'SUN-1'?"),
    ('m.begins = 1', "did you mean 'begin'?")])
def test_a_wrong_line_of_the_mission_is_named(mission, tmp_path, capsys, line, wrong):
    folder = shutil.copytree(mission, tmp_path / "wrong")
    (folder / "faults.py").write_text(f"def matrix(m):\n    {line}\n")
    assert cli.main(["faults", str(folder), "--out", str(tmp_path / "out")]) == 2
    errors = capsys.readouterr().err
    assert wrong in errors and "faults.py, line 2" in errors


def test_no_fault_and_no_time_are_refused_not_taken_for_all(mission):
    matrix, fault = Matrix(mission), Fault("world.gyro", "DEAD")
    with pytest.raises(fledge.SetupError, match="^faults: expected at least one, found none; None stands for all$"):
        fly(matrix, faults=[], begin=[260 * s])
    with pytest.raises(fledge.SetupError, match="^begin: expected at least one time, found none; None stands for "):
        fly(matrix, faults=[fault], begin=[])
    matrix.begin = []
    with pytest.raises(fledge.SetupError, match="^begin: expected at least one time"):
        fly(matrix, faults=[fault])


def test_a_requirement_for_flights_without_a_fault_is_left_out(mission):
    matrix = Matrix(mission)
    matrix.nominal("SUN-1")
    fault = Fault("world.gyro", "DEAD")
    left, judged = [fly(each, faults=[fault], begin=[200 * s])[0] for each in (matrix, Matrix(mission))]
    assert (left.effect, judged.effect) == ("unjudged", "violated") and left.off == judged.off > 0


def test_a_fault_that_its_model_refuses_is_named(mission):
    with pytest.raises(fledge.SetupError, match=r"^world.gyro BIAS \(channels 8\): .*channels: there are 3"):
        fly(Matrix(mission), faults=[Fault("world.gyro", "BIAS", {"channels": 8})], begin=[200 * s])


def test_a_matrix_knows_all_units_of_a_mission():
    """Of the orbiter: its models without the panel of faults, and the units of flight's table that they are."""
    matrix = Matrix("mars_orbiter")
    assert {"world.gyro_a", "world.recorder", "world.wheels", "world.power"} <= set(matrix.units)
    assert not any(unit.startswith("panel.") for unit in matrix.units)
    assert {fault.kind for fault in matrix.faults(["world.recorder"])} == {"FLIP", "WEAR"}
    table, = matrix.isolating.values()
    assert matrix.named["flight.protection.table.faulted"][table["world.gyro_b"].bit_length() - 1] == "gyro b"
    assert table["world.angles_b"] == table["world.gyro_b"] != table["world.gyro_a"]
