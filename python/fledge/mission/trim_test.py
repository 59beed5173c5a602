# SPDX-License-Identifier: Apache-2.0
"""Trim: states, inputs and parameters at which a simulation is at rest."""

import numpy as np
import pytest

import fledge
from fledge import SetupError, world
from fledge.units import N, ms, rad, s

RATE, OMEGA = "world.craft.state.omega_BN_B", "world.craft.omega_BN_B"


def body(step=True, **parameters):
    sim = fledge.Simulation("body")
    w = sim.world
    w.wheels = world.ReactionWheels(axes_B=np.eye(3), J=0.1)
    w.craft = world.Spacecraft(I_B=[10, 20, 30], parts=[w.wheels], **parameters)
    w.task("dynamics", every=100 * ms, run=[w.craft])
    if step:
        sim.step()
    return sim


def test_torques_that_hold_a_rotation():
    omega = np.array([0.1, 0.2, 0.3])
    sim = body(omega_BN_B=omega)
    found = sim.trim([f"world.wheels.command.u[{i}]" for i in range(3)], rates=[OMEGA])
    h = 0.1 * omega
    wanted = -np.cross(omega, np.diag([10, 20, 30]) @ omega + h)
    assert list(found.free.values()) == pytest.approx(list(wanted), abs=1e-9)
    assert max(map(abs, found.left.values())) < 1e-9 and "trimmed with" in repr(found)
    assert sim.time == 0
    sim.run(100 * ms)
    # All of it: the torque holds for the step, the momentum of the wheels moves a little.
    assert sim.world.craft.state.omega_BN_B == pytest.approx(omega, abs=1e-3)
    assert sim.world.wheels.applied.u[:3] == pytest.approx(wanted)


def test_a_rate_that_keeps_itself():
    """About a principal axis, with a wanted rate: from a general attitude."""
    sim = body(omega_BN_B=[0.01, 0.02, 0.3])
    found = sim.trim([f"{OMEGA}[0]", f"{OMEGA}[1]"], rates=[f"{OMEGA}[0]", f"{OMEGA}[1]"])
    h = sim.world.wheels.speeds.Omega[:3] * 0.1 + 0.1 * sim.world.craft.state.omega_BN_B
    omega = sim.world.craft.state.omega_BN_B
    assert np.cross(omega, np.diag([10, 20, 30]) @ omega + h)[:2] == pytest.approx([0, 0], abs=1e-9)
    assert omega[2] == pytest.approx(0.3) and list(found.free) == [f"{OMEGA}[0]", f"{OMEGA}[1]"]


def test_initial_states_before_the_first_instant():
    sim = body(step=False)
    sim.trim("world.craft.omega_BN_B", outputs={RATE: [0.1, 0.2, 0.3] * rad / s})
    assert sim.time_ns == -1 and sim.world.craft.omega_BN_B == pytest.approx([0.1, 0.2, 0.3])
    sim.step()
    assert sim.world.craft.state.omega_BN_B == pytest.approx([0.1, 0.2, 0.3])


def test_a_gain_after_a_time():
    """Which viscosity lets a wheel lose half of its speed in 10 s: h decays by exp(-c t / J)."""
    sim = body(step=False)
    sim.world.wheels.Omega = [100, 0, 0]
    sim.world.wheels.viscosity = [0.01, 0, 0]
    sim.world.craft.I_B = [1e9, 1e9, 1e9]       # the body stands still
    sim.step()
    found = sim.trim("world.wheels.viscosity[0]", outputs={"world.wheels.speeds.Omega[0]": 50}, after=10 * s)
    assert found.free["world.wheels.viscosity[0]"] == pytest.approx(0.1 * np.log(2) / 10, rel=1e-6)
    assert sim.world.wheels.viscosity[0] == found.free["world.wheels.viscosity[0]"] and sim.time == 0
    sim.run(10 * s)
    assert sim.world.wheels.speeds.Omega[0] == pytest.approx(50)


@pytest.mark.parametrize("free, wanted, text", [
    ([], {"rates": OMEGA}, "name what is free"),
    (OMEGA, {}, "name the rates or outputs"),
    ("world.craft.omega", {"rates": OMEGA}, "world.craft has no 'omega'"),
    (OMEGA, {"rates": "world.craft.omega"}, "no differential state world.craft.omega; did you mean"),
    (OMEGA, {"outputs": {RATE: [1, 2]}}, "expected one number or 3"),
    (OMEGA, {"outputs": {RATE: 1 * N}}, "expected a quantity in rad/s"),
    (RATE, {"rates": OMEGA}, "is an output, which its module writes anew"),
    ("world.nav.truth.omega_BN_B", {"rates": OMEGA}, "a wire writes world.nav.truth"),
    ("world.wheels.command.u[0]", {"rates": {f"{OMEGA}[1]": 1}}, "does not depend on world.wheels.command.u.0."),
    ([OMEGA, OMEGA], {"rates": OMEGA}, "omega_BN_B.0. is free twice"),
    (1, {"rates": OMEGA}, "int"),
    ("world.wheels.command.u[0]", {"rates": {f"{OMEGA}[0]": 1, f"{OMEGA}[1]": 1}}, "does not depend"),
    (f"{OMEGA}[0]", {"outputs": {f"{RATE}[0]": 1, "world.wheels.speeds.Omega[0]": 5}},
     "no such state was found, from where the simulation stands; the nearest is"),
])
def test_bad_input_changes_nothing(free, wanted, text):
    sim = body(step=False)
    w = sim.world
    w.nav = world.Navigation()
    w.connect(w.craft.state >> w.nav.truth)
    w.task("sensors", every=100 * ms, run=[w.nav])
    sim.step()
    before = sim.snapshot()
    with pytest.raises((SetupError, TypeError), match=text):
        sim.trim(free, **wanted)
    assert sim.snapshot() == before


def test_before_the_first_instant_only_parameters_are_free():
    sim = body(step=False)
    with pytest.raises(SetupError, match="before the first instant, parameters are free"):
        sim.trim("world.wheels.command.u[0]", rates=OMEGA)
