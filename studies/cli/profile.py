# SPDX-License-Identifier: Apache-2.0
"""`fledge profile MISSION`: what flight costs on targets: memory, code, instructions and time, initialisation and loop
apart.

Exit codes: 0 measured, and no loop grows or allocates; 1 one does, or its outputs differ from the desktop's; 2 the
command line or the mission is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse
from pathlib import Path

from fledge.cli.arguments import (add_campaign, add_mission, add_parameters, add_pool, add_process, add_seed,
                                  given_parameters)
from fledge.targets import TARGETS

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("profile", profile, "profile nadir_spin --on linux,leon3,desktop --for 10min")
    add_mission(sub)
    sub.add_argument("scenario", nargs="?", help="its set-up and duration count; default: the mission's first")
    sub.add_argument("--free", action="store_true", help="without a scenario; with --for")
    sub.add_argument("--on", default="linux", metavar="TARGETS", help="as of fledge fly, where something "
                     "measures it; desktop is CPython, to compare with; default: linux")
    sub.add_argument("--for", dest="duration", metavar="DURATION", help="fly only so long (90s, 10min, 2h)")
    add_process(sub)
    add_seed(sub)
    sub.add_argument("--longest", type=int, metavar="N", help="on leon3: search the longest path of each task in N "
                     "flights with the mission's dispersions; SCENARIO may be several, A,B")
    sub.add_argument("--bound", action="store_true", help="with --longest: a bound of each task beside, from its "
                     "object code")
    add_campaign(sub, "with --longest: ")
    add_pool(sub, "with --longest: ")
    sub.add_argument("--out", metavar="DIR", help="for profile.html, profile.json and what is built; default: "
                     "runs/MISSION/profile")
    add_parameters(sub)
    sub.set_defaults(needs=lambda options: ["profile", "build _emulator", *TARGETS.known(_names(options))])


def profile(options: argparse.Namespace) -> int:
    import json

    from fledge.cli.arguments import flight_time
    from fledge.cli.console import complain, counted, say
    from fledge.cli.runs import alone
    from fledge.columns import columns
    from fledge.errors import Failure
    from fledge.disk import write_files
    from fledge.profile import page, profile as measure
    from fledge.progress import Bar
    from fledge.targets import Job

    names = _names(options)
    if not names:
        raise Failure("profile: --on names no target")
    duration = flight_time(options)
    if options.free and (options.scenario or not duration):
        raise Failure("profile: --free is without a scenario, and needs --for")
    name = Path(options.mission).name
    folder = Path(options.out) if options.out else Path("runs") / name / "profile"
    if options.bound and options.longest is None:
        raise Failure("profile: --bound stands beside the longest path that was seen; add --longest N")
    if options.longest is not None:
        return _longest(options, folder, duration)
    with alone(folder):
        job = Job(options.mission, options.scenario, duration, options.seed, folder=folder, free=options.free,
                  parameters=given_parameters(options))
        say(f"{job.title}, {job.scenario}, {job.duration:g} s")
        with Bar(job.title) as bar:
            timings = measure(job, names, options.process, lambda name, done: bar.at(
                done / len(names), f"{done} of {counted(len(names), 'target')}, now {name}"))
        for line in columns(page.table(timings), right=set(range(1, len(timings) + 1))):
            say("  " + line)
        facts = {"mission": job.title, "scenario": job.scenario, "duration": job.duration,
                 "targets": [timing.as_json() for timing in timings]}
        paths = write_files({"profile.json": json.dumps(facts, indent=1) + "\n",
                             "profile.html": page.page(job.title, job.scenario, job.duration, timings)}, folder)
    say(f"  report   {paths[1]}\n  figures  {paths[0]}")
    problems = [f"{timing.target}: {problem}" for timing in timings for problem in timing.problems()]
    for problem in problems:
        complain(problem)
    return 1 if problems else 0


def _longest(options: argparse.Namespace, folder: Path, duration: float | None) -> int:
    """Search the longest path of each task."""
    from fledge.analysis import timing
    from fledge.cli.console import counted, say
    from fledge.cli.runs import alone
    from fledge.errors import Failure
    from fledge.disk import write_files
    from fledge.progress import Bar

    if _names(options) != ["leon3"] or options.free:
        raise Failure("profile: --longest is for --on leon3, where the emulator counts cycles, and for scenarios")
    with alone(folder):
        search = timing.Search(options.mission, options.scenario.split(",") if options.scenario else [None],
                               options.campaign, duration, options.seed, options.process, folder,
                               **given_parameters(options))
        with Bar(Path(options.mission).name) as bar:
            spans = search.search(options.longest, options.jobs, lambda done: bar.at(
                done / options.longest, f"{done} of {options.longest}"), options.scheduler)
        if options.bound:
            search.bound(spans)
        say(f"{search.jobs[0].title}, {', '.join(job.scenario for job in search.jobs)}: the longest paths in "
            f"{counted(spans.runs, 'flight')}" + (f" with the dispersions of {search.campaign.name}" if search.campaign
                                                  else ", which differ in their noise: there is no dispersions.py"))
        say("\n".join(timing.text(spans)))
        for path in write_files({"timing.csv": timing.as_csv(spans), "timing.json": timing.as_json(spans)}, folder):
            say(f"  figures  {path}")
    return 1 if spans.died or spans.unbounded else 0


def _names(options: argparse.Namespace) -> list[str]:
    return list(dict.fromkeys(filter(None, map(str.strip, options.on.split(",")))))
