# SPDX-License-Identifier: Apache-2.0
"""FMUs in the place of a flight process: the bits of the modules, with parameters, modes, snapshots and clones."""
from pathlib import Path

import pytest

import fledge
from fledge.cosim.fmu import fly_fmu, fmu_node
from fledge.export.fmu import build
from fledge.export.fmu.mission import flight_fmu
from fmi.testing import oscillator


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


def exported(folder: Path, mission: str, version: str = "3") -> Path:
    path = folder / f"{mission}{version}.fmu"
    return path if path.exists() else build.export(flight_fmu(fledge.load(mission)), path, version)


def flown(mission: str, fmu: Path | None, during=lambda sim: None, until: float = 60.0):
    """All that a simulation records."""
    sim = fledge.load(mission)
    if fmu:
        fly_fmu(sim, fmu)
    sim.record(*(instance for process in sim.processes for instance in process))
    sim.run(until / 2)
    during(sim)
    sim.run(until / 2)
    return {log.path: (list(log.times()), bytes(log.bytes())) for log in sim.records}


@pytest.mark.parametrize("version", ["2", "3"])
def test_the_record_is_that_of_the_modules_also_after_a_change_of_parameters(folder, version):
    def double(sim):
        sim.flight.control.K *= 2

    path = exported(folder, "nadir_spin", version)
    record = flown("nadir_spin", path, double)
    assert record == flown("nadir_spin", None, double) != flown("nadir_spin", path)
    assert {"flight.tracking.error", "flight.motor.command", "world.nav.attitude"} <= {*record}


def test_modes_and_events_are_those_of_the_modules_also_on_request(folder):
    seen = []

    def enter(sim):
        sim.flight.enter("brake")
        sim.run(5)
        seen.append(sim.flight.active_mode)

    path = exported(folder, "cubesat")
    record = flown("cubesat", path, enter)
    assert record == flown("cubesat", None, enter) != flown("cubesat", path)
    assert seen == ["brake", "brake"]


def test_snapshots_and_clones_have_the_state_of_the_fmu(folder):
    sim = fledge.load("nadir_spin")
    fly_fmu(sim, exported(folder, "nadir_spin"))
    sim.run(20)
    snapshot = sim.snapshot()
    clone = sim.clone()
    ends = []
    for each in (sim, sim, clone):
        if each is sim:
            sim.restore(snapshot)
        each.run(20)
        ends.append((bytes(memoryview(each.flight.control.torque.torque_B)), each.snapshot()))
    assert ends[0] == ends[1] == ends[2]


def test_what_cannot_fly_a_process_is_refused_in_one_line(folder, tmp_path):
    path = exported(folder, "nadir_spin")
    for mission, says in (("sun_safe", r"nadir_spin3.fmu cannot fly flight: .* export it of this mission: fledge "
                           "export fmu sun_safe --process flight"),
                          ("mars_orbiter", "the computer of flight can be reset, and an FMU cannot")):
        with pytest.raises(fledge.SetupError, match=says) as refused:
            fly_fmu(fledge.load(mission), path)
        assert "\n" not in str(refused.value)
    sim = fledge.load("nadir_spin")
    sim.run(1)
    with pytest.raises(fledge.SetupError, match="has run until 1 s; an FMU flies from the start"):
        fly_fmu(sim, path)
    sim = fledge.load("nadir_spin")
    with pytest.raises(fledge.SetupError, match=r"oscillator.fmu cannot fly flight: it reads no world.nav.attitude"):
        fly_fmu(sim, oscillator.make(tmp_path))
    fly_fmu(sim, path)
    with pytest.raises(fledge.SetupError, match="parameter .* of flight|an FMU flies this process|must be"):
        sim.flight.control.K = -1.0
        sim.run(1)


def test_a_node_of_an_fmu_alone_has_its_messages_or_those_that_are_given(folder, tmp_path):
    node = fmu_node(exported(folder, "nadir_spin"), "flight", 0.5)
    assert {(wire.topic, wire.port) for wire in node.reads} == {
        ("/world/nav/attitude", "flight.fmu.world_nav_attitude"), ("/world/nav/orbit", "flight.fmu.world_nav_orbit"),
        ("/world/wheels/speeds", "flight.fmu.world_wheels_speeds")}
    path = oscillator.make(tmp_path)
    for options, says in (({"reads": {"input": "/x/y"}}, "left has no input message input; did you mean 'inputs'"),
                          ({"messages": {"torque": ("BodyTorqe", {})}}, "torque: there is no message BodyTorqe")):
        with pytest.raises(fledge.SetupError, match=says):
            fmu_node(path, "left", 0.01, **options)
