# SPDX-License-Identifier: Apache-2.0
"""The one table of what was flown where."""
from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from fledge.columns import columns
from fledge.targets import serial

if TYPE_CHECKING:
    from fledge.targets.flown import Flown

HEADS = ("target", "steps", "flight outputs", "first difference", "CPU per step", "code", "memory")


def lines(rows: Iterable[tuple[str, Flown | None, str, str]]) -> list[str]:
    """Lines of a table: of each row a Flown or None, its target's name, hash, and what its first difference is."""
    cells = [HEADS]
    for name, flown, digest, difference in rows:
        if flown is None:
            cells.append((name, "-", "-", difference, "-", "-", "-"))
            continue
        cells.append((name, str(flown.steps), digest, difference,
                      cpu(flown.cpu) + (f", {flown.cpu_of}" if flown.cpu_of else ""), size(flown.code),
                      size(flown.memory)))
    return columns(cells)


def scripts(rows: Iterable[tuple[str, Flown | None, str, str]]) -> list[str]:
    """Lines about the scripts of targets that have one: the heap, and the updates in Python."""
    lines = []
    for name, flown, _, _ in rows:
        if flown and flown.heap:
            start, end, most = flown.heap
            lines.append(f"heap     {name}: {size(start)} after the start, at most {size(most)}; "
                         + (f"flat for {flown.steps} steps" if start == end else f"IT GREW to {size(end)}"))
        lines += [f"script   {name}: {line}" for line in (flown.script if flown else ())]
    return lines


def serial_lines(rows: Iterable[tuple[str, Flown | None, str, str]]) -> list[str]:
    """Lines about the serial lines to boards, and a histogram of how late flight answered by the clock."""
    lines = []
    for name, flown, _, _ in rows:
        if flown and flown.line:
            lines.append(f"line     {name}: {serial.summary(flown.line, flown.steps)}")
            if late := serial.lateness(flown.line):
                lines.append(f"late     {name}: {flown.line.get('missed', 0)} of {sum(n for _, n in late)} steps were "
                             "answered when the next was due")
                lines += [f"         {line}" for line in serial.late_lines(late)]
    return lines


def cpu(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    scale, unit = (1e3, "ms") if seconds >= 1e-3 else (1e6, "us") if seconds >= 1e-6 else (1e9, "ns")
    return f"{seconds * scale:.3g} {unit}"


def size(n: int | None) -> str:
    return "-" if n is None else f"{n / 1024:.1f} KiB"
