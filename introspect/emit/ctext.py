# SPDX-License-Identifier: Apache-2.0
"""What every emitter of C needs: a first line, literals, and the order of includes."""
from __future__ import annotations

from collections.abc import Iterable

from introspect.model import Function, Struct


def banner(what: str) -> str:
    return f"/* {what} Written by introspect: do not edit. */\n"


def includes(structs: Iterable[Struct | Function]) -> str:
    return "".join(f'#include "{header}"\n' for header in sorted({s.header for s in structs}))


def string(text: str) -> str:
    """A literal in plain ASCII: other bytes, of UTF-8, in octal, so that no compiler's locale
    matters; `?` escaped where two would begin a trigraph. Long texts break after newlines."""
    lines = text.split("\n")
    pieces = [line + "\n" for line in lines[:-1]] + ([lines[-1]] if lines[-1] else [])
    return "\n        ".join(f'"{_escaped(piece)}"' for piece in pieces) or '""'


def _escaped(text: str) -> str:
    named = {"\n": "\\n", "\t": "\\t", '"': '\\"', "\\": "\\\\"}
    plain = "".join(named.get(chr(b)) or (chr(b) if 32 <= b < 127 else f"\\{b:03o}")
                    for b in text.encode())
    return plain.replace("??", "?\\?")
