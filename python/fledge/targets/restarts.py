# SPDX-License-Identifier: Apache-2.0
"""The record of a computer that started several times: each start sent a record of its own, with the same channels,
which the next start cut off."""
from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from fledge.archive.mcap import DATA_END, FOOTER, MAGIC, MESSAGE

END = b"".join(struct.pack("<BQ", kind, size) + bytes(size) for kind, size in ((DATA_END, 4), (FOOTER, 20))) + MAGIC


def join_starts(record: Path) -> None:
    """Make one record of a file that has several, each from its magic on: the first one, and the messages of the
    others. A file with one record stays as it is."""
    starts = [part for part in record.read_bytes().split(MAGIC) if part]
    if len(starts) > 1:
        kept = [raw for i, start in enumerate(starts) for kind, raw in _records(start) if i == 0 or kind == MESSAGE]
        record.write_bytes(MAGIC + b"".join(kept) + END)


def _records(part: bytes) -> Iterator[tuple[int, bytes]]:
    """(kind, bytes) of each whole record of the data section."""
    at = 0
    while at + 9 <= len(part) and part[at] != DATA_END:
        kind, size = struct.unpack_from("<BQ", part, at)
        if at + 9 + size > len(part):
            break
        yield kind, part[at:at + 9 + size]
        at += 9 + size
