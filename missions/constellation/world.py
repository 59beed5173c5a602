# SPDX-License-Identifier: Apache-2.0
"""The truth of each spacecraft: its position in a ring about Mars, its slightly different body, its tumble."""
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, rad, s

GOLDEN = 0.6180339887498949    # the fractions of its multiples are spread evenly

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f, number, count):
    """number: of the spacecraft, from 0; count: of all spacecraft."""
    def spread(k):
        """From -1 to 1, spread evenly over the spacecraft; another sequence for each k."""
        return 2 * ((number + 1) * GOLDEN * k % 1.0) - 1

    # Wheels of one batch, at rest.
    w.wheels = world.ReactionWheels(
        axes_B=f.wheels.axes_B, J=(1 + 0.01 * spread(1)) * f.wheels.J[0] * kg * m**2, u_max=0.2 * N * m)

    # Inertias within 2 percent; orbits within a tenth of a degree and 20 km, evenly spaced.
    w.craft  = world.Spacecraft(
        I_B=[700 + 14 * spread(2), 700 + 14 * spread(3), 800 + 16 * spread(5)] * kg * m**2,
        parts=[w.wheels], gravity=[MARS],
        orbit=Orbit(MARS, a=9500 * km, e=0.001 * (1 + spread(7)), i=(35 + 0.1 * spread(11)) * deg,
                    f=360 * deg * number / count),
        sigma_BN=[0.2 * spread(13), 0.2 * spread(17), 0.2 * spread(19)],
        omega_BN_B=[0.01 * spread(23), 0.01 * spread(29), 0.01 * spread(31)] * rad / s)

    # The size of errors of a star tracker with a gyro, and of a radio fix.
    w.nav    = world.Navigation(attitude_noise=[2e-5] * 3 * rad, rate_noise=[1e-6] * 3 * rad / s,
                                position_noise=[10] * 3 * m)

    w.connect(
        w.craft.state   >> w.nav.truth,

        # what flight sees
        w.nav.attitude  >> f.tracking.attitude,
        w.nav.orbit     >> [f.guidance.orbit, f.beacon.orbit],
        w.wheels.speeds >> f.control.speeds,

        # what flight does; by latency 1 each world runs beside its flight computer and all the others
        (f.motor.command >> w.wheels.command).latency(1),
    )
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
