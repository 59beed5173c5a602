# SPDX-License-Identifier: Apache-2.0
"""Runs of a campaign with chosen numbers, and the margins of one requirement in them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fledge.errors import SetupError
from fledge.falsify.stages import Array
from fledge.falsify.reduction import Counterexample, smallest
from fledge.falsify.space import Space
from fledge.mission.field_path import FieldPath
from fledge.mission.scenario import chosen, set_up
from fledge.montecarlo import Chosen
from fledge.montecarlo.campaign import declare
from fledge.montecarlo.requirements import FormulaCheck
from fledge.montecarlo.shares import padded
from fledge.pool import open_pool
from fledge.requirements import Requirements

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation
    from fledge.montecarlo.dispersions import Dispersions


class _Campaign(Chosen):
    """A campaign of a mission with one requirement; with a scenario, from what that sets before its first run, and for
    as long as that run."""

    keeps_seen = True

    def __init__(self, mission: str | os.PathLike[str], name: str | Callable | None, requirement: str,
                 scenario: str | None) -> None:
        self._requirement, self._scenario = requirement, scenario
        super().__init__(mission, name)

    @property
    def recipe(self) -> tuple[Any, tuple]:
        kind, (mission, function) = super().recipe
        return kind, (mission, function, self._requirement, self._scenario)

    def _declare(self, index: int) -> tuple[Simulation, Dispersions, dict[str, str], str]:
        duration: list[float] = []

        def prepare(sim: Simulation) -> None:
            name, function = chosen(sim, self._scenario)
            length = set_up(sim, function)
            if length is None:
                raise SetupError(f"the scenario {name} begins with no run of a duration, as sim.run(10 * minute): "
                                 "there is nothing to fly")
            duration.append(length)

        sim, d, known, name = declare(self._mission, self._function, {}, prepare if self._scenario else None)
        if duration:
            d.duration = duration[0]
        assert sim.mission
        if not Requirements(sim):
            raise SetupError(f"the mission {sim.name} declares no requirements; expected them in "
                             f"{sim.mission.folder / 'requirements.py'}")
        d.requirements.clear()      # those of the campaign are not judged
        d.require(self._requirement)
        every = _check(d).declared.every
        if every:       # sampled as a scenario samples it, so that it has the same margin there
            d.every = every / 1e9
        if self.values:
            d.choose(self.values)
        return sim, d, known, name


class Flights:
    """Flies runs with chosen numbers. A call takes (runs, columns) numbers of `space`, and returns the (runs,) margins
    of the requirement: NaN of a run that ended in an error, or where the requirement is unknown.

    mission: a name, or the path of a folder; requirement: the id of one of its requirements; campaign: of its
    dispersions.py, default: the first, or a function that takes `d`; scenario: fly this one with the campaign's
    dispersions; seed: of the random streams, the same in all runs; scheduler: the address of a Dask scheduler, whose
    workers fly in place of threads, until this is closed as a context manager. `flown` counts the runs; `errors` has
    the texts of those that ended in an error, `unknown` counts those without a verdict; `seen` has of each run of the
    last call how often, up to 255, a mode followed another, an event fired, and, in the build that counts them, an edge
    of a branch of flight code was taken.
    Raises SetupError, or MissionError with the line of the mission's file.
    """

    def __init__(self, mission: str | os.PathLike[str], requirement: str, campaign: str | Callable | None = None,
                 scenario: str | None = None, seed: int = 0, threads: int | None = None,
                 scheduler: str | None = None) -> None:
        self.mission, self.requirement, self.scenario = mission, requirement, scenario
        self.seed, self.threads = seed, threads
        self.campaign = _Campaign(mission, campaign, requirement, scenario)
        self.cluster = open_pool(scheduler=scheduler) if scheduler else None
        self.check = _check(self.campaign.dispersions)
        self.text, self.unit = self.check.declared.text, self.check.variable.unit
        self.faults = self.campaign.dispersions.faults.copy()
        self.marginals = dict(self.campaign.dispersions.marginals)
        self.units = self.campaign.dispersions.columns
        self.space = Space(self.marginals)
        # The kinds of faults that are no draws: as the campaign plans them.
        self.kinds = {f"{fault}.kind": FieldPath(self.campaign.nominal, f"{fault}.kind").value()
                      for fault in self.faults
                      if f"{fault}.kind" not in self.marginals}
        self.flown, self.unknown = 0, 0
        self.errors: list[str] = []
        self.seen = np.zeros((0, 0), np.uint8)
        self.least = np.inf
        self.progress: Callable[[int, float], Any] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.cluster:
            self.cluster.close()

    def __call__(self, values: Array, seed: int | None = None) -> Array:
        return self.fly(dict(zip(self.space.columns, values.T)), seed)

    def repetition(self, values: Array, k: int) -> Array:
        """The margins of runs whose random streams are those of the repetition k, for probability()."""
        return self(values, self.seed + k)

    def fly(self, values: Mapping[str, Sequence[float]], seed: int | None = None) -> Array:
        """The margins of runs: path -> its number in each run. Other numbers are nominal."""
        n = len(next(iter(values.values())))
        if not n:
            return np.empty(0)
        try:
            self.campaign.choose(values)
        except SetupError as error:     # of one point, which is no reason to end a search
            if n == 1:
                self.flown += 1
                self.errors.append(str(error))
                self.seen = np.zeros((1, 0), np.uint8)
                return np.array([np.nan])
            halves = [{path: numbers[part] for path, numbers in values.items()}
                      for part in (slice(n // 2), slice(n // 2, None))]
            parts = [(self.fly(half, seed), self.seen) for half in halves]
            self.seen = padded([seen for _, seen in parts])
            return np.concatenate([margins for margins, _ in parts])
        result = self.campaign.fly(n, self.seed if seed is None else seed, self.threads, progress=self._count,
                                   scheduler=self.cluster)
        if result.interrupted:
            raise KeyboardInterrupt
        self.flown += n
        self.errors += result.errors.values()
        self.seen = padded([result.store.seen[run][None] for run in range(n)])
        margins = result.reached(self.check)[0]
        self.unknown += int(np.isnan(margins).sum()) - len(result.errors)
        self.least = np.fmin(self.least, np.fmin.reduce(margins))
        return margins

    def _count(self, finished: int, _: int) -> None:
        if self.progress:
            self.progress(self.flown + finished, self.least)

    def smallest(self, values: Array, margin: float) -> Counterexample:
        """The smallest counterexample from a failing run with these numbers of `space`."""
        parts = {**{fault: f"{fault}.kind" for fault in self.faults},
                 **{command: f"{command}.which" for command in self.campaign.dispersions.commands}}
        return smallest(self.fly, self.marginals, parts,
                        {**dict(zip(self.space.columns, map(float, values))), **self.kinds}, margin)

    def shown(self, path: str, x: float) -> str:
        """As montecarlo.Campaign.shown()."""
        return self.campaign.shown(path, x)

    def simulation(self, values: Mapping[str, float], seed: int | None = None) -> Simulation:
        """The simulation of one run, ready to be flown for `duration`."""
        self.campaign.choose({path: [x] for path, x in values.items()})
        return self.campaign.simulation(0, self.seed if seed is None else seed)

    @property
    def counts_branches(self) -> bool:
        """Whether this build counts them."""
        return os.environ.get("FLEDGE_OBSERVED") == "branches"

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.campaign.dispersions.duration)


def _check(d: Dispersions) -> FormulaCheck:
    """The one requirement of a campaign."""
    check, = d.requirements
    assert isinstance(check, FormulaCheck)
    return check
