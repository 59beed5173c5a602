# SPDX-License-Identifier: Apache-2.0
"""What a serial line costs a tick: flights in lock step on a board that is a process, behind a wire of each baud rate.

The wire, a process here, passes each byte not before it would have arrived at its rate, 10 bits a byte, both ways at
once. The board computes as fast as this machine, so the line's cost shows alone: `answer` is the time from a tick to
its answer, of which the board's computing and the processes on the way take what `no wire` shows. With the record of
flight, its bytes pass before the next tick; without, only what registers carry. The record's head counts, too.

`ticks a second` is what the answers alone leave room for. `bytes at 10 Hz` is how many bytes a tick, both ways, a
mission may have that answers within 100 ms at this rate: the wire's time of those bytes beside the rest of the answer.
"""
from __future__ import annotations

import collections
import os
import select
import socket
import subprocess
import sys
import time
import tty
from pathlib import Path
from typing import Any

from bench.rows import Rows, in_turn, options, report

BAUDS = (115200, 460800, 921600, 3000000)
MISSIONS = {"nadir_spin": ("spin", 20.0), "mars_orbiter": ("pointing", 20.0), "flatsat": ("manoeuvre", 20.0)}
RATE, PART = 10.0, 32       # [1/s] that a mission is to keep; [bytes] that the wire passes at once


def wire(baud: int, terminal: str, program: str) -> None:
    """Start the board, and pass bytes between it and the terminal; baud 0: at once."""
    line = os.open(terminal, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(line)
    ours, theirs = socket.socketpair()
    board = subprocess.Popen([program, str(theirs.fileno())], pass_fds=[theirs.fileno()])
    theirs.close()
    ends = (line, ours.fileno())
    ways: list[collections.deque[tuple[float, bytes]]] = [collections.deque(), collections.deque()]
    free = [0.0, 0.0]       # when the wire is idle again
    while board.poll() is None:
        due = min((way[0][0] for way in ways if way), default=time.monotonic() + 0.1)
        ready, _, _ = select.select(ends, [], [], max(due - time.monotonic(), 0.0))
        now = time.monotonic()
        for i, end in enumerate(ends):
            if end in ready:
                taken = os.read(end, 4096)
                if not taken:
                    return
                for at in range(0, len(taken), PART if baud else len(taken)):
                    part = taken[at:at + PART] if baud else taken
                    free[i] = max(free[i], now) + (10 * len(part) / baud if baud else 0.0)
                    ways[i].append((free[i], part))
            while ways[i] and ways[i][0][0] <= now:
                os.write(ends[1 - i], ways[i].popleft()[1])


def flights(mission: str, runs: int, rows: Rows) -> None:
    from fledge.disk import build_folder
    from fledge.targets import Job, build, fly
    from fledge.targets.bare import Process

    class AtRate(Process):
        cpu_of = "this machine"
        compiler = "gcc"
        sources = (build.ROOT / "targets/bare/testing/process.c", *Process.sources)

        def __init__(self, baud: int, record: bool) -> None:
            self.baud, self.record, self.figures = baud, record, {}
            self.name = f"{mission}-{baud}{'-record' if record else ''}"

        def node_options(self, built: Path, record: str) -> list[str]:
            return ["--line", f"pty?baud={self.baud or BAUDS[-1]}", *(["--line-record", record] * self.record)]

        def command(self, built: Path, record: str) -> list[str]:
            return [sys.executable, __file__, str(self.baud), "{line}", str(built.resolve())]

        def flown(self, built: Path, record: Path, figures: dict[str, str]) -> Any:
            self.figures = figures
            return super().flown(built, record, figures)

    scenario, duration = MISSIONS[mission]
    job = Job(mission, scenario, duration, folder=build_folder() / f"bench_line/{mission}")
    process = job.parts[0].process

    def flight(baud: int, record: bool) -> dict[str, float]:
        target = AtRate(baud, record)
        fly(job, {process: target}, target.name)
        return {key: float(target.figures[key]) for key in ("ticks", "cpu_ns", "line_bytes_sent", "line_bytes_taken",
                                                            "line_resent")}

    for record in (False, True):
        name = f"{mission}{' and record' if record else ''}"
        found = in_turn({baud: (lambda baud=baud: flight(baud, record)) for baud in (0, *BAUDS)}, runs)
        first = found[0][0]
        sent, taken = (first[f"line_bytes_{way}"] / first["ticks"] for way in ("sent", "taken"))
        rows.add(name, "to the board", sent, "bytes/tick")
        rows.add(name, "from the board", taken, "bytes/tick")
        rows.add(f"{name}, no wire", "answer", [1e-6 * each["cpu_ns"] for each in found[0]], "ms")
        for baud in BAUDS:
            case = f"{name}, {baud}"
            again = sum(each["line_resent"] for each in found[baud])
            answer = rows.add(case, "answer", [1e-6 * each["cpu_ns"] for each in found[baud]], "ms",
                              note=f"{again:.0f} frames were sent again: a busy machine" if again else "")
            rows.add(case, "ticks a second", 1e3 / answer, "1/s")
            rest = answer - 1e4 * (sent + taken) / baud
            rows.add(case, "bytes at 10 Hz", max((1e3 / RATE - max(rest, 0.0)) * baud / 1e4, 0.0), "bytes/tick")


def main(arguments: list[str]) -> None:
    chosen = options("line", arguments, runs=1, cases=list(MISSIONS))
    rows = Rows()
    for mission in chosen.cases or MISSIONS:
        flights(mission, chosen.runs, rows)
    report(rows, chosen)


if __name__ == "__main__":
    wire(int(sys.argv[1]), sys.argv[2], sys.argv[3])
