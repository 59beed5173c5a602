# SPDX-License-Identifier: Apache-2.0
"""What flies, in each of many spacecraft: the antenna on the one ahead, as it says where it is."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s

PERIOD = 0.5 * s


def build(f):
    # The vehicle as all of them should be; none is quite so.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # What is said is read by the one behind half a second later.
    f.beacon   = fsw.OrbitBeacon(lead=PERIOD)

    # b1 looks along the chord to the one ahead, b2 towards the one behind as nearly as that allows.
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
