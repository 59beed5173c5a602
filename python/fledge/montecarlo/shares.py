# SPDX-License-Identifier: Apache-2.0
"""Shares of a campaign: the results of some of its runs, and the ways to fly them on this machine."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING, Any

from fledge import _core

if TYPE_CHECKING:
    import numpy as np

    from fledge.montecarlo.campaign import Campaign

NUMBERS = 2**22     # that the runs of a share retain at most

Ranges = Sequence[tuple[int, int]]      # (first index, one beyond the last) of runs, ascending
Progress = Callable[[int, int], Any]    # (finished runs, of these failed)


@dataclass
class Share:
    """The results of the runs first, first + 1, ...

    flown: whether a run came to its end, or failed; errors: "" of a run that came to its end; health: rows of Findings;
    draws: (runs, dispersed numbers); entered: (runs, modes) [s] when each mode first
    began; retained: (runs, samples, elements) of each variable; NaN where not flown, and after an error.
    """
    first: int
    flown: list[bool]
    errors: list[str]
    health: list[list[tuple]]
    draws: np.ndarray
    entered: np.ndarray
    retained: list[np.ndarray]

    @classmethod
    def of(cls, first: int, result: Any) -> Share:
        """What the kernel gives."""
        return cls(first, result.flown, result.failures, result.health, result.draws, result.entered,
                   result.retained)

    @classmethod
    def joined(cls, shares: Sequence[Share]) -> Share:
        """Shares that follow each other as one."""
        import numpy as np

        return cls(shares[0].first, [x for one in shares for x in one.flown], [x for one in shares for x in one.errors],
                   [x for one in shares for x in one.health], np.concatenate([one.draws for one in shares]),
                   np.concatenate([one.entered for one in shares]),
                   [np.concatenate(values) for values in zip(*(one.retained for one in shares))])

    @classmethod
    def failed(cls, campaign: Campaign, index: int, error: str) -> Share:
        """A run that left nothing but the reason."""
        import numpy as np

        d = campaign.dispersions
        return cls(index, [True], [error], [[]], np.full((1, len(d.columns)), np.nan),
                   np.full((1, len(d.modes)), np.nan),
                   [np.full((1, len(d.ns), len(one.field_path.elements)), np.nan) for one in d.retained.values()])


@dataclass
class Series:
    """Retained variables over time: path -> (runs, samples, ...) at the times `ns`."""
    ns: np.ndarray
    retained: dict[str, np.ndarray] = field(default_factory=dict)


def numbers_of_run(campaign: Campaign) -> int:
    """How many numbers a run retains."""
    d = campaign.dispersions
    return len(d.ns) * sum(len(one.field_path.elements) for one in d.retained.values())


def cut(campaign: Campaign, ranges: Ranges, most: int | None = None) -> list[tuple[int, int]]:
    """The ranges in parts that are small enough for a share, and have at most so many runs."""
    n = max(1, NUMBERS // max(1, numbers_of_run(campaign)))
    n = n if most is None else max(1, min(n, most))
    return [(first, min(first + n, end)) for begin, end in ranges for first in range(begin, end, n)]


def halves(first: int, end: int) -> list[tuple[int, int]]:
    """A range in two parts."""
    middle = (first + end) // 2
    return [(first, middle), (middle, end)]


def fly_share(campaign: Campaign, seed: int, first: int, end: int, threads: int = 1,
              progress: Progress | None = None) -> tuple[Share, bool]:
    """(the share, whether Ctrl-C stopped it), by threads of this process."""
    plan = campaign.plan
    plan.seed, plan.first, plan.runs = seed, first, end - first
    flown, interrupted = _core.fly(campaign.nominal.kernel, plan, threads, progress)
    return Share.of(first, flown), interrupted


def fly_loaded(campaign: Campaign, seed: int, index: int) -> Share:
    """One run, in a mission loaded for it."""
    simulation, plan = campaign._load(index)
    plan.seed = seed
    return campaign.complete(Share.of(index, _core.fly_one(simulation.kernel, plan, index)))


def by_threads(campaign: Campaign, ranges: Ranges, seed: int, threads: int,
               progress: Progress) -> Generator[Share, None, None]:
    """Fly the runs by threads, share after share. Ctrl-C raises KeyboardInterrupt after what was finished."""
    finished = failed = 0
    for first, end in cut(campaign, ranges):
        share, interrupted = fly_share(campaign, seed, first, end, threads,
                                       lambda n, bad: progress(finished + n, failed + bad))
        yield share
        if interrupted:
            raise KeyboardInterrupt
        finished, failed = finished + end - first, failed + sum(map(bool, share.errors))


# --- processes -------------------------------------------------------------------------------------

def by_processes(campaign: Campaign, ranges: Ranges, seed: int, processes: int,
                 progress: Progress) -> Generator[Share, None, None]:
    """Fly the runs by processes, each run in a mission loaded afresh. A process that dies has failed its run."""
    import multiprocessing
    from multiprocessing import connection

    fork = multiprocessing.get_context("fork")
    waiting = (index for first, end in ranges for index in range(first, end))
    flying: dict[Any, tuple[Any, int]] = {}     # pipe -> (process, index of the run in the air)
    finished = failed = 0

    def start(index):
        ours, theirs = fork.Pipe()
        child = fork.Process(target=_fly_given, args=(campaign, seed, theirs, ours), daemon=True)
        child.start()
        theirs.close()
        give(ours, child, index)

    def give(pipe, child, index):
        with suppress(OSError):     # the child has died: recv() will say so
            pipe.send(index)
        if index is None:
            child.join()
        else:
            flying[pipe] = child, index

    try:
        for index in islice(waiting, processes):
            start(index)
        while flying:
            pipe: Any
            for pipe in connection.wait(list(flying), 0.1):
                child, index = flying.pop(pipe)
                try:
                    share = pipe.recv()
                    give(pipe, child, next(waiting, None))
                except (EOFError, OSError):     # it died in the run
                    child.join()
                    share = Share.failed(campaign, index, death(child.exitcode))
                    following = next(waiting, None)
                    if following is not None:
                        start(following)
                finished, failed = finished + 1, failed + bool(share.errors[0])
                yield share
            progress(finished, failed)
    finally:
        for child, _ in flying.values():
            child.terminate()
            child.join()


def _fly_given(campaign, seed, pipe, parents_end):
    """Fly the runs whose indices come, until there is none, or the parent has gone."""
    import signal

    parents_end.close()     # this child inherited it: while it holds it, recv() does not end with the parent
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles it, and ends the children
    with suppress(EOFError, OSError):
        while (index := pipe.recv()) is not None:
            pipe.send(fly_loaded(campaign, seed, index))


def death(code: int | None) -> str:
    """Why a process ended, by its exit code."""
    import signal

    if code is not None and code < 0:
        return f"the process that flew it was ended by {signal.Signals(-code).name}"
    return f"the process that flew it ended with code {code}"
