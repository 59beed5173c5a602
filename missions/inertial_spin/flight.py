# SPDX-License-Identifier: Apache-2.0
"""What flies: a spin at a constant rate about an axis at rest, tracked with a pyramid of four wheels."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s


def build(f):
    # The vehicle, as flight knows it.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Guidance: a frame R0 at rest, and a spin about its third axis at the rate of table 2.3.
    f.guidance = fsw.InertialPointing(sigma_RN=[0.1, -0.2, 0.05])
    f.spin     = fsw.InertialSpin(omega_RR0_R0=[0, 0, 0.3] * deg / s)
    f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 0])

    # Control: gains of table 2.2.
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        # from where to point to what the wheels do
        f.guidance.reference >> f.spin.base,
        f.spin.reference     >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,

        # what the control law knows of the vehicle
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
    )
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.spin, f.tracking, f.control, f.motor])
