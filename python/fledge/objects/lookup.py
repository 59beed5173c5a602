# SPDX-License-Identifier: Apache-2.0
"""Attributes of a Python module from a dictionary of types, with helpful errors for unknown names."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

from fledge import _core
from fledge.errors import SetupError, instead
from fledge.objects import project
from fledge.objects.si import enumeration


def lookup(module: str, types: dict[str, Any],
           extra: dict[str, Any]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The __getattr__ and __dir__ of a Python module that has `types` and the enumerations of their fields besides its
    own `extra`."""
    @cache
    def enumerations() -> dict[str, Any]:
        tables = [_core.struct(type_) for type_ in types.values()]
        rows = [f.enumeration for table in tables for f in table.fields] + [table.events for table in tables]
        return {row[0]: enumeration(*row) for row in rows if row}

    def __getattr__(name: str) -> Any:
        if name in types:
            return types[name]
        if name.startswith("__"):
            raise AttributeError(name)
        if name in enumerations():
            return enumerations()[name]
        if unbuilt := project.unbuilt(module.rpartition(".")[2], name):
            raise SetupError(unbuilt)   # no AttributeError: of that, `from ... import` keeps nothing but the name
        known = [n for n in __dir__() if not n.startswith("_")]
        main = [n for n in types if _core.struct(types[n]).kind in ("module", "model")]
        own = [n for n in known if n not in types and n not in enumerations() and n[:1].isupper()
               and not isinstance(extra.get(n), dict) and not n.endswith("Error")]
        near = instead(name, known)
        raise AttributeError(f"{module} has no '{name}'{near} " + (
            f"there are {', '.join(sorted(main + own))}" if near == ";" else "./fledge list names all"))

    def __dir__() -> list[str]:
        # Without the imports of the module: modules, and functions of others.
        own = [n for n, value in extra.items() if not isinstance(value, ModuleType)
               and not (isinstance(value, (FunctionType, BuiltinFunctionType)) and value.__module__ != module)]
        return sorted([*types, *enumerations(), *own])

    return __getattr__, __dir__
