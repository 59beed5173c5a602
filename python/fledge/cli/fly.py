# SPDX-License-Identifier: Apache-2.0
"""`fledge fly MISSION --on TARGETS`: the same flight on several targets, compared with the desktop.

Exit codes: 0 every target passed; 1 one did not, as the last line says: its outputs differ, a check or a bound does not
hold, a command was refused, or it did not fly; 2 the command line, the mission or a board is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse
import os

from fledge import serial_line
from fledge.cli.arguments import add_mission, add_parameters, add_seed, given_parameters, number
from fledge.cli.console import complain, say
from fledge.errors import Failure
from fledge.targets import TARGETS

PATIENCE = 1e6          # [s] of the other programs, while gdb stops flight
TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path
    from typing import Any

    from fledge.archive import Archive
    from fledge.requirements import Outcome
    from fledge.targets.comparison import Bound, Comparison
    from fledge.targets.flown import Flown
    from fledge.targets.job import Job, Part
    from fledge.targets.target import Target


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("fly", fly, "fly nadir_spin --on desktop,linux,aarch64")
    add_mission(sub)
    sub.add_argument("scenario", nargs="?", help="its set-up and duration count; default: the mission's first")
    sub.add_argument("--free", action="store_true", help="without a scenario; with --for")
    sub.add_argument("--on", default="desktop,linux", metavar="TARGETS", help=f"of {', '.join(TARGETS)}; default: "
                     "desktop,linux. The desktop always flies, because the others are compared with it. "
                     "chief=cfs,deputy=leon3: one run, with a target for each of these flight processes; all others on "
                     "the desktop's code. serial:DEVICE: a board at a serial line, as in "
                     "serial:/dev/ttyACM0?baud=921600&reset=go-on&cut=10; ssh:HOST: a computer with Linux")
    line = sub.add_argument_group("on a board at a serial line (serial:DEVICE), or a computer with Linux")
    line.add_argument("--elf", action="append", default=[], metavar="FILE", help="the program that the board has, "
                      "which is checked; default: any of this mission. PROCESS=FILE: of that flight process")
    line.add_argument("--baud", type=int, metavar="N", help="of the line; default: 921600")
    line.add_argument("--pace", type=number(), default=0.0, metavar="X", help="X simulated seconds per second, with a "
                      "histogram of how late flight answered; default: the world waits for the board")
    sub.add_argument("--for", dest="duration", metavar="DURATION", help="fly only so long (90s, 10min, 2h)")
    add_seed(sub)
    sub.add_argument("--board", nargs="+", action="extend", default=[], metavar="FILE", help="boards that the messages "
                     "pass, as in docs/export.md: files, or folders of *.toml; default: one that carries them whole. "
                     "PROCESS=FILE: of that flight process")
    sub.add_argument("--within", action="append", default=[], type=_bound, metavar="FIELD=BOUND", help="with words "
                     "that round: the largest difference of a field from the desktop's, as in "
                     "tracking.error.sigma_BR=1e-4")
    sub.add_argument("--settled", metavar="DURATION", help="the time from which --within holds; default: the beginning")
    sub.add_argument("--cfs", metavar="DIR", help="with --on cfs: build and fly in a copy of this cFS tree, instead of "
                     "on the pocket cFE; with --on leon3-rtems: an app on its core, under RTEMS")
    sub.add_argument("--rtems", metavar="DIR", help="with --on leon3-rtems: the folder into which RTEMS 6 was "
                     "installed, with the BSP leon3; default: FLEDGE_RTEMS")
    sub.add_argument("--clock", action="store_true", help="fly one process in real time, by the clock of this machine, "
                     "with the inputs of the desktop's flight; print and plot how late it woke and how long a cycle "
                     "took; with --for")
    sub.add_argument("--report", action="store_true", help="also write the plots and a page about the run on each "
                     "target, as run does")
    line.add_argument("--ssh", metavar="COMMAND", default="", help="with ssh:HOST: how ssh is called, as in 'ssh -p "
                      "2222'; default: ssh")
    _add_tools(sub)
    sub.add_argument("--build", action="store_true", help="only build, and print the path and the size")
    sub.add_argument("--join", nargs="?", const="", metavar="ADDRESS", help="fly as a node, called as "
                     "the process, of a run whose controller is elsewhere, one process on one target; default: "
                     "FLEDGE_ADDRESS, FLEDGE_SIMULATION, FLEDGE_NODE")
    sub.add_argument("--keys", metavar="PATH", help="of this node, for --join (fledge keys); default: FLEDGE_KEYS")
    sub.add_argument("--out", metavar="DIR", help="for the records and the programs; default: runs/MISSION/fly")
    add_parameters(sub)
    sub.set_defaults(needs=_needed)


def _add_tools(sub: argparse.ArgumentParser) -> None:
    tools = sub.add_argument_group("on one target on the LEON3 emulator (docs/leon3-debugging.md); --gdb on "
                                   "cortex-m7 and riscv64, too")
    tools.add_argument("--gdb", metavar="[ADDRESS:]PORT", help="wait there for gdb-multiarch")
    for name, what in (("trace", "each instruction, in words"), ("coverage", "the lines and branches that ran, for "
                       "genhtml"), ("profile", "the cost of each function, for callgrind_annotate")):
        tools.add_argument(f"--{name}", metavar="FILE", help=f"write {what}")


def _needed(options: argparse.Namespace) -> list[str]:
    names, apart = _chosen(options.on)
    chosen = [*names, *apart.values()]
    by_ssh = any(name.startswith(serial_line.BY_SSH) for name in chosen)
    return [*TARGETS.known(chosen), *["build loop"] * any(map(serial_line.is_apart, chosen)),
            *["ssh", "aarch64"] * by_ssh]


def fly(options: argparse.Namespace) -> int:
    from fledge.cli.runs import alone

    names, apart = _chosen(options.on)
    lines = _at_lines(options, names, apart)
    names = [serial_line.name_of(name) for name in names]
    apart = {process: serial_line.name_of(name) for process, name in apart.items()}
    targets, lacking = _targets(options, [*names, *apart.values()], lines)
    duration, settled = _times(options, lacking)
    others: list[tuple[Part, Target]] = []
    bounds: list[Bound] = []

    def check(job: Job) -> None:
        for process in [*apart, *filter(None, _by_process(options.elf))]:
            job.part(process)
        others.extend((part, targets[name]) for name in names if name != "desktop" for part in job.parts)
        others.extend((job.part(process), targets[name]) for process, name in apart.items() if name != "desktop")
        bounds.extend(_checked(options, job, others, settled))
        if not (_is_part(options) or options.clock):    # these build at once
            _refuse(lambda target, part: target.check(part), others, lacking)

    for name, why in lacking.items():
        complain(f"{name}: {why}", "  ")
    job = _job(options, duration, settled, check, [*names, *apart.values()])
    with alone(job.folder):
        if options.build:
            return _build(job, others)
        if options.clock:
            return _clock(job, others)
        if options.join is not None:
            return _join(job, *others[0], options.join, options.keys)
        _refuse(lambda target, part: target.built(part), others, lacking)
        runs = {name: {part.process: targets[name] for part in job.parts} for name in names if name != "desktop"}
        if apart:
            runs["apart"] = {part.process: targets[apart.get(part.process, "desktop")] for part in job.parts}
        return _fly(options, job, runs, bounds, lacking)


def _is_part(options: argparse.Namespace) -> bool:
    """Whether this only builds, or flies a part of a run elsewhere: then the duration does not matter."""
    return options.build or options.join is not None


def _targets(options: argparse.Namespace, chosen: list[str], lines: dict[str, Any]
             ) -> tuple[dict[str, Any], dict[str, str]]:
    """(the targets by name, as the options want them; why some of them cannot fly). lines: of _at_lines()"""
    if options.rtems:
        from fledge.targets.leon3_rtems import NAMED_BY

        if "leon3-rtems" not in chosen:
            raise Failure("fly: --rtems is for --on leon3-rtems")
        os.environ[NAMED_BY] = options.rtems
    ours = [name for name in chosen if name not in lines]
    targets, lacking = _ready(["desktop", *ours])
    targets |= lines | _with_tools(options, ours)
    targets |= _in_tree(options.cfs, targets) if options.cfs else {}
    return targets, lacking


def _times(options: argparse.Namespace, lacking: dict[str, str]) -> tuple[float | None, float]:
    """([s] to fly, None: to the end of the scenario; [s] from which --within holds). Raises Failure where no flight of
    any length is possible."""
    from fledge.cli.arguments import flight_time, parse_duration

    duration = flight_time(options)
    settled = parse_duration(options.settled, "--settled") if options.settled else 0.0
    part = _is_part(options)
    if options.clock and not duration:
        raise Failure("--clock: give a duration with --for; each second takes one")
    if lacking and (part or options.clock):
        raise Failure(next(iter(lacking.values())))
    if options.free and (options.scenario or not (duration or part)):
        raise Failure("fly: --free is without a scenario, and needs --for")
    return duration or (1.0 if part else None), settled


def _job(options: argparse.Namespace, duration: float | None, settled: float, check: Callable[[Job], None],
         chosen: list[str]) -> Job:
    """The flight of the desktop, with which the chosen targets are compared. Prints the verdict if its checks fail."""
    from fledge.targets import Job

    try:
        job = Job(options.mission, options.scenario, duration, options.seed, _by_process(options.board), options.out,
                  options.free, given_parameters(options), before=check, judged=True)
    except Failure as error:
        if error.code == 1:     # the scenario fails on the desktop
            _verdict({"desktop": ["the scenario's checks do not hold"], **{name: ["did not fly"] for name in chosen}})
        raise
    if options.settled and settled > job.duration:
        raise Failure(f"--settled {settled:g} s is after the end of the flight, {job.duration:g} s")
    if options.report and not job.whole:
        raise Failure("--report is about a whole scenario; leave out --for" + (" and --free" if options.free else ""))
    if options.gdb:
        address = options.gdb if ":" in options.gdb else f":{options.gdb}"
        complain(f"the board waits for gdb-multiarch: target remote {address}")
    return job


def _refuse(prepare: Callable[[Target, Part], object], others: list[tuple[Part, Target]],
            lacking: dict[str, str]) -> None:
    """Call prepare(target, part) of all that fly, before anything does. Print why a target refuses, and add it to
    `lacking`; its other parts are left out."""
    from fledge.errors import SetupError

    for part, target in others:
        if target.name not in lacking:
            try:
                prepare(target, part)
            except (Failure, SetupError, OSError) as error:
                lacking[target.name] = str(error)
                complain(f"{target.name}: {error}", "  ")


def _checked(options: argparse.Namespace, job: Job, others: list[tuple[Part, Target]], settled: float) -> list[Bound]:
    """The bounds by which the flight is judged: (field, how much, [s] from when on, where it stands) of each. Raises
    Failure if options do not fit the mission."""
    if options.clock and len(others) != 1:
        raise Failure(f"--clock: name one target of one flight process with --on; found {len(others)}")
    if options.join is not None and len(others) != 1:
        several = f", as in {job.parts[0].process}=linux" if len(job.parts) > 1 else ""
        raise Failure(f"--join: name one target with --on{several}; found {len(others)}")
    if options.keys and options.join is None:
        raise Failure("--keys is for --join: other programs of a flight here need none")
    if options.settled and not options.within:
        raise Failure("--settled is for --within; give both")
    if options.within and not job.rounds:
        raise Failure("--within is for boards with words that round; messages that pass whole are the same bits")
    bounds = [*job.bounds(), *((field, bound, settled, "--within") for field, bound in options.within)]
    for field, _, _, where in bounds:
        if not any(part.puts_out(field) for part in job.parts):
            raise Failure(f"{where}: flight puts out no field {field}"
                          + (f"; its processes are {', '.join(part.process for part in job.parts)}"
                             if len(job.parts) > 1 else ""))
    return bounds


def _ready(names: Sequence[str]) -> tuple[dict[str, Any], dict[str, str]]:
    """(the targets by name, why some of them cannot fly). Raises Failure if there is no such target."""
    TARGETS.expect(names, "fly")
    known, lacking = {name: TARGETS[name] for name in names}, {}
    for name in known:
        try:
            TARGETS.ready([name], "fly")
        except Failure as error:
            lacking[name] = str(error)
    return known, lacking


def _at_lines(options: argparse.Namespace, names: list[str], apart: dict[str, str]) -> dict[str, Any]:
    """The boards at serial lines and computers that --on names, by their names."""
    from fledge.targets.serial import Serial
    from fledge.targets.ssh import Ssh

    words = [(process, word) for process, word in [*(("", name) for name in names), *apart.items()]
             if serial_line.is_line(word)]
    for option in ("elf", "baud", "pace"):
        if getattr(options, option) and not words:
            raise Failure(f"fly: --{option} is for a board at a serial line, as in --on {serial_line.EXAMPLE}")
    hosts = [word for word in [*names, *apart.values()] if word.startswith(serial_line.BY_SSH)]
    if options.ssh and not hosts:
        raise Failure("fly: --ssh is for --on ssh:HOST")
    elves = _by_process(options.elf)
    targets: dict[str, Any] = {serial_line.name_of(word): Ssh(word, options.ssh) for word in hosts}
    if more := [process for process, files in elves.items() if len(files) > 1]:
        raise Failure(f"fly: --elf names {len(elves[more[0]])} programs{f' of {more[0]}' * bool(more[0])}; give one, "
                      "or PROCESS=FILE of each flight process")
    for process, word in words:
        files = elves.get(process) or elves.get("") or []
        elf = files[0] if files else None
        target = Serial(word, elf, options.baud, options.pace)
        if target.name in targets:
            raise Failure(f"fly: --on names {target.device} twice; a board flies one process")
        targets[target.name] = target
    return targets


def _with_tools(options: argparse.Namespace, chosen: Iterable[str]) -> dict[str, Any]:
    """The one target on a LEON3, or for --gdb on another emulated board, with what a developer wants of it."""
    words = [word for name in ("trace", "coverage", "profile") if getattr(options, name)
             for word in (f"--{name}", os.path.abspath(getattr(options, name)))]
    words += ["--gdb", options.gdb] if options.gdb else []

    def takes(target: Target) -> bool:
        return target.takes_tools or (words[:1] == ["--gdb"] and target.takes_gdb)

    flown = [name for name in chosen if takes(TARGETS[name])]
    if words and len(flown) != 1:
        taking = [name for name, target in TARGETS.items() if takes(target)]
        raise Failure(f"fly: {words[0]} is for one of {', '.join(taking)}, as in --on {taking[0]}; found {options.on}")
    makers: dict[str, Any] = {name: type(TARGETS[name]) for name in flown}
    return {name: target(words) for name, target in makers.items()} if words else {}


def _in_tree(tree: str, targets: dict[str, Any]) -> dict[str, Any]:
    """Those of the targets that fly in a tree of cFS, by name."""
    from fledge.targets.cfs.real import RealCfs
    from fledge.targets.leon3_rtems.real import RtemsCfs

    makers = {"cfs": lambda _: RealCfs(tree), "leon3-rtems": lambda target: RtemsCfs(tree, target.tools)}
    trees = {name: make(targets[name]) for name, make in makers.items() if name in targets}
    if not trees:
        raise Failure("fly: --cfs is for --on cfs or leon3-rtems")
    return trees


def _chosen(text: str) -> tuple[list[str], dict[str, str]]:
    """(names of targets, a run each; process -> name of its target, in one more run) of --on."""
    names: list[str] = []
    apart: dict[str, str] = {}
    for word in filter(None, map(str.strip, text.split(","))):
        before, line, after = word.partition(serial_line.BEGIN)      # behind which there may be a =
        process, equals, name = before.rpartition("=") if line else word.rpartition("=")
        name += line + after
        if not equals:
            names.append(name)
        elif process in apart:
            raise Failure(f"fly: --on gives {process} two targets, {apart[process]} and {name}; give one")
        else:
            apart[process] = name
    if not names and not apart:
        raise Failure("fly: --on names no target; there are " + ", ".join(TARGETS))
    return names, apart


def _by_process(words: Iterable[str]) -> dict[str, list[str]]:
    """Process -> its files and folders, of the words FILE and PROCESS=FILE."""
    files: dict[str, list[str]] = {}
    for word in words:
        process, _, file = word.rpartition("=")
        files.setdefault(process, []).append(file)
    return files


def _fly(options: argparse.Namespace, job: Job, runs: dict[str, dict[str, Target]], bounds: list[Bound],
         lacking: dict[str, str]) -> int:
    """Fly all, compare and judge; the arguments are those of Comparison."""
    from fledge.targets.comparison import Comparison

    boards = [path.name for path in job.boards]
    title = f"{job.title}, {job.scenario}, {job.duration:g} s"
    say(title + (f", through {', '.join(boards)}" if boards else ""))
    flights = Comparison(job, runs, bounds, lacking, PATIENCE if options.gdb else 60.0, options.pace)
    flights.fly(lambda text: complain(text, "  "))
    _show(flights, title, bool(options.pace))
    _judge(options, flights)
    return _verdict({flights.title(name): problems for name, problems in flights.wrong.items()},
                    130 if flights.interrupted else 1)


def _show(flights: Comparison, title: str, paced: bool) -> None:
    """Print the table of all, and what else there is to know of a flight."""
    from fledge.targets import table

    for line in [*table.lines(flights.rows), *table.scripts(flights.rows), *table.serial_lines(flights.rows)]:
        say("  " + line)
    if flights.archives:
        say(f"  records  {', '.join(map(str, flights.archives))}")
    for name, flight, *_ in flights.rows if paced else ():
        if flight and flight.line:
            say(f"  plot     {_plot_late(flight, f'{title}, by the clock, on {name}')}")
    for note in flights.notes:
        say(f"  {note}")


def _judge(options: argparse.Namespace, flights: Comparison) -> None:
    """Judge what each target put out by the scenario's checks and the requirements that it shows."""
    from fledge.cli.judge import show_required
    from fledge.requirements.judge import VIOLATED, problem_of

    job = flights.job
    if not job.whole:
        if job.scenario != "free":
            say(f"  checks   none: the flight ends before the scenario {job.scenario}")
        return
    if not job.checked:
        say("  checks   none: the scenario has no check, and the mission no requirement for it")
    same: dict[tuple[str, ...], tuple[list[str], list[Outcome]]] = {}     # targets with the same outcomes
    for name, record in flights.records.items():
        raised, failed, outcomes = (job.problem, 1, job.outcomes) if name == "desktop" else _judged(
            options, job, name, record)
        violated = [outcome.requirement.id for outcome in outcomes if outcome.verdict == VIOLATED]
        if violated:
            flights.wrong[name].append(f"violates {', '.join(violated)}")
        if raised and raised != problem_of(outcomes, job.duration):     # by the scenario itself
            flights.wrong[name].append("the scenario's checks "
                                       + ("do not hold" if failed == 1 else "cannot be judged by its record"))
            complain(f"{job.title}, {job.scenario} on {name}: {raised}")
        same.setdefault(tuple(map(str, outcomes)), ([], outcomes))[0].append(flights.title(name))
    for names, outcomes in same.values():
        show_required(outcomes, ", ".join(names))


def _plot_late(flown: Flown, title: str) -> Path:
    from fledge.plot import save
    from fledge.targets import serial

    return save(serial.plot(flown.line or {}, title), flown.record.parent, f"{flown.record.stem}_late")


def _verdict(wrong: dict[str, list[str]], code: int = 1) -> int:
    """Print the last line, which has every target; returns the exit code. wrong: what is, by target."""
    passed = [name for name, problems in wrong.items() if not problems]
    failed = [f"{name}: {', '.join(problems)}" for name, problems in wrong.items() if problems]
    say(f"  failed   {'; '.join(failed)}" + (f" (passed: {', '.join(passed)})" if passed else "") if failed else
        f"  passed   {', '.join(passed)}")
    return code if failed else 0


def _judged(options: argparse.Namespace, job: Job, name: str,
            flown: dict[str, Archive]) -> tuple[str | None, int, list[Outcome]]:
    """The same as of attempt(), of what a target put out."""
    from fledge.archive import Archive, ArchiveError
    from fledge.cli.judge import judge
    from fledge.errors import SetupError

    try:
        return judge(options, job, name, flown, Archive(job.exchange(name)) if job.boards else None)
    except (Failure, SetupError, ArchiveError, OSError) as error:
        return str(error), 2, []


def _build(job: Job, others: list[tuple[Part, Target]]) -> int:
    from fledge.targets import table

    for part, target in others:
        built = target.build(part)
        code, memory = target.sizes(built)
        name = f"{part.process} on {target.name}" if len(job.parts) > 1 else target.name
        say(f"  {name:8}  {built}  {table.size(code)} of code, {table.size(memory)} of memory")
    return 0


def _clock(job: Job, others: list[tuple[Part, Target]]) -> int:
    import dataclasses
    import json

    from fledge.columns import columns
    from fledge.disk import write_files
    from fledge.plot import save
    from fledge.targets.linux import clock

    (part, target), = others
    desktop: Any = TARGETS["desktop"]
    paced = clock.fly(target, part, desktop.fly(job)[part.process].record)
    title = f"{job.title}, {job.duration:g} s by the clock, on {target.name}"
    say(f"{title}\n  scheduling  {paced.scheduling}\n  memory      {paced.memory}; page faults in the loop: "
        f"{paced.faults}\n  cycles      {paced.cycles}, of which {paced.overruns} ended after the next should begin")
    for line in columns(paced.lines(), right={1, 2, 3, 4}):
        say("  " + line)
    files = write_files({f"{target.name}_clock.json": json.dumps(dataclasses.asdict(paced), indent=1) + "\n"},
                        part.folder)
    say(f"  outputs     {'as on the desktop' if paced.same else 'NOT as on the desktop'}\n"
        f"  figures     {files[0]}\n"
        f"  plot        {save(clock.plot(paced, title), part.folder, f'{target.name}_clock')}")
    return _verdict({target.name: [] if paced.same else ["its outputs are not the desktop's"]})


def _join(job: Job, part: Part, target: Target, address: str, keys: str | None) -> int:
    from fledge.targets import table

    address = address or os.environ.get("FLEDGE_ADDRESS") or "tcp://127.0.0.1:7000"
    simulation = os.environ.get("FLEDGE_SIMULATION") or job.title
    node = os.environ.get("FLEDGE_NODE") or part.process
    say(f"{job.title}, {job.scenario}: {target.name} as the node {node} of {simulation} at {address}")
    flown = target.join(part, address, simulation, node, keys)
    say(f"  flown    {flown.steps} steps, {table.cpu(flown.cpu)} each{', ' + flown.cpu_of if flown.cpu_of else ''}\n"
        f"  record   {flown.record}")
    for line in table.serial_lines([(target.name, flown, "", "")]):
        say(f"  {line}")
    return 0


def _bound(text: str) -> tuple[str, float]:
    field, equals, value = text.rpartition("=")
    try:
        return field, float(value) if equals and field and float(value) >= 0 else 1 / 0
    except (ValueError, ZeroDivisionError):
        raise argparse.ArgumentTypeError(f"expected FIELD=BOUND, as in tracking.error.sigma_BR=1e-4; found '{text}'"
                                         ) from None
