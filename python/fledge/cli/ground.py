# SPDX-License-Identifier: Apache-2.0
"""What a person on the ground does by hand: `fledge command` makes or sends a command, `fledge link` lets foreign tools
command a flight computer of a co-simulation.

Exit codes: 0 all went well; 1 the spacecraft refused a command or did not answer, or a link broke; 2 the command line,
the mission or the address is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import ast
import re

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any
    import argparse


def add(command: Callable) -> None:
    """Add the subcommands, by the function of cli.parser() that adds one."""
    one = command("command", command_, "write or send a command to flight",
                  "command nadir_spin flight.control K=3")
    one.add_argument("mission", help="the name of a mission, or its folder, or MISSION_packets.json of an export")
    one.add_argument("what", nargs="+", metavar="WORD", help="a module and its parameters, as in flight.control K=3; "
                     "or a command and its arguments, as in `mode science`, `arm EVENT off`, `noop`")
    one.add_argument("--process", metavar="NAME", help="the flight process, if the mission has several")
    one.add_argument("--to", metavar="ADDRESS", help="send it, and wait for its execution: "
                     "udp://HOST:PORT?listen=PORT, tcp://HOST:PORT, listen://PORT, serial:DEVICE?baud=N; without, "
                     "print its packets in hexadecimal, a line each")
    one.add_argument("--within", default="10s", metavar="DURATION", help="how long to wait; default: 10s")
    one.add_argument("--sequence", type=int, default=0, metavar="N", help="of the first packet; default: 0")

    one = command("link", link, "let foreign tools command a flight computer of a co-simulation",
                  "link flight listen://127.0.0.1:10025")
    one.description += (" It is an [[asynchronous]] program of a co-simulation's file (docs/ground.md), and carries "
                        "packets both ways; the run does not wait for it.")
    one.add_argument("process", help="the flight process, whose target has queues of commands and telemetry")
    one.add_argument("address", metavar="ADDRESS", help="as of `fledge command`: where commands come from, and where "
                     "telemetry goes")


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
            say(f"  {report.t / 1e9:g} s  {'executed' if report.executed else 'accepted'}"
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


# --- link ------------------------------------------------------------------------------------------

def link(options: argparse.Namespace) -> int:
    from threading import Thread

    from fledge.cli.console import say
    from fledge.errors import Failure
    from fledge.ground.address import open_link
    from fledge.ground.member import Onlooker

    forever = 1 << 62
    counts = {"commands": 0, "telemetry": 0}
    problems: list[str] = []
    with open_link(options.address) as outside, Onlooker(options.process) as flight:
        say(f"{options.process} is at {options.address}")

        def down() -> None:
            """Telemetry to the foreign tool, to the end of the run."""
            try:
                while True:
                    for one in flight.receive(forever):
                        outside.send(one.packet)
                        counts["telemetry"] += 1
            except OSError as error:
                problems.append(str(error))

        thread = Thread(target=down, daemon=True)
        thread.start()
        try:
            while thread.is_alive():
                for one in outside.receive(outside.t + 200_000_000):
                    flight.send(one.packet)
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
