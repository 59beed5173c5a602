# SPDX-License-Identifier: Apache-2.0
"""`fledge export c MISSION`: what flies, as source without Python.

Exit codes as of all commands: 0 written; 2 the command line or the mission is wrong, and nothing is written.
"""

from pathlib import Path

from fledge.cli_node import add_parameters, given_parameters


def add(command):
    """Add the subcommand, by the function of cli.parser() that adds one."""
    one = command("export", export, "write what flies in a mission as C", "export c nadir_spin --out nadir_spin_c")
    one.add_argument("form", choices=["c"], help="c: MISSION.h and MISSION.c, in C99")
    one.add_argument("mission", help="the name of a mission, or its folder")
    one.add_argument("--tasks", metavar="NAMES", help="only these, as in gnc,telemetry; default: all")
    one.add_argument("--board", nargs="*", metavar="FILE", help="with the board that its messages pass and the tables "
                     "of how; default: a board of its own, which carries them whole")
    one.add_argument("--outputs", metavar="PATHS", help="which that board carries besides what the world reads, as in "
                     "flight.tracking.error,flight.spin.euler; all: every one")
    one.add_argument("--out", metavar="DIR", help="default: runs/MISSION/c")
    add_parameters(one)


def export(options):
    import fledge
    from fledge import export as exports
    from fledge._console import Failure, say

    tasks = [name.strip() for name in options.tasks.split(",")] if options.tasks is not None else None
    mission = exports.read(fledge.load(options.mission, **given_parameters(options)), tasks)
    if options.outputs and options.board != []:
        raise Failure("export: --outputs is for the mission's own board; give --board, without files")
    more = {}
    if options.board is not None:
        more = exports.emit_board(mission, options.board, outputs_of(options.outputs))
    folder = Path(options.out) if options.out else Path("runs") / mission.title / options.form
    for path in exports.write(mission, folder, more):
        say(f"  wrote  {path}")
    for what in mission.left_out:
        say(f"  left out  {what}")
    return 0


def outputs_of(text):
    """What --outputs says, as emit_board takes it."""
    return "all" if text == "all" else [path.strip() for path in (text or "").split(",") if path.strip()]
