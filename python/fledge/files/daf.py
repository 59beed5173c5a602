# SPDX-License-Identifier: Apache-2.0
"""DAF, the container of SPICE's binary kernels: summaries of segments, and segments of 8-byte words.

    file = daf.read("craft.bc", "DAF/CK  ")
    file.segments[0].words

Source: NAIF, "DAF Required Reading"; the layout is in world/environment/spk.h.
"""
from __future__ import annotations

import os
import struct
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from fledge.disk import Part
from fledge.files import kvn

RECORD = 1024               # bytes
COMMENT = 1000              # characters of a record of comments
TRANSFER = b"FTPSTR:\r:\n:\r\n:\r\0:\x81:\x10\xce:ENDFTP"      # which a transfer as text damages
FRAMES = dict(enumerate((                                       # that do not turn, of states and attitudes
    "J2000 B1950 FK4 DE-118 DE-96 DE-102 DE-108 DE-111 DE-114 DE-122 DE-125 DE-130 GALACTIC DE-200 DE-202 MARSIAU "
    "ECLIPJ2000 ECLIPB1950 DE-140 DE-142 DE-143").split(), 1))


@dataclass
class Segment:
    """first, last: its times, as the kernel counts them; integers: of its summary, without its first and last word;
    words: (n,)."""
    first: float
    last: float
    integers: tuple[int, ...]
    name: str
    words: np.ndarray


@dataclass
class Daf:
    """kind: "DAF/SPK " or "DAF/CK  "; comments: the lines of the comment area."""
    kind: str
    segments: list[Segment]
    comments: list[str] = field(default_factory=list)
    where: str = "the kernel"

    def refuse(self, text: str) -> NoReturn:
        """Raise SetupError, with the file."""
        kvn.refuse_at(self.where, text)


def read(path: str | os.PathLike[str], kind: str) -> Daf:
    """The segments of a kernel of a kind, in either byte order. Raises SetupError with the file and what is wrong."""
    found = Daf(kind, [], where=os.fspath(path))
    try:
        with open(path, "rb") as file:
            data = file.read()
    except OSError as error:
        found.refuse(f"cannot be read: {error.strerror}")
    if data[:8].decode("latin-1") != kind:
        found.refuse(f"expected a kernel that begins with {kind!r}; found {data[:8].decode('latin-1')!r}")
    order = {b"LTL-IEEE": "<", b"BIG-IEEE": ">"}.get(data[88:96])
    if len(data) < RECORD or not order:
        found.refuse("is cut short, or its byte order is marked neither LTL-IEEE nor BIG-IEEE")
    doubles, integers = struct.unpack_from(order + "2i", data, 8)
    record, = struct.unpack_from(order + "i", data, 76)
    if (doubles, integers) != (2, 6):       # of SPK and CK alike
        found.refuse(f"is damaged: expected summaries of 2 doubles and 6 integers; found {doubles} and {integers}")
    comments = range(RECORD, min((record - 1) * RECORD, len(data)), RECORD)
    text = b"".join(data[at:at + COMMENT] for at in comments)
    found.comments = text.split(b"\x04")[0].decode("latin-1").split("\0")[:-1]
    words = np.frombuffer(data[:len(data) // 8 * 8], order + "f8").astype(float)
    visited: set[int] = set()
    while record:
        at = (record - 1) * RECORD
        if record < 1 or record in visited or at + 2 * RECORD > len(data):
            found.refuse(f"is damaged or cut short: summary record {record} is beyond its end or was met before")
        visited.add(record)
        following, _, count = struct.unpack_from(order + "3d", data, at)
        if not (0 <= following < 2**31 and 0 <= count <= 25 and following == int(following)):
            found.refuse(f"is damaged: summary record {record} says {count:g} summaries, and {following:g} as the next")
        for i in range(int(count)):
            first, last = struct.unpack_from(order + "2d", data, at + 24 + 40 * i)
            *numbers, begin, end = struct.unpack_from(order + "6i", data, at + 40 + 40 * i)
            named = at + RECORD + 40 * i
            name = data[named:named + 40].decode("ascii", "backslashreplace").strip(" \0")
            if not 1 <= begin <= end <= len(words):
                found.refuse(f"segment {len(found.segments) + 1}, {name}: is damaged or cut short: its summary gives "
                             f"it the words {begin} to {end}; the file has {len(words)}")
            found.segments.append(Segment(first, last, tuple(numbers), name, words[begin - 1:end]))
        record = int(following)
    return found


def write(path: str | os.PathLike[str], file: Daf) -> None:
    """Write a kernel, little-endian. Raises SetupError where a name or comment is none in ASCII."""
    text = "".join(line + "\0" for line in file.comments) + "\x04" if file.comments else ""
    try:
        comment = text.encode("ascii")
        names = [segment.name.encode("ascii") for segment in file.segments]
    except UnicodeEncodeError as error:
        file.refuse(f"expected names and comments in ASCII; found {error.object!r}")
    if any(len(name) > 40 for name in names):
        file.refuse(f"expected a segment's name of up to 40 characters; found {max(names, key=len).decode()!r}")
    parts = [comment[i:i + COMMENT].ljust(RECORD, b"\0") for i in range(0, len(comment), COMMENT)]
    first = len(parts) + 2
    groups = [range(i, min(i + 25, len(names))) for i in range(0, len(names), 25)]
    at = free = 128 * (first - 1) + 1               # the next word
    previous = 0                                    # summary record
    for i, group in enumerate(groups):
        record = (at - 1) // 128 + 1
        at += 256
        summaries, data = b"", b""
        for j in group:
            segment = file.segments[j]
            words = np.asarray(segment.words, "<f8")
            summaries += struct.pack(f"<2d{len(segment.integers) + 2}i", segment.first, segment.last,
                                     *segment.integers, at, at + len(words) - 1)
            data += words.tobytes()
            at += len(words)
        free = at
        at = (at + 126) // 128 * 128 + 1
        last = i == len(groups) - 1
        parts += [(struct.pack("<3d", 0 if last else (at - 1) // 128 + 1, previous, len(group)) + summaries)
                  .ljust(RECORD, b"\0"), b"".join(names[j].ljust(40) for j in group).ljust(RECORD),
                  data.ljust(-(-len(data) // RECORD) * RECORD, b"\0")]
        previous = record
    head = (file.kind.encode() + struct.pack("<2i", 2, 6) + b"Fledge".ljust(60)
            + struct.pack("<3i", first, previous, free) + b"LTL-IEEE").ljust(699, b"\0") + TRANSFER
    with Part(path) as part:
        part.write_bytes(head.ljust(RECORD, b"\0") + b"".join(parts))
