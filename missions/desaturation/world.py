# SPDX-License-Identifier: Apache-2.0
"""The truth: a low orbit in a dipole field that turns with the Earth; wheels that begin with momentum."""
from fledge import Orbit, world
from fledge.units import N, T, deg, kg, km, m, minute, ms, rad, s

from .flight import RCS, RODS


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=f.wheels.u_max,
                                    Omega=[60, 20, -10, 40] * rad / s)
    w.field  = world.Magnetism(body=world.EARTH, dipole_P=[-3.6e14, 1.2e15, -7.6e15] * T * m**3,
                               spin=7.292115e-5 * rad / s)
    w.rods   = world.TorqueRods(**RODS, field=w.field)
    w.rcs    = world.Thrusters(**RCS, F=1 * N, rise=2 * ms, fall=2 * ms)

    w.craft  = world.Spacecraft(
        mass=200 * kg, I_B=[90, 80, 60] * kg * m**2, parts=[w.wheels, w.rods, w.rcs], gravity=[world.EARTH],
        orbit=Orbit(world.EARTH, a=6878 * km, e=0.001, i=51.6 * deg),
        sigma_BN=[0.24, 0.01, -0.02], omega_BN_B=[0, 0, 0.001] * rad / s)

    w.nav    = world.Navigation()
    w.gps    = world.GpsReceiver(position_noise=[2] * 3 * m, velocity_noise=[0.03] * 3 * m / s, wander=[5] * 3 * m,
                                 wander_time=10 * minute)
    w.tam    = world.Magnetometer(noise=[(3e-8 * T)**2 * s] * 3, bias=[5e-8, -3e-8, 2e-8] * T)

    w.connect(
        w.craft.state    >> [w.nav.truth, w.gps.truth, w.field.truth, w.tam.truth],
        w.field.field    >> w.tam.field,

        # what flight sees
        w.nav.attitude   >> f.tracking.attitude,
        w.gps.orbit      >> f.guidance.orbit,
        w.wheels.speeds  >> [f.control.speeds, f.surplus.speeds, f.excess.speeds],
        w.tam.measured   >> f.magnetic.field,

        # what flight does
        f.motor.command    >> w.wheels.command,
        f.magnetic.command >> w.rods.command,
        f.firing.times     >> w.rcs.times,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav, w.gps, w.field, w.tam])
