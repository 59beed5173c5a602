# SPDX-License-Identifier: Apache-2.0
"""SPICE's text kernels: names and their values.

    text_kernel.read("craft.tsc").numbers("SCLK01_MODULI_77")

Source: NAIF, "Kernel Required Reading"; the form is in world/environment/text_kernel.h.
"""
from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from decimal import Decimal
from typing import NamedTuple, NoReturn

from fledge.errors import did_you_mean
from fledge.files.kvn import refuse
from fledge.files.values import NUMBER, Clock

TOKEN = re.compile(r"'(?P<quoted>(?:[^']|'')*)'|(?P<mark>\+?=|[()])|(?P<word>(?:(?!\+=)[^\s,()='])+)|(?P<bad>[^\s,])")
DATE = re.compile(r"@(\d{4}|\d\d?)-([A-Z]{3,9}|\d\d?)-(\d{4}|\d\d?)(?:[-/T](\d\d):(\d\d)(?::(\d\d(?:\.\d*)?))?)?",
                  re.ASCII)
FAR = 1e300         # which whole numbers of any size would follow
MONTHS = ("JAN", "FEB", "MAR", "APR", "MAY", "JUN", "JUL", "AUG", "SEP", "OCT", "NOV", "DEC")


class Value(NamedTuple):
    """A value as it stands in the file."""
    text: str
    line: int
    kind: str       # "word", a number or a time, or "quoted"


@dataclass
class TextKernel:
    """A kernel. where: its path; values: by name, in the order of the file."""
    where: str
    values: dict[str, list[Value]] = field(default_factory=dict)

    def refuse(self, text: str, line: int = 0) -> NoReturn:
        """Raise SetupError, with the file and, where it is known, the line."""
        refuse(self.where, line, text)

    def numbers(self, name: str, count: int = 0) -> list[Decimal]:
        """The numbers of a name, as they are written; of a time, @2000-JAN-01-12:00:00, the seconds past that on its
        own scale. count: how many are expected, 0 for any. Raises SetupError."""
        if name not in self.values:
            self.refuse(f"has no {name}{did_you_mean(name, self.values)}")
        found = self.values[name]
        if count and len(found) != count:
            self.refuse(f"{name}: expected {count} numbers; found {len(found)}", found[0].line)
        return [self._number(name, value) for value in found]

    def _number(self, name: str, value: Value) -> Decimal:
        text = value.text.upper().replace("D", "E") if not value.text.startswith("@") else value.text.upper()
        try:
            if value.kind == "word" and NUMBER.fullmatch(text) and abs(float(text)) < FAR:
                return Decimal(text)
            if value.kind == "word" and (date := DATE.fullmatch(text)):
                return Decimal(_calendar(date)) / 10**9
        except ValueError:
            pass
        self.refuse(f"{name}: expected a number or a time, 1.5D0 or @2000-JAN-01-12:00:00; found {value.text!r}",
                    value.line)


def _calendar(date: re.Match[str]) -> int:
    """[ns] past 2000-01-01T12:00:00, 86,400 s a day. Raises ValueError."""
    first, month, last, hour, minute, second = date.groups()
    year, day = (first, last) if len(first) == 4 else (last, first)
    number = int(month) if month.isdigit() else MONTHS.index(month[:3]) + 1
    return Clock("MET").ns(f"{year}-{number:02}-{int(day):02}T{hour or '00'}:{minute or '00'}:{second or '00'}")


def read(path: str | os.PathLike[str]) -> TextKernel:
    """The names of a kernel. Raises SetupError with file, line and what was expected there."""
    kernel = TextKernel(os.fspath(path))
    try:
        with open(path, encoding="latin-1") as file:
            lines = file.read().split("\n")
    except OSError as error:
        kernel.refuse(f"cannot be read: {error.strerror}")
    tokens, data = [], False
    for number, line in enumerate(lines, 1):
        if line.strip() in (r"\begindata", r"\begintext"):
            data = line.strip() == r"\begindata"
        elif data:
            tokens += [Value((found[0] if found.lastgroup != "quoted" else found["quoted"].replace("''", "'")), number,
                             str(found.lastgroup)) for found in TOKEN.finditer(line)]
    at = 0
    while at < len(tokens):
        name, sign = tokens[at], tokens[at + 1] if at + 1 < len(tokens) else Value("", tokens[at].line, "")
        if name.kind != "word" or sign.text not in ("=", "+="):
            kernel.refuse(f"expected NAME = or NAME +=; found {name.text} {sign.text}", name.line)
        values, at = _values(kernel, tokens, at + 2)
        kernel.values[name.text] = (kernel.values.get(name.text, []) if sign.text == "+=" else []) + values
    return kernel


def _values(kernel: TextKernel, tokens: list[Value], at: int) -> tuple[list[Value], int]:
    """The value at a place, or those between brackets, and the place behind."""
    begin, several = at, at < len(tokens) and tokens[at].text == "(" and tokens[at].kind == "mark"
    at += several
    values: list[Value] = []
    while at < len(tokens) and tokens[at].kind in ("word", "quoted") and (several or not values):
        values.append(tokens[at])
        at += 1
    closed = not several or (at < len(tokens) and tokens[at].text == ")")
    if not values or not closed:
        line = tokens[min(at, len(tokens) - 1)]
        kernel.refuse(f"{tokens[begin - 2].text}: expected {'values and )' if several else 'a value'}; found "
                      f"{line.text if at < len(tokens) else 'the end'}", line.line)
    return values, at + several
