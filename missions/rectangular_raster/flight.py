# SPDX-License-Identifier: Apache-2.0
"""What flies: five parallel lines across the planet below, there and back, again and again."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s

# The thesis draws this pattern (figure 2.6a) without numbers; these fill its 9600 s with two passes.
# The swath is +-6 deg wide; the lines reach 2 deg beyond, where the body turns into the next one.
SWATH  = 6                      # [deg]
END    = 8                      # [deg] yaw at the ends of the lines
PITCH  = [6, 3, 0, -3, -6]      # [deg] of the lines
SETTLE = 200                    # [s] at the first corner
LINE   = 800                    # [s] along a line
STEP   = 100                    # [s] from one line to the next
BACK   = 200                    # [s] from the last corner to the first


def raster():
    """The rasters of one pass: yaw, pitch and roll where each begins, their rates, and durations."""
    corner = [END, PITCH[0], 0]
    angles, rates, durations = [corner], [[0.0, 0.0, 0.0]], [SETTLE]
    side = 1
    for here, there in zip(PITCH, PITCH[1:] + [None]):
        angles += [[side * END, here, 0]]
        rates += [[-side * 2 * END / LINE, 0, 0]]
        durations += [LINE]
        side = -side
        if there is not None:
            angles += [[side * END, here, 0]]
            rates += [[0, (there - here) / STEP, 0]]
            durations += [STEP]
    last = [side * END, PITCH[-1], 0]
    return {"angles": (angles + [last]) * deg,
            "rates": (rates + [[(b - a) / BACK for a, b in zip(last, corner)]]) * deg / s,
            "durations": (durations + [BACK]) * s}


def build(f):
    # The vehicle, as flight knows it.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Guidance: the Hill frame, turned by Euler angles that a list of rasters commands. The control
    # frame is turned by 180 degrees about b3, so that b1 looks down, not up.
    f.guidance = fsw.HillPointing()
    f.rasters  = fsw.RasterManager(repeat=1, **raster())
    f.scan     = fsw.EulerRotation()
    f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 1])

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
