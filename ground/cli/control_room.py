# SPDX-License-Identifier: Apache-2.0
"""`fledge ground ACTION`: the server of the control room (docs/control-room.md), scripts of the ground, and lines
for the server's file, which let people and scripts use it.

Exit codes: 0 done, also by Ctrl-C of the server; 1 the script failed; 2 the command line, the file or the address is
wrong; 130 Ctrl-C or SIGTERM of a script.
"""
from __future__ import annotations

import argparse
import getpass
import sys
from pathlib import Path

from fledge.cli.arguments import actions, add_process, add_seed, number
from fledge.cli.console import complain, say, trace
from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager
    from typing import Any, NoReturn


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub: Any = command("ground", lambda options: sub.error("serve, run, password or token?"),
                       "ground serve ground.toml")
    sub.set_defaults(needs=_needs)
    action = actions(sub, "ground")
    a = action("serve", serve, "decode, archive and command spacecraft, with a console in the browser",
               "serve ground.toml")
    a.add_argument("file", metavar="FILE", help="its spacecraft and their links: docs/control-room.md")
    a = action("run", run, "run a script of the ground, and write a page about it", "run gains.py --to nadir_spin")
    a.add_argument("script", metavar="SCRIPT.py", help="has a function run(craft, script); docs/ground.md")
    a.add_argument("--to", required=True, metavar="CRAFT", help="MISSION or MISSION:SCENARIO, which is "
                   "simulated meanwhile; an address, as of `fledge command`; or http://HOST:PORT/CRAFT of "
                   "`fledge ground serve`")
    a.add_argument("--token", help="of a server with users: who the script is; default: the variable FLEDGE_TOKEN, "
                   "which others do not see in the list of processes")
    a.add_argument("--mission", help="of an address: the name of the mission, or MISSION_packets.json of an export")
    add_process(a)
    add_seed(a, "a simulated mission's random streams")
    a.add_argument("--pace", type=number(), default=0.0, metavar="X", help="of a simulated mission: X simulated "
                   "seconds per second; default: as fast as possible")
    a.add_argument("--radio", metavar="world.RADIO", help="of a simulated mission: by which packets pass; default: "
                   "straight to flight and back")
    a.add_argument("--yes", action="store_true", help="answer the script's questions with yes")
    a.add_argument("--out", metavar="DIR", help="for script.html and script.jsonl; default: a new folder in "
                   "runs/scripts")
    action("password", password, "ask for a password, and print the line of a [[user]] that knows it", "password")
    a = action("token", token, "make a token for scripts, and print it with its table for the server's file",
               "token 'night pass'")
    a.add_argument("name", metavar="NAME", help="of the script, for the operators' log")


def read(path: Path) -> str:
    """Read the file of a control room."""
    from fledge.ground.server import settings

    settings.read(path)
    return path.name


READERS = {"craft": read}


def _needs(options: argparse.Namespace) -> list[str]:
    if options.function == serve:
        return ["ground", "build ground", "view"]
    served = getattr(options, "to", "").startswith(("http://", "https://"))
    return ["ground"] * served + ["build ground"]


M_ARENA_MAX = -8        # of mallopt(3)


def serve(options: argparse.Namespace) -> int:
    import asyncio
    import ctypes
    import gc
    import os
    import signal

    from fledge.cosim.steering import Steering
    from fledge.ground.server import settings, web
    from fledge.ground.server.room import Room
    from fledge.ground.server.run_control import Steered

    complain(f"loading the spacecraft of {options.file} ...")
    ctypes.CDLL(None).mallopt(M_ARENA_MAX, 1)   # with a heap for each thread, each keeps the size of its largest answer
    os.umask(0o077)     # journal, archive and files are their owner's
    given = settings.read(Path(options.file))
    open_ones = given.guarded()
    steering = Steering.of_run()
    room = Room(given, Steered(steering) if steering else None)
    for text in open_ones:
        complain(text)
        for craft in given.crafts:
            room.report(craft.name, "warning", "server", text)

    def ready(address: str) -> None:
        gc.freeze()     # what there is now stays: a collection need not look at it
        say(f"  the console is at {address} (Ctrl-C ends)")

    async def until_signal() -> None:
        over = asyncio.Event()
        for ending in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(ending, over.set)
        await web.serve(room, ready, over)

    try:
        asyncio.run(until_signal())
    finally:
        room.close()
    say("  ended")
    return 0


def run(options: argparse.Namespace) -> int:
    import shlex
    from datetime import datetime, timezone
    from json import dumps

    from fledge.cli.runs import RUNS, alone
    from fledge.ground.scripts import script as scripts
    from fledge.report import script as page

    path = Path(options.script)
    function = scripts.load(path)
    folder = Path(options.out) if options.out else \
        RUNS / "scripts" / f"{path.stem}-{datetime.now(timezone.utc):%Y%m%dT%H%M%S}Z"
    entries: list[scripts.Entry] = []
    with _craft(options, scripts.Watched) as craft, alone(folder), (folder / "script.jsonl").open("w") as lines:
        def write(entry: scripts.Entry) -> None:
            entries.append(entry)
            lines.write(dumps(entry, ensure_ascii=False) + "\n")
            lines.flush()
            _show(entry)

        write(scripts.begin(path, options.to, function))
        prompt = getattr(craft.link, "ask", None)    # of a server: its operators
        script = scripts.Script(path, craft, write, lambda question: _ask(question, options.yes, prompt))
        try:
            with _ended_as_by_ctrl_c():
                problem, code = script.run(function, lambda: trace(options))
        finally:
            words = [word.replace(options.token or "\0", "...") for word in options.words]      # the page is for others
            at = page.write(folder / "script.html", entries, shlex.join(["./fledge", *words]))
            say(f"  page     {at}")
    if problem:
        raise Failure(f"{path.name}: {problem}" if code == 130 else problem, code)
    say("  passed")
    return 0


def _ended_as_by_ctrl_c() -> AbstractContextManager[None]:
    """SIGTERM, too, ends a script so that its page is written; in the program's first thread."""
    import signal

    from fledge.interruption import handled

    def interrupt(*_: object) -> NoReturn:
        raise KeyboardInterrupt

    return handled([signal.SIGTERM], interrupt)


def _craft(options: argparse.Namespace, kind: Any) -> Any:
    """The spacecraft of --to."""
    import re

    import fledge
    from fledge import ground

    if re.match(r"[a-z]+://|serial:|cosim:", options.to):
        if not options.mission and not options.to.startswith("http"):
            raise Failure(f"ground run: {options.to} is an address; --mission says what is there")
        return ground.connect(options.to, options.mission, process=options.process, kind=kind, token=options.token)
    mission, colon, scenario = options.to.partition(":")
    sim = fledge.load(mission, options.seed)
    if colon:
        from fledge.mission.scenario import chosen, set_up

        set_up(sim, chosen(sim, scenario)[1])
    sim.pace = options.pace
    return ground.connect(sim, process=options.process, radio=options.radio, kind=kind)


def _show(entry: dict[str, Any]) -> None:
    """An entry as a line of the terminal."""
    texts = {"step": " / ".join(entry.get("step", [])), "command": entry.get("text"), "confirm": entry.get("why"),
             "stage": f"{entry.get('id')} {entry.get('stage')} {entry.get('text')}", "file": entry.get("text"),
             "wait": entry.get("why") or "done", "hold": "",
             "check": f"{entry.get('text') or entry.get('source')}: {'holds' if entry.get('good') else 'fails'}",
             "value": str(entry.get("values"))}
    if (text := texts.get(entry["kind"])) is not None:
        say(f"  {entry['t_ns'] / 1e9:10.3f} s  {entry['kind']:9} {text}".rstrip())


def _ask(question: str, yes: bool, prompt: Callable[[str], tuple[bool, str]] | None) -> tuple[bool, str]:
    """(the answer, the name of the operator)."""
    if yes:
        return True, "by --yes"
    if prompt:
        say(f"  the console asks: {question}")
        return prompt(question)
    if not sys.stdin.isatty():
        raise Failure(f"the script asks '{question}', and there is no terminal; --yes answers it", 1)
    return input(f"{question} [y/N] ").strip().lower() in ("y", "yes"), f"by {getpass.getuser()}"


def password(options: argparse.Namespace) -> int:
    from fledge.ground.server.passwords import PASSWORD_LEAST, PASSWORD_MOST, hashed

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

    from fledge.ground.server import passwords

    word, hashed = passwords.token()
    say(f"# the token: {word}")
    say(f"[[token]]\nname = {dumps(options.name, ensure_ascii=False)}\nhash = \"{hashed}\"\nroles = [\"view\"]")
    return 0
