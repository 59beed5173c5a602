# SPDX-License-Identifier: Apache-2.0
"""The instructions of the world on aarch64, beside those of x86-64 in narrow registers: per derivative of each case of
`bench world`, and per step of the nadir spin with its flight software. Both run as FMUs under QEMU's user mode, whose
plugin (executed.c) counts; a run of twice the steps takes the start away. The outputs have to be the same bytes.

    ./fledge bench aarch64
    ./fledge bench aarch64 coupled panels

It takes the library for aarch64 from build/aarch64, by cmake/aarch64.cmake, and builds it anew if sources changed.
"""
from __future__ import annotations
import shutil
import subprocess
import tempfile
from pathlib import Path

import fledge
from fledge.disk import ROOT, build_folder
from fledge.errors import Failure
from fledge.export.fmu.build import compiler_for, export
from fledge.export.fmu.composition import LIBRARY, simulation_fmu
from fmi.testing.flying import Plan, importer, of

from bench import world
from bench.instructions import NADIR_SPIN, STEPS, cases
from bench.rows import Rows, options, report

EMULATORS = {"x86_64": ["qemu-x86_64", "-E", "FLEDGE_WIDE=0"],
             "aarch64": ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]}


def missing() -> str:
    """What is not there, in words."""
    tools = [emulator[0] for emulator in EMULATORS.values()] + ["aarch64-linux-gnu-gcc"]
    if absent := [tool for tool in tools if not shutil.which(tool)]:
        return f"{' and '.join(absent)} not installed"
    folder = build_folder().with_name("aarch64")
    return "" if (folder / "build.ninja").exists() else f"no {folder}; cmake/aarch64.cmake says how to make it"


def uncounted() -> str:
    """Why instructions cannot be counted, in words: QEMU of Debian 13, for programs, is built without plugins."""
    helped = subprocess.run([EMULATORS["aarch64"][0], "-h"], stdout=subprocess.PIPE, text=True)
    return "" if "-plugin" in helped.stdout else "this qemu-aarch64 takes no plugin, which counts instructions"


def build() -> None:
    """The library for aarch64, from the sources of now. Raises Failure."""
    if says := missing():
        raise Failure(f"bench aarch64: {says}")
    done = subprocess.run(["ninja", "-C", build_folder().with_name("aarch64"), f"python/{LIBRARY}"], text=True,
                          stdout=subprocess.PIPE)
    if done.returncode:
        raise Failure(f"bench aarch64: the library was not built:\n{done.stdout[-3000:]}")


class Case:
    """A simulation as an FMU for both machines, in a folder."""

    def __init__(self, name: str, folder: Path) -> None:
        self.folder, self.derivatives = folder, 1 if name == NADIR_SPIN else 4
        sim = fledge.load("nadir_spin") if name == NADIR_SPIN else world.prepared(world.CASES[name]())
        system = simulation_fmu(sim)
        self.layout, self.path = system.layout, export(system, folder / "case.fmu", platforms=list(EMULATORS))

    def fly(self, machine: str, points: int, *counting: str | Path) -> list[int]:
        """Hashes of all outputs at so many points, STEPS steps apart; none if options of the emulator count."""
        plan = Plan()
        fmu = plan.fmu(self.path, self.folder, machine=machine)
        plan.hash(fmu, [] if counting else of(self.layout, "output", "local"))
        return plan.fly(self.folder, points, STEPS * 0.1,
                        program=[*EMULATORS[machine], *counting, importer(compiler_for(machine))]).hashes

    def instructions(self, machine: str, plugin: Path) -> float:
        """Of a derivative, or of a step."""
        log, counts = self.folder / "executed", []
        for points in (1, 2):
            self.fly(machine, points, "-plugin", plugin, "-d", "plugin", "-D", log)
            counts.append(int(log.read_text()))
        return (counts[1] - counts[0]) / (STEPS * self.derivatives)


def compiled(folder: Path) -> Path:
    """The plugin."""
    plugin = folder / "executed.so"
    subprocess.run(["gcc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", plugin, ROOT / "bench/executed.c"], check=True)
    return plugin


def main(arguments: list[str]) -> None:
    chosen = options("aarch64", arguments, runs=1, cases=cases())
    if says := missing() or uncounted():
        raise Failure(f"bench aarch64: {says}")
    build()
    rows = Rows()
    for name in chosen.cases or cases():
        with tempfile.TemporaryDirectory() as folder:
            case, plugin = Case(name, Path(folder)), compiled(Path(folder))
            ours, theirs = (case.instructions(machine, plugin) for machine in ("x86_64", "aarch64"))
            same = "same bits" if case.fly("x86_64", 3) == case.fly("aarch64", 3) else "OTHER BITS"
            rows.add(f"{name}, x86-64", "instructions", ours, "-")
            rows.add(f"{name}, aarch64", "instructions", theirs, "-",
                     note=f"{theirs / ours:.2f} times; {same}")
    report(rows, chosen)
