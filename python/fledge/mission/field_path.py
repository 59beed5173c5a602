# SPDX-License-Identifier: Apache-2.0
"""Paths of numbers: "world.craft.I_B[0, 0]", "flight.tracking.error.sigma_BR"."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import _core, flight
from fledge.elements import ELEMENTS
from fledge.errors import SetupError, did_you_mean, listed
from fledge.objects.measured import flat_index
from fledge.records.series import HEAD

if TYPE_CHECKING:
    from fledge import _core
    from fledge.mission.process import Process
    from fledge.mission.simulation import Simulation


class FieldPath:
    """The field that a path names, and the elements that it selects.

    owner: the module or model; holder: it, or the struct in it that has the field; port: the input or output that has
    the field, or None; offset: of the field in the port [bytes]; elements: flat indices; shape: of the elements
    together; full: the path without them; field: its declaration; stored: that of the number in memory, which differs
    for a mode alone.
    """

    def __init__(self, simulation: Simulation, path: str) -> None:
        self.path = " ".join(path.split())
        self.field: Any         # a Field, or a ModeField
        self.of_mode = False
        if mode := re.fullmatch(r"(\w+)\.mode", self.path):
            if any(p.name == mode[1] and not p.instances.get("mode") for p in simulation.processes):
                return self._of_mode(simulation.process(mode[1]))
        parts = re.fullmatch(r"(\w+)\.(\w+)((?:\.\w+(?:\[[\d, ]+\])*)+)", self.path)
        if not parts:
            raise SetupError(f"'{path}': expected process.instance.name, as in world.craft.I_B or "
                             "world.craft.I_B[0, 0]")
        processes = {p.name: p for p in simulation.processes}
        if parts[1] not in processes:
            raise SetupError(f"{path}: there is no process '{parts[1]}'{did_you_mean(parts[1], processes)} there are "
                             + listed(list(processes)))
        process = processes[parts[1]]
        if parts[2] not in process.instances:
            raise SetupError(f"{path}: {process.unknown(parts[2])}")
        self.owner = process.instances[parts[2]]
        self.port: str | None = None
        self.offset = 0
        struct, at, self.holder = _core.struct(self.owner), f"{parts[1]}.{parts[2]}", self.owner
        names = [(m[1], [int(i) for i in re.findall(r"\d+", m[2])]) for m in re.finditer(r"\.(\w+)([^.]*)", parts[3])]
        for i, (name, indices) in enumerate(names, 1):
            self.field = _member(struct, name, at, path)
            at = f"{at}.{name}"
            if i == 1:
                self.group = self.field.group
            if self.port is not None:
                self.offset += self.field.offset
            if self.field.type != "struct":
                break
            if self.group != "par" and self.port is None:
                self.port = at
            row, inside = self._row(indices, at)
            struct, at = self.field.struct, at + inside
            self.offset += row * struct.size
            self.holder = _core.row(self.holder, name, row)
        else:
            raise SetupError(f"{path} is a whole message; name one of its fields: " + listed(names_of(struct)))
        if i < len(names):
            raise SetupError(f"{path}: {at} is a number or array, and has no '{names[i][0]}'")
        if self.field.type == "char":
            raise SetupError(f"{path} is a text; a path here names numbers")
        self.full, self.stored = at, self.field
        self.elements, self.shape = self._select(indices)

    def _of_mode(self, process: Process) -> None:
        """The mode of a process, as its executive says it."""
        if not process.modes:
            raise SetupError(f"{self.path}: the process {process.name} has no modes")
        self.of_mode = True
        self.field = ModeField([(name, i) for i, (name, _) in enumerate(process.modes)])
        self.owner = self.holder = process
        self.stored = _member(_core.struct(flight.ProcessMode), "index", self.path, self.path)
        self.port, self.offset, self.group, self.full = self.path, self.stored.offset, "out", self.path
        self.elements, self.shape = [0], ()

    def _row(self, indices: Sequence[int], at: str) -> tuple[int, str]:
        """(index, "[index]") of a struct, in an array of them."""
        shape = self.field.shape
        if len(indices) != len(shape) or any(i >= n for i, n in zip(indices, shape)):
            raise SetupError(f"{self.path}: {at} " + (f"has {shape[0]} rows; name one, as in {at}[0]" if shape
                                                      else "is no array"))
        used = getattr(self.holder, self.field.count) if self.field.count and self.group == "par" else None
        if used is not None and indices[0] >= used:
            raise SetupError(f"{self.path}: of the rows of {at} the mission gives {used}")
        return (indices[0], f"[{indices[0]}]") if shape else (0, "")

    def _select(self, indices: Sequence[int]) -> tuple[list[int], tuple[int, ...]]:
        """(flat indices, shape) of [0, 1] or [2], in the rows that are in use."""
        shape = self.field.shape
        if shape and self.field.count and self.port is None:
            shape = (int(getattr(self.holder, self.field.count)), *shape[1:])
        if len(indices) > len(shape) or any(i >= n for i, n in zip(indices, shape)):
            what = f"has shape {shape}" if shape else "is a single number"
            raise SetupError(f"{self.path}: {self.full} {what}; there is no element "
                             f"[{', '.join(map(str, indices))}]")
        rest = self.field.shape[len(indices):] if indices else shape
        n = math.prod(rest)
        first = flat_index(indices, self.field.shape) * n
        return list(range(first, first + n)), tuple(rest)

    @property
    def recorded(self) -> str:
        """Its path in records."""
        return self.path + ".index" * self.of_mode

    def value(self) -> float:
        """The number there, of a path that selects one element."""
        import numpy as np

        return float(np.ravel(getattr(self.holder, self.field.name))[self.elements[0]])

    @property
    def width(self) -> int:
        """[bytes] of an element."""
        return ELEMENTS[self.stored.type].size

    @property
    def has_quality(self) -> bool:
        """Whether the quality of a message is that of the number: not of its head, nor of a mode."""
        return self.port is not None and not self.of_mode and not self.full.startswith(f"{self.port}.{HEAD}")

    def names(self) -> list[str]:
        """The path of each element: "world.craft.I_B[0, 1]"."""
        return [self.full + index_text(e, self.field.shape) for e in self.elements]

    @property
    def unit(self) -> str:
        return "" if self.field.unit in ("", "-") else self.field.unit


class ModeField:
    """The index of a mode, as a field of a header is described. enumerators: (name, index) of each mode"""

    name, type, ctype, unit, dims, rule, count = "mode", "enum", "Mode", "-", (0,) * 8, "", None
    shape: tuple[int, ...] = ()
    doc = "the mode in force"

    def __init__(self, enumerators: list[tuple[str, int]]) -> None:
        self.enumerators = enumerators


class ModePort(NamedTuple):
    """What the executive of a process says of its mode, for Simulation.record()."""
    process: str


def index_text(element: int, shape: Sequence[int]) -> str:
    """The indices of an element by its place in memory: "[0, 1]"; "" of a number."""
    index = []
    for n in reversed(shape):
        element, i = divmod(element, n)
        index.append(str(i))
    return f"[{', '.join(reversed(index))}]" if index else ""


def names_of(struct: _core.Struct, groups: Sequence[str] = ("", "in", "out", "par")) -> list[str]:
    return [f.name for f in struct.fields if f.group in groups and not f.spare]


def _member(struct: _core.Struct, name: str, owner: str, path: str) -> _core.Field:
    for field in struct.fields:
        if field.name == name and not field.spare:
            return field
    known = names_of(struct)
    raise SetupError(f"{path}: {owner} has no '{name}'{did_you_mean(name, known)} it has "
                     + listed(known, none="no parameters, inputs or outputs"))


def port(simulation: Simulation, path: str) -> Any:
    """The input or output at a path, or the ModePort of "flight.mode"."""
    if path.count(".") == 1:
        return ModePort(path.partition(".")[0])
    process, instance, port = path.split(".")
    return getattr(getattr(simulation.process(process), instance), port)
