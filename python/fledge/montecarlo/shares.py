# SPDX-License-Identifier: Apache-2.0
"""Shares of a campaign: the results of some of its runs, and the ways to fly them on this machine."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, field
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
    draws: (runs, dispersed numbers); retained: (runs, samples, elements) of each variable; NaN where not flown, and
    after an error.
    """
    first: int
    flown: list[bool]
    errors: list[str]
    health: list[list[tuple]]
    draws: np.ndarray
    retained: list[np.ndarray]

    @classmethod
    def of(cls, first: int, result: Any) -> Share:
        """What the kernel gives."""
        return cls(first, result.flown, result.failures, result.health, result.draws, result.retained)

    @classmethod
    def joined(cls, shares: Sequence[Share]) -> Share:
        """Shares that follow each other as one."""
        import numpy as np

        return cls(shares[0].first, [x for one in shares for x in one.flown], [x for one in shares for x in one.errors],
                   [x for one in shares for x in one.health], np.concatenate([one.draws for one in shares]),
                   [np.concatenate(values) for values in zip(*(one.retained for one in shares))])

    @classmethod
    def failed(cls, campaign: Campaign, index: int, error: str) -> Share:
        """A run that left nothing but the reason."""
        import numpy as np

        d = campaign.dispersions
        return cls(index, [True], [error], [[]], np.full((1, len(d.columns)), np.nan),
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
    following = fork.Value("q", 0)
    children: dict[Any, Any] = {}       # pipe -> process
    flying: dict[Any, int] = {}         # pipe -> index of the run in the air
    finished = failed = 0

    def start():
        ours, theirs = fork.Pipe()
        children[ours] = fork.Process(target=_fly_following, args=(campaign, ranges, seed, following, theirs),
                                      daemon=True)
        children[ours].start()
        theirs.close()

    try:
        for _ in range(min(processes, sum(end - first for first, end in ranges))):
            start()
        while children:
            pipe: Any
            for pipe in connection.wait(list(children), 0.1):
                try:
                    found = pipe.recv()
                except EOFError:  # it has come to its end, or died in a run
                    child = children.pop(pipe)
                    child.join()
                    if pipe not in flying:
                        continue
                    found = Share.failed(campaign, flying[pipe], death(child.exitcode))
                    start()
                if isinstance(found, int):
                    flying[pipe] = found
                    continue
                del flying[pipe]
                finished, failed = finished + 1, failed + bool(found.errors[0])
                yield found
            progress(finished, failed)
    finally:
        for child in children.values():
            child.terminate()
            child.join()


def _fly_following(campaign, ranges, seed, following, pipe):
    """Fly the next run until there is none. Sends its index, then its share."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles it, and ends the children
    while True:
        with following.get_lock():
            index = _nth(ranges, following.value)
            following.value += 1
        if index is None:
            return
        pipe.send(index)
        pipe.send(fly_loaded(campaign, seed, index))


def _nth(ranges: Iterable[tuple[int, int]], n: int) -> int | None:
    """The n-th index of ranges."""
    for first, end in ranges:
        if n < end - first:
            return first + n
        n -= end - first
    return None


def death(code: int | None) -> str:
    """Why a process ended, by its exit code."""
    import signal

    if code is not None and code < 0:
        return f"the process that flew it was ended by {signal.Signals(-code).name}"
    return f"the process that flew it ended with code {code}"
