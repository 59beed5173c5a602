# SPDX-License-Identifier: Apache-2.0
"""Stored lists: the spacecraft's own thread notes what becomes of them, and pages only read it."""
from types import SimpleNamespace

from fledge.ground.server.clock import Clock
from fledge.ground.server.stored import StoredLists

S = 10**9
RUNNING = 1 << 3


def lists_of(flight):
    """The lists of a spacecraft whose telemetry is a dict; the starts that the journal gets."""
    names = ["running", "held", "inhibited", "next", "head.t"]
    telemetry = SimpleNamespace(
        slot_numbers={f"flight.stored.state.{name}": slot for slot, name in enumerate(names)},
        monitor=SimpleNamespace(newest=lambda slot: (flight["head.t"], 0, 0.0, flight.get(names[slot], 0))))
    clock = Clock(simulated=True)
    clock.now = 100 * S
    kept = []
    reporter = SimpleNamespace(clock=clock, keep=lambda kind, row, shown: kept.append(row["begun"]))
    return StoredLists("flight.stored", None, None, telemetry, reporter), kept


def test_a_sequence_that_others_start_again_has_no_start_from_here():
    """Also if no page asked in between."""
    flight = {"running": RUNNING, "head.t": 50 * S}
    stored, kept = lists_of(flight)
    stored._begun[3] = 40 * S
    stored.poll()
    assert stored.describe()["lists"][3]["t_ns"] == str(60 * S)
    flight |= {"running": 0, "head.t": 60 * S}
    stored.poll()
    flight |= {"running": RUNNING, "head.t": 70 * S}
    stored.poll()
    shown = stored.describe()["lists"][3]
    assert (shown["state"], shown["t_ns"], kept) == ("running", None, [None])


def test_a_sequence_that_telemetry_does_not_show_yet_has_its_start():
    flight = {"running": 0, "head.t": 40 * S}
    stored, kept = lists_of(flight)
    stored._begun[3] = 40 * S
    stored.poll()
    flight |= {"running": RUNNING, "head.t": 41 * S}
    stored.poll()
    assert stored.describe()["lists"][3]["t_ns"] == str(60 * S) and not kept


def test_a_page_that_asks_changes_nothing():
    flight = {"running": 0, "head.t": 60 * S}
    stored, kept = lists_of(flight)
    stored._begun[3] = 40 * S
    stored.describe()
    assert stored._begun == {3: 40 * S} and not kept
