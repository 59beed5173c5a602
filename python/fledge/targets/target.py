# SPDX-License-Identifier: Apache-2.0
"""The places where a mission flies. A target builds the exported C, and gives the command that starts it, and its
size; all else is the same for all targets. To add one: a Target, and a line in TARGETS."""
from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

from fledge.archive import Archive
from fledge.targets import build, loop

if TYPE_CHECKING:
    from fledge.targets.job import Job


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


class Target:
    """A place where an exported mission flies behind the registers of its boards."""

    name = ""
    about = ""
    emulated = False
    needs: tuple[str, ...] = ()     # programs that are not always there

    def missing(self) -> list[str]:
        """The programs that are not installed."""
        return [one for one in self.needs if not shutil.which(one)]

    def build(self, job: Job) -> Path:
        """Build the job for this target, in job.folder / name; only what changed. Returns what `command` starts."""
        raise NotImplementedError

    def command(self, built: Path, record: str) -> list[str]:
        """The arguments that start it: {registers} stands for the register file; it writes all outputs of flight into
        `record`, a file in its working directory, and at its end prints lines of a key and a value, at least ticks and
        cpu_ns."""
        raise NotImplementedError

    def sizes(self, built: Path) -> tuple[int | None, int | None]:
        """(bytes of code and constants, bytes of memory), without the C library; None: not known."""
        return None, None

    def record(self, job: Job) -> Path:
        """The path of its record; the record of an earlier flight is deleted."""
        job.folder.mkdir(parents=True, exist_ok=True)
        path = job.folder / f"{self.name}.mcap"
        for old in (path, path.with_name(path.name + ".part")):
            old.unlink(missing_ok=True)
        return path

    def fly(self, job: Job, timeout: float = 60.0) -> Flown:
        """Build and fly a job in the closed loop; returns a Flown."""
        built, record = self.build(job), self.record(job)
        return self._flown(built, record, loop.close(job, self.command(built, record.name), self.name, timeout))

    def join(self, job: Job, address: str, simulation: str, node: str = "flight",
             keys: Path | str | None = None) -> Flown:
        """The same as a node of a run whose controller is at `address`; keys: of the node, else FLEDGE_KEYS."""
        built, record = self.build(job), self.record(job)
        return self._flown(built, record, loop.join(job, self.command(built, record.name), self.name, address,
                                                    simulation, node, keys))

    def _flown(self, built, record, figures):
        code, memory = self.sizes(built)
        return Flown(record, int(figures["ticks"]), float(figures["cpu_ns"]) / 1e9, "emulated" if self.emulated else "",
                     code, memory, *(sum(int(figures.get(k, 0)) for k in keys) for keys in (
                         ("saturated", "outside_saturated"), ("lost", "skipped", "outside_skipped"))))


class Desktop(Target):
    """The run in one program; the other targets are compared with it."""

    name = "desktop"
    about = "the run in one program, under Python"

    def fly(self, job: Job, timeout: float = 60.0) -> Flown:
        sim = job.start.clone()
        sim.record(*(getattr(getattr(sim.flight, one), port) for one, port in
                     (m.path.split(".")[1:] for m in job.mission.outputs)), every=job.step() / 1e9)
        record = self.record(job)
        sim.archive(record, mission=sim.name, target="desktop")
        start = process_time()
        try:
            for load in job.loads:
                sim.run(until=load.after / 1e9)
                sim.restore(load.snapshot)
            sim.run(until=job.duration)
        finally:
            sim.close_archive()
        spent = process_time() - start
        with Archive(record) as archive:
            steps = int(job.is_instant(archive.time_ns(job.outputs[0])).sum())
        return Flown(record, steps, spent / steps, "world too")


class Linux(Target):
    """A process of its own, targets/linux."""

    name = "linux"
    about = "a process of its own on this machine"
    compiler, size = "gcc", "size"
    runner: tuple[str, ...] = ()
    needs: tuple[str, ...] = ("gcc",)

    def build(self, job: Job) -> Path:
        sources = [*job.sources(), *(build.ROOT / path for path in build.RUNNER)]
        # Static: one file, which can be copied to a board, and for which an emulator needs no libraries.
        return build.program(job.folder / self.name, job.mission.name, sources, job.includes(), self.compiler,
                             flags=["-fno-pie"], link=["-static", "-no-pie"])

    def command(self, built: Path, record: str) -> list[str]:
        return [*self.runner, str(built.resolve()), "--record", record, "{registers}"]

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built, self.size)


class Aarch64(Linux):
    """The Linux target, cross-built, under an emulator."""

    name = "aarch64"
    about = "the same for a Raspberry Pi, under qemu-user"
    emulated = True
    compiler, size, runner = "aarch64-linux-gnu-gcc", "aarch64-linux-gnu-size", ("qemu-aarch64",)
    needs = (compiler, *runner)


class Sparc64(Aarch64):
    """The Linux target on a machine of the other byte order, under an emulator."""

    name = "sparc64"
    about = "the same for a big-endian machine, under qemu-user"
    compiler, size, runner = "sparc64-linux-gnu-gcc", "sparc64-linux-gnu-size", ("qemu-sparc64",)
    needs = (compiler, *runner)


TARGETS = {one.name: one for one in (Desktop(), Linux(), Aarch64(), Sparc64())}
