# SPDX-License-Identifier: Apache-2.0
"""`fledge prove [MODULE...]`: no run-time errors in flight C, and loops that end, for all that headers allow.

Exit codes: 0 all is proved, or named open in the source; 1 an alarm or a loop without a bound is left; 2 the command
line is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse

from fledge.cli.arguments import add_process
from fledge.cli.console import say

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable

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
    sub.add_argument("--json", action="store_true", help="print the results as JSON, and nothing else")
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
    version = eva.version()
    rows: list[Result] = []

    def ended(result: Result) -> None:
        """Print a row, the first one below its titles."""
        if options.json:
            return
        if not rows:
            say(f"Frama-C {version}, machine {options.machine}")
            say(f"  {'module':24}{'inputs':13}{'alarms':>7}{'open':>6}{'beyond':>8}{'loops':>7}{'rounds':>8}"
                f"{'seconds':>9}")
        rows.append(result)
        _row(result)

    if options.export:
        results = [executive(options, ended)]
    else:
        results = proofs.prove(options.modules, project(), options.jobs, ended, options.again, options.machine)
    if options.json:
        print(json.dumps({"frama_c": version, "machine": options.machine,
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
