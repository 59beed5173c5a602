# SPDX-License-Identifier: Apache-2.0
"""`fledge load BOARD ELF`: a program into a board, by openocd; `fledge load ssh:HOST MISSION`: the program of a mission
onto another computer with Linux, such as a Raspberry Pi.

Exit codes: 0 it is loaded; 1 the board, the probe or the host failed; 2 the command line, the file or the mission is
wrong, and nothing was sent; 130 Ctrl-C.
"""
from __future__ import annotations

import shlex

from fledge.cli.arguments import add_parameters, given_parameters
from fledge.errors import Failure
from fledge.serial_line import BY_SSH

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    from fledge.targets import boards

    sub = command("load", load,
                  "load nucleo-h743zi build/my_sat.elf\n         ./fledge load ssh:pi@raspberrypi nadir_spin")
    sub.add_argument("board", metavar="BOARD", help=f"{', '.join(boards())}: by openocd; ssh:HOST or ssh:USER@HOST: by "
                     "ssh")
    sub.add_argument("what", metavar="ELF|MISSION", help="of a board: the linked program; of ssh: a mission, whose "
                     "program is built for that machine")
    sub.add_argument("scenario", nargs="?", help="of a mission: whose set-up counts; default: its first")
    sub.add_argument("--dry-run", action="store_true", help="check the program, and only print the command of openocd")
    sub.add_argument("--probe", metavar="SERIAL", default="", help="the serial number of the debug probe, where there "
                     "are several")
    sub.add_argument("--process", metavar="NAME", help="of a mission: the flight process; default: the only one")
    sub.add_argument("--to", metavar="DIR", help="the folder on that machine; default: fledge/MISSION in the user's "
                     "home")
    sub.add_argument("--ssh", metavar="COMMAND", default="", help="how ssh is called, as in 'ssh -p 2222 -i my_key'; "
                     "default: ssh")
    add_parameters(sub)
    sub.set_defaults(needs=lambda options: ["ssh", "aarch64"] if options.board.startswith(BY_SSH) else ["load"])


def load(options: argparse.Namespace) -> int:
    if options.board.startswith(BY_SSH):
        return _by_ssh(options)
    from fledge import elf
    from fledge.cli.console import say, size_of
    from fledge.targets import probe

    for name in ("scenario", "process", "to", "ssh", "parameters"):
        if getattr(options, name):
            raise Failure(f"load: {'--' * (name != 'scenario')}{'set' if name == 'parameters' else name} is for "
                          f"ssh:HOST; {options.board} takes a linked program")
    board, program = probe.board(options.board), elf.read(options.what)
    board.check(program)
    command = board.command(program, options.probe)
    say(f"{program.path} ({size_of(program.path)}), {program.processor}, build id {program.build_id or 'none'}, into "
        f"{board.name}: {board.about}")
    say(f"  {shlex.join(command)}")
    if not options.dry_run:
        probe.run(command, str(program.path))
        say("  loaded, and started")
    return 0


def _by_ssh(options: argparse.Namespace) -> int:
    from fledge.cli.console import say, size_of
    from fledge.targets import TARGETS, Job, remote
    from fledge.targets.ssh import Ssh

    for name in ("probe", "dry_run"):
        if getattr(options, name):
            raise Failure(f"load: --{name.replace('_', '-')} is for a board that openocd loads; found {options.board}")
    host, ssh = options.board.removeprefix(BY_SSH), options.ssh or remote.SSH
    target, = TARGETS.ready([remote.target_for(host, ssh)], "load")
    job = Job(options.what, options.scenario, 1.0, parameters=given_parameters(options))
    if options.process is None and len(job.parts) > 1:
        names = ", ".join(part.process for part in job.parts)
        raise Failure(f"load: {job.title} has the flight processes {names}; name "
                      "one by --process")
    part = job.part(options.process) if options.process else job.parts[0]
    target.check(part)
    folder = options.to or f"fledge/{job.title}"
    built, board = target.build(part), Ssh(options.board, options.ssh)
    board.compiler = getattr(target, "compiler")    # the host is asked once what it is
    place = remote.copy(built, host, ssh, folder)
    at_line = remote.copy(board.program_of(part), host, ssh, folder, f"{built.name}-line")
    say(f"{job.title}, {part.process}, for {target.name}: {built} ({size_of(built)}) is {place} on {host}")
    say(f"  by its clock  {shlex.join([*shlex.split(ssh), host, f'{shlex.quote(place)} --clock --for 60'])}")
    on = f"{part.process}=" * (len(job.parts) > 1)
    say(f"  in the loop   ./fledge fly {options.what} --on {on}{options.board}"
        + (f" --ssh {shlex.quote(options.ssh)}" if options.ssh else ""))
    own = shlex.join([*shlex.split(ssh), host, f"{shlex.quote(at_line)} /dev/serial0"])
    say(f"  at its serial port  {own}\n                ./fledge fly {options.what} --on {on}serial:DEVICE")
    return 0
