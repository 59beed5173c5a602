# SPDX-License-Identifier: Apache-2.0
"""The truth: a rigid body with four wheels far from everything, and the units of the boards."""
from fledge import Orbit, world
from fledge.units import A, N, V, kg, km, m, minute, ms, s

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)
    w.craft  = world.Spacecraft(I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[MARS],
                                orbit=Orbit(MARS, a=7471.618 * km, e=0.1))
    w.nav    = world.Navigation()
    w.units  = world.Units(s_N=[0.6, 0, 0.8], current=0.008 * A, motor=0.025 * N * m / V, burns_from=5 * minute,
                           full=20 * minute)
    w.connect(
        w.craft.state     >> [w.nav.truth, w.units.truth],
        w.units.motors    >> w.wheels.command,

        # what flight sees
        w.nav.attitude    >> f.tracking.attitude,
        w.wheels.speeds   >> f.control.speeds,
        w.units.sun       >> f.avionics.sun,
        w.units.reply     >> f.avionics.reply,
        w.units.cards     >> f.avionics.cards,
        w.units.bus       >> f.avionics.bus,
        w.units.request   >> f.avionics.request,
        w.units.recorder  >> f.avionics.recorder,

        # what flight does
        f.motor.command   >> w.units.torques,
        f.avionics.volts  >> w.units.volts,
        f.avionics.power  >> w.units.power,
        f.avionics.burn   >> w.units.burn,
        f.avionics.mode   >> w.units.flown,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav, w.units])
