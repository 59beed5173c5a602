# SPDX-License-Identifier: Apache-2.0
"""What flies: a solar telescope on control moment gyros finds the Sun by a fine sun sensor and a gyro, and keeps to it.
The ground speaks with it in frames."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, rad, s

# Four gyros in a pyramid; at angle 0 their wheels turn in a ring, without momentum together.
GIMBALS, SPINS = fsw.PYRAMID, [[-y, x, 0] for x, y, _ in fsw.PYRAMID]
J, OMEGA = 0.01 * kg * m**2, 600 * rad / s
RATE_MAX = 1 * rad / s


def build(f):
    f.vehicle  = fsw.VehicleConfig(I_B=[90, 80, 60] * kg * m**2)

    # The telescope looks along b1. While the sensor does not see the Sun, the body turns about b2.
    f.safe     = fsw.SunSafe(axis_B=[1, 0, 0], search_B=[0, 2, 0] * deg / s, hold=2 * s)
    f.control  = fsw.MrpFeedback(K=40 * N * m, P=45 * N * m * s)
    f.steering = fsw.GimbalSteering(n=4, H=J * OMEGA, axes_B=GIMBALS, spins_B=SPINS, rate_max=RATE_MAX)

    # Commands come in CLTUs and in sequence, telemetry leaves in frames.
    f.space    = fsw.SpaceLink(spacecraft=68, cop1=1, cltu=1, segments=1, tc_random=1, tm_random=1, idle=10 * s)

    # Flight judges requirements of requirements.py itself, and the ground sees what it finds.
    f.judge    = fsw.RequirementMonitor()

    f.connect(
        f.safe.error      >> f.control.error,
        f.control.torque  >> f.steering.torque,
        f.vehicle.vehicle >> f.control.vehicle,
    )
    f.task("gnc", every=0.2 * s, run=[f.safe, f.control, f.steering, f.judge])
    f.task("link", every=1 * s, run=[f.space])
