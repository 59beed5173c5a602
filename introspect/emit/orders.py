# SPDX-License-Identifier: Apache-2.0
"""The byte order of messages, for registers/message.h: which numbers of which width follow one
another, so that a machine of the other order can reverse them. All of a library's:
`fledge_messages_<name>`; each one, with its struct's size: `fledge_message_<Name>`."""
from __future__ import annotations

from introspect.emit import ctext
from introspect.model import Kind, Library, Struct

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Iterator


def emit(library: Library) -> dict[str, str]:
    messages = [s for s in library.structs if s.kind is Kind.MESSAGE]
    parts = [ctext.banner(f"The byte order of library {library.name}'s messages."),
             '#include "registers/message.h"\n']
    parts += [_message(s) for s in messages]
    names = "".join(f"    &fledge_message_{s.name},\n" for s in messages)
    # An array has one element at least, also where there is no message.
    parts.append(f"\nstatic const RegisterMessage *const messages[] = {{\n{names or '    0,'}}};\n"
                 f"\nextern const RegisterMessages fledge_messages_{library.name};\n"
                 f"const RegisterMessages fledge_messages_{library.name} = "
                 f"{{{len(messages)}u, messages}};\n")
    return {f"{library.name}_orders.c": "".join(parts)}


def _message(s: Struct) -> str:
    rows = "".join(f"    {{{width}u, {n}u}},\n" for width, n in runs(s))
    return (f"\nstatic const RegisterRun runs_{s.name}[] = {{\n{rows}}};\n"
            f"\nextern const RegisterMessage fledge_message_{s.name};\n"
            f"const RegisterMessage fledge_message_{s.name} = "
            f"{{{ctext.string(s.name)}, {s.size}u, {len(runs(s))}u, runs_{s.name}}};\n")


def runs(s: Struct) -> list[tuple[int, int]]:
    """(width in bytes, how many), in the order of memory; neighbours of one width are one run."""
    merged: list[tuple[int, int]] = []
    for width, n in _runs(s):
        if merged and merged[-1][0] == width:
            merged[-1] = (width, merged[-1][1] + n)
        else:
            merged.append((width, n))
    return merged


def _runs(s: Struct) -> Iterator[tuple[int, int]]:
    for field in s.fields:
        if field.struct:
            for _ in range(field.size // field.struct.size):
                yield from _runs(field.struct)
        else:
            yield field.element_size, field.size // field.element_size
