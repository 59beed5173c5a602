# SPDX-License-Identifier: Apache-2.0
"""Programs of others on the LEON3: the same results as here, on each engine, and as on stock QEMU."""

import pytest

from tests import leon3_programs as programs
from tests.needs import flies_on

pytestmark = flies_on("leon3")


@pytest.mark.long("compiles and runs random programs")
@flies_on("leon3-qemu", needs=["csmith", "libcsmith-dev"])
def test_random_programs_give_the_same_checksums_as_here(tmp_path):
    compared = 0
    for seed in (1, 2, 3, 5):
        made = programs.random_program(seed, tmp_path)
        if made:
            program, expected = made
            assert expected.startswith("checksum = ")
            for where, printed in programs.everywhere(program).items():
                assert printed == expected, f"seed {seed}, {where}"
            compared += 1
    assert compared >= 3


@pytest.mark.long("runs newlib's tests twice")
@flies_on("leon3-qemu")
def test_the_tests_of_the_c_library_print_the_same_as_on_qemu(tmp_path):
    printed = programs.everywhere(programs.newlib_math(tmp_path), ["threaded", "translator"])
    assert "testing sinf\n" in printed["qemu"] and "Tested 29106 functions" in printed["qemu"]
    for engine, text in printed.items():
        assert text == printed["qemu"], engine


def test_elementary_functions_have_the_same_hashes_as_here(tmp_path):
    program, expected = programs.elementary_hashes(tmp_path)
    assert len(expected.splitlines()) >= 10
    assert programs.on_emulator(program, "translator") == expected
