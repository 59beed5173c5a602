# SPDX-License-Identifier: Apache-2.0
"""CCSDS messages in XML, as the tokens of kvn.py.

A document type is refused, and with it all entities of its own: they can be made to grow without end.
"""
from __future__ import annotations

import re
from typing import NamedTuple
from xml.parsers import expat

from fledge.errors import SetupError
from fledge.files.kvn import SPACE, Token, refuse

LINES = ("trajLine", "covLine", "manLine")      # elements that hold a row
MESSAGES = ("oem", "opm", "omm", "ocm", "aem", "apm", "acm", "cdm", "tdm", "rdm")


class _Element(NamedTuple):
    name: str
    line: int
    attributes: dict[str, str]
    pieces: list[str]

    @property
    def is_value(self) -> bool:
        """Whether it has a text, and no other elements: keywords are in capitals."""
        return self.name.isupper() or self.name in LINES or bool({"angle", "rate"} & set(self.attributes))


def tokens(text: str | bytes, where: str) -> list[Token]:
    """Those of all messages of a document; the version of a message is a keyword, as in KVN."""
    found: list[Token] = []
    opened: list[_Element] = []
    parser = expat.ParserCreate("utf-8" if isinstance(text, str) else None)     # None: as the document declares
    text = text.encode() if isinstance(text, str) else text
    before = max(text.find(b"<"), 0)            # no line feed may stand before the declaration
    if text[:before].strip(SPACE):
        before = 0
    skipped = text.count(b"\n", 0, before)

    def start(name: str, attributes: dict[str, str]) -> None:
        element = _Element(name.rpartition(":")[2], parser.CurrentLineNumber + skipped, attributes, [])
        if opened and opened[-1].is_value:
            refuse(where, element.line, f"{opened[-1].name}: expected a value; found <{element.name}>")
        opened.append(element)
        if element.name in MESSAGES:
            key = f"CCSDS_{element.name.upper()}_VERS"
            found.append(Token("key", key, attributes.get("version", ""), element.line))
        elif not element.is_value:
            found.append(Token("open", element.name, f"<{element.name}>", element.line))

    def end(_: str) -> None:
        element = opened.pop()
        if element.is_value:
            found.append(_value(element))
        elif element.name not in MESSAGES:
            found.append(Token("close", element.name, f"</{element.name}>", element.line))

    def doctype(name: str, *_: object) -> None:
        if name.lower() == "html":
            refuse(where, parser.CurrentLineNumber + skipped, "expected a message in XML; found a page of the web")
        refuse(where, parser.CurrentLineNumber + skipped,
               "expected no document type, whose entities could fill the memory; remove <!DOCTYPE ...>")

    parser.StartElementHandler, parser.EndElementHandler, parser.StartDoctypeDeclHandler = start, end, doctype
    parser.CharacterDataHandler = lambda data: opened[-1].pieces.append(data)
    try:
        parser.Parse(text[before:], True)
    except expat.ExpatError as error:
        cut = error.code in (expat.errors.codes[expat.errors.XML_ERROR_NO_ELEMENTS],
                             expat.errors.codes[expat.errors.XML_ERROR_UNCLOSED_TOKEN])
        refuse(where, error.lineno + skipped, f"expected XML; {expat.ErrorString(error.code)}"
                                              f"{': the file may be cut' if cut else ''}")
    except SetupError:
        raise
    except (LookupError, ValueError) as error:          # an encoding that Python does not know
        refuse(where, 1, f"expected XML; {error}")
    return found


def _value(element: _Element) -> Token:
    text = re.sub(r"\s*\n\s*", " ", "".join(element.pieces).strip())
    attributes = element.attributes
    name = attributes.get("angle") or attributes.get("rate") or element.name    # of rotation1, rotation2 and rotation3
    if name == "COMMENT" or name in LINES:
        return Token("comment" if name == "COMMENT" else "row", name, text, element.line)
    if name == "USER_DEFINED":
        return Token("key", f"USER_DEFINED_{attributes.get('parameter', '')}", text, element.line, "")
    return Token("key", name, text, element.line, attributes.get("units", ""))
