# SPDX-License-Identifier: Apache-2.0
"""A board with a Cortex-M7 and its unit for double precision, without an operating system: ARM's MPS2, under QEMU.

    cortex_m7.ld        its memory; sections.ld: what lies where in it
    start.c, board.c    vectors and start; the five functions of targets/bare/port.h
    fault.c             what an exception says

Example:

    $ ./fledge fly nadir_spin --on cortex-m7 --for 10min
"""
from fledge.targets import build
from fledge.targets.bare import Bare

FOLDER = build.ROOT / "targets/cortex_m7"


class CortexM7(Bare):
    about = "a board with a Cortex-M7 behind a serial line, under QEMU; no operating system"
    profiled_by = "line"
    compiler = "arm-none-eabi-gcc"
    # Enumerations are of 32 bits, as on all other targets, not of as few bytes as hold them.
    machine = ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16", "-fno-short-enums")
    link = ("-Wl,--no-enum-size-warning",)
    scripts = (FOLDER / "cortex_m7.ld", FOLDER / "sections.ld")
    sources = (*(FOLDER / name for name in ("start.c", "board.c", "fault.c")), build.ROOT / "targets/bare/figures.c")
    emulator = ("qemu-system-arm", "-M", "mps2-an500", "-display", "none", "-monitor", "none", "-serial", "{line}",
                "-kernel", "{program}")
    needs = (compiler, emulator[0])
