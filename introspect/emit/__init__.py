# SPDX-License-Identifier: Apache-2.0
"""Emitters: each turns one library of a model into files.

An emitter is a function `emit(library) -> {file name: text}`. Its text depends on the model alone,
in a fixed order, so that equal headers give equal files. A new emitter costs its module and a line.
"""
from introspect.emit import functions, layout, models, orders, schema, stubs, tables

EMITTERS = {
    "functions": functions.emit,
    "tables": tables.emit,
    "layout": layout.emit,
    "models": models.emit,
    "orders": orders.emit,
    "schema": schema.emit,
    "stubs": stubs.emit,
}
