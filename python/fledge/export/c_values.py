# SPDX-License-Identifier: Apache-2.0
"""From an object's bytes to the C that sets them: only what is not zero, and exactly.

"Not zero" is a matter of bytes, or -0.0 would be lost. Doubles are written as Python's repr does: the
shortest decimal that reads back as the same double, with every compiler.
"""
from __future__ import annotations

import struct as packing
from collections.abc import Container, Iterator, Sequence
from typing import TYPE_CHECKING

from fledge.elements import ELEMENTS
from fledge.export.c_text import COLUMNS, declaration, string

if TYPE_CHECKING:
    from fledge import _core

TABLE = 6       # from so many elements on, a plain array is set from a table


class Setting:
    """Lines of C that set one field, and the note of the header on it."""

    def __init__(self, field: _core.Field, lines: list[str]) -> None:
        self.name = field.name
        self.lines = lines
        self.note = " ".join(([f"[{field.unit}]"] if field.unit else []) + ([field.doc] if field.doc else []))


def settings(struct: _core.Struct, memory: bytes, start: str, stem: str,
             leave_out: Container[str] = ()) -> Iterator[Setting]:
    """The Settings that make zeroed memory equal to `memory`.

    start: the C expression of the object; stem: what the names of tables begin with; leave_out:
    expressions of fields that are set elsewhere.
    """
    for field in struct.fields:
        name = (f"{field.group}." if field.group else "") + field.name
        target = f"{start}.{name}" if "[" in start or "." in start or "->" in start else f"{start}->{name}"
        raw = memory[field.offset:field.offset + field.size]
        if target in leave_out or not any(raw):
            continue
        if field.type == "struct":
            size = field.struct.size
            for i, index in enumerate(indices(field.shape)):
                yield from settings(field.struct, raw[i * size:(i + 1) * size], target + index,
                                    f"{stem}_{field.name}" + "".join(c for c in index if c != "[").replace("]", ""),
                                    leave_out)
        elif field.type == "char":
            yield Setting(field, list(texts(field, raw, target)))
        elif field.ctype in ("Vec3", "Mat3"):
            yield Setting(field, list(vectors(field, raw, target)))
        else:
            yield Setting(field, list(numbers(field, raw, target, f"{stem}_{field.name}")))


def indices(shape: Sequence[int]) -> list[str]:
    """[""] of a scalar, "[0]", "[1]" ... of an array, "[0][0]", "[0][1]" ... in the order of memory."""
    texts = [""]
    for n in shape:
        texts = [index + f"[{i}]" for index in texts for i in range(n)]
    return texts


# --- a field each ----------------------------------------------------------------------------------

def texts(field: _core.Field, raw: bytes, target: str) -> Iterator[str]:
    """memcpy, not strcpy: a text may fill its field, and then has no end."""
    length = field.shape[-1] if field.shape else 1
    for i, index in enumerate(indices(field.shape[:-1])):
        text = raw[i * length:(i + 1) * length].rstrip(b"\0")
        if text:
            yield f"memcpy({target}{index}, {string(text)}, {len(text)});"


def vectors(field: _core.Field, raw: bytes, target: str) -> Iterator[str]:
    """Vec3 and Mat3: whole where several elements are given."""
    n, member, dims = (3, "v", 1) if field.ctype == "Vec3" else (9, "m", 2)
    for i, index in enumerate(indices(field.shape[:-dims])):
        row = raw[i * 8 * n:(i + 1) * 8 * n]
        values = [double(v) for v in packing.unpack(f"={n}d", row)]
        given = [j for j in range(n) if any(row[8 * j:8 * j + 8])]
        if n == 3 and len(given) > 1:
            yield f"{target}{index} = vec3({', '.join(values)});"
        elif n == 9 and len(given) > 3:
            rows = ["{" + ", ".join(values[j:j + 3]) + "}" for j in (0, 3, 6)]
            begin = f"    {target}{index} = (Mat3){{{{"
            if len(begin) + max(map(len, rows)) + 3 > COLUMNS:
                begin = begin.replace(" = ", " =\n        ")
            under = " " * len(begin.rpartition("\n")[2])
            yield begin.lstrip() + f",\n{under}".join(rows) + "}};"
        else:
            elements = indices(field.shape[-dims:])
            yield from (f"{target}{index}.{member}{elements[j]} = {values[j]};" for j in given)


def numbers(field: _core.Field, raw: bytes, target: str, table: str) -> Iterator[str]:
    """Scalars and plain arrays, the longer of them from a table."""
    size = len(raw) // max(1, len(indices(field.shape)))
    elements = [raw[i:i + size] for i in range(0, len(raw), size)]
    given = [i for i, e in enumerate(elements) if any(e)]
    last = given[-1] + 1
    if len(field.shape) == 1 and last >= TABLE and 2 * len(given) >= last:
        ctype = field.ctype if field.type == "enum" else ELEMENTS[field.type].ctype
        yield declaration(f"static const {ctype} {table}[] = ", [literal(field, e) for e in elements[:last]])
        yield f"memcpy({target}, {table}, sizeof {table});"
    else:
        index = indices(field.shape)
        yield from (f"{target}{index[i]} = {literal(field, elements[i])};" for i in given)


# --- a number each ---------------------------------------------------------------------------------

def literal(field: _core.Field, raw: bytes) -> str:
    """One element as C writes it."""
    if field.type == "f64":
        return double(packing.unpack("=d", raw)[0])
    if field.type == "f32":
        return single(packing.unpack("=f", raw)[0])
    value = packing.unpack("=" + ELEMENTS[field.type].code, raw)[0]
    if field.type == "enum":
        return next((n for n, v in field.enumerators if v == value), f"({field.ctype}){value}")
    return integer(value)


def double(value: float) -> str:
    """The shortest decimal that is this double. Infinities and NaN are refused before."""
    return repr(value)


def single(value: float) -> str:
    """The shortest decimal that is this float."""
    from numpy import float32

    return repr(float(str(float32(value)))) + "F"


def integer(value: int) -> str:
    """Plain where every int holds it; wider ones name their width, and the least have no literal."""
    if value == -2**31:
        return "INT32_MIN"
    if value == -2**63:
        return "INT64_MIN"
    if abs(value) < 2**31:
        return str(value)
    if 0 < value < 2**32:
        return f"{value}u"
    return f"INT64_C({value})" if value < 2**63 else f"UINT64_C({value})"
