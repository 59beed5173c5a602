# SPDX-License-Identifier: Apache-2.0
"""Where in a TOML file a key stands, which tomllib does not say.

Covers what board files are made of: tables, arrays of tables, and keys at the start of a line.
"""
from __future__ import annotations

import re

Path = tuple[str | int, ...]

_TABLE = re.compile(r"^\s*(\[\[?)\s*([\w.-]+)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"^\s*([\w-]+)\s*=")


def lines_of(text: str) -> dict[Path, int]:
    """The line, from 1, of each table and key by its path: ("snorkel", 0, "field", 2, "bits")."""
    lines: dict[Path, int] = {(): 1}
    counts: dict[Path, int] = {}     # of the arrays of tables: the number of their last element
    here: Path = ()
    for number, line in enumerate(text.splitlines(), 1):
        if match := _TABLE.match(line):
            here = ()
            parts = match[2].split(".")
            for i, part in enumerate(parts):
                here += (part,)
                lines.setdefault(here, number)
                if i == len(parts) - 1 and match[1] == "[[":
                    counts[here] = counts.get(here, -1) + 1
                if here in counts:
                    here += (counts[here],)
            lines[here] = number
        elif match := _KEY.match(line):
            lines.setdefault((*here, match[1]), number)
    return lines


def line_of(lines: dict[Path, int], path: Path) -> int:
    """The line of the innermost part of `path` that has one."""
    while path not in lines:
        path = path[:-1]
    return lines[path]
