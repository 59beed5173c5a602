# SPDX-License-Identifier: Apache-2.0
"""`fledge rewind RUN --to TIME`: a co-simulation goes on from an instant of an earlier run.

Exit codes: those of `fledge up`; 2 if the run cannot go on from there.
"""
from __future__ import annotations

from pathlib import Path

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    from fledge.cli.arguments import number

    sub = command("rewind", rewind, "rewind runs/nadir_spin --to 1h23m")
    sub.add_argument("run", metavar="RUN", help="the folder of a run of fledge up, with keep_every")
    sub.add_argument("--to", required=True, metavar="TIME", help="the instant (90s, 10min, 1h23m)")
    sub.add_argument("--until", metavar="TIME", help="how long to simulate; default: as in the run")
    sub.add_argument("--with", dest="file", metavar="SIM.toml", help="take the programs from this file: another branch")
    sub.add_argument("--changed", action="store_true", help="let programs that have changed since the run fly from the "
                     "start; they must write the same until the instant")
    sub.add_argument("--pace", type=number(), metavar="X",
                     help="X simulated seconds per second from the instant on; 0: as fast as possible")
    sub.add_argument("--out", metavar="DIR", help="for logs and records; default: RUN@TIME")
    sub.add_argument("--logs", action="store_true", help="show the output of the programs instead of the table")
    sub.set_defaults(needs=_needed)


def _needed(options: argparse.Namespace) -> list[str]:
    import json

    try:
        plan = json.loads((Path(options.run) / "run.json").read_text(encoding="utf-8"))["plan"]
        targets = sorted({program["target"] for program in plan["programs"] if program["target"]})
        serves = any(program["serve"] for program in plan["programs"])
    except (OSError, ValueError, TypeError, KeyError):
        targets, serves = [], False     # the command itself says what is wrong
    return ["build cosim", *targets, *["ground", "build ground", "view"] * serves]


def rewind(options: argparse.Namespace) -> int:
    """Run the co-simulation; returns the exit code."""
    from fledge.cli.arguments import parse_duration
    from fledge.cli.console import say
    from fledge.cli.cosim.up import fly, view_of
    from fledge.cosim.up import description
    from fledge.cosim.up.rewind import RewindError, recorded, past_of
    from fledge.errors import Failure
    from fledge.targets import TARGETS

    run, to = Path(options.run), parse_duration(options.to, "--to")
    folder = Path(options.out) if options.out else run.with_name(f"{run.resolve().name}@{options.to.replace(' ', '')}")
    if folder.resolve() == run.resolve():
        raise Failure(f"--out {folder} would overwrite the run from which this one goes on")
    try:
        plan, digests = recorded(run)
        if options.file:
            other = description.read(Path(options.file), TARGETS)
            plan.programs, plan.watch = other.programs, other.watch
        if options.until is not None:
            plan.until = parse_duration(options.until, "--until")
        if options.pace is not None:
            plan.pace = options.pace
        if plan.until is None or to >= plan.until:
            raise RewindError(f"the run is to go on from {to:g} s, but it ends at {plan.until:g} s; give a later "
                              "--until")
        past = past_of(run, plan, digests, to, options.changed)
    except (RewindError, description.SimError) as error:
        raise Failure(f"rewind: {error}") from None
    fresh = [p.name for p in plan.nodes if p.name not in past.snapshots]
    for at in sorted(set(past.snapshots.values())):
        say(f"  from     {at:g} s: {', '.join(name for name, t in past.snapshots.items() if t == at)}")
    if fresh:
        say(f"  from     the start: {', '.join(fresh)}, which must write the same until {to:g} s")
    if past.later:
        say(f"  live     asynchronous programs wrote {past.later} messages after that, which are not written again")
    return fly(plan, folder, view_of(options), past)
