# SPDX-License-Identifier: Apache-2.0
"""What flies: three spirals side by side, one stack of rotations commanded by lists of rasters."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s

# The thesis gives no numbers. Each spiral has three turns of 15 minutes, 2 deg apart, and its centre
# (yaw, pitch, roll) is 14 deg from the others', so that they stay apart. Before each the body comes
# to rest on its centre; after the last it returns to the middle.
CENTRES = [[-7, -4, 0], [7, -4, 0], [0, 8, 0], [0, 0, 0]] * deg
SETTLE  = 300 * s
SPIRAL  = 2700 * s
TURN    = 0.4 * deg / s
OUTWARD = 6 * deg / SPIRAL

REST    = [0, 0, 0]


def build(f):
    # The vehicle, as flight knows it.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Guidance (figure 2.17): the stack of the single spiral on top of one more rotation, to the centre
    # of the spiral. All three take commands: settle, spiral, settle, spiral, settle, spiral, rest.
    phases = [SETTLE.value, SPIRAL.value] * 3 + [SPIRAL.value]
    f.guidance = fsw.InertialPointing(sigma_RN=[0, 0, 0])
    f.centres  = fsw.RasterManager(angles=CENTRES, rates=[REST] * 4, durations=[1, 1, 1, 1] * (SETTLE + SPIRAL))
    f.centre   = fsw.EulerRotation()
    f.turns    = fsw.RasterManager(
        angles=[REST] * 7, rates=([REST, [0, 0, 1]] * 3 + [REST]) * TURN, durations=phases)
    f.turn     = fsw.EulerRotation()
    f.tilts    = fsw.RasterManager(
        angles=[REST] * 7, rates=([REST, [0, 1, 0]] * 3 + [REST]) * OUTWARD, durations=phases)
    f.tilt     = fsw.EulerRotation()
    f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 0])

    # Control: gains of table 2.2.
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        # from where to point to what the wheels do
        f.guidance.reference >> f.centre.base,
        f.centre.reference   >> f.turn.base,
        f.turn.reference     >> f.tilt.base,
        f.tilt.reference     >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,

        # the commands to the rotations
        f.centres.command    >> f.centre.command,
        f.turns.command      >> f.turn.command,
        f.tilts.command      >> f.tilt.command,

        # what the control law knows of the vehicle
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
    )
    f.task("gnc", every=0.5 * s, run=[
        f.guidance, f.centres, f.centre, f.turns, f.turn, f.tilts, f.tilt, f.tracking, f.control, f.motor])
