# SPDX-License-Identifier: Apache-2.0
"""The truth: chief and deputy in a low orbit of the Earth, a few hundred metres apart at first."""
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, rad, s

from .flight import MASS, RCS


def build(w, f):
    orbit = dict(a=6878 * km, e=0.0005, i=51.6 * deg)

    w.chief  = world.Spacecraft(I_B=[8, 8, 8] * kg * m**2, gravity=[world.EARTH],
                                orbit=Orbit(world.EARTH, **orbit, f=0.004 * deg))
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=f.wheels.u_max)
    w.rcs    = world.Thrusters(**RCS, F=0.5 * N, rise=2 * ms, fall=2 * ms)
    w.craft  = world.Spacecraft(
        mass=MASS, I_B=[8, 8, 8] * kg * m**2, parts=[w.wheels, w.rcs], gravity=[world.EARTH],
        orbit=Orbit(world.EARTH, **orbit),
        sigma_BN=[0.2, 0, 0], omega_BN_B=[0, 0, 0.001] * rad / s)

    w.nav    = world.Navigation()
    w.camera = world.CraftSensor(range_noise=0.1 * m, bearing_noise=1e-4 * rad, velocity_noise=1e-3 * m / s)

    w.connect(
        w.craft.state   >> [w.nav.truth, w.camera.truth],
        w.chief.state   >> w.camera.other,

        # what flight sees
        w.nav.attitude  >> [f.tracking.attitude, f.chief.own, f.keeping.attitude],
        w.nav.orbit     >> [f.guidance.orbit, f.chief.orbit, f.keeping.orbit],
        w.camera.seen   >> f.chief.seen,
        w.wheels.speeds >> [f.control.speeds, f.dump.speeds],

        # what flight does
        f.motor.command >> w.wheels.command,
        f.firing.times  >> w.rcs.times,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=250 * ms, run=[w.chief, w.craft, w.nav, w.camera])
