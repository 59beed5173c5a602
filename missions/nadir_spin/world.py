# SPDX-License-Identifier: Apache-2.0
"""The truth: an elliptic orbit through periapsis at Mars, a rigid body, four wheels, perfect navigation."""
from fledge import Orbit, flight as fsw, world
from fledge.units import N, deg, kg, km, m, ms, rad, s

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f):
    # The wheels are what flight believes them to be, at rest.
    w.wheels = world.ReactionWheels(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Table 2.1: in the plane of N's equator, a quarter turn before periapsis.
    w.craft  = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[MARS],
        orbit=Orbit(MARS, a=7471.618 * km, e=0.4, f=270 * deg),
        sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.001, -0.01, 0.03] * rad / s)

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
