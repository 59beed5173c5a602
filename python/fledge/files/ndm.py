# SPDX-License-Identifier: Apache-2.0
"""CCSDS navigation data messages as objects, in SI and radians.

    oem = ndm.read("spacecraft.oem")                # or OPM, OMM, OCM, AEM, APM, CDM; KVN or XML
    oem.segments[0].meta["REF_FRAME"]
    ndm.write(oem, "spacecraft.xml", form="xml")

What is not as its Blue Book says is refused with its file, its line and what was expected.
Source: as messages.py.
"""
from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from fledge.disk import Part
from fledge.errors import SetupError, did_you_mean, listed
from fledge.files import ephemeris, kvn, tables, xml
from fledge.files.kvn import Token, refuse
from fledge.files.messages import (CHOICES, FORMS, NOT_NEGATIVE, OPTIONAL_ROWS, OTHERS, PAIRS, RIVALS, THEORIES, Block,
                                   Form)
from fledge.files.sections import Message, Section, Segment, Value
from fledge.files.values import TIME, UNITS, WHOLE, Clock, to_si, unit_of
from fledge.files.writer import as_kvn, as_xml


@dataclass
class _Raw:
    """A section before its values are converted."""
    block: Block
    line: int
    tokens: dict[str, Token] = field(default_factory=dict)
    rows: list[tuple[int, list[tuple[str, str]]]] = field(default_factory=list)   # line, names and texts
    comments: list[str] = field(default_factory=list)


class _Builder:
    """Orders the tokens of a message into blocks, as its form has them."""

    def __init__(self, form: Form, version: str, where: str, line: int, in_xml: bool) -> None:
        self.where, self.form, self.version, self.in_xml, self.line = where, form, version, in_xml, line
        if version not in form.versions:
            refuse(where, line, f"CCSDS_{form.name}_VERS: expected {' or '.join(form.versions)}; found {version!r}")
        self.blocks = form.of(version)
        self.meta = len(form.front) + 1
        self.front: list[_Raw] = []
        self.segments: list[list[_Raw]] = []
        self.at: _Raw = self._enter(0, line)
        self.opened = ""                # the mark or element of the block that is open
        self.row: list[tuple[str, str]] | None = None
        self.pending: list[str] = []

    def feed(self, token: Token) -> None:
        if token.kind == "comment":
            (self.at.comments if self.opened and not self.at.rows else self.pending).append(token.text)
        elif token.kind == "key":
            self._key(token)
        elif token.kind == "open":
            self._open(token)
        elif token.kind == "close":
            self._close(token)
        else:
            self._row(token)

    def _enter(self, index: int, line: int) -> _Raw:
        block = self.blocks[index]
        if index == self.meta:
            if self.segments and not self.form.segments:
                refuse(self.where, line, f"{block.name} is given twice; an {self.form.name} has a single segment")
            self.segments.append([])
        elif index > self.meta and not self.segments:
            refuse(self.where, line, f"{block.name}: expected {self.blocks[self.meta].name} before it")
        place = self.segments[-1] if index >= self.meta else self.front
        before = [self.blocks.index(raw.block) for raw in place]
        if index in before and not block.many:
            refuse(self.where, line, f"{block.name} is given twice")
        if index < max(before, default=-1) and not block.marked:
            refuse(self.where, line, f"{block.name}: expected before {self.blocks[max(before)].name}")
        self.at = _Raw(block, line)
        place.append(self.at)
        return self.at

    def _take_comments(self) -> None:
        """Comments stand before what they are about."""
        self.at.comments += self.pending
        self.pending = []

    def _key(self, token: Token) -> None:
        if self.row is not None:
            self.row.append((token.name, token.text))
            return
        block, user = self.at.block, token.name.startswith("USER_DEFINED_")
        known = token.name in block.fields or (block.name == "USER" and user)
        if not (known and (self.in_xml or self.opened or not block.marked)):
            self._enter_of(token, user)
        elif token.name in self.at.tokens:
            first = next(iter(self.at.tokens))
            if block.many and token.name == first and (not block.mark or block.name == "COVARIANCE") and not (
                    self.in_xml and self.opened):
                self._enter(self.blocks.index(block), token.line)
            elif token.name == first == "OBJECT":
                self._enter(self.meta, token.line)
            else:
                refuse(self.where, token.line, f"{token.name} is given twice; the first is in line "
                                               f"{self.at.tokens[token.name].line}")
        self._take_comments()
        self.at.tokens[token.name] = token

    def _enter_of(self, token: Token, user: bool) -> None:
        """Begin the block without marks that has a keyword."""
        now = self.blocks.index(self.at.block)
        free = [i for i, block in enumerate(self.blocks) if not block.rows and (
            token.name in block.fields or (block.name == "USER" and user)) and (
                self.in_xml or not block.marked)]
        later = [i for i in free if i > now] or [i for i in free if i == self.meta and self.form.segments]
        inside = self.opened and (not self.in_xml or self.opened == self.at.block.element) and self.opened != "header"
        if later and not inside:
            self._enter(later[0], token.line)
            return
        keys = list(self.at.block.fields) if inside else [key for block in self.blocks for key in block.fields]
        if token.name in keys:
            place = self.blocks[free[0]].name if free else "its block"
            refuse(self.where, token.line, f"{token.name}: expected in {place}, before {self.at.block.name}")
        where = f"the block {self.at.block.name}" if inside else f"{self.form.name} {self.version}"
        refuse(self.where, token.line, f"{where} has no {token.name}{did_you_mean(token.name, keys)} expected one of "
                                       "its keywords, or USER_DEFINED_... at the end")

    def _open(self, token: Token) -> None:
        if self.in_xml:
            if any(block.row == token.name for block in self.blocks if block.rows):
                index = next(i for i, block in enumerate(self.blocks) if block.row == token.name)
                if self.at.block is not self.blocks[index]:
                    self._enter(index, token.line)
                self._take_comments()
                self.row, self.row_line, self.row_name = [], token.line, token.name
                return
            found = [i for i, block in enumerate(self.blocks) if block.element == token.name]
        else:
            found = [i for i, block in enumerate(self.blocks) if block.mark.strip("?") == token.name]
        if not found:
            if not self.in_xml:
                marks = [f"{block.mark.strip('?')}_START" for block in self.blocks if block.mark]
                refuse(self.where, token.line, f"expected {', '.join(marks)}; found {token.text}")
            return
        if self.opened and self.row is None and not (self.in_xml and self.opened == "header"):
            refuse(self.where, token.line, f"expected the end of {self.at.block.name}; found {token.text}")
        if self.row is None and found[0] != 0:
            self._enter(found[0], token.line)
            self._take_comments()
            self.opened = token.name
        elif found[0] == 0:
            self.opened = token.name

    def _close(self, token: Token) -> None:
        if self.row is not None and token.name == self.row_name:
            self.at.rows.append((self.row_line, self.row))
            self.row = None
        elif token.name == self.opened and self.row is None:
            self._take_comments()
            self.opened = ""
        elif not self.in_xml:
            refuse(self.where, token.line, f"expected {self.opened}_STOP; found {token.text}" if self.opened else
                   f"{token.text}: expected its beginning before it")

    def _row(self, token: Token) -> None:
        if token.text[:1].isalpha():
            refuse(self.where, token.line, f"expected KEYWORD = value; found {token.text!r}")
        if not (self.at.block.rows and (self.opened or not self.at.block.mark)):
            index = self.blocks.index(self.at.block) + 1
            block = self.blocks[index] if index < len(self.blocks) else None
            if not self.segments or self.opened or block is None or not block.rows or block.mark or self.in_xml:
                refuse(self.where, token.line, f"expected KEYWORD = value; found {token.text!r}")
            self._enter(index, token.line)
        self._take_comments()
        self.at.rows.append((token.line, [("", text) for text in token.text.split()]))

    def message(self) -> Message:
        """What the tokens say. Raises SetupError where something is missing."""
        if self.opened:
            refuse(self.where, self.at.line, f"{self.at.block.name}: expected its end, "
                                             f"{self.opened}_STOP; found the end of the message")
        self._take_comments()
        self._check(self.front, self.blocks[:self.meta])
        if not self.segments:
            refuse(self.where, self.line, f"expected META in the {self.form.name}; there is none")
        if self.form.name == "CDM" and len(self.segments) != 2:
            refuse(self.where, self.line, f"expected OBJECT1 and OBJECT2; found {len(self.segments)} objects")
        utc = Clock("UTC")
        front = [self._section(raw, utc, None) for raw in self.front]
        segments = []
        for raws in self.segments:
            raws.sort(key=lambda raw: self.blocks.index(raw.block))     # those with marks may come in any order
            self._check(raws, self.blocks[self.meta:])
            keys = raws[0].tokens
            self._check_theory({key: token for raw in raws for key, token in raw.tokens.items()})
            scale, zero = (keys[key].text if key in keys else other for key, other in (
                ("TIME_SYSTEM", "UTC"), ("EPOCH_TZERO", "")))
            try:
                clock = Clock(scale, self.where, keys["TIME_SYSTEM"].line if "TIME_SYSTEM" in keys else 1, zero)
            except SetupError:
                raise
            except ValueError:
                refuse(self.where, keys["EPOCH_TZERO"].line, f"EPOCH_TZERO: expected a time; found {zero!r}")
            meta = self._section(raws[0], clock, None)
            sections = [meta, *(self._section(raw, clock, meta) for raw in raws[1:]
                                if raw.tokens or raw.rows or raw.comments)]
            segments.append([section for section in sections if section.values or section.columns or section.comments])
        return message_of(self.form.name, self.version, front, segments)

    def _check(self, raws: list[_Raw], blocks: list[Block]) -> None:
        """Raise SetupError where a block or keyword is missing."""
        names = {raw.block.name for raw in raws}
        line = raws[0].line if raws else self.line
        for block in blocks:
            if block.required and block.name not in names:
                refuse(self.where, line, f"expected {block.name} in the {self.form.name}; there is none")
        if self.form.some and self.meta and blocks[0].name == "META" and not names & set(self.form.some):
            refuse(self.where, line, f"expected {' or '.join(self.form.some)} in the {self.form.name}; there is none")
        for raw in raws:
            missing = [key for key, item in raw.block.fields.items() if item.required and key not in raw.tokens
                       and not (raw.block.rows and raw.block.name != "COVARIANCE" and not raw.block.mark)]
            if raw.block.name == "COVARIANCE":
                missing = [] if raw.block.rows and raw.rows else tables.missing_of_covariance(raw.tokens, missing)
            if missing:
                refuse(self.where, raw.line, f"expected {listed(missing, 5)} in {raw.block.name}; there is none")
            for key, beside in PAIRS.items():
                if key in raw.tokens and beside not in raw.tokens:
                    refuse(self.where, raw.tokens[key].line, f"expected {beside} with {key}; there is none")
            either = [key for key in raw.block.either if key in raw.tokens]
            if raw.block.either and len(either) != 1:
                refuse(self.where, raw.line, f"expected {' or '.join(raw.block.either)}; found {listed(either)}")

    def _check_theory(self, keys: dict[str, Token]) -> None:
        """Raise SetupError where an OMM lacks what its theory needs."""
        theory = keys.get("MEAN_ELEMENT_THEORY")
        missing = [key for key in THEORIES.get(theory.text.upper(), ()) if key not in keys] if theory else []
        if theory and missing:
            refuse(self.where, theory.line, f"expected {listed(missing)} for {theory.text}; there is none")
        for a, b in RIVALS:
            if a in keys and b in keys:
                refuse(self.where, keys[b].line, f"expected {a} or {b}; found both")

    def _section(self, raw: _Raw, clock: Clock, meta: Section | None) -> Section:
        section = Section(raw.block.name, {}, raw.comments, {}, self.where, raw.line)
        for key, token in raw.tokens.items():
            item = raw.block.fields.get(key)
            if item and not token.text and item.type not in ("text", "date"):     # as CelesTrak leaves CREATION_DATE
                if item.required and not key.startswith(OPTIONAL_ROWS):
                    refuse(self.where, token.line, f"{key}: expected a value; there is none")
                continue
            section.values[key] = value_of(item.type if item else "text", token, clock, self.where)
        if "EULER_ROT_SEQ" in section.values:
            tables.sequence(section)
        if raw.block.rows:
            tables.fill(section, raw.rows, clock, meta, self.form.name, self.version)
        return section


def message_of(kind: str, version: str, front: list[Section], segments: list[list[Section]]) -> Message:
    """A message of its class."""
    segment = {"OEM": ephemeris.OemSegment, "AEM": ephemeris.AemSegment}.get(kind, Segment)
    message = Message(kind, version, front, [segment(sections) for sections in segments])
    for part in message.segments[1:]:
        same = {"OEM": ("OBJECT_NAME", "OBJECT_ID", "TIME_SYSTEM"), "AEM": ("OBJECT_NAME", "OBJECT_ID")}
        for key in same.get(kind, ()):
            if part.meta[key].upper() != message.segments[0].meta[key].upper():
                part.meta.refuse(f"{key}: expected {message.segments[0].meta[key]}, as in the first segment of the "
                                 f"{kind}; found {part.meta[key]}: write another message for it")
    for part in message.segments:
        if isinstance(part, ephemeris.Tabulated):
            part.check()
    return message


def value_of(kind: str, token: Token, clock: Clock, where: str) -> Value:
    """The value of a keyword, of a type of messages.py."""
    if kind == "text":
        if token.text.upper() not in CHOICES.get(token.name, (token.text.upper(),)):
            refuse(where, token.line, f"{token.name}: expected {' or '.join(CHOICES[token.name])}; found {token.text}")
        return token.text
    if kind == "date":
        if token.text and not TIME.fullmatch(token.text):
            refuse(where, token.line, f"{token.name}: expected a time, 2020-10-13T04:52:48; found {token.text!r}")
        return token.text
    if kind == "time":
        return clock.time(token.name, token.text, token.line, where)
    text, unit = token.split()
    if kind == "int":
        if not WHOLE.fullmatch(text):
            refuse(where, token.line, f"{token.name}: expected a whole number of up to 18 digits; found "
                                      f"{token.text!r}")
        return int(text)
    if unit and unit_of(unit) != kind:
        refuse(where, token.line, f"{token.name}: expected the unit {kind}, or none; found {unit}: convert the value")
    try:
        value = to_si(text, UNITS[kind])
    except ValueError:
        refuse(where, token.line, f"{token.name}: expected a number; found {token.text!r}")
    if value < 0 and token.name in NOT_NEGATIVE:
        refuse(where, token.line, f"{token.name}: expected a number that is not negative; found {token.text}")
    return value


def messages(source: str | os.PathLike[str]) -> Iterator[Message]:
    """The messages of a file, or of a text of several lines, in KVN or XML. Raises SetupError."""
    data, where = kvn.content(source)
    in_xml = data.lstrip(kvn.SPACE)[:1] == b"<" or b"<\0" in data[:8] or b"\0<" in data[:8]
    tokens: Iterable[Token] = xml.tokens(data, where) if in_xml else kvn.tokens(kvn.decoded(data, where))
    builder: _Builder | None = None
    combined = in_xml
    for token in tokens:
        kind = token.name[6:-5] if token.kind == "key" and token.name.startswith("CCSDS_") else ""
        combined = combined or kind == "NDM"
        if kind and kind != "NDM":
            if builder:
                yield builder.message()
            if kind not in FORMS:
                found = f"{kind}, {OTHERS[kind]}" if kind in OTHERS else kind
                refuse(where, token.line, f"expected a message of {', '.join(FORMS)}; found {found}")
            builder = _Builder(FORMS[kind], token.text, where, token.line, in_xml)
        elif builder:
            builder.feed(token)
        elif token.kind == "row" or not combined or (token.kind == "key" and not kind and token.name != "MESSAGE_ID"):
            refuse(where, token.line, f"expected CCSDS_..._VERS = ... first, of {', '.join(FORMS)}; found "
                                      f"{token.text!r}")
    if builder:
        yield builder.message()


def read_all(source: str | os.PathLike[str]) -> list[Message]:
    """All messages of a file, or of a text of several lines, also those of an NDM. Raises SetupError."""
    found = list(messages(source))
    if not found:
        raise SetupError(f"{kvn.content(source)[1]}: expected a message of {', '.join(FORMS)}, in KVN or XML; it has "
                         "none")
    return found


def read(source: str | os.PathLike[str]) -> Message:
    """The only message of a file, or of a text of several lines. Raises SetupError, with what is wrong where."""
    found = read_all(source)
    if len(found) > 1:
        raise SetupError(f"{kvn.content(source)[1]}: has {len(found)} messages, {listed([m.kind for m in found], 10)}: "
                         "choose among read_all(...)")
    return found[0]


def create(kind: str, segments: Iterable[Segment | list[Section]], *, originator: str, created: str, version: str = "",
           **header: str) -> Message:
    """A new message. created: its CREATION_DATE, UTC; version: without, the newest; header: its other keywords."""
    if kind not in FORMS:
        raise SetupError(f"create: expected a message of {', '.join(FORMS)}; found {kind!r}")
    front = Section("HEADER", {"CREATION_DATE": created, "ORIGINATOR": originator, **header})
    return message_of(kind, version or FORMS[kind].versions[-1], [front],
                      [segment.sections if isinstance(segment, Segment) else segment for segment in segments])


def text_of(message: Message, form: str = "kvn") -> str:
    """A message as text. form: "kvn" or "xml". Raises SetupError where it would not read back."""
    if form not in ("kvn", "xml"):
        raise SetupError(f"form: expected 'kvn' or 'xml'; found {form!r}")
    text = as_kvn(message) if form == "kvn" else as_xml(message)
    read(text)
    return text


def write(message: Message, path: str | os.PathLike[str], form: str = "kvn") -> None:
    """Write a message into a file. form: "kvn" or "xml". Raises SetupError where it would not read back."""
    text = text_of(message, form)
    with Part(path) as part:
        part.write_text(text, encoding="utf-8")
