# SPDX-License-Identifier: Apache-2.0
"""The limits of the server: each has a name, a figure and the sentence of its refusal, in one table, which the page
"This server" shows with what is in use; and how long the event loop was blocked.

    bounds = Bounds()
    if bounds.over("connections", 2001):    # counted as a refusal
        raise Refusal(429, bounds.says("connections"))
"""
from __future__ import annotations

import asyncio
import os
import resource
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fledge.ground.scripts.links import CLIENTS, USER_TIMEOUT

MIB = 1 << 20
SENDING = 1 << 18       # [bytes] that the operating system keeps for a connection
READ = 1 << 14          # [bytes] of a read, so that it does not delay other connections
DEPTH = 32
# name, figure, unit, refusal, of which {most} is the figure
TABLE: tuple[tuple[str, float, str, str], ...] = (
    ("connections", 2000, "", "the server has {most} connections already"),
    ("connections of an address", 128, "", "this address has {most} connections already"),
    ("requests at once", 64, "", "on a connection, at most {most} requests wait"),
    ("first request", 10, "s", "a connection sends its first request within {most} s"),
    ("connection without a login", 60, "s", "a connection without a login ends after {most} s"),
    ("time of a body", 60, "s", "the request took longer than {most} s"),
    ("time of an answer", 600, "s", "an answer is made and read within {most} s"),
    ("unread", 30, "s", "a connection that takes no byte of what was sent for {most} s is cut off"),
    ("body", 256 << 10, "bytes", "a request to here has at most {most} bytes"),
    ("body of a file", 16 * MIB, "bytes", "a file that goes up has at most {most} bytes"),
    ("bodies at once", 64 * MIB, "bytes", "the server takes {most} bytes of requests at once; try again"),
    ("depth of JSON", DEPTH, "levels", "JSON has at most {most} levels"),
    ("changes of a user", 3000, "/min", "you have asked for {most} changes within a minute; try again"),
    ("refusals of a user", 60, "/min", "beyond {most} refusals within a minute, the log has the 1st, 10th, 100th, ..."),
    ("message", 512 << 10, "bytes", "a message of a WebSocket has at most {most} bytes"),
    ("messages", 600, "/min", "a WebSocket sends at most {most} messages within a minute"),
    ("frames", 6000, "/min", "a WebSocket sends at most {most} frames within a minute"),
    ("values of a subscription", 1 << 16, "", "a subscription has at most {most} values; or all"),
    ("texts of a socket", 4 * MIB, "bytes", "of texts, {most} bytes wait for a browser"),
    ("packets of a socket", 16 * MIB, "bytes", "of packets, {most} bytes wait for a script"),
    ("waiting in all", 128 * MIB, "bytes", "for all browsers and scripts, {most} bytes wait"),
    ("queries", 2, "", "{most} queries of the archive are worked on at once"),
    ("queries that wait", 4, "", "{most} queries of the archive wait already; try again"),
    ("names of a query", 100, "", "names has 1 to {most} parameters, with commas between"),
    ("values read by a user", 4_000_000, "", "the long answers that you are reading have {most} values; try again"),
    ("values read", 16_000_000, "", "the long answers that users are reading have {most} values; try again"),
    ("replays", 8, "", "there are {most} replays already: end one"),
    ("clients of a link", CLIENTS, "", "a link that listens has at most {most} clients"),
    ("files of a spacecraft", 4 << 30, "bytes", "the files of a spacecraft have at most {most} bytes"),
    ("disk that stays free", 512 * MIB, "bytes", "files leave {most} bytes of the disk free"),
)
TICK, SLOW = 0.01, 0.05     # [s] between the loop's measurements of itself; of a block that is reported


@dataclass
class Bound:
    """A limit. used: returns how much is in use; peak: the largest use so far."""

    name: str
    most: float
    unit: str
    refusal: str
    used: Callable[[], float] | None = None
    peak: float = 0
    refused: int = 0


class Bounds:
    """The limits of a server."""

    def __init__(self) -> None:
        self.all = {row[0]: Bound(*row) for row in TABLE}

    def __getitem__(self, name: str) -> float:
        return self.all[name].most

    def __setitem__(self, name: str, most: float) -> None:
        self.all[name].most = most

    def over(self, name: str, wanted: float) -> bool:
        """Whether a use exceeds its limit, which then counts as a refusal."""
        bound = self.all[name]
        if wanted > bound.most:
            bound.refused += 1
            return True
        bound.peak = max(bound.peak, wanted)
        return False

    def refuses(self, name: str) -> str:
        """Count a refusal; returns its sentence."""
        self.all[name].refused += 1
        return self.says(name)

    def uses(self, name: str, used: Callable[[], float]) -> None:
        """Set the function that returns how much is in use."""
        self.all[name].used = used

    def says(self, name: str) -> str:
        """The sentence of a refusal."""
        bound = self.all[name]
        return bound.refusal.format(most=f"{bound.most:,.10g}")

    def describe(self) -> list[dict[str, Any]]:
        """For the page."""
        return [{"name": b.name, "most": b.most, "unit": b.unit, "used": b.used() if b.used else None,
                 "peak": b.peak, "refused": b.refused, "refusal": self.says(b.name)} for b in self.all.values()]


class Recent:
    """Counts what happened within the last minute. Times are seconds of one monotonic clock."""

    def __init__(self) -> None:
        self._all: deque[tuple[float, int]] = deque()   # (time, how many)
        self._n = 0

    def within(self, now: float) -> int:
        """The number within the minute before `now`."""
        while self._all and self._all[0][0] <= now - 60:
            self._n -= self._all.popleft()[1]
        return self._n

    def count(self, more: int, now: float) -> int:
        """Add `more` at `now`; returns the number within the minute before."""
        if more:
            self._all.append((now, more))
            self._n += more
        return self.within(now)


def bound_socket(transport: asyncio.BaseTransport, unread: float) -> None:
    """Bound the system's buffer of a connection, which ends when its client reads nothing for `unread` [s]."""
    if end := transport.get_extra_info("socket"):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENDING)
        setattr(transport, "max_size", READ)
        if end.family in (socket.AF_INET, socket.AF_INET6):
            end.setsockopt(socket.IPPROTO_TCP, USER_TIMEOUT, int(1000 * unread))


class LoopWatch:
    """Measures the event loop: how late ticks are [s], and how long its thread computed between two of them, without
    waits for a processor or another thread. slow: called for a block, once a minute at most."""

    def __init__(self, slow: Callable[[float], Any]) -> None:
        self.longest = 0.0          #: since the start
        self._slow, self._reported = slow, -60.0
        self._blocks: deque[tuple[float, float]] = deque()      # (when, how long), each shorter than those before it
        self._busy: deque[tuple[float, float]] = deque()        # the same for the time that it computed

    async def run(self) -> None:
        """Until it is cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            due, used = loop.time() + TICK, time.thread_time()
            await asyncio.sleep(TICK)
            self.tick(loop.time(), loop.time() - due, time.thread_time() - used)

    def tick(self, now: float, late: float, computed: float = 0.0) -> None:
        """A tick."""
        self.longest = max(self.longest, late)
        for window, value in ((self._blocks, late), (self._busy, computed)):
            while window and window[-1][1] <= value:
                window.pop()
            window.append((now, value))
            while window[0][0] < now - 60:
                window.popleft()
        if late > SLOW and now - self._reported >= 60:
            self._reported = now
            self._slow(late)

    @property
    def recent(self) -> float:
        """The longest block of the last minute [s]."""
        return self._blocks[0][1] if self._blocks else 0.0

    @property
    def computed(self) -> float:
        """The longest that it computed at once in the last minute [s]."""
        return self._busy[0][1] if self._busy else 0.0


def memory() -> dict[str, int]:
    """[bytes] that this process has; its threads; how many descriptors it has, and may have."""
    words = Path("/proc/self/statm").read_text(encoding="ascii").split()
    return {"memory": int(words[1]) * resource.getpagesize(), "threads": threading.active_count(),
            "descriptors": len(os.listdir("/proc/self/fd")), "descriptors_most": resource.getrlimit(
                resource.RLIMIT_NOFILE)[0]}


def raise_descriptors() -> None:
    """Let this process have as many as it may: a connection takes one."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(ValueError, OSError):     # the system may have less
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
