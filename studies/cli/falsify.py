# SPDX-License-Identifier: Apache-2.0
"""`fledge falsify MISSION REQ`: search for the run with the least margin of a requirement; with --probability, how
probable it is that a run violates it.

Exit codes as of all commands: 0 no run was found that violates it; 1 one was; 2 the command line, the mission or its
files are wrong; 130 Ctrl-C, with a report on what was searched.
"""
from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from fledge.cli.arguments import add_campaign, add_mission, add_pool, add_seed, add_update_limit, command_line
from fledge.cli.console import say
from fledge.cli.runs import alone
from fledge.disk import write_files
from fledge.errors import Failure
from fledge.progress import Bar

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any

    from fledge.falsify import Counterexample, Flights, Tried


def add(command: Callable) -> None:
    """Add the subcommand. command: the function of cli.parser() that adds one."""
    sub = command("falsify", falsify, "falsify sun_safe SUN-1 --runs 1000")
    add_mission(sub, "; its dispersions.py says what may differ")
    sub.add_argument("requirement", help="the id of a requirement of its requirements.py")
    add_campaign(sub)
    sub.add_argument("--scenario", metavar="NAME", help="fly this scenario with the campaign's dispersions, from what "
                     "it sets to the end of its first run")
    sub.add_argument("--runs", type=int, metavar="N", help="at most; default: 1000. With --probability: of each level "
                     "of each repetition; default: 500")
    sub.add_argument("--first", action="store_true", help="end with the first run that violates it")
    sub.add_argument("--probability", action="store_true", help="estimate how probable it is that a draw of the "
                     "campaign violates it, by importance splitting")
    sub.add_argument("--repetitions", type=int, default=8, metavar="N", help="of the estimate, whose spread gives its "
                     "interval; each has random streams of its own; default: %(default)s")
    add_seed(sub, "the search, and of all random streams", "S")
    add_pool(sub)
    sub.add_argument("--out", metavar="DIR", help="default: runs/MISSION/falsify/REQ")
    sub.add_argument("--json", action="store_true", help="print the result as JSON, and nothing else")
    add_update_limit(sub)
    sub.set_defaults(needs=lambda options: ["build branches"] * (not options.probability and _counts_branches()))


def _counts_branches() -> bool:
    """Whether there is a compiler for the build that does, and the build can have another one."""
    import os

    from fledge.verify.decisions import has_clang

    return os.environ.get("FLEDGE_PRESET") != "asan" and has_clang()


def falsify(options: argparse.Namespace) -> int:
    """Search, or estimate the probability; returns the exit code."""
    from fledge.falsify import Flights

    if options.probability and options.first:
        raise Failure("falsify: give --probability or --first; not both")
    if options.runs is not None and options.runs < 20:
        raise Failure(f"falsify: --runs must be >= 20, found {options.runs}")
    if options.repetitions < 2:
        raise Failure(f"falsify: --repetitions must be >= 2, found {options.repetitions}")
    flights = Flights(options.mission, options.requirement, options.campaign, options.scenario, options.seed,
                      options.jobs, options.scheduler)
    folder = Path(options.out) if options.out else \
        Path("runs") / flights.campaign.nominal.name / "falsify" / options.requirement
    with flights, alone(folder):
        return (_estimate if options.probability else _search)(options, flights, folder)


class _Live(Bar):
    """The number of runs, and the least margin, while the search flies."""

    def __init__(self, flights: Flights, runs: int) -> None:
        super().__init__(f"{flights.campaign.nominal.name}, {flights.requirement}")
        self._runs = runs
        flights.progress = self._at

    def _at(self, flown: int, least: float) -> None:
        self.at(min(1.0, flown / self._runs), f"{flown} runs"
                + (f", least margin {least:.4g}" if abs(least) < float("inf") else ""))


def _search(options: argparse.Namespace, flights: Flights, folder: Path) -> int:
    import json

    from fledge.falsify import regression, search

    begun = time.perf_counter()
    runs, smallest, path = options.runs or 1000, None, None
    command = command_line(options)
    with _Live(flights, runs):
        tried = search(flights, flights.space, runs, options.seed, options.first, lambda: flights.seen)
        if tried.first is not None:
            smallest = flights.smallest(tried.values[tried.best], float(tried.margins[tried.best]))
    if smallest:
        path = folder / f"{regression.name_of(flights.requirement)}.py"
        write_files({path.name: regression.scenario(flights, smallest, command)}, folder)
    wall = time.perf_counter() - begun
    facts = _facts(options, flights, tried, smallest, path)
    write_files({"searched.json": json.dumps({**facts, "command": command}, indent=1) + "\n"}, folder)
    if options.json:
        print(json.dumps(facts, indent=1))
    else:
        _tell(flights, tried, smallest, facts, wall)
        for file in [path, folder / "searched.json"]:
            if file:
                say(f"  wrote     {file}")
    if tried.interrupted:
        return 130
    return 1 if smallest else 0


def _facts(options: argparse.Namespace, flights: Flights, tried: Tried, smallest: Counterexample | None,
           path: Path | None) -> dict[str, Any]:
    """The statement of what was searched, and what was found."""
    best, margins = tried.best, tried.margins
    return {
        "mission": flights.campaign.nominal.name, "requirement": flights.requirement, "text": flights.text,
        "campaign": flights.campaign.name, "scenario": flights.scenario, "duration": flights.duration,
        "seed": options.seed, "runs": len(margins), "stages": tried.stages,
        "searched": flights.space.described(flights.shown), "branches": flights.counts_branches,
        "unknown": flights.unknown, "errors": len(flights.errors), "error": next(iter(flights.errors), None),
        "unit": flights.unit, "nominal": _finite(margins[0]) if len(margins) else None,
        "least": None if best is None else _finite(margins[best]), "run": best, "first violation": tried.first,
        "least after": {n: _finite(min(known)) for n in _counts(len(margins))
                        if (known := [x for x in margins[:n] if x == x])},
        "worst": {} if best is None else dict(zip(flights.space.columns, map(float, tried.values[best]))),
        "smallest": smallest and {"margin": _finite(smallest.margin), "kept": smallest.kept,
                                  "removed": smallest.removed, "values": smallest.values},
        "regression test": str(path) if path else None, "interrupted": tried.interrupted,
    }


def _counts(n: int) -> list[int]:
    return [*(k for k in (1, 10, 30, 100, 300, 1000, 3000, 10000, 30000, 100000) if k < n), n] if n else []


def _finite(x: float) -> float | str:
    """A number for JSON, which knows no infinity: a margin of a comparison of names."""
    return float(x) if abs(x) < float("inf") else str(float(x))


def _tell(flights: Flights, tried: Tried, smallest: Counterexample | None, facts: dict, wall: float) -> None:
    from fledge.requirements.formula import number_text

    def margin(x: float | str | None) -> str:
        if x is None:
            return "unknown"
        return number_text(float(x), flights.unit) if abs(float(x)) < float("inf") else "a name, not a number"

    def numbers(values: Mapping[str, float]) -> None:
        for name, x in values.items():
            say(f"            {name} = {flights.shown(name, x)}")

    say(f"{facts['mission']}, {facts['requirement']}: {facts['text']}")
    stages = ", ".join(f"{n} {name}" for name, n in tried.stages.items() if n)
    say(f"  searched  {facts['runs']} runs of {flights.duration:g} s in {wall:.3g} s"
        f" ({stages}), seed {facts['seed']}; the campaign {facts['campaign']}"
        + (f" in the scenario {flights.scenario}" if flights.scenario else ""))
    for line in facts["searched"]:
        say(f"            {line}")
    if not facts["branches"]:
        say("  branches  of flight code did not lead it, which clang counts: apt-get install clang-19 (or clang-18)")
    if facts["errors"]:
        say(f"  errors    {facts['errors']} runs ended in an error; the first: {facts['error']}")
    if facts["unknown"]:
        say(f"  unknown   {facts['unknown']} runs, whose margin is not known")
    say(f"  nominal   {margin(facts['nominal'])}")
    say("  least     " + ", ".join(f"{margin(x)} after {n}" for n, x in facts["least after"].items()))
    if not smallest:
        say(f"  holds     in all runs that were flown; the least margin is {margin(facts['least'])}")
        numbers(facts["worst"])
        return
    say(f"  VIOLATED  first by run {tried.first}; the least margin is {margin(facts['least'])}, of run {tried.best}")
    numbers(facts["worst"])
    all_ = len(smallest.kept) + len(smallest.removed)
    say(f"  smallest  {margin(smallest.margin)}, with " + (
        f"{len(smallest.kept)} of {all_} deviations" if smallest.kept else
        "no deviation: the nominal run violates it"))
    numbers({name: x for name, x in smallest.values.items()
             if any(name == group or name.startswith((f"{group}.", f"{group}[")) for group in smallest.kept)})
    if smallest.removed:
        say(f"  set back  {', '.join(smallest.removed)}")


def _estimate(options: argparse.Namespace, flights: Flights, folder: Path) -> int:
    import json

    from fledge.falsify import probability

    runs = options.runs or 500
    with _Live(flights, 5 * runs * options.repetitions):
        estimate = probability(flights.repetition, flights.space, runs, options.repetitions, options.seed)
    facts = {"mission": flights.campaign.nominal.name, "requirement": flights.requirement, "text": flights.text,
             "campaign": flights.campaign.name, "scenario": flights.scenario, "seed": options.seed,
             "searched": flights.space.described(flights.shown), "probability": estimate.value, "low": estimate.low,
             "high": estimate.high, "runs": estimate.runs, "repetitions": estimate.parts,
             "levels": [[_finite(x) for x in level] for level in estimate.levels],
             "unknown": flights.unknown, "errors": len(flights.errors), "error": next(iter(flights.errors), None)}
    path, = write_files({"probability.json": json.dumps(facts, indent=1) + "\n"}, folder)
    if options.json:
        print(json.dumps(facts, indent=1))
        return 0
    say(f"{facts['mission']}, {facts['requirement']}: {facts['text']}")
    say(f"  violated  with the probability {estimate}")
    for line in facts["searched"]:
        say(f"            {line}")
    if facts["errors"] or facts["unknown"]:
        say(f"  errors    {facts['errors']} runs ended in an error, and {facts['unknown']} have no known margin; they "
            "count as none that violates it" + (f"; the first: {facts['error']}" if facts["errors"] else ""))
    say(f"  wrote     {path}")
    return 0
