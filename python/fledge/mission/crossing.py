# SPDX-License-Identifier: Apache-2.0
"""The wires of a simulation from one process to another, and when their readers see a message, as other programs must
do it that run one process alone."""
from __future__ import annotations

from collections import namedtuple
from typing import TYPE_CHECKING

from fledge import _core

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation

Crossing = namedtuple("Crossing", "topic source port latency stale_after message optional")
Crossing.__doc__ = """A wire from one process to another.

topic: "/world/nav/attitude"; source, port: the paths of its ends, "flight.tracking.attitude"; latency:
"same_instant", "next_instant" or "next_exchange"; stale_after [ns]; message: its type, as
_core.struct() gives types; optional: whether the reader can do without.
"""


def crossing_wires(simulation: Simulation) -> list[Crossing]:
    """All wires that go from one process to another, as Crossings."""
    order = [process.name for process in simulation.processes]
    run = {f"{p.name}.{instance}" for p in simulation.processes for task in p.tasks for instance in task.run}
    crossings = []
    for source, port, latency, stale_after, _ in simulation.wires:
        writer, reader = source.partition(".")[0], port.partition(".")[0]
        if writer == reader:
            continue
        field = _field(simulation, port)
        owner = source.rpartition(".")[0]
        if owner not in run and isinstance(_instance(simulation, owner), _core.Module):
            latency = stale_after = 0   # configuration: carried when it is published, and never stale
        name = "next_exchange" if latency else (
            "same_instant" if order.index(writer) < order.index(reader) else "next_instant")
        crossings.append(Crossing("/" + source.replace(".", "/"), source, port, name, stale_after, field.struct,
                                  field.optional))
    return crossings


def _instance(simulation: Simulation, path: str) -> _core.Module | _core.Model:
    process, name = path.split(".")
    return simulation.process(process).instances[name]


def _field(simulation: Simulation, port: str) -> _core.Field:
    path, _, name = port.rpartition(".")
    return next(f for f in _core.struct(_instance(simulation, path)).fields if f.name == name)
