# SPDX-License-Identifier: Apache-2.0
"""What flies: the body follows the Hill frame, with a wheel on each axis."""
from fledge import flight as fsw
from fledge.units import N, kg, m, s


def build(f):
    # The vehicle.
    f.vehicle  = fsw.VehicleConfig(I_B=[40, 35, 30] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], J=0.01 * kg * m**2, u_max=0.1 * N * m)

    # From the attitude reference to the wheel torques. Add a module of your own here, such as that which
    # `fledge new module Offset --kind guidance` begins,
    #     f.offset = fsw.Offset(sigma_RR0=[0, 0, 0.1])
    # wire it in connect(), and add it to the list of the task.
    f.guidance = fsw.HillPointing()
    f.tracking = fsw.TrackingError()
    f.control  = fsw.MrpFeedback(K=0.2 * N * m, P=3 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        f.guidance.reference >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,

        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
    )
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.tracking, f.control, f.motor])
