# SPDX-License-Identifier: Apache-2.0
"""What an exchange costs: a tick between programs, against bare sockets and futexes of this machine.

All cases take turns, so that a slow spell of the machine meets all alike; each is a program of its own
that starts its nodes as further programs. A figure is the median over these turns, each of which is
the median over groups of rounds.

- `libzmq_req_rep`: 64 bytes there and back over bare sockets, between two programs.
- `tick_*`: one node gets 64 bytes in a tick and returns 64 bytes in its tock, both complete.
- `pair_*`: two nodes that step one after the other, against two round trips.
- `futex_barrier`: so many programs, released by one futex all at once; the last one wakes the first.
- `tick_shm_*`: so many nodes that step at once, 64 bytes to and from each, over shared memory; their
  partner lives in the controller's program.
- `nadir_spin`: the mission with world and flight in two programs, against `one_program_and_exchanges`: the
  same in one program, and for each tick a bare round trip.
- `constellation`: up to 128 programs on this machine, and where a tick's time goes (bench/cosim_scaling.py).
"""
from __future__ import annotations
import subprocess
from functools import partial

from bench import cosim_scaling
from bench.rows import Rows, in_turn, options, pair_by_pair, report

NADIR_SPAN = 9600.0  # [s] of simulated time


def program():
    from fledge.disk import build_folder
    return str(build_folder() / "python" / "fledge_bench_cosim")


def rounds(case, transport="-", nodes=1, n=4000):
    """The time of a round [us]."""
    out = subprocess.run([program(), case, transport, str(nodes), str(n)], check=True, capture_output=True,
                         text=True).stdout
    return float(out) * 1e-3


CASES = {
    "req_rep_ipc": ("req_rep", "ipc"), "tick_ipc": ("tick", "ipc"), "pair_ipc": ("pair", "ipc"),
    "req_rep_tcp": ("req_rep", "tcp"), "tick_tcp": ("tick", "tcp"), "pair_tcp": ("pair", "tcp"),
    "futex_1": ("barrier", "-", 1), "tick_shm_1": ("tick", "shm"),
    "futex_4": ("barrier", "-", 4), "tick_shm_4": ("hub", "shm", 4),
    "futex_16": ("barrier", "-", 16, 2000), "tick_shm_16": ("hub", "shm", 16, 2000),
}
SPINS = {"ipc": "forbidden", "shm": "required"}     # transport -> sharing of memory


def main(arguments: list[str]) -> None:
    chosen = options("cosim", arguments, 9)
    rows = Rows()
    samples = in_turn({**{name: partial(rounds, *case) for name, case in CASES.items()},
                       **{way: partial(cosim_scaling.fly, "nadir_spin", NADIR_SPAN, sharing)
                          for way, sharing in SPINS.items()}}, chosen.runs)

    for transport in ("ipc", "tcp"):
        bare, tick, pair = (samples[f"{name}_{transport}"] for name in ("req_rep", "tick", "pair"))
        figure = f"{transport} round trip"
        rows.add("libzmq_req_rep", figure, bare, "us")
        rows.add(f"tick_{transport}", figure, tick, "us", "libzmq_req_rep", note=pair_by_pair(tick, bare))
        figure = f"two {transport} round trips"
        twice = [2 * t for t in bare]
        rows.add("libzmq_req_rep", figure, twice, "us")
        rows.add(f"pair_{transport}", figure, pair, "us", "libzmq_req_rep", note=pair_by_pair(pair, twice))
    for nodes in (1, 4, 16):
        bare, tick = samples[f"futex_{nodes}"], samples[f"tick_shm_{nodes}"]
        figure = f"round of {nodes}"
        rows.add("futex_barrier", figure, bare, "us")
        rows.add(f"tick_shm_{nodes}", figure, tick, "us", "futex_barrier", note=pair_by_pair(tick, bare))
    for way, bare in (("ipc", samples["req_rep_ipc"]), ("shm", samples["futex_1"])):
        floor = sorted(bare)[len(bare) // 2] * 1e-6
        figure = f"nadir_spin, {way}"
        flown = samples[way]
        rows.add("one_program", figure, [run.alone for run in flown], "s")
        rows.add("one_program_and_exchanges", figure, [run.alone + run.ticks * floor for run in flown], "s")
        rows.add("nadir_spin", figure, [run.wall for run in flown], "s", "one_program_and_exchanges",
                 note=f"{flown[0].ticks} ticks")
    cosim_scaling.measure(rows, 1)
    cosim_scaling.measure_shares(rows, min(chosen.runs, 3), rounds)
    report(rows, chosen)
