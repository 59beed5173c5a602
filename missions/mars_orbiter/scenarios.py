# SPDX-License-Identifier: Apache-2.0
"""The tests of section 5.4 of the thesis."""
from dataclasses import replace

from numpy import arctan2, array, cross, einsum, pi
from numpy.linalg import norm

from fledge import flight as fsw
from fledge import ground
from fledge.attitude import mrp_to_dcm
from fledge.records.activity import modes
from fledge.units import minute, s

from .insertion import check_captured, fly
from .vehicle import PLACE

X = array([1, 0, 0])
FAILS = 6 * minute + 200 * s        # after the turn from the tumble to the Sun
FINE, ARRAYS_OFF = 5e-4, 0.025      # [rad] what the instrument and the arrays may be off, once they point


def safe(sim):
    """No command: from a tumble to the Sun, where it waits for the ground. Programs of a co-simulation begin so."""
    log = _record(sim)
    sim.run(20 * minute)
    _, sun = _directions(log)
    assert _angle(log["heading.s_B"], sun)[log.time > 30].max() < 0.02, "flight sees the Sun elsewhere"
    assert (pi - _angle(X, sun))[log.time > 600].max() < 0.01, "-b1 is not on the Sun"
    assert log["arrays.state.off"][log.time > 600].max() < ARRAYS_OFF and not log["table.faulted"].any()


def pointing(sim):
    """Test 1: the ground has the orbiter point inertially, at Mars, at the Sun and at Mars again."""
    log = _record(sim)
    ground.perform(sim, "pointing.py")

    mars, sun = (_angle(X, way) for way in _directions(log))
    arrays = log["arrays.state.off"][:, 0]
    of = log.series("error.sigma_BR")
    off = replace(of, key="mars", name="off", values=mars, unit="rad", meaning="between the instrument and Mars")
    log.plot("craft.state.sigma_BN", "craft.state.omega_BN_B", titles=["(a) attitude", "(b) rate"],
             name="pointing_attitude", title="Pointing commands: the attitude of the body", units={
                 "craft.state.omega_BN_B": "deg/s"})
    log.plot("wheels.speeds.Omega", units={"wheels.speeds.Omega": "rpm"}, name="pointing_wheels",
             title="Pointing commands: the speeds of the wheels")
    log.plot(off, "arrays.state.off", titles=["(a) the instrument's angle to Mars", "(b) the arrays' to the Sun"],
             units={"mars": "deg", "arrays.state.off": "deg"}, name="pointing_miss",
             title="Pointing commands: what instrument and arrays miss")

    # At the end of each mode it points as the mode requires, by the truth, and the arrays at the Sun.
    begins = modes(log)["flight"]
    for (_, name), end in zip(begins[1:], [*(t for t, _ in begins[2:]), sim.time], strict=True):
        last = (log.time > end - 60) & (log.time < end)
        if name == "mars":
            assert mars[last].max() < FINE, f"the instrument is {mars[last].max():.2g} rad off Mars"
        if name == "sun":
            assert (pi - sun[last]).max() < FINE, "the body's -b1 is not on the Sun"
        if name != "inertial":
            assert arrays[last].max() < ARRAYS_OFF, f"{name}: the arrays are off the Sun"
    assert [name for _, name in begins] == ["safe", "inertial", "mars", "sun", "mars"]
    assert not log["table.faulted"].any(), "a unit was found faulty"


def sun_sensors(sim):
    """Test 3: 200 s into the safe mode all sensors of pyramid A babble (figures 5.14 and 5.15)."""
    log = converter_fails(sim, "a", "BABBLE", 0b1111)
    log.plot("adc_a.counts.counts", "adc_b.counts.counts", "table.faulted", titles=[
        "(a) converter A", "(b) converter B", "(c) units that the fault protection has isolated, a bit for each"],
        name="sun_sensors", title="All sensors of pyramid A babble")


def converter_fails(sim, which, kind, channels):
    """Fly a fault of a converter, and judge what flight says of it."""
    log = sun_faults(sim, {0: {which: [{"kind": kind, "channels": channels}]}})
    check_named(log, which, within=45)
    return log


def sun_faults(sim, changes, lasts=5 * minute):
    """Fly the safe mode while faults of the converters change, as a program beside the simulation injects them.
    changes: {time [s] from FAILS on: {"a": faults, "b": faults}}."""
    panel, log = sim.process("panel"), _record(sim)

    def inject(faults):
        for which, converter_faults in faults.items():
            getattr(panel, f"converter_{which}").faults = converter_faults

    for time, faults in changes.items():
        panel.at(FAILS + time * s, lambda faults=faults: inject(faults))
    sim.run(FAILS + lasts)
    return log


def check_named(log, which, within, off=0.05):
    """The converter is named and isolated within a time [s] of the fault, the other one never, and -b1 stays on the Sun
    [rad]."""
    named = log.time[log["status.faulty"] != 0] - FAILS.value
    assert len(named) and 0 < named[0] < within, f"converter {which} is not named in time: {named[:1]}"
    assert set(log["status.faulty"]) == {0, "ab".index(which) + 1}, "the other one is blamed"
    assert not log["table.faulted"][log.time < FAILS.value].any()
    assert int(log["table.faulted"][-1]) == 1 << PLACE[f"converter {which}"], "the table of units says else"
    assert sun_off(log).max() < off, "the body left the Sun"


def sun_off(log, since=FAILS):
    """[rad] Between -b1 and the Sun from a time on, by the truth."""
    return (pi - _angle(X, _directions(log)[1]))[log.time > since.value]


def insertion(sim):
    """Test 2: the ground sends the plan of the orbit insertion, and flight does it by itself: it sleeps, wakes, turns,
    is reset, turns again, settles its propellant, burns, and points at Mars."""
    flown = fly(sim)
    log, planned, f = flown.log, flown.planned, sim.flight
    log.plot("burn.state.gained", "error.sigma_BR", "engines.output.thrust", "rcs.output.thrust",
             titles=["(a) gained", "(b) attitude error", "(c) thrust of the engines", "(d) of the attitude thrusters"],
             name="insertion", title="Mars orbit insertion")
    check_captured(flown)
    assert flown.modes == ["safe", "sleep", "sun", "delta_v", "safe", "delta_v", "sun", "mars"]
    assert f.boot.boot.boots == 2 and f.time.time.synchronized and f.time.time.jams == 1, "it was not reset once"
    assert f.files.state.tables == 7 and f.stored.state.skipped == 0
    used = (log["engines.output.used"] + log["rcs.output.used"])[-1]
    assert abs(used / planned.used - 1) < 0.03, f"{used:.4g} kg were used, not {planned.used:.4g} kg"
    assert not log["error.sigma_BR"][log["burn.state.phase"] == fsw.BurnPhase.RUNS].max() > 0.03


def _record(sim):
    f, w = sim.flight, sim.process("world")
    return sim.record(w.craft.state, w.wheels.speeds, w.sun.state, f.tracking.error, f.filter.attitude, f.line.heading,
                      f.arrays.state, f.pyramids.status, f.protection.table, w.adc_a.counts, w.adc_b.counts,
                      every=1 * s)


def _directions(log):
    """To Mars and to the Sun, by the truth, B components."""
    r, BN = log["craft.state.r_BN_N"], mrp_to_dcm(log["craft.state.sigma_BN"])
    return [einsum("nij,nj->ni", BN, way) for way in (-r, log["sun.state.r_PN_N"] - r)]


def _angle(a, b):
    """[rad] Between vectors of any length, (3) or (n, 3)."""
    return arctan2(norm(cross(a, b), axis=-1), einsum("...j,...j->...", a, b))
