# SPDX-License-Identifier: Apache-2.0
"""`fledge compare RUN RUN`: where two records first differ, and with which parameters and revisions they began.

Exit codes: 0 the same bits, 1 a difference of messages, 2 the command line or a file is wrong.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

from fledge.cli.arguments import number
from fledge.cli.runs import WHAT


def add(command: Callable) -> None:
    """Add the subcommand. command: the function of cli.parser() that adds one."""
    one = command("compare", compare, "compare runs/nadir_spin/fly/desktop.mcap runs/nadir_spin/fly/linux.mcap")
    one.add_argument("runs", nargs=2, metavar="RUN", help=WHAT)
    one.add_argument("--topics", nargs="+", metavar="TOPIC", help="only these, as in tracking.error, or "
                     "those of a process or module, as in chief; default: all")
    one.add_argument("--ignore", nargs="+", default=[], metavar="FIELD", help="fields that do not count, as in "
                     "head.sequence")
    one.add_argument("--tolerance", type=number(), default=0.0, metavar="X", help="differences of numbers up to this "
                     "do not count, in each field's unit; default: 0, the same bits")
    one.add_argument("--all", action="store_true", help="the first difference of each field, how often and how far; "
                     "default: the first of each topic")


def compare(options: argparse.Namespace) -> int:
    """Print the differences of two records; returns the exit code."""
    from fledge.archive import compare as comparing
    from fledge.cli.console import counted, say
    from fledge.cli.runs import open_run

    a, b = map(open_run, options.runs)
    if a.path.resolve() == b.path.resolve():
        print(f"{a.path}: compared with itself", file=sys.stderr)
    found = comparing.compare(a, b, options.topics, options.ignore, options.tolerance)
    origins = comparing.origins(a, b)
    if not found:
        topics = comparing.chosen(a, b, options.topics)
        messages = sum(a.topics[t].count for t in topics)
        within = f"equal to within {options.tolerance:g}" if options.tolerance else "identical"
        same = "" if options.tolerance or options.ignore else f", hash {comparing.digest(a, topics)}"
        say(f"{within}: {len(topics)} topics, {messages} messages in each{same}")
    if found or origins:
        say(f"a  {a.path}\nb  {b.path}")
    if origins:
        say("what the runs began with")
        for what, *values in origins:
            say(f"  {what}: {' and '.join(map(_short, values))}")
    if not found:
        return 0
    if origins:
        say("messages")
    first = {one.topic: one for one in reversed(found)}
    shown = [one for one in found if options.all or first[one.topic] is one]
    for one in shown:
        say(f"  {one}")
        if options.all and one.count:
            say(f"      in {one.count} of {one.total} messages" + (f", by up to {one.worst:g}" if one.worst else ""))
    if left := len(found) - len(shown):
        say(f"  and {counted(left, 'more field')} of these: --all shows them")
    return 1


def _short(text: str) -> str:
    """A value on one line: its beginning, if it is long."""
    line = " ".join(text.split())
    return line if len(line) <= 60 else line[:57] + "..."
