# SPDX-License-Identifier: Apache-2.0
"""`fledge compare RUN RUN`: where two records first differ, and with which parameters and revisions they began.
`fledge compare RUN FILE`: how far a spacecraft is from an orbit or attitude that others publish.

Exit codes: 0 the same bits, or within the tolerance; 1 a difference; 2 the command line or a file is wrong.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

from fledge.cli.arguments import number
from fledge.cli.runs import WHAT


def add(command: Callable) -> None:
    """Add the subcommand. command: the function of cli.parser() that adds one."""
    sub = command("compare", compare, "compare runs/nadir_spin/fly/desktop.mcap runs/nadir_spin/fly/linux.mcap")
    sub.add_argument("runs", nargs=2, metavar="RUN", help=f"{WHAT}; the second may be a file of an orbit or attitude: "
                     "an OEM, AEM, OPM, OMM or two-line elements, STK's .e or .a, or SPICE's .bsp")
    sub.add_argument("--topics", nargs="+", metavar="TOPIC", help="only these, as in tracking.error, or "
                     "those of a process or module, as in chief; default: all")
    sub.add_argument("--ignore", nargs="+", default=[], metavar="FIELD", help="fields that do not count, as in "
                     "head.sequence")
    sub.add_argument("--tolerance", type=number(), default=0.0, metavar="X", help="differences of numbers up to this "
                     "do not count, in each field's unit; default: 0, the same bits; with a file in m, m/s and deg, "
                     "default: any")
    sub.add_argument("--craft", default="", metavar="NAME", help="with a file: which spacecraft of several")
    sub.add_argument("--csv", metavar="FILE", help="with a file: write the differences over time")
    sub.add_argument("--all", action="store_true", help="the first difference of each field, how often and how far; "
                     "default: the first of each topic")


def compare(options: argparse.Namespace) -> int:
    """Print the differences of two records; returns the exit code."""
    from fledge.archive import compare as comparing
    from fledge.cli.console import complain, counted, say
    from fledge.cli.runs import decodable, open_run

    if _is_motion(options.runs[1]):
        return _with_file(options)
    a, b = map(open_run, options.runs)
    if a.path.resolve() == b.path.resolve():
        complain(f"{a.path}: compared with itself", "")
    if options.topics is None:
        for archive in (a, b):
            decodable(archive)
    differences = comparing.compare(a, b, options.topics, options.ignore, options.tolerance)
    origins = comparing.origins(a, b)
    if not differences:
        topics = comparing.chosen(a, b, options.topics)
        messages = sum(a.topics[t].count for t in topics)
        within = f"equal to within {options.tolerance:g}" if options.tolerance else "identical"
        same = "" if options.tolerance or options.ignore else f", hash {comparing.digest(a, topics)}"
        say(f"{within}: {len(topics)} topics, {messages} messages in each{same}")
    if differences or origins:
        say(f"a  {a.path}\nb  {b.path}")
    if origins:
        say("what the runs began with")
        for what, *values in origins:
            say(f"  {what}: {' and '.join(map(_short, values))}")
    if not differences:
        return 0
    if origins:
        say("messages")
    first = {d.topic: d for d in reversed(differences)}
    shown = [d for d in differences if options.all or first[d.topic] is d]
    for d in shown:
        say(f"  {d}")
        if options.all and d.count:
            say(f"      in {d.count} of {d.total} messages" + (f", by up to {d.worst:g}" if d.worst else ""))
    if left := len(differences) - len(shown):
        say(f"  and {counted(left, 'more field')} of these: --all shows them")
    return 1


def _is_motion(name: str) -> bool:
    """Whether a file is no record."""
    from pathlib import Path

    path = Path(name)
    return path.is_file() and path.suffix != ".mcap" and b"\x89MCAP0" not in path.open("rb").read(8)


def _with_file(options: argparse.Namespace) -> int:
    """Print how far a run is from a file of others; returns the exit code."""
    import numpy as np

    from fledge import motion
    from fledge.cli.console import counted, say
    from fledge.cli.runs import open_run
    from fledge.columns import columns
    from fledge.disk import Part
    from fledge.errors import SetupError

    run = motion.of_run(open_run(options.runs[0]), options.craft)
    other = motion.of_file(options.runs[1], run.sky)
    try:
        table = motion.differences(run, other)
    except SetupError as error:
        raise SetupError(f"{options.runs[1]}: {error}") from None
    t = table.pop("t")
    say(f"{run.name} less {other.name}: {counted(len(t), 'instant')}, {run.sky.utc(t[0])} to {run.sky.utc(t[-1])}")
    rows = [("", "rms", "largest", "at", "at the end")]
    for name, values in table.items():
        unit, size = motion.UNITS[name], np.abs(values)
        worst = int(np.argmax(size))
        rows.append((name, f"{np.sqrt(np.mean(values**2)):.6g} {unit}", f"{values[worst]:.6g} {unit}",
                     f"{t[worst]:.6g} s", f"{values[-1]:.6g} {unit}"))
    for line in columns(rows, right={1, 2, 3, 4}, indent="  "):
        say(line)
    if options.csv:
        heads = ",".join(["t [s]", *(f"{name} [{motion.UNITS[name]}]" for name in table)])
        lines = np.stack([t, *table.values()], axis=1)
        with Part(options.csv) as part:
            np.savetxt(part, lines, delimiter=",", header=heads, comments="", fmt="%.17g")
        say(options.csv)
    return int(any(np.abs(values).max() > options.tolerance > 0 for values in table.values()))


def _short(text: str) -> str:
    """A value on one line: its beginning, if it is long."""
    line = " ".join(text.split())
    return line if len(line) <= 60 else line[:57] + "..."
