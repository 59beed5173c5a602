# SPDX-License-Identifier: Apache-2.0
"""Reads a command line: the options before the command, then the words of the command by its own parser."""
from __future__ import annotations

import argparse

from fledge import cli
from fledge.errors import Failure
from fledge.launcher import commands

OPTIONS = ("--project", "--preset")         # that stand before the command


def leading_options(words: list[str]) -> tuple[dict[str, str], list[str]]:
    """Those before the command, and the command's words."""
    given = {}
    while words and words[0] in (*OPTIONS, "--force"):
        if words[0] == "--force":
            given[words.pop(0)] = ""
            continue
        if len(words) < 2:
            raise Failure(f"{words[0]} needs a value")
        given[words[0]] = words[1]
        words = words[2:]
    return given, words


def parser() -> argparse.ArgumentParser:
    """That of all commands."""
    return cli.parser(commands.add)


def parsed(words: list[str]) -> argparse.Namespace:
    """The options of a command. Raises SystemExit for a wrong command line, before anything is installed."""
    return cli.parsed(words, parser())
