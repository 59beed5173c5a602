# SPDX-License-Identifier: Apache-2.0
"""Messages as ros2msg schemas, for archives that any MCAP reader can open.

One line per field, whose comment keeps what ROS 2 cannot say, its true name first:

    <ros type> <lower-cased name>  # <true name> [<unit>] (<shape>) <meaning> {<NAME>=<value>, ...}

Unit, shape (of arrays), meaning and values (of enums) stand there only if there are any. Arrays
have one dimension; the shape in the comment holds all of them. A text is char[n]. Nested structs follow, each
after a line of 80 `=` and `MSG: fledge/<name>`.

A payload is the struct's bytes, which are its CDR exactly if there is no padding and every number
stands at a multiple of its size from the start. The reader has made sure; the proof is here.
"""
from __future__ import annotations

import math
from collections.abc import Iterator

from introspect.errors import HeaderError, Problem
from introspect.model import Field, Kind, Library, Struct, Type

PACKAGE = "fledge"

SCALARS = {Type.F64: "float64", Type.F32: "float32", Type.I8: "int8", Type.U8: "uint8", Type.I16: "int16",
           Type.U16: "uint16", Type.I32: "int32", Type.U32: "uint32", Type.I64: "int64", Type.U64: "uint64",
           Type.CHAR: "char"}


def emit(library: Library) -> dict[str, str]:
    """One file per message."""
    return {f"{s.name}.msg": text(s) for s in library.structs if s.kind is Kind.MESSAGE}


def text(message: Struct) -> str:
    """The schema of a message, with those of the structs it is made of."""
    _prove_cdr(message)
    nested: dict[str, Struct] = {}
    _collect(message, nested)
    parts = [_lines(message)]
    for struct in nested.values():
        parts.append("=" * 80 + f"\nMSG: {PACKAGE}/{struct.name}\n" + _lines(struct))
    return "".join(parts)


def _collect(struct: Struct, into: dict[str, Struct]) -> None:
    for used in struct.uses():
        if used.name not in into:
            into[used.name] = used
            _collect(used, into)


def _lines(struct: Struct) -> str:
    return "".join(_line(f) + "\n" for f in struct.fields)


def _line(f: Field) -> str:
    dimension = f"[{math.prod(f.shape)}]" if f.shape else ""
    words = [f"# {f.name}"]
    if f.unit:
        words.append(f"[{f.unit.text}]")
    if f.shape:
        words.append(f"({', '.join(map(str, f.shape))})")
    if f.doc:
        words.append(f.doc)
    if f.enum:
        values = ", ".join(f"{name}={value}" for name, value in f.enum.short_names.items())
        words.append(f"{{{values}}}")
    elif f.doc.endswith("}"):   # a text of its own, as {k=2}
        words.append("{}")
    return f"{_ros_type(f)}{dimension} {f.name.lower()}  {' '.join(words)}"


def _ros_type(f: Field) -> str:
    if f.struct:
        return f"{PACKAGE}/{f.struct.name}"
    return SCALARS[f.enum.type if f.enum else f.type]


def _prove_cdr(message: Struct) -> None:
    """Serialise in thought: CDR aligns each number to its size and pads nowhere else."""
    position = 0
    for offset, size in _numbers(message):
        position += -position % size
        if position != offset:
            break
        position += size
    else:
        if position == message.size:
            return
    raise HeaderError([Problem(message.path, message.line, "a message's bytes are its CDR",
                               f"`{message.name}` has padding at byte {position}", "add `spare`")])


def _numbers(struct: Struct, start: int = 0) -> Iterator[tuple[int, int]]:
    """Offset and size of every number in the order of memory, elements of arrays one by one."""
    for f in struct.fields:
        for i in range(math.prod(f.shape)):
            offset = start + f.offset + i * f.element_size
            if f.struct:
                yield from _numbers(f.struct, offset)
            else:
                yield offset, f.element_size
