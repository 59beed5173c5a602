# SPDX-License-Identifier: Apache-2.0
"""One mission on several targets, in the same closed loop: exported, built, flown, and compared with the desktop.

    rehearsal.py  a scenario on the desktop: its set-up, its duration, and what it changes between its runs
    job.py        what is flown: a mission's scenario, exported, and for how long
    build.py      builds C by ninja, and measures the size of programs
    target.py     the targets: the desktop, a Linux process, the same for aarch64 and sparc64
    cfs.py        the target that is an app of the core Flight System
    leon3.py      the targets on a LEON3 board; leon3_toolchain.py has its compiler and C library
    console.py    a program that flies by this machine's clock and takes commands
    inputs.py     what flight reads on the desktop, as a file that a process plays
    clock.py      a process by the machine's clock, with histograms
    micropython.py  the targets whose interpreter composes the mission; micropython_toolchain.py builds the interpreter
    procedures.py sends a file to flight, which runs it as a procedure
    loop.py       the programs of one flight: controller, world, and the node of the target's board
    table.py      the table that `fledge fly` prints
"""

from fledge.targets.job import Job, Part
from fledge.targets.cfs import Cfs, RealCfs
from fledge.targets.leon3 import Leon3, Leon3Cfs, Leon3Qemu
from fledge.targets.micropython import (Leon3MicroPython, Leon3MicroPythonQemu, MicroPython,
                                        MicroPythonDevelopment)
from fledge.targets.procedures import procedure
from fledge.targets.target import TARGETS, Flown, Target, fly

TARGETS |= {one.name: one for one in (Cfs(), Leon3(), Leon3Qemu(), Leon3Cfs(), MicroPython(),
                                      MicroPythonDevelopment(), Leon3MicroPython(), Leon3MicroPythonQemu())}

__all__ = ["TARGETS", "Flown", "Job", "Part", "RealCfs", "Target", "fly", "procedure"]
