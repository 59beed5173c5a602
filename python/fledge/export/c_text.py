# SPDX-License-Identifier: Apache-2.0
"""The layout of exported C: at most COLUMNS columns, and the notes of successive lines below one another."""
from __future__ import annotations

from collections.abc import Sequence

COLUMNS = 120   # as in .clang-format
TABLE = 20      # items of a list that clang-format lays out in columns


def wrap(pieces: Sequence[str], first: str, following: str, end: str = "") -> list[str]:
    """Pieces in lines that are full; the first begins with `first`, the others with `following`."""
    lines, line = [], first
    for i, piece in enumerate(pieces):
        gap = "" if line in (first, following) else " "
        room = COLUMNS - (len(end) if i + 1 == len(pieces) else 0)
        if gap and len(line) + 1 + len(piece) > room:
            lines.append(line)
            line, gap = following, ""
        line += gap + piece
    return [*lines, line + end]


def plain(text: str) -> str:
    """Text that cannot end a comment early, and does not continue it on the next line."""
    text = " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")
    return text.replace("??/", "?? /").rstrip("\\")


def comment(text: str, indent: str = "") -> list[str]:
    """A comment on lines of its own."""
    return wrap(plain(text).split(), f"{indent}/* ", f"{indent} * ", " */")


def doc(text: str, indent: str = "") -> list[str]:
    """The same, before a declaration."""
    return wrap(plain(text).split(), f"{indent}/** ", f"{indent} *  ", " */")


def string(raw: bytes) -> str:
    """A literal of bytes; what is not plain ASCII in octal, `?` escaped where two would begin a trigraph."""
    named = {10: "\\n", 9: "\\t", 34: '\\"', 92: "\\\\"}
    text = "".join(named.get(b) or (chr(b) if 32 <= b < 127 else f"\\{b:03o}") for b in raw)
    return '"' + text.replace("??", "?\\?") + '"'


def declaration(start: str, items: list[str], indent: str = "    ") -> str:
    """`start{a, b, c};`, on more lines where it is long, as many items in each."""
    text = f"{start}{{{', '.join(items)}}};"
    if len(indent + text) <= COLUMNS:
        return text
    if len(items) >= TABLE:
        return "\n".join([f"{start}{{", *table(items, 2 * indent)]) + "};"
    under = indent + " " * (len(start) + 1)
    if len(under) > COLUMNS // 2:
        start, under = start + "{\n" + 2 * indent, 2 * indent
    else:
        start += "{"
    widest = max(map(len, items)) + 2
    lines = -(-len(items) // max(1, (COLUMNS - len(under)) // widest))
    per_line = -(-len(items) // lines)
    rows = [", ".join(items[i:i + per_line]) for i in range(0, len(items), per_line)]
    return start + (",\n" + under).join(rows) + "};"


def table(items: Sequence[str], indent: str) -> list[str]:
    """Items in the least number of lines, below one another."""
    for most in range(COLUMNS // 3, 0, -1):     # an item, its comma and a space
        lines = -(-len(items) // most)
        columns = -(-len(items) // lines)       # no more than so many lines need
        widths = [max(map(len, items[i::columns])) + 1 for i in range(columns)]
        if len(indent) + sum(widths) + columns - 1 <= COLUMNS:
            break
    rows = [[f"{item}," for item in items[i:i + columns]] for i in range(0, len(items), columns)]
    rows[-1][-1] = rows[-1][-1][:-1]
    return [indent + " ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def broken(line: str, indent: str = "    ") -> str:
    """A long assignment continues after the =."""
    whole = indent + line
    return whole if len(whole) <= COLUMNS else whole.replace(" = ", f" =\n{indent}    ", 1)


def with_notes(rows: Sequence[tuple[str, str]], indent: str, begin: str = "/*", end: str = " */") -> list[str]:
    """(code, note) of each line -> lines with the notes behind the code, in a column where lines follow one another.

    A note that does not fit beside its code stands before it; of members, then all notes do.
    """
    def line(code: str, width: int, note: str) -> str:
        return f"{indent}{code.ljust(width)} {begin} {note}{end}"

    def fits(block: Sequence[tuple[str, str]]) -> bool:
        width = max(len(code) for code, _ in block)
        return all(len(line(code, width, note)) <= COLUMNS for code, note in block)

    lines: list[str] = []
    block: list[tuple[str, str]] = []

    def flush() -> None:
        width = max((len(code) for code, _ in block), default=0)
        lines.extend(line(code, width, note) for code, note in block)
        block.clear()

    rows = [(code, plain(note)) for code, note in rows]
    if not end and not all(fits([row]) for row in rows):
        return [line for code, note in rows for line in (*(doc(note, indent) if note else []), indent + code)]
    for code, note in rows:
        if not note or not fits([*block, (code, note)]):
            flush()
        if not note:
            lines.append(indent + code)
        elif fits([(code, note)]):
            block.append((code, note))
        else:
            lines += [*(comment(note, indent) if end else doc(note, indent)), broken(code, indent)]
    flush()
    return lines


def seconds(ns: int) -> str:
    """0.5 s"""
    return f"{ns / 1e9:.9g} s"
