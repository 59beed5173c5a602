# SPDX-License-Identifier: Apache-2.0
"""The emulated processor. How flight flies there is in python/fledge/targets/fly_test.py."""
import subprocess

import pytest

from fledge.targets import TARGETS
from tests.needs import flies_on

PROGRAM = """
int main(void)
{
    long sum = 1, more = 2;
    __asm__ volatile(INSTRUCTIONS : : "r"(&sum), "r"(more) : "x3", "w4", "memory");
    return sum == 3 ? 0 : 1;
}
"""


@flies_on("aarch64")
@pytest.mark.parametrize("instructions, code", [
    ("1: ldxr x3, [%0]\\n add x3, x3, %1\\n stxr w4, x3, [%0]\\n cbnz w4, 1b", 0),
    ("ldadd %1, %1, [%0]", 132),        # of ARMv8.1: a Raspberry Pi 3 or 4 has none of it
])
def test_it_has_the_instructions_of_a_raspberry_pi(tmp_path, instructions, code):
    target = TARGETS["aarch64"]
    (tmp_path / "sum.c").write_text(PROGRAM)
    subprocess.run([target.compiler, "-march=armv8.1-a", "-static", f'-DINSTRUCTIONS="{instructions}"', "sum.c", "-o",
                    "sum"], cwd=tmp_path, check=True)
    done = subprocess.run(["sh", "-c", '"$@"; exit $?', "sh", *target.runner, "./sum"], cwd=tmp_path,
                          capture_output=True)
    assert done.returncode == code, done.stderr
