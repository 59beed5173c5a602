# SPDX-License-Identifier: Apache-2.0
"""The outputs of each flight module over random inputs have the same hash on each target, as it is compiled there, and
whatever the optimiser does. The elementary functions that modules call: flight/math/cross_hash_test.py."""
import subprocess

import pytest

from fledge.targets import TARGETS, build
from fledge.targets.bare import Bare
from fledge.targets.leon3 import board
from tests import bare_machine, leon3_programs
from tests.circles import long_after
from tests.needs import needs, skip_unless_on

INPUTS = 1000       # of each module: SETS * ROUNDS of module_hash.c
# All that flies in this build, and the tables of it; who needs another comes first.
LIBRARIES = ["introspect/libfledge_tables.a", "flight/libfledge_flight.a", "flight/libfledge_command.a",
             "flight/math/libfledge_math.a", "ccsds/libfledge_ccsds.a", "ccsds/libfledge_ccsds_store.a"]


def sources():
    """All that flies, and the tables of it."""
    return [build.ROOT / "tests/module_hash.c", build.build_folder() / "introspect/flight_tables.c",
            *build.flight_sources()]


def hashes(printed):
    """Name -> (hash, how often its outputs changed)."""
    return {name: (hash_, int(changes)) for name, hash_, changes in map(str.split, printed.splitlines())}


def run(folder, *flags, compiler="gcc", runner=(), link=()):
    built = build.program(folder, "hash", sources(), [build.ROOT], compiler, list(flags), [*link, "-lm"])
    return hashes(subprocess.run([*runner, built], capture_output=True, text=True, check=True).stdout)


def run_on(name, folder, *flags):
    skip_unless_on(name)
    target = TARGETS[name]
    target.prepare()
    if name == "leon3":
        return hashes(leon3_programs.on_emulator(board.program(folder, "hash", sources(), []), "translator"))
    if isinstance(target, Bare):
        return hashes(bare_machine.printed(target, bare_machine.program(target, folder, "hash", sources())))
    return run(folder, "-fno-pie", *flags, compiler=target.compiler, runner=target.runner, link=target.link)


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """As the build computes it that flies on this machine."""
    libraries = [build.build_folder() / name for name in LIBRARIES]
    built = build.program(tmp_path_factory.mktemp("here"), "hash", sources()[:1], [build.ROOT],
                          link=[*libraries, "-lm"])
    return hashes(subprocess.run([built], capture_output=True, text=True, check=True).stdout)


def test_most_modules_put_out_something_else_at_most_inputs(expected):
    assert len(expected) > 80 and max(n for _, n in expected.values()) <= INPUTS
    assert sum(n > INPUTS / 5 for _, n in expected.values()) > 0.7 * len(expected)


@pytest.mark.parametrize("target", long_after(
    1, ["leon3", "linux", "aarch64", "sparc64", "cortex-m7", "riscv64"], "compiles all of flight once more"))
def test_each_module_computes_the_same_bits_there(target, expected, tmp_path):
    assert run_on(target, tmp_path) == expected


@pytest.mark.long("compiles all of flight for each")
@pytest.mark.parametrize("compiler, level", [("gcc", "-O0"), ("gcc", "-O3"),
                                             pytest.param("clang", "-O3", marks=needs("clang"))])
def test_each_module_computes_the_same_bits_however_it_is_optimised(compiler, level, expected, tmp_path):
    assert run(tmp_path, level, compiler=compiler) == expected


@pytest.mark.long("compiles all of flight once more")
def test_fused_arithmetic_is_seen(expected, tmp_path):
    fused = run_on("aarch64", tmp_path, "-O3", "-ffp-contract=fast")
    assert sum(fused[name] != expected[name] for name in expected) > 0.4 * len(expected)
