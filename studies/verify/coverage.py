# SPDX-License-Identifier: Apache-2.0
"""The lines and the branches of flight code that ran on a board, as its emulator counts them: of each line how often it
ran, of each conditional branch of the object code how often it went each way. Files are as genhtml reads them.

    {"flight/control/mrp_feedback.c": {"lines": {"41": 7200}, "branches": {"43,0,1": 12}}}
"""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

Coverage = dict[str, Any]       # file -> {"lines": {line: count}, "branches": {"line,branch,way": count}}
FOLDERS = ("flight/", "ccsds/")
EXPORTED = "exported/"          # begins the names of the sources that the export wrote


def read(path: Path, roots: Sequence[Path], exported: Path) -> Coverage:
    """The flight code in a file of the emulator. roots: folders with sources; exported: that of the mission's."""
    coverage: Coverage = {}
    for record in path.read_text(encoding="utf-8").split("end_of_record"):
        lines = record.split("\n")
        source = next((line[3:] for line in lines if line.startswith("SF:")), "")
        name = _name(Path(source), roots, exported)
        if not name:
            continue
        file = coverage.setdefault(name, {"lines": {}, "branches": {}})
        for line in lines:
            kind, _, text = line.partition(":")
            place, _, count = text.rpartition(",")
            if kind == "DA":
                file["lines"][place] = int(count)
            elif kind == "BRDA":
                file["branches"][place] = 0 if count == "-" else int(count)
    return coverage


def _name(source: Path, roots: Sequence[Path], exported: Path) -> str:
    """The name of a source of flight; "" of others."""
    source = source.resolve()
    if source.is_relative_to(exported.resolve()):
        return f"{EXPORTED}{source.name}"
    for root in roots:
        if source.is_relative_to(root.resolve()):
            name = source.relative_to(root.resolve()).as_posix()
            if name.startswith(FOLDERS):
                return name
    return ""


def add(to: Coverage, other: Mapping[str, Any]) -> None:
    """Add the counts of another flight."""
    for name, counts in other.items():
        file = to.setdefault(name, {"lines": {}, "branches": {}})
        for kind in ("lines", "branches"):
            for place, count in counts[kind].items():
                file[kind][place] = file[kind].get(place, 0) + count


def joined(coverages: Iterable[Mapping[str, Any]]) -> Coverage:
    """The counts of several flights together."""
    whole: Coverage = {}
    for counts in coverages:
        add(whole, counts)
    return whole


class Share(NamedTuple):
    """How many of the lines ran, and how many of the ways of branches were taken."""
    lines: int
    of_lines: int
    branches: int
    of_branches: int


def share(coverage: Mapping[str, Any]) -> Share:
    counts = [[count for file in coverage.values() for count in file[kind].values()] for kind in ("lines", "branches")]
    return Share(*(n for kind in counts for n in (sum(map(bool, kind)), len(kind))))


def never(file: Mapping[str, Any]) -> str:
    """The lines of a file that never ran: "12-14, 20"."""
    places = sorted((int(line), count) for line, count in file["lines"].items())
    parts: list[list[int]] = []
    open_ = False
    for line, count in places:
        if count:
            open_ = False
        elif open_:
            parts[-1][1] = line
        else:
            parts.append([line, line])
            open_ = True
    return ", ".join(f"{a}" if a == b else f"{a}\N{EN DASH}{b}" for a, b in parts)


def lcov(coverage: Mapping[str, Any], root: Path) -> str:
    """A file for genhtml, of the files that are below the root."""
    out = []
    for name, file in sorted(coverage.items()):
        if name.startswith(EXPORTED):
            continue
        reached = {place.rpartition(",")[0] for place, count in file["branches"].items() if count}
        out += ["TN:", f"SF:{root / name}",
                *(f"BRDA:{place},{count if place.rpartition(',')[0] in reached else '-'}"
                  for place, count in file["branches"].items()),
                *(f"DA:{line},{count}" for line, count in file["lines"].items()), "end_of_record"]
    return "\n".join([*out, ""])
