# SPDX-License-Identifier: Apache-2.0
"""Messages as text, in KVN and XML. Numbers have the digits that give their bits back; comments come before the other
entries of their block."""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from xml.sax.saxutils import escape, quoteattr

from fledge.files import tables
from fledge.files.messages import AROUND, AROUND_ROW, ATTITUDE_ELEMENTS, FORMS, Block
from fledge.files.sections import Message, Section, Segment
from fledge.files.values import UNITS, Clock, from_si


def _entries(section: Section, block: Block, clock: Clock) -> list[tuple[str, str, str]]:
    """Keyword, text and unit of each value, in the order of the block; the unit of a bare number is ""."""
    entries = []
    unknown = [key for key in section.values if key not in block.fields and not (
        block.name == "USER" and key.startswith("USER_DEFINED_"))]
    if unknown:
        section.refuse(f"{block.name}: expected of {', '.join(block.fields) or 'USER_DEFINED_...'}; found {unknown[0]}")
    for key in [*(key for key in block.fields if key in section.values),
                *(key for key in section.values if key not in block.fields)]:
        value, kind = section.values[key], block.fields[key].type if key in block.fields else "text"
        if kind in ("text", "date", "int"):
            text, kind = str(value), ""
            if "\n" in text:
                section.refuse(f"{key}: expected a single line; found {text!r}")
        elif kind == "time":
            text, kind = clock.text(int(value)), ""
        else:
            text = from_si(float(value), UNITS[kind])
        entries.append((key, text, "" if kind == "1" else kind))
    return entries


def _parts(message: Message) -> Iterator[tuple[Segment | None, list[tuple[Section, Block, Clock]]]]:
    """The front, then each segment: its sections with their blocks."""
    blocks = {block.name: block for block in FORMS[message.kind].of(message.version)}

    def of(sections: list[Section], clock: Clock) -> list[tuple[Section, Block, Clock]]:
        for section in sections:
            if section.name not in blocks:
                section.refuse(f"expected {', '.join(blocks)} in the {message.kind}; found {section.name}")
        return [(section, blocks[section.name], clock) for section in sections]

    yield None, of(message.front, Clock("UTC"))
    for segment in message.segments:
        yield segment, of(segment.sections, segment.clock)


def as_kvn(message: Message) -> str:
    """A message as lines of KEYWORD = value."""
    lines = [f"CCSDS_{message.kind}_VERS = {message.version}"]
    for segment, parts in _parts(message):
        for mark, group in groupby(parts, key=lambda part: part[1].mark.strip("?") if part[1].marked else id(part[1])):
            group_ = list(group)
            block = group_[0][1]
            # A block of covariances has several, each with its epoch; others have marks of their own.
            for together in [group_] if block.name == "COVARIANCE" else [[part] for part in group_]:
                lines += ["", f"{mark}_START"] if block.marked else [""]
                for section, _, clock in together:
                    lines += _kvn_section(section, block, clock, segment, message)
                lines += [f"{mark}_STOP"] if block.marked else []
    return "\n".join(lines) + "\n"


def _kvn_section(section: Section, block: Block, clock: Clock, segment: Segment | None, message: Message) -> list[str]:
    lines = [f"COMMENT {line}" for comment in section.comments for line in comment.splitlines() or [""]]
    triangle = block.name == "COVARIANCE" and block.rows
    entries = _entries(section, block, clock)
    width = max((len(key) for key, _, _ in entries), default=0)
    numbers = []
    for key, text, unit in entries:
        if triangle and key in tables.ENTRIES:
            numbers.append(text)
        else:
            lines.append(f"{key:{width}} = {text}".rstrip() + (f" [{unit}]" if unit else ""))
    lines += [" ".join(numbers[i * (i + 1) // 2:(i + 1) * (i + 2) // 2]) for i in range(6 if numbers else 0)]
    if segment:
        lines += [" ".join(text for _, text in row) for row in
                  tables.lines(section, segment.meta, clock, message.kind, message.version)]
    return lines


def as_xml(message: Message) -> str:
    """A message as a document."""
    kind = message.kind.lower()
    lines = ['<?xml version="1.0" encoding="UTF-8"?>',
             f'<{kind} id="CCSDS_{message.kind}_VERS" version={quoteattr(message.version)}>']
    for segment, parts in _parts(message):
        if segment is None:
            for section, block, clock in parts:
                if block.name != "HEADER":
                    lines.append("<body>")
                lines += _element(block.element, _xml_section(section, block, clock, None, message))
            lines += ["<body>"] if len(parts) == 1 else []
            continue
        lines.append("<segment>")
        for i, (section, block, clock) in enumerate(parts):
            inner = _xml_section(section, block, clock, segment, message)
            lines += _element(block.element, inner) if block.element else inner
            lines += ["<data>"] if i == 0 else []
        lines += ["</data>", "</segment>"]
    return "\n".join([*lines, "</body>", f"</{kind}>"]) + "\n"


def _element(name: str, content: Sequence[str]) -> list[str]:
    return [f"<{name}>", *content, f"</{name}>"]


def _xml_section(section: Section, block: Block, clock: Clock, segment: Segment | None, message: Message) -> list[str]:
    lines = [f"<COMMENT>{escape(comment)}</COMMENT>" for comment in section.comments]
    entries = _entries(section, block, clock)
    if block.name == "EULER" and message.version[0] == "1":
        axes = tables.sequence(section)
        entries.sort(key=lambda entry: axes.find(str("XYZ".find(entry[0][0]) + 1)) if entry[0][1] == "_" else -1)
    lines += _leaves(entries, AROUND)
    rows = tables.lines(section, segment.meta, clock, message.kind, message.version) if segment else []
    for row in rows:
        if block.row.endswith("Line"):
            lines.append(f"<{block.row}>{escape(' '.join(text for _, text in row))}</{block.row}>")
        elif segment and block.row == "attitudeState":
            name = ATTITUDE_ELEMENTS[tables.attitude_type(segment.meta, message.version)]
            leaves = _leaves(_attitude(row, segment.meta, message.version), AROUND_ROW)
            lines += _element(block.row, _element(name, leaves))
        else:
            lines += _element(block.row, _leaves([(key, text, "") for key, text in row], {}))
    return lines


def _attitude(row: list[tuple[str, str]], meta: Section, version: str) -> list[tuple[str, str, str]]:
    """The entries of a line: the scalar parts of quaternions last, and in version 1 the angles by their axes."""
    names = ("EPOCH", "Q1", "Q2", "Q3", "QC", "Q1_DOT", "Q2_DOT", "Q3_DOT", "QC_DOT")
    row = sorted(row, key=lambda item: names.index(item[0]) if item[0] in names else len(names))
    if version[0] != "1" or not any(key.startswith("ANGLE_") for key, _ in row):
        return [(key, text, "") for key, text in row]
    named = {}
    for i, axis in enumerate(tables.sequence(meta), 1):
        named[f"ANGLE_{i}"], named[f"ANGLE_{i}_DOT"] = (f"{'XYZ'[int(axis) - 1]}_{kind}" for kind in ("ANGLE", "RATE"))
    return [(named.get(key, key), text, "") for key, text in row]


def _leaves(entries: Sequence[tuple[str, str, str]], around: dict[str, str]) -> list[str]:
    """An element for each entry, those of a group within another."""
    lines = []
    for name, group in groupby(entries, key=lambda entry: around.get(entry[0], "")):
        leaves = []
        for number, (key, text, unit) in enumerate(group, 1):
            tag, attributes = key, {"units": unit} if unit else {}
            if key.startswith("USER_DEFINED_"):
                tag, attributes = "USER_DEFINED", {"parameter": key[13:]}
            elif name.startswith("rotation"):
                tag = f"rotation{number}"
                attributes = {"angle" if name == "rotationAngles" else "rate": key, **attributes}
            shown = "".join(f" {key}={quoteattr(value)}" for key, value in attributes.items())
            leaves.append(f"<{tag}{shown}>{escape(text)}</{tag}>")
        lines += _element(name, leaves) if name else leaves
    return lines
