# SPDX-License-Identifier: Apache-2.0
"""The results of a flight, and its record."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fledge.commands import Report


@dataclass
class Flown:
    """The results of a flight."""
    record: Path            # of all flight outputs
    steps: int              # of flight
    cpu: float | None       # [s] of a processor, per step of flight
    cpu_of: str = ""        # what it includes, or its processor: "world too", "emulated"
    code: int | None = None  # [bytes] without the C library
    memory: int | None = None
    saturated: int = 0      # numbers that were limited to the range of their words, on either side
    lost: int = 0           # packets that a full queue refused or dropped, or that a newer one replaced unseen
    heap: tuple[int, int, int] | None = None    # [bytes] of a script: used at the start, at the end, at most
    script: tuple[str, ...] = ()                # what its own updates did, a line each
    reports: Sequence[Report] = ()              # of its commands, where no telemetry has them
    line: Mapping[str, int] | None = None       # figures of the serial line to its board (serial.py)


def results(record: Path, figures: Mapping[str, str], cpu_of: str, code: int | None, memory: int | None) -> Flown:
    """A Flown of the figures that the programs of a flight printed."""
    saturated, lost = (sum(int(figures.get(key, 0)) for key in keys) for keys in (
        ("saturated", "outside_saturated"), ("lost", "skipped", "outside_skipped")))
    script = tuple(f"{key.removeprefix('script.')} {text}" for key, text in figures.items()
                   if key.startswith("script."))
    return Flown(record, int(figures["ticks"]), float(figures["cpu_ns"]) / 1e9, cpu_of, code, memory, saturated, lost,
                 heap_of(figures.get("heap", "")), script)


def heap_of(marks: str) -> tuple[int, int, int] | None:
    """(used at the start, at the end, at most) of marks "tick:used:peak ..."."""
    switches = [tuple(map(int, mark.split(":"))) for mark in marks.split()]
    return (switches[0][1], switches[-1][1], switches[-1][2]) if switches else None


def new_record(folder: Path, name: str, part: bool = True) -> Path:
    """The path of a record; that of an earlier flight is deleted. part: also one that is not whole, with which a flight
    may go on that takes the place of a lost one."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.mcap"
    for old in (path, *[path.with_name(path.name + ".part")] * part):
        old.unlink(missing_ok=True)
    return path
