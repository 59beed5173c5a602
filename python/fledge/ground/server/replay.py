# SPDX-License-Identifier: Apache-2.0
"""Plays a session of a spacecraft from its archive, as a further spacecraft with a monitor of its own."""
from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fledge.ground.server.spacecraft import TURN, Spacecraft
from fledge.errors import SetupError

if TYPE_CHECKING:
    from fledge.ground.server.room import Room

STEP = 0.05         # [s] of real time between batches


class Replay(Spacecraft):
    """source: of which spacecraft; begin, end [ns] of its clock; speed: times real time, 0: as fast as possible."""

    source: Spacecraft

    def __init__(self, room: Room, source: Spacecraft, session: int, begin: int, end: int, speed: float) -> None:
        if not 0 <= speed <= 1e6:
            raise SetupError(f"a replay's speed is from 0 (as fast as possible) to 1e6; found {speed:g}")
        self.source, self.replayed = source, source.name
        name = next(name for n in range(1, 1000) if (name := f"{source.name}@replay{'' if n == 1 else n}")
                    not in room.crafts)
        self._speed = speed
        self._batches = source.history.replay(begin, end, session, span_ns=max(int(STEP * speed * 1e9), 10**7))
        self._batch: list[Any] = next(self._batches, [])
        if not self._batch:
            raise SetupError(f"the archive of {source.name} has no packets there")
        super().__init__(room, replace(source.settings, name=name), room.next_index)
        self._first, self._begun = self._batch[0][0], time.monotonic()
        self.state = "replaying"
        self.epoch_ns = source.epoch_ns

    @property
    def clock(self) -> str:
        return self.source.clock

    def _prepare(self) -> None:
        self.database = self.source.database
        self.monitor = self.database.monitor(self.settings.root)
        self.simulation = self.source.simulation

    def _open(self) -> None:
        """It has no link."""

    def _turn(self) -> None:
        self._answer()
        if not self._batch:
            self._over.wait(TURN / 1e9)
            return
        ahead = (self._batch[0][0] - self._first) / 1e9 / self._speed - (time.monotonic() - self._begun) \
            if self._speed else 0.0
        if ahead > 0:
            self._over.wait(min(ahead, TURN / 1e9))
            return
        batch, self._batch = self._batch, []
        self.take(batch)
        self.feed.sample()
        self._batch = next(self._batches, [])
        if not self._batch:
            self.state = "ended"
            self.room.publish("craft", self.name, self.told())

    def take(self, rows: list[tuple[int, int, bytes]]) -> None:
        """Apply the limits that were in force when the server received the packets."""
        for _, part in self.limits.in_force.parts(rows):
            super().take(part)

    def noted(self, notes: Any) -> None:
        """Keep no notes: the lists of the spacecraft itself have them."""
        super().noted([one for one in notes if one[0] == "slots"])
