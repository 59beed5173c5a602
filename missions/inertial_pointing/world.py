# SPDX-License-Identifier: Apache-2.0
"""The truth: a rigid body that tumbles at Mars, four wheels, perfect navigation."""
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, rad, s

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f, latency=0):
    # The wheels are those that flight believes in, at rest.
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)

    # Table 2.1.
    w.craft  = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[MARS],
        orbit=Orbit(MARS, a=7471.618 * km, e=0.4, f=270 * deg),
        sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.001, -0.01, 0.03] * rad / s)

    w.nav    = world.Navigation()

    w.connect(
        w.craft.state    >> w.nav.truth,

        # The two messages between the computers. With latency 1 each program reads what the other had
        # half a second ago, so that both can run at the same time.
        (w.nav.attitude  >> f.tracking.attitude).latency(latency),
        (f.motor.command >> w.wheels.command).latency(latency),
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
