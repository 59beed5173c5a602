# SPDX-License-Identifier: Apache-2.0
"""What flies: a roll and then a pitch at constant rates, a spiral about an inertial direction."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s

# The thesis gives no rates. A turn takes 20 minutes, in which the boresight moves 3 deg outward.
TURN    = 0.3 * deg / s
OUTWARD = 0.0025 * deg / s


def build(f):
    # The vehicle, as flight knows it.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Guidance (figure 2.13): a direction that rests in N, a roll about it, and a pitch in the rolled
    # frame that grows. The pitch is the distance of the boresight b1 from the centre, the roll its direction.
    f.guidance = fsw.InertialPointing(sigma_RN=[0, 0, 0])
    f.turn     = fsw.EulerRotation(rates=[0, 0, 1] * TURN)
    f.tilt     = fsw.EulerRotation(rates=[0, 1, 0] * OUTWARD)
    f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 0])

    # Control: gains of table 2.2.
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        # from where to point to what the wheels do
        f.guidance.reference >> f.turn.base,
        f.turn.reference     >> f.tilt.base,
        f.tilt.reference     >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,

        # what the control law knows of the vehicle
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
    )
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.turn, f.tilt, f.tracking, f.control, f.motor])
