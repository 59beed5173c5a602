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
from collections.abc import Callable, Iterable, Iterator, Sequence
from math import isfinite, prod
from struct import iter_unpack
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, TypeAlias

from fledge import _core
from fledge.elements import ELEMENTS
from fledge.errors import SetupError, instead, listed, suggesting
from fledge.mission.command_choice import CommandChoice, routed, schedule
from fledge.objects.script import short_function_text
from fledge.objects.measured import Measured, flat_index, unit_after
from fledge.objects.si import Time, enumerator_names, time_ns
from fledge.objects.wires import Wire, as_shown, caller
from fledge.objects.weak import weakly
from fledge.objects.words import Instance, first_sentence

if TYPE_CHECKING:
    from fledge.mission.commands import Commands

Predicate: TypeAlias = "_core.Condition | _At | Callable[[], object]"
Modes: TypeAlias = "Mode | str | Sequence[Mode | str]"
Events: TypeAlias = "Event | str | Sequence[Event | str]"


# --- conditions ------------------------------------------------------------------------------------

class Watch(Measured):
    """A field of a message or module, by name: `watch(f.tracking.error).sigma_BR[0]`, `.norm()`.

    Comparing it with a constant or with another field makes a condition: data, not code, so that it can be exported.
    `&`, `|` and `~` join conditions.
    """

    def __init__(self, obj: Instance | _core.Message, field: _core.Field | None = None) -> None:
        self._object, self._field = obj, field
        self._path = _core.path(obj) + (f".{field.name}" if field else "")
        self._shape = field.shape if field else ()

    def __getattr__(self, name: str) -> Watch:
        if name.startswith("_"):
            raise AttributeError(name)
        if self._field is None:
            for field in _core.struct(self._object).fields:
                if field.name == name and not field.spare:
                    return Watch(getattr(self._object, name)) if field.type == "struct" and not field.shape else Watch(
                        self._object, field)
            getattr(self._object, name)  # raises, with the valid names
        elif self._field.type == "struct":
            raise AttributeError(f"{self!r} is an array of {self._field.struct.name}; pick one, as in {self!r}[0]")
        raise AttributeError(f"{self!r} is a number or array; it has norm(), max_abs() and [index]")

    def __getitem__(self, index: int | tuple[int, ...]) -> Watch:
        if self._field is None or self._field.type != "struct":
            return super().__getitem__(index)
        if not isinstance(index, int) or not 0 <= index < self._shape[0]:
            raise SetupError(f"{self!r}[{index}]: expected a whole number below {self._shape[0]}")
        return Watch(_core.row(self._object, self._field.name, index))

    def _number(self, what: str) -> tuple[int, str]:
        """(index of the element, measure) of the one number that it is. Raises SetupError if it is no number."""
        if self._field is None or self._field.type == "struct":
            struct = self._field.struct if self._field else _core.struct(self._object)
            raise SetupError(f"{self!r}: {what} one of its fields: "
                             + listed([f.name for f in struct.fields if not f.spare], none="it has none"))
        if self._field.type == "char":
            raise SetupError(f"{self!r} is a text; {what} a number")
        if _core.root(self._object) is None:
            raise SetupError(f"{self!r} is in no module or model: {what} a field of one")
        if isinstance(self._measure, tuple):
            return flat_index(self._measure, self._shape), "element"
        return 0, self._measure or "element"

    def _compare(self, comparison: str, constant: object) -> _core.Condition:
        left = _core.Operand(self._object, self._field, *self._number("compare"))
        if isinstance(constant, Watch):
            right, text = self._other(constant, comparison), repr(constant)
        else:
            value = self._constant(constant, comparison)
            if not isfinite(value) or isinstance(value, int) and not -2**63 <= value < 2**64:
                raise SetupError(f"{self!r} {comparison} {constant!r}: expected a finite number, and a whole one of up "
                                 "to 64 bits")
            right, text = _core.Operand(value), _constant_text(value, self._field)
        return _core.Condition(left, comparison, right, f"{self!r} {comparison} {text}")

    def _other(self, other: Watch, comparison: str) -> _core.Operand:
        """The operand of another field, which must be a number of the same kind."""
        for watch in (self, other):
            if watch._shape and not watch._measure:
                raise SetupError(f"{watch!r} has shape {watch._shape}: compare an element, norm() or max_abs()")
        index, measure = other._number("compare")
        if repr(self) == repr(other):
            raise SetupError(f"{self!r} {comparison} {other!r}: this compares a field with itself")
        ours, theirs = ((f.ctype if f.type == "enum" else f.unit if f.unit == "ns" else f.dims[:7])
                        for f in (self._field, other._field))
        if ours != theirs:
            kinds = (f.ctype if f.type == "enum" else f"in {f.unit}" if f.unit not in ("", "-") else "without unit"
                     for f in (self._field, other._field))
            raise SetupError(f"{self!r} {comparison} {other!r}: the first is {next(kinds)}, the second {next(kinds)}")
        return _core.Operand(other._object, other._field, index, measure)

    def _setting(self, value: object) -> list[tuple[Instance | None, int, bytes]]:
        """(instance, offset, bytes) of what an assignment to this field or element writes."""
        indices: Any = self._measure
        index, measure = self._number("set")
        if measure != "element":
            raise SetupError(f"{self!r}: set an element of it, or the whole field")
        field, root = self._field, _core.root(self._object)
        if not self._measure:
            return [(root, *setting) for setting in self._encoded(value)]
        whole = row = getattr(self._object, field.name).tolist()
        for i in indices[:-1]:
            row = row[i] if i < len(row) else []
        if indices[-1] >= len(row):
            raise SetupError(f"{self!r}: the array has {len(whole)} rows; give it its rows first, or set it whole")
        row[indices[-1]] = value
        offset, raw = self._encoded(whole)[0]
        width = field.size // prod(self._shape)
        return [(root, offset + index * width, raw[index * width:(index + 1) * width])]

    def _encoded(self, value: object) -> list[tuple[int, bytes]]:
        encoded = _core.encode(self._object, self._field.name, value)
        element = ELEMENTS[self._field.type]
        if element.is_float and not all(isfinite(x) for x, in iter_unpack(element.code, encoded[0][1])):
            raise SetupError(f"{self!r}: an event sets numbers that are finite; found {value!r}")
        return encoded

    def __eq__(self, constant: object) -> _core.Condition:  # type: ignore[override]
        return self._compare("==", constant)

    def __ne__(self, constant: object) -> _core.Condition:  # type: ignore[override]
        return self._compare("!=", constant)

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> NoReturn:
        raise TypeError(f"{self!r} is only known when the mission runs; compare it, as in x < 1")

    def __repr__(self) -> str:
        return self.measure_text


def _constant_text(value: Any, field: _core.Field) -> str:
    """A constant of a condition, as the user would write it."""
    if field.type == "enum":
        return enumerator_names(field).get(value, f"{value:g}")
    return (str(value) if isinstance(value, int) else f"{value:g}") + unit_after(field.unit)


# --- handles ---------------------------------------------------------------------------------------

class Task:
    """A task that was declared, for mode()."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
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
        self._process = weakly(process)
        self.name = name

    @property
    def process(self) -> Process:
        """The process whose mode it is."""
        return self._process()

    def enter(self) -> None:
        """Enter it at the next instant of its process. Raises SetupError if its condition does not hold."""
        self._process().enter(self.name)

    def __repr__(self) -> str:
        return f"<mode {self.name}>"


class Guard(NamedTuple):
    """When a mode may be entered. text: in words, "after rest, if flight.plan.loaded == 1"; condition: as of an event,
    or None; after: the modes in which alone it may be requested; none: in all"""

    text: str
    condition: _core.Condition | None
    after: list[str]


def _mode_name(mode: Mode | str) -> str:
    return mode.name if isinstance(mode, Mode) else mode


def _task_name(task: Task | str) -> str:
    return task.name if isinstance(task, Task) else task


def _several(value: object) -> list[Any]:
    """A list of handles or names, of which one may stand alone."""
    return list(value) if isinstance(value, (list, tuple)) else [] if value is None else [value]


def _value_text(value: object) -> str:
    """A value that an event sets, in one line."""
    return " ".join(str(value).split())


class _At(NamedTuple):
    """The condition that a time has come."""

    ns: int


class Event:
    """An event that was declared. `armed` may be read and set; `fired_at` is the time [s], or None."""

    name: str
    when: Any       # a Predicate
    do: Any         # a function, or None
    set_text: list[str]
    declared_at: tuple[str, int]

    def __init__(self, process: Process, name: str, when: Predicate, do: Callable[[], object] | None,
                 set_text: Sequence[str] = ()) -> None:
        vars(self).update(name=name, when=when, do=do, set_text=list(set_text), declared_at=caller())
        self._process = weakly(process)
        self._core: _core.Event = None     # type: ignore[assignment]    # until the kernel has it

    def __setattr__(self, name: str, value: object) -> None:
        if name != "armed" and not name.startswith("_"):
            raise SetupError(f"event {self._process().name}.{self.name}: '{name}' cannot be set, only 'armed'; the "
                             "rest is given where the event is declared")
        object.__setattr__(self, name, value)

    @property
    def text(self) -> str:
        """When it happens, in words."""
        if isinstance(self.when, _core.Condition):
            return repr(self.when)
        return f"t >= {self.when.ns / 1e9:g} s" if isinstance(self.when, _At) else short_function_text(self.when)

    @property
    def fired(self) -> tuple[int, float | None]:
        """(how often it has fired in this run, when first [s] or None)"""
        count, first = self._core.fired
        return count, None if first < 0 else first / 1e9

    @property
    def armed(self) -> bool:
        return self._core.armed

    @armed.setter
    def armed(self, value: bool) -> None:
        self._process().refuse_if_flown()
        if any(_core.maker(instance) == "model" for instance in self._process()):
            raise SetupError(f"{self._process().name}.{self.name}: an FMU flies this process, and arms its events "
                             "itself")
        self._core.armed = bool(value)

    @property
    def arming(self) -> int:
        """1: it is armed; 0: not before something arms it; -1: it has fired, and arms itself again."""
        return self._core.arming

    @property
    def condition(self) -> Any:
        """The condition as data: its steps in postfix order, holds(). For events that watch() makes."""
        return self._core.condition

    @property
    def until(self) -> _core.Condition | None:
        """The condition that arms it again after it has fired; None: that its condition no longer holds."""
        return self._core.until

    @property
    def hold(self) -> int:
        """How long the condition must hold [ns]."""
        return self._core.hold

    @property
    def count(self) -> int:
        """At how many successive instants the condition must hold."""
        return self._core.count

    @property
    def once(self) -> bool:
        """Whether it stays disarmed after it has fired."""
        return self._core.once

    @property
    def starts_armed(self) -> bool:
        """Whether it may fire from the start."""
        return self._core.starts_armed

    @property
    def modes(self) -> list[str]:
        """The names of the modes in which its condition may hold; none: in all."""
        return self._core.modes

    @property
    def mode(self) -> str:
        """The name of the mode that it enters; "" for none."""
        return self._core.mode

    @property
    def arms(self) -> list[tuple[str, bool]]:
        """(name, whether it is armed or disarmed) of the events that it arms and disarms."""
        return self._core.arms

    @property
    def settings(self) -> list[tuple[str, int, bytes]]:
        """(path of the module, offset in its memory, bytes) of what it sets."""
        return self._core.set

    @property
    def functions(self) -> list[Callable[[], object]]:
        """The Python functions that it calls: for its condition, and when it fires."""
        return [f for f in (self.when, self.do) if callable(f) and not isinstance(f, _core.Condition)]

    @property
    def fired_at(self) -> float | None:
        return None if self._core.fired_at < 0 else self._core.fired_at / 1e9

    # The kernel holds these two, which hold the event weakly: a callable that refers to its own
    # simulation would otherwise keep it alive for ever.
    def _predicate(self) -> Callable[[], bool]:
        me = weakly(self)
        if isinstance(self.when, _At):
            return lambda: me()._process()._core_simulation.now >= me().when.ns
        return lambda: bool(me().when())

    def _action(self) -> Callable[[], object]:
        me = weakly(self)
        return lambda: me().do()

    def __repr__(self) -> str:
        at = self.fired_at
        return f"<event {self.name}, " + ("armed" if self.armed else "not armed") + (
            f", fired at {at:g} s>" if at is not None else ">")


# --- processes -------------------------------------------------------------------------------------

@suggesting(period="every", modules="run", condition="when", mode="enter")
class Process:
    """Instances by name, and the tasks, modes and events of a process.

    Assign a module or model to an attribute to give it its name; read it back the same way.
    """

    def __init__(self, core_simulation: _core.Simulation, core_process: _core.Process) -> None:
        put = object.__setattr__
        put(self, "_core_simulation", core_simulation)
        put(self, "_core_process", core_process)
        put(self, "_instances", {})
        put(self, "_gone", "")     # the reason, if it runs in another program
        put(self, "_handles", {})  # modes and events
        put(self, "_declared_at", {})   # (file, line) of instances by name, and of wires by their readers' paths
        put(self, "_commands", None)
        put(self, "_tasks", {})    # apart, because a task may have the name of an instance
        put(self, "_choices", [])
        put(self, "warned", set())  # of what is implausible

    @property
    def name(self) -> str:
        return self._core_process.name

    # --- attributes are instances ---

    def __setattr__(self, name: str, value: object) -> None:
        if name in dir(type(self)):
            attribute = getattr(type(self), name)
            if isinstance(attribute, property) and attribute.fset:
                return attribute.fset(self, value)
            raise SetupError(f"{self.name}.{name}: this name is taken by the process itself; choose another")
        if name in self._handles:
            raise SetupError(f"{self.name}.{name} is already {self._handles[name]!r}")
        if not isinstance(value, (_core.Module, _core.Model)):
            raise SetupError(f"{self.name}.{name}: expected a module or model; found {value!r}")
        self._accept(name, value)
        if lost := _core.assigned(value):
            raise SetupError(f"{self.name}.{name}: {', '.join(lost)} of this {_core.struct(value).name} cannot be set, "
                             "for the run begins with a reset, which clears outputs and memory; set parameters")
        at = caller()
        self._core_process.add(name, value, *as_shown(at))
        self._instances[name] = value
        self._declared_at[name] = at
        _core.set_context(value, weakref.ref(self))

    def _accept(self, name: str, value: Instance) -> None:
        """Refuse a value that does not belong into this process."""

    def __getattr__(self, name: str) -> Any:
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
        return (f"the process {self.name} has no '{name}'{instead(name, [*known, *self._tasks])} it has "
                + listed(known, none="nothing yet"))

    # --- declarations ---

    @property
    def instances(self) -> dict[str, Any]:
        """The modules and models by name, in the order in which they were given."""
        return dict(self._instances)

    @property
    def command_choices(self) -> list[CommandChoice]:
        """The modules that connections to the world added, which choose among commands."""
        return self._choices

    @property
    def tasks(self) -> list[TaskSpec]:
        """The tasks, in the order of their declaration."""
        return [TaskSpec(*task) for task in self._core_process.tasks]

    @property
    def modes(self) -> list[tuple[str, list[str]]]:
        """(name, names of its tasks) of each mode."""
        return self._core_process.modes

    @property
    def guards(self) -> dict[str, Guard]:
        """When modes may be entered, of those that may not always."""
        return {mode: Guard(*guard) for (mode, _), guard in zip(self.modes, self._core_process.guards) if guard[0]}

    @property
    def active_mode(self) -> str:
        """The name of the mode that the process is in; "" if it has none."""
        return self._core_process.mode

    @property
    def requested_mode(self) -> str:
        """The name of the mode that was requested last; the process may be in it."""
        return self._core_process.requested_mode

    @property
    def entered(self) -> dict[str, tuple[int, float | None]]:
        """Mode -> (how often it began in this run, when first [s] or None)."""
        return {name: (count, None if first < 0 else first / 1e9)
                for (name, _), (count, first) in zip(self.modes, self._core_process.entered)}

    @property
    def events(self) -> dict[str, Event]:
        """The events by name."""
        return {name: handle for name, handle in self._handles.items() if isinstance(handle, Event)}

    def declared_at(self, name: str) -> tuple[str, int] | None:
        """(file, line) that assigned an instance, declared a mode, or connected an input, given by its path; None if
        unknown."""
        return self._declared_at.get(name)

    def declare(self, path: str, at: tuple[str, int]) -> None:
        """Note the (file, line) of a mode, or that says where an input gets its messages from, for declared_at()."""
        self._declared_at[path] = at

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._instances, *self._handles, *self._tasks]

    def __iter__(self) -> Iterator[Any]:
        """The instances, in the order in which they were given."""
        return iter(self._instances.values())

    # --- wires, tasks, modes, events ---

    def connect(self, *wires: Wire) -> None:
        """Join outputs to inputs: `connect(a.output >> b.input, ...)`. An input takes one of several outputs by
        fledge.flight.newest(), first(), best() or by_mode(): `connect(fsw.newest(a.torque, b.torque) >> motor.torque)`.
        For a command of the world, `connect(fsw.newest(a.command, b.command) >> w.rods.command)`, flight chooses, by a
        module that this adds to it, `rods_command`.

        Forces add up: for each output beyond the first that is joined to the `external` of a spacecraft `craft`, that
        gets a part of the type ExternalForce, `craft_external_2` and so on.

        Raises SetupError if an input already has a writer, or a module has no name yet.
        """
        for wire in wires:
            if not isinstance(wire, Wire):
                raise SetupError(f"{self.name}.connect: expected wires, as in a.output >> b.input; found {wire!r}")
        for joined in (part for wire in wires for part in routed(wire, Flight)):
            for target in joined.targets:
                target = self._with_room(joined.source, target)
                for i, (source, by, mode) in enumerate(joined.sources):
                    try:
                        self._core_simulation.connect(
                            source, target, joined.options["latency"], joined.options["stale_after"], by, mode, i > 0,
                            *as_shown(joined.declared_at))
                    except SetupError as error:
                        first = self.declared_at(_core.path(target))
                        if first is None or first[0] != joined.declared_at[0]:
                            raise
                        raise SetupError(f"{error}: lines {first[1]} and {joined.declared_at[1]}") from None
                self.declare(_core.path(target), joined.declared_at)

    def _with_room(self, source: _core.Message, target: _core.Message) -> _core.Message:
        """The input; that of a new ExternalForce if it is a spacecraft's `external` that another output writes."""
        path, craft = _core.path(target), _core.root(target)
        if not path.endswith(".external"):
            return target
        from fledge.world import ExternalForce, Spacecraft

        taken = {to: writer for writer, to, *_ in self._core_simulation.wires}
        if path not in taken or not isinstance(craft, Spacecraft):
            return target
        others = [_core.path(part.external) for part in craft.parts if isinstance(part, ExternalForce)]
        for to in (path, *others):
            if taken.get(to) == _core.path(source):
                raise SetupError(f"{taken[to]} >> {path}: this output already acts on it, by {to}")
        part = ExternalForce()
        context = _core.context(craft)
        assert context is not None
        setattr(context(), f"{path.split('.')[1]}_external_{len(others) + 2}", part)
        craft.parts = part
        return part.external

    def feed(self, port: _core.Message, record: object = None, /, **options: Any) -> None:
        """Feed an input by hand, in place of a wire, as Simulation.feed() does."""
        from fledge.mission.feed import feed

        feed(self._core_simulation, port, record, **options)

    def task(self, name: str, *, every: Time, run: Sequence[Instance], offset: Time = 0, priority: int = 0) -> Task:
        """Run modules or models in order, at one rate. Returns a handle for mode().

        every, offset: times. At equal times, tasks of higher priority run first, then those declared
        first. Modules in no task only publish their parameters. The handle is also found as an
        attribute, unless an instance has the same name.
        """
        what = f"task {self.name}.{name}"
        if not isinstance(run, (list, tuple)):
            raise SetupError(f"{what}: run takes a list of modules or models, as in run=[f.control]; found "
                             + (_core.path(run) if isinstance(run, (_core.Module, _core.Model)) else repr(run)))
        for instance in run:
            if not isinstance(instance, (_core.Module, _core.Model)):
                raise SetupError(f"{what}: run takes modules or models; found {instance!r}"
                                 + (": give the object, not its name" if isinstance(instance, str) else ""))
        self._core_process.add_task(name, time_ns(every, f"{what}: every"), time_ns(offset, f"{what}: offset"),
                                    priority, run)
        self._tasks[name] = Task(name)
        self.declare(f"{self.name}.{name}", caller())
        schedule(self)
        return self._tasks[name]

    def mode(self, name: str, tasks: Iterable[Task | str], *, when: _core.Condition | None = None,
             after: Modes | None = None) -> Mode:
        """A named set of tasks that are active in it. Tasks that no mode names are always active.

        The first mode declared is the one to begin with. Returns a handle, also found as an attribute.

        when: a condition made with watch(), without which a request to enter the mode is refused. after: modes of this
        process, or their names, in which alone it may be requested. Runs and resets begin in a mode whatever these say.
        """
        what = f"mode {self.name}.{name}"
        self._new_name(name, what)
        if isinstance(tasks, (str, Task)):
            raise SetupError(f"{what}: expected a list of tasks, as in [\"{_task_name(tasks)}\"]; found {tasks!r}")
        names = [_task_name(task) for task in tasks]
        if when is not None and not isinstance(when, _core.Condition):
            raise SetupError(f"{what}: when takes a condition, as in watch(port).field < 1; found {when!r}")
        for earlier in _several(after):
            if isinstance(earlier, Mode) and earlier._process() is not self:
                raise SetupError(f"{what}: {earlier!r} is of another process")
        at = caller()
        self._core_process.add_mode(name, names, when, list(map(_mode_name, _several(after))), *as_shown(at))
        self.declare(name, at)
        self._handles[name] = Mode(self, name)
        return self._handles[name]

    def start_in(self, mode: Mode | str) -> None:
        """Begin in this mode."""
        self._core_process.start_in(_mode_name(mode))

    def enter(self, mode: Mode | str) -> None:
        """Enter a mode at the next instant of this process. Raises SetupError if its condition does not hold."""
        self.refuse_if_flown()
        self._core_process.enter(_mode_name(mode))

    def refuse_if_flown(self) -> None:
        """Raise SetupError if a computer flies this process, which no request here would reach."""
        if any(_core.maker(instance) == "computer" for instance in self):
            raise SetupError(f"{self.name}: a computer flies this process, and requests and commands here do not reach "
                             "it. Put their packets into its script, as in board.in_flight.script.append((after, "
                             f"packet)), with a time in ns and a packet of {self.name}.commands.packets")

    @staticmethod
    def watch(port: Instance | _core.Message) -> Watch:
        """A symbolic reference to a message, for conditions: `watch(f.tracking.error).sigma_BR.norm()`."""
        if not isinstance(port, (_core.Message, _core.Module, _core.Model)):
            raise SetupError(f"watch: expected a port or module; found {port!r}")
        return Watch(port)

    def event(self, name: str, *, when: Predicate, until: _core.Condition | None = None, hold: Time = 0,
              count: int = 1, once: bool = False, armed: bool = True, modes: Modes | None = None,
              enter: Mode | str | None = None, arm: Events | None = None, disarm: Events | None = None,
              set: Sequence[tuple[Watch, object]] = (), do: Callable[[], object] | None = None) -> Event:
        """Something that happens when a condition has held long enough. Returns a handle, also found as an attribute.

        when: a condition made with watch(), such as (watch(a).x > 1) & ~(watch(b).mode == "SAFE").
        hold, count: it must hold for this time, and at so many successive instants of the process.
        modes: modes of this process, in which alone it holds.
        until: a condition that arms the event again after it has fired; without, it is armed again as soon as `when`
        no longer holds; with once=True, not at all. armed=False: something must arm it first.
        enter: a mode of this process. arm, disarm: events of this process, or their names.
        set: pairs of a parameter or output of this process and its value, as in set=[(watch(a.par).gain, 2)].
        do: a function without arguments.
        """
        what = f"event {self.name}.{name}"
        self._new_name(name, what)
        self._accept_event(what, when, do)
        if not isinstance(when, (_core.Condition, _At)) and not callable(when):
            raise SetupError(f"{what}: when takes a condition, as in watch(port).field < 1; found {when!r}")
        if until is not None and not isinstance(until, _core.Condition):
            raise SetupError(f"{what}: until takes a condition, as in watch(port).field < 1; found {until!r}")
        if not isinstance(count, int):
            raise SetupError(f"{what}: count: expected a whole number; found {count!r}")
        pairs = list(set)
        for pair in pairs:
            if not isinstance(pair, tuple) or len(pair) != 2 or not isinstance(pair[0], Watch):
                raise SetupError(f"{what}: set takes pairs of a field and a value, as in "
                                 f"set=[(f.watch(f.module).parameter, 1)]; found {pair!r}")
        for handle in (*_several(modes), *_several(enter), *_several(arm), *_several(disarm)):
            if isinstance(handle, (Mode, Event)) and handle._process() is not self:
                raise SetupError(f"{what}: {handle!r} is of another process")
        event = Event(self, name, when, do, [f"{target!r} = {_value_text(value)}" for target, value in pairs])
        event._core = self._core_process.add_event(
            name, when if isinstance(when, _core.Condition) else event._predicate(), until,
            time_ns(hold, f"{what}: hold"), count, once, armed, [_mode_name(m) for m in _several(modes)],
            "" if enter is None else _mode_name(enter),
            [(handle.name if isinstance(handle, Event) else handle, on) for these, on in ((arm, True), (disarm, False))
             for handle in _several(these)],
            [setting for target, value in pairs for setting in target._setting(value)], event._action() if do else None,
            event.text, *as_shown(event.declared_at))
        self._handles[name] = event
        return event

    def _accept_event(self, what: str, when: Predicate, do: Callable[[], object] | None) -> None:
        """Refuse a condition or a function that events of this process must not have."""

    def _new_name(self, name: str, what: str) -> None:
        if name in self._instances:
            raise SetupError(f"{what}: the name is taken by the {_core.struct(self._instances[name]).kind} "
                             f"{self.name}.{name} ({_core.struct(self._instances[name]).name}); choose another")
        if name in self._handles:
            raise SetupError(f"{what}: the name is taken by the {type(self._handles[name]).__name__.lower()} "
                             f"{self.name}.{name}; choose another")
        if name in dir(type(self)):
            raise SetupError(f"{what}: this name is taken by the process itself; choose another")

    def mode_texts(self) -> list[tuple[str, str]]:
        """(name, in words its tasks, and when it may be entered) of each mode."""
        only = {name: f"; only {guard.text}" for name, guard in self.guards.items()}
        return [(name, (", ".join(tasks) or "no task of its own") + only.get(name, "")) for name, tasks in self.modes]

    def tables(self) -> list[tuple[str, list[tuple[str, ...]]]]:
        """(heading, rows) of what its repr says, with what each instance is."""
        rows: list[tuple[str, ...]]
        rows = [(name, _core.struct(instance).name, first_sentence(_core.struct(instance).doc))
                for name, instance in self._instances.items()]
        rows += [(task.name, "task, " + task.title.partition(", ")[2], ", ".join(task.run)) for task in self.tasks]
        rows += [(name, "mode", text) for name, text in self.mode_texts()]
        return [(repr(self).partition("\n")[0], rows)]

    def _repr_html_(self) -> str:
        from fledge.display import table

        return table("", self.tables())

    def __repr__(self) -> str:
        lines = [f"process {self.name}" + (f", in mode {self._core_process.mode}" if self._core_process.mode else "")]
        width = max(map(len, self._instances), default=0)
        lines += [f"  {name.ljust(width)}  {_core.struct(instance).name}" for name, instance in self._instances.items()]
        for name, period, offset, priority, run in self._core_process.tasks:
            lines.append(f"  task {name}, every {period / 1e9:g} s: {', '.join(run)}")
        lines += [f"  mode {name}: {text}" for name, text in self.mode_texts()]
        return "\n".join(lines)

    # --- clones ---

    def _clone(self, core_simulation: _core.Simulation) -> Process:
        """The same process of a cloned simulation, its objects made anew."""
        other = type(self)(core_simulation, core_simulation.process(self.name))
        other._instances.update(other._core_process.wrap())
        other._tasks.update(self._tasks)
        other._choices.extend(self._choices)
        other._declared_at.update(self._declared_at)
        other.warned.update(self.warned)
        for instance in other._instances.values():
            _core.set_context(instance, weakref.ref(other))
        events = {e.name: e for e in other._core_process.events}
        for name, handle in self._handles.items():
            if isinstance(handle, Mode):
                other._handles[name] = Mode(other, name)
            else:
                event = Event(other, name, handle.when, handle.do, handle.set_text)
                event._core = events[name]
                if not isinstance(handle.when, _core.Condition):
                    event._core.predicate = event._predicate()
                if handle.do:
                    event._core.action = event._action()
                other._handles[name] = event
        return other


@suggesting()
class Flight(Process):
    """Flight software. Its events are data: conditions, and what they do."""

    def reset_by(self, message: _core.Message, *, down: Time = 0) -> None:
        """The computer of this process is reset by each new count of a ComputerReset, an input of one of its modules.
        For the time `down` it runs nothing, and its outputs stay; then it begins anew, with the parameters that it had
        at the start of the run."""
        self._core_process.reset_by(message, time_ns(down, f"{self.name}.reset_by: down"))

    @property
    def reset(self) -> tuple[str, int] | None:
        """(path of the input that resets its computer, [ns] how long it is down then), or None."""
        return self._core_process.reset

    @property
    def outages(self) -> list[tuple[int, int]]:
        """(from, until) [ns] of the times at which its computer was down in this run."""
        return self._core_process.outages

    @property
    def has_services(self) -> bool:
        """Whether modules of it need `commands`, so that the kernel has its dictionary."""
        return any(_core.struct(instance).service for instance in self)

    @property
    def sends_unseen(self) -> bool:
        """Whether its packets of telemetry are not known here: a computer flies it, or frames come from a record."""
        return (any(_core.maker(instance) == "computer" for instance in self)
                or self._commands is not None and self._commands.plays_frames)

    @property
    def commands(self) -> Commands:
        """Commands by packets, as its targets get them."""
        from fledge.mission.commands import Commands, dictionary

        known = self._commands
        if known is None or self._core_simulation.time < 0 and known.dictionary != dictionary(self):
            object.__setattr__(self, "_commands", Commands(self, self._core_process))
        return self._commands

    def _accept(self, name: str, value: Instance) -> None:
        if isinstance(value, _core.Model):
            raise SetupError(f"{self.name}.{name}: a {_core.struct(value).name} is a model of the world and cannot "
                             "fly; assign it in world.py")

    def _accept_event(self, what: str, when: Predicate, do: Callable[[], object] | None) -> None:
        if do is not None:
            raise SetupError(f"{what}: flight's events are data, so that they can be exported: they have enter, arm, "
                             "disarm or set; do, a function in Python, belongs into the world's events")
        if not isinstance(when, _core.Condition):
            raise SetupError(f"{what}: when takes a condition made with watch(), which flight evaluates, as in "
                             f"f.watch(f.tracking.error).sigma_BR[0] < 1e-3; found {_value_text(when)}")


@suggesting()
class World(Process):
    """The truth. Its events may call Python."""

    def _accept(self, name: str, value: Instance) -> None:
        if isinstance(value, _core.Module):
            raise SetupError(f"{self.name}.{name}: a {_core.struct(value).name} is a flight module, and this process "
                             "is a world; assign it to a flight process, in flight.py")

    @property
    def integrator(self) -> _core.Integrator:
        """The method for the world's differential equations: world.RK4() or world.Adaptive(...)."""
        return self._core_process.integrator

    @integrator.setter
    def integrator(self, method: _core.Integrator) -> None:
        if not isinstance(method, _core.Integrator):
            raise SetupError(f"{self.name}.integrator: expected world.RK4() or world.Adaptive(...); found {method!r}")
        self._core_process.set_integrator(method)

    def at(self, t: Time, do: Callable[[], object], name: str | None = None) -> Event:
        """Call `do()` once, at the first instant at or after the time t. From within an event: after this instant."""
        ns = time_ns(t, f"{self.name}.at")
        name = name or f"at_{ns}_ns" + (f"_{len(self._handles)}" if f"at_{ns}_ns" in self._handles else "")
        return self.event(name, when=_At(ns), do=do, once=True)
