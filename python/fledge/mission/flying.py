# SPDX-License-Identifier: Apache-2.0
"""Python that flies has the arithmetic of targets on the desktop, too: the same text computes the same bits under
CPython and under MicroPython (docs/micropython.md).

That is flight.py or mission.py, what these import of the mission, of other missions and of the project, and procedures.
Such a file has builtins of its own: its `import math` gives target_math, `sum` adds from left to right, and `**` and
pow() are flight's; what it imports flies, too. All else of Python is exact, or the same in both.
"""
from __future__ import annotations

import _ast
import builtins
import importlib.util
import operator
import sys
import threading
from collections.abc import Iterable, Sequence
from functools import lru_cache
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from fledge.flight_math import fm_pow
from fledge.folders import project
from fledge.mission import target_math
from fledge.units import UNITS, Quantity

OWN = "_mission_"       # begins the names of the modules of missions


# --- arithmetic ------------------------------------------------------------------------------------

def power(x: Any, y: Any) -> Any:
    """x ** y: of floats, also with units, flight's own; of integers and arrays Python's.

    Raises ValueError where Python has a complex number, ZeroDivisionError and OverflowError as Python."""
    if _are_floats(x, y):
        return _of_floats(x, y)
    result = operator.pow(x, y)
    if isinstance(x, Quantity) and y % 1 != 0:      # of whole exponents, a quantity has products
        return Quantity(_each(x.value, y), result.dims)
    return result


def power_in_place(x: Any, y: Any) -> Any:
    """What x is after x **= y."""
    return power(x, y) if isinstance(x, (float, int, Quantity)) else operator.ipow(x, y)


def _each(value: Any, y: float) -> Any:
    return [_each(x, y) for x in value] if isinstance(value, (list, tuple)) else power(value, y)


def _are_floats(x: Any, y: Any) -> bool:
    """Whether Python computes this power with floats."""
    return isinstance(x, (float, int)) and isinstance(y, (float, int)) and (
        isinstance(x, float) or isinstance(y, float) or y < 0)


def _of_floats(x: Any, y: Any) -> float:
    x, y = float(x), float(y)
    if x == 0 and 0 > y > -target_math.inf:
        raise ZeroDivisionError("0.0 cannot be raised to a negative power")
    if x < 0 and y % 1 != 0 and abs(y) < target_math.inf:
        raise ValueError(f"{x!r} ** {y!r} is a complex number")
    result = fm_pow(x, y)
    if target_math.isinf(result) and target_math.isfinite(x) and target_math.isfinite(y):
        raise OverflowError(f"{x!r} ** {y!r} is beyond a float")
    return result


def _pow(base: Any, exp: Any, mod: Any = None) -> Any:
    return power(base, exp) if mod is None else pow(base, exp, mod)


def _sum(values: Iterable[Any], /, start: Any = 0) -> Any:
    """From left to right; that of Python 3.12 has the bits of a sum with more digits."""
    for value in values:
        start = start + value
    return start


def execute(source: str, path: str, names: dict[str, Any]) -> None:
    """Run the text of a file that flies, as the module with these names."""
    names["__builtins__"] = BUILTINS
    exec(_compiled(source, path), names)


@lru_cache
def _compiled(source: str, path: str) -> CodeType:
    if "**" not in source:
        return compile(source, path, "exec", dont_inherit=True)
    tree = compile(source, path, "exec", _ast.PyCF_ONLY_AST, dont_inherit=True)
    if not _has_only_units(tree):
        from fledge.mission.powers import rewritten     # late, for ast takes as long as to load a small mission

        tree = rewritten(tree)
    return compile(tree, path, "exec", dont_inherit=True)


def _has_only_units(tree: _ast.Module) -> bool:
    """Whether each power of a file is one of a unit, as in kg * m**2, whose name has no other meaning in the file."""
    units: set[str] = set()
    bound: set[str] = set()
    powers = []
    todo: list[Any] = [tree]
    while todo:
        node = todo.pop()
        of = type(node)
        if of is _ast.Name:
            if type(node.ctx) is not _ast.Load:
                bound.add(node.id)
            continue
        if of is str:       # of a list of names, as that of `global`
            bound.add(node)
        if of is str or of is _ast.Constant or node is None:
            continue
        if of is _ast.ImportFrom and node.module == "fledge.units" and node.level == 0:
            found = {alias.name for alias in node.names if not alias.asname and alias.name in UNITS}
            units |= found
            bound.update(alias.asname or alias.name for alias in node.names if alias.name not in found)
            continue
        if of is _ast.alias:
            bound.add(node.asname or node.name.partition(".")[0])
        elif (of is _ast.BinOp or of is _ast.AugAssign) and type(node.op) is _ast.Pow:
            powers.append(node)
        for value in vars(node).values():
            if type(value) is list:
                todo += value
            elif isinstance(value, _ast.AST):
                todo.append(value)
            elif type(value) is str and of is not _ast.Attribute and of is not _ast.keyword:
                bound.add(value)        # the name of a function, class, parameter, exception or pattern
    return all(_is_power_of_unit(node, units) for node in powers) and "*" not in bound and units.isdisjoint(bound)


def _is_power_of_unit(node: Any, units: set[str]) -> bool:
    """Whether it is m**2 or m**-2."""
    if not (isinstance(node, _ast.BinOp) and isinstance(node.left, _ast.Name) and node.left.id in units):
        return False
    y = node.right.operand if isinstance(node.right, _ast.UnaryOp) else node.right
    return isinstance(y, _ast.Constant) and type(y.value) is int


# --- imports ---------------------------------------------------------------------------------------

class _State(threading.local):
    places: Sequence[Path] = ()     # of files that fly, while one of them imports


_state = _State()


def _import(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> ModuleType:
    if name == "math" and level == 0:
        return target_math
    file = (globals or {}).get("__file__")
    places = [folder for folder in (project(), Path(file).parent if file else None) if folder]
    top = name.partition(".")[0]
    own = level > 0 or any((place / top).is_dir() or (place / f"{top}.py").is_file() for place in places)
    before, _state.places = _state.places, places if own else ()
    try:
        return builtins.__import__(name, globals, locals, fromlist, level)
    finally:
        _state.places = before


class _Loader(SourceFileLoader):
    """Of a file that flies. It keeps no bytecode, which would be that of the file elsewhere, too."""

    def get_code(self, fullname: str) -> CodeType:
        return _compiled(importlib.util.decode_source(self.get_data(self.path)), self.path)

    def exec_module(self, module: ModuleType) -> None:
        module.__dict__["__builtins__"] = BUILTINS
        exec(self.get_code(module.__name__), module.__dict__)


class _Finder:
    """Gives files that fly their loader."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if _state.places else None
        if spec and type(spec.loader) is SourceFileLoader and (
                name.startswith(OWN) or any(map(Path(spec.loader.path).is_relative_to, _state.places))):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


sys.meta_path.insert(0, _Finder)    # type: ignore[arg-type]

# The builtins of a file that flies.
BUILTINS: dict[str, Any] = {**vars(builtins), "__import__": _import, "__power__": power,
                            "__power_in_place__": power_in_place, "pow": _pow, "sum": _sum}
