# SPDX-License-Identifier: Apache-2.0
"""Builds by Ninja that follow contents. Ninja itself compares times, so it misses a source that `cp -p`, tar, rsync or
dpkg replaces by one of an older time.

Example:

    from pathlib import Path
    from fledge.contents import changed
    changed(Path("build/release"))      # the inputs that Ninja would not notice: []
"""
from __future__ import annotations

import json
import os
import re
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fledge.programs import without_preload

RECORD = "compiled.json"    # in the folder of a build: path of an input -> its times, its size, its hash

Seen = dict[str, list[int | str]]


@contextmanager
def by_contents(folder: Path) -> Iterator[None]:
    """Ninja runs in the block, alone. Before it, what was made of other contents is removed; afterwards, the inputs are
    known by their hashes."""
    seen = _seen(folder)
    before = dict(seen)
    if missed := changed(folder, seen):
        made = _made_of(folder)
        for output in (Path(output) for path in missed for output in made.get(path, ())):
            if output.name == "build.ninja":    # CMake makes it from itself
                os.utime(output, (1, 1))
            elif output.is_file():
                output.unlink()
    if seen != before:
        _write(folder, seen)
    yield
    if any(_time(folder / file) >= _time(folder / RECORD) for file in (".ninja_log", "build.ninja")):
        _write(folder, {path: now for path in _made_of(folder) if (now := seen.get(path) or _look(path))})


def changed(folder: Path, seen: Seen | None = None) -> list[str]:
    """The inputs whose contents are no longer those of the last build, without a newer time by which Ninja would know.
    `seen`, the record of the inputs, is brought up to date."""
    last, missed = _time(folder / RECORD), []
    seen = _seen(folder) if seen is None else seen
    for path, before in seen.items():
        now = _look(path, before)
        if now and now is not before:       # what is gone stays as it was compiled
            seen[path] = now
            if now[-1] != before[-1] and int(now[0]) <= last:
                missed.append(path)
    return missed


def _seen(folder: Path) -> Seen:
    try:
        seen: Seen = json.loads((folder / RECORD).read_bytes())
        return seen
    except (OSError, ValueError):
        return {}


def _look(path: str, before: list[int | str] | None = None) -> list[int | str] | None:
    """Times [ns], size and hash of a file; `before` if times and size are those; None without a file."""
    try:
        status = os.stat(path)
        now: list[int | str] = [status.st_mtime_ns, status.st_ctime_ns, status.st_size]
        if before and before[:-1] == now:
            return before
        import hashlib      # it would delay every command

        return [*now, hashlib.blake2b(Path(path).read_bytes(), digest_size=16).hexdigest()]
    except OSError:
        return None


def _made_of(folder: Path) -> dict[str, set[str]]:
    """Path of each input outside the folder -> what Ninja makes of it: by the rules, and by what compilers included."""
    import subprocess       # what reads only needs none

    made: dict[str, set[str]] = defaultdict(set)

    def whole(path: str) -> str:
        return os.path.normpath(os.path.join(folder, path))

    rules = (folder / "build.ninja").read_text(encoding="utf-8", errors="surrogateescape")
    for line in re.findall(r"^build (.*)", rules, re.M):
        outputs, inputs = ([re.sub(r"\$([$ :])", r"\1", word) for word in re.findall(r"(?:\$.|[^ $])+", part)]
                           for part in re.split(r"(?<!\$): ", line.partition(" || ")[0], maxsplit=1))
        if inputs[0] != "phony":
            for path in inputs[1:]:
                made[whole(path)].update(whole(output) for output in outputs)
    output = ""
    for line in subprocess.run(["ninja", "-C", folder, "-t", "deps"], capture_output=True, text=True,
                               errors="surrogateescape", env=without_preload(os.environ)).stdout.splitlines():
        if line.startswith("    "):
            made[whole(line[4:])].add(output)
        elif ": #deps " in line:
            output = whole(line.rpartition(": #deps ")[0])
    inside = f"{os.path.normpath(folder)}/"
    return {path: outputs for path, outputs in made.items() if not path.startswith(inside)}


def _time(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _write(folder: Path, seen: Seen) -> None:
    part = folder / f"{RECORD}.part"
    part.write_text(json.dumps(seen), encoding="utf-8")
    part.replace(folder / RECORD)
