# SPDX-License-Identifier: Apache-2.0
"""What flies on the flat-sat: an inertial attitude, by wheels that take counts and give counts; the attitude by star
tracker and gyros through their electronics; the direction to the Sun by two pyramids of sensors, the vehicle's time,
loads, burns, a count of the computer's starts, and files."""
from fledge import flight as fsw
from fledge.units import A, N, V, kg, m, mA, ms, ohm, rad, s, us

# The data sheets of the avionics, which the world has too.
MOTOR = dict(bits=16, volts=10 * V, torque_constant=0.05 * N * m / A, resistance=2 * ohm, back_emf=0.05 * V * s)
TACHOMETER = dict(marks=1024, window=500 * ms)
SUN_SENSORS = dict(axes_B=fsw.SUN_PYRAMIDS, current=[5] * 8 * mA)
SCALES, OFFSETS = [2e-6, 2.5e-6] * A, [0, -1e-5] * A
TRACKER = dict(bits=31, sigma_SB=[0.1, -0.2, 0.3], residual=1e-6 * rad, tick=1 * ms)
GYROS = dict(bits=24, scale=1e-7 * rad, tick=1 * ms)
ARRAYS = dict(step=1e-3 * rad, count=5e-4 * rad)
LOADS = {"wheels": 0, "sensors": 1, "propulsion": 2,     # of the first switch card
         "recorder": 8, "arrays": 9}                      # of the second one


def build(f):
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # From the attitude to the motors.
    f.speeds   = fsw.TachometerSpeeds(**TACHOMETER)
    f.guidance = fsw.InertialPointing(sigma_RN=[0.1, 0, 0])
    f.tracking = fsw.TrackingError()
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()
    f.drive    = fsw.WheelDriveCounts(**MOTOR)

    # The attitude by star tracker and gyros.
    f.stars    = fsw.StarTrackerAttitude(**TRACKER, about=8, age_max=2 * s)
    f.gyros    = fsw.GyroRates(**GYROS, rate_max=0.5 * rad / s)
    f.filter   = fsw.AttitudeMekf(rate_noise=1e-12 * rad**2 / s, bias_walk=1e-18 * rad**2 / s**3,
                                  bias_std=1e-4 * rad / s, star_std=1e-5 * rad, gate=30, hold=3 * s, coast=30 * s,
                                  persistence=3)

    # The other units.
    f.sun      = fsw.SunPyramids(**SUN_SENSORS, scale=SCALES, offset=OFFSETS, dark=0.02, differ=0.005, persistence=10)
    f.arrays   = fsw.ArrayPointing(**ARRAYS, axes_B=[[0, 1, 0], [0, -1, 0]], normals_B=[[0, 0, 1]] * 2,
                                   dead_band=0.02 * rad, persistence=10 * s)
    f.time     = fsw.VehicleTime(pulse=1 * s, jam_beyond=10 * ms, allowed=20 * us)
    f.boot     = fsw.BootCount(slot=3)
    f.power    = fsw.PowerManager(on=sum(1 << load for load in LOADS.values()), clears=2, clear_after=10 * s,
                                  silent_after=2 * s)
    f.plan     = fsw.BurnSchedule(ahead=5 * s, start=[30, 62, 90, 91, 120] * s, thruster=[0, 1, 2, 2, 3],
                                  duration=[0.25, 1, 0.1, 0.3, 2] * s)
    f.burns    = fsw.PropulsionManager(n=4, armed=1, persistence=1 * s, silent_after=2 * s)
    f.files    = fsw.Files(entity=2, ground=1, rate=2000, allowed=0b1111, kept=1)

    f.connect(
        f.guidance.reference >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,
        f.motor.command      >> f.drive.command,
        f.speeds.speeds      >> [f.control.speeds, f.drive.speeds],
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
        f.plan.times         >> f.burns.times,
        f.sun.heading        >> f.arrays.sun,
        f.stars.attitude     >> f.filter.stars,
        f.gyros.rate         >> f.filter.gyro,
    )
    f.task("gnc", every=0.5 * s, run=[f.speeds, f.guidance, f.tracking, f.control, f.motor, f.drive])
    f.task("navigation", every=0.5 * s, run=[f.stars, f.gyros, f.filter])
    f.task("units", every=0.5 * s, run=[f.sun, f.arrays, f.time, f.boot, f.power, f.plan, f.burns])
    f.task("files", every=0.5 * s, run=[f.files])

    f.reset_by(f.boot.computer, down=3 * s)
