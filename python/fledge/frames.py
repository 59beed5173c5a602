# SPDX-License-Identifier: Apache-2.0
"""The frames that a mission speaks (flight/services/space_link.h), as its dictionary describes them, and a telecommand
frame for a packet: expedited (type BD), without security."""
from __future__ import annotations

import binascii
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from fledge.errors import SetupError, listed

OPTIONS = ("spacecraft", "command_channel", "telemetry_channel", "frame_size", "cop1", "window", "cltu", "segments",
           "map", "tc_random", "tm_random", "marker")
FILE = "link.keys"      # in the mission's folder
OVERHEAD = 30           # [bytes] of a frame's data that security takes
ROOM = 1186             # [bytes] of the CLTU of the largest telecommand frame


@dataclass(frozen=True)
class Frames:
    """The parameters of a SpaceLink; without values, those with which others begin."""
    spacecraft: int = 68
    command_channel: int = 1
    telemetry_channel: int = 1
    frame_size: int = 1024      # [bytes]
    cop1: int = 0
    window: int = 128
    cltu: int = 0
    segments: int = 0
    map: int = 0
    tc_random: int = 0
    tm_random: int = 0
    marker: int = 0
    secured: int = 0            # 1: authenticated, 2: encrypted
    keys: tuple[int, ...] = ()  # ids: of the roles, 0: none; and of telemetry

    def __post_init__(self) -> None:
        least = 6 + 7 + 4 * self.cop1 + 2 + (OVERHEAD if self.secured else 0)
        wrong = [f"frame_size is {self.frame_size}; a frame has {max(least, 19)} to 2048 bytes"
                 for _ in [0] if not max(least, 19) <= self.frame_size <= 2048]
        wrong += [f"{name} is {value}; it is 0 to {most}" for name, most in (
            ("spacecraft", 1023), ("command_channel", 63), ("telemetry_channel", 7), ("map", 63), ("cop1", 1),
            ("cltu", 1), ("segments", 1), ("tc_random", 1), ("tm_random", 1), ("marker", 1))
            if not 0 <= (value := getattr(self, name)) <= most]
        if not 2 <= self.window <= 254 or self.window % 2:
            wrong.append(f"window is {self.window}; it is even, 2 to 254")
        if self.map and not self.segments:
            wrong.append("a map needs segments=1")
        if self.secured and (len(self.keys) < 2 or not any(self.keys[:-1]) or not self.keys[-1]):
            wrong.append("secured frames need the key of a role and telemetry_key")
        if wrong:
            raise SetupError("a link of frames: " + "; ".join(wrong))

    @property
    def options(self) -> dict[str, int]:
        """Those that the ground's end of ccsds/space_link.h takes, by their names."""
        return {name: getattr(self, name) for name in OPTIONS}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Frames:
        """Those of a module's parameters."""
        settings: dict[str, Any] = {name: int(values[name]) for name in (*OPTIONS, "secured")}
        settings["frame_size"] = settings["frame_size"] or 1024
        settings["window"] = settings["window"] or 128
        if settings["secured"]:
            settings["keys"] = (*(int(role["key"]) for role in values["roles"]), int(values["telemetry_key"]))
        return cls(**settings)

    @classmethod
    def parse(cls, text: str) -> Frames:
        """Of an address: `frames=68`, the spacecraft alone, or `frames=spacecraft:68,cop1:1,...`. Raises SetupError."""
        known = [field.name for field in fields(cls) if field.name not in ("secured", "keys")]
        values: dict[str, Any] = {}
        for word in text.split(","):
            name, colon, value = word.partition(":")
            name, value = (name, value) if colon else ("spacecraft", name)
            if name not in known or not value.isascii() or not value.isdigit():
                raise SetupError(f"frames={text}: expected numbers, as in frames=spacecraft:68,cop1:1; there are "
                                 + listed(known))
            values[name] = int(value)
        return cls(**values)

    @property
    def unit(self) -> int:
        """[bytes] of a unit of telemetry."""
        return self.frame_size + 4 * self.marker

    def command(self, packet: bytes) -> bytes:
        """The unit of a packet."""
        if self.secured:
            raise SetupError("this mission's link is secured: send commands by fledge.ground.connect(), which has the "
                             "keys")
        data = bytes([0xC0 | self.map]) * self.segments + packet
        size = 5 + len(data) + 2
        if size > 1024:
            raise SetupError(f"a telecommand frame has at most 1024 bytes; this packet's has {size}")
        head = (0x2000 | self.spacecraft) << 24 | (self.command_channel << 10 | size - 1) << 8
        frame = head.to_bytes(5, "big") + data
        frame += binascii.crc_hqx(frame, 0xFFFF).to_bytes(2, "big")
        if self.tc_random:
            frame = bytes(map(int.__xor__, frame, _noise(len(frame))))
        return cltu(frame) if self.cltu else frame


def cltu(frame: bytes) -> bytes:
    """A frame as a CLTU (CCSDS 231.0-B)."""
    blocks = (frame[at:at + 7].ljust(7, b"\x55") for at in range(0, len(frame), 7))
    return b"\xEB\x90" + b"".join(block + bytes([_parity(block)]) for block in blocks) + b"\xC5" * 7 + b"\x79"


def _parity(block: bytes) -> int:
    rest = 0
    for i in range(55, -1, -1):
        out = rest >> 6 & 1 ^ int.from_bytes(block, "big") >> i & 1
        rest = rest << 1 & 0x7F ^ 0x45 * out
    return (rest ^ 0x7F) << 1


def _noise(n: int) -> bytes:
    """The sequence of the randomiser of telecommands: x^8 + x^6 + x^4 + x^3 + x^2 + x + 1."""
    bits = [1] * 8
    while len(bits) < 8 * n:
        bits.append(bits[-8] ^ bits[-7] ^ bits[-6] ^ bits[-5] ^ bits[-4] ^ bits[-2])
    return bytes(int("".join(map(str, bits[at:at + 8])), 2) for at in range(0, 8 * n, 8))
