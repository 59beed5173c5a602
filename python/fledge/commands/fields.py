# SPDX-License-Identifier: Apache-2.0
"""Fields of parameters and messages, and their values in packets.

    field = dictionary.block("flight.control")[1].fields[0]
    raw = encoded(field, 3.0)                   # big-endian
    values([field], raw)                        # {"K": 3.0}
"""
from __future__ import annotations

import struct as packing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field as with_default
from functools import cached_property
from typing import Any, TypeVar

from fledge.elements import ELEMENTS, short_names
from fledge.errors import SetupError, did_you_mean, listed

Item = TypeVar("Item")


@dataclass
class Field:
    """A field of parameters or of a message."""
    name: str
    type: str                   # f64, ..., enum, char, struct
    offset: int                 # [bytes] in its block, message or struct
    size: int                   # [bytes] of all its elements
    shape: list[int]
    unit: str
    meaning: str
    enumerators: dict[str, int] = with_default(default_factory=dict)
    fields: list[Field] = with_default(default_factory=list)    # of a struct
    rule: str = ""              # "> 0"

    @cached_property
    def labels(self) -> dict[int, Enumerator]:
        """Value -> the first enumerator that has it."""
        return {self.enumerators[name]: Enumerator(name, short)
                for name, short in reversed([*short_names(self.enumerators).items()])}


def described(fields: Sequence[Any], start: int = 0) -> list[Field]:
    """Fields of the tables of the headers as data."""
    return [Field(f.name, f.type, f.offset - start, f.size, list(f.shape), f.unit, f.doc,
                  dict(f.enumerators) if f.type == "enum" else {},
                  described(f.struct.fields) if f.type == "struct" else [], f.rule) for f in fields]


def parameters(struct: Any) -> tuple[list[Any], int, int]:
    """(fields, from, to [bytes]) of the parameters in a module's struct; [], 0, 0 if it has none."""
    fields = [f for f in struct.fields if f.group == "par"]
    return (fields, fields[0].offset, fields[-1].offset + fields[-1].size) if fields else ([], 0, 0)


def leaves(fields: Sequence[Any], base: int = 0, prefix: str = "") -> Iterator[tuple[str, Any, int]]:
    """(path, field, offset) of every field that is no struct; of an array of structs, of each element."""
    for f in fields:
        if f.type == "struct":
            inner = f.fields if isinstance(f, Field) else f.struct.fields
            n = 1
            for length in f.shape:
                n *= length
            for i, at in enumerate(range(base + f.offset, base + f.offset + f.size, f.size // n)):
                yield from leaves(inner, at, f"{prefix}{f.name}" + (f"[{i}]" if f.shape else "") + ".")
        else:
            yield prefix + f.name, f, base + f.offset


def byte_runs(fields: Sequence[Any]) -> list[tuple[int, int]]:
    """(width in bytes, how many) of the numbers in the order of memory, as introspect/emit/orders.py."""
    merged: list[tuple[int, int]] = []
    for _, f, _ in leaves(fields):
        width = ELEMENTS[f.type].size
        n = f.size // width
        if merged and merged[-1][0] == width:
            n += merged.pop()[1]
        merged.append((width, n))
    return merged


def place_of(items: Sequence[Item], names: Sequence[str], name: str, kind: str, where: str) -> tuple[int, Item]:
    """(place, item) of a name. Raises SetupError."""
    if name not in names:
        raise SetupError(f"{where} has no {kind} '{name}'{did_you_mean(name, names)} it has {listed(names)}")
    return names.index(name), items[names.index(name)]


def encoded(field: Field, value: Any, shape: Sequence[int] | None = None) -> bytes:
    """A value in big-endian bytes."""
    shape = field.shape if shape is None else shape
    if field.type == "char" and shape:
        if len(shape) == 1 and isinstance(value, str):
            raw = value.encode()
            if len(raw) > shape[0]:
                raise SetupError(f"{field.name} has room for {shape[0]} bytes; '{value}' has {len(raw)}")
            return raw.ljust(shape[0], b"\0")
    if shape:
        try:
            rows = len(value)
        except TypeError:   # a number, with or without unit
            rows = -1
        if rows != shape[0]:
            raise SetupError(f"{field.name} has the shape {list(field.shape)}; found {value!r}")
        return b"".join(encoded(field, item, shape[1:]) for item in value)
    if field.type == "struct":
        missing = [f.name for f in field.fields if f.name not in value]
        if missing:
            raise SetupError(f"{field.name}: give {listed(missing)} too")
        return b"".join(encoded(f, value[f.name]) for f in field.fields)
    if field.type == "enum" and isinstance(value, str):
        short = short_names(field.enumerators)
        value = field.enumerators[value] if value in field.enumerators else place_of(
            list(field.enumerators.values()), list(short.values()), value, "enumerator", field.name)[1]
    element = ELEMENTS[field.type]
    try:
        return packing.pack(">" + element.code, float(value) if element.is_float else int(value))
    except (packing.error, TypeError, ValueError, OverflowError) as error:
        raise SetupError(f"{field.name} is a {element.ctype}: {error}; found {value!r}") from None


def reversed_numbers(fields: Sequence[Any], content: bytes, start: int = 0) -> bytes:
    """The same numbers in the other byte order."""
    out = bytearray(content)
    for _, f, at in leaves(fields, -start):
        width = ELEMENTS[f.type].size
        for i in range(at, at + f.size, width):
            out[i:i + width] = content[i:i + width][::-1]
    return bytes(out)


def values(fields: Sequence[Field], raw: bytes, mark: str = ">") -> dict[str, Any]:
    """Field -> value of a block or message: numbers, texts, enumerators by name, lists, dicts. mark: ">" big-endian."""
    return {f.name: value_of(f, raw[f.offset:f.offset + f.size], f.shape, mark) for f in fields}


class Enumerator(str):
    """The whole name of an enumerator, as databases of ground stations have it; its short name equals it, too."""

    short: str

    def __new__(cls, whole: str, short: str) -> Enumerator:
        enumerator = super().__new__(cls, whole)
        enumerator.short = short
        return enumerator

    def __eq__(self, other: object) -> bool:
        return str.__eq__(self, other) is True or other == self.short

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = str.__hash__


def value_of(field: Field, raw: bytes, shape: Sequence[int], mark: str) -> Any:
    """The value of a field, or of elements of it."""
    if field.type == "char" and len(shape) == 1:
        return raw.rstrip(b"\0").decode(errors="replace")
    if len(shape) == 1 and field.type != "struct":      # all at once
        numbers = packing.unpack(f"{mark}{shape[0]}{ELEMENTS[field.type].code}", raw)
        return [field.labels.get(number, number) for number in numbers] if field.type == "enum" else list(numbers)
    if shape:
        size = len(raw) // shape[0]
        return [value_of(field, raw[i * size:(i + 1) * size], shape[1:], mark) for i in range(shape[0])]
    if field.type == "struct":
        return values(field.fields, raw, mark)
    value = packing.unpack(mark + ELEMENTS[field.type].code, raw)[0]
    return field.labels.get(value, value) if field.type == "enum" else value
