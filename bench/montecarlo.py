# SPDX-License-Identifier: Apache-2.0
"""How fast dispersed runs fly: 2,000 nadir spins of 600 s on all cores, against one simulation flown
again and again with the same dispersions, records and step.

Campaigns and single runs take turns. The scaling is the campaign's rate over the cores times the
single rate: it includes making the clones and drawing the values, but not importing and loading.
An open peer, recorded in 2026-11 on this kind of machine: 19 runs a second.
"""
from __future__ import annotations
import time

from fledge.montecarlo import Campaign, disperse
from fledge.pool import cores

from bench.rows import PEER, Rows, in_turn, median_ratio, options, report

RUNS = 2000
PEER_RUNS_PER_SECOND = 19.0


def measure(work, runs):
    """(runs a second, processor time of a run in us)"""
    start, cpu = time.perf_counter(), time.process_time()
    work()
    return runs / (time.perf_counter() - start), 1e6 * (time.process_time() - cpu) / runs


def main(arguments: list[str]) -> None:
    chosen = options("montecarlo", arguments, 7)
    rounds = chosen.runs
    rows = Rows()
    campaign = Campaign("nadir_spin")
    n = cores()
    single = campaign.simulation(0)
    single.record(*(series.port(single) for series in campaign.dispersions.retained.values()),
                  every=campaign.dispersions.every)

    def again(runs=300):
        for _ in range(runs):
            single.reset()
            single.run(campaign.dispersions.duration)

    samples = in_turn({"single": lambda: measure(again, 300),
                       "one thread": lambda: measure(lambda: campaign.fly(RUNS // n, threads=1), RUNS // n),
                       "campaign": lambda: measure(lambda: campaign.fly(RUNS), RUNS)}, rounds)
    rates = {name: [r for r, _ in found] for name, found in samples.items()}
    cpu = {name: [c for _, c in found] for name, found in samples.items()}

    rows.add("single", "runs", rates["single"], "1/s")
    rows.add("one thread", "runs", rates["one thread"], "1/s", "single")
    rows.add("campaign", "runs", rates["campaign"], "1/s", "single",
             note=f"{n} threads; {sorted(rates['campaign'])[rounds // 2] / PEER_RUNS_PER_SECOND:.0f} times the {PEER}")
    rows.add("campaign", "scaling", median_ratio(
        rates["campaign"], rates["single"]) / n, "-", note=f"of {n} cores times the single rate")
    rows.add("single", "cpu of a run", cpu["single"], "us")
    rows.add("campaign", "cpu of a run", cpu["campaign"], "us", "single",
             note="what sharing costs, also on a busy machine")
    draws = []
    drawn = campaign.simulation(0)
    for _ in range(5):
        start = time.perf_counter()
        for index in range(1000):
            disperse(campaign.nominal, drawn, campaign.plan, index)
        draws.append((time.perf_counter() - start) * 1e3)
    rows.add("draws of a run", "wall", draws, "us", note=f"{len(campaign.dispersions.columns)} numbers")
    report(rows, chosen)
