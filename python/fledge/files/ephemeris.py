# SPDX-License-Identifier: Apache-2.0
"""Ephemerides of orbits (OEM) and attitudes (AEM) as arrays, between whose lines they are interpolated.

    segment = files.read("spacecraft.oem").segments[0]
    r, v = segment.at(segment.times[0] + 30 * 10**9)
    segment.to_pandas()
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fledge.attitude import quaternion_rate
from fledge.errors import SetupError, listed
from fledge.files.sections import Section, Segment
from fledge.files.tables import sequence

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

R, V, A = (("X", "Y", "Z"), ("X_DOT", "Y_DOT", "Z_DOT"), ("X_DDOT", "Y_DDOT", "Z_DDOT"))
RATES = ("ANGVEL_X", "ANGVEL_Y", "ANGVEL_Z")
METHODS = ("LINEAR", "LAGRANGE", "HERMITE")
DEGREE = 7      # where the message does not say, and has lines enough


class Tabulated(Segment):
    """A segment whose second section is a table over time."""

    @property
    def table(self) -> Section:
        """The section with the columns over time."""
        return self.sections[1]

    @property
    def times(self) -> np.ndarray:
        """[ns] (n,) of the lines, as values.Clock has them."""
        return self.table.columns["EPOCH"]

    @property
    def span(self) -> tuple[int, int]:
        """[ns] From when to when the segment may be used: by USEABLE_..., else all of it that has lines."""
        first = max(int(self.times[0]), self.meta.get("USEABLE_START_TIME", self.times[0]))
        last = min(int(self.times[-1]), self.meta.get("USEABLE_STOP_TIME", self.times[-1]))
        return int(first), int(last)

    def check(self) -> None:
        """Raise SetupError for a span or an interpolation that cannot be."""
        for first, last in (("START_TIME", "STOP_TIME"), ("USEABLE_START_TIME", "USEABLE_STOP_TIME"),
                            ("START_TIME", "USEABLE_START_TIME"), ("USEABLE_STOP_TIME", "STOP_TIME")):
            if first in self.meta.values and last in self.meta.values and self.meta[first] > self.meta[last]:
                self.meta.refuse(f"{first}: expected before {last}; found after it")

    def _method(self, key: str) -> tuple[str, int]:
        method = str(self.meta.get(key, "LAGRANGE")).upper()
        if method not in METHODS:
            self.meta.refuse(f"{key}: expected {', '.join(METHODS)}; found {method}")
        degree = int(self.meta.get("INTERPOLATION_DEGREE", min(DEGREE, len(self.times) - 1)))
        if degree < 1 and "INTERPOLATION_DEGREE" in self.meta.values:
            self.meta.refuse(f"INTERPOLATION_DEGREE: expected 1 or more; found {degree}")
        return method, 1 if method == "LINEAR" else degree

    def _at(self, t: ArrayLike) -> np.ndarray:
        """Times [ns] (m,) that lie within the span."""
        found = np.atleast_1d(np.asarray(t))
        if found.dtype.kind not in "iu":
            raise SetupError(f"{type(self).__name__}.at: expected times [ns] as whole numbers; found {found.dtype}: "
                             "segment.clock.ns(\"2020-10-13T04:52:48\") gives that of a date")
        first, last = self.span
        out = found[(found < first) | (found > last)]
        if len(out):
            text = self.clock.text
            self.meta.refuse(f"the segment may be used from {text(first)} to {text(last)} {self.clock.scale}; found "
                             f"{text(int(out[0]))}: choose the segment of that time")
        return found

    def to_pandas(self) -> Any:
        """A frame with a row for each line: its time [ns], and the columns of the table in SI and radians."""
        import pandas

        return pandas.DataFrame(self.table.columns)

    @classmethod
    def _of_columns(cls, name: str, meta: dict[str, Any], columns: dict[str, Any]) -> Any:
        arrays = {key: np.asarray(values) for key, values in columns.items()}
        times = arrays.get("EPOCH", np.zeros(0))
        if times.dtype.kind not in "iu" or not times.size or np.any(np.diff(times) <= 0) or any(
                x.shape != times.shape or x.dtype.kind not in "iuf" for x in arrays.values()):
            raise SetupError(f"{cls.__name__}: expected EPOCH [ns], whole numbers that increase, and columns of "
                             "numbers, as many as it has")
        arrays = {key: x.astype(np.int64 if key == "EPOCH" else float) for key, x in arrays.items()}
        span = {"START_TIME": int(times[0]), "STOP_TIME": int(times[-1])}
        segment = cls([Section("META", {**span, **meta}), Section(name, columns=arrays)])
        segment.check()
        return segment


class OemSegment(Tabulated):
    """Positions and velocities over time, about meta["CENTER_NAME"] in the axes meta["REF_FRAME"]."""

    @classmethod
    def of(cls, meta: dict[str, Any], times: ArrayLike, r: ArrayLike, v: ArrayLike) -> OemSegment:
        """A segment of times [ns] (n,), positions [m] (n, 3) and velocities [m/s] (n, 3). meta: its keywords, of which
        START_TIME and STOP_TIME follow. Raises SetupError unless the times are whole and increase, and shapes agree."""
        return cls._of_columns("STATE", meta, {"EPOCH": times, **dict(zip(R, np.asarray(r, float).T)),
                                               **dict(zip(V, np.asarray(v, float).T))})

    @classmethod
    def from_pandas(cls, frame: Any, meta: dict[str, Any]) -> OemSegment:
        """A segment of a frame as to_pandas() gives it. meta, and what is raised: as of of()."""
        return cls._of_columns("STATE", meta, {key: frame[key].to_numpy() for key in frame.columns})

    def _stack(self, names: tuple[str, ...]) -> np.ndarray:
        missing = [name for name in names if name not in self.table.columns]
        if missing:
            self.table.refuse(f"expected the columns {', '.join(names)}; there is no {listed(missing)}")
        return np.stack([self.table.columns[name] for name in names], axis=-1)

    @property
    def r(self) -> np.ndarray:
        """[m] (n, 3)"""
        return self._stack(R)

    @property
    def v(self) -> np.ndarray:
        """[m/s] (n, 3); of a table of positions alone the rates of at()"""
        return self._stack(V) if V[0] in self.table.columns else self._curve(self.times)[1]

    @property
    def a(self) -> np.ndarray | None:
        """[m/s^2] (n, 3), NaN where a line has none; None without"""
        return self._stack(A) if A[0] in self.table.columns else None

    @property
    def covariances(self) -> list[Section]:
        """Sections COVARIANCE: each has EPOCH, COV_REF_FRAME and covariance()."""
        return self.all("COVARIANCE")

    @property
    def interpolation(self) -> tuple[str, int]:
        """The method between the lines, of METHODS, and the degree of its polynomial."""
        return self._method("INTERPOLATION")

    def at(self, t: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m] (m, 3) and velocities [m/s] (m, 3) at times [ns] (m,), by INTERPOLATION and its degree.

        LAGRANGE interpolates positions and velocities each for itself; HERMITE takes the velocities as rates of the
        positions, and gives the rate of what it finds, as LAGRANGE does of positions alone. Without INTERPOLATION:
        LAGRANGE of degree 7, or less where there are fewer lines. Raises SetupError outside the useable span, and where
        the degree needs more lines.
        """
        found = self._at(t)
        r, rates = self._curve(found)
        method, degree = self.interpolation
        if method == "HERMITE" or V[0] not in self.table.columns:
            return r, rates
        return r, interpolate(self.times, self.v, found, degree, None, self.meta)[0]

    def curve(self, t: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """The positions [m] (m, 3) of at() and their rates [m/s] (m, 3), which are not quite the velocities that
        LAGRANGE interpolates. Raises SetupError as at() does."""
        return self._curve(self._at(t))

    def _curve(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        method, degree = self.interpolation
        rates = self._stack(V) if method == "HERMITE" and V[0] in self.table.columns else None
        return interpolate(self.times, self.r, t, degree, rates, self.meta)


class AemSegment(Tabulated):
    """Attitudes over time of meta["REF_FRAME_B"] relative to meta["REF_FRAME_A"]."""

    @classmethod
    def of(cls, meta: dict[str, Any], times: ArrayLike, beta_BA: ArrayLike,
           omega_BA_B: ArrayLike | None = None) -> AemSegment:
        """A segment of times [ns] (n,) and quaternions of B relative to A, scalar first (n, 4). meta: its keywords.

        omega_BA_B: [rad/s] (n, 3) the rate of B relative to A in axes of B, which AEMs have since version 2.0.
        Raises SetupError unless the times are whole and increase, and shapes agree.
        """
        kind, columns = "QUATERNION", {"EPOCH": times,
                                       **dict(zip(("QC", "Q1", "Q2", "Q3"), np.asarray(beta_BA, float).T))}
        if omega_BA_B is not None:
            kind, meta = "QUATERNION/ANGVEL", {"ANGVEL_FRAME": meta.get("REF_FRAME_B", ""), **meta}
            columns |= dict(zip(RATES, np.asarray(omega_BA_B, float).T))
        return cls._of_columns("DATA", {"ATTITUDE_TYPE": kind, **meta}, columns)

    @classmethod
    def from_pandas(cls, frame: Any, meta: dict[str, Any]) -> AemSegment:
        """A segment of a frame as to_pandas() gives it. meta, and what is raised: as of of()."""
        return cls._of_columns("DATA", meta, {key: frame[key].to_numpy() for key in frame.columns})

    @property
    def beta_BA(self) -> np.ndarray:
        """(n, 4) Quaternions of B relative to A, scalar first, each on the side of the one before it.

        Of spins B is the body whose third axis spins. Raises SetupError for nutating spins, of which lines say only the
        axis and its motion.
        """
        columns = self.table.columns
        kind = str(self.meta["ATTITUDE_TYPE"]).upper()
        if "QC" in columns:
            beta = np.stack([columns[name] for name in ("QC", "Q1", "Q2", "Q3")], axis=-1)
        elif "ANGLE_1" in columns:
            beta = turns(sequence(self.meta), [columns[f"ANGLE_{i}"] for i in (1, 2, 3)])
        elif kind == "SPIN":
            beta = turns("313", [columns["SPIN_ALPHA"] + np.pi / 2, np.pi / 2 - columns["SPIN_DELTA"],
                                 columns["SPIN_ANGLE"]])
        else:
            self.meta.refuse("ATTITUDE_TYPE: expected quaternions, Euler angles or SPIN; found "
                             f"{kind}: use the columns")
        norm = np.linalg.norm(beta, axis=-1, keepdims=True)
        if np.any(np.abs(norm - 1) > 0.1):
            bad = int(np.flatnonzero(np.abs(norm[:, 0] - 1) > 0.1)[0])
            self.table.refuse(f"line {bad + 1} of the table: expected a unit quaternion; found one of length "
                              f"{norm[bad, 0]:.4g}")
        beta = beta / norm
        if str(self.meta.get("ATTITUDE_DIR", "A2B")).upper() == "B2A":
            beta = beta * [1, -1, -1, -1]
        sides = np.where(np.sum(beta[1:] * beta[:-1], axis=-1) < 0, -1.0, 1.0)
        return beta * np.concatenate([[1.0], np.cumprod(sides)])[:, None]

    def at(self, t: ArrayLike) -> np.ndarray:
        """Quaternions of B relative to A, scalar first (m, 4), at times [ns] (m,), by INTERPOLATION_METHOD.

        LINEAR turns about a fixed axis from line to line. LAGRANGE and HERMITE interpolate components, HERMITE with the
        derivatives that the message has, and scale them to length 1. A message that names none is LINEAR, or with
        derivatives HERMITE of degree 3. Raises SetupError outside the useable span.
        """
        return self.curve(t)[0]

    @property
    def interpolation(self) -> tuple[str, int]:
        """The method between the lines, of METHODS, and the degree of its polynomial."""
        if "INTERPOLATION_METHOD" in self.meta.values:
            return self._method("INTERPOLATION_METHOD")
        return ("LINEAR", 1) if self.rates(self.beta_BA) is None else ("HERMITE", min(3, 2 * len(self.times) - 1))

    def curve(self, t: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """The quaternions of at(), and their rates [1/s] (m, 4). Raises SetupError as at() does."""
        when, beta, (method, degree) = self._at(t), self.beta_BA, self.interpolation
        if method == "LINEAR":
            return slerp(self.times, beta, when)
        return _unit(*interpolate(self.times, beta, when, degree, self.rates(beta) if method == "HERMITE" else None,
                                  self.meta))

    def rates(self, beta: np.ndarray) -> np.ndarray | None:
        """Derivatives [1/s] (n, 4) of the quaternions beta_BA; None where the table has neither them nor rates in B."""
        columns = self.table.columns
        if "ANGVEL_X" in columns and self.meta.get("ANGVEL_FRAME") == self.meta["REF_FRAME_B"]:
            return quaternion_rate(beta, np.stack([columns[name] for name in RATES], axis=-1))
        if "QC_DOT" not in columns:
            return None
        given = np.stack([columns[name] for name in ("QC", "Q1", "Q2", "Q3")], axis=-1)
        rates = np.stack([columns[name] for name in ("QC_DOT", "Q1_DOT", "Q2_DOT", "Q3_DOT")], axis=-1)
        if str(self.meta.get("ATTITUDE_DIR", "A2B")).upper() == "B2A":
            given, rates = given * [1, -1, -1, -1], rates * [1, -1, -1, -1]
        return rates * np.sign(np.sum(given * beta, axis=-1, keepdims=True))


def turns(axes: str, angles: list[np.ndarray]) -> np.ndarray:
    """(n, 4) The quaternions, scalar first, of turns by angles [rad] (n,) about the axes "321", one after the other."""
    beta = np.zeros((len(angles[0]), 4))
    beta[:, 0] = 1
    for axis, angle in zip(axes, angles):
        c, s, i = np.cos(angle / 2), np.sin(angle / 2), int(axis)
        j, k = i % 3 + 1, (i + 1) % 3 + 1
        turned = np.empty_like(beta)
        turned[:, 0], turned[:, i] = c * beta[:, 0] - s * beta[:, i], c * beta[:, i] + s * beta[:, 0]
        turned[:, j], turned[:, k] = c * beta[:, j] + s * beta[:, k], c * beta[:, k] - s * beta[:, j]
        beta = turned
    return beta


def slerp(times: np.ndarray, beta: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 4) Quaternions at times [ns] (m,) between those at times (n,), which turn about a fixed axis, and their rates
    [1/s]."""
    if len(times) == 1:
        return np.repeat(beta, len(t), axis=0), np.zeros((len(t), 4))
    i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    span = (times[i + 1] - times[i])[:, None]
    u = (t - times[i])[:, None] / span
    angle = np.arccos(np.clip(np.sum(beta[i] * beta[i + 1], axis=-1, keepdims=True), -1, 1))
    small = angle < 1e-6
    safe = np.where(small, 1.0, np.sin(angle))
    found = np.where(small, (1 - u) * beta[i] + u * beta[i + 1],
                     (np.sin((1 - u) * angle) * beta[i] + np.sin(u * angle) * beta[i + 1]) / safe)
    rates = np.where(small, beta[i + 1] - beta[i],
                     angle * (np.cos(u * angle) * beta[i + 1] - np.cos((1 - u) * angle) * beta[i]) / safe)
    return _unit(found, rates / span * 1e9)


def _unit(beta: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scaled to length 1, with the rates that are left."""
    norm = np.linalg.norm(beta, axis=-1, keepdims=True)
    found = beta / norm
    return found, (rates - np.sum(found * rates, axis=-1, keepdims=True) * found) / norm


def interpolate(times: np.ndarray, y: np.ndarray, t: np.ndarray, degree: int, rates: np.ndarray | None,
                where: Section | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The polynomial of a degree through the lines nearest each time, and its rate [1/s].

    times: [ns] (n,); y: (n, k); t: [ns] (m,); rates: (n, k), of y, which the polynomial meets, too. Divided differences
    of Newton, with each line twice where it has a rate. Raises SetupError where there are too few lines; if `where` is
    None, the degree is lower.
    """
    twice = rates is not None
    lines = (degree + 2) // 2 if twice else degree + 1
    if where is None:
        lines = min(lines, len(times))
    elif len(times) < lines:
        most = len(times) * (2 if twice else 1) - 1
        where.refuse(f"INTERPOLATION_DEGREE: expected up to {most}, which {len(times)} lines allow; found {degree}")
    middle = np.searchsorted(times, t, side="right") - (lines + 1) // 2
    if lines % 2:       # the line nearest in the middle
        i = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
        nearest = np.where(t - times[i - 1] <= times[i] - t, i - 1, i) if len(times) > 1 else np.zeros(len(t), int)
        middle = nearest - lines // 2
    rows = np.clip(middle, 0, len(times) - lines)[:, None] + np.arange(lines)
    rows = np.repeat(rows, 2, axis=1) if twice else rows
    x = (times[rows] - t[:, None]) / 1e9           # of the lines past each time, which is 0
    table = y[rows].astype(float)
    newton = [table[:, 0]]
    for order in range(1, rows.shape[1]):
        step = (x[:, order:] - x[:, :-order])[..., None]
        same = step == 0
        table = np.where(same, rates[rows[:, order:]] if rates is not None else 0.0,
                         (table[:, 1:] - table[:, :-1]) / np.where(same, 1.0, step))
        newton.append(table[:, 0])
    value, rate = newton[-1], np.zeros_like(newton[-1])
    for order in range(rows.shape[1] - 2, -1, -1):
        at = -x[:, order, None]
        rate = rate * at + value
        value = value * at + newton[order]
    return value, rate
