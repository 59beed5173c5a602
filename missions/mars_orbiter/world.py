# SPDX-License-Identifier: Apache-2.0
"""The truth: an orbiter at Mars with wheels, thrusters, tanks and fuel that sloshes, and the avionics between it and
flight."""
from fledge import world
from fledge.units import A, J, N, V, deg, kg, km, m, ms, ohm, rad, s

from .vehicle import (ARRAYS, ATTITUDE_FUEL, BORESIGHTS, CONVERTERS, DRY, ENGINE_THRUST, ENGINES, EPOCH, GYROS, ISP,
                      LOADS, MAIN_FUEL, MOTOR, RCS, RCS_THRUST, SLOSH, SUN_SENSORS, TACHOMETER, TRACKER, TRACKERS,
                      TURNED)


def build(w, f, panel, sky, orbit):
    panel.converter_a, panel.converter_b = world.FaultPanel(), world.FaultPanel()
    panel.task("panel", every=1 * s, run=[panel.converter_a, panel.converter_b])
    truth(w, f, sky, orbit)
    sensors(w)
    avionics(w)
    connect(w, f, panel)
    w.integrator = world.RK4()
    w.task("sky", every=10 * s, run=[w.sun])
    w.task("dynamics", every=100 * ms, run=[
        w.power, w.driver, w.card_a, w.card_b, w.craft, w.light, w.css, w.adc_a, w.adc_b, w.clock, w.memory, w.recorder,
        w.tracker_a, w.tracker_b, w.gyro_a, w.gyro_b, w.stars_a, w.stars_b, w.angles_a, w.angles_b, w.acc, w.drive,
        w.array])


def truth(w, f, sky, orbit):
    w.sun     = world.CelestialBody(body=world.SUN, sky=sky)
    w.light   = world.Sunlight(sun=world.SUN, shadows=[world.MARS], sky=sky)
    w.wheels  = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=f.wheels.u_max)
    w.rcs     = world.Thrusters(**RCS, F=RCS_THRUST, isp=220 * s, rise=10 * ms, fall=10 * ms, min_on=20 * ms,
                                load=LOADS["propulsion a"], r_KB_B=[[0, 0, -0.8]] * m, propellant=[ATTITUDE_FUEL],
                                radius=[0.25] * m)
    w.engines = world.Thrusters(**ENGINES, F=ENGINE_THRUST, isp=ISP, rise=50 * ms, fall=50 * ms,
                                load=LOADS["propulsion b"], r_KB_B=[[0, 0, 0.2]] * m, propellant=[MAIN_FUEL],
                                radius=[0.55] * m, shape=["SHRINKS"])
    w.slosh   = world.SloshPendulum(mass=SLOSH, length=[0.3] * 2 * m, r_B=[[0, 0, 0.1], [0, 0, 0.3]] * m,
                                    rod_B=[[0.1, 0, -1], [0, 0.1, -1]], damping=[1.5] * 2 * N * s / m)
    w.pressure = world.SolarPressure(light=w.light, area=20 * m**2, Cr=1.3, centre_B=[0, 0, 0.3] * m)

    # The centre of mass is half a centimetre beside the engines' line.
    w.craft   = world.Spacecraft(
        mass=DRY, center_B=[0.01, 0.0075, 0] * m, I_B=[560, 560, 640] * kg * m**2,
        parts=[w.wheels, w.rcs, w.engines, w.slosh, w.pressure], sky=sky, gravity=[world.MARS.zonal(2), world.SUN],
        orbit=orbit, sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.1, -0.3, 0.4] * deg / s)


def sensors(w):
    for name, case, boresight in zip("ab", TRACKERS, BORESIGHTS):
        tracker, gyro = f"stars {name}", f"gyro {name}"
        setattr(w, f"tracker_{name}", world.StarTracker(
            boresight_B=boresight, deviation_across=2e-5 * rad, deviation_about=1.6e-4 * rad,
            sun_exclusion=30 * deg, planet_exclusion=15 * deg, planet_radius=3396 * km, rate_max=1 * deg / s,
            latency=0.2 * s, load=LOADS[tracker]))
        setattr(w, f"stars_{name}", world.StarTrackerElectronics(**TRACKER, **case, load=LOADS[tracker]))
        setattr(w, f"gyro_{name}", world.Gyro(noise=[1e-12 * rad**2 / s] * 3, bias=[5e-6, -3e-6, 4e-6] * rad / s,
                                              load=LOADS[gyro]))
        setattr(w, f"angles_{name}", world.GyroElectronics(**GYROS, load=LOADS[gyro]))
    w.acc    = world.Accelerometer(noise=[(1e-4 * m / s**2)**2 * s] * 3, r_AB_B=[0.2, 0, 0.3] * m,
                                   load=LOADS["accelerometer"])
    w.css    = world.CoarseSunSensors(**SUN_SENSORS)
    for k, name in enumerate("ab"):
        setattr(w, f"adc_{name}", world.SunSensorConverter(
            n=4, first=4 * k, bits=12, scale=CONVERTERS["scale"][k], offset=CONVERTERS["offset"][k], noise=1e-6 * A,
            load=LOADS["converters"]))


def avionics(w):
    w.driver   = world.WheelConverter(n=4, **MOTOR, **TACHOMETER, load=LOADS["wheels"])
    w.drive    = world.ArrayDrive(n=2, **ARRAYS, rate=20 / s, load=LOADS["arrays"])
    w.array    = world.SolarArray(**TURNED, areas=[4, 4] * m**2, efficiency=0.28)
    w.clock    = world.VehicleClock(epoch=EPOCH, pulse=1 * s, drift=12500, slew=1000000)
    resistance = [1e6] * 32
    for load, ohms in {"wheels": 10, "stars a": 90, "stars b": 90, "gyro a": 60, "gyro b": 60, "converters": 900,
                       "accelerometer": 900, "propulsion a": 40, "propulsion b": 20, "arrays": 60,
                       "recorder": 40, "radio": 8, "instrument": 30}.items():
        resistance[LOADS[load]] = ohms
    w.power    = world.PowerUnit(n=32, on=sum(1 << load for load in LOADS.values()), volts=30 * V, inner=0.02 * ohm,
                                 load=resistance * ohm, trip=[10] * 32 * A, trip_after=200 * ms, count_current=1e-3 * A,
                                 count_volts=1e-3 * V, battery=8e6 * J, charge=0.8, watchdog=6 * s)
    w.card_a   = world.PropulsionCard(n=8, load=LOADS["propulsion a"], min_on=20 * ms)
    w.card_b   = world.PropulsionCard(n=6, load=LOADS["propulsion b"], min_on=20 * ms)
    w.memory   = world.Interconnect(slots=8)
    w.recorder = world.Recorder(pages=256, load=LOADS["recorder"], write_time=2 * ms, read_time=1 * ms)


def connect(w, f, panel):
    w.connect(
        w.craft.state         >> [w.light.truth, w.css.truth, w.tracker_a.truth, w.tracker_b.truth, w.gyro_a.truth,
                                  w.gyro_b.truth, w.acc.truth, w.array.truth],
        w.sun.state           >> [w.tracker_a.sun, w.tracker_b.sun],
        w.light.light         >> [w.css.light, w.array.light],
        w.tracker_a.attitude  >> w.stars_a.attitude,
        w.tracker_b.attitude  >> w.stars_b.attitude,
        w.gyro_a.rate         >> w.angles_a.rate,
        w.gyro_b.rate         >> w.angles_b.rate,
        w.css.currents        >> [w.adc_a.currents, w.adc_b.currents],
        panel.converter_a.set >> w.adc_a.injected,
        panel.converter_b.set >> w.adc_b.injected,
        w.wheels.speeds       >> w.driver.speeds,
        w.driver.torques      >> w.wheels.command,
        w.card_a.thrusters    >> w.rcs.times,
        w.card_b.thrusters    >> w.engines.times,
        w.rcs.output          >> w.card_a.thrust,
        w.engines.output      >> w.card_b.thrust,
        w.drive.angles        >> w.array.angles,
        w.array.array         >> w.power.array,
        w.power.supply        >> [w.driver.power, w.card_a.power, w.card_b.power, w.recorder.power, w.tracker_a.power,
                                  w.tracker_b.power, w.gyro_a.power, w.gyro_b.power, w.stars_a.power, w.stars_b.power,
                                  w.angles_a.power, w.angles_b.power, w.acc.power, w.adc_a.power, w.adc_b.power,
                                  w.drive.power, w.rcs.power, w.engines.power],
        w.power.computer      >> [w.clock.computer, w.memory.computer],

        # what flight sees
        w.driver.tachometers  >> f.speeds.tachometers,
        w.stars_a.registers   >> f.stars_a.registers,
        w.stars_b.registers   >> f.stars_b.registers,
        w.angles_a.registers  >> f.gyro_a.registers,
        w.angles_b.registers  >> f.gyro_b.registers,
        w.adc_a.counts        >> f.pyramids.a,
        w.adc_b.counts        >> f.pyramids.b,
        w.acc.force           >> f.sum.force,
        w.clock.reading       >> f.time.clock,
        w.memory.reply        >> f.share.reply,
        w.memory.state        >> f.boot.interconnect,
        w.recorder.reply      >> f.files.recorded,
        w.power.computer      >> f.boot.computer,
        w.power.telemetry     >> f.power.power,
        w.card_a.state        >> f.pulses.card,
        w.card_b.state        >> f.engines.card,
        w.drive.state         >> f.arrays.drive,

        # what flight does
        f.drive.drive         >> w.driver.drive,
        f.time.command        >> w.clock.command,
        f.share.request       >> w.memory.request,
        f.files.request       >> w.recorder.request,
        f.power.command       >> w.power.command,
        f.pulses.command      >> w.card_a.command,
        f.engines.command     >> w.card_b.command,
        f.arrays.command      >> w.drive.command,
    )
