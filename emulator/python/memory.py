# SPDX-License-Identifier: Apache-2.0
"""The variables of an exported mission in the memory of a computer, by their C names: `board.flight.control.K`.

The computer is big-endian; its structs lie as on the desktop, because no message or module has padding.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fledge.elements import ELEMENTS
from fledge.errors import SetupError, did_you_mean
from fledge.objects.si import to_enumerators, to_si

if TYPE_CHECKING:
    from fledge import _core


def address(variable: Variable, name: str) -> int:
    """The address of a field of it."""
    return variable._place[1] + variable._field(name).offset


class Variable:
    """A struct in the memory of a computer: its fields are attributes, which read and write that memory."""

    def __init__(self, board: Any, address: int, struct: _core.Struct, path: str) -> None:
        object.__setattr__(self, "_place", (board, address, struct, path))

    def _field(self, name: str) -> Any:
        _, _, struct, path = self._place
        known = [field for field in struct.fields if not field.spare]
        variable = next((variable for variable in known if variable.name == name), None)
        if variable is None:
            names = [variable.name for variable in known]
            raise AttributeError(f"{path} has no '{name}'{did_you_mean(name, names)} there are {', '.join(names)}")
        return variable

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        field = self._field(name)
        board, address, _, path = self._place
        at, n = address + field.offset, math.prod(field.shape)
        if field.type == "struct":
            rows = [Variable(board, at + i * (field.size // n), field.struct,
                             f"{path}.{name}" + (f"[{i}]" if field.shape else "")) for i in range(n)]
            return rows if field.shape else rows[0]
        raw = board.peek(at, field.size)
        if field.type == "char":
            return raw.split(b"\0")[0].decode("utf-8", "replace")
        values = np.frombuffer(raw, ">" + ELEMENTS[field.type].dtype).astype(ELEMENTS[field.type].dtype)
        return values.reshape(field.shape) if field.shape else values[0].item()

    def __setattr__(self, name: str, value: Any) -> None:
        field = self._field(name)
        board, address, _, path = self._place
        if field.type in ("struct", "char"):
            raise SetupError(f"{path}.{name} is a {'text' if field.type == 'char' else 'struct'}; "
                             "write its numbers, or the memory by board.poke()")
        dtype, whole = ELEMENTS[field.type].dtype, f"{path}.{name}"
        numbers = to_enumerators(field.ctype, field.enumerators, value, whole) if field.type == "enum" else to_si(
            value, whole, field.unit, field.dims, f"a number in {field.unit}")
        values = np.asarray(numbers, dtype)
        if values.shape not in ((), tuple(field.shape)):
            raise SetupError(f"{whole} has shape {list(field.shape)}; found {list(values.shape)}")
        board.refuse_before_boot(whole)
        board.poke(address + field.offset, np.broadcast_to(values, field.shape).astype(">" + dtype).tobytes())

    def __dir__(self) -> list[str]:
        return [field.name for field in self._place[2].fields if not field.spare]

    def __repr__(self) -> str:
        _, address, struct, path = self._place
        lines = [f"{path}, a {struct.name} at 0x{address:08x}"]
        for field in struct.fields:
            if not field.spare and field.type != "struct":
                lines.append(f"  {field.name} = {getattr(self, field.name)} {field.unit}".rstrip())
        return "\n".join(lines)
