# SPDX-License-Identifier: Apache-2.0
"""Structs that no header declares, laid out as a C compiler would do it, and the tables of those that one does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from fledge import _core
from introspect import comment, units
from introspect.model import Bounds, Enumeration, Enumerator, Field, Group, Kind, Struct, Type


def lay_out(fields: Sequence[Field]) -> tuple[list[Field], int, int]:
    """(fields in their places, with spares; size; alignment), as a C compiler lays out the header's struct."""
    align = max((_alignment(f) for f in fields), default=1)
    placed: list[Field] = []
    offset = 0
    for group in Group:
        own = [f for f in fields if f.group is group]
        names = iter(["spare", *(f"spare{i}" for i in range(2, len(own) + 3))])
        # A group ends at a multiple of the struct's alignment, so that no padding follows it.
        for f in [*own, None] if own else []:
            gap = -offset % (_alignment(f) if f else align)
            if gap:
                placed.append(Field(next(names), Type.U8, "uint8_t", (gap,), offset, gap, own[0].line, group))
                offset += gap
            if f:
                placed.append(replace(f, offset=offset))
                offset += f.size
    return placed, offset, align


def _alignment(f: Field) -> int:
    return f.struct.align if f.struct else f.element_size


def head(types: dict[str, Any]) -> Field:
    """The head of a message; types: takes its type."""
    types["Head"] = _core.library("flight")["Head"]
    struct = described(_core.struct(types["Head"]))
    return Field("head", Type.STRUCT, "Head", (), 0, struct.size, 0, struct=struct)


@cache
def described(struct: _core.Struct) -> Struct:
    """A table as introspect's model of it: the docs of the enumerators and the lines of the header are not in it."""
    return Struct(struct.name, struct.doc, Kind(struct.kind), struct.size, struct.align,
                  tuple(described_field(f) for f in struct.fields), struct.header, struct.header, 0)


def described_field(f: Any) -> Field:
    """The same of a field."""
    lo, hi, lo_open, hi_open = f.bounds
    clauses = frozenset(word for word in comment.WORDS if getattr(f, word.replace("-", "_")))
    return Field(f.name, Type[f.type.upper()], f.ctype, tuple(f.shape), f.offset, f.size, 0, Group(f.group),
                 units.parse(f.unit) if f.unit else None, clauses,
                 None if lo is hi is None else Bounds(lo, hi, lo_open, hi_open), f.count, f.distinct, f.doc,
                 described(f.struct) if f.type == "struct" else None, described_enum(f) if f.type == "enum" else None)


def described_enum(f: Any) -> Enumeration:
    """The enumeration of a field, without the lines of the header."""
    name, doc, values = f.enumeration
    return Enumeration(name, doc, tuple(Enumerator(*value) for value in values), "")
