# SPDX-License-Identifier: Apache-2.0
"""The types of a field's elements, as in flight/exec/element.h, and short names of enumerators."""

import struct
from collections.abc import Iterable, Mapping
from functools import cache
from os.path import commonprefix
from typing import NamedTuple


class Element(NamedTuple):
    code: str       # of the module struct
    ctype: str      # in C

    @property
    def size(self) -> int:
        """[bytes]"""
        return struct.calcsize("=" + self.code)

    @property
    def is_float(self) -> bool:
        return self.code in "df"

    @property
    def dtype(self) -> str:
        """numpy's name: "f8", "i4"."""
        return ("f" if self.is_float else "i" if self.code.islower() else "u") + str(self.size)


ELEMENTS = {
    "f64": Element("d", "double"), "f32": Element("f", "float"),
    "i8": Element("b", "int8_t"), "u8": Element("B", "uint8_t"),
    "i16": Element("h", "int16_t"), "u16": Element("H", "uint16_t"),
    "i32": Element("i", "int32_t"), "u32": Element("I", "uint32_t"),
    "i64": Element("q", "int64_t"), "u64": Element("Q", "uint64_t"),
    "enum": Element("i", "int32_t"), "char": Element("c", "char"),
}


def short_names(whole: Iterable[str], enumeration: str = "") -> Mapping[str, str]:
    """Whole name -> short name of the enumerators of an enumeration, without its own name, or without the words with
    which all begin: GOOD of QUALITY_GOOD, IGRF of FIELD_IGRF. Whole names stay if one would be no identifier."""
    return _short_names(tuple(whole), enumeration)


@cache
def _short_names(names: tuple[str, ...], enumeration: str) -> dict[str, str]:
    start = f"{enumeration.upper()}_"
    if not enumeration or not all(name.startswith(start) for name in names):
        start = commonprefix(names) if len(names) > 1 and all(map(str.isupper, names)) else ""     # not of modes
        start = start[:start.rfind("_") + 1]
    short = {name: name.removeprefix(start) for name in names}
    return short if all(map(str.isidentifier, short.values())) else {name: name for name in names}
