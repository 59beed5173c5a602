# SPDX-License-Identifier: Apache-2.0
"""What flies, in each of many spacecraft: the antenna on the one ahead, as it says where it is."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s

PERIOD = 0.5 * s


def build(f):
    # The nominal vehicle. The true ones differ a little from it and from one another.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # The spacecraft behind reads this message half a second later.
    f.beacon   = fsw.OrbitBeacon(lead=PERIOD)

    # b1 points at the spacecraft ahead; b2 as nearly as possible at the one behind.
    f.guidance = fsw.TwoBodyPointing(separation_min=0.5 * deg)
    f.tracking = fsw.TrackingError()

    # Control: gains of table 2.2.
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        # from where to point to what the wheels do
        f.guidance.reference >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,

        # what the control law knows of the vehicle
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
    )
    f.task("gnc", every=PERIOD, run=[f.beacon, f.guidance, f.tracking, f.control, f.motor])
