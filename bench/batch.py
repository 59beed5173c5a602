# SPDX-License-Identifier: Apache-2.0
"""How fast clones of the nadir spin are stepped together, in world steps of 0.1 s: its loop of world and flight, with
the attitude error as observation and no actions, or with the wheels' torques as actions.

Batches of one and of two threads take turns with single runs of the same length, and with 1, 10 and 100 world steps per
call, for few clones, whose memory a core's cache holds, and for many.
"""
from __future__ import annotations

import time

import fledge
from fledge.units import s

from bench.rows import Rows, in_turn, median_ratio, options, report

CLONES = (64, 1024)
CALLS = (1, 10, 100)
STEPS = 400_000     # world steps of a sample
OBSERVED = ["flight.tracking.error.sigma_BR", "flight.tracking.error.omega_BR_B"]


def measure(work, steps):
    """(world steps a second [1e6], processor time of one [ns])"""
    start, cpu = time.perf_counter(), time.process_time()
    work()
    return 1e-6 * steps / (time.perf_counter() - start), 1e9 * (time.process_time() - cpu) / steps


def batched(sim, clones, per_call, threads, actions=()):
    """A function that takes a sample."""
    import numpy as np

    batch = sim.batch(clones, actions, OBSERVED, every=0.1 * per_call * s, threads=threads)
    given = np.zeros((clones, len(batch.action_names)))
    batch.reset()
    calls = max(STEPS // (clones * per_call), 3)

    def work():
        for _ in range(calls):
            batch.step(given)
    return lambda: measure(work, calls * clones * per_call)


def single(sim):
    def sample():
        sim.reset()
        return measure(lambda: sim.run(0.1 * STEPS * s), STEPS)
    return sample


def main(arguments: list[str]) -> None:
    chosen = options("batch", arguments, 7)
    rows = Rows()
    sim = fledge.load("nadir_spin")
    cases = {"single run": single(sim)}
    for clones in CLONES:
        for per_call in CALLS:
            for threads in (1, 2):
                cases[f"{clones} clones, {per_call} a call, {threads} threads"] = batched(
                    sim, clones, per_call, threads)
    cases[f"{CLONES[0]} clones, 10 a call, 2 threads, torques given"] = batched(
        sim, CLONES[0], 10, 2, ["world.wheels.command.u"])
    samples = in_turn(cases, chosen.runs)
    alone = [rate for rate, _ in samples["single run"]]
    for name, found in samples.items():
        rates = [rate for rate, _ in found]
        rows.add(name, "world steps", rates, "1e6/s",
                 note=f"{median_ratio(rates, alone):.3g} of the single run in turn")
    for name, found in samples.items():
        rows.add(name, "cpu of a step", [cpu for _, cpu in found], "ns", "single run" if name != "single run" else None)
    report(rows, chosen)
