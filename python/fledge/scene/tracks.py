# SPDX-License-Identifier: Apache-2.0
"""Motions and signals over time, thinned to the samples that a picture needs, each within a stated bound.

A picture interpolates between the remaining samples: positions by cubics (Hermite), attitudes along the shortest turn,
signals by lines. A sample is left out only where the interpolation is within the bound of it.

Before its first sample, and from a sample that is NaN until the next one, a track has no value: at() gives NaN there.
A value that was written too long ago is stale: age() gives its age.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

POSITION = 0.01     # [m] how far a shown position may be from a recorded one
ATTITUDE = 1e-6     # [rad] the same of an attitude
SHARE = 1e-3        # [-] the same of a signal, as a share of its range
DIGITS = 1e-5       # [-] of one that is read as a number: as a share of its size
POINTS = 20_000     # of a signal; with more, the smallest and largest of each of many short spans are shown


@dataclass
class Track:
    """A quantity at times [s] (n,).

    source: of a track that grows: builds the track of later records, from their derivation
    written [s] (n,): when the value of a stale sample was written; NaN for others; None: no sample is stale
    """
    source: Callable[[Any], Any] | None = field(default=None, init=False, compare=False, repr=False)
    written: np.ndarray | None = field(default=None, init=False, compare=False, repr=False)

    def age(self, t: np.ndarray) -> np.ndarray:
        """[s] (m,) How old the values are at some times [s] (m,); 0 where they are not stale."""
        import numpy as np

        time: np.ndarray = getattr(self, "time")
        if self.written is None or not len(time):
            return np.zeros(len(t))
        written = self.written[np.searchsorted(time, t, side="right").clip(min=1) - 1]
        return np.where(np.isnan(written) | (t < time[0]), 0.0, t - written)


@dataclass
class Motion(Track):
    """Where something is. time [s] (n,); r [m] (n, 3) and v [m/s] (n, 3), relative to the origin of N."""
    time: np.ndarray
    r: np.ndarray
    v: np.ndarray

    def at(self, t: np.ndarray) -> np.ndarray:
        """The positions [m] (m, 3) at some times [s] (m,)."""
        return _begun(self.time, _hermite(self.time, self.r, self.v, t), t)

    def thinned(self) -> Motion:
        some = within_bound(self.time, lambda some: _norm(_hermite(self.time[some], self.r[some], self.v[some],
                                                                   self.time) - self.r), POSITION)
        return Motion(self.time[some], self.r[some], self.v[some])


@dataclass
class Turning(Track):
    """How something is turned. time [s] (n,); q (n, 4): the quaternion, scalar last, that turns the components of a
    vector in the body's frame into those in N."""
    time: np.ndarray
    q: np.ndarray

    @classmethod
    def of_mrp(cls, time: np.ndarray, sigma_BN: np.ndarray) -> Turning:
        import numpy as np

        s2 = (sigma_BN**2).sum(axis=1, keepdims=True)
        return cls(time, np.hstack([2 * sigma_BN, 1 - s2]) / (1 + s2))

    @classmethod
    def of_dcm(cls, time: np.ndarray, dcm_BN: np.ndarray) -> Turning:
        import numpy as np

        from fledge.attitude import dcm_to_quaternion

        beta = dcm_to_quaternion(dcm_BN)
        return cls(time, np.hstack([beta[:, 1:], beta[:, :1]]))

    def at(self, t: np.ndarray) -> np.ndarray:
        """The quaternions (m, 4) at some times [s] (m,)."""
        return _begun(self.time, _slerp(self.time, self.q, t), t)

    def thinned(self) -> Turning:
        import numpy as np

        def choose(time: np.ndarray, q: np.ndarray) -> np.ndarray:
            def off(some: np.ndarray) -> np.ndarray:
                between = _slerp(time[some], q[some], time)
                return 2 * np.minimum(_norm(between - q), _norm(between + q))
            return within_bound(time, off, ATTITUDE)

        some, q = _by_pieces(self, self.q, choose)
        return _with_ages(Turning(self.time[some], q), self, some)


@dataclass
class Signal(Track):
    """Numbers over time. time [s] (n,), values (n, k); read: they are shown as numbers, small ones as exactly as
    large ones."""
    time: np.ndarray
    values: np.ndarray
    read: bool = False

    def at(self, t: np.ndarray) -> np.ndarray:
        """The values (m, k) at some times [s] (m,)."""
        return _begun(self.time, _linear(self.time, self.values, t), t)

    def thinned(self) -> Signal:
        import numpy as np

        good = np.isfinite(self.values).all(axis=1)
        if not good.any():
            return _with_ages(Signal(self.time[:0], self.values[:0]), self, slice(0))
        size = np.ptp(self.values[good], axis=0)
        size = np.where(size > 0, size, 1)

        def choose(time: np.ndarray, values: np.ndarray) -> np.ndarray:
            scaled = values / size
            within = (DIGITS * _norm(scaled)).clip(min=1e-3 * DIGITS, max=SHARE) if self.read else SHARE
            some = within_bound(time, lambda some: np.abs(_linear(time[some], scaled[some], time) - scaled).max(axis=1)
                                / within, 1.0)
            most = max(2, POINTS * len(time) // len(good))
            return some if len(some) <= most else _extremes(values, max(1, most // (2 * values.shape[1])))

        some, values = _by_pieces(self, self.values, choose)
        return _with_ages(Signal(self.time[some], values, self.read), self, some)


def _begun(time: np.ndarray, values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The values at times t, with NaN before the first sample."""
    values[t < time[0]] = float("nan")
    return values


def _by_pieces(track: Turning | Signal, values: np.ndarray,
               choose: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """(indices, values) of the remaining samples: those that choose(times, values) picks in each piece without NaN, the
    NaN after it if a piece follows, and the samples before and after values become stale or fresh."""
    import numpy as np

    time = track.time
    good = np.isfinite(values).all(axis=1)
    turns = np.flatnonzero(np.diff(good, prepend=False, append=False))
    if not len(turns):
        return np.zeros(0, int), values[:0]
    pieces = []
    for begin, end in zip(turns[::2], turns[1::2]):
        pieces += [begin + choose(time[begin:end], values[begin:end]), [end]]
    some = np.concatenate(pieces[:-1] if turns[-1] == len(time) else pieces)
    if track.written is not None:
        other = np.flatnonzero(np.diff(np.nan_to_num(track.written, nan=-1.0)) != 0)
        other = np.concatenate([other, other + 1])
        some = np.union1d(some, other[(other >= turns[0])])
    rows = values[some]
    rows[~good[some]] = np.nan
    return some, rows


def _with_ages(thin: Any, track: Track, some: Any) -> Any:
    """The samples of a track, with its ages."""
    thin.written = None if track.written is None else track.written[some]
    return thin


def within_bound(time: np.ndarray, off: Callable[[np.ndarray], np.ndarray], bound: float) -> np.ndarray:
    """The indices of samples between which an interpolation is within the bound of all samples. off(indices): the
    distance of each sample from it. Spans beyond the bound are halved, until none is."""
    import numpy as np

    last = len(time) - 1
    some = np.unique([0, last])[:len(time)]
    while len(some) > 1:
        worst = np.maximum.reduceat(off(some), some[:-1])
        gap = np.diff(some)
        bad = ~(worst <= bound) & (gap > 1)
        if not bad.any():
            break
        some = np.sort(np.concatenate([some, some[:-1][bad] + gap[bad] // 2]))
    return some


def _extremes(values: np.ndarray, spans: int) -> np.ndarray:
    """The indices of the smallest and the largest of each column in each of some spans."""
    import numpy as np

    extremes = [np.array([0, len(values) - 1])]
    for part in np.array_split(np.arange(len(values)), spans):
        extremes += [part[values[part].argmin(axis=0)], part[values[part].argmax(axis=0)]]
    return np.unique(np.concatenate(extremes))


def _span(time: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(index of the sample before, share of the way to the next, length of the span), shaped to multiply rows."""
    import numpy as np

    if len(time) == 1:
        return np.zeros(len(t), int), np.zeros((len(t), 1)), np.ones((len(t), 1))
    i = np.clip(np.searchsorted(time, t, side="right") - 1, 0, len(time) - 2)
    h = time[i + 1] - time[i]
    return i, np.clip((t - time[i]) / h, 0, 1)[:, None], h[:, None]


def _after(values: np.ndarray, i: np.ndarray) -> np.ndarray:
    """The sample after each of i; sample i itself where the next one is NaN."""
    import numpy as np

    after = values[(i + 1).clip(max=len(values) - 1)]
    return np.where(np.isnan(after), values[i], after)


def _hermite(time: np.ndarray, r: np.ndarray, v: np.ndarray, t: np.ndarray) -> np.ndarray:
    i, x, h = _span(time, t)
    j = (i + 1).clip(max=len(time) - 1)
    return ((1 + 2 * x) * (1 - x)**2 * r[i] + x**2 * (3 - 2 * x) * r[j]
            + h * x * (1 - x) * ((1 - x) * v[i] - x * v[j]))


def _linear(time: np.ndarray, values: np.ndarray, t: np.ndarray) -> np.ndarray:
    i, x, _ = _span(time, t)
    return (1 - x) * values[i] + x * _after(values, i)


def _slerp(time: np.ndarray, q: np.ndarray, t: np.ndarray) -> np.ndarray:
    import numpy as np

    i, x, _ = _span(time, t)
    a, b = q[i], _after(q, i)
    dot = (a * b).sum(axis=1, keepdims=True)
    b, dot = np.where(dot < 0, -b, b), np.abs(dot)
    angle = np.arctan2(_norm(b - dot * a)[:, None], dot)
    sine = np.where(angle > 1e-9, np.sin(angle), 1)
    near = angle <= 1e-9
    between = (np.where(near, 1 - x, np.sin((1 - x) * angle) / sine) * a
               + np.where(near, x, np.sin(x * angle) / sine) * b)
    return between / _norm(between)[:, None]


def _norm(rows: np.ndarray) -> np.ndarray:
    import numpy as np

    return np.sqrt((rows * rows).sum(axis=1))
