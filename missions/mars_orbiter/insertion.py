# SPDX-License-Identifier: Apache-2.0
"""Test 2, section 5.4.2 of the thesis: the orbit insertion, nominal and with what may go wrong. Each ends captured, or
safe with the reason in telemetry."""
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy import arccos, array, pi
from numpy.linalg import norm

from fledge import Orbit, ground, world
from fledge.attitude import mrp_to_dcm
from fledge.commands import Event, decoded
from fledge.records.activity import modes
from fledge.units import s

from .plan import PERIOD, Plan, plan

BURN_ABORT = ["", "TOO_LONG", "OFF_POINT", "BLIND", "NO_THRUST", "LATE", "LEFT"]
LASTS = 80 * 60         # [s] of the run after the start of the burn


@dataclass(frozen=True)
class Flown:
    """What became of it, by the truth and by telemetry."""

    sim: Any
    log: Any
    planned: Plan
    orbit: Orbit            # at the end, by the truth
    modes: list[str]        # in their order
    events: list[Event]     # of telemetry

    def events_of(self, output: str) -> list[Event]:
        return [event for event in self.events if event.output == f"flight.{output}"]

    @property
    def period(self) -> float:
        """[s]"""
        a = self.orbit.p / (1 - self.orbit.e**2)
        return float(2 * pi * (a**3 / world.MARS.mu) ** 0.5)


def telemetry(commands: Any) -> list[bytes]:
    """A list that collects the packets that a flight process' take_packets() returns, to any caller."""
    packets: list[bytes] = []
    take = commands.take_packets

    def taken() -> Any:
        found = take()
        packets.extend(received.packet for received in found)
        return found

    commands.take_packets = taken
    return packets


def fly(sim: Any, first: Callable[[Any], None] | None = None, **changes: Any) -> Flown:
    """Fly the insertion from the approach on. first: what is done with the simulation before the ground sends its plan.
    changes: fields of models of the world, by the plan."""
    f, w, planned = sim.flight, sim.process("world"), plan()
    w.craft.orbit = Orbit.from_state(world.MARS, planned.r_0, planned.v_0)
    for name, values in changes.items():
        for field, value in values(planned).items():
            setattr(getattr(w, name), field, value)
    log = sim.record(w.craft.state, w.engines.output, w.rcs.output, w.slosh.fuel, f.burn.state, f.tracking.error,
                     every=1 * s)
    packets = telemetry(f.commands)
    if first is not None:
        first(sim)
    ground.perform(sim, "uplink.py")
    sim.run((planned.start + LASTS - sim.time) * s)
    f.commands.take_packets()
    decoded_packets = (decoded(f.commands.dictionary, packet) for packet in packets)
    return Flown(sim, log, planned, Orbit.from_state(
        world.MARS, log["craft.state.r_BN_N"][-1], log["craft.state.v_BN_N"][-1]),
        [name for _, name in modes(log)["flight"]], [p.content for p in decoded_packets if p.path == "events"])


def check_captured(flown: Flown, hours: float = 2, miss: float = 0.1) -> None:
    """It is in the planned orbit, by the truth, up to so much of its period, and points at Mars as well as by the
    planned orbit [rad]; so says telemetry."""
    f, planned, log = flown.sim.flight, flown.planned, flown.log
    burnt = f.burned.kept
    assert burnt.phase.name == "COMPLETE", f"the burn is {burnt.phase.name}, {burnt.abort.name}"
    assert abs(burnt.gained / norm(planned.dv_N) - 1) < 1e-3, f"{burnt.gained:.6g} m/s were gained"
    assert flown.orbit.e < 1, f"e is {flown.orbit.e:.3g}"
    assert abs(flown.period - PERIOD.value) < hours * 3600, f"a period of {flown.period / 3600:.3g} h"
    lowest, wanted = (orbit.p / (1 + orbit.e) for orbit in (flown.orbit, planned.capture))
    assert abs(lowest - wanted) < 100e3, f"a periapsis of {lowest / 1e3:.4g} km, not {wanted / 1e3:.4g} km"
    assert flown.modes[-2:] == ["sun", "mars"], flown.modes
    r, BN = log["craft.state.r_BN_N"][-1], mrp_to_dcm(log["craft.state.sigma_BN"][-1])
    off = arccos(-BN[0] @ r / norm(r))
    assert off < miss, f"the instrument is {off:.2g} rad off Mars"


def check_safe(flown: Flown, why: str) -> None:
    """It is not captured, points at the Sun, and telemetry says why."""
    last = flown.events_of("burned.event")[-1]
    assert last.name == "ABORTED" and BURN_ABORT[int(last.arguments["why"])] == why, flown.events
    assert flown.modes[-1] == "safe" and flown.sim.flight.stored.state.inhibited == 1
    w, log = flown.sim.process("world"), flown.log
    sun = array(w.sun.state.r_PN_N) - log["craft.state.r_BN_N"][-1]
    off = arccos(-mrp_to_dcm(log["craft.state.sigma_BN"][-1])[0] @ sun / norm(sun))
    assert off < 0.02, f"-b1 is {off:.2g} rad off the Sun"
