# SPDX-License-Identifier: Apache-2.0
"""Impulses on a spacecraft, by hand, at times and by events, against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fledge
from fledge import SetupError, world
from fledge.attitude import mrp_to_dcm
from fledge.units import N, deg, kg, m, ms, rad, s

I_B = np.diag([40.0, 35.0, 30.0])


def adrift(parts=(), **parameters):
    """A craft on which nothing else acts."""
    sim = fledge.Simulation()
    w = sim.world
    for i, part in enumerate(parts):
        setattr(w, f"part_{i}", part)
    w.craft = world.Spacecraft(I_B=I_B * kg * m**2, parts=list(parts),
                               **{"mass": 100 * kg, "omega_BN_B": [0.01, -0.02, 0.03] * rad / s,
                                  "sigma_BN": [0.2, -0.1, 0.3], **parameters})
    w.task("dynamics", every=100 * ms, run=[w.craft])
    return sim


def test_a_rigid_body_gets_the_momentum_at_the_place_where_it_acts():
    sim = adrift(center_B=[0.1, 0, -0.2] * m)
    craft = sim.world.craft
    sim.run(10 * s)
    v, omega, dcm, where = (np.copy(x) for x in (craft.state.v_CN_N, craft.state.omega_BN_B,
                                                 mrp_to_dcm(craft.state.sigma_BN), craft.state.r_CN_N))
    p, h, point = np.array([3.0, -1, 2]), np.array([0.3, 0.2, -0.1]), np.array([0.5, 0.7, -0.3])
    craft.impulse(momentum_B=p * N * s, angular_N=h * N * m * s, r_PB_B=point * m)
    assert_allclose(craft.state.v_CN_N, v + dcm.T @ p / 100, rtol=1e-13)
    assert_allclose(craft.state.omega_BN_B, omega + np.linalg.solve(I_B, dcm @ h + np.cross(point - [0.1, 0, -0.2], p)),
                    rtol=1e-13)
    assert (craft.state.r_CN_N == where).all() and sim.time == 10
    sim.run(10 * s)     # and drifts on with it
    assert_allclose(craft.state.r_CN_N, where + 10 * (v + dcm.T @ p / 100), rtol=1e-12)


def test_fuel_on_a_spring_keeps_its_own_motion():
    """The hub alone is struck: along the spring's line by p / m of the hub, across it by p / m of both."""
    fuel = world.FuelSlosh(n=1, mass=[25] * kg, r_B=[[0, 0, 0]] * m, axes_B=[[1, 0, 0]], stiffness=[4] * N / m)
    sim = adrift([fuel], omega_BN_B=[0, 0, 0], sigma_BN=[0, 0, 0])
    sim.run(1 * s)
    sim.world.craft.impulse(momentum_N=[50, 50, 0] * N * s)
    assert_allclose(sim.world.craft.state.v_BN_N, [50 / 100, 50 / 125, 0], rtol=1e-14)
    assert_allclose(fuel.fuel.v_B[0], [-50 / 100, 0, 0], rtol=1e-14)
    assert_allclose(sim.world.craft.state.v_CN_N, [50 / 125, 50 / 125, 0], rtol=1e-14)
    sim.world.craft.impulse(dv_N=[-50 / 125, -50 / 125, 0] * m / s)
    assert_allclose(sim.world.craft.state.v_CN_N, 0, atol=1e-15)


def test_a_balanced_wheel_keeps_its_momentum():
    wheels = world.ReactionWheels(axes_B=[[0, 0, 1]], J=0.5 * kg * m**2, u_max=1 * N * m, Omega=[100] * rad / s)
    sim = adrift([wheels], omega_BN_B=[0, 0, 0], mass=0 * kg)
    sim.run(1 * s)
    before = np.copy(sim.world.craft.state.omega_BN_B)
    sim.world.craft.impulse(angular_B=[0, 0, 3] * N * m * s)
    assert_allclose(sim.world.craft.state.omega_BN_B - before, [0, 0, 3 / 30], rtol=1e-12, atol=1e-15)
    assert_allclose(wheels.speeds.Omega[0], 100 - 3 / 30, rtol=1e-14)


def test_a_time_and_an_event_let_it_act_also_in_clones_snapshots_and_batches():
    def made():
        sim = adrift()
        w = sim.world
        w.at(2 * s, lambda: w.craft.impulse(dv_N=[1, 0, 0] * m / s))
        w.event("far", when=w.watch(w.craft.state).r_CN_N[0] > 0.95, once=True,
                do=lambda: w.craft.impulse(dv_N=[-1, 0, 0] * m / s))
        return sim

    sim = made()
    log = sim.record(sim.world.craft.state)
    sim.run(1 * s)
    before, clone = sim.snapshot(), sim.clone()
    for _ in range(2):
        sim.run(3 * s)
        v = log["state.v_CN_N"][:, 0]
        # An event acts at its instant, whose sample has it: 1 m/s from 2 s on, until 1 m is flown
        assert_allclose(v, np.where((log.time > 1.95) & (log.time < 2.95), 1.0, 0.0), atol=1e-14)
        sim.restore(before)
    sim.reset()
    sim.run(4 * s)
    assert sim.world.craft.state.r_CN_N[0] == pytest.approx(1.0)
    del clone   # its functions strike the original; those of a batch strike their own
    batch = made().batch(2, observations=["world.craft.state.r_CN_N"], every=1 * s)
    batch.reset()
    for _ in range(4):
        seen = batch.step()
    assert_allclose(batch.by_name(seen)["world.craft.state.r_CN_N"][:, 0], 1.0)


@pytest.mark.parametrize("given, text", [
    ({}, "give at least one of dv_N, dv_B, momentum_N, momentum_B, angular_N, angular_B"),
    ({"r_PB_B": [1, 0, 0]}, "give at least one of"),
    ({"dv_N": [1, 2]}, "world.craft.impulse: dv_N: expected 3 numbers"),
    ({"dv_N": [1, 2, 3] * N}, r"world.craft.impulse: dv_N: expected a quantity in m/s; found \[1.0, 2.0, 3.0\] N"),
    ({"dv_B": [1, 2, float("nan")]}, "dv_B: expected finite numbers"),
    ({"momentum_B": [1, 2, 3]}, "world.craft.mass is 0, so that a momentum has no effect")])
def test_a_wrong_impulse_is_refused_and_changes_nothing(given, text):
    sim = adrift(mass=0 * kg)
    sim.run(1 * s)
    before = sim.snapshot()
    with pytest.raises(SetupError, match=text):
        sim.world.craft.impulse(**given)
    assert sim.snapshot() == before
    sim.world.craft.impulse(dv_N=[1, 2, 3] * m / s)     # which needs no mass
    assert_allclose(sim.world.craft.state.v_CN_N, [1, 2, 3])


def test_it_acts_in_a_run_alone_and_names_what_was_meant():
    craft = adrift().world.craft
    with pytest.raises(SetupError, match=r"world.craft.impulse: the run has not begun: set v_BN_N and omega_BN_B, or "):
        craft.impulse(dv_N=[1, 0, 0])
    with pytest.raises(TypeError, match="impulse has no 'force_B'; did you mean 'momentum_B'"):
        craft.impulse(force_B=[1, 0, 0])
    with pytest.raises(TypeError, match="no attribute 'impulse'"):      # it is no parameter
        world.Spacecraft(I_B=I_B, impulse=3 * deg)
