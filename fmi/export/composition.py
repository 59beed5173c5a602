# SPDX-License-Identifier: Apache-2.0
"""The world of a mission, or all of it, as the system of an FMU: the kernel flies it there by the mission as data,
without Python. fmi/simulation/composition.h has what is no data, and so is refused."""
from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence
from math import gcd
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import __version__, objects
from fledge.disk import ROOT, build_folder
from fledge.errors import Failure, SetupError
from fledge.export.fmu.build import System, closure, prebuilt
from fledge.export.fmu.description import Facts
from fledge.export.fmu.variables import Event, Layout, Message, Parameters, Process, listed
from fledge.export.names import identifier
from fledge.export.packets import UNWRITTEN
from fledge.mission.process import Flight
from fledge.objects import project

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation

LIBRARY = "libfledge_fmu_simulation.so"
# What its sources need besides Fledge's.
NEEDS = {"erfa": "ERFA 2.0 (liberfa-dev)",
         "Eigen3": "Eigen 3.4, headers alone (libeigen3-dev): an include directory, as /usr/include/eigen3",
         "nlohmann_json": "JSON for Modern C++ 3.11, headers alone (nlohmann-json3-dev)"}


def simulation_fmu(sim: Simulation, process: str | None = None, sources: bool = False, heads: bool = True) -> System:
    """The system of a process of a simulation which has not run, or of all of them, in one FMU. What other processes
    give to that process comes from outside. sources: with those of the kernel, from the build; heads: see
    variables.listed(). Raises SetupError for what is no data, and for what a run would refuse."""
    sim.check()
    inside = [p for p in sim.processes if process in (None, p.name)]
    for flight in inside:
        frames = flight.commands.dictionary.frames if isinstance(flight, Flight) and flight.has_services else None
        if frames and frames.secured:
            raise SetupError(f"{flight.name}: its link secures frames, and an FMU has no keys: export it without")
    commanded = _commanded(sim, process)
    packets = {f"{sim.name}_packets.json": commanded.commands.dictionary.text()} if commanded else {}
    text, files = sim.composition(process)
    tables = _libraries(sim.processes)
    if sources and tables:
        raise Failure(f"export fmu: it has types of {', '.join(tables)}, of the project, whose sources Fledge does not "
                      "list; leave out --sources")
    variables = layout(sim, process, heads)
    composition = json.loads(text) | {
        "libraries": {name: path.name for name, path in tables.items()},
        "fmu": variables.rows() | {"processes": [p.name for p in variables.processes],
                                   "events": [(event.process, event.name) for event in variables.events],
                                   "commanded": commanded.name if commanded else ""}}
    times = [time for p in inside for task in p.tasks for time in (task.period, task.offset) if time]
    name = sim.name if process is None else f"{sim.name} {process}"
    facts = Facts(name, identifier(name.replace(" ", "_")), sim.mission.summaries()[""] if sim.mission else "",
                  f"Fledge {__version__}", gcd(*times) / 1e9, needs=NEEDS)
    return System(facts, variables, sources=kernel_sources() if sources else {},
                  resources={"composition.json": json.dumps(composition, separators=(",", ":")),
                             **packets, **{name: Path(path) for path, name in files}},
                  libraries=lambda platform: [prebuilt(LIBRARY, platform), *tables.values()])


def layout(sim: Simulation, process: str | None = None, heads: bool = True) -> Layout:
    """Its variables: messages from outside, those of its modules and models, and their parameters. Blocks of memory are
    all instances, in the order of their processes."""
    blocks = {objects.path(instance): (i, instance) for i, instance in enumerate(x for p in sim.processes for x in p)}
    inside = [p for p in sim.processes if process in (None, p.name)]
    running = {f"{p.name}.{name}" for p in sim.processes for task in p.tasks for name in task.run}
    ours = {p.name for p in inside}
    crossing = [(source, target) for source, target, *_ in sim.wires
                if (source.partition(".")[0] in ours) != (target.partition(".")[0] in ours)]
    read = {source for source, _ in crossing}
    inputs = dict.fromkeys(source for source, target in crossing if target.partition(".")[0] in ours
                           and source.rpartition(".")[0] in running)     # configuration is as it was exported

    def message(path: str, role: str) -> Message:
        owner, _, port = path.rpartition(".")
        block, instance = blocks[owner]
        field = next(f for f in objects.struct(instance).fields if f.name == port)
        return Message(path, field.struct, role, block, field.offset,
                       objects.memory(instance)[field.offset:field.offset + field.size] if role == "input" else b"")

    messages = [message(path, "input") for path in inputs]
    parameters = []
    for p in inside:
        for instance in p:
            struct, path = objects.struct(instance), objects.path(instance)
            messages += [message(f"{path}.{f.name}", "output" if process is None or f"{path}.{f.name}" in read
                                 else "local") for f in struct.fields if f.group == "out"]
            parameters.append(Parameters(path, struct, blocks[path][0], 0, objects.memory(instance),
                                         left_out=UNWRITTEN.get(struct.name, ())))
    modes = [Process(p.name, [name for name, _ in p.modes]) for p in inside if p.modes]
    events = [Event(p.name, event.name, event.text) for p in inside for event in p.events.values()]
    commanded = _commanded(sim, process)
    return listed(messages, parameters, modes, events,
                  {commanded.name: commanded.commands.dictionary.room} if commanded else {}, heads)


def _commanded(sim: Simulation, process: str | None) -> Flight | None:
    """The flight process in it that takes packets: the only one."""
    return sim.flights[0] if process is None and len(sim.flights) == 1 else None


def _libraries(processes: Sequence[Any]) -> dict[str, Path]:
    """The libraries of the project whose types the instances have, by name. Raises SetupError for types of Python."""
    types = project.owners()
    found = {}
    for instance in (x for p in processes for x in p):
        struct = objects.struct(instance)
        type_ = struct.name
        if struct.header.endswith(".fmu"):
            raise SetupError(f"{objects.path(instance)} is {Path(struct.header).name}, and an FMU has no other inside: "
                             "export the processes without it, and connect all FMUs in the importer")
        if type_ not in types:
            raise SetupError(f"{objects.path(instance)} is of the type {type_}, which was made in Python: an FMU flies "
                             "types of headers alone")
        if library := types[type_]:
            found[library[0]] = library[1]
    return found


def kernel_sources() -> dict[str, Path]:
    """All files of which the build makes the library, by their names under the root or the build's folder."""
    folder = build_folder()
    if not (folder / "build.ninja").is_file():
        raise Failure(f"export fmu: --sources lists what the build compiles, and {folder} is no folder of a build: "
                      "export from a checkout of Fledge")
    commands = subprocess.run(["ninja", "-C", folder, "-t", "commands", f"python/{LIBRARY}"], capture_output=True,
                              text=True, check=True).stdout
    found: list[Path] = []
    for name in re.findall(r" -c (\S+)$", commands, re.MULTILINE):
        together = re.findall(r'^#include "(/.*)"$', (folder / name).read_text("utf-8"), re.MULTILINE)
        found += [Path(each) for each in together] or [folder / name]   # CMake compiles several C++ files as one
    return closure(found, {}, [folder, ROOT])
