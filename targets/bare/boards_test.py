# SPDX-License-Identifier: Apache-2.0
"""The support of the boards behind a line: what a program needs, what protects it, what a fault says, and gdb. What
all targets have in common is in fly_test.py, which flies these, too."""
import re
import socket
import subprocess
import sys

import pytest

from fledge import cli
from fledge.targets import TARGETS, build
from tests.bare_machine import Machine, printed, program
from tests.needs import needs, skip_unless_on

# What each board reports of a fault, by the check's action: the fault, and the function in which it is.
FAULTS = {
    "cortex-m7": {
        "c": ("jump to what is no code", None),
        "s": ("access to protected memory", "wild_store"),
        "p": ("access to protected memory", "wild_code"),
        "l": ("access to where no memory is", "wild_load"),
        "d": ("division by zero", "wild_quotient"),
        "f": ("stack overflow", "deeper"),
        "w": ("watchdog: the program was not idle for 10 s,", "obey|main")},
    "riscv64": {
        "c": ("jump to what is no code", None),
        "s": ("store to protected memory, or where none is,", "wild_store"),
        "p": ("store to protected memory, or where none is,", "wild_code"),
        "l": ("load from protected memory, or where none is,", "wild_load"),
        "f": ("stack overflow", "deeper"),
        "w": ("watchdog: the program was not idle for 10 s,", "obey|main")}}
# How they say it: (where, registers).
SAYS = {"cortex-m7": (r"0x(\w{8})(?:, called from 0x\w{8})?", "number"),
        "riscv64": (r"0x(\w{8,}), called from 0x\w{8,}", "cause")}


@pytest.fixture(scope="module", params=FAULTS)
def target(request):
    skip_unless_on(request.param)
    return TARGETS[request.param]


@pytest.fixture(scope="module")
def check(target, tmp_path_factory):
    """The check of boards, with a watchdog of half a second."""
    return program(target, tmp_path_factory.mktemp("check"), "check", [
        build.ROOT / "targets/bare/testing/check.c"], "-Werror", "-Wconversion", "-DBOARD_PATIENCE_MS=500")


@pytest.mark.parametrize("action, status", [(".", 0), ("e", 7)])
def test_the_board_support_does_what_a_program_needs(target, check, action, status):
    """Initial data, registers over interrupts, denormal numbers, errno of the C library, the line in both directions,
    and the status at the end."""
    with Machine(target, check) as board:
        assert board.until("^start 1\nchecked\n")
        assert board.process.poll() is None
        board.send("0123456789" * 100 + action)
        assert board.process.wait() == status


@pytest.mark.parametrize("target, action", [(name, fault) for name, faults in FAULTS.items() for fault in faults],
                         indirect=["target"], scope="module")
def test_a_fault_says_what_and_where_and_resets_the_board(target, check, action):
    """Null pointers, code, and what is below the stack are protected. Initial data are fresh after the reset; what is
    kept, is kept."""
    (what, function), (where, registers) = FAULTS[target.name][action], SAYS[target.name]
    with Machine(target, check) as board:
        assert board.until(r"^start 1\nchecked\n")
        board.send(action)
        match = board.until(rf"^fault: (.*) at {where}\n({registers} .*)\n")
        assert match[1] == what and len(re.findall(r"\w+ [0-9a-f]+\b", match[3])) > 15
        if function:
            place = subprocess.run([target.addr2line, "-f", "-e", check, match[2]], capture_output=True, text=True,
                                   check=True).stdout
            assert re.fullmatch(function, place.splitlines()[0])
        else:
            assert match[2] == "00000010"
        assert board.until(r"^start 2\nchecked\n")
        board.send("r")
        assert board.until(r"^start 3\nchecked\n")
        board.send(".")
        assert board.process.wait() == 0


def test_the_elementary_functions_have_the_same_bits(target, tmp_path):
    """Hashes over 200,000 arguments of each function."""
    math = build.ROOT / "flight/math"
    sources = [math / "elementary_hash.c", *build.math_sources()]
    here = build.program(tmp_path / "here", "hash", sources, [build.ROOT], link=["-lm"])
    expected = subprocess.run([here], capture_output=True, text=True, check=True).stdout
    there = program(target, tmp_path / "there", "hash", sources)
    assert printed(target, there) == expected and len(expected.splitlines()) == 12


@pytest.mark.long("builds and flies an image under gdb")
@needs("gdb-multiarch")
def test_gdb_stops_in_flight(target, tmp_path):
    """As docs/debugging.md has it; the flight then goes on to its end."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    arguments = ["fly", "nadir_spin", "--for", "5s", "--on", target.name, "--out", str(tmp_path)]
    assert cli.main([*arguments, "--build"]) == 0
    with subprocess.Popen([sys.executable, "-P", "-m", "fledge.cli", *arguments, "--gdb", str(port)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as flight:
        words = ["set tcp connect-timeout 500", f"target remote :{port}", "break mrp_feedback_update", "continue",
                 "print m->par.K", "backtrace", "delete", "continue"]
        commands = [option for word in words for option in ("-ex", word)]
        program = tmp_path / target.name / "nadir_spin"
        output = subprocess.run(["gdb-multiarch", "-q", "-nx", "-batch", *commands, program],
                                capture_output=True, text=True).stdout
        printed = flight.communicate()[0]
    assert "Breakpoint 1, mrp_feedback_update" in output and "$1 = 2.531" in output and "run_gnc" in output, output
    assert flight.returncode == 0 and f"passed   desktop, {target.name}" in printed, printed
