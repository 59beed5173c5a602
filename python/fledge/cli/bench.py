# SPDX-License-Identifier: Apache-2.0
"""`fledge bench [NAME]`: the measurements of bench/, in a checkout."""
from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fledge.cli.console import say
from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable

BENCH = Path(__file__).resolve().parents[3] / "bench"


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("bench", bench, "bench sim --json sim.json")
    sub.set_defaults(needs=_needed)
    sub.add_argument("bench", nargs="?", metavar="NAME")
    sub.add_argument("options", nargs=argparse.REMAINDER, metavar="OPTION",
                     help="the bench's own, such as --json FILE; 'bench NAME --help' lists them")


def benches() -> list[str]:
    """The names of the benches; none where Fledge is installed without them."""
    return sorted(p.stem for p in BENCH.glob("*.py") if "def main(" in p.read_text(encoding="utf-8"))


def _needed(options: argparse.Namespace) -> list[str] | None:
    """With the NEEDS of a bench, which is not imported: it may import what is not built yet."""
    import ast
    import re

    if options.bench not in benches():
        return []
    if {"-h", "--help"} & set(options.options):
        return None
    text = (BENCH / f"{options.bench}.py").read_text(encoding="utf-8")
    match = re.search(r"^NEEDS = (.*)$", text, re.MULTILINE)
    return ["bench", "build all", "build fledge_bench", *(ast.literal_eval(match[1]) if match else [])]


def bench(options: argparse.Namespace) -> int:
    from importlib import import_module

    known = benches()
    if not options.bench:
        say("benches: " + (", ".join(known) or "none"))
        return 0
    if not known:
        raise Failure("bench: an installed Fledge has no measurements", 1)
    if options.bench not in known:
        raise Failure(f"there is no bench '{options.bench}'; there are {', '.join(known) or 'none'}")
    sys.path.insert(0, str(BENCH.parent))
    return import_module(f"bench.{options.bench}").main(options.options) or 0
