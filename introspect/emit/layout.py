# SPDX-License-Identifier: Apache-2.0
"""A C99 file of nothing but compile-time checks: that the compiler of any target lays out every
struct as in the model. A broken one is an array of negative size, named after the member."""
from __future__ import annotations

from introspect.emit import ctext
from introspect.model import Library, Struct


def emit(library: Library) -> dict[str, str]:
    parts = [ctext.banner(f"The memory layout of library {library.name}, checked by compiling."),
             "#include <stddef.h>\n\n", ctext.includes(library.structs), """
#define FLEDGE_CHECK(name, condition) typedef char fledge_layout_##name[(condition) ? 1 : -1]
"""]
    parts += [_checks(struct) for struct in library.structs]
    return {f"{library.name}_layout.c": "".join(parts)}


def _checks(struct: Struct) -> str:
    lines = [f"\nFLEDGE_CHECK({struct.name}, sizeof({struct.name}) == {struct.size});\n"]
    for f in struct.fields:
        check = f"FLEDGE_CHECK({struct.name}_{f.path.replace('.', '_')}, "
        lines.append(
            f"{check}offsetof({struct.name}, {f.path}) == {f.offset}\n"
            f"    && sizeof((({struct.name} *)0)->{f.path}) == {f.size});\n")
    return "".join(lines)
