# SPDX-License-Identifier: Apache-2.0
"""Dispersed runs of a mission: `fledge montecarlo MISSION`, or from Python

    from fledge.montecarlo import Campaign

    campaign = Campaign("nadir_spin")        # as its dispersions.py declares it; see fledge.montecarlo.dispersions
    result = campaign.fly(2000, seed=1)
    result.retained["flight.tracking.error.sigma_BR"]     # (2000, samples, 3)
    result.draws["world.craft.I_B[0, 0]"]                 # (2000,)
    result.failures                                       # index -> text
    sim = campaign.simulation(17, seed=1)                 # that run, ready to be flown by hand

A run is fixed by (seed, index): neither threads nor processes nor their order change a bit of it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from fledge import _core, mission as missions
from fledge.errors import SetupError
from fledge.mission.folder import MissionFiles, first_line, functions_of
from fledge.mission.simulation import Finding
from fledge.montecarlo.dispersions import Dispersions
from fledge.montecarlo.field_path import FieldPath

if TYPE_CHECKING:
    import numpy as np

    from fledge.mission.log import Log
    from fledge.mission.simulation import Simulation


class Campaign:
    """A mission, and the parameters that differ between its runs.

    mission: a name, or the path of a folder; name: of a function in its dispersions.py (default: the
    first), or a function that takes `d`; `known` lists those of the file, with the first lines of their
    docstrings.
    Raises SetupError, or MissionError with the line of the mission's file.
    """

    def __init__(self, mission: str | os.PathLike[str],
                 name: str | Callable[[Dispersions], Any] | None = None) -> None:
        self._mission, self._function = mission, name
        self.nominal, self.dispersions, self.known, self.name = _declare(mission, name)
        self.plan = self.dispersions._finished()
        self.summary = self.known.get(self.name, "")

    @property
    def has_callables(self) -> bool:
        """Whether the mission's events or modules call Python. Processes fly such runs, each in a mission loaded
        afresh, because the functions of one mission may share data."""
        return _core.has_callables(self.nominal.kernel)

    def simulation(self, index: int, seed: int = 0) -> Simulation:
        """The simulation of one run, its parameters and seed set, not yet run.

        Fly it for `campaign.dispersions.duration`.
        """
        if index < 0:
            raise SetupError(f"a run's index must be >= 0, found {index}")
        sim, dispersions, *_ = _declare(self._mission, self._function)
        plan = dispersions._finished()
        plan.seed = seed
        disperse(sim, sim, plan, index)
        return sim

    def fly(self, runs: int, seed: int = 0, threads: int | None = None, processes: bool = False,
            progress: Callable[[int, int], Any] | None = None, strict: bool = False) -> Result:
        """Fly the runs 0 to runs - 1; returns a Result.

        threads: default: all cores; processes: fly by processes even where threads would do;
        progress(finished, failed) is called about ten times a second; strict: a run with a finding about its
        health has failed. Ctrl-C stops the campaign: the
        result has the runs that were finished, and `interrupted` is set.
        Raises SetupError before the first run if something is wrong with all of them.
        """
        threads = cores() if threads is None else threads
        for value, what in ((runs, "runs"), (threads, "threads")):
            if value < 1:
                raise SetupError(f"{what} must be >= 1, found {value}")
        if not 0 <= seed < 2**64:
            raise SetupError(f"seed must be a whole number from 0 to 2^64 - 1, found {seed}")
        plan = self.plan
        plan.seed, plan.runs = seed, runs
        self._check_room(runs)
        self.nominal.kernel.ready_for(plan.duration)  # an error of the nominal run is one of all runs
        if processes or self.has_callables:
            return _fly_in_processes(self, runs, seed, min(threads, runs), progress, strict)
        flown, interrupted = _core.fly(self.nominal.kernel, plan, threads, progress)
        return Result(self, seed, flown.flown, flown.failures, flown.draws, flown.retained, interrupted,
                      flown.health, strict)

    def drawn(self, simulation: Simulation) -> dict[str, float]:
        """The values of the dispersed parameters in a simulation of this mission: path -> number."""
        return {path: FieldPath(simulation, path).value() for path in self.dispersions.columns}

    def judge(self, log: Log, seed: int = 0) -> Result:
        """The Result of one run that was flown by hand, from its records every `every`."""
        import numpy as np

        d = self.dispersions
        every = d.ns[1] if len(d.ns) > 1 else d.ns[0] + 1
        retained = []
        for path in d.retained:
            # As the kernel keeps them: between two instants a sample is that of the first.
            taken = np.rint(log.time_of(path) * 1e9).astype(np.int64) // every
            at = np.searchsorted(taken, np.arange(len(d.ns)), "right") - 1
            retained.append(log[path][np.maximum(at, 0)][None])
        return Result(self, seed, [True], [""], np.full((1, len(d.columns)), np.nan), retained, False, [[]])

    def _check_room(self, runs):
        numbers = sum(len(s.field_path.elements) for s in self.dispersions.retained.values())
        wanted = 8 * runs * len(self.dispersions.ns) * numbers
        room = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        if wanted > room / 2:
            raise SetupError(f"{runs} runs would retain {wanted / 1e9:.1f} GB, more than half of this machine's "
                             "memory: fly fewer, retain less, or set a longer d.every")

    def __repr__(self):
        return f"<campaign {self.name} of {self.nominal.name}: {len(self.dispersions.columns)} numbers dispersed>"


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0))


def _declare(mission, wanted):
    """A fresh simulation, its Dispersions, and the campaigns there are, for Campaign."""
    sim = missions.load(mission)
    dispersions = Dispersions(sim)
    if callable(wanted):
        wanted(dispersions)
        return sim, dispersions, {wanted.__name__: first_line(wanted.__doc__)}, wanted.__name__
    assert sim.mission
    path = sim.mission.folder / "dispersions.py"
    if not path.exists():
        raise SetupError(f"the mission {sim.name} declares no dispersions; expected them in {path}")
    with MissionFiles(sim.mission) as files:
        module = files.execute("dispersions")
        known = functions_of(module)
        if not known:
            raise SetupError(f"{path}: expected a function that takes d, as in def release(d)")
        name = wanted or next(iter(known))
        if name not in known:
            raise SetupError(f"the mission {sim.name} has no campaign '{name}'; it has {', '.join(known)}")
        files.call(known[name], dispersions)
        files.forget()
    return sim, dispersions, {n: first_line(f.__doc__) for n, f in known.items()}, name


def disperse(nominal: Simulation, simulation: Simulation, plan: Any, index: int) -> list[float]:
    """Set the parameters and the seed of a simulation to those of the run `index`; returns the numbers drawn.

    nominal: a simulation with the nominal parameters, which may be the same one
    """
    return _core.disperse(nominal.kernel, simulation.kernel, plan, index)


# --- results ---------------------------------------------------------------------------------------

class Result:
    """The results of a campaign.

    flown: (runs,) whether a run came to its end, or failed; False after Ctrl-C for those not finished
    passed: (runs,) flown without an error and with every requirement fulfilled
    failures: index -> text of each run that failed
    health: (runs,) lists of Findings, as of Simulation.health
    draws: path of each dispersed element -> (runs,), NaN where not flown
    retained: path -> (runs, samples, ...), NaN where not flown or after an error; read-only
    ns: (samples,) times of the samples [ns]; time: the same [s]
    """

    def __init__(self, campaign: Campaign, seed: int, flown: Sequence[bool], errors: Sequence[str], draws: np.ndarray,
                 retained: Sequence[np.ndarray], interrupted: bool, health: Sequence[Sequence[tuple]],
                 strict: bool = False) -> None:
        import numpy as np

        d = campaign.dispersions
        self.campaign, self.seed, self.interrupted = campaign, seed, interrupted
        self.ns = d.ns
        self.time = self.ns / 1e9
        self.flown = np.array(flown, bool)
        self.draws = {path: draws[:, i] for i, path in enumerate(d.columns)}
        self.retained = {}
        for (path, variable), values in zip(d.retained.items(), retained):
            self.retained[path] = values.reshape(*values.shape[:2], *variable.field_path.shape)
            self.retained[path].flags.writeable = False
        self.health = [[Finding(*row) for row in rows] for rows in health]
        self.errors = {i: text for i, text in enumerate(errors) if text}
        self.complete = self.flown.copy()
        self.complete[list(self.errors)] = False
        self.failures = dict(self.errors)
        for requirement in d.requirements:
            values, times, holds = requirement.worst(self)
            for i in np.flatnonzero(self.complete & ~holds):
                text = requirement.failure(values[i], times[i])
                self.failures[int(i)] = f"{self.failures[i]}; {text}" if i in self.failures else text
        if strict:
            for run, found in enumerate(self.health):
                if found:
                    self.failures.setdefault(run, "health: " + found[0].text)
        self.failures = dict(sorted(self.failures.items()))
        self.passed = self.flown.copy()
        self.passed[list(self.failures)] = False

    def unhealthy(self) -> list[tuple[Finding, list[int]]]:
        """Each kind of finding at each path, as of its first run, with all runs that have it; the most frequent come
        first."""
        runs: dict[tuple[str, str], tuple[Finding, list[int]]] = {}
        for run, found in enumerate(self.health):
            for one in found:
                runs.setdefault((one.kind, one.path), (one, []))[1].append(run)
        return sorted(runs.values(), key=lambda entry: -len(entry[1]))

    def __len__(self):
        return len(self.flown)

    def __repr__(self):
        return (f"<{len(self)} runs of {self.campaign.nominal.name}, {self.campaign.name}, seed {self.seed}: "
                f"{self.passed.sum()} passed, {len(self.failures)} failed"
                + (f", {(~self.flown).sum()} not flown" if not self.flown.all() else "") + ">")


# --- processes -------------------------------------------------------------------------------------

def _fly_in_processes(campaign, runs, seed, n, progress, strict):
    """The same as threads give, by processes, each run in a mission loaded afresh."""
    import multiprocessing
    from multiprocessing import connection

    import numpy as np

    d = campaign.dispersions
    draws = np.full((runs, len(d.columns)), np.nan)
    retained = [np.full((runs, len(d.ns), len(s.field_path.elements)), np.nan) for s in d.retained.values()]
    flown, errors = [False] * runs, [""] * runs
    health: list[list[tuple]] = [[] for _ in range(runs)]
    fork = multiprocessing.get_context("fork")
    following = fork.Value("q", 0)
    children: dict[Any, Any] = {}       # pipe -> process
    flying: dict[Any, int] = {}         # pipe -> index of the run in the air
    interrupted = False

    def start():
        ours, theirs = fork.Pipe()
        children[ours] = fork.Process(target=_fly_share, args=(campaign, runs, seed, following, theirs), daemon=True)
        children[ours].start()
        theirs.close()

    try:
        for _ in range(n):
            start()
        while children:
            pipe: Any
            for pipe in connection.wait(list(children), 0.1):
                try:
                    index, *results = pipe.recv()
                except EOFError:  # it has come to its end, or died in a run
                    child = children.pop(pipe)
                    child.join()
                    if pipe in flying:
                        index = flying.pop(pipe)
                        flown[index], errors[index] = True, _death(child.exitcode)
                        start()
                    continue
                if not results:
                    flying[pipe] = index
                    continue
                del flying[pipe]
                flown[index] = True
                errors[index], draws[index], own_retained, health[index] = results
                for to, values in zip(retained, own_retained):
                    to[index] = values
            if progress:
                progress(sum(flown), sum(map(bool, errors)))
    except KeyboardInterrupt:
        interrupted = True
    finally:
        for child in children.values():
            child.terminate()
            child.join()
    return Result(campaign, seed, flown, errors, draws, retained, interrupted, health, strict)


def _fly_share(campaign, runs, seed, following, pipe):
    """Fly the next run until there is none. Sends (index,), then the run's results."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles it, and ends the children
    while True:
        with following.get_lock():
            index = following.value
            following.value += 1
        if index >= runs:
            return
        pipe.send((index,))
        sim, dispersions, *_ = _declare(campaign._mission, campaign._function)
        plan = dispersions._finished()
        plan.seed = seed
        result = _core.fly_one(sim.kernel, plan, index)
        pipe.send((index, result.failures[0], result.draws[0], [values[0] for values in result.retained],
                   result.health[0]))


def _death(code):
    import signal

    if code is not None and code < 0:
        return f"the process that flew it was ended by {signal.Signals(-code).name}"
    return f"the process that flew it ended with code {code}"
