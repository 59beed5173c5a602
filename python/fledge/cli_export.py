# SPDX-License-Identifier: Apache-2.0
"""`fledge export c MISSION`: what flies, as source without Python.

Exit codes as of all commands: 0 written; 2 the command line or the mission is wrong, and nothing is written.
"""

from pathlib import Path


def add(command):
    """Add the subcommand, by the function of cli.parser() that adds one."""
    one = command("export", export, "write what flies in a mission as C", "export c nadir_spin --out nadir_spin_c")
    one.add_argument("form", choices=["c"], help="c: MISSION.h and MISSION.c, in C99")
    one.add_argument("mission", help="the name of a mission, or its folder")
    one.add_argument("--tasks", metavar="NAMES", help="only these, as in gnc,telemetry; default: all")
    one.add_argument("--out", metavar="DIR", help="default: runs/MISSION/c")


def export(options):
    import fledge
    from fledge import export as exports
    from fledge._console import say

    tasks = [name.strip() for name in options.tasks.split(",")] if options.tasks is not None else None
    mission = exports.read(fledge.load(options.mission), tasks)
    folder = Path(options.out) if options.out else Path("runs") / mission.title / options.form
    for path in exports.write(mission, folder):
        say(f"  wrote  {path}")
    for what in mission.left_out:
        say(f"  left out  {what}")
    return 0
