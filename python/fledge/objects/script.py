# SPDX-License-Identifier: Apache-2.0
"""Flight modules whose update is the user's, in Python: `fsw.SunSlew(update=slew, reset=begin)`."""

from __future__ import annotations

import os
from collections.abc import Callable
from types import TracebackType
from typing import Any

from fledge import _core
from fledge.errors import RunError, SetupError
from fledge.disk import shown

_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep


def check_script(kind: str, update: Any, reset: Any, turns: Any) -> None:
    """Raise SetupError if these are not the two functions of a module, of which the second may be None, and how many
    turns of loops and returns of functions an update may take on a target, or None. None of them is no script."""
    if update is reset is turns is None:
        return
    if update is None:
        raise SetupError(f"{kind}: {'reset' if reset is not None else 'turns'}= goes with update=, the module's update "
                         "in Python")
    if turns is not None and (not isinstance(turns, int) or isinstance(turns, bool) or not 0 < turns < 2**31):
        raise SetupError(f"{kind}.turns: expected a whole number from 1 to 2^31 - 1; found {turns!r}")
    for name, function, arguments in (("update", update, "(m, t, dt)"), ("reset", reset, "(m)")):
        if function is not None:
            check_function(f"{kind}.{name}", function, arguments)


def check_function(path: str, function: Any, arguments: str) -> None:
    """Raise SetupError if this is no function that can be called with `arguments`, as "(m, t, dt)"."""
    import inspect

    expected = f"{path}: expected a function of {arguments}; found "
    if not callable(function):
        raise SetupError(f"{expected}{function!r}")
    if any(test(function) for test in (inspect.isgeneratorfunction, inspect.iscoroutinefunction,
                                       inspect.isasyncgenfunction)):
        raise SetupError(f"{expected}{function_text(function)}, whose call does not run it: it is a generator or "
                         "is asynchronous")
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):     # of C, without one
        return
    try:
        signature.bind(*arguments.split(","))
    except TypeError:
        raise SetupError(f"{expected}{function_text(function)} with the arguments {signature}") from None


def script_failed(path: str, when: str, error: BaseException, trace: TracebackType | None) -> str:
    """Where and when a function of a module ended with an exception: the last line of the user's."""
    import traceback

    lines = traceback.extract_tb(trace)
    own = [line for line in lines if not line.filename.startswith(_PACKAGE)] or lines
    place = f"{shown(own[-1].filename)}, line {own[-1].lineno}: " if own else ""
    return f"{place}{path} {when}: {type(error).__name__}: {error}"


def air_numbers(what: str, when: str, found: Any) -> list[float]:
    """[density, v, v, v, temperature, molar mass] of what the method air_at() of a model returned."""
    import math

    parts = found if isinstance(found, tuple) and len(found) in (2, 4) else (found,)
    try:
        velocity = tuple(parts[1]) if len(parts) > 1 else (0.0, 0.0, 0.0)
        numbers = [float(x) for x in (parts[0], *velocity, *(parts[2:] or (0.0, 0.0)))]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 6 or not all(map(math.isfinite, numbers)) or not numbers[0] >= 0.0:
        raise RunError(f"{what} {when}: expected density >= 0 [kg/m^3], or (density, v_AN_N [m/s]), or (density, "
                       f"v_AN_N, temperature [K], molar_mass [kg/mol]), all finite; found {found!r}")
    return numbers


def script(obj: Any) -> tuple[Callable[..., Any], Callable[..., Any] | None] | None:
    """(update, reset or None) of a module in Python; None: it runs its C."""
    return _core.script(obj) if isinstance(obj, (_core.Module, _core.Model)) else None


def prototype(obj: Any) -> Any:
    """The class of a prototype; None for what has a header."""
    return _core.class_of(obj) if isinstance(obj, (_core.Module, _core.Model)) else None


def python_text(obj: Any) -> str:
    """What of a module or model is Python: "class SunSlew, prototypes.py, line 12"; "" for one in C."""
    if cls := prototype(obj):
        struct = cls._struct
        return f"class {struct.name}, {os.path.basename(struct.path)}, line {struct.line}"
    functions = script(obj)
    return function_text(functions[0]) if functions else ""


def short_function_text(function: Any) -> str:
    """ "slew()" """
    name = getattr(function, "__name__", type(function).__name__)
    return "a Python function" if name == "<lambda>" else f"{name}()"


def function_text(function: Any) -> str:
    """ "slew(), flight.py, line 12" """
    code = getattr(function, "__code__", None)
    name = getattr(function, "__qualname__", type(function).__qualname__).rpartition("<locals>.")[2]
    return f"{name}()" + (f", {os.path.basename(code.co_filename)}, line {code.co_firstlineno}" if code else "")
