# SPDX-License-Identifier: Apache-2.0
"""The truth: a body that tumbles, four control moment gyros, a sun sensor that sees half the sky, and a leak."""
from fledge import world
from fledge.units import N, deg, hour, kg, m, ms, rad, s

from .flight import GIMBALS, OMEGA, RATE_MAX, SPINS, J


def build(w, f):
    w.gyros  = world.ControlMomentGyros(
        gimbal_axes_B=GIMBALS, spin_axes_B=SPINS, J=J, J_g=0.012 * kg * m**2, J_s=0.004 * kg * m**2,
        J_t=0.01 * kg * m**2, Omega=OMEGA, rate_max=RATE_MAX, torque_max=2 * N * m, lag=100 * ms)
    w.leak   = world.ExternalForce()
    w.craft  = world.Spacecraft(
        mass=300 * kg, I_B=[90, 80, 60] * kg * m**2, parts=[w.gyros, w.leak],
        sigma_BN=[0.3, -0.4, 0.2], omega_BN_B=[2, -3, 1.5] * deg / s)

    w.eye    = world.SunSensor(boresight_B=[1, 0, 0], view=90 * deg, s_N=[1, -2, -2], deviation=2e-4 * rad)
    w.rate   = world.Gyro(noise=[(0.01 * deg)**2 / hour] * 3)

    w.connect(
        w.craft.state    >> [w.eye.truth, w.rate.truth],

        # what flight sees
        w.eye.heading    >> f.safe.sun,
        w.rate.rate      >> [f.safe.rate, f.steering.rate],
        w.gyros.gimbals  >> f.steering.gimbals,

        # what flight does
        f.steering.rates >> w.gyros.rates,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=10 * ms, run=[w.craft, w.eye, w.rate])
