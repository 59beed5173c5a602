# SPDX-License-Identifier: Apache-2.0
"""A board behind a serial line, in the closed loop: QEMU makes an instruction a nanosecond of the board's time
(-icount), and targets/bare/count.c tells this time of each exchange; the program tells at its end what it needed of its
stack."""
from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any

from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.errors import Failure
from fledge.profile import code
from fledge.profile.measure import Profile
from fledge.targets import build, flown, loop

if TYPE_CHECKING:
    from pathlib import Path

    from fledge.targets import Part

MARKS = 60
COUNTED = ("-icount", "shift=0")     # of QEMU: an instruction takes a nanosecond


def measure(target: Any, part: Part, record: Path) -> Profile:
    parts, static = code.by_part(target.build(part))
    counted = copy.copy(target)
    counted.name = f"{target.name}_counted"
    counted.sources = (*target.sources, build.ROOT / "targets/bare/count.c")
    counted.link = (*target.link, "-Wl,--wrap=mission_host_exchange")
    counted.emulator = (*target.emulator, *COUNTED)
    options = loop.meeting(part.job)
    built, own = counted.build(part), flown.new_record(part.folder, counted.name)
    node = loop.board_node(part, [*options, "--node", part.process, *counted.node_options(built, own.name)],
                           counted.command(built, own.name), counted.name)
    figures = loop.close(part.job, {part.process: node}, counted.name, options)[part.process]

    n = int(figures["ticks"])
    steps = [int(figures[f"cycle_{i}"]) for i in range(n)]
    if n < 6:
        raise Failure(f"profile: {n} cycles are too few; fly longer with --for")
    every = max(1, n // MARKS)
    with Archive(record) as ours, Archive(own) as its:
        same = not compare(ours, its, part.outputs, times=part.is_instant)
    profile = Profile(target.name, "QEMU, in the closed loop: each exchange, without its record", n, same, code=parts,
                      static=static, executable=sum(parts.values()), time={"mean": sum(steps) / n / 1e9},
                      time_of="QEMU's count, 1 ns an instruction")
    profile.init_instructions = int(figures["cycle_first"])
    profile.instructions = [(i, sum(steps[i:i + every]) / len(steps[i:i + every])) for i in range(0, n, every)]
    profile.loop_stack = int(figures["stack_bytes"]) if "stack_bytes" in figures else None
    if " malloc" not in built.with_name(f"{built.name}.map").read_text(errors="replace"):
        profile.loop_heap = profile.allocations = 0     # there is no heap
    return profile
