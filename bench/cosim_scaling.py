# SPDX-License-Identifier: Apache-2.0
"""How many programs the exchange carries: the mission constellation with a program for each process.

N spacecraft are 2 N programs, which hear each other in a ring, and one controller. Each figure is from the
first to the last instant, without starting the programs. The same in one program is what the physics costs.
"""
from __future__ import annotations
import os
import time

from bench.rows import Rows, options, report

SPAN = 120.0  # [s] of simulated time


def fly(mission, span, sharing="allowed", **parameters):
    """(ticks, wall time of them [s], wall time of the same in one program [s])"""
    import fledge
    from fledge import cosim
    from fledge.cli.node import Programs

    sim = fledge.load(mission, **parameters)
    names = [process.name for process in sim.processes]
    crossing = cosim.checked_wires(sim)
    address = f"ipc://@fledge-scaling-{os.getpid()}-{len(names)}"
    with Programs() as programs:
        for name in names:
            programs.start(name, lambda name=name: cosim.split(sim, name, crossing).serve(address) != "")
        controller = cosim.Controller(mission, names, span, address=address, sharing=sharing)
        ended = controller.run()
        failed = programs.wait()
    if ended or failed:
        raise SystemExit(f"{mission} in {len(names)} programs: {ended or failed[0]}")
    times = controller.times
    sim.reset()
    begun = time.perf_counter()
    sim.run(span)
    # All the time since a node was ready is computing, on the way, or waiting.
    return sum(t[0] for t in times.values()), max(sum(t[1:]) for t in times.values()), time.perf_counter() - begun


def measure(rows, runs):
    """Add the figures of 2 to 64 spacecraft."""
    for spacecraft in (1 << k for k in range(1, 7)):
        flown = [fly("constellation", SPAN, spacecraft=spacecraft) for _ in range(runs)]
        figure = f"{2 * spacecraft} programs"
        rows.add("one_program", figure, [SPAN / alone for *_, alone in flown], "s/s")
        rows.add("constellation", figure, [SPAN / wall for _, wall, _ in flown], "s/s", "one_program",
                 note=f"{flown[0][0]} ticks")
        rows.add("constellation", f"{figure}, ticks", [ticks / wall for ticks, wall, _ in flown], "1/s")


def main(arguments: list[str]) -> None:
    chosen = options("cosim_scaling", arguments, 3)
    rows = Rows()
    measure(rows, chosen.runs)
    report(rows, chosen)
