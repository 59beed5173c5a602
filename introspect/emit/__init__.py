# SPDX-License-Identifier: Apache-2.0
"""Emitters: each turns one library of a model into files.

An emitter is a function `emit(library) -> {file name: text}`. Its text depends on the model alone,
in a fixed order, so that equal headers give equal files. A new emitter costs its module and a name.

Example:

    from pathlib import Path

    import introspect
    from introspect.emit import EMITTERS
    from introspect.model import Kind
    from introspect.reader import read
    from introspect.sources import Source

    model = read([Source(Path(introspect.__file__).parents[1], "flight", Kind.MODULE, "flight")])
    for name, text in EMITTERS["stubs"](model.library("flight")).items():
        print(name, len(text))
"""
from __future__ import annotations

from functools import partial
from importlib import import_module

TYPE_CHECKING = False   # of `typing`
if TYPE_CHECKING:
    from introspect.model import Library


def _emit(name: str, library: Library) -> dict[str, str]:
    return import_module(f"introspect.emit.{name}").emit(library)    # the flights of `fledge fly` need none of them


EMITTERS = {name: partial(_emit, name) for name in ("functions", "tables", "layout", "models", "orders", "protocol",
                                                    "schema", "stubs")}
