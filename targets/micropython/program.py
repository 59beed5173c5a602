# SPDX-License-Identifier: Apache-2.0
"""A mission's program under MicroPython, and what its script composes there beside what it composes here."""
from __future__ import annotations

import subprocess
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.errors import Failure
from fledge.export.read import ExportError
from fledge.disk import write_files
from fledge.objects import project
from fledge.targets import build
from fledge.targets.linux import runner_of
from fledge.targets.micropython import toolchain
from fledge.targets.micropython.export import Composed, compose
from fledge.targets.micropython.export.check import first_difference
from fledge.targets.micropython.export.script import placed

if TYPE_CHECKING:
    from fledge.mission.process import Flight
    from fledge.targets.job import Part

# What unpacking a value of the world says there, which is empty, and what it means.
EMPTY = "ValueError: need more than 0 values to unpack"
UNKNOWN = ("this unpacks a value of the world or of another process, which is not known on the target: write numbers "
           "into the script, or take what world.fit_ephemeris() and fit_orientation() give (docs/micropython.md)")
LINK = ["-no-pie", "-Wl,-z,noseparate-code", "-lm"]     # without separate pages for code: 4 KB less


def export(composed: Composed, flight: Flight, folder: Path, development: bool = False) -> Path:
    """Write a mission's C into folder / "c", build its program for this machine, and check that the script composes
    there what it composes here. flight: the desktop's process, which has not run. Returns the program."""
    own = project.folder()
    built = program(composed, folder, [*([own] if own else []), build.ROOT], development)
    check(composed, flight, built)
    return built


def program(composed: Composed, folder: Path, roots: Sequence[Path], development: bool = False) -> Path:
    """Build a mission's program for this machine."""
    library = toolchain.library("host", development)
    runner, defines = runner_of(composed.mission)
    files = [*sources(composed, folder, roots, library), *runner]
    return build.program(folder, composed.mission.name, files, [(folder / "c").resolve(), *roots],
                         library.compiler, [*library.flags, *defines], LINK, archives=[library.archive])


def sources(composed: Composed, folder: Path, roots: Sequence[Path], library: toolchain.Library) -> list[Path]:
    """The sources of a mission, after writing those that are its own."""
    try:
        frozen = toolchain.freeze(composed.scripts.files, library)
    except Failure as failure:
        raise ExportError(placed(str(failure), composed.scripts.files)) from None
    written = write_files({**composed.files, f"{composed.mission.name}_frozen.c": frozen}, folder / "c")
    return [*(path.resolve() for path in written if path.suffix == ".c"),
            *build.module_sources(composed.mission, roots), *build.math_sources(),
            *(build.ROOT / path for path in build.COMMAND)]


def check(composed: Composed, flight: Flight, built: Path) -> None:
    """Raise ExportError if the script of a program for this machine fails, or composes other than the desktop's."""
    done = subprocess.run([built.resolve(), "--describe"], capture_output=True, text=True, errors="replace")
    if done.returncode:
        why = done.stderr.strip().removeprefix(f"{composed.mission.folder}: script: ")
        raise ExportError(placed(why.replace(EMPTY, UNKNOWN), composed.scripts.files)
                          or f"{built} ended with {done.returncode}")
    difference = first_difference(composed.mission, flight, done.stdout.splitlines())
    if difference:
        raise ExportError(f"{composed.mission.title}: under MicroPython it composes something else: {difference}")


def stripped(built: Path) -> int:
    """[bytes] of a program without its symbols."""
    bare = built.with_name(f"{built.name}.stripped")
    subprocess.run(["strip", "-o", bare, built], check=True)
    size = bare.stat().st_size
    bare.unlink()
    return size


@lru_cache(8)
def composed_of(part: Part) -> Composed:
    """A part for MicroPython: what its script composes, and what the scenario changes of it before it runs."""
    return compose(part.job.fresh, part.mission, part.job.own[part.process], part.boards)


def checked(part: Part) -> Path:
    """The program of a part for this machine, whose script composed what the desktop's did."""
    composed = composed_of(part)
    built = program(composed, part.folder / "micropython", part.roots)
    check(composed, part.job.start.process(part.process), built)
    return built
