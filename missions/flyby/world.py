# SPDX-License-Identifier: Apache-2.0
"""The truth: a hyperbola past Mars on 2 March 2015, pulled at by Sun and Jupiter, a rigid body, four wheels."""
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, rad, s

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f):
    # N has the axes of J2000 and its origin in Mars.
    sky = world.Sky("2015-03-02T12:00:00", center=MARS)

    # The wheels are those that flight believes in, at rest.
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)

    # 500 km above the ground at periapsis, 80 minutes ahead, with 2.96 km/s left far from Mars.
    w.craft  = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], sky=sky,
        gravity=[MARS, world.SUN, world.JUPITER_SYSTEM],
        orbit=Orbit(MARS, rp=3897 * km, e=1.8, i=30 * deg, Omega=60 * deg, f=-103.8 * deg),
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
