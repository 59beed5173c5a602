# SPDX-License-Identifier: Apache-2.0
"""What the orbiter must do: drawn from the tests of sections 5.4 and 7.1 of the thesis, and from the design.

Limits come from data sheets and from what the mission needs, not from runs. The truth judges wherever there is one.
"""
from functools import reduce
from math import sqrt
from operator import and_, or_

from fledge import world
from fledge.requirements import after, always, angle, begins, eventually, implies, never, settles, turned, until, within
from fledge.units import N, W, deg, km, m, minute, mrad, ms, rad, s, us

from .vehicle import ATTITUDE_FUEL, MAIN_FUEL, PLACE

INSTRUMENT = 0.5 * mrad         # what the instrument may be off
ARRAYS = 25 * mrad              # what the arrays may be off: they move by more than 20 mrad only
SETTLES = 10 * minute           # a turn by any angle
LOADS = 390 * W                 # of all loads together: 30 V squared over the resistances of world.py
FAR = 12000 * km                # from Mars: the insertion ends nearer
ALONE, TURNS = ["safe", "sun_sensors"], ["pointing"]
ALL = ["safe", "pointing", "sun_sensors", "insertion"]


def system(r):
    """The system."""
    mode = _mode(r)
    position, v = (r.signal(f"world.craft.state.{name}").norm() for name in ("r_BN_N", "v_BN_N"))
    r.require("SYS-1", "The orbiter shall have power at all times: its battery holds 60 % of its charge.",
              always(_charge(r) > 0.6), rationale="A battery that is discharged no deeper than this lasts the "
              "mission.", shown_by=ALL)
    r.require("SYS-2", "The orbiter shall be captured by Mars: it ends nearer than 12,000 km, slower than what escapes "
              "from there.", eventually(always((position < FAR) & (
                  v < sqrt(2 * world.MARS.mu / FAR.value) * m / s))),
              rationale="Thesis 5.4.2: without the insertion there is no mission.", shown_by=["insertion"])
    r.require("SYS-3", "The orbiter shall look at Mars for two minutes at a time.",
              eventually(always((mode == "mars") & (_to_mars(r) < INSTRUMENT), 0 * s, 2 * minute)),
              rationale="Thesis 5.4.1: an observation lasts so long.", shown_by=TURNS)
    r.require("SYS-4", "The orbiter shall end at Mars or on the Sun, or say why not, after any two faults.",
              rationale="It cannot be repaired.", method="analysis", evidence="docs/orbiter.md#two-faults-at-random")
    r.require("SYS-5", "The orbiter shall do and say the same on each computer that its flight software runs on.",
              rationale="Thesis 5.4 and 7.1: what is shown on one target counts for all.", method="inspection",
              evidence="missions/mars_orbiter/mars_orbiter_test.py")


def pointing(r):
    """Pointing."""
    mode = _mode(r)
    sigma, off = r.signal("world.craft.state.sigma_BN"), r.signal("flight.arrays.state.off")
    wanted = r.signal("flight.rest.reference.sigma_RN")
    error = (4 * (sigma - wanted).norm()).named("the angle to the wanted attitude")
    r.require("PNT-1", "The orbiter shall point its instrument at Mars up to 0.5 mrad within 10 minutes of the mode "
              "mars, and until that ends.", _holds(mode == "mars", _to_mars(r) < INSTRUMENT),
              rationale="The instrument's field of view; thesis figure 5.11.", parent="SYS-3", shown_by=TURNS)
    r.require("PNT-2", "The orbiter shall point -b1 at the Sun up to 0.5 mrad within 10 minutes of the mode sun, and "
              "until that ends.", _holds(mode == "sun", _off_sun(r) < INSTRUMENT),
              rationale="Flight knows its attitude as well as in the mode mars.", parent="SYS-3", shown_by=TURNS)
    r.require("PNT-3", "The orbiter shall have the attitude that the ground has written up to 0.5 mrad within 10 "
              "minutes of the mode inertial, and until that ends.",
              _holds(mode == "inertial", error < INSTRUMENT.value),
              rationale="Thesis 5.4.1: the first command of the test.", parent="SYS-3", shown_by=TURNS)
    r.require("PNT-4", "The orbiter shall have its arrays on the Sun up to 25 mrad within 10 minutes of the modes mars "
              "and sun, and until they end.", _holds(mode == "mars", off.max_abs() < ARRAYS)
              & _holds(mode == "sun", off.max_abs() < ARRAYS),
              rationale="Thesis figure 5.11; the arrays rest within 20 mrad.", parent="SYS-1", shown_by=TURNS)
    r.require("PNT-5", "The orbiter shall keep its wheels slower than 400 rad/s.",
              always(r.signal("world.wheels.speeds.Omega").max_abs() < 400 * rad / s),
              rationale="At 560 rad/s the bus has no voltage left for a torque; monitors fire at 400 rad/s. Thesis "
              "figure 5.10.", parent="SYS-3", shown_by=ALL)


def navigation(r):
    """Navigation."""
    mode = _mode(r)
    attitude, heading = "flight.filter.attitude", "flight.line.heading"
    true, sigma = r.signal("world.craft.state.sigma_BN"), r.signal(f"{attitude}.sigma_BN")
    good = r.signal(f"{attitude}.head.quality") == "GOOD"
    lit = r.signal("world.light.light.visible") > 0.99
    sensed = angle(r.signal(f"{heading}.s_B"), turned(true, _sun(r))).named("the error of the sensed Sun")
    miss = [angle(turned(sigma, to), turned(true, to)).named(f"the error of the direction to {name}")
            for name, to in (("the Sun", _sun(r)), ("Mars", _mars(r)))]
    r.require("NAV-1", "The orbiter shall know its attitude again within a minute, however it turns.",
              always(within(1 * minute, good)), rationale="Thesis 5.4.1: modes wait for the lock. Star trackers are "
              "blind while the body turns faster than 1 deg/s.", parent="SYS-3", shown_by=[*ALONE, *TURNS])
    r.require("NAV-2", "The orbiter shall see Mars and the Sun within 10 mrad of where they are while it says that its "
              "attitude is good.", always(implies(good, (miss[0] < 10 * mrad) & (miss[1] < 10 * mrad))),
              rationale="Engines open up to an error of 1 degree, of which this is a half.", parent="SYS-2",
              shown_by=ALL)
    r.require("NAV-3", "The orbiter shall see the Sun within 20 mrad of where it is, while it is lit and says that it "
              "sees it well.",
              always(implies(lit & (r.signal(f"{heading}.head.quality") == "GOOD"), sensed < 20 * mrad)),
              rationale="The safe mode and the arrays have no other direction.", parent="SAF-1", shown_by=ALL)
    known, error = (r.signal(f"flight.time.time.{name}") for name in ("synchronized", "error"))
    r.require("NAV-4", "The orbiter shall jam its clock within 10 s of each start, and keep it up to 100 us from then "
              "on.", always(within(10 * s, known == 1)) & always(implies(known == 1, abs(error) < 100 * us)),
              rationale="Thesis 5.4.2: time jams. In 100 us the orbiter moves by less than a metre.", parent="SYS-2",
              shown_by=ALL)
    position = r.signal("flight.orbit.orbit.r_BN_N") - r.signal("world.craft.state.r_BN_N")
    r.require("NAV-5", "The orbiter shall know its position up to 100 m while it points at Mars.",
              _holds(mode == "mars", position.norm().named("the error of the position") < 100 * m, 10 * s),
              rationale="The elements on board leave out that Mars is flat, which moves the orbiter by as much in two "
              "hours; 0.5 mrad from there is 10 km.", parent="PNT-1", shown_by=TURNS)


def safe_mode(r):
    """Safe mode."""
    mode = _mode(r)
    resets, thrust = r.signal("world.power.computer.count"), r.signal("world.rcs.output.thrust")
    r.require("SAF-1", "The orbiter shall point -b1 at the Sun up to 10 mrad within 10 minutes, from its tumble and "
              "without a command, and stay there.",
              settles((mode == "safe") & (_off_sun(r) < 10 * mrad), within=SETTLES),
              rationale="Thesis 5.4.3: it waits for the ground there; the arrays lose nothing.", parent="SYS-1",
              shown_by=ALONE)
    r.require("SAF-2", "The orbiter shall keep its thrusters shut in the safe mode.",
              _holds(mode == "safe", thrust.max_abs() < 0.1 * N, 2 * s),
              rationale="A fault must not cost propellant, nor change the orbit.", parent="SYS-4", shown_by=ALL)
    r.require("SAF-3", "The orbiter shall be in the safe mode within 5 s of a reset of its computer.",
              always(implies(begins(resets != 0), within(5 * s, mode == "safe"))) & eventually(resets != 0),
              rationale="Thesis 5.4.2: resets. The computer is down for 3 s.", parent="SYS-4", shown_by=["insertion"])


def fault_protection(r):
    """Fault protection."""
    _mode(r)
    a, b = (r.signal(f"panel.converter_{name}.set.n") != 0 for name in "ab")
    named, faulted = r.signal("flight.pyramids.status.faulty"), r.signal("flight.protection.table.faulted")
    isolated = {name: faulted == 1 << PLACE[f"converter {name}"] for name in "ab"}
    names = {name: named == bit for name, bit in (("a", 1), ("b", 2))}
    r.require("FDP-1", "The orbiter shall name a converter of sun sensors, and isolate it in its table of units, "
              "within 45 s of its fault.", always(implies(begins(a), within(45 * s, names["a"] & isolated["a"]))
                                                  & implies(begins(b), within(45 * s, names["b"] & isolated["b"]))),
              rationale="Thesis 5.4.3, figure 5.15.", parent="SYS-4", shown_by=["sun_sensors"])
    r.require("FDP-2", "The orbiter shall never name a converter without a fault.",
              always(implies(~after(a), ~names["a"]) & implies(~after(b), ~names["b"]) & (named != 0b11)),
              rationale="Thesis 5.4.3: converter 2 stays primary.", parent="SYS-4", shown_by=ALL)
    r.require("FDP-3", "The orbiter shall keep -b1 up to 50 mrad on the Sun while a converter fails.",
              always(implies(after(a | b), _off_sun(r) < 50 * mrad)),
              rationale="The arrays lose a thousandth there.", parent="SAF-1", shown_by=["sun_sensors"])
    r.require("FDP-4", "The orbiter shall isolate no unit while nothing has failed.",
              always(implies(~after(a | b), faulted == 0)),
              rationale="A false alarm costs a spare unit, and the mission its plan.", parent="SYS-4", shown_by=ALL)
    r.require("FDP-5", "The orbiter shall have two chains of attitude that agree, but for less than 5 minutes at a "
              "time.", never(always(r.signal("flight.differ.state.tripped") == 1, 0 * s, 5 * minute)),
              rationale="After 5 minutes a rule enters the safe mode.", parent="SYS-4", shown_by=ALL)


def power(r):
    """Power."""
    mode = _mode(r)
    bus = (1e-3 * r.signal("world.power.telemetry.bus")).named("the volts of the bus")
    array, lit = r.signal("world.array.array.power"), r.signal("world.light.light.visible") > 0.99
    trips = [r.signal(f"world.power.telemetry.cards[{card}].trips") == 0 for card in range(4)]
    r.require("POW-1", "The orbiter shall have twice the power of all its loads from its arrays within 10 minutes of "
              "the modes safe and sun, until they end or Mars hides the Sun.",
              _holds((mode == "safe") | (mode == "sun"), (array > 2 * LOADS) | ~lit),
              rationale="As much charges the battery as is used.", parent="SYS-1", shown_by=ALL)
    r.require("POW-2", "The orbiter shall fill its battery to 99 % within 50 minutes.",
              within(50 * minute, _charge(r) > 0.99),
              rationale="It starts with four fifths; by the data sheets the rest takes half an hour.", parent="SYS-1",
              shown_by=["pointing", "insertion"])
    r.require("POW-3", "The orbiter shall have 28 V on its bus and no load that trips.",
              always(reduce(and_, trips, bus > 28)),
              rationale="The converter of the wheels' motors is made for 28 V.", parent="SYS-1", shown_by=ALL)


def insertion(r):
    """Orbit insertion."""
    mode = _mode(r)
    burns, ends, captured = (r.event("flight", name) for name in ("burns", "ends", "captured"))
    error = (4 * r.signal("flight.tracking.error.sigma_BR").norm()).named("the angle to the planned direction")
    thrust = r.signal("world.engines.output.thrust")
    shut = thrust.max_abs() < 1 * N
    phase, to_go = (r.signal(f"flight.burned.kept.{name}") for name in ("phase", "to_go"))
    torque, push = r.signal("world.wheels.applied.u"), r.signal("world.rcs.output.thrust")
    booted, tables = (r.signal(f"flight.files.state.{name}") for name in ("booted", "tables"))
    attitude_fuel, main_fuel = (r.signal(f"world.{name}.tanks.mass")[0] for name in ("rcs", "engines"))
    shown = {"parent": "SYS-2", "shown_by": ["insertion"]}
    r.require("INS-1", "The orbiter shall neither turn its wheels nor open thrusters while it sleeps.",
              _holds(mode == "sleep", (torque.max_abs() < 0.01 * N * m) & (push.max_abs() < 0.1 * N), 5 * s),
              rationale="Thesis 5.4.2: flight sleeps in the cruise. A twentieth of the torque holds speeds.", **shown)
    r.require("INS-2", "The orbiter shall thrust within 1 degree of the planned direction when engines open, and "
              "within 4 degrees while they burn.", always(
                  implies(burns, error < 1 * deg.value) & implies(phase == "RUNS", error < 4 * deg.value)),
              rationale="4 degrees lose a four-hundredth of the velocity; beyond, the burn is aborted.", **shown)
    r.require("INS-3", "The orbiter shall gain the planned velocity up to 1 m/s.",
              eventually(phase == "COMPLETE") & always(implies(phase == "COMPLETE", abs(to_go) < 1 * m / s)),
              rationale="A thousandth of the plan, which moves the period of 40 hours by 20 minutes.", **shown)
    r.require("INS-4", "The orbiter shall keep its engines shut until the burn, and from 1 s after it on.",
              until(shut, burns) & always(implies(ends, within(1 * s, always(shut)))),
              rationale="Thesis 5.4.2: burn times in the cards' registers.", **shown)
    r.require("INS-5", "The orbiter shall have more than 100 N from each engine within 1 s of the burn's begin.",
              always(implies(burns, within(1 * s, reduce(and_, [thrust[k] > 100 * N for k in range(6)])))),
              rationale="An engine has 120 N; with a tenth less of one the plan still captures it.", **shown)
    r.require("INS-6", "The orbiter shall have the tables of the burn back within a minute of a reset.",
              always(implies((mode == "safe") & begins(booted == 1) & after(10 * minute), tables == 6))
              & always(within(1 * minute, booted == 1)),
              rationale="Thesis 5.4.2: non-volatile memory; the sequence has a reset in it.", **shown)
    r.require("INS-7", "The orbiter shall have a quarter of its propellant left, in each tank.",
              always((attitude_fuel > ATTITUDE_FUEL / 4) & (main_fuel > MAIN_FUEL / 4)),
              rationale="The mission after the insertion needs it.", **shown)
    r.require("INS-8", "The orbiter shall turn to the Sun by itself when it is captured, up to 10 mrad in 10 minutes.",
              eventually(captured) & always(implies(captured, within(1 * s, mode == "sun")))
              & _holds(mode == "sun", _off_sun(r) < 10 * mrad),
              rationale="The arrays are on the Sun before the ground knows.", **shown | {"parent": "SYS-1"})
    r.require("INS-9", "The orbiter shall point at Mars up to 50 mrad by the planned orbit within 15 minutes.",
              _holds(mode == "mars", _to_mars(r) < 50 * mrad, 15 * minute),
              rationale="Mars' disc is 0.6 rad wide there, so the first image has it.", **shown | {"parent": "SYS-3"})


def commanding(r):
    """Commands."""
    mode = _mode(r)
    attitude = r.signal("flight.differ.attitude.head.quality") == "GOOD"
    bodies = [r.signal(f"flight.{body}_at.body.head.quality") == "GOOD" for body in ("mars", "sun", "earth")]
    entered = [begins(mode == name) for name in ("sun", "mars", "two_body")]
    skipped = r.signal("flight.stored.state.skipped")
    r.require("CMD-1", "The orbiter shall enter a mode that points at bodies only while it knows its attitude and "
              "where they are.", always(implies(reduce(or_, entered), reduce(and_, bodies, attitude))),
              rationale="Thesis 5.4.1: lock and ephemerides come before the commands.", parent="SYS-3",
              shown_by=["pointing", "insertion"])
    r.require("CMD-2", "The orbiter shall execute the sequence of the insertion by itself and skip no command.",
              _order(mode, "safe", "sleep", "sun", "delta_v", "safe", "delta_v", "sun", "mars")
              & always(skipped == 0), rationale="Thesis 5.4.2: block commands; the Earth is 11 minutes away.",
              parent="SYS-2", shown_by=["insertion"])
    r.require("CMD-3", "The orbiter shall take the modes that the ground commands, one after the other.",
              _order(mode, "safe", "inertial", "mars", "sun", "mars"), rationale="Thesis 5.4.1.", parent="SYS-3",
              shown_by=TURNS)
    r.require("CMD-4", "The orbiter shall refuse commands and tables that are wrong, and stay in a mode that is safe.",
              rationale="The ground errs, and so does the link.", method="inspection", parent="SYS-4",
              evidence="missions/mars_orbiter/bad_input_test.py")


def data(r):
    """Data and the link."""
    _mode(r)
    sent = r.signal("flight.reports.state.sent")
    received, failed = (r.signal(f"flight.files.state.{name}") for name in ("received", "failed"))
    signal, state = (r.signal(f"world.radio.up.{name}") for name in ("eb_n0_dB", "state"))
    r.require("DAT-1", "The orbiter shall send housekeeping from its start on: 100 packets in 10 minutes.",
              always(implies(after(10 * minute), sent > 100)),
              rationale="Thesis 5.4.1: the ground watches telemetry. Two reports each 10 s give 120.", parent="SYS-3",
              shown_by=[*ALONE, *TURNS])
    r.require("DAT-2", "The orbiter shall receive the six files of the insertion, and lose none.",
              eventually(received == 6) & always(failed == 0), rationale="Thesis 5.4.2, figure 5.13: CFDP.",
              parent="SYS-2", shown_by=["insertion"])
    r.require("DAT-3", "The orbiter shall hear the station with a margin of 3 dB in any attitude.",
              always(implies(state == "LOCKED", signal > 12)), rationale="Its receiver needs 9 dB.", parent="SYS-3",
              shown_by=["pointing", "insertion"])


def _mode(r):
    r.every = 500 * ms              # of flight
    return r.mode("flight")


def _charge(r):
    """[-] Of the battery, from its counts."""
    return (1 / 65535 * r.signal("world.power.telemetry.battery")).named("the battery's charge")


def _sun(r):
    """[m] From the orbiter to the Sun by the truth, N components."""
    return r.signal("world.sun.state.r_PN_N") - r.signal("world.craft.state.r_BN_N")


def _mars(r):
    """[m] From the orbiter to Mars by the truth, N components."""
    return -1 * r.signal("world.craft.state.r_BN_N")


def _off_sun(r):
    """[rad] Between -b1 and the Sun, by the truth."""
    off = angle(turned(r.signal("world.craft.state.sigma_BN"), _sun(r)), [-1, 0, 0])
    return off.named("the angle of -b1 to the Sun")


def _to_mars(r):
    """[rad] Between the instrument and Mars, by the truth."""
    off = angle(turned(r.signal("world.craft.state.sigma_BN"), _mars(r)), [1, 0, 0])
    return off.named("the instrument's angle to Mars")


def _holds(while_, what, after=SETTLES):
    """So long after `while_` has begun, `what` holds, and does until `while_` or the run ends."""
    return always(implies(begins(while_), within(after, until(what, ~while_) | always(what))))


def _order(mode, first, *others):
    return eventually((mode == first) & _order(mode, *others)) if others else eventually(mode == first)
