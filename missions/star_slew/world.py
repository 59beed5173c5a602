# SPDX-License-Identifier: Apache-2.0
"""The truth: two panels that swing at 0.3 Hz, four wheels out of balance, a gyro, and a star tracker at 1 Hz."""
from fledge import Orbit, world
from fledge.units import N, arcsec, deg, hour, kg, km, m, ms, rad, s

from .flight import GYRO

# About its hinge, a panel has 5 kg (1 m)^2 and its own inertia.
OWN = [[1.0, 0, 0], [0, 0.42, 0], [0, 0, 1.4]]
FREQUENCY = 0.3 * 2 * 3.141592653589793
STIFFNESS = (5 + OWN[0][0]) * FREQUENCY**2

# Of a wheel for 12 N m s, by a data sheet: 0.15 g cm, 2.2 g cm^2 (Honeywell, Constellation Series Reaction Wheels).
STATIC, DYNAMIC = 1.5e-6 * kg * m, 2.2e-7 * kg * m**2


def build(w, f):
    # The wheels begin with 100 rad/s and no momentum together, and keep below 150 rad/s.
    w.wheels = world.ReactionWheels(
        axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=f.wheels.u_max, Omega=[100, -100, 100, -100] * rad / s,
        unbalance=STATIC, couple=DYNAMIC, r_WB_B=[[0.3 * x for x in axis] for axis in f.wheels.axes_B] * m)
    w.panels = world.HingedPanels(
        mass=[5, 5] * kg, I_B=[OWN, OWN] * kg * m**2, hinge_B=[[0, 0.7, 0], [0, -0.7, 0]] * m,
        axes_B=[[1, 0, 0], [-1, 0, 0]], center_B=[[0, 1, 0], [0, -1, 0]] * m,
        stiffness=[STIFFNESS] * 2 * N * m, damping=[0.01 * STIFFNESS / FREQUENCY] * 2 * N * m * s)
    w.craft  = world.Spacecraft(
        mass=300 * kg, I_B=[68, 70, 120] * kg * m**2, parts=[w.wheels, w.panels], gravity=[world.EARTH],
        orbit=Orbit(world.EARTH, altitude=700 * km, i=98 * deg),
        sigma_BN=[0.02, -0.01, 0.03], omega_BN_B=[1e-3, -2e-3, 1e-3] * rad / s)

    # The gyro's bias is unknown to flight; the star tracker loses the stars beyond 0.5 deg/s.
    w.gyro   = world.Gyro(noise=[GYRO["noise"]] * 3, walk=[GYRO["walk"]] * 3, bias=[12, -18, 9] * deg / hour)
    w.stars  = world.StarTracker(
        boresight_B=[0, -1, -1], deviation_across=5 * arcsec, deviation_about=40 * arcsec, latency=250 * ms,
        s_N=[0, 1, 0], sun_exclusion=30 * deg, rate_max=0.5 * deg / s)

    w.connect(
        w.craft.state     >> [w.gyro.truth, w.stars.truth],

        # what flight sees
        w.gyro.rate       >> f.filter.gyro,
        w.stars.attitude  >> f.filter.stars,
        w.wheels.speeds   >> f.servo.speeds,

        # what flight does
        f.motor.command   >> w.wheels.command,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=4 * ms, run=[w.craft])     # 10 steps in the shortest turn of a wheel
    w.task("gyro", every=200 * ms, run=[w.gyro])
    w.task("stars", every=1 * s, run=[w.stars])
