# SPDX-License-Identifier: Apache-2.0
"""The page of a mission's packets, commands and events for people, in Markdown, for `fledge docs`."""
from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from fledge.elements import ELEMENTS
from fledge.export.ground import Ground, Shown
from fledge.export.packets import HEADER, Command, Database, Item, Packet
from introspect.emit.reference import prose

if TYPE_CHECKING:
    from fledge.export.read import Mission


def page(name: str, missions: Sequence[Mission], databases: Sequence[Database], ground: Ground) -> str:
    """missions and databases: of each flight process, in the same order."""
    lines = [f"# Packets of {name}", "", "All that the mission's flight software sends and understands. Places count "
             "from 0, the most significant bit first: 0.5 is bit 5 of byte 0. `fledge export xtce` writes the same for "
             "ground stations."]
    for mission, database in zip(missions, databases):
        process = database.process
        lines += ["", f"## {process}: packets", "", f"The version of its dictionary is "
                  f"`{database.dictionary.version:#06x}`. Numbers are {database.order}-endian. Each packet begins with "
                  "this header:", "", *table(HEADER)]
        children = [packet for packet in database.packets if packet.parent]
        for packet in database.packets:
            if packet.parent:
                continue
            packet = replace(packet, items=[*packet.items, *packet.rest])
            length = sum(item.bits for item in (*HEADER, *packet.items)) // 8
            open_ = ", and more" if packet.items[-1].count else ""
            lines += ["", f"### {packet.path}", "", f"{sentence(packet.about)} Stream `{packet.stream:#06x}` (APID "
                      f"{packet.stream & 0x7FF}), {length} bytes{open_}.", "", *packet_table(packet, ground)]
            if events := [child for child in children if child.parent == packet.path]:
                lines += ["", *rows(("output", "id", "event", "arguments", "meaning"), map(event_cells, events))]
        header = database.chain(database.command(f"{process}.command"))
        lines += ["", f"## {process}: commands", "", f"Stream `{database.dictionary.stream:#06x}`. Numbers are "
                  "big-endian. Each command begins with this header; the first two have no version:", "",
                  *table([item for part in header for item in part.items])]
        writes: dict[str, list[Command]] = {}
        for command in database.commands:
            if command.parent == f"{process}.write":
                writes.setdefault(".".join(command.path.split(".")[:3]), []).append(command)
            elif not command.abstract:
                lines += ["", *command_lines(database, command, ground)]
        for path, commands in writes.items():
            lines += ["", f"### {path}", "", f"Write parameters of `{process}.{path.split('.')[2]}`, module "
                      f"{commands[0].fixed['module']}: code 3, one command for each row.", "",
                      *write_table(path, commands, ground)]
        if mission.modes:
            lines += ["", f"## {process}: modes", "", *rows(("number", "mode", "is entered"), (
                (str(i), f"`{mission.mode_titles[mode]}`",
                 text(f"only {mission.guards[mode].text}" if mode in mission.guards else "always"))
                for i, mode in enumerate(mission.modes)))]
        if mission.events:
            lines += ["", f"## {process}: events", "", *rows(("number", "event", "what happens"), (
                (str(i), f"`{event.title}`", text(event.text)) for i, event in enumerate(mission.events)))]
    return "\n".join([*lines, ""])


def sentence(words: str) -> str:
    return text(words[:1].upper() + words[1:]) + "." if words else ""


def text(words: str) -> str:
    """In a cell: escaped for Markdown."""
    return prose(words).strip().replace("\n", " ") if words else ""


def whole(words: str) -> str:
    """The same, on one line of the page."""
    return text(words).replace(" ", "\u00a0")


def rows(titles: Sequence[str], cells: Iterable[Sequence[str]]) -> list[str]:
    """A table; columns that would be empty are left out."""
    table = list(cells)
    shown = [i for i in range(len(titles)) if any(row[i] for row in table)]
    return ["| " + " | ".join(titles[i] for i in shown) + " |", "|---" * len(shown) + "|",
            *("| " + " | ".join(row[i] for i in shown) + " |" for row in table)]


def grouped(items: Sequence[Item], at: int = 0) -> Iterator[tuple[int, str, int, Item]]:
    """(first bit, name, how many, the first) of each item, and of each array as one."""
    i = 0
    while i < len(items):
        base, n = items[i].name.partition("[")[0] if items[i].name.endswith("]") else items[i].name, 1
        while i + n < len(items) and items[i].name != base and items[i + n].name.partition("[")[0] == base and \
                items[i + n].name.endswith("]"):
            n += 1
        yield at, items[i].name if n == 1 else f"{items[i].name} to {items[i + n - 1].name[len(base):]}", n, items[i]
        at += sum(item.bits for item in items[i:i + n])
        i += n


def place(at: int, n_bits: int) -> str:
    """Which bytes, or of less than whole ones, which bits."""
    end = at + n_bits - 1
    if n_bits == 0:
        return f"{at // 8}\u00a0on"
    first, last = (f"{at // 8}", f"{end // 8}") if at % 8 == 0 and end % 8 == 7 else (
        f"{at // 8}.{at % 8}", f"{end // 8}.{end % 8}")
    return first if first == last else f"{first}\u00a0to\u00a0{last}"


def table(items: Sequence[Item], at: int = 0, value: str = "value") -> list[str]:
    return rows(("byte", "name", "type", value, "unit", "range", "meaning"), (
        (place(first, n * item.bits), f"`{name}`", kind(item, n), "" if item.value is None else str(item.value),
         whole(item.unit), whole(item.rule), meaning(item)) for first, name, n, item in grouped(items, at)))


def event_cells(event: Packet) -> list[str]:
    """Of an event that a module says."""
    arguments = [f"`{item.name}`" + (f" {whole(item.unit)}" if item.unit else "") for item in event.items
                 if item.type == "f64"]
    return [str(event.fixed["output"]), str(event.fixed["id"]), f"`{event.path}`", ", ".join(arguments),
            text(event.about)]


def packet_table(packet: Packet, ground: Ground) -> list[str]:
    start = sum(item.bits for item in HEADER)
    return rows(("byte", "name", "type", "unit", "range", "meaning", "on the ground"), (
        (place(first, n * item.bits), f"`{name}`", kind(item, n), whole(item.unit), whole(item.rule), meaning(item),
         shown(ground.telemetry.get(f"{packet.path}.{item.name}"))) for first, name, n, item in
        grouped(packet.items, start)))


def command_lines(database: Database, command: Command, ground: Ground) -> list[str]:
    parents = database.chain(command)[:-1]
    at = sum(item.bits for part in parents for item in part.items)
    lines = [f"### {command.path}", "", f"{sentence(command.about)} Code {command.fixed['code']}, "
             f"{at // 8 + sum(item.bits for item in command.items) // 8} bytes"
             f"{', and more' * any(item.count for item in command.items)}. {warned(command, ground)}".rstrip()]
    return [*lines, "", *table(command.items, at, "default")] if command.items else lines


def write_table(path: str, commands: Sequence[Command], ground: Ground) -> list[str]:
    return rows(("offset", "parameter", "type", "unit", "range", "meaning"), (
        (str(command.fixed["offset"]), f"`{command.path.removeprefix(f'{path}.')}`", kind(item, len(command.items)),
         whole(item.unit), whole(item.rule), ". ".join(filter(None, (meaning(item), warned(command, ground)))))
        for command in commands for item in command.items[:1]))


def warned(command: Command, ground: Ground) -> str:
    return f"**Hazardous**: {text(ground.hazardous[command.path])}" if command.path in ground.hazardous else ""


def kind(item: Item, n: int) -> str:
    """8 f64, u11, text of 16 bytes, ..."""
    if item.type in ("char", "bytes"):
        what = "text" if item.type == "char" else "bytes"
        return f"{what} to the end" if item.count else f"{what} of {item.bits // 8} bytes"
    name = item.type if item.type != "enum" else "i32"
    name = name if ELEMENTS[name].size * 8 == item.bits else f"u{item.bits}"
    return f"{n}\u00a0×\u00a0{name}" if n > 1 else name


def meaning(item: Item) -> str:
    labels = ", ".join(f"{value}\u00a0`{label}`" for label, value in item.enumerators.items())
    return ": ".join(part for part in (text(item.meaning), labels) if part)


def shown(change: Shown | None) -> str:
    """What ground.toml says of a number."""
    if not change:
        return ""
    terms = " + ".join(f"{x:g}" + (f" x{f'^{i}' if i > 1 else ''}" if i else "")
                       for i, x in enumerate(change.polynomial) if x)
    parts = [f"{terms or '0'} {change.unit or ''}".strip() if change.polynomial or change.unit else ""]
    parts += [f"{name} outside {low:g} to {high:g}" for name, (low, high) in (
        ("warning", change.warning or (0, 0)), ("critical", change.critical or (0, 0))) if low != high]
    return text(re.sub(r"\s+", " ", ", ".join(part for part in parts if part)))
