# SPDX-License-Identifier: Apache-2.0
"""The journal and the browsers of a room, as one of its spacecraft uses them."""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fledge.ground.server.bounds import Bounds
    from fledge.ground.server.clock import Clock
    from fledge.ground.server.journal import Row
    from fledge.ground.server.room import Room


class Reporter:
    """name: of the spacecraft; clock: its time, at which an event happens unless another is given."""

    def __init__(self, room: Room, name: str, clock: Clock) -> None:
        self.name, self._room, self.clock = name, room, clock
        self.bounds: Bounds = room.bounds

    @property
    def problem(self) -> str:
        """Why the journal cannot be written; empty: it can."""
        return self._room.journal.problem

    def event(self, severity: str, source: str, text: str, t: int | None = None) -> None:
        """Keep an event, and publish it. severity: of alarms.SEVERITIES."""
        self._room.report(self.name, severity, source, text, self.clock.now if t is None else t)

    def publish(self, kind: str, content: Mapping[str, Any]) -> None:
        """Send an object to all browsers."""
        self._room.publish(kind, self.name, content)

    def keep(self, kind: str, *rows: Mapping[str, Any], shown: Callable[[Row], Row] = dict, must: bool = False) -> None:
        """Write rows into the journal, and publish them, as `shown` has them. What the journal does not take is
        written as soon as it can be; must: it raises JournalError instead."""
        self._room.keep(kind, self.name, *rows, shown=shown, must=must)

    def save(self, kind: str, row: Mapping[str, Any]) -> None:
        """Write a row into the journal, and do not publish it. Raises JournalError."""
        self._room.journal.save(kind, self.name, row)

    def log(self, user: str, action: str, text: str, also: Sequence[tuple[str, Row]] = ()) -> None:
        """Keep a user's action, and also (kind, row) of it, all or none. Raises JournalError."""
        self._room.log(user, action, text, self.name, also=also)

    def flush(self) -> None:
        """Write what the journal has not taken before."""
        self._room.flush(self.name)

    def newest(self, kind: str) -> list[Row]:
        """The newest rows of the journal, the newest first."""
        return self._room.journal.rows(kind, self.name)

    def all(self, kind: str, is_open: bool = False) -> list[Row]:
        """All rows of the journal, the oldest first. is_open: those that have not ended."""
        return self._room.journal.all(kind, self.name, is_open)
