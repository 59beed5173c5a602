# SPDX-License-Identifier: Apache-2.0
"""An FMU in the place of a process of a mission, or as a node of its own.

    sim = fledge.load("nadir_spin")
    fly_fmu(sim, "flight.fmu")      # of fledge export fmu nadir_spin --process flight
    sim.run(10 * minute)

    node = fmu_node("ball.fmu", "ball", every=0.01 * s, reads={"inputs": "/wind/fmu/outputs"})
    node.serve()                    # puts out /ball/fmu/outputs
"""
from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

from fledge import _core, cosim, objects
from fledge.errors import SetupError, did_you_mean, listed

if TYPE_CHECKING:
    from fledge.fmi.interface import Interface
    from fledge.mission.process import Process
    from fledge.mission.simulation import Simulation

Row = tuple[Any, str, int]      # (a module, its field, where [bytes] the FMU's model has it)


def fly_fmu(simulation: Simulation, path: str | PathLike[str], process: str | None = None) -> _core.Model:
    """Let an FMU that Fledge exported fly a process: at each of its instants the FMU gets the messages and parameters
    of the modules, steps, and what it puts out becomes theirs; none of them runs. Events, modes and records are as
    with the modules. Returns the FMU's model.

    process: its name; None: the only flight process. A snapshot of the simulation has the FMU's state. Raises
    SetupError if the simulation has run, or the FMU reads or writes other messages than the process.
    """
    from fledge.fmi.archive import opened
    from fledge.fmi.interface import Interface

    part = simulation.process(process) if process else simulation.flight
    if simulation.time_ns >= 0:
        raise SetupError(f"{simulation.name} has run until {simulation.time:g} s; an FMU flies from the start: load "
                         "the mission anew, or reset() it")
    interface = Interface(opened(path), {}, True)
    core = simulation.kernel.process(part.name)
    if core.reset:
        raise SetupError(f"{interface.archive.where}: the computer of {part.name} can be reset, and an FMU cannot")
    model = interface.type()
    _core.set_fmu(model, interface.plan)
    problems: list[str] = []
    rows: list[Row] = []
    for row in _shared(simulation, part, interface, model):
        if isinstance(row, str):
            problems.append(row)
        else:
            rows.append(row)
    if problems:
        raise SetupError(f"{interface.archive.where} cannot fly {part.name}: {listed(problems, 6)}; export it of this "
                         f"mission: fledge export fmu {simulation.name} --process {part.name}")
    core.fly_by_model("fmu", model, rows, _request(part, interface, model))
    return model


def _request(part: Process, interface: Interface, model: _core.Model) -> int:
    """Where [bytes] the model has the mode that the FMU shall enter; -1: it has no modes."""
    path = next((own for own, of in interface.names.items() if of == f"{part.name}.request"), None)
    if not path:
        return -1
    port, name = path.split(".")
    outer = next(f for f in objects.struct(model).fields if f.name == port)
    return outer.offset + next(f.offset for f in outer.struct.fields if f.name == name)


def _shared(simulation: Simulation, part: Process, interface: Interface, model: _core.Model) -> Iterator[Row | str]:
    """What the FMU and the modules of a process have in common, and words for what they should have, too."""
    places = {f.name: f for f in objects.struct(model).fields}
    messages = {path: places.get(path.replace(".", "_")) for path in interface.description.messages}

    def place(path: str, message: str, verb: str) -> Row | str:
        name, port = path.split(".")[1:]
        there = messages.get(message)
        instance = part.instances[name]
        size = next(f.size for f in objects.struct(instance).fields if f.name == port)
        if there is None or there.size != size:
            return f"it {verb} no {message}"
        return instance, port, there.offset

    read: dict[str, str] = {}
    for source, target, *_ in simulation.wires:
        if target.startswith(f"{part.name}.") and not source.startswith(f"{part.name}."):
            read.setdefault(source, target)
    for source, target in read.items():
        yield place(target, source, "reads")
    for path in interface.description.messages:
        if interface.description.messages[path][1] == "input" and path not in read:
            yield f"it reads {path}, which {part.name} does not"
    for name, instance in part.instances.items():
        for f in objects.struct(instance).fields:
            if f.group == "out":
                path = f"{part.name}.{name}.{f.name}"
                yield place(path, path, "writes")
            elif f.group == "par":
                there = places.get(next((own for own, of in interface.names.items()
                                         if of == f"{part.name}.{name}.{f.name}" and "." not in own), ""))
                if there and (there.type, there.size) == (f.type, f.size):
                    yield instance, f.name, there.offset


def fmu_node(path: str | PathLike[str], name: str, every: Any, *, reads: Mapping[str, str] | None = None,
             messages: Mapping[str, tuple[str, Mapping[str, str]]] | None = None, latency: str = "next_exchange",
             parameters: Mapping[str, Any] | None = None) -> cosim.Node:
    """A node with an FMU alone, which steps by `every`. Its messages are those of world.Fmu, as /NAME/fmu/outputs.

    reads: its inputs -> topics; without one, an input keeps its starts. None: of an FMU that Fledge made, its messages
    by their own names. messages: name -> (type, field -> variable), as of world.Fmu, the type by its name, or by the
    file of an FMU, whose outputs it is. latency: of what it reads. Raises SetupError.
    """
    from fledge import world
    from fledge.mission.crossing import Crossing
    from fledge.mission.simulation import Simulation
    from fledge.objects import project

    types = {**_core.library("flight"), **_core.library("world"), **project.types("flight"), **project.types("world")}
    for port, (kind, _) in (messages or {}).items():
        if kind.endswith(".fmu"):
            types[kind] = type(world.Fmu(kind).outputs)
        elif kind not in types:
            raise SetupError(f"{port}: there is no message {kind}{did_you_mean(kind, list(types)).rstrip(';')}")
    process = re.sub(r"\W", "_", name)
    simulation = Simulation(name, empty=True)
    part = simulation.add_world(process)
    try:
        part.fmu = world.Fmu(path, parameters, messages={port: (types[kind], fields)
                                                         for port, (kind, fields) in (messages or {}).items()})
    except (AttributeError, TypeError, ValueError) as error:    # of a parameter
        raise SetupError(f"{path}: {error}") from None
    part.task("step", every=every, run=[part.fmu])
    ports = {f.name: f for f in objects.struct(part.fmu).fields if f.group == "in"}
    if reads is None:
        reads = {port: topic for port, topic in _of_fledge(path).items() if port in ports}
    for port in reads:
        if port not in ports:
            raise SetupError(f"{name} has no input message {port}{did_you_mean(port, list(ports))} there are "
                             + (", ".join(ports) or "none"))
    return cosim.Node(simulation, process, [
        Crossing(topic, "", f"{process}.fmu.{port}", latency, 0, ports[port].struct, True)
        for port, topic in reads.items()])


def own_topics(node: cosim.Node, path: str | PathLike[str]) -> dict[str, str]:
    """What a node of fmu_node() writes -> the topic of the run: of the messages of Fledge's FMUs their own."""
    model, own = node.simulation.process(node.process).fmu, _of_fledge(path)
    topics = {f.name: f"/{node.process}/fmu/{f.name}" for f in objects.struct(model).fields if f.group == "out"}
    return {topic: own.get(port, topic) for port, topic in topics.items()}


def _of_fledge(path: str | PathLike[str]) -> dict[str, str]:
    """The ports that are messages of Fledge's own -> topics."""
    from fledge.fmi.archive import opened

    return {message.replace(".", "_"): "/" + message.replace(".", "/")
            for message in opened(path).description.messages}
