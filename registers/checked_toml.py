# SPDX-License-Identifier: Apache-2.0
"""Checks a TOML file and reports all its mistakes at once, each with line, rule, finding and advice."""
from __future__ import annotations

import difflib
import json
import math
import re
import tomllib
from pathlib import Path
from collections.abc import Sequence
from typing import Any

from registers.location import line_of, lines_of


LEVELS = 32     # of tables in tables; what reads more takes the square of their number, or runs out of stack
_DEEP = re.compile(r"""(?:^|[\[{,])[ \t]*(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){%d}""" % LEVELS, re.MULTILINE)


class TomlError(Exception):
    """All that is wrong with a file, one complaint a line."""


def text_of(path: Path) -> str:
    """The text of a file. Raises TomlError if it is not in UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise TomlError(f"{path}:1: the file must be TOML; it is no text in UTF-8") from None


def parse(text: str, path: Path) -> tuple[dict, dict]:
    """The data in the text of the file at that path, and their lines: (data, lines_of it). Raises
    TomlError if it is no TOML."""
    if deep := _DEEP.search(text):
        line = text.count("\n", 0, deep.end()) + 1
        raise TomlError(f"{path}:{line}: a key has at most {LEVELS} parts; this one has more; leave out what is no key")
    try:
        return tomllib.loads(text), lines_of(text)
    except RecursionError:
        raise TomlError(f"{path}:1: the file must be TOML; its arrays or tables are nested too deeply") from None
    except ValueError as error:     # TOMLDecodeError; a number of thousands of digits
        match = re.search(r"at line (\d+)", str(error))
        number = match[1] if match else str(len(text.splitlines())) if "end of document" in str(error) else "1"
        raise TomlError(f"{path}:{number}: the file must be TOML; {error}") from error


def shown(value: Any) -> str:
    try:
        return json.dumps(value, default=str)
    except RecursionError:
        return "a value too deep to be shown"


class Tables:
    """Reads tables by their paths and collects the mistakes; after each it goes on with a harmless value."""

    whole = "d"     # how whole numbers are shown

    def __init__(self, file: str, lines: dict):
        self.file, self.lines = file, lines
        self.problems: list[tuple[int, str]] = []

    def refuse(self, path: tuple, rule: str, found: str, advice: str) -> None:
        self.problems.append((line_of(self.lines, path), f"{rule}; {found}; {advice}"))

    # ---- values

    def value(self, table: dict, path: tuple, key: str, kinds: tuple, words: str, default: Any) -> Any:
        """The value of a key; of `...` as default: it must be there."""
        if key not in table:
            if default is ...:
                self.refuse((*path, key), f"`{key}` must be given", "it is not there",
                            f"give {words}")
                return None
            return default
        value = table[key]
        if not isinstance(value, kinds) or isinstance(value, bool) and bool not in kinds:
            self.refuse((*path, key), f"`{key}` is {words}", f"it is {shown(value)}",
                        f"write {words}")
            return None if default is ... else default
        return value

    def integer(self, table: dict, path: tuple, key: str, low: int, high: int, default: Any = ...,
                multiple: int = 1) -> Any:
        value = self.value(table, path, key, (int,), "a whole number", default)
        if key not in table or value is None or not isinstance(table[key], int):
            return value
        if not low <= value <= high or value % multiple:
            of = f", a multiple of {multiple}" if multiple > 1 else ""
            self.refuse((*path, key), f"`{key}` is from {low:{self.whole}} to {high:{self.whole}}{of}",
                        f"it is {value:{self.whole}}", "choose one of those")
            return None
        return value

    def choice(self, table: dict, path: tuple, key: str, choices: Sequence[Any], default: Any = ...) -> Any:
        value = table.get(key, default)
        if value is ... or value not in choices:
            found = "it is not there" if value is ... else f"it is {shown(value)}"
            self.refuse((*path, key), f"`{key}` must say which", found,
                        f"choose {', '.join(map(shown, choices))}")
            return None
        return value

    def text(self, table: dict, path: tuple, key: str, default: Any = ...) -> str:
        return self.value(table, path, key, (str,), "a text", default) or ""

    def number(self, table: dict, path: tuple, key: str, default: Any = ...) -> float:
        value = self.value(table, path, key, (int, float), "a number", default)
        if value is not None and not math.isfinite(value):
            self.refuse((*path, key), f"`{key}` is finite", f"it is {value}", "give a finite one")
            value = None if default is ... else default
        return 0.0 if value is None else float(value)

    def keys(self, table: dict, path: tuple, valid: tuple[str, ...]) -> None:
        for key in table:
            if key not in valid:
                near = difflib.get_close_matches(key, valid, 1)
                self.refuse((*path, key), "only known keys count", f"there is `{key}`",
                            f"did you mean `{near[0]}`?" if near else f"choose {', '.join(valid)}")

    def table(self, table: dict, path: tuple, key: str) -> dict:
        value = table.get(key, {})
        if not isinstance(value, dict):
            self.refuse((*path, key), f"`{key}` is a table", f"it is {shown(value)}",
                        f"write [{key}]")
            return {}
        return value

    def tables(self, table: dict, path: tuple, key: str) -> list[dict]:
        value = table.get(key, [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            self.refuse((*path, key), f"`{key}` is an array of tables", f"it is {shown(value)}",
                        f"write [[{'.'.join(str(p) for p in (*path, key) if isinstance(p, str))}]]")
            return []
        return value

    def complaints(self) -> str:
        """All that was refused, in the order of the lines; "" if nothing was."""
        return "\n".join(f"{self.file}:{line}: {text}" for line, text in sorted(set(self.problems)))
