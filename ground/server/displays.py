# SPDX-License-Identifier: Apache-2.0
"""Displays that a mission composes: files displays/NAME.toml.

    title = "Pointing"

    [[panel]]
    title  = "Attitude error"
    values = ["flight.tracking.error.sigma_BR",                 # a field: all its elements, a row each
              { name = "flight.wheels.speeds.Omega[0]", label = "wheel 1", digits = 1 }]

    [[panel]]
    large = ["flight.tracking.error.sigma_BR[0]"]               # the same in large digits

    [[panel]]
    plot    = ["flight.tracking.error.sigma_BR"]
    minutes = 10                                                # the default
    wide    = true                                              # over the whole page, also of the other panels

    [[panel]]
    commands = [{ command = "flight.write.steering.K1", label = "Soft", arguments = { K1 = 0.1 } }]

A name that is not known stays in its panel with the reason, and the rest of the display works.
"""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fledge.errors import did_you_mean
from fledge.disk import shown
from registers.checked_toml import Tables, TomlError, parse, text_of

KINDS = ("values", "large", "plot", "commands")
MOST = 200      # rows of a name
Rows = Sequence[Mapping[str, Any]]
Place = tuple[str | int, ...]       # of a value: the keys and numbers that lead to it


def displays(folders: Iterable[Path], slots: Rows, forms: Rows) -> list[dict[str, Any]]:
    """The displays of the files *.toml of these folders, by their names; the first folder that has a name counts.

    slots, forms: the parameters and commands of the craft. Each is {name, title, problems, panels: [{kind, title, wide,
    minutes, items}]}; an item has a slot, label and digits, or a command, label and arguments, or a problem. problems:
    "FILE:LINE: ...", what is wrong with the file."""
    files: dict[str, Path] = {}
    for folder in folders:
        for file in folder.glob("*.toml"):
            files.setdefault(file.stem, file)
    return [_display(files[name], slots, forms) for name in sorted(files)]


def _display(file: Path, slots: Rows, forms: Rows) -> dict[str, Any]:
    display: dict[str, Any] = {"name": file.stem, "title": file.stem, "problems": [], "panels": []}
    try:
        text = text_of(file)
        whole, lines = parse(text, Path(shown(file)))
    except (OSError, TomlError) as error:
        return display | {"problems": [str(error)]}
    reader = _Reader(str(shown(file)), lines, text, slots, forms)
    display["panels"] = reader.read(whole)
    display["title"] = reader.text(whole, (), "title", file.stem)
    return display | {"problems": reader.complaints().splitlines()}


class _Reader(Tables):
    def __init__(self, file: str, lines: dict[Place, int], text: str, slots: Rows, forms: Rows) -> None:
        super().__init__(file, lines)
        self.rows = text.splitlines()
        self.slots = {str(slot["name"]): slot for slot in slots}
        self.forms = {str(form["name"]): form for form in forms}

    def read(self, whole: dict[str, Any]) -> list[dict[str, Any]]:
        self.keys(whole, (), ("title", "panel"))
        return [self.panel(table, ("panel", i)) for i, table in enumerate(self.tables(whole, (), "panel"))]

    def panel(self, table: dict[str, Any], at: Place) -> dict[str, Any]:
        self.keys(table, at, ("title", "wide", "minutes", *KINDS))
        kinds = [key for key in KINDS if key in table]
        if len(kinds) != 1:
            self.refuse(at, f"a panel has one of {', '.join(KINDS)}", f"it has {', '.join(kinds) or 'none'}",
                        "give one, and more panels")
        kind = kinds[0] if kinds else "values"
        minutes = self.number(table, at, "minutes", 10.0)
        if not 0 < minutes <= 1440:
            self.refuse((*at, "minutes"), "`minutes` is > 0, and a day at most", f"it is {minutes:g}", "give 10")
            minutes = 10.0
        items: list[dict[str, Any]] = []
        for given in self.value(table, at, kind, (list,), "an array", []) or []:
            entry = {("command" if kind == "commands" else "name"): given} if isinstance(given, str) else given
            if not isinstance(entry, dict):
                self.refuse((*at, kind), f"`{kind}` has names and tables", f"there is {given!r}",
                            "write a name in quotes")
            else:
                items += self.button(entry, (*at, kind)) if kind == "commands" else self.numbers(entry, (*at, kind))
        return {"kind": kind, "title": self.text(table, at, "title", ""), "minutes": minutes, "items": items,
                "wide": bool(self.value(table, at, "wide", (bool,), "true or false", False))}

    def numbers(self, given: dict[str, Any], at: Place) -> list[dict[str, Any]]:
        """The slots of a name: its own, or those of all its elements and members."""
        self.keys(given, at, ("name", "label", "digits"))
        name, label = self.text(given, at, "name"), self.text(given, at, "label", "")
        digits = self.value(given, at, "digits", (int,), "a whole number", None)
        if digits is not None and not 0 <= digits <= 17:
            self.refuse((*at, "digits"), "`digits` is from 0 to 17", f"it is {digits}", "leave it out")
            digits = None
        matches = [self.slots[name]] if name in self.slots else [
            slot for path, slot in self.slots.items() if path.startswith((f"{name}[", f"{name}."))]
        if not name or not matches or len(matches) > MOST:
            why = f"{len(matches)} parameters begin with '{name}'; {MOST} are the most" if matches and name else \
                f"there is no parameter '{name}'{did_you_mean(name, self.slots)}".rstrip(";")
            return [{"name": name, "label": label or name, "problem": f"{self.place(name, at)}: {why}"}]
        return [{"name": slot["name"], "slot": slot["slot"], "digits": digits,
                 "label": (label + str(slot["name"])[len(name):] if label else slot["name"])} for slot in matches]

    def button(self, given: dict[str, Any], at: Place) -> list[dict[str, Any]]:
        self.keys(given, at, ("command", "label", "arguments"))
        name = self.text(given, at, "command")
        arguments = self.table(given, at, "arguments")
        entry = {"command": name, "label": self.text(given, at, "label", "") or name, "arguments": arguments}
        why = ""
        if name not in self.forms:
            why = f"there is no command '{name}'{did_you_mean(name, self.forms)}".rstrip(";")
        else:
            known = [str(argument["name"]) for argument in self.forms[name]["arguments"]]
            why = next((f"{name} has no argument '{argument}'{did_you_mean(argument, known)}".rstrip(";")
                        for argument in arguments if argument not in known), "")
        return [entry | ({"problem": f"{self.place(name, at)}: {why}"} if why else {})]

    def place(self, name: str, at: Place) -> str:
        """FILE:LINE of a name: of its line in the array, or of the array's."""
        first: int = self.lines.get(at) or self.lines.get(at[:-1]) or 1
        line = next((i for i, row in enumerate(self.rows[first - 1:], first) if f'"{name}"' in row), first)
        return f"{self.file}:{line}"
