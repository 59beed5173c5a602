# SPDX-License-Identifier: Apache-2.0
"""The truth: a polar orbit about the Earth's field of degree 4, four wheels of which one may seize."""
from fledge import Orbit, world
from fledge.units import MHz, N, deg, kg, km, m, ms, rad, s

from .flight import STATION


def build(w, f):
    # A pass over the station is from 17 to 26 minutes later.
    sky = world.Sky("2026-03-20T10:00:00", center=world.EARTH)
    w.sun    = world.CelestialBody(body=world.SUN, sky=sky)

    # The wheels are those that flight believes in, at rest.
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=f.wheels.u_max)

    w.craft  = world.Spacecraft(
        I_B=[12, 10, 8] * kg * m**2, parts=[w.wheels], sky=sky, gravity=[world.EARTH.zonal(4), world.SUN],
        orbit=Orbit(world.EARTH, a=6978 * km, e=0.001, i=97.8 * deg, Omega=30 * deg, f=0 * deg),
        sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.001, -0.01, 0.02] * rad / s)

    w.nav     = world.Navigation()
    w.station = world.GroundStation(body=world.EARTH, sky=sky, **STATION)

    # S band: 1 W to a patch beside the camera; a dish of 3 m, and 200 W to it.
    w.radio   = world.Radio(
        station=w.station, sky=sky, axis_B=[1, 0, 0], beam=70 * deg, floor_dB=20,
        down_frequency=2250 * MHz, down_eirp_dBW=6, down_g_t_dBK=13, down_loss_dB=3, down_rate=2e6 / s,
        down_code="CONVOLUTIONAL", down_required_dB=2,
        up_frequency=2050 * MHz, up_eirp_dBW=30, up_g_t_dBK=-22, up_loss_dB=3, up_rate=16e3 / s, up_required_dB=8)

    w.connect(
        w.craft.state   >> [w.nav.truth, w.station.truth, w.radio.truth],

        # what flight sees
        w.nav.attitude  >> f.tracking.attitude,
        w.nav.orbit     >> [f.hill.orbit, f.station.orbit, f.link.orbit],
        w.sun.state     >> f.link.secondary,
        w.wheels.speeds >> [f.servo.speeds, f.monitor.speeds, f.balance.speeds],

        # what flight does
        f.balance.command >> w.wheels.command,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav, w.station, w.radio])
    w.task("ephemeris", every=500 * ms, run=[w.sun])
