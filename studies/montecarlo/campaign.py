# SPDX-License-Identifier: Apache-2.0
"""A mission that flies many times, each time with other parameters."""

from __future__ import annotations

import math
import os
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import _core, mission as missions
from fledge.errors import SetupError, did_you_mean
from fledge.folders import first_line
from fledge.mission.field_path import FieldPath
from fledge.mission.folder import MissionFiles, functions_of
from fledge.mission.simulation import report_crashes
from fledge.montecarlo.dispersions import Dispersions
from fledge.montecarlo.requirements import Reported, Watch, repeated
from fledge.montecarlo.result import Result
from fledge.montecarlo.shares import Share, by_pool, by_threads
from fledge.montecarlo.store import Store
from fledge.objects.measured import unit_after
from fledge.objects.si import enumerator_names
from fledge.pool import Pool, anywhere, cores, open_pool
from fledge.progress import Bar

if TYPE_CHECKING:
    from fledge.mission.log import Log
    from fledge.mission.simulation import Simulation


class Campaign:
    """A mission, and the parameters that differ between its runs.

    mission: a name, or the path of a folder; name: of a function in its dispersions.py (default: the
    first), or a function that takes `d`; `known` lists those of the file, with the first lines of their
    docstrings.
    Raises SetupError, or MissionError with the line of the mission's file.
    """

    values: dict[str, list[float]] = {}     # of runs whose numbers are chosen; else there are none
    keeps_seen = False                      # whether Store.seen has what each run has seen

    def __init__(self, mission: str | os.PathLike[str],
                 name: str | Callable[[Dispersions], Any] | None = None) -> None:
        self._mission, self._function = mission, name
        self.nominal, self.dispersions, self.known, self.name = self._declare(0)
        self.plan = self.dispersions._finished()
        self.summary = self.known.get(self.name, "")
        # The elements of orbits as they were drawn: a state does not tell all of them.
        self._orbits: weakref.WeakKeyDictionary[Simulation, list[float]] = weakref.WeakKeyDictionary()

    @property
    def folder(self) -> Path:
        """The mission's folder."""
        assert self.nominal.mission
        return self.nominal.mission.folder

    @property
    def recipe(self) -> tuple[Any, tuple]:
        """(class, arguments) that make this campaign in another program."""
        return type(self), (anywhere(self._mission), self._function)

    @property
    def has_callables(self) -> bool:
        """Whether the mission's events or modules call Python. Processes fly such runs, each in a mission loaded
        afresh, because the functions of one mission may share data."""
        return bool(_core.callables(self.nominal.kernel))

    def tell_crashes(self, command: Sequence[str]) -> None:
        """If a run crashes, tell what shows it in a debugger: this command, followed by the index of the run."""
        report_crashes(_core, command)

    def simulation(self, index: int, seed: int = 0) -> Simulation:
        """The simulation of one run, its parameters and seed set, not yet run.

        Fly it for `campaign.dispersions.duration`. Raises SetupError for an index < 0, or as Campaign() does.
        """
        if index < 0:
            raise SetupError(f"a run's index must be >= 0, found {index}")
        sim, plan = self._load(index)
        plan.seed = seed
        draws = disperse(sim, sim, plan, index)
        self._orbits[sim] = draws[len(draws) - len(self.dispersions.composed):]
        return sim

    def fly(self, runs: int, seed: int = 0, threads: int | None = None, processes: bool = False,
            progress: Callable[[int, int], Any] | None = None, strict: bool = False,
            folder: str | os.PathLike[str] | None = None, scheduler: str | Pool | None = None) -> Result:
        """Fly the runs 0 to runs - 1; returns a Result.

        threads: default: all cores; processes: fly by processes even where threads would do; scheduler: the address of
        a Dask scheduler, whose workers fly in place of both, or a pool of them that is open;
        progress(finished, failed) is called about ten times a second; not given: as fledge.progress shows it;
        strict: a run with a finding about its health has failed. folder: results go to disk there, in `unfinished`, so
        that a campaign that was broken off goes on where it was; Result.close() deletes them. Ctrl-C stops the
        campaign: the result has the runs that were finished, and `interrupted` is set.
        Raises SetupError before the first run if something is wrong with all of them, or with the workers; RunError if
        the scheduler goes away.
        """
        threads = cores() if threads is None else threads
        for value, what in ((runs, "runs"), (threads, "threads")):
            if value < 1:
                raise SetupError(f"{what} must be >= 1, found {value}")
        if not 0 <= seed < 2**64:
            raise SetupError(f"seed must be a whole number from 0 to 2^64 - 1, found {seed}")
        self.nominal.kernel.ready_for(self.plan.duration)  # an error of the nominal run is one of all runs
        store = Store(self, runs, seed, Path(folder) if folder else None, strict)
        before, bad = store.finished, len(store.errors)

        live = Bar(self.name)

        def report(finished: int, failed: int) -> None:
            finished, failed = before + finished, bad + failed
            if progress:
                progress(finished, failed)
            else:
                live.at(finished / runs, f"{finished} of {runs}" + (f", {failed} failed" if failed else ""))

        report(0, 0)
        interrupted = False
        with live, ExitStack() as opened:
            opened.callback(store.save)
            try:
                if scheduler or processes or self.has_callables:
                    pool = scheduler if isinstance(scheduler, Pool) else opened.enter_context(
                        open_pool(threads, scheduler))
                    shares = by_pool(self, store.missing(), seed, pool, report)
                else:
                    shares = by_threads(self, store.missing(), seed, threads, report)
                for share in opened.enter_context(closing(shares)):
                    store.add(share)
                report(store.finished - before, len(store.errors) - bad)
            except KeyboardInterrupt:
                interrupted = True
            except SetupError:
                if not store.finished:      # it has not begun
                    store.close()
                raise
        return Result(self, seed, store, interrupted)

    def drawn(self, simulation: Simulation) -> dict[str, float]:
        """The dispersed numbers of a simulation that simulation() gave, or of another one of this mission, which has
        the nominal orbit: path -> number in SI."""
        elements = self.dispersions.composed
        drawn = dict(zip(elements, self._orbits.get(simulation, elements.values())))
        return {path: drawn[path] if path in drawn else FieldPath(simulation, path).value()
                for path in self.dispersions.drawn}

    def enumerators(self, path: str) -> Mapping[float, str]:
        """Number -> name of the enumerators that a draw chooses among; {} of a draw of numbers."""
        if path in self.dispersions.composed or path in getattr(self, "parameters", ()):
            return self.dispersions.labels.get(path, {})
        return {float(n): name for n, name in enumerator_names(FieldPath(self.nominal, path).field).items()}

    def shown(self, path: str, x: float) -> str:
        """A drawn number for people: the name of an enumerator, seconds, or with its unit in SI."""
        unit = self.dispersions.columns.get(path, "")       # "SI" where it depends on the model, as of a fault
        plain = f"{x / 1e9:.7g} s" if unit == "ns" else f"{x:.7g}{unit_after(unit) if unit != 'SI' else ''}"
        return self.enumerators(path).get(x, plain)

    def watch(self, simulation: Simulation) -> Watch:
        """Look at a run by hand from now on, for judge()."""
        return Watch(self.dispersions, simulation)

    def judge(self, log: Log, watch: Watch, seed: int = 0) -> Result:
        """The Result of one run that was flown by hand, from its records every `every`, and from what watched it. log:
        has all retained fields, at their samples; else SetupError."""
        import numpy as np

        d = self.dispersions
        retained = []
        for variable in d.retained.values():
            if isinstance(variable, Reported):
                retained.append(watch.found(variable, len(d.ns))[None])
                continue
            path = variable.field_path.recorded
            at, _ = repeated(np.rint(log.time_of(path) * 1e9).astype(np.int64), d._sampling(), len(d.ns))
            retained.append(np.asarray((log.raw if variable.raw else log)[path][at], float).reshape(1, len(d.ns), -1))
        store = Store(self, 1, seed)
        store.add(Share(0, [True], [""], [[]], np.full((1, len(d.columns)), np.nan),
                        np.array([[self._entered(log, name) for name in d.modes]]).reshape(1, -1), retained,
                        np.zeros((1, 0), np.uint8)))
        return Result(self, seed, store)

    @staticmethod
    def _entered(log: Log, name: str) -> float:
        """[s] when a mode first began in the simulation of a log; NaN: it did not."""
        process, _, mode = name.split(".", 2)
        first = log.simulation.process(process).entered[mode][1]
        return math.nan if first is None else first

    def _load(self, index: int) -> tuple[Simulation, Any]:
        """A fresh simulation of the mission for a run, and the plan for it."""
        sim, dispersions, *_ = self._declare(index)
        return sim, dispersions._finished()

    def _declare(self, index: int) -> tuple[Simulation, Dispersions, dict[str, str], str]:
        """A fresh simulation for a run, its Dispersions, and the name and the others of its campaign."""
        return declare(self._mission, self._function, {})

    def take(self, values: dict[str, list[float]]) -> None:
        """Fly runs with these chosen numbers next; {}: with those that are drawn."""
        assert values == self.values

    def complete(self, share: Share) -> Share:
        """A share with the numbers of its runs that the kernel does not know."""
        return share

    def _repr_html_(self) -> str:
        from fledge.display import table

        d = self.dispersions
        drawn = [(path, repr(draw)) for path, draw in d.draws.items()]
        retained = [(variable.path, variable.field_path.field.doc) for variable in d.shown]
        checked = [(repr(requirement), requirement.message) for requirement in d.requirements]
        return table(f"{self.name} of {self.nominal.name}, runs of {d.duration:g} s",
                     [("dispersed", drawn), ("retained", retained), ("requirements", checked)], notes=[self.summary])

    def __repr__(self) -> str:
        return f"<campaign {self.name} of {self.nominal.name}: {len(self.dispersions.columns)} numbers dispersed>"


class Chosen(Campaign):
    """A campaign whose runs have chosen numbers in place of draws: choose() them, then fly() as many runs."""

    def choose(self, values: Mapping[str, Sequence[float]]) -> None:
        """The numbers of the runs that fly() flies next, as of Dispersions.choose(). Raises SetupError on a number that
        its parameter cannot have."""
        self.values = {}
        self.dispersions.choose(values)
        self.values = {path: [float(x) for x in numbers] for path, numbers in values.items()}

    def take(self, values: dict[str, list[float]]) -> None:
        """Fly runs with these chosen numbers next: choose(), unless they are chosen already."""
        if values != self.values:
            self.choose(values)

    def _declare(self, index: int) -> tuple[Simulation, Dispersions, dict[str, str], str]:
        sim, dispersions, known, name = super()._declare(index)
        if self.values:
            dispersions.choose(self.values)
        return sim, dispersions, known, name


def declare(mission: str | os.PathLike[str], wanted: str | Callable[[Dispersions], Any] | None,
            parameters: dict[str, Any], prepare: Callable[[Simulation], Any] | None = None,
            ) -> tuple[Simulation, Dispersions, dict[str, str], str]:
    """(a fresh simulation, its Dispersions, the campaigns that there are, the name of this one)

    parameters: of the mission; prepare(simulation): before anything is dispersed"""
    sim = missions.load(mission, **parameters)
    if prepare:
        prepare(sim)
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
            raise SetupError(f"the mission {sim.name} has no campaign '{name}'{did_you_mean(name, known)} it has "
                             f"{', '.join(known)}")
        files.call(known[name], dispersions)
        files.forget()
    return sim, dispersions, {n: first_line(f.__doc__) for n, f in known.items()}, name


def disperse(nominal: Simulation, simulation: Simulation, plan: Any, index: int) -> list[float]:
    """Set the parameters and the seed of a simulation to those of the run `index`; returns the numbers drawn.

    nominal: a simulation with the nominal parameters, which may be the same one
    """
    return _core.disperse(nominal.kernel, simulation.kernel, plan, index)
