# SPDX-License-Identifier: Apache-2.0
"""The comment beside a field: what the C type cannot say.

    comment = "///<" [ "[" unit "]" ] [ clause { "," clause } ":" ] meaning
    clause  = "required" | "optional" | "assumed" | "initial" | "non-zero" | "inertia"
            | (">" | ">=" | "<" | "<=") number | "in [" number "," number "]" | "count" field
            | "distinct" port | "range [" number "," number "]"

What stands before the first colon is clauses if its first part is one; else all is meaning, so that
`///< Ri: what the control frame shall follow` may be written. Continuation lines keep their `///<`.

The comment beside the id of an event: "///<" severity { "," argument "[" unit "]" } ":" meaning
"""
from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass, replace

from introspect import units
from introspect.errors import Refusal
from introspect.model import Bounds, Unit

WORDS = ("required", "optional", "assumed", "initial", "non-zero", "inertia")
SEVERITIES = ("info", "low", "medium", "high")     # EventSeverity of flight/msg/event.h, from 1
CLAUSES = ", ".join(WORDS) + ", > x, >= x, < x, <= x, in [a, b], count FIELD, distinct PORT, range [a, b]"

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


@dataclass(frozen=True)
class Comment:
    unit: Unit | None = None
    clauses: frozenset[str] = frozenset()
    bounds: Bounds | None = None
    count: str | None = None
    distinct: str | None = None
    range: Bounds | None = None
    meaning: str = ""


@dataclass(frozen=True)
class Event:
    """What the comment of an event's id says: `///< medium, monitor [-], value [SI]: it has fired`."""
    severity: str                           # of SEVERITIES
    arguments: tuple[tuple[str, str], ...]  # (name, unit)
    meaning: str


def event(text: str) -> Event:
    """The words behind the id of an event. Raises Refusal."""
    before, colon, meaning = text.partition(":")
    severity, *named = [part.strip() for part in before.split(",")]
    arguments = [re.fullmatch(r"([a-z]\w*) \[([^\]]*)\]", argument) for argument in named]
    if not colon or not meaning.strip() or severity not in SEVERITIES or not all(arguments) or len(named) > 4:
        raise Refusal("an event's comment is a severity, up to 4 arguments with their units, and the meaning",
                      f"`{text}`", f"write `{' | '.join(SEVERITIES)}, name [unit], ...: what has happened`")
    return Event(severity, tuple((argument[1], units.parse(argument[2]).text) for argument in arguments if argument),
                 meaning.strip())


def field_text(raw: str | None) -> str | None:
    """The words of a comment after its field, in one line; None if it does not stand there."""
    if not raw:
        return None
    if raw.startswith("/**<"):
        lines = re.sub(r"^\s*\*", "", raw[4:-2], flags=re.M).splitlines()
    else:
        lines = raw.splitlines()
        if not all(line.lstrip().startswith("///<") for line in lines):
            return None
        lines = [line.lstrip()[4:] for line in lines]
    return " ".join(" ".join(lines).split())


def doc_text(raw: str | None) -> str:
    """The words of the comment before a declaration, in its lines; empty if there is none."""
    if not raw or not re.match(r"/(\*\*|//)(?!<)", raw):
        return ""
    return plain_text(raw)


def plain_text(raw: str) -> str:
    """The lines of any comment without its marks; those that stand deeper than the others stay indented."""
    if raw.startswith("/*"):
        first, *rest = re.sub(r"^/\*+|\*/$", "", raw).splitlines() or [""]
        lines = [first.strip(), *(re.sub(r"^\s*\*? {0,2}", "", line) for line in rest)]
    else:
        lines = [re.sub(r"^\s*///? ?", "", line) for line in raw.splitlines()]
    return "\n".join(line.rstrip() for line in lines).strip()


def parse(text: str) -> Comment:
    """What the words of a field's comment say. Raises Refusal."""
    unit = None
    if bracket := re.match(r"\[([^\]]*)\]\s*", text):
        unit = units.parse(bracket[1])
        text = text[bracket.end():]
    before, colon, after = text.partition(":")
    parts = [part.strip() for part in re.split(r",(?![^\[(]*[\])])", before)]
    if not colon:
        if _are_clauses(parts) and parts != ["inertia"]:
            raise Refusal("a clause ends with a colon, before the meaning", f"`{text}`",
                          f"write `{text}: ` and what the field is")
        return Comment(unit, meaning=text)
    if not _is_clause(parts[0]):
        if near := difflib.get_close_matches(parts[0], WORDS, 1, 0.8):
            raise Refusal(f"a clause is one of: {CLAUSES}", f"`{parts[0]}`, which is almost `{near[0]}`",
                          "correct it, or begin the meaning with another word")
        return Comment(unit, meaning=text)
    comment = Comment(unit, meaning=after.strip())
    for part in parts:
        comment = _with_clause(comment, part)
    return comment


def _is_clause(part: str) -> bool:
    return (part in WORDS or part.startswith((">", "<")) or bool(re.match(r"(in|range)\s*[\[(]", part))
            or bool(re.fullmatch(r"(count|distinct)\s+\w+", part)))


def _are_clauses(parts: list[str]) -> bool:
    try:
        for part in parts:
            _with_clause(Comment(), part)
    except Refusal:
        return False
    return True


def _with_clause(comment: Comment, part: str) -> Comment:
    if part in WORDS:
        return replace(comment, clauses=comment.clauses | {part})
    if counted := re.fullmatch(r"count\s+(\w+)", part):
        return replace(comment, count=counted[1])
    if other := re.fullmatch(r"distinct\s+(\w+)", part):
        return replace(comment, distinct=other[1])
    if used := re.fullmatch(r"range\s*\[([^,\[\]]*),([^,\[\]]*)\]", part):
        if comment.range:
            raise Refusal("a range is given once", f"`{part}` after another", "leave one of them")
        return replace(comment, range=_both(Bounds(), Bounds(_number(used[1], part), _number(used[2], part)), part))
    if compared := re.fullmatch(r"(>=|<=|>|<)(.*)", part):
        sign, value = compared[1], _number(compared[2], part)
        open_ = "=" not in sign
        new = Bounds(lo=value, lo_open=open_) if sign[0] == ">" else Bounds(hi=value, hi_open=open_)
    elif interval := re.fullmatch(r"in\s*\[([^,\[\]]*),([^,\[\]]*)\]", part):
        new = Bounds(_number(interval[1], part), _number(interval[2], part))
    elif re.match(r"(in|range)\s*[\[(]", part):
        raise _malformed(part)
    else:
        raise Refusal(f"a clause is one of: {CLAUSES}", f"`{part}` between other clauses",
                      "correct it, or word the meaning so that it does not begin with a clause")
    return replace(comment, bounds=_both(comment.bounds or Bounds(), new, part))


def _both(old: Bounds, new: Bounds, part: str) -> Bounds:
    if (None not in (old.lo, new.lo)) or (None not in (old.hi, new.hi)):
        raise Refusal("a bound is given once", f"`{part}` after another bound of that side",
                      "leave one of them")
    both = Bounds(old.lo if new.lo is None else new.lo, old.hi if new.hi is None else new.hi,
                  old.lo_open or new.lo_open, old.hi_open or new.hi_open)
    if both.lo is not None and both.hi is not None:
        if both.lo > both.hi or (both.lo == both.hi and (both.lo_open or both.hi_open)):
            raise Refusal("bounds leave room for a value", f"`{part}`, so nothing is allowed",
                          "exchange or correct them")
    return both


def _number(text: str, part: str) -> float:
    if not _NUMBER.fullmatch(text.strip()) or math.isinf(float(text)):
        raise _malformed(part)
    return float(text)


def _malformed(part: str) -> Refusal:
    return Refusal("a range is `range [a, b]`, with numbers" if part.startswith("range") else
                   "a bound is `> x`, `>= x`, `< x`, `<= x` or `in [a, b]`, with numbers",
                   f"`{part}`", "write numbers, also where C has a name for them")
