# SPDX-License-Identifier: Apache-2.0
"""A progress bar on stderr for long work."""
from __future__ import annotations

import sys
import time

TYPE_CHECKING = False   # of `typing`
if TYPE_CHECKING:
    from typing import Self

_LONG = 2.0      # [s] of wall time: shorter runs show no bar
_LOOK = 0.3      # [s] until the duration of a run is estimated
_WIDTH = 28


def bar(done: float) -> str:
    """[#######.....]  58%"""
    filled = int(done * _WIDTH)
    return f"[{'#' * filled}{'.' * (_WIDTH - filled)}] {done:4.0%}"


class Bar:
    """One line on stderr, or in the output of a notebook, drawn again and again; cleared at the end."""

    def __init__(self, title: str):
        self._title = title
        self._begun = time.monotonic()
        self._drawn = 0
        from fledge.display import Live     # `typing`, which it imports, would delay every command

        self._live = Live()
        self.notebook = self._live.there

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_):
        if self._drawn and self._live.there:
            self._live.show("")
        elif self._drawn:
            self._write(" " * self._drawn + "\r")

    def draw(self, done: float, text: str) -> None:
        line = f"{self._title} {bar(done)}  {text}"
        if self._live.there:
            self._live.show(f"{self._title}  {done:.0%}  {text}", done)
            self._drawn = 1
            return
        self._write(line.ljust(self._drawn))
        self._drawn = max(self._drawn, len(line))

    @staticmethod
    def _write(text: str) -> None:
        sys.stderr.write("\r" + text)
        sys.stderr.flush()


class Progress(Bar):
    """The bar of a run. Times are nanoseconds of the simulation."""

    def __init__(self, title: str, start: int, end: int, wanted: bool | None = None):
        super().__init__(title)
        self.wanted = self.notebook or sys.stderr.isatty() if wanted is None else wanted
        self._forced = bool(wanted)
        self._start, self._end = start, end

    def at(self, now: int) -> None:
        """The run calls this about every 50 ms with the simulated time."""
        spent = time.monotonic() - self._begun
        done = (now - self._start) / max(self._end - self._start, 1)
        if done <= 0 or spent < _LOOK or not (self._drawn or self._forced or spent / done > _LONG):
            return
        speed = (now - self._start) / 1e9 / spent
        self.draw(done, f"{clock(now / 1e9)} of {clock(self._end / 1e9)}, {speed:.4g}x, "
                        f"{clock(spent / done - spent)} left")


def clock(seconds: float) -> str:
    """2:40:00, 1:05, 3 s"""
    whole = int(seconds + 0.5)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
