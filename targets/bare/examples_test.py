# SPDX-License-Identifier: Apache-2.0
"""The five functions in a task of an operating system compile against what its manual declares (examples/testing), and
those of a board without one."""

import subprocess

import pytest

from tests.needs import needs
from tests.tree import ROOT

EXAMPLES = ROOT / "targets/bare/examples"
FIVE = {"board_send", "board_receive", "board_time", "board_watch", "board_keep"}
STRICT = ["-std=c99", "-D_DEFAULT_SOURCE", "-Wall", "-Wextra", "-Wconversion", "-Wstrict-prototypes",
          "-Wmissing-prototypes", "-Werror", f"-I{ROOT}", f"-I{EXAMPLES / 'testing'}", "-c"]


def symbols(name, tmp_path, prefix="", *flags):
    """{symbol: the kind that nm tells} of an example."""
    subprocess.run([f"{prefix}gcc", *flags, *STRICT, EXAMPLES / name, "-o", tmp_path / "o"], check=True)
    printed = subprocess.run([f"{prefix}nm", "--format=posix", tmp_path / "o"], capture_output=True, text=True,
                             check=True).stdout
    return {name: kind for name, kind, *_ in map(str.split, printed.splitlines())}


@pytest.mark.parametrize("system", ["freertos", "zephyr", "rtems"])
def test_the_five_functions_compile_in_a_task(system, tmp_path):
    symbols_ = symbols(f"{system}.c", tmp_path)
    assert {name for name, kind in symbols_.items() if kind == "T"} >= FIVE
    assert symbols_["fledge_fly"] == "U"


@needs("gcc-arm-none-eabi", "picolibc-arm-none-eabi")
def test_the_five_functions_compile_for_a_board(tmp_path):
    symbols_ = symbols("nucleo_h743zi.c", tmp_path, "arm-none-eabi-", "--specs=picolibc.specs", "-mcpu=cortex-m7",
                       "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16", "-DCORTEX_M7_LINE=39")
    assert {name for name, kind in symbols_.items() if kind == "T"} == FIVE | {
        "cortex_m7_begin", "cortex_m7_beat", "cortex_m7_receive"}
