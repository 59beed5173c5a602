# SPDX-License-Identifier: Apache-2.0
"""The library's errors, and helpers for their texts."""
from __future__ import annotations

import re
from functools import wraps
from math import isfinite
from types import FunctionType

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from typing import Any, TypeVar

    from _core import CompositionError, RunError, SetupError

    Named = TypeVar("Named", bound=Callable[..., Any])


class Failure(Exception):
    """A command or flight cannot be carried out. `code` is the exit code: 2 a wrong request, 1 a failed one."""

    def __init__(self, text: str, code: int = 2) -> None:
        super().__init__(text)
        self.code = code


class Mistakes(Exception):
    """All mistakes in a file, one a line."""


class Stopped(Failure):
    """A run has ended at the first violation of a requirement, as the user chose. outcomes: of the violated
    requirements; the simulation keeps its state."""

    def __init__(self, text: str, outcomes: Sequence[Any]) -> None:
        super().__init__(text, 1)
        self.outcomes = outcomes


# Control characters, those that are not seen or turn the order of what is, and halves of pairs of UTF-16; the console's
# web/dom.js has the same.
_HIDDEN = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff"
                     "\ufff9-\ufffb\ud800-\udfff\U000e0000-\U000e007f]")
# What tables of others take for the beginning of a formula, also behind blanks and quotes.
_FORMULA = re.compile("[\\s'\"\u2018-\u201f`]*[=+\\-@\uff1d\uff0b\uff0d\uff20]|[\t\r]")


def printable(text: str, lines: bool = True) -> str:
    """A text of a file, a spacecraft or another program as it is shown: an escape is \u27e81B\u27e9, so that it drives
    no terminal and hides nothing. lines: line feeds and tabs stay."""
    text = _HIDDEN.sub(lambda match: f"\u27e8{ord(match[0]):02X}\u27e9", text)
    return text if lines else text.replace("\n", "\u27e80A\u27e9").replace("\t", "\u27e809\u27e9")


def excerpt(text: str, most: int = 500) -> str:
    """The same of a text of any length: its first characters."""
    return printable(text[:most]) + (f" ... and {len(text) - most} more characters" if len(text) > most else "")


def cell(text: str) -> str:
    """A text for a cell of CSV, as it is shown; one that a table would take for a formula begins with an apostrophe."""
    return ("'" if _FORMULA.match(text) else "") + printable(text)


def field(text: str) -> str:
    """The same between the commas of a line; in quotes wherever a table might divide it."""
    text = cell(text)
    return '"' + text.replace('"', '""') + '"' if set(text) & set('",;\t\n') else text


def for_json(content: object, word: Callable[[float], str | None] = lambda _: None) -> object:
    """What JSON can have: in place of a number that is not finite stands its word, None by default."""
    if isinstance(content, dict):
        return {key: for_json(value, word) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [for_json(value, word) for value in content]
    return word(content) if isinstance(content, float) and not isfinite(content) else content


def nearest(name: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """The known name that is most like `name`: the same but for case and underscores, or similar. "" if there is
    none."""
    from difflib import get_close_matches

    def bare(text: str) -> str:
        return text.lower().replace("_", "")

    names = list(known)
    same = [other for other in names if bare(other) == bare(name)]
    return next(iter(get_close_matches(name, same, 1, 0.0) or get_close_matches(name, names, 1, cutoff)), "")


def refuse_misspelt(owner: object, name: str, settings: Iterable[str]) -> None:
    """Raise AttributeError if an attribute that is to be set has almost the name of a setting, which it would miss."""
    near = "" if name.startswith("_") else nearest(name, settings, 0.8)
    if near not in ("", name):
        raise AttributeError(f"{type(owner).__name__} has no '{name}' to set; did you mean '{near}'?")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """What follows "... has no 'name'": "; did you mean 'names'?", or ";" if no known name is similar."""
    near = nearest(name, known)
    return f"; did you mean '{near}'?" if near else ";"


def instead(name: str, known: Iterable[str]) -> str:
    """The same of a name in Python, which may be a word of Basilisk: "; here, Basilisk's 'recorder' is ...;"."""
    from fledge.basilisk import WORDS

    names = list(known)
    if name in WORDS and not nearest(name, names, 1.0):
        return f"; here, Basilisk's '{name}' is {WORDS[name]};"
    return did_you_mean(name, names)


def suggesting(**synonyms: str) -> Callable[[Named], Named]:
    """Decorates a function, or a class, of which it means the constructor and the public methods: of arguments that do
    not fit, the TypeError says which it takes, and of a keyword that it does not have, the nearest one.

    synonyms: keyword that others use -> the one here, as inc="i"
    """
    def decorate(item: Any) -> Any:
        if not isinstance(item, type):
            return _suggesting(item, synonyms)
        for name, value in list(vars(item).items()):
            wrapper = type(value) if isinstance(value, (classmethod, staticmethod)) else None
            function = value.__func__ if wrapper else value
            if isinstance(function, FunctionType) and (name == "__init__" or not name.startswith("_")):
                wrapped = _suggesting(function, synonyms, wrapper is not staticmethod)
                setattr(item, name, wrapper(wrapped) if wrapper else wrapped)
        return item

    return decorate


def _suggesting(function: FunctionType, synonyms: Mapping[str, str], method: bool = False) -> Any:
    code = function.__code__
    takes = code.co_varnames[code.co_posonlyargcount or int(method):code.co_argcount + code.co_kwonlyargcount]
    if not takes:
        return function

    @wraps(function)
    def call(*given: Any, **named: Any) -> Any:
        try:
            return function(*given, **named)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise       # of its body
            title = function.__qualname__.rpartition("<locals>.")[2].removesuffix(".__init__")
            unknown = next((name for name in named if name not in takes), "")
            means = f"; did you mean '{synonyms[unknown]}'?" if unknown in synonyms else \
                did_you_mean(unknown, takes) if unknown else ";"
            why = f"{title} has no '{unknown}'" if unknown else f"{title}() {str(error).partition('() ')[2]}"
            raise TypeError(f"{why}{means} it takes {listed(takes)}") from None

    return call


def listed(names: Sequence[str], most: int | None = None, none: str = "none") -> str:
    """ "a, b and 3 more", of which at most `most` are named; `none` of an empty list."""
    shown = ", ".join(names[:most]) or none
    return shown + (f" and {len(names) - most} more" if most is not None and len(names) > most else "")


def __getattr__(name: str) -> Any:
    # These come from the extension, which commands such as `fledge plot` need not load.
    if name in ("SetupError", "CompositionError", "RunError"):
        from fledge import _core

        return getattr(_core, name)
    raise AttributeError(f"module {__name__} has no attribute '{name}'")
