# SPDX-License-Identifier: Apache-2.0
"""What flies: the application of the orbiter, from sensors' registers to the counts of its motors and valves."""
from fledge import flight as fsw
from fledge.units import N, deg, hour, km, m, minute, ms, rad, s

from .vehicle import (ARRAYS, BOOTS_SLOT, BURN_ERROR, BURN_SLOT, CONVERTERS, GYROS, INERTIA, LOADS, MOTOR, PLACE, RCS,
                      RCS_THRUST, STORED, SUN_SENSORS, TACHOMETER, TRACKER, TRACKERS, TURNED, UNITS, UNITS_SLOT, WHEELS)

GNC = 500 * ms


def build(f, ephemerides):
    vehicle(f)
    computer(f)
    navigation(f, ephemerides)
    guidance(f)
    control(f)
    burns(f)
    modes(f)


def vehicle(f):
    f.vehicle   = fsw.VehicleConfig(I_B=INERTIA)
    f.wheels    = fsw.WheelConfig(**WHEELS)
    f.thrusters = fsw.ThrusterConfig(**RCS, F_max=RCS_THRUST)


def computer(f):
    """Time, power, memory, and the services that the ground commands."""
    f.time       = fsw.VehicleTime(pulse=1 * s, jam_beyond=10 * ms, allowed=20e-6 * s)
    f.boot       = fsw.BootCount(slot=BOOTS_SLOT)
    f.share      = fsw.NvmShare()
    f.protection = fsw.FaultProtection(slot=UNITS_SLOT + 1)
    for unit, (name, start, kind) in zip(f.protection.units, UNITS):
        unit.name, unit.start, unit.kind = name, f"UNIT_{start}", kind
        unit.loads = 1 << LOADS[name] if name in LOADS else 0
        unit.warm = start == "REDUNDANT"
    f.power      = fsw.PowerManager(on=sum(1 << load for load in LOADS.values()), clears=2, clear_after=10 * s,
                                    silent_after=2 * s)
    f.stored     = fsw.StoredCommands(**STORED)
    f.burned     = fsw.BurnMemory(slot=BURN_SLOT + 1, silent=3 * s)
    f.monitors   = fsw.Monitors()
    f.log        = fsw.EventLog(least=fsw.EventSeverity.LOW, most=10, window=1 * minute)
    f.reports    = fsw.Housekeeping()
    f.files      = fsw.Files(entity=2, ground=1, rate=2000, allowed=0b1111, kept=1, boot=1)
    f.connect(
        f.boot.request       >> f.share.ask_a,
        f.share.reply_a      >> f.boot.reply,
        f.protection.request >> f.share.ask_b,
        f.share.reply_b      >> f.protection.reply,
        f.burned.request     >> f.share.ask_c,
        f.share.reply_c      >> f.burned.reply,
        f.stored.request     >> f.share.ask_d,
        f.share.reply_d      >> f.stored.reply,
        f.protection.table   >> f.power.units,
        f.time.time          >> f.stored.clock,
    )
    f.task("memory", every=GNC, run=[f.share, f.burned, f.files])
    f.task("computer", every=500 * ms, run=[f.time, f.boot, f.protection, f.power, f.stored, f.monitors, f.log,
                                            f.reports])
    f.reset_by(f.boot.computer, down=3 * s)


def navigation(f, ephemerides):
    """The attitude by star trackers and gyros, the direction to the Sun by sun sensors, the orbit and the bodies by
    ephemerides. Until the ground has correlated the clock, none of these is known."""
    for name, case in zip("ab", TRACKERS):
        setattr(f, f"stars_{name}", fsw.StarTrackerAttitude(**TRACKER, **case, about=8, age_max=2 * s))
        setattr(f, f"gyro_{name}", fsw.GyroRates(**GYROS, rate_max=0.08 * rad / s))
    f.stars  = fsw.StarSelect(places=[PLACE["stars a"], PLACE["stars b"]])
    f.gyro   = fsw.GyroSelect(places=[PLACE["gyro a"], PLACE["gyro b"]])
    noise    = dict(rate_noise=1e-10 * rad**2 / s, bias_walk=1e-18 * rad**2 / s**3, bias_std=1e-4 * rad / s,
                    star_std=5e-5 * rad, gate=30, hold=3 * s, coast=30 * s, persistence=3)
    f.filter = fsw.AttitudeMekf(**noise)

    # The redundant units have an estimator of their own, which shows faults that no unit reports itself.
    f.other  = fsw.AttitudeUkf(**noise)
    f.differ = fsw.AttitudeMiscompare(angle_max=0.3 * deg, rate_max=0.02 * deg / s, persistence=20, release=120)
    f.pyramids  = fsw.SunPyramids(**SUN_SENSORS, **CONVERTERS, dark=0.05, differ=0.01, persistence=10)
    f.line   = fsw.SunLine(noise=0.002, length=0.02, rate_noise=1e-10 * rad**2 / s, walk=1e-16 * rad**2 / s**3,
                           rate_std=1e-4 * rad / s, gate=6, good=2 * deg, hold=5 * s, persistence=20)

    f.epoch    = fsw.TimeCorrelation()
    f.orbit    = fsw.ElementEphemeris(mu=4.282837e13 * m**3 / s**2, a=7471.618 * km)
    f.mars_at  = fsw.ChebyshevEphemeris(**ephemerides["mars"])
    f.sun_at   = fsw.ChebyshevEphemeris(**ephemerides["sun"])
    f.earth_at = fsw.ChebyshevEphemeris(**ephemerides["earth"])
    f.connect(
        f.stars_a.attitude >> f.stars.a,
        f.stars_b.attitude >> [f.stars.b, f.other.stars],
        f.gyro_a.rate      >> f.gyro.a,
        f.gyro_b.rate      >> [f.gyro.b, f.other.gyro],
        f.protection.table >> [f.stars.units, f.gyro.units],
        f.stars.attitude   >> f.filter.stars,
        f.gyro.rate        >> [f.filter.gyro, f.line.gyro],
        f.filter.attitude  >> f.differ.a,
        f.other.attitude   >> f.differ.b,
        f.pyramids.cosines >> f.line.cosines,
        f.pyramids.heading >> f.line.guess,
        f.time.time        >> f.epoch.vehicle,
        f.epoch.time       >> [f.orbit.time, f.mars_at.time, f.sun_at.time, f.earth_at.time],
    )


def guidance(f):
    """A stack for each mode; the newest reference counts. The rotations say which axes of B point: b1 at the primary
    body with the Sun in the plane of b1 and b3, which the arrays reach; -b1 at the Sun; b3 along the thrust."""
    f.rest     = fsw.InertialPointing(sigma_RN=[0, 0, 0])
    f.to_sun       = fsw.TwoBodyPointing(separation_min=1 * deg)
    f.sun_axes     = fsw.EulerRotation(angles=[180, 0, 0] * deg)
    f.to_mars      = fsw.TwoBodyPointing(separation_min=1 * deg)
    f.mars_axes    = fsw.EulerRotation(angles=[0, 0, -90] * deg)
    f.to_two       = fsw.TwoBodyPointing(separation_min=1 * deg)
    f.two_axes     = fsw.EulerRotation(angles=[0, 0, -90] * deg)
    f.plan         = fsw.BurnPlan(n=1, start=[4e8] * s, dv_N=[[1, 0, 0]] * m / s)
    f.along        = fsw.BurnPointing()
    f.burn_axes    = fsw.EulerRotation(angles=[90, 0, 90] * deg)
    f.tracking     = fsw.TrackingError(hold=5 * s)
    f.arrays       = fsw.ArrayPointing(**ARRAYS, **TURNED, dead_band=0.02 * rad, persistence=10 * s)
    f.connect(
        f.orbit.orbit         >> [f.to_sun.orbit, f.to_mars.orbit, f.to_two.orbit],
        f.sun_at.body         >> [f.to_sun.primary, f.to_mars.secondary, f.to_two.secondary],
        f.earth_at.body       >> [f.to_sun.secondary, f.to_two.primary],
        f.mars_at.body           >> f.to_mars.primary,
        f.to_sun.reference    >> f.sun_axes.base,
        f.to_mars.reference   >> f.mars_axes.base,
        f.to_two.reference    >> f.two_axes.base,
        f.plan.command        >> f.along.command,
        f.along.reference     >> f.burn_axes.base,
        fsw.newest(f.rest.reference, f.sun_axes.reference, f.mars_axes.reference, f.two_axes.reference,
                   f.burn_axes.reference) >> f.tracking.reference,
        f.differ.attitude     >> f.tracking.attitude,
        f.line.heading        >> f.arrays.sun,
    )


def control(f):
    """Wheels hold the attitude, and thrusters take momentum out of them; in the safe mode by the Sun alone."""
    f.speeds   = fsw.TachometerSpeeds(**TACHOMETER)
    f.sun_safe    = fsw.SunSafe(axis_B=[-1, 0, 0], search_B=[0, 0.3, 0] * deg / s, hold=60 * s)
    f.safe_law = fsw.MrpFeedback(K=2.531 * N * m, P=45 * N * m * s, hold=2 * s)
    f.law      = fsw.MrpFeedback(K=2.531 * N * m, P=45 * N * m * s, hold=2 * s)
    f.monitor  = fsw.WheelMonitor(torque_max=0.08 * N * m, persistence=6, least=3)
    f.motor    = fsw.WheelTorques(hold=2 * s)
    f.drive    = fsw.WheelDriveCounts(**MOTOR, hold=2 * s)
    f.dump     = fsw.MomentumDump(gain=0.02 / s, torque_max=0.5 * N * m, h_start=20 * N * m * s, h_stop=2 * N * m * s)
    f.mapping  = fsw.ThrusterMapping(hold=2 * s)
    f.firing   = fsw.ThrusterFiring(period=GNC, min_on=20 * ms, level_on=0.75, level_off=0.25)
    f.pulses   = fsw.PropulsionManager(n=8, armed=1, persistence=2 * s, silent_after=2 * s)
    f.connect(
        f.line.heading         >> f.sun_safe.sun,
        f.line.rate            >> f.sun_safe.rate,
        f.sun_safe.error           >> f.safe_law.error,
        f.tracking.error       >> f.law.error,
        f.speeds.speeds        >> [f.safe_law.speeds, f.law.speeds, f.drive.speeds, f.monitor.speeds, f.dump.speeds],
        f.vehicle.vehicle      >> [f.safe_law.vehicle, f.law.vehicle],
        f.wheels.wheels        >> [f.safe_law.wheels, f.law.wheels, f.motor.wheels, f.monitor.wheels, f.dump.wheels],
        (fsw.newest(f.safe_law.torque, f.law.torque)
         >> f.motor.torque).stale_after(2 * s),     # of a law that its mode has suspended
        f.motor.command        >> [f.drive.command, f.monitor.command],
        f.monitor.availability >> f.motor.availability,
        f.thrusters.thrusters  >> [f.mapping.thrusters, f.firing.thrusters],
        f.mapping.forces       >> f.firing.forces,
        f.firing.times         >> f.pulses.times,
        f.pulses.availability  >> f.mapping.availability,
    )


def burns(f):
    """Engines change the orbit; the attitude thrusters hold the body meanwhile."""
    f.sum      = fsw.DeltaVAccumulation()
    f.burn     = fsw.BurnExecution(engines_used=0b111111, longest=1 * hour, error_max=BURN_ERROR, error_open=1 * deg,
                                   wait=2 * minute, a_min=0.1 * m / s**2, settle=10 * s, hold=2 * s)
    f.engines  = fsw.PropulsionManager(n=6, armed=0, persistence=2 * s, silent_after=2 * s)
    f.steering = fsw.MrpSteering(K1=0.15, K3=1, omega_max=1 * deg / s)
    f.servo    = fsw.RateServo(P=600 * N * m * s, K_I=100 * N * m, u_I_max=15 * N * m, hold=2 * s)
    f.connect(
        f.differ.attitude  >> f.sum.attitude,
        f.plan.command     >> f.burn.command,
        f.sum.sum          >> f.burn.sum,
        f.tracking.error   >> [f.burn.error, f.steering.error, f.servo.error],
        f.burn.state       >> [f.plan.state, f.burned.state],
        f.burned.kept      >> [f.plan.kept, f.burn.kept],
        f.burn.engines     >> f.engines.times,
        f.steering.command >> f.servo.command,
        f.vehicle.vehicle  >> f.servo.vehicle,
        (fsw.newest(f.dump.torque, f.servo.torque) >> f.mapping.torque).stale_after(2 * s),
    )


def modes(f):
    """Tasks run in the order of their declaration. Each mode has its guidance; what they share follows."""
    f.task("sensing", every=GNC, run=[f.speeds, f.stars_a, f.stars_b, f.gyro_a, f.gyro_b, f.stars, f.gyro, f.pyramids,
                                      f.line, f.filter, f.other, f.differ])
    f.task("bodies", every=GNC, run=[f.epoch, f.orbit, f.mars_at, f.sun_at, f.earth_at])
    guide = [(name, f.task(f"guide {name}", every=GNC, run=run)) for name, run in (
        ("sun", [f.to_sun, f.sun_axes]), ("inertial", [f.rest]), ("mars", [f.to_mars, f.mars_axes]),
        ("two_body", [f.to_two, f.two_axes]), ("delta_v", [f.plan, f.along, f.burn_axes]))]
    point  = f.task("point", every=GNC, run=[f.tracking])
    safe   = f.task("safe", every=GNC, run=[f.sun_safe, f.safe_law])
    law    = f.task("law", every=GNC, run=[f.law])
    burn   = f.task("burn", every=GNC, run=[f.sum, f.burn, f.engines, f.steering, f.servo])
    dump   = f.task("dump", every=GNC, run=[f.dump])
    act    = f.task("act", every=GNC, run=[f.monitor, f.motor, f.drive, f.mapping, f.firing, f.pulses, f.arrays])

    # A pointing mode needs a known attitude and, except the inertial one, known bodies.
    attitude = f.watch(f.differ.attitude)
    bodies = [f.watch(at.body).head.quality for at in (f.sun_at, f.mars_at, f.earth_at)]
    knows = attitude.head.quality == "GOOD"
    seen = (bodies[0] == "GOOD") & (bodies[1] == "GOOD") & (bodies[2] == "GOOD")
    f.mode("safe", [safe, act])
    for name, task in guide:
        f.mode(name, [task, point, act] + ([burn] if name == "delta_v" else [law, dump]),
               when=knows if name in ("inertial", "delta_v") else knows & seen)
    f.mode("sleep", [act])      # nothing moves: without a torque wheels are held at their speeds, and thrusters shut

    # While engines burn, the attitude thrusters are open but for what the torque needs.
    state, mapping = f.watch(f.burn.state), f.watch(f.mapping)
    f.event("burns", when=state.phase == "RUNS", set=[(mapping.off_pulse, 1)])
    f.event("ends", when=state.phase > "RUNS", set=[(mapping.off_pulse, 0)])

    # A burn that a reset of the computer has cut off goes on, once its plan and the attitude are back.
    kept, files = f.watch(f.burned.kept), f.watch(f.files.state)
    f.event("resume", when=(kept.phase == "CUT") & (files.booted == 1) & (attitude.head.quality == "GOOD"),
            modes=[f.safe], enter=f.delta_v)
    f.event("captured", when=state.phase == "COMPLETE", hold=1 * minute, modes=[f.delta_v], enter=f.sun)

    # Where an ephemeris ends, the bodies stand still: soon that is no direction to follow.
    f.event("ephemeris", when=(bodies[0] < "GOOD") | (bodies[1] < "GOOD") | (bodies[2] < "GOOD"), hold=2 * minute,
            modes=[f.sun, f.mars, f.two_body], enter="safe")

    # Once the ground has armed it: without an attitude, only the Sun is left to point at.
    pointing = [f.sun, f.inertial, f.mars, f.two_body, f.delta_v]
    f.event("blind", when=attitude.head.quality < "GOOD", hold=2 * minute, modes=pointing, armed=False, enter="safe")
