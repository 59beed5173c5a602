# SPDX-License-Identifier: Apache-2.0
"""The live objects of one of a mission's flight processes as plain data, checked, for all exports.

Names in it are C's already: flight.py's own, but for keywords of C and C++, names that are taken, and texts that are
no identifiers.
"""
from __future__ import annotations

import re
import struct as packing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import objects
from fledge.commands import leaves
from fledge.elements import ELEMENTS
from fledge.errors import CompositionError, SetupError
from fledge.export import names
from fledge.disk import ROOT, shown
from fledge.mission.crossing import crossing_wires
from fledge.mission.wiring import event_text
from fledge.objects import project
from fledge.objects.script import function_text, prototype, script

if TYPE_CHECKING:
    from fledge import _core
    from fledge.mission.process import Flight
    from fledge.mission.simulation import Simulation

    Steps = list[tuple[_core.Operand, str, _core.Operand] | str]   # of a condition, as _core.Condition.steps has them

# The files of ccsds/ of a SpaceLink.
FRAMES = ("farm", "fop", "packet_zone", "space_link", "space_packet", "sync", "tc_frame", "tm_frame")
# Those of Files.
FILES = ("cfdp", "cfdp_filestore", "cfdp_messages", "cfdp_pdu", "cfdp_ranges", "cfdp_receiver", "cfdp_sender",
         "cfdp_transaction", "store/memory_store")
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)\.h"', re.MULTILINE)
HOSTS = ("targets/mission.h", "targets/mission_host.h")     # what the C of a mission includes
FUNCTIONS = ("init", "reset", "restart", "next", "tick", "enter", "may_enter", "set_up", "memory", "messages",
             "parameters", "commands", "definitions", "io", "services", "telemetry")    # and tables
LINKED = ("ccsds/", "flight/command/", "flight/math/", "flight/telemetry/")     # by other rules


class ExportError(SetupError):
    """A mission that cannot be exported: the text names file and line, instance, rule and finding."""


@dataclass
class Module:
    name: str                        # in C
    path: str                        # flight.control
    struct: _core.Struct
    memory: bytes                    # as flight.py left it, before any reset
    script: str = ""                 # why it cannot be C, with file and line: its update is Python

    @property
    def type(self) -> str:
        return self.struct.name

    @property
    def function(self) -> str:
        return names.snake(self.type)

    def fields(self, group: str) -> list[_core.Field]:
        return [f for f in self.struct.fields if f.group == group]

    def field(self, name: str) -> _core.Field:
        return next(f for f in self.struct.fields if f.name == name)


@dataclass
class Wire:
    source: str                      # m->in.nav_attitude, without the m->
    target: str                      # tracking.in.attitude
    stale_after: int                 # [ns]; 0: never
    choice: str = ""                 # of several into one input: "newest", "first", "best", "in MODE"


@dataclass
class Task:
    name: str
    title: str                       # as in flight.py
    period: int                      # [ns]
    offset: int                      # [ns]
    run: list[Module]
    modes: list[str] | None          # names of those in which it runs; None: always


@dataclass
class Guard:
    text: str                        # when a mode may be entered, in words
    condition: Steps                 # none: it has none
    after: list[str]                 # C names of the modes in which alone it is entered; none: in all


@dataclass
class Event:
    name: str
    title: str
    text: str                        # all of it, in words
    when: str                        # its condition in words
    condition: Steps
    until: Steps                     # of what arms it again; none: that the condition no longer holds
    hold: int                        # [ns]
    count: int                       # [instants]
    once: bool
    armed: bool                      # from the start
    modes: list[str]                 # C names of those in which it holds; none: in all
    mode: str                        # C name of the mode to enter; "": none
    arms: list[tuple[str, bool]]     # (C name of an event, whether to arm or disarm it)
    settings: list[tuple[Module, int, bytes]]   # (module, offset in its memory, bytes) of what it sets
    publishes: list[Module]          # the configuration that it sets


@dataclass
class Message:
    name: str                        # nav_attitude, motor_command
    path: str                        # world.nav.attitude
    struct: _core.Struct
    member: str                      # in.nav_attitude, motor.out.command
    direction: str                   # in, out, inside
    ends: list[str]                  # paths at its other ends
    latency: str = "same_instant"    # of an input, as the host must see to: mission/crossing.py
    optional: bool = False           # of an input: flight does without
    fed: str = ""                    # of an input that no wire feeds: what does on the desktop


@dataclass
class Mission:
    name: str                        # of the files and functions
    folder: str                      # the name of the mission's folder
    process: str                     # its flight process
    several: bool                    # whether the mission has other flight processes, too
    about: str                       # the first line of flight.py
    modules: list[Module]
    configuration: list[Module]      # those that only publish their parameters
    tasks: list[Task]                # in the order of equal times
    modes: list[str]                 # C names; the titles in mode_titles
    mode_titles: dict[str, str]
    initial_mode: str | None
    events: list[Event]
    inputs: list[Message]            # from outside
    outputs: list[Message]           # all of the modules' outputs
    wires: dict[str, list[Wire]]     # module name -> wires carried before its update
    published: dict[str, list[Wire]]  # configuration module name -> wires carried when it is published
    left_out: list[str]              # titles of tasks and events that are not exported
    reset: int | None = None         # the index in `inputs` of the message by which the computer is reset
    down: int = 0                    # [ns] how long it is down then
    form: str = "c"                  # c: with its functions; rtems: a thread for each task, too; micropython: composed
    changed: list[Module] = field(default_factory=list)     # micropython: those that are not as the script leaves them
    begins: str | None = None        # micropython: the initial mode, if it is not the script's
    place: Path | None = None        # the mission's folder; None: a program composed it
    guards: dict[str, Guard] = field(default_factory=dict)  # C name of a mode -> when it may be entered, if not always

    @property
    def title(self) -> str:
        """In words: "nadir_spin", "formation chief"."""
        return f"{self.folder} {self.process}" if self.several else self.folder

    @property
    def words(self) -> str:
        """What names it on the command line: "nadir_spin", "formation --process chief"."""
        return f"{self.folder} --process {self.process}" if self.several else self.folder

    def struct(self) -> str:
        """The name of the struct that holds it all."""
        return names.camel(self.name)

    def sources(self, roots: Sequence[Path]) -> list[str]:
        """The C files of its modules, and what drives services, each from the first of the roots that has it;
        flight/math is needed beside them."""
        driven = {"flight/telemetry/services.c"} if self.services else set()
        if any(m.type == "Files" for m in self.modules):
            driven |= {f"ccsds/{name}.c" for name in FILES}
        if any(m.type == "SpaceLink" for m in self.services):
            driven |= {f"ccsds/{name}.c" for name in FRAMES}
        own = [m.struct.header.removesuffix(".h") for m in self.modules]
        return sorted({f"{name}.c" for name in own} | driven | included(own, roots))

    @property
    def services(self) -> list[Module]:
        """The modules that commands need."""
        return [m for m in self.modules if m.struct.service]


def included(modules: Sequence[str], roots: Sequence[Path]) -> set[str]:
    """The C files of modules, which are named without their suffix, and those beside the headers that they include,
    from a root or beside themselves; and so on. Left out is what is linked anyway."""
    def file(name: str) -> Path | None:
        return next((root / name for root in roots if (root / name).is_file()), None)

    sources: set[str] = set()
    todo = list(modules)
    for stem in todo:           # it grows
        for name in (f"{stem}.h", f"{stem}.c"):
            if (path := file(name)) is None:
                continue
            if name.endswith(".c"):
                sources.add(name)
            for other in INCLUDE.findall(path.read_text("utf-8", "replace")):
                near = (Path(stem).parent / other).as_posix()
                other = near if file(f"{near}.h") else other
                if other not in todo and not other.startswith(LINKED):
                    todo.append(other)
    return sources


def read(sim: Simulation, process: str | None = None, tasks: Sequence[str] | None = None) -> Mission:
    """The Mission of a flight process, by its name, in a simulation which has not run, or of it the named tasks.

    process: None if there is only one. What it reads of other processes is an input, of the world as of flight. A
    subset takes with it the configuration that is wired to it; what it reads of the rest of its process becomes an
    input, too. Raises ExportError, and SetupError for what a run would refuse as well.
    """
    flights = {flight.name: flight for flight in sim.flights}
    if process is None and len(flights) != 1:
        raise ExportError(f"{sim.name} has {len(flights)} flight processes; choose one: {', '.join(flights)}"
                          if flights else f"{sim.name} has no flight process")
    if process is not None and process not in flights:
        raise ExportError(f"{sim.name} has no flight process '{process}'; it has {', '.join(flights) or 'none'}")
    flight = flights[process] if process is not None else sim.flight
    return _Reader(sim, flight, _memory(flight), tasks).mission()


def read_all(sim: Simulation) -> list[Mission]:
    """The Missions of all flight processes of a simulation which has not run."""
    memory = [_memory(flight) for flight in sim.flights]    # before the first is read, which resets them all
    return [_Reader(sim, *flight).mission() for flight in zip(sim.flights, memory)]


def _memory(flight: Flight) -> dict[str, bytes]:
    return {name: objects.memory(module) for name, module in flight.instances.items()}


class _Reader:
    def __init__(self, sim: Simulation, flight: Flight, memory: dict[str, bytes],
                 tasks: Sequence[str] | None = None) -> None:
        self.sim, self.flight = sim, flight
        if sim.time_ns >= 0:
            raise ExportError(f"{sim.name}: export it before it runs; it stands at {sim.time:g} s")
        try:
            sim.prepare()
        except CompositionError:
            raise
        except SetupError as error:
            raise self.refusal(str(error)) from None
        known = [t[0] for t in self.flight.tasks]
        if not known:
            raise ExportError(f"{sim.name}: {flight.name} has no task, so there is nothing to fly")
        for name in tasks or []:
            if name not in known:
                raise ExportError(f"{sim.name} has no task '{name}'; {flight.name} has {', '.join(known) or 'none'}")
        self.chosen = [t for t in sorted(self.flight.tasks, key=lambda t: -t[3]) if not tasks or t[0] in tasks]
        self.partial = len(self.chosen) < len(known)
        self.modules = self.read_modules(memory)

    # --- which modules ---

    def read_modules(self, memory: dict[str, bytes]) -> dict[str, Module]:
        live = self.flight.instances
        in_task = {name for t in self.flight.tasks for name in t[4]}
        self.running = running = {name for t in self.chosen for name in t[4]}
        wanted = set(running if self.partial else live)
        for source, target, *_ in self.sim.wires:
            process, name, _ = source.split(".")
            to_process, to_name, _ = target.split(".")
            if process == to_process == self.flight.name and name not in in_task and to_name in running:
                wanted.add(name)
        self.refuse_prototypes({name: module for name, module in live.items() if name in wanted})
        c = names.distinct(live, ("in", "task", "mode", "event"), names.NO_MEMBERS)    # what its struct holds besides
        return {name: Module(c[name], f"{self.flight.name}.{name}", objects.struct(module), memory[name],
                             self.read_script(name, module)) for name, module in live.items() if name in wanted}

    def refuse_prototypes(self, modules: dict[str, Any]) -> None:
        """Raise ExportError for modules whose interface is Python, too: no target has that."""
        prototypes = []
        for name, cls in ((name, prototype(module)) for name, module in modules.items()):
            if cls:
                kind, file, line = cls._struct.name, shown(cls._struct.path), cls._struct.line
                prototypes.append(self.refusal(
                    f"{self.flight.name}.{name} is still Python (the class {kind}, {file}, line {line}): "
                    f"./fledge new module {kind} --from {file}:{kind} begins its C", name))
        if prototypes:
            raise ExportError("\n".join(map(str, prototypes)))

    def read_script(self, name: str, module: Any) -> str:
        functions = script(module)
        return str(self.refusal(f"{self.flight.name}.{name} is still Python ({function_text(functions[0])}): write it "
                                "in C, or fly it with export micropython", name)) if functions else ""

    # --- wires ---

    def read_wires(self, mission: Mission) -> None:
        order: dict[str, Message] = {}
        crossing = {(wire.source, wire.port): wire for wire in crossing_wires(self.sim)}
        for source, target, latency, stale_after, choice in self.sim.wires:
            from_process, from_name, from_port = source.split(".")
            to_process, to_name, to_port = target.split(".")
            inside = from_process == self.flight.name and from_name in self.modules
            if to_process != self.flight.name or to_name not in self.modules:
                if inside:
                    self.ends.setdefault(source, []).append(target)
                continue
            module = self.modules[to_name]
            if inside and latency:
                raise self.refusal(f"{source} >> {target} has a latency of one exchange: that is for wires between "
                                   "processes; within one it cannot be exported")
            end = f"{module.name}.in.{to_port}"
            if not inside:
                wire = crossing.get((source, target))   # None: from the rest of this process
                self.read_input(order, source, target, wire.latency if wire else "same_instant")
                mission.wires[module.name].append(Wire(source, end, wire.stale_after if wire else stale_after, choice))
                continue
            producer = self.modules[from_name]
            start = f"{producer.name}.out.{from_port}"
            if from_name not in self.running:
                mission.published[producer.name].append(Wire(start, end, 0))
            else:
                mission.wires[module.name].append(Wire(start, end, stale_after, choice))
        for target, fed, stale_after in self.sim.feeds:
            process, name, port = target.split(".")
            if process == self.flight.name and name in self.modules:
                module = self.modules[name]
                field = module.field(port)
                order[target] = Message("", target, field.struct, "", "in", [target], optional=field.optional, fed=fed)
                mission.wires[module.name].append(Wire(target, f"{module.name}.in.{port}", stale_after))
        self.name_inputs(mission, order)

    def read_input(self, order: dict[str, Message], source: str, target: str, latency: str) -> None:
        """Add the end of a wire to the message that comes from outside, with this latency."""
        _, name, port = target.split(".")
        field = self.modules[name].field(port)
        message = order.setdefault(source, Message("", source, field.struct, "", "in", [], latency, True))
        if message.latency != latency:
            raise self.refusal(f"{source} reaches {self.flight.name} with two latencies, by {message.ends[0]} and "
                               f"{target}; an exported mission reads it once: give both the same")
        message.optional &= field.optional
        message.ends.append(target)

    def name_inputs(self, mission: Mission, order: dict[str, Message]) -> None:
        """The inputs by their paths get names in C, which their wires use."""
        c = names.distinct([path.removeprefix("world.") for path in order])
        for path, message in order.items():
            message.name = c[path.removeprefix("world.")]
            message.member = f"in.{message.name}"
        for inner in mission.wires.values():
            for node in inner:
                if node.source in order:
                    node.source = order[node.source].member
        mission.inputs = list(order.values())
        if self.flight.reset:
            line, mission.down = self.flight.reset
            mission.reset = next((i for i, port in enumerate(mission.inputs) if line in port.ends), None)

    # --- the whole ---

    def mission(self) -> Mission:
        sim = self.sim
        self.ends: dict[str, list[str]] = {}     # paths that read an output here
        name = self.name()
        mode_titles = [m[0] for m in self.flight.modes]
        mode_names = names.distinct(mode_titles)
        modules = list(self.modules.values())
        mission = Mission(
            name=name, folder=sim.name, process=self.flight.name, several=len(sim.flights) > 1,
            about=sim.mission.summaries()[""] if sim.mission else "", modules=modules,
            configuration=[m for n, m in self.modules.items() if n not in self.running], tasks=[],
            modes=list(mode_names.values()), mode_titles={c: t for t, c in mode_names.items()},
            initial_mode=mode_names.get(self.flight.active_mode), events=[], inputs=[], outputs=[],
            wires={m.name: [] for m in modules}, published={m.name: [] for m in modules}, left_out=[],
            place=sim.mission.folder if sim.mission else None)
        self.read_wires(mission)
        self.read_tasks(mission, mode_names)
        self.read_guards(mission, mode_names)
        self.read_events(mission, mode_names)
        ports = {f"{m.path}.{f.name}": (m, f) for m in modules for f in m.fields("out")}
        c = names.distinct([p.partition(".")[2] for p in ports], [m.name for m in mission.inputs])
        for path, (module, port) in ports.items():
            ends = self.ends.get(path, [])
            mission.outputs.append(Message(c[path.partition(".")[2]], path, port.struct,
                                           f"{module.name}.out.{port.name}", "out" if ends else "inside", ends))
        if not mission.outputs:
            raise self.refusal(f"{self.flight.name} puts out no message, so what flies could show nothing")
        for module in modules:
            self.check_finite(module, mission)
        return mission

    def name(self) -> str:
        """The mission's, unless something where its C is compiled has such a name already."""
        own = f"{self.sim.name}_{self.flight.name}" if len(self.sim.flights) > 1 else self.sim.name
        name = names.identifier(own).lower()
        headers = {*HOSTS, *(m.struct.header for m in self.modules.values())}
        taken = names.words(headers, [root for root in (ROOT, project.folder()) if root])
        static = [*(t[0] for t in self.flight.tasks), *self.flight.events, *(m[0] for m in self.flight.modes)]
        taken |= {f"{begin}_{title}" for begin in ("run", "runs", "thread", "check", "may_enter") for title in static}
        made = {*(names.camel(name) + end for end in ("", "In", "Mode", "Message")), f"{name}_publish",
                *(f"{name}_{end}" for end in FUNCTIONS),
                *(f"{name}_{end}".upper() for end in ("h", "messages", "parameters"))}
        if name in names.HEADERS or names.OF_LIBC.fullmatch(name) or made & taken:
            name += "_mission"
        return name

    def read_tasks(self, mission: Mission, mode_names: dict[str, str]) -> None:
        naming = names.distinct([t[0] for t in self.flight.tasks], keywords=names.NO_MEMBERS)
        for title, period, offset, _, run in self.chosen:
            modes = [mode_names[m] for m, tasks in self.flight.modes if title in tasks]
            mission.tasks.append(Task(naming[title], title, period, offset, [self.modules[n] for n in run],
                                      modes or None))
        chosen = [t[0] for t in self.chosen]
        mission.left_out += [f"the task {t[0]}" for t in self.flight.tasks if t[0] not in chosen]

    def read_guards(self, mission: Mission, mode_names: dict[str, str]) -> None:
        modules = {m.path: m for m in mission.modules}
        for mode, guard in self.flight.guards.items():
            steps = guard.condition.steps if guard.condition is not None else []
            paths = self.watched(f"mode {self.flight.name}.{mode}", steps, self.flight.declared_at(mode) or ("", 0))
            if paths <= modules.keys():
                mission.guards[mode_names[mode]] = Guard(guard.text, steps, [mode_names[mode] for mode in guard.after])
            else:
                mission.left_out.append(f"the condition of the mode {mode}")

    def watched(self, what: str, steps: Steps, declared_at: tuple[str, int]) -> set[str]:
        """The paths of the modules that a condition looks at, which must be flight's own."""
        operands = [operand for step in steps if not isinstance(step, str) for operand in (step[0], step[2])]
        paths = {operand.path for operand in operands if operand.path}
        for path in sorted(paths):
            if path.split(".")[0] != self.flight.name:
                raise ExportError("{}, line {}: ".format(*declared_at) + f"{what} looks at {path}: flight cannot see "
                                  "into other processes; watch an input of flight, as in watch(f.tracking.attitude)")
        return paths

    def read_events(self, mission: Mission, mode_names: dict[str, str]) -> None:
        live = self.flight.events.values()
        naming = names.distinct([e.name for e in live], keywords=names.NO_MEMBERS)
        modules = {m.path: m for m in mission.modules}
        rows, until = [], {}
        for event in live:
            until[event.name] = event.until.steps if event.until is not None else []
            steps = [*event.condition.steps, *until[event.name]]
            paths = self.watched(f"event {self.flight.name}.{event.name}", steps, event.declared_at)
            if {*paths, *(path for path, _, _ in event.settings)} <= modules.keys():
                rows.append(event)
            else:
                mission.left_out.append(f"the event {event.name}")
        flying = [event.name for event in rows]
        for event in rows:
            settings = [(modules[path], offset, raw) for path, offset, raw in event.settings]
            mission.events.append(Event(
                naming[event.name], event.name, event_text(event), event.text, event.condition.steps,
                until[event.name], event.hold, event.count, event.once, event.starts_armed,
                [mode_names[m] for m in event.modes], mode_names.get(event.mode, ""),
                [(naming[name], on) for name, on in event.arms if name in flying], settings,
                [m for m in mission.configuration if any(m is module for module, _, _ in settings)]))

    def check_finite(self, module: Module, mission: Mission) -> None:
        wired = {w.target for wires in (*mission.wires.values(), *mission.published.values()) for w in wires}
        for path, value in floats(module.struct, module.memory):
            if not value - value == 0.0 and ".".join([module.name, *path.split(".")[:2]]) not in wired:
                name = module.path.partition(".")[2]
                raise self.refusal(f"{module.path}.{path.partition('.')[2]} must be finite; found {value}", name)

    def refusal(self, text: str, name: str | None = None) -> ExportError:
        """An ExportError that begins with file and line: of what the mission calls `name` in this process, or else of
        the first instance that the text names."""
        if not self.sim.mission:
            return ExportError(text)
        folder, known = self.sim.mission.folder, {process.name: process for process in self.sim.processes}
        words = [] if name else re.findall(r"\b(\w+)\.(\w+)", text)
        named = ((known[p], n) for p, n in words if p in known and n in known[p].instances)
        process, name = next(named, (self.flight, name or ""))
        event = process.events.get(name)
        file, line = (event.declared_at if event else process.declared_at(name)) or ("", 0)
        if Path(file).is_relative_to(folder):
            return ExportError(f"{file}, line {line}: {text}")
        kind = "world" if process not in self.sim.flights else "flight"
        path = next((folder / f"{stem}.py" for stem in (kind, "mission") if (folder / f"{stem}.py").exists()), folder)
        return ExportError(f"{path}: {text}")


def floats(struct: _core.Struct, memory: bytes) -> Iterator[tuple[str, float]]:
    """(path, value) of every floating-point number in an object of that struct."""
    for port in struct.fields:
        for path, f, at in leaves([port], prefix=f"{port.group}." if port.group else ""):
            if ELEMENTS[f.type].is_float:
                values = packing.unpack_from(f"={f.size // ELEMENTS[f.type].size}{ELEMENTS[f.type].code}", memory, at)
                yield from ((path + (f"[{i}]" if f.shape else ""), v) for i, v in enumerate(values))
