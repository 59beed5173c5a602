# SPDX-License-Identifier: Apache-2.0
"""More topics in an MCAP file: its bytes up to the end of its data, then theirs, and a new summary of both."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from typing import BinaryIO, NamedTuple

from fledge.archive import mcap
from fledge.errors import SetupError

CHUNK = 4_000_000       # [bytes]
DATA_END = struct.pack("<BQI", mcap.DATA_END, 4, 0)
FOOTER = 9 + 20 + len(mcap.MAGIC)       # [bytes] that end a file
COUNTS = "<QHIIIIQQ"                    # how Statistics begin


def append(data: bytes, topics: Mapping[str, tuple[str, str]], messages: Iterable[tuple[int, str, bytes]],
           out: BinaryIO) -> None:
    """Write a whole file with more topics into `out`.

    data: the file; topics: topic -> name and text of its definition, "ros2msg"; messages: (time [ns], topic, message as
    CDR) in the order of time, at least one. Raises SetupError if the file has no summary.
    """
    end, old = _summary(data)
    ids = [struct.unpack_from("<H", record, 9)[0] for record in old[mcap.SCHEMA] + old[mcap.CHANNEL]]
    channels = {topic: id for id, topic in enumerate(topics, max(ids, default=0) + 1)}
    heads = b"".join(
        _record(mcap.SCHEMA, struct.pack("<H", id), _text(name), _text("ros2msg"), _text(definition))
        + _record(mcap.CHANNEL, struct.pack("<HH", id, id), _text(topic), _text("cdr"), struct.pack("<I", 0))
        for (topic, id), (name, definition) in zip(channels.items(), topics.values()))
    out.write(data[:end])
    position, chunks, indices = end, [], []
    for chunk in _chunks(heads, channels, messages):
        written, index = chunk.written(position)
        out.write(written)
        position += len(written)
        chunks.append(chunk._replace(content=b""))
        indices.append(index)
    out.write(DATA_END)
    position += len(DATA_END)
    statistics = old[mcap.STATISTICS][0]
    n_chunks = struct.unpack_from(COUNTS, statistics, 9)[5]
    # Without an index of the record's own chunks, an index of the new ones would hide those.
    indexed = old[mcap.CHUNK_INDEX] + indices if old[mcap.CHUNK_INDEX] or not n_chunks else []
    summary = b"".join([*old[mcap.SCHEMA], *old[mcap.CHANNEL], heads, _statistics(statistics, chunks, channels),
                        *indexed, *old[mcap.METADATA_INDEX], struct.pack("<BQQQ", mcap.FOOTER, 20, position, 0)])
    out.write(summary + struct.pack("<I", zlib.crc32(summary)) + mcap.MAGIC)


def _record(op: int, *fields: bytes) -> bytes:
    content = b"".join(fields)
    return struct.pack("<BQ", op, len(content)) + content


def _text(text: str | bytes) -> bytes:
    data = text.encode() if isinstance(text, str) else text
    return struct.pack("<I", len(data)) + data


def _summary(data: bytes) -> tuple[int, dict[int, list[bytes]]]:
    """(where the DataEnd of a file is, its summary's records by their kinds)"""
    old: dict[int, list[bytes]] = {op: [] for op in (mcap.SCHEMA, mcap.CHANNEL, mcap.STATISTICS, mcap.CHUNK_INDEX,
                                                     mcap.METADATA_INDEX)}
    footer = len(data) - FOOTER
    begin, = struct.unpack_from("<Q", data, footer + 9)
    at = begin or footer
    end = at - len(DATA_END)
    while at < footer:
        op, length = struct.unpack_from("<BQ", data, at)
        if op in old:
            old[op].append(data[at:at + 9 + length])
        at += 9 + length
    if not old[mcap.STATISTICS] or data[end] != mcap.DATA_END:
        raise SetupError("the record has no summary")
    return end, old


class _Chunk(NamedTuple):
    """Messages, with the times [ns] and the places in the content of each channel's; first, last: [ns]"""
    content: bytes
    entries: dict[int, list[tuple[int, int]]]
    first: int
    last: int

    def written(self, position: int) -> tuple[bytes, bytes]:
        """The chunk and its MessageIndex records, for that place in the file, and its ChunkIndex."""
        size = struct.pack("<Q", len(self.content))
        packed = _record(mcap.CHUNK, struct.pack("<QQ", self.first, self.last), size,
                         struct.pack("<I", zlib.crc32(self.content)), _text(""), size, self.content)
        places, indices = [], b""
        for channel, rows in self.entries.items():
            places.append(struct.pack("<HQ", channel, position + len(packed) + len(indices)))
            listed = b"".join(struct.pack("<QQ", *row) for row in rows)
            indices += _record(mcap.MESSAGE_INDEX, struct.pack("<H", channel), _text(listed))
        return packed + indices, _record(
            mcap.CHUNK_INDEX, struct.pack("<QQQQ", self.first, self.last, position, len(packed)),
            _text(b"".join(places)), struct.pack("<Q", len(indices)), _text(""), size, size)


def _chunks(heads: bytes, channels: dict[str, int], messages: Iterable[tuple[int, str, bytes]]) -> Iterator[_Chunk]:
    entries: dict[int, list[tuple[int, int]]] = {}
    content, times, sequence = bytearray(heads), [], dict.fromkeys(channels.values(), 0)
    for t, topic, message in messages:
        channel = channels[topic]
        entries.setdefault(channel, []).append((t, len(content)))
        times.append(t)
        content += _record(mcap.MESSAGE, struct.pack("<HIQQ", channel, sequence[channel], t, t), message)
        sequence[channel] += 1
        if len(content) > CHUNK:
            yield _Chunk(bytes(content), entries, times[0], times[-1])
            content, entries, times = bytearray(), {}, []
    if times:
        yield _Chunk(bytes(content), entries, times[0], times[-1])


def _statistics(old: bytes, chunks: list[_Chunk], channels: dict[str, int]) -> bytes:
    """The Statistics of a file with these chunks more."""
    total, schemas, n, attachments, metadata, n_chunks, first, last = struct.unpack_from(COUNTS, old, 9)
    counts = {id: sum(len(chunk.entries.get(id, ())) for chunk in chunks) for id in channels.values()}
    begin = chunks[0].first
    return _record(
        mcap.STATISTICS, struct.pack(
            COUNTS, total + sum(counts.values()), schemas + len(channels), n + len(channels), attachments, metadata,
            n_chunks + len(chunks), min(first, begin) if total else begin, max(last, chunks[-1].last)),
        _text(old[9 + struct.calcsize(COUNTS) + 4:] + b"".join(struct.pack("<HQ", *item) for item in counts.items())))
