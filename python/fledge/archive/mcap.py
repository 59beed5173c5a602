# SPDX-License-Identifier: Apache-2.0
"""The container: finds the messages in the bytes of an MCAP file, by record/mcap_reader.h. numpy decodes them later."""

from __future__ import annotations

import mmap
import os
from array import array
from typing import TYPE_CHECKING

from fledge import _core
from fledge.archive import rosmsg

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

MAGIC = b"\x89MCAP0\r\n"
(HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT, ATTACHMENT_INDEX, STATISTICS,
 METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END) = range(1, 16)

# Offsets within a Message record: its content, log_time, the CDR header, the message struct.
CONTENT_AT, TIME_AT, CDR_AT, PAYLOAD_AT = 9, 15, 31, 35


class Unsupported(Exception):
    """The file is whole, but uses a feature that Fledge cannot read."""


class RawChannel:
    """A Channel record, its Schema, and where its messages are."""

    def __init__(self, topic: str, definition: Sequence[str], encoding: str, metadata: dict[str, str]) -> None:
        self.topic = topic
        self.schema_name, self.schema_encoding, self.schema_text = definition
        self.encoding = encoding
        self.metadata = metadata
        self.offsets = array("Q")  # of its Message records in the file
        self.struct: rosmsg.Struct | None = None
        self.why_not: str | None = None
        try:
            self.struct = self._parse()
        except rosmsg.DefinitionError as error:
            self.why_not = str(error)

    def _parse(self) -> rosmsg.Struct:
        if (self.schema_encoding, self.encoding) != ("ros2msg", "cdr"):
            raise rosmsg.DefinitionError(
                f'schema encoding "{self.schema_encoding}" and message encoding "{self.encoding}"; '
                'only "ros2msg" and "cdr" are read')
        return rosmsg.parse(self.schema_text)


def _merged(records: Iterable[tuple[str, dict[str, str]]]) -> dict[str, dict[str, str]]:
    merged: dict[str, dict[str, str]] = {}
    for name, pairs in records:
        merged.setdefault(name, {}).update(pairs)
    return merged


def metadata(path: str | os.PathLike[str]) -> dict[str, dict[str, str]]:
    """The metadata of a file, as Scan has them, up to the first fault. Of chunks, only the heads are read."""
    with open(path, "rb") as file:
        if not os.fstat(file.fileno()).st_size:
            return {}
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _merged(_core.mcap_metadata(data))


class Scan:
    """The contents of a file.

    channels: id -> RawChannel; metadata: name -> {key: value}; problem: None, or the fault in words;
    problem_at: its byte; t_good: [ns] the time before which all messages are present and right, or None if unknown.
    """

    def __init__(self, data: mmap.mmap | bytes) -> None:
        channels: list[RawChannel] = []

        def declare(topic: str, definition: Sequence[str], encoding: str, metadata: dict[str, str]) -> int | None:
            """The length that every Message record of a fixed-size type must state."""
            channels.append(RawChannel(topic, definition, encoding, metadata))
            struct = channels[-1].struct
            return None if struct is None else PAYLOAD_AT - CONTENT_AT + struct.size

        try:
            scan = _core.McapScan(data, declare)
        except ValueError as error:
            raise Unsupported(str(error)) from None
        self.size = len(data)
        self.metadata = _merged(scan.metadata)
        self.profile, self.library = scan.profile, scan.library
        self.problem, self.problem_at = scan.problem or None, scan.problem_at
        self.t_good = scan.good_until
        self.channels: dict[int, RawChannel] = {}
        for channel, (id, offsets) in zip(channels, scan.offsets):
            channel.offsets.frombytes(offsets)
            self.channels[id] = channel
