# SPDX-License-Identifier: Apache-2.0
"""SPICE's kernels of positions, SPK (.bsp): written of states over time, and read as a Sky reads them.

    spk.write("craft.bsp", target=-999, center="EARTH", times=times, r=r, v=v)
    r, v = spk.read("craft.bsp")[0].at(times)

Source: NAIF, "SPK Required Reading", types 9 and 13.
"""
from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fledge.errors import SetupError
from fledge.files import daf
from fledge.files.ephemeris import interpolate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

KIND = "DAF/SPK "
HIGHEST = 27                # degree that NAIF's own reader takes
LAGRANGE = (8, 9)           # types


@dataclass
class SpkSegment:
    """Of a kernel: a body about another, by NAIF's numbers. frame: of the file's states; type: NAIF's; begin, end: [ns]
    of TDB past J2000; times, degree: of types 8, 9, 12 and 13, [ns] (n,) of the states, also of those beyond begin and
    end, and of polynomials; of others the ends, and 0."""
    target: int
    center: int
    frame: str
    type: int
    begin: int
    end: int
    name: str
    where: str = field(repr=False)
    sky: Callable[[], Any] = field(repr=False)
    times: np.ndarray = field(repr=False)
    degree: int

    def at(self, times: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s] (m, 3), in axes of J2000, at times [ns] (m,) of TDB past J2000, by this
        segment alone, whatever others of the kernel say. Raises SetupError for times that are not in it."""
        when, sky = np.atleast_1d(np.asarray(times)), self.sky()
        if len(out := when[(when < self.begin) | (when > self.end)]):
            begin, end, found = (sky.text(int(t), "TDB") for t in (self.begin, self.end, out[0]))
            raise SetupError(f"{self.where}: body {self.target} is given from {begin} to {end}; found {found}: choose "
                             "the segment of that time")
        return self._states(when)

    def curve(self, times: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """The positions [m] (m, 3) of at() and their rates [m/s] (m, 3): types 8 and 9 have velocities by polynomials
        of their own. Raises SetupError as at() does."""
        r, v = self.at(times)
        if self.type not in LAGRANGE:
            return r, v
        return r, interpolate(self.times, self._at_times[0], np.atleast_1d(times), self.degree, None)[1]

    @cached_property
    def _at_times(self) -> tuple[np.ndarray, np.ndarray]:
        return self._states(self.times)

    def _states(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sky = self.sky()
        states = np.array([sky.state(self.target, self.center, int(t))[:2] for t in times]).reshape(-1, 2, 3)
        return states[:, 0], states[:, 1]


def is_kernel(source: object) -> bool:
    """Whether it is the path of such a kernel, by its first bytes."""
    try:
        with open(os.fspath(source), "rb") as file:     # type: ignore[call-overload]
            return bool(file.read(8) == KIND.encode())
    except (OSError, TypeError, ValueError):
        return False


def read(path: str | os.PathLike[str]) -> list[SpkSegment]:
    """The segments of a kernel, of the types that a Sky reads. Raises SetupError with the file, the segment and what is
    wrong."""
    from fledge import _core

    def sky_of(file: str, segments: list[daf.Segment]) -> Any:
        root = min((body for segment in segments for body in segment.integers[:2]), default=0)
        return _core.Sky("2000-01-01T12:00:00 TDB", root, [file], None, None, None, False)

    @cache
    def sky(i: int) -> Any:
        """Of segment i alone, if there a later one has the body, too, or if it is asked for all its states."""
        own = segments[i]
        if own.integers[3] not in LAGRANGE and not any(
                other.integers[0] == own.integers[0] and other.first <= own.last and other.last >= own.first
                for other in segments[i + 1:]):
            return whole
        ends = [own.first, own.last, *_states(own)[0][[0, -1]]]
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "alone.bsp")
            daf.write(path, daf.Daf(KIND, [daf.Segment(min(ends), max(ends), own.integers, "", own.words)]))
            return sky_of(path, [own])      # which keeps the bytes

    segments = daf.read(path, KIND).segments
    whole = sky_of(os.fspath(path), segments)
    found = []
    for i, segment in enumerate(segments):
        target, center, frame, kind = segment.integers
        seconds, degree = _states(segment)
        found.append(SpkSegment(
            target, center, daf.FRAMES[frame], kind, _within(segment.first, 1), _within(segment.last, -1), segment.name,
            f"{os.fspath(path)}: segment {i + 1}, {segment.name}", partial(sky, i),
            np.rint((seconds * 1e9).clip(-2**62, 2**62)).astype(np.int64), degree))
    return found


def _states(segment: daf.Segment) -> tuple[np.ndarray, int]:
    """[s] (n,) of the states of a table, and the degree of its polynomials; of other types its ends, and 0."""
    kind, words = segment.integers[3], segment.words
    if kind not in (8, 9, 12, 13):
        return np.array([segment.first, segment.last]), 0
    last, n = (int(x) for x in words[-2:])      # of a window, counted from 0; states
    return (words[6 * n:7 * n] if kind in (9, 13) else words[-4] + words[-3] * np.arange(n),
            last if kind in LAGRANGE else 2 * last + 1)


def _within(seconds: float, side: int) -> int:
    """[ns] The first (side 1) or last (-1) int64 that as a double [s] is not beyond an end of a segment."""
    ns = round(Fraction(seconds) * 10**9) - 256 * side
    while (_seconds(ns) - seconds) * side < 0:
        ns += side
    return min(max(ns, -2**63), 2**63 - 1)


def _seconds(ns: Any) -> Any:
    """Rounded once, as Fledge's reader does."""
    return ns // 10**9 + ns % 10**9 / 1e9


def write(path: str | os.PathLike[str], *, target: int | str, center: int | str, times: ArrayLike, r: ArrayLike,
          v: ArrayLike, type: int = 13, degree: int = 11, name: str = "FLEDGE", comments: Sequence[str] = ()) -> None:
    """Write a kernel with a segment of states over time.

    target, center: bodies by NAIF's numbers or names; times: [ns] (n,) of TDB past J2000, increasing; r: [m] (n, 3);
    v: [m/s] (n, 3), in axes of J2000; type: 13, polynomials of Hermite through positions and velocities, of odd
    degree, or 9, of Lagrange through each. With fewer states than the degree needs, it is lower. name, comments: of the
    segment, and lines of the file, in ASCII. Raises SetupError for other values.
    """
    from fledge import _core

    where = os.fspath(path)
    et = _seconds(np.asarray(times, dtype=np.int64))
    states = np.concatenate([np.asarray(x, float).reshape(-1, 3) for x in (r, v)], axis=1) / 1e3 \
        if np.shape(r) == np.shape(v) else np.zeros((0, 6))
    if et.ndim != 1 or len(et) < 2 or states.shape != (len(et), 6):
        raise SetupError(f"{where}: expected times (n,), r and v (n, 3), n > 1; found {et.shape}, {np.shape(r)} and "
                         f"{np.shape(v)}")
    if not np.all(np.isfinite(states)) or np.any(np.diff(et) <= 0):
        raise SetupError(f"{where}: expected finite states, and times that increase")
    if type not in (9, 13) or not 1 <= degree <= HIGHEST or (type == 13 and degree % 2 == 0):
        raise SetupError(f"{where}: expected type 9, or 13 of odd degree, and a degree of 1 to {HIGHEST}; found type "
                         f"{type}, degree {degree}")
    bodies = [_core.body_id(body) if isinstance(body, str) else int(body) for body in (target, center)]
    window = min((degree + 1) // 2 if type == 13 else degree + 1, len(et))
    words = np.concatenate([states.ravel(), et, et[99:len(et) - 1:100], [window - 1, len(et)]])
    segment = daf.Segment(et[0], et[-1], (*bodies, 1, type), name, words)
    daf.write(path, daf.Daf(KIND, [segment], list(comments), where))
