# SPDX-License-Identifier: Apache-2.0
"""`fledge export c MISSION`: what flies, as source without Python; `fledge export cfs MISSION --app NAME`: as an app
of the core Flight System; `fledge export rtems MISSION`: as an application of RTEMS; `fledge export micropython
MISSION`: as a program of MicroPython, whose script composes it; `fledge export xtce MISSION`: its packets and commands,
as a database for ground stations; `fledge export fmu MISSION`: the mission, its world or its flight as an FMU.

Exit codes as of all commands: 0 written; 2 the command line or the mission is wrong, and nothing is written.
"""
from __future__ import annotations

from pathlib import Path

from fledge.cli.arguments import add_mission, add_parameters, given_parameters
from fledge.targets import TARGETS

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from fledge.export.read import Mission
    import argparse


# Options that a form has alone.
OWN = {"cfs": ("app", "topic", "wakeup", "input", "keep", "beside", "simulated", "order"),
       "micropython": ("development",), "xtce": ("yamcs", "cosmos"),
       "fmu": ("fmi", "sources", "no_heads", "platform", "on")}


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("export", export, "export c nadir_spin --out nadir_spin_c")
    forms = ["c", "cfs", "rtems", "micropython", "xtce", "fmu"]
    sub.add_argument("form", choices=forms, help="c: MISSION.h and MISSION.c, in C99; cfs: an app for the apps "
                     "folder of a cFS tree; rtems: an application of RTEMS 6 on a LEON3, with a Makefile; "
                     "micropython: a program for this machine, which its script composes; "
                     "xtce: all packets and commands, of all flight processes, as a database for ground stations; "
                     "fmu: an FMU for co-simulation")
    add_mission(sub)
    sub.add_argument("--process", metavar="NAME", help="the flight process; default: the only one, or of xtce all; "
                     "fmu: also world; default: world and flight in one FMU")
    sub.add_argument("--tasks", metavar="NAMES", help="export only these tasks, as in gnc,telemetry; default: all")
    sub.add_argument("--board", nargs="*", action="extend", metavar="FILE", help="also write the boards through which "
                     "the messages pass, and their tables: files, or folders of *.toml; without FILE: a board that "
                     "carries each message whole")
    sub.add_argument("--outputs", metavar="PATHS", help="further outputs that the board carries, besides "
                     "those that the world reads, as in flight.tracking.error,flight.spin.euler; all: every output")
    sub.add_argument("--app", metavar="NAME", help="cfs: the app's name, as in nav; its C is called NAV_...")
    sub.add_argument("--topic", metavar="N", default=None, help="cfs: the number of the app's first message "
                     "id, which is 0x1800 + N for commands and 0x0800 + N for telemetry; default: 0xC0")
    sub.add_argument("--wakeup", metavar="ID", help="cfs: the message of a scheduler that wakes the app, as in 0x18D0, "
                     "or own: the app wakes itself; default: a topic of the app's")
    sub.add_argument("--input", metavar="PATH=ID", action="append", default=[], help="cfs: the message id of an input, "
                     "as in world.nav.attitude=0x08D3; default: a topic of the app's")
    sub.add_argument("--keep", metavar="NAMES", help="cfs: what outlives the app, in a critical data store: "
                     "parameters, or modules, as in flight.control")
    sub.add_argument("--beside", metavar="DIR", action="append", default=[], help="cfs: the folder of an app of the "
                     "same core, whose message ids must differ; apps in the same folder are known")
    sub.add_argument("--simulated", action="store_true", help="cfs: with registers in a file, for a simulation")
    sub.add_argument("--order", choices=["little", "big"], default=None, help="cfs: byte order of the target, for .tbl "
                     "files; default: little")
    sub.add_argument("--development", action="store_true", help="micropython: with the compiler and a prompt")
    sub.add_argument("--yamcs", action="store_true", help="xtce: also an instance of Yamcs, in DIR/yamcs")
    sub.add_argument("--cosmos", action="store_true", help="xtce: also a plugin of COSMOS, in DIR/cosmos")
    sub.add_argument("--fmi", choices=["3", "2"], help="fmu: the version of the standard, 3.0 or 2.0; default: 3")
    sub.add_argument("--sources", action="store_true", help="fmu: with all its C and C++, for other systems")
    sub.add_argument("--no-heads", action="store_true", help="fmu: the FMU gives inputs their heads, for "
                     "importers that set every input, as Simulink does")
    sub.add_argument("--platform", metavar="NAMES", help="fmu: of which machines to have the library, as in "
                     "x86_64,aarch64; default: this one's")
    sub.add_argument("--on", choices=["leon3"], help="fmu: flight on the emulated computer of this target")
    sub.add_argument("--out", metavar="DIR", help="default: runs/MISSION/FORM, or runs/MISSION/cfs/APP; of fmu a file, "
                     "runs/MISSION/fmu/NAME.fmu")
    add_parameters(sub)
    sub.set_defaults(needs=needs)


def needs(options: argparse.Namespace) -> list[str]:
    """The packages and parts of the build."""
    library = "fledge_fmu_board" if options.on else "fledge_fmu_simulation"
    return [*TARGETS.known([options.form, options.on, *listed(options.platform)]),
            *[f"build {library}"] * (options.form == "fmu")]


def export(options: argparse.Namespace) -> int:
    import fledge
    from fledge import export as exports
    from fledge.cli.console import say
    from fledge.errors import Failure

    tasks = [name.strip() for name in options.tasks.split(",")] if options.tasks is not None else None
    if options.form == "cfs" and not options.app:
        raise Failure("export cfs: name the app, as in --app nav")
    for form, names in OWN.items():
        for name in names:
            if options.form != form and getattr(options, name):
                raise Failure(f"export {options.form}: --{name.replace('_', '-')} is for `export {form}`")
    if options.outputs and options.board:
        raise Failure("export: --outputs is for the mission's own board; give --board without files")
    if options.outputs and options.board is None and options.form == "c":
        raise Failure("export: --outputs is for the mission's own board; give --board, without files")
    if options.form == "xtce":
        return export_xtce(options)
    if options.form == "micropython":
        return export_micropython(options)
    if options.form == "fmu":
        return export_fmu(options)
    mission = exports.read(fledge.load(options.mission, **given_parameters(options)), options.process, tasks)
    folder = Path(options.out) if options.out else Path("runs") / mission.folder / options.form
    if options.form == "cfs":
        folder = folder if options.out else folder / options.app
        paths = export_cfs(mission, options, folder)
    elif options.form == "rtems":
        from fledge.objects import project
        from fledge.targets.leon3_rtems import export as rtems

        ours = project.folder()
        paths = rtems.write(mission, folder, options.board or (), outputs_of(options.outputs), [ours] if ours else [])
    else:
        more = {}
        if options.board is not None:
            more = (exports.emit_board(mission, options.board, outputs_of(options.outputs))
                    | exports.emit_commands(mission))
        paths = exports.write(mission, folder, more)
    if options.form == "c":
        for path in paths:
            say(f"  wrote  {path}")
    else:
        what = "how they go into a cFS tree" if options.form == "cfs" else "how to build them"
        say(f"  wrote  {len(paths)} files in {folder}; {folder / 'README.md'} says {what}")
    for what in mission.left_out:
        say(f"  left out  {what}")
    return 0


def export_xtce(options: argparse.Namespace) -> int:
    import fledge
    from fledge.cli.console import say
    from fledge.errors import Failure
    from fledge.export import ground, packets, read, read_all, stations, xtce
    from fledge.disk import write_files

    for name in ("tasks", "outputs", "board"):
        if getattr(options, name) is not None:
            raise Failure(f"export xtce: --{name} is for `export c`; the database has all packets of a process")
    sim = fledge.load(options.mission, **given_parameters(options))
    missions = [read(sim, options.process)] if options.process else read_all(sim)
    if not missions:
        raise Failure(f"{sim.name} has no flight process, so there are no packets")
    databases = [packets.database(mission) for mission in missions]
    more = ground.read(missions[0].place, databases)
    files = {f"{sim.name}.xml": xtce.xtce(sim.name, databases, more)}
    for station, emit in (("yamcs", stations.yamcs), ("cosmos", stations.cosmos)):
        if getattr(options, station):
            files |= {f"{station}/{file}": text for file, text in emit(sim.name, databases, more).items()}
    for path in write_files(files, Path(options.out) if options.out else Path("runs") / sim.name / "xtce"):
        say(f"  wrote  {path}")
    return 0


def export_fmu(options: argparse.Namespace) -> int:
    import fledge
    from fledge.cli.console import say
    from fledge.errors import Failure
    from fledge.export.fmu import build
    from fledge.export.fmu.mission import flight_fmu
    from fledge.objects import project

    for name in ("tasks", "outputs", *["board"] * (not options.on)):
        if getattr(options, name) is not None:
            raise Failure(f"export fmu: --{name} is for `export c`; an FMU has whole processes and all their outputs")
    sim = fledge.load(options.mission, **given_parameters(options))
    flights = [process.name for process in sim.flights]
    known = [process.name for process in sim.processes]
    if options.process is not None and options.process not in known:
        raise Failure(f"{sim.name} has no process '{options.process}'; it has {', '.join(known)}")
    if options.on and options.process not in flights:
        raise Failure("export fmu: --on is for a flight process, which --process names: "
                      f"{', '.join(flights) or f'{sim.name} has none'}")
    if options.on:
        from fledge.export.fmu.board import board_fmu

        system = board_fmu(options.mission, options.process, options.board or (), heads=not options.no_heads,
                           **given_parameters(options))
    elif options.process in flights:
        ours = project.folder()
        system = flight_fmu(sim, options.process, [ours] if ours else [], not options.no_heads)
    else:
        from fledge.export.fmu.composition import simulation_fmu

        system = simulation_fmu(sim, options.process, options.sources, not options.no_heads)
    path = Path(options.out or Path("runs") / sim.name / "fmu" / f"{system.facts.identifier}.fmu")
    if path.suffix != ".fmu":
        raise Failure(f"export fmu: --out is a file, NAME.fmu; found {path}")
    build.export(system, path, options.fmi or "3", listed(options.platform), options.sources)
    inputs, outputs = (sum(m.role == role for m in system.layout.messages) for role in ("input", "output"))
    say(f"  wrote  {path}: {inputs} message{'s' * (inputs != 1)} in, {outputs} out, {len(system.layout.variables)} "
        "variables")
    return 0


def export_micropython(options: argparse.Namespace) -> int:
    import fledge
    from fledge import export as exports
    from fledge.cli.console import say
    from fledge.errors import Failure
    from fledge.mission.folder import without_preset
    from fledge.targets import table
    from fledge.targets.micropython import program
    from fledge.targets.micropython.export import compose

    for name in ("tasks", "outputs"):
        if getattr(options, name):
            raise Failure(f"export micropython: --{name} is for `export c`; a script composes the whole process")
    TARGETS.ready(["micropython-dev" if options.development else "micropython"], "export")
    sim = fledge.load(options.mission, **given_parameters(options))
    mission = exports.read(sim, options.process)
    folder = Path(options.out) if options.out else Path("runs") / mission.folder / "micropython"
    fresh = without_preset(options.mission, **given_parameters(options))
    composed = compose(fresh, mission, exports.read(fresh, options.process), options.board or ())
    built = program.export(composed, sim.process(mission.process), folder, options.development)
    for path in sorted(folder.glob("c/*")):
        say(f"  wrote  {path}")
    say(f"  built  {built}, {table.size(program.stripped(built))} without symbols")
    return 0


def export_cfs(mission: Mission, options: argparse.Namespace, folder: Path) -> list[Path]:
    """Write an app's folder; returns the paths."""
    from fledge.objects import project
    from fledge.errors import Failure
    from fledge.targets.cfs import export as cfs

    def number(option: str, text: str) -> int:
        try:
            return int(text, 0)
        except ValueError:
            raise Failure(f"export cfs: {option} must be a number, as 0xC0; found {text}") from None

    wires = {path.strip(): number(f"--input {path}", mid) for path, _, mid in
             (word.partition("=") for word in options.input)}
    app = cfs.App(options.app, number("--topic", options.topic or "0xC0"), options.order or "little",
                  None if options.wakeup in (None, "own") else number("--wakeup", options.wakeup),
                  options.wakeup == "own",
                  listed(options.keep), wires)
    ours = project.folder()
    files = () if options.outputs and options.board is None else options.board   # --outputs: of a board
    return cfs.write(mission, app, folder, files, outputs_of(options.outputs), [ours] if ours else [],
                     options.simulated, others=options.beside)


def outputs_of(text: str | None) -> list[str] | str:
    """The value of --outputs, as emit_board takes it."""
    return "all" if text == "all" else listed(text)


def listed(text: str | None) -> list[str]:
    return [path.strip() for path in (text or "").split(",") if path.strip()]
