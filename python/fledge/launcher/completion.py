# SPDX-License-Identifier: Apache-2.0
"""What may follow on a command line, for completion.sh: `fledge completion -- WORD...`, the last of which is typed.

The parser of all commands has the names and options.
"""
from __future__ import annotations

import argparse
import os
from collections.abc import Iterable

from fledge import folders
from fledge.cli.bench import benches
from fledge.cli.runs import KEPT, RUNS, SCENE
from fledge.launcher.context import PRESETS
from fledge.launcher.parser import OPTIONS, leading_options, parser


def offers(words: list[str]) -> list[str]:
    """What the last of the words may become; nothing where any file may stand."""
    *before, word = words or [""]
    names: Iterable[str]
    if before and before[-1] in OPTIONS and not leading_options(before[:-1])[1]:    # its value
        names = PRESETS if before[-1] == "--preset" else ()
    else:
        given, before = leading_options(before)
        if "--project" in given:
            os.environ["FLEDGE_PROJECT"] = given["--project"]
        if not before and word.startswith("-"):
            names = OPTIONS
        else:
            words = before[before[:1] == ["help"]:]
            names = [*_of_parser(parser(), words, word), *["help"] * (not words)]
    return sorted(name for name in names if name.startswith(word))


def _of_parser(parser: argparse.ArgumentParser, before: list[str], word: str) -> Iterable[str]:
    places = [action for action in parser._actions if not action.option_strings]
    given: dict[str, str] = {}
    option = None       # whose value comes next
    for i, text in enumerate(before):
        if text in parser._option_string_actions:
            option = parser._option_string_actions[text]
            option = option if option.nargs != 0 else None
        elif option or places:
            taker = option or places[0]
            if isinstance(taker, argparse._SubParsersAction):
                return _of_parser(taker.choices[text], before[i + 1:], word) if text in taker.choices else ()
            given[taker.dest] = text
            if taker.nargs in (None, "?"):
                option, places = None, places if option else places[1:]
    if word.startswith("-"):
        return [name for name, action in parser._option_string_actions.items() if action.help != argparse.SUPPRESS]
    action = option or next(iter(places), None)
    if action is None:
        return ()
    return action.choices or _names(action, given, word)


def _names(action: argparse.Action, given: dict[str, str], word: str) -> Iterable[str]:
    """What an argument names: that is known by what the parser calls it."""
    name = action.dest
    if name in ("mission", "simulation") or name == "source" and given.get("what") == "mission":
        return folders.missions()
    if name in ("scenario", "campaign"):
        folder = folders.missions().get(given.get("mission") or given.get("simulation") or "")
        file = "scenarios.py" if name == "scenario" else "dispersions.py"
        return filter(None, folders.summaries(folder, file)) if folder else ()
    if name in ("run", "runs") and action.metavar == "RUN":
        return _runs()
    if name == "on":
        return _targets(word)
    if name == "preset":
        return PRESETS
    if name == "board" and not action.option_strings:
        from fledge.targets import boards

        return boards()
    return benches() if name == "bench" else ()


def _targets(word: str) -> list[str]:
    """The targets behind what a list of them has already."""
    from fledge import serial_line
    from fledge.targets import TARGETS      # of the project, too, if one was named

    done = word[:max(word.rfind(","), word.rfind("=")) + 1]
    return [done + target for target in [*TARGETS, *(serial_line.BEGIN + device for device in serial_line.devices())]]


def _runs() -> Iterable[str]:
    """The shortest names of all records in ./runs: a mission's, a kept run's, a folder's, or the file's own."""
    records = [path for path in RUNS.glob("**/*.mcap") if not path.name.endswith(SCENE)]
    for record in records:
        short = [folder for folder in list(record.parents)[-3::-1]      # runs/X first
                 if folder != KEPT and [record for record in records if folder in record.parents] == [record]]
        folder = short[0] if short else record
        yield folder.name if folder.parent in (RUNS, KEPT) else str(folder)
