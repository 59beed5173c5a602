# SPDX-License-Identifier: Apache-2.0
"""A link of frames over a link of units: the ground's end of ccsds/space_link.h."""
from __future__ import annotations

from collections import deque
from pathlib import Path
from threading import Lock

from fledge.commands import Timed
from fledge.errors import SetupError
from fledge.frames import Frames
from fledge.ground.scripts.links import Link

TIMER, LIMIT = 5.0, 20      # [s] until a frame is sent again; how often it is sent
_last: dict[tuple, int] = {}    # the next number of each association and session of this program


class Framed(Link):
    """Packets over frames. With COP-1 a command that is lost is sent again, after `timer` [s] on the link's clock at
    the latest and `limit` times at most, and answers() has what became of it. The link below carries units as they are.

    keys: the file of a secured link; role: the place of the role whose key protects the commands.
    """

    def __init__(self, link: Link, frames: Frames, keys: Path | str | None = None, role: int = 0,
                 timer: float = TIMER, limit: int = LIMIT) -> None:
        from fledge import _ground

        self.link, self.frames = link, frames
        if frames.secured and keys is None:
            raise SetupError("a secured link needs its file of keys: keys=\"link.keys\"")
        if frames.secured and not (0 <= role < len(frames.keys) - 1 and frames.keys[role]):
            raise SetupError(f"role {role} has no key; the mission gives keys to the roles "
                             + ", ".join(str(i) for i, key in enumerate(frames.keys[:-1]) if key))
        session = link.origin % 2**29
        self._association = (str(keys), role, session)
        self._end = _ground.SpaceLink(
            frames.options, round(timer * 1e9), limit,
            (str(keys), frames.secured, role + 1, frames.keys[role], len(frames.keys), frames.keys[-1],
             _last.get(self._association, 0), session)
            if frames.secured else None)
        self._lock = Lock()
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._sent: dict[int, bytes] = {}
        self._answers: list[tuple[bytes, bool]] = []
        self._tag = 0
        self._reported = 0      # bytes between frames

    @property
    def t(self) -> int:
        return self.link.t

    @property
    def origin(self) -> int:
        return self.link.origin

    @property
    def counts(self) -> dict[str, int]:
        """Frames of telemetry and those missing, CLCWs, how often COP-1 ended; and, by fault, frames refused; packets
        of others that were `encapsulated`, what in frames was `unread`: cut off, or of another version; and frames
        that came `repeated`, and count once."""
        return dict(self._end.counts)

    @property
    def cop1(self) -> dict[str, str | bool]:
        """The `state` of COP-1 and why it last `ended`, "" without; once a CLCW came, its flags no_rf, no_bit_lock,
        lockout, wait and retransmit."""
        return self._end.cop1 | ({} if self.frames.cop1 else {"state": "", "ended": ""})

    def send(self, packet: bytes) -> None:
        with self._lock:
            self._waiting.append((self._tag, packet))
            self._sent[self._tag] = packet
            self._tag += 1
            self._work()

    def answers(self) -> list[tuple[bytes, bool]]:
        with self._lock:
            answers, self._answers = self._answers, []
        return answers

    def receive(self, until: int) -> list[Timed]:
        while True:
            with self._lock:
                self._work()
                due = self._end.due
            arrived = self.link.receive(min(until, max(due, self.t + 1)))
            packets: list[Timed] = []
            with self._lock:
                for unit in arrived:
                    packets += (Timed(unit.t, packet) for packet in self._end.take(unit.packet))
                self._work()
                answered = bool(self._answers)
            self.skipped, self.dropped = self.link.skipped + self._end.counts["skipped"], self.link.dropped
            if packets or answered or self.t >= until or not arrived and self.link.wait is not None:
                return packets

    def damages(self) -> list[str]:
        skipped = self._end.counts["skipped"]
        new, self._reported = skipped - self._reported, skipped
        return self.link.damages() + ([f"{new} bytes of the stream are no frame"] if new else [])

    def close(self) -> None:
        self.link.close()

    def _work(self) -> None:
        """Send what can go, and note what became of what went."""
        self._end.time(self.t)
        while self._waiting and self._end.send(*self._waiting[0]):
            self._waiting.popleft()
        for unit in self._end.units():
            self.link.send(unit)
        for tag, good in self._end.answers():
            packet = self._sent.pop(tag)
            if self.frames.cop1:
                self._answers.append((packet, good))
        if self.frames.secured:
            _last[self._association] = self._end.number
