# SPDX-License-Identifier: Apache-2.0
"""The truth: a low orbit with eclipses, a body that tumbles, sensors that are coarse."""
from fledge import Orbit, world
from fledge.units import A, N, deg, hour, kg, km, m, minute, ms, rad, s

from .flight import OFFSETS, SCALES, SUN_SENSORS


def build(w, f):
    sky = world.Sky("2026-03-20T10:00:00", center=world.EARTH)
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=f.wheels.u_max)
    w.craft  = world.Spacecraft(
        I_B=[90, 80, 60] * kg * m**2, parts=[w.wheels], sky=sky, gravity=[world.EARTH],
        orbit=Orbit(world.EARTH, a=6878 * km, e=0.001, i=51.6 * deg, f=270 * deg),
        sigma_BN=[0.3, -0.4, 0.2], omega_BN_B=[2, -3, 1.5] * deg / s)
    w.light  = world.Sunlight(sun=world.SUN, shadows=[world.EARTH], sky=sky)

    # A converter for each pyramid. From 8 minutes on one channel of A stays at its end.
    w.css    = world.CoarseSunSensors(**SUN_SENSORS)
    w.adc_a  = world.SunSensorConverter(n=4, bits=12, scale=SCALES[0], offset=OFFSETS[0], noise=1e-5 * A,
                                        faults=[{"kind": "HIGH", "channels": 1 << 3, "begin": 8 * minute}])
    w.adc_b  = world.SunSensorConverter(n=4, first=4, bits=12, scale=SCALES[1], offset=OFFSETS[1], noise=1e-5 * A)
    w.gyro   = world.Gyro(noise=[(0.15 * deg)**2 / hour] * 3, bias=[0.02, -0.01, 0.015] * deg / s)

    w.connect(
        w.craft.state   >> [w.light.truth, w.css.truth, w.gyro.truth],
        w.light.light   >> w.css.light,
        w.css.currents  >> [w.adc_a.currents, w.adc_b.currents],

        # what flight sees
        w.adc_a.counts  >> f.sun.a,
        w.adc_b.counts  >> f.sun.b,
        w.gyro.rate     >> [f.line.gyro, f.safe.rate, f.tumble.rate],
        w.wheels.speeds >> f.control.speeds,

        # what flight does
        f.motor.command >> w.wheels.command,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.craft, w.light, w.css, w.adc_a, w.adc_b, w.gyro])
