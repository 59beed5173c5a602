# SPDX-License-Identifier: Apache-2.0
"""Parameters as cFE tables, one for each module that has any: what an operator changes, uploads and reads back is
one module's, and nothing else is touched.

A table is a word that identifies its layout, one with a check of its bytes, and the module's `par` as it lies in
memory. So the app recognises a file of another byte order, of an export before a header changed, and one that is cut:
cFE loads it, and the rest of the table keeps what it had. A check of 0 is of no use, as in the sources that a build
compiles. `.tbl` files are written here, in either byte order: cFE's file header and the table's, big-endian, then the
table in the target's order.
"""
from __future__ import annotations

import binascii
import struct as packing
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fledge.commands import reversed_numbers
from fledge.export import names
from fledge.export.c_text import plain, string, wrap
from fledge.export.c_values import literal
from fledge.export.read import Mission, Module

if TYPE_CHECKING:
    from fledge.targets.cfs.export.app import App

NAME_MAX, FILE_MAX = 15, 19          # CFE_MISSION_TBL_MAX_NAME_LENGTH, OS_MAX_FILE_NAME, less the end of a text
HEAD_SIZE = 8


@dataclass
class Table:
    module: Module
    name: str                        # Control
    stem: str                        # nav_control: of its source and of its .tbl
    fields: list
    content: bytes                   # of par, little-endian
    start: int                       # [bytes] where par begins in the module

    @property
    def layout(self) -> int:
        """A number that changes with the names, types, places and units of what is in it."""
        return zlib.crc32(repr(described(self.fields, self.start)).encode())

    @property
    def file(self) -> str:
        return f"/cf/{self.stem}.tbl"


def described(fields: Sequence[Any], start: int = 0) -> list[tuple]:
    return [(f.name, f.type, tuple(f.shape), f.offset - start, f.unit,
             described(f.struct.fields) if f.type == "struct" else ()) for f in fields]


def tables(mission: Mission, app: App) -> list[Table]:
    """Those of all modules with parameters, in the order of the mission's list of parameters."""
    built: list[Table] = []
    taken_names: set[str] = set()
    taken_stems: set[str] = set()
    for module in mission.modules:
        fields = module.fields("par")
        if fields:
            start, end = fields[0].offset, fields[-1].offset + fields[-1].size
            name = shortened(names.camel(names.identifier(module.name)), NAME_MAX, taken_names)
            stem = shortened(f"{app.name}_{module.name.lower()}", FILE_MAX - len(".tbl"), taken_stems)
            built.append(Table(module, name, stem, fields, module.memory[start:end], start))
    return built


def shortened(text: str, longest: int, taken: set[str]) -> str:
    """A text that is short enough, and not taken: the later of two has a number at its end."""
    name, n = text[:longest].rstrip("_"), 2
    while name.lower() in taken:
        name, n = text[:longest - len(str(n))].rstrip("_") + str(n), n + 1
    taken.add(name.lower())
    return name


# --- files -----------------------------------------------------------------------------------------

def tbl(app: App, table: Table) -> bytes:
    """The bytes of a .tbl file. It holds no time, so that the same parameters give the same bytes."""
    block = table.content if app.order == "little" else reversed_numbers(table.fields, table.content, table.start)
    check = 0x10000 + binascii.crc_hqx(block, 0xFFFF)
    content = packing.pack({"little": "<II", "big": ">II"}[app.order], table.layout, check) + block
    header = packing.pack(">4s7I32s", b"cFE1", 8, 64, 0, 0, 0, 0, 0, f"{table.module.path} parameters".encode()[:31])
    return header + packing.pack(">3I40s", 0, 0, len(content), f"{app.prefix}.{table.name}".encode()) + content


def source(app: App, table: Table) -> str:
    """The source of one table, for the build of a cFS tree."""
    name = f"{app.prefix}_{table.name}"
    return "\n".join(["/* SPDX-License-Identifier: Apache-2.0 */",
                      f"/* The parameters of {plain(table.module.path)}, as its app was exported with. */",
                      '#include "cfe_tbl_filedef.h"', "", f'#include "{app.name}_tbl.h"', "",
                      "/* Not const, for the tool that makes a table of it. */",
                      f"{name}_t {name} = {{", f"    .Layout = {name.upper()}_LAYOUT,",
                      *values(table.fields, table.content, table.start), "};", "",
                      f"CFE_TBL_FILEDEF({name}, {app.prefix}.{table.name}, {table.module.name} parameters, "
                      f"{table.stem}.tbl)", ""])


def values(fields: Sequence[Any], content: bytes, start: int = 0, indent: str = "    ") -> Iterator[str]:
    """Designated initialisers of everything, exactly."""
    for field in fields:
        raw = content[field.offset - start:field.offset - start + field.size]
        text = nested(field, raw, list(field.shape))
        yield from wrap(f".{field.name} = {text},".split(" "), indent, indent + "    ")


def nested(field: Any, raw: bytes, shape: list[int]) -> str:
    if shape and not (field.type == "char" and len(shape) == 1):
        size = len(raw) // shape[0]
        return "{" + ", ".join(nested(field, raw[i:i + size], shape[1:])
                               for i in range(0, len(raw), size)) + "}"
    if field.type == "char":
        return string(raw.rstrip(b"\0")) if len(raw) > 1 else f"{raw[0]}"
    if field.type == "struct":
        return "{" + " ".join(line.strip() for line in values(field.struct.fields, raw)) + "}"
    if field.type == "enum":
        return str(packing.unpack("=i", raw)[0])
    return literal(field, raw)


def layout_checks(app: App, tables: Sequence[Table]) -> list[str]:
    """Lines that a compiler refuses where a table is not its module's parameters."""
    lines = []
    for table in tables:
        name, module = f"{app.prefix}_{table.name}_t", table.module
        lines.append(f"SAME(sizeof({name}), {HEAD_SIZE} + sizeof((({module.type} *)0)->par), {table.name});")
        for f in table.fields:
            lines.append(f"SAME(offsetof({name}, {f.name}), {HEAD_SIZE} + offsetof({module.type}, par.{f.name}) - "
                         f"offsetof({module.type}, par), {table.name}_{f.name});")
    return [row for line in lines for row in wrap(line.split(" "), "", "     ")]
