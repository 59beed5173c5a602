# SPDX-License-Identifier: Apache-2.0
"""The database of the ground: packets to values, and commands to packets and back, by files of XTCE.

    from fledge.ground import Database

    craft = Database.load("craft.xml")
    packet = craft.decode(received)
    packet.values["battery_voltage"], packet.container, packet.reason
    uplink = craft.encode("SET_MODE", mode="SAFE")
    craft.decode_command(uplink).command, craft.decode_command(uplink).arguments
"""
from __future__ import annotations

import os
from typing import Any, NotRequired, TypedDict, cast

from fledge import _ground

History = _ground.History
Monitor = _ground.Monitor
PacketArchive = _ground.PacketArchive
time_text = _ground.time_text

TIMES = ("time", "duration")    # kinds of values in ns


class Argument(TypedDict):
    """An argument of a Form. size: [bits]; of text and binary, bytes at most."""
    name: str
    type: str
    unit: str
    low: Any
    high: Any
    low_open: bool
    high_open: bool
    labels: list[str]
    initial: Any
    description: str
    counted_by: str         # the argument that has its length
    size: int | None


class Verifier(TypedDict):
    """A verifier of a Form. start, stop [s]: its window; own: it compares arguments of the command."""
    stage: str
    text: str
    start: float
    stop: float | None
    from_release: bool
    percent: float | None
    own: bool
    problem: NotRequired[str]       # of the server: why it cannot be watched


class Form(TypedDict):
    """A command that can be sent; the name is in Fledge's words, if it has such. hazardous: why; "": it is not."""
    name: str
    path: str
    group: str
    description: str
    hazardous: str
    arguments: list[Argument]
    constraints: list[str]      # what must hold before it leaves
    verifiers: list[Verifier]


class Database:
    """What packets and commands are. Its lists have the paths of `containers`, `parameters` and `commands`; `notes`
    says what its files hold that is not computed here, with file and line, and `left_out` what is wrong with them."""

    def __init__(self, files: list[tuple[str, str]], lenient: bool = False) -> None:
        self._read = _ground.Database.read(files, lenient=lenient)
        self.containers: list[str] = self._read.containers
        self.parameters: list[str] = self._read.parameters
        self.commands: list[str] = self._read.commands
        self.notes: list[str] = self._read.notes
        self.left_out: list[str] = self._read.left_out

    @classmethod
    def load(cls, *files: str | os.PathLike[str], under: dict[str, str] | None = None,
             lenient: bool = False) -> Database:
        """Read files of XTCE, which may refer to one another. under: file -> path of the space system that its own one
        belongs to. Raises SetupError with file and line of each fault; lenient: what has one, and what refers to it, is
        in `left_out`, and the rest is read."""
        given = under or {}
        return cls([(os.fspath(file), given.get(os.fspath(file), "")) for file in files], lenient)

    def decode(self, packet: bytes, root: str | None = None) -> Any:
        """The _ground.Packet of a packet: `raw` and `values` by parameter, `rows` in its order, `container`, `reason`.
        Its container extends `root`; without it, any that extends nothing. A packet that fits none has a reason and no
        values; one that ends early has those in front of its end. Booleans are bool, times int [ns] since 1970 UTC
        (ground/database/times.h), durations int [ns], and enumerators their label, or a number if they have none.
        Raises SetupError on an unknown root."""
        return self._read.decode(packet, root)

    def encode(self, name: str, /, **arguments: Any) -> bytes:
        """The packet of a command. Arguments, and parameters of its header, are numbers in units, labels, texts, bytes,
        lists and dicts; times are numbers [ns] since 1970 UTC or dates, as "2026-03-01T12:00:00.5Z", durations numbers
        [ns] or texts, as "1.5 s" and "PT1.5S". The control room checks a command's constraints; encode() does not.
        Raises SetupError on an unknown command or argument, and for a value that it cannot have."""
        return self._read.encode(name, arguments)

    def decode_command(self, packet: bytes, header: str = "none") -> _ground.CommandPacket:
        """Which command a packet is, the most derived one whose fixed values it has, and its arguments, as encode()
        takes them. header: "ccsds" if a sender has set the sequence and the length of a space packet, "cfs" if also
        the checksum of a command of cFS."""
        return self._read.decode_command(packet, header)

    def forms(self) -> list[Form]:
        """A Form, a dict, of each command that can be sent."""
        return cast(list[Form], self._read.forms())

    def places(self, name: str, /, **arguments: Any) -> list[tuple[str, bool, int, int]]:
        """(name, whether it is an argument, first bit, bits) of each entry in the packet of encode(). Raises as
        encode() does."""
        return list(self._read.places(name, arguments))

    def container_names(self) -> dict[str, str]:
        """Path of each container -> its name in Fledge's words, or the path."""
        return dict(self._read.container_names())

    def monitor(self, root: str | None = None) -> Monitor:
        """What decodes batches of packets, whose container extends `root`, checks their limits and has their newest
        values (ground/monitor)."""
        return _ground.Monitor(self._read, root)

    def archive(self, folder: str | os.PathLike[str], craft: str) -> PacketArchive:
        """What writes the packets of a craft into a folder (ground/packets). Raises SetupError if another program
        does."""
        return _ground.PacketArchive(os.fspath(folder), craft, self._read)

    def history(self, folder: str | os.PathLike[str], craft: str, root: str | None = None) -> History:
        """What reads the packets of an archive(), also while they are written."""
        return _ground.History(os.fspath(folder), craft, self._read, root)

    def units(self, parameter: str) -> list[str]:
        """The units of a parameter. Raises SetupError on an unknown one."""
        return self._read.units(parameter)
