# SPDX-License-Identifier: Apache-2.0
"""How fast Python's objects on C memory are: what a user's own loop around a module pays."""
from __future__ import annotations
import gc
import timeit

import fledge
from fledge import flight as fsw
from fledge.units import N, m, s

from bench.rows import Rows, options, report

STATEMENTS = [
    ("number", "get", "c.K"),
    ("number", "set", "c.K = x"),
    ("message", "view", "c.error"),
    ("array", "view", "c.P"),
    ("array in a message", "view", "c.error.sigma_BR"),
    ("array from a list", "set", "c.error.sigma_BR = three"),
    ("matrix from a number", "set", "c.P = x"),
    ("number with a unit", "set", "c.K = quantity"),
    ("module", "make", "MrpFeedback(K=2.5, P=45.0)"),
    ("module", "make with units", "MrpFeedback(K=K, P=P)"),
    ("module", "update", "c.update(0.5, 0.5)"),
    ("simulation", "step", "sim.step()"),
]


def main(arguments: list[str], runs: int = 9) -> None:
    chosen = options("objects", arguments, runs)
    rows = Rows()
    sim = fledge.load("nadir_spin")
    sim.reset()
    MrpFeedback = getattr(fsw, "MrpFeedback")
    names = dict(c=MrpFeedback(K=2.5, P=45.0), MrpFeedback=MrpFeedback, x=3.0, three=[0.1, 0.2, 0.3],
                 quantity=3 * N * m, K=2.5 * N * m, P=45 * N * m * s, sim=sim)
    gc.disable()

    def samples(statement):
        number = 20_000
        return [1e9 * t / number for t in timeit.repeat(statement, globals=names, number=number, repeat=chosen.runs)]

    empty = min(samples("pass"))
    for case, figure, statement in STATEMENTS:
        rows.add(case, figure, [t - empty for t in samples(statement)], "ns", note=statement)
    gc.enable()
    report(rows, chosen)
