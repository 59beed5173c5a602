# SPDX-License-Identifier: Apache-2.0
"""`fledge ground ACTION`: the server of the control room (docs/control-room.md), and lines for its file, which let people
and scripts use it.

Exit codes as of all commands: 0 done, also by Ctrl-C; 2 the command line or the file is wrong.
"""
from __future__ import annotations

import argparse
import getpass
import sys

from fledge.cli.console import say
from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    one: Any = command("ground", lambda options: one.error("serve, password or token?"),
                       "the control room: serve it, its users and their scripts", "ground serve ground.toml")
    kinds = one.add_subparsers(metavar="ACTION", parser_class=type(one))

    def action(name, function, text, example):
        a = kinds.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".",
                             epilog=f"example: ./fledge ground {example}")
        a.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
        a.set_defaults(function=function)
        return a

    a = action("serve", serve, "decode, archive and command spacecraft, with a console in the browser",
               "serve ground.toml")
    a.add_argument("file", metavar="FILE", help="its spacecraft and their links: docs/control-room.md")
    action("password", password, "ask for a password, and print the line of a [[user]] that knows it", "password")
    a = action("token", token, "make a token for scripts, and print it with its table for the server's file",
               "token 'night pass'")
    a.add_argument("name", metavar="NAME", help="of the script, for the operators' log")


def serve(options: argparse.Namespace) -> int:
    import asyncio
    import signal
    from pathlib import Path

    from fledge.control_room import web
    from fledge.control_room.room import Room
    from fledge.control_room.settings import read

    room = Room(read(Path(options.file)))

    async def until_signal() -> None:
        over = asyncio.Event()
        for one in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(one, over.set)
        await web.serve(room, lambda address: say(f"  the console is at {address} (Ctrl-C ends)"), over)

    try:
        asyncio.run(until_signal())
    finally:
        room.close()
    say("  ended")
    return 0


def password(options: argparse.Namespace) -> int:
    from fledge.control_room.users import PASSWORD_LEAST, PASSWORD_MOST, hashed

    if sys.stdin.isatty():
        given = getpass.getpass("password: ")
        if given != getpass.getpass("again: "):
            raise Failure("ground password: the two are not the same")
    else:
        given = sys.stdin.readline().rstrip("\n")
    if not PASSWORD_LEAST <= len(given) <= PASSWORD_MOST:
        raise Failure(f"ground password: a password has {PASSWORD_LEAST} to {PASSWORD_MOST} characters; "
                      f"found {len(given)}")
    say(f'password = "{hashed(given)}"')
    return 0


def token(options: argparse.Namespace) -> int:
    from json import dumps

    from fledge.control_room.users import token as made

    word, kept = made()
    say(f"# the token: {word}")
    say(f"[[token]]\nname = {dumps(options.name, ensure_ascii=False)}\nhash = \"{kept}\"\nroles = [\"view\"]")
    return 0
