# SPDX-License-Identifier: Apache-2.0
"""The report of a bench: a table for people, and the same figures as a list of rows for `--json`."""
from __future__ import annotations
import argparse
import json
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fledge.columns import columns


PEER = "peer, recorded 2026-11 on another machine"      # beside a figure that was measured once, in another program


class Rows:
    """The figures of one bench.

    A figure is the median of its samples, and their least. A ratio is this median over that of the case
    that it is compared with.
    """

    def __init__(self) -> None:
        self._rows: list[dict] = []

    def add(self, case: str, figure: str, samples: float | Sequence[float], unit: str, ratio_to: str | None = None,
            note: str = "") -> float:
        """Add a figure from its samples (or one number). `ratio_to` names a case with the same figure,
        added before."""
        values = [samples] if isinstance(samples, (int, float)) else samples
        value = statistics.median(values)
        least = min(values) if len(values) > 1 else None
        ratio = None
        if ratio_to is not None:
            other = [r for r in self._rows if r["case"] == ratio_to and r["figure"] == figure]
            if not other:
                raise KeyError(f"no case {ratio_to!r} with the figure {figure!r} to compare with")
            ratio = value / other[0]["value"]
        self._rows.append(dict(case=case, figure=figure, value=value, unit=unit, ratio_to=ratio_to,
                               ratio=ratio, least=least, note=note))
        return value

    def print(self) -> None:
        table = [("case", "figure", "least", "median", "unit", "ratio", "")]
        for r in self._rows:
            table.append((
                r["case"], r["figure"], "" if r["least"] is None else f"{r['least']:.4g}",
                f"{r['value']:.4g}", r["unit"],
                "" if r["ratio"] is None else f"{r['ratio']:.3g} x {r['ratio_to']}",
                r["note"]))
        print(*columns(table, {2, 3}), sep="\n")

    def write(self, path: Path | str) -> None:
        keys = ("case", "figure", "value", "least", "unit", "ratio_to", "ratio")
        with open(path, "w") as file:
            json.dump([{k: r[k] for k in keys} for r in self._rows], file, indent=1)
            file.write("\n")


def in_turn(cases: dict[Any, Callable[[], Any]], runs: int) -> dict[Any, list]:
    """Name -> samples of each case, a function that returns one. The cases take turns, so that a slow spell of the
    machine affects all of them; the first turn warms up."""
    turns = [{name: case() for name, case in cases.items()} for _ in range(runs + 1)][1:]
    return {name: [turn[name] for turn in turns] for name in cases}


def median_ratio(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """The median of the ratios within each turn, which a slow spell of the machine does not change."""
    return statistics.median_high(a / b for a, b in zip(ours, theirs))


def pair_by_pair(ours: Sequence[float], theirs: Sequence[float]) -> str:
    """The same in words."""
    return f"{median_ratio(ours, theirs):.3g} pair by pair"


def options(name: str, arguments: list[str], runs: int, cases: Sequence[str] = ()) -> argparse.Namespace:
    """Read the command line of a bench. The user may choose some of the cases; [] means all."""
    parser = argparse.ArgumentParser(prog=f"fledge bench {name}",
                                     epilog=f"example: ./fledge bench {name} --json {name}.json")
    parser.add_argument("--json", metavar="FILE", help="write the figures as a list of rows, too")
    parser.add_argument("--runs", type=int, default=runs, help="samples of each figure (default %(default)s)")
    if cases:
        parser.add_argument("cases", nargs="*", metavar="CASE", help=f"only these of {', '.join(cases)}")
    chosen = parser.parse_args(arguments)
    for case in getattr(chosen, "cases", []):
        if case not in cases:
            parser.error(f"there is no case {case}; there are {', '.join(cases)}")
    return chosen


def report(rows: Rows, chosen: argparse.Namespace) -> None:
    rows.print()
    if chosen.json:
        rows.write(chosen.json)
