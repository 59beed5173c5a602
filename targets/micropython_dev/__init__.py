# SPDX-License-Identifier: Apache-2.0
"""MicroPython on this machine with the compiler of Python, so that flight evaluates texts: `fledge console`.

Example:

    $ ./fledge console nadir_spin
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets.micropython import MicroPython

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.targets.job import Part


class MicroPythonDevelopment(MicroPython):
    about = "the same with Python's compiler on board, for `fledge console`"
    uses = ("micropython",)

    def prepare(self) -> None:
        from fledge.targets.micropython import toolchain

        toolchain.library(development=True)

    def build(self, part: Part) -> Path:
        from fledge.targets.micropython import program

        return program.program(program.composed_of(part), part.folder / self.name, part.roots, True)
