# SPDX-License-Identifier: Apache-2.0
"""The bound of a function is the time of its costliest path: where all paths can be taken, that which the emulator
counts for some input."""
import random
import subprocess

import pytest

from fledge.analysis import bound
from fledge.emulator import Board
from fledge.errors import Failure
from fledge.targets.leon3 import board as boards
from tests.needs import flies_on

pytestmark = flies_on("leon3")

BITS = 6        # of the input, each of which decides one branch
HEAD = """#include <string.h>
#include "targets/bare/bare.h"
#define APART __attribute__((noinline, noclone))
volatile int sink;
volatile double real;
int from[64], to[64];
"""
QUIET = """__asm__ volatile("rd %%psr, %%g1; or %%g1, 0xf00, %%g1; wr %%g1, %%psr; nop; nop; nop" : : : "g1");"""


def written(stream, bits, depth=0):
    """Statements: each bit of x decides one branch, rounds of loops are constant."""
    text = ""
    for _ in range(stream.randint(1, 3)):
        kind = stream.random()
        if bits and kind < 0.5:
            condition = f"x & {1 << bits.pop()}"
            text += f"if ({condition}) {{ {written(stream, bits, depth + 1)} }}"
            text += f" else {{ {written(stream, bits, depth + 1)} }}\n" if stream.random() < 0.5 else "\n"
        elif depth < 3 and kind < 0.7:
            name = f"i{depth}"
            text += f"for (int {name} = 0; {name} < {stream.randint(2, 30)}; {name}++) {{ " \
                    f"{written(stream, [], depth + 1)} }}\n"
        else:
            text += stream.choice(["sink += 3;", "sink *= 5;", "real = real / 3.0;", "sink = sink / 7;", "real += 1.0;",
                                   "sink ^= 1;"])
    return text


def built(folder, body, flags=()):
    source = folder / "program.c"
    source.write_text(HEAD + body, encoding="utf-8")
    return boards.program(folder / "built", "program", [source], [], flags)


def seen(program, names, arguments):
    """name -> [cycles] of its calls, in their order."""
    board = Board(boards.BOARD, program)
    times = {name: [] for name in names}
    starts, running = {board.address(name): name for name in names}, {}
    for place in starts:
        board.breakpoint(place)

    core = board.core
    while board.run_until(60.0) == "breakpoint":
        place = core.registers()["%pc"]
        if place in running:
            name, begun = running.pop(place)
            times[name].append(core.cycles - begun)
        if place in starts:
            after = core.registers()["%o7"] + 8
            board.breakpoint(after)
            running[after] = starts[place], core.cycles
    assert all(len(of) == arguments for of in times.values())
    return times


def test_all_paths_of_random_functions_cost_what_the_emulator_counts(tmp_path):
    stream = random.Random(5)
    names = [f"f{k}" for k in range(12)]
    body = "".join(f"APART void {name}(unsigned x)\n{{\n(void)x;\n"
                   f"{written(stream, stream.sample(range(BITS), BITS))}}}\n" for name in names)
    calls = "".join(f"        {name}(x);\n" for name in names)
    program = built(tmp_path, f"{body}int main(void)\n{{\n    {QUIET}\n"
                              f"    for (unsigned x = 0; x < {1 << BITS}; x++) {{\n{calls}    }}\n    return 0;\n}}\n")
    analysed = bound.Program(program)
    for name, times in seen(program, names, 1 << BITS).items():
        assert analysed.longest(name) == max(times), (name, max(times))


def test_windows_calls_and_sizes_count(tmp_path):
    program = built(tmp_path, f"""
APART int depth(int x) {{ sink = x; return sink + 1; }}
APART int deeper(int x) {{ return depth(x) + depth(x + 1); }}
APART void copies(int n) {{ memcpy(to, from, sizeof to); memset(from, n, 37); memcpy((char *)to + 1, from, 21); }}
int main(void) {{ {QUIET} for (int x = 0; x < 3; x++) {{ deeper(x); copies(x); }} return 0; }}
""", ["-fno-ipa-cp", "-fno-ipa-sra", "-fno-optimize-sibling-calls"])
    analysed = bound.Program(program)
    for name, times in seen(program, ["deeper", "copies"], 3).items():
        # The first call may find no free window, later ones do.
        windows = analysed.cost(analysed.symbols[name]).windows
        assert analysed.longest(name) == times[-1] + windows * analysed.overflow
        assert times[-1] <= times[0] <= analysed.longest(name)


def test_the_loop_of_a_number_from_outside_needs_a_comment(tmp_path):
    loop = "APART void {}(int n) {{ for (int i = 0; i < n; i++) {{ sink += i; }}{}\n}}\n"
    program = built(tmp_path, loop.format("f", "") + "".join(
        loop.format(name, f" /* at most {rounds}: it is a day of the week */") for name, rounds in (("g", 5), ("h", 6))
    ) + "int main(void) { f(sink); g(sink); h(sink); return 0; }\n")
    with pytest.raises(Failure, match=r"a loop of f, .*program.c:7 has no bound: count it by a constant, prove it"):
        bound.Program(program).longest("f")
    known = bound.Program(program, bound.known())
    assert known.longest("h") - known.longest("g") in range(4, 12)


@pytest.fixture(scope="module")
def unbounded(tmp_path_factory):
    """A program of functions without a bound."""
    return built(tmp_path_factory.mktemp("unbounded"), """
APART int itself(int n) { return n < 2 ? 1 : itself(n - 1) * itself(n - 2) + sink; }
typedef void (*Call)(int);
volatile Call call;
APART void pointer(int n) { call(n); sink = n; }
APART void endless(int n) { (void)n; for (;;) { sink = 1; } }
int main(void) { sink = itself(sink); pointer(1); endless(1); return 0; }
""")


@pytest.mark.parametrize("name, wrong", [
    ("itself", r"itself calls itself, by itself; write it as a loop"),
    ("pointer", r"pointer, .*program.c:11 calls through a pointer; call the function by its"),
    ("endless", r"endless, .* never returns; it has no bound"), ("other", "has no function other")])
def test_what_has_no_bound_is_named(unbounded, name, wrong):
    with pytest.raises(Failure, match=wrong):
        bound.Program(unbounded).longest(name)


def test_a_program_without_lines_of_its_source_has_no_bound(unbounded, tmp_path):
    subprocess.run([bound.TOOLS + "strip", "--strip-debug", unbounded, "-o", tmp_path / "stripped"], check=True)
    with pytest.raises(Failure, match="has no lines of its source; build it with -g"):
        bound.Program(tmp_path / "stripped").longest("pointer")
