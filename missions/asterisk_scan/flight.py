# SPDX-License-Identifier: Apache-2.0
"""What flies: four lines through one inertial direction, an asterisk, and back to where it began."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s

# Table 2.4: yaw, pitch and roll where each line begins, in units of alpha, and the way it runs. The
# fifth is the way back, to the point where the first began.
BEGIN = [[1, 0, 0], [-1, -1, 0], [1, -1, 0], [0, 1, 0], [1, 0, 0]]
ALONG = [[-1, 0, 0], [1, 1, 0], [-1, 1, 0], [0, -1, 0], [0, 0, 0]]
LINE  = 1600 * s


def asterisk(alpha, lead=0.0):
    """The rasters for lines from -alpha to alpha, each LINE long, entered `lead` alpha before it begins.

    The lead is flown at the rate of the line, so it takes lead / 2 of its time.
    """
    rate  = 2 * alpha / LINE
    early = [[b - lead * a for a, b in zip(along, begin)] for along, begin in zip(ALONG, BEGIN)]
    return {"angles": early * alpha, "rates": ALONG * rate, "durations": ([1 + lead / 2] * 4 + [3]) * LINE}


def build(f):
    # The vehicle, as flight knows it.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Guidance: a direction that rests in N, and Euler angles that a list of rasters commands.
    f.guidance = fsw.InertialPointing(sigma_RN=[0, 0, 0])
    f.rasters  = fsw.RasterManager(**asterisk(8 * deg, lead=0.5))
    f.scan     = fsw.EulerRotation()
    f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 0])

    # Control: gains of table 2.2.
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        # from where to point to what the wheels do
        f.guidance.reference >> f.scan.base,
        f.rasters.command    >> f.scan.command,
        f.scan.reference     >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,

        # what the control law knows of the vehicle
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
    )
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.rasters, f.scan, f.tracking, f.control, f.motor])
