# SPDX-License-Identifier: Apache-2.0
"""Plays a session of a spacecraft from its archive, as a further spacecraft with a monitor of its own."""
from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from fledge.errors import SetupError
from fledge.ground.server.clock import Packets
from fledge.ground.server.link import TURN
from fledge.ground.server.spacecraft import Spacecraft
from fledge.ground.server.telemetry import Note

if TYPE_CHECKING:
    from fledge.ground.server.room import Room

STEP = 0.05         # [s] of real time between batches


class Replay(Spacecraft):
    """source: of which spacecraft; begin, end [ns] of its clock; speed: times real time, 0: as fast as possible."""

    def __init__(self, room: Room, source: Spacecraft, session: int, begin: int, end: int, speed: float) -> None:
        if not 0 <= speed <= 1e6:
            raise SetupError(f"a replay's speed is from 0 (as fast as possible) to 1e6; found {speed:g}")
        name = next(name for n in range(1, 1000) if (name := f"{source.name}@replay{'' if n == 1 else n}")
                    not in room.crafts)
        self._speed = speed
        assert source.telemetry.history is not None
        self._batches = source.telemetry.history.replay(begin, end, session,
                                                        span_ns=max(int(STEP * speed * 1e9), 10**7))
        self._batch: Packets = next(self._batches, [])
        if not self._batch:
            raise SetupError(f"the archive of {source.name} has no packets there")
        super().__init__(room, replace(source.settings, name=name), room.next_index, source)
        self._first, self._begun = self._batch[0][0], time.monotonic()
        self.connection.state = "replaying"

    def _open(self) -> None:
        """A replay opens no link."""

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
            self.connection.state = "ended"
            self.publish()

    def take(self, packets: Packets) -> None:
        """Apply the limits that were in force when the server received the packets."""
        for _, part in self.limits.in_force.parts(packets):
            super().take(part)

    def handle(self, notes: Iterable[Note]) -> None:
        """Keep no notes: the lists of the spacecraft itself have them."""
        super().handle([note for note in notes if note[0] == "slots"])
