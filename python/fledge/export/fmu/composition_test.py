# SPDX-License-Identifier: Apache-2.0
"""Missions as data fly with the bits of the missions themselves."""
from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import fledge
from fledge import _core
from fledge.errors import SetupError
from fledge.export.fmu.build import export
from fledge.export.fmu.composition import layout, simulation_fmu
from fledge.export.fmu.mission import flight_fmu
from fledge.units import s
from fmi.testing.flying import Plan, content, hashes, of, places

MISSIONS = sorted(path.parent.name for path in Path(fledge.__file__).parents[2].glob("missions/*/scenarios.py"))


def built(sim: Any, folder: Path, process: str = "") -> Any:
    """The simulation in the extension that the JSON describes, with its files in a folder."""
    for flight in sim.flights:
        flight.has_services and flight.commands     # the kernel gets the dictionary
    text, files = sim.composition(process)
    for path, name in files:
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(path, folder / name)
    return _core.build_composition(text, str(folder))


@pytest.mark.parametrize("name", MISSIONS)
def test_a_whole_mission_flies_with_its_bits(name: str, tmp_path: Path) -> None:
    sim = fledge.load(name)
    other = built(sim, tmp_path)
    sim.run(20 * s)
    other.run_until(20_000_000_000, 0.0, None)
    assert other.snapshot() == sim.kernel.snapshot()


def exchange(sim: Any, other: Any, inputs: list[str]) -> None:
    """Give the outputs of sim's processes to those of the other simulation that stand in for them."""
    processes = {path.split(".")[0] for path in inputs}
    objects = {name: other.process(name).wrap() for name in processes}
    for path in inputs:
        process, instance, port = path.split(".")
        there = getattr(objects[process][instance], port)
        other.process(process).put_out(there, _core.memory(getattr(sim.process(process).instances[instance], port)))


@pytest.mark.parametrize("name", ["nadir_spin", "sun_safe", "cubesat", "constellation"])    # flight steps at 2 Hz
def test_a_world_flies_with_its_bits_on_the_outputs_of_flight(name: str, tmp_path: Path) -> None:
    sim = fledge.load(name)
    truth = next(p for p in sim.processes if isinstance(p, fledge.mission.process.World))
    other = built(sim, tmp_path, truth.name)
    inputs = [message.path for message in layout(sim, truth.name).inputs]
    assert inputs
    other.run_until(0, 0.0, None)
    sim.run(0)
    for i in range(1, 61):
        exchange(sim, other, inputs)
        other.run_until(i * 500_000_000, 0.0, None)
        sim.run(until=i * 0.5 * s)
        ours = other.process(truth.name).wrap()
        assert all(_core.memory(ours[n]) == _core.memory(model) for n, model in truth.instances.items())


@pytest.mark.parametrize("version", ["3", "2"])
def test_an_importer_flies_a_whole_mission_with_its_bits(version: str, tmp_path: Path) -> None:
    """In two instances, which also go back to states, and on by their bytes."""
    system = simulation_fmu(sim := fledge.load("sun_safe"))
    plan = Plan()
    fmu = plan.fmu(export(system, tmp_path / "whole.fmu", version), tmp_path)
    plan.hash(fmu, of(system.layout, "output"))
    points = []
    for i in range(201):
        sim.run(until=i * 0.5 * s)
        points.append(content(sim, system.layout, "output"))
    assert plan.fly(tmp_path, 200, 0.5, sets=2, states=30).hashes == hashes(points)
    assert len(set(points)) > 100


@pytest.mark.parametrize("mission", ["nadir_spin", "cubesat"])
def test_world_and_flight_in_turn_fly_with_the_bits_of_the_mission(mission: str, tmp_path: Path) -> None:
    sim = fledge.load(mission)
    both = [simulation_fmu(fledge.load(mission), "world"), flight_fmu(fledge.load(mission))]
    plan = Plan()
    world, flight = (plan.fmu(export(system, tmp_path / f"{i}.fmu"), tmp_path) for i, system in enumerate(both))
    names = [places(system.layout) for system in both]
    for a, b in ((world, flight), (flight, world)):
        for message in both[b].layout.inputs:
            for v in both[b].layout.variables[message.first:message.first + message.n]:
                plan.wire(a, names[a][v.name], b, names[b][v.name])
    for fmu, system in enumerate(both):
        plan.hash(fmu, of(system.layout, "output", "local"))
    points = []
    for i in range(121):
        sim.run(until=i * 0.5 * s)
        points.append(b"".join(content(sim, system.layout, "output", "local") for system in both))
    assert plan.fly(tmp_path, 120, 0.5).hashes == hashes(points)
    assert len(set(points)) > 100
