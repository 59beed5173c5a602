# SPDX-License-Identifier: Apache-2.0
"""The truth of each spacecraft: the orbit of the nadir spin at Mars, the deputy half a degree behind, 55 km."""
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, rad, s

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, control, wheels, f, orbits):
    """control: the flight process that controls it; wheels: of its configuration; orbits: inputs for its orbit."""
    w.wheels = world.ReactionWheels(axes_B=wheels.axes_B, J=wheels.J, u_max=0.2 * N * m)
    w.craft  = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[MARS],
        orbit=Orbit(MARS, a=7471.618 * km, e=0.4, i=37 * deg, f=f),
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
    """A camera of the spacecraft `w` that sees where another one is and how it points."""
    w.camera = world.CraftSensor(range_share=1e-4, bearing_noise=1e-5 * rad, velocity_noise=1e-3 * m / s,
                                 attitude_noise=1e-4 * rad, rate_noise=1e-7 * rad / s)
    w.connect(
        w.craft.state     >> w.camera.truth,
        other.craft.state >> w.camera.other,
        w.camera.seen     >> flight.seen.seen,
        w.nav.attitude    >> flight.seen.own,
        w.nav.orbit       >> flight.seen.orbit,
    )
    w.task("camera", every=500 * ms, run=[w.camera])
