# SPDX-License-Identifier: Apache-2.0
"""A mission in several programs: each flies one of its processes, joined by a controller (cosim/README.md).

Example:

    import fledge
    from fledge import cosim

    node = cosim.split(fledge.load("nadir_spin"), "flight")    # this program is the flight computer
    node.serve(address="tcp://127.0.0.1:7000")                 # until the controller ends the run

A wire that crosses from one process to another is read as the run in one program reads it, so that
both give the same bits: along the order of the processes at the same instant, against it at the next
one, with latency 1 after the next exchange. crossing_wires() has them all.
"""
from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from fledge import _core
from fledge.errors import SetupError
from fledge.mission.crossing import Crossing, crossing_wires
from fledge.mission.process import Process
from fledge.objects.si import time_ns

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import CodeType, FunctionType

    from fledge.mission.simulation import Simulation

DEFAULT_ADDRESS = "tcp://127.0.0.1:7000"


def check(simulation: Simulation) -> None:
    """Raise SetupError, with all faults, if something besides wires joins its processes."""
    faults = [*_shared(simulation), *_python_events(simulation), *_two_latencies(simulation)]
    if faults:
        raise SetupError("\n".join(faults))


def checked_wires(simulation: Simulation) -> list[Crossing]:
    """check(), then crossing_wires()."""
    check(simulation)
    return crossing_wires(simulation)


def split(simulation: Simulation, process: str, crossing: list[Crossing] | None = None) -> Node:
    """Reduce a simulation to one of its processes; other programs run the others. Returns it as a Node.

    crossing: what checked_wires() gives, if the caller has it already: with n processes in n programs, each need not
    look at all wires again. It must not have run. Raises SetupError, and changes nothing, if the process is unknown,
    has no task, or shares more than wires with another process.
    """
    process_ = simulation.process(process)
    if simulation.time_ns >= 0:
        raise SetupError(f"{simulation.name} has run until {simulation.time:g} s; a process of it can be a node only "
                         "from the start: load the mission anew, or reset() it")
    if not process_.tasks:
        raise SetupError(f"{process} has no task, so it can be no node: there is nothing to step"
                         + ("" if process_.instances else "; it is empty"))
    if crossing is None:
        crossing = checked_wires(simulation)
    reads = [wire for wire in crossing if wire.port.startswith(process + ".")]
    carries = _carried(simulation, process)
    simulation.isolate(process)
    return Node(simulation, process, reads, carries)


def _carried(simulation: Simulation, process: str) -> dict[str, list[tuple[int, int]]]:
    """{the flight process: when it steps} of the radios of a process."""
    order = [process.name for process in simulation.processes]
    carried = {}
    for path, served in simulation.kernel.carriers:
        if path.startswith(process + ".") and served in order:
            if order.index(served) < order.index(process):
                raise SetupError(f"{path} carries what {served} sends, which runs before {process}: add {process} to "
                                 "the simulation first")
            carried[served] = [(task.period, task.offset) for task in simulation.process(served).tasks]
    return carried


class Node:
    """A process of a mission, ready to take part in a run of many programs."""

    def __init__(self, simulation: Simulation, process: str, reads: list[Crossing],
                 carries: dict[str, list[tuple[int, int]]] | None = None) -> None:
        from fledge import _cosim
        from fledge.mission.simulation import report_crashes

        report_crashes(_cosim)
        self.simulation, self.process, self.reads = simulation, process, reads
        self._core = _cosim.ProcessNode(simulation.kernel, process)
        for wire in reads:
            self._core.read(wire.topic, wire.port, wire.latency, wire.stale_after)
        for flight, rates in (carries or {}).items():
            self._core.carry(flight, rates)

    def serve(self, address: str | None = None, *, simulation: str | None = None, name: str | None = None,
              keys: Path | str | None = None, timeout: float = 60.0, delay: float = 0.0) -> str:
        """Take part in one run, from greeting the controller to its end. Returns the reason of the end, "" if
        it is the regular one.

        address: of the controller; simulation: what it calls the run; name: of this node. Not given, they
        are FLEDGE_ADDRESS, FLEDGE_SIMULATION and FLEDGE_NODE, and else tcp://127.0.0.1:7000, the mission's
        name and the process'. keys: a folder or file of keys (fledge keys); else FLEDGE_KEYS. timeout:
        how long to wait for the controller [s]. delay: the longest random wait before each step [s]; no result
        may depend on it.

        The controller gives the seed. Records and the archive begin with the run. Ctrl-C ends the node.
        Raises RunError if the controller refuses the node, does not answer, or ends.
        """
        begun = perf_counter()
        try:
            return self._core.serve(
                simulation or os.environ.get("FLEDGE_SIMULATION") or self.simulation.name,
                name or os.environ.get("FLEDGE_NODE") or self.process,
                address or os.environ.get("FLEDGE_ADDRESS") or DEFAULT_ADDRESS, str(keys or ""),
                float(timeout), float(delay), self._begin)
        finally:
            self.simulation.wall += perf_counter() - begun

    def _begin(self) -> None:
        """The run begins, or continues from the snapshot of a lost program, whose record this program continues."""
        self.simulation.open_archive(resumed=self.simulation.time_ns >= 0)

    def __repr__(self) -> str:
        return f"<{self.process} of {self.simulation.name} as a node>"


class Controller:
    """Joins programs into one simulation; it runs in this program. Nodes connect to `address`.

    nodes: names, or (name, the policy for a loss: "abort", "pause", "hold", "drop", "restart"); end: of the run, a
    time; address: with "*" for a TCP port, any free one; keys: a folder of keys (fledge keys); else
    FLEDGE_KEYS; unencrypted: without keys, allow an address that other machines can reach; join,
    reply: how long to wait for all nodes, and for a reply [s]; sharing: of memory with nodes on this
    machine, "allowed", "required" or "forbidden"; save_every: the time from one snapshot to the next, of nodes
    with the policy restart, 0: as needed; report: a function that takes a text for the user.
    """

    def __init__(self, simulation: str, nodes: Sequence[str | Sequence[str]], end: Any, *, seed: int = 0,
                 address: str = DEFAULT_ADDRESS, keys: Path | str | None = None, unencrypted: bool = False,
                 join: float = 60.0, reply: float = 60.0, sharing: str = "allowed", save_every: Any = 0,
                 report: Callable[[str], None] | None = None) -> None:
        from fledge import _cosim

        pairs = [(node, "abort") if isinstance(node, str) else (node[0], node[1]) for node in nodes]
        self._core = _cosim.Control(simulation, pairs, time_ns(end, "Controller: end"), seed, address, str(keys or ""),
                                    unencrypted, float(join), float(reply), sharing,
                                    time_ns(save_every, "Controller: save_every"), report or (lambda text: None))
        self.address = self._core.address
        self._nodes = [name for name, *_ in pairs]

    @property
    def times(self) -> dict[str, tuple]:
        """Of each node, by name: its ticks, and the wall time [s] computing, on the way, and waiting for others."""
        return {name: (ticks, *(ns / 1e9 for ns in spent))
                for name, (ticks, *spent) in zip(self._nodes, self._core.times)}

    def run(self, poll: Callable[[], bool] | None = None) -> str:
        """From the first greeting to the end; returns its reason, "" if it is the regular one.

        poll: is called about ten times a second; a false value ends the run.
        """
        return self._core.run(poll)


# --- faults that prevent a split --------------------------------------------------------------------------

def _at(place: tuple[str, int] | None) -> str:
    from fledge.disk import shown

    return f"{shown(place[0])}, line {place[1]}: " if place else ""


def _shared(simulation: Simulation) -> Iterator[str]:
    """Events and parts that belong to two processes."""
    for what, whose in simulation.kernel.cross_process_dependencies():
        owner, name = what.split(".", 1)
        process = simulation.process(owner)
        event = process.events.get(name)
        if event:
            yield (f"{_at(event.declared_at)}event {what} watches {whose}, which runs in another program; wire what "
                   f"it watches to a module or model of {owner} and watch that input, or give the event to "
                   f"{whose.partition('.')[0]}")
        else:
            yield (f"{_at(process.declared_at(name))}{what} has {whose} as a part, which runs in another program; a "
                   "model and its parts belong in one process")


def _python_events(simulation: Simulation) -> Iterator[str]:
    """Events whose Python function reaches what runs in another program."""
    for process in simulation.processes:
        foreign = [p for p in simulation.processes if p is not process]
        for event in process.events.values():
            for function in event.functions:
                reach = _Reach(simulation, foreign).of(function)
                if reach:
                    yield (f"{_at(event.declared_at)}event {process.name}.{event.name} calls Python that reaches "
                           f"{reach}, which runs in another program; let a message tell it: wire an output to "
                           f"{process.name}, or give the event to the other process")


class _Reach:
    """What of other processes a Python function refers to."""

    def __init__(self, simulation: Simulation, foreign: list[Process]) -> None:
        self.simulation, self.foreign = simulation, foreign
        self.seen: set[int] = set()

    def of(self, thing: Any) -> str:
        """The name of the first such object, or ""."""
        import functools
        import types

        if id(thing) in self.seen:
            return ""
        self.seen.add(id(thing))
        if isinstance(thing, Process):
            return thing.name if thing in self.foreign else ""
        if isinstance(thing, (_core.Module, _core.Model, _core.Message)):
            path = _core.path(thing)
            return path if path.partition(".")[0] in {p.name for p in self.foreign} else ""
        if isinstance(thing, types.FunctionType):
            return self._of_function(thing)
        if isinstance(thing, types.MethodType):
            return self.of(thing.__self__) or self.of(thing.__func__)
        if isinstance(thing, functools.partial):
            return self._first([thing.func, *thing.args, *thing.keywords.values()])
        if isinstance(thing, dict):
            return self._first([*thing.keys(), *thing.values()])
        if isinstance(thing, (list, tuple, set, frozenset)):
            return self._first(thing)
        if type(thing).__module__.startswith("_mission_"):  # a class of the mission's own
            return self._first([*vars(thing).values(), *vars(type(thing)).values()])
        return ""

    def _first(self, things: Iterable[Any]) -> str:
        return next(filter(None, map(self.of, list(things))), "")

    def _of_function(self, function: FunctionType) -> str:
        held = [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()]
        for cell in function.__closure__ or ():
            try:
                held.append(cell.cell_contents)
            except ValueError:  # the cell is empty yet
                pass
        names = _names(function.__code__)
        held += [function.__globals__[name] for name in names if name in function.__globals__]
        for value in held:
            if value is self.simulation:  # all processes can be reached from it: which are named?
                named = [p.name for p in self.foreign if p.name in names]
                if named:
                    return named[0]
        return self._first(value for value in held if value is not self.simulation)


def _names(code: CodeType) -> set[str]:
    """All names in a function, those inside it included."""
    names = set(code.co_names)
    for constant in code.co_consts:
        if hasattr(constant, "co_names"):
            names |= _names(constant)
    return names


def _two_latencies(simulation: Simulation) -> Iterator[str]:
    """A topic that one process reads at two latencies: a node asks for it once."""
    first: dict[tuple[str, str], Crossing] = {}
    for wire in crossing_wires(simulation):
        reader = wire.port.partition(".")[0]
        other = first.setdefault((wire.topic, reader), wire)
        if other.latency != wire.latency:
            own = simulation.process(reader)
            line = next(filter(None, (p.declared_at(wire.port) for p in [own, *simulation.processes])), None)
            yield (f"{_at(line)}{wire.port} reads {wire.source} at {wire.latency}, and {other.port} at "
                   f"{other.latency}; in another program a message comes once: give both wires one latency")
