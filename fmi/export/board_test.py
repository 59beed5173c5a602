# SPDX-License-Identifier: Apache-2.0
"""FMUs of flight on the emulated LEON3 in an importer in C, with the inputs of the desktop's flight: every output has
its bytes."""

import ctypes
import functools
import re
import struct
import subprocess
import xml.etree.ElementTree as xml
import zipfile
from dataclasses import replace

import pytest

import fledge
from fledge import cli
from fledge.errors import Failure
from fledge.export.fmu.board import board_fmu
from fledge.export.fmu.build import export
from fledge.export.fmu.flight_test import VERSIONS, Flight
from fledge.targets.reset_test import mission
from fmi.testing.flying import Plan, importer, places
from tests.needs import flies_on

SIZE, F64 = ctypes.c_size_t, ctypes.c_double
LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)

pytestmark = flies_on("leon3")


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A function that gives the Flight of a mission on the LEON3, and builds each mission once."""
    systems = functools.cache(lambda mission: board_fmu(mission, folder=tmp_path_factory.mktemp("built")))

    class Board(Flight):
        def __init__(self, mission, folder, version="3"):
            self.folder, self.sim, self.plan = folder, fledge.load(mission), Plan()
            self.system = systems(mission)
            self.layout, self.step = self.system.layout, self.system.facts.step
            self.path, self.places = export(self.system, folder / "board.fmu", version), places(self.layout)

    return Board


@pytest.fixture(scope="module")
def resetting(tmp_path_factory):
    """A mission whose computer the power unit resets."""
    return str(mission(tmp_path_factory.mktemp("missions") / "resetting", [7.2, 14.0], 1.3))


@VERSIONS
def test_every_output_has_the_bytes_of_the_desktop(flight, tmp_path, version):
    """In two instances, which also go back to states, and on by their bytes; and with other parameters."""
    board = flight("nadir_spin", tmp_path, version)
    u_max = board.places["flight.wheels.u_max"]
    board.plan.set(0, board.places["flight.control.K"], [2.0])
    board.plan.set(0, board.places["flight.control.K"], [3.0], at=50)
    board.plan.set(0, u_max, [0.2, 0.01, 0.2, 0.2, *[0.0] * (u_max.n - 4)], at=70)

    def change(sim, step):
        sim.flight.control.K = 2.0 if step < 50 else 3.0
        if step == 70:
            sim.flight.wheels.u_max[1] = 0.01       # the configuration is published again

    board.fly(200, change=change, sets=2, states=20)


def test_modes_events_and_resets_are_those_of_the_desktop(flight, resetting, tmp_path):
    board = flight(resetting, tmp_path)
    mode, fired, clock = (board.places[f"flight.{name}"] for name in ("mode", "fired.turns", "clock.mode"))
    board.plan.show(0, [mode, fired])
    board.plan.clock(0, clock.reference)
    board.plan.set(0, board.places["flight.request"], [2], at=34)
    board.step = 0.5    # the tasks that run between read no inputs
    shown = board.fly(48, change=lambda sim, step: step == 34 and sim.flight.turn.enter(), events=True, states=10)
    desktop = board.sim.flight
    assert [desktop.active_mode, desktop.turns.fired[0]] == ["turn", 3] and shown[mode.reference] == ["2"]
    assert shown[fired.reference] == ["3"]
    assert shown[clock.reference] == [str(sum(count for count, _ in desktop.entered.values()))]


def test_packets_pass_both_ways(flight, resetting, tmp_path):
    """Commands are executed at the next instant, and what flight sends has the bytes of the desktop."""
    board, expected = flight(resetting, tmp_path), []
    commands = board.sim.flight.commands
    commands.take_packets()
    board.sim.step()
    same = fledge.load(resetting).flight.commands.packets
    packets = same.mode("turn") + same.telemetry("flight.spin.reference")
    commands.mode("turn")
    commands.telemetry("flight.spin.reference")
    for step in range(1, 7):
        board.sim.run(until=step)
        expected.append(b"".join(packet for _, packet in commands.take_packets()))
    assert fly_packets(board, packets, 6) == expected and len(expected[0]) > 100 and len(set(expected)) == 6


def fly_packets(board, packets, steps):
    """Of each step of 1 s what flight sends, if it gets the packets before the first one."""
    library, fmu, _ = instance(board)
    uplink, downlink = (ctypes.byref(ctypes.c_uint32(board.places[f"flight.{name}"].reference))
                        for name in ("uplink", "downlink"))
    size, data = SIZE(len(packets)), ctypes.c_char_p(packets)
    flags, last = [ctypes.byref(ctypes.c_bool())] * 3, ctypes.byref(F64())
    value = SIZE(1), ctypes.byref(size), ctypes.byref(data), SIZE(1)
    assert start(library, fmu) == 0 and library.fmi3SetBinary(fmu, uplink, *value) == 0
    found = []
    for step in range(steps):
        assert library.fmi3DoStep(fmu, F64(step), F64(1), True, *flags, last) == 0
        assert library.fmi3GetBinary(fmu, downlink, *value) == 0
        found.append(ctypes.string_at(data, size.value))
    library.fmi3FreeInstance(fmu)
    return found


def instance(board):
    """(the library, an instance, the lines of its log), without the importer in C."""
    with zipfile.ZipFile(board.path) as archive:
        archive.extractall(board.folder)
    library = ctypes.CDLL(str(next(board.folder.glob("binaries/*/*_leon3.so"))))
    token = xml.parse(board.folder / "modelDescription.xml").getroot().attrib["instantiationToken"]
    lines = []
    library.log = LOG(lambda _, status, category, text: lines.append(f"{category.decode()}: {text.decode()}"))
    library.fmi3InstantiateCoSimulation.restype = ctypes.c_void_p
    fmu = library.fmi3InstantiateCoSimulation(b"flight", token.encode(), f"{board.folder}/resources/".encode(), False,
                                              True, False, False, None, SIZE(0), None, library.log, None)
    return library, ctypes.c_void_p(fmu), lines


def start(library, fmu):
    return (library.fmi3EnterInitializationMode(fmu, False, F64(), F64(), False, F64())
            or library.fmi3ExitInitializationMode(fmu))


def test_a_parameter_that_breaks_its_rule_is_refused(flight, tmp_path):
    board = flight("nadir_spin", tmp_path)
    library, fmu, lines = instance(board)
    gain = ctypes.byref(ctypes.c_uint32(board.places["flight.control.K"].reference))
    assert library.fmi3SetFloat64(fmu, gain, SIZE(1), ctypes.byref(F64(-2)), SIZE(1)) == 0
    assert start(library, fmu) != 0
    assert any(re.search(r"errors: flight\.control\.K must be .*> 0 N m; found -2$", line) for line in lines), lines
    library.fmi3FreeInstance(fmu)


@pytest.mark.parametrize("words, error", [
    ((0, 0), "the processor is in its error mode, at 0x[0-9a-f]+ leon3_halt"),
    ((0x10800000, 0x01000000), "the processor runs, at 0x[0-9a-f]+ mrp_feedback_update")])
def test_a_program_that_fails_is_an_error_that_says_where(flight, tmp_path, words, error):
    """By an instruction that is none, of which the program tells the console, and by a branch to itself."""
    board = flight("nadir_spin", tmp_path)
    changed = {**board.system.resources, "flight.elf": damaged(board.system.resources["flight.elf"], words)}
    board.path = export(replace(board.system, resources=changed), tmp_path / "damaged.fmu")
    library, fmu, lines = instance(board)
    assert start(library, fmu) == 3
    assert any(re.search(f"flight did not answer .*, in the tick at 0 s: {error}", line) for line in lines), lines
    assert any(line.startswith("console: trap 0x00000002 at ") for line in lines) == (words == (0, 0))
    library.fmi3FreeInstance(fmu)


def damaged(program, words):
    """The bytes of a program with other instructions at the beginning of the control law."""
    def output(name, *options):
        return subprocess.run([f"sparc64-linux-gnu-{name}", *options, program], check=True, capture_output=True,
                              text=True).stdout

    place = int(re.search(r"(\w+) T mrp_feedback_update", output("nm"))[1], 16)
    sections = re.search(r"\.text +\w+ +(\w+) +\w+ +(\w+)", output("objdump", "-hw"))
    at = place - int(sections[1], 16) + int(sections[2], 16)
    content = program.read_bytes()
    return content[:at] + struct.pack(">2I", *words) + content[at + 8:]


@flies_on("aarch64")
def test_on_aarch64_the_same_bits(flight, tmp_path):
    """With the library that cmake/aarch64.cmake builds."""
    board = flight("nadir_spin", tmp_path)
    try:
        board.path = export(board.system, tmp_path / "aarch64.fmu", platforms=["aarch64"])
    except Failure as failure:
        pytest.skip(str(failure))
    board.fly(60, machine="aarch64", states=5,
              program=["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu", importer("aarch64-linux-gnu-gcc")])


def test_what_it_cannot_be_is_refused(tmp_path, capsys):
    assert cli.main(["export", "fmu", "nadir_spin", "--on", "leon3", "--out", str(tmp_path / "x.fmu")]) == 2
    assert "--on is for a flight process, which --process names: flight" in capsys.readouterr().err
