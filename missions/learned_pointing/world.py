# SPDX-License-Identifier: Apache-2.0
"""The truth: a small rigid body that turns in a low orbit, four wheels, perfect navigation."""
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, s


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.05 * N * m)
    w.craft  = world.Spacecraft(
        I_B=[12, 10, 8] * kg * m**2, parts=[w.wheels], gravity=[world.EARTH],
        orbit=Orbit(world.EARTH, altitude=500 * km, i=97.4 * deg),
        sigma_BN=[0.5, -0.4, 0.3], omega_BN_B=[0.4, -0.8, 0.6] * deg / s)
    w.nav    = world.Navigation()

    w.connect(
        w.craft.state    >> w.nav.truth,
        w.nav.attitude   >> f.tracking.attitude,
        f.motor.command  >> w.wheels.command,
    )
    w.task("dynamics", every=250 * ms, run=[w.craft, w.nav])
