# SPDX-License-Identifier: Apache-2.0
"""The deputy's computer: a base from the chief, commanded by radio or seen by a sensor, and an asterisk about it."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s

# Table 2.4 of the thesis, with its narrow lines, entered early by half of alpha: see missions/asterisk_scan.
ALPHA = 8 * deg
BEGIN = [[1, 0, 0], [-1, -1, 0], [1, -1, 0], [0, 1, 0]]
ALONG = [[-1, 0, 0], [1, 1, 0], [-1, 1, 0], [0, -1, 0]]
LINE  = 1200 * s
LEAD  = 0.25 * LINE


def build(f, chief):
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Of its own: b1 on the chief, by the chief's beacon.
    f.look     = fsw.TwoBodyPointing(separation_min=1 * deg)
    # The chief's attitude, by the camera and the deputy's own.
    f.seen     = fsw.SeenTarget(hold=5 * s)

    f.base     = fsw.BaseReference(hold=10 * s, source="COMMANDED")

    f.rasters  = fsw.RasterManager(
        angles=[[b - 0.5 * a for a, b in zip(along, begin)] for along, begin in zip(ALONG, BEGIN)] * ALPHA,
        rates=ALONG * (2 * ALPHA / LINE), durations=[LINE + LEAD] * 4)
    f.scan     = fsw.EulerRotation()
    f.tracking = fsw.TrackingError()
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        # by radio, an exchange late
        (chief.offset.reference >> f.base.commanded).latency(1).stale_after(5 * s),
        (chief.beacon.body      >> f.look.primary).latency(1),

        f.seen.attitude         >> f.base.sensed,
        f.look.reference        >> f.base.own,
        f.base.reference        >> f.scan.base,
        f.rasters.command       >> f.scan.command,
        f.scan.reference        >> f.tracking.reference,
        f.tracking.error        >> f.control.error,
        f.control.torque        >> f.motor.torque,
        f.vehicle.vehicle       >> f.control.vehicle,
        f.wheels.wheels         >> [f.control.wheels, f.motor.wheels],
    )
    f.task("navigation", every=1 * s, priority=1, run=[f.look])
    f.task("gnc", every=0.5 * s, run=[f.seen, f.base, f.rasters, f.scan, f.tracking, f.control, f.motor])
