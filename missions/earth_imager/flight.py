# SPDX-License-Identifier: Apache-2.0
"""What flies: a camera that looks down, and hands over to a ground station while that sees the spacecraft; MRP steering
and a rate servo; four wheels that are balanced and watched."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, km, m, rad, s

# Svalbard, on the Earth of WGS 84, with a mask.
STATION = dict(longitude=15.39 * deg, latitude=78.23 * deg, altitude=450 * m, mask=8 * deg)

# The Earth of WGS 84, how it stands at the epoch, and how fast it turns: numbers of an almanac.
STANDS  = [[0.8436783814789698, -0.5368446223419787, -0.002154086238830078],
           [0.5368428951377278, 0.8436811313562944, -0.0013618125810623534],
           [0.0025484436757961595, -7.474058561493416e-06, 0.9999967526842123]]
EARTH   = dict(radius=6378.137 * km, flattening=1 / 298.257223563, rate=7.292115018682752e-5 * rad / s, dcm_PN=STANDS)


def build(f):
    # The vehicle, as flight knows it.
    f.vehicle  = fsw.VehicleConfig(I_B=[12, 10, 8] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=2e-3 * kg * m**2, u_max=0.05 * N * m)

    # Guidance: the Hill frame, turned so that b1 looks down; or b1 on the station, with b2 towards the Sun.
    f.hill     = fsw.HillPointing()
    f.nadir    = fsw.EulerRotation(angles=[180, 0, 0] * deg)
    f.station  = fsw.GroundTarget(**STATION, **EARTH)
    f.link     = fsw.TwoBodyPointing(separation_min=1 * deg)
    f.base     = fsw.BaseReference(hold=5 * s, source="OWN")
    f.tracking = fsw.TrackingError()

    # Control: at most 1.5 deg/s about an axis; the servo's error decays in 2 s.
    f.steering = fsw.MrpSteering(K1=0.3, K3=1, omega_max=1.5 * deg / s)
    f.servo    = fsw.RateServo(P=5 * N * m * s)
    f.monitor  = fsw.WheelMonitor(torque_max=5e-3 * N * m, persistence=6)
    f.motor    = fsw.WheelTorques()
    f.balance  = fsw.WheelBalance(K=1e-5 * N * m * s)

    f.connect(
        # from where to point to what the wheels do
        f.hill.reference       >> f.nadir.base,
        f.nadir.reference      >> f.base.own,
        f.station.target       >> f.link.primary,
        f.link.reference       >> f.base.commanded,
        f.base.reference       >> f.tracking.reference,
        f.tracking.error       >> [f.steering.error, f.servo.error],
        f.steering.command     >> f.servo.command,
        f.servo.torque         >> f.motor.torque,
        f.motor.command        >> f.balance.torques,

        # which wheels may be used
        f.balance.command      >> f.monitor.command,
        f.monitor.availability >> [f.motor.availability, f.balance.availability],

        # what the modules know of the vehicle
        f.vehicle.vehicle      >> f.servo.vehicle,
        f.wheels.wheels        >> [f.servo.wheels, f.monitor.wheels, f.motor.wheels, f.balance.wheels],
    )
    f.task("gnc", every=0.5 * s, run=[f.hill, f.nadir, f.station, f.link, f.base, f.tracking, f.steering, f.servo,
                                      f.monitor, f.motor, f.balance])

    contact, base = f.watch(f.station.contact), f.watch(f.base)
    f.event("rise", when=contact.visible == 1, set=[(base.source, "COMMANDED")])
    f.event("set", when=contact.visible == 0, set=[(base.source, "OWN")])
