# SPDX-License-Identifier: Apache-2.0
"""A class as the struct that its C header would declare: the same fields, places, rules and refusals, because
introspect's parser and rules read them. Spares are not in the class: they stand where the header needs them."""

from __future__ import annotations

import enum
import inspect
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from fledge import _core
from fledge.errors import SetupError, did_you_mean
from fledge.disk import shown
from fledge.objects import outside, project
from fledge.objects.layout import described, described_enum, head, lay_out
from fledge.objects.script import check_function
from introspect import comment, rules, units
from introspect.emit import schema
from introspect.errors import Problem, Refusal
from introspect.model import Bounds, Enumeration, Enumerator, Field, Group, Kind, Struct, Type


class Array:
    """Vec3 or Mat3, as a type."""

    def __init__(self, name: str, shape: tuple[int, ...]) -> None:
        self.name, self.shape = name, shape

    def __repr__(self) -> str:
        return self.name


ARRAYS = {"Vec3": Array("Vec3", (3,)), "Mat3": Array("Mat3", (3, 3))}

_C = {Type.F64: ("double", 8), Type.F32: ("float", 4), Type.I8: ("int8_t", 1), Type.U8: ("uint8_t", 1),
      Type.I16: ("int16_t", 2), Type.U16: ("uint16_t", 2), Type.I32: ("int32_t", 4), Type.U32: ("uint32_t", 4),
      Type.I64: ("int64_t", 8), Type.U64: ("uint64_t", 8), Type.CHAR: ("char", 1)}
_PYTHON = {float: Type.F64, int: Type.I64, bool: Type.U8, str: Type.CHAR}
_NUMPY = {"float64": Type.F64, "float32": Type.F32, **{
    f"{sign}int{bits}": Type[f"{letter}{bits}"] for sign, letter in (("", "I"), ("u", "U"))
    for bits in (8, 16, 32, 64)}}
_TYPES = ("float, int, bool, a type of numpy such as np.uint32, Vec3, Mat3, str with a shape, a message's type such as "
          "fsw.NavAttitude, an IntEnum, or the name of a header's enumeration")
_FUNCTIONS = {Kind.MODULE: {"update": "(self, t, dt)", "reset": "(self)"},
              Kind.MODEL: {"update": "(self, t, dt)", "reset": "(self, t)", "prepare": "(self)",
                           "air_at": "(self, t, r_BN_N)"}}
DIMS_MAX = 4  # as sim/table.h


class Declaration:
    """A port, parameter or piece of memory, as the class has it, with its line."""

    def __init__(self, group: Group, type: Any, text: str, shape: int | Sequence[int] = ()) -> None:
        self.group, self.type, self.text, self.name = group, type, text, ""
        self.shape: Any = (shape,) if isinstance(shape, int) else shape
        self.line = sys._getframe(2).f_lineno

    def __set_name__(self, owner: Any, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
        return f"<{self.group.name.lower()} {self.name}: {self.text}>"


# --- the class -------------------------------------------------------------------------------------

def place_of(cls: Any) -> tuple[str, int]:
    """(file, line) of the class: those of its first statement that Python knows."""
    codes = [function.__code__ for function in outside.functions(cls)
             if function.__qualname__.startswith(cls.__qualname__ + ".")]
    file = codes[0].co_filename if codes else getattr(sys.modules.get(cls.__module__), "__file__", None) or "?"
    try:
        return file, inspect.getsourcelines(cls)[1]
    except (OSError, TypeError):
        lines = [code.co_firstlineno for code in codes] + [var.line for var in vars(cls).values()
                                                           if isinstance(var, Declaration)]
        return file, max(min(lines, default=2) - 1, 1)


def refuse_methods(cls: Any) -> None:
    """Raise SetupError for methods that a prototype does not have, or that keep state outside of its memory."""
    file, line = place_of(cls)
    where = f"{shown(file)}, line {line}: "
    if not (cls.__doc__ or "").strip() or cls.__doc__ == cls.__mro__[1].__doc__:
        raise SetupError(f"{where}{cls.__name__} has no docstring: say there what it does and where its equations come "
                         "from; the first line is its meaning")
    if cls._kind is Kind.MESSAGE:
        return
    if "__init__" in vars(cls) or "__new__" in vars(cls):
        raise SetupError(f"{where}{cls.__name__} has __init__() or __new__(): its memory begins at zero, or in reset()")
    if not callable(getattr(cls, "update", None)):
        raise SetupError(f"{where}{cls.__name__} has no update(self, t, dt)")
    for name, arguments in _FUNCTIONS[cls._kind].items():
        if (function := getattr(cls, name, None)) is not None:
            check_function(f"{cls.__name__}.{name}", function, arguments)
    if faults := list(outside.faults(cls)):
        raise SetupError(
            "\n".join(f"{shown(file)}, line {line}: {cls.__name__}: {text}" for file, line, text in faults))


def declare(cls: Any) -> tuple[Struct, Any]:
    """(struct, type on its memory) of a class. Raises SetupError with all that breaks a rule of headers."""
    file, line = place_of(cls)
    declarations: dict[str, Declaration] = {}
    for base in reversed(cls.__mro__):
        declarations.update((name, value) for name, value in vars(base).items() if isinstance(value, Declaration))
    problems: list[Problem] = []
    fields: list[Field] = []
    types: dict[str, Any] = {}
    for name, declaration in declarations.items():
        try:
            declaration.name = name
            fields.append(_field(declaration, types))
        except Refusal as refusal:
            problems.append(refusal.at(file, declaration.line))
    folder = "world" if cls._kind is Kind.MODEL else "flight"
    if cls._kind is Kind.MESSAGE:
        fields.insert(0, head(types))
    fields, size, align = lay_out(fields)
    struct = Struct(cls.__name__, _doc(cls.__doc__), cls._kind, size, align, tuple(fields),
                    f"{folder}/{os.path.basename(file)}", file, line, folder)
    if not declarations:
        what, call = ("fields", "field") if cls._kind is Kind.MESSAGE else ("ports, parameters or memory", "par")
        problems.append(Problem(file, line, f"a prototype has {what}", f"`{cls.__name__}` has none",
                                f"declare them, as in rate = {call}(float, \"[rad/s] meaning\")"))
    for declaration in declarations.values():
        if (declaration.group is Group.NONE) is not (cls._kind is Kind.MESSAGE):
            problems.append(Problem(file, declaration.line,
                                    "field() is for messages; input(), out(), par() and mem() for modules and models",
                                    f"`{declaration.name}` of {cls.__name__}", "use the others"))
    problems += rules.check(struct, complete=not problems)
    if problems:
        raise SetupError("\n".join(f"{shown(p.file)}, line {p.line}: {p.rule}; {p.found}; {p.advice}"
                                   for p in sorted(set(problems))))
    # A class that is defined again, as in a notebook or by each load of a mission, has the same table.
    key = replace(struct, line=0, fields=tuple(replace(f, line=0) for f in fields))
    if key not in _types:
        _types[key] = _core.declare(struct, types, schema.text(struct) if cls._kind is Kind.MESSAGE else None)
    return struct, _types[key]


def _doc(text: str) -> str:
    """A docstring as a header's comment is read, which it must not end."""
    return "\n".join(line.strip() for line in text.strip().replace("*/", "* /").splitlines())


_types: dict[Struct, Any] = {}


# --- fields ----------------------------------------------------------------------------------------

def _field(declaration: Declaration, types: dict[str, Any]) -> Field:
    """The field without its place; types: takes the type of its struct. Raises Refusal."""
    parsed = comment.parse(" ".join(declaration.text.split()))
    type_, ctype, shape, struct, enumeration, width = _typed(declaration, types)
    if type_.is_number and parsed.unit is None:
        raise Refusal("a number has a unit", f"`{declaration.name}` has none",
                      f"begin its text with one, as in \"[rad/s] {declaration.text or 'meaning'}\", or with [-]")
    size = width
    for n in shape:
        size *= n
    return Field(declaration.name, type_, ctype, shape, 0, size, declaration.line, declaration.group, parsed.unit,
                 parsed.clauses, parsed.bounds, parsed.count, parsed.distinct, parsed.meaning, struct, enumeration,
                 parsed.range)


def _typed(declaration: Declaration, types: dict[str, Any]) -> tuple[Type, str, tuple[int, ...], Any, Any, int]:
    """(type, C type, shape, struct, enumeration, bytes of an element) of a declaration. Raises Refusal."""
    try:
        shape = tuple(declaration.shape)
    except TypeError:
        shape = (0,)
    if any(not isinstance(n, int) or n < 1 for n in shape) or len(shape) > DIMS_MAX:
        raise Refusal(f"a shape is 1 to {DIMS_MAX} whole numbers > 0",
                      f"`{declaration.name}` has {declaration.shape!r}", "change it")
    given = declaration.type
    if isinstance(given, Array):
        return Type.F64, given.name, shape + given.shape, None, None, 8
    if getattr(given, "_kind", None) is Kind.MESSAGE and "_struct" in vars(given):
        types[given.__name__] = given._memory
        return Type.STRUCT, given.__name__, shape, given._struct, None, given._struct.size
    if isinstance(given, type) and issubclass(given, _core.Message):
        struct = described(_core.struct(given))
        types[struct.name] = given
        return Type.STRUCT, struct.name, shape, struct, None, struct.size
    if isinstance(given, str) or isinstance(given, type) and issubclass(given, enum.Enum):
        enumeration = _enumeration(given, declaration.name)
        return Type.ENUM, enumeration.name, shape, None, enumeration, 4
    fixed = _PYTHON.get(given) if isinstance(given, type) else None
    fixed = fixed or (_NUMPY.get(getattr(given, "__name__", "")) if isinstance(given, type) else None)
    if fixed is None or fixed is Type.CHAR and not shape:
        raise Refusal("a type is one of: " + _TYPES, f"`{declaration.name}` has {given!r}", "change it")
    return fixed, _C[fixed][0], shape, None, None, _C[fixed][1]


def _enumeration(given: Any, name: str) -> Enumeration:
    if isinstance(given, str):
        known = _known_enumerations()
        if given not in known:
            raise Refusal("an enumeration is an IntEnum, or one that a header declares",
                          f"`{name}` is a '{given}'{did_you_mean(given, known)}", "write its class, or its name")
        return known[given]
    if not issubclass(given, enum.IntEnum) or not all(-2**31 <= member < 2**31 for member in given) or not len(given):
        raise Refusal("an enumeration is an IntEnum whose numbers have 32 bits", f"`{name}` is a {given.__name__}",
                      "derive it from enum.IntEnum")
    doc = "" if given.__doc__ in (None, enum.IntEnum.__doc__, "An enumeration.") else _doc(given.__doc__)
    return Enumeration(given.__name__, doc, tuple(
        Enumerator(f"{given.__name__.upper()}_{member.name}", int(member), "") for member in given), "")


# --- what headers declare, from their tables -------------------------------------------------------

@cache
def _known_enumerations() -> dict[str, Enumeration]:
    """The enumerations that fields of headers have, by name."""
    types = [*_core.library("flight").values(), *_core.library("world").values(),
             *project.types("flight").values(), *project.types("world").values()]
    return {f.ctype: described_enum(f) for type_ in types for f in _structs(_core.struct(type_)) if f.type == "enum"}


def _structs(struct: _core.Struct) -> Iterator[Any]:
    for f in struct.fields:
        yield f
        if f.type == "struct":
            yield from _structs(f.struct)
