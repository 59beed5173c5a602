# SPDX-License-Identifier: Apache-2.0
"""The truth: a rigid body with four wheels at Mars, and the avionics between it and flight."""
from fledge import Orbit, world
from fledge.units import A, N, V, kg, km, m, minute, ms, ohm, rad, s

from .flight import LOADS, MOTOR, OFFSETS, SCALES, SUN_SENSORS, TACHOMETER

MARS = world.MARS.with_mu(4.2828314e13 * m**3 / s**2)    # as in the thesis


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)
    w.craft  = world.Spacecraft(I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[MARS],
                                orbit=Orbit(MARS, a=7471.618 * km, e=0.1), sigma_BN=[0.1, 0.2, -0.3],
                                omega_BN_B=[0.001, -0.01, 0.02] * rad / s)
    w.nav    = world.Navigation()
    w.css    = world.CoarseSunSensors(**SUN_SENSORS, s_N=[0.6, 0, 0.8])

    # Each converter has its own scale and offset. From 6 minutes on one channel of A stays at its end.
    w.adc_a  = world.SunSensorConverter(n=8, bits=12, scale=SCALES[0], offset=OFFSETS[0], noise=1e-6 * A,
                                        faults=[{"kind": "HIGH", "channels": 1 << 7, "begin": 6 * minute}])
    w.adc_b  = world.SunSensorConverter(n=8, bits=12, scale=SCALES[1], offset=OFFSETS[1], noise=1e-6 * A)
    w.driver = world.WheelConverter(n=4, **MOTOR, **TACHOMETER)
    w.clock  = world.VehicleClock(epoch=7e8 * s, pulse=1 * s, drift=12500, slew=1000000)

    # The computer is reset at 1 minute, while the body turns; the sensors' load has a latch-up at 3 minutes.
    w.power  = world.PowerUnit(n=3, on=0b011, volts=30 * V, inner=0.1 * ohm, load=[10, 50, 20] * ohm,
                               trip=[5, 2, 4] * A, trip_after=200 * ms, count_current=1e-3 * A, count_volts=1e-3 * V,
                               latch_up_at=3 * minute, latch_up_load=LOADS["sensors"], latch_up_current=3 * A,
                               reset_at=[60.3, 0, 0, 0] * s, watchdog=6 * s)
    w.card   = world.PropulsionCard(n=4, load=LOADS["propulsion"], min_on=20 * ms)
    w.memory = world.Interconnect(slots=8)

    # A page is worn out. While the computer is down, a bit flips in two pages of the first file, and two flip in a word
    # of the second one.
    w.recorder = world.Recorder(pages=32, write_time=2 * ms, read_time=1 * ms, faults=[
        {"kind": "WEAR", "page": 4},
        {"kind": "FLIP", "page": 1, "bit": 1000, "bits": 1, "begin": 61 * s},
        {"kind": "FLIP", "page": 3, "bit": 1003, "bits": 1, "begin": 61 * s},
        {"kind": "FLIP", "page": 9, "bit": 512, "bits": 2, "begin": 62 * s}])

    w.connect(
        w.craft.state        >> [w.nav.truth, w.css.truth],
        w.css.currents       >> [w.adc_a.currents, w.adc_b.currents],
        w.wheels.speeds      >> w.driver.speeds,
        w.driver.torques     >> w.wheels.command,
        w.power.telemetry    >> w.card.power,
        w.power.computer     >> [w.clock.computer, w.memory.computer],

        # what flight sees
        w.nav.attitude       >> f.tracking.attitude,
        w.driver.tachometers >> f.speeds.tachometers,
        w.adc_a.counts       >> f.sun.a,
        w.adc_b.counts       >> f.sun.b,
        w.clock.reading      >> f.time.clock,
        w.memory.reply       >> f.boot.reply,
        w.memory.state       >> f.boot.interconnect,
        w.recorder.reply     >> f.files.recorded,
        w.power.computer     >> f.boot.computer,
        w.power.telemetry    >> f.power.power,
        w.card.state         >> f.burns.card,

        # what flight does
        f.drive.drive        >> w.driver.drive,
        f.time.command       >> w.clock.command,
        f.boot.request       >> w.memory.request,
        f.files.request      >> w.recorder.request,
        f.power.command      >> w.power.command,
        f.burns.burn         >> w.card.burn,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.driver, w.craft, w.nav, w.css, w.adc_a, w.adc_b, w.power, w.clock, w.card,
                                            w.memory, w.recorder])
