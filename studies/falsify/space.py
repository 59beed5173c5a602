# SPDX-License-Identifier: Apache-2.0
"""The draws of a campaign as the unit cube: a point of the cube gives each dispersed number by its quantile function,
so that points with equal probability in the cube are draws of the campaign.

The evolutionary search goes through a box: that of the same numbers, with normal distributions cut at SIGMAS and at
equal distances, so that their tails are as near as their middle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from fledge.errors import SetupError
from fledge.montecarlo.dispersions import Marginal

Array = NDArray[np.float64]

SIGMAS = 4.0        # a search goes so many standard deviations from the mean of a normal distribution
WHOLE = 20.0        # fewer whole numbers than this are choices
_BELOW_ONE = 1 - 2.0**-53


class Axis:
    """A number, or the three of an attitude, as coordinates of the cube. names: the paths of the numbers; n: how many
    coordinates there are, as many as numbers"""

    def __init__(self, names: Sequence[str], marginal: Marginal) -> None:
        self.names, self.n, self.of = list(names), len(names), marginal
        m, half = marginal, 0.5 * marginal.whole * (marginal.scale != "relative")
        self._steps = half > 0
        if m.kind == "normal":
            # Whole numbers are rounded, and then cut.
            self.low = np.ceil(m.low) - half if self._steps else m.low
            self.high = np.floor(m.high) + half if self._steps else m.high
            self._ends = [max(self.low, m.a - SIGMAS * m.b), min(self.high, m.a + SIGMAS * m.b)]
            if self._ends[0] >= self._ends[1]:      # cut beyond SIGMAS, or no width at all
                self._ends = [max(self.low, m.a - 8 * m.b), min(self.high, m.a + 8 * m.b)]

    @property
    def choices(self) -> int:
        """Of how many values it takes one; 0: of an interval, or of as many whole numbers that it is as good as one."""
        if self.of.kind == "choice":
            return len(self.of.choices)
        if self.of.kind == "uniform" and self._steps and self.of.b - self.of.a < WHOLE:
            return int(np.floor(self.of.b) - np.ceil(self.of.a)) + 1
        return 0

    def values(self, u: Array) -> Array:
        """(runs, n) numbers in SI, of (runs, n) coordinates from 0 to 1."""
        m, u = self.of, np.clip(u, 0.0, _BELOW_ONE)
        if m.kind == "attitude":
            return _attitudes(u)
        if m.kind == "choice":
            x = np.array(m.choices)[(u * len(m.choices)).astype(int)]
        elif m.kind == "uniform" and self._steps:
            low = np.ceil(m.a)
            x = np.floor(low + (np.floor(m.b) - low + 1) * u)
        elif m.kind == "uniform":
            x = m.a + (m.b - m.a) * u
        else:
            x = np.clip(m.a + m.b * self._deviation(u), self.low, self.high)
            x = np.clip(np.round(x), m.low, m.high) if self._steps else x
        return m.nominal * x if m.scale == "relative" else m.nominal + x if m.scale == "about" else x

    def _deviation(self, u: Array) -> Array:
        """[standard deviations] of a cut normal distribution. The upper half is computed from the upper
        tail, the lower half from the lower one: there is no 1 - 1e-17."""
        m = self.of
        if m.b == 0:
            return np.zeros_like(u)
        low, high = (self.low - m.a) / m.b, (self.high - m.a) / m.b
        if low > 0:
            return -ndtri(ndtr(-high) + (ndtr(-low) - ndtr(-high)) * (1 - u))
        return ndtri(ndtr(low) + (ndtr(high) - ndtr(low)) * u)

    def from_box(self, c: Array) -> Array:
        """Coordinates of the cube, of those of the box."""
        m = self.of
        if m.kind != "normal" or m.b == 0:
            return c
        begin, end = self._ends
        low, high, x = ((number - m.a) / m.b for number in (self.low, self.high, begin + (end - begin) * c))
        if low > 0:
            return 1 - (ndtr(-x) - ndtr(-high)) / (ndtr(-low) - ndtr(-high))
        return (ndtr(x) - ndtr(low)) / (ndtr(high) - ndtr(low))

    def to_box(self, u: Array) -> Array:
        """The reverse; a point outside the box comes to its side."""
        m = self.of
        if m.kind != "normal" or m.b == 0:
            return u
        begin, end = self._ends
        return np.clip((m.a + m.b * self._deviation(np.clip(u, 1e-300, _BELOW_ONE)) - begin) / (end - begin), 0, 1)

    def described(self, text: Callable[[str, float], str]) -> str:
        """Its values in words. text: formats a number of a path"""
        m = self.of
        if m.kind == "attitude":
            return f"{self.names[0].rpartition('[')[0]}: any attitude"

        def shown(x: float) -> str:
            return f"{x:g}" if m.scale == "relative" else text(self.names[0], x)

        before = text(self.names[0], m.nominal) + {"about": " + ", "relative": " * "}[m.scale] if m.scale else ""
        if m.kind == "choice":
            return f"{self.names[0]}: {before}one of {', '.join(map(shown, m.choices))}"
        if m.kind == "uniform":
            return f"{self.names[0]}: {before}{shown(m.a)} to {shown(m.b)}"
        return (f"{self.names[0]}: {before}{shown(self._ends[0])} to {shown(self._ends[1])}, normal with "
                f"{shown(m.a)} +- {shown(m.b)}")


class Space:
    """All dispersed numbers of a campaign. columns: their paths; n: the dimension of the cube; nominal: the numbers
    of the mission's own files. Raises SetupError if nothing differs."""

    def __init__(self, marginals: Mapping[str, Marginal]) -> None:
        self.columns = list(marginals)
        self.axes: list[Axis] = []
        for name, marginal in marginals.items():
            if marginal.kind == "attitude" and self.axes and self.axes[-1].of.kind == "attitude" and \
                    self.axes[-1].n < 3:
                self.axes[-1] = Axis([*self.axes[-1].names, name], marginal)
            else:
                self.axes.append(Axis([name], marginal))
        self.n = len(self.columns)
        self.nominal: Array = np.array([marginal.nominal for marginal in marginals.values()], float)
        if not self.n or not np.ptp(self.values(np.linspace(0, 1, 4)[:, None].repeat(self.n, axis=1)), axis=0).any():
            raise SetupError("there is nothing to search: " + (
                f"each of {', '.join(self.columns)} has one value alone" if self.columns else "nothing is dispersed"))

    def values(self, u: Array) -> Array:
        """(runs, n) numbers in SI, of points of the cube."""
        return np.hstack([axis.values(part) for axis, part in self._parts(u)])

    def from_box(self, c: Array) -> Array:
        """Points of the cube, of points of the box."""
        return np.hstack([axis.from_box(part) for axis, part in self._parts(c)])

    def to_box(self, u: Array) -> Array:
        return np.hstack([axis.to_box(part) for axis, part in self._parts(u)])

    @property
    def choices(self) -> list[int]:
        """Of each coordinate: of how many values it takes one; 0: of an interval."""
        return [axis.choices for axis in self.axes for _ in axis.names]

    def _parts(self, u: Array) -> list[tuple[Axis, Array]]:
        k = np.cumsum([0, *(axis.n for axis in self.axes)])
        return [(axis, u[:, i:i + axis.n]) for axis, i in zip(self.axes, k)]

    def described(self, text: Callable[[str, float], str]) -> list[str]:
        """The values of each number in words; elements of an array with the same values are one line. text: formats a
        number of a path"""
        lines = []
        for axis in self.axes:
            name, _, words = axis.described(text).partition(": ")
            alike = [other for other in self.axes if other.of.declared == axis.of.declared]
            if len(alike) > 1 and len({other.described(text).partition(": ")[2] for other in alike}) == 1:
                name = f"{axis.of.declared}, each"
            lines.append(f"{name}: {words}")
        return list(dict.fromkeys(lines))


def _attitudes(u: Array) -> Array:
    """MRP of unit quaternions that are uniform (Shoemake 1992), |sigma| <= 1."""
    v, w = 2 * np.pi * u[:, 1], 2 * np.pi * u[:, 2]
    a, b = np.sqrt(1 - u[:, 0]), np.sqrt(u[:, 0])
    q0 = b * np.cos(w)
    scale = np.where(q0 < 0, -1.0, 1.0) / (1 + abs(q0))
    return scale[:, None] * np.stack([a * np.sin(v), a * np.cos(v), b * np.sin(w)], axis=1)
