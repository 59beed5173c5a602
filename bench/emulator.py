# SPDX-License-Identifier: Apache-2.0
"""How fast the emulated LEON3 executes instructions, beside stock QEMU in the same run.

The engines of the emulator and QEMU take turns with the same program, whose code and data share no page, but for
`stores_beside_code`: it does what `stores` does, on the page of its code. CPU time counts. The emulator counts the
instructions. All must print the same checksum.
"""
from __future__ import annotations

import resource
import subprocess
from pathlib import Path
from typing import NamedTuple

from fledge.errors import Failure
from fledge.disk import build_folder
from fledge.targets import build
from fledge.targets.leon3 import board

from bench.rows import Rows, in_turn, options, pair_by_pair, report

NEEDS = ["leon3-qemu"]
GUEST = build.ROOT / "bench/guest"
BOARD = build.ROOT / "emulator/boards/leon3_generic.toml"
MODULES = ["actuation/wheel_torques", "control/mrp_feedback", "guidance/euler_rotation", "guidance/hill_pointing",
           "guidance/tracking_error", "vehicle/vehicle_config", "vehicle/wheel_config"]


class Program(NamedTuple):
    rounds: int             # of the work: stock QEMU needs a second or two
    sources: list[Path]
    flags: list[str]


PROGRAMS = {
    "kinematics": Program(60, [], ["-O2"]),
    "covariance": Program(80, [], ["-O2"]),
    "flight_loop": Program(50, [*(build.ROOT / f"flight/{name}.c" for name in MODULES), *build.math_sources()], []),
    "integers": Program(90, [], ["-O2"]),
    "stores": Program(10, [], ["-O2"]),
    "stores_beside_code": Program(10, [], ["-O2"]),
}
ENGINES = ["interpreter", "threaded", "translator"]
SHORT = 30      # the interpreter has a part of the work


def built(name: str, rounds: int) -> Path:
    program = PROGRAMS[name]
    return board.program(build_folder() / f"bench_emulator/{name}_{rounds}", name,
                         [GUEST / "main.c", GUEST / f"{name}.c", *program.sources], [],
                         [f"-DROUNDS={rounds}", *program.flags])


class Sample(NamedTuple):
    seconds: float
    instructions: int
    checksum: str


def real_board() -> Path:
    """QEMU's board, with the times of a LEON3 and its GRFPU."""
    text = BOARD.read_text(encoding="utf-8").replace('"plain"', '"leon3"').replace('"qemu"', '"grfpu"')
    path = build_folder() / "bench_emulator/leon3_grfpu.toml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def emulated(engine: str, elf: Path, board: Path = BOARD) -> Sample:
    command = [build_folder() / "python/fledge_bench_emulated", engine, board, elf]
    lines = dict(line.split() for line in subprocess.run(command, check=True, capture_output=True,
                                                         text=True).stdout.splitlines())
    return Sample(float(lines["seconds"]), int(lines["instructions"]), lines["checksum"])


def in_qemu(elf: Path) -> Sample:
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    output = subprocess.run(["qemu-system-sparc", "-M", "leon3_generic", "-nographic", "-no-reboot", "-kernel", elf],
                            stdin=subprocess.DEVNULL, check=True, capture_output=True, text=True).stdout
    return Sample(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before, 0, output.split()[1])


def agree(samples: list[Sample], of: str) -> None:
    sums = {sample.checksum for sample in samples}
    if len(sums) != 1:
        raise Failure(f"{of}: the checksums differ, {', '.join(sorted(sums))}")


def measure(name: str, runs: int, rows: Rows) -> None:
    rounds = PROGRAMS[name].rounds
    elf, short = built(name, rounds), built(name, max(1, rounds // SHORT))
    grfpu = real_board()
    samples = in_turn({
        "QEMU": lambda: in_qemu(elf),
        "interpreter": lambda: emulated("interpreter", short),
        "threaded": lambda: emulated("threaded", elf),
        "translator": lambda: emulated("translator", elf),
        "GRFPU": lambda: emulated("translator", elf, grfpu),
    }, runs)
    agree([sample for case, several in samples.items() for sample in several if case != "interpreter"], name)
    agree([*samples["interpreter"], emulated("translator", short)], f"{name}, short")
    count = samples["translator"][0].instructions
    mips = {case: [1e-6 * (count if case == "QEMU" else sample.instructions) / sample.seconds for sample in several]
            for case, several in samples.items()}
    rows.add(f"{name} QEMU", "speed", mips["QEMU"], "MIPS", note=f"{count / 1e6:.0f} million instructions")
    for engine in ENGINES:
        rows.add(f"{name} {engine}", "speed", mips[engine], "MIPS", f"{name} QEMU",
                 note=pair_by_pair(mips[engine], mips["QEMU"]))
    rows.add(f"{name} GRFPU", "speed", mips["GRFPU"], "MIPS", f"{name} QEMU",
             note=f"{pair_by_pair(mips['GRFPU'], mips['QEMU'])}; translator, LEON3's times, GRFPU")


def main(arguments: list[str]) -> None:
    chosen = options("emulator", arguments, runs=5, cases=list(PROGRAMS))
    rows = Rows()
    for name in chosen.cases or PROGRAMS:
        measure(name, chosen.runs, rows)
    report(rows, chosen)
