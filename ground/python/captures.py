# SPDX-License-Identifier: Apache-2.0
"""The packets of a file: a capture of a network, frames of telemetry, or packets one behind the other.

Captures are pcap and pcapng; each UDP datagram, or packet of a link that is a user's own, holds packets. So does each
message of a queue of packets in the record of a co-simulation's exchange. A file of the control room's archive has a
packet in each message.
"""
from __future__ import annotations

import os
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from fledge.errors import Failure

PROTOCOLS = ("idle", "LTP", "IPE", "CFDP", "BP", "protocol 5", "extended", "mission")   # in encapsulation packets
PCAP = {b"\xd4\xc3\xb2\xa1": ("<", 10**3), b"\xa1\xb2\xc3\xd4": (">", 10**3), b"\x4d\x3c\xb2\xa1": ("<", 1),
        b"\xa1\xb2\x3c\x4d": (">", 1)}      # byte order, and nanoseconds of a fraction
MIDDLE, FIRST, LAST, WHOLE = range(4)       # parts of a unit of data
PCAPNG = b"\x0a\x0d\x0d\x0a"
MCAP = b"\x89MCAP0\r\n"
ETHERNET, USER = 1, range(147, 163)                                             # kinds of links
IP_AT = {0: 4, 12: 0, 14: 0, 101: 0, 108: 4, 113: 16, 228: 0, 229: 0, 276: 20}      # [bytes] of others in front of IP


class Piece(NamedTuple):
    """A packet, or a problem with the file; without both, a note of what it had."""

    at: int                     # [bytes] into the file
    packet: bytes
    time: int | None = None     # [ns] since 1970, of a capture; of a record: simulated
    problem: str = ""
    note: str = ""              # of a packet: why it may be damaged


# (place, time, kind of link, bytes) of a packet of the network, or (place, None, None, problem).
Captured = tuple[int, int | None, int | None, Any]


class Format(NamedTuple):
    """How packets or frames stand in a file, ground/capture/frames.h. [bytes]"""

    skip: int = 0               # in front of each
    frames: int = 0             # of a frame; 0: the file is none of frames, and what follows is not used
    trailer: int = 0            # behind each frame
    reed_solomon: int = 0       # depth of the code behind each; 0: there is none
    insert: int = 0             # of the insert zone of AOS frames
    control: bool = False       # AOS frames have an operational control field
    randomized: bool = False


class Header(NamedTuple):
    """The header of a packet."""

    command: bool
    secondary: bool
    application: int
    part: int                   # of a unit of data: MIDDLE, FIRST, LAST or WHOLE
    sequence: int
    size: int                   # [bytes] of the whole packet


def header(packet: bytes, at: int = 0) -> Header | None:
    """The header of the packet that begins there; None: none does, or it has another version."""
    if len(packet) < at + 7 or packet[at] >> 5:
        return None
    first, second, length = struct.unpack_from(">HHH", packet, at)
    return Header(bool(first >> 12 & 1), bool(first >> 11 & 1), first & 0x7FF, second >> 14, second & 0x3FFF,
                  length + 7)


class Unit(NamedTuple):
    """A unit of data that came in several packets."""

    packet: bytes               # the first one, as if it were whole: with all the data
    parts: list[Piece]          # its packets, in their order
    problem: str = ""           # why there is no such packet


class Joiner:
    """Joins units of data of their parts, above the packets: those of an application may stand between those of
    others, and have counts that follow one another, or one count for all parts of a unit. A packet that comes again
    counts once.

    secondary: [bytes] of a secondary header, which a unit has of its first part alone
    """

    def __init__(self, secondary: int = 0) -> None:
        self._secondary = secondary
        self._open: dict[bytes, list[Piece]] = {}       # units that go on, by the first two bytes
        self._last: dict[bytes, bytes] = {}             # the last packet
        self._parts = self._units = self._joined = self._headed = 0

    def take(self, piece: Piece) -> Unit | None:
        """The unit that ends with a packet; None: none does."""
        head, key = header(piece.packet), piece.packet[:2]
        if head is None:
            return None
        before = self._open.pop(key, [])
        if head.part == WHOLE:
            return None
        counts = [found.sequence for part in before if (found := header(part.packet))]
        again = piece.packet == self._last.get(key) or any(part.packet == piece.packet for part in before)
        self._last[key] = piece.packet
        stays = len(counts) > 1 and counts[0] == counts[-1]     # the count; then parts may be equal
        if again and not stays:
            if before:
                self._open[key] = before
            return None
        self._parts += 1
        if head.part == FIRST:
            self._open[key] = [piece]
            return None
        same = counts and head.sequence == counts[-1] and (stays or len(counts) == 1)
        if not same and (stays or not counts or head.sequence != (counts[-1] + 1) % 0x4000):
            return None
        before.append(piece)
        if head.part == MIDDLE:
            self._open[key] = before
            return None
        self._units += 1
        self._joined += len(before)
        return self._unit(before)

    def note(self) -> str:
        """What became of the parts; empty: there were none."""
        if not self._parts:
            return ""
        return f"{self._parts} packets are parts of longer units of data; {self._units} units are whole, of " \
            f"{self._joined} parts" + (
                ", which have secondary headers: --secondary N leaves those behind a unit's first out" if self._headed
                else "")

    def _unit(self, parts: list[Piece]) -> Unit:
        first = parts[0].packet
        head = header(parts[1].packet)
        self._headed += bool(head and head.secondary and not self._secondary)
        skip = 6 + (self._secondary if head and head.secondary else 0)
        if min(len(part.packet) for part in parts[1:]) < skip:
            return Unit(b"", parts, f"a part of it is shorter than a secondary header of {self._secondary} bytes: it "
                        "is not decoded")
        data = first[6:] + b"".join(part.packet[skip:] for part in parts[1:])
        if len(data) > 1 << 16:
            return Unit(b"", parts, f"it has {len(data) + 6} bytes, more than the length of a packet can say: it is "
                        "not decoded")
        sequence = int.from_bytes(first[2:4], "big") | WHOLE << 14
        return Unit(first[:2] + struct.pack(">HH", sequence, len(data) - 1) + data, parts)


def encapsulated(packet: bytes) -> str | None:
    """The protocol in an encapsulation packet (133.1-B-3); None: it is a space packet."""
    if packet[0] >> 5 != 7:
        return None
    kind = packet[0] >> 2 & 7
    return f"extended {packet[1] & 15}" if kind == 6 and packet[0] & 2 else PROTOCOLS[kind]


def pieces(data: bytes, format: Format = Format()) -> Iterator[Piece]:
    """All packets of a file, in its order, and its problems. data: pcap, pcapng, packets one behind the other, or
    frames as the format says. Raises Failure for a format that cannot be."""
    skip = format.skip
    if format.frames:
        from fledge import _ground

        try:
            rows = _ground.packets_of_frames(data, format.frames, skip, *format[2:])
        except ValueError as wrong:
            raise Failure(f"packets: {wrong}") from None
        yield from (Piece(at, packet, None, problem, note) for at, packet, problem, note in rows)
    elif data[:4] in PCAP:
        yield from _datagrams(_pcap(data), skip)
    elif data[:4] == PCAPNG:
        yield from _datagrams(_pcapng(data), skip)
    else:
        yield from packets(data, skip)


def read(path: str | os.PathLike[str], format: Format = Format()) -> Iterator[Piece]:
    """The same of a file by its path, which may be the record of a co-simulation's exchange: it has the messages of
    queues of packets, in the order of their times."""
    data = Path(path).read_bytes()
    yield from _recorded(path, format.skip) if data[:8] == MCAP else pieces(data, format)


def _recorded(path: str | os.PathLike[str], skip: int) -> Iterator[Piece]:
    from fledge.archive import Archive

    record = Archive(path)
    rows: list[tuple] = []
    for topic, channel in record.topics.items():
        if channel.schema == "fledge/msg/GroundPacket":
            rows += map(_archived, channel.offsets, record.contents(topic))
        elif channel.problem is None and {"n", "bytes"} <= set(channel.fields):
            rows += zip(record.time_ns(topic).tolist(), channel.offsets, record[topic])
    for time, at, message in sorted(rows, key=lambda row: row[:2]):
        if isinstance(message, bytes):
            yield Piece(at, message, time, "" if message else "a message whose packet has another size than it states")
            continue
        yield from packets(message["bytes"].tobytes()[:int(message["n"])], skip, at, time)
    if record.problem or not rows:
        yield Piece(0, b"", None, record.problem or "a record without packets: fledge convert writes its values")


def _archived(at: int, content: bytes) -> tuple[int, int, bytes]:
    """(time, place, packet) of a message of the control room's archive, which has t, received, the packet's size and
    the packet; b"": its sizes do not agree."""
    time, _, n = struct.unpack_from("<qqI", content) if len(content) >= 20 else (0, 0, 0)
    return time, at + 35 + 20, content[20:] if len(content) == 20 + n else b""


def packets(data: bytes, skip: int = 0, base: int = 0, time: int | None = None) -> Iterator[Piece]:
    """Packets one behind the other, with what may stand between them, as ground/capture/packets.h finds them."""
    from fledge import _ground

    for at, packet, problem, note in _ground.packets_of_bytes(data, skip):
        yield Piece(base + at, packet, time, problem, note)


# --- captures --------------------------------------------------------------------------------------

def _pcap(data: bytes) -> Iterator[Captured]:
    """(place, time, kind of link, bytes) of each packet of the network, or (place, None, None, problem)."""
    order, tick = PCAP[data[:4]]
    if len(data) < 24:
        yield len(data), None, None, "the file ends within its header"
        return
    link = struct.unpack_from(order + "I", data, 20)[0] & 0xFFFF
    at = 24
    while at < len(data):
        if at + 16 > len(data):
            yield at, None, None, "the file ends within a header"
            return
        seconds, part, n, _ = struct.unpack_from(order + "4I", data, at)
        if at + 16 + n > len(data):
            yield at, None, None, f"the file ends within a packet of {n} bytes"
            return
        yield at + 16, seconds * 10**9 + part * tick, link, data[at + 16:at + 16 + n]
        at += 16 + n


def _pcapng(data: bytes) -> Iterator[Captured]:
    at, order = 0, "<"
    links: list[tuple[int, int, int]] = []      # kind, ticks of a second, [s] to add
    while at < len(data):
        if data[at:at + 4] == PCAPNG:
            order, links = (">" if data[at + 8:at + 12] == b"\x1a\x2b\x3c\x4d" else "<"), []
        if at + 12 > len(data):
            yield at, None, None, "the file ends within a block"
            return
        kind, n = struct.unpack_from(order + "2I", data, at)
        body = data[at + 8:at + n - 4]
        if n < 12 or n % 4 or at + n > len(data):
            yield at, None, None, f"the file ends within a block of {n} bytes"
            return
        if kind == 1 and len(body) >= 8:        # a description of an interface
            links.append((struct.unpack_from(order + "H", body)[0], *_clock(body[8:], order)))
        elif kind in (2, 6) and len(body) >= 20:     # a packet; 2: in the older form, which counts those dropped, too
            interface, high, low, size, _ = struct.unpack_from(order + ("H2x4I" if kind == 2 else "5I"), body)
            if interface < len(links) and 20 + size <= len(body):
                link, ticks, offset = links[interface]
                yield at + 28, (high << 32 | low) * 10**9 // ticks + offset * 10**9, link, body[20:20 + size]
            else:
                yield at, None, None, "a packet of an interface that is not described, or longer than its block"
        elif kind == 3 and len(body) >= 4 and links:    # a simple packet, without a time
            yield at + 12, None, links[0][0], body[4:4 + struct.unpack_from(order + "I", body)[0]]
        at += n


def _clock(options: bytes, order: str) -> tuple[int, int]:
    """Of an interface: ticks of a second, and [s] to add to its times."""
    at, ticks, offset = 0, 10**6, 0
    while at + 4 <= len(options):
        code, n = struct.unpack_from(order + "2H", options, at)
        if code == 9 and n == 1 and at + 4 < len(options):
            value = options[at + 4]
            ticks = 2 ** (value & 0x7F) if value & 0x80 else 10 ** value
        elif code == 14 and n == 8 and at + 12 <= len(options):
            offset, = struct.unpack_from(order + "q", options, at + 4)
        at += 4 + (n + 3) // 4 * 4
    return ticks, offset


def _datagrams(captured: Iterable[Captured], skip: int) -> Iterator[Piece]:
    other = 0
    unknown: dict[int, int] = {}
    for at, time, link, content in captured:
        if link is None:
            yield Piece(at, b"", None, content)
            continue
        if link not in IP_AT and link != ETHERNET and link not in USER:
            unknown[link] = unknown.get(link, 0) + 1
            continue
        place, payload = (0, content) if link in USER else _udp(content, link)
        if place is None:
            other += 1
        else:
            yield from packets(payload, skip, at + place, time)
    for link, n in unknown.items():
        yield Piece(0, b"", None, f"{n} packets of a network of kind {link} (LINKTYPE), which is not read: they are "
                    "left out")
    if other:
        yield Piece(0, b"", None, f"{other} packets of the network are no whole UDP datagrams: they are left out")


def _udp(frame: bytes, link: int) -> tuple[int | None, bytes]:
    """(place, bytes) of the payload of a datagram; place None: it is none, or a fragment."""
    if link == ETHERNET:
        at = 12
        while frame[at:at + 2] in (b"\x81\x00", b"\x88\xa8"):   # tags of virtual networks
            at += 4
        at = at + 2 if frame[at:at + 2] in (b"\x08\x00", b"\x86\xdd") else len(frame)
    else:
        at = IP_AT[link]
    ip = frame[at:]
    if len(ip) >= 28 and ip[0] >> 4 == 4 and ip[9] == 17 and not int.from_bytes(ip[6:8], "big") & 0x3FFF:
        head, end = 4 * (ip[0] & 15), int.from_bytes(ip[2:4], "big")
    elif len(ip) >= 48 and ip[0] >> 4 == 6 and ip[6] == 17:
        head, end = 40, 40 + int.from_bytes(ip[4:6], "big")
    else:
        return None, b""
    udp = ip[head:end]
    size = int.from_bytes(udp[4:6], "big")
    return (at + head + 8, udp[8:size]) if 8 <= size <= len(udp) else (None, b"")
