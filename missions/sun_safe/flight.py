# SPDX-License-Identifier: Apache-2.0
"""What flies: from a tumble to the Sun, by coarse sun sensors and gyros alone; no attitude is known."""
from fledge import flight as fsw
from fledge.units import A, N, deg, kg, m, mA, rad, s

# Two pyramids of four sensors, about b3 and -b3, each with a converter. The Sun on b1 lights two of each.
SUN_SENSORS = dict(axes_B=fsw.SUN_PYRAMIDS, current=[5] * 8 * mA)
SCALES, OFFSETS = [2e-6, 2.5e-6] * A, [0, -1e-5] * A
FAST, SLOW = 1 * deg / s, 0.1 * deg / s


def build(f):
    f.vehicle  = fsw.VehicleConfig(I_B=[90, 80, 60] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.05 * kg * m**2, u_max=0.2 * N * m)

    # The direction to the Sun: least squares of what the sensors see, and a filter with the gyros, which goes on in the
    # shadow.
    f.sun      = fsw.SunPyramids(**SUN_SENSORS, scale=SCALES, offset=OFFSETS, dark=0.1, differ=0.02, persistence=20)
    f.line     = fsw.SunLine(noise=0.01, length=0.02, rate_noise=1e-8 * rad**2 / s, walk=1e-14 * rad**2 / s**3,
                             rate_std=1e-3 * rad / s, gate=5, good=2 * deg, hold=5 * s, persistence=100)

    # Solar panels look along b1. Without a direction to the Sun the body turns about b2 until there is one.
    f.safe     = fsw.SunSafe(axis_B=[1, 0, 0], search_B=[0, 0.5, 0] * deg / s, hold=60 * s)
    f.control  = fsw.MrpFeedback(K=6 * N * m, P=24 * N * m * s)
    f.motor    = fsw.WheelTorques()

    # While the body tumbles, it only points; once it has been slow for a minute, it spins about the line to the Sun.
    f.tumble   = fsw.RateLimit(rate_max=FAST, persistence=2, release=120)

    f.connect(
        f.sun.cosines     >> f.line.cosines,
        f.line.heading    >> f.safe.sun,
        f.safe.error      >> f.control.error,
        f.control.torque  >> f.motor.torque,
        f.vehicle.vehicle >> f.control.vehicle,
        f.wheels.wheels   >> [f.control.wheels, f.motor.wheels],
    )
    f.task("gnc", every=0.5 * s, run=[f.sun, f.line, f.tumble, f.safe, f.control, f.motor])

    state, safe = f.watch(f.tumble.state), f.watch(f.safe)
    f.event("calm", when=(state.tripped == 0) & (state.trips > 0), set=[(safe.spin, SLOW)])
    f.event("tumbles", when=state.tripped == 1, set=[(safe.spin, 0 * rad / s)])
