# SPDX-License-Identifier: Apache-2.0
"""How many runs `fledge falsify` needs to find planted bugs that the scenarios of sun_safe pass, against draws alone.

    ./fledge bench falsify
    ./fledge bench falsify --mutants 3 --seeds 4 --runs 500        # shorter

Changes of one operator, constant, condition, returned value or statement are drawn of the flight modules of sun_safe
(bench/mutation.py). Each is compiled into an extension of its own, which counts branches. A change is taken if both
scenarios pass with it, and if one of the searches, which screen it with --screening runs each, finds a run of a
campaign that violates a requirement which holds without the change, but not by its first --easy runs. Then both look
for it again with --seeds seeds: how many runs each needs to the first violation, at most --runs.

The table has medians. A search that finds nothing counts with all its runs. Draws have no memory, so their median
follows from their rate, all finds over all runs. Where they find none, the median exceeds what is printed, with a
confidence of 95 %.
"""
from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

from fledge.columns import columns

from bench.mutants import ROOT, Mutant, drawn, mutants_of
from bench.relinked import Program, Unusable, extension

NEEDS = ["unit", "build branches"]
MODULES = ["flight/sensing/sun_pyramids.c", "flight/sensing/sun_line.c", "flight/guidance/sun_safe.c"]
QUESTIONS = ["SUN-1", "SUN-3"]
ORIGINAL = "FLEDGE_ORIGINAL"        # the folder of the extension without a change
EASY = 5                # runs: a violation that so few runs find needs no search
SCREENING = 150         # runs of each search for each requirement
LIMIT = 300.0           # [s] of the scenarios and the screening: a change may make an endless loop


def ask(folder: Path, limit: float = LIMIT, **question: Any) -> Any:
    """What a program with the extension of a folder answers to answer(); None if it fails or takes too long."""
    original = os.environ.get(ORIGINAL) or next((path for path in sys.path if any(Path(path).glob("_core.*.so"))), "")
    environment = {**os.environ, ORIGINAL: original,
                   "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT), *filter(None, sys.path)])}
    try:
        done = subprocess.run([sys.executable, "-P", "-m", "bench.falsify", json.dumps(question)], env=environment,
                              cwd=folder, capture_output=True, text=True, timeout=limit)
        return json.loads(done.stdout) if done.returncode == 0 else None
    except (subprocess.TimeoutExpired, ValueError):
        return None


# --- in the program with the change ----------------------------------------------------------------

def stuck(d: Any) -> None:
    """The campaign `tumbles` of sun_safe, and a sensor of converter B that stays at an end, or babbles."""
    from fledge.units import minute, s
    from missions.sun_safe import dispersions

    dispersions.tumbles(d)
    d.fault("world.adc_b", kind=d.choice("HIGH", "LOW", "BABBLE"), channels=d.choice(1, 2, 4, 8),
            begin=d.uniform(0 * s, 4 * minute), lasts=d.uniform(5 * s, 4 * minute))


def answer(question: dict[str, Any]) -> Any:
    """Of points: their margins. Without a requirement: whether the scenarios pass, and the requirement that a search
    finds violated by `screening` runs, None if it was none, or found by the first `easy` ones. Of a requirement: for
    each seed the runs that search() and random_search() needed to the first violation, None where they found none."""
    from functools import partial

    import fledge
    import numpy as np
    from fledge.falsify import Flights, random_search, search
    from fledge.requirements import Requirements

    def first(method, requirement, runs, seed):
        flights = Flights("sun_safe", requirement, stuck, seed=seed)

        def margins(values):
            found = flights(values)
            if (bad := np.flatnonzero(found < 0)).size:
                without = ask(Path(os.environ[ORIGINAL]), requirement=requirement, points=values[bad].tolist(),
                              seed=seed)
                found[bad[np.array(without) < 0]] = 0.0
            return found

        if method is search:
            method = partial(search, seen=lambda: flights.seen)
        found = method(margins, flights.space, runs, seed, first=True).first
        return None if found is None else found + 1

    if "points" in question:
        flights = Flights("sun_safe", question["requirement"], stuck, seed=question["seed"])
        return flights(np.array(question["points"])).tolist()
    if "requirement" not in question:
        for name in ("safe", "blind"):
            sim = fledge.load("sun_safe")
            sim.plots = False
            own = Requirements(sim)
            watch = own.watch([requirement.id for requirement in own.for_scenario(name)])
            assert sim.mission
            sim.mission.scenarios[name](sim)
            if any(outcome.verdict == "violated" for outcome in watch.outcomes()):
                return False, None
        for requirement in QUESTIONS:
            for method in (search, random_search):
                n = first(method, requirement, question["screening"], 0)
                if n:
                    return True, requirement if n > question["easy"] else None
        return True, None
    return [[first(method, question["requirement"], question["runs"], seed) for method in (search, random_search)]
            for seed in question["seeds"]]


# --- the study -------------------------------------------------------------------------------------

class Needed(NamedTuple):
    """Medians of runs to the first violation. more: draws found none, and need more than `draws`, with a
    confidence of 95 %"""
    search: float
    draws: float
    more: bool


def needed(found: list[list[int | None]], runs: int) -> Needed:
    """Of pairs of runs that the search and draws needed, None where they found nothing by so many."""
    drawn_runs, finds = sum(pair[1] or runs for pair in found), sum(pair[1] is not None for pair in found)
    return Needed(statistics.median(pair[0] or runs for pair in found), math.log(2) * drawn_runs / (finds or 3),
                  not finds)


def table(rows: list[dict[str, Any]], runs: int) -> list[str]:
    """The lines of the table, by the runs that draws need, and the median ratio of all and of the rarer half."""
    medians = sorted(((needed(row["needed"], runs), row) for row in rows), key=lambda pair: pair[0].draws)
    ratios = [m.draws / m.search for m, _ in medians]
    shown = [("mutant", "violates", "search", "draws", "ratio", "missed")]
    for (m, row), ratio in zip(medians, ratios):
        more = ">" if m.more else ""
        missed = [sum(pair[i] is None for pair in row["needed"]) for i in (0, 1)]
        shown.append((f"{Path(row['file']).name}:{row['line']}", row["requirement"], f"{m.search:g}",
                      f"{more}{m.draws:.0f}", f"{more}{ratio:.2g}", f"{missed[0]}, {missed[1]}"))
    return [*columns(shown, {2, 3, 4}), f"median ratio {statistics.median(ratios):.3g}, of the rarer half "
            f"{statistics.median(ratios[len(ratios) // 2:]):.3g}"]


def study(program: Program, order: list[Mutant], count: int, seeds: int, runs: int, easy: int = EASY,
          screening: int = SCREENING, tell: Any = lambda _: None) -> list[dict[str, Any]]:
    """The first `count` mutants that the scenarios pass and a search finds, with what both searches needed; and how
    many were not taken. tell(rows) is called after each."""
    rows: list[dict[str, Any]] = []
    seen = dict.fromkeys(["not compiled", "equivalent", "scenarios fail", "not found", "alike"], 0)
    with tempfile.TemporaryDirectory() as name:
        for k, mutant in enumerate(order):
            folder = Path(name) / str(k)
            folder.mkdir()
            try:
                program.make(mutant.file, mutant.changed(), folder)
            except Unusable as why:
                seen[str(why)] += 1
                continue
            passes, requirement = ask(folder, easy=easy, screening=screening) or (False, None)
            begun = time.monotonic()
            found = requirement and ask(folder, 10 * LIMIT, requirement=requirement,
                                        seeds=list(range(1, seeds + 1)), runs=runs)
            if not found:
                seen["not found" if passes else "scenarios fail"] += 1
                continue
            if any(found == row["needed"] for row in rows):     # it does the same as another
                seen["alike"] += 1
                continue
            before, after = mutant.lines()
            rows.append({"file": mutant.file, "line": mutant.line(), "before": before, "after": after,
                         "requirement": requirement, "needed": found,
                         "seconds": time.monotonic() - begun})
            tell(rows)
            if len(rows) == count:
                break
    return [*rows, seen]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="fledge bench falsify", description="Runs that a search needs to find "
                                     "planted bugs, against draws alone.",
                                     epilog="example: ./fledge bench falsify --mutants 3")
    parser.add_argument("--mutants", type=int, default=10, help="default: %(default)s")
    parser.add_argument("--seeds", type=int, default=10, help="of each search; default: %(default)s")
    parser.add_argument("--runs", type=int, default=1000, help="at most, of each search; default: %(default)s")
    parser.add_argument("--easy", type=int, default=EASY, metavar="N", help="leave out what one of the searches finds "
                        "by its first N runs; default: %(default)s")
    parser.add_argument("--screening", type=int, default=SCREENING, metavar="N", help="runs of each search that say "
                        "whether a mutant can be found; default: %(default)s")
    parser.add_argument("--seed", type=int, default=1, help="of the mutants; default: %(default)s")
    parser.add_argument("--json", metavar="FILE", help="write each mutant, too")
    chosen = parser.parse_args(arguments)
    order = drawn(mutants_of(ROOT, MODULES, ["flight"]), chosen.seed)

    def tell(rows: list[dict[str, Any]]) -> None:
        print(*lines_of(rows[-1]), sep="\n", flush=True)
        if chosen.json:
            Path(chosen.json).write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")

    *rows, seen = study(extension("branches"), order, chosen.mutants, chosen.seeds, chosen.runs, chosen.easy,
                        chosen.screening, tell)
    if rows:
        print(*table(rows, chosen.runs), sep="\n")
    print("not taken: " + ", ".join(f"{n} {why}" for why, n in seen.items()))
    return 0 if len(rows) == chosen.mutants else 1


def lines_of(row: dict[str, Any]) -> list[str]:
    searched, drawn_ = ([pair[i] for pair in row["needed"]] for i in (0, 1))
    return [f"{row['file']}:{row['line']}, {row['requirement']}, {row['seconds']:.3g} s",
            f"    {row['before']}", f"    {row['after']}", f"    runs of the search {searched}, draws {drawn_}"]


if __name__ == "__main__":
    print(json.dumps(answer(json.loads(sys.argv[1]))))
