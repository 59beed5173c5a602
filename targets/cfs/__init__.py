# SPDX-License-Identifier: Apache-2.0
"""A mission as an app of the core Flight System: on the pocket cFE, or in a real tree.

    export/       writes the app's folder: `fledge export cfs`
    pocket.py     the app as it flies here, with a record after each tick (watch.c), and with the pocket cFE
    *.c, inc/     the pocket cFE (README.md)
    real.py       the app in a copy of a real tree

Example:

    $ ./fledge fly nadir_spin --on cfs --for 10min
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets import build
from fledge.targets.target import Target

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.targets.job import Part


class Cfs(Target):
    """On the pocket cFE, in a process of its own."""

    about = "an app of the core Flight System, on the pocket cFE or (--cfs DIR) in a real tree"
    cpu_of = "core and record too"
    needs: tuple[str, ...] = ("gcc",)
    frames = False

    def build(self, part: Part) -> Path:
        from fledge.targets.cfs import pocket

        return pocket.core(part, part.folder / self.name)

    def command(self, built: Path, record: str) -> list[str]:
        return ["env", "FSW_REGISTERS={registers}", f"FLEDGE_RECORD={record}", str(built.resolve()), "--root",
                str(built.resolve().parent), "--quiet"]

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built)
