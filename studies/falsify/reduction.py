# SPDX-License-Identifier: Apache-2.0
"""The smallest counterexample: a failing run whose faults and commands are removed, and whose numbers are set back to
those of the mission's own files, one by one, for as long as it still fails."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fledge.montecarlo.dispersions import Marginal

Fly = Callable[[Mapping[str, Sequence[float]]], Any]


@dataclass
class Counterexample:
    """values: path of each dispersed number, and of the kind of each fault -> its number; kept: what differs from the
    nominal run, removed: what does not: faults ("world.gyro.faults[0]") and commands ("flight.commands[0]"), lines of
    dispersions.py, or elements of their arrays; margin: of the requirement, below 0"""
    values: dict[str, float]
    kept: list[str]
    removed: list[str]
    margin: float


def smallest(fly: Fly, marginals: Mapping[str, Marginal], parts: Mapping[str, str], values: Mapping[str, float],
             margin: float) -> Counterexample:
    """The smallest counterexample from a failing run: its numbers, the kinds of all its faults among them, and its
    margin. fly: path -> its number in each run, to the margins; parts: faults and commands -> the path of the number
    that is 0 where there is none.

    Faults and commands go first, then lines of dispersions.py, then elements of their arrays; of those that can go,
    the one whose going leaves the least margin. What is left cannot go by itself."""
    lines: dict[str, dict[str, float]] = {}
    for path, m in marginals.items():
        if not path.startswith(tuple(f"{part}." for part in parts)):
            lines.setdefault(m.declared, {})[path] = m.nominal
    stages: list[dict[str, dict[str, float]]] = [
        {part: {path: 0.0} for part, path in parts.items()}, lines,
        {path: {path: x} for line in lines.values() for path, x in line.items()
         if len(line) > 1 and marginals[path].kind != "attitude"}]
    now = dict(values)

    def there(change: Mapping[str, float]) -> bool:
        return any(now[path] != x for path, x in change.items())

    for stage in stages:
        while left := {name: change for name, change in stage.items() if there(change)}:
            tried = [{**now, **change} for change in left.values()]
            margins = np.asarray(fly({path: [candidate[path] for candidate in tried] for path in now}))
            if not (margins < 0).any():
                break
            best = int(np.nanargmin(margins))
            now, margin = tried[best], float(margins[best])
    names = {name: change for stage in stages for name, change in stage.items()}
    arrays = {marginals[path].declared for path in stages[2]}
    kept = [name for name, change in names.items() if name not in arrays and there(change)]
    removed = [name for name, change in names.items() if name not in stages[2] and not there(change)]
    return Counterexample(now, kept, removed, margin)
