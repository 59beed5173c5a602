# SPDX-License-Identifier: Apache-2.0
"""The reader's use of libclang: a parse of all headers, and a few queries on the result."""
from __future__ import annotations

import os
import re

from clang import cindex
from clang.cindex import Cursor, CursorKind, TypeKind

from introspect.errors import HeaderError, Problem
from introspect.sources import Headers

ALL = "everything.c"

# The hosted headers of C99, which belong to a C library. Layout needs only size_t of them. So for
# another target almost empty headers are enough, and its C library need not be installed.
_HOSTED = ("assert", "complex", "ctype", "errno", "fenv", "inttypes", "locale", "math", "setjmp",
           "signal", "stdio", "stdlib", "string", "time", "wchar", "wctype")
_HERE = os.path.dirname(os.path.abspath(__file__))

# Clang's second complaint about two structs of one name, about their typedefs.
_ECHO = re.compile(r"typedef redefinition .*'(?:struct|enum) \(unnamed")

_LIBRARY = cindex.conf.lib
_LIBRARY.clang_Cursor_getCommentRange.argtypes = [Cursor]
_LIBRARY.clang_Cursor_getCommentRange.restype = cindex.SourceRange


def parse(headers: Headers, target: str | None = None) -> cindex.TranslationUnit:
    """All headers as one translation unit, for this machine or another. Raises HeaderError."""
    text = "".join(f'#include "{path}"\n' for path in headers.sources)
    args = ["-xc", "-std=c99", *(f"-I{root}" for root in headers.roots)]
    unsaved = [(ALL, text)]
    if target:
        args += [f"--target={target}", "-ffreestanding", "-nostdlibinc", f"-isystem{_HERE}"]
        unsaved += [(f"{_HERE}/{name}.h", "#include <stddef.h>\n") for name in _HOSTED]
    unit = cindex.Index.create().parse(
        ALL, args=args, unsaved_files=unsaved,
        options=cindex.TranslationUnit.PARSE_SKIP_FUNCTION_BODIES)
    problems = [_problem(diagnostic, headers, target) for diagnostic in unit.diagnostics
                if diagnostic.severity >= cindex.Diagnostic.Error
                and not _ECHO.match(diagnostic.spelling)]
    if problems:
        raise HeaderError(problems)
    return unit


def _problem(diagnostic: cindex.Diagnostic, headers: Headers, target: str | None) -> Problem:
    place = diagnostic.location
    file = headers.show(place.file.name) if place.file else "command line"
    found = f"clang says: {diagnostic.spelling}"
    if "redefinition" in diagnostic.spelling:
        for note in diagnostic.children:
            if "previous" in note.spelling and note.location.file:
                before = headers.show(note.location.file.name)
                found += f" (before in {before}:{note.location.line})"
        return Problem(file, place.line, "a name stands for one thing in all headers", found,
                       "rename one of them")
    where = f" for {target}, without an operating system" if target else ""
    return Problem(file, place.line, f"a header compiles as C99{where}", found, "correct it")


def file_of(cursor: Cursor) -> str:
    """The absolute path of the header that declares it; empty for a built-in declaration."""
    file = cursor.location.file
    return os.path.abspath(file.name) if file and file.name != ALL else ""


def comment_place(cursor: Cursor) -> tuple[str, int] | None:
    """Where a declaration's comment begins: clang gives one comment to all that share its line."""
    start = _LIBRARY.clang_Cursor_getCommentRange(cursor).start
    return (start.file.name, start.offset) if start.file else None


def tag(cursor: Cursor) -> str:
    """The tag of a struct or enum, empty if it has none: libclang 16 and later then spell something else."""
    return cursor.spelling if cursor.type.spelling.endswith(f" {cursor.spelling}") else ""


def struct_name(cursor: Cursor) -> str:
    """The tag of a struct, or, where it has none, its typedef's name."""
    return tag(cursor) or cursor.type.spelling


def member_name(member: Cursor) -> str:
    """The name of a member, empty if it has none: libclang 19 then spells its place."""
    return "" if "(" in member.spelling else member.spelling


def is_group(member: Cursor) -> bool:
    """Whether a member is a `struct {...} name`, or an array of such."""
    type_ = member.type
    while type_.kind is TypeKind.CONSTANTARRAY:
        type_ = type_.element_type
    declaration = type_.get_declaration()
    return declaration.kind is CursorKind.STRUCT_DECL and not tag(declaration)


def offsets(record: cindex.Type, groups: bool) -> list[int]:
    """The offsets in bytes of all members, or of those of its groups, with the offset of each group."""
    members = [(member, member.get_field_offsetof() // 8) for member in record.get_fields()]
    if not groups:
        return [offset for _, offset in members]
    return [start + offset for group, start in members for offset in offsets(group.type.get_canonical(), False)]
