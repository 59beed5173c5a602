# SPDX-License-Identifier: Apache-2.0
"""A mission's world and flight as two FMUs, in turn by the importer in C: the bits of the desktop."""
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import fledge
from fledge import objects
from fledge.export.fmu import build
from fledge.export.fmu.composition import simulation_fmu
from fledge.export.fmu.mission import flight_fmu
from fmi.testing.flying import Plan, hashes, places

STEP, STEPS = 0.1, 600      # [s] of the world; flight has five times that


def bytes_of(sim: Any, name: str) -> Callable[[], bytes]:
    """A function that gives the present bytes of PROCESS.INSTANCE.MESSAGE.FIELD."""
    process, instance, port, field = name.split(".")
    owner = sim.process(process).instances[instance]
    message = next(f for f in objects.struct(owner).fields if f.name == port)
    inner = next(f for f in message.struct.fields if f.name == field)
    start = message.offset + inner.offset
    return lambda: objects.memory(owner)[start:start + inner.size]


@pytest.mark.parametrize("version", ["3", "2"])
def test_world_and_flight_in_turn_have_the_bits_of_the_desktop(tmp_path: Path, version: str) -> None:
    systems = [simulation_fmu(fledge.load("nadir_spin"), "world"), flight_fmu(fledge.load("nadir_spin"))]
    plan = Plan()
    fmus = [plan.fmu(build.export(system, tmp_path / f"{i}.fmu", version), tmp_path)
            for i, system in enumerate(systems)]
    known = [{v.name: v for v in system.layout.variables} for system in systems]
    at = [places(system.layout) for system in systems]
    for here, there in ((0, 1), (1, 0)):
        for name, v in known[there].items():
            if v.role == "input":
                plan.wire(fmus[here], at[here][name], fmus[there], at[there][name])
    shown = [v for v in known[1].values() if v.role in ("output", "local") and v.name.count(".") == 3]
    plan.hash(fmus[1], [at[1][v.name] for v in shown])
    flown = plan.fly(tmp_path, STEPS, STEP, sets=2, states=20)

    sim, points = fledge.load("nadir_spin"), []
    read = [bytes_of(sim, v.name) for v in shown]
    for k in range(STEPS + 1):
        sim.run(STEP if k else 0)
        points.append(b"".join(get() for get in read))
    assert flown.hashes == hashes(points)
