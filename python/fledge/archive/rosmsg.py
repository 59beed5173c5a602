# SPDX-License-Identifier: Apache-2.0
"""Message definitions in an archive: ROS 2 text that also has the original names.

    fledge/Head head
    float64[3] sigma_br  # sigma_BR [-] (3) MRP of B relative to R
    uint32 mode  # mode [-] what the unit does {OFF=0, ON=1}
    ================================================================================
    MSG: fledge/Head
    int64 t  # t [ns] time of validity

A line is `<type> <lower-case name>  # <true name> [<unit>] (<shape>) <meaning> {<NAME>=<n>, ...}`;
unit, shape, meaning and values are optional, and only integers have values; `{}` stands behind a meaning that ends with
a brace. ROS 2 requires lower-case names and one-dimensional arrays; the comment has the original ones.
A definition from elsewhere, without such comments, has its ROS names and no units.

Fledge reads only messages of fixed size without padding: they are C structs, byte for byte.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from math import prod
from typing import TYPE_CHECKING, Any

from fledge.errors import excerpt
from fledge.records.series import element_names

if TYPE_CHECKING:
    import numpy

PRIMITIVES = {  # ROS 2 name -> numpy's code
    "bool": "?", "byte": "u1", "char": "u1",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float32": "f4", "float64": "f8",
}

SIZE_MOST = 2**22       # [bytes] of a message that is read: its elements have a name and a column each
DIMS_MOST = 24          # of a field, with those of the messages that it is in; numpy has up to 32
FIELDS_MOST = 2**14     # of a message, with those of nested ones
_DEPTH_MOST = 32        # of messages in messages

_FIELD = re.compile(r"(?P<type>[A-Za-z]\w*(?:/\w+)*)(?:\[(?P<count>\d{1,18})\])?"
                    r"\s+(?P<name>[A-Za-z]\w*)")
_COMMENT = re.compile(r"(?P<name>[A-Za-z_]\w*)(?:\s+\[(?P<unit>[^\]]*)\])?"
                      r"(?:\s+(?P<meaning>.*))?")
_SHAPE = re.compile(r"\((\d{1,18}(?:\s*,\s*\d{1,18})*),?\)\s*")
_VALUES = re.compile(r"\s*\{(\w+\s*=\s*-?\d{1,20}(?:\s*,\s*\w+\s*=\s*-?\d{1,20})*|)\}\s*$")


class DefinitionError(ValueError):
    """A definition that cannot be decoded: the text has the line and the reason."""


@dataclass(frozen=True)
class Field:
    """A number, or an array of numbers, in a message.

    name: its true name from the message down, e.g. "sigma_BR", "head.t", "wheels.axis_B"
    unit: "" where the definition has none, "-" for dimensionless
    shape: () for a scalar; of nested arrays, all dimensions from the outside in
    dtype: numpy's code without byte order, e.g. "f8"; "S12" of a text, char[12]
    values: the names of an enumeration's values
    """

    name: str
    unit: str
    shape: tuple
    meaning: str
    dtype: str
    values: dict = field(default_factory=dict, compare=False)
    parts: tuple = field(default=(), compare=False, repr=False)  # (name, shape) from the outside in

    def columns(self) -> list[str]:
        """The names of its elements in memory order: "sigma_BR[0]", "wheels[2].axis_B[0]"."""
        return element_names(self.parts)


@dataclass(frozen=True)
class Member:
    """One line of a definition. type: a code of PRIMITIVES or a Struct."""

    name: str
    type: Any
    shape: tuple
    unit: str
    meaning: str
    values: dict

    @property
    def item(self) -> int:
        """Bytes of one element."""
        if isinstance(self.type, Struct):
            return self.type.size
        return 1 if self.type == "?" else int(self.type[1:])

    @property
    def alignment(self) -> int:
        """[bytes] of a number or text in CDR."""
        return 1 if self.type[0] == "S" else self.item

    @property
    def size(self) -> int:
        """[bytes] of all elements."""
        return self.item * prod(self.shape)


@dataclass(frozen=True)
class Struct:
    """A message type: its members in order, without padding. n: how many fields it has, with those of nested ones"""

    members: tuple
    size: int
    n: int = 0

    def fields(self, parts: tuple = ()) -> Iterator[Field]:
        """Its Fields in memory order, those of nested messages included."""
        for m in self.members:
            path = parts + ((m.name, m.shape),)
            if isinstance(m.type, Struct):
                yield from m.type.fields(path)
            else:
                shape = tuple(n for _, s in path for n in s)
                name = ".".join(part for part, _ in path)
                yield Field(name, m.unit, shape, m.meaning, m.type, m.values, path)

    def dtype(self, order: str) -> numpy.dtype:
        """The numpy dtype; order: "<" or ">"."""
        import numpy
        return numpy.dtype([
            (m.name, m.type.dtype(order) if isinstance(m.type, Struct) else order + m.type, m.shape)
            for m in self.members])

    def misaligned(self, start: int = 0) -> str | None:
        """The first member that CDR would pad for, where the struct begins at byte `start`."""
        at = start
        for m in self.members:
            if isinstance(m.type, Struct):
                for i in range(min(prod(m.shape), 8)):  # alignments repeat after at most 8 elements
                    inner = m.type.misaligned(at + i * m.type.size)
                    if inner:
                        return f"{m.name}.{inner}"
            elif at % m.alignment:
                return m.name
            at += m.size
        return None


@lru_cache(maxsize=256)
def parse(text: str) -> Struct:
    """The Struct that a definition's text describes. Raises DefinitionError."""
    sections: dict[Any, list[tuple[int, str]]] = {None: []}
    name = None
    lines = iter(enumerate(text.splitlines(), start=1))
    for number, line in lines:
        if len(line) == 80 and not line.strip("="):
            number, line = next(lines, (number, ""))
            head, _, name = line.partition(":")
            name = _short(name.strip())
            if head != "MSG" or not name or name in sections:
                raise DefinitionError(f'line {number}: expected "MSG: <a new type>", '
                                      f'found "{excerpt(line, 100)}"')
            sections[name] = []
        else:
            sections[name].append((number, line))
    struct = _struct(None, sections, {}, ())
    if (dims := max((len(f.shape) for f in struct.fields()), default=0)) > DIMS_MOST:
        raise DefinitionError(f"a field has {dims} dimensions; up to {DIMS_MOST} are read")
    padded = struct.misaligned()
    if padded:
        raise DefinitionError(f"{padded} needs padding before it; only structs without are read")
    return struct


def _short(name: str) -> str:
    """fledge/msg/Head, fledge/Head and Head are the same: the package is ignored."""
    return name.rpartition("/")[2]


def _struct(name: str | None, sections: dict[Any, list[tuple[int, str]]], known: dict[str | None, Struct],
            inside: tuple[str | None, ...]) -> Struct:
    if name not in known:
        members: dict[str, Member] = {}
        size = fields = 0
        for number, line in sections[name]:
            code, _, comment = line.partition("#")
            if not code.strip():
                continue
            member = _member(number, code.strip(), comment.strip(), sections, known, inside + (name,))
            if member.name in members:
                raise DefinitionError(f"{name or 'the message'} has two members named {member.name}")
            members[member.name] = member
            size += member.size
            fields += member.type.n if isinstance(member.type, Struct) else 1
            for found, most, what in ((size, SIZE_MOST, "bytes"), (fields, FIELDS_MOST, "fields")):
                if found > most:
                    raise DefinitionError(f"{name or 'the message'} has at least {found} {what}; up to {most} are "
                                          "read")
        known[name] = Struct(tuple(members.values()), size, fields)
    return known[name]


def _member(number: int, code: str, comment: str, sections: dict[Any, list[tuple[int, str]]],
            known: dict[str | None, Struct], inside: tuple[str | None, ...]) -> Member:
    match = _FIELD.fullmatch(code)
    if not match:
        raise DefinitionError(f'line {number}: expected "<type> <name>" of fixed size, '
                              f'found "{excerpt(code, 100)}"')
    kind, name = match["type"], match["name"]
    of: str | Struct
    if kind in PRIMITIVES:
        of = PRIMITIVES[kind]
    elif _short(kind) not in sections:
        raise DefinitionError(f"line {number}: {name} has the type {kind}, which is not of fixed "
                              "size or not defined here")
    elif _short(kind) in inside:
        raise DefinitionError(f"line {number}: {kind} contains itself")
    elif len(inside) > _DEPTH_MOST:
        raise DefinitionError(f"line {number}: {kind} is in {len(inside)} messages; up to {_DEPTH_MOST} are read")
    else:
        of = _struct(_short(kind), sections, known, inside)
    shape: tuple[int, ...] = () if match["count"] is None else (int(match["count"]),)
    if kind == "char" and shape:
        of, shape = f"S{shape[0]}", ()
    unit, meaning, values = "", comment, {}
    comments = _COMMENT.fullmatch(comment)
    if comments and (comments["unit"] is not None or comments["name"].lower() == name):
        name, unit, meaning = comments["name"], comments["unit"] or "", comments["meaning"] or ""
        dims = _SHAPE.match(meaning)
        if dims and str(of).startswith("S"):
            meaning = meaning[dims.end():]
        elif dims and shape:
            true_shape = tuple(int(n) for n in dims[1].split(","))
            if prod(true_shape) == prod(shape) > 0:
                shape, meaning = true_shape, meaning[dims.end():]
        enum = _VALUES.search(meaning) if isinstance(of, str) and of[0] in "iu" else None
        if enum:
            meaning = meaning[:enum.start()]
            pairs = (pair.split("=") for pair in enum[1].split(",") if pair)
            values = {name.strip(): int(value) for name, value in pairs}
    return Member(name, of, shape, unit, meaning, values)
