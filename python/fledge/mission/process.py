# SPDX-License-Identifier: Apache-2.0
"""Processes as a mission builds them: `f`, the flight software, and `w`, the world.

    def build(f):
        f.control = fsw.MrpFeedback(K=2.5 * N * m, P=45 * N * m * s)    # the name is the attribute
        f.connect(f.tracking.error >> f.control.error)
        gnc = f.task("gnc", every=0.5 * s, run=[f.tracking, f.control])
        f.mode("science", [gnc])
        f.event("settled", when=f.watch(f.tracking.error).sigma_BR.norm() < 1e-3, hold=60 * s,
                enter=f.science)
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from fledge import _core
from fledge.elements import ELEMENTS
from fledge.errors import SetupError, did_you_mean, listed
from fledge.mission.commands import Commands
from fledge.objects.measured import Measured, flat_index, unit_after
from fledge.objects.si import time_ns
from fledge.objects.wires import Wire, caller


# --- conditions ------------------------------------------------------------------------------------

class Watch(Measured):
    """A field of a message or module, by name: `watch(f.tracking.error).sigma_BR[0]`, `.norm()`.

    Comparing it with a constant makes a condition: data, not code, so that it can be exported.
    """

    def __init__(self, obj, field=None):
        self._object, self._field = obj, field
        self._path = _core.path(obj) + (f".{field.name}" if field else "")
        self._shape = field.shape if field else ()

    def __getattr__(self, name: str) -> Watch:
        if name.startswith("_"):
            raise AttributeError(name)
        if self._field is None:
            for field in _core.struct(self._object).fields:
                if field.name == name and not field.spare:
                    return Watch(getattr(self._object, name)) if field.type == "struct" else Watch(self._object, field)
            getattr(self._object, name)  # raises, with the valid names
        raise AttributeError(f"{self!r} is a number or array; it has norm(), max_abs() and [index]")

    def _compare(self, comparison, constant):
        if self._field is None:
            names = ", ".join(f.name for f in _core.struct(self._object).fields if not f.spare)
            raise SetupError(f"{self!r}: compare one of its fields: {names}")
        value = self._constant(constant, comparison)
        index, measure = (flat_index(self._measure, self._shape), "element") if isinstance(self._measure, tuple) else (
            0, self._measure or "element")
        return _core.condition(self._object, self._field, index, measure, comparison, value,
                               f"{self!r} {comparison} {value:g}{unit_after(self._field.unit)}")

    def _encoded(self, value):
        encoded = _core.encode(self._object, self._field.name, value)
        element = ELEMENTS[self._field.type]
        if element.is_float and not all(isfinite(x) for x, in iter_unpack(element.code, encoded[0][1])):
            raise SetupError(f"{self!r}: an event sets numbers that are finite; found {value!r}")
        return encoded

    def __eq__(self, constant: Any) -> Any:
        return self._compare("==", constant)

    def __ne__(self, constant: Any) -> Any:
        return self._compare("!=", constant)

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self):
        raise TypeError(f"{self!r} is only known when the mission runs; compare it, as in x < 1")

    def __repr__(self):
        return self.measure_text


# --- handles ---------------------------------------------------------------------------------------

class Task:
    """A task that was declared, for mode()."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __repr__(self):
        return f"<task {self.name}>"


class TaskSpec(NamedTuple):
    """What a task runs, and when."""

    name: str
    period: int     # [ns]
    offset: int     # [ns]
    priority: int
    run: list[str]  # the names of its instances, in order

    @property
    def title(self) -> str:
        """Its name, rate and priority, in words."""
        return (f"{self.name}, every {self.period / 1e9:g} s"
                + (f" from {self.offset / 1e9:g} s" if self.offset else "")
                + (f", priority {self.priority}" if self.priority else ""))


class Mode:
    """A mode that was declared, for events."""

    def __init__(self, process: Process, name: str) -> None:
        self._process: Callable[[], Any] = weakref.ref(process)
        self.name = name

    def enter(self) -> None:
        """Enter it at the next instant of its process."""
        self._process().enter(self.name)

    def __repr__(self):
        return f"<mode {self.name}>"


def _mode_name(mode: Mode | str) -> str:
    return mode.name if isinstance(mode, Mode) else mode


class _At(NamedTuple):
    """The condition that a time has come."""

    ns: int


class Event:
    """An event that was declared. `armed` may be read and set; `fired_at` is the time [s], or None."""

    def __init__(self, process: Process, name: str, when: Any, do: Callable[[], Any] | None) -> None:
        self.name, self.when, self.do = name, when, do
        self.declared_at = caller()
        self._process: Callable[[], Any] = weakref.ref(process)
        self._core: Any = None

    @property
    def armed(self) -> bool:
        return self._core.armed

    @armed.setter
    def armed(self, value: bool) -> None:
        self._core.armed = bool(value)

    @property
    def condition(self) -> Any:
        """The condition as data: path, field, comparison, constant. For events that watch() makes."""
        return self._core.condition

    @property
    def hold(self) -> int:
        """How long the condition must hold [ns]."""
        return self._core.hold

    @property
    def once(self) -> bool:
        """Whether it stays disarmed after it has fired."""
        return self._core.once

    @property
    def mode(self) -> str:
        """The name of the mode that it enters; "" for none."""
        return self._core.mode

    @property
    def functions(self) -> list[Callable[[], Any]]:
        """The Python functions that it calls: for its condition, and when it fires."""
        return [f for f in (self.when, self.do) if callable(f) and not isinstance(f, _core.Condition)]

    @property
    def fired_at(self) -> float | None:
        return None if self._core.fired_at < 0 else self._core.fired_at / 1e9

    # The kernel holds these two, which hold the event weakly: a callable that refers to its own
    # simulation would otherwise keep it alive for ever.
    def _predicate(self):
        me: Callable[[], Any] = weakref.ref(self)
        if isinstance(self.when, _At):
            return lambda: me()._process()._core_simulation.now >= me().when.ns
        return lambda: bool(me().when())

    def _action(self):
        me: Callable[[], Any] = weakref.ref(self)
        return lambda: me().do()

    def __repr__(self):
        at = self.fired_at
        return f"<event {self.name}, " + ("armed" if self.armed else "not armed") + (
            f", fired at {at:g} s>" if at is not None else ">")


# --- processes -------------------------------------------------------------------------------------

class Process:
    """Instances by name, and the tasks, modes and events of a process.

    Assign a module or model to an attribute to give it its name; read it back the same way.
    """

    def __init__(self, core_simulation, core_process):
        put = object.__setattr__
        put(self, "_core_simulation", core_simulation)
        put(self, "_core_process", core_process)
        put(self, "_instances", {})
        put(self, "_gone", "")     # the reason, if it runs in another program
        put(self, "_handles", {})  # modes and events
        put(self, "_declared_at", {})   # (file, line) of instances by name, and of wires by their readers' paths
        put(self, "_commands", None)
        put(self, "_tasks", {})    # apart, because a task may have the name of an instance

    @property
    def name(self) -> str:
        return self._core_process.name

    # --- attributes are instances ---

    def __setattr__(self, name, value):
        if name in dir(type(self)):
            found = getattr(type(self), name)
            if isinstance(found, property) and found.fset:
                return found.fset(self, value)
            raise SetupError(f"{self.name}.{name}: this name is taken by the process itself; choose another")
        if name in self._handles:
            raise SetupError(f"{self.name}.{name} is already {self._handles[name]!r}")
        if not isinstance(value, (_core.Module, _core.Model)):
            raise SetupError(f"{self.name}.{name}: expected a module or model; found {value!r}")
        self._accept(name, value)
        self._core_process.add(name, value)
        self._instances[name] = value
        self._declared_at[name] = caller()
        _core.set_context(value, weakref.ref(self))

    def _accept(self, name, value):
        """Refuse a value that does not belong into this process."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        for names in (self._instances, self._handles, self._tasks):
            if name in names:
                return names[name]
        if self._gone:
            raise SetupError(f"{self.name}.{name}: {self.name} {self._gone}")
        raise AttributeError(self.unknown(name))

    def leave(self) -> str:
        """Forget everything, because the process runs in another program from now on. Returns this reason, which
        the errors for its former attributes give."""
        why = "runs in another program: see its state there, in its own record, or in a run of one program"
        self._instances.clear()
        self._handles.clear()
        self._tasks.clear()
        object.__setattr__(self, "_gone", why)
        return why

    def unknown(self, name: str) -> str:
        """The text of the error for a name that the process does not have."""
        known = [*self._instances, *self._handles]
        return (f"the process {self.name} has no '{name}'{did_you_mean(name, known)} it has "
                + listed(known, none="nothing yet"))

    # --- declarations ---

    @property
    def instances(self) -> dict[str, Any]:
        """The modules and models by name, in the order in which they were given."""
        return dict(self._instances)

    @property
    def tasks(self) -> list[TaskSpec]:
        """The tasks, in the order of their declaration."""
        return [TaskSpec(*task) for task in self._core_process.tasks]

    @property
    def modes(self) -> list[tuple[str, list[str]]]:
        """(name, names of its tasks) of each mode."""
        return self._core_process.modes

    @property
    def active_mode(self) -> str:
        """The name of the mode that the process is in; "" if it has none."""
        return self._core_process.mode

    @property
    def requested_mode(self) -> str:
        """The name of the mode that the process was last asked to enter, which it may be in."""
        return self._core_process.asked

    @property
    def events(self) -> dict[str, Event]:
        """The events by name."""
        return {name: one for name, one in self._handles.items() if isinstance(one, Event)}

    def declared_at(self, name: str) -> tuple[str, int] | None:
        """(file, line) that assigned an instance, or that connected an input, given by its path; None if unknown."""
        return self._declared_at.get(name)

    def __dir__(self):
        return [*super().__dir__(), *self._instances, *self._handles, *self._tasks]

    def __iter__(self):
        """The instances, in the order in which they were given."""
        return iter(self._instances.values())

    # --- wires, tasks, modes, events ---

    def connect(self, *wires: Wire) -> None:
        """Join outputs to inputs: `connect(a.output >> b.input, ...)`.

        Raises SetupError if an input already has a writer, or a module has no name yet.
        """
        for one in wires:
            if not isinstance(one, Wire):
                raise SetupError(f"{self.name}.connect: expected wires, as in a.output >> b.input; found {one!r}")
            for target in one.targets:
                self._core_simulation.connect(one.source, target, one.options["latency"], one.options["stale_after"])
                self._declared_at[_core.path(target)] = one.declared_at

    def task(self, name: str, *, every: Any, run: Sequence[Any], offset: Any = 0, priority: int = 0) -> Task:
        """Run modules or models in order, at one rate. Returns a handle for mode().

        every, offset: times. At equal times, tasks of higher priority run first, then those declared
        first. Modules in no task only publish their parameters. The handle is also found as an
        attribute, unless an instance has the same name.
        """
        what = f"task {self.name}.{name}"
        for one in run:
            if not isinstance(one, (_core.Module, _core.Model)):
                raise SetupError(f"{what}: run takes modules or models; found {one!r}")
        self._core_process.add_task(name, time_ns(every, f"{what}: every"), time_ns(offset, f"{what}: offset"),
                                    priority, run)
        self._tasks[name] = Task(name)
        return self._tasks[name]

    def mode(self, name: str, tasks: Iterable[Task | str]) -> Mode:
        """A named set of tasks that are active in it. Tasks that no mode names are always active.

        The first mode declared is the one to begin with. Returns a handle, also found as an attribute.
        """
        self._new_name(name, f"mode {self.name}.{name}")
        names = [t.name if isinstance(t, Task) else t for t in tasks]
        self._core_process.add_mode(name, names)
        self._handles[name] = Mode(self, name)
        return self._handles[name]

    def start_in(self, mode: Mode | str) -> None:
        """Begin in this mode."""
        self._core_process.start_in(_mode_name(mode))

    def enter(self, mode: Mode | str) -> None:
        """Enter a mode at the next instant of this process."""
        self._core_process.enter(_mode_name(mode))

    @staticmethod
    def watch(port: Any) -> Watch:
        """A symbolic reference to a message, for conditions: `watch(f.tracking.error).sigma_BR.norm()`."""
        if not isinstance(port, (_core.Message, _core.Module, _core.Model)):
            raise SetupError(f"watch: expected a port or module; found {port!r}")
        return Watch(port)

    def event(self, name: str, *, when: Any, hold: Any = 0, once: bool = False, enter: Mode | str | None = None,
              do: Callable[[], Any] | None = None) -> Event:
        """Something that happens when a condition has held for a time; it arms itself again when the
        condition no longer holds, unless `once`.

        when: a condition made with watch(); hold: a time; enter: a mode of this process; do: a function
        without arguments. Returns a handle, also found as an attribute.
        """
        what = f"event {self.name}.{name}"
        self._new_name(name, what)
        self._accept_event(what, when, do)
        if not isinstance(when, (_core.Condition, _At)) and not callable(when):
            raise SetupError(f"{what}: when takes a condition, as in watch(port).field < 1; found {when!r}")
        event = Event(self, name, when, do)
        event._core = self._core_process.add_event(
            name, when if isinstance(when, _core.Condition) else event._predicate(), time_ns(hold, f"{what}: hold"),
            once, "" if enter is None else _mode_name(enter), event._action() if do else None)
        self._handles[name] = event
        return event

    def _accept_event(self, what, when, do):
        """Refuse a condition or a function that events of this process must not have."""

    def _new_name(self, name, what):
        if name in self._instances or name in self._handles:
            raise SetupError(f"{what}: {self.name}.{name} is already there")
        if name in dir(type(self)):
            raise SetupError(f"{what}: this name is taken by the process itself; choose another")

    def __repr__(self):
        lines = [f"process {self.name}" + (f", in mode {self._core_process.mode}" if self._core_process.mode else "")]
        width = max(map(len, self._instances), default=0)
        lines += [f"  {name.ljust(width)}  {_core.struct(one).name}" for name, one in self._instances.items()]
        for name, period, offset, priority, run in self._core_process.tasks:
            lines.append(f"  task {name}, every {period / 1e9:g} s: {', '.join(run)}")
        for name, tasks in self._core_process.modes:
            lines.append(f"  mode {name}: {', '.join(tasks)}")
        return "\n".join(lines)

    # --- clones ---

    def _clone(self, core_simulation):
        """The same process of a cloned simulation, its objects made anew."""
        other = type(self)(core_simulation, core_simulation.process(self.name))
        other._instances.update(other._core_process.wrap())
        other._tasks.update(self._tasks)
        other._declared_at.update(self._declared_at)
        for one in other._instances.values():
            _core.set_context(one, weakref.ref(other))
        events = {e.name: e for e in other._core_process.events}
        for name, handle in self._handles.items():
            if isinstance(handle, Mode):
                other._handles[name] = Mode(other, name)
            else:
                event = Event(other, name, handle.when, handle.do)
                event._core = events[name]
                if not isinstance(handle.when, _core.Condition):
                    event._core.predicate = event._predicate()
                if handle.do:
                    event._core.action = event._action()
                other._handles[name] = event
        return other


class Flight(Process):
    """Flight software. Its events are data: a condition and a mode."""

    @property
    def commands(self) -> Commands:
        """Commands by packets, as its targets get them."""
        if self._commands is None or not self._core_process.has_dictionary:
            object.__setattr__(self, "_commands", Commands(self, self._core_process))
        return self._commands

    def _accept(self, name, value):
        if isinstance(value, _core.Model):
            raise SetupError(f"{self.name}.{name}: a {_core.struct(value).name} is a model of the world and cannot "
                             "fly; assign it in world.py")

    def _accept_event(self, what, when, do):
        if do is not None or not isinstance(when, _core.Condition):
            raise SetupError(f"{what}: flight's events are data, so that they can be exported: a condition made "
                             "with watch(), and a mode to enter; Python belongs into the world's events")


class World(Process):
    """The truth. Its events may call Python."""

    @property
    def integrator(self) -> Any:
        """The method for the world's differential equations: world.RK4() or world.Adaptive(...)."""
        return self._core_process.integrator

    @integrator.setter
    def integrator(self, method: Any) -> None:
        if not isinstance(method, _core.Integrator):
            raise SetupError(f"{self.name}.integrator: expected world.RK4() or world.Adaptive(...); found {method!r}")
        self._core_process.integrator = method

    def at(self, t: Any, do: Callable[[], Any], name: str | None = None) -> Event:
        """Call `do()` once, at the first instant at or after the time t. From within an event: after this instant."""
        ns = time_ns(t, f"{self.name}.at")
        name = name or f"at_{ns}_ns" + (f"_{len(self._handles)}" if f"at_{ns}_ns" in self._handles else "")
        return self.event(name, when=_At(ns), do=do, once=True)
