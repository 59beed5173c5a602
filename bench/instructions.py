# SPDX-License-Identifier: Apache-2.0
"""The instructions of the world, by Callgrind, which other work on the machine does not change: per derivative of each
case of `bench world`, and per step of the nadir spin with its flight software.

    ./fledge bench instructions

The code is that of narrow registers, because Callgrind of Valgrind 3.19 does not know all instructions of wide code.
"""
from __future__ import annotations
import sys
import tempfile
from pathlib import Path

import fledge
from fledge.profile.valgrind import callgrind
from fledge.units import s

from bench import world
from bench.rows import Rows, options, report

NADIR_SPIN = "nadir spin, a step"
STEPS = 200
# As gcc 12 makes them.
RECORDED = {
    "rigid": 385,
    "wheels": 494,
    "jitter": 1065,
    "coupled": 2718,
    "panels": 2307,
    "slosh": 2179,
    "wheels and panels": 2452,
    "thrusters": 691,
    "thrusters and tank": 1412,
    "8 thrusters": 716,
    "8 thrusters and tank": 1448,
    "8 thrusters and filled tank": 1423,
    "8 thrusters and settled tank": 1801,
    "gyros": 1582,
    "rods": 855,
    "rods with WMM": 3278,
    "rods with WMM to 0.1 nT": 1743,
    NADIR_SPIN: 3096,
}


def cases():
    return [*world.CASES, NADIR_SPIN]


def measured():
    """Name -> instructions of each case."""
    names = cases()
    environment = {"FLEDGE_WIDE": "0", "PYTHONPATH": ":".join(path for path in sys.path if path)}
    with tempfile.TemporaryDirectory() as folder:
        stretches = callgrind([sys.executable, "-P", "-m", "bench.instructions"], Path(folder),
                              "fledge::sim::Simulation::run_until*", environment)
    # After the start of Python, the first step of each case, which sets up; then the steps that count.
    called = [next(n for name, n in stretch.inclusive.items() if name.startswith("fledge::sim::Simulation::run_until"))
              for stretch in stretches[1 + len(names):]]
    return {name: n / (STEPS * (1 if name == NADIR_SPIN else 4)) for name, n in zip(names, called, strict=True)}


def main(arguments: list[str]) -> None:
    chosen = options("instructions", arguments, runs=1)
    rows = Rows()
    for name, n in measured().items():
        rows.add(name, "instructions", n, "-", note=f"{n / RECORDED[name]:.2f} times those recorded")
    report(rows, chosen)


def _run():
    """What runs under Callgrind."""
    simulations = [fledge.load("nadir_spin") if name == NADIR_SPIN else world.prepared(world.CASES[name]())
                   for name in cases()]
    for simulation in simulations:
        simulation.reset()
        simulation.run(0.1 * s)
    for simulation in simulations:
        simulation.run(STEPS * 0.1 * s)


if __name__ == "__main__":
    _run()
