# SPDX-License-Identifier: Apache-2.0
"""What judging requirements costs a run: the nadir spin with 20 formulas, looked at each instant and every 10 s, and
the Mars orbiter's safe scenario with its own requirements, beside the same runs without. The goal is 1.5 at each
instant, else 1.05.
"""
from __future__ import annotations

import time

import fledge
from fledge.requirements import Requirements, after, always, implies, never, settles, within
from fledge.requirements.declared import Declaration
from fledge.requirements.judge import Judged
from fledge.units import Quantity, minute, s

from bench.rows import Rows, in_turn, median_ratio, options, report

FORMULAS = 20


def formulas(sim, every):
    """So many over four signals of the nadir spin."""
    r = Declaration(sim)
    r.every = every
    signals = [r.signal(path).norm() for path in (
        "flight.tracking.error.sigma_BR", "flight.tracking.error.omega_BR_B", "world.craft.state.omega_BN_B")]
    signals.append(r.signal("flight.motor.command.u").max_abs())
    for i in range(FORMULAS):
        x, limit = signals[i % 4], 0.01 + 0.001 * i
        a, b = (x < Quantity(limit * factor, x.dims) for factor in (1, 2))
        r.require(f"R-{i}", "", [always(implies(after(10 * minute), a)), always(within(5 * minute, a)), never(~b),
                                 settles(a, within=20 * minute)][i // 4 % 4])
    return list(r._found.values())


def spin(every=None):
    sim = fledge.load("nadir_spin")
    watch = None
    if every is not None:
        watch = Judged(formulas(sim, every), sim)
        watch.watch(False)

    def sample():
        sim.reset()
        begin = time.perf_counter()
        sim.run(160 * minute)
        return time.perf_counter() - begin
    return sample


def orbiter(judged):
    def sample():
        sim = fledge.load("mars_orbiter")
        if judged:
            required = Requirements(sim)
            required.watch([requirement.id for requirement in required.for_scenario("safe")])
        begin = time.perf_counter()
        sim.run(20 * minute)
        return time.perf_counter() - begin
    return sample


def main(arguments: list[str]) -> None:
    chosen = options("requirements", arguments, 7)
    cases = {"nadir spin": spin(), "nadir spin, each instant": spin(0 * s), "nadir spin, every 10 s": spin(10 * s),
             "Mars orbiter": orbiter(False), "Mars orbiter, its requirements": orbiter(True)}
    samples = in_turn(cases, chosen.runs)
    rows = Rows()
    for name, found in samples.items():
        alone = samples[name.partition(",")[0]]
        rows.add(name, "run", [1e3 * seconds for seconds in found], "ms",
                 note="" if found is alone else f"{median_ratio(found, alone):.4g} of the run alone")
    report(rows, chosen)
