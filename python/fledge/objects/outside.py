# SPDX-License-Identifier: Apache-2.0
"""What functions of a prototype remember outside of its memory, which no snapshot, clone or reset has.

That is: global variables, variables of an enclosing function, defaults of arguments, attributes of classes and
functions, and the random numbers of `random` and numpy. It is reported at the class, as far as the code says
it; else where an update changes it. Not seen: objects that pickle cannot write, what a change hides behind them,
variables of other modules, and files.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import CodeType, FunctionType, GeneratorType, MethodType, ModuleType
from typing import Any, NamedTuple

from fledge.disk import shown

_CONTAINERS = (list, dict, set, bytearray)
_RANDOM = "the random numbers of Python or numpy"
_TABLE = ("_struct", "_memory")     # what declares the memory
_CONSTANTS = (int, float, complex, str, bytes, bool, type(None), range)


class Seen(NamedTuple):
    """A value outside of the memory that the functions use, and where."""

    file: str
    line: int
    mark: Any     # equal as long as the value stays


def functions(cls: Any) -> Iterator[FunctionType]:
    """The functions of a class and its bases, those of Fledge left out."""
    for base in cls.__mro__:
        if is_library(base):
            continue
        for value in vars(base).values():
            if isinstance(value, property):
                yield from (function for function in (value.fget, value.fset) if isinstance(function, FunctionType))
            elif isinstance(value := getattr(value, "__func__", value), FunctionType):
                yield value


def faults(cls: Any) -> Iterator[tuple[str, int, str]]:
    """(file, line, text) of what the code says: `global`, `nonlocal`, and defaults that can change."""
    for function in functions(cls):
        code = function.__code__
        for name, line in stores(code, code.co_freevars):
            yield code.co_filename, line, (f"{function.__name__}() assigns {name}, a variable outside of the object, "
                                           f"which no snapshot has: declare {name} = mem(...)")
        for value in (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()):
            if isinstance(value, _CONTAINERS):
                yield code.co_filename, code.co_firstlineno, (
                    f"{function.__name__}() has the default {value!r}, which lives on from call to call and which no "
                    "snapshot has: declare it by mem(...)")


def outside_state(cls: Any) -> dict[str, Seen]:
    """What the functions of a class use outside of the memory, by name."""
    states: dict[str, Seen] = {}
    todo, done = list(functions(cls)), set()
    while todo:
        function = todo.pop()
        code = function.__code__
        if code in done:
            continue
        done.add(code)
        file = code.co_filename
        used = {name: (function.__globals__.get(name), line) for name, line in globals_of(code)}
        for name, cell in zip(code.co_freevars, function.__closure__ or ()):
            try:
                used[name] = cell.cell_contents, code.co_firstlineno
            except ValueError:      # not assigned yet
                continue
        for name, (value, line) in used.items():
            if isinstance(value, FunctionType):
                todo += [] if is_library(value) else [value]
            elif not isinstance(value, (ModuleType, type)):
                states[name] = Seen(file, line, _mark(value))
        for name, value in vars(function).items():
            states[f"{function.__name__}.{name}"] = Seen(file, code.co_firstlineno, _mark(value))
        if "random" in code.co_names and _RANDOM not in states:
            states[_RANDOM] = Seen(file, code.co_firstlineno, _random_state())
    for base in cls.__mro__:
        for name, value in () if is_library(base) else vars(base).items():
            if not name.startswith("__") and name not in _TABLE and not hasattr(type(value), "__get__"):
                states[f"{base.__name__}.{name}"] = Seen(cls._struct.path, cls._struct.line, _mark(value))
    return states


def changed_outside(cls: Any, before: dict[str, Seen], path: str, when: str) -> str | None:
    """What an update changed outside of the memory, as an error; None if nothing."""
    for name, seen in outside_state(cls).items():
        if name not in before or before[name].mark != seen.mark:
            be, advice = (("are", "a world model draws by self.normal() and self.uniform()") if name == _RANDOM else
                          ("is", "declare it by mem(...)"))
            return (f"{shown(seen.file)}, line {seen.line}: {path} {when}: {cls.__name__} changed {name}, which {be} "
                    f"not in its memory: no snapshot, clone or reset has it; {advice}")
    return None


def is_library(cls: Any) -> bool:
    """Whether a function or class is of Fledge, Python or a package of others: what these keep is their own affair. A
    test of Fledge defines what a user would."""
    module = cls.__module__ or ""
    code = getattr(cls, "__code__", None)
    return not module.endswith("_test") and (module.split(".")[0] in ("fledge", *sys.stdlib_module_names)
                                             or bool(code and "-packages" in code.co_filename))


def _codes(code: CodeType) -> Iterator[CodeType]:
    """A function's code, and those of the functions within it."""
    yield code
    for const in code.co_consts:
        if isinstance(const, CodeType):
            yield from _codes(const)


def _instructions(code: CodeType) -> Iterator[tuple[str, Any, int]]:
    """(operation, argument, line) of each instruction."""
    import dis

    for part in _codes(code):
        line = part.co_firstlineno
        for step in dis.get_instructions(part):
            # `starts_line` says from Python 3.13 on whether the instruction begins one.
            line = step.positions and step.positions.lineno or line
            yield step.opname, step.argval, line


def stores(code: CodeType, free: tuple[str, ...]) -> Iterator[tuple[str, int]]:
    """(name, line) of each assignment to a variable outside of the function. free: those of enclosing functions."""
    for operation, name, line in _instructions(code):
        if operation in ("STORE_GLOBAL", "DELETE_GLOBAL") or operation == "STORE_DEREF" and name in free:
            yield name, line


def globals_of(code: CodeType) -> Iterator[tuple[str, int]]:
    """(name, line) of each global variable that a function reads."""
    for operation, name, line in _instructions(code):
        if operation in ("LOAD_GLOBAL", "LOAD_NAME"):
            yield name, line


def _mark(value: Any, depth: int = 2) -> Any:
    """Something that is equal as long as the value stays; of what pickle cannot write, to this depth."""
    import pickle

    if isinstance(value, _CONSTANTS):
        return repr(value)
    if isinstance(value, MethodType) or getattr(value, "__self__", None) is not None and not isinstance(
            value.__self__, ModuleType):    # random.Random().random
        return _mark(value.__self__, depth)
    if isinstance(value, GeneratorType):
        frame = value.gi_frame
        return frame and (frame.f_lasti, [_mark(local, depth - 1) for local in frame.f_locals.values()]
                          if depth else None)
    try:
        return pickle.dumps(value)
    except Exception:    # whatever its class raises
        inner = vars(value).values() if depth and hasattr(value, "__dict__") else ()
        return id(value), [_mark(element, depth - 1) for element in inner]


def _random_state() -> Any:
    import pickle
    import random

    numpy = sys.modules.get("numpy")
    return random.getstate(), pickle.dumps(numpy.random.get_state()) if numpy else None
