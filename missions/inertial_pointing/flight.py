# SPDX-License-Identifier: Apache-2.0
"""What flies: a reference that rests, tracked with a pyramid of four wheels."""
from fledge import flight as fsw
from fledge.units import N, kg, m, s


def build(f):
    # The vehicle, as flight knows it.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Guidance: the axes of N.
    f.guidance = fsw.InertialPointing(sigma_RN=[0, 0, 0])
    f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 0])

    # Control: gains of table 2.2. Flight does not know the wheels' speeds; their momentum then disturbs
    # the body while it turns, but not at rest.
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        # from where to point to what the wheels do
        f.guidance.reference >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,

        # what the control law knows of the vehicle
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> f.motor.wheels,
    )
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.tracking, f.control, f.motor])
