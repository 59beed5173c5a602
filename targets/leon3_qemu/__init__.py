# SPDX-License-Identifier: Apache-2.0
"""The program of a LEON3 board on stock QEMU, which knows nothing of the project: qemu.c has the board's end of the
registers.

Example:

    $ ./fledge fly nadir_spin --on leon3-qemu --for 10min
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets import build
from fledge.targets.leon3 import Leon3

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.targets.job import Part


class Leon3Qemu(Leon3):
    about = "the same program on stock QEMU"
    cpu_of = "emulated"
    profiled_by = ""
    takes_tools = False
    addr2line = ""      # what is built is the board's end
    uses = ("leon3",)
    needs = ("qemu-system-sparc", "gcc")
    guests: type[Leon3] = Leon3     # the target whose program it is

    def build(self, part: Part) -> Path:
        self.guests().build(part)
        sources = [*part.table_sources(), *(build.ROOT / path for path in (
            "targets/leon3_qemu/qemu.c", "targets/mission_io.c", "registers/clock.c", "registers/message.c",
            "registers/shared_file.c"))]
        return build.program(part.folder / self.name, part.mission.name, sources, part.includes())

    def command(self, built: Path, record: str) -> list[str]:
        from fledge.targets.leon3.board import read_board

        return [str(built.resolve()), str(self.guest(built).resolve()), str(read_board(self.board)["ram"]["size"]),
                record, "{registers}"]

    def sizes(self, built: Path) -> tuple[int, int]:
        return super().sizes(self.guest(built))

    def guest(self, built: Path) -> Path:
        """The program of the board."""
        return built.parent.parent / self.guests.name / built.name
