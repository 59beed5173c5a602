# SPDX-License-Identifier: Apache-2.0
"""Profiles of a flight process on several targets, each measured in the way of its target."""
from __future__ import annotations

from collections.abc import Sequence

from fledge.errors import Failure
from fledge.profile import board, desktop, process as processes
from fledge.profile.measure import Profile
from fledge.targets import TARGETS, Job
from fledge.targets.desktop import Desktop

METHODS = {"process": processes.measure, "board": board.measure, "desktop": desktop.measure}     # Target.profiled_by


def profile(job: Job, names: Sequence[str], process: str | None = None) -> list[Profile]:
    """Profile a flight process of a job on these targets; None: the only one."""
    if process is None and len(job.parts) > 1:
        raise Failure(f"{job.title} has several flight processes; choose one with --process: "
                      + ", ".join(one.process for one in job.parts))
    part = job.part(process) if process else job.parts[0]
    for name in names:
        if name not in TARGETS or not TARGETS[name].profiled_by:
            can = [one.name for one in TARGETS.values() if one.profiled_by]
            raise Failure(f"profile: cannot profile on '{name}'; there are {', '.join(can)}")
    targets = TARGETS.ready(names, "profile")
    flown = Desktop().fly(job)[part.process]
    return [METHODS[one.profiled_by](one, part, flown.record) for one in targets]
