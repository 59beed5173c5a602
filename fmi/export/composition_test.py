# SPDX-License-Identifier: Apache-2.0
"""Missions as data fly with the bits of the missions themselves."""
from __future__ import annotations

import ctypes
import json
import posixpath
import re
import shutil
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import fledge
from fledge import _core, prototype, world
from fledge.disk import ROOT
from fledge.errors import CompositionError, Failure, SetupError
from fledge.export.fmu.build import export
from fledge.export.fmu.composition import layout, simulation_fmu
from fledge.export.fmu.mission import flight_fmu
from fledge.units import s
from fmi.testing import oscillator
from fmi.testing.flying import Failed, Plan, content, hashes, of, places

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
    for i in range(101):
        sim.run(until=i * 0.5 * s)
        points.append(content(sim, system.layout, "output"))
    assert plan.fly(tmp_path, 100, 0.5, sets=2, states=10).hashes == hashes(points)
    assert len(set(points)) > 90


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
    for i in range(101):
        sim.run(until=i * 0.5 * s)
        points.append(b"".join(content(sim, system.layout, "output", "local") for system in both))
    assert plan.fly(tmp_path, 100, 0.5).hashes == hashes(points)
    assert len(set(points)) > 90


def test_an_importer_may_unload_the_library(tmp_path: Path) -> None:
    """Nothing of it stays in the program: no thread has a handler or a destructor of it."""
    with zipfile.ZipFile(export(simulation_fmu(fledge.load("nadir_spin")), tmp_path / "whole.fmu")) as archive:
        archive.extractall(tmp_path)
    token = ElementTree.parse(tmp_path / "modelDescription.xml").getroot().attrib["instantiationToken"]
    [path] = (tmp_path / "binaries").glob("*/nadir_spin.so")
    library, nothing = ctypes.CDLL(str(path)), ctypes.c_double()
    library.fmi3InstantiateCoSimulation.restype = ctypes.c_void_p
    fmu = ctypes.c_void_p(library.fmi3InstantiateCoSimulation(
        b"whole", token.encode(), f"{tmp_path}/resources/".encode(), False, False, False, False, None,
        ctypes.c_size_t(0), None, None, None))
    flags, zero = [ctypes.byref(ctypes.c_bool()) for _ in range(3)], ctypes.c_double(0.0)
    assert fmu and library.fmi3EnterInitializationMode(fmu, False, zero, zero, False, zero) == 0
    assert library.fmi3ExitInitializationMode(fmu) == 0
    assert library.fmi3DoStep(fmu, zero, ctypes.c_double(10.0), True, *flags, ctypes.byref(nothing)) == 0
    library.fmi3FreeInstance(fmu)
    assert str(path) in Path("/proc/self/maps").read_text()
    close = ctypes.CDLL(None).dlclose
    close.argtypes = [ctypes.c_void_p]
    close(library._handle)
    assert str(path) not in Path("/proc/self/maps").read_text()


def test_parameters_count_as_on_the_desktop_and_bad_ones_do_not(tmp_path: Path) -> None:
    """The initial state before the start, a gain within the run; a gain that the header refuses discards the step."""
    system = simulation_fmu(sim := fledge.load("nadir_spin"))
    names = places(system.layout)
    plan = Plan()
    fmu = plan.fmu(export(system, tmp_path / "whole.fmu"), tmp_path)
    plan.hash(fmu, of(system.layout, "output"))
    sim.world.craft.omega_BN_B = [0.01, -0.02, 0.03]
    plan.set(fmu, names["world.craft.omega_BN_B"], [0.01, -0.02, 0.03])
    plan.set(fmu, names["flight.control.K"], [3.0], at=40)
    points = []
    for i in range(81):
        if i == 40:
            sim.flight.control.K = 3.0
        sim.run(until=i * 0.5 * s)
        points.append(content(sim, system.layout, "output"))
    assert plan.fly(tmp_path, 80, 0.5, sets=2, states=20).hashes == hashes(points)
    plan.set(fmu, names["flight.control.K"], [-1.0], at=60)
    with pytest.raises(Failed, match="fmi3DoStep: it makes no progress"):
        plan.fly(tmp_path, 80, 0.5)


class Turning(prototype.Module):
    """Adds up."""
    sum = prototype.mem(float, "[-] so far")

    def update(self, t: float, dt: float) -> None:
        self.sum += dt


def test_what_is_no_data_is_refused_with_its_lines(tmp_path: Path) -> None:
    sim = fledge.load("nadir_spin")
    sim.world.event("call", when=lambda: True, do=lambda: None)
    sim.flight.turning = Turning()
    sim.flight.task("turn", every=1 * s, run=[sim.flight.turning])
    with pytest.raises(CompositionError) as refused:
        simulation_fmu(sim)
    event, module = str(refused.value).splitlines()
    assert ", line " in event and "event world.call calls Python" in event
    assert ", line " in module and "flight.turning is still Python" in module
    sim = fledge.load("nadir_spin")
    sim.run(1 * s)
    with pytest.raises(SetupError, match="has run until 1 s: export it before it runs"):
        simulation_fmu(sim)
    sim = fledge.load("nadir_spin")
    sim.world.event("close", when=sim.world.watch(sim.flight.control.torque).torque_B.norm() > 1, set=[],
                    enter=None, disarm=["close"])
    with pytest.raises(SetupError, match="world.close depends on flight.control, of another process"):
        simulation_fmu(sim, "world")


@pytest.mark.parametrize("process", [None, "world"])
def test_an_fmu_inside_is_refused(process: str | None, tmp_path: Path) -> None:
    sim = fledge.load("nadir_spin")
    sim.world.spring = world.Fmu(oscillator.make(tmp_path))
    sim.world.task("spring", every=1 * s, run=[sim.world.spring])
    with pytest.raises(SetupError, match="^world.spring is oscillator.fmu, .*: export the processes without it, .*$"):
        simulation_fmu(sim, process)


@pytest.fixture(scope="module")
def with_sources() -> Any:
    return simulation_fmu(fledge.load("sun_safe"), "world", sources=True)


@pytest.mark.parametrize("version", ["3", "2"])
def test_the_sources_are_whole(version: str, with_sources: Any, tmp_path: Path) -> None:
    """All files to compile are there, each header that they include, and what defines the functions of a header."""
    path = export(with_sources, tmp_path / "x.fmu", version, sources=True)
    with zipfile.ZipFile(path) as archive:
        files = {name.removeprefix("sources/"): archive.read(name).decode() for name in archive.namelist()
                 if name.startswith("sources/")}
        description = archive.read("modelDescription.xml").decode()
    root = ElementTree.fromstring(description if version == "2" else files.pop("buildDescription.xml"))
    listed = {element.attrib["name"] for element in root.iter("File" if version == "2" else "SourceFile")}
    assert listed == {name for name in files if name.endswith((".c", ".cpp"))}
    assert {"fmi/fmu/fmi3.c", "fmi/simulation/system.cpp", "sim/simulation.cpp", "world/world_models.cpp",
            "introspect/world_tables.c"} <= listed
    for name, text in files.items():
        for other in re.findall(r'^\s*#\s*include\s*"([^"]+)"', text, re.MULTILINE):
            assert posixpath.normpath(f"{posixpath.dirname(name)}/{other}") in files or other in files, (name, other)
        code = [f"{name[:-2]}{suffix}" for suffix in (".c", ".cpp") if name.startswith(("sim/", "world/", "flight/"))]
        assert all(other in listed for other in code if (ROOT / other).is_file()), code


def test_sources_that_no_build_lists_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("fledge.export.fmu.composition.build_folder", lambda: tmp_path)
    with pytest.raises(Failure, match=f"what the build compiles, and {tmp_path} is no folder of a build"):
        simulation_fmu(fledge.load("sun_safe"), sources=True)
    monkeypatch.setattr("fledge.export.fmu.composition._libraries", lambda processes: {"libSAT.so": tmp_path})
    with pytest.raises(Failure, match="it has types of libSAT.so, of the project, .*; leave out --sources"):
        simulation_fmu(fledge.load("sun_safe"), sources=True)


@pytest.mark.parametrize("change, words", [
    (lambda all: all.pop("seed"), "key 'seed' not found"),
    (lambda all: all["processes"][0].update(tasks=3), r"/processes/0/tasks\)|type must be|cannot use at"),
    (lambda all: all["processes"][0]["instances"][0].update(type="Nothing"), "its type Nothing is in no library here"),
    (lambda all: all["processes"][0]["instances"][0].update(hash=1), "has another header here: export"),
    (lambda all: all["processes"][0]["instances"][0].update(bytes="00"), "it has 1 bytes; expected "),
    (lambda all: all["wires"][0].update(to="world.nothing.state"), "it has no instance world.nothing"),
    (lambda all: all.update(format=2), "its format is 2, expected 1")])
def test_a_damaged_composition_is_refused(change: Any, words: str, tmp_path: Path) -> None:
    whole = json.loads(fledge.load("nadir_spin").composition()[0])
    change(whole)
    with pytest.raises(SetupError, match=words):
        _core.build_composition(json.dumps(whole), str(tmp_path))
