# SPDX-License-Identifier: Apache-2.0
"""The folders of runs, and their records by name.

    runs/MISSION/SCENARIO/run.mcap      the last run of a scenario
    runs/kept/NAME/run.mcap             a run that was given a name, by fledge run --as NAME
"""
from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fledge.cli.console import complain
from fledge.errors import Failure, listed
from fledge.disk import make

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.archive import Archive
    from fledge.archive.reader import Channel

RUNS = Path("runs")
KEPT = RUNS / "kept"
SCENE = ".scene.mcap"   # ends the name of a copy with a scene, which is no run of its own
WHAT = "a .mcap file, its folder, the name of a mission flown before, or that of a kept run"    # what RUN may be


@contextmanager
def alone(folder: Path, instead: str = "give another folder with --out") -> Iterator[None]:
    """Reserve a folder, made if it is missing, for the files of this program; raises Failure if another one has it.

    instead: what a user can do, besides waiting. The lock is the kernel's: it ends with the program, however that ends.
    """
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    lock = -1
    while lock < 0:
        make(folder, 0o700)
        lock = _lock(folder, instead)
    try:
        yield
    finally:
        for parent in missing:        # which are empty, where a command is refused
            try:
                parent.rmdir()
            except OSError:
                break
        os.close(lock)


def _lock(folder: Path, instead: str) -> int:
    """A descriptor that holds the lock of a folder; -1 if another program has deleted the folder meanwhile."""
    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except FileNotFoundError:
        return -1
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise Failure(f"another fledge command writes into {folder} now; wait until it has ended, or {instead}"
                      ) from None
    except OSError:
        pass                    # a file system without locks: the files themselves still exclude each other
    if folder.exists() and os.path.samestat(os.fstat(lock), folder.stat()):
        return lock
    os.close(lock)
    return -1


# --- names -----------------------------------------------------------------------------------------

def folder_of(name: str, replace: bool = False) -> Path:
    """The folder of a new run with a name. Raises Failure if it cannot be a name, or if a run has it."""
    if (not name or not name.isprintable() or name != name.strip() or name[0] in ".-" or set(name) & set("/\\")
            or len(name.encode()) > 100):
        raise Failure(f"--as {name!r}: expected a name of up to 100 bytes, without / and \\, that begins with neither "
                      ". nor -")
    from fledge.mission import missions

    if name in missions() or (RUNS / name).is_dir():
        raise Failure(f"--as {name}: a mission has this name; plot {name} would mean either")
    folder = KEPT / name
    if not replace and any(folder.glob("run*.mcap*")):
        raise Failure(f"--as {name}: {folder} has a run of this name already; choose another name, or replace that run "
                      "by --replace")
    return folder


def kept_runs() -> dict[str, list[Path]]:
    """The kept runs: name -> their records, or what is left of one that has not ended."""
    return {folder.name: files for folder in sorted(KEPT.glob("*"))
            if (files := sorted(folder.glob("*.mcap")) or sorted(folder.glob("*.mcap.part")))}


def find_run(name: str) -> Path:
    """The record that is meant by a file, a folder, the name of a mission flown before, or the name of a kept run.

    Of several runs of a mission, the newest; a line on stderr then says which."""
    unfinished = []
    for path in (Path(name), KEPT / name, RUNS / name):
        if path.is_file():
            return path
        if path.is_dir():
            records = sorted(record for record in [*path.glob("*.mcap"), *path.glob("*/*.mcap")]
                             if not record.name.endswith(SCENE))
            if len(records) == 1:
                return records[0]
            if path.parent == RUNS and path != KEPT and (runs := list(path.glob("*/run.mcap"))):
                newest = max(runs, key=lambda record: record.stat().st_mtime_ns)
                complain(f"{newest} is the newest run of {path.name}; {path} has {len(records)} records", "")
                return newest
            if records:
                raise Failure(f"there are several records in {path}; name one of {', '.join(map(str, records))}")
            unfinished += sorted([*path.glob("*.mcap.part"), *path.glob("*/*.mcap.part")])
    if unfinished:
        raise Failure(f"there is no whole record '{name}'; {' '.join(map(_left, unfinished))}")
    known = sorted(map(str, RUNS.glob("*/*/*.mcap")))
    raise Failure(f"there is no record '{name}'; " + (f"there are {listed(known, most=12)}" if known
                                                      else "none has been made yet: ./fledge run MISSION"))


def open_run(name: str) -> Archive:
    """The archive of find_run(). Lines on stderr say if it is damaged, and if a later run has not ended."""
    from fledge.archive import Archive

    path = find_run(name)
    archive = Archive(path)
    if archive.problem:
        complain(archive.problem, "")
    own = path.with_name(path.name + ".part")
    parts = [own] if own.is_file() else []
    for folder in (Path(name), KEPT / name, RUNS / name):
        if folder.is_dir() and path.is_relative_to(folder):     # later runs of its other scenarios
            parts += [part for part in sorted([*folder.glob("*.mcap.part"), *folder.glob("*/*.mcap.part")])
                      if part != own and part.stat().st_mtime > path.stat().st_mtime]
    for part in parts:
        complain(f"{path} is not of the last run: {_left(part)}", "")
    return archive


def decodable(archive: Archive) -> list[Channel]:
    """The topics whose messages are plain data. Names the others, as the scene for Foxglove."""
    for channel in archive.topics.values():
        if channel.problem:
            complain(f"without {channel.topic} ({channel.schema}), which cannot be decoded: {channel.problem}")
    return [channel for channel in archive.topics.values() if not channel.problem]


def _left(part: Path) -> str:
    return f"a run that has not ended left {part}, with {worth(part)}."


def worth(part: Path) -> str:
    """What is in the part of a program that was killed or still goes on."""
    from fledge.archive import Archive, ArchiveError

    try:
        with Archive(part) as archive:
            good = archive.good_until
    except ArchiveError:
        good = None
    return "no readable data" if good is None else f"the data up to t = {good:g} s"
