# SPDX-License-Identifier: Apache-2.0
"""`fledge faults MISSION`: each fault of each unit in each mode, flown and compared with the flight without it (FMEA).

Exit codes: 0 all were flown; 2 the command line or the mission is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse
from pathlib import Path

from fledge.cli.arguments import (add_mission, add_parameters, add_pool, add_seed, add_update_limit, command_line,
                                  given_parameters)

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("faults", faults, "faults sun_safe --begin 5min")
    add_mission(sub, "; its faults.py may say more")
    sub.add_argument("--scenario", action="append", default=[], metavar="NAME", help="may be repeated; default: the "
                     "first")
    sub.add_argument("--unit", action="append", default=[], metavar="PATH", help="only this one, as world.gyro; may be "
                     "repeated")
    sub.add_argument("--kind", action="append", default=[], metavar="KIND", help="only faults of this kind, as DEAD; "
                     "may be repeated")
    sub.add_argument("--begin", metavar="TIMES", help="when they begin: 90s, or 5min,1h; default: those of faults.py, "
                     "or the middle of each mode's first stay")
    sub.add_argument("--lasts", metavar="DURATION", help="for how long; default: that of faults.py, or for ever")
    sub.add_argument("--for", dest="duration", metavar="DURATION", help="end each flight so long after its start (90s, "
                     "10min, 2h); default: with its scenario")
    sub.add_argument("--double", action="store_true", help="pairs of faults of different units, too")
    add_seed(sub)
    add_pool(sub)
    sub.add_argument("--out", metavar="DIR", help="for the report; default: runs/MISSION/faults")
    add_update_limit(sub)
    add_parameters(sub)


def read(path: Path) -> str:
    """Read a mission's faults.py."""
    from fledge.analysis import Matrix

    Matrix(path.parent)
    return path.name


READERS = {"faults.py": read}


def faults(options: argparse.Namespace) -> int:
    import time

    from fledge.analysis import Matrix, fly, page
    from fledge.cli.arguments import flight_time, parse_duration
    from fledge.cli.console import counted, say
    from fledge.cli.runs import alone
    from fledge.progress import FIRST, Bar, clock

    matrix = Matrix(options.mission, options.seed, **given_parameters(options))
    name = matrix.simulation.name
    wanted = matrix.faults(options.unit, options.kind)
    begin = [parse_duration(word, "--begin") for word in options.begin.split(",")] if options.begin else None
    lasts = parse_duration(options.lasts, "--lasts") if options.lasts else None
    limit = flight_time(options)
    folder = Path(options.out) if options.out else Path("runs") / name / "faults"
    with alone(folder):
        say(f"{name}: {counted(len(wanted), 'fault')} of {counted(len({fault.unit for fault in wanted}), 'unit')}")
        begun = time.perf_counter()
        with Bar(name) as bar:
            def progress(done: int, all_: int, expected: float) -> None:
                if not bar.expected:
                    bar.expected = expected
                    if expected > FIRST:
                        say(f"  takes    about {clock(expected)} for {counted(all_, 'flight')}, as those without a "
                            "fault took; less with --for, --unit or --kind")
                bar.at(done / all_, f"{done} of {counted(all_, 'flight')}")

            flights = fly(matrix, options.scenario, wanted, options.double, begin, lasts, options.jobs, limit, progress,
                          options.scheduler)
        wall = time.perf_counter() - begun
        paths = page.write(flights, matrix, folder, command_line(options))
    say("\n".join(page.text(flights)))
    for flight in list(filter(page.hidden, flights))[:8]:
        say(f"  hidden   {flight.scenario}, {flight.begin:g} s: {' and '.join(map(str, flight.faults))}: "
            + (", ".join(flight.violated) or flight.text))
    say(f"  flown    {counted(len(flights), 'flight')} in {wall:.3g} s")
    for path in paths:
        say(f"  report   {path}")
    return 0
