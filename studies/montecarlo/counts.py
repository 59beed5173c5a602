# SPDX-License-Identifier: Apache-2.0
"""Percentiles of more numbers than memory holds, the same in whatever order the numbers came."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

BITS = 8                        # of the mantissa that tell the bins apart
BOUND = 2.0**-(BITS + 1)        # relative error of a bin's middle
_BELOW = 52 - BITS              # bits of a double that a bin leaves open
_CODES = 1 << (12 + BITS)       # bins of a sample


class Counts:
    """How many numbers fell into each bin, at each of some samples; a bin is a sign, an exponent and the leading 8 bits
    of the mantissa.

    Whole numbers add up to the same in any order, so that the percentiles have the same bits however the numbers are
    shared. A percentile is the middle of the bin that holds the order statistic at or below it: within 0.2 % (2^-9) of
    that number.
    """

    def __init__(self, samples: int) -> None:
        import numpy as np

        self.samples = samples
        self.keys = np.empty(0, np.int64)       # ascending: sample, then bin from the lowest number to the highest
        self.counts = np.empty(0, np.int64)

    def add(self, values: np.ndarray) -> None:
        """Count numbers. values: (runs, samples); those that are NaN do not count"""
        import numpy as np

        values = np.ascontiguousarray(values, np.float64)
        bits = values.view(np.int64) >> _BELOW
        bits = np.where(bits < 0, -_CODES // 2 - 1 - bits, bits) + _CODES // 2      # ascending as the numbers do
        keys = bits + _CODES * np.arange(self.samples)
        self.merge(*np.unique(keys[~np.isnan(values)], return_counts=True))

    def merge(self, keys: np.ndarray, counts: np.ndarray) -> None:
        """Add counts of others. keys: ascending; counts: how many of each"""
        import numpy as np

        both, n = np.concatenate([self.keys, keys]), np.concatenate([self.counts, counts])
        order = np.argsort(both, kind="stable")     # two ascending parts, which it merges
        both = both[order]
        starts = np.flatnonzero(np.concatenate([[True], both[1:] != both[:-1]])) if len(both) else np.empty(0, int)
        self.keys, self.counts = both[starts], np.add.reduceat(n[order], starts) if len(both) else n

    def percentiles(self, shown: Iterable[float]) -> np.ndarray:
        """(percentiles, samples); NaN for samples without numbers."""
        import numpy as np

        ends = np.searchsorted(self.keys, _CODES * np.arange(self.samples + 1))
        below = np.concatenate([[0], np.cumsum(self.counts)])
        n = below[ends[1:]] - below[ends[:-1]]
        if not len(self.keys):
            return np.full((len(list(shown)), self.samples), np.nan)
        bins = [np.searchsorted(below, below[ends[:-1]] + (n - 1) * int(round(p * 1000)) // 100_000, "right") - 1
                for p in shown]
        values = _middles(self.keys[np.array(bins, int).clip(0, len(self.keys) - 1)] % _CODES)
        return np.where(n > 0, values, np.nan)

    def least_positive(self) -> float:
        """The middle of the lowest bin above 0; not a number if there is none."""
        import numpy as np

        codes = self.keys % _CODES
        above = codes[codes > _CODES // 2]
        return float(_middles(above.min())) if len(above) else float(np.nan)

    def only_zero(self) -> bool:
        """Whether all numbers were 0, or as small as no double of the usual form."""
        return bool((_middles(self.keys % _CODES) == 0).all())


def _middles(codes: np.ndarray) -> np.ndarray:
    import numpy as np

    codes = np.asarray(codes) - _CODES // 2
    codes = np.where(codes < 0, -_CODES // 2 - 1 - codes, codes)
    values = ((codes << _BELOW) + (1 << (_BELOW - 1))).view(np.float64)
    return np.where(np.abs(values) < np.finfo(float).tiny, 0.0, values)
