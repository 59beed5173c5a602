# SPDX-License-Identifier: Apache-2.0
"""For tests: a board that is a process of this machine, on the other end of a serial line. process.c has the
list of its arguments."""
from fledge.targets import bare, build


class Process(bare.Process):
    name = "process"
    about = "a board that is a process"
    cpu_of = "this machine"
    compiler = "gcc"
    flags = ("-g0",)    # what names no folder is compiled once for all folders
    sources = (build.ROOT / "targets/bare/testing/process.c", *bare.Process.sources)
    emulator = ("{program}", "{line}")
    needs = (compiler,)
