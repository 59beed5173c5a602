# SPDX-License-Identifier: Apache-2.0
"""Time travel: a run goes on from the past of another.

`fledge up` notes in RUN/run.json what it starts. With `keep_every`, the controller writes RUN/exchange.mcap, with all
messages between the nodes, and RUN/snapshots/T.snapshots (cosim/tools/snapshots.h). From these, a new run starts the
same programs again. The controller plays the past: a program with a snapshot goes on from it; any other one steps from
the start, and has to write the same messages again.
"""
from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fledge.archive import ArchiveError
from fledge.cosim.replay import Exchange
from fledge.cosim.up.description import Plan, Program
from fledge.serial_line import name_of

NOTE, FOLDER = "run.json", "snapshots"
_FIRST = b"fledge snapshots 1\n"
# Of a program: what decides what it computes.
_DECIDES = ("mission", "process", "scenario", "free", "parameters", "target", "board", "command", "env", "prefix",
            "topics", "asynchronous")


class RewindError(Exception):
    """The reason why a run cannot go on from there, and what to do."""


@dataclass
class Past:
    """What a run goes on from: t [s], what `run` wrote until then, and snapshots of nodes (name -> reached [s]).

    file: for the controller; later: messages of asynchronous programs after t, which are not written again.
    """
    run: Path
    t: float
    file: Any
    snapshots: dict[str, float]
    programs: dict[str, Program]
    later: int

    def take_records(self, folder: Path) -> None:
        """Give the programs that go on from snapshots the records of the first run, which they go on with."""
        for name in self.snapshots:
            for record in _records(self.run, self.programs[name]):
                to = folder / record.relative_to(self.run).with_name(f"{record.name.removesuffix('.part')}.part")
                to.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(record, to)


def _records(run: Path, p: Program) -> list[Path]:
    """What a program of a mission has written in the folder of a run."""
    if not p.mission or p.host:
        return []
    names = [f"{p.name}.mcap", f"{p.name}-[0-9]*.mcap"]
    if p.target:    # in a folder of its own, and there in one of each process, if the mission has several
        names = [f"{folder}/{name_of(p.target)}.{file}" for folder in (p.name, f"{p.name}/{p.process}")
                 for file in ("mcap", "telemetry.txt")]
    return [path for name in names for ending in ("", ".part") for path in run.glob(name + ending)]


def _can_go_on(run: Path, p: Program) -> bool:
    """Whether there is what a program needs besides its snapshot: flight on a board, its files."""
    records = {path.name.removesuffix(".part") for path in _records(run, p)}
    return not p.target or records == {f"{name_of(p.target)}.{file}" for file in ("mcap", "telemetry.txt")}


def write_note(plan: Plan, folder: Path, past: Past | None) -> None:
    """Write what the run starts, and from where."""
    content: dict[str, Any] = {"fledge": _fledge(), "plan": asdict(plan),
                               "files": {p.name: _files(p) for p in plan.programs if not p.asynchronous}}
    if past:
        content["from"] = {"run": str(past.run.resolve()), "t": past.t}
    part = folder / f"{NOTE}.part"
    part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    part.rename(folder / NOTE)


def recorded(run: Path) -> tuple[Plan, dict[str, Any]]:
    """What was started in the folder of a run. Raises RewindError."""
    try:
        note = json.loads((run / NOTE).read_text(encoding="utf-8"))
        plan: dict[str, Any] = {**note["plan"],
                                "programs": [Program(**program) for program in note["plan"]["programs"]]}
        return Plan(**plan), note
    except FileNotFoundError:
        raise RewindError(f"{run} is no folder of a run: it has no {NOTE}, which fledge up writes") from None
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise RewindError(f"{run / NOTE} is damaged, or of another version of Fledge: {error}") from None


def past_of(run: Path, plan: Plan, note: dict[str, Any], t: float, changed: bool) -> Past:
    """The past of a run until t [s], for the programs of a plan. Raises RewindError.

    note: as recorded() returns it. changed: let programs that have changed since then step from the start.
    """
    try:
        exchange = Exchange(next((path for path in (run / "exchange.mcap", run / "exchange.mcap.part")
                                  if path.exists()), run / "exchange.mcap"))
    except (ArchiveError, OSError) as error:
        raise RewindError(f"{run} has no record of its messages, which it needs to go on from: fly it with keep_every "
                          f"({error})") from None
    snapshot_files = sorted((int(path.stem), path) for path in (run / FOLDER).glob("*.snapshots")
                            if path.stem.isdigit())
    at, known, why = round(t * 1e9), exchange.known, exchange.limited or "there it ended"
    if snapshot_files and snapshot_files[-1][0] > known and not exchange.archive.complete:
        known = min([snapshot_files[-1][0], *exchange.changes])   # the record has all messages up to each snapshot
    if at > known:
        raise RewindError(f"{run} is known until {max(known, 0) / 1e9:g} s, because {why}; found --to {t:g} s; choose "
                          "an earlier time")
    others = changed_since(plan, note)
    if others and not changed:
        raise RewindError("since that run, these have changed: " + "; ".join(
            f"{name}, {what}" for name, what in others.items()) + "; restore them, or give --changed: they fly from "
            f"the start then, and must write the same until {t:g} s")
    earlier = [path for when, path in snapshot_files if when <= at]
    snapshots = {} if "fledge" in others else _read(earlier[-1]) if earlier else {}
    here = {p.name: p for p in plan.nodes if p.joins is None and p.name not in others}
    snapshots = {name: snapshot for name, snapshot in snapshots.items() if name in here and snapshot[0] >= 0
                 and _can_go_on(run, here[name])}
    file, later = tempfile.TemporaryFile(), 0
    file.write(_FIRST + b"until %d\n" % at)
    for name, channel in exchange.archive.topics.items():
        times = exchange.archive.time_ns(name)
        before = times <= at
        if channel.metadata["writer"] not in [p.name for p in plan.nodes]:
            later += int((~before).sum())
        initial = bytes.fromhex(channel.metadata["initial"])
        file.write(b"topic %d %d %s\n" % (len(initial) - 4, int(before.sum()), name.encode()))
        file.write(initial + times[before].astype("=i8").tobytes() + exchange.archive[name][before].tobytes())
    for name, (reached, data) in snapshots.items():
        file.write(b"node %d %d %08x %s\n" % (reached, len(data), zlib.crc32(data), name.encode()) + data)
    file.write(b"end\n")
    file.flush()
    return Past(run, t, file, {name: reached / 1e9 for name, (reached, _) in snapshots.items()}, here, later)


def _read(path: Path) -> dict[str, tuple[int, bytes]]:
    """The snapshots of a file: node -> (reached [ns], bytes)."""
    snapshots, problem = {}, ""
    with open(path, "rb") as file:
        if file.readline() != _FIRST:
            problem = "it does not begin as such a file"
        while not problem and (line := file.readline()) != b"end\n":
            try:
                what, reached, size, crc, name = line.decode().rstrip("\n").split(" ", 4)
                data = file.read(int(size))
                if what != "node" or len(data) < int(size):
                    problem = "it is cut off"
                elif zlib.crc32(data) != int(crc, 16):
                    problem = f"the checksum of {name} is {zlib.crc32(data):08x}, the file says {crc}"
                snapshots[name] = int(reached), data
            except ValueError:
                problem = "it is cut off"
    if problem:
        raise RewindError(f"{path} is damaged: {problem}; delete it, and the run goes on from the snapshots before")
    return snapshots


def changed_since(plan: Plan, note: dict[str, Any]) -> dict[str, str]:
    """Nodes that are not what they were, and in what; "fledge" if it is Fledge itself."""
    others = {}
    if (fledge := _fledge()) != note["fledge"]:
        others["fledge"] = f"it was {note['fledge']} and is {fledge}"
    before: dict[str, Any] = {program["name"]: program for program in note["plan"]["programs"]}
    for p in plan.nodes:
        was, now = before.get(p.name), json.loads(json.dumps(asdict(p)))
        if was is None:
            others[p.name] = "it was not there"
        elif different := [key for key in _DECIDES if was[key] != now[key]]:
            others[p.name] = f"its {' and '.join(different)}"
        elif _files(p) != note["files"][p.name]:
            others[p.name] = "its files"
    return others


def _fledge() -> str:
    """The revision of Fledge, as it is built here."""
    from fledge.mission.provenance import ROOT, identity

    return identity(ROOT)["fledge"]


def _files(p: Program) -> str:
    """A digest of the files that make a node: of its mission, its boards, and those that its command names."""
    from fledge.mission.folder import find

    if p.host:
        return ""
    files = [path for word in [*(p.command or ()), *p.board] if (path := Path(p.directory) / word).is_file()]
    files += [path for word in p.board for path in sorted((Path(p.directory) / word).glob("*.toml"))]
    if p.mission:
        folder = find(p.mission).folder
        files += [path for path in sorted(folder.rglob("*")) if path.is_file() and not
                  {"__pycache__", "runs", "build"} & {*path.relative_to(folder).parts}]
    digests = [path.name.encode() + hashlib.sha256(path.read_bytes()).digest() for path in files]
    return hashlib.sha256(b"".join(digests)).hexdigest()[:16]
