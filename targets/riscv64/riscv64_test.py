# SPDX-License-Identifier: Apache-2.0
"""The board's support: what a program needs, what protects it, and what a fault says; and flights on it. What all
targets have in common is in fly_test.py, which flies this target, too."""

import re
import shutil
import socket
import subprocess
import sys

import pytest

from fledge import cli
from fledge.targets import TARGETS, build
from tests.bare_machine import CONSOLE, Machine

TARGET = TARGETS["riscv64"]
pytestmark = pytest.mark.skipif(bool(TARGET.missing()), reason=f"{TARGET.missing()} not installed")


@pytest.fixture(scope="module")
def check(tmp_path_factory):
    """The check of boards, with a watchdog of half a second."""
    return TARGET.program(tmp_path_factory.mktemp("check"), "check", [
        build.ROOT / "targets/bare/testing/check.c", *CONSOLE], [],
        ("-Werror", "-Wconversion", "-DBOARD_PATIENCE_MS=500"))


def function_at(program, address):
    """The function of an address, inlined ones left out."""
    done = subprocess.run(["riscv64-unknown-elf-addr2line", "-f", "-e", program, address], capture_output=True,
                          text=True, check=True)
    return done.stdout.splitlines()[0]


@pytest.mark.parametrize("asked, status", [(".", 0), ("e", 7)])
def test_the_board_support_does_what_a_program_needs(check, asked, status):
    """Initial data, registers over interrupts, denormal numbers, errno of the C library, the line in both directions,
    and the status at the end."""
    with Machine(TARGET, check) as machine:
        assert machine.until("^checked\n")
        assert machine.process.poll() is None
        machine.say("0123456789" * 100 + asked)
        assert machine.process.wait() == status


@pytest.mark.parametrize("asked, what, where", [
    ("c", "jump to what is no code", None),
    ("s", "store to protected memory, or where none is,", "wild_store"),
    ("p", "store to protected memory, or where none is,", "wild_code"),
    ("l", "load from protected memory, or where none is,", "wild_load"),
    ("f", "stack overflow", "deeper"),
    ("w", "watchdog: the program was not idle for 10 s,", "do_what_is_asked|main")])
def test_a_fault_says_what_and_where_and_resets_the_board(check, asked, what, where):
    """Null pointers, code, and the page below the stack are protected. Initial data are fresh after the reset; what is
    kept, is kept."""
    with Machine(TARGET, check) as machine:
        assert machine.until(r"^(.*)\nchecked\n")[1] == "start 1"
        machine.say(asked)
        said = machine.until(r"^fault: (.*) at 0x(\w{8,}), called from 0x\w{8,}\n(cause .*)\n")
        assert said[1] == what and len(re.findall(r"\w+ [0-9a-f]+\b", said[3])) > 15
        if where:
            assert re.fullmatch(where, function_at(check, said[2]))
        else:
            assert said[2] == "00000010"
        assert machine.until(r"^(.*)\nchecked\n")[1] == "start 2"
        machine.say("r")
        assert machine.until(r"^(.*)\nchecked\n")[1] == "start 3"
        machine.say(".")
        assert machine.process.wait() == 0


def test_the_elementary_functions_have_the_same_bits(tmp_path):
    """Hashes over 200,000 arguments of each function."""
    math = build.ROOT / "flight/math"
    sources = [math / "elementary_hash.c", *build.math_sources()]
    here = build.program(tmp_path / "here", "hash", sources, [build.ROOT], link=["-lm"])
    expected = subprocess.run([here], capture_output=True, text=True, check=True).stdout
    there = TARGET.program(tmp_path / "there", "hash", [*sources, *CONSOLE], [], link=("-lm",))
    with Machine(TARGET, there) as machine:
        assert machine.process.communicate()[0].decode() == expected and len(expected.splitlines()) == 11
        assert machine.process.returncode == 0


@pytest.mark.long("builds and flies two images")
def test_a_reset_of_the_computer_in_flight(tmp_path, capsys):
    """The record goes on, and all bits and all telemetry are the desktop's."""
    assert cli.main(["fly", "flatsat", "silent", "--on", "riscv64", "--out", str(tmp_path)]) == 0, capsys.readouterr()
    row, = (line for line in capsys.readouterr().out.splitlines() if line.startswith("  riscv64"))
    assert " none " in row and "flight: recorded 589\n" in (tmp_path / "riscv64.log").read_text()


@pytest.mark.long("builds and flies an image")
def test_a_mission_with_a_large_board(tmp_path, capsys):
    """Of 700 KiB: commands, files and tables cross it."""
    assert cli.main(["fly", "mars_orbiter", "pointing", "--for", "20s", "--on", "riscv64", "--out", str(tmp_path)]) == 0
    assert "passed   desktop, riscv64" in capsys.readouterr().out


@pytest.mark.long("builds images of two boards")
@pytest.mark.skipif(bool(TARGETS["cortex-m7"].missing()), reason="the other board is not installed")
def test_boards_of_different_processors_fly_in_one_run(tmp_path, capsys):
    assert cli.main(["fly", "formation", "sensed", "--for", "10s", "--on", "deputy=riscv64,chief=cortex-m7", "--out",
                     str(tmp_path)]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if re.search(" on (riscv64|cortex-m7) ", line)]
    assert len(rows) == 2 and all(" none " in row for row in rows)


@pytest.mark.long("builds and flies an image under gdb")
@pytest.mark.skipif(not shutil.which("gdb-multiarch"), reason="gdb-multiarch is not installed")
@pytest.mark.parametrize("name", ["riscv64", "cortex-m7"])
def test_gdb_stops_in_flight(name, tmp_path):
    """As docs/debugging.md has it; the flight then goes on to its end."""
    if TARGETS[name].missing():
        pytest.skip(f"{TARGETS[name].missing()} not installed")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    arguments = ["fly", "nadir_spin", "--for", "5s", "--on", name, "--out", str(tmp_path)]
    assert cli.main([*arguments, "--build"]) == 0
    with subprocess.Popen([sys.executable, "-P", "-m", "fledge.cli", *arguments, "--gdb", str(port)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as flight:
        words = ["set tcp connect-timeout 500", f"target remote :{port}", "break mrp_feedback_update", "continue",
                 "print m->par.K", "backtrace", "delete", "continue"]
        asked = [word for one in words for word in ("-ex", one)]
        said = subprocess.run(["gdb-multiarch", "-q", "-nx", "-batch", *asked, tmp_path / name / "nadir_spin"],
                              capture_output=True, text=True).stdout
        printed = flight.communicate()[0]
    assert "Breakpoint 1, mrp_feedback_update" in said and "$1 = 2.531" in said and "run_gnc" in said, said
    assert flight.returncode == 0 and f"passed   desktop, {name}" in printed, printed
