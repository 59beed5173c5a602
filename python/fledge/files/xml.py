# SPDX-License-Identifier: Apache-2.0
"""CCSDS messages in XML, as the tokens of kvn.py.

A document type is refused, and with it all entities of its own: they can be made to grow without end.
"""
from __future__ import annotations

import re
from typing import NamedTuple
from xml.parsers import expat

from fledge.errors import SetupError
from fledge.files.kvn import Token, refuse

LINES = ("trajLine", "covLine", "manLine")      # elements that hold a row
MESSAGES = ("oem", "opm", "omm", "ocm", "aem", "apm", "acm", "cdm", "tdm", "rdm")


class _Element(NamedTuple):
    name: str
    line: int
    attributes: dict[str, str]
    pieces: list[str]


def tokens(text: str | bytes, where: str) -> list[Token]:
    """Those of all messages of a document; the version of a message is a keyword, as in KVN."""
    found: list[Token] = []
    opened: list[_Element] = []
    leaf = False
    parser = expat.ParserCreate("utf-8" if isinstance(text, str) else None)     # None: as the document declares
    text = text.encode() if isinstance(text, str) else text
    before = max(text.find(b"<"), 0)            # no line feed may stand before the declaration
    if text[:before].strip(b"\xef\xbb\xbf \t\r\n"):
        before = 0
    skipped = text.count(b"\n", 0, before)

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal leaf
        leaf, name, line = True, name.rpartition(":")[2], parser.CurrentLineNumber + skipped
        if name in MESSAGES:
            found.append(Token("key", f"CCSDS_{name.upper()}_VERS", attributes.get("version", ""), line))
        elif not name.isupper() and name not in LINES and "angle" not in attributes and "rate" not in attributes:
            found.append(Token("open", name, f"<{name}>", line))
        opened.append(_Element(name, line, attributes, []))

    def end(_: str) -> None:
        nonlocal leaf
        name, line, attributes, pieces = opened.pop()
        text = re.sub(r"\s*\n\s*", " ", "".join(pieces).strip())
        if name == "COMMENT":
            found.append(Token("comment", "", text, line))
        elif name in LINES:
            found.append(Token("row", name, text, line))
        elif name == "USER_DEFINED":
            found.append(Token("key", f"USER_DEFINED_{attributes.get('parameter', '')}", text, line, ""))
        elif "angle" in attributes or "rate" in attributes:     # of rotation1, rotation2 and rotation3
            name = attributes.get("angle") or attributes["rate"]
            found.append(Token("key", name, text, line, attributes.get("units", "")))
        elif name.isupper():
            if not leaf:
                refuse(where, line, f"{name}: expected a value; found other elements")
            found.append(Token("key", name, text, line, attributes.get("units", "")))
        elif name not in MESSAGES:
            found.append(Token("close", name, f"</{name}>", line))
        leaf = False

    def doctype(*_: object) -> None:
        refuse(where, parser.CurrentLineNumber + skipped,
               "expected no document type, whose entities could fill the memory; remove <!DOCTYPE ...>")

    parser.StartElementHandler, parser.EndElementHandler, parser.StartDoctypeDeclHandler = start, end, doctype
    parser.CharacterDataHandler = lambda data: opened[-1].pieces.append(data)
    try:
        parser.Parse(text[before:], True)
    except expat.ExpatError as error:
        refuse(where, error.lineno + skipped, f"expected XML; {expat.ErrorString(error.code)}")
    except SetupError:
        raise
    except (LookupError, ValueError) as error:          # an encoding that Python does not know
        refuse(where, 1, f"expected XML; {error}")
    return found
