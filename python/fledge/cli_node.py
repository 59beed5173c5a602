# SPDX-License-Identifier: Apache-2.0
"""`fledge node MISSION PROCESS`: one process of a mission as a program of a co-simulation.

Exit codes: 0 the run came to its regular end; 1 it ended early; 2 the command line or the mission is wrong,
or the mission cannot be split; 130 Ctrl-C.
"""

import argparse
import ast
import inspect
import os
import signal
from pathlib import Path

from fledge._console import Failure, say, size_of


def add(command):
    """Add the subcommand, by the function of cli.parser() that adds one."""
    one = command("node", node, "fly one process of a mission as a program of its own, under a controller",
                  "node nadir_spin flight --address tcp://127.0.0.1:7000")
    one.add_argument("mission", help="the name of a mission, or its folder")
    one.add_argument("process", help="what to fly here: flight, world, ...")
    one.add_argument("scenario", nargs="?", help="whose set-up to take, up to its run: what it changes and records; "
                     "default: the mission's first")
    one.add_argument("--free", action="store_true", help="without a scenario, all outputs recorded every second")
    add_parameters(one)
    one.add_argument("--name", metavar="NODE", help="of this node; default: FLEDGE_NODE, else the process' name")
    one.add_argument("--address", metavar="A", help="of the controller; default: FLEDGE_ADDRESS, else "
                     "tcp://127.0.0.1:7000")
    one.add_argument("--simulation", metavar="NAME", help="what the controller calls the run; default: "
                     "FLEDGE_SIMULATION, else the mission's name")
    one.add_argument("--record", metavar="DIR", help="write the record of this process into DIR/NODE.mcap")
    one.add_argument("--keys", metavar="PATH", help="the keys of this node (fledge keys); default: FLEDGE_KEYS")
    one.add_argument("--patience", type=_seconds, default=60.0, metavar="S", help="for the controller to be there; "
                     "default: 60")
    one.add_argument("--delay", type=_seconds, default=0.0, metavar="S", help="before each step wait so long, at "
                     "random, at most: what must not change any result")


def node(options):
    import fledge
    from fledge import cosim

    sim = fledge.load(options.mission, **given_parameters(options))
    scenario = set_up(sim, options.scenario, options.free)
    part = cosim.split(sim, options.process)
    name = options.name or os.environ.get("FLEDGE_NODE") or options.process
    if options.record:
        folder = Path(options.record)
        folder.mkdir(parents=True, exist_ok=True)
        sim.archive(folder / f"{name}.mcap", mission=sim.name, scenario=scenario, fledge=fledge.__version__,
                    process=options.process)
    say(f"{sim.name}, {scenario}: {options.process} as the node {name}")
    signal.signal(signal.SIGTERM, _terminate)
    problem, code = None, 1
    try:
        problem = part.serve(options.address, simulation=options.simulation, name=name, keys=options.keys,
                             patience=options.patience, delay=options.delay)
    except KeyboardInterrupt:
        problem, code = "interrupted", 130
    except Exception as error:
        problem, code = str(error), 2 if isinstance(error, fledge.SetupError) else 1
    say(f"  flown    {sim.time:g} s")
    path = sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    if path:
        say(f"  record   {path} ({size_of(path)})")
    elif options.record:
        say("  record   none" + ("" if problem else f": nothing of {options.process} is recorded"))
    if problem:
        raise Failure(f"{sim.name}, {options.process}: {problem}", code)
    return 0


def _terminate(number, frame):
    raise KeyboardInterrupt


def _seconds(text):
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a number of seconds >= 0; found '{text}'")
    return value


# --- parameters of missions ------------------------------------------------------------------------

def add_parameters(command):
    """The option for a mission's parameters, of every command that loads one."""
    command.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="parameters",
                         help="a parameter of the mission, as in --set spacecraft=8")


def given_parameters(options):
    """What --set gave: name -> a Python literal, or the text itself."""
    given = {}
    for text in options.parameters:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier():
            raise Failure(f"--set {text}: expected NAME=VALUE, as in spacecraft=8")
        try:
            given[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            given[name] = value
    return given


# --- what comes before the run ---------------------------------------------------------------------

class _Begins(BaseException):
    """The scenario asks for its run."""


def set_up(sim, scenario=None, free=False):
    """Do what a scenario does before its run: change parameters, say what to record. Returns its name.

    What it does afterwards, its checks and plots, needs all processes and is left out. Raises SetupError
    if it runs more than once, for what lies between would be left out too.
    """
    from fledge import SetupError

    known = sim.mission.scenarios
    if free or not known:
        if scenario:
            raise Failure("node: give a scenario or --free, not both" if free
                          else f"the mission {sim.name} has no scenarios")
        sim.record(*(one for process in sim.processes for one in process), every=1.0)
        return "free"
    name = scenario or next(iter(known))
    if name not in known:
        raise Failure(f"the mission {sim.name} has no scenario '{name}'; it has {', '.join(known)}")
    again = _second_run(known[name])
    if again:
        from fledge.mission import _relative

        others = [other for other in known if not _second_run(known[other])]
        raise SetupError(f"{_relative(again[0])}, line {again[1]}: the scenario {name} runs again here, and what it "
                         "does between its runs cannot be done in programs of their own; fly it in one, by run"
                         + (f", take the scenario {' or '.join(others)}" if others else "") + ", or use --free")

    def begins(*_, **__):
        raise _Begins

    sim.plots, sim.run, sim.step = False, begins, begins
    try:
        known[name](sim)
    except _Begins:
        pass
    finally:
        del sim.run, sim.step
    return name


def _second_run(function):
    """(file, line) where a scenario runs for the second time, or None."""
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(inspect.cleandoc("if 1:\n" + "".join(lines)) if lines[0][0].isspace() else "".join(lines))
    except (OSError, SyntaxError):
        return None
    sim = function.__code__.co_varnames[0]

    def runs(node, looped):
        looped = looped or isinstance(node, (ast.For, ast.While))
        if (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("run", "step")
                and isinstance(node.func.value, ast.Name) and node.func.value.id == sim):
            yield node.lineno
            if looped:
                yield node.lineno
        for child in ast.iter_child_nodes(node):
            yield from runs(child, looped)

    found = sorted(runs(tree, False))
    return (function.__code__.co_filename, first + found[1] - 1) if len(found) > 1 else None
