# SPDX-License-Identifier: Apache-2.0
"""How much memory a campaign takes, by its number of runs: short nadir spins, with results on disk.

A program of its own flies each campaign. The private memory (RssAnon) after each share is that of this program alone;
what it maps from files is the system's to take back. From the last two campaigns follows that of a million runs.
"""
from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fledge.montecarlo import Campaign
from fledge.pool import cores
from fledge.units import deg, kg, m, s

from bench.rows import Rows, options, report

RUNS = (10_000, 100_000, 200_000)     # the last two are beyond what is kept one by one
MILLION = 1_000_000


def short(d):
    """20 s, which retain 410 numbers: 100,000 of them are beyond what is kept one by one."""
    d.duration, d.every = 20 * s, 0.5 * s
    d["world.craft.sigma_BN"] = d.attitude()
    d["world.craft.omega_BN_B"] = d.normal(0, 0.5 * deg / s)
    d["world.craft.I_B"] = d.nominal + d.normal(0, 10 * kg * m**2)
    error, *_ = d.retain("flight.tracking.error.sigma_BR", "flight.tracking.error.omega_BR_B", "flight.motor.command.u")
    d.check(error.norm().final < 1)


def memory() -> float:
    """[MB] private memory of this program."""
    return float(re.findall(r"RssAnon:\s*(\d+) kB", Path("/proc/self/status").read_text(encoding="utf-8"))[0]) / 1e3


def fly(runs: int) -> None:
    """Fly a campaign in this program, and print what was measured."""
    campaign = Campaign("nadir_spin", short)
    before, most = memory(), 0.0

    def at(*_: int) -> None:
        nonlocal most
        most = max(most, memory())

    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        result = campaign.fly(runs, folder=folder, progress=at)
        wall = time.perf_counter() - start
        disk = sum(file.stat().st_blocks * 512 for file in Path(folder).rglob("*") if file.is_file()) / 1e6
        print(json.dumps([result.exact, most - before, disk, runs / wall]))


def main(arguments: list[str]) -> None:
    chosen = options("campaign", arguments, 1)
    rows = Rows()
    found = {}
    for runs in RUNS:
        done = [json.loads(subprocess.run(
            [sys.executable, "-c", f"from bench.campaign import fly; fly({runs})"], check=True, stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}).stdout)
            for _ in range(chosen.runs)]
        name = f"{runs} runs"
        kept = "kept one by one" if done[0][0] else "counted"
        rows.add(name, "memory", [row[1] for row in done], "MB", note=kept)
        rows.add(name, "disk", [row[2] for row in done], "MB")
        rows.add(name, "rate", [row[3] for row in done], "1/s", note=f"{cores()} threads")
        found[runs] = min(row[1] for row in done), min(row[2] for row in done)
    (n, (a, da)), (last, (b, db)) = list(found.items())[-2:]
    rows.add(f"{MILLION} runs", "memory, estimated", [b + (b - a) / (last - n) * (MILLION - last)], "MB")
    rows.add(f"{MILLION} runs", "disk, estimated", [db * MILLION / last], "MB")
    report(rows, chosen)
