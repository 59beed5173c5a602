# SPDX-License-Identifier: Apache-2.0
"""`fledge versions MISSION --against VERSION`: the same campaign with two versions of flight, and what moved.

Exit codes: 0 every requirement holds in the runs in which it held; 1 one does not; 2 the command line, a mission or a
version is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse
from pathlib import Path

from fledge.cli.arguments import add_campaign, add_jobs, add_mission, add_seed

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("versions", versions, "versions nadir_spin --against HEAD~1 --runs 200")
    add_mission(sub, "; its dispersions.py defines the campaign")
    add_campaign(sub)
    sub.add_argument("--against", required=True, metavar="VERSION", help="a revision in git; or a folder: another "
                     "tree of Fledge or of the project, the mission as it was, or results of this campaign")
    sub.add_argument("--runs", type=int, default=100, metavar="N", help="default: %(default)s")
    add_seed(sub, "all draws and random streams", "S")
    add_jobs(sub)
    sub.add_argument("--out", metavar="DIR", help="for the results of both and versions.csv; default: "
                     "runs/MISSION/versions")


def versions(options: argparse.Namespace) -> int:
    from fledge import mission as missions
    from fledge.analysis import versions as comparing
    from fledge.cli.console import complain, counted, say
    from fledge.cli.runs import alone
    from fledge.disk import write_files

    folder = Path(options.out) if options.out else Path("runs") / missions.find(options.mission).name / "versions"
    with alone(folder):
        this, other = comparing.fly(options.mission, options.against, options.campaign, options.runs, options.seed,
                                    folder, options.jobs)
        moved = comparing.compare(this, other)
        say("\n".join(comparing.text(this, other, moved)))
        for path in write_files({"versions.csv": comparing.as_csv(this, moved)}, folder):
            say(f"  report   {path}")
    fell = comparing.regressions(moved)
    for change in fell:
        complain(f"{change.name} held in {counted(len(change.lost), 'run')} in which it does not hold now, as in run "
                 f"{change.lost[0]}")
    return 1 if fell else 0
