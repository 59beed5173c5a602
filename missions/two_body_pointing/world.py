# SPDX-License-Identifier: Apache-2.0
"""The truth: an orbit at Mars on 2 March 2015, with Earth and Sun where DE405 has them, four wheels."""
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, rad, s

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f):
    # N has the axes of J2000 and its origin in Mars. Earth and Sun are 18 deg apart from there.
    sky = world.Sky("2015-03-02T12:00:00", center=MARS)
    w.earth  = world.CelestialBody(body=world.EARTH, sky=sky)
    w.sun    = world.CelestialBody(body=world.SUN, sky=sky)

    # The wheels are those that flight believes in, at rest.
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)

    # The size and shape of table 2.1, over Mars' equator by and large. Tumbling.
    w.craft  = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], sky=sky, gravity=[MARS, world.SUN],
        orbit=Orbit(MARS, a=7471.618 * km, e=0.4, i=37 * deg, Omega=48 * deg, f=270 * deg),
        sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.001, -0.01, 0.03] * rad / s)

    w.nav    = world.Navigation()

    w.connect(
        w.craft.state   >> w.nav.truth,

        # what flight sees
        w.nav.attitude  >> f.tracking.attitude,
        w.nav.orbit     >> f.guidance.orbit,
        w.earth.state   >> f.guidance.primary,
        w.sun.state     >> f.guidance.secondary,
        w.wheels.speeds >> f.control.speeds,

        # what flight does
        f.motor.command >> w.wheels.command,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
    w.task("ephemeris", every=500 * ms, run=[w.earth, w.sun])
