# SPDX-License-Identifier: Apache-2.0
"""`fledge prove [MODULE...]`: no run-time errors in flight C, and loops that end, for all that headers allow.

Exit codes: 0 all is proved, or named open in the source, and with --table; 1 an alarm or a loop without a bound is
left; 2 the command line is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse

from fledge.cli.arguments import add_process
from fledge.cli.console import say

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from fledge.prove import Result


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("prove", prove, "prove MrpFeedback actuation")
    sub.add_argument("modules", nargs="*", metavar="MODULE", help="modules, drivers by hand, or folders of them as "
                     "flight/control; default: all, of the project around this folder, else of Fledge")
    sub.add_argument("--export", metavar="MISSION", help="in place of modules, the executive that `export c MISSION` "
                     "writes, with any inputs and commands; modules count as what their own proofs allow")
    add_process(sub)
    sub.add_argument("--again", action="store_true", help="also what is proved and has not changed since")
    sub.add_argument("--machine", default="gcc_x86_64", metavar="NAME", help="as Frama-C names it (-machdep); ppc_32 "
                     "has 32 bits and the order of bytes of a LEON3; default: gcc_x86_64")
    sub.add_argument("--jobs", type=int, metavar="N", help="analyses at a time; default: one for each core")
    printed = sub.add_mutually_exclusive_group()
    printed.add_argument("--json", action="store_true", help="print the results as JSON, and nothing else")
    printed.add_argument("--table", action="store_true", help="prove nothing; print what is kept as tables in "
                         "Markdown, beside the conditions that the last `fledge test --coverage` counted")
    sub.set_defaults(needs=lambda _: ["prove"])


def prove(options: argparse.Namespace) -> int:
    import json

    from fledge import prove as proofs
    from fledge.errors import Failure
    from fledge.folders import project
    from fledge.prove import eva

    if options.process and not options.export:
        raise Failure("prove: --process is for --export MISSION")
    if options.export and options.modules:
        raise Failure("prove: --export proves a mission's executive; prove modules by another command")
    if options.table:
        if options.export or options.again or options.machine != eva.MACHINE:
            raise Failure("prove: --table prints what is kept of modules; leave out --export, --again and --machine")
        eva.version()       # without Frama-C nothing is kept
        print("\n".join(table(options.modules, project())))
        return 0
    rows: list[Result] = []

    def ended(result: Result) -> None:
        """Print a row, the first one below its titles."""
        if options.json:
            return
        if not rows:
            say(f"Frama-C {eva.version()}, machine {options.machine}")
            say(f"  {'module':24}{'inputs':13}{'alarms':>7}{'open':>6}{'beyond':>8}{'loops':>7}{'rounds':>8}"
                f"{'seconds':>9}")
        rows.append(result)
        _row(result)

    if options.export:
        results = [executive(options, ended)]
    else:
        results = proofs.prove(options.modules, project(), options.jobs, ended, options.again, options.machine)
    if options.json:
        print(json.dumps({"frama_c": eva.version(), "machine": options.machine,
                          "modules": [result.facts() for result in results]}, indent=1))
    else:
        for result in results:
            _details(result)
        _sum(results)
    return 0 if all(result.proved for result in results) else 1


def executive(options: argparse.Namespace, ended: Callable[[Result], None]) -> Result:
    """That of the exported mission, and which of its modules are proved."""
    import fledge
    from fledge import export
    from fledge import prove as proofs
    from fledge.errors import listed
    from fledge.folders import project
    from fledge.prove.export import prove_export

    mission = export.read(fledge.load(options.export), options.process)
    result = prove_export(mission, project(), options.again, options.machine)
    ended(result)
    kept = {r.name for place in {project(), None} for r in proofs.kept(place) if r.proved}
    types = sorted({module.type for module in mission.modules})
    left = [name for name in types if name not in kept]
    if not options.json:
        say(f"  of its {len(types)} modules, {len(types) - len(left)} are proved by themselves"
            + (f"; not yet: {listed(left, 6)}" if left else ""))
    return result


def table(names: Sequence[str], project: Path | None) -> list[str]:
    """What is kept of the proofs, and of the decisions in the same sources: the sums of folders, then each module or
    driver, in Markdown. names: as select() takes them. Raises Failure."""
    import json

    from fledge import prove as proofs
    from fledge.prove.sources import Tree

    tree = Tree.of(project)
    kept = {(result.name, result.file): result for result in proofs.kept(project)}
    try:
        decisions = json.loads((tree.roots[0] / "build/decisions.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        decisions = {}
    columns = "proved | alarms | open | beyond | loops | seconds | conditions | have decided |"
    sums: dict[str, list[float]] = {}
    rows, seen = [], set[str]()
    for unit in proofs.select(proofs.units(tree), names):
        result, stem = kept.get((unit.name, unit.file)), unit.file.removesuffix(".h").removesuffix("_proof.c")
        states = [alarm.state for alarm in result.alarms] if result else []
        proof = [int(result.proved), *map(states.count, ("alarm", "open", "beyond")), len(result.loops),
                 result.seconds] if result else [0] * 6
        counted = decisions.get(f"{stem}.c", {"conditions": 0, "decided": 0})
        numbers = [*proof, counted["conditions"], counted["decided"]]
        state = "not kept" if not result else "yes" if result.proved else "no"
        rows.append(f"| `{stem}` | {unit.name} | {result.inputs if result else ''} | {state} | "
                    + " | ".join("" if not result and i < 6 else f"{n:g}" for i, n in enumerate(numbers) if i) + " |")
        if stem in seen:                # modules of one source share its decisions
            numbers[-2:] = 0, 0
        seen.add(stem)
        for folder in (f"`{stem.rpartition('/')[0]}`", "all"):
            sum_ = sums.setdefault(folder, [0] * 10)
            sums[folder] = [a + b for a, b in zip(sum_, [1, int(result is not None), *numbers])]
    sums["all"] = sums.pop("all")       # behind the folders
    return [f"| folder | modules | kept | {columns}", "|---|" + "---:|" * 10,
            *(f"| {folder} | " + " | ".join(f"{n:,.0f}" for n in numbers) + " |" for folder, numbers in sums.items()),
            "", f"| source | module | inputs | {columns}", "|---|---|---|---|" + "---:|" * 7, *rows]


def _row(result: Result) -> None:
    states = [alarm.state for alarm in result.alarms]
    most = max((loop.bound or 0 for loop in result.loops), default=0)
    say(f"  {result.name:24}{result.inputs:13}{len(result.left):7}{states.count('open'):6}{states.count('beyond'):8}"
        f"{len(result.loops):7}{'none' if result.endless else most:>8}{result.seconds:9.1f}")


def _details(result: Result) -> None:
    for alarm in result.alarms:
        more = {"open": f" [open: {alarm.reason}]", "beyond": " [with inputs beyond those declared]"}
        say(f"{alarm.file}:{alarm.line}: {result.name}, {alarm.function}: {alarm.kind}: {alarm.text}"
            + more.get(alarm.state, ""))
    for loop in result.endless:
        say(f"{loop.file}:{loop.line}: {result.name}, {loop.function}: no bound of this loop is known; give it a "
            "counter that it compares with a bound, or write /* at most N: reason */ above it")


def _sum(results: list[Result]) -> None:
    alarms = [alarm for result in results for alarm in result.alarms]
    open_, beyond = (sum(alarm.state == state for alarm in alarms) for state in ("open", "beyond"))
    proved = sum(result.proved for result in results)
    say(f"{proved} of {len(results)} proved; {sum(len(r.left) for r in results)} "
        f"alarms, {open_} named open, {beyond} beyond what headers declare")
