# SPDX-License-Identifier: Apache-2.0
"""Packets and their times in files: what `--script` of a board's program reads."""
from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from fledge.frames import Frames


class Timed(NamedTuple):
    """A command that flight gets before its first instant after a time, or a packet of telemetry and its instant."""
    t: int                      # [ns]
    packet: bytes


def script(packets: Iterable[Timed]) -> str:
    """The lines of a file of packets, for --script of fledge_board_node."""
    return "".join(f"{packet.t} {packet.packet.hex()}\n" for packet in packets)


def read_script(text: str) -> list[Timed]:
    """The packets of such a file."""
    return [Timed(int(t), bytes.fromhex(digits)) for t, digits in (line.split() for line in text.splitlines())]


def unframed(frames: Frames, units: Iterable[Timed]) -> Iterator[Timed]:
    """The packets in units of telemetry (ccsds/space_link.h)."""
    from fledge import _ground

    end = _ground.SpaceLink(frames.options, 1, 1)
    for unit in units:
        for packet in end.take(unit.packet):
            yield Timed(unit.t, packet)
