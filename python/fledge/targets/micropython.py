# SPDX-License-Identifier: Apache-2.0
"""Missions under MicroPython: the Linux target and the LEON3 target, with a mission that its script composes there."""
from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.errors import Failure
from fledge.export.micropython import Composed
from fledge.export.micropython_check import first_difference
from fledge.export.micropython_script import placed
from fledge.export.read import ExportError
from fledge.export.write import write_files
from fledge.objects import project
from fledge.targets import build
from fledge.targets import leon3
from fledge.targets import micropython_toolchain as toolchain
from fledge.targets.target import Linux

if TYPE_CHECKING:
    from fledge.targets.job import Part

LINK = ["-no-pie", "-Wl,-z,noseparate-code", "-lm"]     # without separate pages for code: 4 KB less


def export(composed: Composed, flight: Any, folder: Path, development: bool = False) -> Path:
    """Write a mission's C into folder / "c", build its program for this machine, and check that the script composes
    there what it composes here. flight: the desktop's process, which has not run. Returns the program."""
    own = project.folder()
    built = program(composed, folder, [*([own] if own else []), build.ROOT], development)
    check(composed, flight, built)
    return built


def program(composed: Composed, folder: Path, roots: Sequence[Path], development: bool = False) -> Path:
    """Build a mission's program for this machine."""
    library = toolchain.library("host", development)
    sources = [*_sources(composed, folder, roots, library), *(build.ROOT / path for path in build.RUNNER)]
    return build.program(folder, composed.mission.name, sources, [(folder / "c").resolve(), *roots],
                         library.compiler, library.flags, LINK, archives=[library.archive])


def _sources(composed, folder, roots, library):
    """The sources of a mission, after writing those that are its own."""
    try:
        frozen = toolchain.freeze(composed.scripts.files, library)
    except Failure as failure:
        raise ExportError(placed(str(failure), composed.scripts.files)) from None
    written = write_files({**composed.files, f"{composed.mission.name}_frozen.c": frozen}, folder / "c")
    return [*(path.resolve() for path in written if path.suffix == ".c"),
            *build.module_sources(composed.mission, roots), *build.math_sources(),
            *(build.ROOT / path for path in build.COMMAND)]


def check(composed: Composed, flight: Any, built: Path) -> None:
    """Raise ExportError if the script of a program for this machine fails, or composes other than the desktop's."""
    done = subprocess.run([built.resolve(), "--describe"], capture_output=True, text=True, errors="replace")
    if done.returncode:
        why = done.stderr.strip().removeprefix(f"{composed.mission.folder}: script: ")
        raise ExportError(placed(why, composed.scripts.files) or f"{built} ended with {done.returncode}")
    found = first_difference(composed.mission, flight, done.stdout.splitlines())
    if found:
        raise ExportError(f"{composed.mission.title}: under MicroPython it composes something else: {found}")


def stripped(built: Path) -> int:
    """[bytes] of a program without its symbols."""
    bare = built.with_name(f"{built.name}.stripped")
    subprocess.run(["strip", "-o", bare, built], check=True)
    size = bare.stat().st_size
    bare.unlink()
    return size


class MicroPython(Linux):
    """The Linux target. Its C library is that of the machine, not in the program."""

    name = "micropython"
    about = "MicroPython on this machine, which composes the mission from its script"
    composes = True
    development = False

    def build(self, part: Part) -> Path:
        return checked(part) if not self.development else program(part.composed, part.folder / self.name, part.roots,
                                                                  True)


class MicroPythonDevelopment(MicroPython):
    """The same with the compiler, so that flight evaluates texts."""

    name = "micropython-dev"
    about = "the same with Python's compiler on board, for `fledge console`"
    development = True


def checked(part: Part) -> Path:
    """The program of a part for this machine, whose script composed what the desktop's did."""
    built = program(part.composed, part.folder / MicroPython.name, part.roots)
    check(part.composed, part.job.start.process(part.process), built)
    return built


class Leon3MicroPython(leon3.Leon3):
    """The program of a LEON3 board."""

    name = "leon3-micropython"
    about = "MicroPython on a LEON3 board, emulated; no operating system"
    composes = True

    def build(self, part: Part) -> Path:
        checked(part)       # an error of the script is easier to read here
        library = toolchain.library("leon3")
        folder = part.folder / Leon3MicroPython.name
        sources = [*_sources(part.composed, folder, part.roots, library),
                   *(build.ROOT / path for path in leon3.SHARED), leon3.FOLDER / "main.c", leon3.FOLDER / "recorder.c"]
        return leon3.program(folder, part.mission.name, sources, [(folder / "c").resolve(), *part.roots],
                             library.flags, self.board, [library.archive])


class Leon3MicroPythonQemu(leon3.Leon3Qemu):
    """The same program on stock QEMU."""

    name = "leon3-micropython-qemu"
    about = "the same program on stock QEMU"
    composes = True
    guests = Leon3MicroPython
