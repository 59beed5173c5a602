# SPDX-License-Identifier: Apache-2.0
"""The progress of a run: on a terminal a table that is drawn again and again, elsewhere lines."""
from __future__ import annotations

import os
import shutil
import sys
import time
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TextIO

from fledge.cosim.up.logs import shown
from fledge.errors import printable
from fledge.progress import bar, clock

_SHARES = 16        # columns of the bar that divides a node's time
_LATELY = 2.0       # [s] over which rates are averaged
_QUIET = 5.0        # [s] between lines where there is no terminal
_CLOCK = 600.0      # [s] from which on times are shown as 10:00
_OFTEN = 0.2        # [s] between drawings
_LOG_LINES = 8      # at most, below the table
_NAME = 24          # columns of a name, at most
_SLOWEST = "slowest"
_LEGEND = "# compute  = transport  . wait"

_BOLD, _DIM, _RED, _YELLOW = 1, 2, 31, 33   # of ANSI terminals


@dataclass
class Row:
    """A node. Times in seconds; compute, transport and wait are totals of wall time."""
    name: str
    state: str = "starting"
    t: float = -1.0             # simulated
    ticks: int = 0
    compute: float = 0.0
    transport: float = 0.0
    wait: float = 0.0
    pending: float = 0.0        # the age of the request that it has not yet answered
    bad: bool = False           # whether its state is a problem
    takes_part: bool = True     # not an asynchronous program

    def shares(self) -> tuple[float, float, float]:
        """The shares of compute, transport and wait in its time so far."""
        whole = self.compute + self.transport + self.wait or 1.0
        return self.compute / whole, self.transport / whole, self.wait / whole

    def since(self, before: Row, wall: float) -> Row:
        """The progress since `before`: time and ticks per second of wall time."""
        return replace(self, t=(self.t - max(before.t, 0.0)) / wall if self.t >= 0 else 0.0,
                       ticks=(self.ticks - before.ticks) / wall, compute=self.compute - before.compute,
                       transport=self.transport - before.transport, wait=self.wait - before.wait)


@dataclass
class Progress:
    """A run at one time."""
    simulation: str
    until: float
    phase: str = "starting"
    wall: float = 0.0           # since all nodes had joined
    t: float = -1.0
    rows: list[Row] = field(default_factory=list)
    overruns: int | None = None     # late instants; None: the run is not paced
    worst: float = 0.0              # the largest delay


def slowest(rates: list[Row]) -> str | None:
    """The node with the largest share of compute and transport: the others wait for it."""
    busy = {row.name: 1.0 - row.shares()[2] for row in rates if row.takes_part and sum(row.shares()) > 0}
    return max(busy, key=lambda name: busy[name]) if len(busy) > 1 else None


def times(x: float) -> str:
    return f"{x:,.0f}" if x >= 100 else f"{x:.3g}"


def _span(x: float) -> str:
    """2.83 s, 279 us"""
    factor, unit = (1, "s") if x >= 1 or x == 0 else (1e3, "ms") if x >= 1e-3 else (1e6, "us")
    return f"{x * factor:.3g} {unit}"


def _count(x: float) -> str:
    return f"{x:,.0f}" if x >= 10 or x == 0 else f"{x:.2g}"


def _simulated(t: float) -> str:
    """12.40 s; from ten minutes on 10:00."""
    return "-" if t < 0 else f"{t:.2f} s" if t < _CLOCK else clock(t)


def _length(t: float) -> str:
    return f"{t:g} s" if t < _CLOCK else clock(t)


def _shares(row: Row) -> str:
    compute, both = (round(x * _SHARES) for x in (row.shares()[0], sum(row.shares()[:2])))
    return "#" * compute + "=" * (both - compute) + "." * (_SHARES - both) if any(row.shares()) else ""


def headline(now: Progress, speed: float, width: int) -> str:
    """The name of the run and its progress."""
    done = min(max(now.t, 0.0) / now.until, 1.0) if now.until > 0 else 1.0
    text = f"{now.simulation}  {now.phase}  {_simulated(max(now.t, 0.0))} of {_length(now.until)}"
    if speed > 0:
        text += f"  {times(speed)}x real time"
    if now.overruns:
        text += f"  {now.overruns:,} late"
    whole = f"{text}  {bar(done)}"
    return whole if len(whole) <= width else text[:width]


@dataclass(frozen=True)
class _Column:
    """In a narrow terminal, the column with the highest `dropped` is left out first."""
    title: str
    width: int
    dropped: int
    live: Callable[[Row, Row], str]     # of (row, rate)
    final: Callable[[Row, Row], str]


def _part(title: str, width: int, dropped: int, i: int) -> _Column:
    """A column of compute, transport or wait: its share, in the last table the whole time."""
    return _Column(title, width, dropped, lambda row, rate: f"{rate.shares()[i]:.0%}",
                   lambda row, rate: _span(getattr(row, title)))


_COLUMNS = (
    _Column("time", 9, 4, *2 * [lambda row, rate: _simulated(row.t)]),
    _Column("ticks/s", 9, 3, *2 * [lambda row, rate: _count(rate.ticks)]),
    _Column("speed", 7, 2, *2 * [lambda row, rate: f"{times(rate.t)}x"]),
    _part("compute", 8, 0, 0),
    _part("transport", 9, 0, 1),
    _part("wait", 8, 1, 2),
    _Column("", _SHARES, 5, *2 * [lambda row, rate: _shares(rate)]),
)


def cut(text: str, width: int) -> str:
    """As much of a text as takes no more columns of a terminal than `width`."""
    columns = 0
    for i, character in enumerate(text):
        columns += 0 if unicodedata.combining(character) else 1 + (unicodedata.east_asian_width(character) in "WF")
        if columns > width:
            return text[:i]
    return text


def _chosen(now: Progress, rates: list[Row], most: int) -> list[int]:
    """The rows to show, in their own order: those with a problem and the busiest."""
    order = list(range(len(now.rows)))
    if len(order) <= most:
        return order
    order.sort(key=lambda i: (not now.rows[i].bad, now.rows[i].state == "running", rates[i].shares()[2]))
    return sorted(order[:max(most - 1, 1)])


def lines(now: Progress, rates: list[Row], width: int, most: int = 10**6, colour: bool = False,
          final: bool = False) -> list[str]:
    """The table. rates: of each row its progress per second; most: how many rows, of which the least busy are left
    out first; final: with total times instead of shares."""
    def styled(style: int, text: str) -> str:
        return f"\x1b[{style}m{text}\x1b[0m" if colour and style else text

    names = max([len("node")] + [min(len(row.name), _NAME) for row in now.rows])
    states = max([len("state")] + [len(row.state) for row in now.rows])
    slow = slowest(rates)
    note = f"  {_SLOWEST}" if slow else ""
    columns = list(_COLUMNS)
    while columns and sum(2 + c.width for c in columns) > width - names - 2 - states - len(note):
        columns.remove(max(columns, key=lambda c: c.dropped))
    head = f"{'node':{names}}  {'state':{states}}" + "".join(f"  {c.title:>{c.width}}" for c in columns)
    table = [styled(_BOLD, head[:width].rstrip())]
    chosen = _chosen(now, rates, most)
    for row, rate in ((now.rows[i], rates[i]) for i in chosen):
        text = f"{row.name[:_NAME]:{names}}  {row.state:{states}}"
        if row.takes_part and row.ticks:
            text += "".join(f"  {(c.final if final else c.live)(row, rate):>{c.width}}" for c in columns)
        table.append(styled(_RED if row.bad else 0 if row.takes_part else _DIM, text[:width].rstrip())
                     + (f"  {styled(_YELLOW, _SLOWEST)}" if row.name == slow else ""))
    if len(chosen) < len(now.rows):
        table.append(styled(_DIM, f"and {len(now.rows) - len(chosen)} more, which wait more"))
    if _COLUMNS[-1] in columns and any(row.ticks for row in now.rows):
        table.append(styled(_DIM, f"{_LEGEND:>{len(head)}}"))
    return table


class Watch:
    """The progress of a run during the last two seconds."""

    def __init__(self) -> None:
        self._past: list[Progress] = []

    def take(self, now: Progress) -> tuple[list[Row], float]:
        """Add the newest state; returns (the rates of each node, simulated seconds per second)."""
        self._past = [p for p in self._past if now.wall - _LATELY <= p.wall < now.wall]
        self._past.append(replace(now, rows=[replace(row) for row in now.rows]))
        return between(self._past[0], now)


def between(before: Progress, now: Progress) -> tuple[list[Row], float]:
    """The rates of each node and of the run between two times."""
    wall = now.wall - before.wall
    if wall <= 0:
        return [Row(row.name, takes_part=row.takes_part) for row in now.rows], 0.0
    old = {row.name: row for row in before.rows}
    rates = [row.since(old.get(row.name, Row(row.name)), wall) for row in now.rows]
    return rates, (max(now.t, 0.0) - max(before.t, 0.0)) / wall


def whole(now: Progress) -> tuple[list[Row], float]:
    """The same for the whole run."""
    return between(Progress(now.simulation, now.until), now)


class Lines:
    """Where there is no terminal: each event of the run, a line every some seconds, and the table at the end."""

    def __init__(self, out: TextIO | None = None, show_logs: bool = False):
        self._out = out or sys.stdout
        self._show_logs = show_logs
        self._watch = Watch()
        self._written = time.monotonic()

    def happens(self, text: str) -> None:
        """Show an event of the run."""
        self._write([printable(text)])

    def logged(self, new: list[tuple[str, str]], width: int) -> None:
        """Show new lines of logs: (name, line)."""
        if self._show_logs and new:
            self._write([f"{name:{width}} | {shown(line)}" for name, line in new])

    def goes(self, now: Progress, recent: Sequence[tuple[str, str]]) -> None:
        """Show the progress. recent: the last lines of all logs."""
        rates, speed = self._watch.take(now)
        if time.monotonic() - self._written < _QUIET:
            return
        self._written = time.monotonic()
        text = f"  {_simulated(max(now.t, 0.0))} of {_length(now.until)}"
        if speed > 0:
            text += f", {times(speed)}x real time"
        if slow := slowest(rates):
            shares = next(row.shares() for row in rates if row.name == slow)
            text += f", slowest {slow}: {shares[0]:.0%} computing, {shares[1]:.0%} on the way"
        self._write([text + "".join(f"; {row.name} {row.state}" for row in now.rows
                                    if row.bad or row.takes_part and row.state != "running")])

    def ends(self, now: Progress) -> None:
        """Show the table of the whole run."""
        self._write(lines(now, whole(now)[0], 120, final=True))

    def close(self) -> None:
        """Leave the terminal as it was."""

    def _write(self, text: list[str]) -> None:
        self._out.write("\n".join(text) + "\n")
        self._out.flush()


class Screen(Lines):
    """A terminal: the table in place, with the last lines of the logs below it."""

    def __init__(self, out: TextIO | None = None):
        super().__init__(out)
        self._drawn = 0
        self._colour = not os.environ.get("NO_COLOR") and os.environ.get("TERM", "dumb") != "dumb"
        self._out.write("\x1b[?25l")

    def goes(self, now: Progress, recent: Sequence[tuple[str, str]]) -> None:
        rates, speed = self._watch.take(now)
        if time.monotonic() - self._written < _OFTEN and self._drawn:
            return
        self._written = time.monotonic()
        columns, rows = shutil.get_terminal_size()
        width, room = max(columns - 1, 20), max(rows - 6, 3)
        logged = list(recent)[max(len(recent) - min(_LOG_LINES, room // 3), 0):]
        head = headline(now, speed, width)
        names = min(max(len(row.name) for row in now.rows), _NAME)
        text = [f"\x1b[{_BOLD}m{head}\x1b[0m" if self._colour else head,
                *lines(now, rates, width, max(room - len(logged), 2), self._colour), *([""] if logged else []),
                *(cut(f"{name[:_NAME]:{names}} | {shown(line)}", width) for name, line in logged)]
        up = f"\x1b[{self._drawn}A\r" if self._drawn else "\r"
        self._out.write(up + "".join(line + "\x1b[K\n" for line in text) + "\x1b[J")
        self._out.flush()
        self._drawn = len(text)

    def ends(self, now: Progress) -> None:
        width = max(shutil.get_terminal_size().columns - 1, 20)
        self._write(lines(now, whole(now)[0], width, colour=self._colour, final=True))

    def close(self) -> None:
        self._clear()
        self._out.write("\x1b[?25h")
        self._out.flush()

    def _write(self, text: list[str]) -> None:
        self._clear()
        super()._write(text)

    def _clear(self) -> None:
        if self._drawn:
            self._out.write(f"\x1b[{self._drawn}A\r\x1b[J")
            self._drawn = 0
