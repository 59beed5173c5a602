# SPDX-License-Identifier: Apache-2.0
"""The tables of sim/table.h, in C99: a library's structs and enums as constant data.

A struct's table is `fledge_struct_<name>`, an enum's `fledge_enum_<name>`, both defined by the
library that owns the header and by no other, so that a table's address stands for its type also
between libraries. All structs of a library: `fledge_library_<name>`.
"""
from __future__ import annotations

from introspect.emit import ctext, schema
from introspect.emit.ctext import string
from introspect.model import Bounds, Enumeration, Field, Kind, Library, Struct

# C99 requires of a compiler string literals of up to 4095 characters only. gcc and clang accept longer
# ones, but warn under -pedantic. Schemas of large messages are longer.
_PROLOGUE = """#include <stddef.h>

#include "sim/table.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Woverlength-strings"
#endif
"""


def emit(library: Library) -> dict[str, str]:
    interfaces = [s for s in library.structs if s.kind is Kind.MODULE]
    structs = {s.name: s for s in library.structs}
    enums = {e.name: e for e in library.enums}
    for struct in library.structs:
        structs |= {used.name: used for used in struct.uses()}
        enums |= {e.name: e for e in [struct.events, *(f.enum for f in struct.fields)] if e}

    parts = [ctext.banner(f"The tables of library {library.name}."), ctext.includes(interfaces),
             "\n" if interfaces else "", _PROLOGUE, "\n"]
    parts += [f"extern const FledgeEnum fledge_enum_{name};\n" for name in sorted(enums)]
    parts += [f"extern const FledgeStruct fledge_struct_{name};\n" for name in sorted(structs)]
    parts += [_enum(e) for e in library.enums]
    parts += [_struct(s) for s in library.structs]
    parts.append(_library(library))
    return {f"{library.name}_tables.c": "".join(parts)}


def _enum(e: Enumeration) -> str:
    rows = "".join(f"    {{{string(v.name)}, {v.value}, {string(v.doc)}}},\n" for v in e.values)
    return (f"\nstatic const FledgeEnumerator values_{e.name}[] = {{\n{rows}}};\n"
            f"\nconst FledgeEnum fledge_enum_{e.name} = {{\n"
            f"    .name = {string(e.name)},\n    .doc = {string(e.doc)},\n"
            f"    .n = {len(e.values)}u,\n    .values = values_{e.name},\n}};\n")


def _struct(s: Struct) -> str:
    members = [
        ("name", string(s.name)),
        ("doc", string(s.doc)),
        ("header", string(s.header)),
        ("folder", string(s.folder)),
        ("kind", f"FLEDGE_{s.kind.name}"),
        ("size", f"{s.size}u"),
        ("align", f"{s.align}u"),
        ("hash", f"UINT64_C(0x{s.hash:016x})"),
        ("n", f"{len(s.fields)}u"),
        ("fields", f"fields_{s.name}"),
    ]
    if s.kind is Kind.MESSAGE:
        members.append(("schema", string(schema.text(s))))
    if s.kind is Kind.MODULE:
        members += [(verb, f"(void (*)(void)){s.snake_name}_{verb}")
                    for verb in ("reset", "update")]
        members += [("service", f"&{s.snake_name}_service")] * s.service
    if s.events:
        members.append(("events", f"&fledge_enum_{s.events.name}"))
    return (f"\nstatic const FledgeField fields_{s.name}[] = {{\n"
            + "".join(_field(f) for f in s.fields) + "};\n"
            f"\nconst FledgeStruct fledge_struct_{s.name} = {{\n"
            + "".join(f"    .{key} = {value},\n" for key, value in members) + "};\n")


def _field(f: Field) -> str:
    """A field's row; members that are zero or NULL are left out."""
    members = [
        ("name", string(f.name)),
        ("offset", f"{f.offset}u"),
        ("size", f"{f.size}u"),
        ("type", f"FLEDGE_{f.type.name}"),
        ("group", f"FLEDGE_{f.group.name}"),
    ]
    flags = sorted(f.clauses) + ["spare"] * f.is_spare
    if flags:
        members.append(("flags", " | ".join(f"FLEDGE_{flag.upper().replace('-', '_')}"
                                            for flag in flags)))
    if f.bounds:
        members += _bounds(f.bounds)
    if f.shape:
        members += [("ndim", f"{len(f.shape)}u"),
                    ("shape", "{" + ", ".join(f"{n}u" for n in f.shape) + "}")]
    if f.count:
        members.append(("count", string(f.count)))
    if f.distinct:
        members.append(("distinct", string(f.distinct)))
    if f.struct:
        members.append(("sub", f"&fledge_struct_{f.struct.name}"))
    if f.enum:
        members.append(("values", f"&fledge_enum_{f.enum.name}"))
    members.append(("unit", string(f.unit.text if f.unit else "")))
    if f.unit and any(f.unit.dims):
        members.append(("dims", "{" + ", ".join(map(str, f.unit.dims)) + "}"))
    members += [("ctype", string(f.ctype)), ("doc", string(f.doc))]
    return "    {" + ",\n     ".join(f".{key} = {value}" for key, value in members) + "},\n"


def _bounds(b: Bounds) -> list[tuple[str, str]]:
    marks = {"HAS_LO": b.lo is not None, "HAS_HI": b.hi is not None,
             "LO_OPEN": b.lo_open, "HI_OPEN": b.hi_open}
    return [("bounds", " | ".join(f"FLEDGE_{mark}" for mark, holds in marks.items() if holds)),
            ("lo", repr(b.lo or 0.0)), ("hi", repr(b.hi or 0.0))]


def _library(library: Library) -> str:
    rows = "".join(f"    &fledge_struct_{s.name},\n" for s in library.structs)
    return (f"\nstatic const FledgeStruct *const structs[] = {{\n{rows}}};\n"
            f"\nextern const FledgeLibrary fledge_library_{library.name};\n"
            f"const FledgeLibrary fledge_library_{library.name} = {{\n"
            f"    .version = FLEDGE_TABLE_VERSION,\n    .name = {string(library.name)},\n"
            f"    .n = {len(library.structs)}u,\n    .structs = structs,\n}};\n")
