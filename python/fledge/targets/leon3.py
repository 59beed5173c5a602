# SPDX-License-Identifier: Apache-2.0
"""A mission on a LEON3 board: on the project's emulator, on stock QEMU, and as an app of the pocket cFE."""
from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.targets import build
from fledge.targets import leon3_toolchain as toolchain
from fledge.targets.target import Target

if TYPE_CHECKING:
    from fledge.targets.job import Part

FOLDER = build.ROOT / "targets/leon3"
BOARD = build.ROOT / "emulator/boards/leon3.toml"
SUPPORT = [*(FOLDER / name for name in ("traps.S", "board.c", "runtime.c", "system.c"))]
SHARED = ["targets/mission_io.c", "targets/mission_packets.c", "targets/mission_host.c", "record/mcap.c",
          "record/mcap_crc.c", "registers/lane.c", "registers/field.c", "registers/clock.c", "registers/message.c"]


def program(folder: Path, name: str, sources: list[Path], includes: list[Path]) -> Path:
    """Build a program for a LEON3 board, with its board support."""
    return build.program(folder, name, [*SUPPORT, *sources], [*includes, build.ROOT], toolchain.COMPILER,
                         toolchain.headers(), toolchain.link(FOLDER / "leon3.ld", LEON3_RAM=0x40000000,
                                                             LEON3_RAM_SIZE=0x800000, LEON3_CLOCK=80_000_000),
                         machine=toolchain.MACHINE)


class Leon3(Target):
    """The program of targets/leon3 on the project's emulator."""

    name = "leon3"
    about = "a LEON3 board, emulated; no operating system"
    emulated = True
    needs: tuple[str, ...] = (toolchain.COMPILER,)

    def build(self, part: Part) -> Path:
        return program(part.folder / "leon3", part.mission.name,
                       [*part.sources(), *(build.ROOT / path for path in SHARED), FOLDER / "main.c"], part.includes())

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built, toolchain.SIZE)
