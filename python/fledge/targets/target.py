# SPDX-License-Identifier: Apache-2.0
"""The places where a mission flies. A target builds the exported C, and gives the command that starts it, and its
size; all else is the same for all targets. To add one: a Target, and a line in TARGETS."""
from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

from fledge.archive import Archive
from fledge.errors import Failure
from fledge.targets import build, loop

if TYPE_CHECKING:
    from fledge.targets.job import Job, Part


@dataclass
class Flown:
    """The results of a flight."""
    record: Path            # of all flight outputs
    steps: int              # of flight
    cpu: float | None       # [s] of a processor, per step of flight
    cpu_of: str = ""        # what it includes, or its processor: "world too", "emulated"
    code: int | None = None  # [bytes] without the C library
    memory: int | None = None
    saturated: int = 0      # numbers that were limited to the range of their words, on either side
    lost: int = 0           # packets that a full queue refused or dropped, or that a newer one replaced unseen
    heap: tuple[int, int, int] | None = None    # [bytes] of a script: used at the start, at the end, at most
    script: tuple[str, ...] = ()                # what its own updates did, a line each


class Target:
    """A place where an exported mission flies behind the registers of its boards."""

    name = ""
    about = ""
    emulated = False
    # the mission's script composes it there: for missions that fit (docs/micropython.md)
    composes = False
    needs: tuple[str, ...] = ()     # programs that are not always there
    profiled_by = ""                # how `fledge profile` measures it: fledge.profile.METHODS; "": it cannot

    def missing(self) -> list[str]:
        """The programs that are not installed."""
        return [one for one in self.needs if not shutil.which(one)]

    def build(self, part: Part) -> Path:
        """Build a flight process for this target, in part.folder / name; only what changed. Returns what `command`
        starts."""
        raise NotImplementedError

    def command(self, built: Path, record: str) -> list[str]:
        """The arguments that start it: {registers} stands for the register file; it writes all outputs of flight into
        `record`, a file in its working directory, and at its end prints lines of a key and a value, at least ticks and
        cpu_ns; what a script of its own did has keys that begin with "script."."""
        raise NotImplementedError

    def sizes(self, built: Path) -> tuple[int | None, int | None]:
        """(bytes of code and constants, bytes of memory), without the C library; None: not known."""
        return None, None

    def advice(self, log: str) -> str:
        """What a user may do about a flight that ended early with this log; "" if that is not known."""
        return ""

    def prepared(self, part: Part, options: list[Any], timeout: float) -> tuple[list[Any], Callable[..., Flown]]:
        """(the command of its node in a run, a function from the figures that this prints to a Flown)."""
        built, record = self.build(part), new_record(part.folder, self.name)
        return (loop.board_node(part, [*options, "--node", part.process, "--reply", timeout],
                                self.command(built, record.name), self.name),
                lambda figures: self._flown(built, record, figures))

    def fly(self, job: Job, timeout: float = 60.0) -> dict[str, Flown]:
        """Build and fly a job in the closed loop, all its flight processes here; returns a Flown of each."""
        return fly(job, {part.process: self for part in job.parts}, self.name, timeout)

    def join(self, part: Part, address: str, simulation: str, node: str, keys: Path | str | None = None) -> Flown:
        """The same of one process, as a node of a run whose controller is at `address`; keys: of the node, else
        FLEDGE_KEYS."""
        built, record = self.build(part), new_record(part.folder, self.name)
        return self._flown(built, record, loop.join(part, self.command(built, record.name), self.name, address,
                                                    simulation, node, keys))

    def _flown(self, built, record, figures):
        code, memory = self.sizes(built)
        return Flown(record, int(figures["ticks"]), float(figures["cpu_ns"]) / 1e9, "emulated" if self.emulated else "",
                     code, memory, *(sum(int(figures.get(k, 0)) for k in keys) for keys in (
                         ("saturated", "outside_saturated"), ("lost", "skipped", "outside_skipped"))),
                     heap=_heap(figures.get("heap", "")),
                     script=tuple(f"{key.removeprefix('script.')} {text}" for key, text in figures.items()
                                  if key.startswith("script.")))


def _heap(marks):
    """(used at the start, at the end, at most) of marks "tick:used:peak ..."."""
    found = [tuple(map(int, mark.split(":"))) for mark in marks.split()]
    return (found[0][1], found[-1][1], found[-1][2]) if found else None


def fly(job: Job, on: Mapping[str, Target], name: str, timeout: float = 60.0) -> dict[str, Flown]:
    """Build and fly a job in the closed loop, each flight process on its target, those that are not named on the
    desktop's code; returns a Flown of each. name: of the log."""
    for process in on:
        job.part(process)
    options = loop.meeting(job)
    nodes = {part.process: on.get(part.process, DESKTOP).prepared(part, options, timeout) for part in job.parts}
    try:
        figures = loop.close(job, {process: node[0] for process, node in nodes.items()}, name, options, timeout)
    except Failure as failure:
        log = (job.folder / f"{name}.log").read_text(encoding="utf-8", errors="replace")
        advice = next(filter(None, (target.advice(log) for target in on.values())), "")
        raise Failure(f"{advice}\n{failure}", failure.code) if advice else failure from None
    return {process: flown(figures[process]) for process, (_, flown) in nodes.items()}


def new_record(folder: Path, name: str) -> Path:
    """The path of a record; that of an earlier flight is deleted."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.mcap"
    for old in (path, path.with_name(path.name + ".part")):
        old.unlink(missing_ok=True)
    return path


class Desktop(Target):
    """The run in one program, with which the other targets are compared. Beside targets, a `fledge node`."""

    name = "desktop"
    about = "the run in one program, under Python"
    profiled_by = "desktop"

    def prepared(self, part: Part, options: list[Any], timeout: float) -> tuple[list[Any], Callable[..., Flown]]:
        record = new_record(part.folder, "node")
        script = ["--script", part.write_script()] if part.script else []
        command = loop.python_node(part.job, part.process, [*options, "--patience", timeout, "--outputs", record,
                                                            *script])

        def flown(_: dict[str, str]) -> Flown:
            with Archive(record) as archive:
                return Flown(record, steps(part, archive), None, "")

        return command, flown

    def fly(self, job: Job, timeout: float = 60.0) -> dict[str, Flown]:
        sim = job.begun()
        for part in job.parts:
            flight = sim.process(part.process)
            sim.record(*(getattr(getattr(flight, one), port) for one, port in
                         (m.path.split(".")[1:] for m in part.mission.outputs)), every=part.step() / 1e9)
            # What comes before the first run waits already.
            flight.commands.script([one for one in part.script if one.t >= 0])
        record = new_record(job.folder, self.name)
        sim.archive(record, mission=sim.name, target="desktop")
        start = process_time()
        try:
            sim.run(until=job.duration)
        finally:
            sim.close_archive()
        spent = process_time() - start
        with Archive(record) as archive:
            for part in job.parts:
                times = archive.time_ns(part.outputs[0])
                for start, end in sim.process(part.process).outages:
                    times = times[(times < start) | (times >= end)]
                part.instants = times[part.is_instant(times)]
        total = sum(len(part.instants) for part in job.parts)
        return {part.process: Flown(record, len(part.instants), spent / total if total else None, "world too")
                for part in job.parts}


def steps(part: Part, archive: Archive) -> int:
    """How many instants of a flight process a record has."""
    return int(part.is_instant(archive.time_ns(part.outputs[0])).sum())


class Linux(Target):
    """A process of its own, targets/linux."""

    name = "linux"
    about = "a process of its own on this machine"
    profiled_by = "process"
    compiler, size = "gcc", "size"
    link: tuple[str, ...] = ("-static", "-no-pie")  # one file, for a board, and for emulators without libraries
    runner: tuple[str, ...] = ()
    needs: tuple[str, ...] = ("gcc",)

    def build(self, part: Part) -> Path:
        sources = [*part.sources(), *(build.ROOT / path for path in build.RUNNER)]
        return build.program(part.folder / self.name, part.mission.name, sources, part.includes(), self.compiler,
                             flags=["-fno-pie"], link=self.link)

    def command(self, built: Path, record: str) -> list[str]:
        return [*self.runner, str(built.resolve()), "--record", record, "{registers}"]

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built, self.size)


class Aarch64(Linux):
    """The Linux target, cross-built, under an emulator."""

    name = "aarch64"
    about = "the same for a Raspberry Pi, under qemu-user"
    emulated = True
    profiled_by = ""
    compiler, size, runner = "aarch64-linux-gnu-gcc", "aarch64-linux-gnu-size", ("qemu-aarch64",)
    needs = (compiler, *runner)


class Sparc64(Aarch64):
    """The Linux target on a machine of the other byte order, under an emulator."""

    name = "sparc64"
    about = "the same for a big-endian machine, under qemu-user"
    compiler, size, runner = "sparc64-linux-gnu-gcc", "sparc64-linux-gnu-size", ("qemu-sparc64",)
    needs = (compiler, *runner)


def on_this_machine(target: Target) -> bool:
    """Whether it is a process of this machine's own kind, as valgrind and the clock need it."""
    return target.profiled_by == "process"


DESKTOP = Desktop()
TARGETS = {one.name: one for one in (DESKTOP, Linux(), Aarch64(), Sparc64())}
