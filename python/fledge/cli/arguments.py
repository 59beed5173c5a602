# SPDX-License-Identifier: Apache-2.0
"""Arguments that several commands take: numbers, durations, parameters of missions."""
from __future__ import annotations

import argparse
from collections.abc import Callable

from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any


def add_update_limit(command: argparse.ArgumentParser) -> None:
    """The option of every command that flies in this program; cli.main() obeys it."""
    command.add_argument("--update-limit", metavar="DURATION", help="an update of a module or model that takes longer, "
                         "as in an endless loop, ends the program, which names it (2s, 500ms of wall time); default: "
                         "none")


def add_mission(command: argparse.ArgumentParser, more: str = "") -> None:
    """The argument of every command that loads a mission. more: what the help says besides"""
    command.add_argument("mission", help=f"the name of a mission, or its folder{more}")


def add_process(command: argparse.ArgumentParser) -> None:
    """The option of every command that is about one flight process."""
    command.add_argument("--process", metavar="NAME", help="the flight process, if the mission has several")


def add_seed(command: argparse.ArgumentParser, of: str = "the random streams", letter: str = "N") -> None:
    """The option of every command that draws numbers."""
    command.add_argument("--seed", type=int, default=0, metavar=letter, help=f"of {of}; default: 0")


def actions(command: Any, name: str) -> Callable[[str, Callable[..., int], str, str], Any]:
    """A function that adds an action to a command which has several, by its name, handler, help and example."""
    kinds = command.add_subparsers(metavar="ACTION", parser_class=type(command))

    def action(kind: str, function: Callable[..., int], text: str, example: str) -> Any:
        sub = kinds.add_parser(kind, help=text, description=text[0].upper() + text[1:] + ".",
                               epilog=f"example: ./fledge {name} {example}")
        sub.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
        sub.set_defaults(function=function)
        return sub

    return action


def add_campaign(command: argparse.ArgumentParser, when: str = "") -> None:
    """The option of every command that flies a campaign of a mission."""
    command.add_argument("--campaign", metavar="NAME", help=f"{when}a function of dispersions.py; default: the first")


def add_jobs(command: argparse.ArgumentParser, when: str = "") -> None:
    """The option of every command that flies several runs at a time."""
    command.add_argument("--jobs", type=int, metavar="N", help=f"{when}flights at a time; default: one for each core")


def add_pool(command: argparse.ArgumentParser, when: str = "") -> None:
    """The options of every command whose flights a cluster may fly."""
    add_jobs(command, when)
    command.add_argument("--scheduler", metavar="ADDRESS", help=f"{when}fly on the workers of this Dask scheduler, as "
                         "tcp://127.0.0.1:8786, in place of --jobs")


def add_parameters(command: argparse.ArgumentParser) -> None:
    """The option for a mission's parameters, of every command that loads one."""
    command.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="parameters",
                         help="a parameter of the mission, without a unit, as in --set spacecraft=8")


def command_line(options: argparse.Namespace) -> str:
    """The command as the user gave it, for a shell."""
    import shlex

    return shlex.join(["./fledge", *options.words])


def given_parameters(options: argparse.Namespace) -> dict[str, Any]:
    """What --set gave: name -> a Python literal, or the text itself.

    Raises Failure for a number with letters behind it: a text would end in a TypeError of the mission.
    """
    import ast
    import re

    given = {}
    for text in options.parameters:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier():
            raise Failure(f"--set {text}: expected NAME=VALUE, as in spacecraft=8")
        try:
            given[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            if re.fullmatch(r"\s*[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?\s*\*?\s*[A-Za-z][\w\s*/^]*", value):
                raise Failure(f"--set {text}: expected a number without a unit, in the unit that the mission gives "
                              f"{name}; found '{value}' (a text of that kind needs quotes: {name}=\"'{value}'\")"
                              ) from None
            given[name] = value
    return given


def number(what: str = "a number") -> Callable[[str], float]:
    """The type of an option that takes a finite number >= 0, for argparse."""
    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = -1.0
        if not 0 <= value < float("inf"):
            raise argparse.ArgumentTypeError(f"expected {what} >= 0; found '{text}'")
        return value

    return read


def flight_time(options: argparse.Namespace) -> float | None:
    """[s] of --for, if it was given. Raises Failure unless it is > 0."""
    if options.duration is None:
        return None
    duration = parse_duration(options.duration)
    if not duration:
        raise Failure("--for: fly longer than 0 s")
    return duration


def parse_duration(text: str, option: str = "--for") -> float:
    """Seconds of "90", "90s", "10min", "2.5 h", "1h23m"."""
    import re

    parts = re.fullmatch(r"\s*(?:(\d+)\s*h)?\s*(?:(\d+)\s*m(?:in)?)?\s*(?:([0-9.]+)\s*s)?\s*", text)
    if parts and sum(part is not None for part in parts.groups()) > 1:
        text = str(sum(float(part or 0) * unit for part, unit in zip(parts.groups(), (3600, 60, 1))))
    match = re.fullmatch(r"\s*([0-9.]+(?:e[0-9]+)?)\s*([a-z]*)\s*", text)
    factors = {"": 1.0, "s": 1.0, "ms": 1e-3, "min": 60.0, "minute": 60.0, "h": 3600.0, "hour": 3600.0, "d": 86400.0,
               "day": 86400.0}
    try:
        seconds = float(match[1]) * factors[match[2]] if match else float("")
    except (KeyError, ValueError):
        raise Failure(f"{option}: expected a duration such as 90s, 10min or 2h; found '{text}'") from None
    if seconds > 1e9:
        raise Failure(f"{option}: expected at most 1e9 s, which are 31 years; found '{text}'")
    return seconds
