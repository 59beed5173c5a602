# SPDX-License-Identifier: Apache-2.0
"""What a struct may not do, whatever its C types: names, padding, clauses, ports.

Each rule takes a Struct and yields (line, Refusal); `check` runs them all.
"""
from __future__ import annotations

import re
from collections.abc import Iterator

from introspect import keywords
from introspect.errors import Problem, Refusal
from introspect.model import Bounds, Field, Group, Kind, Struct, Type

Finding = tuple[int, Refusal]

_METHODS = ("held", "publish", "reset", "turns", "update")    # of a module in Python, and keywords
_KEYWORDS = [("C", keywords.C), ("C++", keywords.CPP), ("Python", keywords.PYTHON)]


def check(struct: Struct, complete: bool = True) -> Iterator[Problem]:
    """All that is wrong with a struct. If it is not complete, because a member was refused already,
    the rules about what stands beside what say nothing."""
    rules = [names, unique_names, head, clauses, bounds, units]
    if complete:
        rules += [padding, counts, distincts]
    if struct.kind.is_interface:
        rules += [documented, ports]
    elif struct.kind is Kind.MESSAGE:
        rules += [documented]
    for rule in rules:
        for line, refusal in rule(struct):
            yield refusal.at(struct.path, line)


def names(struct: Struct) -> Iterator[Finding]:
    """A name works in C, C++, Python, and, where it travels, in a ROS 2 schema."""
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", struct.name):
        yield struct.line, Refusal("a struct's name is CamelCase, of letters and digits",
                                   f"`{struct.name}`", "rename it")
    for f in struct.fields:
        keyword_of = [language for language, words in _KEYWORDS if f.name in words]
        if keyword_of:
            yield f.line, Refusal("a name is no keyword",
                                  f"`{f.name}` is one in {' and '.join(keyword_of)}", "rename it")
        elif struct.kind.is_interface and f.name in _METHODS:
            yield f.line, Refusal(f"no member is named {', '.join(_METHODS[:-1])} or {_METHODS[-1]}",
                                  f"`{f.path}`: the name means something else in Python", "rename it")
        elif f.name.endswith("_") or "__" in f.name or not f.name[0].isalpha():
            yield f.line, Refusal("a name begins with a letter, has no `__` and no `_` at its end",
                                  f"`{f.name}`", "rename it")


def unique_names(struct: Struct) -> Iterator[Finding]:
    """ROS 2 schemas are lower case; Python flattens in, out, par and mem into one object."""
    first: dict[str, Field] = {}
    for f in struct.fields:
        if f.is_spare and struct.kind.is_interface:
            continue
        other = first.setdefault(f.name.lower(), f)
        if other is f:
            continue
        if other.name == f.name:
            yield f.line, Refusal("names are unique across in, out, par and mem",
                                  f"`{f.path}` and `{other.path}` in line {other.line}",
                                  "rename one of them")
        else:
            yield f.line, Refusal("names differ in more than case",
                                  f"`{f.name}` and `{other.name}` in line {other.line}",
                                  "rename one of them")


def padding(struct: Struct) -> Iterator[Finding]:
    """Padding is bytes that no code sets: they would leak into archives, wires and snapshots, and
    CDR has none."""
    following = [(f.offset, f"before `{f.path}`") for f in struct.fields[1:]]
    following.append((struct.size, "at the end of the struct"))
    for f, (end, where) in zip(struct.fields, following):
        gap = end - (f.offset + f.size)
        if gap <= 0:
            continue
        taken = {g.name for g in struct.fields if g.group is f.group}
        spare = next(n for n in ["spare"] + [f"spare{i}" for i in range(2, 99)] if n not in taken)
        declared = {1: f"uint8_t {spare};", 2: f"uint16_t {spare};", 4: f"uint32_t {spare};"}
        yield f.line, Refusal(
            "a struct holds no padding", f"{gap} byte{'s' * (gap > 1)} {where}, after `{f.path}`",
            f"add `{declared.get(gap, f'uint8_t {spare}[{gap}];')}` after `{f.name}`")
    for f in struct.fields:
        align = _alignment(f)
        if f.offset % align:
            yield f.line, Refusal("a member stands at a multiple of its own size",
                                  f"`{f.path}` at byte {f.offset}, needing a multiple of {align}",
                                  "do not pack, and order by size")


def _alignment(f: Field) -> int:
    return f.struct.align if f.struct else f.element_size


def head(struct: Struct) -> Iterator[Finding]:
    """A Head elsewhere than in front is a message gone wrong."""
    for f in struct.fields:
        stray = f.struct and f.struct.name == "Head" and struct.kind is Kind.PLAIN
        if stray or (struct.kind is Kind.MESSAGE and f.name == "head" and f.shape):
            yield f.line, Refusal("a message begins with `Head head;`", f"`{f.ctype} {f.name}`",
                                  "make it the first member, named head")


def documented(struct: Struct) -> Iterator[Finding]:
    if not struct.doc:
        yield struct.line, Refusal(
            "a module, model or message has a doc comment", f"`{struct.name}` has none",
            "write /** what it is, and its source */ before `typedef`")


def units(struct: Struct) -> Iterator[Finding]:
    for f in struct.fields:
        if f.type.is_number and f.unit is None and not f.is_spare:
            yield f.line, Refusal("a number has a unit", f"`{f.name}` has none",
                                  "write `///< [unit] meaning` after it, [-] for none")
        if f.unit and f.unit.text == "ns" and not f.type.is_integer:
            yield f.line, Refusal("ns is for integer times", f"`{f.ctype} {f.name}` in [ns]",
                                  "use s, or int64_t")


def clauses(struct: Struct) -> Iterator[Finding]:
    """A clause means something only in its group, and on its type."""
    for f in struct.fields:
        for clause, group in (("required", Group.PAR), ("optional", Group.IN),
                              ("assumed", Group.PAR), ("initial", Group.PAR)):
            if clause in f.clauses and f.group is not group:
                yield f.line, Refusal(f"only a member of `{group.value}` is {clause}",
                                      f"`{f.path}` {_in_group(f)}", f"leave out `{clause}`")
        if "inertia" in f.clauses and not (f.type is Type.F64 and f.shape[-2:] == (3, 3)):
            yield f.line, Refusal("an inertia is a Mat3", f"`{f.ctype} {f.name}`",
                                  "leave out `inertia`, or write what it means after a colon")
        if "non-zero" in f.clauses and not f.type.is_number:
            yield f.line, Refusal("only numbers are non-zero", f"`{f.ctype} {f.name}`",
                                  "leave out `non-zero`")


def _in_group(f: Field) -> str:
    return f"is in `{f.group.value}`" if f.group is not Group.NONE else "is in no group"


def bounds(struct: Struct) -> Iterator[Finding]:
    for f in struct.fields:
        if f.bounds and not f.type.is_number:
            yield f.line, Refusal("only numbers have bounds", f"`{f.ctype} {f.name}`",
                                  "leave them out")
        if f.range and (not f.type.is_number or f.group in (Group.IN, Group.OUT, Group.MEM)):
            yield f.line, Refusal("numbers of messages, structs and `par` have a range", f"`{f.ctype} {f.path}`",
                                  "leave it out")
        elif f.range and f.bounds and not _meet(f.bounds, f.range):
            yield f.line, Refusal("a range has values within the bounds", f"`{f.path}` has none", "correct one of them")


def _meet(bounds: Bounds, other: Bounds) -> bool:
    """Whether a number is within bounds, and within others that are closed."""
    assert other.lo is not None and other.hi is not None
    return not ((bounds.lo is not None and (other.hi < bounds.lo or (bounds.lo_open and other.hi == bounds.lo)))
                or (bounds.hi is not None and (other.lo > bounds.hi or (bounds.hi_open and other.lo == bounds.hi))))


def counts(struct: Struct) -> Iterator[Finding]:
    for f in struct.fields:
        if f.count is None:
            continue
        if not f.shape:
            yield f.line, Refusal("`count` is for arrays", f"`{f.ctype} {f.name}`",
                                  "leave out `count`")
        candidates = [g.name for g in struct.fields if g.group is f.group
                      and g.type.is_unsigned and not g.shape and not g.is_spare]
        if f.count not in candidates:
            valid = ", ".join(candidates) or "none here"
            yield f.line, Refusal(
                "`count` names an unsigned integer of the same group or struct",
                f"`count {f.count}`", f"name one of: {valid}")


def distincts(struct: Struct) -> Iterator[Finding]:
    for f in struct.fields:
        if f.distinct is None:
            continue
        others = [g.name for g in struct.fields if g.group is f.group is Group.IN and g is not f
                  and g.ctype == f.ctype]
        if f.distinct not in others:
            valid = ", ".join(others) or "none here"
            yield f.line, Refusal("`distinct` stands at an input and names another of its type",
                                  f"`distinct {f.distinct}`", f"name one of: {valid}")


def ports(struct: Struct) -> Iterator[Finding]:
    """Inputs and outputs are single messages, so that every wire copies one message."""
    for f in struct.fields:
        if f.group not in (Group.IN, Group.OUT) or f.is_spare:
            continue
        if not f.struct:
            yield f.line, Refusal("`in` and `out` hold messages",
                                  f"`{f.path}` is of type {f.ctype}",
                                  "put it into a message, or into `par` or `mem`")
        elif f.struct.kind is not Kind.MESSAGE:
            yield f.line, Refusal("`in` and `out` hold messages",
                                  f"`{f.path}` is of type {f.ctype}, which has no Head",
                                  f"make `Head head;` the first member of {f.ctype}")
        elif f.shape:
            yield f.line, Refusal("a port is one message", f"`{f.path}` is an array",
                                  "name its elements, or put the array into the message")
