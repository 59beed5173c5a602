# SPDX-License-Identifier: Apache-2.0
"""A CubeSat ends its tumble by rods in the field of the Earth."""
import math

import numpy as np
import pytest

from fledge import Orbit, Simulation, flight as fsw, world
from fledge.units import A, N, T, deg, kg, km, m, minute, s

DIPOLE = [-3.6e14, 1.2e15, -7.6e15]
LEAST = 0.12                                   # [kg m^2]


def craft(gyro: bool, **par):
    sim = Simulation()
    f, w = sim.flight, sim.world
    axes = np.eye(3)
    f.rods = fsw.RodConfig(n=3, axes_B=axes, m_max=[0.4 * A * m**2] * 3)
    orbit = Orbit(world.EARTH, a=6878 * km, e=0, i=97 * deg)
    period = 2 * math.pi * math.sqrt(6878e3**3 / world.EARTH.mu)
    f.b_dot = fsw.BDot(gain=4 * math.pi / period * (1 + math.sin(math.radians(97))) * LEAST * N * m * s,
                       field_min=1e-7 * T, **par)
    f.motor = fsw.RodTorques(field_min=1e-7 * T)
    f.connect(f.b_dot.torque >> f.motor.torque, f.b_dot.measured >> f.motor.field, f.rods.rods >> f.motor.rods)
    f.task("detumble", every=1 * s, run=[f.b_dot, f.motor])
    w.field = world.Magnetism(body=world.EARTH, dipole_P=DIPOLE, spin=7.292e-5)
    w.rods = world.TorqueRods(field=w.field, n=3, axes_B=axes, m_max=[0.4 * A * m**2] * 3)
    w.craft = world.Spacecraft(mass=20 * kg, I_B=np.diag([LEAST, 0.25, 0.28]), parts=[w.rods], gravity=[world.EARTH],
                               orbit=orbit, omega_BN_B=[5 * deg / s, -4 * deg / s, 6 * deg / s])
    w.magnetometer, w.gyro = world.Magnetometer(), world.Gyro()
    w.connect(w.craft.state >> [w.field.truth, w.magnetometer.truth, w.gyro.truth],
              w.field.field >> w.magnetometer.field, w.magnetometer.measured >> f.b_dot.field,
              f.motor.command >> w.rods.command)
    if gyro:
        w.connect(w.gyro.rate >> f.b_dot.gyro)
    w.task("world", every=1 * s, run=[w.craft, w.field, w.magnetometer, w.gyro])
    return sim


@pytest.mark.parametrize("gyro", [True, False])
@pytest.mark.parametrize("cycle", [{}, {"measure": 2 * s, "act": 8 * s}])
def test_a_tumble_ends_within_three_orbits(gyro, cycle):
    sim = craft(gyro, **cycle)
    sim.run(285 * minute)
    rate = np.linalg.norm(sim.world.craft.state.omega_BN_B)
    # With a gyro it comes to rest; by the field's change alone, it may turn with the field, twice an orbit and more.
    assert rate < math.radians(0.05 if gyro else 0.3)
    assert sim.flight.b_dot.torque.head.quality.name == "GOOD"
