# SPDX-License-Identifier: Apache-2.0
"""Callgrind and Massif: run a program under them, and read the files that they write."""
from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from fledge.errors import Failure
from fledge.programs import without_preload


def run(tool: str, options: Sequence[str], command: Sequence[str | Path], folder: Path,
        environment: Mapping[str, str] | None = None) -> str:
    """Run a command under a tool, in a folder; returns what it printed."""
    if not shutil.which("valgrind"):
        raise Failure("profile: valgrind is not installed; as root, run: apt-get install valgrind")
    done = subprocess.run(["valgrind", "-q", f"--tool={tool}", *options, *map(str, command)], cwd=folder, text=True,
                          capture_output=True, errors="replace",
                          env=without_preload({**os.environ, **(environment or {})}))
    if done.returncode:
        raise Failure(f"profile: {command[0]} failed under {tool}:\n{(done.stderr or done.stdout).strip()[-2000:]}", 1)
    return done.stdout


# --- callgrind -------------------------------------------------------------------------------------

@dataclass
class Stretch:
    """The instructions of a program between two marks."""
    total: int = 0
    own: Counter[str] = field(default_factory=Counter)          # of each function, without what it calls
    inclusive: Counter[str] = field(default_factory=Counter)    # of calls, with what they call
    calls: Counter[str] = field(default_factory=Counter)


def callgrind(command: Sequence[str | Path], folder: Path, mark: str,
              environment: Mapping[str, str] | None = None) -> list[Stretch]:
    """The stretches of a program's run between calls of the function `mark`; the last to its end."""
    for old in folder.glob("callgrind.out*"):
        old.unlink()
    run("callgrind", ["--callgrind-out-file=callgrind.out", f"--dump-before={mark}"], command, folder, environment)
    parts = sorted(folder.glob("callgrind.out.*"), key=lambda path: int(path.suffix[1:]))
    return [read_callgrind(path.read_text(encoding="utf-8", errors="replace"))
            for path in [*parts, *([folder / "callgrind.out"] if (folder / "callgrind.out").exists() else [])]]


def read_callgrind(text: str) -> Stretch:
    """A file in callgrind's format, with instructions as its only event."""
    stretch, names = Stretch(), {}
    function, called = "", ""

    def name(word: str) -> str:
        number, _, given = word.partition(" ")
        if given:
            names[number] = given.partition("'")[0]     # f'2 is a recursion of f
        return names.get(number, word)

    for line in text.splitlines():
        key, equals, value = line.partition("=")
        if equals and key == "fn":
            function = name(value)
        elif equals and key == "cfn":
            called = name(value)
        elif equals and key == "calls":
            stretch.calls[called] += int(value.split()[0])
        elif line[:1] in "+-*0123456789" and line:
            cost = int(line.split()[1])
            if called:
                stretch.inclusive[called] += cost
                called = ""
            else:
                stretch.own[function] += cost
                stretch.total += cost
    return stretch


# --- massif ----------------------------------------------------------------------------------------

class Snapshot(NamedTuple):
    time: int       # instructions since the start
    heap: int       # [bytes]
    stack: int      # [bytes]


def massif(command: Sequence[str | Path], folder: Path, stacks: bool = True,
           environment: Mapping[str, str] | None = None) -> list[Snapshot]:
    """The heap and the stack of a program over its run."""
    out = folder / "massif.out"
    run("massif", [f"--massif-out-file={out.resolve()}", "--time-unit=i", f"--stacks={'yes' if stacks else 'no'}",
                   "--peak-inaccuracy=0.0", "--max-snapshots=400", "--detailed-freq=1000000", "--depth=1"],
        command, folder, environment)
    return read_massif(out.read_text(encoding="utf-8", errors="replace"))


def read_massif(text: str) -> list[Snapshot]:
    rows = [tuple(int(value) for value in numbers) for numbers in re.findall(
        r"^time=(\d+)\nmem_heap_B=(\d+)\nmem_heap_extra_B=(\d+)\nmem_stacks_B=(\d+)$", text, re.MULTILINE)]
    return [Snapshot(time, heap + extra, stack) for time, heap, extra, stack in rows]
