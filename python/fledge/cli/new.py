# SPDX-License-Identifier: Apache-2.0
"""`fledge new WHAT NAME`: the first files of a module, model, mission or project."""
from __future__ import annotations

import argparse
import os

from fledge.cli.console import say
from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("new", new, "new module SunSlew --kind guidance\n         ./fledge new mission my_sat --from cubesat")
    sub.set_defaults(needs=lambda _: None)
    sub.add_argument("what", metavar="WHAT", choices=["module", "model", "mission", "project"],
                     help="module, model, mission or project")
    sub.add_argument("name", metavar="NAME",
                     help="SunSlew, or guidance/SunSlew for a subfolder; of a project: its folder")
    sub.add_argument("--project", metavar="DIR", default=os.environ.get("FLEDGE_PROJECT"),
                     help="the project that it belongs to; default: FLEDGE_PROJECT, else Fledge itself")
    kind = sub.add_mutually_exclusive_group()
    kind.add_argument("--kind", dest="variant", choices=["guidance", "control", "determination", "sensing"],
                      help="of a module: a small one that works, with fitting messages, units and a test; a model has "
                      "sensing alone; default: as the subfolder is called, else --bare")
    kind.add_argument("--bare", dest="variant", action="store_const", const="bare",
                      help="of a module or model: the smallest that does something, with a test")
    kind.add_argument("--from", dest="source", metavar="SOURCE", help="of a mission: another, by name or folder, of "
                      "which it is a copy; of a module or model: FILE:CLASS, the prototype whose interface it gets, "
                      "with a test that compares both")


def new(options: argparse.Namespace) -> int:
    from fledge import new as scaffold

    given = {name: value for name, value in (("source", options.source), ("kind", options.variant)) if value}
    if options.what == "project" and options.source:
        raise Failure("new: --from is for a module, model or mission")
    if options.what not in ("module", "model") and options.variant:
        raise Failure("new: --kind and --bare are for a module or model")
    try:
        where = [] if options.what == "project" else [options.project]
        files, next_step = getattr(scaffold, options.what)(options.name, *where, **given)
    except scaffold.NewError as error:
        raise Failure(f"new {options.what}: {error}") from None
    for file in files:
        say(f"  wrote  {os.path.relpath(file)}")
    say(next_step)
    return 0
