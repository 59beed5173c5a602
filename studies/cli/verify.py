# SPDX-License-Identifier: Apache-2.0
"""`fledge verify MISSION`: all requirements over all scenarios and targets, with a report for a review.

Exit codes: 0 no requirement is violated, and every flight came to its end; 1 one is, or did not; 2 the command line,
the mission, its requirements or a CSV is wrong; 130 Ctrl-C: what has been flown is not flown again.
"""
from __future__ import annotations

import argparse
from pathlib import Path

from fledge.cli.arguments import add_mission, add_parameters, add_pool, add_seed, command_line, given_parameters
from fledge.targets import TARGETS

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any

    from fledge.mission.simulation import Simulation
    from fledge.requirements import Requirements
    from fledge.verify.book import Part
    from fledge.verify.decisions import File
    from fledge.verify.evidence import Row
    from fledge.verify.flight import Flight, Flown

OUT = Path("verification")


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("verify", verify, "verify nadir_spin --on desktop,leon3")
    add_mission(sub, "; its requirements.py has the requirements")
    sub.add_argument("--on", default="desktop", metavar="TARGETS", help=f"of {', '.join(TARGETS)}; default: desktop")
    sub.add_argument("--scenario", action="append", metavar="NAME", help="fly only this one; may be given again; "
                     "default: all that show a requirement")
    sub.add_argument("--only", action="append", metavar="ID", help="report on this requirement and its children; may "
                     "be given again; default: all")
    sub.add_argument("--again", action="store_true", help="fly all; default: take the flights whose sources, target, "
                     "seed, scenario and requirements are those of the report before from there")
    sub.add_argument("--coverage", nargs="?", const="object", choices=["object", "mcdc"], default="",
                     help="also count the statements and branches of flight that ran on leon3; mcdc: and which "
                     "conditions of its C have decided on the desktop")
    sub.add_argument("--requirements", metavar="CSV", help="name the differences to this table: id, text, rationale, "
                     "parent, method")
    add_seed(sub)
    add_pool(sub)
    sub.add_argument("--strict", action="store_true", help="a requirement that is unknown or not shown also fails; so "
                     "does evidence that leaves something")
    sub.add_argument("--out", metavar="DIR", help="for report.html, requirements.csv, junit.xml, results.json and the "
                     f"records; default: {OUT}/MISSION")
    sub.add_argument("--evidence", metavar="DIR", help="as --out DIR, and add a book there: proofs, rules and "
                     "decisions, and where all this answers clauses of ECSS-E-ST-40C and NPR 7150.2D")
    add_parameters(sub)
    sub.set_defaults(needs=lambda options: [*TARGETS.known(_targets(options)),
                                            *["decisions", "build mcdc"] * (options.coverage == "mcdc"),
                                            *["prove", "rules"] * bool(options.evidence)])


def verify(options: argparse.Namespace) -> int:
    import fledge
    from fledge.cli.console import cannot_fly, placed
    from fledge.cli.runs import alone
    from fledge.errors import Failure, did_you_mean
    from fledge.mission.scenario import lacking
    from fledge.requirements import Requirements
    from fledge.verify import decisions, tables

    targets = _targets(options)
    if not targets:
        raise Failure("verify: --on names no target; there are " + ", ".join(TARGETS))
    TARGETS.ready(targets, "verify")
    if options.coverage == "mcdc":
        if options.scheduler or "desktop" not in targets:
            raise Failure("verify: --coverage mcdc counts in flights on the desktop of this machine; "
                          + ("leave out --scheduler" if options.scheduler else "add it: --on desktop," + options.on))
        if not decisions.objects():
            raise Failure("verify: nothing that is loaded counts decisions: './fledge verify' of a checkout builds "
                          "what does; an installed Fledge counts those of a project's own modules")
    elif options.coverage and not any(TARGETS[name].takes_tools for name in targets):
        taking = [name for name, target in TARGETS.items() if target.takes_tools]
        raise Failure(f"verify: --coverage counts on {', '.join(taking)}; add one, as in --on desktop,{taking[0]}")
    given = tables.read(Path(options.requirements)) if options.requirements else []
    sim = fledge.load(options.mission, options.seed, **given_parameters(options))
    assert sim.mission
    known = sim.mission.scenarios
    for name in options.scenario or ():
        if name not in known:
            raise Failure(f"verify: the mission {sim.name} has no scenario '{name}'{did_you_mean(name, known)} it has "
                          f"{', '.join(known) or 'none'}")
    for problems in lacking(sim, options.scenario or known).values():
        raise Failure(cannot_fly(placed(problems)))
    requirements = Requirements(sim)
    if not requirements:
        raise Failure(f"the mission {sim.name} has no requirements: write them in requirements.py "
                      "(docs/verification.md)")
    for id in options.only or ():
        requirements.of(id)
    if options.out and options.evidence:
        raise Failure("verify: --out and --evidence both name the folder of the report; give one of them")
    folder = Path(options.out or options.evidence or OUT / sim.name)
    with alone(folder):
        return _verify(options, targets, sim, requirements, given, folder)


def _verify(options: argparse.Namespace, targets: list[str], sim: Simulation, requirements: Requirements,
            given: list[dict[str, str]], folder: Path) -> int:
    """Fly, judge, and write the report. given: the rows of --requirements"""
    from fledge.cli.console import counted, say
    from fledge.columns import columns
    from fledge.verify import decisions, tables
    from fledge.verify.flight import Flight

    assert sim.mission
    scenarios = {name: [requirement.id for requirement in requirements.for_scenario(name)]
                 for name in sim.mission.scenarios if name in (options.scenario or sim.mission.scenarios)}
    _, rows = _rows(options, requirements, scenarios, given, [])
    wanted = {row.id for row in rows}
    chosen = [Flight(options.mission, name, target, options.seed, given_parameters(options),
                     _counts(options.coverage, target), folder / "flights" / name / target)
              for name, ids in scenarios.items() if set(ids) & wanted for target in targets]
    say(f"{sim.name}: {counted(len(rows), 'requirement')}, {counted(len(chosen), 'flight')} on {', '.join(targets)}")
    flown = _fly(options, sim, chosen)
    own, rows = _rows(options, requirements, scenarios, given, flown)
    for line in columns([("requirement", "verdict", "margin", "where"), *map(_line, rows)]):
        say(f"  {line}")
    csv = {"file": Path(options.requirements).name, "differences": tables.differences(
        given, [row for row in own if row in rows], not options.only)} if given else None
    for id, what in csv["differences"] if csv else ():
        say(f"  differs  {id} {what}")
    decided = _decisions(options, chosen)
    for line in decisions.lines(decided, each=False) if decided else ():
        say(f"  {line}")
    for path in _write(options, sim, rows, flown, decided, scenarios, csv, folder):
        say(f"  wrote    {path}")
    parts = _book(options, sim, rows, flown, decided, scenarios, folder) if options.evidence else []
    _refuse(options, sim, rows, flown, parts)
    return 0


def _rows(options: argparse.Namespace, requirements: Requirements, scenarios: Mapping[str, Sequence[str]],
          given: list[dict[str, str]], flown: list[Flown]) -> tuple[list[Row], list[Row]]:
    """(rows of the mission's own requirements, of all that are reported: with those of the CSV alone, of --only)"""
    from fledge.verify import evidence, tables

    own = evidence.rows(requirements, scenarios, flown)
    rows = own + tables.only_there(given, own)
    evidence.adopt(rows)
    wanted = evidence.with_children([row for row in rows if row.id in (options.only or [row.id])])
    return own, [row for row in rows if row.id in wanted]


def _fly(options: argparse.Namespace, sim: Simulation, chosen: list[Flight]) -> list[Flown]:
    """The results of the flights; the paths of their records are those that the report has."""
    from fledge.cli.console import say
    from fledge.progress import Bar
    from fledge.verify import flights

    def tell(flight: Flown) -> None:
        words = [shown.verdict for shown in flight.shown]
        verdicts = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
        how = f"failed: {flight.error}" if flight.error else \
            f"{flight.time:g} s in {flight.wall:.3g} s, {flight.speed:,.0f} times real time; {verdicts}"
        say(f"  {'before ' if flight.before else 'flown  '}  {flight.title}: {how}")

    assert sim.mission
    with Bar(sim.name) as bar:
        flown = flights.fly(chosen, sim.mission.folder, options.jobs, options.again, tell,
                            lambda done, all_: bar.at(done / max(all_, 1), f"{done} of {all_} flights"),
                            options.scheduler)
    for flight in flown:
        if flight.record:
            flight.record = f"flights/{flight.scenario}/{flight.target}/{flight.record}"
    return flown


def _decisions(options: argparse.Namespace, chosen: list[Flight]) -> dict[str, File]:
    """Of the flight code that ran in these flights; {} without --coverage mcdc."""
    from fledge import folders
    from fledge.disk import ROOT
    from fledge.errors import Failure
    from fledge.verify import decisions

    if options.coverage != decisions.KIND:
        return {}
    counts = [path for flight in chosen for path in sorted(flight.folder.glob(f"{decisions.COUNTS}*"))]
    roots = [root for root in (folders.project(), ROOT) if root]
    files = decisions.read(counts, decisions.objects(), roots) if counts else {}
    if not files:
        raise Failure("verify: no flight code in C has run, whose decisions --coverage mcdc counts: prototypes and "
                      "scripts have none")
    return files


def _book(options: argparse.Namespace, sim: Simulation, rows: list[Row], flown: list[Flown], decided: dict[str, File],
          scenarios: Mapping[str, Sequence[str]], folder: Path) -> list[Part]:
    """Write the book of evidence; returns its parts."""
    from fledge.cli.console import say
    from fledge.columns import columns
    from fledge.verify import book, evidence

    paths, parts = book.write(sim, rows, flown, decided, evidence.traces(rows, scenarios), command_line(options),
                              folder, options.jobs)
    for line in columns([("evidence", "", "result"), *((part.title, part.state, part.what) for part in parts)]):
        say(f"  {line}")
    for path in paths:
        say(f"  wrote    {path}")
    return parts


def _refuse(options: argparse.Namespace, sim: Simulation, rows: list[Row], flown: list[Flown],
            parts: list[Part]) -> None:
    """Raise Failure if a requirement is violated, or a flight has failed; with --strict, also of what is not shown, and
    of evidence that leaves something."""
    from fledge.errors import Failure
    from fledge.requirements.judge import UNKNOWN, VIOLATED
    from fledge.verify.evidence import NOT_SHOWN

    def of(verdict: str) -> list[str]:
        ids = [row.id for row in rows if row.verdict == verdict]
        return [f"{verdict}: {', '.join(ids)}"] if ids else []

    problems = [*of(VIOLATED), *(f"failed: {flight.title}" for flight in flown if flight.error),
                *(text for verdict in (UNKNOWN, NOT_SHOWN) * options.strict for text in of(verdict)),
                *(f"left: {part.title}" for part in parts if options.strict and part.state == "left")]
    if problems:
        raise Failure(f"{sim.name}: {'; '.join(problems)}", 1)


def _line(row: Row) -> tuple[str, str, str, str]:
    """Of the table on the terminal."""
    from fledge.verify.evidence import margin_text

    if row.decided is None:
        return row.id, row.verdict, "", ""
    flown, shown = row.decided
    at = "" if shown.at is None else f", t = {shown.at:g} s"
    return row.id, row.verdict, margin_text(shown), f"{flown.title}{at}" + (f": {shown.reason}" if shown.reason else "")


def _write(options: argparse.Namespace, sim: Simulation, rows: list[Row], flown: list[Flown], decided: dict[str, File],
           scenarios: Mapping[str, Sequence[str]], csv: dict[str, Any] | None, folder: Path) -> list[Path]:
    """Write the files of the report; returns their paths."""
    import dataclasses
    import shlex
    from datetime import datetime, timezone

    from fledge.disk import ROOT, write_files
    from fledge.mission.provenance import identity
    from fledge.verify import coverage, decisions, evidence, page, tables
    from fledge.verify.flight import dumps

    assert sim.mission
    whole = not (options.only or options.scenario)
    before = evidence.earlier(folder / "results.json")
    time = datetime.now(timezone.utc)
    name = Path(options.mission).name
    common = [*(["--seed", str(options.seed)] if options.seed else []),
              *(word for text in options.parameters for word in ("--set", text))]

    def command(flight: Flown) -> str:
        desktop = flight.target == "desktop"
        return shlex.join(["./fledge", "run" if desktop else "fly", name, flight.scenario, *common,
                           *([] if desktop else ["--on", flight.target])])

    results = {
        "mission": sim.name, "made": time.isoformat(timespec="seconds"), "seed": options.seed,
        "identity": identity(sim.mission.folder), "requirements": [evidence.facts(row) for row in rows],
        "traces": evidence.traces(rows, scenarios),
        "coverage": {id: coverage._asdict() for id, coverage in page.per_requirement(rows).items()},
        "decisions": decisions.facts(decided),
        "flights": [{**dataclasses.asdict(flight), "coverage": None,
                     "shown": [{**dataclasses.asdict(shown), "figure": None} for shown in flight.shown]}
                    for flight in flown]}
    files = {"report.html": page.page(
        sim.mission, rows, flown, scenarios, command, decided=decided, seed=options.seed, made=time,
        about=sim.mission.summaries()[""], only="; ".join(
            [*(["--only " + " ".join(options.only)] if options.only else []),
             *(["--scenario " + " ".join(options.scenario)] if options.scenario else [])]),
        repeat=command_line(options),
        changed=None if before is None else evidence.differences(before, rows, whole),
        changed_since=before["made"].replace("T", " ").replace("+00:00", " UTC") if before else "", csv=csv),
        "requirements.csv": tables.write(rows), "junit.xml": tables.junit(sim.name, rows, flown),
        "results.json": dumps(results)}
    counts = coverage.joined(flight.coverage for flight in flown)
    if counts:
        files["coverage.info"] = coverage.lcov(counts, ROOT)
    return write_files(files, folder)


def _counts(coverage: str, target: str) -> str:
    """What is counted there; "" for nothing."""
    if target == "desktop":
        return "mcdc" if coverage == "mcdc" else ""
    return "object" if coverage and TARGETS[target].takes_tools else ""


def _targets(options: argparse.Namespace) -> list[str]:
    return list(dict.fromkeys(filter(None, map(str.strip, options.on.split(",")))))
