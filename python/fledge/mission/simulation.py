# SPDX-License-Identifier: Apache-2.0
"""The simulation for users: the flight process, the world, their common time, and records.

    sim = fledge.load("nadir_spin")
    log = sim.record(sim.flight.tracking.error, every=1 * s)
    sim.run(160 * minute)
    sim.flight.control.K = 3 * N * m          # change a gain, and go on
    sim.run(10 * minute)
    log.plot("error.sigma_BR")
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from fledge import _core
from fledge.errors import SetupError, did_you_mean, instead, listed, refuse_misspelt, suggesting
from fledge.mission.process import Flight, Mode, Process, World
from fledge.objects.plausible import check
from fledge.objects.si import Time, time_ns
from fledge.programs import in_debugger

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike

    from fledge.mission.batch import Batch
    from fledge.mission.field_path import ModePort
    from fledge.mission.folder import Mission
    from fledge.mission.linear import Linear
    from fledge.mission.linearize import Part
    from fledge.mission.log import Log
    from fledge.mission.process import Modes
    from fledge.mission.provenance import Revisions
    from fledge.mission.state import Paths
    from fledge.mission.trim import Trim, Wanted
    from fledge.objects.words import Instance
    from fledge.records.series import Records

P = TypeVar("P", bound=Process)

_limit = 0      # [ns]


def report_crashes(extension: Any, command: Sequence[str] = ()) -> None:
    """Let an extension with a kernel report crashes of what it runs, and obey the limit. command: that of a run of a
    campaign, whose index follows."""
    extension.report_crashes(in_debugger(sys.orig_argv), in_debugger(command) if command else "")
    extension.limit_updates(_limit)


def limit_updates(limit: Any) -> None:
    """From now on an update that takes longer than this wall time ends the program by SIGXCPU, which names its module:
    `limit_updates(2 * s)`. 0: none does, as at the beginning. Raises SetupError for what is no time."""
    global _limit
    _limit = time_ns(limit, "limit_updates")
    for name in ("_core", "_cosim"):
        if name in sys.modules:
            sys.modules[name].limit_updates(_limit)


report_crashes(_core)


class Finding(NamedTuple):
    """Something that a user should know although the run went on: what was late, missing, old, limited or not finite.

    kind: "unwritten", "held", "degraded", "stale", "saturated", "not finite", "late" (read a step late, where another
    order of the modules would not) or "uneven" (periods that do not divide); path: of the output, input or module;
    first: [s], None if it follows from the structure; updates: in how many; text: all of it in words
    """
    kind: str
    path: str
    first: float | None
    updates: int
    text: str


@suggesting()
class Simulation:
    """A world and the flight software in it.

    `flight` and `world` are the processes; their instances are attributes: `sim.flight.control`.
    Two simulations share nothing. Made by fledge.load(), or here, to be filled by hand; `empty` is one
    without processes, for missions of several spacecraft: add_world() and add_flight() make them.
    """

    def __init__(self, name: str = "simulation", seed: int = 0, *, empty: bool = False) -> None:
        self._adopt(_core.Simulation(_seed(seed)), name)
        if not empty:
            self.add_world("world")  # at each instant the world advances before flight runs
            self.add_flight("flight")

    def __setattr__(self, name: str, value: Any) -> None:
        refuse_misspelt(self, name, ("seed", "pace", "plots"))
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name in dir(type(self)):     # the latter: of a property that failed
            return object.__getattribute__(self, name)
        known = [n for n in dir(self) if not n.startswith("_")]
        near = instead(name, known)
        raise AttributeError(f"the simulation has no '{name}'"
                             + (f"; it has {listed(known)}" if near == ";" else near.rstrip(";")))

    def _adopt(self, core: _core.Simulation, name: str) -> None:
        self._core = core
        self._processes: dict[str, Any] = {}    # by name, in the order in which they run
        self._gone: dict[str, str] = {}         # why a process is not in this program, by its name
        self.name = name
        self.mission: Mission | None = None     # from which it was loaded
        self.pace = 0.0                         # the default of run(); 0: as fast as possible
        self.plots: Any = None                  # collects the figures of Log.plot(); None: they are shown; False: none
        self.wall = 0.0                         # [s] of wall time that run() took so far
        self._archive: Any = None               # (path, metadata) of the archive that the next run opens
        self.archives_motion = False            # an archive has attitudes, for a view in 3-D, whatever is recorded
        self._revisions: Revisions | None = None    # for that archive
        self.watches: list[Any] = []            # the requirements that are judged while it runs
        self._outputs: str | None = None        # the record of all outputs that the next run opens

    # --- its parts ---

    @property
    def flight(self) -> Flight:
        """The flight process: its modules, tasks, modes and events. Raises SetupError if there are several, or none."""
        return self._only(Flight, "flight")

    @property
    def world(self) -> World:
        """The world: its models, tasks and events. Raises SetupError if there are several, or none."""
        return self._only(World, "world")

    @property
    def processes(self) -> tuple[Process, ...]:
        """All processes, in the order in which they run at equal times."""
        return tuple(self._processes.values())

    @property
    def flights(self) -> tuple[Flight, ...]:
        """The processes that fly."""
        return tuple(p for p in self.processes if isinstance(p, Flight))

    def process(self, name: str) -> Process:
        """The process of that name. Raises SetupError, with the names that there are."""
        if name in self._processes:
            return self._processes[name]
        if name in self._gone:
            raise SetupError(f"{name} {self._gone[name]}")
        raise SetupError(f"{self.name} has no process '{name}'; it has {', '.join(self._processes) or 'none'}")

    def add_world(self, name: str) -> World:
        """A further World, a process; it runs after the present ones. Raises SetupError for a name that is taken or no
        identifier, and once the simulation has run."""
        return self._add(World, name)

    def add_flight(self, name: str) -> Flight:
        """A further Flight, as add_world() adds a World."""
        return self._add(Flight, name)

    def _add(self, kind: type[P], name: str) -> P:
        if not str(name).isidentifier():
            raise SetupError(f"process {name!r}: its name must be an identifier")
        self._core.add_process(name)
        process = self._processes[name] = kind(self._core, self._core.process(name))
        return process

    def _only(self, kind: type[P], name: str) -> P:
        """The process of that name, or else the only one of its kind."""
        matches = [p for p in self.processes if isinstance(p, kind)]
        if name in self._processes or name in self._gone or len(matches) != 1:
            if name not in self._processes and len(matches) > 1:
                raise SetupError(f"{self.name} has several of the kind {name}; take one by "
                                 f"process(): {', '.join(p.name for p in matches)}")
            return cast(P, self.process(name))
        return matches[0]

    def isolate(self, process: str) -> None:
        """Keep one process, by its name. The others run in other programs: access to them raises SetupError."""
        self._core.isolate(process)
        for other in [p for p in self.processes if p.name != process]:
            del self._processes[other.name]
            self._gone[other.name] = other.leave()

    @property
    def kernel(self) -> _core.Simulation:
        """The simulation in the extension, for the library's own use."""
        return self._core

    @property
    def seed(self) -> int:
        """The seed of all random streams, from 0 to 2^64 - 1. Setting it raises SetupError for another number, and
        between the first run and reset()."""
        return self._core.seed

    @seed.setter
    def seed(self, seed: int) -> None:
        self._core.seed = _seed(seed)

    @property
    def time(self) -> float:
        """The time up to which the simulation has run [s]: the sum of its runs; 0 before the first."""
        return max(self._core.time, 0) / 1e9

    @property
    def time_ns(self) -> int:
        """The same [ns]; -1 before the first run."""
        return self._core.time

    @property
    def state_time(self) -> float:
        """The last instant that ran [s]: the time of the state. It is less than `time` if no task runs at the end of
        the run."""
        return max(self._core.now, 0) / 1e9

    @property
    def wires(self) -> list[tuple[str, str, int, int, str]]:
        """(path of the output, path of the input, latency, stale_after [ns], choice) of each wire. choice: of several
        into one input, "newest", "first", "best" or "in MODE"; "": it is the only one."""
        return self._core.wires

    @property
    def feeds(self) -> list[tuple[str, str, int]]:
        """(path of the input, what feeds it in words, stale_after [ns]) of each input that is fed by hand."""
        return self._core.feeds

    @property
    def records(self) -> list[_core.Log]:
        """The samples so far, a record for each port: path, times() [ns] and bytes() as stored."""
        return self._core.logs

    @property
    def mode(self) -> str:
        """The mode that flight is in; "" if it has none."""
        return self.flight.active_mode

    @property
    def scenarios(self) -> dict[str, Callable[[], object]]:
        """The mission's scenarios by name, each a function without arguments."""
        from functools import partial

        return {n: partial(f, self) for n, f in self.mission.scenarios.items()} if self.mission else {}

    @property
    def assumptions(self) -> list[str]:
        """One line for each important parameter that has its default."""
        return self._core.assumptions

    @property
    def health(self) -> list[Finding]:
        """What a user should know of the run so far; empty if all is well."""
        return [Finding(*row) for row in self._core.health]

    def feed(self, port: _core.Message, record: Records | pd.DataFrame | dict | None = None, /, *,
             time: ArrayLike | None = None, topic: str | None = None, linear: bool | Iterable[str] = False,
             stale_after: Time = 0, quality: int | str = "GOOD", **fields: object) -> None:
        """Feed an input by hand, in place of a wire: `feed(f.tracking.attitude, sigma_BN=[0, 0, 0.1])`.

        fields: of the message, with units as parameters have them; those that are left out are 0. One that is called
        as an option is, such as a field `time`, comes in a dict: `feed(f.ephemeris.time, {"time": 5 * s})`.
        time: (n,) times [s], rising. A field is then constant, or has n rows, one for each time. Without it, the
        message holds for each instant.
        record: a Log, an Archive or a pandas DataFrame as their frame() gives, in place of fields and time. topic:
        which of its messages; not given: the only one of the input's type, or that of the same path.
        The input holds each message until the next one, with the time and the quality that it had; before the first,
        nothing was written. linear: True, or names of fields, whose numbers change linearly between two messages; not
        for attitudes, which may go over to the shadow set.
        stale_after: as of a wire. quality: "GOOD", "DEGRADED" or "STALE", of fields.

        Give other messages at any time. The first feed of an input is a change of the structure, before the simulation
        has run. Raises SetupError on a wrong name, shape, unit or order of times, a number that the header refuses, and
        an input that has a wire.
        """
        from fledge.mission.feed import feed

        feed(self._core, port, record, time=time, topic=topic, linear=linear, stale_after=stale_after, quality=quality,
             **fields)

    # --- running ---

    def run(self, duration: Time | None = None, *, until: Time | None = None, pace: float | None = None,
            progress: bool | None = None) -> None:
        """Run for a duration, or until a time, both included; the first run begins with the instant 0.

        Runs add up: run(a) and run(b) end with the same bits as run(a + b). A task runs at the multiples of its
        period; where none falls on the end of a run, `time` is the end, the state stays that of the last instant,
        `state_time`, and the remainder counts for the next run. A mode that is requested between two runs begins
        at its process' first instant after `time`. Processes in programs of their own do the same.

        pace: simulated seconds per second, 1 for real time; 0 or not given: as fast as possible.
        progress: show a bar on stderr; not given: on a terminal, for runs of more than about 2 s, elsewhere some lines
        for runs of more than 10 s.

        Ctrl-C ends the run after the current instant: all is consistent, and run() can go on from there. A
        second Ctrl-C also interrupts a Python event.
        Raises CompositionError if something is missing, RunError if the state is no longer finite, SetupError for an
        end before the present or a negative pace, Stopped where a requirement ends it; an exception in a Python event
        ends the run at that instant.
        """
        start = max(self._core.time, 0)
        if duration is not None and until is None:
            end = start + time_ns(duration, "run")
        elif until is not None and duration is None:
            end = time_ns(until, "run: until")
        else:
            raise TypeError("run() takes a duration, or until=a time")
        if end < start:
            raise SetupError(f"run: {end / 1e9:g} s lies before the present, {start / 1e9:g} s")
        pace = self.pace if pace is None else pace
        if pace < 0:
            raise SetupError(f"run: pace must be >= 0, found {pace:g}")
        self._begin()
        self._core.ready_for(end)
        self.open_archive()
        from fledge.interruption import Interruption
        from fledge.progress import Progress

        begun = perf_counter()
        try:
            with Interruption() as interruption, Progress(self.name, start, end, progress) as bar:
                def poll(now: int) -> None:
                    interruption.check()
                    bar.reaches(now)

                self._core.run_until(end, float(pace), poll)
        finally:
            self.wall += perf_counter() - begun
        for watch in self.watches:
            watch.refuse_violation()

    @property
    def problems(self) -> list[tuple[str, int, str]]:
        """Why it cannot fly as it is composed now, all of it: (file, line, what and the remedy), by file and line;
        empty if it can."""
        return self._core.problems()

    def check(self) -> None:
        """Raise CompositionError with all `problems`, if there are any."""
        if self.problems:
            self._core.prepare()

    def prepare(self) -> None:
        """Check that nothing is missing and fix the order of all tasks, as the first run does. Raises CompositionError
        with all `problems`."""
        self._core.prepare()

    def step(self, n: int = 1) -> None:
        """Run the next instant, or the next n. Raises CompositionError and RunError as run() does."""
        self._begin()
        self._core.prepare()
        self.open_archive()
        self._core.step(n)

    def _begin(self) -> None:
        """Before a run: of the first one, warn of what is implausible."""
        if self._core.now < 0:
            for flight in self.flights:
                frames = flight.commands.dictionary.frames if flight.has_services else None
                if frames and frames.secured and self.mission:
                    from fledge.frames import FILE

                    flight.commands.take_keys(Path(self.mission.folder) / FILE)
            check(self.processes)

    def reset(self) -> None:
        """Back to time 0: modules and models are reset, records emptied. Parameters stay."""
        if self._core.archiving:
            # The second run gets a file of its own.
            path, metadata = self._archive
            self._finish_archive({})
            self.archive(_next_name(path), **metadata)
        self._core.reset()

    @property
    def pace_report(self) -> dict[str, float]:
        """How paced runs kept up: {"instants", "overruns" (later than 1 ms), "worst" [s]}."""
        instants, overruns, worst = self._core.pace_report
        return {"instants": instants, "overruns": overruns, "worst": worst / 1e9}

    def composition(self, process: str | None = None) -> tuple[str, list[tuple[str, str]]]:
        """(JSON, (path, name) of each file that it needs) that FMUs fly, before the first run. process: the only one
        that flies there. Raises CompositionError with all that is no data, as functions of Python."""
        return _core.compose(self._core, process or "")

    # --- control theory ---

    def linearize(self, inputs: Paths, outputs: Paths, *, hold: Paths = (), discrete: bool = False,
                  part: Part | Iterable[Part] | None = None, period: Time | None = None) -> Linear:
        """The linear system about the present state, which stays as it is:
        `linearize("world.wheels.command.u", "world.craft.state.omega_BN_B").A`.

        inputs: paths of fields of inputs, of outputs (in place of them, for all that read them), or of parameters; an
        input given so replaces what comes by a wire, so that a loop is open there.
        outputs: paths of fields of outputs, or of a module's memory. A path stands for all elements, or has indices.
        States that reach no output are left out; without outputs, all are there. hold: paths of differential states
        that are no states here, because they stay as they are: `hold=["world.craft.r_CN_N", "world.craft.v_CN_N"]`.

        Continuous: of the differential equations of the world, at the last instant, with inputs held. Its states are
        those of the spacecraft and its parts. discrete: of all that runs from instant to instant, flight's memory and
        messages that wait included, over the common period of the tasks, or a multiple of it, `period`. part: only
        these processes, modules and models run, and what comes from elsewhere stays as it is.

        y(k) is what outputs hold at the instant k. An input of flight is what flight reads at that instant; one of a
        model of dynamics acts from then on to the next.

        Warns, in Linear.notes too, where a slope is not the same on both sides, as at limits and steps. Raises
        SetupError if nothing has run, on unknown paths, and on what cannot be an input or output.
        """
        from fledge.mission.linearize import linearize

        return linearize(self, inputs, outputs, hold, discrete, part, period)

    def trim(self, free: Paths, *, rates: Wanted = (), outputs: Wanted = (), after: Time = 0) -> Trim:
        """Find values of free numbers for which rates vanish and outputs have values, and leave the simulation there:
        `trim(["world.craft.omega_BN_B"], rates=["world.craft.omega_BN_B"])`.

        free: paths of differential states, of fields of inputs to which nothing comes, or of parameters; of a
        simulation that has not run, of parameters alone, the initial states among them, and it stays at its beginning.
        rates: paths of differential states whose derivatives are to vanish, or a dict of paths and values in SI.
        outputs: the same of fields of outputs; values may have units. after: a time, after which the outputs are looked
        at; 0: outputs of spacecraft and their parts are looked at now.

        The search begins at the present values, by least squares. Raises SetupError, and changes nothing, on unknown
        paths, if a wanted number does not depend on the free ones, and with the nearest state if there is none.
        """
        from fledge.mission.trim import trim

        return trim(self, free, rates, outputs, after)

    # --- states ---

    def snapshot(self) -> bytes:
        """The whole dynamic state as bytes, for restore() here or in a clone. Raises CompositionError if it cannot
        fly."""
        self._core.prepare()
        return self._core.snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Go back, or on, to a snapshot. Records after it are dropped.

        Raises SetupError if it is not of a simulation with the same modules, tasks and events.
        """
        if not isinstance(snapshot, bytes):
            raise SetupError(f"restore: expected the bytes that snapshot() gives; found {snapshot!r:.40}")
        for flight in self.flights:
            flight.commands     # the snapshot may have some that wait
        self._core.restore(snapshot)

    def clone(self) -> Simulation:
        """A simulation that shares nothing with this one and stands at the same time.

        Python events are the same functions: one that refers to a simulation still refers to this one.
        """
        return self._around(self._core.clone())

    def _around(self, core: _core.Simulation) -> Simulation:
        """A clone of this simulation in the extension as one for users."""
        other = object.__new__(type(self))
        other._adopt(core, self.name)
        other.mission, other.pace = self.mission, self.pace
        other._processes = {name: process._clone(core) for name, process in self._processes.items()}
        other._gone = dict(self._gone)
        return other

    def batch(self, n: int, actions: Iterable[str] = (), observations: Iterable[str] = (), *, every: Time,
              seed: int = 0, dispersions: Any = None, threads: int | None = None, delay: int = 0) -> Batch:
        """n clones that are stepped together, on all cores, from and to numpy arrays; see fledge.mission.batch.

        actions: paths of fields of inputs, outputs or parameters that step() writes, "flight.motor.command.u[:4]": of
        the first four rows; other fields and rows of the message stay as they are
        observations: paths of fields that it returns
        every: the duration of a step, a time
        seed: of their runs; dispersions: what differs from run to run, of a Campaign or its `dispersions`
        threads: default: all cores
        delay: how many periods of flight later than the output of a law in flight an action counts

        The batch takes the parameters as they are now; its clones begin at time 0, whatever the time is here.
        Python makes it fly on one thread: prototypes, functions of modules, and events. Each clone has functions of its
        own, which use that clone in place of this simulation. Raises SetupError if a path is none, an action would have
        no effect, or a function keeps what clones would share.
        """
        from fledge.mission.batch import Batch

        return Batch(self, n, actions, observations, every, seed, dispersions, threads, delay)

    # --- records ---

    @property
    def activity(self) -> Log:
        """The messages of the executives of all processes in this run, the first 100,000 messages of each kind:

            sim.activity["flight.mode.name"], sim.activity.time_of("flight.mode")    # the modes, as they began
            sim.activity.frame("flight.activity")       # events that fired, commands and their answers, resets
        """
        from fledge.mission.log import Log

        return Log(self, self._core.followed)

    def record(self, *ports: _core.Message | Instance | Process | ModePort, every: Time = 0,
               modes: Modes | None = None) -> Log:
        """Record inputs and outputs: `record(f.tracking.error, f.motor.command, every=1 * s)`.

        A module or model stands for all its outputs, a process, `sim.flight`, for its mode. every: a time; 0, or less
        than the instants are apart, records each instant, which is the largest rate. modes: of a process, or names of
        flight's, in which alone samples are taken. Returns a Log, which fills as the simulation runs.

        A port that is recorded twice has one record, with the shorter period and the modes of both. Raises SetupError
        for what is no port, time or mode of this simulation.
        """
        from fledge.mission.field_path import ModePort
        from fledge.mission.log import Log

        period = time_ns(every, "record: every")
        if not period and every:
            raise SetupError(f"record: every: {every} is less than a nanosecond, the unit of time; 0 records each "
                             "instant, which is the largest rate")
        if not ports:
            raise SetupError("record: name at least one port, as in sim.record(f.tracking.error)")
        only = self._modes("record: modes", modes)
        logs = []
        for port in ports:
            if isinstance(port, Process):
                if not port.modes:
                    raise SetupError(f"record: the process {port.name} has no modes; name its modules")
                port = ModePort(port.name)
            if isinstance(port, (_core.Module, _core.Model)):
                outputs = [f.name for f in _core.struct(port).fields if f.group == "out"]
                logs += [self._core.record(getattr(port, name), period, True, *only) for name in outputs]
            elif isinstance(port, _core.Message):
                logs.append(self._core.record(port, period, True, *only))
            elif isinstance(port, ModePort):
                logs.append(self._core.record_executive(port.process, 0, period, *only))
            else:
                raise SetupError(f"record: expected an input, output or module; found {port!r}")
        return Log(self, logs)

    def _modes(self, what: str, modes: Modes | None) -> tuple[str, list[str]]:
        """(process, names) of modes of one process; ("", []) of none."""
        given = [] if modes is None else list(modes) if isinstance(modes, (list, tuple)) else [modes]
        if modes is not None and not given:
            raise SetupError(f"{what}: expected a mode, or several; found {modes!r}")
        processes = {mode.process if isinstance(mode, Mode) else self.flight for mode in given}
        names = [mode.name if isinstance(mode, Mode) else mode for mode in given]
        for process in processes:
            known = [name for name, _ in process.modes]
            if process not in self.processes or len(processes) > 1:
                raise SetupError(f"{what}: expected modes of one process of this simulation; found {given!r}")
            for name in names:
                if not isinstance(name, str):
                    raise SetupError(f"{what}: expected modes, or their names; found a {type(name).__name__}")
                if name not in known:
                    raise SetupError(f"{what}: {process.name} has no mode '{name}'{did_you_mean(name, known)} it has "
                                     + listed(known))
        return (processes.pop().name if processes else ""), names

    def archive(self, path: str | os.PathLike[str], **metadata: object) -> None:
        """Write all records to an MCAP file too, from the next run on; close_archive() finishes it.

        metadata: texts kept in the file. Until it is finished its name ends in .part. The file also has the seed, the
        parameters with which the first run begins, and the revisions of Fledge and of the mission as of now. Raises
        SetupError while another one is being written.
        """
        if self._core.archiving:
            raise SetupError(f"archive: {self._archive[0]} is still being written; close_archive() first")
        self._archive = (str(path), {str(k): str(v) for k, v in metadata.items()})
        from fledge.mission.provenance import Revisions

        self._revisions = Revisions(self.mission.folder if self.mission else None)

    def archive_outputs(self, path: str | os.PathLike[str]) -> None:
        """Write all outputs to an MCAP file of their own too, from the next run on, each at the instants at which it
        has changed; close_outputs() or close_archive() finishes it."""
        self._outputs = str(path)

    def close_outputs(self) -> None:
        """Finish the record of all outputs, if one is being written."""
        self._outputs = None
        self._core.close_outputs()

    def open_archive(self, resumed: bool = False) -> None:
        """Begin the archives that archive() and archive_outputs() have named, unless they have begun.

        resumed: the run goes on within another one. From the snapshot of a lost program, the archive goes on with what
        that program's file has until then. Without that file, and where a program joins late, an older file stays, and
        this one takes the next free name; it says what it lacks.
        """
        if self._outputs:
            self._core.open_outputs(self._outputs)
            self._outputs = None
        if self._archive and not self._core.archiving:
            from fledge.mission.provenance import instances, parameters, wires

            path, metadata = self._archive
            if resumed and self._core.resume_archive(path):
                return
            lost, lost_path = self._core.resumed, path
            while resumed and (os.path.exists(path) or os.path.exists(path + ".part")):
                path = _next_name(path)
            self._archive = (path, metadata)
            if self.archives_motion:
                self._archive_motion()
            lines = {**metadata, "seed": str(self.seed), "assumptions": "\n".join(self.assumptions)}
            self._core.open_archive(path, list(lines.items()))
            for name, pairs in (("parameters", parameters(self.processes)), ("instances", instances(self.processes)),
                                ("wires", wires(self))):
                self._core.archive_metadata(name, list(pairs.items()))
            if lost:
                why = f"a program was lost, and {os.path.basename(lost_path)}.part was not its record when another " \
                      "one went on from its snapshot"
                self._core.archive_metadata("missing", [("until", f"{self._core.now} ns"), ("why", why)])
            if feeds := self.feeds:
                self._core.archive_metadata("feeds", [(path, source) for path, source, _ in feeds])

    def _archive_motion(self) -> None:
        """Archive the states of all spacecraft, unless a record has an attitude: as often as the records, at 1 Hz
        without any."""
        logs = self._core.logs
        if any(log.struct.name in ("CraftState", "NavAttitude") for log in logs):
            return
        every = min((log.every for log in logs if log.every), default=0 if logs else 1_000_000_000)
        for instance in (instance for process in self.processes for instance in process):
            for field in _core.struct(instance).fields:
                if field.group == "out" and field.struct.name == "CraftState":
                    self._core.record(getattr(instance, field.name), every, True)

    def close_archive(self, **metadata: object) -> str | None:
        """Finish the archive, if one is being written; returns its path, or None."""
        path = self._archive[0] if self._core.archiving else None
        self._archive = None
        self.close_outputs()
        self._finish_archive(metadata)
        return path

    def _finish_archive(self, metadata: Mapping[str, object]) -> None:
        if self._revisions:
            revisions, self._revisions = self._revisions.read(), None
            if self._core.archiving and revisions:
                self._core.archive_metadata("revisions", list(revisions.items()))
        if self._core.archiving:
            if findings := self.health:
                self._core.archive_metadata("health", [(f"{row.kind} {row.path}", row.text) for row in findings])
            self._core.close_archive([(str(k), str(v)) for k, v in metadata.items()])

    def _title(self) -> str:
        at = f"at t = {self.time:g} s" if self._core.now >= 0 else "not yet run"
        return f"{self.name}, {at}, seed {self.seed}"

    def __repr__(self) -> str:
        return "\n".join([self._title(), *map(repr, self.processes)])

    def _repr_html_(self) -> str:
        from fledge.display import table

        return table(self._title(), [group for process in self.processes for group in process.tables()],
                     notes=[finding.text for finding in self.health])


def _seed(seed: object) -> int:
    if not isinstance(seed, int) or not 0 <= seed < 2**64:
        raise SetupError(f"seed: expected a whole number from 0 to 2^64 - 1; found {seed!r}")
    return seed


def _next_name(path: str) -> str:
    """run.mcap -> run-2.mcap -> run-3.mcap"""
    import re

    def higher(match: re.Match) -> str:
        return f"-{int(match[1] or 1) + 1}{match[2]}"

    return re.sub(r"(?:-(\d+))?(|\.\w+)$", higher, path, count=1)
