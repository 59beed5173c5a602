#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The elementary functions give the same bits on another compiler or machine.

    cross_hash_test.py TARGET       one of those below

Builds elementary_hash.c for TARGET, runs it (under QEMU's user mode where it must be), and compares
its hashes with those of a native gcc -O0 build. Exits with 0 if they agree, 1 if not, and 77, which
CTest shows as skipped, if a tool is not installed.

The target fused is a check of the check: with multiplications and additions fused, as the flag
-ffp-contract=off forbids, the hashes have to differ.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCES = [HERE / name for name in
           ("elementary_hash.c", "reduction.c", "trig.c", "inverse_trig.c", "exp_log.c")]
OPTIONS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wstrict-prototypes",
           "-Werror", "-ffp-contract=off", "-fno-math-errno", "-I", HERE.parents[1]]
SKIPPED = 77

AARCH64 = ["aarch64-linux-gnu-gcc", "-O3", "-static"]

# LEON3 code. Debian has no C library for 32-bit SPARC, so the program brings its own start.
SPARC_V8 = ["sparc64-linux-gnu-gcc", "-O3", "-m32", "-mcpu=leon3", "-mno-v8plus", "-mhard-float",
            "-mlong-double-64", "-fno-pic", "-fno-pie", "-no-pie", "-fno-stack-protector",
            "-nostdlib", "-static", "-DFREESTANDING"]

# Target: how to compile, and how to run.
TARGETS = {
    "gcc_O3": (["gcc", "-O3"], []),
    "clang_O2": (["clang", "-O2"], []),
    "aarch64": (AARCH64, ["qemu-aarch64"]),
    "aarch64_clang": (["clang", "-O3", "--target=aarch64-linux-gnu", "-static"],
                      ["qemu-aarch64"]),
    "sparc_v8": (SPARC_V8, ["qemu-sparc"]),
    "fused": (AARCH64 + ["-ffp-contract=fast"], ["qemu-aarch64"]),
}


def hashes(compiler, emulator, folder):
    """Lines "function hash" from a build with the compiler, run by the emulator, if any."""
    missing = ["qemu-user" if tool in emulator else f"gcc-{tool[:-4]}" if "-gcc" in tool else tool
               for tool in (compiler[0], *emulator[:1]) if not shutil.which(tool)]
    if missing:
        print(f"not installed: {', '.join(missing)}", file=sys.stderr)
        sys.exit(SKIPPED)
    program = folder / "elementary_hash"
    # The headers of glibc's 64-bit SPARC package ask for this empty file when compiled for 32 bits.
    (folder / "gnu").mkdir(exist_ok=True)
    (folder / "gnu" / "stubs-32.h").touch()
    libraries = [] if "-nostdlib" in compiler else ["-lm"]
    contract = [option for option in compiler if option.startswith("-ffp-contract")]
    subprocess.run([*compiler, *OPTIONS, *contract, "-isystem", folder, *SOURCES, "-o", program,
                    *libraries], check=True)
    output = subprocess.run([*emulator, program], check=True, stdout=subprocess.PIPE, text=True)
    return output.stdout.splitlines()


def main(arguments):
    if len(arguments) != 1 or arguments[0] not in TARGETS:
        print(__doc__, "Targets:", " ".join(TARGETS), file=sys.stderr)
        return 2
    target = arguments[0]
    with tempfile.TemporaryDirectory() as folder:
        found = hashes(*TARGETS[target], Path(folder))
        wanted = hashes(["gcc", "-O0"], [], Path(folder))
    if len(wanted) != len(found) or len(wanted) < 10:
        print(f"FAILED: {len(wanted)} hashes from the native program, {len(found)} from {target}")
        return 1
    same = [a == b for a, b in zip(wanted, found)]
    for line, other, equal in zip(wanted, found, same):
        print(f"{line}  {other.split()[1]}  {'same' if equal else 'DIFFERENT'}")
    return int(all(same)) if target == "fused" else int(not all(same))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
