# SPDX-License-Identifier: Apache-2.0
"""What a requirement costs on board: instructions on the LEON3 at a sample, and bytes of operations and of memory, for
each kind of formula.

    ./fledge bench flown_requirements       # prints the table of docs/evidence.md

The monitor runs alone on the emulated board, over numbers that wander. What it takes without a requirement is a row of
its own, and taken off the others, of which each flies alone.
"""
from __future__ import annotations

import statistics
from pathlib import Path
from tempfile import TemporaryDirectory

import fledge
from fledge import flight as fsw
from fledge.emulator import Board
from fledge.errors import Failure
from fledge.requirements import after, always, angle, begins, implies, settles, until, within
from fledge.requirements.declared import Declaration
from fledge.requirements.onboard import Compiled
from fledge.targets import build
from fledge.targets.leon3 import board
from fledge.units import s

from bench.rows import Rows, options

NEEDS = ["leon3", "build _emulator"]
GUEST, MONITOR = "bench/guest/flown_requirements.c", "flight/services/requirement_monitor"
TICKS = 200         # samples, of which those count that find all windows full
FULL = 130
NODE, REQUIREMENT, NUMBER = 64, 40, 8       # [bytes]
FIGURES = ["instructions", "most instructions", "operations", "table", "memory"]
NONE = "the monitor, without a requirement"


def formulas() -> dict[str, Compiled]:
    """By what docs/evidence.md calls them."""
    sim = fledge.Simulation()
    f = sim.flight
    f.tracking, f.judge = fsw.TrackingError(), fsw.RequirementMonitor()
    f.task("all", every=1 * s, run=[f.tracking, f.judge])
    f.mode("safe", [])
    r = Declaration(sim)
    r.every = 1 * s
    sigma, omega = (r.signal(f"flight.tracking.error.{name}") for name in ("sigma_BR", "omega_BR_B"))
    x = sigma[0]
    limit = x < 0.9
    kinds = {
        "`always(x < c)`": always(limit),
        "`always(v.norm() < c)`": always(sigma.norm() < 0.9),
        "`always(v.max_abs() < c)`": always(sigma.max_abs() < 0.9),
        "`always(angle(v, w) < c)`": always(angle(sigma, omega) < 0.9),
        "`always(r.mode() == \"safe\")`": always(r.mode() == "safe"),
        "`always(implies(a, b))`": always(implies(sigma[1] > 0.5, limit)),
        "`always(after(a))`": always(after(limit)),
        "`always(begins(a))`": always(begins(limit)),
        "`settles(a, within=60 s)`": settles(limit, within=60 * s),
        **{f"`always(within({n} s, a))`": always(within(n * s, limit)) for n in (10, 60, 120)},
        "`always(always(a, 0, 60 s))`": always(always(limit, 0, 60 * s)),
        **{f"`always(until(a, b, within={n} s))`": always(until(limit, sigma[1] > 0.5, within=n * s))
           for n in (10, 60)},
    }
    for i, formula in enumerate(kinds.values()):
        r.require(f"R-{i}", "", formula)
    return {name: Compiled(requirement, f, "flight.judge")
            for name, requirement in zip(kinds, r._found.values(), strict=True)}


def written(compiled: list[Compiled | None]) -> str:
    """The guest with formulas before it; None: no requirement."""
    def node(row: dict) -> str:
        numbers = {"scale": 1.0, **row}
        return "{" + ", ".join(f".{name} = {value!r}" if isinstance(value, float) else f".{name} = {value}"
                               for name, value in numbers.items()) + "}"

    lists = ",\n".join(f"    {{{len(each.rows)}u, {{{', '.join(map(node, each.rows))}}}}}" if each
                       else "    {0u, {{0}}}" for each in compiled)
    return f"""\
#include "{MONITOR}.h"
enum {{ FORMULAS = {len(compiled)}, TICKS = {TICKS}, NODE = {NODE}, REQUIREMENT = {REQUIREMENT} }};
#define EVERY INT64_C(1000000000)
static const struct {{
    uint32_t n;
    FormulaNode nodes[16];
}} formulas[FORMULAS] = {{
{lists}
}};
#include "{GUEST}"
"""


def counted(compiled: list[Compiled | None]) -> list[list[int]]:
    """The instructions on the LEON3 of each sample at which windows are full."""
    with TemporaryDirectory() as folder:
        program = Path(folder, "program.c")
        program.write_text(written(compiled), encoding="utf-8")
        elf = board.program(Path(folder, "built"), "flown_requirements",
                            [program, build.ROOT / f"{MONITOR}.c", *build.math_sources()],
                            [], ["-O2"])
        computer = Board(board.BOARD, elf)
        computer.breakpoint(begin := computer.address("judge"))
        end, before, found = 0, 0, []
        while computer.run_until(600.0) == "breakpoint":
            registers = computer.core.registers()
            if registers["%pc"] == begin:
                before = computer.core.instructions
                if not end:
                    computer.breakpoint(end := registers["%o7"] + 8)
            else:
                found.append(computer.core.instructions - before)
    if len(found) != TICKS * len(compiled):
        raise Failure(f"flown_requirements: the guest ended after {len(found)} samples", 1)
    return [found[i + FULL:i + TICKS] for i in range(0, len(found), TICKS)]


def measured() -> list[tuple[str, float, float, int, int, int]]:
    """Of the monitor alone, then of each formula its name and FIGURES."""
    known = formulas()
    none, *others = counted([None, *known.values()])
    alone = statistics.mean(none)
    rows: list[tuple[str, float, float, int, int, int]] = [(NONE, alone, max(none), 0, 0, 0)]
    for (name, compiled), samples in zip(known.items(), others, strict=True):
        n = len(compiled.rows)
        rows.append((name, statistics.mean(samples) - alone, max(samples) - alone, n, REQUIREMENT + NODE * n,
                     NUMBER * compiled.memory))
    return rows


def main(arguments: list[str]) -> None:
    chosen = options("flown_requirements", arguments, runs=1)
    rows = Rows()
    print("| formula | instructions, mean | most | operations | bytes of table | bytes of memory |",
          "|---|---:|---:|---:|---:|---:|", sep="\n")
    for name, *figures in measured():
        for figure, value, unit in zip(FIGURES, figures, ["-", "-", "-", "bytes", "bytes"], strict=True):
            rows.add(name, figure, value, unit)
        print(f"| {name} | {' | '.join(f'{value:,.0f}' for value in figures)} |")
    if chosen.json:
        rows.write(chosen.json)
