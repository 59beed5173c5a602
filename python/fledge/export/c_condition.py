# SPDX-License-Identifier: Apache-2.0
"""A flight event's condition as an expression of C, computed as sim::Condition::holds() does."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fledge.export.c_values import indices

if TYPE_CHECKING:
    from fledge.export.read import Event


def condition(event: Event) -> tuple[list[str], str]:
    """(statements before it, the expression that is 1 where the condition holds)."""
    c = event.condition
    start, field, first = locate(event.module.struct, c.offset, f"m->{event.module.name}")
    elements = [start + index for index in indices_of(field)]
    before = []
    if c.measure == "element":
        value = number(field, elements[first])
    elif field.ctype == "Vec3" and len(field.shape) == 1:
        value = f"exec_{c.measure}({start}.v, 3)"
    elif field.type == "f64" and len(field.shape) == 1:
        value = f"exec_{c.measure}({start}, {len(elements)})"
    else:
        table = f"{event.name}_elements"
        before = [f"    const double {table}[] = {{", *(f"        {number(field, e)}," for e in elements), "    };"]
        value = f"exec_{c.measure}({table}, {len(elements)})"
    return before, f"{value} {c.comparison} {float(c.constant)!r}"


def indices_of(field: Any) -> list[str]:
    """The C behind a field's name that picks each element, in the order of memory."""
    if field.ctype == "Vec3":
        return [outer + ".v" + inner for outer in indices(field.shape[:-1]) for inner in indices(field.shape[-1:])]
    if field.ctype == "Mat3":
        return [outer + ".m" + inner for outer in indices(field.shape[:-2]) for inner in indices(field.shape[-2:])]
    return indices(field.shape)


def number(field: Any, expression: str) -> str:
    """As a double, as all comparisons are made."""
    return expression if field.type == "f64" else f"(double){expression}"


def locate(struct: Any, offset: int, start: str) -> tuple[str, Any, int]:
    """(expression, field, number of the element) of what lies at an offset in a struct."""
    field = next(f for f in struct.fields if f.offset <= offset < f.offset + f.size)
    path = f"{start}.{field.group}.{field.name}" if field.group else f"{start}.{field.name}"
    offset -= field.offset
    if field.type == "struct":
        row, offset = divmod(offset, field.struct.size)
        return locate(field.struct, offset, path + indices(field.shape)[row])
    return path, field, offset // (field.size // len(indices(field.shape)))
