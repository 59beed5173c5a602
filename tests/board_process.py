# SPDX-License-Identifier: Apache-2.0
"""For tests: a board that is a process of this machine, on the other end of a serial line. process.c tells its
arguments."""
from fledge.targets import build
from fledge.targets.bare import Bare


class Process(Bare):
    name = "process"
    about = "a board that is a process"
    cpu_of = "this machine"
    compiler = "gcc"
    library = ()
    start = False
    sources = (build.ROOT / "targets/bare/testing/process.c",)
    scripts = (build.ROOT / "targets/linux/line.ld",)
    emulator = ("{program}", "{line}")
    needs = (compiler,)
