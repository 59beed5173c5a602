# SPDX-License-Identifier: Apache-2.0
"""`fledge montecarlo MISSION [CAMPAIGN] --runs N`: dispersed runs, or with --only one of them.

Exit codes as of all commands: 0 every run passed; 1 some failed; 2 the command line, the mission or its dispersions
are wrong; 130 Ctrl-C, with a report on the finished runs.
"""
from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

from fledge.cli.console import Plots, say, size_of
from fledge.cli.runs import alone
from fledge.errors import Failure
from fledge.progress import Bar, clock

FAILURES_SHOWN = 8


def add(command: Callable) -> None:
    """Add the subcommand. command: the function of cli.parser() that adds one."""
    one = command("montecarlo", montecarlo, "fly dispersed runs of a mission", "montecarlo nadir_spin --runs 2000")
    one.add_argument("mission", help="the name of a mission, or its folder; its dispersions.py defines the dispersions")
    one.add_argument("campaign", nargs="?", help="a function of dispersions.py; default: the first")
    one.add_argument("--runs", type=int, metavar="N", help="how many")
    one.add_argument("--seed", type=int, default=0, metavar="S", help="of all draws and random streams; default: 0")
    one.add_argument("--threads", type=int, metavar="T", help="default: all cores")
    one.add_argument("--only", type=int, metavar="INDEX",
                     help="fly this one run, as an ordinary simulation with a record and plots")
    one.add_argument("--out", metavar="DIR", help="default: runs/MISSION/montecarlo/CAMPAIGN, with /INDEX for --only")
    one.add_argument("--strict", action="store_true", help="a run with a finding about its health has failed")
    one.add_argument("--json", action="store_true", help="print the summary as JSON, and nothing else")


def montecarlo(options: argparse.Namespace) -> int:
    """Fly a campaign, or one run of it; returns the exit code."""
    from fledge.montecarlo import Campaign

    if (options.runs is None) == (options.only is None):
        raise Failure("montecarlo: give --runs N, or --only INDEX to fly one of them")
    if options.only is not None and options.json:
        raise Failure("montecarlo: --json is for --runs")
    campaign = Campaign(options.mission, options.campaign)
    folder = Path(options.out) if options.out else Path("runs") / campaign.nominal.name / "montecarlo" / campaign.name
    if options.only is not None and not options.out:
        folder /= str(options.only)
    with alone(folder):
        return (_all if options.only is None else _one)(campaign, options, folder)


def _command(campaign, options):
    """index -> the command that flies this run alone."""
    import shlex

    first = next(iter(campaign.known))
    words = ["./fledge", "montecarlo", options.mission, *([campaign.name] if campaign.name != first else []),
             "--seed", str(options.seed), "--only"]
    return lambda index: shlex.join([*words, str(index)])


# --- a campaign ------------------------------------------------------------------------------------

def _all(campaign, options, folder):
    import json

    from fledge.montecarlo import cores, report

    workers = min(cores() if options.threads is None else options.threads, options.runs)
    if campaign.has_callables and workers > 0:
        print(f"fledge: the mission calls Python, so {workers} processes fly the runs instead of threads, each "
              "run in a mission loaded afresh", file=sys.stderr)
    begun = time.perf_counter()
    with _Live(f"{campaign.nominal.name}, {campaign.name}", options.runs) as line:
        result = campaign.fly(options.runs, options.seed, options.threads, progress=line.at, strict=options.strict)
    wall = time.perf_counter() - begun
    data, paths = report.write(result, folder, _command(campaign, options))
    if options.json:
        print(json.dumps(data, indent=1))
    else:
        say(report.text(data, FAILURES_SHOWN))
        say(f"\n  flown    {data['flown']} runs in {wall:.3g} s, {data['flown'] / wall:,.4g} a second, on {workers} "
            + ("processes" if campaign.has_callables else "threads" if workers > 1 else "thread"))
        for path in paths:
            say(f"  {'plot' if path.suffix == '.png' else 'report':8} {path}")
    if result.interrupted:
        print(f"fledge: interrupted; the report is about the {data['flown']} runs that were finished", file=sys.stderr)
        return 130
    return 1 if data["failed"] else 0


class _Live(Bar):
    """The bar of a campaign: finished runs, their rate, the time left, failures."""

    def __init__(self, title: str, runs: int):
        super().__init__(title)
        self._runs = runs
        self._wanted = sys.stderr.isatty()

    def at(self, finished: int, failed: int) -> None:
        if not self._wanted:
            return
        spent = time.monotonic() - self._begun
        done = finished / self._runs
        text = f"{finished} of {self._runs}"
        if finished:
            text += f", {finished / spent:,.3g} a second, {clock(spent / done - spent)} left"
        if failed:
            text += f", {failed} failed"
        self.draw(done, text)


# --- one run of it ---------------------------------------------------------------------------------

def _one(campaign, options, folder):
    import fledge

    from fledge.cli import health

    index, d = options.only, campaign.dispersions
    sim = campaign.simulation(index, options.seed)
    title = f"{sim.name}, {campaign.name}, run {index} of seed {options.seed}"
    say(title)
    sim.plots = Plots(folder)
    sim.archive(folder / "run.mcap", mission=sim.name, campaign=campaign.name, campaign_seed=options.seed, run=index,
                fledge=fledge.__version__)
    everything = [one for process in sim.processes for one in process]
    log = sim.record(*everything, *(series.port(sim) for series in d.retained.values()), every=d.every)
    problem, code = "", 0
    try:
        sim.run(d.duration)
    except KeyboardInterrupt:
        problem, code = "interrupted", 130
    except (fledge.SetupError, fledge.RunError) as error:
        problem, code = str(error), 1
    except Exception as error:  # of the mission's Python
        from fledge import mission as missions

        problem, code = missions.explain(error, sim.mission.folder), 1
    say(f"  flown    {sim.time:g} s")
    drawn = campaign.drawn(sim)
    width = max(map(len, drawn))
    for path, value in drawn.items():
        nominal = campaign.drawn(campaign.nominal)[path]
        unit = f" {d.columns[path]}" if d.columns[path] else ""
        say(f"  drawn    {path.ljust(width)}  {value:.7g}{unit}, nominal {nominal:.7g}{unit}")
    if not problem:
        result = campaign.judge(log, options.seed)
        for requirement in d.requirements:
            values, times, holds = requirement.worst(result)
            unit = f" {requirement.variable.unit}" if requirement.variable.unit else ""
            say(f"  {'holds' if holds[0] else 'FAILS':8} {requirement!r}: {values[0]:.4g}{unit} at {times[0]:g} s")
        if result.failures:
            problem, code = next(iter(result.failures.values())), 1
    findings = health.show(sim.health)
    if options.strict and findings and not problem:
        problem, code = health.refusal(findings), 1
    if d.retained and len(log):
        log.plot(*d.retained, columns=1 if len(d.retained) < 4 else 2, name="retained", title=title)
    path = sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    if path:
        say(f"  record   {path} ({size_of(path)})")
    for plot in sim.plots.saved:
        say(f"  plot     {plot}")
    if problem:
        raise Failure(f"{title}: {problem}", code)
    say("  passed")
    return 0
