# SPDX-License-Identifier: Apache-2.0
"""The five functions in a task of an operating system compile against what its manual declares (examples/testing)."""

import subprocess

import pytest

from tests.tree import ROOT

EXAMPLES = ROOT / "targets/bare/examples"
FIVE = {"board_send", "board_receive", "board_time", "board_watch", "board_keep"}


@pytest.mark.parametrize("system", ["freertos", "zephyr", "rtems"])
def test_the_five_functions_compile_in_a_task(system, tmp_path):
    subprocess.run(["gcc", "-std=c99", "-D_DEFAULT_SOURCE", "-Wall", "-Wextra", "-Wconversion", "-Wstrict-prototypes",
                    "-Wmissing-prototypes", "-Werror", f"-I{ROOT}", f"-I{EXAMPLES / 'testing'}", "-c",
                    EXAMPLES / f"{system}.c", "-o", tmp_path / "o"], check=True)
    symbols = subprocess.run(["nm", "--format=posix", tmp_path / "o"], capture_output=True, text=True, check=True)
    kinds = {name: kind for name, kind, *_ in map(str.split, symbols.stdout.splitlines())}
    assert {name for name, kind in kinds.items() if kind == "T"} >= FIVE
    assert kinds["fledge_fly"] == "U"
