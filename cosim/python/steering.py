# SPDX-License-Identifier: Apache-2.0
"""The hand of a program of a co-simulation on the run: pause, go on, one step, another pace, back in time. `fledge up`
gives it to an asynchronous program with `steers = true` in the file."""
from __future__ import annotations

import json
import os
import socket
from typing import Any

STATE = ("phase", "t", "pace", "paused", "wall")


class Steering:
    """The socket that `fledge up` made. state: the newest of the run: its phase, `t` [s], `pace` (0: as fast as
    possible), whether it is `paused`, `wall` [s] since its begin, whether it `rewinds`, its `past` [s]: until then it
    repeats an earlier run, and why it `refused` the last rewind; {} until the first."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end
        self._state: dict[str, Any] = {}

    @classmethod
    def of_run(cls) -> Steering | None:
        """That of this program; None: the run cannot be steered from here."""
        given = os.environ.get("FLEDGE_STEERING")
        return cls(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET, fileno=int(given))) if given else None

    @property
    def state(self) -> dict[str, Any]:
        try:
            while data := self._end.recv(4096):
                self._state = json.loads(data)
        except OSError:
            pass
        return self._state

    def pause(self) -> None:
        """Pause, after some tenths of a second at the latest."""
        self._say("pause")

    def go(self) -> None:
        self._say("go")

    def until(self, t: float) -> None:
        """Go on, and pause before the first instant after t [s]."""
        self._say(f"until {t!r}")

    def pace(self, speed: float) -> None:
        """speed: simulated seconds per second; 0: as fast as possible."""
        self._say(f"pace {speed!r}")

    def rewind(self, t: float) -> None:
        """End this run, and let another one go on from its instant t [s], as `fledge rewind` does. All programs are
        started again, this one too. The run has to be one that `rewinds`: it keeps a record of its messages."""
        self._say(f"rewind {t!r}")

    def _say(self, line: str) -> None:
        self._end.send(line.encode())
