# SPDX-License-Identifier: Apache-2.0
"""`./fledge packets FILE`: the packets of a file, one by one, with every field by a database.

Exit codes as of all commands: 0 read to its end; 1 parts of the file are no packets, or a packet has values missing;
2 the command line, the file or the database is wrong.
"""
from __future__ import annotations

import json

from fledge.cli.console import complain
from fledge.errors import Failure, field, for_json, printable

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable
    from typing import Any

    from _ground import Packet
    from fledge.ground import Database
    from fledge.ground.captures import Piece, Unit

    Show = Callable[[Piece, Packet | None, Unit | None, Packet | None], None]   # prints a packet, and the unit it ends


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("packets", packets, "packets received.pcap --database craft.xml")
    sub.set_defaults(needs=lambda _: ["build ground"])
    sub.add_argument("file", metavar="FILE", help="a capture (pcap, pcapng), the record of a "
                     "co-simulation's exchange, or packets one behind the other")
    sub.add_argument("--database", metavar="XTCE", action="append", default=[],
                     help="what the packets are; several files may refer to one another. Without it, headers alone")
    sub.add_argument("--lenient", action="store_true", help="leave out what is wrong in the database, and what refers "
                     "to it, and say what that is")
    sub.add_argument("--root", metavar="CONTAINER", help="the container that all packets extend; default: any that "
                     "extends nothing")
    sub.add_argument("--skip", metavar="N", type=int, default=0, help="bytes in front of each packet, or of each frame")
    sub.add_argument("--frames", metavar="N", type=int, default=0, help="the file is of TM or AOS frames of N bytes")
    sub.add_argument("--trailer", metavar="N", type=int, default=0, help="bytes behind each frame, passed over")
    sub.add_argument("--reed-solomon", metavar="DEPTH", type=int, default=0, help="each frame has its code behind it, "
                     "32 bytes for each of DEPTH interleaved code words: up to 16 wrong ones of each are corrected")
    sub.add_argument("--randomized", action="store_true", help="frames, with their code, are randomised (131.0-B)")
    sub.add_argument("--insert", metavar="N", type=int, default=0, help="bytes of the insert zone of AOS frames")
    sub.add_argument("--control", action="store_true", help="AOS frames have an operational control field")
    sub.add_argument("--secondary", metavar="N", type=int, default=0, help="bytes of the secondary header of packets "
                     "that are parts of a longer unit of data, which has that of the first alone")
    kind = sub.add_mutually_exclusive_group()
    kind.add_argument("--csv", action="store_true", help="a line for each field")
    kind.add_argument("--json", action="store_true", help="a line for each packet")


def packets(options: argparse.Namespace) -> int:
    from fledge.ground.captures import Format, Joiner, encapsulated, read

    if options.secondary < 0:
        raise Failure(f"packets: --secondary is a number from 0 on, not {options.secondary}")
    how = Format(*(getattr(options, name) for name in Format._fields))
    for name, value in zip(how._fields, how):
        option = "--" + name.replace("_", "-")
        if value < 0:
            raise Failure(f"packets: {option} is a number from 0 on, not {value}")
        if value and not how.frames and name != "skip":
            raise Failure(f"packets: {option} is for frames: --frames N says how many bytes one has")
    database = None
    if options.database:
        from fledge.ground import Database

        database = Database.load(*options.database, lenient=options.lenient)
        for reason in database.left_out:
            complain(reason)
    write = _csv if options.csv else _json if options.json else _text
    show = write(database)
    good = True
    joiner, lacking = Joiner(options.secondary), set()      # lacking: places of packets with values missing
    for piece in read(options.file, how):
        if not piece.packet:
            good = good and not piece.problem
            where = f", byte {piece.at}" if piece.problem else ""
            complain(f"{options.file}{where}: {piece.problem or piece.note}")
            continue
        packet = database.decode(piece.packet, options.root) if database and not encapsulated(piece.packet) else None
        good = good and not piece.note
        unit = joiner.take(piece)
        whole = database.decode(unit.packet, options.root) if database and unit and unit.packet else None
        if packet and packet.reason:
            lacking.add((piece.time, piece.at))
        if unit and whole and not whole.reason:      # the database describes units, and not their parts
            lacking -= {(part.time, part.at) for part in unit.parts}
        show(piece, packet, unit, whole)
    if note := joiner.note():
        complain(f"{options.file}: {note}")
    return 0 if good and not lacking else 1


PARTS = "middle", "first", "last"       # of a unit of data


def _of_unit(unit: Unit, packet: Packet | None) -> dict[str, Any]:
    """What is known of a unit of data before its fields."""
    first = unit.parts[0]
    about = _about(first, packet) | {"parts": len(unit.parts), "bytes": len(unit.packet)}
    del about["part"]
    return about | ({"reason": unit.problem} if unit.problem else {})


def _about(piece: Piece, packet: Packet | None) -> dict[str, Any]:
    """What is known of a packet before its fields."""
    from fledge.ground.captures import WHOLE, encapsulated, header

    head = header(piece.packet)
    about = {"byte": piece.at, "time": piece.time, "kind": "command" if head and head.command else "telemetry"}
    if head:
        about |= {"application": head.application, "count": head.sequence}
        if head.part != WHOLE:
            about["part"] = PARTS[head.part]
    else:
        about |= {"kind": "encapsulation", "protocol": encapsulated(piece.packet)}
    about["bytes"] = len(piece.packet)
    reasons = [text for text in (piece.note, packet.reason if packet else "") if text]
    return {key: value for key, value in about.items() if value is not None} | (
        {"container": packet.container} if packet else {}) | (
        {"reason": "; ".join(reasons) or None} if packet or reasons else {})


def _plain(value: Any) -> Any:
    return value.hex() if isinstance(value, bytes) else value


def _text(database: Database | None) -> Show:
    from fledge.ground.database import TIMES, time_text

    def line(text: str) -> None:
        print(printable(text, lines=False))     # a value does not look like another line

    def show(piece: Piece, packet: Packet | None, unit: Unit | None, whole: Packet | None) -> None:
        about = _about(piece, packet)
        when = f", {about['time'] // 10**9}.{about['time'] % 10**9:09} s" if "time" in about else ""
        which = f"protocol {about['protocol']}" if "protocol" in about else \
            f"application {about['application']}, count {about['count']}" + (
                f", {about['part']} part" if "part" in about else "")
        line(f"byte {piece.at}{when}: {about['kind']}, {which}, {about['bytes']} bytes"
             + (f", {packet.container or 'not decoded'}" if packet else ""))
        fields(about, packet)
        if unit:
            about = _of_unit(unit, whole)
            line(f"  = unit of {about['parts']} parts from byte {about['byte']} on, {about['bytes']} bytes"
                 + (f", {whole.container or 'not decoded'}" if whole else ""))
            fields(about, whole)

    def fields(about: dict[str, Any], packet: Packet | None) -> None:
        if about.get("reason"):
            line(f"  ! {about['reason']}")
        width = min(max((len(name) for name, _, _ in packet.rows), default=0), 80) if packet else 0
        for (name, raw, value), (kind, unit) in zip(packet.rows, packet.fields) if packet else ():
            shown = "no value" if value is None else str(_plain(value))
            if kind in TIMES and isinstance(value, int):
                shown = time_text(kind, value)
            beside = f"  (raw {_plain(raw)})" if value is None or (raw != value and str(raw) != str(value)) else ""
            line(f"  {name:{width}}  {shown}{' ' + unit if unit and kind != 'time' else ''}{beside}")

    return show


def _csv(database: Database | None) -> Show:
    def line(*row: Any) -> None:
        print(",".join("" if cell is None else field(cell) if isinstance(cell, str) else str(cell) for cell in row))

    line("byte", "application", "count", "container", "field", "value", "raw", "kind", "reason")

    def show(piece: Piece, packet: Packet | None, unit: Unit | None, whole: Packet | None) -> None:
        rows(_about(piece, packet), packet)
        if unit:
            rows(_of_unit(unit, whole), whole)

    def rows(about: dict[str, Any], packet: Packet | None) -> None:
        head = [about.get(key) for key in ("byte", "application", "count")]
        kind = f"encapsulation {about['protocol']}" if "protocol" in about else \
            f"{about['kind']} {about['part']} part" if "part" in about else \
            f"{about['kind']} unit of {about['parts']} parts" if "parts" in about else about["kind"]
        end = [kind, about.get("reason")]
        of = packet.container if packet else None
        for name, raw, value in packet.rows if packet else ():
            line(*head, of, name, _plain(value), _plain(raw), *end)
        if not packet or not packet.rows:
            line(*head, packet.container if packet else "", "", "", "", *end)

    return show


def _word(number: float) -> str:
    """Of a number that is not finite: the texts are those of Protocol Buffers, as in Yamcs."""
    return "NaN" if number != number else "Infinity" if number > 0 else "-Infinity"


def _json(database: Database | None) -> Show:
    def values(packet: Packet | None) -> dict[str, Any]:
        return {"values": packet.values, "raw": packet.raw} if packet else {}

    def show(piece: Piece, packet: Packet | None, unit: Unit | None, whole: Packet | None) -> None:
        joined = {"unit": _of_unit(unit, whole) | values(whole)} if unit else {}
        text = json.dumps(for_json(_about(piece, packet) | values(packet) | joined, _word), default=_plain)
        print(text.replace("\x7f", "\\u007f"))     # the one control character that JSON leaves

    return show
