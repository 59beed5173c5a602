# SPDX-License-Identifier: Apache-2.0
"""What the file ground.toml in a mission's folder adds to its packets and commands: calibrations and limits of numbers,
hazardous commands, and how long their verification may take.

    completed_within = 20                           # [s]

    [telemetry."flight.tracking.error.sigma_BR"]    # all its elements; or one: "flight.tracking.error.sigma_BR[0]"
    polynomial = [0, 229.18311805232927]            # shown: 0 + 229.18 x + ...
    unit       = "deg"
    warning    = [-5, 5]                            # beyond: a warning; in the unit that is shown
    critical   = [-20, inf]

    [commands."flight.reset_flight"]                # or "flight.write.control": all that begin so
    hazardous = "flight begins again"
"""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fledge.elements import ELEMENTS
from fledge.errors import SetupError, nearest
from fledge.export.packets import Database
from fledge.disk import shown
from registers.checked_toml import Tables, TomlError, parse, text_of

FILE = "ground.toml"


@dataclass(frozen=True)
class Shown:
    """How the ground shows a number, and when it warns."""
    polynomial: tuple[float, ...] = ()      # from the constant on
    unit: str | None = None                 # None: that of the header
    warning: tuple[float, float] | None = None
    critical: tuple[float, float] | None = None


@dataclass(frozen=True)
class Ground:
    accepted_within: float = 10.0           # [s]
    completed_within: float = 60.0          # [s]
    telemetry: dict[str, Shown] = field(default_factory=dict)   # flight.tracking.error.sigma_BR[0]
    hazardous: dict[str, str] = field(default_factory=dict)     # command -> why


def read(folder: Path | None, databases: Sequence[Database]) -> Ground:
    """That of a mission's folder; without a folder or such a file, nothing is added. Raises SetupError."""
    path = folder / FILE if folder else Path(FILE)
    if not folder or not path.exists():
        return Ground()
    try:
        tables, lines = parse(text_of(path), path)
    except TomlError as error:
        raise SetupError(str(error)) from None
    reader = _Reader(str(shown(path)), lines)
    ground = reader.read(tables, databases)
    if wrong := reader.complaints():
        raise SetupError(wrong)
    return ground


def holds(key: str, path: str) -> bool:
    """Whether a key names this path, or the beginning of it."""
    return path == key or path.startswith((f"{key}.", f"{key}["))


class _Reader(Tables):
    def read(self, whole: dict, databases: Sequence[Database]) -> Ground:
        self.keys(whole, (), ("accepted_within", "completed_within", "telemetry", "commands"))
        times = {}
        for key in ("accepted_within", "completed_within"):
            times[key] = self.number(whole, (), key, getattr(Ground, key))
            if times[key] <= 0:
                self.refuse((key,), f"`{key}` is > 0 s", f"it is {times[key]:g}", "give a longer time")
        items = {f"{packet.path}.{item.name}": item for database in databases for packet in database.packets
                 for item in packet.items}
        commands = [command.path for database in databases for command in database.commands if not command.abstract]
        telemetry: dict[str, Shown] = {}
        hazardous: dict[str, str] = {}
        for key in self.table(whole, (), "telemetry"):
            table = self.table(whole["telemetry"], ("telemetry",), key)
            change = self.change(table, ("telemetry", key))
            for path in self.named(("telemetry", key), items):
                if items[path].enumerators or items[path].type not in ELEMENTS or items[path].type == "char":
                    self.refuse(("telemetry", key), "only numbers have calibrations and limits", f"{path} is none",
                                "name a number")
                telemetry[path] = change
        for key in self.table(whole, (), "commands"):
            table = self.table(whole["commands"], ("commands",), key)
            self.keys(table, ("commands", key), ("hazardous",))
            why = self.text(table, ("commands", key), "hazardous")
            hazardous |= {path: why for path in self.named(("commands", key), commands)}
        return Ground(**times, telemetry=telemetry, hazardous=hazardous)

    def named(self, at: tuple, paths: Iterable[str]) -> list[str]:
        """The paths that the key at the end of `at` holds."""
        ends = [path for path in paths if holds(at[-1], path)]
        if not ends:
            near = nearest(at[-1], [*paths, *(path.partition("[")[0] for path in paths)])
            self.refuse(at, f"a key of [{at[0]}] is of the mission", f"there is no {at[-1]}",
                        f"did you mean {near}?" if near else "./fledge export xtce writes all names")
        return ends

    def change(self, table: dict, at: tuple) -> Shown:
        self.keys(table, at, ("polynomial", "unit", "warning", "critical"))
        polynomial = self.numbers(table, at, "polynomial", None)
        limits = {key: self.numbers(table, at, key, 2) for key in ("warning", "critical")}
        for key, pair in limits.items():
            if pair and not pair[0] < pair[1]:
                self.refuse((*at, key), f"`{key}` is [low, high]", f"it is {list(pair)}", "give the lower one first")
        return Shown(polynomial or (), self.value(table, at, "unit", (str,), "a text", None),
                     **limits)      # type: ignore[arg-type]

    def numbers(self, table: dict, at: tuple, key: str, n: int | None) -> tuple[float, ...] | None:
        """Some numbers, n if it is given; of limits, also infinite ones."""
        value: Any = self.value(table, at, key, (list,), "an array of numbers", None)
        if value is None:
            return None
        good = isinstance(value, list) and value and all(
            isinstance(x, (int, float)) and not isinstance(x, bool) and (math.isfinite(x) if n is None else x == x)
            for x in value)
        if not good or n not in (None, len(value)):
            self.refuse((*at, key), f"`{key}` has {n or 'finite'} numbers", f"it is {value}", f"write {key} = [0, 1]")
            return None
        return tuple(map(float, value))
