# SPDX-License-Identifier: Apache-2.0
"""Type stubs for Python: modules, models and messages as an editor and a type checker see them.

`_fledge_flight.pyi` and `_fledge_world.pyi` hold the types of Fledge's two libraries, `_project_flight.pyi`
and `_project_world.pyi` what a project declares in its folders of those names. `fledge.flight` and
`fledge.world` import all of them, for type checkers only.
"""
from __future__ import annotations

from introspect.model import Bounds, Enumeration, Field, Group, Kind, Library, Struct, Type

_PROLOGUE = '''\
# Written by introspect from the C headers: do not edit.
import enum
from typing import Any, Callable, Sequence, Union

from numpy.typing import NDArray

from _core import Message, Model, Module
from fledge.units import Quantity

# What a parameter or field takes, by its number of dimensions: one value may stand for a whole array.
_0 = Union[float, Quantity]
_1 = Union[_0, Sequence[_0], NDArray[Any]]
_2 = Union[_1, Sequence[_1]]
_3 = Union[_2, Sequence[_2]]
_4 = Union[_3, Sequence[_3]]

class _Number:
    def __get__(self, instance: Any, owner: Any = ...) -> float: ...
    def __set__(self, instance: Any, value: _0) -> None: ...

class _Integer:
    def __get__(self, instance: Any, owner: Any = ...) -> int: ...
    def __set__(self, instance: Any, value: _0) -> None: ...
'''

_ARRAY = '''
class _Array{n}:
    def __get__(self, instance: Any, owner: Any = ...) -> NDArray[Any]: ...
    def __set__(self, instance: Any, value: _{n}) -> None: ...
'''

PARTS = ("flight", "world")
_BASES = {Kind.PLAIN: "Message", Kind.MESSAGE: "Message", Kind.MODULE: "Module", Kind.MODEL: "Model"}


def emit(library: Library) -> dict[str, str]:
    own = library.name in PARTS
    files = {}
    for part in [library.name] if own else PARTS:
        name = f"_{'fledge' if own else 'project'}_{part}"
        structs = [s for s in library.structs if _module(s, library) == name]
        enums = [e for e in library.enums if _module(e, library) == name]
        used = {u for s in structs for f in s.fields for u in (f.struct, f.enum) if u}
        imports = sorted(f"\nfrom {_module(u, library)} import {u.name}" for u in used if _module(u, library) != name)
        files[f"stubs/{name}.pyi"] = "".join([
            _PROLOGUE, *(_ARRAY.format(n=n) for n in range(1, 5)), *imports, ("\n" if imports else ""),
            *map(_enum, enums), *map(_struct, structs)])
    return files


def _module(declared: Struct | Enumeration, library: Library) -> str:
    """The stub that declares it."""
    part = declared.header.split("/")[0]
    own = declared.library == library.name and library.name not in PARTS
    return f"_project_{part}" if own else f"_fledge_{part}"


def _enum(e: Enumeration) -> str:
    rows = zip(e.short_names, e.values)
    return f"\nclass {e.name}(enum.IntEnum):\n" + doc_string(e.doc) + "".join(
        f"    {short} = {v.value}\n{doc_string(v.doc)}" + (f"    {v.name} = {v.value}\n" if v.name != short else "")
        for short, v in rows)


def _struct(s: Struct) -> str:
    fields = [f for f in s.fields if not f.is_spare]
    settable = sorted((f for f in fields if not s.kind.is_interface or f.group is Group.PAR),
                      key=lambda f: "required" not in f.clauses)
    lines = [f"\nclass {s.name}({_BASES[s.kind]}):\n", doc_string(s.doc)]
    parameters = [f"{f.name}: {_accepted(f)}" + ("" if _is_required(s, f) else " = ...") for f in settable]
    if s.kind is Kind.MODEL:
        parameters.append("**properties: Any")
    if s.kind is Kind.MODULE:
        parameters += [f"update: Callable[[{s.name}, float, float], Any] = ...",
                       f"reset: Callable[[{s.name}], Any] = ...", "turns: int = ..."]
    if parameters:
        star = "*, " if settable or s.kind is Kind.MODULE else ""
        lines += [f"    def __init__(self, {star}{', '.join(parameters)}) -> None:\n",
                  doc_string("\n".join(f"{f.name}{_about(f)}" for f in settable), indent=8), "        ...\n"]
    for f in fields:
        lines += [f"    {f.name}: {_attribute(f)}\n", doc_string(_about(f).lstrip(" ,:"))]
    return "".join(lines)


def _is_required(s: Struct, f: Field) -> bool:
    """Models have properties besides, made in Python, and one of these may set the parameter."""
    return "required" in f.clauses and s.kind is not Kind.MODEL


def _accepted(f: Field) -> str:
    """The type of values that the field can be set to."""
    if f.struct:
        return _repeated(f.struct.name, len(f.shape))
    if f.type is Type.CHAR:
        return _repeated("str", len(f.shape) - 1)
    if f.enum:
        return _repeated(f"{f.enum.name} | int | str", len(f.shape))
    return f"_{len(f.shape)}"


def _attribute(f: Field) -> str:
    """The type of the field when it is read; for numbers, a descriptor that also takes quantities."""
    if f.type.is_number:
        if f.shape:
            return f"_Array{len(f.shape)}"
        return "_Integer" if f.type.is_integer else "_Number"
    return "Any" if f.type is Type.ENUM else _accepted(f)


def _repeated(name: str, dimensions: int) -> str:
    return f"Sequence[{_repeated(name, dimensions - 1)}]" if dimensions > 0 else name


def _about(f: Field) -> str:
    """Its unit, shape, rules and meaning: " [N m], required, > 0: gain on the MRP error"."""
    kind = f" [{f.unit.text}]" if f.unit and f.unit.text != "-" else f" {f.ctype}" if f.struct or f.enum else ""
    words = [kind]
    if f.shape:
        words.append(f"shape ({', '.join(map(str, f.shape))})")
    words += sorted(f.clauses)
    words += [f"distinct from {f.distinct}"] if f.distinct else []
    words += _bounds(f.bounds) if f.bounds else []
    words += [f"range [{f.range.lo:g}, {f.range.hi:g}]"] if f.range else []
    meaning = f.doc or (f.struct.doc.split("\n")[0] if f.struct else "")
    return ", ".join(words) + (f": {meaning}" if meaning else "")


def _bounds(b: Bounds) -> list[str]:
    lo = [] if b.lo is None else [f"{'>' if b.lo_open else '>='} {b.lo:g}"]
    return lo + ([] if b.hi is None else [f"{'<' if b.hi_open else '<='} {b.hi:g}"])


def doc_string(text: str, indent: int = 4) -> str:
    text = text.replace("\\", "\\\\").replace('"', "'")
    if not text:
        return ""
    lines = [f'"""{text}'] if "\n" not in text else f'"""{text}\n'.split("\n")
    lines[-1] += '"""'
    return "".join(f"{' ' * indent}{line}".rstrip() + "\n" for line in lines)
