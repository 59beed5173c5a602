# SPDX-License-Identifier: Apache-2.0
"""Air for drag: of models in C++, and of prototypes in Python."""

import math

import numpy as np
import pytest

from fledge import Orbit, RunError, SetupError, Simulation, prototype, world
from fledge.prototype import out, par
from fledge.units import kg, km, m, minute, rad, s

EARTH = world.EARTH
SPIN = 7.292115146706388e-5
RADIUS = 6378137.0       # [m] of WGS 84


class Exponential(prototype.Model):
    """Air that is thinner by a factor e per scale height over a sphere, and turns with it."""
    air = out(world.AirState, "of a place over the equator")
    density = par(float, "[kg/m^3] > 0: at the height base")
    base = par(float, "[m]: height")
    scale = par(float, "[m] > 0: height in which it is thinner by a factor e")

    def air_at(self, t, r_BN_N):
        x, y, z = r_BN_N
        height = math.sqrt(x * x + y * y + z * z) - RADIUS
        return self.density * math.exp((self.base - height) / self.scale), (-SPIN * y, SPIN * x, 0.0)

    def update(self, t, dt):
        self.air.density, self.air.v_AN_N = self.air_at(t, (RADIUS + self.base, 0.0, 0.0))
        self.publish(self.air)


def flown(air, duration=30 * minute, **drag):
    sim = Simulation("air")
    w = sim.world
    w.air = air
    w.drag = world.Drag(air=w.air, **{"Cd": 2.2, "area": 10 * m**2, **drag})
    w.craft = world.Spacecraft(mass=100 * kg, I_B=1, gravity=[EARTH.with_surface(0)], parts=[w.drag],
                               orbit=Orbit(EARTH, altitude=250 * km, i=0))
    if hasattr(air, "truth"):
        w.connect(w.craft.state >> w.air.truth)
    w.task("world", every=10 * s, run=[w.craft, w.air])
    sim.run(duration)
    return sim


def test_a_prototype_is_air_at_each_stage_of_the_integrator():
    # On the equator, where the ellipsoid's height is that over the sphere of its radius.
    law = {"density": 6e-11 * kg / m**3, "base": 250 * km}
    model = flown(world.Atmosphere(body=EARTH, law="EXPONENTIAL", scale_height=40 * km, spin=SPIN * rad / s, **law))
    python = flown(Exponential(scale=40 * km, **law))
    free = flown(Exponential(**{**law, "density": 1e-30}, scale=40 * km))
    r, same, far = (np.array(sim.world.craft.state.r_BN_N) for sim in (model, python, free))
    assert np.linalg.norm(r - far) > 500
    np.testing.assert_allclose(same, r, rtol=0, atol=1e-3)
    clone = python.clone()
    for sim in (python, clone):
        sim.run(5 * minute)
    assert clone.snapshot() == python.snapshot()
    assert python.world.drag.air is python.world.air


def test_winds_blow_relative_to_the_turning_air():
    model = {"body": EARTH, "law": "CONSTANT", "density": 1e-12, "spin": SPIN}
    still, windy = (flown(world.Atmosphere(**model, **wind), 10 * s).world.air.air.v_AN_N
                    for wind in ({}, {"wind_east": 100 * m / s, "wind_north": -50 * m / s}))
    r = np.array(flown(world.Atmosphere(**model), 10 * s).world.craft.state.r_BN_N)
    east = np.cross([0, 0, 1], r) / np.linalg.norm(r[:2])
    np.testing.assert_allclose(windy - still, 100 * east - [0, 0, 50], atol=1e-9)
    np.testing.assert_allclose(still, SPIN * np.cross([0, 0, 1], r), rtol=1e-12)


def test_molecules_that_flow_freely_need_the_temperature_of_the_air():
    free = {"Cd": 0, "T_wall": 300, "accommodation": 0.9}
    load, before = (np.linalg.norm(flown(world.Atmosphere(body=EARTH, law="STANDARD_1976", spin=SPIN), 10 * s,
                                         **keys).world.drag.load.force_B) for keys in (free, {}))
    # Below 300 km, a sphere's coefficient is between 2.0 and 2.4 for accommodation near 1 (Moe and Moe 2005).
    assert 2.0 < 2.2 * load / before < 2.4
    with pytest.raises(RunError, match="drag.T_wall needs the temperature and the molar mass of the air"):
        flown(Exponential(density=6e-11, base=250 * km, scale=40 * km), 10 * s, **free)
    with pytest.raises(SetupError, match="which world.air does not have: take another law"):
        flown(world.Atmosphere(body=EARTH, density=1e-12), 10 * s, **free)


def test_facets_of_drag_turn_the_panel_that_carries_them():
    sim = Simulation("wing")
    w = sim.world
    w.air = world.Atmosphere(body=EARTH, density=1e-12)
    w.panels = world.HingedPanels(n=1, mass=1, I_B=[np.eye(3)], hinge_B=[[0, 1, 0]], axes_B=[[0, 0, 1]],
                                  center_B=[[0, 1, 0]])
    w.drag = world.Drag(air=w.air, panels=w.panels, panel=[1], Cd=2, areas=[2], normals_B=[[0, 1, 0]],
                        centres_B=[[1, 1, 0]])
    w.craft = world.Spacecraft(mass=1e6 * kg, I_B=1e6, gravity=[EARTH.with_surface(0)], parts=[w.drag, w.panels],
                               orbit=Orbit(EARTH, altitude=250 * km, i=0))
    w.connect(w.craft.state >> w.air.truth)
    w.task("world", every=1 * s, run=[w.craft, w.air])
    sim.run(10 * s)
    clone = sim.clone()
    for each in (sim, clone):
        each.run(10 * s)
    assert clone.snapshot() == sim.snapshot() and w.drag.panels is w.panels
    # The wind comes from y: 1/2 density Cd v^2 A turns the panel by the arm of 1 m against its inertia of 2 kg m^2.
    v = np.linalg.norm(w.craft.state.v_BN_N)
    assert w.panels.angles.theta[0] == pytest.approx(-0.5 * (0.5 * 1e-12 * 2 * v**2 * 2) / 2 * 20**2, rel=0.05)


def test_the_standard_atmosphere_says_its_temperature_and_molar_mass():
    air = flown(world.Atmosphere(body=EARTH, law="STANDARD_1976", spin=SPIN), 10 * s).world.air.air
    # Table IV and VIII of the US Standard Atmosphere 1976 at 250 km: 941.33 K, 19.19 kg/kmol.
    assert air.altitude == pytest.approx(250e3, abs=100)
    assert air.temperature == pytest.approx(941.33, rel=1e-3) and air.molar_mass == pytest.approx(19.19e-3, rel=2e-3)


@pytest.mark.parametrize("answer, found", [("None", "None"), ("-1.0", "-1.0"), ("(1e-12, 3)", "(1e-12, 3)"),
                                           ("float('nan')", "nan"), ("(1, (0, 0, 0), 3)", "(1, (0, 0, 0), 3)")])
def test_a_wrong_answer_of_a_prototype_ends_the_run(answer, found):
    class Wrong(Exponential):
        """Answers wrongly."""

        def air_at(self, t, r_BN_N):
            return eval(answer)

        def update(self, t, dt):
            pass

    with pytest.raises(RunError) as error:
        flown(Wrong(density=1, base=1, scale=1))
    assert str(error.value).startswith("world.air.air_at() at 0 s: expected density >= 0 [kg/m^3], or (density, ")
    assert str(error.value).endswith(f"found {found}")


def test_models_that_are_no_air_are_refused_with_what_is():
    class Bare(prototype.Model):
        """A model without air."""
        air = out(world.AirState, "of nowhere")

        def update(self, t, dt):
            pass

    for source in (Bare(), world.Sunlight(), 5):
        with pytest.raises(SetupError, match="Drag.air: expected a model of air: world.Atmosphere\\(...\\), or a "
                                             "prototype with a method air_at\\(self, t, r_BN_N\\); found"):
            world.Drag(air=source)

    with pytest.raises(SetupError, match="air_at: expected a function of \\(self, t, r_BN_N\\); found"):
        class Short(Bare):
            """Its method lacks an argument."""

            def air_at(self, t):
                return 0.0
