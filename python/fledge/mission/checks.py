# SPDX-License-Identifier: Apache-2.0
"""Whether a scenario checks anything."""
from __future__ import annotations

import dis
import inspect
from collections.abc import Callable
from typing import Any

OWN = "_mission_"       # begins the names of the modules of missions


def has_checks(function: Callable) -> bool:
    """Whether a scenario can fail by a check: an assert or raise, or a call of an assert_...(), in it, or in a function
    of its mission that it names."""
    seen: set[Any] = set()
    waiting: list[tuple[Any, dict[str, Any]]] = []      # code, and the names around it

    def take(named: Any) -> None:
        named = inspect.unwrap(named) if callable(named) else named
        if inspect.isfunction(named) and named.__module__.startswith(OWN):
            waiting.append((named.__code__, named.__globals__))

    waiting.append(((first := inspect.unwrap(function)).__code__, first.__globals__))
    while waiting:
        code, around = waiting.pop()
        if code in seen:
            continue
        seen.add(code)
        if any(instruction.opname == "RAISE_VARARGS" for instruction in dis.get_instructions(code)) or any(
                name.startswith("assert_") for name in code.co_names):
            return True
        waiting += [(const, around) for const in code.co_consts if inspect.iscode(const)]
        for name in code.co_names:
            take(around.get(name))
            for module in (around.get(module_name) for module_name in code.co_names):
                if inspect.ismodule(module) and module.__name__.startswith(OWN):
                    take(getattr(module, name, None))
    return False
