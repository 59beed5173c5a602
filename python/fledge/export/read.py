# SPDX-License-Identifier: Apache-2.0
"""The live objects of a mission's flight process as plain data, checked, for all exports.

Names in it are C's already: flight.py's own, but for keywords of C and texts that are no identifiers.
"""
from __future__ import annotations

import ast
import re
import struct as packing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fledge import objects
from fledge.elements import ELEMENTS
from fledge.errors import SetupError
from fledge.export import names
from fledge.mission.wiring import event_text


class ExportError(SetupError):
    """A mission that cannot be exported: the text names file and line, instance, rule and finding."""


@dataclass
class Module:
    name: str                        # in C
    path: str                        # flight.control
    struct: Any                      # objects.struct() of it
    memory: bytes                    # as flight.py left it, before any reset

    @property
    def type(self) -> str:
        return self.struct.name

    @property
    def function(self) -> str:
        return names.snake(self.type)

    def fields(self, group: str) -> list[Any]:
        return [f for f in self.struct.fields if f.group == group]


@dataclass
class Wire:
    source: str                      # m->in.nav_attitude, without the m->
    target: str                      # tracking.in.attitude
    stale_after: int                 # [ns]; 0: never


@dataclass
class Task:
    name: str
    title: str                       # as in flight.py
    period: int                      # [ns]
    offset: int                      # [ns]
    run: list                        # of Module
    modes: list | None               # names of those in which it runs; None: always


@dataclass
class Event:
    name: str
    title: str
    text: str                        # all of it, in words
    condition: list                  # steps of an objects.Condition
    until: list                      # the same, of what arms it again; none: that the condition no longer holds
    hold: int                        # [ns]
    count: int                       # [instants]
    once: bool
    armed: bool                      # from the start
    modes: list                      # C names of those in which it holds; none: in all
    mode: str                        # C name of the mode to enter; "": none
    arms: list                       # (C name of an event, whether to arm or disarm it)
    settings: list                   # (Module, offset in its memory, bytes) of what it sets
    publishes: list                  # of Module: the configuration that it sets


@dataclass
class Message:
    name: str                        # nav_attitude, motor_command
    path: str                        # world.nav.attitude
    struct: Any
    member: str                      # in.nav_attitude, motor.out.command
    direction: str                   # in, out, inside
    ends: list                       # paths at its other ends
    latency: int = 0                 # exchanges that an input takes, as the host must see to
    optional: bool = False           # of an input: flight does without


@dataclass
class Mission:
    name: str                        # of the files and functions
    title: str                       # of the folder
    about: str                       # the first line of flight.py
    modules: list
    configuration: list              # modules that only publish their parameters
    tasks: list                      # in the order of equal times
    modes: list                      # C names; the titles in mode_titles
    mode_titles: dict
    initial_mode: str | None
    events: list
    inputs: list                     # Message, from outside
    outputs: list                    # Message, all of the modules' outputs
    wires: dict                      # module name -> wires carried before its update
    published: dict                  # configuration module name -> wires carried when it is published
    left_out: list                   # titles of tasks and events that are not exported

    def struct(self) -> str:
        """The name of the struct that holds it all."""
        return names.camel(self.name)

    def sources(self) -> list[str]:
        """The C files of its modules, from the root that their headers are included from; flight/math is
        needed beside them."""
        return sorted({m.struct.header.removesuffix(".h") + ".c" for m in self.modules})


def read(sim: Any, tasks: Sequence[str] | None = None) -> Mission:
    """The Mission that flies in a simulation which has not run, or of it the named tasks.

    A subset takes with it the configuration that is wired to it; what it reads of the rest of flight
    becomes an input, as what it reads of the world. Raises ExportError, and SetupError for what a run
    would refuse as well.
    """
    return _Reader(sim, tasks).mission()


class _Reader:
    def __init__(self, sim, tasks):
        if len(sim.flights) > 1:
            raise ExportError(f"{sim.name} has {len(sim.flights)} flight processes, and what is exported is that of "
                              "one spacecraft: fly it in a mission of its own")
        self.sim, self.flight = sim, sim.flight
        if sim.time_ns >= 0:
            raise ExportError(f"{sim.name}: export it before it runs; it stands at {sim.time:g} s")
        bytes_before = {name: objects.memory(one) for name, one in sim.flight.instances.items()}
        try:
            sim.prepare()
        except SetupError as error:
            raise self.refusal(str(error)) from None
        known = [t[0] for t in self.flight.tasks]
        for name in tasks or []:
            if name not in known:
                raise ExportError(f"{sim.name} has no task '{name}'; flight has {', '.join(known)}")
        self.chosen = [t for t in sorted(self.flight.tasks, key=lambda t: -t[3]) if not tasks or t[0] in tasks]
        self.partial = len(self.chosen) < len(known)
        self.modules = self.read_modules(bytes_before)

    # --- which modules ---

    def read_modules(self, memory):
        live = self.sim.flight.instances
        in_task = {name for t in self.flight.tasks for name in t[4]}
        running = {name for t in self.chosen for name in t[4]}
        wanted = set(running)
        for source, target, _, _ in self.sim.wires:
            process, name, _ = source.split(".")
            if process == "flight" and name not in in_task and target.split(".")[1] in running:
                wanted.add(name)
        if not self.partial:
            wanted = set(live)
        self.running = running
        c = names.distinct(live, ("in", "task", "mode", "event"))   # what the mission's struct holds besides
        return {name: Module(c[name], f"flight.{name}", objects.struct(one), memory[name])
                for name, one in live.items() if name in wanted}

    # --- wires ---

    def read_wires(self, mission):
        order = {}
        for source, target, latency, stale_after in self.sim.wires:
            from_process, from_name, from_port = source.split(".")
            to_process, to_name, to_port = target.split(".")
            inside = from_process == "flight" and from_name in self.modules
            if to_process != "flight" or to_name not in self.modules:
                if inside:
                    self.ends.setdefault(source, []).append(target)
                continue
            module = self.modules[to_name]
            if inside and latency:
                raise self.refusal(f"{source} >> {target} has a latency of one exchange: that is for wires between "
                                   "processes; within flight it cannot be exported")
            end = f"{module.name}.in.{to_port}"
            if inside:
                producer = self.modules[from_name]
                start = f"{producer.name}.out.{from_port}"
                if from_name not in self.running:
                    mission.published[producer.name].append(Wire(start, end, 0))
                else:
                    mission.wires[module.name].append(Wire(start, end, stale_after))
            else:
                struct = next(f.struct for f in module.struct.fields if f.name == to_port)
                message = order.setdefault(source, Message("", source, struct, "", "in", [], latency, True))
                if message.latency != latency:
                    raise self.refusal(f"{source} reaches flight with two latencies, by {message.ends[0]} and "
                                       f"{target}; an exported mission reads it once: give both the same")
                message.optional &= next(f.optional for f in module.struct.fields if f.name == to_port)
                message.ends.append(target)
                mission.wires[module.name].append(Wire(source, end, stale_after))
        c = names.distinct([path.removeprefix("world.") for path in order])
        for path, message in order.items():
            message.name = c[path.removeprefix("world.")]
            message.member = f"in.{message.name}"
        for wires in mission.wires.values():
            for wire in wires:
                if wire.source in order:
                    wire.source = order[wire.source].member
        mission.inputs = list(order.values())

    # --- the whole ---

    def mission(self):
        sim = self.sim
        self.ends = {}
        name = self.name()
        mode_titles = [m[0] for m in self.flight.modes]
        mode_names = names.distinct(mode_titles)
        modules = list(self.modules.values())
        mission = Mission(
            name=name, title=sim.name, about=sim.mission.summaries()[""] if sim.mission else "", modules=modules,
            configuration=[m for n, m in self.modules.items() if n not in self.running], tasks=[],
            modes=list(mode_names.values()), mode_titles={c: t for t, c in mode_names.items()},
            initial_mode=mode_names.get(self.flight.active_mode), events=[], inputs=[], outputs=[],
            wires={m.name: [] for m in modules}, published={m.name: [] for m in modules}, left_out=[])
        self.read_wires(mission)
        self.read_tasks(mission, mode_names)
        self.read_events(mission, mode_names)
        taken = [m.name for m in mission.inputs]
        ports = {f"{m.path}.{f.name}": (m, f) for m in modules for f in m.fields("out")}
        c = names.distinct([p.partition(".")[2] for p in ports], taken)
        for path, (module, port) in ports.items():
            ends = self.ends.get(path, [])
            mission.outputs.append(Message(c[path.partition(".")[2]], path, port.struct,
                                           f"{module.name}.out.{port.name}", "out" if ends else "inside", ends))
        for module in modules:
            self.check_finite(module, mission)
        return mission

    def name(self):
        """The mission's, apart from the names of its modules and messages and of targets/mission.h."""
        name = names.identifier(self.sim.name).lower()
        types = {"Mission", "MissionMessage"}
        for module in self.modules.values():
            types |= {module.type, *(f.struct.name for f in module.struct.fields if f.group in ("in", "out"))}
        if types & {names.camel(name) + end for end in ("", "In", "Mode", "Message")}:
            name += "_mission"
        return name

    def read_tasks(self, mission, mode_names):
        naming = names.distinct([t[0] for t in self.flight.tasks])
        for title, period, offset, _, run in self.chosen:
            modes = [mode_names[m] for m, tasks in self.flight.modes if title in tasks]
            mission.tasks.append(Task(naming[title], title, period, offset, [self.modules[n] for n in run],
                                      modes or None))
        chosen = [t[0] for t in self.chosen]
        mission.left_out += [f"the task {t[0]}" for t in self.flight.tasks if t[0] not in chosen]

    def read_events(self, mission, mode_names):
        live = self.flight.events.values()
        naming = names.distinct([e.name for e in live])
        modules = {m.path: m for m in mission.modules}
        kept, until = [], {}
        for event in live:
            until[event.name] = event.until.steps if event.until is not None else []
            steps = [*event.condition.steps, *until[event.name]]
            paths = [one.path for step in steps if not isinstance(step, str) for one in (step[0], step[2]) if one.path]
            for path in paths:
                if path.split(".")[0] != self.flight.name:
                    file, line = event.declared_at
                    raise ExportError(f"{file}, line {line}: event {self.flight.name}.{event.name} looks at {path}: "
                                      "flight cannot see into other processes; watch an input of flight, as in "
                                      "watch(f.tracking.attitude)")
            if {*paths, *(path for path, _, _ in event.settings)} <= modules.keys():
                kept.append(event)
            else:
                mission.left_out.append(f"the event {event.name}")
        flying = [event.name for event in kept]
        for event in kept:
            settings = [(modules[path], offset, raw) for path, offset, raw in event.settings]
            mission.events.append(Event(
                naming[event.name], event.name, event_text(event), event.condition.steps,
                until[event.name], event.hold, event.count, event.once, event.starts_armed,
                [mode_names[m] for m in event.modes], mode_names.get(event.mode, ""),
                [(naming[name], on) for name, on in event.arms if name in flying], settings,
                [m for m in mission.configuration if any(m is one for one, _, _ in settings)]))

    def check_finite(self, module, mission):
        wired = {w.target for wires in (*mission.wires.values(), *mission.published.values()) for w in wires}
        for path, value in floats(module.struct, module.memory):
            if not value - value == 0.0 and ".".join([module.name, *path.split(".")[:2]]) not in wired:
                name = module.path.partition(".")[2]
                raise self.refusal(f"{module.path}.{path.partition('.')[2]} must be finite; found {value}", name)

    def refusal(self, text, name=None):
        """An ExportError that begins with file and line: of what flight.py calls `name`, or else of the first
        instance that the text names."""
        if not self.sim.mission:
            return ExportError(text)
        process = "flight"
        for p, n in [] if name else re.findall(r"\b(flight|world)\.(\w+)", text):
            if n in getattr(self.sim, p).instances:
                process, name = p, n
                break
        path = self.sim.mission.folder / f"{process}.py"
        line = line_of(path, name)
        return ExportError(f"{path}, line {line}: {text}" if line else f"{path}: {text}")


def line_of(path: Path, name: str | None) -> int | None:
    """The line of a mission's file where an instance or event gets its name, or None."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if (isinstance(node, ast.Attribute) and node.attr == name and isinstance(node.ctx, ast.Store)
                or isinstance(node, ast.Constant) and node.value == name):
            return node.lineno
    return None


def leaves(fields: Sequence[Any], path: str = "", base: int = 0) -> Iterator[tuple[str, Any, int]]:
    """(path, field, offset) of every field that is no struct; of an array of structs, of each element."""
    for f in fields:
        if f.type == "struct":
            for i, at in enumerate(range(base + f.offset, base + f.offset + f.size, f.struct.size)):
                yield from leaves(f.struct.fields, f"{path}{f.name}" + (f"[{i}]" if f.shape else "") + ".", at)
        else:
            yield path + f.name, f, base + f.offset


def floats(struct: Any, memory: bytes) -> Iterator[tuple[str, float]]:
    """(path, value) of every floating-point number in an object of that struct."""
    for port in struct.fields:
        for path, f, at in leaves([port], f"{port.group}." if port.group else ""):
            if ELEMENTS[f.type].is_float:
                values = packing.unpack_from(f"={f.size // ELEMENTS[f.type].size}{ELEMENTS[f.type].code}", memory, at)
                yield from ((path + (f"[{i}]" if f.shape else ""), v) for i, v in enumerate(values))
