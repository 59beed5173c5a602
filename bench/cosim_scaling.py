# SPDX-License-Identifier: Apache-2.0
"""How many programs the exchange carries: the mission constellation with a program for each process.

N spacecraft are 2 N programs, which hear each other in a ring, and one controller. Each figure is from the
first to the last instant, without starting the programs. The same in one program is what the physics costs.

Where a tick's time goes: processor time of all programs, by a run of ten spans less one of one span, so that starts and
ends cancel. What the programs did not use of the processors is idle, or another program's.
"""
from __future__ import annotations
import os
import resource
import time
from dataclasses import dataclass

from bench.rows import Rows, options, report

SPAN = 120.0  # [s] of simulated time
PROGRAMS = 128


@dataclass
class Flown:
    """What a run in several programs took."""

    ticks: int
    wall: float     # [s] of them
    alone: float    # [s], the same in one program
    spent: list     # [s] of the processors: controller's own, its kernel's, nodes' own, their kernel's; switches


def _usage(of):
    used = resource.getrusage(of)
    return [used.ru_utime, used.ru_stime, used.ru_nvcsw + used.ru_nivcsw]


def fly(mission, span, sharing="allowed", **parameters) -> Flown:
    import fledge
    from fledge import cosim
    from fledge.cli.cosim.node import Programs

    sim = fledge.load(mission, **parameters)
    names = [process.name for process in sim.processes]
    crossing = cosim.checked_wires(sim)
    address = f"ipc://@fledge-scaling-{os.getpid()}-{len(names)}"
    before = _usage(resource.RUSAGE_SELF) + _usage(resource.RUSAGE_CHILDREN)
    with Programs() as programs:
        for name in names:
            programs.start(name, lambda name=name: cosim.split(sim, name, crossing).serve(address) != "")
        controller = cosim.Controller(mission, names, span, address=address, sharing=sharing)
        ended = controller.run()
        failed = programs.wait()
    if ended or failed:
        raise SystemExit(f"{mission} in {len(names)} programs: {ended or failed[0]}")
    after = _usage(resource.RUSAGE_SELF) + _usage(resource.RUSAGE_CHILDREN)
    user, system, switches, *nodes = (b - a for a, b in zip(before, after, strict=True))
    times = controller.times
    sim.reset()
    begun = time.perf_counter()
    sim.run(span)
    # All the time since a node was ready is computing, on the way, or waiting.
    return Flown(sum(t[0] for t in times.values()), max(sum(t[1:]) for t in times.values()),
                 time.perf_counter() - begun, [user, system, *nodes[:2], switches + nodes[2]])


def measure(rows, runs):
    """Add the figures of 2 to 64 spacecraft."""
    for spacecraft in (1 << k for k in range(1, 7)):
        flown = [fly("constellation", SPAN, spacecraft=spacecraft) for _ in range(runs)]
        figure = f"{2 * spacecraft} programs"
        rows.add("one_program", figure, [SPAN / run.alone for run in flown], "s/s")
        rows.add("constellation", figure, [SPAN / run.wall for run in flown], "s/s", "one_program",
                 note=f"{flown[0].ticks} ticks")
        rows.add("constellation", f"{figure}, ticks", [run.ticks / run.wall for run in flown], "1/s")


def measure_shares(rows, runs, rounds):
    """Add where the time of a tick goes with 128 programs, in turn with a barrier of as many programs.

    rounds(case, transport, nodes, n): the time of a round [us]
    """
    processors = os.cpu_count() or 1
    figure = f"{PROGRAMS} programs, a tick"
    parts = ("constellation", "controller", "its kernel", "nodes", "their kernel", "idle", "changes of context")
    samples: dict[str, list] = {"futex_barrier": [], **{part: [] for part in parts}}
    for _ in range(runs):
        samples["futex_barrier"].append(rounds("barrier", "-", PROGRAMS, 1000) / PROGRAMS)
        short, long = (fly("constellation", k * SPAN, spacecraft=PROGRAMS // 2) for k in (1, 10))
        ticks = long.ticks - short.ticks
        *spent, switches = ((b - a) / ticks for a, b in zip(short.spent, long.spent, strict=True))
        wall = (long.wall - short.wall) / ticks
        for part, value in zip(parts, [wall, *spent, processors * wall - sum(spent)]):
            samples[part].append(1e6 * value)
        samples["changes of context"].append(switches)
    rows.add("futex_barrier", figure, samples["futex_barrier"], "us")
    for part in parts:
        rows.add(part, figure, samples[part], "-" if part == "changes of context" else "us",
                 "futex_barrier" if part == "constellation" else None)


def main(arguments: list[str]) -> None:
    from bench.cosim import rounds

    chosen = options("cosim_scaling", arguments, 3)
    rows = Rows()
    measure(rows, chosen.runs)
    measure_shares(rows, chosen.runs, rounds)
    report(rows, chosen)
