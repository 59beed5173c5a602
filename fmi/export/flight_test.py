# SPDX-License-Identifier: Apache-2.0
"""FMUs of flight in an importer in C (fmi/testing), with the inputs of the desktop's: every output has its bytes."""

import functools
import subprocess
import tempfile
import zipfile
from pathlib import Path

import pytest

import fledge
from fledge import objects
from fledge.cli import main
from fledge.elements import ELEMENTS
from fledge.export.fmu.archive import write_archive
from fledge.errors import Failure
from fledge.export.fmu.build import OPTIONS, compiler_for, export
from fledge.export.fmu.mission import flight_fmu
from fledge.export.testing import COMPILERS
from fmi.testing.flying import Plan, hashes, importer, places
from tests.needs import flies_on

VERSIONS = pytest.mark.parametrize("version", ["3", "2"])


@functools.cache
def exported(mission, version="3", platform=None, sources=False, heads=True):
    """(layout, step [s], path) of a mission's flight as an FMU, which is built once."""
    system = flight_fmu(fledge.load(mission), heads=heads)
    path = Path(tempfile.mkdtemp(prefix="fmu-"), f"{mission}.fmu")
    return system.layout, system.facts.step, export(system, path, version, [platform] if platform else [], sources)


class Flight:
    """A mission's flight as an FMU, and the same on the desktop."""

    def __init__(self, mission, folder, *args, **options):
        self.folder, self.sim = folder, fledge.load(mission)
        self.layout, self.step, self.path = exported(mission, *args, **options)
        self.places = places(self.layout)
        self.plan = Plan()

    def content(self, *roles):
        """The bytes of the variables of all messages with these roles, on the desktop now."""
        found = b""
        for message in self.layout.messages:
            if message.role in roles:
                process, *names = message.path.split(".")
                thing = self.sim.process(process)
                for name in names:
                    thing = getattr(thing, name)
                memory = objects.memory(thing)
                for v in self.variables(message):
                    found += memory[v.offset:v.offset + v.n * ELEMENTS[v.type].size]
        return found

    def variables(self, message):
        return self.layout.variables[message.first:message.first + message.n]

    def of(self, *roles):
        return [self.places[v.name] for message in self.layout.messages if message.role in roles
                for v in self.variables(message)]

    def fly(self, steps, *, change=lambda sim, step: None, events=False, machine=None, **options):
        """Fly both; change: called before each step from 1 on. Returns what fly.c shows."""
        inputs, outputs = [], []
        for step in range(steps + 1):
            change(self.sim, step)
            self.sim.run(until=step * self.step)
            inputs.append(self.content("input"))
            outputs.append(self.content("output", "local"))
        fmu = self.plan.fmu(self.path, self.folder, events=events, **({"machine": machine} if machine else {}))
        self.plan.feed(fmu, self.of("input"), inputs)
        self.plan.hash(fmu, self.of("output", "local"))
        flown = self.plan.fly(self.folder, steps, self.step, **options)
        assert len(set(outputs)) > steps / 2
        assert flown.hashes == hashes(outputs)
        return flown.values


@VERSIONS
def test_every_output_has_the_bytes_of_the_desktop(tmp_path, version):
    """In two instances, which also go back to states, and on by their bytes."""
    Flight("nadir_spin", tmp_path, version).fly(200, sets=2, states=30)


def test_an_importer_that_cannot_give_heads_leaves_them_to_the_fmu(tmp_path):
    """Flight takes its inputs for good and new, as those of the desktop are."""
    flight = Flight("nadir_spin", tmp_path, heads=False)
    assert not any(v.name.startswith("world.") and ".head." in v.name for v in flight.layout.variables)
    flight.fly(100, sets=2, states=10)


def test_a_reset_of_the_computer_begins_flight_anew(tmp_path):
    """The computer of flatsat is reset at 60.5 s, and down for 3 s. Its parameters are those of the start again."""
    flight = Flight("flatsat", tmp_path)
    begun = flight.sim.flight.control.K

    def change(sim, step):
        if step == 50:
            sim.flight.control.K = 2 * begun

    flight.plan.set(0, flight.places["flight.control.K"], [2 * begun], at=50)
    flight.fly(140, change=change, states=15)
    assert flight.sim.flight.control.K == begun
    assert flight.sim.process("world").power.computer.count == 1


@pytest.mark.parametrize("events", [False, True])
def test_a_mode_begins_that_the_importer_requests(tmp_path, events):
    """With event mode, at the instant; both ways with the bytes of the desktop. One of its modules is called clock."""
    flight = Flight("cubesat", tmp_path)
    modes = [mode for mode, _ in flight.sim.flight.modes]
    mode, clock = (flight.places[f"flight.{name}"] for name in ("mode", "clock_.mode"))
    flight.plan.set(0, flight.places["flight.request"], [3], at=40)
    flight.plan.show(0, [mode])
    if events:
        flight.plan.clock(0, clock.reference)

    def change(sim, step):
        if step == 40:
            sim.flight.enter(modes[2])

    shown = flight.fly(80, change=change, events=events, states=10)
    assert flight.sim.flight.active_mode == modes[2]
    assert shown[mode.reference] == ["3"] and shown.get(clock.reference) == (["2"] if events else None)


@pytest.mark.parametrize("events", [False, True])
def test_events_fire_when_those_of_the_desktop_do(tmp_path, events):
    flight = Flight("sun_safe", tmp_path)
    names = list(flight.sim.flight.events)
    fired, clocks = ([flight.places[f"flight.{kind}.{name}"] for name in names] for kind in ("fired", "clock"))
    flight.plan.show(0, fired)
    for clock in clocks if events else []:
        flight.plan.clock(0, clock.reference)
    shown = flight.fly(250, events=events, states=10)
    assert [shown[place.reference] for place in fired] == [["1"]] * len(names)
    assert all(event.fired[0] == 1 for event in flight.sim.flight.events.values())
    if events:
        assert [shown[clock.reference] for clock in clocks] == [["1"]] * len(names)


@VERSIONS
def test_parameters_act_from_the_next_instant_on(tmp_path, version):
    flight = Flight("nadir_spin", tmp_path, version)

    def change(sim, step):
        if step == 50:
            sim.flight.control.K = 3.0
            sim.flight.wheels.u_max[1] = 0.01       # the configuration is published again

    flight.plan.set(0, flight.places["flight.control.K"], [3.0], at=50)
    u_max = flight.places["flight.wheels.u_max"]
    flight.plan.set(0, u_max, [0.2, 0.01, 0.2, 0.2, *[0.0] * (u_max.n - 4)], at=50)
    flight.fly(100, change=change, states=10)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_sources_compile_anywhere_and_fly_alike(tmp_path, compiler):
    flight = Flight("sun_safe", tmp_path, sources=True)
    with zipfile.ZipFile(flight.path) as archive:
        archive.extractall(tmp_path / "fmu")
    sources = [path for path in (tmp_path / "fmu/sources").rglob("*.c")]
    library = next((tmp_path / "fmu/binaries").rglob("*.so"))
    library.unlink()
    strict = ["-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
    subprocess.run([compiler, "-std=c99", *OPTIONS.split(), *strict, "-shared", "-I.", *sources, "-o", library],
                   cwd=tmp_path / "fmu/sources", check=True)
    files = {path.relative_to(tmp_path / "fmu").as_posix(): path for path in (tmp_path / "fmu").rglob("*")
             if path.is_file()}
    flight.path = write_archive(tmp_path / "again.fmu", files)
    flight.fly(100)


@flies_on("aarch64")
def test_the_library_for_aarch64_flies_alike(tmp_path):
    flight = Flight("nadir_spin", tmp_path, platform="aarch64")
    flight.fly(100, machine="aarch64", states=5,
               program=["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu", importer("aarch64-linux-gnu-gcc")])


def test_the_same_mission_gives_the_same_bytes(tmp_path):
    again = export(flight_fmu(fledge.load("nadir_spin")), tmp_path / "again.fmu")
    assert again.read_bytes() == exported("nadir_spin")[2].read_bytes()


def test_a_process_of_several_is_named_by_its_mission():
    system = flight_fmu(fledge.load("formation"), "chief")
    assert system.facts.identifier == "formation_chief"
    assert "chief.motor.command" in {message.path for message in system.layout.messages}


@pytest.mark.parametrize("words, says", [
    (["nadir_spin", "--process", "ground"], "nadir_spin has no process 'ground'; it has world, flight"),
    (["nadir_spin", "--on", "leon3"], "--on is for a flight process, which --process names: flight"),
    (["nadir_spin", "--process", "flight", "--platform", "riscv64"], "platforms are x86_64 and aarch64; found riscv64"),
    (["nadir_spin", "--process", "flight", "--out", "folder"], "--out is a file, NAME.fmu; found folder"),
    (["nadir_spin", "--process", "flight", "--tasks", "gnc"], "--tasks is for `export c`"),
    (["nadir_spin", "--process", "flight", "--yamcs"], "--yamcs is for `export xtce`")])
def test_wrong_requests_are_refused_in_one_line(tmp_path, monkeypatch, capsys, words, says):
    monkeypatch.chdir(tmp_path)
    assert main(["export", "fmu", *words]) == 2
    error = capsys.readouterr().err
    assert says in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_compiler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(Failure, match="aarch64-linux-gnu-gcc is not installed; sudo apt install gcc-aarch64-linux-gnu"):
        compiler_for("aarch64")
