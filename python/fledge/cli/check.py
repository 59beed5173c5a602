# SPDX-License-Identifier: Apache-2.0
"""`fledge check MISSION`: all that is wrong with a mission's files, without a flight.

Exit codes: 0 it can fly; 2 it cannot, or one of its files is wrong.
"""
from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from fledge.cli.console import counted, itemized, placed, say
from fledge.cli.arguments import add_mission, add_parameters, given_parameters
from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any

    from fledge.mission.simulation import Simulation


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("check", check, "check nadir_spin")
    add_mission(sub)
    sub.add_argument("--on-board", action="store_true", help="also say which of its requirements flight can judge "
                     "itself, by how many operations, and why it cannot judge another one")
    add_parameters(sub)


def check(options: argparse.Namespace) -> int:
    """Check a mission; returns the exit code."""
    import fledge
    from fledge.errors import Mistakes, SetupError

    sim = fledge.load(options.mission, **given_parameters(options))
    assert sim.mission
    wrong = list(_composition(sim))
    can_fly = not wrong
    parts = [_summary(process) for process in sim.processes]
    wrong += _scripts(sim)
    parts += [counted(len(sim.mission.scenarios), "scenario")] * bool(sim.mission.scenarios)
    # What a scenario gives is not there yet: boards and ground.toml are read of a mission that is whole without it.
    for read in _readers(sim, can_fly and not sim.problems):
        try:
            parts += filter(None, [read()])
        except (SetupError, Failure) as error:
            wrong.append(str(error))
        except Mistakes as error:
            wrong += str(error).splitlines()
    if wrong:
        head = f"{sim.name} {'can' if can_fly else 'cannot'} fly; {counted(len(wrong), 'error')}"
        raise Failure(itemized(head, wrong))
    say(f"{sim.name}: {', '.join(parts)}: can fly")
    if options.on_board:
        from fledge.requirements.onboard import flyable

        for requirement, compiled, reason in flyable(sim):
            cost = f"{counted(len(compiled.rows), 'operation')}, {counted(compiled.memory, 'number')} remembered" \
                if compiled else ""
            say(f"  {requirement.id:<8} {cost or reason}")
    return 0


def _composition(sim: Simulation) -> Iterator[str]:
    """Why it cannot fly, a line each."""
    from fledge.errors import CompositionError
    from fledge.mission import MissionError, explain
    from fledge.mission.scenario import lacking

    assert sim.mission
    if problems := sim.problems:
        scenarios = sim.mission.scenarios
        try:
            left = lacking(sim, scenarios)
        except MissionError as error:
            yield from (*placed(problems), str(error))
            return
        if left or not scenarios:
            yield from placed(problems)
        if left and (whole := [name for name in scenarios if name not in left]):
            yield f"{', '.join(whole)} can fly: what is missing, the scenario gives"
        return
    try:
        sim.prepare()
    except CompositionError as error:
        yield from str(error).splitlines()
    except Exception as error:      # of the reset of a module in Python
        yield explain(error, sim.mission.folder)


def _scripts(sim: Simulation) -> Iterator[str]:
    """What modules in Python would compute to other bits on a target, a line each."""
    from fledge.disk import shown
    from fledge.mission.checks import other_bits
    from fledge.objects.script import script

    functions = {function for process in sim.flights for module in process.instances.values()
                 for function in script(module) or () if function}
    for file, line, why in sorted({found for function in functions for found in other_bits(function)}):
        yield f"{shown(file)}, line {line}: not the same bits under MicroPython: {why}"


def _summary(process: Any) -> str:
    """ "flight 12 modules in 3 tasks and 2 modes"."""
    from fledge.mission.wiring import kind_of

    places = [counted(len(some), word) for some, word in ((process.tasks, "task"), (process.modes, "mode")) if some]
    return (f"{process.name} {counted(len(process.instances), 'model' if kind_of(process) == 'world' else 'module')}"
            + (f" in {' and '.join(places)}" if places else ""))


# --- its files, by what reads them in other commands; those of capabilities, by READERS --------

def _readers(sim: Simulation, whole: bool) -> Iterator[Callable[[], str]]:
    """The reader of each of its files, which returns a summary. whole: those about flight's messages, too."""
    from functools import partial

    from fledge.cli import capabilities

    assert sim.mission
    folder = sim.mission.folder
    readers = capabilities.readers()
    yield partial(_requirements, sim)
    for name in readers:
        if name.endswith(".py") and (folder / name).exists():
            yield partial(readers[name], folder / name)
    keys = {path: _keys(path) for path in sorted(folder.glob("*.toml"))}
    boards = [[path] for path, entries in keys.items() if "snorkel" in entries]
    if any(folder.glob("boards/*.toml")):
        boards.append([folder / "boards"])
    for paths in boards if whole else ():
        yield partial(_boards, sim, paths)
    if whole and (folder / "ground.toml").exists():
        yield partial(_ground, sim)
    for path, entries in keys.items():
        yield from [partial(read, path) for kind, read in readers.items() if kind in (entries or {""})][:1]


def _keys(path: Path) -> set[str]:
    """The keys of a TOML file; none if it cannot be read, which the reader of "" reports."""
    import tomllib

    try:
        return set(tomllib.loads(path.read_text(encoding="utf-8")))
    except (ValueError, OSError):
        return set()


def _requirements(sim: Any) -> str:
    from fledge.requirements import Requirements

    requirements = Requirements(sim)
    return counted(len(requirements.all), "requirement") if requirements else ""


def _boards(sim: Any, paths: Sequence[Any]) -> str:
    """Of the one flight process; if there are several, the commands that take boards say which is meant."""
    from fledge.export import board, read_all

    if len(sim.flights) == 1:
        mission = read_all(sim)[0]
        board.lanes(mission, board.read(mission, board.texts_of(paths)))
    return ", ".join(path.name for path in paths)


def _ground(sim: Any) -> str:
    from fledge.export import ground, packets, read_all

    ground.read(sim.mission.folder, [packets.database(process) for process in read_all(sim)])
    return ground.FILE
