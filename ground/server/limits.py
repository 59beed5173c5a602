# SPDX-License-Identifier: Apache-2.0
"""Limits that administrators have set instead of the database's. They are in the journal, and a value is judged by
those that were in force when its packet was received: live, in a replay, in history and in PostgreSQL."""
from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from fledge.ground.server.clock import Packets
from fledge.ground.server.journal import JournalError
from fledge.errors import SetupError, listed

if TYPE_CHECKING:
    from fledge.ground.database import Monitor
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.telemetry import Note, Telemetry

Levels = dict[str, list[float | None]]      # of each level: from, to; None: open
Change = dict[str, Any]     # name, kind, unit, limits (None: the database's again), persistence, time_ns, ...
EVER = 2**63 - 1


class InForce:
    """The limits of a monitor at a time. changes: in their order; more may be appended."""

    def __init__(self, changes: list[Change], monitor: Monitor) -> None:
        self.changes, self.monitor = changes, monitor
        self.newest: dict[str, Change] = {}     #: of each parameter
        self._next = 0
        self._known: dict[str, dict[str, Any]] | None = None    # what the monitor has

    @property
    def until(self) -> int:
        """When [ns, UTC] the next change is."""
        return int(self.changes[self._next]["time_ns"]) if self._next < len(self.changes) else EVER

    def at(self, received: int) -> list[Note]:
        """Apply the changes up to a time [ns, UTC]; returns the monitor's notes."""
        notes: list[Note] = []
        while self._next < len(self.changes) and self.until <= received:
            change = self.changes[self._next]
            self._next += 1
            self.newest[change["name"]] = change
            notes += self.apply(change["name"])
        return notes

    def apply(self, name: str) -> list[Note]:
        """Apply the newest change of a parameter to the monitor, if it fits the parameter there."""
        change, about = self.newest.get(name), self.about(name)
        if about is None:
            return []
        levels = change["limits"] if change and fits(change, about) else None
        return list(self.monitor.set_limits(about["slot"], levels, change["persistence"] if change else 1))

    def learn(self, first: int) -> list[Note]:
        """Apply the limits to new slots of the monitor; returns its notes."""
        if self._known is None:
            return []
        more = {slot["name"]: slot for slot in self.monitor.slots(first)}
        self._known |= more
        return [note for name in self.newest if name in more for note in self.apply(name)]

    def about(self, name: str) -> dict[str, Any] | None:
        """What the monitor knew of a parameter before its limits were changed; None: it has no such one."""
        if self._known is None:
            self._known = {slot["name"]: slot for slot in self.monitor.slots(0)}
        return self._known.get(name)

    def parts(self, rows: Packets) -> Iterator[tuple[list[Note], Packets]]:
        """Packets in pieces of the same limits, each after the notes of the changes before it."""
        begin = 0
        while begin < len(rows):
            notes, until = self.at(rows[begin][1]), self.until
            end = next((i for i in range(begin, len(rows)) if rows[i][1] >= until), len(rows))
            yield notes, rows[begin:end]
            begin = end


class SetLimits:
    """The limits of a spacecraft that users set.

    changes: all so far; those of a replay are its spacecraft's, and none is kept
    handle: gets what the monitor notes when limits change
    """

    def __init__(self, changes: list[Change], telemetry: Telemetry, reporter: Reporter, replayed: bool,
                 handle: Callable[[list[Note]], None]) -> None:
        self.changes, self._telemetry, self._clock, self._reporter = changes, telemetry, reporter.clock, reporter
        self._replayed, self._handle = replayed, handle
        self.in_force = InForce(changes, telemetry.monitor)

    def begin(self) -> None:
        """Apply the limits to the spacecraft's monitor, and report those that do not fit."""
        self.in_force = InForce(self.changes, self._telemetry.monitor)
        if self._replayed:          # its packets are judged by the limits of their own times
            return
        self.in_force.at(EVER)
        absent = []
        for name, change in self.in_force.newest.items():
            about = self.in_force.about(name)
            if change["limits"] is None:
                continue
            if about is None:
                absent.append(name)
            elif not fits(change, about):
                self._event("warning", f"the limits that {change['user']} set for {name} do not count: it was "
                            f"{change['kind']} [{change['unit']}], and is {about['kind']} [{about['unit']}] now; set "
                            "them anew")
            elif about["limits"] != change["database"]:
                self._event("info", f"the database has other limits of {name} than before "
                            f"({in_words(about['limits'])}); those that {change['user']} set still count: "
                            f"{in_words(change['limits'], change['persistence'])}")
        if absent:
            self._event("warning", f"the limits that were set for {listed(absent)} wait: the database has no such "
                        "parameter now")

    def change(self, user: str, slot: int, levels: Levels | None, persistence: int) -> None:
        """Set other limits of a parameter; {}: none, None: those of the database again. They are in the journal when
        this returns, but those of a replay, which end with it. Raises SetupError."""
        monitor = self._telemetry.monitor
        before, = monitor.slots(slot, 1)
        notes = monitor.set_limits(slot, levels, persistence)
        now, = monitor.slots(slot, 1)
        change = {
            "name": before["name"], "kind": before["kind"], "unit": before["unit"],
            "limits": None if levels is None else now["limits"], "persistence": persistence, "user": user,
            "old": {"limits": before["limits"], "persistence": before["persistence"]},
            "database": before["limits"] if before["replaced"] is None else before["replaced"],
            "time_ns": str(max([time.time_ns(), *(int(earlier["time_ns"]) for earlier in self.changes[-1:])])),
            "t_ns": str(self._clock.now)}
        try:
            self._reporter.log(user, "limits", f"{change['name']}: "
                               f"{in_words(before['limits'], before['persistence'])} -> "
                               f"{in_words(now['limits'], now['persistence'])}"
                               f"{', as in the database' if levels is None else ''}",
                               [] if self._replayed else [("limits", change)])
            if not self._replayed:
                self.changes.append(change)
                self.in_force.at(EVER)
        except JournalError:
            notes += self.in_force.apply(change["name"])
            raise
        finally:
            self._handle(notes)

    def of(self, name: str) -> list[tuple[int, Levels | None, int]]:
        """When [ns, UTC] which limits of a parameter began to count (None: the database's), and their persistence."""
        if not self.changes:
            return []
        with suppress(SetupError):
            name = name if name in self._telemetry.slot_numbers else \
                self._telemetry.slot_names[self._telemetry.monitor.slot(name)]      # of a path
        return [(int(change["time_ns"]), change["limits"] if fits(change, self.in_force.about(name)) else None,
                 change["persistence"]) for change in self.changes if change["name"] == name]

    def _event(self, severity: str, text: str) -> None:
        self._reporter.event(severity, "limits", text)


def fits(change: Change, about: dict[str, Any] | None) -> bool:
    """Whether a parameter still is what its limits were set for."""
    return about is not None and (change["kind"], change["unit"]) == (about["kind"], about["unit"])


def in_words(levels: Levels, persistence: int = 1) -> str:
    """warning -1 to 1, critical open to 2"""
    parts = [f"{level} {' to '.join('open' if end is None else repr(end).removesuffix('.0') for end in ends)}"
             for level, ends in levels.items()]
    return ", ".join(parts + [f"{persistence} in a row"] * (persistence > 1 and bool(parts))) or "none"
