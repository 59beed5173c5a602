# SPDX-License-Identifier: Apache-2.0
"""What flies: an inertial attitude, and the manager of the units."""
from fledge import flight as fsw
from fledge.units import N, V, K, kg, m, s


def build(f):
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)
    f.guidance = fsw.InertialPointing(sigma_RN=[0.1, 0, 0])
    f.tracking = fsw.TrackingError()
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()
    f.avionics = fsw.Avionics(motor=0.025 * N * m / V, cold=290 * K, warm=4 * K,
                              volts_min=20 * V)
    f.connect(
        f.guidance.reference >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,
        f.motor.command      >> f.avionics.torques,
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
    )
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.tracking, f.control, f.motor, f.avionics])
