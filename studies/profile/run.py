# SPDX-License-Identifier: Apache-2.0
"""Profiles of a flight process on several targets, each measured in the way of its target."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from fledge.archive import Archive
from fledge.errors import Failure
from fledge.profile import board, desktop, line, process as processes
from fledge.profile.measure import Profile
from fledge.records.activity import modes
from fledge.targets import TARGETS, Job
from fledge.targets.desktop import Desktop

if TYPE_CHECKING:
    from pathlib import Path

    from fledge.targets.job import Part

METHODS = {"process": processes.measure, "board": board.measure, "line": line.measure,
           "desktop": desktop.measure}      # Target.profiled_by


def profile(job: Job, names: Sequence[str], process: str | None = None,
            progress: Callable[[str, int], Any] = lambda name, done: None) -> list[Profile]:
    """Profile a flight process of a job on these targets; None: the only one. progress(the target, how many are done):
    before each."""
    if process is None and len(job.parts) > 1:
        raise Failure(f"{job.title} has several flight processes; choose one with --process: "
                      + ", ".join(part.process for part in job.parts))
    part = job.part(process) if process else job.parts[0]
    for name in names:
        if name not in TARGETS or not TARGETS[name].profiled_by:
            can = [target.name for target in TARGETS.values() if target.profiled_by]
            raise Failure(f"profile: cannot profile on '{name}'; there are {', '.join(can)}")
    targets = TARGETS.ready(names, "profile")
    flown = Desktop().fly(job)[part.process]
    profiles: list[Profile] = []
    for target in targets:
        progress(target.name, len(profiles))
        profiles.append(METHODS[target.profiled_by](target, part, flown.record))
        profiles[-1].changes = _changes(part, flown.record)
    return profiles


def _changes(part: Part, path: Path) -> list[int]:
    """The cycles at which the mode of a process changes."""
    import numpy as np

    with Archive(path) as record:
        stays = modes(record).get(part.process, [])
    return np.searchsorted(part.instants, [round(t * 1e9) for t, _ in stays[1:]]).tolist()
