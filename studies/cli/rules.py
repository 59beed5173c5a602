# SPDX-License-Identifier: Apache-2.0
"""`fledge rules [PATH...]`: the rules of MISRA C:2012 that flight C keeps, and the reasons of deviations.

Exit codes: 0 each finding has a reason; 1 one has none, or a reason has no finding; 2 the command line or the file of
reasons is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("rules", rules, "rules flight/control")
    sub.add_argument("paths", nargs="*", metavar="PATH", help="sources, or folders of them; default: all flight C of "
                     "the project around this folder, else of Fledge")
    sub.add_argument("--tree", metavar="DIR", help="the folder that #include is relative to, as that of an exported "
                     "mission; default: that of the project, else of Fledge")
    sub.add_argument("--table", action="store_true", help="print the rules and reasons as a table in Markdown, and "
                     "nothing else")
    sub.add_argument("--json", action="store_true", help="print the results as JSON, and nothing else")
    sub.add_argument("--jobs", type=int, metavar="N", help="sources at a time; default: one for each core")
    sub.set_defaults(needs=lambda _: ["rules"])


def rules(options: argparse.Namespace) -> int:
    import json
    from pathlib import Path

    from fledge import rules as checks
    from fledge.cli.console import say
    from fledge.columns import columns
    from fledge.errors import Failure
    from fledge.folders import project
    from fledge.progress import Bar
    from fledge.prove.sources import Tree

    if options.tree and not Path(options.tree).is_dir():
        raise Failure(f"rules: --tree: there is no folder {options.tree}")
    tree = Tree.of(Path(options.tree).resolve() if options.tree else project())
    given = checks.reasons(tree)
    with Bar("rules") as bar:
        check = checks.check(tree, options.paths, options.jobs,
                             lambda done, of: bar.at(done / of, f"{done} of {of} sources"))
    rows = checks.judge(check, given)
    left = [finding for row in rows for finding in row.left]
    if options.json:
        print(json.dumps(checks.facts(check, rows), indent=1))
    elif options.table:
        print(checks.table(rows), end="")
    else:
        say(f"MISRA C:2012 by cppcheck {check.version}: {len(check.files)} sources, {len(check.checked)} rules")
        for line in columns([("rule", "category", "found", "state"), *(
                (row.rule, row.category, str(len(row.found)), row.state) for row in rows if row.found)]):
            say(f"  {line}")
        for finding in left:
            say(f"{finding.file}:{finding.line}: rule {finding.rule}; mend it, or give a reason in {checks.DEVIATIONS}")
        states = [row.state for row in rows]
        say(f"{states.count('kept')} rules kept, {states.count('deviation')} with deviations, "
            f"{states.count('broken')} broken")
        if not check.whole:
            say("rules on several sources count without a PATH only")
    return 1 if left else 0
