# SPDX-License-Identifier: Apache-2.0
"""A LEON3 board without an operating system, on the project's emulator.

    board.py      programs for a board; traps.S, devices.c, board.c, runtime.c, system.c: its support;
                  flight.c: its registers and record, for targets/bare/main.c
    toolchain.py  Debian's SPARC compiler, and newlib, the C library, which is built once

Example:

    $ ./fledge fly nadir_spin --on leon3 --for 10min
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets import build
from fledge.targets.target import Target

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Sequence

    from fledge.targets.job import Part


class Leon3(Target):
    """On the project's emulator."""

    about = "a LEON3 board, emulated; no operating system"
    cpu_of = "simulated"
    profiled_by = "board"
    takes_tools = True
    needs: tuple[str, ...] = ("sparc64-linux-gnu-gcc",)
    parts = ("loop", "fledge_leon3")
    addr2line = "sparc64-linux-gnu-addr2line"
    board = build.ROOT / "emulator/boards/leon3.toml"

    def __init__(self, tools: Sequence[str] = ()) -> None:
        self.tools = tools      # further arguments of fledge_leon3

    def prepare(self) -> None:
        from fledge.targets.leon3 import toolchain

        toolchain.library()

    def build(self, part: Part) -> Path:
        from fledge.targets.leon3 import board

        return board.program(part.folder / self.name, part.mission.name, [*part.sources(), *board.FLIGHT],
                             part.includes(), board=self.board)

    def command(self, built: Path, record: str) -> list[str]:
        tables = built.parent.parent / f"tables/{built.name}.so"
        # What a debugger, a trace or a profile has seen is in no snapshot.
        tools = self.tools or ["--snapshots", "{snapshots}"]
        return [str(build.native("fledge_leon3", "emulator/tools")), str(self.board), str(built.resolve()), "--tables",
                str(tables.resolve()), "--registers", "{registers}", "--record", record, *tools]

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built, "sparc64-linux-gnu-size")
