# SPDX-License-Identifier: Apache-2.0
"""What the functions of a mission do: whether a scenario checks anything, and where a script of flight computes other
bits on the desktop than under MicroPython."""
from __future__ import annotations

import ast
import builtins
import dis
import inspect
import math
from collections.abc import Callable, Iterator
from typing import Any

OWN = "_mission_"       # begins the names of the modules of missions

# Of the module math: functions that flight computes by its own, and others that a target has (its math.c).
OTHER = {"acos", "asin", "atan", "atan2", "cos", "exp", "log", "sin", "tan"}
SAME = {"ceil", "copysign", "degrees", "fabs", "floor", "fmod", "isfinite", "isinf", "isnan", "radians", "sqrt",
        "trunc"}


def has_checks(function: Callable) -> bool:
    """Whether a scenario can fail by a check: an assert or raise, or a call of an assert_...(), in it, or in a function
    of its mission that it names."""
    return any(any(instruction.opname == "RAISE_VARARGS" for instruction in dis.get_instructions(code))
               or any(name.startswith("assert_") for name in code.co_names) for code, _ in _reached(function))


def other_bits(function: Callable) -> Iterator[tuple[str, int, str]]:
    """(file, line, why) of what computes other bits under MicroPython, in an update or reset in Python and in the
    functions of its mission that it names."""
    trees: dict[str, list[Any]] = {}
    found: set[tuple[str, int, str]] = set()
    for code, around in _reached(function):
        if code.co_filename not in trees:
            try:
                with open(code.co_filename, encoding="utf-8") as file:
                    tree = ast.parse(file.read())
            except (OSError, SyntaxError):      # of a prompt, or changed since
                tree = ast.Module([], [])
            trees[code.co_filename] = [node for node in ast.walk(tree) if hasattr(node, "lineno")]
        lines = {line for _, _, line in code.co_lines() if line}
        found |= {(code.co_filename, node.lineno, why) for node in trees[code.co_filename] if node.lineno in lines
                  for why in [_unequal(node, around)] if why}
    yield from sorted(found)


def _unequal(node: ast.AST, around: dict[str, Any]) -> str:
    """Why an expression has other bits there; "" if it has the same."""
    if isinstance(node, (ast.BinOp, ast.AugAssign)) and isinstance(node.op, ast.Pow):
        sides = (node.left, node.right) if isinstance(node, ast.BinOp) else ()
        whole = sides and all(isinstance(side, ast.Constant) and isinstance(side.value, int) for side in sides)
        return "" if whole else "** rounds differently there; write products and math.sqrt()"
    value = getattr(builtins, node.id, None) if isinstance(node, ast.Name) else None
    if isinstance(node, ast.Name):
        value = around.get(node.id, value)
    elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and around.get(node.value.id) is math:
        value = getattr(math, node.attr, None)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) + len(node.keywords) > 1 \
            and around.get(node.func.id, getattr(builtins, node.func.id, None)) is round:
        return "round(x, digits) rounds differently there; write round(100 * x) / 100"
    if value is pow or value is math.pow:
        return "pow() rounds differently there; write products and math.sqrt()"
    if not inspect.isbuiltin(value) or value.__module__ != "math" or value.__name__ in SAME:
        return ""
    if value.__name__ in OTHER:
        return f"math.{value.__name__} is the C library's here and flight's own there"
    return f"there is no math.{value.__name__}"


def _reached(function: Callable) -> Iterator[tuple[Any, dict[str, Any]]]:
    """The code of a function, and of the functions of its mission that it names, each with the names around it."""
    seen: set[Any] = set()
    waiting: list[tuple[Any, dict[str, Any]]] = []      # code, and the names around it

    def take(named: Any, own: bool = False) -> None:
        named = inspect.unwrap(named) if callable(named) else named
        if inspect.isfunction(named) and (own or named.__module__.startswith(OWN)):
            waiting.append((named.__code__, {**named.__globals__, **inspect.getclosurevars(named).nonlocals}))

    take(function, own=True)
    while waiting:
        code, around = waiting.pop()
        if code in seen:
            continue
        seen.add(code)
        yield code, around
        waiting += [(const, around) for const in code.co_consts if inspect.iscode(const)]
        for name in (*code.co_names, *code.co_freevars):
            take(around.get(name))
            for module in (around.get(module_name) for module_name in code.co_names):
                if inspect.ismodule(module) and module.__name__.startswith(OWN):
                    take(getattr(module, name, None))
