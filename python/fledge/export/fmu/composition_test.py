# SPDX-License-Identifier: Apache-2.0
"""Missions as data fly with the bits of the missions themselves."""
from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import fledge
from fledge import _core, world
from fledge.errors import CompositionError, SetupError
from fledge.export.fmu.composition import layout, simulation_fmu
from fledge.units import minute, s

MISSIONS = sorted(path.parent.name for path in Path(fledge.__file__).parents[2].glob("missions/*/scenarios.py"))
OF_SEVERAL = {"constellation", "formation"}


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
