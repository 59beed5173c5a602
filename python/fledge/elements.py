# SPDX-License-Identifier: Apache-2.0
"""The types of a field's elements, as in flight/exec/element.h."""

import struct
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
