# SPDX-License-Identifier: Apache-2.0
"""A board with a RISC-V processor of 64 bits, without an operating system: `virt` of QEMU.

    start.S, riscv64.ld     vectors and start; the board's memory
    board.c                 the five functions of targets/bare/port.h, and the devices behind them
    fault.c                 what an exception says

Example:

    $ ./fledge fly nadir_spin --on riscv64 --for 10min
"""
from fledge.targets import build
from fledge.targets.bare import Bare

FOLDER = build.ROOT / "targets/riscv64"


class Riscv64(Bare):
    about = "a board with a RISC-V processor of 64 bits behind a serial line, under QEMU; no operating system"
    profiled_by = "line"
    compiler = "riscv64-unknown-elf-gcc"
    machine = ("-march=rv64gc", "-mabi=lp64d", "-mcmodel=medany")
    scripts = (FOLDER / "riscv64.ld",)
    sources = (*(FOLDER / name for name in ("start.S", "board.c", "fault.c")), build.ROOT / "targets/bare/figures.c")
    link = ("-Wl,--no-warn-rwx-segments",)
    # QEMU keeps the last 16 MiB of the memory for itself.
    emulator = ("qemu-system-riscv64", "-M", "virt", "-m", "32M", "-bios", "none", "-display", "none", "-monitor",
                "none", "-serial", "{line}", "-kernel", "{program}")
    needs = (compiler, emulator[0])
