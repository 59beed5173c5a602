# SPDX-License-Identifier: Apache-2.0
"""Sweeps: a campaign whose runs are the points of a grid. `fledge sweep MISSION --set NAME=VALUES`, or from Python

    from fledge.montecarlo import Sweep, lin, log

    sweep = Sweep("imager", {"stiffness": lin(0.1, 1, 10), "flight.control.P": [2, 3, 4]})
    result = sweep.fly()                    # a run at each point
    result = sweep.fly(runs=20, seed=1)     # a sweep with dispersed=True: 20 dispersed runs at each point

An axis is a parameter of the mission, as in fledge.load("imager", stiffness=0.4), or the path of a number. The first
one changes fastest.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.montecarlo.campaign import Campaign, declare
from fledge.montecarlo.dispersions import Dispersions
from fledge.montecarlo.shares import Share

if TYPE_CHECKING:
    import numpy as np

    from fledge.mission.simulation import Simulation
    from fledge.montecarlo.result import Result


def lin(first: Any, last: Any, n: int) -> list[Any]:
    """n values at equal distances, the ends included, with their unit. Raises SetupError for n < 2."""
    _check_n(n)
    return [first + (last - first) * (i / (n - 1)) for i in range(n - 1)] + [last]


def log(first: Any, last: Any, n: int) -> list[Any]:
    """n values with equal ratios, the ends included, with their unit. Raises SetupError for n < 2 or an end <= 0."""
    _check_n(n)
    if not (first > 0 * first and last > 0 * last):
        raise SetupError(f"log: the ends must be > 0, found {first!r} and {last!r}")
    ratio = math.log(float(last / first))
    return [first * math.exp(ratio * i / (n - 1)) for i in range(n - 1)] + [last]


def _check_n(n: int) -> None:
    if n < 2:
        raise SetupError(f"a range of values needs at least 2, found {n}")


class Sweep(Campaign):
    """A mission, and the axes of a grid.

    axes: name of a mission's parameter, or path of a number -> its values; name: of a function in dispersions.py, or a
    function that takes `d`: duration, retained variables and requirements are those of this campaign. dispersed: each
    point also has its dispersions, with the same draws and random streams at each; else they are left out.
    Raises SetupError, or MissionError with the line of the mission's file.
    """

    def __init__(self, mission: str | os.PathLike[str], axes: Mapping[str, Sequence[Any]],
                 name: str | Callable[[Dispersions], Any] | None = None, dispersed: bool = False) -> None:
        self.axes = {path: list(values) for path, values in axes.items()}
        if not self.axes:
            raise SetupError("a sweep needs an axis, as in stiffness=0.1:1:10")
        for path, values in self.axes.items():
            if not values:
                raise SetupError(f"the axis {path} has no values")
            if len({repr(value) for value in values}) < len(values):
                raise SetupError(f"the axis {path} has a value twice: {', '.join(map(repr, values))}")
        self.parameters = [path for path in self.axes if "." not in path]   # of the mission
        self.dispersed = dispersed
        self.points = math.prod(map(len, self.axes.values()))
        super().__init__(mission, name)
        self._check_parameters()

    def _check_parameters(self) -> None:
        """Load the mission with each value of each parameter once, so that a wrong one is an error at once."""
        stride = 1
        for path, values in self.axes.items():
            if path in self.parameters:
                for i in range(1, len(values)):
                    self._load(i * stride)
            stride *= len(values)

    @property
    def has_callables(self) -> bool:
        """As of Campaign; also with parameters of the mission, which each run loads anew."""
        return bool(self.parameters) or super().has_callables

    @property
    def recipe(self) -> tuple[Any, tuple]:
        """As of Campaign."""
        kind, (mission, function) = super().recipe
        return kind, (mission, self.axes, function, self.dispersed)

    def at(self, index: int) -> dict[str, Any]:
        """The values at the point of a run: name or path -> value."""
        point = {}
        for path, values in self.axes.items():
            index, k = divmod(index, len(values))
            point[path] = values[k]
        return point

    def fly(self, runs: int = 1, *arguments: Any, **options: Any) -> Result:
        """Fly all points; runs: how many at each, 1 without dispersions, else SetupError. The rest as Campaign.fly; its
        run i is at the point `at(i % points)`, which on_grid() sorts."""
        if runs < 1 or runs > 1 and not self.dispersed:
            raise SetupError("runs at a point must be " + (">= 1" if self.dispersed else "1 without dispersions")
                             + f", found {runs}")
        return super().fly(runs * self.points, *arguments, **options)

    def _declare(self, index: int) -> tuple[Simulation, Dispersions, dict[str, str], str]:
        at = self.at(index % self.points)
        sim, d, known, name = declare(self._mission, self._function, {path: at[path] for path in self.parameters})
        d.sweep(self.axes, self.parameters, self.points, self.dispersed)
        return sim, d, known, name

    def complete(self, share: Share) -> Share:
        """Mission parameters are numbers of a run like drawn ones."""
        import numpy as np

        if self.parameters:
            columns = [[number(self.axes[path], self.at(share.first + i)[path]) for path in self.parameters]
                       for i in range(len(share.flown))]
            share.draws = np.hstack([np.array(columns, float), share.draws])
        return share

    def drawn(self, simulation: Simulation) -> dict[str, float]:
        """As of Campaign, with the mission's parameters of the point."""
        assert simulation.mission
        given = simulation.mission.parameters
        return {**{path: number(self.axes[path], given[path]) for path in self.parameters}, **super().drawn(simulation)}

    def unit(self, path: str) -> str:
        """The unit of an axis by its path, "" if it has none."""
        return next((unit for name, unit in self.dispersions.columns.items() if name.startswith(path)), "")

    def on_grid(self, values: np.ndarray) -> np.ndarray:
        """(runs at a point, values of the last axis, ..., of the first) of (runs,) numbers."""
        return values.reshape(-1, *(len(axis) for axis in reversed(self.axes.values())))


def number(values: Sequence[Any], value: Any) -> float:
    """A value of an axis as a number in SI; of a text its place."""
    try:
        return float(getattr(value, "value", value))
    except (TypeError, ValueError):
        return float(values.index(value))


def text(value: Any) -> str:
    """A value of an axis for people."""
    return f"{value:.6g}" if isinstance(value, (int, float)) else str(value)
