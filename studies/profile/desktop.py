# SPDX-License-Identifier: Apache-2.0
"""The same mission under CPython: flight, world and the kernel in one process. Two runs under Massif, of which one only
makes the mission ready, tell initialisation from the loop."""
from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.errors import Failure
from fledge.profile import valgrind
from fledge.profile.measure import Profile
from fledge.targets.loop import environment

if TYPE_CHECKING:
    from fledge.targets import Part

NOISE = 0.1     # of the start: its instructions differ between runs by a part of that; a shorter loop is not measured

# It ends at once: what CPython does at its end belongs to neither part.
PROGRAM = """
import os, resource
import fledge
sim = fledge.load({mission!r}, **{parameters!r})
sim.seed = {seed}
sim.prepare()
before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
if {duration}:
    sim.run({duration}, progress=False)
print("seconds", resource.getrusage(resource.RUSAGE_SELF).ru_utime - before, flush=True)
os._exit(0)
"""


def measure(target: Any, part: Part, record: Path) -> Profile:
    job = part.job
    folder = (part.folder / "profile_desktop").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    cycles = len(part.instants)

    def command(duration: float | None) -> list[str]:
        return [sys.executable, "-P", "-c", PROGRAM.format(mission=mission_of(job), parameters=job.parameters,
                                                           seed=job.seed, duration=duration)]

    done = subprocess.run(command(job.duration), cwd=folder, env=environment(), capture_output=True, text=True)
    if done.returncode:
        raise Failure(f"profile: the mission does not fly by itself:\n{done.stderr.strip()}", 1)
    # Python's own allocator takes its memory by mmap, which Massif does not see.
    under = {**environment(), "PYTHONMALLOC": "malloc", "PYTHONHASHSEED": "0"}
    ready = valgrind.massif(command(0.0), folder, False, under)
    whole = valgrind.massif(command(job.duration), folder, False, under)
    begin = ready[-1].time
    spent = whole[-1].time - begin
    measured = spent > NOISE * begin
    per_cycle = spent / cycles if measured else 0.0
    during = [sample for sample in whole if sample.time >= begin] if measured else []
    return Profile(
        target.name, "Valgrind; Python, flight and world in one process", cycles, strict=False,
        init_instructions=begin, init_heap=max(sample.heap for sample in ready),
        instructions=[(0, per_cycle)] if measured else [],
        heap=[(min(cycles, round((sample.time - begin) / per_cycle)), sample.heap) for sample in during],
        loop_heap=max((sample.heap for sample in during), default=None),
        time={"mean": float(done.stdout.split()[1]) / cycles}, time_of="world too",
        executable=Path(sys.executable).resolve().stat().st_size, total_instructions=whole[-1].time)


def mission_of(job: Any) -> str:
    """The mission's name, or its folder from anywhere."""
    return os.path.abspath(job.source) if os.path.isdir(job.source) else job.source
