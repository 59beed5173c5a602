# SPDX-License-Identifier: Apache-2.0
"""`fledge falsify` on missions: it finds what fails, and the scenario that it writes fails by the same margin."""

import json
import math
import re
import shutil

import numpy as np
import pytest
from scipy.stats import norm

import fledge
from fledge import cli, folders
from fledge.errors import SetupError
from fledge.falsify import Flights, probability, scenario, search
from fledge.montecarlo import Campaign, Chosen
from fledge.montecarlo.shares import Range, Runs
from fledge.units import deg, kg, km, m, s

REQUIREMENTS = """
from fledge.requirements import always, eventually, implies, after
from fledge.units import deg, s

def rates(r):
    r.every = 1 * s
    rate = r.signal("world.craft.state.omega_BN_B")
    r.require("R-1", "It turns slowly.", always(rate[0] < 3.5 * deg / s))
    r.require("R-4", "It never turns fast.", always(rate[0] < 4.9 * deg / s))
    r.require("R-2", "It is known.", method="analysis", evidence="x.md")
    r.require("R-3", "It is slow.", always(implies(after(1 * s), rate[0] < 9 * deg / s)), shown_by="still")
"""
DISPERSIONS = """
from fledge.units import deg, kg, km, m, s

def tumbles(d):
    d.duration = 2 * s
    d.every    = 0.5 * s
    d["world.craft.omega_BN_B"] = d.normal(0, 1 * deg / s)
    d["world.craft.I_B"]        = d.nominal + d.normal(0, 1 * kg * m**2)
    d.orbit("world.craft", altitude=d.nominal + d.normal(0, 2 * km))
    d.fault("world.gyro", kind="BIAS", size=d.uniform(0 * deg / s, 1 * deg / s))

def constant(d):
    d.duration = 2 * s
    d["world.craft.omega_BN_B"] = d.choice(1 * deg / s)
"""
SCENARIOS = """
from fledge.units import s

def still(sim):
    sim.world.craft.omega_BN_B = [0, 0, 0.01]
    sim.record(sim.world.craft.state)
    sim.run(3 * s)

def steps(sim):
    sim.step()
"""


@pytest.fixture
def tumbler(tmp_path):
    folder = tmp_path / "tumbler"
    shutil.copytree(folders.missions()["sun_safe"], folder, ignore=shutil.ignore_patterns("__pycache__", "*_test.py"))
    for name, text in (("requirements", REQUIREMENTS), ("dispersions", DISPERSIONS), ("scenarios", SCENARIOS)):
        (folder / f"{name}.py").write_text(text)
    return folder


def flown(folder, text, requirement):
    """The margin of the requirement in the scenario of a regression test, in a mission that has its text."""
    name = re.search(r"def (\w+)\(sim\)", text)[1]
    file = folder / "scenarios.py"
    file.write_text(file.read_text() + text.partition('"""\n')[2])
    sim = fledge.load(str(folder))
    sim.plots = False
    with pytest.raises(AssertionError, match=requirement) as raised:
        sim.mission.scenarios[name](sim)
    return float(re.search(r"margin is (\S+)", str(raised.value))[1])


def test_it_finds_what_fails_and_repeats_it(tumbler):
    flights = Flights(tumbler, "R-1", seed=3)
    tried = search(flights, flights.space, 200, seed=3)
    least = tried.margins[tried.best]
    assert least == pytest.approx(math.radians(3.5) - max(tried.values[:, 0]), rel=0.01) and least < 0
    found = flights.smallest(tried.values[tried.best], least)
    assert found.kept == ["world.craft.omega_BN_B[0]"] and found.margin < 0
    text = scenario(flights, found, "by hand")
    assert "faults" not in text and "r_BN_N" not in text and text.count("omega_BN_B") == 1
    assert flown(tumbler, text, "R-1") == pytest.approx(found.margin, abs=1e-12)


def test_a_scenario_repeats_faults_orbits_and_inertias(tumbler):
    flights = Flights(tumbler, "R-1", scenario="still")
    assert flights.duration == 3
    values = dict(zip(flights.space.columns, flights.space.values(np.full((1, flights.space.n), 0.9))[0]))
    values["world.craft.omega_BN_B[0]"] = math.radians(5)
    margin = float(flights.fly({path: [x] for path, x in values.items()})[0])
    kept = [*(path for path in values if "faults" not in path), *flights.faults]
    from fledge.falsify import Counterexample
    text = scenario(flights, Counterexample({**values, **flights.kinds}, kept, [], margin), "by hand")
    assert '"kind": "BIAS"' in text and "I_B[1, 0]" in text and 'chosen(sim, "still")' in text
    assert flown(tumbler, text, "R-1") == pytest.approx(margin, abs=1e-12)
    sim = flights.simulation(values)
    again = fledge.load(str(tumbler))
    again.plots = False
    with pytest.raises(AssertionError):
        again.mission.scenarios["keeps_r_1"](again)
    assert list(again.world.craft.r_BN_N) == list(sim.world.craft.r_BN_N)
    assert np.array_equal(again.world.craft.I_B, sim.world.craft.I_B) and sim.seed == again.seed
    assert repr(again.world.gyro.faults) == repr(sim.world.gyro.faults)


def test_a_scenario_repeats_commands(tumbler):
    """A gain that is wrong while the first command counts, and before the second one mends it."""
    (tumbler / "requirements.py").write_text("""
from fledge.requirements import always

def gains(r):
    r.require("R-1", "It turns little.", always(r.signal("flight.control.torque.torque_B").norm() < 20))
""")
    (tumbler / "dispersions.py").write_text("""
from fledge.units import deg, s

def commanded(d):
    d.duration, d.every = 30 * s, 1 * s
    d["world.craft.omega_BN_B"] = d.normal(0, 0.01 * deg / s)
    wrong = d.packets.write("flight.control", P=[[5e4, 0, 0], [0, 5e4, 0], [0, 0, 5e4]])
    d.command(d.choice(None, d.packets.noop(), wrong), at=d.uniform(5 * s, 20 * s))
    d.command(d.choice(None, d.packets.noop()), at=d.uniform(5 * s, 20 * s))
""")
    flights = Flights(tumbler, "R-1", seed=3)
    tried = search(flights, flights.space, 100, seed=3)
    found = flights.smallest(tried.values[tried.best], tried.margins[tried.best])
    assert "flight.commands[0]" in found.kept and "flight.commands[1]" in found.removed
    text = scenario(flights, found, "by hand")
    assert text.count("bytes.fromhex") == 1 and "# write flight.control.P" in text
    assert flown(tumbler, text, "R-1") == pytest.approx(found.margin, abs=1e-12)


@pytest.mark.long("many draws")
def test_its_probability_is_that_of_the_draws(tumbler):
    flights = Flights(tumbler, "R-4", seed=1)
    found = probability(flights.repetition, flights.space, 300, 4, seed=1)
    p = norm.sf(4.9)
    assert found.low < p < found.high < 10 * p and found.runs < 0.01 / p and flights.flown == found.runs


@pytest.mark.parametrize("arguments, message", [
    (["R-9"], "there is no requirement 'R-9'.* there are R-1, R-4, R-2, R-3"),
    (["R-2"], "R-2 is shown by analysis, and has no formula"),
    (["R-1", "--campaign", "tumble"], "has no campaign 'tumble'; did you mean 'tumbles'. it has tumbles, constant"),
    (["R-1", "--campaign", "constant"], "there is nothing to search: each of world.craft.omega_BN_B.* one value alone"),
    (["R-1", "--scenario", "stil"], "has no scenario 'stil'; did you mean 'still'. it has still, steps"),
    (["R-1", "--scenario", "steps"], "the scenario steps begins with no run of a duration"),
    (["R-1", "--runs", "3"], "--runs must be >= 20, found 3"),
    (["R-1", "--probability", "--first"], "give --probability or --first; not both"),
])
def test_bad_input_is_named_before_the_first_run(tumbler, arguments, message, capsys, monkeypatch):
    monkeypatch.setattr(Chosen, "fly", lambda *_, **__: pytest.fail("it has flown"))
    assert cli.main(["falsify", str(tumbler), *arguments]) == 2
    assert re.search(message, capsys.readouterr().err)


def test_a_mission_without_requirements_is_reported(tumbler, capsys):
    (tumbler / "requirements.py").unlink()
    assert cli.main(["falsify", str(tumbler), "R-1"]) == 2
    assert "the mission tumbler declares no requirements; expected them in" in capsys.readouterr().err


def test_the_command_prints_the_search(tumbler, tmp_path, capsys):
    arguments = ["falsify", str(tumbler), "R-1", "--runs", "150", "--seed", "2", "--out", str(tmp_path / "out")]
    assert cli.main(arguments) == 1
    out = capsys.readouterr().out
    facts = json.loads((tmp_path / "out/searched.json").read_text())
    assert facts["runs"] == 150 and facts["smallest"]["kept"] == ["world.craft.omega_BN_B[0]"] and facts["least"] < 0
    assert facts["command"].endswith("--out " + str(tmp_path / "out")) and facts["errors"] == facts["unknown"] == 0
    assert "world.craft.orbit.altitude: " in out and "VIOLATED" in out and "keeps_r_1.py" in out
    compile((tmp_path / "out/keeps_r_1.py").read_text(), "keeps_r_1.py", "exec")
    assert cli.main([*arguments, "--json"]) == 1
    assert {**json.loads(capsys.readouterr().out), "command": facts["command"]} == facts
    assert cli.main(["falsify", str(tumbler), "R-1", "--probability", "--runs", "40", "--repetitions", "2", "--out",
                     str(tmp_path / "out")]) == 0
    assert "violated  with the probability" in capsys.readouterr().out


def test_what_holds_ends_well(tumbler, tmp_path, capsys):
    assert cli.main(["falsify", str(tumbler), "R-3", "--runs", "60", "--out", str(tmp_path)]) == 0
    assert "holds     in all runs that were flown" in capsys.readouterr().out and not list(tmp_path.glob("keeps*"))


# --- chosen runs -----------------------------------------------------------------------------------

def spread(d):
    d.duration = 2 * s
    d["world.craft.sigma_BN"] = d.attitude()
    d["world.craft.I_B"] = d.nominal + d.normal(0, 3 * kg * m**2)
    d["flight.line.persistence"] = d.uniform(50, 60)
    d.orbit("world.craft", altitude=d.nominal + d.normal(0, 2 * km), i=d.uniform(50 * deg, 52 * deg))
    d.fault("world.gyro", kind=d.choice("NONE", "BIAS"), size=d.uniform(0 * deg / s, 1 * deg / s))
    d.retain("world.craft.state.r_BN_N", "world.craft.state.omega_BN_B", "world.craft.state.sigma_BN")


@pytest.mark.parametrize("processes", [False, True])
def test_chosen_runs_fly_as_drawn_ones(processes):
    drawn = Campaign("sun_safe", spread).fly(6, seed=4)
    campaign = Chosen("sun_safe", spread)
    campaign.choose({path: values.tolist() for path, values in drawn.draws.items()})
    chosen = campaign.fly(6, seed=9, processes=processes)
    assert not chosen.errors and {path: chosen.draws[path].tolist() for path in drawn.draws} == \
        {path: values.tolist() for path, values in drawn.draws.items()}
    # The noise of sensors differs with the seed; it reaches the motion through the wheels.
    for path, tolerance in (("world.craft.state.r_BN_N", 1e-9), ("world.craft.state.sigma_BN", 1e-4)):
        assert chosen.retained[path] == pytest.approx(drawn.retained[path], rel=tolerance, abs=tolerance)


def test_another_program_flies_chosen_runs_by_their_recipe():
    campaign = Chosen("sun_safe", spread)
    campaign.choose({"world.craft.I_B[0, 0]": [90.0, 100.0, 110.0]})
    make, arguments = Runs(campaign, 9).recipe
    share, whole = make(*arguments).fly(Range(1, 3, campaign.values)), campaign.fly(3, seed=9)
    assert share.first == 1 and share.draws.tolist() == [[100.0], [110.0]]
    for values, path in zip(share.retained, whole.retained, strict=True):
        assert values.tobytes() == whole.retained[path][1:].tobytes()


def test_a_number_that_its_parameter_cannot_have_is_one_run_without_a_margin(tumbler):
    flights = Flights(tumbler, "R-1")
    values = np.tile(flights.space.nominal, (5, 1))
    values[3, flights.space.columns.index("world.craft.I_B[0, 0]")] = -1.0
    margins = flights(values)
    assert np.isnan(margins).tolist() == [False, False, False, True, False] and len(flights.errors) == 1
    assert "I_B" in flights.errors[0] and flights.flown == 5 and flights.unknown == 0


def test_of_a_repetition_the_random_streams_differ(tumbler):
    flights = Flights("sun_safe", "SUN-3", "tumbles")
    values = np.tile(flights.space.nominal, (2, 1))
    first, second = flights.repetition(values, 0), flights.repetition(values, 1)
    assert first[0] == first[1] != second[0] == second[1]


def test_an_unknown_scenario_is_an_error_in_python(tumbler):
    with pytest.raises(SetupError, match="no scenario"):
        Flights(tumbler, "R-1", scenario="none")
