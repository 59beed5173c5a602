# SPDX-License-Identifier: Apache-2.0
"""What the launcher works for: a command, with a build of Fledge, in a project or none."""
from __future__ import annotations

import os
import sys
from pathlib import Path

from fledge.errors import Failure
from fledge.disk import ROOT
from fledge.folders import has_code
from fledge.launcher.tools import say

PRESETS = ("release", "debug", "asan")      # and tsan, for some tests
OBSERVED = ("mcdc", "branches")     # kinds of a build whose flight code counts what it does: cmake/FledgeObserved.cmake


class Context:
    def __init__(self, command: str = "", preset: str = "release", project: Path | None = None) -> None:
        self.command = command
        self.preset = preset
        self.project = project
        self.installed = not (ROOT / "CMakeLists.txt").exists()     # `cmake --install` leaves out the build's files
        self.project_build: Path | None = None                      # where the project was built
        self.observed = ""                                          # of OBSERVED: what the command uses, or none
        self.develops = False                                       # warnings of compilers are errors
        self.force = False                                          # try on a system that is none of packages.SYSTEMS

    @property
    def build(self) -> Path:
        """The folder of Fledge's build."""
        return ROOT / "build" / self.preset

    @property
    def tree(self) -> Path:
        """What is tested and documented: the project, or Fledge itself."""
        return self.project or ROOT

    @property
    def builds_project(self) -> bool:
        """Whether there is a project that is built: without C an installed Fledge needs no compiler for it. A checkout
        has one, and links for editors what it knows of types."""
        return self.project is not None and (not self.installed or has_code(self.project))

    @property
    def logs(self) -> Path:
        return self.tree / "build"

    def environment(self, *more: Path) -> dict[str, str]:
        """The variables by which Python finds the packages, the extension of the build, these folders, and the project.
        """
        variables = {**os.environ, **self.names(), "PYTHONPATH": os.pathsep.join(map(str, filter(None, [
            *self.folders(), *more, os.environ.get("PYTHONPATH")])))}
        if self.preset == "asan":
            # The interpreter is not instrumented: the sanitizer's library must be loaded before it. It does not free
            # all its memory on exit: leaks are not reported.
            import subprocess

            variables["LD_PRELOAD"] = ":".join(
                subprocess.run(["gcc", f"-print-file-name={library}"], stdout=subprocess.PIPE, text=True,
                               check=True).stdout.strip() for library in ("libasan.so", "libstdc++.so"))
            variables["ASAN_OPTIONS"] = "detect_leaks=0"
        return variables

    def observe(self, kind: str) -> None:
        """Let the command use the build that counts so."""
        if self.preset == "asan":
            raise Failure(f"{self.command}: flight code counts what it does in the build release; leave out "
                          "--preset asan")
        self.observed = kind

    def names(self) -> dict[str, str]:
        """The variables that name the build and the project."""
        return {"FLEDGE_PRESET": self.preset, "FLEDGE_PROJECT": str(self.project or ""),
                "FLEDGE_OBSERVED": self.observed, **({"FLEDGE_FORCE": "1"} if self.force else {}),
                **({"FLEDGE_PROJECT_BUILD": str(self.project_build)} if self.project_build else {})}

    def folders(self) -> list[str]:
        observed = [str(self.build / f"python_{self.observed}")] * bool(self.observed)
        return [str(ROOT / "python"), str(ROOT), *observed, str(self.build / "python")]

    def enter(self) -> None:
        """Let this program be one that uses the build."""
        import importlib

        environment = self.environment()
        sys.path[:] = [*self.folders(), *(path for path in sys.path if path not in self.folders())]
        os.environ.update(environment)
        importlib.invalidate_caches()


def project_around(folder: Path) -> Path | None:
    """The folder, or one around it, whose CMakeLists.txt calls fledge_project(). The search ends at the user's home,
    and within Fledge itself. Raises Failure for a project of another user."""
    import re

    home = Path(os.environ.get("HOME") or "/")
    if ROOT in (folder, *folder.parents):
        return None
    for place in (folder, *folder.parents):
        file = place / "CMakeLists.txt"
        try:
            text = file.read_text(encoding="utf-8", errors="replace")
        except OSError:
            text = ""
        if re.search(r"^\s*fledge_project\s*\(", text, re.M | re.I):
            if file.stat().st_uid != os.geteuid():
                raise Failure(f"the project {place} belongs to another user: with --project {place} you trust it, with "
                              "--project '' you leave it out", 1)
            return place
        if same(place, home):
            return None
    return None


def project_named(name: str) -> Path | None:
    if not name:
        return None
    if not Path(name, "CMakeLists.txt").exists():
        raise Failure(f"there is no project in {name} (no CMakeLists.txt); './fledge new project {name}' makes one", 1)
    return Path(name).resolve()


def say_if_in_another_checkout(folder: Path) -> None:
    """Say that the installed Fledge runs, if it is called within a checkout."""
    for place in (folder, *folder.parents):
        if os.access(place / "fledge", os.X_OK) and (place / "python/fledge/__init__.py").exists() \
                and not same(place, ROOT):
            say(f"this is the Fledge in {ROOT}, not the checkout around this folder; for that, {place}/fledge")
            return


def same(first: str | Path, other: str | Path) -> bool:
    """Whether both are there, and the same."""
    try:
        return os.path.samefile(first, other)
    except OSError:
        return False
