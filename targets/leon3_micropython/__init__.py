# SPDX-License-Identifier: Apache-2.0
"""MicroPython on a LEON3 board.

Example:

    $ ./fledge fly nadir_spin --on leon3-micropython --for 10min
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets.leon3 import Leon3

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.targets.job import Part


class Leon3MicroPython(Leon3):
    about = "MicroPython on a LEON3 board, emulated; no operating system"
    uses = ("leon3", "micropython")

    def prepare(self) -> None:
        from fledge.targets.micropython import toolchain

        toolchain.library("leon3")

    def build(self, part: Part) -> Path:
        from fledge.targets.leon3 import board
        from fledge.targets.micropython import program, toolchain

        program.checked(part)       # an error of the script is easier to read here
        library = toolchain.library("leon3")
        folder = part.folder / self.name
        sources = [*program.sources(program.composed_of(part), folder, part.roots, library), *board.FLIGHT]
        return board.program(folder, part.mission.name, sources, [(folder / "c").resolve(), *part.roots],
                             library.flags, self.board, [library.archive])
