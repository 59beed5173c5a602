# SPDX-License-Identifier: Apache-2.0
"""MicroPython: the mission's script composes the mission where it flies, and C runs it.

    export/       reads the script, writes the tables that it needs, and compares what it composes: `fledge export
                  micropython`
    toolchain.py  the interpreter, which is built once, and its cross-compiler
    program.py    a mission's program
    *.c           the executive, which runs what the script composed; the script's objects; the binding (tables.h)
    console.py    a program that flies by this machine's clock and takes commands: `fledge console`
    procedures.py sends a file to flight, which runs it as a procedure

Example:

    $ ./fledge fly nadir_spin --on micropython --for 10min
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets.linux import Linux

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.targets.job import Part


class MicroPython(Linux):
    """The Linux target. Its C library is that of the machine, not in the program."""

    about = "MicroPython on this machine, which composes the mission from its script"

    def prepare(self) -> None:
        from fledge.targets.micropython import toolchain

        toolchain.cross_compiler()
        toolchain.library()

    def check(self, part: Part) -> None:
        from fledge.targets.micropython import program

        program.composed_of(part)

    def build(self, part: Part) -> Path:
        from fledge.targets.micropython import program

        return program.checked(part)
