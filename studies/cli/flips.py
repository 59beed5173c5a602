# SPDX-License-Identifier: Apache-2.0
"""`fledge flips MISSION`: bit flips in its flight computer in the middle of a manoeuvre, and what came of each.

Exit codes: 0 the campaign was flown; 1 the process of a flight died; 2 the command line or the mission is wrong;
130 Ctrl-C.
"""
from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from fledge.cli.arguments import add_mission, add_pool, add_seed, parse_duration


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("flips", flips, "flips nadir_spin --count 1000")
    add_mission(sub, ", with one flight process")
    sub.add_argument("scenario", nargs="?", help="its set-up counts; default: the mission's first")
    sub.add_argument("--count", type=int, default=1000, metavar="N", help="how many flips, each in a flight of its own;"
                     " default: 1000")
    add_seed(sub, "the drawn bits and times", "S")
    sub.add_argument("--at", default="60s", metavar="TIME", help="where all flights begin; default: 60s")
    sub.add_argument("--for", dest="duration", default="60s", metavar="DURATION",
                     help="the flips come in it; default: 60s")
    sub.add_argument("--after", default="20s", metavar="DURATION", help="how long each flight goes on then, so that a "
                     "watchdog can act; default: 20s")
    sub.add_argument("--bits", type=int, default=1, metavar="N", help="how many neighbouring bits of a word each flip "
                     "inverts; default: 1")
    sub.add_argument("--rates", type=float, nargs=2, metavar=("REGISTERS", "MEMORY"), help="flips per bit and day; they"
                     " then come at any time, and effects have a rate; default: each bit as likely, at any instruction")
    sub.add_argument("--edac", choices=("off", "on", "both"), default="both", help="check bits of the memory; default: "
                     "both, one campaign after the other with the same flips")
    add_pool(sub)
    sub.add_argument("--engine", default="translator", choices=("translator", "threaded", "interpreter"),
                     help="of the emulator; default: translator")
    sub.add_argument("--out", metavar="DIR", help="for the tables and the plot; default: runs/MISSION/flips")
    sub.set_defaults(needs=lambda options: ["leon3", "build _emulator"])


def flips(options: argparse.Namespace) -> int:
    import time

    from fledge.cli.console import say
    from fledge.cli.runs import alone
    from fledge.emulator import flips as campaigns
    from fledge.disk import write_files
    from fledge.progress import Bar

    at, duration, after = map(parse_duration, (options.at, options.duration, options.after))
    results: dict[str, Sequence[campaigns.Outcome]] = {}
    died: list[str] = []
    name = Path(options.mission).name
    folder = Path(options.out) if options.out else Path("runs") / name / "flips"
    with alone(folder):
        for edac in {"off": [False], "on": [True], "both": [False, True]}[options.edac]:
            title = "with EDAC" if edac else "without EDAC"
            campaign = campaigns.Campaign(options.mission, options.scenario, at=at, duration=duration, after=after,
                                          edac=edac, bits=options.bits, rates=options.rates,
                                          engine=options.engine)
            begun = time.perf_counter()
            with Bar(title) as bar:
                def progress(done: int, bar: Bar = bar) -> None:
                    bar.at(done / options.count, f"{done} of {options.count} flips")

                outcomes = campaign.fly(options.count, options.seed, options.jobs, progress, options.scheduler)
            wall = time.perf_counter() - begun
            results[title] = outcomes
            died += campaign.died
            say(f"{campaign.name}, {title}, {options.count} flips from {at:g} s to {at + duration:g} s, seed "
                f"{options.seed}, in {wall:.3g} s")
            say(f"  of {campaign.n_registers:,} places in registers and {campaign.n_memory:,} in memory"
                + (f", {campaign.per_day:.3g} flips per day" if campaign.per_day else ""))
            for lines in (campaigns.table(outcomes), campaigns.shares(outcomes, campaign.per_day),
                          campaigns.severity(outcomes, campaign.measures)):
                for line in ["", *lines] if lines else []:
                    say(("  " + line).rstrip())
            for text in campaign.died:
                say(f"  died     {text}")
            write_files({f"{'edac' if edac else 'plain'}.csv": campaigns.csv(outcomes, campaign.measures)}, folder)
        path = campaigns.plot(results, f"{name}: bit flips in the flight computer", folder / "flips.png")
    say(f"  plot     {path}")
    return 1 if died else 0
