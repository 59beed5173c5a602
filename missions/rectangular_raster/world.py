# SPDX-License-Identifier: Apache-2.0
"""The truth: the nadir spin's orbit at Mars, a rigid body that looks down, four wheels, perfect navigation."""
from math import sqrt

from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, s

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f):
    # The wheels are those that flight believes in, at rest.
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)

    # Table 2.1. It begins at rest, with b1 on nadir.
    w.craft  = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[MARS],
        orbit=Orbit(MARS, a=7471.618 * km, e=0.4, f=270 * deg),
        sigma_BN=[0, 0, sqrt(2) - 1])

    w.nav    = world.Navigation()

    w.connect(
        w.craft.state   >> w.nav.truth,

        # what flight sees
        w.nav.attitude  >> f.tracking.attitude,
        w.nav.orbit     >> f.guidance.orbit,
        w.wheels.speeds >> f.control.speeds,

        # what flight does
        f.motor.command >> w.wheels.command,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
