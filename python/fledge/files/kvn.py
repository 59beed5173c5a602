# SPDX-License-Identifier: Apache-2.0
"""CCSDS messages as lines of KEYWORD = value: their tokens, which xml.py makes of the other form, too."""
from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple, NoReturn

from fledge.errors import SetupError, printable

KEY = re.compile(r"\s*([A-Z][A-Z0-9_]*)\s*=(.*)", re.DOTALL)
MARK = re.compile(r"\s*([A-Z]+)_(START|STOP)\s*")
UNIT = re.compile(r"(.*?)\s*\[(.*)\]", re.DOTALL)


class Token(NamedTuple):
    """A piece of a message. kind: "key", "row" of a table, "open" or "close" of a block or "comment".

    name: the keyword; of a block that of its marks in KVN, that of its element in XML.
    """
    kind: str
    name: str
    text: str
    line: int
    unit: str | None = None     # None: the text may have it, "10 [km]"

    def split(self) -> tuple[str, str]:
        """The text of a number and its unit, "" without."""
        found = UNIT.fullmatch(self.text) if self.unit is None else None
        return (found[1].strip(), found[2].strip()) if found else (self.text, self.unit or "")


def refuse(where: str, line: int, text: str) -> NoReturn:
    raise SetupError(printable(f"{where}, line {line}: {text}"))


def tokens(text: str) -> Iterator[Token]:
    """Those of all messages of a text, line by line."""
    for number, line in enumerate(text.lstrip("\ufeff").split("\n"), 1):
        line = line.strip()
        if re.match(r"COMMENT\b", line):
            yield Token("comment", "", line[7:].strip(), number)
        elif key := KEY.fullmatch(line):
            yield Token("key", key[1], key[2].strip(), number)
        elif mark := MARK.fullmatch(line):
            yield Token("open" if mark[2] == "START" else "close", mark[1], line, number)
        elif line:
            yield Token("row", "", line, number)
