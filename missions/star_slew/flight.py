# SPDX-License-Identifier: Apache-2.0
"""What flies: a telescope that slews between targets by star tracker and gyro alone; a filter carries the attitude
through the slew, which is too fast for the star tracker."""
from fledge import flight as fsw
from fledge.units import N, arcsec, deg, hour, kg, m, s

# What the data sheets say; the world has the same sensors, with their real errors.
GYRO = dict(noise=(0.06 * deg)**2 / hour, walk=(0.3 * deg / hour)**2 / hour)


def build(f, filter="AttitudeMekf"):
    # The vehicle, as flight knows it: its panels are stiff.
    f.vehicle  = fsw.VehicleConfig(I_B=[99, 71, 152] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.02 * kg * m**2, u_max=0.2 * N * m)

    # The attitude: 5 standard deviations are an outlier; after 60 s without stars the attitude is degraded.
    f.filter   = getattr(fsw, filter)(rate_noise=GYRO["noise"], bias_walk=GYRO["walk"], bias_std=20 * deg / hour,
                                      star_std=2 * arcsec, gate=5, persistence=5, hold=1 * s, coast=60 * s)

    # Guidance: a target at rest, turned to at 1 deg/s at most about an axis.
    f.guidance = fsw.InertialPointing(sigma_RN=[0, 0, 0])
    f.tracking = fsw.TrackingError()
    f.steering = fsw.MrpSteering(K1=0.3, K3=1, omega_max=1 * deg / s)
    f.servo    = fsw.RateServo(P=40 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        # from the stars to what the wheels do
        f.filter.attitude    >> f.tracking.attitude,
        f.guidance.reference >> f.tracking.reference,
        f.tracking.error     >> [f.steering.error, f.servo.error],
        f.steering.command   >> f.servo.command,
        f.servo.torque       >> f.motor.torque,

        # what the modules know of the vehicle
        f.vehicle.vehicle    >> f.servo.vehicle,
        f.wheels.wheels      >> [f.servo.wheels, f.motor.wheels],
    )
    f.task("gnc", every=0.2 * s, run=[f.filter, f.guidance, f.tracking, f.steering, f.servo, f.motor])
