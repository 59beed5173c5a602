# SPDX-License-Identifier: Apache-2.0
"""The header of one interface, as a person would write it: reading it again gives the interface."""
from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterable

from introspect.comment import WORDS
from introspect.model import Bounds, Enumeration, Field, Group, Kind, Struct, Type

COLUMNS = 120


def text(s: Struct, includes: Iterable[str], enums: Iterable[Enumeration], messages: Iterable[Struct]) -> str:
    """The header at s.header. includes: those of its messages; enums, messages: what it declares itself."""
    guard = s.header.upper().replace("/", "_").replace(".", "_")
    lines = ["/* SPDX-License-Identifier: Apache-2.0 */", f"#ifndef {guard}", f"#define {guard}", ""]
    lines += [*(f'#include "{header}"' for header in sorted(set(includes))), ""]
    for enum in enums:
        lines += [*_doc(enum.doc), f"typedef enum {enum.name} {{",
                  *(f"    {v.name} = {v.value}," for v in enum.values), f"}} {enum.name};", ""]
    for message in messages:
        lines += [*_doc(message.doc), f"typedef struct {message.name} {{",
                  *_fields(message.fields, "    "), f"}} {message.name};", ""]
    lines += [*_doc(s.doc), f"typedef struct {s.name} {{"]
    for group in (Group.IN, Group.OUT, Group.PAR, Group.MEM):
        if fields := [f for f in s.fields if f.group is group]:
            lines += ["    struct {", *_fields(fields, "        "), f"    }} {group.value};"]
    lines += [f"}} {s.name};", ""]
    if s.kind is Kind.MODULE:
        lines += [f"void {s.snake_name}_reset({s.name} *m);", f"void {s.snake_name}_update({s.name} *m, Tick t);", ""]
    return "\n".join([*lines, "#endif", ""])


def _doc(doc: str) -> list[str]:
    lines = doc.splitlines()
    if not lines:
        return []
    lines = [f"/** {lines[0]}", *(f" *  {line}".rstrip() for line in lines[1:])]
    return [*lines[:-1], f"{lines[-1]} */"]


def _fields(fields: Iterable[Field], indent: str) -> list[str]:
    """Their lines. Comments of neighbours stand in one column."""
    lines: list[str] = []
    for commented, run in itertools.groupby(fields, key=lambda f: not f.is_spare and bool(comment(f))):
        members = [(f"{indent}{_declaration(f)}", f) for f in run]
        width = max(len(declaration) for declaration, _ in members)
        for declaration, f in members:
            words = textwrap.wrap(comment(f), max(COLUMNS - width - 6, 40), break_long_words=False,
                                  break_on_hyphens=False) if commented else []
            lines += [f"{start.ljust(width)} ///< {line}" for start, line in
                      zip([declaration] + [""] * len(words), words)] or [declaration]
    return lines


def _declaration(f: Field) -> str:
    """A Vec3 is an array by another name, whose own dimensions the declaration leaves out."""
    inner = {"Vec3": 1, "Mat3": 2}.get(f.ctype, 0) if f.type is Type.F64 else 0
    return f"{f.ctype} {f.name}{''.join(f'[{n}]' for n in f.shape[:len(f.shape) - inner])};"


def comment(f: Field) -> str:
    """The words of its comment: introspect.comment.parse() gives the same parts again."""
    clauses = [word for word in WORDS if word in f.clauses] + (_bounds(f.bounds) if f.bounds else [])
    clauses += ["range" + _bounds(f.range)[0].removeprefix("in")] if f.range else []
    clauses += ([f"count {f.count}"] if f.count else []) + ([f"distinct {f.distinct}"] if f.distinct else [])
    parts = [f"[{f.unit.text}]"] if f.unit else []
    parts += [", ".join(clauses) + ":"] if clauses else []
    return " ".join([*parts, f.doc]).strip()


def _bounds(b: Bounds) -> list[str]:
    if b.lo is not None and b.hi is not None and not b.lo_open and not b.hi_open:
        return [f"in [{_number(b.lo)}, {_number(b.hi)}]"]
    ends = ((b.lo, ">", b.lo_open), (b.hi, "<", b.hi_open))
    return [f"{sign}{'' if is_open else '='} {_number(x)}" for x, sign, is_open in ends if x is not None]


def _number(x: float) -> str:
    return repr(x).removesuffix(".0")
