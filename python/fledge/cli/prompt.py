# SPDX-License-Identifier: Apache-2.0
"""`fledge console MISSION`: its flight software under MicroPython, by this machine's clock, with a prompt.

Exit codes: 0 the end of the input; 1 flight ended early; 2 the command line or the mission is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse
from pathlib import Path

from fledge.cli.arguments import add_mission, add_parameters, add_process, given_parameters

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from fledge.mission.process import Flight

TARGET = "micropython-dev"
HELP = """A line is Python, which flight evaluates at its next instant: f.control.K; f.control.K = 3.
:run FILE    send a procedure, and start it
:stop        stop it
:help        print this
Ctrl-D ends."""


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("console", console, "console nadir_spin")
    add_mission(sub)
    add_process(sub)
    sub.add_argument("--turns", type=int, default=10_000, metavar="N", help="of loops and returns of functions that a "
                     "line or a procedure may take in one instant; default: 10000")
    sub.add_argument("--out", metavar="DIR", help="for the programs; default: runs/MISSION/console")
    add_parameters(sub)
    sub.set_defaults(needs=lambda options: [TARGET])


def console(options: argparse.Namespace) -> int:
    from fledge.cli.runs import alone
    from fledge.errors import Failure
    from fledge.targets import TARGETS, Job
    from fledge.targets.micropython.console import Console

    target, = TARGETS.ready([TARGET], "console")
    folder = Path(options.out) if options.out else Path("runs") / Path(options.mission).name / "console"
    with alone(folder):
        job = Job(options.mission, None, 1.0, 0, folder=folder, free=True, parameters=given_parameters(options))
        if options.process is None and len(job.parts) > 1:
            raise Failure(f"console: --process: {job.title} has {', '.join(part.process for part in job.parts)}")
        part = job.part(options.process or job.parts[0].process)
        with Console(part, target) as flight:
            for text in _texts(f"{part.mission.title}; :help; Ctrl-D ends"):
                _answer(flight, text, options.turns)
        return 0


def _texts(title: str) -> Iterator[str]:
    """What a person types: lines; blocks to their empty line. Without a terminal, nothing is asked for."""
    import sys

    asks = sys.stdin.isatty()
    if asks:
        import readline  # noqa: F401, so that input() has a history
        print(title)
    block: list[str] = []
    while True:
        try:
            line = input((("... " if block else ">>> ")) if asks else "")
        except EOFError:
            if block:
                yield "\n".join(block) + "\n"
            if asks:
                print()
            return
        if block or line.rstrip().endswith(":"):
            block.append(line)
            if line.strip():
                continue
            line, block = "\n".join(block) + "\n", []
        if line.strip():
            yield line


def _answer(flight: Flight, text: str, turns: int) -> None:
    """Send a text to flight, and print its answer."""
    from fledge.cli.console import say
    from fledge.errors import Failure, SetupError

    word, _, rest = text.strip().partition(" ")
    try:
        if word == ":help":
            print(HELP)
        elif word == ":run":
            flight.run(Path(rest.strip()), turns)
        elif word == ":stop":
            flight.stop()
        elif word.startswith(":"):
            print(f"there is no {word}; :help shows what there is")
        else:
            flight.evaluate(text, turns)
    except (Failure, SetupError, OSError) as error:
        if not flight.lives():
            raise
        say(str(error))
