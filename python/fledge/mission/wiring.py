# SPDX-License-Identifier: Apache-2.0
"""The instances of a simulation and the wires between them: as an outline in text, and for the picture.

    wiring = Wiring(fledge.load("nadir_spin"))
    print(wiring.outline())
    fledge.plot.wiring.save(wiring, "nadir_spin.svg")    # .svg, .png, .pdf or .dot
"""

from __future__ import annotations

from dataclasses import dataclass

from fledge import _core
from fledge.mission.process import Event, Process, World
from fledge.objects.script import prototype, script, short_function_text

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from fledge.mission.simulation import Simulation


def kind_of(process: Process) -> str:
    """What a process is: "flight" or "world"."""
    return "world" if isinstance(process, World) else "flight"


class Node:
    """An instance: its position in the tasks, and what it is."""

    def __init__(self, process: Process, name: str, instance: _core.Module | _core.Model):
        struct = _core.struct(instance)
        self.instance = instance
        self.process, self.kind = process.name, kind_of(process)
        self.name, self.type, self.doc = name, struct.name, struct.doc
        self.path = f"{process.name}.{name}"
        self.task: str | None = None     # the task that runs it
        self.slot: tuple[int, ...] = ()  # (task, index in it) if a task runs it; a part takes the slot of its host
        self.in_stack = False            # whether it is in the longest chain of its task
        self.host: str | None = None     # the path of the model that it is a part of
        self.notes = _notes(instance)
        self.inputs = [f for f in struct.fields if f.group == "in"]


@dataclass
class Link:
    """A wire, or what feeds an input by hand: then `source` says it in words."""
    source: str
    target: str
    message: str            # the name of its type
    latency: int            # [exchanges]
    stale_after: int        # [ns]
    choice: str = ""        # of several into one input: which one counts
    fed: bool = False
    back: bool = False      # whether its reader sees the data only at a later instant

    @property
    def start(self) -> str:
        """The path of the instance that writes it."""
        return "" if self.fed else _owner(self.source)

    @property
    def to(self) -> str:
        """The path of the instance that reads it."""
        return _owner(self.target)

    @property
    def crosses(self) -> bool:
        """Whether it goes from one process to another."""
        return self.source.partition(".")[0] != self.target.partition(".")[0]

    @property
    def ports(self) -> str:
        """The names at its ends, once if they are the same."""
        a, b = (path.rpartition(".")[2] for path in (self.source, self.target))
        return b if a == b or self.fed else f"{a} \N{RIGHTWARDS ARROW} {b}"

    @property
    def options(self) -> list[str]:
        """Its choice, its latency and its age limit, in words."""
        late = "one exchange late" if self.latency == 1 else f"{self.latency} exchanges late"
        stale = f"stale after {self.stale_after / 1e9:g} s"
        return [text for text, is_so in ((self.choice, self.choice), (late, self.latency), (stale, self.stale_after))
                if is_so]


class Wiring:
    """The processes, nodes and links of a simulation.

    flight_only: leave out the world; the wires between it and flight end at names.
    """

    def __init__(self, simulation: Simulation, flight_only: bool = False) -> None:
        self.name = simulation.name
        # Flight first, as it is what a mission is about.
        shown = sorted(simulation.flights if flight_only else simulation.processes, key=lambda p: isinstance(p, World))
        self.processes = [_Process(p) for p in shown]
        self.kinds = {p.name: kind_of(p) for p in simulation.processes}
        self.nodes: dict[str, Node] = {node.path: node for process in self.processes for node in process.nodes}
        messages = {f"{_core.path(instance)}.{f.name}": f.struct.name
                    for process in simulation.processes for instance in process
                    for f in _core.struct(instance).fields if f.group in ("in", "out")}
        links = [Link(wire[0], wire[1], messages[wire[0]], *wire[2:]) for wire in simulation._core.wires]
        links += [Link(source, target, messages[target], 0, stale_after, fed=True)
                  for target, source, stale_after in simulation.feeds]
        self.links: list[Link] = [link for link in links if link.start in self.nodes or link.to in self.nodes]
        ports = dict.fromkeys(port for link in self.links for port in (link.source, link.target))
        fed = {link.source for link in self.links if link.fed}
        self.open_ends: list[str] = [port for port in ports if port in fed or _owner(port) not in self.nodes]
        for link in self.links:
            link.back = self._goes_back(link)
        self._find_stacks()

    def _goes_back(self, link: Link) -> bool:
        """Whether the reader sees the data at a later instant: the wire is late, or the reader runs first."""
        a, b = self.nodes.get(link.start), self.nodes.get(link.to)
        return bool(link.latency) or bool(a and b and not link.crosses and a.slot and b.slot and a.slot >= b.slot)

    def _find_stacks(self) -> None:
        """Find the stack of each task: its longest chain of wires, the last of several. The other nodes of the task,
        such as a source of commands for a module of the stack, stand beside it."""
        order = {f"{n.path}.{f.name}": i for n in self.nodes.values() for i, f in enumerate(n.inputs)}
        feeding: dict[str, list[str]] = {}
        for link in sorted(self.links, key=lambda joined: order.get(joined.target, 0)):
            a, b = self.nodes.get(link.start), self.nodes.get(link.to)
            if a and b and a.task and (a.process, a.task) == (b.process, b.task) and not link.back:
                feeding.setdefault(b.path, []).append(a.path)
        for process in self.processes:
            for task in process.tasks:
                length, before = {"": 0}, {}
                for node in process.run_by(task.name):
                    above = max(feeding.get(node.path, ()), key=lambda path: length[path], default="")
                    before[node.path], length[node.path] = above, 1 + length[above]
                last = max(reversed(length), key=lambda path: length[path])
                while last:
                    self.nodes[last].in_stack = True
                    last = before[last]

    # --- text ---

    def outline(self) -> str:
        """The wiring as text: the order in which the nodes run, and the source of each input."""
        sources: dict[str, list[Link]] = {}
        for link in self.links:
            sources.setdefault(link.target, []).append(link)
        lines: list[str] = []
        for process in self.processes:
            lines += ["", process.name] if lines else [process.name]
            width = max((len(n.name) for n in process.nodes), default=0)
            for task, title in [*((t.name, t.title) for t in process.tasks), (None, "in no task")]:
                nodes = process.run_by(task)
                if not nodes:
                    continue
                lines.append(f"  {title}")
                for node in nodes:
                    lines.append(f"    {node.name.ljust(width)}  {node.type}"
                                 + "".join(f"; {note}" for note in node.notes)
                                 + (f"; part of {node.host.partition('.')[2]}" if node.host else ""))
                    ports = max((len(f.name) for f in node.inputs), default=0)
                    for port in node.inputs:
                        links = sources.get(f"{node.path}.{port.name}", [])
                        start = f"    {' ' * width}    {port.name.ljust(ports)}  "
                        if not links:
                            lines.append(f"{start}-- not wired" + (", optional" if port.optional else ""))
                        for link in links:
                            source = link.source.removeprefix(f"{process.name}.")
                            lines.append(f"{start}<< " + ", ".join([source, *link.options]))
            for word, rows in (("mode", process.modes), ("event", process.events)):
                lines += [f"  {word} {name}: {text}" if name else f"  {word} {text}" for name, text in rows]
            if process.integrator:
                lines.append(f"  integrator: {process.integrator}")
        return "\n".join(lines)


# --- reading ---------------------------------------------------------------------------------------

class _Process:
    def __init__(self, process: Process):
        core = process._core_process
        self.name, self.kind, self.mode = process.name, kind_of(process), core.mode
        self.nodes = [Node(process, _core.name(instance), instance) for instance in process]
        # In the order in which they run at equal times.
        self.tasks = sorted(process.tasks, key=lambda t: -t.priority)
        by_name = {node.name: node for node in self.nodes}
        for i, task in enumerate(self.tasks):
            for j, name in enumerate(task.run):
                if by_name[name].task is None:
                    by_name[name].task, by_name[name].slot = task.name, (i, j)
        for node in self.nodes:
            for k, part in enumerate(_attached(node.instance, "parts")):
                child = by_name.get(_core.name(part))
                if child is not None:
                    child.host = node.path
                    if node.slot and not child.slot:
                        child.task, child.slot = node.task, (*node.slot, k)
        self.integrator = core.integrator if self.kind == "world" else ""
        self.modes = process.mode_texts()
        self.handles = list(process.events.values())
        self.events = [(event_name(e), event_text(e)) for e in self.handles]

    def run_by(self, task: str | None) -> list[Node]:
        """The nodes of a task in their order; None: the nodes that no task runs."""
        nodes = [n for n in self.nodes if n.task == task]
        return sorted(nodes, key=lambda n: n.slot) if task else nodes


def event_name(event: Event) -> str:
    """The name of an event; "" for one that World.at() has named."""
    when = event.when
    return "" if hasattr(when, "ns") and event.name.startswith(f"at_{when.ns}_ns") else event.name


def action_text(event: Event) -> str:
    """What an event does, in words."""
    words = [f"enter {event.mode}"] if event.mode else []
    words += [f"{'arm' if on else 'disarm'} {name}" for name, on in event.arms]
    words += [f"set {text}" for text in event.set_text]
    if event.do:
        words.append(f"call {short_function_text(event.do)}")
    return ", ".join(words) or "nothing"


def rule_text(event: Event) -> str:
    """How long and when its condition must hold, and when it is armed again, in words."""
    return ((f" for {event.hold / 1e9:g} s" if event.hold else "")
            + (f" {event.count} times in a row" if event.count > 1 else "")
            + (f" in {' or '.join(event.modes)}" if event.modes else "")
            + (f", again after {event.until!r}" if event.until is not None else ", once" if event.once else "")
            + (", disarmed at first" if not event.starts_armed else ""))


def event_text(event: Event) -> str:
    """What an event does and when, in words."""
    return f"{event.text}{rule_text(event)}: {action_text(event)}"


def _notes(instance: _core.Module | _core.Model) -> list[str]:
    """Notes beside its name and type: the bodies that attract a craft, a module's function in Python."""
    if cls := prototype(instance):
        return [f"Python: class {cls.__name__}"]
    if (struct := _core.struct(instance)).header.endswith(".fmu"):
        return [struct.doc.rpartition("From ")[2].removesuffix(".")]
    if functions := script(instance):
        return [f"Python: {short_function_text(functions[0])}"]
    names = ", ".join(getattr(b, "name", None) or _core.path(b) for b in _attached(instance, "gravity"))
    return [f"gravity: {names}"] if names else []


def _attached(instance: _core.Module | _core.Model, name: str) -> Any:
    """What Python has attached to a model under a name; a parameter may have the same one."""
    return getattr(instance, name) if isinstance(vars(type(instance)).get(name), property) else ()


def _owner(port: str) -> str:
    """ "flight.control.error" -> "flight.control" """
    return port.rpartition(".")[0]
