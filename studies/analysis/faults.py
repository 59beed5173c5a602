# SPDX-License-Identifier: Apache-2.0
"""Faults as a matrix (FMEA): each unit of the world by each kind of fault by each mode of a scenario, flown and
compared with the flight without the fault.

    matrix = Matrix("sun_safe")
    flights = fly(matrix, ["safe"])         # a Flight for each fault; see its docstring

A scenario is flown once until the fault begins; there the program forks, once for each fault, and each child goes on
with its own. So a fault costs the rest of the run, and the scenario's Python needs no copy. On a cluster, each
worker flies a share of the faults so.
"""

from __future__ import annotations

import itertools
import operator
import os
import pickle
import traceback
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from multiprocessing.connection import Connection
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import mission as missions, objects
from fledge.analysis.comparison import Flight, Seen, compare, mode_at
from fledge.analysis.matrix import Fault, Matrix, plant
from fledge.errors import CompositionError, RunError, SetupError
from fledge.disk import shown
from fledge.mission.checks import has_checks
from fledge.mission.log import Log
from fledge.mission.scenario import chosen
from fledge.objects.si import time_ns
from fledge.pool import Children, Died, Local, Pool, Work, open_pool
from fledge.records.activity import happenings
from fledge.requirements import Requirements
from fledge.requirements.judge import HOLDS

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation
    from fledge.requirements import Judged

SECOND = 10**9          # [ns]
LEAD = 10 * SECOND      # a fault is planned so long before it begins: delays and drop-outs need earlier samples


class _Done(BaseException):
    """All copies have ended, so that the rest of the scenario is not needed here; or why none shall fly."""


class _Limit(BaseException):
    """The flight has come to its limit; the rest of the scenario is left out."""


class Plan(NamedTuple):
    """Flights of a scenario, each with its faults from a time [ns] on. first: the place of the first of them among all
    that are flown; lasts, limit: [ns], as of fly()"""
    first: int
    scenario: str
    tasks: list[tuple[int, list[Fault]]]
    lasts: int
    limit: int | None


def cut(plan: Plan, begin: int, end: int) -> Plan:
    """The tasks begin to end - 1 of a plan."""
    return plan._replace(first=plan.first + begin, tasks=plan.tasks[begin:end])


class _Faults(Work[Plan, tuple[int, list[Flight]]]):
    """Shares of a matrix as the work of a pool."""

    def __init__(self, matrix: Matrix) -> None:
        assert matrix.simulation.mission
        self.matrix, self.folder = matrix, matrix.simulation.mission.folder
        self.baselines: dict[tuple[str, int | None], Seen] = {}     # by scenario and limit

    @property
    def recipe(self) -> tuple[Callable[..., _Faults], tuple[Any, ...]]:
        return _Faults.made, self.matrix.recipe

    @classmethod
    def made(cls, *arguments: Any) -> _Faults:
        return cls(Matrix.made(*arguments))

    def baseline(self, scenario: str, limit: int | None) -> Seen:
        """The flight without a fault."""
        if (scenario, limit) not in self.baselines:
            self.baselines[scenario, limit] = _flight(self.matrix, scenario, limit=limit)
        return self.baselines[scenario, limit]

    def fly(self, item: Plan) -> tuple[int, list[Flight]]:
        return item.first, _Branches(self, item, 1).fly()

    def split(self, item: Plan) -> list[Plan]:
        middle = len(item.tasks) // 2
        return [cut(item, 0, middle), cut(item, middle, len(item.tasks))] if middle else []

    def failed(self, plan: Plan, index: int, text: str) -> Flight:
        """A flight whose process has ended."""
        ns, faults = plan.tasks[index]
        baseline = self.baseline(plan.scenario, plan.limit)
        return Flight(plan.scenario, mode_at(baseline, ns / 1e9), ns / 1e9, faults, "failed", text=text)


class _Branches:
    """The flights of a plan: its scenario flies up to each beginning, where a copy of this process goes on with each
    fault, several at a time. progress(done): about every second"""

    def __init__(self, work: _Faults, plan: Plan, jobs: int,
                 progress: Callable[[int], Any] = lambda done: None) -> None:
        self._work, self._plan, self._jobs, self._progress = work, plan, jobs, progress
        self._stops = sorted({max(0, ns - LEAD) for ns, _ in plan.tasks})
        self._children = Children()
        self._flights: list[Any] = [None] * len(plan.tasks)
        self._mine: tuple[int, Connection] | None = None    # of a copy: its task, its pipe

    def fly(self) -> list[Flight]:
        plan = self._plan
        baseline = self._work.baseline(plan.scenario, plan.limit)
        try:
            seen = _flight(self._work.matrix, plan.scenario, self._stops, self._stopped, plan.limit)
            if self._mine:
                index, pipe = self._mine
                pipe.send_bytes(pickle.dumps(seen.problem if seen.failed == "SetupError" else compare(
                    self._work.matrix, plan.scenario, baseline, seen, *plan.tasks[index])))
                os._exit(0)
        except _Done as end:
            if end.args:
                raise end.args[0] from None
            return self._flights
        finally:
            if self._mine:
                traceback.print_exc()
                os._exit(1)
            self._children.end()
        raise SetupError(f"the scenario {plan.scenario} never reaches {self._stops[-1] / 1e9:g} s by sim.run()")

    def _stopped(self, sim: Simulation, at: int) -> None:
        try:
            self._fork_each(sim, at)
        except KeyboardInterrupt:
            raise _Done(KeyboardInterrupt()) from None      # which a script of the ground would take for its own

    def _fork_each(self, sim: Simulation, at: int) -> None:
        """Begin the flights of the faults that are planned at a stop [ns]."""
        if self._mine:
            return
        for index, (ns, faults) in enumerate(self._plan.tasks):
            if max(0, ns - LEAD) != at or self._flights[index]:
                continue
            self._collect(self._jobs - 1)
            pipe = self._children.fork(index)
            if pipe:
                self._mine = index, pipe
                sim.__dict__["_plant"] = lambda: plant(sim, ns, faults, self._plan.lasts)
                return
        self._collect(0)
        if at == self._stops[-1]:
            raise _Done

    def _collect(self, most: int) -> None:
        """Wait until at most so many copies fly."""
        while len(self._children) > most:
            self._progress(sum(map(bool, self._flights)))
            for index, answer, pipe in self._children.answers():
                if isinstance(answer, str) or pipe is None:
                    self._flights[index] = self._work.failed(self._plan, index, str(answer))
                    continue
                self._children.dismiss(pipe)
                result = pickle.loads(answer)
                if isinstance(result, str):
                    raise _Done(SetupError(f"{' and '.join(map(str, self._plan.tasks[index][1]))}: {result}"))
                self._flights[index] = result


def fly(matrix: Matrix, scenarios: Sequence[str] = (), faults: Sequence[Fault] | None = None, double: bool = False,
        begin: Sequence[Any] | None = None, lasts: Any = None, jobs: int | None = None, limit: Any = None,
        progress: Callable[[int, int, float], Any] = lambda done, all_, expected: None,
        scheduler: str | None = None) -> list[Flight]:
    """Fly each fault in each scenario; returns a Flight for each, in the order of the declarations.

    scenarios: by name; default: the first. faults: at least one; None: all. double: the pairs of faults of different
    units too. begin: times, at least one; None: those of the matrix, or the middle of each mode's first stay. lasts: a
    time; 0: for ever. jobs: processes at a time; default: all cores. limit: a time at which each flight ends; default:
    with its scenario. progress(done, all, [s] that all will take, by the flights without a fault): before the first,
    and about every second. scheduler: the address of a Dask scheduler, whose workers fly instead.
    Raises SetupError before the first flight if something is wrong with all of them.
    """
    names = [matrix.scenario(scenario) for scenario in scenarios] or [chosen(matrix.simulation, None)[0]]
    sets = _sets(matrix.faults() if faults is None else faults, double)
    times = _times(matrix.begin if begin is None else begin)
    for_ns = time_ns(matrix.lasts if lasts is None else lasts, "lasts")
    end = None if limit is None else time_ns(limit, "limit")
    work = _Faults(matrix)
    with open_pool(jobs, scheduler) as pool:
        plans: list[Plan] = []
        expected = 0.0
        for name in names:
            begins, wall, duration = _begins(work, name, end, times)
            tasks = [(ns, together) for ns in sorted(set(begins)) for together in sets]
            plans.append(Plan(sum(len(plan.tasks) for plan in plans), name, tasks, for_ns, end))
            # The rest of each flight, several at a time, and the one that leads up to all.
            rest = sum(1 - max(0, ns - LEAD) / 1e9 / duration for ns, _ in tasks)
            expected += wall * (rest / min(pool.threads, len(tasks)) + max(begins) / 1e9 / duration)
        count = sum(len(plan.tasks) for plan in plans)
        flown: dict[int, Flight] = {}

        def report(done: int = 0) -> None:
            progress(len(flown) + done, count, expected)

        report()
        with closing(_flown(work, plans, len(sets), pool, report)) as results:
            for first, flights in results:
                flown.update(enumerate(flights, first))
    return [flown[place] for place in sorted(flown)]


def _sets(faults: Sequence[Fault], double: bool) -> list[list[Fault]]:
    """The faults that are flown together."""
    if not faults:
        raise SetupError("faults: expected at least one, found none; None stands for all")
    pairs = itertools.combinations(faults, 2) if double else ()
    return [*([fault] for fault in faults), *(list(pair) for pair in pairs if pair[0].unit != pair[1].unit)]


def _times(given: Any) -> list[int] | None:
    """[ns] of a time or several; None: they follow from the flight."""
    if given is None:
        return None
    times = [time_ns(time, "begin") for time in (given if isinstance(given, (list, tuple)) else [given])]
    if not times:
        raise SetupError("begin: expected at least one time, found none; None stands for those of the modes")
    return times


def _begins(work: _Faults, scenario: str, limit: int | None, times: list[int] | None) -> tuple[list[int], float, float]:
    """(the beginnings of faults [ns] in a scenario, wall time [s] of the flight without a fault, its duration [s])"""
    started = perf_counter()
    baseline = work.baseline(scenario, limit)
    wall = perf_counter() - started
    if baseline.problem and (baseline.failed or not baseline.duration):
        raise SetupError(f"{work.matrix.simulation.name}, {scenario} does not fly without a fault: {baseline.problem}")
    begins = _middles(baseline) if times is None else times
    for ns in begins:
        if not 0 <= ns < baseline.duration * 1e9:
            raise SetupError(f"begin: {ns / 1e9:g} s is not within the scenario {scenario}, which flies "
                             f"{baseline.duration:g} s")
    return begins, wall, baseline.duration


def _flown(work: _Faults, plans: Sequence[Plan], together: int, pool: Pool,
           report: Callable[..., None]) -> Generator[tuple[int, Sequence[Flight]], None, None]:
    """(place of the first, flights) of all plans, as they come. together: the faults that begin at a time"""
    if isinstance(pool, Local):
        for plan in plans:
            yield plan.first, _Branches(work, plan, pool.threads, report).fly()
        return
    # Faults that begin together are a share for each thread, which repeats the flight before them.
    size = -(-together // pool.threads)
    shares = [cut(plan, first, min(first + size, begun + together)) for plan in plans
              for begun in range(0, len(plan.tasks), together)
              for first in range(begun, begun + together, size)]
    results = pool.fly(work, shares, report)
    with closing(results):
        for _, result in results:
            if isinstance(result, Died):
                yield result.item.first, [work.failed(result.item, 0, result.text)]
            else:
                yield result


def _middles(baseline: Seen) -> list[int]:
    """[ns] The middle of the first stay in each mode of the process with the most; else a third of the flight."""
    stays: list[tuple[float, str]] = max(baseline.modes.values(), key=len, default=[])
    first: dict[str, float] = {}
    for (t, name), end in zip(stays, [*(t for t, _ in stays[1:]), baseline.duration]):
        first.setdefault(name, (t + end) / 2)
    return [int(t) * SECOND for t in first.values()] or [int(baseline.duration / 3) * SECOND]


def _flight(matrix: Matrix, name: str, stops: Sequence[int] = (), then: Callable[[Any, int], Any] | None = None,
            limit: int | None = None) -> Seen:
    """Fly a scenario, at most up to a limit [ns], and return its results. At each of the stops [ns] `then` is called
    with the simulation."""
    sim = matrix.load()
    assert sim.mission
    _, function = chosen(sim, name)
    sim.plots = False
    watch = _watch(sim, name, matrix.left_out)
    _on_the_way(sim, list(stops), then, limit)
    problem, failed = "", ""
    try:
        function(sim)
    except _Limit:
        pass
    except CompositionError:
        raise
    except Exception as error:      # a check does not hold, or the run cannot go on
        problem = missions.explain(error, sim.mission.folder)
        failed = "RunError" if isinstance(error, RunError) else "SetupError" if isinstance(error, SetupError) else ""
    problem = problem.split("\n")[0].replace(f"{shown(sim.mission.folder)}/", "")
    activity = happenings(sim.activity)
    modes = {process.name: [(happening.t, happening.name) for happening in activity
                            if happening.kind == "mode" and happening.process == process.name]
             for process in sim.processes if process.modes}
    outcomes = {outcome.requirement.id: outcome for outcome in watch.outcomes()} if watch and not failed else {}
    judged = (any(outcome.verdict == HOLDS for outcome in outcomes.values()) if outcomes else
              not problem and has_checks(function))
    return Seen(activity, modes, {port.name: port.decoded() for port in Log(sim, sim.kernel.logs)._ports()},
                {process.name for process in sim.flights}, sim.time, problem, failed, judged, outcomes,
                _traces(watch) if watch and not failed else {})


def _watch(sim: Simulation, name: str, left_out: set[str]) -> Judged | None:
    """Judge the requirements that a scenario shows while it flies; None: there are none."""
    requirements = Requirements(sim)
    ids = [requirement.id for requirement in requirements.for_scenario(name) if requirement.id not in left_out]
    return requirements.watch(ids, traces=True) if ids else None


def _traces(watch: Judged) -> dict[tuple[str, str], Any]:
    """Each requirement's comparisons over time: (id, text) -> (times [s], whether it held)."""
    relations: dict[str, Callable[[Any, Any], Any]] = {
        "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne}
    traces = {}
    for requirement in watch.requirements:
        for comparison in requirement.formula.comparisons if requirement.formula is not None else ():
            times, values = watch.values(comparison)
            traces[requirement.id, comparison.text] = times, relations[comparison.relation](values, comparison.limit)
    return traces


def _on_the_way(sim: Simulation, stops: list[int], then: Callable[[Any, int], Any] | None, limit: int | None) -> None:
    """Make a simulation record the outputs that are compared, and stop at some rising times [ns] to call `then`. Its
    scenario ends at the limit [ns], if that is not None."""
    run = sim.run
    recorded: list[bool] = []

    def go(ns: int, more: dict[str, Any]) -> None:
        plant = sim.__dict__.get("_plant")
        if plant:       # of a child; there are several, and all write to one terminal
            plant()
        run(until=ns / 1e9, **{**more, "progress": False if plant else None})

    def on_the_way(duration: Any = None, *, until: Any = None, **more: Any) -> None:
        if not recorded:
            recorded.append(_record(sim))
        start = max(sim.time_ns, 0)
        end = start + time_ns(duration, "run") if until is None else time_ns(until, "run: until")
        over = limit is not None and end > limit
        end = limit if limit is not None and over else end
        while stops and stops[0] <= end:
            ns = stops.pop(0)
            if ns > start:
                go(ns, more)
            if then:
                then(sim, ns)
        go(end, more)
        if over:
            raise _Limit

    sim.__dict__["run"] = on_the_way


def _record(sim: Simulation) -> bool:
    """Record all outputs of flight, and attitudes. What the scenario records keeps its period: a port has one record,
    with the shorter of two periods."""
    own = {record.path for record in sim.records}
    period = min((task.period for process in sim.flights for task in process.tasks), default=SECOND)
    for process in sim.processes:
        for instance in process:
            for f in objects.struct(instance).fields:
                if f.group == "out" and f"{objects.path(instance)}.{f.name}" not in own:
                    if process in sim.flights:
                        sim.record(getattr(instance, f.name), every=period / 1e9)
                    elif objects.struct(instance).name == "Spacecraft" and f.name == "state":
                        sim.record(getattr(instance, f.name), every=1.0)
    return True
