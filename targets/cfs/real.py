# SPDX-License-Identifier: Apache-2.0
"""A mission as an app in a tree of the core Flight System, which is copied, and which its own make builds."""
from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.errors import Failure
from fledge.disk import write_files
from fledge.targets.cfs import Cfs
from fledge.targets.cfs.export import around
from fledge.targets.cfs.pocket import APP, write_app

if TYPE_CHECKING:
    from fledge.targets.job import Part

QUEUES = "/proc/sys/fs/mqueue/msg_max"


class RealCfs(Cfs):
    """In a tree of Caelum, Draco or 7.x."""

    needs = ("make", "cmake", "gcc")

    def __init__(self, tree: Path | str) -> None:
        if self.missing():
            raise Failure(f"--cfs: a cFS tree is built with {' and '.join(self.missing())}, not installed here")
        self.tree = Path(tree).resolve()
        missing = [name for name in ("cfe", "osal", "psp") if not (self.tree / name).is_dir()]
        if missing:
            raise Failure(f"--cfs {tree}: this is no cFS tree, for it has no {', '.join(missing)}; give the folder "
                          "that cfe, osal and psp are in, with all its submodules")

    def build(self, part: Part) -> Path:
        copy = self.copied((part.folder / "cfs_tree").resolve())
        definitions = defined(copy)
        app = write_app(APP, part, part.folder / self.name)
        shutil.rmtree(copy / "apps" / APP.name, ignore_errors=True)
        shutil.copytree(app, copy / "apps" / APP.name)
        targets = definitions / "targets.cmake"
        text = targets.read_text(encoding="utf-8")
        if around.targets(APP) not in text:
            targets.write_text(text.rstrip("\n") + "\n" + around.targets(APP), encoding="utf-8")
        for script in sorted([*definitions.glob("*cfe_es_startup.scr"), *definitions.glob("generate_startup.cmake")]):
            script.write_text(started(script.read_text(encoding="utf-8")), encoding="utf-8")
        make = ["make", "-C", copy, "SIMULATION=native", f"MISSIONCONFIG={definitions.name.removesuffix('_defs')}"]
        # gcc 12 finds a copy onto itself in Caelum's OSAL, which calls any warning an error.
        environment = {**os.environ, "CFLAGS": f"{os.environ.get('CFLAGS', '')} -Wno-error=restrict".strip()}
        for goal in goals(copy):
            done = subprocess.run([*map(str, make), goal], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                  errors="replace", env=environment)
            if done.returncode:
                raise Failure(f"{copy}: make {goal} failed:\n" + "\n".join(done.stdout.splitlines()[-30:]), 1)
        programs = sorted(copy.glob("build*/exe/cpu1/core-cpu1"))
        if not programs:
            raise Failure(f"{copy}: make install left no exe/cpu1/core-cpu1", 1)
        return programs[0]

    def copied(self, copy: Path) -> Path:
        """The tree's copy; what an earlier flight built in it stays, unless it was of another tree."""
        origin = copy.with_name(copy.name + ".from")
        if copy.is_dir() and not (origin.is_file() and origin.read_text(encoding="utf-8") == str(self.tree)):
            shutil.rmtree(copy)
        shutil.copytree(self.tree, copy, ignore=shutil.ignore_patterns(".git", "build", "build-*"), dirs_exist_ok=True,
                        symlinks=True)
        write_files({origin.name: str(self.tree)}, origin.parent)
        return copy

    def advice(self, log: str, part: Part) -> str:
        if "msg_max" not in log:
            return ""
        return (f"cFE could not make a queue of messages: {QUEUES} says how deep one may be, and its pipes are up to "
                f"40 deep; as root: echo 64 > {QUEUES}")     # OSAL's advice, above many other lines

    def command(self, built: Path, record: str) -> list[str]:
        folder = next(path for path in built.parents if path.name == "cfs_tree").parent   # the job's
        return ["env", "-C", str(built.parent), "FSW_REGISTERS={registers}", "FLEDGE_END=1",
                f"FLEDGE_RECORD={folder / record}", f"./{built.name}"]

    def sizes(self, built: Path) -> tuple[int, int]:
        done = subprocess.run(["size", built], capture_output=True, text=True, check=True)
        text, data, bss = map(int, done.stdout.splitlines()[1].split()[:3])
        return text, data + bss


def defined(tree: Path) -> Path:
    """The folder of a tree's definitions; a fresh clone has them as a sample only, as its README says."""
    folders = sorted(path.parent for path in tree.glob("*_defs/targets.cmake"))
    if not folders and (tree / "cfe/cmake/sample_defs").is_dir():
        shutil.copytree(tree / "cfe/cmake/sample_defs", tree / "sample_defs")
        if not (tree / "Makefile").is_file():
            shutil.copy(tree / "cfe/cmake/Makefile.sample", tree / "Makefile")
        folders = [tree / "sample_defs"]
    if not folders:
        raise Failure(f"{tree} has no definitions, such as sample_defs/targets.cmake")
    return next((path for path in folders if path.name == "sample_defs"), folders[0])


def goals(tree: Path) -> tuple[str, str]:
    """The goals of make that build for this machine. A bundle of 7.x has goals for each of its configurations."""
    configurations = tree / "target-configs.mk"
    if not configurations.is_file():
        return "prep", "install"
    names = re.findall(r"^ARCH_(\w+)\s*:?=\s*native\s*$", configurations.read_text(encoding="utf-8"), re.MULTILINE)
    if not names:
        raise Failure(f"{configurations} has no configuration for this machine (ARCH_... = native)")
    name = next((name for name in names if name.endswith("_std")), names[0])
    return f"{name}.prep", f"{name}.install"


def started(script: str) -> str:
    """A start-up script with the app in it, before the end of what counts; or the CMake that writes a script."""
    line = around.startup(APP)
    if line.strip() in script:
        return script
    ends = "endfunction" if "file (WRITE" in script else "!"
    if ends == "endfunction":
        line = f'    file (APPEND ${{STARTUP_FILE}} "{line.strip()}\\n")\n'
    end = re.search(f"^{ends}", script, re.MULTILINE)
    at = end.start() if end else len(script)
    return script[:at] + line + script[at:]
