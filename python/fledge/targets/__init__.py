# SPDX-License-Identifier: Apache-2.0
"""One mission on several targets, in the same closed loop: exported, built, flown, and compared with the desktop.

    rehearsal.py  a scenario on the desktop: its set-up, duration, and what it changes on the way
    job.py        what is flown: a mission's scenario, exported, and for how long
    build.py      C to programs, by ninja; how large they are
    target.py     where it flies: the desktop, a Linux process, the same for aarch64
    cfs.py        and as an app of the core Flight System
    loop.py       the programs of one flight: controller, world, and the node of the target's board
    table.py      the one table
"""

from fledge.targets.job import Job
from fledge.targets.cfs import Cfs, RealCfs
from fledge.targets.target import TARGETS, Flown, Target

TARGETS[Cfs.name] = Cfs()

__all__ = ["TARGETS", "Flown", "Job", "RealCfs", "Target"]
