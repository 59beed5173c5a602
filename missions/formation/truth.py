# SPDX-License-Identifier: Apache-2.0
"""The truth of each spacecraft: the orbit of the nadir spin at Mars, the deputy half a degree behind, 55 km."""
from fledge import Orbit, world
from fledge.units import N, deg, km, kg, m, ms, rad, s


def build(w, control, wheels, f, orbits):
    """control: the flight process that controls it; wheels: of its configuration; orbits: inputs for its orbit."""
    w.wheels = world.ReactionWheels(axes_B=wheels.axes_B, J=wheels.J, u_max=0.2 * N * m)
    w.craft  = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[world.MARS],
        orbit=Orbit(world.MARS, a=7471.618 * km, e=0.4, i=37 * deg, f=f),
        sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.001, -0.01, 0.03] * rad / s)
    w.nav    = world.Navigation()
    w.connect(
        w.craft.state         >> w.nav.truth,
        w.nav.attitude        >> control.tracking.attitude,
        w.nav.orbit           >> orbits,
        w.wheels.speeds       >> control.control.speeds,
        control.motor.command >> w.wheels.command,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=250 * ms, run=[w.craft, w.nav])


def see(w, other, flight):
    """A sensor of the spacecraft `w` that sees the attitude of another one, with the noise of a camera."""
    w.camera = world.Navigation(attitude_noise=[1e-4] * 3 * rad, rate_noise=[1e-7] * 3 * rad / s)
    w.connect(other.craft.state >> w.camera.truth, w.camera.attitude >> flight.base.sensed)
    w.task("camera", every=500 * ms, run=[w.camera])
