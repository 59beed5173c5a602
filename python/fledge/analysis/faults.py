# SPDX-License-Identifier: Apache-2.0
"""Faults as a matrix (FMEA): each unit of the world by each kind of fault by each mode of a scenario, flown and
compared with the flight without the fault.

    matrix = Matrix("sun_safe")
    flights = fly(matrix, ["safe"])         # a Flight for each fault; see its docstring

A scenario is flown once until the fault begins; there the program forks, once for each fault, and each child goes on
with its own. So a fault costs what is left of the run, and the scenario's Python needs no copy.

A mission may say more in its faults.py, in one function that takes `m`:

    def matrix(m):
        m.begin = [200 * s, 50 * minute]                        # default: the middle of each mode's first stay
        m.fault("world.gyro", "BIAS", size=0.1 * deg / s)       # in place of the usual one; several are several faults
        m.without("world.css", "DELAY", "BIAS")                 # not flown; without kinds: none of the unit
        m.detects("flight.sun.status.faulty")                   # flight says here that something is wrong
        m.isolates("flight.sun.status.faulty", {"world.adc_a": 0b01, "world.adc_b": 0b10})
        m.nominal("FDP-4")                                      # not judged: a requirement for where nothing fails
"""

from __future__ import annotations

import functools
import itertools
import math
import operator
import os
import pickle
import select
import signal
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import mission as missions, objects
from fledge.errors import CompositionError, RunError, SetupError, did_you_mean, listed, refuse_misspelt
from fledge.files import shown
from fledge.mission.checks import has_checks
from fledge.mission.field_path import FieldPath
from fledge.mission.folder import MissionFiles, functions_of
from fledge.mission.log import Log
from fledge.mission.scenario import chosen
from fledge.objects.si import enumerator_names, time_ns
from fledge.records.activity import happenings
from fledge.requirements import Requirements
from fledge.requirements.judge import HOLDS

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation

FILE = "faults.py"
SECOND = 10**9          # [ns]
LEAD = 10 * SECOND      # a fault is planned so long before it begins: delays and drop-outs need what was before

# What a channel gives at most, where the model has no limit of its own, in the unit of the channel: a number, or the
# name of a parameter. A usual bias is a tenth of it, a usual drift a tenth in a minute. 1: of any other model.
LIMITS: dict[str, float | str] = {
    "Accelerometer": 1.0, "CoarseSunSensors": "current", "ControlMomentGyros": 1.0, "CraftSensor": 10.0,
    "GpsReceiver": 10e3, "Gyro": 0.1, "GyroElectronics": "bits", "Magnetometer": 100e-6, "Navigation": 0.1,
    "ReactionWheels": "u_max", "StarTracker": 1.0, "StarTrackerElectronics": "bits", "SunSensor": 1.0,
    "SunSensorConverter": "bits", "Thrusters": "F", "TorqueRods": "m_max", "WheelConverter": 100.0}
SHARE, DELAY = 0.1, 1.0


class Fault(NamedTuple):
    """A fault to be flown. fields: of the model's `faults`, as assigned, without the times"""
    unit: str
    kind: str
    fields: Mapping[str, Any] = {}

    @property
    def details(self) -> str:
        """Its fields in words."""
        return ", ".join(f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
                         for name, value in self.fields.items())

    def __str__(self) -> str:
        return f"{self.unit} {self.kind}" + (f" ({self.details})" if self.fields else "")


@dataclass
class Flight:
    """A flight with a fault, or with two. Times are [s] since the fault began; None: it did not happen.

    mode: that flight was in as the fault began, "" of a process without modes
    effect: "none", where no output of flight and no attitude differs from the undisturbed flight by a bit; "tolerated",
    or "unjudged" where nothing judges the flight; "violated": a requirement does not hold that held without the fault;
    of a mission without requirements: a check of the scenario; "unknown": one cannot be judged; "failed": the run did
    not come to its end
    detected, by: when flight first said that something is wrong, and how
    isolated, as_: when it took a unit that has the fault out of use; wrongly: units without a fault that it took out
    back: when flight was back for good: in the modes of the undisturbed flight, and with each comparison of a violated
    requirement true that is true there; None: it was not by the end. 0: it never left
    ends: the mode at the end; violated, unknown: requirement -> its margin in words; least: of those that hold, the one
    that lost most: (requirement, share of the undisturbed margin that is left, the margin in words)
    text: the check or the error that ended it; off, off_end: [deg] from the attitude of the undisturbed flight, at most
    and at the end
    """
    scenario: str
    mode: str
    begin: float
    faults: list[Fault]
    effect: str = "none"
    detected: float | None = None
    by: str = ""
    isolated: float | None = None
    as_: str = ""
    wrongly: list[str] = field(default_factory=list)
    back: float | None = None
    ends: str = ""
    violated: dict[str, str] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    least: tuple[str, float, str] | None = None
    text: str = ""
    off: float = 0.0
    off_end: float = 0.0


class Matrix:
    """The units and faults of a mission: `m`, which the function of its faults.py completes.

    parameters: of the mission. Raises SetupError, with the line of the mission's file.
    """

    def __init__(self, mission: str | os.PathLike[str], seed: int = 0, **parameters: Any) -> None:
        self._load = lambda: missions.load(mission, seed, **parameters)
        sim = self.simulation = self._load()
        self.begin: Any = None      # times; None: the middle of each mode's first stay
        self.lasts: Any = 0         # a time; 0: for ever
        self.units = {objects.path(one): one for process in sim.processes for one in process if _takes_faults(one)}
        self._own: dict[tuple[str, str], list[Fault]] = {}
        self._without: set[tuple[str, str]] = set()
        self.detecting: list[str] = []
        self.isolating: dict[str, dict[str, int]] = {}
        self.named: dict[str, dict[int, str]] = {}      # path -> what its bits mean, of flight's tables
        self.left_out: set[str] = set()     # ids of requirements
        self._tables()
        assert sim.mission
        if (sim.mission.folder / FILE).exists():
            with MissionFiles(sim.mission) as files:
                known = functions_of(files.execute(FILE.removesuffix(".py")))
                if len(known) != 1:
                    raise SetupError(f"{sim.mission.folder / FILE}: expected one function that takes m, as in "
                                     f"def matrix(m); found {listed(list(known))}")
                files.call(*known.values(), self)
                files.forget()

    def __setattr__(self, name: str, value: Any) -> None:
        refuse_misspelt(self, name, ("begin", "lasts"))
        object.__setattr__(self, name, value)

    def _tables(self):
        """What a table of flight's units isolates: the unit of the world that has its load of the power unit."""
        sim = self.simulation
        powered = {target.rpartition(".")[0] for _, target, *_ in sim.wires if target.endswith(".power")}
        loads = {path: 1 << one.load for path, one in self.units.items() if path in powered and hasattr(one, "load")}
        for process in sim.flights:
            for one in process:
                if objects.struct(one).name == "FaultProtection":
                    path = f"{objects.path(one)}.table.faulted"
                    self.named[path] = {place: unit.name or f"unit {place}" for place, unit in enumerate(one.units)}
                    self.isolating[path] = {
                        unit: 1 << place for unit, load in loads.items()
                        for place, row in enumerate(one.units) if row.loads & load}

    # --- what a mission says ---

    def fault(self, unit: str, kind: str, **fields: Any) -> None:
        """Fly this fault of a unit in place of the usual one of its kind. fields: of `faults` (docs/sensors.md) but for
        begin and lasts."""
        kind, = self._kinds(unit, [kind])
        self._own.setdefault((unit, kind), []).append(Fault(unit, kind, fields))
        self._try(self._own[unit, kind][-1])

    def without(self, unit: str, *kinds: str) -> None:
        """Leave kinds of faults of a unit out, or all."""
        self._without |= {(unit, kind) for kind in self._kinds(unit, kinds)}

    def detects(self, *paths: str) -> None:
        """Outputs of flight that say that something is wrong, when they differ from those of the undisturbed flight."""
        for path in paths:
            self._number(path)
            self.detecting.append(path)

    def isolates(self, path: str, units: Mapping[str, int]) -> None:
        """An output of flight whose bits are the units that it does not use any more. units: those of the world, by
        path, each with its bits."""
        self._number(path)
        for unit, bits in units.items():
            self.unit(unit)
            if not isinstance(bits, int) or bits <= 0:
                raise SetupError(f"m.isolates({path!r}): {unit}: expected bits, a whole number > 0; found {bits!r}")
        self.isolating[path] = {**self.isolating.get(path, {}), **units}

    def nominal(self, *ids: str) -> None:
        """Requirements for flights in which nothing fails, as that no unit is isolated: they are not judged here."""
        self.left_out |= {Requirements(self.simulation).of(id).id for id in ids}

    def _number(self, path):
        """Refuse what is no whole number of an output of flight."""
        found = FieldPath(self.simulation, path)
        if found.group != "out" or found.port is None or not path.startswith(
                tuple(f"{process.name}." for process in self.simulation.flights)):
            raise SetupError(f"{path} is no output of flight")
        if found.field.type.startswith("f"):
            raise SetupError(f"{path}: expected a whole number, which differs by itself; it has the type "
                             f"{found.field.type}")

    # --- the faults ---

    def unit(self, path: str) -> Any:
        """The model at a path. Raises SetupError if it takes no faults."""
        if path not in self.units:
            raise SetupError(f"there is no unit '{path}' that takes faults{did_you_mean(path, self.units)} there are "
                             + listed(list(self.units)))
        return self.units[path]

    def _kinds(self, unit, wanted=()):
        """The kinds of fault of a unit, or those of them that are wanted."""
        known = list(_kinds_of(self.unit(unit)))
        for kind in wanted:
            if kind not in known:
                raise SetupError(f"{unit} has no fault of the kind '{kind}'{did_you_mean(kind, known)} it has "
                                 + listed(known))
        return list(wanted) or known

    def faults(self, units: Sequence[str] = (), kinds: Sequence[str] = ()) -> list[Fault]:
        """All faults, or those of some units and kinds. Raises SetupError on one that does not exist."""
        units = units or list(self.units)
        known = list(dict.fromkeys(kind for unit in units for kind in self._kinds(unit)))
        for kind in kinds:
            if kind not in known:
                raise SetupError(f"there is no kind of fault '{kind}'{did_you_mean(kind, known)} there are "
                                 + listed(known))
        found = [one for unit in units for kind in self._kinds(unit)
                 if (not kinds or kind in kinds) and (unit, kind) not in self._without
                 for one in self._own.get((unit, kind), [self._usual(unit, kind)])]
        if not found:
            raise SetupError(f"the mission {self.simulation.name} has no fault to fly: "
                             + ("no model takes `faults`" if not self.units else "all are left out"))
        return found

    def _usual(self, unit, kind):
        """The fault of a kind, large enough to matter."""
        if "bits" in _fields(self.unit(unit)):
            return Fault(unit, kind, {"bits": 2})       # of a memory: one more than its code corrects
        named = LIMITS.get(objects.struct(self.unit(unit)).name, 1.0)
        if isinstance(named, float):
            limit = named
        elif named == "bits":
            limit = 2.0 ** self.unit(unit).bits
        else:
            import numpy as np

            limit = float(np.max(getattr(self.unit(unit), named))) or 1.0
        sizes = {"HIGH": limit, "LOW": limit, "BABBLE": limit, "BIAS": SHARE * limit, "DRIFT": SHARE * limit / 60,
                 "DELAY": DELAY}
        return Fault(unit, kind, {"size": sizes[kind]} if kind in sizes else {})

    def _try(self, fault):
        """Refuse at once what the model would refuse."""
        owner, before = self.unit(fault.unit), _planned(self.unit(fault.unit))
        try:
            owner.faults = [{"kind": fault.kind, **fault.fields}]
        finally:
            owner.faults = before

    def scenario(self, name: str) -> str:
        """A scenario, by its name. Raises SetupError if there is none."""
        assert self.simulation.mission
        known = self.simulation.mission.scenarios
        if name not in known:
            raise SetupError(f"the mission {self.simulation.name} has no scenario '{name}'{did_you_mean(name, known)} "
                             f"it has {listed(list(known))}")
        return name


def _takes_faults(one):
    struct = objects.struct(one)
    return isinstance(one, objects.Model) and struct.name != "FaultPanel" and any(
        f.name == "faults" and f.group == "par" for f in struct.fields)


def _fields(owner):
    """The fields of a fault of a model, by name."""
    return {f.name: f for one in objects.struct(owner).fields if one.name == "faults" for f in one.struct.fields
            if not f.spare}


def _kinds_of(owner):
    """Name -> number of each kind of fault of a model; without what the names have in common, and the sound one."""
    return {name: number for number, name in enumerator_names(_fields(owner)["kind"]).items() if number}


def _planned(owner):
    return [{name: getattr(one, name) for name in _fields(owner)} for one in owner.faults]


# --- flying ----------------------------------------------------------------------------------------

class _Done(BaseException):
    """All children have ended, so that the rest of the scenario is not needed here; or why none shall fly."""


class _Limit(BaseException):
    """The flight has come to its limit; the rest of the scenario is left out."""


class _Seen(NamedTuple):
    """What a flight left."""
    activity: list[Any]     # its happenings
    modes: dict[str, list[tuple[float, str]]]       # (t [s], mode) of each process with modes
    records: dict[str, tuple[Any, Any]]             # (times [ns], messages) of each port
    flights: set[str]       # the processes that fly
    duration: float         # [s]
    problem: str            # a check that does not hold, or an error
    failed: str             # "RunError" or "SetupError" that ended it; else ""
    judged: bool            # whether something holds that a fault can violate: a requirement; without any, a check
    outcomes: dict[str, Any]        # of requirements, by id
    traces: dict[tuple[str, str], Any]      # whether their comparisons held, over time


def fly(matrix: Matrix, scenarios: Sequence[str] = (), faults: Sequence[Fault] | None = None, double: bool = False,
        begin: Sequence[Any] | None = None, lasts: Any = None, jobs: int | None = None, limit: Any = None,
        progress: Callable[[int, int, float], Any] = lambda done, all_, expected: None) -> list[Flight]:
    """Fly each fault in each scenario; returns a Flight for each, in the order of the declarations.

    scenarios: by name; default: the first. faults: default: all. double: the pairs of faults of different units too.
    begin: times; default: those of the matrix, or the middle of each mode's first stay. lasts: a time; 0: for ever.
    jobs: processes at a time; default: all cores. limit: a time at which each flight ends; default: with its scenario.
    progress(done, all, [s] that all will take, by the flights without a fault): before the first, and about every
    second.
    Raises SetupError before the first flight if something is wrong with all of them.
    """
    assert matrix.simulation.mission
    names = [matrix.scenario(one) for one in scenarios] or [chosen(matrix.simulation, None)[0]]
    wanted = list(matrix.faults() if faults is None else faults)
    sets = [[one] for one in wanted]
    if double:
        sets += [list(pair) for pair in itertools.combinations(wanted, 2) if pair[0].unit != pair[1].unit]
    for_ns = time_ns(matrix.lasts if lasts is None else lasts, "lasts")
    given = matrix.begin if begin is None else begin
    times = None if given is None else [time_ns(one, "begin") for one in (
        given if isinstance(given, (list, tuple)) else [given])]
    jobs = len(os.sched_getaffinity(0)) if jobs is None else jobs
    if jobs < 1:
        raise SetupError(f"jobs must be >= 1, found {jobs}")
    end = None if limit is None else time_ns(limit, "limit")
    plans, expected = [], 0.0
    for name in names:
        started = perf_counter()
        baseline = _flight(matrix, name, limit=end)
        wall = perf_counter() - started
        if baseline.problem and (baseline.failed or not baseline.duration):
            raise SetupError(f"{matrix.simulation.name}, {name} does not fly without a fault: {baseline.problem}")
        begins = _begins(baseline) if times is None else times
        for ns in begins:
            if not 0 <= ns < baseline.duration * 1e9:
                raise SetupError(f"begin: {ns / 1e9:g} s is not within the scenario {name}, which flies "
                                 f"{baseline.duration:g} s")
        tasks = [(ns, one) for ns in sorted(set(begins)) for one in sets]
        plans.append((name, baseline, tasks))
        # The rest of each flight, several at a time, and the one that leads up to all.
        rest = sum(1 - max(0, ns - LEAD) / 1e9 / baseline.duration for ns, _ in tasks)
        expected += wall * (rest / min(jobs, len(tasks)) + max(begins) / 1e9 / baseline.duration)
    found: list[Flight] = []
    count = sum(len(tasks) for *_, tasks in plans)
    progress(0, count, expected)
    for name, baseline, tasks in plans:
        before = len(found)
        found += _children(matrix, name, baseline, tasks, for_ns, jobs, end,
                           lambda done: progress(before + done, count, expected))
    return found


def _begins(baseline):
    """[ns] The middle of the first stay in each mode of the process with the most; else a third of the flight."""
    stays: list[tuple[float, str]] = max(baseline.modes.values(), key=len, default=[])
    first: dict[str, float] = {}
    for (t, name), end in zip(stays, [*(t for t, _ in stays[1:]), baseline.duration]):
        first.setdefault(name, (t + end) / 2)
    return [int(t) * SECOND for t in first.values()] or [int(baseline.duration / 3) * SECOND]


def _flight(matrix: Matrix, name: str, stops: Sequence[int] = (), then: Callable[[Any, int], Any] | None = None,
            limit: int | None = None) -> Any:
    """Fly a scenario, at most up to a limit [ns], and return what was seen. At each of the stops [ns] `then` is called
    with the simulation."""
    sim = matrix._load()
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
    modes = {process.name: [(one.t, one.name) for one in activity
                            if one.kind == "mode" and one.process == process.name]
             for process in sim.processes if process.modes}
    outcomes = {one.requirement.id: one for one in watch.outcomes()} if watch and not failed else {}
    judged = (any(one.verdict == HOLDS for one in outcomes.values()) if outcomes else
              not problem and has_checks(function))
    return _Seen(activity, modes, {port.name: port.decoded() for port in Log(sim, sim.kernel.logs)._ports()},
                 {process.name for process in sim.flights}, sim.time, problem, failed, judged, outcomes,
                 _traces(watch) if watch and not failed else {})


def _watch(sim, name, left_out):
    """Judge the requirements that a scenario shows while it flies; None: there are none."""
    requirements = Requirements(sim)
    found = [one.id for one in requirements.for_scenario(name) if one.id not in left_out]
    return requirements.watch(found, traces=True) if found else None


def _traces(watch):
    """What each requirement's comparisons were, over time: (id, text) -> (times [s], whether it held)."""
    relations: dict[str, Callable[[Any, Any], Any]] = {
        "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne}
    found = {}
    for requirement in watch.requirements:
        for one in requirement.formula.comparisons:
            times, values = watch.values(one)
            found[requirement.id, one.text] = times, relations[one.relation](values, one.limit)
    return found


def _on_the_way(sim: Simulation, stops: list[int], then: Callable[[Any, int], Any] | None, limit: int | None) -> None:
    """Have a simulation record what is compared, and stop on its way at some times [ns], rising, to call `then`. Its
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


def _record(sim):
    """Record all outputs of flight, and attitudes. What the scenario records keeps its period: a port has one record,
    with the shorter of two periods."""
    own = {one.path for one in sim.records}
    period = min((task.period for process in sim.flights for task in process.tasks), default=SECOND)
    for process in sim.processes:
        for one in process:
            for f in objects.struct(one).fields:
                if f.group == "out" and f"{objects.path(one)}.{f.name}" not in own:
                    if process in sim.flights:
                        sim.record(getattr(one, f.name), every=period / 1e9)
                    elif objects.struct(one).name == "Spacecraft" and f.name == "state":
                        sim.record(getattr(one, f.name), every=1.0)
    return True


def _children(matrix, name, baseline, tasks, lasts, jobs, limit, progress):
    """Fly a scenario up to each beginning, and let a child go on with each fault."""
    flying: dict[int, tuple[int, int, bytearray]] = {}     # pipe -> (index, process, what it said)
    found: list[Any] = [None] * len(tasks)
    done = 0
    mine: list[Any] = []        # of a child: (index, pipe)

    def collect(most):
        nonlocal done
        while len(flying) > most:
            progress(done)
            for pipe in select.select(list(flying), [], [], 1.0)[0]:
                part = os.read(pipe, 1 << 16)
                if part:
                    flying[pipe][2].extend(part)
                    continue
                index, child, said = flying.pop(pipe)
                os.close(pipe)
                _, status = os.waitpid(child, 0)
                ns, faults = tasks[index]
                found[index] = pickle.loads(said) if said else Flight(
                    name, _mode_at(baseline, ns / 1e9), ns / 1e9, faults, "failed",
                    text=f"the process that flew it ended with {os.waitstatus_to_exitcode(status)}")
                if isinstance(found[index], str):
                    raise _Done(SetupError(f"{' and '.join(map(str, faults))}: {found[index]}"))
                done += 1

    def branch(sim, at):
        if mine:
            return
        for index, (ns, faults) in enumerate(tasks):
            if max(0, ns - LEAD) != at or found[index]:
                continue
            collect(jobs - 1)
            ours, theirs = os.pipe()
            child = os.fork()
            if child == 0:
                os.close(ours)
                mine[:] = index, theirs
                sim.__dict__["_plant"] = lambda: _plant(sim, ns, faults, lasts)
                return
            os.close(theirs)
            flying[ours] = index, child, bytearray()
        collect(0)
        if at == stops[-1]:
            raise _Done

    def careful(sim, at):
        try:
            branch(sim, at)
        except KeyboardInterrupt:
            raise _Done(KeyboardInterrupt()) from None      # which a script of the ground would take for its own

    stops = sorted({max(0, ns - LEAD) for ns, _ in tasks})
    try:
        seen = _flight(matrix, name, stops, careful, limit)
        if mine:
            index, pipe = mine
            ns, faults = tasks[index]
            with os.fdopen(pipe, "wb") as out:
                pickle.dump(seen.problem if seen.failed == "SetupError" else
                            _compare(matrix, name, baseline, seen, ns, faults), out)
            os._exit(0)
    except _Done as end:
        if end.args:
            raise end.args[0] from None
        return found
    finally:
        if mine:
            if not isinstance(sys.exc_info()[1], KeyboardInterrupt):    # the parent tells of that
                traceback.print_exc()
            os._exit(1)
        for pipe, (_, child, _) in flying.items():
            os.kill(child, signal.SIGTERM)
            os.waitpid(child, 0)
    raise SetupError(f"the scenario {name} never reaches {stops[-1] / 1e9:g} s by sim.run()")


def _plant(sim, ns, faults, lasts):
    """Have the faults in the models, also where the scenario has just assigned others."""
    for one in faults:
        process, _, instance = one.unit.partition(".")
        owner = getattr(sim.process(process), instance)
        known = _fields(owner)
        planned = _planned(owner)
        number = _kinds_of(owner)[one.kind]
        if not any(row["kind"] == number and row["begin"] == ns for row in planned):
            times = {"begin": ns, **({"lasts": lasts} if "lasts" in known else {})}     # whole numbers are [ns]
            owner.faults = [*planned, {"kind": one.kind, **one.fields, **times}]


def _mode_at(seen, t):
    """The modes in force, "safe", or "a: x, b: y" of several processes."""
    now = {process: [name for at, name in stays if at <= t][-1:] for process, stays in seen.modes.items()}
    return ", ".join(f"{process}: {names[0]}" if len(now) > 1 else names[0] for process, names in now.items() if names)


# --- comparing -------------------------------------------------------------------------------------

def _compare(matrix, name, baseline, seen, ns, faults):
    begin = ns / 1e9
    found = Flight(name, _mode_at(baseline, begin), begin, faults, text=seen.problem,
                   ends=_mode_at(seen, seen.duration))
    says = [*_new_happenings(baseline, seen, begin), *_worse(baseline, seen, ns)]
    for path in matrix.detecting:
        names = enumerator_names(FieldPath(matrix.simulation, path).field)
        says += [(t, f"{path} is {names.get(ours, ours)}, not {names.get(theirs, theirs)}")
                 for t, ours, theirs in _differences(baseline, seen, path, ns)]
    isolated = []       # (t, unit, whether it has a fault)
    for path, units in matrix.isolating.items():
        own = functools.reduce(operator.or_, (units.get(one.unit, 0) for one in faults))
        named = matrix.named.get(path) or {bits.bit_length() - 1: unit for unit, bits in units.items()}
        for t, ours, theirs in _differences(baseline, seen, path, ns):
            for bit in range(32):
                if ours & ~theirs & 1 << bit:
                    isolated.append((t, named.get(bit, f"bit {bit} of {path}"), bool(own & 1 << bit)))
                    says.append((t, f"{path}: {isolated[-1][1]}"))
    for t, unit, right in sorted(isolated):
        if right and found.isolated is None:
            found.isolated, found.as_ = t - begin, unit
        elif not right and unit not in found.wrongly:
            found.wrongly.append(unit)
    if says:
        t, found.by = min(says)
        found.detected = t - begin
    found.off, found.off_end = _off(baseline, seen, begin)
    _judge(found, baseline, seen, begin)
    return found


def _new_happenings(baseline, seen, begin):
    """(t, text) of each event, mode, command or reset of flight that the undisturbed flight has not as often."""
    left = Counter(one[1:4] for one in baseline.activity if one.t >= begin)
    for one in seen.activity:
        if one.t >= begin and one.process in seen.flights:
            left[one[1:4]] -= 1
            if left[one[1:4]] < 0:
                yield one.t, f"{one.kind} {one.process}.{one.name}"


def _ports(baseline, seen, ns):
    """(name, times [ns], messages of this flight, of the undisturbed one) of each output of flight since the fault."""
    for name, (t, ours) in seen.records.items():
        other_t, theirs = baseline.records.get(name, (t[:0], ours[:0]))
        n = min(len(t), len(other_t))
        if name.partition(".")[0] in seen.flights and (t[:n] == other_t[:n]).all():
            first = int(t[:n].searchsorted(ns))
            yield name, t[first:n], ours[first:n], theirs[first:n]


def _worse(baseline, seen, ns):
    """(t, text) where flight first says of an output that its quality is worse than in the undisturbed flight."""
    for name, t, ours, theirs in _ports(baseline, seen, ns):
        if "head" in (ours.dtype.names or ()):
            at = (ours["head"]["quality"] < theirs["head"]["quality"]).nonzero()[0]
            if len(at):
                yield t[at[0]] / 1e9, f"quality of {name}"


def _differences(baseline, seen, path, ns):
    """(t [s], this number, that of the undisturbed flight) of a path, at each sample at which they differ."""
    import numpy as np

    port, _, rest = path.partition(".")
    instance, _, rest = rest.partition(".")
    output, _, member = rest.partition(".")
    for name, t, ours, theirs in _ports(baseline, seen, ns):
        if name == f"{port}.{instance}.{output}":
            one, other = (np.asarray(_member(values, member)).reshape(len(t), -1) for values in (ours, theirs))
            for i, k in zip(*(one != other).nonzero()):
                yield t[i] / 1e9, int(one[i, k]), int(other[i, k])


def _member(values, member):
    import re

    for name, index in re.findall(r"(\w+)(?:\[(\d+)\])?", member):
        values = values[name]
        values = values[..., int(index)] if index else values
    return values


def _off(baseline, seen, begin):
    """[deg] Between the attitudes of both flights, at most and at the end."""
    import numpy as np

    from fledge import attitude

    most = end = 0.0
    for name, (t, ours) in seen.records.items():
        if name in baseline.records and "sigma_BN" in (ours.dtype.names or ()) and name.partition(".")[0] not in \
                seen.flights:
            theirs = baseline.records[name][1]["sigma_BN"]
            n = min(len(ours), len(theirs))
            ours, theirs = ours["sigma_BN"][:n], theirs[:n]
            apart = np.degrees(attitude.angle(attitude.relative(ours, theirs)))
            apart = np.where((ours == theirs).all(axis=-1), 0.0, apart)[t[:n] >= begin * 1e9]
            if len(apart):
                most, end = max(most, float(apart.max())), max(end, float(apart[-1]))
    return most, end


def _judge(found, baseline, seen, begin):
    """The effect of the fault, and whether flight is back."""
    for name, one in seen.outcomes.items():
        if baseline.outcomes[name].verdict == "holds":
            if one.verdict != "holds":
                (found.violated if one.verdict == "violated" else found.unknown)[name] = one.margin_text
            else:
                share = one.margin / baseline.outcomes[name].margin if baseline.outcomes[name].margin else 0.0
                if math.isfinite(share) and (found.least is None or share < found.least[1]):
                    found.least = name, share, one.margin_text
    same = not found.text and found.detected is None and found.off == 0.0 and all(
        ours.tobytes() == theirs.tobytes() for _, _, ours, theirs in _ports(baseline, seen, begin * 1e9))
    # A check counts where there are no requirements, or where it has ended the run before they could be judged.
    broken = bool(seen.problem and not baseline.problem and (found.unknown or not seen.outcomes))
    found.effect = "failed" if seen.failed else "violated" if broken or found.violated else "unknown" if \
        found.unknown else "none" if same else "tolerated" if baseline.judged else "unjudged"
    if seen.failed or broken or seen.duration < baseline.duration:
        return
    away = [begin, *(t for process, stays in seen.modes.items() for t in _apart(stays, baseline.modes[process], begin))]
    never = set(found.violated)     # of those what is wrong is that something never holds
    for key, (times, held) in seen.traces.items():
        n = min(len(times), len(baseline.traces[key][0]))
        wrong = (~held[:n] & baseline.traces[key][1][:n] & (times[:n] >= begin)).nonzero()[0]
        if key[0] in found.violated and len(wrong):
            never.discard(key[0])
            away.append(times[wrong[-1]] if wrong[-1] < n - 1 else math.inf)
    if not never and max(away) < math.inf and all(stays[-1:] and stays[-1][1] == baseline.modes[process][-1][1]
                                                  for process, stays in seen.modes.items()):
        found.back = float(max(away)) - begin


def _apart(stays: Sequence[tuple[float, str]], others: Sequence[tuple[float, str]], begin: float) -> Iterator[float]:
    """The times at which a mode begins that both flights have, after a time in which they differed."""
    ours = theirs = ""
    for t in sorted({t for t, _ in (*stays, *others)}):
        before = ours == theirs
        ours = next((name for at, name in reversed(stays) if at <= t), "")
        theirs = next((name for at, name in reversed(others) if at <= t), "")
        if t >= begin and not before and ours == theirs:
            yield t
