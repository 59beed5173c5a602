# SPDX-License-Identifier: Apache-2.0
"""The operators' log, as requests write it, and how many rows of it a client may cause."""
from __future__ import annotations

import asyncio
from collections import Counter, defaultdict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from ipaddress import ip_address, ip_network
from time import monotonic
from typing import Any

from aiohttp import web

from fledge.ground.server.bounds import Bounds, Recent

Log = Callable[[str, str, dict[str, Any]], None]        # user, action, details


class RequestLog:
    """write: waits for the disk, so that a thread of its own calls it. clock: [s] of the rows of a user."""

    def __init__(self, write: Log, bounds: Bounds, clock: Callable[[], float] = monotonic) -> None:
        self.bounds, self._write, self._clock = bounds, write, clock
        self.thread = ThreadPoolExecutor(1)
        self._strangers: Counter[tuple[str, str]] = Counter()       # their refusals
        self._rows: dict[tuple[str, str], Recent] = defaultdict(Recent)     # those that a user caused in the journal

    def later(self, user: str, action: str, details: dict[str, Any]) -> None:
        """Write a row soon."""
        self.thread.submit(self._write, user, action, details)

    async def write(self, user: str, action: str, details: dict[str, Any]) -> None:
        """Write a row, and wait until it is written. Raises what the writer does."""
        await asyncio.get_running_loop().run_in_executor(self.thread, self._write, user, action, details)

    async def refused(self, request: web.Request, status: int, why: str) -> None:
        """Write that a request was refused."""
        await asyncio.get_running_loop().run_in_executor(self.thread, self._refused, request, status, why)

    def allows(self, user: str, bound: str) -> bool:
        """Whether a user may cause one more row in the journal now."""
        now, rows = self._clock(), self._rows[user, bound]
        if self.bounds.over(bound, rows.within(now) + 1):
            return False
        rows.count(1, now)
        return True

    def times(self, address: str, what: str) -> int:
        """Count a refusal; how many there were, if it is the 1st, the 10th, the 100th, ..., else 0."""
        if len(self._strangers) > 10_000:
            self._strangers.clear()
        self._strangers[address, what] += 1
        times = self._strangers[address, what]
        return times if str(times).strip("0") == "1" else 0

    def _refused(self, request: web.Request, status: int, why: str) -> None:
        """Log a refusal; those without a login, and those of a user beyond the limit, at the 1st, the 10th, the 100th,
        ... time, because a client can cause any number of them."""
        user, address = request["user"], network_of(request.remote)
        details: dict[str, Any] = {"request": f"{request.method} {request.path}"[:200], "status": status,
                                   "why": why[:200], "from": address}
        if user is None or not self.allows(user.name, "refusals of a user"):
            details["times"] = self.times(user.name if user else address, f"{status}")
            if not details["times"]:
                return
        self._write(user.name if user else "", "refused", details)

    def close(self) -> None:
        """Write all that waits, and end."""
        self.thread.shutdown()


@lru_cache(10_000)
def network_of(remote: str | None) -> str:
    """Where a request comes from: an address of IPv4, or a network of IPv6, of which one host has 2^64 addresses."""
    try:
        address = ip_address(remote or "")
    except ValueError:
        return str(remote)
    return str(address) if address.version == 4 or address.is_loopback else str(ip_network((address, 64), strict=False))
