# SPDX-License-Identifier: Apache-2.0
"""Thrusters in simulations: loops with flight modules, snapshots."""
import numpy as np
import pytest

from fledge import Orbit, SetupError, Simulation, world
from fledge import flight as fsw
from fledge.units import N, kg, m, minute, ms, s

SIX = {"r_TB_B": [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [-1, 0, 0]] * m,
       "axes_B": [[0, 0, 1], [0, 0, -1], [0, 0, 1], [0, 0, -1], [0, 1, 0], [0, -1, 0]]}


def loop(**tanks):
    """Flight turns a body to rest by six thrusters with ramps."""
    sim = Simulation("loop")
    w, f = sim.world, sim.flight
    w.thrusters = world.Thrusters(**SIX, F=0.5 * N, rise=2 * ms, fall=2 * ms, min_on=5 * ms, **tanks)
    w.craft = world.Spacecraft(mass=50 * kg, I_B=[10, 12, 15] * kg * m**2, parts=[w.thrusters],
                               sigma_BN=[0.2, -0.1, 0.3], omega_BN_B=[0.01, -0.02, 0.015])
    w.nav = world.Navigation()
    f.vehicle = fsw.VehicleConfig(I_B=[10, 12, 15] * kg * m**2)
    f.thrusters = fsw.ThrusterConfig(**SIX, F_max=0.5 * N)
    f.guidance = fsw.InertialPointing()
    f.tracking = fsw.TrackingError()
    f.control = fsw.MrpFeedback(K=0.5 * N * m, P=4 * N * m * s)
    f.mapping = fsw.ThrusterMapping()
    f.firing = fsw.ThrusterFiring(period=0.5 * s, min_on=5 * ms, level_on=0.75, level_off=0.25)
    f.connect(f.guidance.reference >> f.tracking.reference, f.tracking.error >> f.control.error,
              f.control.torque >> f.mapping.torque, f.mapping.forces >> f.firing.forces,
              f.vehicle.vehicle >> f.control.vehicle, f.thrusters.thrusters >> [f.mapping.thrusters,
                                                                                f.firing.thrusters])
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.tracking, f.control, f.mapping, f.firing])
    w.connect(w.craft.state >> w.nav.truth, w.nav.attitude >> f.tracking.attitude, f.firing.times >> w.thrusters.times)
    w.task("world", every=100 * ms, run=[w.craft, w.nav])
    return sim


def test_thrusters_turn_a_body_to_rest_and_pay_for_it():
    sim = loop(isp=60 * s, propellant=[2] * kg)
    sim.run(5 * minute)
    w = sim.world
    assert np.linalg.norm(w.craft.state.sigma_BN) < 0.02 and np.linalg.norm(w.craft.state.omega_BN_B) < 2e-3
    output = w.thrusters.output
    assert output.used == pytest.approx(sum(output.impulse) / (60 * 9.80665), rel=1e-9)
    assert w.thrusters.tanks.mass[0] == pytest.approx(2 - output.used, rel=1e-12)
    assert 0.001 < output.used < 0.01


def test_snapshots_and_clones_go_on_with_open_valves():
    sim = loop()
    sim.run(1.1 * s)
    assert sum(sim.world.thrusters.output.thrust) > 0
    copy, snapshot = sim.clone(), sim.snapshot()
    ends = []
    for each in (sim, copy):
        each.run(20 * s)
        ends.append(np.concatenate([each.world.craft.state.r_BN_N, each.world.craft.state.sigma_BN]))
    sim.restore(snapshot)
    sim.run(20 * s)
    ends.append(np.concatenate([sim.world.craft.state.r_BN_N, sim.world.craft.state.sigma_BN]))
    assert (ends[0] == ends[1]).all() and (ends[0] == ends[2]).all()


def gimballed(parts=("thrusters", "panels"), panel=1):
    """A thruster on a panel that a spring holds."""
    sim = Simulation("gimbal")
    w = sim.world
    w.panels = world.HingedPanels(n=1, mass=0.1 * kg, I_B=[0.2 * np.eye(3)] * kg * m**2, hinge_B=[[0, 0, -1]] * m,
                                  axes_B=[[1, 0, 0]], stiffness=100 * N * m, damping=3 * N * m * s, theta=0.1)
    w.thrusters = world.Thrusters(r_TB_B=[[0, 0, -1]] * m, axes_B=[[0, 0, 1]], F=20 * N, panel=[panel], panels=w.panels)
    w.craft = world.Spacecraft(mass=100 * kg, I_B=[50, 50, 10] * kg * m**2, parts=[getattr(w, part) for part in parts])
    w.task("world", every=10 * ms, run=[w.craft])
    w.panels.command.theta[0], w.panels.command.head.quality = 0.1, 3
    w.thrusters.valves.open[0], w.thrusters.valves.head.quality = 1, 3
    return sim


def test_a_thruster_on_a_hinge_turns_the_body():
    for parts in (("thrusters", "panels"), ("panels", "thrusters")):
        sim = gimballed(parts)
        sim.run(10 * ms)
        copy = sim.clone()
        assert copy.world.thrusters.panels is copy.world.panels
        for each in (sim, copy):
            each.run(990 * ms)
            state, thrusters = each.world.craft.state, each.world.thrusters
            assert state.omega_BN_B[0] == pytest.approx(-20 * np.sin(0.1) / 50, rel=1e-2)
            assert thrusters.output.impulse[0] == pytest.approx(20, rel=1e-9)
        assert (sim.world.craft.state.sigma_BN == copy.world.craft.state.sigma_BN).all()


def test_a_mount_that_does_not_exist_is_refused_before_the_first_step():
    def says(words, sim):
        with pytest.raises(SetupError) as error:
            sim.run(1 * s)
        assert words in str(error.value)

    says("world.thrusters.panel[0] is 2, but its HingedPanels have n = 1", gimballed(panel=2))
    says("HingedPanels world.panels is a part of no spacecraft", gimballed(["thrusters"]))
    sim = loop(panel=[0, 0, 1, 0, 0, 0])
    assert sim.world.thrusters.panels is None
    says("world.thrusters.panel[2] is 1, but world.thrusters.panels is missing", sim)
    with pytest.raises(SetupError, match=r"world.thrusters.panels: expected .* world.HingedPanels\(...\); found"):
        sim.world.thrusters.panels = sim.world.craft


@pytest.mark.parametrize("wheels, craft, words", [
    ({}, {"I_B": [3, 4, 7.1]}, "Spacecraft.I_B is that of no body: a principal moment exceeds the sum of the others"),
    ({}, {"I_B": [[3, 0.1, 0], [0, 4, 0], [0, 0, 5]]}, "Spacecraft.I_B must be symmetric, found [[3, 0.1, 0]"),
    ({}, {"I_B": [3, 4, -5]}, "Spacecraft.I_B must be positive definite"),
    ({}, {"I_B": [1e-320] * 3}, "Spacecraft.I_B must be 0 or of a size from 1e-100 to 1e+100 kg m^2, found 1e-320"),
    ({"axes_B": [[0, 0, 1e160]]}, {}, "ReactionWheels.axes_B must be 0 or of a size from 1e-100 to 1e+100, found 1e"),
    ({"axes_B": [[0, 0, 0]]}, {}, "ReactionWheels.axes_B must have a length, found zero at [0]"),
    ({"J": 1e-320}, {}, "ReactionWheels.J must be 0 or of a size from 1e-100 to 1e+100 kg m^2, found 1e-320")])
def test_bodies_and_wheels_that_cannot_be_are_refused(wheels, craft, words):
    with pytest.raises(SetupError) as error:
        world.Spacecraft(**{"I_B": [10, 12, 15], **craft})
        world.ReactionWheels(**{"axes_B": [[0, 0, 1]], "J": 0.1, **wheels})
    assert words in str(error.value)


def test_bad_propulsion_is_refused_before_the_first_step():
    def says(words, **parameters):
        with pytest.raises(SetupError) as error:
            loop(**parameters).run(1 * s)
        assert words in str(error.value)

    says("world.thrusters.isp[0] is 60 s, so propellant flows, but n_tanks is 0", isp=60 * s)
    says("world.thrusters.isp[0] must be > 0 s where tanks feed", propellant=[2] * kg)
    says("Thrusters.propellant must be in [1e-09, 1e+09] kg, found 0", propellant=[0] * kg, isp=60 * s)


def test_a_wheel_stuck_at_its_limit_has_one():
    def prepared(u_max, Omega_max, size=0):
        sim = Simulation("wheels")
        w = sim.world
        w.wheels = world.ReactionWheels(axes_B=[[1, 0, 0], [0, 1, 0]], J=0.1, u_max=u_max, Omega_max=Omega_max,
                                        faults=[{"kind": "HIGH", "channels": 1, "size": size}])
        w.craft = world.Spacecraft(I_B=3, parts=[w.wheels], gravity=[world.EARTH],
                                   orbit=Orbit(world.EARTH, altitude=500e3))
        w.task("dynamics", every=0.1, run=[w.craft])
        sim.prepare()

    prepared([0.1, 0.2], [600, 500])
    prepared([0.1, 0], [600, 0], size=0.1)
    for limits in (([0.1, 0], [600, 500]), ([0.1, 0.2], [0, 500])):
        with pytest.raises(SetupError, match="world.wheels.faults.0..size: not every channel has limits, so it must"):
            prepared(*limits)


def test_the_states_of_wheels_have_their_names():
    sim = Simulation("wheels")
    w = sim.world
    w.wheels = world.ReactionWheels(axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], J=0.1, Omega=[10, 20, 30],
                                    unbalance=[0, 1e-5, 0])
    w.craft = world.Spacecraft(I_B=3, mass=10, parts=[w.wheels], gravity=[world.EARTH],
                               orbit=Orbit(world.EARTH, altitude=500e3))
    w.task("dynamics", every=0.1, run=[w.craft])
    sim.step()
    linear = sim.linearize([], [])
    found = dict(zip(linear.states, linear.x0))
    assert [found[f"world.wheels.h[{i}]"] for i in range(3)] == pytest.approx([1, 2, 3])
    rates = dict(zip(linear.states, linear.drift))
    assert [rates[f"world.wheels.theta[{i}]"] for i in range(3)] == pytest.approx([10, 20, 30], rel=1e-6)
