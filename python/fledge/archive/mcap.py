# SPDX-License-Identifier: Apache-2.0
"""The container: finds every message in the bytes of an MCAP file (https://mcap.dev/spec).

Scan reads the file from its beginning, with or without a summary: one way for whole, truncated and unindexed
files, which checks every checksum. It stops at the first fault. The messages before it stay readable, and
`problem` names the fault, its byte, and the data that are still good.

Scan reads only the bytes that separate messages, one step per message. numpy decodes the requested topics later.
"""

from __future__ import annotations

import os
import struct
import zlib
from array import array

from fledge.archive import rosmsg

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import mmap
    from collections.abc import Callable
    from typing import Any

    Data = bytes | mmap.mmap    # of a file, or of a record of it

MAGIC = b"\x89MCAP0\r\n"
(HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT, ATTACHMENT_INDEX, STATISTICS,
 METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END) = range(1, 16)
NAMES = dict(enumerate("Header Footer Schema Channel Message Chunk MessageIndex ChunkIndex Attachment AttachmentIndex "
                       "Statistics Metadata MetadataIndex SummaryOffset DataEnd".split(), 1))
IN_DATA = {SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, ATTACHMENT, METADATA, DATA_END}
IN_SUMMARY = {SCHEMA, CHANNEL, CHUNK_INDEX, ATTACHMENT_INDEX, STATISTICS, METADATA_INDEX, SUMMARY_OFFSET, FOOTER}

# Offsets within a Message record: log_time, the CDR header, the message struct.
TIME_AT, CDR_AT, PAYLOAD_AT = 15, 31, 35

_PREFIX = 9
_CHUNK_HEAD, _COMPRESSION_AT = 49, 37   # of a chunk that is not compressed
_prefix = struct.Struct("<BQ").unpack_from
_message = struct.Struct("<BQHIQ").unpack_from  # up to log_time


class Damage(Exception):
    """A fault at a byte of the file."""

    def __init__(self, offset: int, what: str) -> None:
        super().__init__(what)
        self.offset = offset
        self.what = what


class Unsupported(Exception):
    """The file is whole, but uses a feature that Fledge cannot read."""


class RawChannel:
    """A Channel record, its Schema, and where its messages are."""

    def __init__(self, key: tuple[Any, ...], topic: str, schema: tuple[str, str, str], encoding: str,
                 metadata: dict[str, str]) -> None:
        self.key = key            # equal for identical records
        self.topic = topic
        self.schema_name, self.schema_encoding, self.schema_text = schema
        self.encoding = encoding
        self.metadata = metadata
        self.offsets = array("Q")  # of its Message records in the file
        self.struct: rosmsg.Struct | None = None
        self.why_not: str | None = None
        try:
            self.struct = self._parse()
        except rosmsg.DefinitionError as error:
            self.why_not = str(error)
        # The length that every Message record of a fixed-size type must state.
        self.length = self.struct and PAYLOAD_AT - _PREFIX + self.struct.size

    def _parse(self) -> rosmsg.Struct:
        if (self.schema_encoding, self.encoding) != ("ros2msg", "cdr"):
            raise rosmsg.DefinitionError(
                f'schema encoding "{self.schema_encoding}" and message encoding "{self.encoding}"; '
                'only "ros2msg" and "cdr" are read')
        return rosmsg.parse(self.schema_text)


class _Fields:
    """The fields of one record, in order."""

    def __init__(self, data: Data, start: int, begin: int, end: int) -> None:
        self.data, self.start, self.at, self.end = data, start, begin, end

    def take(self, n: int) -> bytes:
        if n > self.end - self.at:
            raise Damage(self.start, "a field reaches beyond its record")
        self.at += n
        return self.data[self.at - n:self.at]

    def number(self, n: int) -> int:
        return int.from_bytes(self.take(n), "little")

    def text(self) -> str:
        try:
            return bytes(self.take(self.number(4))).decode()
        except UnicodeDecodeError:
            raise Damage(self.start, "a text is not UTF-8") from None

    def pairs(self, key: Callable[[_Fields], Any] = text, value: Callable[[_Fields], Any] = text) -> dict[Any, Any]:
        size = self.number(4)
        inner = _Fields(self.data, self.start, self.at, self.at + len(self.take(size)))
        found = {}
        while inner.at < inner.end:
            name = key(inner)
            found[name] = value(inner)
        return found


def metadata(path: str | os.PathLike[str]) -> dict[str, dict[str, str]]:
    """The metadata of a file, as Scan has them, without its messages: only the heads of chunks are read. It ends at the
    first fault."""
    found: dict[str, dict[str, str]] = {}
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        at = file.seek(len(MAGIC))
        while len(head := file.read(_PREFIX)) == _PREFIX:
            op, length = _prefix(head)
            if length > size - at:
                break
            if op == METADATA:
                data = file.read(length)
                try:
                    fields = _Fields(data, at, 0, len(data))
                    name, pairs = fields.text(), fields.pairs()
                except Damage:
                    break
                found.setdefault(name, {}).update(pairs)
            elif op == DATA_END:
                break
            at = file.seek(at + _PREFIX + length)
    return found


class Scan:
    """The contents of a file.

    channels: id -> RawChannel; metadata: name -> {key: value}; problem: None, or the fault in words;
    problem_at: its byte; t_good: [ns] the time before which all messages are present and right, or None if unknown.
    """

    def __init__(self, data: Data) -> None:
        self.data = data
        self.size = len(data)
        self.channels: dict[int, RawChannel] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.profile = self.library = ""
        self.problem: str | None = None
        self.problem_at: int | None = None
        self.t_good: int | None = None
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._statistics: dict[int, int] | None = None
        self._t_last: int | None = None
        self._loose = False         # messages outside of chunks: no checksum of their own
        self._cut = False           # the file ends within a chunk, whose checksum is then of no use
        self._passed_over = False   # some records were not, or not wholly, decoded
        self._data_end_at: int | None = None        # the DataEnd record, once it is reached
        self._data_is_right: bool | None = None     # whether its checksum is right; None: it has none
        try:
            self._summary(self._data_section(len(MAGIC)))
        except Damage as damage:
            self.problem, self.problem_at = damage.what, damage.offset
        self._judge()

    @property
    def count(self) -> int:
        return sum(len(c.offsets) for c in self.channels.values())

    def _judge(self) -> None:
        """Set t_good, and add to `problem` which data are good."""
        self.t_good = self._t_last
        if self._data_is_right is False:
            if self.problem is None:
                self.problem = "the checksum of the data section is wrong"
                self.problem_at = self._data_end_at
            if self._loose or self._statistics != self._counts():
                self.t_good = None
                self.problem += "; the damaged record is unknown, any value may be wrong"
            else:
                self.problem += "; all messages are there and agree with their chunks' checksums"
        elif self.problem and self._passed_over and self._data_is_right is None:
            self.t_good = None
            self.problem += "; records before it were passed over, which may have held messages"
        elif self.problem and self._data_end_at is not None:
            self.problem += "; all messages are there"
        elif self.problem and self._cut:
            self.problem += "; the messages that are there of this chunk were read without a checksum"
        elif self.problem and self._loose:
            self.problem += "; the messages before it have no checksum of their own"

    def _counts(self) -> dict[int, int]:
        return {id: len(c.offsets) for id, c in self.channels.items()}

    # ---- records ----

    def _record(self, at: int, end: int) -> tuple[int, int, int]:
        """Operation code, beginning and end of the content of the record at a byte."""
        if end - at < _PREFIX:
            raise Damage(at, f"the file ends within a record ({end - at} bytes of it are there)"
                         if end == self.size else "a record reaches beyond its chunk")
        op, length = _prefix(self.data, at)
        if length > end - at - _PREFIX:
            name = NAMES.get(op, f"0x{op:02x}")
            there = end - at - _PREFIX
            raise Damage(at, f"the {name} record states {length} bytes, {there} are there")
        return op, at + _PREFIX, at + _PREFIX + length

    def _data_section(self, at: int) -> int:
        op, begin, end = self._record(at, self.size)
        if op != HEADER:
            raise Damage(at, f"expected the Header, found record 0x{op:02x}")
        fields = _Fields(self.data, at, begin, end)
        self.profile, self.library = fields.text(), fields.text()
        at = self._contents(end, self.size, in_chunk=False)
        _, begin, end = self._record(at, self.size)
        crc = _Fields(self.data, at, begin, end).number(4)
        self._data_end_at = at
        if crc:
            self._data_is_right = crc == self._crc(0, at)
        return end

    def _crc(self, begin: int, end: int) -> int:
        with memoryview(self.data) as view, view[begin:end] as part:
            return zlib.crc32(part)

    def _contents(self, at: int, end: int, in_chunk: bool) -> int:
        """Read the records of a chunk to its end, or of the data section to its DataEnd."""
        data, channels = self.data, self.channels
        t_last = -1
        try:
            while at < end:
                # The fast path for messages, which are nearly all records.
                if end - at >= CDR_AT:
                    op, length, id, _, t = _message(data, at)
                    if op == MESSAGE and CDR_AT - _PREFIX <= length <= end - at - _PREFIX:
                        channel = channels.get(id)
                        if channel is None:
                            raise Damage(at, f"a message of channel {id}, which is not declared")
                        if length != channel.length and channel.length is not None:
                            raise Damage(at, f"a message on {channel.topic} has {length} bytes, "
                                         f"by its definition it has {channel.length}")
                        channel.offsets.append(at)
                        if t > t_last:
                            t_last = t
                        at += _PREFIX + length
                        continue
                try:
                    op, begin, stop = self._record(at, end)
                except Damage:
                    if not in_chunk:
                        self._cut_chunk(at)
                    raise
                if op == DATA_END and not in_chunk:
                    return at
                self._other(op, at, begin, stop, in_chunk)
                at = stop
        finally:
            if t_last >= 0:
                self._t_last = max(t_last, self._t_last or 0)
                self._loose = self._loose or not in_chunk
        if not in_chunk:
            raise Damage(at, "the file ends before its DataEnd record")
        return at

    def _other(self, op: int, at: int, begin: int, end: int, in_chunk: bool) -> None:
        fields = _Fields(self.data, at, begin, end)
        if op == SCHEMA:
            self._schema(fields)
        elif op == CHANNEL:
            self._channel(fields)
        elif op == CHUNK and not in_chunk:
            self._chunk(fields)
        elif op == MESSAGE:
            raise Damage(at, "a Message record shorter than its head")
        elif op == METADATA and not in_chunk:
            name = fields.text()
            self.metadata.setdefault(name, {}).update(fields.pairs())
        elif op == MESSAGE_INDEX and not in_chunk:
            fields.number(2)
            fields.take(fields.number(4))
        elif in_chunk or (op not in IN_DATA and op < 0x80):
            raise Damage(at, f"record {NAMES.get(op, f'0x{op:02x}')} has no place here")
        # Attachments, private records and fields of a later MCAP are harmless, unless damage turned another record
        # into one.
        self._passed_over = self._passed_over or fields.at != end

    def _schema(self, fields: _Fields) -> None:
        id = fields.number(2)
        schema = (fields.text(), fields.text(), fields.text())
        if self._data_end_at is not None and id not in self._schemas:
            raise Damage(fields.start, f"schema {id} is declared in the summary alone")
        if self._schemas.setdefault(id, schema) != schema:
            raise Damage(fields.start, f"schema {id} is declared twice, differently")

    def _channel(self, fields: _Fields) -> None:
        id, schema = fields.number(2), fields.number(2)
        if schema and schema not in self._schemas:
            raise Damage(fields.start, f"channel {id} has schema {schema}, which is not declared")
        topic, encoding, metadata = fields.text(), fields.text(), fields.pairs()
        key = (schema, topic, encoding, metadata)
        if self._data_end_at is not None and id not in self.channels:
            raise Damage(fields.start, f"channel {id} is declared in the summary alone")
        if id not in self.channels:
            definition = self._schemas.get(schema, ("", "", ""))
            self.channels[id] = RawChannel(key, topic, definition, encoding, metadata)
        elif self.channels[id].key != key:
            raise Damage(fields.start, f"channel {id} is declared twice, differently")

    def _chunk(self, fields: _Fields) -> None:
        fields.take(16)  # earliest and latest time
        size, crc, compression = fields.number(8), fields.number(4), fields.text()
        if compression in ("lz4", "zstd"):
            raise Unsupported(f"its chunks are compressed ({compression}), which is not read here")
        if compression:
            raise Damage(fields.start, f'the chunk states an unknown compression, "{compression}"')
        length = fields.number(8)
        begin = fields.at
        if length != size or length != fields.end - begin:
            raise Damage(fields.start, "the lengths that the Chunk record states do not agree")
        fields.at = fields.end
        found = self._crc(begin, fields.end)
        if crc and crc != found:
            raise Damage(fields.start, f"the checksum of this chunk is 0x{found:08x}, "
                         f"0x{crc:08x} was written")
        self._contents(begin, fields.end, in_chunk=True)

    def _cut_chunk(self, at: int) -> None:
        """Read what is there of a chunk in which the file ends."""
        if self.size - at >= _CHUNK_HEAD and _prefix(self.data, at)[0] == CHUNK and not any(
                self.data[at + _COMPRESSION_AT:at + _COMPRESSION_AT + 4]):
            before = self.count
            try:
                self._contents(at + _CHUNK_HEAD, self.size, in_chunk=True)
            except Damage:
                pass        # the end of the file, which the caller names
            self._cut = self.count > before

    def _summary(self, start: int) -> None:
        at = start
        while True:
            op, begin, end = self._record(at, self.size)
            fields = _Fields(self.data, at, begin, end)
            if op == SCHEMA:
                self._schema(fields)
            elif op == CHANNEL:
                self._channel(fields)
            elif op == STATISTICS:
                self._read_statistics(fields)
            elif op == FOOTER:
                break
            elif op not in IN_SUMMARY and op < 0x80:
                raise Damage(at, f"record {NAMES.get(op, f'0x{op:02x}')} has no place in a summary")
            at = end
        stated, _, crc = fields.number(8), fields.number(8), fields.number(4)
        if fields.at != end or stated != (start if at > start else 0):
            raise Damage(at, "the Footer does not fit the file")
        if crc and crc != self._crc(start, end - 4):
            raise Damage(at, "the checksum of the summary is wrong")
        if self.data[end:] != MAGIC:
            raise Damage(end, "expected the closing magic bytes and then the end of the file")
        if self._statistics is not None and self._statistics != self._counts():
            raise Damage(start, f"the Statistics count {sum(self._statistics.values())} messages, "
                         f"{self.count} were found")

    def _read_statistics(self, fields: _Fields) -> None:
        total = fields.number(8)
        fields.take(2 + 4 * 4 + 2 * 8)
        found = fields.pairs(lambda f: f.number(2), lambda f: f.number(8))
        if found:
            # Other writers leave out channels without messages.
            self._statistics = {id: 0 for id in self.channels} | found
            if total != sum(found.values()):
                raise Damage(fields.start, "the counts of the Statistics do not add up")
