# SPDX-License-Identifier: Apache-2.0
"""What a campaign declares: paths, units, distributions, requirements, and the messages of errors."""

import math
import re
from itertools import product

import numpy as np
import pytest

import fledge
from fledge import world
from fledge.attitude import mrp_to_dcm
from fledge.commands import Code
from fledge.montecarlo.dispersions import Dispersions
from fledge.montecarlo import Campaign, disperse
from fledge.units import N, deg, kg, km, m, s


@pytest.fixture
def d():
    simulation = fledge.load("nadir_spin")
    found = Dispersions(simulation)
    found.duration = 20 * s
    return found


def drawn(d, runs, seed=0, of=lambda: fledge.load("nadir_spin")):
    """(runs, columns) of draws, and the simulation with the last of them."""
    plan = d._finished()
    plan.seed = seed
    other = of()
    return np.array([disperse(d.simulation, other, plan, i) for i in range(runs)]), other


# --- errors before the first flight -----------------------------------------------------------------

@pytest.mark.parametrize("path, words", [
    ("craft.I_B", "'craft.I_B': expected process.instance.name, as in world.craft.I_B"),
    ("world.craft.I_B[a]", "expected process.instance.name"),
    ("space.craft.I_B", "space.craft.I_B: there is no process 'space'; there are world, flight"),
    ("world.carft.I_B", "the process world has no 'carft'; did you mean 'craft'?"),
    ("world.craft.I_b", "world.craft has no 'I_b'; did you mean 'I_B'? it has external, state, mass, center_B, I_B,"),
    ("world.craft.state", "world.craft.state is a whole message; name one of its fields: head, r_BN_N"),
    ("world.craft.state.sigma_BN", "is no parameter, and only these can be dispersed; world.craft has mass, center_B,"),
    ("world.craft.I_B[3, 0]", "world.craft.I_B has shape (3, 3); there is no element [3, 0]"),
    ("world.craft.mass[0]", "world.craft.mass is a single number; there is no element [0]"),
    ("world.wheels.J[4]", "world.wheels.J has shape (4,); there is no element [4]"),
    ("world.craft.mass.x", "world.craft.mass is a number or array, and has no 'x'"),
    ("world.wheels.n", "is how many rows of axes_B, J, u_max"),
])
def test_unknown_paths_are_answered(d, path, words):
    with pytest.raises(fledge.SetupError) as error:
        d[path] = d.normal(0, 1)
    assert words in str(error.value)


@pytest.mark.parametrize("path, draw, words", [
    ("world.craft.mass", lambda d: 3.0, "expected something drawn, such as d.normal(...)"),
    ("world.craft.mass", lambda d: d.uniform(1 * m, 2 * m), "expected a quantity in kg; found 1.0 m"),
    ("world.craft.mass", lambda d: d.nominal * d.uniform(0.9 * kg, 1.1 * kg), "expected a number without unit"),
    ("world.craft.sigma_BN", lambda d: d.normal(0, [1, 2]), "an array of shape (3,); found one of shape (2,)"),
    ("world.craft.mass", lambda d: d.uniform(-5 * kg, 5 * kg), "must be >= 0 kg, found -5 kg, of draws between"),
    ("world.wheels.J", lambda d: d.nominal * d.uniform(-1, 1), "world.wheels.J must be > 0 kg m^2"),
    ("world.craft.mass", lambda d: d.uniform(5 * kg, 4 * kg), "the lower bound is above the upper one"),
    ("world.craft.mass", lambda d: d.normal(1 * kg, -1 * kg), "a standard deviation must be >= 0, found -1"),
    ("world.craft.mass", lambda d: d.normal(1, 1, low=3, high=2), "never falls between 3 and 2"),
    ("world.craft.mass", lambda d: d.normal(float("nan"), 1), "a distribution needs finite numbers"),
    ("world.craft.mass", lambda d: d.attitude(), "a random attitude needs the three elements of an MRP"),
    ("world.wheels.friction", lambda d: d.nominal * d.uniform(0.5, 2), "nominal value is 0, which no factor changes"),
    ("world.craft.mass", lambda d: d.nominal + d.attitude(), "cannot be joined with the nominal value"),
    ("world.craft.mass", lambda d: d.nominal + (d.nominal * d.uniform(1, 2)), "twice"),
    ("world.craft.mass", lambda d: d.nominal + 3 * kg, "expected something drawn, as in d.nominal + d.normal("),
])
def test_impossible_draws_are_refused(d, path, draw, words):
    with pytest.raises(fledge.SetupError) as error:
        d[path] = draw(d)
    assert words in str(error.value) and (path in str(error.value) or "nominal" in str(error.value))


def test_nothing_is_dispersed_twice(d):
    d["world.craft.I_B[0, 1]"] = d.normal(0, 1)
    for path in ("world.craft.I_B[0, 1]", "world.craft.I_B[1, 0]", "world.craft.I_B", "world.craft.I_B[1]"):
        with pytest.raises(fledge.SetupError, match="is dispersed twice"):
            d[path] = d.normal(0, 1)


def test_what_is_retained_and_checked_must_be_there(d):
    with pytest.raises(fledge.SetupError, match="no field of an input or output.*world.craft has external, state"):
        d.retain("world.craft.mass")
    with pytest.raises(fledge.SetupError, match="has no 'sigma_BN'; did you mean 'sigma_BR'"):
        d.retain("flight.tracking.error.sigma_BN")
    error = d.retain("flight.tracking.error.sigma_BR")
    with pytest.raises(fledge.SetupError, match=r"has shape \(3,\): compare an element, norm\(\) or max_abs\(\)"):
        d.check(error < 1)
    with pytest.raises(fledge.SetupError, match="expected a comparison"):
        d.check(error.norm())
    with pytest.raises(fledge.SetupError, match="norm.*expected a number without unit; found 1.0 m"):
        d.check(error.norm() < 1 * m)
    with pytest.raises(fledge.SetupError, match=r"after\(30 s\) is not within the run"):
        error.norm().after(30 * s)
    with pytest.raises(TypeError, match="only known when the campaign has flown"):
        bool(error.norm() < 1)


def test_a_campaign_without_its_essentials(d):
    with pytest.raises(fledge.SetupError, match="nothing is dispersed"):
        d._finished()
    d["world.craft.mass"] = d.uniform(1, 2)
    d._duration = None
    with pytest.raises(fledge.SetupError, match="d.duration is not given"):
        d._finished()
    d.duration, d.every = 10 * s, 4 * s
    speed = d.retain("flight.tracking.error.omega_BR_B")
    d.check(speed.norm().after(9 * s) < 1 * deg / s)
    with pytest.raises(fledge.SetupError, match="there is no sample in that time, with one every 4 s for 10 s"):
        d._finished()
    for bad in (0 * s, -1 * s, 3 * m):
        with pytest.raises(fledge.SetupError, match="d.every"):
            d.every = bad


def test_errors_name_file_and_line(tmp_path):
    mission(tmp_path, "def release(d):\n    d.duration = 10\n    d['world.craft.mas'] = d.uniform(1, 2)\n")
    with pytest.raises(fledge.SetupError) as error:
        Campaign(tmp_path)
    assert "dispersions.py, line 3: world.craft.mas: world.craft has no 'mas'; did you mean 'mass'?" in str(error.value)


def test_campaigns_by_name(tmp_path):
    text = ("from fledge.units import kg\nfrom .flight import fsw\ndef _both(d):\n    d.duration = 10\n"
            "def heavy(d):\n    'Heavy ones.'\n    _both(d)\n    d['world.craft.mass'] = d.uniform(1 * kg, 2 * kg)\n"
            "def light(d):\n    _both(d)\n    d['world.craft.mass'] = d.uniform(0, 1)\n")
    mission(tmp_path, text)
    assert Campaign(tmp_path).name == "heavy" and Campaign(tmp_path).summary == "Heavy ones."
    assert Campaign(tmp_path, "light").name == "light"
    with pytest.raises(fledge.SetupError, match="has no campaign 'heave'; did you mean 'heavy'. it has heavy, light"):
        Campaign(tmp_path, "heave")
    mission(tmp_path, "x = 1\n")
    with pytest.raises(fledge.SetupError, match="expected a function that takes d"):
        Campaign(tmp_path)
    (tmp_path / "dispersions.py").unlink()
    with pytest.raises(fledge.SetupError, match="declares no dispersions"):
        Campaign(tmp_path)


def mission(folder, dispersions, world=""):
    """A copy of nadir_spin with dispersions of its own, and something more at the end of its build(w, f)."""
    home = fledge.mission.find("nadir_spin").folder
    for name in ("flight.py", "world.py"):
        (folder / name).write_text((home / name).read_text() + (world if name == "world.py" else ""))
    (folder / "dispersions.py").write_text(dispersions)


# --- draws -----------------------------------------------------------------------------------------

def test_draws_are_about_the_nominal_values(d):
    d["world.craft.I_B[0, 0]"] = d.nominal + d.normal(0, 10 * kg * m**2)
    d["world.wheels.J"] = d.uniform(0.9, 1.1) * d.nominal
    d["world.craft.omega_BN_B"] = d.normal([0, 0, 1] * deg / s, [0.1, 0.2, 0] * deg / s, low=[-0.1, -9, 0] * deg / s)
    d["world.craft.mass"] = d.uniform(100 * kg, 200 * kg)
    draws, other = drawn(d, 2000)
    assert list(d.columns) == ["world.craft.I_B[0, 0]", *(f"world.wheels.J[{i}]" for i in range(4)),
                               *(f"world.craft.omega_BN_B[{i}]" for i in range(3)), "world.craft.mass"]
    error = 4 / np.sqrt(2000)
    assert abs(draws[:, 0].mean() - 700) < 10 * error and abs(draws[:, 0].std() / 10 - 1) < error
    factors = draws[:, 1:5] / d.simulation.world.wheels.J
    assert factors.min() >= 0.9 and factors.max() <= 1.1 and np.all(abs(factors.mean(axis=0) - 1) < 0.058 * error)
    rates = np.rad2deg(draws[:, 5:8])
    assert rates[:, 0].min() >= -0.1 and rates[:, 0].max() > 0.25 and abs(rates[:, 1].std() / 0.2 - 1) < error
    assert np.all(draws[:, 7] == (1 * deg).value)
    assert 100 <= draws[:, 8].min() < 101 and 199 < draws[:, 8].max() <= 200
    # They are where they belong, and nothing else was touched.
    assert other.world.craft.mass == draws[-1, 8] and list(other.world.wheels.J) == list(draws[-1, 1:5])
    assert other.world.craft.I_B[1, 1] == 700 and list(other.flight.wheels.J) == list(d.simulation.flight.wheels.J)


def test_any_attitude_is_as_likely(d):
    d["world.craft.sigma_BN"] = d.attitude()
    draws, _ = drawn(d, 4000)
    assert np.linalg.norm(draws, axis=1).max() <= 1
    # Each direction of each body axis is as likely: mean 0 and, on the sphere, mean square 1/3.
    dcm = mrp_to_dcm(draws)
    assert abs(dcm.mean(axis=0)).max() < 4 / np.sqrt(3 * 4000)
    assert abs((dcm**2).mean(axis=0) - 1 / 3).max() < 4 * np.sqrt(4 / 45 / 4000)


def test_each_element_has_a_stream_of_its_own(d):
    d["world.craft.I_B[0, 0]"] = d.normal(700, 10)
    d["world.craft.I_B[1, 1]"] = d.normal(700, 10)
    d["world.wheels.J[2]"] = d.uniform(1, 2)
    few, _ = drawn(d, 50)
    assert not (few[:, 0] == few[:, 1]).any()
    more = Dispersions(fledge.load("nadir_spin"))
    more.duration = 20 * s
    more["world.craft.mass"] = more.uniform(1, 2)
    more["world.wheels.J"] = more.uniform(1, 2)
    more["world.craft.I_B"] = more.normal([[700, 0, 0], [0, 700, 0], [0, 0, 800]], 10)
    many, other = drawn(more, 50)
    columns = list(more.columns)
    for i, path in enumerate(d.columns):
        assert (few[:, i] == many[:, columns.index(path)]).all(), path
    assert not (drawn(d, 50, seed=1)[0] == few).any()
    assert (other.world.craft.I_B == other.world.craft.I_B.T).all() and other.world.craft.I_B[0, 1] != 0


def test_inertias_of_several_parts_stay_symmetric_each_by_itself():
    def with_panels():
        sim = fledge.load("nadir_spin")
        sim.world.panels = world.HingedPanels(mass=[2, 3], I_B=[np.diag([4, 5, 6])] * 2, hinge_B=[[1, 0, 0]] * 2,
                                              axes_B=[[0, 1, 0]] * 2)
        return sim

    d = Dispersions(with_panels())
    d.duration = 20 * s
    d["world.panels.I_B[1, 0, 1]"] = d.uniform(0.1, 0.2)
    with pytest.raises(fledge.SetupError, match="is dispersed twice"):
        d["world.panels.I_B[1, 1, 0]"] = d.normal(0, 1)
    _, other = drawn(d, 1, of=with_panels)
    assert (other.world.panels.I_B[0] == np.diag([4, 5, 6])).all()
    assert 0.1 < other.world.panels.I_B[1, 0, 1] == other.world.panels.I_B[1, 1, 0] < 0.2

    d = Dispersions(with_panels())
    d.duration = 20 * s
    d["world.panels.I_B"] = d.nominal + d.uniform(0.1, 0.2)
    assert len(d.columns) == 12
    _, other = drawn(d, 1, of=with_panels)
    I_B = other.world.panels.I_B - np.diag([4, 5, 6])
    assert (I_B > 0.1 - 1e-9).all() and (I_B == I_B.transpose(0, 2, 1)).all() and len(set(I_B.ravel())) == 12


# --- orbits and faults -------------------------------------------------------------------------------

def orbiter(folder, orbit="Orbit(world.EARTH, a=7000e3, e=0.01, i=1, Omega=2, omega=3, f=0.5)", more=""):
    (folder / "mission.py").write_text(f'''
"""A body in an orbit, and its gyro."""
from fledge import Orbit, world


def build(sim):
    w = sim.add_world("world")
    w.craft = world.Spacecraft(I_B=10, gravity=[world.EARTH], orbit={orbit})
    w.gyro = world.Gyro()
    {more}
    w.connect(w.craft.state >> w.gyro.truth)
    w.task("all", every=1, run=[w.craft, w.gyro])
''')
    return folder


def elements_of(mu, r, v):
    """a, e, i, Omega, omega, f by the vectors of angular momentum, node and eccentricity."""
    h = np.cross(r, v)
    node = np.cross([0, 0, 1], h)
    e = np.cross(v, h) / mu - r / np.linalg.norm(r)

    def angle(a, b):    # from a to b about h
        return np.arctan2(np.dot(np.cross(a, b), h) / np.linalg.norm(h), np.dot(a, b)) % (2 * np.pi)

    return (1 / (2 / np.linalg.norm(r) - np.dot(v, v) / mu), np.linalg.norm(e), np.arccos(h[2] / np.linalg.norm(h)),
            np.arctan2(node[1], node[0]) % (2 * np.pi), angle(node, e), angle(e, r))


def test_the_drawn_elements_are_those_of_the_drawn_states(tmp_path):
    def orbits(d):
        d.duration, d.every = 2, 1
        d.orbit("world.craft", a=d.nominal + d.normal(0, 20 * km), e=d.nominal * d.uniform(0.5, 2),
                i=d.uniform(10 * deg, 170 * deg), Omega=d.uniform(0, 360 * deg), omega=d.choice(1, 2), f=d.nominal +
                d.normal(0, 0.1))
        d.retain("world.craft.state.r_BN_N", "world.craft.state.v_BN_N")

    campaign = Campaign(orbiter(tmp_path), orbits)
    result = campaign.fly(300, seed=4, threads=2)
    assert not result.failures
    names = ["a", "e", "i", "Omega", "omega", "f"]
    assert list(result.draws) == [f"world.craft.orbit.{name}" for name in names]
    assert [campaign.dispersions.columns[path] for path in result.draws] == ["m", "", "rad", "rad", "rad", "rad"]
    r, v = (result.retained[f"world.craft.state.{name}"][:, 0] for name in ("r_BN_N", "v_BN_N"))
    drawn = np.array([result.draws[f"world.craft.orbit.{name}"] for name in names]).T
    for run in range(300):
        found = np.array(elements_of(world.EARTH.mu, r[run], v[run]))
        assert np.abs(found / drawn[run] - 1).max() < 1e-9, run
    error = 4 / np.sqrt(300)
    assert abs(drawn[:, 0].mean() - 7000e3) < 20e3 * error and abs(drawn[:, 0].std() / 20e3 - 1) < error
    assert 0.005 <= drawn[:, 1].min() < 0.0052 and 0.0197 < drawn[:, 1].max() <= 0.02
    assert set(drawn[:, 4]) == {1, 2}
    sim = campaign.simulation(17, seed=4)
    assert list(campaign.drawn(sim).values()) == drawn[17].tolist()
    assert (sim.world.craft.r_BN_N == r[17]).all()
    assert list(campaign.drawn(campaign.nominal).values()) == pytest.approx([7000e3, 0.01, 1, 2, 3, 0.5], rel=1e-12)


@pytest.mark.parametrize("orbit, drawn, p, e", [
    ("Orbit(world.EARTH, altitude=500e3)", {"altitude": 600e3}, 6978136.3, 0),
    ("Orbit(world.EARTH, a=8000e3, e=0.1)", {"altitude": 600e3}, 6978136.3 * 1.1, 0.1),
    ("Orbit(world.EARTH, a=8000e3, e=0.1)", {"rp": 7000e3}, 7000e3 * (1 + 18 / 158), 18 / 158),
    ("Orbit(world.EARTH, a=8000e3, e=0.1)", {"rp": 7000e3, "e": 0.2}, 8400e3, 0.2),
    ("Orbit(world.EARTH, a=8000e3, e=0.1)", {"e": 0.2}, 8000e3 * 0.96, 0.2),
    ("Orbit(world.EARTH, a=8000e3, e=0.1)", {"p": 9000e3}, 9000e3, 0.1),
])
def test_the_mission_gives_the_elements_that_are_not_drawn(tmp_path, orbit, drawn, p, e):
    d = Dispersions(fledge.load(orbiter(tmp_path, orbit)))
    d.duration = 1 * s
    d.orbit("world.craft", **{name: d.choice(value) for name, value in drawn.items()})
    sim = fledge.load(tmp_path)
    disperse(d.simulation, sim, d._finished(), 0)
    found = sim.process("world").craft.orbit
    assert abs(found.p / p - 1) < 1e-12 and abs(found.e - e) < 1e-12


@pytest.mark.parametrize("path, elements, words", [
    ("world.carft", {"a": 1}, "there is no such spacecraft; did you mean 'world.craft'? there is world.craft"),
    ("world.gyro", {"a": 1}, "it is no spacecraft but Gyro; there are world.craft"),
    ("world.craft", {"omga": 1}, "an orbit has no element 'omga'; did you mean 'omega'? it has a, e, p, rp,"),
    ("world.craft", {}, "name what to draw, of a, e, p"),
    ("world.craft", {"a": 1, "rp": 2}, "draw of the size and shape a and e, p and e, altitude and e, rp and ra, rp"),
    ("world.craft", {"i": 1 * m}, "world.craft.orbit.i = uniform(1 m, 1 m): expected a quantity in rad; found 1.0 m"),
    ("world.craft", {"e": -0.1}, "world.craft.orbit.e = -0.1: world.craft.orbit: orbit: the eccentricity must be >= 0"),
    ("world.craft", {"altitude": -1 * km}, "is inside the body, of radius "),
])
def test_a_wrong_dispersion_of_an_orbit_is_refused(tmp_path, path, elements, words):
    d = Dispersions(fledge.load(orbiter(tmp_path)))
    with pytest.raises(fledge.SetupError) as error:
        d.orbit(path, **{name: d.uniform(value, value) for name, value in elements.items()})
    assert words in str(error.value)


def test_an_orbit_is_dispersed_once_and_must_be_given(tmp_path):
    d = Dispersions(fledge.load(orbiter(tmp_path)))
    d.duration = 1 * s
    d.orbit("world.craft", i=d.uniform(1, 2))
    with pytest.raises(fledge.SetupError, match="world.craft.orbit.i is dispersed twice"):
        d.orbit("world.craft", i=d.uniform(1, 2))
    d["world.craft.r_BN_N"] = d.nominal + d.normal(0, 1 * m)
    with pytest.raises(fledge.SetupError, match=r"world.craft.r_BN_N\[0\] is dispersed twice"):
        d._finished()
    with pytest.raises(fledge.SetupError, match=r"e=...\): expected a number drawn.*found 0.1"):
        d.orbit("world.craft", e=0.1)
    d = Dispersions(fledge.load(orbiter(tmp_path, more="w.craft.v_BN_N[0] += 1")))
    with pytest.raises(fledge.SetupError, match="the mission gives it no orbit=Orbit"):
        d.orbit("world.craft", i=d.uniform(1, 2))


def test_an_orbit_into_the_body_is_a_failure_of_its_run(tmp_path):
    def falling(d):
        d.duration, d.every = 1, 1
        d.orbit("world.craft", a=d.normal(6450e3, 50e3), e=d.normal(0.01, 1e-6))

    result = Campaign(orbiter(tmp_path), falling).fly(100, threads=2)
    low = result.draws["world.craft.orbit.a"] * (1 - result.draws["world.craft.orbit.e"]) < world.EARTH.radius
    failed = sorted(result.failures)
    assert 20 < len(failed) < 80 and set(np.flatnonzero(low)) <= set(failed)
    assert all(text.startswith("world.craft.orbit: its lowest point, ") for text in result.failures.values())


def test_faults_that_the_mission_does_not_plan_are_dispersed(tmp_path):
    def faulty(d):
        d.duration, d.every = 10, 1
        d.fault("world.gyro", kind=d.choice("NONE", "BIAS"), channels=d.choice(1, 2, 4),
                size=d.normal(0, 0.1 * deg / s), begin=d.uniform(2 * s, 8 * s))
        d.fault("world.gyro", kind="DRIFT", channels=4, size=d.choice(0, 1))
        d.retain("world.gyro.rate.omega_BN_B")

    campaign = Campaign(orbiter(tmp_path), faulty)
    result = campaign.fly(60, seed=1, threads=2)
    draws = {path.rpartition("gyro.")[2]: values for path, values in result.draws.items()}
    assert list(draws) == [*(f"faults[0].{name}" for name in ("kind", "channels", "size", "begin")), "faults[1].size"]
    rate = result.retained["world.gyro.rate.omega_BN_B"]
    t = np.arange(11)[None, :, None]
    for channel in range(3):
        acts = (draws["faults[0].kind"] == 4) & (draws["faults[0].channels"] == 1 << channel)
        assert 3 < acts.sum() < 30
        expected = (draws["faults[0].size"] * acts)[:, None, None] * \
            (t * 1e9 >= draws["faults[0].begin"][:, None, None])
        if channel == 2:
            expected = expected + draws["faults[1].size"][:, None, None] * t
        assert np.allclose(rate[:, :, channel], expected[:, :, 0], atol=1e-12)
    with pytest.raises(fledge.SetupError, match="a fault has no 'sise'; did you mean 'size'"):
        campaign.dispersions.fault("world.gyro", kind="BIAS", sise=3)
    with pytest.raises(fledge.SetupError, match="no model of that name takes faults; these do: world.gyro"):
        campaign.dispersions.fault("world.craft", kind="BIAS")
    with pytest.raises(fledge.SetupError, match="of the rows of world.gyro.faults the mission gives 2"):
        campaign.dispersions["world.gyro.faults[2].size"] = campaign.dispersions.uniform(0, 1)


def test_drawn_commands_come_at_their_times_in_threads_and_alone():
    def commanded(d):
        d.duration, d.every = 20, 1
        d.command(d.choice(None, d.packets.noop(), d.packets.write("flight.control", K=9.0)),
                  at=d.uniform(8 * s, 16 * s))
        d.command([*d.packets.write("flight.control", K=4.0), d.packets.noop()], at=d.normal(12 * s, 1 * s))
        d.retain("flight.control.torque.torque_B")

    campaign = Campaign("nadir_spin", commanded)
    result = campaign.fly(12, seed=2, threads=2)
    draws = {path.removeprefix("flight.commands"): values for path, values in result.draws.items()}
    assert list(draws) == ["[0].which", "[0].at", "[1].which", "[1].at"] and not result.failures
    assert set(draws["[0].which"]) == {0, 1, 2} and set(draws["[1].which"]) == {1}
    assert campaign.shown("flight.commands[0].which", 2) == "write flight.control.K"
    for run in range(12):
        sim = campaign.simulation(run, seed=2)
        assert campaign.drawn(sim) == {path: values[run] for path, values in result.draws.items()}
        log = sim.record(sim.flight.control.torque, every=1 * s)
        sim.run(20 * s)
        assert (log["torque.torque_B"] == result.retained["flight.control.torque.torque_B"][run]).all()
        which, first, _, second = (values[run] for values in draws.values())
        sent = sorted([*([(first, ("NOOP", "WRITE")[int(which) - 1])] if which else []), (second, "WRITE"),
                       (second, "NOOP")], key=lambda row: row[0])
        reports = [report for report in sim.flight.commands.reports if report.executed]
        assert all(report.good for report in reports)
        assert [report.sequence for report in reports] == list(range(len(sent)))
        assert [(report.t, Code(report.code).name) for report in reports] == \
            [((math.floor(t / 0.5) + 1) * 500_000_000, name) for t, name in sent]      # the next instant of flight
    wrong = Dispersions(fledge.load("nadir_spin"))
    p = wrong.packets
    for packets, at, words in [
            (p.noop(), -1 * s, "flight.commands[0].at must be > 0, found -1 s"),
            (p.noop(), wrong.uniform(-1 * s, 1 * s), "a command comes at 0 s or later, found -1 s"),
            (p.noop(), wrong.uniform(1 * m, 2 * m), "expected a quantity in s"),
            (p.noop(), wrong.attitude(), "expected a time drawn"),
            ("noop", 1 * s, "expected packets, as d.packets.mode(...) gives them"),
            (wrong.uniform(1, 2), 1 * s, "expected packets, or d.choice(...) of some"),
            (wrong.choice(None), 1 * s, "name a command"), (b"x" * 12, 1 * s, "of no flight software")]:
        with pytest.raises(fledge.SetupError, match=re.escape(words)):
            wrong.command(packets, at)
    assert not wrong.columns


# --- requirements ----------------------------------------------------------------------------------

class Flown:
    """Retained values as if two runs had given them."""
    ns = np.arange(6) * 4 * 10**9
    retained = {"flight.tracking.error.sigma_BR": np.array(
        [[[0, 3, 4]] * 3 + [[1, 2, 2]] * 2 + [[0, 0, 1]], [[0, 0, 1]] * 5 + [[0, np.nan, 0]]], float),
        "flight.tracking.error.head.quality": np.full((2, 6), 3.0)}


def test_requirements_hold_at_every_sample_of_their_time(d):
    d.every = 4 * s
    error = d.retain("flight.tracking.error.sigma_BR")
    assert d.retain("flight.tracking.error.sigma_BR") is error

    def outcome(requirement):
        d.check(requirement, "bad")
        values, times, holds = requirement.worst(Flown)
        return values[0], times[0], holds.tolist()

    assert outcome(error.norm() < 4) == (5, 0, [False, False])
    assert outcome(error.norm().before(16 * s) <= 5) == (5, 0, [True, True])
    assert outcome(error.norm().after(12 * s) < 4) == (3, 12, [True, False])
    assert outcome(error.norm().final < 2) == (1, 20, [True, False])
    assert outcome(error.max_abs().after(8 * s).before(16 * s) < 4) == (4, 8, [False, True])
    assert outcome(error[2].before(16 * s) > 1.5) == (2, 12, [True, False])
    assert outcome(error[1].final >= 0) == (0, 20, [True, False])
    assert d.requirements[2].failure(4.5, 12) == (
        "bad: norm(flight.tracking.error.sigma_BR) is 4.5 at 12 s, not < 4")


def test_units_of_limits(d):
    torque = d.retain("flight.motor.command.u[0]")
    assert repr(torque.final < 200 * N * m) == "flight.motor.command.u[0] at the end < 200 N m"
    rate = d.retain("flight.tracking.error.omega_BR_B")
    assert (rate[2] < 1 * deg / s).limit == pytest.approx(np.pi / 180)


# --- whole numbers, enumerations, structs ----------------------------------------------------------

@pytest.fixture
def every_kind(tmp_path):
    """A mission whose module has parameters and outputs of every kind."""
    (tmp_path / "mission.py").write_text('''
"""Every kind of number."""
from fledge.objects.testing import kinds


def build(sim):
    f, Noise = sim.add_flight("flight"), kinds()[1]["Noise"]
    f.noise = Noise(step=10, x=5, part={"share": 0.5, "pairs": [{"count": 7}, {}]})
    f.task("all", every=1, run=[f.noise])
''')
    return tmp_path


def flown(folder, declare, runs=400):
    def campaign(d):
        d.duration, d.every = 4, 1
        declare(d)
    return Campaign(folder, campaign).fly(runs, seed=5, threads=2)


def test_whole_numbers_and_enumerations_are_dispersed_in_structs_too(every_kind):
    def declare(d):
        d["flight.noise.step"] = d.nominal + d.uniform(-3, 3.5)
        d["flight.noise.level"] = d.normal(5, 2, low=0, high=10)
        d["flight.noise.wide[1]"] = d.uniform(2**40, 2**40 + 1)
        d["flight.noise.phase"] = d.choice("SAFE", "PHASE_DRAIN", 3)
        d["flight.noise.phases"] = d.choice("SAFE", "SCIENCE")
        d["flight.noise.part.share"] = d.nominal * d.uniform(0.5, 1.5)
        d["flight.noise.part.pairs[0].count"] = d.nominal * d.uniform(0, 2)
        d["flight.noise.parts[2].steps[1]"] = d.choice(-5, 5)
        d["flight.noise.parts[1].pairs[1].x"] = d.choice(1 * m, 2 * m)

    result = flown(every_kind, declare)
    assert not result.failures, result.failures
    draws = result.draws
    values, counts = np.unique(draws["flight.noise.step"], return_counts=True)
    assert values.tolist() == [*range(7, 14)] and counts.min() > 30
    assert set(draws["flight.noise.level"]) == set(range(11))
    assert set(draws["flight.noise.wide[1]"]) == {2**40, 2**40 + 1}
    assert set(draws["flight.noise.phase"]) == {0, 3, 100}
    assert set(zip(*(draws[f"flight.noise.phases[{i}]"] for i in range(3)))) == set(product((0, 3), repeat=3))
    assert set(draws["flight.noise.part.pairs[0].count"]) == set(range(15))
    assert draws["flight.noise.part.share"].std() > 0.1 and set(draws["flight.noise.parts[2].steps[1]"]) == {-5, 5}
    sim = result.campaign.simulation(17, seed=5)
    assert result.campaign.drawn(sim) == {path: values[17] for path, values in draws.items()}
    assert sim.flight.noise.parts[1].pairs[1].x == draws["flight.noise.parts[1].pairs[1].x"][17]
    assert sim.flight.noise.phase == draws["flight.noise.phase"][17]


def test_numbers_of_every_type_are_retained(every_kind):
    paths = ["i8", "u8", "i16", "u32", "single", "u16", "u16[1]", "i64", "u64", "phase", "phases", "part.phase",
             "parts[1].share", "parts[2].pairs[1].count", "parts[0].steps[2]", "turn", "grid[1]"]

    def declare(d):
        d["flight.noise.seed"] = d.uniform(0, 1000)
        d.retain(*(f"flight.noise.kinds.{path}" for path in paths))
        d.check(d.retain("flight.noise.kinds.phase").final == "SAFE", "not safe")
        d.check(d.retain("flight.noise.kinds.parts[1].phase") != "PHASE_DRAIN")

    result = flown(every_kind, declare, 20)
    sim = result.campaign.simulation(7, seed=5)
    log, watch = sim.record(sim.flight.noise.kinds, every=1), result.campaign.watch(sim)
    sim.run(4)
    for path in paths:
        assert (result.retained[f"flight.noise.kinds.{path}"][7] == log[f"flight.noise.kinds.{path}"]).all(), path
    judged = result.campaign.judge(log, watch)
    assert judged.failures.get(0) == result.failures.get(7)
    last = result.retained["flight.noise.kinds.phase"][:, -1]
    drained = (result.retained["flight.noise.kinds.parts[1].phase"] == 100).any(axis=1)
    for run in range(20):
        text = result.failures.get(run, "")
        assert ("not safe: flight.noise.kinds.phase is " in text) == (last[run] != 0)
        assert ("flight.noise.kinds.parts[1].phase is DRAIN at " in text) == drained[run]
    assert 0 < drained.sum() < 20 and "at 4 s, not == SAFE" in str(result.failures)


@pytest.mark.parametrize("line, text", [
    ('d["flight.noise.phase"] = d.uniform(0, 3)', "Phase is an enumeration; draw it by d.choice(...), of NOT_SAFE,"),
    ('d["flight.noise.phase"] = d.choice("SAVE")', "expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found 'SAVE'; did"),
    ('d["flight.noise.phase"] = d.choice()', "name what to choose from"),
    ('d["flight.noise.step"] = d.uniform(0.2, 0.8)', "there is no whole number between 0.2 and 0.8"),
    ('d["flight.noise.step"] = d.choice(1, 200)', "flight.noise.step must be in [-100, 100], found 200"),
    ('d["flight.noise.counts"] = d.uniform(0, 65536)', "counts[0] cannot be 65536: it is of type uint16_t"),
    ('d["flight.noise.seed"] = d.uniform(0, 1e17)', "flight.noise.seed cannot be 1e+17: it is of type uint64_t"),
    ('d["flight.noise.parts.share"] = d.uniform(0, 1)',
     "parts has 3 rows; name one, as in flight.noise.parts[0]"),
    ('d["flight.noise.parts[3].share"] = d.uniform(0, 1)', "flight.noise.parts has 3 rows; name one"),
    ('d["flight.noise.part[0].share"] = d.uniform(0, 1)', "flight.noise.part is no array"),
    ('d["flight.noise.part"] = d.uniform(0, 1)', "is a whole message; name one of its fields: phase, share, pairs"),
    ('d["flight.noise.part.pairs[0].y"] = d.uniform(0, 1)', "flight.noise.part.pairs[0] has no 'y'; it has count, x"),
    ('d["flight.noise.kinds.x"] = d.uniform(0, 1)', "flight.noise has x, seed, step, level, phase, phases, counts"),
    ('d.retain("flight.noise.kinds.label")', "flight.noise.kinds.label is a text; a path here names numbers"),
    ('d.retain("flight.noise.kinds.parts[0]")', "is a whole message; name one of its fields: phase, share, pairs"),
    ('d.retain("flight.noise.step")', "flight.noise has hint, kinds"),
    ('d.check(d.retain("flight.noise.kinds.phase") == "OFF")', "expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found"),
])
def test_a_wrong_number_enumeration_or_struct_is_refused(every_kind, line, text):
    with pytest.raises(fledge.SetupError) as error:
        Campaign(every_kind, lambda d: exec(line, {"d": d}))
    assert text in str(error.value)
