# SPDX-License-Identifier: Apache-2.0
"""The command line: every command of usage.txt but those that fledge.launcher has, which install, build and test.

Exit codes: 0 all went well; 1 a check of the scenario failed, or the run did; 2 the command line or
the mission is wrong; 130 Ctrl-C.

Example:

    $ ./fledge run nadir_spin spin --seed 2 --as first
"""
from __future__ import annotations

import argparse
import io
import os
import sys
import warnings
from pathlib import Path

from fledge.cli.arguments import add_update_limit, flight_time, given_parameters, number, parse_duration
from fledge.cli.console import Plots, cannot_fly, itemized, placed, say, size_of, trace
from fledge.cli.runs import RUNS, SCENE, WHAT, alone, folder_of, kept_runs, open_run
from fledge.errors import Failure, did_you_mean, printable

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any, NoReturn

    from fledge.archive import Archive
    from fledge.mission.simulation import Simulation

BENCH = Path(__file__).resolve().parents[3] / "bench"


# --- run -------------------------------------------------------------------------------------------

def run(options: argparse.Namespace) -> int:
    import fledge

    from fledge.mission.scenario import lacking

    if options.name and options.out:
        raise Failure("run: give a name with --as, or a folder with --out; not both")
    if options.replace and not options.name:
        raise Failure("run: --replace is for --as")
    if options.outputs and options.check_replay:
        raise Failure("run: give --outputs or --check-replay, which writes such records of its own; not both")
    sim = fledge.load(options.mission, options.seed, **given_parameters(options))
    name, fly = _scenario(sim, options)
    for problems in lacking(sim, [name] if not options.duration else []).values():
        raise Failure(cannot_fly(placed(problems)))
    folder = folder_of(options.name, replace=True) if options.name else \
        Path(options.out) if options.out else RUNS / sim.name / name
    with alone(folder, "give another folder with --out, or a name with --as"):
        if options.name:    # again: another run may have taken the name meanwhile
            folder_of(options.name, options.replace)
        return _run(options, sim, name, fly, folder)


def _run(options: argparse.Namespace, sim: Simulation, name: str, fly: Callable[[Simulation], object],
         folder: Path) -> int:
    """Fly a scenario, and write what comes of it into the folder."""
    import fledge
    from fledge.cli import check_replay, health
    from fledge.cli.judge import attempt, show_required
    from fledge.mission.checks import has_checks

    assert sim.mission
    sim.pace = options.pace
    sim.plots = Plots(folder) if not options.no_plots else False
    sim.archive(folder / "run.mcap", mission=sim.name, scenario=name, fledge=fledge.__version__,
                **sim.mission.metadata())
    replay = check_replay.Replay(folder) if options.check_replay else None
    if replay or options.outputs:
        sim.archive_outputs(replay.first if replay else options.outputs)

    report = _report(sim, name) if options.report else None

    title = f"{sim.name}, {name}"
    about = sim.mission.summaries().get(name)
    say(title + (f": {about}" if about else ""))
    try:
        problem, code, outcomes = attempt(options, sim, name, fly, folder / "violated.snapshot" if options.stop else
                                          None)
    except Exception:
        if replay:
            replay.give_up()
        raise
    sim.close_outputs()
    judged = not options.duration and (has_checks(fly) or bool(outcomes))
    again = ""
    if replay:
        different, again = replay.fly(options, sim, code)
        problem, code = "; ".join(filter(None, [problem, different])) or None, code or int(different != "")
    findings = sim.health
    if options.strict and findings and not problem:
        problem, code = health.refusal(findings), 1
    plots = []
    if isinstance(sim.plots, Plots):
        try:
            plots = sim.plots.whole()
        except OSError as error:
            plots, problem, code = sim.plots.saved, problem or f"failed: {_in_words(error)}", code or 1
    say(f"  flown    {sim.time:g} s in {sim.wall:.3g} s"
        + (f", {sim.time / sim.wall:,.0f} times real time" if sim.wall > 0 else "")
        + (f"; no task runs at the end, the state is that of {sim.state_time:g} s"
           if sim.state_time < sim.time else ""))
    if again:
        say(f"  replay   {again}")
    if sim.pace and sim.pace_report["overruns"]:
        late = sim.pace_report
        say(f"  pace     {late['overruns']} of {late['instants']} instants were late, by up to "
            f"{1e3 * late['worst']:.1f} ms")
    path = sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    if path:
        say(f"  record   {path} ({size_of(path)})")
    else:
        older = f"; {folder / 'run.mcap'} is of an earlier run" if (folder / "run.mcap").exists() else ""
        say("  record   none" + ("" if problem else ": the scenario records nothing") + older)
    for plot in plots:
        say(f"  plot     {plot}")
    show_required(outcomes)
    for line in sim.assumptions:
        say(f"  assumed  {line}")
    health.show_modes(sim)
    health.show(findings)
    say(f"  summary  {health.write(folder / 'summary.json', sim, name, problem, findings, outcomes)}")
    if path:    # which replaced the record that older pages show
        for page in ["view.html"] + ["report.html"] * (not report):
            if os.path.lexists(folder / page):
                earlier = folder / f"earlier-{page}"
                os.replace(folder / page, earlier)
                say(f"  earlier  {earlier}: {page} of the run before")
    if report:
        say(f"  report   {_write_report(report, folder, options, judged, code, problem, path, plots)}")
    if problem:
        say("  interrupted" if code == 130 else "  failed")
        raise Failure(f"{title} {problem}" if code == 130 else f"{title}: {problem}", code)
    if judged:
        say("  passed")
    elif not options.duration:
        say("  ended    nothing judges it: the scenario has no check, and the mission no requirement for it")
    return 0


def _scenario(sim: Simulation, options: argparse.Namespace) -> tuple[str, Callable[[Simulation], object]]:
    """(name, function of a simulation) to fly."""
    duration = flight_time(options)
    if duration is not None:
        if options.scenario:
            raise Failure("run: give a scenario, or --for a duration to fly freely; not both")
        every = min(1.0, duration / 10)

        def free(sim: Simulation) -> None:
            sim.record(*(instance for process in sim.processes for instance in process), every=every)
            sim.run(duration)

        return "free", free
    assert sim.mission
    if not sim.mission.scenarios:
        raise Failure(f"the mission {sim.name} has no scenarios: write one in scenarios.py, or fly it with --for 10min")
    from fledge.mission.scenario import chosen

    return chosen(sim, options.scenario)


def _report(sim: Simulation, name: str) -> Any:
    from fledge.report import Report

    assert sim.mission
    return Report(sim, name, sim.mission.scenarios.get(name))


def _write_report(report: Any, folder: Path, options: argparse.Namespace, judged: Any, code: int, problem: str | None,
                  record: Any, plots: Any) -> Any:
    """The page about a run; returns its path."""
    import shlex

    from fledge.report import Outcome

    verdict = {0: "passed" if judged else "flown", 130: "interrupted"}.get(code, "failed")
    command = ["./fledge", "run", Path(options.mission).name, *([options.scenario] if options.scenario else []),
               *(["--for", options.duration] if options.duration else []),
               *(["--seed", str(options.seed)] if options.seed else []),
               *(["--as", options.name, "--replace"] if options.name else []),
               *(word for text in options.parameters for word in ("--set", text))]
    message = (problem or "").removeprefix("failed: ") if code != 130 else ""
    return report.write(folder / "report.html", Outcome(
        verdict, message, Path(record) if record else None, None if options.no_plots else plots, shlex.join(command)))


# --- show ------------------------------------------------------------------------------------------

def show(options: argparse.Namespace) -> int:
    import fledge
    from fledge.mission.wiring import Wiring
    from fledge.plot.wiring import save

    sim = fledge.load(options.mission, **given_parameters(options))
    if problems := sim.problems:
        print("fledge: " + itemized("without what a scenario may give, the mission cannot fly", placed(problems)),
              file=sys.stderr)
    wiring = Wiring(sim, options.flight_only)
    if options.out:
        say(str(save(wiring, options.out)))
        return 0
    say(wiring.outline())
    if not options.text:
        say(f"\ndrawn in {save(wiring, Path('runs') / wiring.name / 'wiring.svg')}")
    return 0


# --- list ------------------------------------------------------------------------------------------

def list_(options: argparse.Namespace) -> int:
    from fledge import flight, mission, objects, world
    from fledge.objects.words import first_sentence

    say("missions")
    summaries = {name: folder.summaries() for name, folder in mission.missions().items()}
    width = max((len(name) for about in summaries.values() for name in about), default=0) + 2
    for name, about in summaries.items():
        say(f"  {name:{width}} {about.pop('')}")
        for scenario, text in about.items():
            say(f"    {scenario:{width - 2}} {text}")
    if not summaries:
        say("  none")
    for title, types, kind in (
            ("flight modules (from fledge import flight as fsw)", getattr(flight, "TYPES"), "module"),
            ("world models (from fledge import world)", world.TYPES, "model")):
        say("\n" + title)
        for name in sorted(types):
            struct = objects.struct(types[name])
            if struct.kind == kind:
                say(f"  {name:18} {first_sentence(struct.doc)}")
                if options.ports:
                    for group, arrow in (("in", "<<"), ("out", ">>")):
                        for f in struct.fields:
                            if f.group == group:
                                note = "  (optional)" if f.optional else ""
                                say(f"    {arrow} {f.name:13} {f.struct.name}{note}")
    say("\nbodies\n  " + ", ".join(f"world.{name}" for name in world.BODIES))
    if runs := kept_runs():
        from fledge.archive.mcap import metadata

        say("\nkept runs (each is a RUN for plot, compare and convert)")
        for name, (record, *_) in runs.items():
            facts = {key: text for pairs in metadata(record).values() for key, text in pairs.items()}
            facts.setdefault("outcome", "has not ended")
            say(f"  {name:{width}} " + ", ".join(facts[key] for key in ("mission", "scenario", "outcome")
                                                 if key in facts))
    return 0


# --- plot, view, convert ---------------------------------------------------------------------------

def plot(options: argparse.Namespace) -> int:
    from fledge.plot import plot as draw, save

    archive = open_run(options.run)
    folder = options.out or archive.path.parent
    if options.fields:
        figures = [draw(archive, *options.fields)]
    else:  # a figure per topic, a panel per field
        figures = []
        for channel in _decodable(archive):
            fields = {f"{channel.name}.{n}": f for n, f in channel.fields.items() if not n.startswith("head.")}
            if channel.count and fields:
                figures.append(draw(archive, *fields, name=channel.name, title=channel.name,
                                    titles=[f.meaning or f.name for f in fields.values()]))
    if not figures:
        raise Failure(f"{archive.path}: there is nothing to plot", 1)
    for figure in figures:
        say(str(save(figure, folder)))
    return 0


def view(options: argparse.Namespace) -> int:
    from fledge import scene
    import fledge.scene.film
    import fledge.scene.foxglove

    archive = open_run(options.run)
    if options.film:
        begin, end = (parse_duration(text, name) if text else None for text, name in
                      ((options.begin, "--from"), (options.end, "--to")))
        path = scene.film.write(scene.of(archive), options.film, options.look, begin, end, options.frames)
    elif options.foxglove:
        path = scene.foxglove.write(scene.of(archive), archive.path,
                                    options.out or archive.path.with_suffix(SCENE))
    else:
        path = scene.view(archive, options.out)
    say(f"{path} ({size_of(path)})")
    return 0


def convert(options: argparse.Namespace) -> int:
    archive = open_run(options.run)
    if options.about:
        return _about(archive)
    topics = [channel.topic for channel in _decodable(archive)]
    if not topics:
        raise Failure(f"{archive.path}: there is nothing to convert", 1)
    if options.hdf5:
        say(str(archive.to_hdf5(options.out or archive.path.with_suffix(".h5"), topics)))
    else:
        for path in archive.to_csv(options.out or archive.path.parent, topics):
            say(str(path))
    return 0


def _decodable(archive: Archive) -> list[Any]:
    """The topics whose messages are plain data. Names the others, as the scene for Foxglove."""
    for channel in archive.topics.values():
        if channel.problem:
            print(f"fledge: without {printable(channel.topic)} ({printable(channel.schema)}), whose messages are "
                  "no plain structs", file=sys.stderr)
    return [channel for channel in archive.topics.values() if not channel.problem]


def _about(archive: Archive) -> int:
    """Print a record's facts about its run."""
    from fledge.archive.compare import digest
    from fledge.columns import columns

    about = dict(archive.metadata)
    facts = {**about.pop("run", {}), **{f"revision of {k}": v for k, v in about.pop("revisions", {}).items()},
             **about.pop("end", {})}
    parameters = about.pop("parameters", {})
    say(str(archive.path))
    for line in columns([("" if i else key, value) for key, text in facts.items()
                         for i, value in enumerate(text.split("\n"))], indent="  "):
        say(line)
    say(f"topics, hash {digest(archive, archive.topics)}")
    rows = [(c.name, str(c.count), c.schema.rpartition("/")[2]) for c in archive.topics.values()]
    for line in columns(rows, right={1}, indent="  "):
        say(line)
    for title, pairs in (("parameters, as the run began", parameters), *about.items()):
        if pairs:
            say(title)
            for line in columns(list(pairs.items()), indent="  "):
                say(line)
    return 0


# --- bench -----------------------------------------------------------------------------------------

def benches() -> list[str]:
    """The names of the benches; none where Fledge is installed without them."""
    return sorted(p.stem for p in BENCH.glob("*.py") if "def main(" in p.read_text(encoding="utf-8"))


def _needed(options: argparse.Namespace) -> list[str] | None:
    """With the NEEDS of a bench, which is not imported: it may import what is not built yet."""
    import ast
    import re

    if options.bench not in benches():
        return []
    if {"-h", "--help"} & set(options.options):
        return None
    text = (BENCH / f"{options.bench}.py").read_text(encoding="utf-8")
    match = re.search(r"^NEEDS = (.*)$", text, re.MULTILINE)
    return ["bench", "build all", "build fledge_bench", *(ast.literal_eval(match[1]) if match else [])]


def bench(options: argparse.Namespace) -> int:
    from importlib import import_module

    known = benches()
    if not options.bench:
        say("benches: " + (", ".join(known) or "none"))
        return 0
    if not known:
        raise Failure("bench: an installed Fledge has no measurements", 1)
    if options.bench not in known:
        raise Failure(f"there is no bench '{options.bench}'; there are {', '.join(known) or 'none'}")
    sys.path.insert(0, str(BENCH.parent))
    return import_module(f"bench.{options.bench}").main(options.options) or 0


# --- new -------------------------------------------------------------------------------------------

def new(options: argparse.Namespace) -> int:
    from fledge import new as scaffold

    given = {name: value for name, value in (("source", options.source), ("kind", options.variant)) if value}
    if options.what == "project" and options.source:
        raise Failure("new: --from is for a module, model or mission")
    if options.what not in ("module", "model") and options.variant:
        raise Failure("new: --kind and --bare are for a module or model")
    try:
        where = [] if options.what == "project" else [options.project]
        files, next_step = getattr(scaffold, options.what)(options.name, *where, **given)
    except scaffold.NewError as error:
        raise Failure(f"new {options.what}: {error}") from None
    for file in files:
        say(f"  wrote  {os.path.relpath(file)}")
    say(next_step)
    return 0


# --- the parser ------------------------------------------------------------------------------------

class Parser(argparse.ArgumentParser):
    """argparse with errors of one line that name the command, and its usage."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse here what this command does not know: argparse itself leaves that to the parser above it."""
        options, rest = super().parse_known_args(args, namespace)
        if rest:
            word = rest[0].partition("=")[0]
            hint = did_you_mean(word, self._option_string_actions).rstrip(";") if word.startswith("-") else ""
            self.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
        return options, rest

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}\n{self.format_usage()}")


def usage() -> str:
    return Path(__file__).with_name("usage.txt").read_text(encoding="utf-8")


def summaries() -> dict[str, str]:
    """Command -> what it does, of all in usage.txt."""
    import re

    return dict(re.findall(r"^  (\w+) .{,20}?  +(.*)", usage(), re.M))


def parser(*more: Callable[..., None]) -> argparse.ArgumentParser:
    """That of the commands here, and of those that other functions add, by the function that adds one. `needs` says
    what the launcher provides first, besides what all need (fledge.launcher.packages); None: it builds nothing."""
    texts = summaries()
    top = Parser(prog="fledge", description="Fly flight software in closed loop.",
                 epilog="example: ./fledge run nadir_spin")
    top.add_argument("--debug", action="store_true", help="show tracebacks")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)

    def command(name: str, function: Callable[..., int], example: str) -> Any:
        text = texts[name]
        sub = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".",
                                  epilog=f"example: ./fledge {example}",
                                  formatter_class=argparse.RawDescriptionHelpFormatter if "\n" in example else
                                  argparse.HelpFormatter)
        sub.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help="show tracebacks")
        sub.set_defaults(function=function, needs=lambda _: [], by_itself=False)
        return sub

    sub = command("run", run, "run nadir_spin --pace 10")
    sub.add_argument("mission", help="the name of a mission, or its folder")
    sub.add_argument("scenario", nargs="?", help="default: the mission's first")
    sub.add_argument("--out", metavar="DIR", help="for the record and plots; default: runs/MISSION/SCENARIO")
    sub.add_argument("--as", dest="name", metavar="NAME", help="keep the run under this name, in runs/kept/NAME: plot, "
                     "compare and convert find it by NAME")
    sub.add_argument("--replace", action="store_true", help="with --as: in place of the run that has the name")
    sub.add_argument("--seed", type=int, default=0, metavar="N", help="of the random streams; default: 0")
    sub.add_argument("--pace", type=number(), default=0.0, metavar="X",
                     help="X simulated seconds per second; default: as fast as possible")
    sub.add_argument("--strict", action="store_true", help="a run with a finding about its health has failed")
    sub.add_argument("--stop", action="store_true", help="end the run at the first violation of a requirement, and "
                     "keep the state in violated.snapshot")
    sub.add_argument("--no-plots", action="store_true", help="leave out the scenario's plots")
    sub.add_argument("--report", action="store_true", help="write all about the run into one page, report.html")
    sub.add_argument("--for", dest="duration", metavar="DURATION",
                     help="fly without a scenario for this long (90s, 10min, 2h), recording all outputs")
    sub.add_argument("--outputs", metavar="FILE", help="write a record of all outputs too, each at the instants at "
                     "which it has changed")
    sub.add_argument("--check-replay", action="store_true", help="fly it again, in another process with another "
                     "environment; the run has failed if an output differs, which is named")
    add_update_limit(sub)
    sub.set_defaults(needs=lambda options: ["try view"] * options.report)

    from fledge.cli import (check, compare, control_room, export, falsify, faults, flips, fly, ground, keys, load,
                            montecarlo, node, packets, profile, prompt, replay, rewind, up, verify, versions)

    node.add_parameters(sub)
    check.add(command)
    node.add(command)
    montecarlo.add(command)
    falsify.add(command)
    faults.add(command)
    versions.add(command)
    export.add(command)
    fly.add(command)
    load.add(command)
    flips.add(command)
    profile.add(command)
    verify.add(command)
    prompt.add(command)
    compare.add(command)
    replay.add(command)
    packets.add(command)
    keys.add(command)
    up.add(command)
    rewind.add(command)
    ground.add(command)
    control_room.add(command)
    for add in more:
        add(command)

    sub = command("show", show, "show nadir_spin --out nadir_spin.png")
    sub.add_argument("mission", help="the name of a mission, or its folder")
    sub.add_argument("--out", metavar="FILE", help="draw only into this .svg, .png, .pdf or .dot; "
                     "default: an outline, and runs/MISSION/wiring.svg")
    sub.add_argument("--text", action="store_true", help="only the outline")
    sub.add_argument("--flight-only", action="store_true", help="leave out the world")
    node.add_parameters(sub)

    sub = command("new", new, "new module SunSlew --kind guidance\n         ./fledge new mission my_sat --from cubesat")
    sub.set_defaults(needs=lambda _: None)
    sub.add_argument("what", metavar="WHAT", choices=["module", "model", "mission", "project"],
                     help="module, model, mission or project")
    sub.add_argument("name", metavar="NAME",
                     help="SunSlew, or guidance/SunSlew for a subfolder; of a project: its folder")
    sub.add_argument("--project", metavar="DIR", default=os.environ.get("FLEDGE_PROJECT"),
                     help="the project that it belongs to; default: FLEDGE_PROJECT, else Fledge itself")
    kind = sub.add_mutually_exclusive_group()
    kind.add_argument("--kind", dest="variant", choices=["guidance", "control", "determination", "sensing"],
                      help="of a module: a small one that works, with fitting messages, units and a test; a model has "
                      "sensing alone; default: as the subfolder is called, else --bare")
    kind.add_argument("--bare", dest="variant", action="store_const", const="bare",
                      help="of a module or model: the smallest that does something, with a test")
    kind.add_argument("--from", dest="source", metavar="SOURCE", help="of a mission: another, by name or folder, of "
                      "which it is a copy; of a module or model: FILE:CLASS, the prototype whose interface it gets, "
                      "with a test that compares both")

    sub = command("list", list_, "list --ports")
    sub.add_argument("--ports", action="store_true", help="with the inputs and outputs of each")

    sub = command("plot", plot, "plot nadir_spin error.sigma_BR command.u")
    sub.add_argument("run", metavar="RUN", help=WHAT)
    sub.add_argument("fields", nargs="*", metavar="FIELD", help="default: everything, a figure per topic")
    sub.add_argument("--out", metavar="DIR", help="default: beside the record")

    sub = command("view", view, "view earth_imager")
    sub.set_defaults(needs=lambda options: ["view", *["film"] * bool(options.film)])
    sub.add_argument("run", metavar="RUN", help=WHAT)
    kind = sub.add_mutually_exclusive_group()
    kind.add_argument("--foxglove", action="store_true", help="write the record with transforms and markers for "
                      "Foxglove's 3-D panel, in place of a page")
    kind.add_argument("--film", metavar="FILE.webp", help="write a film in place of a page")
    sub.add_argument("--out", metavar="FILE", help=f"default: view.html, or run{SCENE}, beside the record")
    sub.add_argument("--look", default="", metavar="TEXT", help="of a film: what follows # in the page's address")
    sub.add_argument("--from", dest="begin", metavar="TIME", help="of a film: its first frame (90s, 1h23m)")
    sub.add_argument("--to", dest="end", metavar="TIME", help="of a film: its last frame")
    sub.add_argument("--frames", type=int, default=180, metavar="N",
                     help="of a film, 12.5 a second; default: %(default)s")

    sub = command("convert", convert, "convert nadir_spin --csv --out tables")
    sub.add_argument("run", metavar="RUN", help=WHAT)
    kind = sub.add_mutually_exclusive_group(required=True)
    kind.add_argument("--csv", action="store_true", help="a file per topic")
    kind.add_argument("--hdf5", action="store_true", help="one file")
    kind.add_argument("--about", action="store_true", help="write no file; print the outcome, seed, revisions and "
                      "parameters of the run, its topics, and a hash of its messages")
    sub.add_argument("--out", metavar="PATH", help="a folder for --csv, a file for --hdf5; default: beside the record")

    sub = command("bench", bench, "bench sim --json sim.json")
    sub.set_defaults(needs=_needed)
    sub.add_argument("bench", nargs="?", metavar="NAME")
    sub.add_argument("options", nargs=argparse.REMAINDER, metavar="OPTION",
                     help="the bench's own, such as --json FILE; 'bench NAME --help' lists them")
    return top


def parsed(arguments: list[str], of: argparse.ArgumentParser | None = None) -> argparse.Namespace:
    """The options of a command line, and what follows `--`."""
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    options = (of or parser()).parse_args(arguments[:cut])
    options.after_dashes = arguments[cut + 1:]
    options.words = arguments
    return options


def main(arguments: list[str] | None = None) -> int:
    return carry_out(parsed(list(sys.argv[1:] if arguments is None else arguments)))


def carry_out(options: argparse.Namespace) -> int:
    """Run the command; returns the exit code."""
    if isinstance(sys.stdout, io.TextIOWrapper):    # a character that the user's encoding lacks is no error
        sys.stdout.reconfigure(errors="backslashreplace")
    setattr(warnings, "showwarning", _say_warning)  # in one line, as an error; each once
    try:
        if options.after_dashes and not getattr(options, "starts_command", False):
            raise Failure(f"nothing may follow --; found {' '.join(options.after_dashes)}")
        if (jobs := getattr(options, "jobs", None)) is not None and jobs < 1:
            raise Failure(f"--jobs must be >= 1, found {jobs}")
        if getattr(options, "update_limit", None):
            from fledge import limit_updates

            limit_updates(parse_duration(options.update_limit, "--update-limit"))
        return options.function(options)
    except Failure as error:
        print(f"fledge: {printable(str(error))}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        print("fledge: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of the output has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 1
    except Exception as error:
        trace(options)
        if _expected(error):
            print(f"fledge: {_in_words(error)}", file=sys.stderr)
            return 1 if type(error).__name__ == "RunError" else 2
        if options.debug:
            return 70
        print(f"fledge: {type(error).__name__}: {error}\nThis is a defect of fledge; --debug shows where.",
              file=sys.stderr)
        return 70


def _say_warning(message: object, category: type, file: str, line: int, *_: object) -> None:
    from fledge.files import shown

    print(f"fledge: {shown(file)}, line {line}: {printable(str(message))}", file=sys.stderr)


def _expected(error: BaseException) -> bool:
    """Whether an error is about the input of the user or a missing package, and no defect of this program."""
    if isinstance(error, (OSError, ImportError)):
        return True
    from fledge import RunError, SetupError
    from fledge.archive import ArchiveError

    return isinstance(error, (SetupError, RunError, ArchiveError))


def _in_words(error: BaseException) -> str:
    """The text of an error; of an error of the operating system the file and the reason, without the number."""
    if type(error).__name__ == "CompositionError":
        return cannot_fly(str(error).splitlines())
    if isinstance(error, PermissionError) and isinstance(error.filename, str):
        return f"this user may not write or read {os.path.abspath(error.filename)}"
    if isinstance(error, ModuleNotFoundError) and (package := _package_of(str(error.name))):
        return f"{error.name} is not installed; as root, run: apt-get install {package}"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


def _package_of(module: str) -> str:
    """The package of Debian, among those that Fledge names, which has a module of Python; "" if there is none."""
    from fledge.files import ROOT

    package = f"python3-{module.partition('.')[0].lower()}"
    listed = (ROOT / "cmake/packages.txt").read_text(encoding="utf-8").split()
    return package if package in listed else ""
