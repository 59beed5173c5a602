# SPDX-License-Identifier: Apache-2.0
"""What an exchange costs: a tick between programs, against bare means of this machine.

All cases take turns, so that a slow spell of the machine meets all alike; each is a program of its own
that starts its nodes as further programs. A figure is the median over these turns, each of which is
the median over groups of rounds.

- `libzmq_req_rep`: 64 bytes there and back over bare sockets, between two programs.
- `tick_*`: one node gets 64 bytes in a tick and returns 64 bytes in its tock, both complete.
- `pair_*`: two nodes that step one after the other, against two round trips.
"""
import pathlib
import subprocess

from bench.rows import Rows, options, report


def program():
    from fledge import _core
    return str(pathlib.Path(_core.__file__).with_name("fledge_bench_cosim"))


def rounds(case, transport="-", nodes=1, n=4000):
    """The time of a round [us]."""
    out = subprocess.run([program(), case, transport, str(nodes), str(n)], check=True, capture_output=True,
                         text=True).stdout
    return float(out) * 1e-3


def pair_by_pair(ours, theirs, scale=1.0):
    """In words, the median of the ratios within each turn: what a slow spell cannot bend."""
    ratios = sorted(a / (scale * b) for a, b in zip(ours, theirs))
    return f"{ratios[len(ratios) // 2]:.3g} pair by pair"


CASES = {
    "req_rep_ipc": ("req_rep", "ipc"), "tick_ipc": ("tick", "ipc"), "pair_ipc": ("pair", "ipc"),
    "req_rep_tcp": ("req_rep", "tcp"), "tick_tcp": ("tick", "tcp"), "pair_tcp": ("pair", "tcp"),
}


def main(arguments):
    chosen = options("cosim", arguments, 9)
    rows = Rows()
    samples = {name: [] for name in CASES}
    for i in range(chosen.runs + 1):
        for name, case in CASES.items():
            sample = rounds(*case)
            if i:  # the first warms up
                samples[name].append(sample)

    for transport in ("ipc", "tcp"):
        bare, tick, pair = (samples[f"{name}_{transport}"] for name in ("req_rep", "tick", "pair"))
        figure = f"{transport} round trip"
        rows.add("libzmq_req_rep", figure, bare, "us")
        rows.add(f"tick_{transport}", figure, tick, "us", "libzmq_req_rep", note=pair_by_pair(tick, bare))
        figure = f"two {transport} round trips"
        rows.add("libzmq_req_rep", figure, [2 * t for t in bare], "us")
        rows.add(f"pair_{transport}", figure, pair, "us", "libzmq_req_rep", note=pair_by_pair(pair, bare, 2.0))
    report(rows, chosen)
