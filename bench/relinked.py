# SPDX-License-Identifier: Apache-2.0
"""Programs of the build with a change in one source, for benches that plant bugs.

Example:

    from bench.relinked import Program, extension

    program = Program("flight/flight_control_test")     # or extension()
    path = program.make("flight/control/rate_damping.c", changed_text, folder)
"""
from __future__ import annotations

import os
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

from fledge.errors import Failure

from bench.mutants import ROOT

LIMIT = 900.0           # [s] of each program: a change may make an endless loop


class Unusable(Exception):
    """A change that the compiler refuses ("not compiled"), or that leaves the object the same ("equivalent")."""


class Program:
    """A program or library of the build, that is linked anew with another object of one source. target: of ninja"""

    def __init__(self, target: str) -> None:
        self.build = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release")
        self.path = self.build / target
        run(["ninja", target], self.build, "./fledge test builds what this bench takes; ")
        self._commands = run(["ninja", "-t", "commands", target], self.build).stdout.splitlines()

    def make(self, file: str, text: str, folder: Path) -> Path:
        """The program with this text of a source, in a folder. Raises Unusable."""
        link = shlex.split(self._commands[-1].removeprefix(": && ").removesuffix(" && :"))
        compiles = [shlex.split(re.sub(r" -MD -MT \S+ -MF \S+", "", command)) for command in self._commands
                    if command.endswith(f" -c {ROOT / file}")]
        words = max(compiles, key=lambda words: words[words.index("-o") + 1] in link)   # not that of an archive
        place = words.index("-o") + 1
        before = words[place]
        objects = []
        for words[-1] in self._written(file, text, folder):
            words[place] = f"{folder}/{len(objects)}-{self.path.name}.o"
            if run(words, self.build, check=False).returncode:
                raise Unusable("not compiled")
            objects.append(words[place])
        if len({bare(Path(path)) for path in objects}) < 2:
            raise Unusable("equivalent")
        if before not in link:      # it is in an archive, from which the linker takes what it has not found before
            before = next(word for word in link if word.endswith(".a"))
            objects.append(before)
        link[link.index(before):link.index(before) + 1] = objects[1:]
        link[link.index("-o") + 1] = str(folder / self.path.name)
        run(link, self.build)
        return folder / self.path.name

    @staticmethod
    def _written(file: str, text: str, folder: Path) -> Iterator[str]:
        """The source's place: with its own text, and with another one."""
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        for content in ((ROOT / file).read_text(encoding="utf-8"), text):
            path.write_text(content, encoding="utf-8")
            yield str(path)


def extension(kind: str = "") -> Program:
    """The extension `_core` of the build, or of one that counts what flight does, as "branches"."""
    built = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release")
    name = next((built / "python").glob("_core.*.so")).name
    return Program(f"python_{kind}/{name}" if kind else f"python/{name}")


def bare(path: Path) -> bytes:
    """An object without what debuggers need."""
    run(["objcopy", "--strip-debug", str(path), f"{path}.bare"], path.parent)
    return Path(f"{path}.bare").read_bytes()


def run(words: list[str], cwd: Path, otherwise: str = "", check: bool = True, **more: str
        ) -> subprocess.CompletedProcess[str]:
    """Run a program. more: variables of its environment. Raises Failure, which begins with `otherwise`, if it fails and
    `check` is True."""
    try:
        done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, errors="replace", timeout=LIMIT,
                              env={**os.environ, **more})
    except subprocess.TimeoutExpired:
        done = subprocess.CompletedProcess(words, 124, "", "it takes too long")
    if check and done.returncode:
        raise Failure(f"{otherwise}{shlex.join(words)[:200]}: {(done.stdout + done.stderr)[-1000:]}", 1)
    return done
