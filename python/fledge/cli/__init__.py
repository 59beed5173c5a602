# SPDX-License-Identifier: Apache-2.0
"""The command line: every command of usage.txt but those that fledge.launcher has, which install, build and test.
Each is in a module whose add() has its arguments and names the function that carries it out: here, or in the folder
of a capability (capabilities.py).

Exit codes: 0 all went well; 1 a check of the scenario failed, or the run did; 2 the command line or
the mission is wrong; 130 Ctrl-C.

Example:

    $ ./fledge run nadir_spin spin --seed 2 --as first
"""
from __future__ import annotations

import argparse
import io
import os
import sys
import warnings
from pathlib import Path

from fledge.cli.arguments import parse_duration
from fledge.cli.console import complain, trace
from fledge.cli.failures import expected, in_words, say_warning
from fledge.errors import Failure, did_you_mean

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any, NoReturn


class Parser(argparse.ArgumentParser):
    """argparse with errors of one line that name the command, and its usage."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse here what this command does not know: argparse itself leaves that to the parser above it."""
        options, rest = super().parse_known_args(args, namespace)
        if rest:
            word = rest[0].partition("=")[0]
            hint = did_you_mean(word, self._option_string_actions).rstrip(";") if word.startswith("-") else ""
            self.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
        return options, rest

    def error(self, message: str) -> NoReturn:
        head, choose, choices = message.partition("(choose from ")     # which Python quotes before version 3.12.8
        message = head + choose + choices.replace("'", "")
        self.exit(2, f"{self.prog}: {message}\n{self.format_usage()}")


def usage() -> str:
    return Path(__file__).with_name("usage.txt").read_text(encoding="utf-8")


def summaries() -> dict[str, str]:
    """Command -> what it does, of all in usage.txt."""
    import re

    return dict(re.findall(r"^  (\w+) .{,20}?  +(.*)", usage(), re.M))


def parser(*more: Callable[..., None]) -> argparse.ArgumentParser:
    """That of the commands here and of capabilities, and of those that other functions add, by the function that adds
    one. `needs` says what the launcher provides first, besides what all need (fledge.launcher.packages); None: it
    builds nothing."""
    from fledge.cli import bench, capabilities, check, compare, export, fly, load, new, prompt, records, run, show

    texts = summaries()
    top = Parser(prog="fledge", description="Fly flight software in closed loop.",
                 epilog="example: ./fledge run nadir_spin")
    top.add_argument("--debug", action="store_true", help="show tracebacks")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)

    def command(name: str, function: Callable[..., int], example: str) -> Any:
        text = texts[name]
        sub = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".",
                                  epilog=f"example: ./fledge {example}",
                                  formatter_class=argparse.RawDescriptionHelpFormatter if "\n" in example else
                                  argparse.HelpFormatter)
        sub.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help="show tracebacks")
        sub.set_defaults(function=function, needs=lambda _: [], by_itself=False)
        return sub

    for module in (run, check, export, fly, load, prompt, compare, show, new, records, bench, *capabilities.modules()):
        module.add(command)
    for add in more:
        add(command)
    for name in texts:      # an error names them in the order of the usage
        if name in commands.choices:
            commands.choices[name] = commands.choices.pop(name)
    return top


def parsed(arguments: list[str], of: argparse.ArgumentParser | None = None) -> argparse.Namespace:
    """The options of a command line, and what follows `--`."""
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    options = (of or parser()).parse_args(arguments[:cut])
    options.after_dashes = arguments[cut + 1:]
    options.words = arguments
    return options


def main(arguments: list[str] | None = None) -> int:
    return carry_out(parsed(list(sys.argv[1:] if arguments is None else arguments)))


def carry_out(options: argparse.Namespace) -> int:
    """Run the command; returns the exit code."""
    if isinstance(sys.stdout, io.TextIOWrapper):    # a character that the user's encoding lacks is no error
        sys.stdout.reconfigure(errors="backslashreplace")
    setattr(warnings, "showwarning", say_warning)  # in one line, as an error; each once
    try:
        if options.after_dashes and not getattr(options, "starts_command", False):
            raise Failure(f"nothing may follow --; found {' '.join(options.after_dashes)}")
        if (jobs := getattr(options, "jobs", None)) is not None and jobs < 1:
            raise Failure(f"--jobs must be >= 1, found {jobs}")
        if getattr(options, "update_limit", None):
            from fledge import limit_updates

            limit_updates(parse_duration(options.update_limit, "--update-limit"))
        return options.function(options)
    except Failure as error:
        complain(str(error))
        return error.code
    except KeyboardInterrupt:
        complain("interrupted")
        return 130
    except BrokenPipeError:  # the reader of the output has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 1
    except Exception as error:
        trace(options)
        if expected(error):
            complain(in_words(error, getattr(options, "out", None) or "."))
            return 1 if type(error).__name__ == "RunError" else 2
        if options.debug:
            return 70
        complain(f"{type(error).__name__}: {error}\nThis is a defect of fledge; --debug shows where.")
        return 70
