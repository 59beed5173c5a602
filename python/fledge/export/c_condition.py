# SPDX-License-Identifier: Apache-2.0
"""A flight event's condition in C, computed as sim::Condition::holds() does, and what the event sets."""
from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from fledge.elements import ELEMENTS
from fledge.export.c_text import COLUMNS, broken, wrap
from fledge.export.c_values import indices, integer, literal

if TYPE_CHECKING:
    from fledge import _core
    from fledge.export.read import Module, Steps

LIMITS = {"i64": (-2**63, 2**63), "u64": (0, 2**64)}


def condition(name: str, steps: Steps, modules: Mapping[str, Module], first: str = "") -> list[str]:
    """Statements that end with an int of that name, which is 1 where the condition holds.

    steps: those of objects.Condition; modules: by path; first: an expression that must hold besides.
    """
    lines, compared = [], []
    for i, compares in enumerate(step for step in steps if not isinstance(step, str)):
        before, expression = comparison(compares, modules, f"{name}_{i + 1}")
        lines += before
        compared.append(expression)
    if len(compared) > 1:
        names = [f"{name}_{i + 1}" for i in range(len(compared))]
        lines += [line for name, expression in zip(names, compared) for line in statement(name, expression)]
        compared = names
    results: list[tuple[str, str]] = []   # (expression, the operator that it is made with) of each that waits
    remaining = iter(compared)
    for step in steps:
        if not isinstance(step, str):
            results.append((next(remaining), ""))
        elif step == "~":
            results.append((f"!({results.pop()[0]})", ""))
        else:
            b, a = results.pop(), results.pop()
            results.append((f" {step}{step} ".join(enclosed(*operand, step) for operand in (a, b)), step))
    expression, made_with = results[0]
    if first:
        expression = f"{first} && {enclosed(expression, made_with, '&')}"
    return lines + statement(name, expression)


def statement(name: str, expression: str) -> list[str]:
    """The declaration of an int, in lines that fit."""
    lines = broken(f"const int {name} = {expression};").split("\n")
    if max(map(len, lines)) > COLUMNS:
        lines = wrap(f"const int {name} = {expression};".split(" "), "    ", "        ")
    return lines


def enclosed(expression: str, made_with: str, operator: str) -> str:
    """As an operand: in parentheses, if it is made with the other operator."""
    return expression if made_with in ("", operator) else f"({expression})"


def comparison(step: tuple[_core.Operand, str, _core.Operand], modules: Mapping[str, Module], stem: str
               ) -> tuple[list[str], str]:
    """(statements before it, the expression) of a comparison. stem: what the names of tables begin with."""
    left, relation, right = step
    before: list[str] = []
    a, b = (value(operand, modules, before, f"{stem}_{end}") for operand, end in ((left, "a"), (right, "b")))
    wide = {operand.type for operand in (a, b)} & LIMITS.keys()
    if a.field and a.type == "enum" and b.constant is not None:
        return before, f"{a.expression} {relation} {literal_of(a.field, b.constant)}"
    if not wide:
        return before, f"{a.real()} {relation} {b.real()}"
    low, high = LIMITS[a.type] if a.type in wide else (0, 0)
    if a.type == b.type:
        return before, f"{a.expression} {relation} {b.expression}"
    # An unsigned number is always >= 0: compilers warn of this.
    if b.constant is not None and b.constant == int(b.constant) and low <= b.constant < high and (
            b.constant != 0 or a.type != "u64"):
        constant = integer(int(b.constant))
        return before, f"{a.expression} {relation} {constant}"
    return before, f"exec_difference({a.exact()}, {b.exact()}) {relation} 0.0"


class Value:
    """An operand in C."""

    def __init__(self, expression: str, type: str, field: _core.Field | None = None, constant: float | None = None
                 ) -> None:
        self.expression, self.type, self.field, self.constant = expression, type, field, constant

    def real(self) -> str:
        """As a double, as all comparisons are made."""
        return self.expression if self.type == "f64" else f"(double){self.expression}"

    def exact(self) -> str:
        if self.type in LIMITS:
            return f"exec_{'signed' if self.type == 'i64' else 'unsigned'}({self.expression})"
        return f"exec_real({self.real()})"


def value(operand: _core.Operand, modules: Mapping[str, Module], before: list[str], table: str) -> Value:
    """An operand; where it needs a table, statements are added to `before`."""
    constant = operand.constant
    if isinstance(constant, int):
        return Value(integer(constant), "i64" if constant < 2**63 else "u64", None, constant)
    if constant is not None:
        return Value(repr(constant), "f64", None, constant)
    assert operand.path
    module = modules[operand.path]
    start, field, first = locate(module.struct, operand.offset, f"m->{module.name}")
    elements = [start + index for index in indices_of(field)]
    if operand.measure == "element":
        return Value(elements[first], field.type, field)
    if field.ctype == "Vec3" and len(field.shape) == 1:
        table, n = f"{start}.v", 3
    elif field.type == "f64" and len(field.shape) == 1:
        table, n = start, len(elements)
    else:
        n = len(elements)
        reals = [f"        {Value(element, field.type).real()}," for element in elements]
        before += [f"    const double {table}[] = {{", *reals, "    };"]
    return Value(f"exec_{operand.measure}({table}, {n})", "f64")


def assignments(module: Module, offset: int, raw: bytes) -> Iterator[str]:
    """What sets the elements of a field, from that offset on."""
    start, field, first = locate(module.struct, offset, f"m->{module.name}")
    size = ELEMENTS[field.type].size
    for i, index in enumerate(indices_of(field)[first:first + len(raw) // size]):
        yield broken(f"{start}{index} = {literal(field, raw[i * size:(i + 1) * size])};")


def literal_of(field: _core.Field, value: float) -> str:
    """A number as an element of that field."""
    return literal(field, int(value).to_bytes(4, sys.byteorder, signed=True))


def indices_of(field: _core.Field) -> list[str]:
    """The C behind a field's name that picks each element, in the order of memory."""
    if field.ctype == "Vec3":
        return [outer + ".v" + inner for outer in indices(field.shape[:-1]) for inner in indices(field.shape[-1:])]
    if field.ctype == "Mat3":
        return [outer + ".m" + inner for outer in indices(field.shape[:-2]) for inner in indices(field.shape[-2:])]
    return indices(field.shape)


def locate(struct: _core.Struct, offset: int, start: str) -> tuple[str, _core.Field, int]:
    """(expression, field, number of the element) of what lies at an offset in a struct."""
    field = next(f for f in struct.fields if f.offset <= offset < f.offset + f.size)
    path = f"{start}.{field.group}.{field.name}" if field.group else f"{start}.{field.name}"
    offset -= field.offset
    if field.type == "struct":
        row, offset = divmod(offset, field.struct.size)
        return locate(field.struct, offset, path + indices(field.shape)[row])
    return path, field, offset // (field.size // len(indices(field.shape)))
