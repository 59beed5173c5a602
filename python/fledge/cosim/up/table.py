# SPDX-License-Identifier: Apache-2.0
"""How a run goes, for people: a table that is drawn over and over, or lines where there is no terminal."""
from __future__ import annotations

import os
import shutil
import sys
import time
from dataclasses import dataclass, field, replace

from fledge.progress import clock

_WIDTH = 28         # of the progress bar
_SHARES = 16        # of the bar of a node's time
_LATELY = 2.0       # [s] that rates are taken over
_QUIET = 5.0        # [s] between lines where there is no terminal
_CLOCK = 600.0      # [s] from which on times are as a clock has them
_OFTEN = 0.2        # [s] between drawings
_LOG_LINES = 8      # at most, below the table
_NAME = 24          # columns, at most
_SLOWEST = "slowest"
_LEGEND = "# compute  = transport  . wait"

_BOLD, _DIM, _RED, _YELLOW, _GREEN, _PLAIN = "\x1b[1m", "\x1b[2m", "\x1b[31m", "\x1b[33m", "\x1b[32m", "\x1b[0m"


@dataclass
class Row:
    """A node. Times in seconds; compute, transport and wait of wall time in all."""
    name: str
    state: str = "starting"
    t: float = -1.0             # simulated
    ticks: int = 0
    compute: float = 0.0
    transport: float = 0.0
    wait: float = 0.0
    asked: float = 0.0          # how long ago the request was that it has not yet answered
    bad: bool = False           # its state is to be noticed
    takes_part: bool = True     # not an asynchronous program

    def shares(self) -> tuple[float, float, float]:
        """Of compute, transport and wait, of its time so far."""
        whole = self.compute + self.transport + self.wait
        return (self.compute / whole, self.transport / whole, self.wait / whole) if whole > 0 else (0.0, 0.0, 0.0)

    def since(self, before: Row, wall: float) -> Row:
        """What was between, per second of wall time."""
        return Row(self.name, self.state, (self.t - max(before.t, 0.0)) / wall if self.t >= 0 else 0.0,
                   (self.ticks - before.ticks) / wall, self.compute - before.compute,
                   self.transport - before.transport, self.wait - before.wait, self.asked, self.bad, self.takes_part)


@dataclass
class Progress:
    """A run at one time."""
    simulation: str
    until: float
    phase: str = "starting"
    wall: float = 0.0           # since all nodes were there
    t: float = -1.0
    rows: list[Row] = field(default_factory=list)
    overruns: int | None = None     # instants that were late; None: it is not paced
    worst: float = 0.0              # how late


def slowest(rates: list[Row]) -> str | None:
    """The node that is busy most of its time, by itself and on the way, so that others wait for it."""
    busy = {row.name: 1.0 - row.shares()[2] for row in rates if row.takes_part and sum(row.shares()) > 0}
    return max(busy, key=busy.get) if len(busy) > 1 else None


def _speed(x: float) -> str:
    return f"{x:,.0f}x" if x >= 100 else f"{x:.3g}x"


def _span(x: float) -> str:
    """2.83 s, 279 us"""
    factor, unit = (1, "s") if x >= 1 or x == 0 else (1e3, "ms") if x >= 1e-3 else (1e6, "us")
    return f"{x * factor:.3g} {unit}"


def _count(x: float) -> str:
    return f"{x:,.0f}" if x >= 10 or x == 0 else f"{x:.2g}"


def _simulated(t: float) -> str:
    """12.40 s; from ten minutes on as a clock has it."""
    return "-" if t < 0 else f"{t:.2f} s" if t < _CLOCK else clock(t)


def _length(t: float) -> str:
    return f"{t:g} s" if t < _CLOCK else clock(t)


def _bar(shares: tuple[float, float, float], width: int) -> str:
    if not any(shares):
        return " " * width
    compute = round(shares[0] * width)
    both = round((shares[0] + shares[1]) * width)
    return "#" * compute + "=" * (both - compute) + "." * (width - both)


def headline(now: Progress, speed: float, width: int) -> str:
    """The name of the run and how far it is."""
    done = min(max(now.t, 0.0) / now.until, 1.0) if now.until > 0 else 1.0
    filled = int(done * _WIDTH)
    text = f"{now.simulation}  {now.phase}  {_simulated(max(now.t, 0.0))} of {_length(now.until)}"
    if speed > 0:
        text += f"  {_speed(speed)} real time"
    if now.overruns:
        text += f"  {now.overruns:,} late"
    bar = f"  [{'#' * filled}{'.' * (_WIDTH - filled)}] {done:4.0%}"
    return text + bar if len(text) + len(bar) <= width else text[:width]


@dataclass(frozen=True)
class _Column:
    """Which is left out first where there is no room: that of the highest `dear`."""
    title: str
    width: int
    dear: int
    live: object        # (row, rate) -> text
    final: object = None


_COLUMNS = (
    _Column("time", 9, 4, lambda row, rate: _simulated(row.t)),
    _Column("ticks/s", 9, 3, lambda row, rate: _count(rate.ticks)),
    _Column("speed", 7, 2, lambda row, rate: _speed(rate.t)),
    _Column("compute", 8, 0, lambda row, rate: f"{rate.shares()[0]:.0%}", lambda row, rate: _span(row.compute)),
    _Column("transport", 9, 0, lambda row, rate: f"{rate.shares()[1]:.0%}", lambda row, rate: _span(row.transport)),
    _Column("wait", 8, 1, lambda row, rate: f"{rate.shares()[2]:.0%}", lambda row, rate: _span(row.wait)),
    _Column("", _SHARES, 5, lambda row, rate: _bar(rate.shares(), _SHARES)),
)


def _fitting(room: int) -> list[_Column]:
    columns = list(_COLUMNS)
    while columns and sum(2 + c.width for c in columns) > room:
        columns.remove(max(columns, key=lambda c: c.dear))
    return columns


def _chosen(now: Progress, rates: list[Row], most: int) -> list[int]:
    """The rows that are shown: those to be noticed and the busiest, in their own order."""
    order = list(range(len(now.rows)))
    if len(order) <= most:
        return order
    order.sort(key=lambda i: (not now.rows[i].bad, now.rows[i].state == "running", rates[i].shares()[2]))
    return sorted(order[:max(most - 1, 1)])


def lines(now: Progress, rates: list[Row], width: int, most: int = 10**6, colour: bool = False,
          final: bool = False) -> list[str]:
    """The table. rates: of each row what there was per second lately. most: rows; what does not fit is
    left out from the least busy on. final: with whole times instead of shares."""
    marks = {"head": _BOLD, "bad": _RED, "slow": _YELLOW, "dim": _DIM, "off": _PLAIN} if colour else \
        dict.fromkeys(("head", "bad", "slow", "dim", "off"), "")
    names = max([len("node")] + [min(len(row.name), _NAME) for row in now.rows])
    states = max([len("state")] + [len(row.state) for row in now.rows])
    slow = slowest(rates)
    note = f"  {_SLOWEST}" if slow else ""
    columns = _fitting(width - names - 2 - states - len(note))
    head = f"{'node':{names}}  {'state':{states}}" + "".join(f"  {c.title:>{c.width}}" for c in columns)
    table = [f"{marks['head']}{head[:width].rstrip()}{marks['off']}"]
    chosen = _chosen(now, rates, most)
    for row, rate in ((now.rows[i], rates[i]) for i in chosen):
        text = f"{row.name[:_NAME]:{names}}  {row.state:{states}}"
        if row.takes_part and row.ticks:
            text += "".join(f"  {(final and c.final or c.live)(row, rate):>{c.width}}" for c in columns)
        text = text[:width].rstrip()
        mark = "bad" if row.bad else "" if row.takes_part else "dim"
        if mark:
            text = f"{marks[mark]}{text}{marks['off']}"
        if row.name == slow and note:
            text += f"  {marks['slow']}{_SLOWEST}{marks['off']}"
        table.append(text)
    left = len(now.rows) - len(chosen)
    if left:
        table.append(f"{marks['dim']}and {left} more, which wait more{marks['off']}")
    if _COLUMNS[-1] in columns and any(row.ticks for row in now.rows):
        table.append(f"{marks['dim']}{_LEGEND:>{len(head)}}{marks['off']}")
    return table


class Watch:
    """What a run did lately: from the last two seconds of what was told."""

    def __init__(self):
        self._past: list[Progress] = []

    def take(self, now: Progress) -> tuple[list[Row], float]:
        """(each node's rates, simulated seconds per second)"""
        self._past = [p for p in self._past if now.wall - p.wall <= _LATELY]
        self._past.append(replace(now, rows=[replace(row) for row in now.rows]))
        return between(self._past[0], now)


def between(before: Progress, now: Progress) -> tuple[list[Row], float]:
    wall = now.wall - before.wall
    if wall <= 0:
        return [Row(row.name, takes_part=row.takes_part) for row in now.rows], 0.0
    old = {row.name: row for row in before.rows}
    rates = [row.since(old.get(row.name, Row(row.name)), wall) for row in now.rows]
    return rates, (max(now.t, 0.0) - max(before.t, 0.0)) / wall


def whole(now: Progress) -> tuple[list[Row], float]:
    """The same of the whole run."""
    return between(Progress(now.simulation, now.until), now)


class Lines:
    """Where there is no terminal: what happens, a line every some seconds, and the table at the end."""

    def __init__(self, out=None, show_logs=False):
        self._out = out or sys.stdout
        self._show_logs = show_logs
        self._watch = Watch()
        self._told = time.monotonic()

    def happens(self, text: str) -> None:
        self._write([text])

    def logged(self, new: list[tuple[str, str]], width: int) -> None:
        from fledge.cosim.up.logs import shown

        if self._show_logs and new:
            self._write([f"{name:{width}} | {shown(line)}" for name, line in new])

    def goes(self, now: Progress, recent) -> None:
        rates, speed = self._watch.take(now)
        if time.monotonic() - self._told < _QUIET:
            return
        self._told = time.monotonic()
        slow = slowest(rates)
        text = f"{_simulated(max(now.t, 0.0))} of {_length(now.until)}"
        if speed > 0:
            text += f", {_speed(speed)} real time"
        if slow:
            shares = next(row.shares() for row in rates if row.name == slow)
            text += f", slowest {slow}: {shares[0]:.0%} computing, {shares[1]:.0%} on the way"
        for row in now.rows:
            if row.bad or row.takes_part and row.state != "running":
                text += f"; {row.name} {row.state}"
        self._write(["  " + text])

    def ends(self, now: Progress) -> None:
        rates, _ = whole(now)
        self._write(lines(now, rates, 120, final=True))

    def close(self) -> None:
        pass

    def _write(self, text: list[str]) -> None:
        self._out.write("\n".join(text) + "\n")
        self._out.flush()


class Screen(Lines):
    """A terminal: the table in place, with the last lines of the logs below it."""

    def __init__(self, out=None):
        super().__init__(out)
        self._drawn = 0
        self._colour = not os.environ.get("NO_COLOR") and os.environ.get("TERM", "dumb") != "dumb"
        self._out.write("\x1b[?25l")

    def goes(self, now: Progress, recent) -> None:
        rates, speed = self._watch.take(now)
        if time.monotonic() - self._told < _OFTEN and self._drawn:
            return
        self._told = time.monotonic()
        columns, rows = shutil.get_terminal_size()
        width = max(columns - 1, 20)
        room = max(rows - 6, 3)
        logged = min(_LOG_LINES, room // 3, len(recent))
        table = lines(now, rates, width, max(room - logged, 2), self._colour)
        mark, plain = (_BOLD, _PLAIN) if self._colour else ("", "")
        shown = [f"{mark}{headline(now, speed, width)}{plain}", *table]
        if logged:
            from fledge.cosim.up.logs import shown as printable

            names = max(len(row.name) for row in now.rows)
            shown += [""] + [f"{name[:24]:{min(names, 24)}} | {printable(line)}"[:width]
                             for name, line in list(recent)[-logged:]]
        self._draw(shown)

    def happens(self, text: str) -> None:
        self._clear()
        super().happens(text)

    def ends(self, now: Progress) -> None:
        self._clear()
        rates, _ = whole(now)
        width = max(shutil.get_terminal_size().columns - 1, 20)
        self._write(lines(now, rates, width, colour=self._colour, final=True))

    def close(self) -> None:
        self._clear()
        self._out.write("\x1b[?25h")
        self._out.flush()

    def _draw(self, text: list[str]) -> None:
        up = f"\x1b[{self._drawn}A\r" if self._drawn else "\r"
        self._out.write(up + "".join(line + "\x1b[K\n" for line in text) + "\x1b[J")
        self._out.flush()
        self._drawn = len(text)

    def _clear(self) -> None:
        if self._drawn:
            self._out.write(f"\x1b[{self._drawn}A\r\x1b[J")
            self._out.flush()
            self._drawn = 0
