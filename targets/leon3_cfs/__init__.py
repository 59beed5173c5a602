# SPDX-License-Identifier: Apache-2.0
"""The app of the core Flight System on a LEON3 board, with the pocket cFE.

    app.py        the app, its tables and its files as one program, with tasks and files of targets/bare
    cfs.c         its registers and its record, and the main program

Example:

    $ ./fledge fly nadir_spin --on leon3-cfs --for 10min
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets.leon3 import Leon3

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.targets.job import Part


class Leon3Cfs(Leon3):
    about = "an app of the core Flight System on the board, on the pocket cFE"
    cpu_of = "simulated, record too"
    profiled_by = ""
    uses = ("leon3", "cfs")

    def build(self, part: Part) -> Path:
        from fledge.targets.leon3_cfs import app

        return app.program(part, part.folder / self.name, self.board)
