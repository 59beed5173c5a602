# SPDX-License-Identifier: Apache-2.0
"""The time of a spacecraft: UTC, or simulated time since the start of its run; and when telemetry was missing."""
from __future__ import annotations

import time
from collections import deque
from datetime import datetime, timezone

from fledge.commands import Timed
from fledge.errors import listed

BACK = 10**9            # [ns] by which the clock may step back within a session
GAPS = 500              # the newest ones are kept

Packets = list[tuple[int, int, bytes]]      # (t, received [ns UTC], packet) of each


class Clock:
    """For the spacecraft's own thread; others may read `now`. live: UTC goes on while no packet comes."""

    def __init__(self, simulated: bool, live: bool = True) -> None:
        self.simulated = simulated
        self.now = 0                    #: [ns] of the newest packet, or the link's time
        self.gaps: deque[tuple[int, int]] = deque(maxlen=GAPS)     #: [ns] in which telemetry of this session is missing
        self._live = live and not simulated
        self._zero: int | None = None   # [ns] UTC of the steady clock's 0

    @property
    def kind(self) -> str:
        """utc, or simulated: ns since the run's start."""
        return "simulated" if self.simulated else "utc"

    def advance(self) -> int:
        """Go on with UTC. Returns by how much [ns] the server's clock was set meanwhile; 0: it was not."""
        if not self._live:
            return 0
        begin = now = step = 0
        while not now or time.monotonic_ns() - begin > BACK // 10:      # the machine stood still between the two
            begin, now = time.monotonic_ns(), time.time_ns()
        zero = now - begin
        if self._zero is None:
            self._zero = zero
        if abs(zero - self._zero) > BACK:
            step, self._zero = zero - self._zero, zero
            self.now = max(0, self.now + step)
        self.now = max(self.now, now)
        return step

    def timed(self, arrived: list[Timed], link_t: int) -> Packets:
        """Packets with their times. link_t: [ns] now by the clock of their link."""
        received = time.time_ns()
        if self.simulated:
            return [(max(arrival.t, 0), received, arrival.packet) for arrival in arrived]
        offset = received - link_t
        packets = [(arrival.t + offset, arrival.t + offset, arrival.packet) for arrival in arrived]
        if packets and 0 < self.now - packets[0][0] <= BACK:
            packets = [(max(t, self.now), received, packet) for t, received, packet in packets]
        return packets

    def missing(self, begin: int, end: int) -> str:
        """In words, which telemetry of a stretch [ns] is missing; empty: none."""
        words = [f"from {self.text(a)} to {self.text(b)}" for a, b in self.gaps if a < end and begin < b]
        return f"telemetry is missing {listed(words)}" if words else ""

    def text(self, t: int) -> str:
        """A time [ns] in words."""
        return f"{t / 1e9:g} s" if self.simulated else \
            datetime.fromtimestamp(t / 1e9, timezone.utc).strftime("%Y-%m-%d %H:%M:%S UTC")
