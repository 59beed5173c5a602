# SPDX-License-Identifier: Apache-2.0
"""The book of evidence: proofs, decisions, rules, longest times and flights of a mission on one HTML page, and where
they answer clauses of ECSS-E-ST-40C and NPR 7150.2D. What was not run stands there as such, with the command
that runs it.

    DIR/evidence.html, evidence.json        the page, and the same for programs, with the SHA-256 of every file of DIR
    DIR/proof.json, rules.json              the results of `fledge prove` and `fledge rules`
    DIR/report.html, ...                    the report of `fledge verify`, with the records
"""
from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fledge import prove, rules
from fledge.disk import write_files
from fledge.errors import Failure, listed
from fledge.folders import project
from fledge.mission.wiring import Wiring
from fledge.prove import eva
from fledge.prove.sources import Tree
from fledge.report.run import templates, versions
from fledge.requirements.judge import HOLDS
from fledge.verify import decisions
from fledge.verify.evidence import Row, margin_text
from fledge.verify.flight import Flown

SHOWN, LEFT, NOT_RUN, NOT_ANSWERED = "shown", "left", "not run", "not answered"
ORDER = (NOT_ANSWERED, NOT_RUN, LEFT, SHOWN)      # the worst first
PAGE, FACTS, TIMES = "evidence.html", "evidence.json", "bounds/timing.json"


@dataclasses.dataclass
class Part:
    """A kind of evidence. state: SHOWN, LEFT or NOT_RUN; what: the result, or the command that runs it; file: of the
    book, with all of it; tool: with its version."""
    name: str
    title: str
    state: str
    what: str
    file: str = ""
    tool: str = ""


class Clause(NamedTuple):
    """asks: in our words. parts: names of those that answer it; none: the book does not. note: what else is needed."""
    standard: str
    number: str
    asks: str
    parts: tuple[str, ...] = ()
    note: str = ""


ECSS, NPR = "ECSS-E-ST-40C", "NPR 7150.2D"
CLAUSES = (
    Clause(ECSS, "5.5.3.2", "units are tested, with results", ("tests", "decisions")),
    Clause(ECSS, "5.6.3", "the software is validated against its specification", ("requirements",)),
    Clause(ECSS, "5.8.3.1 to 5.8.3.4", "requirements and design are verified", (),
           "reviews of the project's documents"),
    Clause(ECSS, "5.8.3.5", "code keeps its standards, is covered by tests, and is robust",
           ("rules", "decisions", "proof")),
    Clause(ECSS, "5.8.3.6", "unit tests are complete and consistent", ("tests", "decisions")),
    Clause(ECSS, "5.8.3.7", "integration is verified", ("requirements",),
           "by flights of the whole; units of others and hardware are the project's"),
    Clause(ECSS, "5.8.3.8", "validation covers the requirements, and is traced to them", ("requirements", "traces")),
    Clause(ECSS, "5.8.3.9", "what only the whole system can validate is identified", ("traces",),
           "as requirements by analysis, inspection or demonstration"),
    Clause(ECSS, "5.8.3.10", "documents are verified", (), "reviews of the project's documents"),
    Clause(ECSS, "5.8.3.11", "tasks meet their deadlines, by analysis and by measurement", ("bounds",)),
    Clause(ECSS, "5.8.3.12", "budgets of memory and processor are kept", ("bounds",), "memory: fledge profile"),
    Clause(ECSS, "5.8.3.13", "the model of behaviour is verified", (), "no such model is made"),
    Clause(NPR, "SWE-052", "requirements, code and tests are traced in both directions", ("traces",),
           "to code by the coverage of each requirement's flights"),
    Clause(NPR, "SWE-061", "code keeps a standard", ("rules",)),
    Clause(NPR, "SWE-062", "units are tested", ("tests",)),
    Clause(NPR, "SWE-066", "the software is tested against its requirements", ("requirements",)),
    Clause(NPR, "SWE-068", "results of tests are evaluated", ("requirements",)),
    Clause(NPR, "SWE-070", "models and simulations for qualification are validated", (),
           "docs/accuracy.md has the errors of Fledge's models; their use for a mission is the project's to accept"),
    Clause(NPR, "SWE-073", "the software is validated on its target or a high-fidelity simulation", ("target",)),
    Clause(NPR, "SWE-081", "configuration items and their versions are identified", ("hashes",)),
    Clause(NPR, "SWE-134", "safety-critical software has its protections", (),
           "the project's hazard analysis names them"),
    Clause(NPR, "SWE-135", "static analysis looks at the code", ("proof", "rules")),
    Clause(NPR, "SWE-136", "tools are accredited", (), "their versions are named below"),
    Clause(NPR, "SWE-186", "unit tests can be repeated", ("tests",)),
    Clause(NPR, "SWE-189", "coverage of the code is measured", ("decisions",)),
    Clause(NPR, "SWE-190", "coverage follows from executed tests", ("decisions",)),
    Clause(NPR, "SWE-191", "changes are tested again", ("requirements",),
           "report.html has the differences to the report before"),
    Clause(NPR, "SWE-219", "safety-critical code has 100 % MC/DC", ("decisions",)),
    Clause(NPR, "SWE-220", "complexity of safety-critical code is limited", (), "it is not measured"),
)


def state(clause: Clause, parts: Mapping[str, Part]) -> str:
    """The worst of its parts."""
    states = [parts[name].state for name in clause.parts] or [NOT_ANSWERED]
    return min(states, key=ORDER.index)


# --- Parts -----------------------------------------------------------------------------------------

def proof(sim: Any, jobs: int | None = None) -> tuple[Part, list[prove.Result]]:
    """Of the modules that a mission uses; `fledge prove` without a name proves the executive and the protocols, too."""
    used = {type(node.instance).__name__ for node in Wiring(sim).nodes.values()}
    results: list[prove.Result] = []
    command = "./fledge prove"
    try:
        version = eva.version()
        for own in dict.fromkeys((project(), None)):
            if names := [unit.name for unit in prove.units(Tree.of(own)) if unit.module and unit.name in used]:
                results += prove.prove(names, own, jobs)
    except Failure as failure:
        return Part("proof", "No run-time errors", NOT_RUN, f"{failure}; then: {command}"), results
    if not results:
        return Part("proof", "No run-time errors", NOT_RUN, "the mission has no modules in C"), results
    alarms = [alarm for result in results for alarm in result.alarms]
    proved = sum(result.proved for result in results)
    text = (f"{proved} of {len(results)} modules of the mission proved; alarms: "
            f"{sum(len(r.left) for r in results)} left, {sum(a.state == 'open' for a in alarms)} open with a reason, "
            f"{sum(a.state == 'beyond' for a in alarms)} beyond what headers declare")
    return Part("proof", "No run-time errors", SHOWN if proved == len(results) else LEFT, text, "proof.json",
                f"Frama-C {version}"), results


def of_rules(jobs: int | None = None) -> tuple[Part, rules.Check | None, list[rules.Row]]:
    """Of all flight C of the project, or of Fledge."""
    try:
        tree = Tree.of(project())
        check = rules.check(tree, jobs=jobs)
        rows = rules.judge(check, rules.reasons(tree))
    except Failure as failure:
        return Part("rules", "Rules of MISRA C:2012", NOT_RUN, f"{failure}; then: ./fledge rules"), None, []
    states = [row.state for row in rows]
    text = (f"{states.count('kept')} rules kept, {states.count('deviation')} with deviations that have a reason, "
            f"{states.count('broken')} broken")
    return Part("rules", "Rules of MISRA C:2012", LEFT if "broken" in states else SHOWN, text, "rules.json",
                f"Cppcheck {check.version}"), check, rows


def of_flights(rows: Sequence[Row], flown: Sequence[Flown], decided: Mapping[str, decisions.File], traces: Mapping,
               name: str) -> list[Part]:
    """What the flights of `fledge verify` show. traces: those of the report, of which each is a gap."""
    words = [row.verdict for row in rows]
    holds = all(word == HOLDS or word.startswith("by ") for word in words) and not any(flight.error for flight in flown)
    gaps = [f"{what}: {listed(list(ids), 4)}" for what, ids in traces.items() if ids]
    others = [flight for flight in flown if flight.target != "desktop"]
    targets = list(dict.fromkeys(flight.target for flight in others))
    all_ = decisions.total(decided)
    verify = f"./fledge verify {name} --evidence DIR"
    return [
        Part("requirements", "Requirements", SHOWN if holds else LEFT, ", ".join(
            f"{words.count(word)} {word}" for word in dict.fromkeys(words)) + f"; flights: {len(flown)}",
            "report.html"),
        Part("traces", "Traces", LEFT if gaps else SHOWN, "; ".join(gaps) or
             "each requirement has a test or children, each scenario shows a requirement", "report.html"),
        Part("decisions", "Decisions (MC/DC)", SHOWN if not all_.open else LEFT,
             f"{all_.decided} of {len(all_.conditions)} conditions have decided in these flights, {len(all_.reasoned)} "
             f"cannot, with a reason, {len(all_.open)} are left", "results.json", "clang, llvm-cov")
        if decided else Part("decisions", "Decisions (MC/DC)", NOT_RUN, f"{verify} --coverage mcdc"),
        Part("target", "On the target", SHOWN if all(flight.same and not flight.error for flight in others) else LEFT,
             f"flown on {', '.join(targets)}: {'' if all(flight.same for flight in others) else 'not all with '}"
             "the bits of the desktop", "report.html")
        if others else Part("target", "On the target", NOT_RUN, f"{verify} --on desktop,leon3")]


# --- The book --------------------------------------------------------------------------------------

def write(sim: Any, rows: Sequence[Row], flown: Sequence[Flown], decided: Mapping[str, decisions.File],
          traces: Mapping, repeat: str, folder: Path, jobs: int | None = None) -> tuple[list[Path], list[Part]]:
    """Write the book into the folder of the report; returns the paths, and the parts."""
    proved, results = proof(sim, jobs)
    ruled, check, kept = of_rules(jobs)
    name = sim.mission.folder.name
    timed, tasks = of_times(folder, name)
    every = [*of_flights(rows, flown, decided, traces, name), proved, ruled, timed,
             Part("tests", "Tests of units", NOT_RUN, "./fledge test --all"),
             Part("hashes", "Versions and hashes", SHOWN, "of sources, records and results", FACTS)]
    parts = {part.name: part for part in every}
    files = {}
    if results:
        files["proof.json"] = json.dumps([result.facts() for result in results], indent=1) + "\n"
    if check:
        files["rules.json"] = json.dumps(rules.facts(check, kept), indent=1) + "\n"
    sources = {path.relative_to(sim.mission.folder).as_posix(): _sha(path)
               for path in sorted(sim.mission.folder.rglob("*.py"))}
    clauses = [(clause, state(clause, parts)) for clause in CLAUSES]
    about = dict(versions(sim.mission))
    files[PAGE] = templates().get_template("evidence.html").render(
        mission=sim.name, parts=parts, clauses=clauses, results=results, rules=[row for row in kept if row.found],
        kept=[row.rule for row in kept if not row.found], decided=decided, total=decisions.total,
        tasks=tasks,
        rows=[(row, *row.decided) for row in rows if row.decided], margin_text=margin_text, flown=flown,
        versions=about, repeat=repeat, sources=sources, checked=check.files if check else {})
    paths = write_files(files, folder)
    book = {path.relative_to(folder).as_posix(): _sha(path) for path in sorted(folder.rglob("*"))
            if path.is_file() and path.name not in (FACTS, ".lock") and not path.name.endswith(".part")}
    facts = {"mission": sim.name, "versions": about, "repeat": repeat,
             "parts": [dataclasses.asdict(part) for part in every],
             "clauses": [{**clause._asdict(), "state": word} for clause, word in clauses],
             "sources": {"mission": sources, "flight": check.files if check else {}}, "files": book}
    return [*paths, *write_files({FACTS: json.dumps(facts, indent=1) + "\n"}, folder)], every


def of_times(folder: Path, name: str) -> tuple[Part, list[dict[str, Any]]]:
    """Of the tasks on the LEON3, from what `fledge profile` has put into the book: its rows. Raises Failure."""
    title, path = "Longest times of tasks", folder / TIMES
    if not path.is_file():
        return Part("bounds", title, NOT_RUN, f"./fledge profile {name} --on leon3 --longest 100 --bound --out "
                    f"{path.parent}; then this again"), []
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        tasks = found["longest"]
        bound = [task for task in tasks if task.get("bound") is not None]
        late = [task["task"] for task in tasks if task["time"] > task["period"]]
    except (ValueError, KeyError, TypeError, AttributeError):
        raise Failure(f"{path}: this is no timing.json of fledge profile --longest; make it anew") from None
    text = f"{len(bound)} of {len(tasks)} tasks have a bound; seen beyond the period: {listed(late)}"
    return Part("bounds", title, LEFT if late or len(bound) < len(tasks) else SHOWN, text, TIMES), tasks


def _sha(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
