# SPDX-License-Identifier: Apache-2.0
"""`fledge up SIM.toml`: start, watch and end all programs of a co-simulation together."""
from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path

from fledge.cli.console import counted, say, size_of
from fledge.errors import Failure
from fledge.disk import build_folder

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from types import ModuleType

    from fledge.cosim.up.description import Plan
    from fledge.cosim.up.rewind import Past
    from fledge.cosim.up.session import Outcome, Session
    from fledge.cosim.up.table import Lines
    from fledge.mission.simulation import Simulation

_MOST_RECORDS = 8   # in the list; of more only the sum is shown


def read(path: Path) -> str:
    """Read the description of a simulation."""
    from fledge.cosim.up import description
    from fledge.targets import TARGETS

    description.read(path, TARGETS)
    return path.name


READERS = {"node": read, "asynchronous": read, "": read}


def add(command: Callable) -> None:
    """Add the subcommand. command: the function of cli.parser() that adds one."""
    from fledge.cli.arguments import add_parameters, number

    sub = command("up", up, "up spring.toml")
    sub.add_argument("simulation", metavar="SIM.toml|MISSION",
                     help="a file that names the programs; or a mission, each of its processes as a program")
    sub.add_argument("scenario", nargs="?", help="of a MISSION: whose set-up to take; default: its first")
    sub.add_argument("--until", metavar="DURATION", help="how long to simulate (90s, 10min, 2h); default: as the file "
                     "or the scenario says")
    sub.add_argument("--seed", type=int, metavar="N", help="of the random streams")
    sub.add_argument("--pace", type=number(), metavar="X",
                     help="X simulated seconds per second; 0: as fast as possible")
    add_parameters(sub)
    sub.add_argument("--tcp", action="store_true", help="meet at a TCP port of this machine")
    sub.add_argument("--exchange", action="store_true", help="record all messages between the nodes")
    sub.add_argument("--keep-every", metavar="DURATION", help="of simulated time: keep snapshots of all nodes, so that "
                     "fledge rewind can go on from any instant")
    sub.add_argument("--out", metavar="DIR", help="for logs and records; default: runs/NAME")
    sub.add_argument("--report", action="store_true", help="of a whole mission: then check by its scenario what the "
                     "flight computers have put out, and write its plots and a page, into DIR/report")
    sub.add_argument("--logs", action="store_true", help="show the output of the programs instead of the table")
    sub.add_argument("--check", action="store_true", help="only check the file")
    sub.set_defaults(needs=_needed)


def _needed(options: argparse.Namespace) -> list[str]:
    """The targets on which the nodes of a file fly, and the server of a control room. A wrong file needs no more: the
    command itself refuses it."""
    import tomllib

    from fledge.serial_line import BY_SSH
    from fledge.targets import TARGETS

    try:
        file = tomllib.loads(Path(options.simulation).read_text(encoding="utf-8"))
        targets = TARGETS.known([node["target"] for node in file.get("node", []) if "target" in node])
        by_ssh = any(str(node.get("target")).startswith(BY_SSH) for node in file.get("node", []))
        targets += ["ssh", "aarch64"] * by_ssh
        serves = any("serve" in program for program in file.get("asynchronous", []))
    except (OSError, ValueError, TypeError, AttributeError):
        targets, serves = [], False
    return ["build cosim", *targets, *["ground", "build ground", "view"] * serves]


def up(options: argparse.Namespace) -> int:
    """Run the co-simulation; returns the exit code."""
    from fledge.cosim.up import description

    plan = _plan(options, description)
    if plan.until is None:
        raise Failure(f"{plan.file}: how long? write until = SECONDS, or give --until 10min")
    if options.check:
        say(f"{plan.file}: correct: {_programs(plan)}, {plan.until:g} s")
        return 0
    folder = Path(options.out) if options.out else Path("runs") / plan.simulation
    if not options.report:
        return fly(plan, folder, view_of(options))
    from fledge.cli.judge import reported, show_required
    from fledge.cosim.up.missions import whole_mission

    whole_mission(plan)
    plan.report = True
    fly(plan, folder, view_of(options))
    sim, scenario = flown(plan, folder)
    problem, _, outcomes = reported(options, sim, scenario, f"{plan.simulation} in {_programs(plan)}",
                                    folder / "report")
    show_required(outcomes)
    if problem:
        raise Failure(f"{plan.simulation}, {scenario}: {problem}", 1)
    say("  passed")
    return 0


def flown(plan: Plan, folder: Path) -> tuple[Simulation, str]:
    """(the mission, the name of its scenario) of a finished run of `fledge up --report`: what its flight computers put
    out comes from their records; the world runs. Of a program that was lost, the record is what is left of it."""
    import fledge
    from fledge.archive import Archive
    from fledge.cosim.up.missions import whole_mission
    from fledge.mission.scenario import chosen
    from fledge.targets.playback import stand_in

    first = whole_mission(plan)
    sim = fledge.load(str(first.mission), plan.seed, **first.parameters)
    records = {}
    for p in plan.nodes:
        if p.flies:
            place = folder / p.name / str(p.process) / str(p.target) if p.target else folder / p.name
            files = [file for file in (place.with_name(f"{place.name}.mcap{end}") for end in ("", ".part"))
                     if file.exists()]
            if not files:
                raise Failure(f"{place}.mcap, the record of {p.name}, is missing")
            records[str(p.process)] = Archive(files[0])
    stand_in(sim, records, Archive(folder / "exchange.mcap"))
    return sim, chosen(sim, first.scenario)[0]


def fly(plan: Plan, folder: Path, view: Lines, past: Past | None = None) -> int:
    """Run a Plan, perhaps from the Past of another; returns the exit code."""
    from fledge.cosim.up.rewind import RewindError, recorded, past_of
    from fledge.cosim.up.session import Session, StartError
    from fledge.targets import TARGETS
    from fledge.serial_line import is_apart

    built = build_folder() / "cosim"
    for program in ("fledge_controller", "fledge_guard"):
        if not (built / program).exists():
            raise Failure(f"{program} is not built; ./fledge setup builds it")
    TARGETS.ready({p.target: None for p in plan.nodes if p.target and not p.host and not is_apart(p.target)}, "up")
    say(f"{plan.simulation}: {_programs(plan)}, {plan.until:g} s" + (
        f"; warning: without keys, any program that reaches {plan.listening()} reads all messages and may take any "
        "part (fledge help keys)" if plan.beyond and not plan.keys else ""))
    run = folder
    try:
        while True:
            session = Session(plan, folder, view, built, past)
            outcome = session.run()
            if any(row.ticks for row in outcome.progress.rows):
                view.ends(outcome.progress)
            if outcome.rewind is None:
                break
            past = past_of(folder, plan, recorded(folder)[1], outcome.rewind, False)
            new = run.with_name(f"{run.resolve().name}@{outcome.rewind:g}s")
            folders = (new.with_name(f"{new.name}-{i}" if i > 1 else new.name) for i in count(1))
            folder = next(path for path in folders if not path.exists())
            view.happens(f"{plan.simulation}: back to {outcome.rewind:g} s, in {folder}")
    except (StartError, RewindError) as error:
        raise Failure(f"up: {error}") from None
    finally:
        view.close()
    return _report(plan, folder, session, outcome)


def _plan(options: argparse.Namespace, description: ModuleType) -> Plan:
    from fledge.cli.arguments import parse_duration

    given = Path(options.simulation)
    if given.suffix == ".toml" or given.is_file():
        if not given.exists():
            raise Failure(f"up: there is no file {given}")
        from fledge.targets import TARGETS

        try:
            plan = description.read(given, TARGETS, options.scenario)
        except description.SimError as error:
            raise Failure(f"up: the simulation cannot be started\n{error}") from None
        if options.parameters or options.scenario and not plan.mission:
            raise Failure(f"up: a scenario and --set are for a mission; in {given}, write `scenario` and `parameters` "
                          "of a node" + ", or of the file's mission" * bool(plan.mission))
    else:
        from fledge.cli.arguments import given_parameters
        from fledge.cosim.up.missions import plan_of

        plan = plan_of(options.simulation, options.scenario, given_parameters(options))
    if options.until is not None:
        plan.until = parse_duration(options.until, "--until")
    if options.seed is not None:
        if options.seed < 0:
            raise Failure("up: a seed is a number from 0 on")
        plan.seed = options.seed
    if options.pace is not None:
        plan.pace = options.pace
    if options.tcp and not plan.address:
        plan.transport = "tcp"
    plan.exchange = plan.exchange or options.exchange
    if options.keep_every is not None:
        plan.keep_every = parse_duration(options.keep_every, "--keep-every")
    return plan


def _programs(plan: Plan) -> str:
    others = len(plan.programs) - len(plan.nodes)
    return counted(len(plan.nodes), "node") + (f" and {counted(others, 'asynchronous program')}" if others else "")


def view_of(options: argparse.Namespace) -> Lines:
    from fledge.cosim.up.table import Lines, Screen

    if sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb" and not options.logs:
        return Screen()
    return Lines(show_logs=options.logs)


def _report(plan: Plan, folder: Path, session: Session, outcome: Outcome) -> int:
    """Print the results of a run; returns the exit code."""
    from fledge.archive.mcap import metadata
    from fledge.archive.reader import missing_of
    from fledge.cli.runs import worth
    from fledge.cosim.up.table import times

    t, wall = max(outcome.progress.t, 0.0), outcome.progress.wall
    if t > 0 and wall > 0:
        say(f"  flown    {t:g} s in {wall:.3g} s, {times(t / wall)} times real time")
    if outcome.progress.overruns:
        say(f"  pace     {outcome.progress.overruns} instants were late, by up to "
            f"{1e3 * outcome.progress.worst:.1f} ms")
    records = session.records()
    if len(records) > _MOST_RECORDS:
        say(f"  record   {folder}: {len(records)} files ({sum(r.stat().st_size for r in records) / 1e6:.1f} MB)")
    else:
        for record in records:
            say(f"  record   {record} ({size_of(record)})")
    for record in records:
        if missing := missing_of(metadata(record)):
            say(f"  missing  {record}: {missing}")
    for part in session.remains():
        say(f"  left     {part}: its program was lost; it has {worth(part)}")
    say(f"  logs     {folder / 'log'}")
    for name, what in outcome.failed:
        lines = session.last_lines(name)
        say(f"\n{name} {what}" + ("; the end of its log:" if lines else "; its log is empty"))
        for line in lines:
            say(f"  | {line}")
    if outcome.reason:
        code = 1 if not outcome.signal else 128 + outcome.signal
        raise Failure(f"{plan.simulation} ended early: {outcome.reason}", code)
    if outcome.failed:
        raise Failure(f"{plan.simulation} came to its end, but {', '.join(name for name, _ in outcome.failed)} failed",
                      1)
    return 0
