# SPDX-License-Identifier: Apache-2.0
"""The truth: a low orbit with all that turns a small craft, the World Magnetic Model, sensors as their data sheets have
them, and a battery."""
from datetime import datetime, timedelta

from fledge import Orbit, world
from fledge.units import A, MHz, N, V, W, arcsec, deg, hour, m, minute, ms, ohm, s

from .flight import SAFE
from .vehicle import (BORESIGHTS, CAMERA, CASES, CONVERTERS, ELEMENTS, EPOCH, FIELD, GYRO, INERTIA, LOADS, MASS, PANELS,
                      RODS, SPEED, STATION, SUN_SENSORS, TRACKER, WHEEL)

DATE = (datetime(2000, 1, 1, 12) + timedelta(seconds=EPOCH.value)).isoformat()


def build(w, f, trackers=2):
    sky = world.Sky(DATE, center=world.EARTH)
    surroundings(w, sky)
    craft(w, f, sky)
    sensors(w, trackers)
    power_and_radio(w, sky)
    connect(w, f, trackers)
    w.integrator = world.RK4()
    w.task("sky", every=10 * s, run=[w.sun, w.moon])
    w.task("dynamics", every=100 * ms, run=[w.craft])
    w.task("surroundings", every=500 * ms, run=[
        w.light, w.array, w.power, w.field, w.air, w.css, w.adc_a, w.adc_b, w.tam, w.gyro, w.gps, *eyes(w, trackers),
        w.station, w.radio])


def eyes(w, trackers):
    return [getattr(w, f"{what}_{name}") for name in "ab"[:trackers] for what in ("stars", "eye")]


def surroundings(w, sky):
    w.sun     = world.CelestialBody(body=world.SUN, sky=sky)
    w.moon    = world.CelestialBody(body=world.MOON, sky=sky)
    w.light   = world.Sunlight(sun=world.SUN, shadows=[world.EARTH], sky=sky)
    w.field   = world.Magnetism(body=world.EARTH, sky=sky, coefficients="WMM2025")
    w.air     = world.Atmosphere(body=world.EARTH, sky=sky, law="STANDARD_1976")
    w.station = world.GroundStation(body=world.EARTH, sky=sky, **STATION)


def craft(w, f, sky):
    # The centres of pressure are beside that of mass, and the craft has a small dipole of its own.
    w.wheels   = world.ReactionWheels(axes_B=f.wheels.axes_B, **WHEEL, Omega_max=SPEED, friction=2e-5 * N * m)
    w.rods     = world.TorqueRods(**RODS, field=w.field)
    w.own      = world.TorqueRods(axes_B=[[0.6, -0.64, 0.48]], m_max=0.01 * A * m**2, field=w.field)
    w.gradient = world.GravityGradient()
    w.drag     = world.Drag(air=w.air, Cd=2.2, area=0.07 * m**2, centre_B=[0.01, 0.005, -0.02] * m)
    w.pressure = world.SolarPressure(light=w.light, area=0.12 * m**2, Cr=1.3, centre_B=[0.01, 0.005, -0.02] * m)
    w.craft    = world.Spacecraft(
        mass=MASS, I_B=INERTIA, parts=[w.wheels, w.rods, w.own, w.gradient, w.drag, w.pressure], sky=sky,
        gravity=[world.EARTH.zonal(6), world.SUN, world.MOON], orbit=Orbit.from_elements(sky, **ELEMENTS),
        sigma_BN=[0.3, -0.4, 0.2], omega_BN_B=[4, -6, 5] * deg / s)
    w.own.command = {"head": {"quality": "GOOD"}, "dipole": [1] + [0] * 7}    # at its limit, always


def sensors(w, trackers):
    w.css   = world.CoarseSunSensors(**SUN_SENSORS)
    w.adc_a = world.SunSensorConverter(n=4, bits=12, scale=CONVERTERS["scale"][0], offset=CONVERTERS["offset"][0],
                                       noise=3e-5 * A)
    w.adc_b = world.SunSensorConverter(n=4, first=4, bits=12, scale=CONVERTERS["scale"][1],
                                       offset=CONVERTERS["offset"][1], noise=3e-5 * A)
    w.tam   = world.Magnetometer(noise=[FIELD["noise"]**2 * s] * 3, bias=[1, -0.6, 0.8] * FIELD["bias"])
    w.gyro  = world.Gyro(noise=[GYRO["noise"]] * 3, walk=[GYRO["walk"]] * 3, bias=[1, -0.5, 0.7] * GYRO["bias"])
    w.gps   = world.GpsReceiver(position_noise=[5] * 3 * m, velocity_noise=[0.05] * 3 * m / s, wander=[5] * 3 * m,
                                wander_time=10 * minute, latency=0.3 * s)
    for name, case, boresight in zip("ab"[:trackers], CASES, BORESIGHTS):
        setattr(w, f"stars_{name}", world.StarTracker(
            boresight_B=boresight, deviation_across=10 * arcsec, deviation_about=70 * arcsec, sun_exclusion=35 * deg,
            planet_exclusion=25 * deg, planet_radius=world.EARTH.radius * m, moon_exclusion=10 * deg,
            moon_radius=world.MOON.radius * m, rate_max=1 * deg / s, latency=0.2 * s, load=LOADS[f"stars {name}"]))
        setattr(w, f"eye_{name}", world.StarTrackerElectronics(**TRACKER, **case, load=LOADS[f"stars {name}"]))


def power_and_radio(w, sky):
    w.array = world.SolarArray(normals_B=[PANELS], areas=0.1 * m**2, efficiency=0.28)
    watts   = {"computer": 2, "wheels": 3, "radio": 2, "gps": 1, "stars a": 1.2, "stars b": 1.2, "camera": 10}
    w.power = world.PowerUnit(n=16, on=SAFE, volts=8 * V, inner=0.05 * ohm, load=_resistances(watts) * ohm,
                              trip=[3] * 16 * A, trip_after=0.2 * s, count_current=1e-3 * A, count_volts=1e-3 * V,
                              battery=80 * W * hour, charge=0.9)
    w.radio = world.Radio(
        station=w.station, sky=sky, axis_B=CAMERA, beam=75 * deg, floor_dB=20,
        down_frequency=2250 * MHz, down_eirp_dBW=4, down_g_t_dBK=13, down_loss_dB=3, down_rate=1e6 / s,
        down_code="CONVOLUTIONAL", down_required_dB=2,
        up_frequency=2050 * MHz, up_eirp_dBW=36, up_g_t_dBK=-25, up_loss_dB=3, up_rate=16e3 / s, up_required_dB=8)


def _resistances(watts):
    """[ohm] of all 16 loads at 8 V."""
    return [64 / next((power for name, power in watts.items() if LOADS[name] == load), 64e-6) for load in range(16)]


def connect(w, f, trackers):
    w.connect(
        w.craft.state   >> [w.light.truth, w.field.truth, w.css.truth, w.tam.truth, w.gyro.truth, w.gps.truth,
                            w.air.truth, w.array.truth, w.station.truth, w.radio.truth],
        w.light.light   >> [w.css.light, w.array.light],
        w.field.field   >> w.tam.field,
        w.css.currents  >> [w.adc_a.currents, w.adc_b.currents],
        w.array.array   >> w.power.array,

        # what flight sees
        w.adc_a.counts    >> f.pyramids.a,
        w.adc_b.counts    >> f.pyramids.b,
        w.gyro.rate       >> [f.line.gyro, f.vectors.gyro, f.b_dot.gyro, f.damping.gyro,
                              *([f.stars.gyro] if trackers else [])],
        w.tam.measured    >> f.window.measured,
        w.gps.orbit       >> [f.orbit.fix, f.ahead.fix],
        w.wheels.speeds   >> [f.sun_law.speeds, f.law.speeds, f.monitor.speeds, f.plan.speeds, f.balance.speeds,
                              f.dump.speeds, f.magnetic.speeds],
        w.power.telemetry >> f.power.power,

        # what flight does
        f.power.command   >> w.power.command,
        f.balance.command >> w.wheels.command,
        f.window.command  >> w.rods.command,
    )
    for name in "ab"[:trackers]:
        tracker, electronics = getattr(w, f"stars_{name}"), getattr(w, f"eye_{name}")
        w.connect(
            w.craft.state         >> tracker.truth,
            w.sun.state           >> tracker.sun,
            w.moon.state          >> tracker.moon,
            w.power.supply        >> [tracker.power, electronics.power],
            tracker.attitude      >> electronics.attitude,
            electronics.registers >> getattr(f, f"star_{name}").registers,
        )
