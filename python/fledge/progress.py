# SPDX-License-Identifier: Apache-2.0
"""How far long work is, with an estimate of what is left: a bar on a terminal and in a notebook, elsewhere some lines.

Both are on stderr. Work that ends within 2 s shows no bar, and such of less than 10 s no line.
"""
from __future__ import annotations

import sys
import time

TYPE_CHECKING = False   # of `typing`
if TYPE_CHECKING:
    from typing import Self

_LONG = 2.0      # [s] of wall time: shorter work shows no bar
_LOOK = 0.3      # [s] until the duration of a run is estimated
FIRST = 10.0     # [s] without a terminal: no line for shorter work; one is due then, and at twice the time of the last
_MOST = 300.0    # [s] between two lines
_WIDTH = 28


def bar(done: float) -> str:
    """[#######.....]  58%"""
    filled = int(done * _WIDTH)
    return f"[{'#' * filled}{'.' * (_WIDTH - filled)}] {done:4.0%}"


class Bar:
    """One line on stderr, or in the output of a notebook, drawn again and again and cleared at the end. Where stderr is
    a file: a line as soon as the work is known to take more than 10 s, and after 10 s, 20 s, 40 s and so on.

    expected: [s] that the work will take, by what is known before it; 0: nothing is
    wanted: True: show the bar at once, and into a file too; False: show nothing
    """

    def __init__(self, title: str, expected: float = 0.0, wanted: bool | None = None):
        self.expected = expected
        self._title = title
        self._begun = time.monotonic()
        self._before: float | None = None   # what was done as this began
        self._drawn = 0
        self._next = _LONG      # [s] since it began, of the next line of a file
        self._estimated = True  # whether its last line had an estimate
        self._wanted = wanted
        from fledge.display import Live     # `typing`, which it imports, would delay every command

        self._live = Live()

    @property
    def spent(self) -> float:
        """[s] since this began."""
        return time.monotonic() - self._begun

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._drawn and self._live.there:
            self._live.show("")
        elif self._drawn:
            self._write("\r" + " " * self._drawn + "\r")

    def at(self, done: float, text: str) -> None:
        """done: from 0 to 1, with what an earlier program did; text: the same in words. Call it about every second,
        also while `done` stays the same."""
        if self._wanted is False:
            return
        self._before = done if self._before is None else self._before
        spent, new = self.spent, done - self._before
        left = (1 - done) * spent / new if new > 0 else max(self.expected - spent, 0.0)
        estimated = new > 0 or left > 0
        if left >= 0.5:
            text += f", {clock(left)} left"
        if self._live.there:
            self._live.show(f"{self._title}  {done:.0%}  {text}", done)
            self._drawn = 1
        elif not self._wanted and not sys.stderr.isatty():
            due = spent >= self._next or estimated and not self._estimated
            if due and spent + left >= FIRST and done < 1:
                self._next, self._estimated = FIRST, estimated
                while self._next <= spent:
                    self._next += min(self._next, _MOST)
                self._write(f"{self._title} {done:4.0%}  {text}\n")
        elif self._drawn or self._wanted or spent > _LONG or spent > _LOOK and spent + left > _LONG:
            line = f"{self._title} {bar(done)}  {text}"
            self._write("\r" + line.ljust(self._drawn))
            self._drawn = max(self._drawn, len(line))

    @staticmethod
    def _write(text: str) -> None:
        sys.stderr.write(text)
        sys.stderr.flush()


class Progress(Bar):
    """The bar of a run. Times are nanoseconds of the simulation."""

    def __init__(self, title: str, start: int, end: int, wanted: bool | None = None):
        super().__init__(title, wanted=wanted)
        self._start, self._end = start, end

    def reaches(self, now: int) -> None:
        """The run calls this about every 50 ms with the simulated time."""
        speed = (now - self._start) / 1e9 / max(self.spent, 1e-9)
        self.at((now - self._start) / max(self._end - self._start, 1),
                f"{clock(now / 1e9)} of {clock(self._end / 1e9)}, {speed:.4g}x")


def clock(seconds: float) -> str:
    """2:40:00, 1:05, 3 s"""
    whole = int(seconds + 0.5)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
