# SPDX-License-Identifier: Apache-2.0
"""`fledge replay EXCHANGE NODE -- COMMAND`: one node again, with the record of the others.

Exit codes: 0 it wrote the same bits; 1 it did not, or the run ended early; 2 the command line or the record is
wrong; 130 Ctrl-C.
"""
from __future__ import annotations

from pathlib import Path

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("replay", replay, "replay runs/nadir_spin/exchange.mcap flight -- ./fledge node nadir_spin flight")
    sub.set_defaults(needs=lambda _: ["build cosim"])
    sub.add_argument("exchange", metavar="EXCHANGE", help="an exchange.mcap, as fledge up and "
                     "fledge_controller --record write it, or its folder")
    sub.add_argument("node", metavar="NODE", help="the node that runs again")
    sub.add_argument("--until", metavar="DURATION", help="only until then (90s, 10min, 2h); default: the end "
                     "of the complete part of the record")
    sub.add_argument("--out", metavar="FILE", help="the archive of the replay; default: replay_NODE.mcap beside the "
                     "record")
    sub.add_argument("--address", metavar="A", help="where the node greets; default: an abstract socket")
    sub.add_argument("--keys", metavar="PATH", help="the controller's keys (fledge keys)")
    sub.add_argument("--patience", type=float, default=60.0, metavar="S",
                     help="how long to wait for the node; default: 60")
    sub.add_argument("--reply", type=float, default=60.0, metavar="S", help="how long to wait for its replies; 0: for "
                     "ever, as for a debugger; default: 60")
    sub.description += " COMMAND starts the node; without it, start the node by hand, for example in a debugger."
    sub.usage = sub.format_usage().removeprefix("usage: ").rstrip() + " [-- COMMAND ...]"
    sub.set_defaults(starts_command=True)


def replay(options: argparse.Namespace) -> int:
    from fledge.cli.console import say, size_of
    from fledge.errors import Failure
    from fledge.archive import ArchiveError
    from fledge.cli.arguments import parse_duration
    from fledge.cosim.replay import Exchange
    from fledge.cosim.replay import replay as run

    path = Path(options.exchange)
    if path.is_dir():
        path = path / "exchange.mcap"
    command = options.after_dashes
    until = None if options.until is None else parse_duration(options.until, "--until")
    out = Path(options.out) if options.out else path.with_name(f"replay_{options.node}.mcap")
    if out.resolve() == path.resolve():
        raise Failure(f"--out {out} would overwrite the record")
    try:
        exchange = Exchange(path)
    except ArchiveError as error:
        raise Failure(str(error)) from None
    others = [name for name in exchange.nodes if name != options.node]
    say(f"{exchange.simulation}: {options.node} again, with the record of {', '.join(others) or 'no other node'}")
    if exchange.limited:
        say(f"  until    {exchange.known / 1e9:g} s: {exchange.limited}")

    def listening(address: str) -> None:
        if not command:
            say(f"  waiting  start the node now, with FLEDGE_ADDRESS={address} FLEDGE_NODE={options.node}"
                f" FLEDGE_SIMULATION={exchange.simulation}")

    try:
        again = run(exchange, options.node, command or None, out=out, address=options.address, keys=options.keys,
                    until=None if until is None else round(until * 1e9), timeout=options.patience,
                    reply=options.reply, listening=listening)
    except OSError as error:
        raise Failure(f"cannot start {command[0] if command else options.node}: {error.strerror or error}") from None
    if again.record:
        say(f"  record   {again.record} ({size_of(again.record)})")
    for difference in again.differences:
        say(f"  differs  {difference}")
    if again.outcome:
        raise Failure(f"{exchange.simulation}: the replay ended early: {again.outcome}", 1)
    if not again.differences:
        say(f"  the same {len(again.topics)} topic{'s' * (len(again.topics) != 1)}, {again.messages} messages, until "
            f"{again.until / 1e9:g} s")
    return 1 if again.differences else 0
