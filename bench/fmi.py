# SPDX-License-Identifier: Apache-2.0
"""What FMUs of the nadir spin cost: flight in the place of the modules, the world as a model, and a node.

All cases take turns. A step of flight is one of 0.5 s, of the world one of 0.1 s.

- `tick`: the exported C, called step after step with the same inputs.
- `modules`, `fmu_3`, `fmu_2`: the mission with the modules, and with flight's FMU in their place; so their difference
  is what all inputs, outputs and the step of an FMU cost beyond the modules.
- `world`, `world_fmu`: the world alone, and an FMU of it, whose outputs are all read at each step.
- `node`, `node_fmu`: world and flight in two programs (`fledge up`).
"""
from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import fledge
from fledge.units import s

from bench.rows import Rows, in_turn, options, pair_by_pair, report

SPAN = 20_000.0         # [s] of simulated time
LOOP = """
#include "nadir_spin.h"
#include <stdio.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }
int main(void)
{
    static NadirSpin m;
    nadir_spin_init(&m);
    nadir_spin_restart(&m, 0);
    const double start = now();
    for (long i = 0; i < 1000000; i++) {
        nadir_spin_tick(&m, i * 500000000);
    }
    printf("%g\\n", now() - start);
    return 0;
}
"""


def mission(fmu: Path | None) -> Any:
    from fledge.cosim.fmu import fly_fmu

    sim = fledge.load("nadir_spin")
    if fmu:
        fly_fmu(sim, fmu)
    return sim


def world(fmu: Path | None) -> Any:
    """The world with flight's command at rest."""
    if fmu is None:
        sim = fledge.load("nadir_spin")
        sim.kernel.process("flight").fly_by(lambda t: None)
        return sim
    sim = fledge.Simulation("world")
    sim.world.fmu = fledge.world.Fmu(fmu, locals=True)
    sim.world.task("step", every=0.1 * s, run=[sim.world.fmu])
    return sim


def per_step(sim: Any, step: float) -> float:
    """The time of a step [us]."""
    sim.reset()
    start = time.perf_counter()
    sim.run(SPAN)
    return 1e6 * (time.perf_counter() - start) / (SPAN / step)


def node(folder: Path, fmu: Path | None) -> float:
    """The time of a step of flight [us]."""
    flight = f'fmu = "{fmu}"\n' if fmu else ""
    (folder / "run.toml").write_text(f'mission = "nadir_spin"\nuntil = {SPAN}\nrecord = false\n[[node]]\n'
                                     f'name = "flight"\n{flight}')
    out = subprocess.run([sys.executable, "-P", "-m", "fledge.cli", "up", "run.toml"], cwd=folder, check=True,
                         text=True, capture_output=True).stdout
    flown = re.search(r"flown .* in ([\d.]+) s", out)
    assert flown, out
    return 1e6 * float(flown[1]) / (SPAN / 0.5)


def loop(folder: Path) -> Path:
    """The program that calls the exported C."""
    from fledge.export.fmu.build import ROOT
    from fledge.export.fmu.mission import flight_fmu

    system = flight_fmu(fledge.load("nadir_spin"))
    assert system.code
    for name, text in {**system.code(""), "loop.c": LOOP}.items():
        (folder / name).write_text(text)
    subprocess.run(["gcc", "-O3", "-ffp-contract=off", "-fno-math-errno", f"-I{ROOT}", f"-I{folder}", "-o",
                    folder / "loop", *folder.glob("*.c"), *system.sources.values(), "-lm"], check=True)
    return folder / "loop"


def main(arguments: list[str]) -> None:
    from fledge.export.fmu import build
    from fledge.export.fmu.composition import simulation_fmu
    from fledge.export.fmu.mission import flight_fmu

    chosen = options("fmi", arguments, 7)
    rows = Rows()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        new = partial(fledge.load, "nadir_spin")
        fmus = {version: build.export(flight_fmu(new()), folder / f"flight{version}.fmu", version) for version in "23"}
        whole = build.export(simulation_fmu(new(), "world"), folder / "world.fmu")
        program = loop(folder)
        samples = in_turn({
            "tick": lambda: float(subprocess.run([program], check=True, capture_output=True, text=True).stdout),
            "modules": partial(per_step, mission(None), 0.5),
            **{f"fmu_{version}": partial(per_step, mission(fmu), 0.5) for version, fmu in fmus.items()},
            "world": partial(per_step, world(None), 0.1), "world_fmu": partial(per_step, world(whole), 0.1),
            "node": partial(node, folder, None), "node_fmu": partial(node, folder, fmus["3"])}, chosen.runs)
    rows.add("tick", "exported C", samples["tick"], "us")
    for figure, against, *others in (("step of flight and world", "modules", "fmu_3", "fmu_2"),
                                     ("step of the world", "world", "world_fmu"),
                                     ("step of two programs", "node", "node_fmu")):
        rows.add(against, figure, samples[against], "us")
        for other in others:
            rows.add(other, figure, samples[other], "us", against, note=pair_by_pair(samples[other], samples[against]))
    report(rows, chosen)
