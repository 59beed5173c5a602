# SPDX-License-Identifier: Apache-2.0
"""What SunPyramids finds of every fault of one sun sensor, at random Sun directions, and what geometry shows of it.

    ./fledge bench sun_faults

The expected geometry comes from another method than the module's: a search of all directions. A fault is shown if the
readings fit no direction, and no fault of the other converter explains them: of one of its sensors, or of all four.
"""
from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fledge import flight as fsw
from fledge.columns import columns
from fledge.units import A, mA

from bench.rows import options

Array = NDArray[np.float64]

AXES = np.array(fsw.SUN_PYRAMIDS) / np.linalg.norm(fsw.SUN_PYRAMIDS, axis=1)[:, None]
FULL, SCALES, OFFSETS = 5e-3, np.repeat([2e-6, 2.5e-6], 4), np.repeat([0, -1e-5], 4)     # [A] as in flatsat
NOISE, DARK, DIFFER, PERSISTENCE = 2e-4, 0.02, 0.005, 10
KINDS = ("high", "low", "babble", "bias 0.05")
BEGIN, UPDATES = 15, 60     # a fault begins at this update of so many, at 2 Hz


def direction(random: np.random.Generator) -> Array:
    s: Array = random.normal(size=3)
    return s / np.linalg.norm(s)


def faulty(cosines: Array, sensor: int, kind: str, random: np.random.Generator) -> Array:
    """The eight cosines with a fault of one sensor; the converter's range is that of 12 bits."""
    ends = OFFSETS[sensor] / FULL, (OFFSETS[sensor] + 4095 * SCALES[sensor]) / FULL
    reads = {"high": ends[1], "low": ends[0], "babble": random.uniform(*ends), "bias 0.05": cosines[sensor] + 0.05}
    return np.where(np.arange(8) == sensor, reads[kind], cosines)


class Geometry:
    """A search of the unit sphere for the direction whose cosines are nearest to readings."""

    def __init__(self, points: int = 4000) -> None:
        k = np.arange(points) + 0.5
        z, turn = 1 - 2 * k / points, np.pi * (1 + 5**0.5) * k
        self._sphere = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)
        self._cosines = np.maximum(0, self._sphere @ AXES.T)
        step = np.array([[x, y, w] for x in (-1, 0, 1) for y in (-1, 0, 1) for w in (-1, 0, 1)])
        self._steps = 1.5 * np.sqrt(4 * np.pi / points) * step
        of_a = np.arange(8) < 4
        self._masks = np.array([np.arange(8) != i for i in range(8)] + [~of_a, of_a, of_a | True], float)

    def misfits(self, reads: Array) -> Array:
        """shape (11,): the least root of the sum of squares of the readings without sensor 0 to 7, without A, without
        B, and of all; with all of these dark, 0."""
        reads = np.maximum(0, reads)
        found = ((reads - self._cosines)**2 @ self._masks.T).argsort(axis=0)[:10].T
        s, steps = self._sphere[found], self._steps
        for _ in range(22):
            tried = s[:, :, None] + steps
            tried /= np.linalg.norm(tried, axis=-1, keepdims=True)
            squares = ((reads - np.maximum(0, tried @ AXES.T))**2 * self._masks[:, None, None]).sum(axis=-1)
            best = squares.argmin(axis=2)[..., None, None]
            s, steps = np.take_along_axis(tried, best, axis=2)[:, :, 0], 0.65 * steps
        squares = squares.min(axis=(1, 2))
        dark = ((reads < DARK) | (self._masks == 0)).all(axis=1)
        return np.where(dark, 0, np.sqrt(squares))

    def shows(self, reads: Array, converter: int) -> bool:
        """Whether readings show a fault of a converter (0: A, 1: B), beyond twice what counts as a contradiction."""
        misfit = self.misfits(reads)
        own = slice(4 - 4 * converter, 8 - 4 * converter)       # the sensors of the other converter
        whole = misfit[9 - converter] < 2 * DIFFER and (misfit[8 + converter] > DIFFER / 2 or
                                                        bool((reads[own] < DARK).all()))
        return bool(misfit[10] > 2 * DIFFER and misfit[own].min() > 2 * DIFFER and not whole)


class Flown(NamedTuple):
    """What became of one fault."""

    found: float    # [s] after it began; nan: it was not found
    wrong: bool     # the sound converter was blamed
    exact: bool     # its sensor alone is out of use
    error: float    # [rad] the largest of the direction


def fly(sun: Array, sensor: int, kind: str, random: np.random.Generator) -> Flown:
    """Let the module see a fault of one sensor, with noise of half a count."""
    m = fsw.SunPyramids(axes_B=fsw.SUN_PYRAMIDS, current=[5] * 8 * mA, scale=SCALES[[0, 4]] * A,
                        offset=OFFSETS[[0, 4]] * A, dark=DARK, differ=DIFFER, persistence=PERSISTENCE)
    m.a.head.quality = m.b.head.quality = "GOOD"
    m.reset()
    cosines, found, error = np.maximum(0, AXES @ sun), np.nan, 0.0
    for k in range(UPDATES):
        reads = cosines + random.normal(0, NOISE, 8)
        reads = faulty(reads, sensor, kind, random) if k >= BEGIN else reads
        counts = np.clip(np.round((FULL * reads - OFFSETS) / SCALES), 0, 4095).astype(int).tolist()
        m.a.counts, m.b.counts = counts[:4] + [0] * 4, counts[4:] + [0] * 4
        m.update(t=0.5 * k, dt=0.5)
        error = max(error, float(np.linalg.norm(np.array(m.heading.s_B) - sun)))
        if m.status.faulty and np.isnan(found):
            found = 0.5 * (k - BEGIN)
    return Flown(found, bool(m.status.faulty & ~(1 << sensor // 4)), m.status.unused == 1 << sensor, error)


def study(directions: int, seed: int = 1) -> dict[str, dict[str, float]]:
    """Every fault of every sensor at so many directions. Of each kind: faults, those that geometry shows, those of
    them that were found, the others that were found, the time until half and 95 % of the found ones were [s], those
    whose sensor alone is out of use, wrongly blamed ones, and the largest error of the direction [rad]."""
    random, geometry = np.random.default_rng(seed), Geometry()
    suns = [direction(random) for _ in range(directions)]
    table = {}
    for kind in KINDS:
        shown, flown = [], []
        for sun in suns:
            for sensor in range(8):
                draws = [faulty(np.maximum(0, AXES @ sun), sensor, kind, random)
                         for _ in range(3 if kind == "babble" else 1)]
                shown.append(sum(geometry.shows(draw, sensor // 4) for draw in draws) > len(draws) / 2)
                flown.append(fly(sun, sensor, kind, random))
        found, of = np.array([flight.found for flight in flown]), np.array(shown)
        seen = np.isfinite(found)
        late = np.quantile(found[seen], [0.5, 0.95]) if seen.any() else [np.nan] * 2
        table[kind] = {"faults": len(flown), "shown": int(of.sum()), "found of these": int((seen & of).sum()),
                       "found of others": int((seen & ~of).sum()), "half [s]": late[0], "95 % [s]": late[1],
                       "sensor alone": sum(flight.exact for flight in flown),
                       "wrongly": sum(flight.wrong for flight in flown),
                       "error [rad]": max(flight.error for flight in flown)}
    return table


def show(table: dict[str, dict[str, float]]) -> list[str]:
    """The lines of a table of a study."""
    head = ["fault", *next(iter(table.values()))]
    return list(columns([head, *([kind, *(f"{x:.3g}" if isinstance(x, float) else str(x) for x in row.values())]
                                 for kind, row in table.items())], set(range(1, len(head)))))


def main(arguments: list[str]) -> int:
    chosen = options("sun_faults", arguments, runs=500)
    table = study(chosen.runs)
    print(*show(table), sep="\n")
    if chosen.json:
        Path(chosen.json).write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    return int(any(row["wrongly"] for row in table.values()))
