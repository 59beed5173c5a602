# SPDX-License-Identifier: Apache-2.0
"""`fledge montecarlo MISSION --runs N`: dispersed runs, or with --only one of them.
`fledge sweep MISSION --set NAME=VALUES`: the same over the points of a grid.

Exit codes as of all commands: 0 every run passed; 1 some failed; 2 the command line, the mission or its dispersions
are wrong; 130 Ctrl-C, with a report on the finished runs.
"""
from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

from fledge.cli.arguments import add_campaign, add_mission, add_pool, add_seed, add_update_limit, command_line
from fledge.cli.console import Plots, complain, counted, say, size_of
from fledge.cli.failures import in_words
from fledge.cli.runs import alone
from fledge.disk import write_files
from fledge.errors import Failure, listed
from fledge.progress import Bar

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any

    from fledge.mission.log import Log
    from fledge.mission.simulation import Simulation
    from fledge.montecarlo import Campaign
    from fledge.montecarlo.requirements import Watch

FAILURES_SHOWN = 8


def read(path: Path) -> str:
    """Read the campaigns of a mission's dispersions.py."""
    from fledge.montecarlo import Campaign

    known = list(Campaign(path.parent).known)
    for name in known[1:]:
        Campaign(path.parent, name)
    return counted(len(known), "campaign")


READERS = {"dispersions.py": read}


def add(command: Callable) -> None:
    """Add the subcommand. command: the function of cli.parser() that adds one."""
    sub = command("montecarlo", montecarlo, "montecarlo nadir_spin --runs 2000")
    add_mission(sub, "; its dispersions.py defines the dispersions")
    sub.add_argument("--runs", type=int, metavar="N", help="how many")
    _add_common(sub, "montecarlo")

    sub = command("sweep", sweep, "sweep nadir_spin --set flight.control.K=1:5:9")
    add_mission(sub, "; its dispersions.py says how long a run is, what it retains, and what must hold")
    sub.add_argument("--set", action="append", default=[], metavar="NAME=VALUES", dest="axes", help="an axis of the "
                     "grid: a parameter of the mission, or the path of a number in SI. VALUES: 0.1:1:10, ten at equal "
                     "distances; 0.1:1:10:log, at equal ratios; or a list, 1,2,5")
    sub.add_argument("--runs", type=int, metavar="N", help="fly N runs at each point, with the campaign's dispersions, "
                     "the same at each; default: one without dispersions")
    _add_common(sub, "sweep")


def _add_common(sub: argparse.ArgumentParser, name: str) -> None:
    """The options of campaigns and sweeps."""
    add_campaign(sub)
    add_seed(sub, "all draws and random streams", "S")
    add_pool(sub)
    sub.add_argument("--only", type=int, metavar="INDEX",
                     help="fly this one run, as an ordinary simulation with a record and plots")
    sub.add_argument("--out", metavar="DIR", help=f"default: runs/MISSION/{name}/CAMPAIGN, with /INDEX for --only")
    sub.add_argument("--junit", metavar="FILE", help="also write the runs and requirements as test cases for a CI, as "
                     "JUnit's XML")
    sub.add_argument("--strict", action="store_true", help="a run with a finding about its health has failed")
    add_update_limit(sub)
    sub.add_argument("--json", action="store_true", help="print the summary as JSON, and nothing else")


def montecarlo(options: argparse.Namespace) -> int:
    """Fly a campaign, or one run of it; returns the exit code."""
    from fledge.montecarlo import Campaign

    if (options.runs is None) == (options.only is None):
        raise Failure("montecarlo: give --runs N, or --only INDEX to fly one of them")
    if options.only is not None and (options.json or options.junit):
        raise Failure(f"montecarlo: {'--json' if options.json else '--junit'} is for --runs")
    return _fly(Campaign(options.mission, options.campaign), options, options.runs, "montecarlo", [])


def sweep(options: argparse.Namespace) -> int:
    """Fly a sweep, or one run of it; returns the exit code."""
    from fledge.montecarlo import Sweep

    if options.only is not None and (options.json or options.junit):
        raise Failure(f"sweep: {'--json' if options.json else '--junit'} is for all points")
    axes = dict(map(_axis, options.axes))
    if len(axes) < len(options.axes):
        raise Failure("sweep: an axis is given twice")
    campaign = Sweep(options.mission, axes, options.campaign, dispersed=options.runs is not None)
    given = [word for text in options.axes for word in ("--set", text)]
    return _fly(campaign, options, 1 if options.runs is None else options.runs, "sweep",
                given + ([] if options.runs is None else ["--runs", str(options.runs)]))


def _axis(text: str) -> tuple[str, list[Any]]:
    """(name, values) of "stiffness=0.1:1:10", "mode=SAFE,SCIENCE"."""
    import ast

    from fledge.montecarlo import lin, log

    name, equals, values = text.partition("=")
    if not equals or not name or not values:
        raise Failure(f"--set {text}: expected NAME=VALUES, as in stiffness=0.1:1:10 or stiffness=0.1,0.2,0.5")

    def value(word: str) -> Any:
        try:
            return ast.literal_eval(word)
        except (ValueError, SyntaxError):
            return word

    parts = values.split(":")
    if len(parts) == 1:
        numbers = value(values) if values[0] in "[(" else [value(word) for word in values.split(",")]
        return name, list(numbers) if isinstance(numbers, (list, tuple)) else [numbers]
    try:
        low, high, n = float(parts[0]), float(parts[1]), int(parts[2])
        if len(parts) > 4 or len(parts) == 4 and parts[3] not in ("lin", "log"):
            raise ValueError
    except (ValueError, IndexError):
        raise Failure(f"--set {text}: expected FIRST:LAST:COUNT or FIRST:LAST:COUNT:log, as in 0.1:1:10") from None
    return name, (log if parts[3:] == ["log"] else lin)(low, high, n)


def _fly(campaign: Campaign, options: argparse.Namespace, runs: int, name: str, given: list[str]) -> int:
    """Fly all runs of a campaign, or the one of --only. given: the words that make it what it is, besides its name"""
    import shlex

    first = next(iter(campaign.known))
    words = ["./fledge", name, options.mission, *given,
             *(["--campaign", campaign.name] if campaign.name != first else []), "--seed", str(options.seed),
             *(["--update-limit", options.update_limit] if options.update_limit else []), "--only"]
    campaign.tell_crashes([sys.executable, "-m", "fledge.cli", *words[1:]])
    folder = Path(options.out) if options.out else Path("runs") / campaign.nominal.name / name / campaign.name
    if options.only is not None and not options.out:
        folder /= str(options.only)
    with alone(folder):
        if options.only is not None:
            return _single(campaign, options, folder)
        return _all(campaign, options, runs, folder, lambda index: shlex.join([*words, str(index)]))


# --- a campaign ------------------------------------------------------------------------------------

def _all(campaign: Campaign, options: argparse.Namespace, runs: int, folder: Path,
         command: Callable[[int], str]) -> int:
    import json

    from fledge.montecarlo import report
    from fledge.pool import cores

    points = getattr(campaign, "points", 1)
    workers = min(cores() if options.jobs is None else options.jobs, runs * points)
    if campaign.has_callables and workers > 0 and not options.scheduler:
        parameters = getattr(campaign, "parameters", [])
        complain(f"the mission {f'takes {listed(parameters)}' if parameters else 'calls Python'}, so {workers} "
                 "processes fly the runs instead of threads, each run in a mission loaded afresh")
    begun = time.perf_counter()
    with _Live(f"{campaign.nominal.name}, {campaign.name}", runs * points) as line:
        result = campaign.fly(runs, options.seed, options.jobs, progress=line.count, strict=options.strict,
                              folder=folder, scheduler=options.scheduler)
    wall = time.perf_counter() - begun
    from fledge.report import campaign as page

    try:
        data, paths = report.write(result, folder, command)
        paths.insert(0, page.write(folder / "report.html", data, [path for path in paths if path.suffix == ".png"],
                                   command_line(options), campaign.folder))
        if options.junit:
            junit = Path(options.junit)
            paths += write_files({junit.name: report.junit(result, data, wall, command)}, junit.parent)
    except OSError as error:
        raise Failure(f"{in_words(error)}; the {int(result.flown.sum())} runs that were flown are kept in "
                      f"{folder / 'unfinished'}: once that is mended, the same command writes the report", 1) from None
    if not result.interrupted:
        result.close()
    if options.json:
        print(json.dumps(data, indent=1))
    else:
        say(report.text(data, FAILURES_SHOWN))
        say(f"\n  flown    {line.flown} runs in {wall:.3g} s, {line.flown / wall:,.4g} a second, on "
            + (f"the workers of {options.scheduler}" if options.scheduler else f"{workers} processes" if
               campaign.has_callables else f"{workers} threads" if workers > 1 else "1 thread")
            + (f"; {data['flown'] - line.flown} were flown before" if data["flown"] > line.flown else ""))
        for path in paths:
            say(f"  {'plot' if path.suffix == '.png' else 'report':8} {path}")
        say(f"  failed   {data['failed']} of {data['flown']}" if data["failed"] else
            f"  {'passed' if data['requirements'] else 'ended':8} {data['passed']} of {data['flown']}"
            + (f"; {data['runs'] - data['flown']} are missing" if result.interrupted else ""))
    if result.interrupted:
        complain(f"interrupted; the report is about the {data['flown']} runs that were finished; the same command "
                 "flies the rest")
        return 130
    return 1 if data["failed"] else 0


class _Live(Bar):
    """The bar of a campaign: finished runs, failures, the rate."""

    def __init__(self, title: str, runs: int):
        super().__init__(title)
        self._runs = runs
        self._earlier: int | None = None    # flown by an earlier program
        self.flown = 0

    def count(self, finished: int, failed: int) -> None:
        self._earlier = finished if self._earlier is None else self._earlier
        self.flown = finished - self._earlier
        self.at(finished / self._runs, f"{finished} of {self._runs}" + (f", {failed} failed" if failed else "")
                + (f", {self.flown / self.spent:,.3g} a second" if self.flown else ""))


# --- one run of it ---------------------------------------------------------------------------------

def _single(campaign: Campaign, options: argparse.Namespace, folder: Path) -> int:
    import fledge

    from fledge.cli import health
    from fledge.montecarlo.requirements import Variable

    d = campaign.dispersions
    sim = campaign.simulation(options.only, options.seed)
    title = f"{sim.name}, {campaign.name}, run {options.only} of seed {options.seed}"
    say(title)
    sim.plots = Plots(folder)
    sim.archive(folder / "run.mcap", mission=sim.name, campaign=campaign.name, campaign_seed=options.seed,
                run=options.only, fledge=fledge.__version__)
    everything = [instance for process in sim.processes for instance in process]
    fields = [variable.port(sim) for variable in d.retained.values() if isinstance(variable, Variable)]
    log, watch = sim.record(*everything, *fields, every=d.every), campaign.watch(sim)
    problem, code = _attempt(campaign, sim)
    if problem and sim.time_ns < 0:
        raise Failure(f"{title}: {problem}", code)
    say(f"  flown    {sim.time:g} s")
    _show_drawn(campaign, sim)
    if not problem:
        problem = _judged(campaign, log, watch, options.seed)
        code = int(problem != "")
    findings = health.show(sim.health)
    if options.strict and findings and not problem:
        problem, code = health.refusal(findings), 1
    shown = [field.field_path.recorded for field in d.shown]
    try:
        if shown and len(log):
            log.plot(*shown, columns=1 if len(shown) < 4 else 2, name="retained", title=title)
    except OSError as error:
        problem, code = "; ".join(filter(None, [problem, in_words(error)])), code or 1
    record = sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    if record:
        say(f"  record   {record} ({size_of(record)})")
    for plot in sim.plots.saved:
        say(f"  plot     {plot}")
    if problem:
        say("  interrupted" if code == 130 else "  failed")
        raise Failure(f"{title}: {problem}", code)
    say("  passed" if d.requirements else "  ended    without an error; nothing is required of it")
    return 0


def _attempt(campaign: Campaign, sim: Simulation) -> tuple[str, int]:
    """Fly a run; returns (what went wrong or "", the exit code)."""
    import fledge

    try:
        sim.run(campaign.dispersions.duration)
    except KeyboardInterrupt:
        return "interrupted", 130
    except fledge.CompositionError:
        raise
    except (fledge.SetupError, fledge.RunError) as error:
        return str(error), 1
    except Exception as error:  # of the mission's Python
        from fledge import mission as missions

        return missions.explain(error, campaign.folder), 1
    return "", 0


def _show_drawn(campaign: Campaign, sim: Simulation) -> None:
    """Print what was drawn for a run."""
    drawn, nominal = campaign.drawn(sim), campaign.drawn(campaign.nominal)
    width = max(map(len, drawn))
    for path, value in drawn.items():
        swept = path in getattr(campaign, "parameters", ())     # of the mission, whose own value no run has
        say(f"  drawn    {path.ljust(width)}  {campaign.shown(path, value)}"
            + ("" if swept else f", nominal {campaign.shown(path, nominal[path])}"))


def _judged(campaign: Campaign, log: Log, watch: Watch, seed: int) -> str:
    """Print what a run reached of each requirement; returns why it failed or ""."""
    result = campaign.judge(log, watch, seed)
    for requirement in campaign.dispersions.requirements:
        values, times, holds = result.reached(requirement)
        at = "" if math.isnan(times[0]) else f"at {times[0]:g} s"
        reached = requirement.failure(values[0], times[0]) if math.isnan(values[0]) else \
            " ".join(filter(None, [requirement._shown(values[0], ".4g"), at]))
        say(f"  {'holds' if holds[0] else 'FAILS':8} {requirement!r}" + (f": {reached}" if reached else ""))
    return next(iter(result.failures.values()), "")
