# SPDX-License-Identifier: Apache-2.0
"""CCSDS messages as lines of KEYWORD = value: their tokens, which xml.py makes of the other form, too."""
from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, NoReturn

from fledge.disk import shown
from fledge.errors import SetupError, printable

KEY = re.compile(r"\s*([A-Z][A-Z0-9_]*)\s*=(.*)", re.DOTALL)
MARK = re.compile(r"\s*([A-Z]+)_(START|STOP)\s*")
UNIT = re.compile(r"(.*?)\s*\[(.*)\]", re.DOTALL)
PACKED = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"]\0\0": "lzma", b"PK\3\4": "zip"}
SPACE = b"\xef\xbb\xbf \t\r\n"     # before a text: the mark of UTF-8, and blanks
MOST = 600          # characters that a refusal shows


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
    """Raise SetupError. line: 0 of what is in no file."""
    refuse_at(f"{where}, line {line}" if line else where, text)


def refuse_at(place: str, text: str) -> NoReturn:
    """Raise SetupError; a long text is cut in its middle. place: the file and its line."""
    text = printable(text)
    raise SetupError(f"{printable(place)}: {text if len(text) <= MOST else f'{text[:MOST - 100]} ... {text[-100:]}'}")


def content(source: str | os.PathLike[str]) -> tuple[bytes, str]:
    """The bytes of a file, or of a text of several lines, and what refusals call it."""
    if isinstance(source, str) and ("\n" in source or source.lstrip()[:1] in ("<", "{", "[")):
        return source.encode(), "the text"
    where = str(shown(source))
    try:
        data = Path(source).read_bytes()
    except (OSError, ValueError) as error:
        raise SetupError(printable(f"{where}: expected a file, or a text of several lines; "
                                   f"{getattr(error, 'strerror', error)}")) from None
    for begin, program in PACKED.items():
        if data.startswith(begin):
            raise SetupError(f"{where}: expected a file that is not packed; found one of {program}: unpack it first")
    return data, where


def decoded(data: bytes, where: str) -> str:
    """A text in UTF-8. Raises SetupError."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        refuse(where, data.count(b"\n", 0, error.start) + 1,
               "expected a text in UTF-8; found another encoding, or no text: save it as UTF-8")


def tokens(text: str) -> Iterator[Token]:
    """Those of all messages of a text, line by line."""
    for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1):
        line = line.strip()
        if re.match(r"COMMENT\b", line):
            yield Token("comment", "", line[7:].strip(), number)
        elif key := KEY.fullmatch(line):
            yield Token("key", key[1], key[2].strip(), number)
        elif mark := MARK.fullmatch(line):
            yield Token("open" if mark[2] == "START" else "close", mark[1], line, number)
        elif line:
            yield Token("row", "", line, number)
