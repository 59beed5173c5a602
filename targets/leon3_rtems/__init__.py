# SPDX-License-Identifier: Apache-2.0
"""A mission as an application of RTEMS on a LEON3 board; the user names the installed RTEMS.

    board.c    the board under RTEMS
    rtems.c    a thread for each task of flight
    export.py  writes the application's folder: `fledge export rtems`
    Makefile   is in each such folder; it looks for RTEMS, too
    real.py    an app of NASA's core Flight Executive in place of that, from a tree; with cfe.c and the files beside it

Example:

    $ ./fledge fly nadir_spin --on leon3-rtems --rtems /opt/rtems --for 10min
"""
from __future__ import annotations

import os
from pathlib import Path

from fledge.targets.leon3 import Leon3

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.targets.job import Part

NAMED_BY = "FLEDGE_RTEMS"       # the environment has the folder of RTEMS; --rtems sets it


class Leon3Rtems(Leon3):
    about = "an application of RTEMS 6 on the board, with the RTEMS of --rtems DIR"
    cpu_of = "simulated, RTEMS too"
    profiled_by = ""
    uses = ()
    needs = ("make",)

    def missing(self) -> list[str]:
        return super().missing() + ([] if os.environ.get(NAMED_BY) else [
            f"RTEMS 6 with the BSP leon3 (--rtems DIR, or {NAMED_BY}, is its folder)"])

    def prepare(self) -> None:
        self.make(Path(__file__).parent, "check")

    def prefix(self) -> Path:
        """The folder of RTEMS."""
        return Path(os.environ[NAMED_BY]).resolve()

    def make(self, folder: Path, goal: str) -> str:
        """What `make` prints."""
        import subprocess

        from fledge.errors import Failure

        done = subprocess.run(["make", "--no-print-directory", "-sC", folder, "-j", str(os.cpu_count()), goal,
                               f"RTEMS={self.prefix()}"], capture_output=True, text=True, errors="replace")
        if done.returncode:
            error = done.stderr.strip()
            raise Failure(error.partition("*** ")[2].removesuffix(".  Stop.") if goal == "check" else
                          f"{folder} cannot be built:\n{error}", 1)
        return done.stdout.strip()

    def build(self, part: Part) -> Path:
        from fledge.targets.leon3_rtems import export

        folder = part.folder / self.name
        files = {*export.write(part.mission, folder, part.boards, (), part.roots[:-1])}
        for old in {*folder.glob("src/**/*.[ch]")} - files:
            old.unlink()                # of an earlier export
        self.make(folder, "all")
        return folder / part.mission.name

    def sizes(self, built: Path) -> tuple[int, int]:
        """RTEMS included."""
        import subprocess

        tools = self.make(Path(__file__).parent, "facts").splitlines()[0]
        done = subprocess.run([f"{tools}size", built], capture_output=True, text=True, check=True)
        text, data, bss = map(int, done.stdout.splitlines()[1].split()[:3])
        return text, data + bss
