# SPDX-License-Identifier: Apache-2.0
"""A flight of a job on its targets, in the closed loop."""
from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from fledge.errors import Failure
from fledge.targets import TARGETS, loop

if TYPE_CHECKING:
    from fledge.targets.flown import Flown
    from fledge.targets.job import Job
    from fledge.targets.target import Target


def fly(job: Job, on: Mapping[str, Target], name: str, timeout: float = 60.0, pace: float = 0.0) -> dict[str, Flown]:
    """Build and fly a job in the closed loop, each flight process on its target, those that are not named on the
    desktop's code; returns a Flown of each. name: of the log. pace: simulated seconds per second; 0: as fast as
    possible."""
    for process in on:
        job.part(process)
    options = loop.meeting(job)
    nodes = {part.process: on.get(part.process, TARGETS["desktop"]).prepared(part, options, timeout)
             for part in job.parts}
    try:
        figures = loop.close(job, {process: node[0] for process, node in nodes.items()}, name, options, timeout,
                             pace)
    except Failure as failure:
        path = job.folder.resolve() / f"{name}.log"
        log = path.read_text(encoding="utf-8", errors="replace")
        for target in on.values():
            if reason := target.reason(log):
                raise Failure(f"{reason}; the whole log is {path}", failure.code) from None
        advice = next(filter(None, (target.advice(log, job.part(process)) for process, target in on.items())), "")
        raise Failure(f"{advice}\n{failure}", failure.code) if advice else failure from None
    return {process: flown(figures[process]) for process, (_, flown) in nodes.items()}
