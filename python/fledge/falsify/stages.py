# SPDX-License-Identifier: Apache-2.0
"""The run with the least margin, by a budget of runs, in four stages:

    draws           the nominal run, and draws of the campaign that fill the cube (a Latin hypercube)
    cross-entropy   draws of a distribution that moves to the draws with the least margins, generation by generation
    evolution       differential evolution in the box, which begins with the best so far and with new draws
    polishing       Nelder and Mead from the best, by the numbers that are no choices

Each stage begins where the one before ended. The random numbers are those of the seed.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeWarning, differential_evolution, minimize
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from fledge.falsify.space import Space

Array = NDArray[np.float64]
Margins = Callable[[Array], Array]      # (runs, columns) numbers of a Space -> (runs,) margins, NaN where unknown

DRAWS, CROSS_ENTROPY, EVOLUTION = 0.15, 0.4, 0.85   # of the budget are spent when a stage ends
ELITE, SMOOTH = 0.2, 0.5            # of a generation; how far its distribution goes to that of its elite
NEW = 0.1                           # of a generation are draws of the campaign: the least margins may mislead
NO_MARGIN = 1e30                    # of runs without a margin


@dataclass
class Tried:
    """The runs in their order. values: (runs, columns) in SI; margins: (runs,), the first of the nominal run;
    stages: name -> its runs; interrupted: by Ctrl-C"""
    values: Array
    margins: Array
    stages: dict[str, int] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def best(self) -> int | None:
        """The run with the least margin; None if none has one."""
        return None if np.isnan(self.margins).all() else int(np.nanargmin(self.margins))

    @property
    def first(self) -> int | None:
        """The first run with a margin below 0."""
        below = np.flatnonzero(self.margins < 0)
        return int(below[0]) if len(below) else None


class _Done(Exception):
    """The budget is used up, or the first violation is found."""


def random_search(margins: Margins, space: Space, runs: int, seed: int = 0, first: bool = False,
                  batch: int = 20) -> Tried:
    """The same by draws of the campaign alone: what search() is compared with."""
    search_ = _Search(margins, space, runs, seed, first)
    search_.run([("draws", 1.0, lambda: search_.fly(search_.random.random((batch, space.n))))])
    return search_.tried


def search(margins: Margins, space: Space, runs: int, seed: int = 0, first: bool = False) -> Tried:
    """Search for the least margin by at most so many runs. first: end with the first margin below 0. KeyboardInterrupt
    in margins ends the search with the runs so far."""
    search_ = _Search(margins, space, runs, seed, first)
    search_.run([("draws", DRAWS, search_.draws), ("cross-entropy", CROSS_ENTROPY, search_.cross_entropy),
                 ("evolution", EVOLUTION, search_.evolution), ("polishing", 1.0, search_.polish)])
    return search_.tried


class _Search:
    """The stages of a search. u, g: all runs but the nominal one, as points of the cube, and their margins,
    finite"""

    def __init__(self, margins: Margins, space: Space, runs: int, seed: int, first: bool) -> None:
        self.margins, self.space, self.runs, self.only_first = margins, space, runs, first
        self.random = np.random.default_rng(seed)
        self.tried = Tried(np.empty((0, space.n)), np.empty(0))
        self.u, self.g = np.empty((0, space.n)), np.empty(0)
        self.end = runs
        self.generation = int(np.clip(runs // 40, 15, 60))
        # Mean and standard deviation of the cross-entropy, and the shares of each choice.
        self._normal: Any = None

    def run(self, stages: list[tuple[str, float, Callable]]) -> None:
        for name, share, stage in stages:
            before = len(self.tried.margins)
            self.end = max(1, round(share * self.runs))
            try:
                while len(self.tried.margins) < self.end:
                    at = len(self.tried.margins)
                    stage()
                    if len(self.tried.margins) == at:       # it has nothing left to try
                        break
            except _Done:
                pass
            except KeyboardInterrupt:
                self.tried.interrupted = True
            self.tried.stages[name] = len(self.tried.margins) - before
            if self.tried.interrupted or self.only_first and self.tried.first is not None:
                break

    def fly(self, u: Array) -> Array:
        """The margins of points of the cube. Raises _Done after those that the budget of the stage allows."""
        u = u[:self.end - len(self.tried.margins)]
        if not len(u):
            raise _Done
        margins = known(self._fly(self.space.values(u)))
        self.u, self.g = np.vstack([self.u, u]), np.concatenate([self.g, margins])
        if len(self.tried.margins) >= self.end or self.only_first and (margins < 0).any():
            raise _Done
        return margins

    def _fly(self, values: Array) -> Array:
        margins = self.margins(values)
        self.tried.values = np.vstack([self.tried.values, values])
        self.tried.margins = np.concatenate([self.tried.margins, margins])
        return margins

    # --- the stages ---

    def draws(self) -> None:
        if not len(self.tried.margins):
            self._fly(self.space.nominal[None])
            if self.only_first and self.tried.first is not None:
                raise _Done
        self.fly(qmc.LatinHypercube(self.space.n, seed=self.random).random(max(1, self.end - len(self.g) - 1)))

    def cross_entropy(self) -> None:
        """A generation. Numbers are normal in what the standard normal distribution makes of the cube; choices have
        shares of their own."""
        n = self.space.n
        if self._normal is None:
            self._normal = (np.zeros(n), np.ones(n), {k: np.full(m, 1 / m) for k, m in enumerate(self.space.choices)
                                                      if m})
            if len(self.u):
                self._follow(slice(None))
        mean, std, shares = self._normal
        u = ndtr(mean + std * self.random.normal(size=(self.generation, n)))
        for k, share in shares.items():
            drawn = self.random.choice(len(share), self.generation, p=share)
            u[:, k] = (drawn + self.random.random(self.generation)) / len(share)
        new = self.random.random(self.generation) < NEW
        u[new] = self.random.random((int(new.sum()), n))
        begin = len(self.u)
        self.fly(u)
        self._follow(slice(begin, None))
        if (self._normal[1] < 0.06).all():      # it has come to a point: begin anew
            self._normal = None

    def _follow(self, part: slice) -> None:
        """Move the distribution of the cross-entropy to the elite of some runs."""
        mean, std, shares = self._normal
        order = np.argsort(self.g[part], kind="stable")[:max(4, round(ELITE * len(self.g[part])))]
        elite = self.u[part][order]
        z = ndtri(np.clip(elite, 1e-12, 1 - 1e-12))
        mean += SMOOTH * (z.mean(axis=0) - mean)
        std += SMOOTH * (np.maximum(z.std(axis=0), 0.05) - std)
        for k, share in shares.items():
            counts = np.bincount(np.minimum((elite[:, k] * len(share)).astype(int), len(share) - 1),
                                 minlength=len(share)) / len(elite)
            share[:] = 0.9 * (SMOOTH * counts + (1 - SMOOTH) * share) + 0.1 / len(share)    # none dies out

    def evolution(self) -> None:
        """Differential evolution until it stands still: half of its first generation are the best of all runs."""
        n = int(np.clip(2 * self.space.n, 10, 60))
        order = np.argsort(self.g, kind="stable")[:n // 2]
        new = qmc.LatinHypercube(self.space.n, seed=self.random).random(n - len(order))
        begin = np.vstack([self.space.to_box(self.u[order]), self.space.to_box(new)])
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", OptimizeWarning)
            differential_evolution(
                lambda c: self.fly(np.clip(self.space.from_box(c.T.reshape(-1, self.space.n)), 0, 1)),
                [(0, 1)] * self.space.n, init=begin, vectorized=True, updating="deferred", polish=False,
                strategy="currenttobest1bin", maxiter=100_000, tol=1e-3, seed=self.random)

    def polish(self) -> None:
        best = int(self.g.argmin())
        free = np.flatnonzero(np.array(self.space.choices) == 0)
        if not len(free) or abs(self.g[best]) == NO_MARGIN:
            return
        at = self.space.to_box(self.u[[best]])

        def margin(c: Array) -> float:
            point = at.copy()
            point[0, free] = c
            return float(self.fly(np.clip(self.space.from_box(point), 0, 1))[0])

        start = at[0, free]
        size = np.where(start < 0.95, 0.05, -0.05)      # of the first simplex
        minimize(margin, start, method="Nelder-Mead", bounds=[(0, 1)] * len(free),
                 options={"initial_simplex": np.vstack([start, start + np.diag(size)]), "adaptive": True,
                          "xatol": 1e-5, "fatol": 0, "maxfev": 10**9, "maxiter": 10**9})


def known(margins: Array) -> Array:
    """Finite numbers in the order of the margins; a margin that is not known is larger than all."""
    return np.nan_to_num(np.clip(margins, -NO_MARGIN, NO_MARGIN), nan=NO_MARGIN)
