# SPDX-License-Identifier: Apache-2.0
"""The board's support: what a program needs, what protects it, and what a fault says; and flights on it. What all
targets have in common is in fly_test.py, which flies this target, too."""

import re
import subprocess
import types

import pytest

from fledge import cli
from fledge.errors import Failure
from fledge.targets import TARGETS, build
from tests.bare_machine import Machine, printed, program

TARGET = TARGETS["cortex-m7"]
pytestmark = pytest.mark.skipif(bool(TARGET.missing()), reason=f"{TARGET.missing()} not installed")


@pytest.fixture(scope="module")
def check(tmp_path_factory):
    """The check of boards, with a watchdog of half a second."""
    return program(TARGET, tmp_path_factory.mktemp("check"), "check", [
        build.ROOT / "targets/bare/testing/check.c"], "-Werror", "-Wconversion", "-DBOARD_PATIENCE_MS=500")


def function_at(program, address):
    done = subprocess.run(["arm-none-eabi-addr2line", "-f", "-e", program, address], capture_output=True, text=True,
                          check=True)
    return done.stdout.splitlines()[0]


@pytest.mark.parametrize("asked, status", [(".", 0), ("e", 7)])
def test_the_board_support_does_what_a_program_needs(check, asked, status):
    """Initial data, registers over interrupts, denormal numbers, errno of the C library, the line in both directions,
    and the status at the end."""
    with Machine(TARGET, check) as board:
        assert board.until("^start 1\nchecked\n")
        board.say("0123456789" * 100 + asked)
        assert board.process.wait() == status


@pytest.mark.parametrize("asked, what, where", [
    ("c", "jump to what is no code", None),
    ("s", "access to protected memory", "wild_store"),
    ("p", "access to protected memory", "wild_code"),
    ("l", "access to where no memory is", "wild_load"),
    ("d", "division by zero", "wild_quotient"),
    ("f", "stack overflow", "deeper"),
    ("w", "watchdog: the program was not idle for 10 s,", "do_what_is_asked|main")])
def test_a_fault_says_what_and_where_and_resets_the_board(check, asked, what, where):
    """Null pointers, code, and what is below the stack are protected. Initial data are fresh after the reset; what is
    kept, is kept."""
    with Machine(TARGET, check) as board:
        assert board.until(r"^start 1\nchecked\n")
        board.say(asked)
        said = board.until(r"^fault: (.*) at 0x(\w{8})(?:, called from 0x\w{8})?\n(number .*)\n")
        assert said[1] == what and len(re.findall(r"\w+ [0-9a-f]+\b", said[3])) > 15
        if where:
            assert re.fullmatch(where, function_at(check, said[2]))
        else:
            assert said[2] == "00000010"
        assert board.until(r"^start 2\nchecked\n")
        board.say("r")
        assert board.until(r"^start 3\nchecked\n")
        board.say(".")
        assert board.process.wait() == 0


def test_the_elementary_functions_have_the_same_bits(tmp_path):
    """Hashes over 200,000 arguments of each function."""
    math = build.ROOT / "flight/math"
    sources = [math / "elementary_hash.c", *build.math_sources()]
    here = build.program(tmp_path / "here", "hash", sources, [build.ROOT], link=["-lm"])
    expected = subprocess.run([here], capture_output=True, text=True, check=True).stdout
    there = program(TARGET, tmp_path / "there", "hash", sources)
    assert printed(TARGET, there) == expected and len(expected.splitlines()) == 11


def test_a_processor_without_a_unit_for_double_precision_is_refused(monkeypatch):
    part = types.SimpleNamespace(frames=None)
    TARGET.check(part)
    for machine in (("-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"), ("-mcpu=cortex-m3",)):
        monkeypatch.setattr(TARGET, "machine", ("-mthumb", *machine))
        with pytest.raises(Failure, match="no unit for double precision, and the compiler's software for it has other"):
            TARGET.check(part)


@pytest.mark.long("builds and flies images of two boards")
def test_a_flight_prints_what_it_needed_beside_another_board(tmp_path, capsys):
    on = "deputy=cortex-m7" + ("" if TARGETS["leon3"].missing() else ",chief=leon3")
    assert cli.main(["fly", "formation", "sensed", "--for", "10s", "--on", on, "--out", str(tmp_path)]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if " on cortex-m7" in line or " on leon3" in line]
    assert len(rows) == len(on.split(",")) and all(" none " in row for row in rows)
    figures = dict(re.findall(r"deputy: (\w+) (\d+)", (tmp_path / "apart.log").read_text()))
    assert figures["ticks"] == figures["recorded"] == "21" and figures["refused"] == figures["line_resets"] == "0"
    assert 500 < int(figures["stack_bytes"]) < 20_000 and int(figures["data_bytes"]) < int(figures["ram_bytes"])
    assert 20_000 < int(figures["program_bytes"]) < 200_000 and int(figures["ram_bytes"]) < 1_000_000
