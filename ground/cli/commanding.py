# SPDX-License-Identifier: Apache-2.0
"""What a person on the ground does by hand: `fledge command` makes or sends a command, `fledge send` and `fledge fetch`
move files, `fledge link` lets foreign tools command a flight computer of a co-simulation.

Exit codes: 0 all went well; 1 the spacecraft refused a command or did not answer, or a link broke; 2 the command line,
the mission or the address is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import ast
import re

from fledge.cli.arguments import add_process, number

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable
    from typing import Any


def add(command: Callable) -> None:
    """Add the subcommands, by the function of cli.parser() that adds one."""
    mission = "the name of a mission, or its folder, or MISSION_packets.json of an export"
    address = "udp://HOST:PORT?listen=PORT, tcp://HOST:PORT, listen://PORT, serial:DEVICE?baud=N"
    sub = command("command", command_, "command nadir_spin flight.control K=3")
    sub.add_argument("mission", help=mission)
    sub.add_argument("what", nargs="+", metavar="WORD", help="a module and its parameters, as in flight.control K=3; "
                     "or a command and its arguments, as in `mode science`, `arm EVENT off`, `noop`")
    add_process(sub)
    sub.add_argument("--to", metavar="ADDRESS", help=f"send it, and wait for its execution: {address}; without, "
                     "print its packets in hexadecimal, a line each")
    sub.add_argument("--within", default="10s", metavar="DURATION", help="how long to wait; default: 10s")
    sub.add_argument("--sequence", type=int, default=0, metavar="N", help="of the first packet; default: 0")

    for name, does, example, other in (
            ("send", send, "send plan.bin --as next", "its name on board; default: the same"),
            ("fetch", fetch, "fetch science.bin", "the file here; default: the same name, in this folder")):
        sub = command(name, does, f"{example} --to 'udp://127.0.0.1:10025?listen=10015' nadir_spin")
        sub.set_defaults(needs=lambda _: ["build ground"])
        sub.description += " By CFDP (docs/ground.md)."
        sub.add_argument("file", help="the file" if name == "send" else
                         "its name on board; a name that ends with / lists that directory, / alone lists all")
        sub.add_argument("mission", help=mission)
        sub.add_argument("--as", dest="name", metavar="NAME", help=other)
        sub.add_argument("--to", metavar="ADDRESS", required=True, help=f"where flight is: {address}")
        add_process(sub)
        sub.add_argument("--within", default="1h", metavar="DURATION", help="how long to wait; default: 1h")
        sub.add_argument("--rate", type=number("a rate"), metavar="BYTES_PER_S", help="of the packets that go up; "
                         "default: 4000")
        sub.add_argument("--class1", action="store_true", help="without acknowledgements; what is lost stays lost")
        sub.add_argument("--entities", default="1,2", metavar="OWN,PEER", help="their numbers; default: 1,2")

    sub = command("link", link, "link flight listen://127.0.0.1:10025")
    sub.set_defaults(needs=lambda _: ["build cosim"])
    sub.description += (" It is an [[asynchronous]] program of a co-simulation's file (docs/ground.md), and carries "
                        "packets both ways; the run does not wait for it.")
    sub.add_argument("process", help="the flight process, whose target has queues of commands and telemetry")
    sub.add_argument("address", metavar="ADDRESS", help="as of `fledge command`: where commands come from, and where "
                     "telemetry goes")
    sub.add_argument("--radio", metavar="world.RADIO", help="by which packets pass; default: straight to flight and "
                     "back")


# --- command ---------------------------------------------------------------------------------------

def command_(options: argparse.Namespace) -> int:
    from fledge import ground
    from fledge.cli.arguments import parse_duration
    from fledge.cli.console import say
    from fledge.commands import Packets
    from fledge.errors import Failure

    if not 0 <= options.sequence < 0x4000:
        raise Failure(f"--sequence: expected 0 to {0x3FFF}; found {options.sequence}")
    dictionary = ground.dictionary_of(options.mission, options.process)
    what, arguments, values = parsed(options.what)
    within = parse_duration(options.within, "--within")
    if not options.to:
        for packet in ground.packets(Packets(dictionary, options.sequence), what, *arguments, **values):
            say(packet.hex())
        return 0
    with ground.connect(options.to, dictionary, sequence=options.sequence) as craft:
        sent = craft.command(what, *arguments, **values)
        sent.completed(within)
        for report in sent.reports:
            say(f"  {report.t / 1e9:g} s  {report.stage_text}"
                + (f"  {report.data.hex()}" if report.data else ""))
    return 0


def parsed(words: list[str]) -> tuple[str, list[Any], dict[str, Any]]:
    """(command, arguments, values) of what a person types: "flight.control K=3", "mode science"."""
    what, *rest = words
    arguments: list[Any] = []
    if "." in what:
        what, arguments = "write", [what]
    values = {}
    for word in rest:
        name, equals, value = word.partition("=")
        if equals and re.fullmatch(r"\w+", name):
            values[name] = _value(value)
        elif word in ("on", "off"):
            values["on"] = word == "on"
        else:
            arguments.append(word)
    return what, arguments, values


def _value(text: str) -> Any:
    """A Python literal, or the text itself."""
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text


# --- send, fetch -----------------------------------------------------------------------------------

def send(options: argparse.Namespace) -> int:
    from pathlib import Path

    name = options.name or Path(options.file).name
    return _move(options, f"sent     {options.file} as {name}",
                 lambda craft, progress: craft.put(options.file, name, class1=options.class1, progress=progress))


def fetch(options: argparse.Namespace) -> int:
    from pathlib import Path

    if options.file.endswith("/"):
        return _move(options, "", None)
    name = options.name or Path(options.file).name
    return _move(options, f"fetched  {options.file} as {name}",
                 lambda craft, progress: craft.fetch(options.file, name, class1=options.class1, progress=progress))


def _move(options: argparse.Namespace, done: str, begin: Callable[[Any, Callable[[Any], None]], Any] | None) -> int:
    """Begin a transfer, and wait for it; without `begin`, print a directory."""
    from fledge import ground
    from fledge.cli.arguments import parse_duration
    from fledge.cli.console import say
    from fledge.errors import Failure
    from fledge.ground.scripts.files import RATE, Files
    from fledge.progress import Bar

    if not re.fullmatch(r"\d{1,5},\d{1,5}", options.entities):
        raise Failure(f"--entities: expected two numbers from 0 to 65535, as in 1,2; found '{options.entities}'")
    own, peer = map(int, options.entities.split(","))
    within = parse_duration(options.within, "--within")
    with ground.connect(options.to, ground.dictionary_of(options.mission, options.process)) as craft:
        craft.files = Files(craft, rate=options.rate or RATE, own=own, peer=peer)
        if begin is None:
            for line in craft.directory(options.file.rstrip("/"), within):
                say(line)
            return 0
        with Bar(options.file) as bar:
            def draw(instance: Any) -> None:
                bar.at(instance.done / max(instance.size, 1), f"{instance.done} of {instance.size} bytes")

            start = craft.link.t
            screen = begin(craft, draw)
            try:
                screen.completed(within)
            except (ground.NoAnswer, KeyboardInterrupt):
                if not screen.problem:     # so that nothing of it stays on board
                    screen.cancel()
                    craft.listen(1.0)
                raise
        say(f"  {done}, {screen.size} bytes in {(craft.link.t - start) / 1e9:.3g} s")
    return 0


# --- link ------------------------------------------------------------------------------------------

def link(options: argparse.Namespace) -> int:
    import signal
    from threading import Event, Thread

    from fledge.cli.console import say
    from fledge.errors import Failure
    from fledge.ground.scripts.address import open_link
    from fledge.ground.scripts.member import Onlooker
    from fledge.interruption import handled

    forever = 1 << 62
    counts = {"commands": 0, "telemetry": 0}
    problems: list[str] = []
    ended = Event()     # by `fledge up`, which does not wait for a program that is slow to see the end of the run
    with open_link(options.address) as outside, Onlooker(options.process, radio=options.radio) as flight, \
            handled([signal.SIGTERM], lambda *_: ended.set()):
        say(f"{options.process} is at {options.address}")

        def down() -> None:
            """Telemetry to the foreign tool, to the end of the run."""
            try:
                while True:
                    for packet in flight.receive(forever):
                        outside.send(packet.packet)
                        counts["telemetry"] += 1
            except OSError as error:
                problems.append(str(error))

        thread = Thread(target=down, daemon=True)
        thread.start()
        try:
            while thread.is_alive() and not ended.is_set():
                for packet in outside.receive(outside.t + 200_000_000):
                    flight.send(packet.packet)
                    counts["commands"] += 1
        except OSError as error:
            problems.append(str(error))
    lost = f"; {outside.dropped} for slow readers were dropped" if outside.dropped else ""
    lost += f"; {flight.dropped} messages were missed" if flight.dropped else ""
    lost += f"; {outside.skipped} bytes were no packet" if outside.skipped else ""
    say(f"  carried  {counts['commands']} commands, {counts['telemetry']} packets of telemetry{lost}")
    if problems and problems[0] != "the run is over":
        raise Failure(f"link: {problems[0]}", 1)
    return 0
