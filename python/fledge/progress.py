# SPDX-License-Identifier: Apache-2.0
"""A progress bar for what takes long, on stderr."""

import sys
import time

_LONG = 2.0      # [s] of wall time: shorter runs show nothing
_LOOK = 0.3      # [s] before the length of a run is estimated
_WIDTH = 28


class Bar:
    """One line on stderr, drawn over and over; cleared at the end."""

    def __init__(self, title):
        self._title = title
        self._begun = time.monotonic()
        self._drawn = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self._drawn:
            sys.stderr.write("\r" + " " * self._drawn + "\r")
            sys.stderr.flush()

    def _draw(self, done, text):
        filled = int(done * _WIDTH)
        line = f"{self._title} [{'#' * filled}{'.' * (_WIDTH - filled)}] {done:4.0%}  {text}"
        sys.stderr.write("\r" + line.ljust(self._drawn))
        sys.stderr.flush()
        self._drawn = max(self._drawn, len(line))


class Progress(Bar):
    """Draws while a run goes on. Times are nanoseconds of the simulation."""

    def __init__(self, title, start, end, wanted=None):
        super().__init__(title)
        self.wanted = sys.stderr.isatty() if wanted is None else wanted
        self._forced = bool(wanted)
        self._start, self._end = start, end

    def at(self, now):
        """Called about every 50 ms with the simulated time."""
        spent = time.monotonic() - self._begun
        done = (now - self._start) / max(self._end - self._start, 1)
        if done <= 0 or spent < _LOOK or not (self._drawn or self._forced or spent / done > _LONG):
            return
        speed = (now - self._start) / 1e9 / spent
        self._draw(done, f"{clock(now / 1e9)} of {clock(self._end / 1e9)}, {speed:.4g}x, "
                         f"{clock(spent / done - spent)} left")


def clock(seconds):
    """2:40:00, 1:05, 3 s"""
    whole = int(seconds + 0.5)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
