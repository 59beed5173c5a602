# SPDX-License-Identifier: Apache-2.0
"""A mission as an app of NASA's core Flight Executive, with OSAL's port to RTEMS, in a copy of a tree: one program of
app, core and RTEMS."""
from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import tarfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.errors import Failure
from fledge.disk import ROOT, write_files
from fledge.targets.cfs.export import around
from fledge.targets.cfs.export.sources import renamed
from fledge.targets.cfs.pocket import write_app
from fledge.targets.cfs.real import RealCfs
from fledge.targets.leon3_cfs.app import APP, LEFT_OUT
from fledge.targets.leon3_rtems import Leon3Rtems

if TYPE_CHECKING:
    from fledge.targets.job import Part

HERE = Path(__file__).resolve().parent
OWN = ["targets/bare/say.c", "targets/bare/recorder.c", "targets/leon3/devices.c", "targets/leon3/flight.c",
       "targets/leon3_rtems/board.c", "targets/leon3_rtems/cfe.c"]
HEADERS = ["targets/bare/bare.h", "targets/bare/context.h", "targets/bare/recorder.h", "targets/leon3/leon3.h",
           "targets/leon3_rtems/board.h", "targets/cfs/watch.h", "registers/plug_and_play.h"]
DEFINITIONS = "leon3_defs"
SYSTEM = f"""\
SET(MISSION_NAME "Fledge")
SET(SPACECRAFT_ID 0x42)
SET(MISSION_CPUNAMES cpu1)
SET(cpu1_PROCESSORID 1)
SET(cpu1_SYSTEM leon3)
SET(cpu1_STATIC_APPLIST {APP.name})
SET(cpu1_STATIC_SYMLIST {APP.prefix}_AppMain,{APP.prefix})
"""
OSAL = """\
set(OSAL_CONFIG_INCLUDE_NETWORK FALSE)
set(OSAL_CONFIG_INCLUDE_DYNAMIC_LOADER FALSE)
set(OSAL_CONFIG_INCLUDE_STATIC_LOADER TRUE)
set(OSAL_CONFIG_QUEUE_MAX_DEPTH 256)
"""
FILES = """\
        .section .rodata
        .global _binary_tarfile_start, _binary_tarfile_size
_binary_tarfile_start:
        .incbin "files.tar"
        .set _binary_tarfile_size, . - _binary_tarfile_start
"""


class RtemsCfs(Leon3Rtems):
    """In a tree of cFS 7."""

    def __init__(self, tree: Path | str, tools: Sequence[str] = ()) -> None:
        super().__init__(tools)
        self.real = RealCfs(tree)

    def build(self, part: Part) -> Path:
        copy, folder = self.real.copied((part.folder / "cfs_rtems").resolve()), part.folder / self.name
        if not (copy / "osal/src/bsp/generic-rtems/config").is_dir():
            raise Failure(f"--cfs {self.real.tree}: its OSAL has no port to RTEMS 6; use cFS 7")
        app, definitions = write_app(APP, part, folder), copy / DEFINITIONS
        self.put(app, copy / "apps" / APP.name)
        shutil.copytree(copy / "cfe/cmake/sample_defs", definitions, dirs_exist_ok=True)
        prefix, (tools, abi) = self.prefix(), self.make(HERE, "facts").splitlines()
        text = (HERE / "toolchain.cmake.in").read_text(encoding="utf-8")
        for key, value in (("prefix", prefix), ("tools", tools), ("abi", abi)):
            text = text.replace(f"@{key}@", str(value))
        files = {file.name: file.read_bytes() for file in sorted((app / "cf").iterdir())}
        write_files({"targets.cmake": SYSTEM, "default_osconfig.cmake": OSAL, "toolchain-leon3.cmake": text,
                     "files.S": FILES,
                     "files.tar": packed(files | {"cfe_es_startup.scr": around.startup(APP).encode() + b"!\n"}),
                     **{name: (HERE / name).read_bytes() for name in ("bsp_rtems_cfg.h", "link.cmake")}}, definitions)
        run([f"{tools}gcc", *abi.split(), "-c", "files.S", "-o", "files.o"], definitions)
        for goal in ("prep", "install"):
            run(["make", goal, "-f", "cfe/cmake/Makefile.sample", "O=build-leon3", "MISSIONCONFIG=leon3",
                 "BUILDTYPE=release"], copy)
        built = folder / part.mission.name
        shutil.copyfile(copy / "build-leon3/exe/cpu1/core-cpu1.exe", built)
        return built

    def put(self, app: Path, to: Path) -> None:
        """The app with the board in place of files and a host."""
        shutil.rmtree(to, ignore_errors=True)
        shutil.copytree(app, to)
        listed = (to / "CMakeLists.txt").read_text(encoding="utf-8")
        for name in LEFT_OUT:
            listed = re.sub(rf"\s+fsw/src/(\S+/)?{re.escape(name)}", "", listed)
        listed = listed.replace(f" fsw/src/{APP.name}_app.c", "".join(f" fsw/src/{name}\n   " for name in OWN)
                                + f" fsw/src/{APP.name}_app.c")
        texts = {name: (ROOT / name).read_text(encoding="utf-8") for name in (*OWN, *HEADERS)}
        write_files({"CMakeLists.txt": listed, **{f"fsw/src/{name}": renamed(APP, text) if name.endswith(".c") else text
                                                  for name, text in texts.items()}}, to)


def packed(files: Mapping[str, bytes]) -> bytes:
    """An archive of files for /cf."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name, content in files.items():
            info = tarfile.TarInfo(f"mnt/eeprom/{name}")
            info.size, info.mode = len(content), 0o644
            archive.addfile(info, io.BytesIO(content))
    return out.getvalue()


def run(words: Sequence[str], folder: Path) -> None:
    done = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          errors="replace", env=dict(os.environ, MAKEFLAGS=f"-j{os.cpu_count()}"))
    if done.returncode:
        raise Failure(f"{folder}: {' '.join(words[:3])} ... failed:\n" + "\n".join(done.stdout.splitlines()[-30:]), 1)
