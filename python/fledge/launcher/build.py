# SPDX-License-Identifier: Apache-2.0
"""Builds what has changed: parts of Fledge, the project, and the 3-D view."""
from __future__ import annotations

import os
import re
import shutil
import sys
import time
import zlib
from collections.abc import Sequence
from pathlib import Path

from fledge.contents import by_contents, changed
from fledge.errors import Failure
from fledge.disk import ROOT, may_write
from fledge.folders import not_for_cmake
from fledge.launcher.context import Context, same
from fledge.launcher.packages import need
from fledge.launcher.tools import alone, failure, pass_on, run, say


class Build:
    """A tree of sources, and the folder where CMake and Ninja build it. fledge: where its cache must have found Fledge,
    of a project."""

    def __init__(self, tree: Path, folder: Path, arguments: Sequence[str], fledge: Path | None = None) -> None:
        self.tree = tree
        self.folder = folder
        self.arguments = arguments      # of CMake
        self.fledge = fledge
        self.of = f" {tree}" if fledge else ""

    def cached(self, name: str) -> str:
        """A variable in CMake's cache, or ""."""
        try:
            text = (self.folder / "CMakeCache.txt").read_text(encoding="utf-8", errors="replace")
        except OSError:
            return ""
        match = re.search(f"^{name}:[A-Z]*=(.*)$", text, re.M)
        return match[1] if match else ""

    def is_configured_here(self) -> bool:
        """Whether the folder belongs to this place of the tree, and of Fledge: a copied or moved one holds the paths of
        another place, and Ninja would build that."""
        return same(self.cached("CMAKE_HOME_DIRECTORY"), self.tree) and (
            self.fledge is None or same(self.cached("Fledge_DIR"), self.fledge))

    def is_built(self, targets: Sequence[str]) -> bool:
        """Whether nothing needs to be built."""
        import subprocess

        return self.is_configured_here() and not changed(self.folder) and "ninja: no work to do" in subprocess.run(
            ["ninja", "-C", self.folder, "-n", *targets], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            text=True).stdout

    def _has_its_tests(self) -> bool:
        """Whether the tests of a project are there, or not, as they were when it was configured."""
        try:
            lines = (self.folder / "fledge-tests.txt").read_text(encoding="utf-8").splitlines()
        except OSError:
            return True
        return all((self.tree / line[2:]).exists() == (line[0] == "+") for line in lines)

    def make(self, context: Context, targets: Sequence[str], tests: bool) -> None:
        """Configure the tree if it is not configured here, or if it is without the tests, or the errors for warnings,
        that are now requested, or with other tests; then build the targets, and print the warnings of a project. When a
        CMake file changes, Ninja configures again by itself. Other launchers wait meanwhile: Ninja expects to be
        alone."""
        if why := not_for_cmake(self.tree):
            raise Failure(f"{why}; move it to another folder", 1)
        logs, preset = self.tree / "build", context.preset
        if not may_write(logs, self.folder):
            if not self.is_built(targets):
                raise self._not_writable()
            return
        begun = time.monotonic()
        with alone(logs / f"{preset}.lock", f"builds{self.of} ({preset})") as lock:
            self._refuse_the_future()
            if (self.folder / "CMakeCache.txt").exists() and not self.is_configured_here():
                of_fledge = f" with {self.cached('Fledge_DIR')}" if self.fledge else ""
                say(f"building{self.of} anew ({preset}): {self.folder} was made in "
                    f"{self.cached('CMAKE_HOME_DIRECTORY')}{of_fledge}")
                shutil.rmtree(self.folder)
            elif not (self.folder / "build.ninja").exists():
                say(f"building{self.of} ({preset})")
            # What a configuration that failed has found would stay: a wrong compiler, for one.
            fresh = [] if (self.folder / "build.ninja").exists() else ["--fresh"]
            requested = {"BUILD_TESTING": tests,
                         "CMAKE_COMPILE_WARNING_AS_ERROR": context.develops and not self.fledge}
            on = {name: value or not fresh and self.cached(name) == "ON" for name, value in requested.items()}
            new = any(value and self.cached(name) != "ON" for name, value in requested.items())
            if fresh or new or not self._has_its_tests():
                log = logs / f"configure-{preset}.log"
                if status := run(log, ["cmake", *fresh, *self.arguments,
                                       f"-DBUILD_TESTING={'ON' if on.pop('BUILD_TESTING') else 'OFF'}",
                                       *(f"-D{name}=ON" for name, value in on.items() if value)], self.tree, lock=lock):
                    raise failure(log, "the configuration", status)
            log = logs / f"build-{preset}.log"
            with by_contents(self.folder):
                status = run(log, ["ninja", "-C", self.folder, *targets], self.tree, lock=lock)
            if status:
                raise failure(log, "the build", status)
            text = log.read_text(encoding="utf-8", errors="replace")
            if self.fledge:
                print("".join(re.findall("^.*: warning: .*\n", text, re.M)), end="", file=sys.stderr, flush=True)
            if "ninja: no work to do" not in text:
                say(f"built{self.of} ({preset}) in {time.monotonic() - begun:.0f} s")

    def _not_writable(self) -> Failure:
        if self.tree.stat().st_uid == os.geteuid():
            how = f"copy {self.tree} to a disk that can be written"
        else:
            try:
                owner = self.tree.owner()
            except KeyError:        # without a name
                owner = "its owner"
            how = f"{owner} can, by the same command"
        return Failure(f"{self.tree} must be built, and this user may not write into {self.folder}; {how}", 1)

    def _refuse_the_future(self) -> None:
        """Refuse sources from the future, which Ninja would build for ever; and remove what was built there, which it
        would take for newer than what changes now. Clocks of disks in a network may differ by some seconds."""
        import subprocess

        late = subprocess.run(
            ["find", ".", "(", "-name", "build", "-o", "-name", "runs", "-o", "-name", ".?*", ")", "-prune", "-o",
             "-type", "f", "-newermt", "1 minute", "-print", "-quit"], cwd=self.tree, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True).stdout.strip()
        if late:
            raise Failure(f"{self.tree}/{late.removeprefix('./')} is from the future: set the clock; if it is right, "
                          f"find '{self.tree}' -name build -prune -o -newermt '1 minute' -exec touch {{}} +", 1)
        subprocess.run(["find", self.folder, "-type", "f", "-newermt", "1 minute", "-delete"],
                       stderr=subprocess.DEVNULL)


def compile(context: Context, parts: Sequence[str], tests: bool = False, programs: str = "tests") -> Path:
    """Build these parts of Fledge (desktop, loop, cosim, emulator, ground or all), then the project, if there is one;
    returns the folder of the last. With a project, `tests` is about the project's tests, not Fledge's; programs: those
    of the tests that are built."""
    project = context.project
    folder, package = context.build, ROOT / "cmake"
    if project and "cosim" not in parts and _links_cosim(project):
        parts = [*parts, "cosim"]
    if not context.installed:
        package = context.build
        own = tests and not project
        Build(ROOT, folder, ["--preset", context.preset]).make(context, [*parts, *programs.split() * own], own)
    if project:
        folder = project / "build" / context.preset
    if project and context.builds_project:
        need(context, "project")
        build = _of_project(context, project, package)
        context.project_build = folder = build.folder
        build.make(context, ["all", *[context.observed] * bool(context.observed), *programs.split() * tests], tests)
    return folder


def _links_cosim(project: Path) -> bool:
    """Whether something in a project is linked with Fledge's co-simulation."""
    for place, folders, files in os.walk(project):
        folders[:] = [name for name in folders if name != "build"]
        if "CMakeLists.txt" in files and re.search(
                "fledge::(cosim|node)", Path(place, "CMakeLists.txt").read_text(encoding="utf-8", errors="replace")):
            return True
    return False


def _of_project(context: Context, project: Path, package: Path) -> Build:
    """Another Fledge that stands beside this one keeps its build of the project, and this one makes its own."""
    def build(folder: Path) -> Build:
        return Build(project, folder, ["-G", "Ninja", "-S", ".", "-B", str(folder), f"-DFledge_DIR={package}",
                                       "-DCMAKE_C_COMPILER=gcc", "-DCMAKE_CXX_COMPILER=g++"], package)

    shared = build(project / "build" / context.preset)
    own = build(project / f"build/{context.preset}-{zlib.crc32(str(package).encode())}")
    owner = shared.cached("Fledge_DIR")
    others = Path(owner, "FledgeConfig.cmake").exists() and not same(owner, package)
    return own if own.folder.exists() or others else shared


# --- what is built by Python -----------------------------------------------------------------------

def prepare(context: Context, targets: str = "") -> None:
    """Build what all flights on these targets need; without names, on all that are installed."""
    if status := pass_on([sys.executable, "-P", "-m", "fledge.targets", *[targets] * bool(targets)],
                         environment=context.environment()):
        sys.exit(status)


def need_node(context: Context) -> None:
    if not shutil.which("npm"):
        need(context, "view")


def view(context: Context, if_possible: bool = False) -> None:
    """Build what shows runs in 3-D, unless it is built; Node is installed for that, if there is none. if_possible:
    without Node, what needs the view says so itself."""
    if context.installed:
        return
    log, command = ROOT / "build/view.log", [sys.executable, "-P", "-m", "fledge.scene.bundle"]
    if not may_write(log.parent):       # then it says itself what is wrong
        if pass_on(command, environment=context.environment()) and not if_possible:
            sys.exit(1)
        return
    status = run(log, command, environment=context.environment())
    if status and not shutil.which("npm"):
        if if_possible:
            return
        need_node(context)
        status = run(log, command, environment=context.environment())
    if status and not if_possible:
        raise failure(log, "the 3-D view", status)
    if status:
        say(f"the 3-D view was not built; the log is {log}")
