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
from pathlib import Path
from typing import Any

from fledge.folders import project
from fledge.mission import target_math
from fledge.mission.flying import BUILTINS, OWN

ELSEWHERE = ("is Python's own here and flight's there: flight.py did not import this file, or another file imported it "
             "before")


def has_checks(function: Callable) -> bool:
    """Whether a scenario can fail by a check: an assert or raise, or a call of an assert_...(), in it, or in a function
    of its mission that it names."""
    return any(any(instruction.opname == "RAISE_VARARGS" for instruction in dis.get_instructions(code))
               or any(name.startswith("assert_") for name in code.co_names) for code, _ in _reached(function))


def other_bits(function: Callable) -> Iterator[tuple[str, int, str]]:
    """(file, line, why) of what computes other bits under MicroPython, in an update or reset in Python and in the
    functions of its mission and project that it names."""
    trees: dict[str, list[Any]] = {}
    found: set[tuple[str, int, str]] = set()
    for code, around in _reached(function, project()):
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
    flies = around.get("__builtins__") is BUILTINS
    if isinstance(node, (ast.BinOp, ast.AugAssign)) and isinstance(node.op, ast.Pow):
        return "" if flies else f"** {ELSEWHERE}"
    if isinstance(node, ast.Name):
        value = around.get(node.id, getattr(builtins, node.id, None))
    elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and \
            any(around.get(node.value.id) is module for module in (math, target_math)):
        value = getattr(around[node.value.id], node.attr, None)
    else:
        return ""
    if not flies and (value is pow or value is sum):
        return f"{value.__name__}() {ELSEWHERE}"
    if not inspect.isbuiltin(value) or value.__module__ != "math" or value.__name__ in target_math.SAME:
        return ""
    of_flight = inspect.isfunction(vars(target_math)[value.__name__])      # else Python's own, in C
    return f"math.{value.__name__} {ELSEWHERE}" if of_flight else f"there is no math.{value.__name__}"


def _reached(function: Callable, folder: Path | None = None) -> Iterator[tuple[Any, dict[str, Any]]]:
    """The code of a function, and of the functions of its mission, and of files in the folder, that it names, each with
    the names around it."""
    seen: set[Any] = set()
    waiting: list[tuple[Any, dict[str, Any]]] = []      # code, and the names around it

    def is_own(module: str, file: str | None) -> bool:
        return module.startswith(OWN) or bool(folder and file and Path(file).is_relative_to(folder))

    def take(named: Any, own: bool = False) -> None:
        named = inspect.unwrap(named) if callable(named) else named
        if inspect.isfunction(named) and (own or is_own(named.__module__, named.__code__.co_filename)):
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
                if inspect.ismodule(module) and is_own(module.__name__, getattr(module, "__file__", None)):
                    take(getattr(module, name, None))
