# SPDX-License-Identifier: Apache-2.0
"""The page of a mission's packets shows every bit once, and every command and event."""
import re

import pytest

import fledge
from fledge import export
from fledge.export import packets
from fledge.export.ground import Ground, Shown
from fledge.export.packets import HEADER, Item, bits
from fledge.export.page import page, place, table


def page_of(name, ground=Ground()):
    missions = export.read_all(fledge.load(name))
    databases = [packets.database(mission) for mission in missions]
    return page(name, missions, databases, ground), databases, missions


@pytest.mark.parametrize("name", ["earth_imager", "formation"])
def test_every_byte_of_every_packet_and_every_command_and_event_stand_there(name):
    text, databases, missions = page_of(name)
    sections = dict(re.findall(r"^### (\S+)\n(.*?)(?=^##|\Z)", text, re.M | re.S))
    for mission, database in zip(missions, databases):
        for packet in database.packets:
            at = 16
            rows = sections[packet.path].replace("\u00a0", " ")
            for first, last in re.findall(r"^\| (\d+)(?: to (\d+)| on)? \|", rows, re.M):
                assert int(first) == at
                at = int(last or at) + 1
            variable = any(item.count for item in packet.items)
            assert at == 16 + sum(item.bits for item in packet.items) // 8 + variable
        for command in database.commands:
            if command.parent == f"{database.process}.write":
                module, parameter = re.fullmatch(r"(\w+\.write\.\w+)\.(.*)", command.path).groups()
                assert f"| {command.fixed['offset']} | `{parameter}` |" in sections[module]
            elif not command.abstract:
                assert f"Code {command.fixed['code']}, " in sections[command.path]
        for event in mission.events:
            assert f"| `{event.title}` |" in text


def test_what_the_ground_adds_stands_there():
    ground = Ground(telemetry={f"flight.tracking.error.sigma_BR[{i}]": Shown((0.0, 229.0), "deg", (-5, 5))
                               for i in range(3)}, hazardous={"flight.reset_flight": "it begins *again*"})
    text, _, _ = page_of("nadir_spin", ground)
    assert "| 229 x deg, warning outside -5 to 5 |" in text
    assert "Code 7, 10 bytes. **Hazardous**: it begins \\*again\\*\n" in text


def test_places_are_bytes_or_bits():
    ranges = ((0, 3), (3, 1), (5, 11), (16, 16), (32, 8), (128, 0))
    assert [place(*bits_).replace("\u00a0", " ") for bits_ in ranges] == [
        "0.0 to 0.2", "0.3", "0.5 to 1.7", "2 to 3", "4", "16 on"]
    rows = table([bits("a", 4), Item("b", "char", 64), Item("c[0]", "f32", 32, "m | n"), Item("c[1]", "f32", 32)])
    assert [row.replace("\u00a0", " ") for row in rows[2:]] == [
        "| 0.0 to 0.3 | `a` | u4 |  |", "| 0.4 to 8.3 | `b` | text of 8 bytes |  |",
        "| 8.4 to 16.3 | `c[0] to [1]` | 2 × f32 | m \\| n |"]
    assert len(HEADER) == len(table(HEADER)) - 2
