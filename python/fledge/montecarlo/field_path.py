# SPDX-License-Identifier: Apache-2.0
"""Paths of numbers: "world.craft.I_B[0, 0]", "flight.tracking.error.sigma_BR"."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from fledge import _core
from fledge.errors import SetupError, did_you_mean
from fledge.objects.measured import flat_index

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation


class FieldPath:
    """The field that a path names, and the elements that it selects.

    owner: the module or model; port: the input or output that has the field, or None; offset: of the
    field in the port [bytes]; elements: flat indices; shape: of the elements together.
    """

    def __init__(self, simulation: Simulation, path: str) -> None:
        self.path = " ".join(path.split())
        match = re.fullmatch(r"(\w+(?:\.\w+)*)((?:\[[\d, ]+\])*)", self.path)
        names = match[1].split(".") if match else []
        if not match or len(names) < 3:
            raise SetupError(f"'{path}': expected process.instance.name, as in world.craft.I_B or "
                             "world.craft.I_B[0, 0]")
        processes = {p.name: p for p in simulation.processes}
        if names[0] not in processes:
            raise SetupError(f"{path}: there is no process '{names[0]}'; there are {', '.join(processes)}")
        process = processes[names[0]]
        if names[1] not in process.instances:
            raise SetupError(f"{path}: {process.unknown(names[1])}")
        self.owner = process.instances[names[1]]
        self.port: str | None = None
        self.offset = 0
        struct, at = _core.struct(self.owner), ".".join(names[:2])
        for i, name in enumerate(names[2:], 3):
            self.field = _member(struct, name, at, path)
            at = f"{at}.{name}"
            if self.field.type != "struct":
                break
            if self.port is None:
                self.port = at
            else:
                self.offset += self.field.offset
            struct = self.field.struct
        else:
            raise SetupError(f"{path} is a whole message; name one of its fields: {', '.join(names_of(struct))}")
        if i < len(names):
            raise SetupError(f"{path}: {at} is a number or array, and has no '{names[i]}'")
        if self.field.type != "f64":
            raise SetupError(f"{path} is of type {self.field.ctype}; a path here names floating-point numbers")
        if self.port is not None:
            self.offset += self.field.offset
        self.full = at
        self.elements, self.shape = self._select(match[2])

    def _select(self, text):
        """(flat indices, shape) of "[0, 1]" or "[2]", in the rows that are in use."""
        shape = self.field.shape
        if shape and self.field.count and self.port is None:
            shape = (int(getattr(self.owner, self.field.count)), *shape[1:])
        indices = [int(i) for i in re.findall(r"\d+", text)]
        if len(indices) > len(shape) or any(i >= n for i, n in zip(indices, shape)):
            what = f"has shape {shape}" if shape else "is a single number"
            raise SetupError(f"{self.path}: {self.full} {what}; there is no element "
                             f"[{', '.join(map(str, indices))}]")
        rest = self.field.shape[len(indices):] if indices else shape
        n = math.prod(rest)
        first = flat_index(indices, self.field.shape) * n
        return list(range(first, first + n)), tuple(rest)

    def names(self) -> list[str]:
        """The path of each element: "world.craft.I_B[0, 1]"."""
        return [self.full + index_text(e, self.field.shape) for e in self.elements]

    @property
    def unit(self) -> str:
        return "" if self.field.unit in ("", "-") else self.field.unit


def index_text(element: int, shape: Sequence[int]) -> str:
    """The indices of an element by its place in memory: "[0, 1]"; "" of a number."""
    index = []
    for n in reversed(shape):
        element, i = divmod(element, n)
        index.append(str(i))
    return f"[{', '.join(reversed(index))}]" if index else ""


def names_of(struct: Any, groups: Sequence[str] = ("", "in", "out", "par")) -> list[str]:
    return [f.name for f in struct.fields if f.group in groups and not f.spare]


def _member(struct, name, owner, path):
    for field in struct.fields:
        if field.name == name and not field.spare:
            return field
    known = names_of(struct)
    raise SetupError(f"{path}: {owner} has no '{name}'{did_you_mean(name, known)} it has {', '.join(known)}")


def port(simulation: Simulation, path: str) -> Any:
    """The input or output at a path."""
    process, instance, port = path.split(".")
    return getattr(getattr(simulation.process(process), instance), port)
