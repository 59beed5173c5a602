# SPDX-License-Identifier: Apache-2.0
"""`fledge node MISSION PROCESS`: one process of a mission, or several, as programs of a co-simulation.

Exit codes: 0 the run came to its regular end; 1 it ended early; 2 the command line or the mission is wrong,
or the mission cannot be split; 130 Ctrl-C.
"""
from __future__ import annotations

import ast
import os
import signal
from functools import partial
from pathlib import Path
from time import monotonic, perf_counter, sleep

from fledge.cli.arguments import add_mission, add_parameters, add_update_limit, given_parameters, number, parse_duration
from fledge.cli.console import complain, counted, say, size_of
from fledge.errors import Failure
from fledge.disk import make

LATENCIES = ("same_instant", "next_instant", "next_exchange")

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator
    from typing import Any, Self

    from fledge.cosim import Node
    from fledge.mission.crossing import Crossing
    from fledge.mission.simulation import Simulation


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("node", node, "node nadir_spin flight --address tcp://127.0.0.1:7000")
    sub.set_defaults(needs=lambda _: ["build cosim"])
    add_mission(sub)
    sub.add_argument("process", help="what to fly here: flight, world, ...; several, as in world,flight, or all: each "
                     "in a program of its own")
    sub.add_argument("scenario", nargs="?", help="whose set-up to take, up to its run: what it changes and records; "
                     "default: the mission's first")
    sub.add_argument("--scripted", action="store_true", help="what the scenario does between its runs comes by "
                     "commands, as of --script")
    sub.add_argument("--free", action="store_true", help="without a scenario, all outputs recorded every second")
    add_parameters(sub)
    sub.add_argument("--name", metavar="NODE", help="of this node; default: FLEDGE_NODE, else the process' name")
    sub.add_argument("--address", metavar="A", help="of the controller; default: FLEDGE_ADDRESS, else "
                     "tcp://127.0.0.1:7000")
    sub.add_argument("--simulation", metavar="NAME", help="what the controller calls the run; default: "
                     "FLEDGE_SIMULATION, else the mission's name")
    sub.add_argument("--until", metavar="DURATION", help="with the controller here too, which ends the run then (90s, "
                     "10min, 2h): nothing else is to be started")
    sub.add_argument("--seed", type=int, metavar="N", help="of the random streams, with --until; default: 0")
    sub.add_argument("--record", metavar="DIR", help="write the record of this process into DIR/NODE.mcap")
    sub.add_argument("--outputs", metavar="FILE", help="write a record of all outputs of this process, at each of its "
                     "instants")
    sub.add_argument("--script", metavar="FILE", help="commands to this flight process: lines of a time [ns] and the "
                     "bytes of a packet in hexadecimal; each comes before the first instant after its time")
    sub.add_argument("--fmu", metavar="FILE", help="this FMU flies in the place of the process: fledge export fmu")
    sub.add_argument("--every", metavar="DURATION", help="of an FMU in the place of a mission, as in `node ball.fmu "
                     "ball`: the time from one step to the next")
    sub.add_argument("--read", action="append", default=[], metavar="PORT=TOPIC", help="what an input message of that "
                     "FMU reads")
    sub.add_argument("--message", action="append", nargs="+", default=[], metavar="WORD", help="a further message of "
                     "that FMU: NAME TYPE FIELD=VARIABLE ...")
    sub.add_argument("--latency", choices=LATENCIES, default=LATENCIES[-1], help="of what it reads; default: "
                     "next_exchange")
    sub.add_argument("--keys", metavar="PATH", help="the keys of this node (fledge keys); default: FLEDGE_KEYS")
    add_update_limit(sub)
    seconds = number("a number of seconds")
    sub.add_argument("--patience", type=seconds, default=60.0, metavar="S", help="how long to wait for the controller; "
                     "default: 60")
    sub.add_argument("--delay", type=seconds, default=0.0, metavar="S", help="before each step wait so long, at "
                     "random, at most; no result may change")


def node(options: argparse.Namespace) -> int:
    import fledge
    from fledge.interruption import handled

    if options.mission.endswith(".fmu"):
        with handled([number for number in ENDS if signal.getsignal(number) is not signal.SIG_IGN], _interrupt_once):
            return _fmu(options)
    if options.every or options.read or options.message:
        raise Failure("node: --every, --read and --message are of an FMU alone, as in node ball.fmu ball --every 10ms")
    sim = fledge.load(options.mission, **given_parameters(options))
    scenario = set_up(sim, options.scenario, options.free, options.scripted)
    sim.check()
    names = [name.strip() for name in options.process.split(",")]
    if names == ["all"] and "all" not in [process.name for process in sim.processes]:
        names = [process.name for process in sim.processes if process.tasks]
    for name in names:
        sim.process(name)  # raises for an unknown name
    if options.outputs and (options.record or len(names) > 1):
        raise Failure("node: --outputs is for one process, and writes its only record; leave out --record")
    if options.fmu and len(names) > 1:
        raise Failure("node: --fmu is for one process")
    if options.script and (len(names) > 1 or names[0] not in [flight.name for flight in sim.flights]):
        raise Failure("node: --script is for one flight process")
    if len(names) > 1 and options.name:
        raise Failure("node: --name is for one process; several are called as they are")
    if options.record:
        make(Path(options.record), 0o700)
    if options.until is None and options.seed is not None:
        raise Failure("node: the seed is the controller's to give; --seed is for a run with --until")
    # A program in the background of a shell script ignores Ctrl-C: then it stays so.
    with handled([number for number in ENDS if signal.getsignal(number) is not signal.SIG_IGN], _interrupt_once):
        if len(names) > 1 or options.until is not None:
            from fledge import cosim

            return _several(sim, scenario, names, options, cosim.checked_wires(sim))
        return _single(sim, scenario, names[0], options)


def _single(sim: Simulation, scenario: str, process: str, options: argparse.Namespace,
            crossing: list[Crossing] | None = None, address: str | None = None, quiet: bool = False,
            part: Node | None = None) -> int:
    """Fly one process in this program, until the end of the run. part: it, if it is a node already"""
    import fledge
    from fledge import cosim
    from fledge.cli import health

    if options.fmu:
        from fledge.cosim.fmu import fly_fmu

        fly_fmu(sim, options.fmu, process)
    part = part or cosim.split(sim, process, crossing)
    name = options.name or (not quiet and os.environ.get("FLEDGE_NODE")) or process
    _prepare(sim, scenario, process, options, name)
    if not quiet:
        say(f"{sim.name}, {scenario}: {process} as the node {name}")
    problem, reason, code = None, None, 1
    try:
        problem = reason = part.serve(address or options.address, simulation=options.simulation, name=name,
                                      keys=options.keys, timeout=options.patience, delay=options.delay)
    except KeyboardInterrupt:
        problem, code = "interrupted", 130
    except Exception as error:
        problem, code = str(error), 2 if isinstance(error, fledge.SetupError) else 1
    if not quiet and (not problem or sim.time_ns >= 0):     # it took part
        say(f"  flown    {sim.time:g} s")
    findings = sim.health
    if not quiet or findings and not problem:
        health.show(findings, process)
    _close_record(sim, process, options, problem, quiet)
    over = f"the controller refuses {name}: the run is over"  # to a program that comes late
    if quiet and options.until is not None and problem and (
            problem in (reason, "interrupted") or problem.startswith(over)):
        return code  # the controller, which runs here too, reports the reason
    if problem:
        raise Failure(f"{sim.name}, {process}: {problem}", code)
    return 0


def _fmu(options: argparse.Namespace) -> int:
    """Fly an FMU alone."""
    from fledge.cosim.fmu import fmu_node

    if not options.every:
        raise Failure(f"node: how often does {options.mission} step? Give --every, as in --every 10ms")
    reads = dict(word.partition("=")[::2] for word in options.read)
    messages = {}
    for name, *words in options.message:
        kind, *fields = words or [""]
        messages[name] = (kind, dict(word.partition("=")[::2] for word in fields))
    part = fmu_node(options.mission, options.process, parse_duration(options.every, "--every"), reads=reads or None,
                    messages=messages, latency=options.latency, parameters=given_parameters(options))
    if options.record:
        make(Path(options.record), 0o700)
        part.simulation.record(part.simulation.process(part.process).fmu)
    return _single(part.simulation, "alone", part.process, options, part=part)


def _prepare(sim: Simulation, scenario: str, process: str, options: argparse.Namespace, name: str) -> None:
    """Let a process fly its script of commands, and record what is wanted. name: of the node"""
    import fledge

    if options.outputs:
        sim.record(*sim.process(process))
    if options.script:
        from fledge.commands import read_script

        try:
            packets = read_script(Path(options.script).read_text(encoding="utf-8"))
        except ValueError as error:
            raise Failure(f"node: --script {options.script}: expected lines of a time [ns] and hexadecimal: {error}"
                          ) from None
        sim.process(process).commands.script(packets)
    for log in sim.records:
        log.keep = False    # it goes into the file; this program may run for weeks
    if options.record or options.outputs:
        sim.archive(options.outputs or Path(options.record) / f"{name}.mcap", mission=sim.name, scenario=scenario,
                    fledge=fledge.__version__, process=process,
                    **(sim.mission.metadata() if sim.mission else {}))


def _close_record(sim: Simulation, process: str, options: argparse.Namespace, problem: str | None, quiet: bool) -> None:
    """Close the record of a run that has ended, and print what it is. problem: why the run ended early"""
    from fledge.archive.mcap import metadata
    from fledge.archive.reader import missing_of
    from fledge.interruption import handled

    with handled(ENDS, signal.SIG_IGN):
        path = sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    if quiet:
        return
    if path:
        say(f"  record   {path} ({size_of(path)})")
        if missing := missing_of(metadata(path)):
            say(f"  missing  {missing}")
    elif options.record:
        say("  record   none" + ("" if problem else f": nothing of {process} is recorded"))


def _several(sim: Simulation, scenario: str, names: list[str], options: argparse.Namespace,
             crossing: list[Crossing]) -> int:
    """Fly each of several processes in a program of its own; with --until, this program is their controller."""
    from fledge import cosim

    end = None if options.until is None else parse_duration(options.until, "--until")
    own = "" if end is None else f"ipc://@fledge-{sim.name}-{os.getpid()}"
    address: str = options.address or os.environ.get("FLEDGE_ADDRESS") or own
    if end is not None:
        options.simulation = options.simulation or sim.name
    say(f"{sim.name}, {scenario}: {counted(len(names), 'program')}"
        + (f", {', '.join(names)}" if len(names) < 9 else ""))
    begun, problem = perf_counter(), ""
    with Programs() as programs:
        for name in names:
            programs.start(name, partial(_single, sim, scenario, name, options, crossing, address, True))
        if end is not None:  # made after the forks, for sockets belong to one program
            controller = cosim.Controller(options.simulation, names, end, seed=options.seed or 0, address=address,
                                          keys=options.keys, join=options.patience, report=say)
            problem = controller.run(programs.poll)
        failed = programs.wait(5.0 if problem else None)
    took = perf_counter() - begun
    if failed and problem in ("", STOPPED):
        problem = failed[0] + (f", and {counted(len(failed) - 1, 'other')}" if len(failed) > 1 and not problem else "")
    if problem:
        raise Failure(f"{sim.name}: {problem}", 1)
    say(f"  flown    {f'{end:g} s' if end is not None else 'to the end'} in {took:.3g} s"
        + (f", {end / took:,.0f} times real time" if end else ""))
    if end is not None:
        times = controller.times
        ticks, slowest = sum(t[0] for t in times.values()), max(times, key=lambda name: times[name][1])
        say(f"  ticks    {ticks}, {ticks / took:,.0f} per second; {slowest} computed longest, "
            f"{times[slowest][1]:.3g} s")
    if options.record:
        written = [f"{name}.mcap" for name in names if (Path(options.record) / f"{name}.mcap").exists()]
        shown = [*written[:4], *["..."] * (len(written) > 4)]
        say(f"  record   {len(written)} in {options.record}: {', '.join(shown)}")
    return 0


STOPPED = "the user ended it"  # the controller's reason where its poll ends the run


class Programs:
    """Copies of this program, a process each, which all end with it."""

    GRACE = 1.0  # [s] for the controller to notice that a program ended, and to report the reason

    def __init__(self) -> None:
        self.running: dict[int, str] = {}       # name by process
        self.failed: list[str] = []             # how those ended that failed
        self.since: float | None = None         # when this was first seen

    def start(self, name: str, work: Callable[[], Any]) -> None:
        """work: returns the exit code, or nothing"""
        from fledge.pool import fork, leave

        pid = fork()
        if pid:
            self.running[pid] = name
            return
        code = 70
        try:
            code = int(work() or 0)
        except Failure as error:
            complain(str(error))
            code = error.code
        except BaseException as error:
            complain(f"{type(error).__name__}: {error}")
        finally:
            leave(code)

    def poll(self) -> bool:
        """Whether the run can go on: none has failed, or the controller has had no time yet to notice it."""
        self._reap()
        if self.failed and self.since is None:
            self.since = monotonic()
        return self.since is None or monotonic() - self.since < self.GRACE

    def _reap(self) -> None:
        for pid in list(self.running):
            ended, status = os.waitpid(pid, os.WNOHANG)
            if ended:
                name = self.running.pop(pid)
                if status:
                    how = f"was ended by signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else "ended early"
                    self.failed.append(f"{name} {how}")

    def wait(self, timeout: float | None = None) -> list[str]:
        """Wait until all have ended, at most `timeout` [s]; returns how those ended that failed.

        A program that starts after the controller has ended waits for the controller, so there is a limit then.
        """
        until = None if timeout is None else monotonic() + timeout
        while self.running and (until is None or monotonic() < until):
            self._reap()
            sleep(0.01)
        return self.failed

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Ask the programs that are still running to end, then kill them."""
        for signal_number, timeout in ((signal.SIGTERM, 5.0), (signal.SIGKILL, None)):
            for pid in self.running:
                os.kill(pid, signal_number)
            self.wait(timeout)


ENDS = (signal.SIGINT, signal.SIGTERM)


def _interrupt_once(*_: Any) -> None:
    """The terminal and the command that started this program may each send a signal; the first one ends it."""
    for signal_number in ENDS:
        signal.signal(signal_number, signal.SIG_IGN)
    raise KeyboardInterrupt


# --- what comes before the run ---------------------------------------------------------------------

def set_up(sim: Simulation, scenario: str | None = None, free: bool = False, scripted: bool = False) -> str:
    """Do what a scenario does before its run: change parameters, choose what to record. Returns its name.

    Its checks and plots after the run need all processes and are left out. Raises SetupError
    if it runs more than once and is not `scripted`, because the steps between the runs would be left out too.
    """
    from fledge import SetupError
    from fledge.mission import scenario as scenarios

    assert sim.mission
    known = sim.mission.scenarios
    if free or not known:
        if scenario:
            raise Failure("node: give a scenario or --free, not both" if free
                          else f"the mission {sim.name} has no scenarios")
        sim.record(*(instance for process in sim.processes for instance in process), every=1.0)
        return "free"
    name, function = scenarios.chosen(sim, scenario)
    again = _second_run(function)
    if again and not scripted:
        from fledge.disk import shown

        others = [other for other in known if not _second_run(known[other])]
        raise SetupError(f"{shown(again[0])}, line {again[1]}: the scenario {name} runs again here, and what it "
                         "does between its runs cannot be done in programs of their own; fly it in one, by run"
                         + (f", take the scenario {' or '.join(others)}" if others else "")
                         + ", or fly it without a scenario: --free, in the file of a run free = true in each [[node]] "
                         "of the mission")

    scenarios.set_up(sim, function)
    return name


def _second_run(function: Any) -> tuple[str, int] | None:
    """(file, line) where a scenario runs for the second time, or None."""
    import inspect

    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(inspect.cleandoc("if 1:\n" + "".join(lines)) if lines[0][0].isspace() else "".join(lines))
    except (OSError, SyntaxError):
        return None
    sim = function.__code__.co_varnames[0]

    def runs(node: ast.AST, looped: bool) -> Iterator[int]:
        looped = looped or isinstance(node, (ast.For, ast.While))
        if (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("run", "step")
                and isinstance(node.func.value, ast.Name) and node.func.value.id == sim):
            yield node.lineno
            if looped:
                yield node.lineno
        for child in ast.iter_child_nodes(node):
            yield from runs(child, looped)

    places = sorted(runs(tree, False))
    return (function.__code__.co_filename, first + places[1] - 1) if len(places) > 1 else None
