# SPDX-License-Identifier: Apache-2.0
"""The world has the same bits on aarch64, and its instructions are counted rightly."""
import os
import subprocess

import pytest

from bench.aarch64 import EMULATORS, Case, build, cases, compiled, missing, uncounted
from tests.needs import flies_on, skip_unless_on

LOOP = r"""
#include <stdlib.h>
int main(int count, char **arguments)
{
    long n = atol(arguments[1]);
    (void)count;
    __asm__ volatile("1: subs %0, %0, #1\n nop\n bne 1b" : "+r"(n) : : "cc");
    return 0;
}
"""


@flies_on("aarch64")
def test_a_turn_of_a_loop_counts_its_instructions(tmp_path):
    if says := uncounted():
        pytest.skip(says)
    (tmp_path / "loop.c").write_text(LOOP)
    subprocess.run(["aarch64-linux-gnu-gcc", "loop.c", "-o", "loop"], cwd=tmp_path, check=True)

    def executed(n):
        subprocess.run([*EMULATORS["aarch64"], "-plugin", compiled(tmp_path), "-d", "plugin", "-D", "log", "./loop",
                        str(n)], cwd=tmp_path, check=True)
        return int((tmp_path / "log").read_text())

    assert executed(80_000) - executed(20_000) == 3 * 60_000


@pytest.fixture(scope="module")
def library():
    skip_unless_on("aarch64")
    if os.environ.get("FLEDGE_PRESET", "release") != "release":
        pytest.skip("the libraries are those of the release build")
    if says := missing():
        pytest.skip(says)
    build()


@pytest.mark.long("builds the library for aarch64, and flies all cases under QEMU")
@pytest.mark.parametrize("name", cases())
def test_all_outputs_have_the_bytes_of_x86(library, name, tmp_path):
    case = Case(name, tmp_path)
    hashes = case.fly("x86_64", 3)
    assert len(set(hashes)) == 4        # they move
    assert case.fly("aarch64", 3) == hashes
