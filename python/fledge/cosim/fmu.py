# SPDX-License-Identifier: Apache-2.0
"""An FMU in the place of a process of a mission.

    sim = fledge.load("nadir_spin")
    cosim.fly_fmu(sim, "flight.fmu")    # of fledge export fmu nadir_spin --process flight
    sim.run(10 * minute)
"""
from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from typing import TYPE_CHECKING, Any

from fledge import _core, objects
from fledge.errors import SetupError, listed

if TYPE_CHECKING:
    from fledge.world.fmu_interface import Interface
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
    from fledge.world.fmu_interface import Interface

    part = simulation.process(process) if process else simulation.flight
    if simulation.time_ns >= 0:
        raise SetupError(f"{simulation.name} has run until {simulation.time:g} s; an FMU flies from the start: load the "
                         "mission anew, or reset() it")
    interface = Interface(opened(path), {}, True)
    core = simulation.kernel.process(part.name)
    if core.reset:
        raise SetupError(f"{interface.archive.where}: {part.name} has a computer that can be reset, which an FMU cannot")
    model = interface.type()
    _core.set_fmu(model, interface.plan)
    problems, rows = [], []
    for row in _shared(simulation, part, interface, model):
        (problems if isinstance(row, str) else rows).append(row)
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
    missing = object()

    def place(path: str, message: Any, verb: str) -> Row | str:
        name, port = path.split(".")[1:]
        there = messages.get(message, missing)
        instance = part.instances[name]
        size = next(f.size for f in objects.struct(instance).fields if f.name == port)
        if there is missing or there is None or there.size != size:
            return f"it {verb} no {message}"
        return instance, port, there.offset

    read = {}
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
