# SPDX-License-Identifier: Apache-2.0
"""Programs of others on the LEON3: csmith's random C computes the same there as here, and as on stock QEMU.

    PYTHONPATH=python:.:build/release/python /usr/bin/python3 -m tests.leon3_programs [--seed N] [--minutes M]

compares one random program after the other, and ends at the first difference.
"""

import argparse
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from fledge.targets import build
from fledge.targets.leon3 import board, toolchain

ENGINES = ["interpreter", "threaded", "translator"]
GENERIC = build.ROOT / "emulator/boards/leon3_generic.toml"

# Two machines agree on what C defines: not on what a union shows of another member, nor on what lies at an odd address.
CSMITH = ["csmith", "--no-unions", "--no-packed-struct", "--no-argc", "--max-funcs", "6", "--max-block-depth", "3"]
CSMITH_HEADERS = Path("/usr/include/csmith")


def on_emulator(program: Path, engine: str, seconds: float = 600, board: Path = GENERIC) -> str:
    """The output of a program."""
    command = [build.native("fledge_leon3", "emulator/tools"), board, program, "--engine", engine, "--for", seconds]
    return subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=300, check=True).stdout


def on_qemu(program: Path) -> str:
    done = subprocess.run(["qemu-system-sparc", "-M", "leon3_generic", "-no-reboot", "-display", "none", "-monitor",
                           "none", "-serial", "stdio", "-kernel", program], capture_output=True, text=True, timeout=300,
                          check=True, stdin=subprocess.DEVNULL)
    return done.stdout


def everywhere(program: Path, engines: Sequence[str] = ENGINES) -> dict[str, str]:
    """Its output on each engine, and on stock QEMU."""
    return {**{engine: on_emulator(program, engine) for engine in engines}, "qemu": on_qemu(program)}


def random_program(seed: int, folder: Path) -> tuple[Path, str] | None:
    """A random program for the board, and its output here; None if it computes for more than five seconds."""
    source = folder / f"random_{seed}.c"
    text = subprocess.run([*CSMITH, "--seed", str(seed)], capture_output=True, text=True, check=True,
                          cwd=folder).stdout      # it writes a file there
    source.write_text(re.sub(r"\b(0x[0-9A-F]+|\d+)(U?)L\b", r"\1\2", text),
                      encoding="utf-8")    # a long has 32 bits there
    flags = ["-w", "-std=gnu99", f"-I{CSMITH_HEADERS}"]
    here = folder / f"random_{seed}"
    subprocess.run(["gcc", *flags, "-O1", source, "-o", here], check=True)
    done = subprocess.run(["sh", "-c", 'ulimit -S -t 5; exec "$0"', here], capture_output=True, text=True)
    if done.returncode == -signal.SIGXCPU:
        return None
    done.check_returncode()
    return board.program(folder / f"board_{seed}", "random", [source], [], [*flags, "-O2"]), done.stdout


def newlib_math(folder: Path) -> Path:
    """The tests of newlib's mathematics and strings, which print each function and each result that is not exact."""
    tests = toolchain.library() / "source/libm/test"
    # Left out: random output, libraries for another machine, and names that newlib has no more.
    left_out = {"dcvt": "", "dvec": "", "convert": "test_cvt", "test_is": "test_is", "test_ieee": "test_ieee"}
    stubs = folder / "stubs.c"
    stubs.write_text("".join(f"void {name}(void);\nvoid {name}(void) {{}}\n" for name in left_out.values() if name),
                     encoding="utf-8")
    return board.program(folder / "newlib", "math", [*(path for path in sorted(tests.glob("*.c"))
                         if path.stem not in left_out), stubs], [tests], ["-w", "-std=gnu99", "-O2", "-g0", "-fcommon"])


def elementary_hashes(folder: Path) -> tuple[Path, str]:
    """The hashes of flight's elementary functions: the program for the board, and its output here."""
    math = build.ROOT / "flight/math"
    sources = [math / "elementary_hash.c", *build.math_sources()]
    here = build.program(folder / "here", "hash", sources, [build.ROOT], link=["-lm"])
    return (board.program(folder / "board", "hash", sources, []),
            subprocess.run([here], capture_output=True, text=True, check=True).stdout)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1, help="of the first program (default: 1)")
    parser.add_argument("--minutes", type=float, default=1.0, help="how long (default: 1)")
    options = parser.parse_args()
    end, seed, compared = time.monotonic() + 60 * options.minutes, options.seed, 0
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory() as folder:
            if result := random_program(seed, Path(folder)):
                program, expected = result
                for where, printed in everywhere(program).items():
                    if printed != expected:
                        print(f"seed {seed}, {where}: {printed.strip()!r} instead of {expected.strip()!r}")
                        return 1
                compared += 1
        seed += 1
    print(f"programs {compared}\nendless {seed - options.seed - compared}\ndifferences 0")
    return 0


if __name__ == "__main__":
    sys.exit(main())
