# SPDX-License-Identifier: Apache-2.0
"""What flies: knowledge of orbit, Sun and field; the attitude by vectors, and by star trackers where there are any;
rods that stop the tumble and unload the wheels; wheels that point at the Sun, down, at a station and at a target."""
from fledge import flight as fsw
from fledge.units import N, T, arcsec, day, deg, hour, km, m, minute, ms, rad, s

from .vehicle import (AXES, BORESIGHTS, CAMERA, CASES, CONVERTERS, EARTH, ELEMENTS, EPOCH, FIELD, GYRO, INERTIA, LOADS,
                      MU, PANELS, RODS, SPEED, STATION, SUN_SENSORS, TARGET, TRACKER, WHEEL, ZONAL)

GNC = 500 * ms


def build(f, trackers=2, wheels=4):
    if trackers not in (0, 1, 2) or wheels not in (3, 4):
        raise ValueError(f"expected 0, 1 or 2 star trackers, and 3 or 4 wheels; found {trackers} and {wheels}")
    vehicle(f, wheels)
    knowledge(f)
    attitude(f, trackers)
    guidance(f, trackers)
    control(f, trackers)
    modes(f, trackers)


def vehicle(f, wheels):
    f.vehicle = fsw.VehicleConfig(I_B=INERTIA)
    f.wheels  = fsw.WheelConfig(axes_B=AXES[:wheels], **WHEEL)
    f.rods    = fsw.RodConfig(**RODS)
    f.power   = fsw.PowerManager(on=SAFE, clears=2, clear_after=10 * s, silent_after=2 * s)


def loads(*names):
    """A bit for each."""
    return sum(1 << LOADS[name] for name in names)


SAFE    = loads("computer", "radio", "gps", "wheels")
POINTS  = SAFE + loads("stars a", "stars b")
IMAGES  = POINTS + loads("camera")


def knowledge(f):
    """Where the CubeSat is: by GPS, filtered; without it for long, by the elements that the ground sends. How the Earth
    is turned, where Sun and Moon are, the shadow and the field there, and the next pass over the station."""
    f.clock    = fsw.UtcCorrelation(time_0=EPOCH)
    f.earth    = fsw.EarthOnBoard()
    f.sun_at   = fsw.SunOnBoard()
    f.moon_at  = fsw.MoonOnBoard()
    f.elements = fsw.OrbitOnBoard(**ELEMENTS)
    f.orbit    = fsw.OrbitFilter(
        **ZONAL, step=10 * s, steps=60, accel_noise=1e-6 * m**2 / s**3, along_std=5e-7 * m / s**2,
        along_time=20000 * s, position_std=5 * m, velocity_std=0.05 * m / s, wander=5 * m, gate=6, good=50 * m,
        latency=2 * s, persistence=3)
    f.ahead    = fsw.OrbitPropagator(**ZONAL, step=10 * s, steps=20, age_max=1.5 * hour)
    f.shadow   = fsw.EclipseOnBoard(**EARTH, mu=MU)
    f.field    = fsw.FieldOnBoard(model="IGRF", degree=8)
    f.passes   = fsw.GroundPass(**STATION, **EARTH, mu=MU, J2=ZONAL["J2"], horizon=1 * day, step=30 * s, differ=5 * km,
                                steps=20)
    f.connect(
        f.clock.time  >> [f.earth.time, f.sun_at.time, f.moon_at.time, f.elements.time, f.field.time],
        f.earth.earth >> [f.orbit.planet, f.ahead.planet, f.field.earth, f.passes.planet],
        here(f)       >> [f.shadow.orbit, f.field.orbit, f.passes.orbit],
        f.sun_at.sun  >> f.shadow.sun,
    )


def here(f):
    return fsw.best(f.orbit.orbit, f.ahead.orbit, f.elements.orbit)


def attitude(f, trackers):
    """From the Sun and the field, whatever the tumble: by QUEST or TRIAD where both are seen, and by a filter with the
    gyro, which the shadow does not stop. Star trackers have a filter of their own."""
    f.pyramids = fsw.SunPyramids(**SUN_SENSORS, **CONVERTERS, dark=0.1, differ=0.03, persistence=20)
    f.line     = fsw.SunLine(noise=0.01, length=0.02, rate_noise=GYRO["noise"], walk=GYRO["walk"],
                             rate_std=GYRO["bias"], gate=5, good=3 * deg, hold=5 * s, persistence=100)
    f.window   = fsw.RodWindow(period=5 * s, on=3.5 * s, settle=0.4 * s)
    f.sun_seen = fsw.BodyDirection(std=1 * deg)
    f.field_seen = fsw.FieldDirection(std=1 * deg, noise=FIELD["bias"], differ=0.15)
    f.triad    = fsw.Triad(separation_min=15 * deg, together=5 * s, gate=5)
    f.fix      = fsw.Quest(separation_min=15 * deg, together=5 * s, gate=5)
    f.vectors  = fsw.VectorFilter(
        rate_noise=GYRO["noise"], bias_walk=GYRO["walk"], bias_std=2 * GYRO["bias"], field_noise=3e-7 * T,
        field_walk=1e-18 * T**2 / s, field_bias_std=2 * FIELD["bias"], gate=5, hold=2 * s, age_max=5 * s,
        good=1.5 * deg, persistence=10)
    f.connect(
        f.pyramids.cosines >> f.line.cosines,
        f.pyramids.heading >> [f.line.guess, f.sun_seen.heading],
        f.sun_at.sun       >> f.sun_seen.body,
        here(f)            >> f.sun_seen.orbit,
        f.window.field     >> [f.field_seen.field, f.vectors.field],
        f.field.field      >> [f.field_seen.known, f.vectors.known_field],
        f.sun_seen.seen    >> [f.triad.primary, f.fix.first, f.vectors.first],
        f.field_seen.seen  >> [f.triad.secondary, f.fix.second],
        fsw.best(f.fix.attitude, f.triad.attitude) >> f.vectors.start,
    )
    for name, case in zip("ab"[:trackers], CASES):
        setattr(f, f"star_{name}", fsw.StarTrackerAttitude(**TRACKER, **case, about=8, age_max=2 * s))
    if trackers:
        f.stars = fsw.AttitudeMekf(
            rate_noise=GYRO["noise"], bias_walk=GYRO["walk"], bias_std=2 * GYRO["bias"], star_std=10 * arcsec, gate=30,
            hold=2 * s, coast=2 * minute, persistence=5)
        seen = [eye.attitude for eye in eyes(f, trackers)]
        f.connect((fsw.newest(*seen) if trackers > 1 else seen[0]) >> f.stars.stars)


def eyes(f, trackers):
    return [getattr(f, f"star_{name}") for name in "ab"[:trackers]]


def known(f, trackers):
    return fsw.best(f.stars.attitude, f.vectors.attitude) if trackers else f.vectors.attitude


def guidance(f, trackers):
    """Where to point: down, at the station while it sees the CubeSat, at the target while that is high. On the way the
    star trackers keep away from Sun and Moon, and the body turns no faster than its wheels can."""
    f.to_nadir  = fsw.TwoBodyPointing(separation_min=1 * deg)
    f.nadir_axes = fsw.EulerRotation(angles=[-90, 0, -90] * deg)        # b3 at the place, -b1 towards the Sun
    f.station   = fsw.GroundTarget(**STATION, **EARTH)
    f.to_station = fsw.TwoBodyPointing(separation_min=1 * deg)
    f.station_axes = fsw.EulerRotation(angles=[-90, 0, -90] * deg)
    f.target    = fsw.GroundTarget(**TARGET, **EARTH)
    f.to_target = fsw.TwoBodyPointing(separation_min=1 * deg)
    f.target_axes = fsw.EulerRotation(angles=[-90, 0, -90] * deg)
    f.keep_out  = fsw.KeepOut(
        n=2 if trackers else 1, boresights_B=BORESIGHTS if trackers else [CAMERA], first_angle=35 * deg,
        second_angle=10 * deg, margin=3 * deg, reached=2 * deg, jump=1 * deg)
    f.slew      = fsw.SlewProfile(rate_max=1 * deg / s, accel_max=0.1 * deg / s**2, jump=1 * deg)
    f.tracking  = fsw.TrackingError(hold=5 * s)
    f.connect(
        here(f)                  >> [f.station.orbit, f.target.orbit, f.to_nadir.orbit, f.to_station.orbit,
                                     f.to_target.orbit, f.keep_out.orbit],
        f.sun_at.sun             >> [f.to_nadir.secondary, f.to_station.secondary, f.to_target.secondary,
                                     f.keep_out.first],
        f.moon_at.moon           >> f.keep_out.second,
        f.earth.centre           >> f.to_nadir.primary,
        f.earth.earth            >> [f.station.attitude, f.target.attitude],
        f.to_nadir.reference     >> f.nadir_axes.base,
        f.station.target         >> f.to_station.primary,
        f.to_station.reference   >> f.station_axes.base,
        f.target.target          >> f.to_target.primary,
        f.to_target.reference    >> f.target_axes.base,
        fsw.newest(f.nadir_axes.reference, f.station_axes.reference, f.target_axes.reference) >> f.keep_out.target,
        f.keep_out.way           >> f.slew.target,
        f.slew.reference         >> f.tracking.reference,
        known(f, trackers)       >> [f.keep_out.attitude, f.slew.attitude, f.tracking.attitude],
    )


def control(f, trackers):
    """Rods stop the tumble; wheels do the rest, and rods unload them. Without enough wheels, rods and gravity point."""
    f.b_dot     = fsw.BDot(k=3e-4 * N * m * s, field_min=5e-6 * T, tau=5 * s, gap=20 * s, rate_slow=0.5 * deg / s,
                           slow_time=2 * minute)
    f.damping   = fsw.RateDamping(P=0.03 * N * m * s, torque_max=2e-3 * N * m)
    f.sun_safe  = fsw.SunSafe(axis_B=PANELS, search_B=[0.5, 0.3, 0] * deg / s, hold=60 * s)
    f.sun_law   = fsw.MrpFeedback(K=3e-3 * N * m, P=0.06 * N * m * s, hold=2 * s)
    f.law       = fsw.MrpFeedback(K=0.07 * N * m, P=0.1 * N * m * s, hold=2 * s)
    f.monitor   = fsw.WheelMonitor(torque_max=5e-4 * N * m, persistence=6)
    f.motor     = fsw.WheelTorques(hold=2 * s)
    f.plan      = fsw.WheelSpeedPlan(Omega_min=40 * rad / s, Omega_max=0.9 * SPEED, margin=20 * rad / s)
    f.balance   = fsw.WheelBalance(K=5e-6 * N * m * s)
    f.dump      = fsw.MomentumDump(gain=1e-3 / s, hold=5 * s)
    f.hill      = fsw.HillPointing()
    f.hill_axes = fsw.EulerRotation(angles=[90, 0, -90] * deg)          # b3 down, b1 along the orbit
    f.off       = fsw.TrackingError(hold=5 * s)
    f.magnetic  = fsw.MagneticPointing(K=0 * N * m, P=3e-4 * N * m * s, pitch_B=[0, -1, 0], K_pitch=6e-3 * N * m,
                                       P_pitch=0.03 * N * m * s, h_bias=0.02 * N * m * s, gain=5e-4 / s, hold=5 * s)
    f.rod_law   = fsw.RodTorques(field_min=5e-6 * T, hold=10 * s)
    f.connect(
        f.window.field          >> [f.b_dot.field, f.rod_law.field],
        f.line.heading          >> f.sun_safe.sun,
        f.line.rate             >> f.sun_safe.rate,
        f.sun_safe.error        >> f.sun_law.error,
        f.tracking.error        >> f.law.error,
        here(f)                 >> f.hill.orbit,
        f.hill.reference        >> f.hill_axes.base,
        f.hill_axes.reference   >> f.off.reference,
        known(f, trackers)      >> f.off.attitude,
        f.off.error             >> f.magnetic.error,
        (fsw.newest(f.damping.torque, f.sun_law.torque, f.law.torque, f.magnetic.wheels_torque)
         >> f.motor.torque).stale_after(2 * s),      # of a law that its mode has suspended
        f.motor.command         >> f.balance.torques,
        (f.plan.wanted          >> f.balance.wanted).stale_after(2 * s),
        f.balance.command       >> f.monitor.command,
        f.monitor.availability  >> [f.motor.availability, f.plan.availability, f.balance.availability],

        fsw.newest(f.dump.torque, f.magnetic.torque) >> f.rod_law.torque,
        (fsw.newest(f.b_dot.command, f.rod_law.command) >> f.window.wanted).stale_after(5 * s),

        f.vehicle.vehicle       >> [f.sun_law.vehicle, f.law.vehicle],
        f.wheels.wheels         >> [f.sun_law.wheels, f.law.wheels, f.monitor.wheels, f.motor.wheels, f.plan.wheels,
                                    f.balance.wheels, f.dump.wheels, f.magnetic.wheels],
        f.rods.rods             >> [f.b_dot.rods, f.rod_law.rods],
    )


def modes(f, trackers):
    """Tasks run in the order of their declaration. It begins in the tumble that the deployer leaves, and finds the Sun
    by itself; from there the ground commands it."""
    f.task("place", every=GNC, run=[f.clock, f.earth, f.orbit, f.ahead, f.elements, f.field, f.passes])
    f.task("bodies", every=10 * s, run=[f.sun_at, f.moon_at, f.shadow])
    f.task("sensing", every=GNC, run=[f.window, f.pyramids, f.line, f.sun_seen, f.field_seen, f.triad, f.fix, f.vectors]
           + (eyes(f, trackers) + [f.stars] if trackers else []))
    f.task("house", every=GNC, run=[f.power, f.station, f.target])
    down    = f.task("to nadir", every=GNC, run=[f.to_nadir, f.nadir_axes])
    station = f.task("to station", every=GNC, run=[f.to_station, f.station_axes])
    target  = f.task("to target", every=GNC, run=[f.to_target, f.target_axes])
    point   = f.task("point", every=GNC, run=[f.keep_out, f.slew, f.tracking, f.law])
    tumble  = f.task("tumble", every=GNC, run=[f.b_dot])
    brake   = f.task("damp", every=GNC, run=[f.damping])
    sun     = f.task("to the sun", every=GNC, run=[f.sun_safe, f.sun_law])
    hover   = f.task("hover", every=GNC, run=[f.hill, f.hill_axes, f.off, f.magnetic])
    dump    = f.task("dump", every=GNC, run=[f.dump])
    rods    = f.task("rods act", every=GNC, run=[f.rod_law])
    plan    = f.task("plan speeds", every=GNC, run=[f.plan])
    f.task("wheels act", every=GNC, run=[f.monitor, f.motor, f.balance])

    sure = f.watch(f.vectors.attitude).head.quality == "GOOD"
    if trackers:
        sure = sure | (f.watch(f.stars.attitude).head.quality == "GOOD")
    f.mode("detumble", [tumble])
    f.mode("brake", [brake])
    f.mode("sun", [sun, dump, rods, plan])
    f.mode("nadir", [down, point, dump, rods, plan], when=sure)
    f.mode("contact", [station, point, dump, rods, plan], when=sure)
    f.mode("image", [target, point, dump, rods, plan], when=sure)
    f.mode("hover", [hover, rods], when=sure)

    # From the tumble to the Sun, and back to rods if something spins it up.
    rate, power = f.watch(f.line.rate).omega_BN_B.norm(), f.watch(f.power)
    f.event("slow", when=f.watch(f.b_dot.state).detumbled == 1, modes=[f.detumble], enter=f.brake)
    f.event("still", when=rate < 0.2 * deg / s, hold=20 * s, modes=[f.brake], enter=f.sun, set=[(power.on, POINTS)])
    f.event("spins", when=rate > 4 * deg / s, hold=10 * s, modes=[f.brake, f.sun], enter=f.detumble,
            set=[(power.on, SAFE)])

    # While it looks down, passes come by themselves: over the station, and over the target, where it is light, with the
    # camera switched on.
    forecast, high = f.watch(f.passes.forecast), f.watch(f.target.contact)
    lit = f.watch(f.shadow.shadow).phase == "SUNLIT"
    f.event("rises", when=forecast.state == "NOW", modes=[f.nadir], enter=f.contact)
    f.event("sets", when=~(forecast.state == "NOW"), modes=[f.contact], enter=f.nadir)
    f.event("over", when=(high.visible == 1) & lit, modes=[f.nadir], enter=f.image,
            set=[(power.on, IMAGES)])
    f.event("past", when=high.visible == 0, modes=[f.image], enter=f.nadir, set=[(power.on, POINTS)])

    # What can go wrong: the attitude, the battery, two wheels.
    pointing = [f.nadir, f.contact, f.image]
    f.event("blind", when=~sure, hold=5 * minute, modes=pointing, enter=f.sun)
    f.event("hungry", when=f.watch(f.power.state).battery < 26214, hold=1 * minute, modes=pointing + [f.hover],
            enter=f.sun, set=[(power.on, SAFE)])
    f.event("crippled", when=f.watch(f.monitor.state).trips > 1, modes=pointing, enter=f.hover)
