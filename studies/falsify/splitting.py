# SPDX-License-Identifier: Apache-2.0
"""The probability that a margin is below 0, where counting would need too many runs: importance splitting, known as
subset simulation (Au and Beck 2001).

The probability is a product of shares that are not small: of the draws of the campaign, those below a first level; of
draws that are below it, those below a second one; until a level is 0. The draws below a level come from Markov chains
in the space of independent standard normal numbers, by adaptive conditional sampling (Papaioannou, Betz, Zwirglmaier
and Straub 2015): a step goes to z' = rho z + sqrt(1 - rho^2) w, and stays if that is above the level. The spread of
independent repetitions gives the interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtr
from scipy.stats import t as student

from fledge.errors import RunError
from fledge.falsify.stages import NO_MARGIN, Array, known
from fledge.falsify.space import Space

SHARE = 0.1             # of the draws of a level that are below the next one
ACCEPTED = 0.44         # of the steps of the chains
LEVELS = 15             # at most
CONFIDENCE = 0.95


@dataclass
class Probability:
    """value: the estimate; low, high: the ends of its interval; runs: flown; parts: the estimate of each repetition, 0
    where it found no run below 0 within the levels; levels: of each repetition, the margins that it went through"""
    value: float
    low: float
    high: float
    runs: int
    parts: list[float]
    levels: list[list[float]]

    @property
    def saved(self) -> float:
        """How many times more runs counting would need for the same relative error; NaN if there is none."""
        error = float(np.std(self.parts, ddof=1)) / math.sqrt(len(self.parts)) / self.value if self.value else 0.0
        return (1 - self.value) / (self.value * error**2) / self.runs if error else math.nan

    def __str__(self) -> str:
        if not self.value:
            return f"no run of {self.runs} failed; the probability is below {self.high:.2g}"
        return (f"{self.value:.3g}, between {self.low:.2g} and {self.high:.2g} ({CONFIDENCE:.0%}), by {self.runs} runs "
                f"in {len(self.parts)} repetitions" + (f"; counting would need {self.saved:,.2g} times as many"
                                                       if self.saved > 1 else ""))


def probability(margins: Callable[[Array, int], Array], space: Space, runs: int = 1000, repetitions: int = 8,
                seed: int = 0) -> Probability:
    """The probability that a draw of the campaign has a margin below 0.

    margins: (numbers, repetition) -> (runs,), as of search(); runs: of each level of each repetition; a margin that is
    not known is none below 0. Raises RunError if the margins of a repetition do not differ: there are no levels.
    """
    random = np.random.default_rng(seed)
    parts, levels, flown = [], [], 0
    for k in range(repetitions):
        def margin(z: Array) -> Array:
            return known(margins(space.values(ndtr(z)), k))

        part, through, n = _repetition(margin, space.n, runs, random)
        parts.append(part)
        levels.append(through)
        flown += n
    mean = float(np.mean(parts))
    if not mean:
        return Probability(0.0, 0.0, min(1.0, 3 * SHARE**min(map(len, levels)) / math.sqrt(repetitions)), flown, parts,
                           levels)
    # The parts are about log-normal; their mean has no bias of the first order, that of their logarithms has.
    width = math.inf
    if repetitions > 1:
        relative = np.std(parts, ddof=1) / mean / math.sqrt(repetitions)
        width = student.ppf((1 + CONFIDENCE) / 2, repetitions - 1) * math.sqrt(math.log1p(relative**2))
    return Probability(mean, mean * math.exp(-width), min(1.0, mean * math.exp(width)), flown, parts, levels)


def _repetition(margin: Callable[[Array], Array], n: int, runs: int,
                random: np.random.Generator) -> tuple[float, list[float], int]:
    """(estimate, levels, runs flown) of one repetition."""
    z = random.normal(size=(runs, n))
    g = margin(z)
    levels: list[float] = []
    value, flown, spread = 1.0, runs, 0.6
    while True:
        level = float(np.sort(g)[max(1, round(SHARE * runs)) - 1])
        if level < 0 or len(levels) == LEVELS:
            return value * float(np.mean(g < 0)), levels, flown
        inside = g <= level
        if inside.all():
            if not levels and level >= 0 and not np.ptp(g):
                raise RunError("the margins of all draws are the same, so that no level leads to those below 0")
            return value * float(np.mean(g < 0)), levels, flown
        value *= float(np.mean(inside))
        levels.append(level)
        z, g, spread = _chains(margin, z, g, level, runs, spread, random)
        flown += len(g) - int(inside.sum())


def _chains(margin: Callable[[Array], Array], z: Array, g: Array, level: float, runs: int, spread: float,
            random: np.random.Generator) -> tuple[Array, Array, float]:
    """(draws below a level, their margins, the spread of the steps at the end), by chains from those of `z` that are.
    Every third step is a plain one; between, a guess of the margin leads several steps that are not flown."""
    guess = _Guess(z, g, level)
    z, g = z[g <= level], g[g <= level]
    deviation = np.clip(z.std(axis=0), 0.1, None)
    all_z, all_g, count, step, plain = [z], [g], len(z), 0, 0
    while count < runs:
        step += 1
        if guess.useful and step % 3:
            tried = guess.lead(z, random)
            allowed = np.log(random.random(len(z))) < guess.log_share(z) - guess.log_share(tried)
        else:
            plain += 1
            sigma = np.minimum(spread * deviation, 1.0)
            tried, allowed = np.sqrt(1 - sigma**2) * z + sigma * random.normal(size=z.shape), np.ones(len(z), bool)
        g_tried = margin(tried)
        accepted = (g_tried <= level) & allowed
        z, g = np.where(accepted[:, None], tried, z), np.where(accepted, g_tried, g)
        all_z.append(z)
        all_g.append(g)
        count += len(z)
        if not guess.useful or step % 3 == 0:
            spread = float(np.clip(spread * math.exp((accepted.mean() - ACCEPTED) / math.sqrt(plain)), 1e-3, 10.0))
    return np.vstack(all_z), np.concatenate(all_g), spread


class _Guess:
    """The margin as a linear function, by the draws of a level. It proposes: a step goes as the share of those that are
    guessed to be below the level would, and the margin itself corrects which steps are accepted (delayed acceptance,
    Christen and Fox 2005), so that a bad guess costs runs, and no truth."""

    STEPS = 12

    def __init__(self, z: Array, g: Array, level: float) -> None:
        near = np.argsort(g, kind="stable")[:len(g) // 2]
        near = near[np.abs(g[near]) < NO_MARGIN]
        x, y = np.hstack([np.ones((len(near), 1)), z[near]]), g[near]
        self.useful = len(near) > 4 * x.shape[1] and bool(np.ptp(y))
        if self.useful:
            self._slope = np.linalg.solve(x.T @ x + 1e-6 * len(near) * np.eye(x.shape[1]), x.T @ y)
            off = float(np.std(y - x @ self._slope))
            self.useful = off < 0.7 * float(np.std(y))
            self._level, self._off, self._spread = level, max(off, 0.05 * float(np.std(y))), 0.6

    def log_share(self, z: Array) -> Array:
        """The logarithm of the probability that it is below the level, up to what the guess leaves open."""
        guessed = self._slope[0] + z @ self._slope[1:]
        return log_ndtr((self._level - guessed) / self._off)

    def lead(self, z: Array, random: np.random.Generator) -> Array:
        """Some steps from each point; none is flown."""
        share = self.log_share(z)
        for _ in range(self.STEPS):
            sigma = min(self._spread, 1.0)
            tried = math.sqrt(1 - sigma**2) * z + sigma * random.normal(size=z.shape)
            new = self.log_share(tried)
            accepted = np.log(random.random(len(z))) < new - share
            z, share = np.where(accepted[:, None], tried, z), np.where(accepted, new, share)
        self._spread = float(np.clip(self._spread * math.exp(0.5 * (accepted.mean() - ACCEPTED)), 1e-2, 2.0))
        return z
