# SPDX-License-Identifier: Apache-2.0
"""The truth: a rigid body with four wheels at Mars, and the avionics between it and flight."""
from fledge import Orbit, world
from fledge.attitude import mrp_to_dcm
from fledge.units import A, N, V, kg, km, m, minute, ms, ohm, rad, s

from .flight import ARRAYS, GYROS, LOADS, MOTOR, OFFSETS, SCALES, SUN_SENSORS, TACHOMETER, TRACKER

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)
    w.craft  = world.Spacecraft(I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[MARS],
                                orbit=Orbit(MARS, a=7471.618 * km, e=0.1), sigma_BN=[0.1, 0.2, -0.3],
                                omega_BN_B=[0.001, -0.01, 0.02] * rad / s)
    w.nav    = world.Navigation()
    w.css    = world.CoarseSunSensors(**SUN_SENSORS, s_N=[0.96, 0.28, 0])

    # They are behind the sensors' load, and their electronics too.
    w.tracker = world.StarTracker(boresight_B=mrp_to_dcm(TRACKER["sigma_SB"])[2], deviation_across=2e-5 * rad,
                                  deviation_about=1.6e-4 * rad, latency=0.2 * s, load=LOADS["sensors"])
    w.gyro    = world.Gyro(noise=[1e-12 * rad**2 / s] * 3, bias=[5e-6, -3e-6, 4e-6] * rad / s, load=LOADS["sensors"])
    w.stars   = world.StarTrackerElectronics(**TRACKER, load=LOADS["sensors"])
    w.angles  = world.GyroElectronics(**GYROS, load=LOADS["sensors"])

    # A converter for each pyramid, with its own scale and offset. From 6 minutes on one channel of A stays at its end.
    w.adc_a  = world.SunSensorConverter(n=4, bits=12, scale=SCALES[0], offset=OFFSETS[0], noise=1e-6 * A,
                                        faults=[{"kind": "HIGH", "channels": 1 << 3, "begin": 6 * minute}])
    w.adc_b  = world.SunSensorConverter(n=4, first=4, bits=12, scale=SCALES[1], offset=OFFSETS[1], noise=1e-6 * A)
    w.driver = world.WheelConverter(n=4, **MOTOR, **TACHOMETER, load=LOADS["wheels"])
    w.drive  = world.ArrayDrive(n=2, **ARRAYS, rate=20 / s, load=LOADS["arrays"])
    w.clock  = world.VehicleClock(epoch=7e8 * s, pulse=1 * s, drift=12500, slew=1000000)

    # The computer is reset at 1 minute, while the body turns; the sensors' load has a latch-up at 3 minutes.
    w.power  = world.PowerUnit(n=10, on=0b1_0000_0011, volts=30 * V, inner=0.1 * ohm,
                               load=[10, 50, 20, *[1e6] * 5, 40, 60] * ohm, trip=[5, 2, 4, *[0] * 7] * A,
                               trip_after=200 * ms, count_current=1e-3 * A, count_volts=1e-3 * V,
                               latch_up_at=3 * minute, latch_up_load=LOADS["sensors"], latch_up_current=3 * A,
                               reset_at=[60.3, 0, 0, 0] * s, watchdog=6 * s)
    w.card   = world.PropulsionCard(n=4, load=LOADS["propulsion"], min_on=20 * ms)
    w.memory = world.Interconnect(slots=8)

    # A page is worn out. While the computer is down, a bit flips in two pages of the first file, and two flip in a word
    # of the second one.
    w.recorder = world.Recorder(pages=32, load=LOADS["recorder"], write_time=2 * ms, read_time=1 * ms, faults=[
        {"kind": "WEAR", "page": 4},
        {"kind": "FLIP", "page": 1, "bit": 1000, "bits": 1, "begin": 61 * s},
        {"kind": "FLIP", "page": 3, "bit": 1003, "bits": 1, "begin": 61 * s},
        {"kind": "FLIP", "page": 9, "bit": 512, "bits": 2, "begin": 62 * s}])

    w.connect(
        w.craft.state        >> [w.nav.truth, w.css.truth, w.tracker.truth, w.gyro.truth],
        w.tracker.attitude   >> w.stars.attitude,
        w.gyro.rate          >> w.angles.rate,
        w.css.currents       >> [w.adc_a.currents, w.adc_b.currents],
        w.wheels.speeds      >> w.driver.speeds,
        w.driver.torques     >> w.wheels.command,
        w.power.supply       >> [w.driver.power, w.card.power, w.recorder.power, w.tracker.power, w.gyro.power,
                                 w.stars.power, w.angles.power, w.drive.power],
        w.power.computer     >> [w.clock.computer, w.memory.computer],

        # what flight sees
        w.nav.attitude       >> f.tracking.attitude,
        w.driver.tachometers >> f.speeds.tachometers,
        w.stars.registers    >> f.stars.registers,
        w.angles.registers   >> f.gyros.registers,
        w.adc_a.counts       >> f.sun.a,
        w.adc_b.counts       >> f.sun.b,
        w.clock.reading      >> f.time.clock,
        w.memory.reply       >> f.boot.reply,
        w.memory.state       >> f.boot.interconnect,
        w.recorder.reply     >> f.files.recorded,
        w.power.computer     >> f.boot.computer,
        w.power.telemetry    >> f.power.power,
        w.card.state         >> f.burns.card,
        w.drive.state        >> f.arrays.drive,

        # what flight does
        f.drive.drive        >> w.driver.drive,
        f.time.command       >> w.clock.command,
        f.boot.request       >> w.memory.request,
        f.files.request      >> w.recorder.request,
        f.power.command      >> w.power.command,
        f.burns.command      >> w.card.command,
        f.arrays.command     >> w.drive.command,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.power, w.driver, w.craft, w.nav, w.css, w.adc_a, w.adc_b, w.clock, w.card,
                                            w.memory, w.recorder, w.tracker, w.gyro, w.stars, w.angles, w.drive])
