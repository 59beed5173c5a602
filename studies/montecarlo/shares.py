# SPDX-License-Identifier: Apache-2.0
"""Shares of a campaign: the results of some of its runs, and the ways to fly them, by threads or by a pool."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import _core
from fledge.errors import SetupError
from fledge.pool import Died, Local, Pool, Work

if TYPE_CHECKING:
    import numpy as np

    from fledge.montecarlo.campaign import Campaign

NUMBERS = 2**22     # that the runs of a share retain at most
RUNS_MOST = 500     # of a share on a cluster
SHARES = 8          # for each thread of a cluster, at least, so that all end at about the same time

Ranges = Sequence[tuple[int, int]]      # (first index, one beyond the last) of runs, ascending
Progress = Callable[[int, int], Any]    # (finished runs, of these failed)


@dataclass
class Share:
    """The results of the runs first, first + 1, ...

    flown: whether a run came to its end, or failed; errors: "" of a run that came to its end; health: rows of Findings;
    draws: (runs, dispersed numbers); entered: (runs, modes) [s] when each mode first
    began; retained: (runs, samples, elements) of each variable; NaN where not flown, and after an error; seen: (runs,
    pairs of modes, events and branches) how often, up to 255.
    """
    first: int
    flown: list[bool]
    errors: list[str]
    health: list[list[tuple]]
    draws: np.ndarray
    entered: np.ndarray
    retained: list[np.ndarray]
    seen: np.ndarray

    @classmethod
    def of(cls, first: int, result: Any) -> Share:
        """What the kernel gives."""
        return cls(first, result.flown, result.failures, result.health, result.draws, result.entered,
                   result.retained, result.seen)

    @classmethod
    def joined(cls, shares: Sequence[Share]) -> Share:
        """Shares that follow each other as one."""
        import numpy as np

        return cls(shares[0].first, [x for share in shares for x in share.flown],
                   [x for share in shares for x in share.errors],
                   [x for share in shares for x in share.health], np.concatenate([share.draws for share in shares]),
                   np.concatenate([share.entered for share in shares]),
                   [np.concatenate(values) for values in zip(*(share.retained for share in shares))],
                   padded([share.seen for share in shares]))

    @classmethod
    def failed(cls, campaign: Campaign, index: int, error: str) -> Share:
        """A run of which only the error is known."""
        import numpy as np

        d = campaign.dispersions
        return cls(index, [True], [error], [[]], np.full((1, len(d.columns)), np.nan),
                   np.full((1, len(d.modes)), np.nan),
                   [np.full((1, len(d.ns), len(variable.field_path.elements)), np.nan)
                    for variable in d.retained.values()], np.zeros((1, 0), np.uint8))


def padded(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Rows of different lengths as one array, with zeros behind the shorter ones: a run that died has seen nothing."""
    import numpy as np

    width = max(part.shape[1] for part in rows)
    return np.vstack([np.pad(part, ((0, 0), (0, width - part.shape[1]))) for part in rows])


@dataclass
class Series:
    """Retained variables over time: path -> (runs, samples, ...) at the times `ns`."""
    ns: np.ndarray
    retained: dict[str, np.ndarray] = field(default_factory=dict)


def numbers_of_run(campaign: Campaign) -> int:
    """How many numbers a run retains."""
    d = campaign.dispersions
    return len(d.ns) * sum(len(variable.field_path.elements) for variable in d.retained.values())


def cut(campaign: Campaign, ranges: Ranges, most: int | None = None) -> list[tuple[int, int]]:
    """The ranges in parts that are small enough for a share, and have at most so many runs."""
    n = max(1, NUMBERS // max(1, numbers_of_run(campaign)))
    n = n if most is None else max(1, min(n, most))
    return [(first, min(first + n, end)) for begin, end in ranges for first in range(begin, end, n)]


def fly_share(campaign: Campaign, seed: int, first: int, end: int, threads: int = 1,
              progress: Progress | None = None) -> tuple[Share, bool]:
    """(the share, whether Ctrl-C stopped it), by threads of this process."""
    plan = campaign.plan
    plan.seed, plan.first, plan.runs = seed, first, end - first
    nominal, watch = campaign.nominal, campaign.dispersions.watch
    flown, interrupted = _core.fly(nominal.kernel, plan, threads, progress, lambda clone: watch(nominal._around(clone)))
    return Share.of(first, flown), interrupted


def by_threads(campaign: Campaign, ranges: Ranges, seed: int, threads: int,
               progress: Progress) -> Generator[Share, None, None]:
    """Fly the runs by threads, share after share. Ctrl-C raises KeyboardInterrupt after the finished shares."""
    finished = failed = 0
    for first, end in cut(campaign, ranges):
        share, interrupted = fly_share(campaign, seed, first, end, threads,
                                       lambda n, bad: progress(finished + n, failed + bad))
        yield share
        if interrupted:
            raise KeyboardInterrupt
        finished, failed = finished + end - first, failed + sum(map(bool, share.errors))


class Range(NamedTuple):
    """The runs first to end - 1. values: of the campaign's runs, if these are chosen: path -> number in each"""
    first: int
    end: int
    values: dict[str, list[float]] = {}


class Runs(Work[Range, Share]):
    """The runs of a campaign as the work of a pool."""

    def __init__(self, campaign: Campaign, seed: int) -> None:
        self.campaign, self.seed, self.folder = campaign, seed, campaign.folder

    @property
    def recipe(self) -> tuple[Callable[..., Runs], tuple[Any, ...]]:
        """(function, arguments) that make it in another program."""
        kind, arguments = self.campaign.recipe
        return Runs.made, (self.seed, kind, *arguments)

    @classmethod
    def made(cls, seed: int, kind: Callable[..., Campaign], *arguments: Any) -> Runs:
        """By the recipe of a campaign."""
        return cls(kind(*arguments), seed)

    def fly(self, item: Range) -> Share:
        """By this thread; where the mission calls Python, each run in a mission loaded for it."""
        self.campaign.take(item.values)
        if not self.campaign.has_callables:
            return fly_share(self.campaign, self.seed, item.first, item.end)[0]
        return Share.joined([self._loaded(index) for index in range(item.first, item.end)])

    def _loaded(self, index: int) -> Share:
        try:
            simulation, plan = self.campaign._load(index)
        except SetupError as error:
            return Share.failed(self.campaign, index, str(error))
        plan.seed = self.seed
        watch = self.campaign.dispersions.watch
        flown = _core.fly_one(simulation.kernel, plan, index, lambda _: watch(simulation))
        return self.campaign.complete(Share.of(index, flown))

    def split(self, item: Range) -> list[Range]:
        """Its two halves; [] of a single run."""
        middle = (item.first + item.end) // 2
        return [item._replace(end=middle), item._replace(first=middle)] if item.end - item.first > 1 else []


def by_pool(campaign: Campaign, ranges: Ranges, seed: int, pool: Pool,
            progress: Progress) -> Generator[Share, None, None]:
    """Fly the runs by a pool: one at a time on this machine, shares on a cluster. A process that dies has failed its
    run."""
    most = 1
    if not isinstance(pool, Local):
        most = min(RUNS_MOST, -(-sum(end - first for first, end in ranges) // (SHARES * pool.threads)))
    items = [Range(first, end, campaign.values) for first, end in cut(campaign, ranges, most)]
    finished = failed = 0
    flown = pool.fly(Runs(campaign, seed), items, lambda: progress(finished, failed))
    with closing(flown):
        for _, result in flown:
            share = Share.failed(campaign, result.item.first, result.text) if isinstance(result, Died) else result
            finished, failed = finished + len(share.flown), failed + sum(map(bool, share.errors))
            yield share
    progress(finished, failed)
