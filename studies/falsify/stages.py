# SPDX-License-Identifier: Apache-2.0
"""The run with the least margin, by a budget of runs, in five stages:

    draws           the nominal run, and draws of the campaign that fill the cube (a Latin hypercube)
    breeding        changes of runs that took rare branches of flight code, where runs tell which they took
    cross-entropy   draws of a distribution that moves to the draws with the least margins, generation by generation
    evolution       differential evolution in the box, which begins with the best so far and with new draws
    polishing       Nelder and Mead from the best, by the numbers that are no choices

Each stage begins where the one before ended. The random numbers are those of the seed.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeWarning, differential_evolution, minimize
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from fledge.falsify.space import Space
from fledge.montecarlo.shares import padded

Array = NDArray[np.float64]
Margins = Callable[[Array], Array]      # (runs, columns) numbers of a Space -> (runs,) margins, NaN where unknown
Seen = Callable[[], NDArray[np.uint8]]  # -> (runs, what there is to see): how often each run of the last call saw it
Stage = tuple[str, float, Callable]     # its name, the share of the budget that is spent when it ends, and a step of it

DRAWS, CROSS_ENTROPY, EVOLUTION = 0.15, 0.4, 0.85   # of the budget are spent when a stage ends
BRED = 0.5, 0.6, 0.9    # the same of what follows the draws, with a breeding before it
BROOD = 16              # runs
CHANGES = 0.4, 0.2, 0.4     # shares of coordinates that are drawn anew, taken of another run, or a small step away
STEPS = (0.02, 0.1, 0.3)    # sizes of a small change, in the box
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


def search(margins: Margins, space: Space, runs: int, seed: int = 0, first: bool = False,
           seen: Seen | None = None) -> Tried:
    """Search for the least margin by at most so many runs. first: end with the first margin below 0; seen: what the
    runs of the last call of margins saw, which leads the breeding. KeyboardInterrupt in margins ends the search with
    the runs so far."""
    search_ = _Search(margins, space, runs, seed, first, seen)

    def stages() -> Iterator[Stage]:
        cross_entropy, evolution = CROSS_ENTROPY, EVOLUTION
        yield "draws", DRAWS, search_.draws
        if _rarities(search_.saw).any():      # else all have seen the same
            bred, cross_entropy, evolution = BRED
            yield "breeding", bred, search_.breed
        yield "cross-entropy", cross_entropy, search_.cross_entropy
        yield "evolution", evolution, search_.evolution
        yield "polishing", 1.0, search_.polish

    search_.run(stages())
    return search_.tried


class _Search:
    """The stages of a search. u, g: all runs but the nominal one, as points of the cube, and their margins,
    finite; saw: of each of them, whether it saw each thing that there is to see"""

    def __init__(self, margins: Margins, space: Space, runs: int, seed: int, first: bool,
                 seen: Seen | None = None) -> None:
        self.margins, self.space, self.runs, self.only_first, self.seen = margins, space, runs, first, seen
        self.saw: list[NDArray[np.bool_]] = []
        self.random = np.random.default_rng(seed)
        self.tried = Tried(np.empty((0, space.n)), np.empty(0))
        self.u, self.g = np.empty((0, space.n)), np.empty(0)
        self.end = runs
        self.generation = int(np.clip(runs // 40, 15, 60))
        # Mean and standard deviation of the cross-entropy, and the shares of each choice.
        self._normal: Any = None

    def run(self, stages: Iterable[Stage]) -> None:
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
        if self.seen:
            self.saw += list(self.seen() > 0)
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

    def breed(self) -> None:
        """A brood of runs that saw what few runs have seen: each is changed in a few coordinates."""
        weights = _rarities(self.saw)
        parents, others = self.random.choice(len(weights), (2, BROOD), p=weights / weights.sum())
        u = self.u[parents]
        new = self.random.random((BROOD, self.space.n))
        steps = self.random.choice(STEPS, u.shape) * self.random.normal(size=u.shape)
        near = self.space.from_box(np.clip(self.space.to_box(u) + steps, 0, 1))
        near = np.where(self.space.choices, new, near)      # a choice has no neighbours
        candidates = np.stack([new, self.u[others], near])
        of = self.random.choice(3, (1, *u.shape), p=CHANGES)
        count = np.minimum(self.random.geometric(0.5, BROOD), self.space.n)
        changed = self.random.random(u.shape).argsort(axis=1).argsort(axis=1) < count[:, None]
        u = np.where(changed, np.take_along_axis(candidates, of, 0)[0], u)
        u = np.where(self.random.random((BROOD, 1)) < NEW, self.random.random(u.shape), u)
        self.fly(u)

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


def _rarities(saw: list[NDArray[np.bool_]]) -> Array:
    """(runs,) of each run 1/n of the rarest branch, or the like, that it saw, of which n runs saw any; what all saw
    counts for nothing."""
    if not saw:
        return np.zeros(0)
    seen = padded([row[None] for row in saw])
    seen = seen[:, ~seen.all(axis=0)]
    return np.max(seen / np.maximum(seen.sum(axis=0), 1), axis=1, initial=0.0)


def known(margins: Array) -> Array:
    """Finite numbers in the order of the margins; a margin that is not known is larger than all."""
    return np.nan_to_num(np.clip(margins, -NO_MARGIN, NO_MARGIN), nan=NO_MARGIN)
