# SPDX-License-Identifier: Apache-2.0
"""SPICE's kernels of positions, SPK (.bsp): written of states over time, and read as a Sky reads them.

    spk.write("craft.bsp", target=-999, center="EARTH", times=times, r=r, v=v)
    r, v = spk.read("craft.bsp")[0].at(times)

Source: NAIF, "SPK Required Reading", types 9 and 13.
"""
from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from fledge.errors import SetupError
from fledge.files import daf

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

KIND = "DAF/SPK "
HIGHEST = 27                # degree that NAIF's own reader takes


@dataclass
class SpkSegment:
    """Of a kernel: a body about another, by NAIF's numbers. frame: of the file's states; type: NAIF's; begin, end: [ns]
    of TDB past J2000; times, degree: of types 9 and 13, [ns] (n,) of the states and of polynomials."""
    target: int
    center: int
    frame: str
    type: int
    begin: int
    end: int
    name: str
    sky: Any = field(repr=False)
    times: np.ndarray | None = field(default=None, repr=False)
    degree: int = 0

    def at(self, times: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s] (m, 3), in axes of J2000, at times [ns] (m,) of TDB past J2000; of the
        last segment where several have the body. Raises SetupError where the kernel does not say."""
        states = [self.sky.state(self.target, self.center, int(t)) for t in np.atleast_1d(np.asarray(times))]
        r, v = (np.array([state[i] for state in states]).reshape(-1, 3) for i in (0, 1))
        return r, v


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

    segments = daf.read(path, KIND).segments
    root = min((body for segment in segments for body in segment.integers[:2]), default=0)
    sky = _core.Sky("2000-01-01T12:00:00 TDB", root, [os.fspath(path)], None, None, None, False)
    found = []
    for segment in segments:
        target, center, frame, kind = segment.integers
        made = SpkSegment(target, center, daf.FRAMES[frame], kind, _within(segment.first, 1),
                          _within(segment.last, -1), segment.name, sky)
        if kind in (9, 13):
            last, n = (int(x) for x in segment.words[-2:])      # of a window, counted from 0; states
            made.degree = 2 * last + 1 if kind == 13 else last
            made.times = np.rint(segment.words[6 * n:7 * n] * 1e9).astype(np.int64).clip(made.begin, made.end)
        found.append(made)
    return found


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
