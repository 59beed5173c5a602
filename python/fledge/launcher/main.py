# SPDX-License-Identifier: Apache-2.0
"""`./fledge [--project DIR] [--preset NAME] [--force] COMMAND [ARGUMENTS]`, in order: reads it, provides what the
command needs, and runs it."""
from __future__ import annotations

import argparse
import io
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

import fledge
from fledge import cli
from fledge.errors import Failure, nearest, printable
from fledge.disk import ROOT
from fledge.launcher import build, packages
from fledge.launcher.commands import become
from fledge.launcher.context import OBSERVED, Context, project_around, project_named, say_if_in_another_checkout
from fledge.launcher.parser import leading_options, parsed
from fledge.launcher.tools import say, set_stops, stop

QUIET = ("help", "-h", "--help", "--version", "completion")     # which build nothing


def main(words: Sequence[str], ctrl_c: signal._HANDLER) -> int:
    """ctrl_c: what Ctrl-C does while a command of cli/ runs."""
    set_stops(stop)
    if isinstance(sys.stdout, io.TextIOWrapper):    # a character that the user's encoding lacks is no error
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        return _main(list(words), ctrl_c)
    except Failure as error:
        say(printable(str(error)))
        return error.code
    except BrokenPipeError:     # the reader of the output has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 1
    except OSError as error:    # of the launcher's own work
        say(printable(f"{error.filename}: {error.strerror}" if error.filename else str(error)))
        return 1


def _main(words: list[str], ctrl_c: signal._HANDLER) -> int:
    given, words = leading_options(words)
    context = Context()
    context.preset = given.get("--preset") or os.environ.get("FLEDGE_PRESET") or "release"
    context.force = "--force" in given or bool(os.environ.get("FLEDGE_FORCE"))
    project = given.get("--project", os.environ.get("FLEDGE_PROJECT"))
    context.project = project_around(Path.cwd()) if project is None else project_named(project)
    words = words or ["help"]
    if words[0] == "help" and len(words) > 1:   # help COMMAND, help keys new
        words = [*words[1:], "--help"]
    context.command = words[0]
    if context.installed and context.command not in QUIET:
        say_if_in_another_checkout(Path.cwd())
    os.environ.update(context.names())          # some modules read them when they are imported

    if context.command in ("help", "-h", "--help"):
        print(cli.usage(), end="", flush=True)
        return 0
    if context.command == "--version":
        print(f"fledge {fledge.__version__}")
        return 0
    if words[:2] == ["completion", "--"]:       # the words of a command line, of which the last is being typed
        from fledge.launcher.completion import offers

        print("\n".join(offers(words[2:])))
        return 0
    if context.command not in cli.summaries():
        near = nearest(context.command, cli.summaries(), 0.7)
        meant = f"; did you mean '{near}'?" if near else ";"
        raise Failure(f"unknown command '{context.command}'{meant} './fledge help' lists all")
    options = parsed(words)
    if getattr(options, "preset", None):
        context.preset = options.preset
    if options.by_itself:
        return options.function(context, options)
    provide(context, options)
    return carry_out(context, options, ctrl_c)


def provide(context: Context, options: argparse.Namespace) -> None:
    """Install and build what a command of cli/ needs."""
    packages.need(context, "run")
    try:
        needs = options.needs(options)
        if needs is None:
            return
        if getattr(options, "scheduler", None):
            needs = [*needs, "scheduler"]
        purposes = packages.expanded(needs)
    except Failure:         # the command itself says what is wrong
        purposes = []
    for kind in OBSERVED:
        if f"build {kind}" in purposes:
            context.observe(kind)
    rest = packages.provide(context, purposes, without=context.command == "fly")
    views = [part for part in rest if part.endswith("view")]
    parts = [part for part in rest if part not in views]
    build.compile(context, parts if "all" in parts else ["desktop", *parts])
    if views:
        build.view(context, if_possible="view" not in views)


def carry_out(context: Context, options: argparse.Namespace, ctrl_c: signal._HANDLER) -> int:
    """Run a command of cli/: in this program, unless a sanitizer must be loaded before Python."""
    if context.preset == "asan":
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})   # until cli/__main__.py has begun
        return become(sys.executable, [sys.executable, "-P", str(ROOT / "python/fledge/cli/__main__.py"),
                                       *options.words], context.environment())
    context.enter()
    set_stops(signal.SIG_DFL)
    signal.signal(signal.SIGINT, ctrl_c)
    return cli.carry_out(options)
