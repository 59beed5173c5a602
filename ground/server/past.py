# SPDX-License-Identifier: Apache-2.0
"""The past of one spacecraft: packets, sessions and series of values, from its archive. For all threads."""
from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fledge.ground.server.limits import SetLimits
    from fledge.ground.server.telemetry import Telemetry

AT_ONCE = 100_000       # packets of the same time that are searched for an id
LISTED = 1 << 22        # [bytes] of packets in a list, which ends then


class Series(NamedTuple):
    """The values of a parameter, or those of each of some buckets."""

    t: NDArray[np.int64]        #: [ns]
    value: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    concern: NDArray[np.uint8]
    worst: NDArray[np.uint8]
    exact: tuple[str, list[Any]] | None     #: (kind, values), if they were requested


class Past:
    """limits: by which values are judged. `sessions` and `series` need an archive, the others have the packets that
    came last without one."""

    def __init__(self, telemetry: Telemetry, limits: SetLimits) -> None:
        self._telemetry, self._limits = telemetry, limits

    def packet_list(self, before: int, limit: int, container: str | None, undecoded: bool) -> list[dict[str, Any]]:
        """Packets up to the time `before`, the newest first."""
        telemetry, rows = self._telemetry, list[tuple[int, int, str | None, bytes, str]]()
        inspect = telemetry.monitor.inspect
        if telemetry.history is not None:
            with telemetry.reading:
                archived = telemetry.history.packets(
                    0, before, "undecoded" if undecoded else container or None, limit, True, most_bytes=LISTED)
            rows += ((t, received, name, packet, inspect(packet)["reason"] if name is None else "")
                     for t, received, name, packet in archived)
        elif undecoded:
            rows += [(t, received, None, packet, reason) for t, received, packet, reason in reversed(telemetry.bad)
                     if t <= before][:limit]
        else:
            for t, received, packet in reversed(telemetry.recent):
                seen = inspect(packet)
                if t <= before and container in (None, "", seen["container"]) and len(rows) < limit:
                    rows.append((t, received, seen["container"], packet, seen["reason"]))
        return [{"id": number_of(t, packet), "t_ns": str(t), "received_ns": str(received), "container": name,
                 "size": len(packet), "reason": reason, "hex": packet.hex()}
                for t, received, name, packet, reason in rows]

    def packet_of(self, number: str) -> dict[str, Any] | None:
        """The packet of a list's `id` in words."""
        telemetry, text = self._telemetry, number.partition("-")[0]
        if telemetry.history is not None and text.isdigit() and int(text) < 2**63:
            rows: Iterable[tuple[int, int, bytes]] = self._at(int(text))
        else:
            rows = [*telemetry.recent, *((t, received, packet) for t, received, packet, _ in telemetry.bad)]
        return next((telemetry.inspect(packet) | {"id": number, "t_ns": str(t), "received_ns": str(received)}
                     for t, received, packet in rows if number_of(t, packet) == number), None)

    def _at(self, t: int) -> Iterator[tuple[int, int, bytes]]:
        """The packets of a time, also of earlier sessions: a new simulation, or a clock that was set back, has the same
        times again."""
        history, reading = self._telemetry.history, self._telemetry.reading
        assert history is not None
        with reading:
            numbers = [session["session"] for session in history.sessions() if session["first"] <= t <= session["last"]]
        for number in (-1, *reversed(numbers)):
            with reading:
                rows = history.packets(t, t, None, AT_ONCE, False, number)
            yield from ((t, received, packet) for t, received, _, packet in rows)

    def sessions(self) -> list[dict[str, Any]]:
        """What the archive has."""
        assert self._telemetry.history is not None
        with self._telemetry.reading:
            return [{"session": session["session"], "first_ns": str(session["first"]), "last_ns": str(session["last"]),
                     "packets": session["packets"], "ended": session["ended"],
                     "gaps": [[str(begin), str(end), why] for begin, end, why in session["gaps"]]}
                    for session in self._telemetry.history.sessions()]

    def series(self, names: list[str], begin: int, end: int, points: int, session: int,
               exact: bool = False) -> dict[str, Series]:
        """What the archive has of parameters by their names; the concerns are by the limits that were in force. Raises
        SetupError."""
        derived = self._telemetry.derived
        plain = [name for name in names if name not in derived]
        with self._telemetry.reading:
            history = self._telemetry.history
            assert history is not None
            limits = {name: self._limits.of(name) for name in plain}
            series = history.series(plain, begin, end, points, session, limits, exact) if plain else {}
            return {name: Series(*series[name]) if name in series else derived.series(
                name, history, begin, end, session, points) for name in names}


def number_of(t: int, packet: bytes) -> str:
    """The id of a packet in lists."""
    return f"{t}-{zlib.crc32(packet):08x}"
