# SPDX-License-Identifier: Apache-2.0
"""On which draws a measure depends most."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np

    from fledge.montecarlo.result import Result

SIGNIFICANCE = 1e-3     # the probability that chance alone makes any draw a driver of a measure
RUNS_MIN = 30
_GROUPS = 16
_IN_GROUP = 10          # runs, at least


class Driver(NamedTuple):
    """A draw on which a measure depends. share: of the variance of the measure's ranks, which the draw explains;
    correlation: of the ranks of both, which is near 0 where the dependence is symmetric."""
    share: float
    path: str
    correlation: float


def drivers(result: Result, values: np.ndarray) -> list[Driver]:
    """The draws on which a number of each run depends, the strongest first. values: (runs,)

    Kruskal's and Wallis' test (1952): the runs are sorted into up to 16 equal groups by the draw, and the mean ranks of
    the measure are compared. It sees dependences of any shape, also |x|, whose rank correlation is 0. All the draws
    together are mistaken for drivers with the probability SIGNIFICANCE. Of fewer than RUNS_MIN runs it gives [].
    """
    import numpy as np

    used = result.complete & np.isfinite(values)
    n = int(used.sum())
    if n < RUNS_MIN:
        return []
    own = ranks(values[used])
    total = float(own @ own)
    strong = []
    for path, draws in result.draws.items() if total else ():
        drawn = draws[used]
        groups = _groups(drawn)
        k = int(groups.max()) + 1
        between = float(np.sum(np.bincount(groups, own)**2 / np.bincount(groups)))
        # n - 1 times the share has the distribution chi^2 with k - 1 degrees of freedom.
        if k > 1 and (n - 1) * between / total > chi_squared(1 - SIGNIFICANCE / len(result.draws), k - 1):
            theirs = ranks(drawn)
            correlation = float(own @ theirs) / math.sqrt(total * float(theirs @ theirs))
            strong.append(Driver(between / total, path, correlation))
    return sorted(strong, key=lambda driver: -driver.share)


def ranks(x: np.ndarray) -> np.ndarray:
    """The ranks of numbers, less their mean; equal numbers have the mean of theirs."""
    import numpy as np

    _, at, counts = np.unique(x, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return (last - (counts - 1) / 2)[at] - (len(x) + 1) / 2


def _groups(x: np.ndarray) -> np.ndarray:
    """The group of each number: about as many in each, equal ones together."""
    import numpy as np

    n = max(2, min(_GROUPS, len(x) // _IN_GROUP))
    edges = np.unique(np.sort(x)[np.arange(1, n) * len(x) // n])
    return np.unique(np.searchsorted(edges, x, "right"), return_inverse=True)[1]


def chi_squared(probability: float, degrees: int) -> float:
    """The quantile of the chi-squared distribution; of more than 1 degree after Wilson and Hilferty (1931), which is
    too high in the tail, by up to 8 % at 1e-5, and so on the safe side."""
    normal = NormalDist()
    if degrees == 1:
        return normal.inv_cdf((1 + probability) / 2)**2
    spread = 2 / (9 * degrees)
    return degrees * (1 - spread + normal.inv_cdf(probability) * math.sqrt(spread))**3
