# SPDX-License-Identifier: Apache-2.0
"""Reads and checks the file of `fledge ground serve FILE`: all mistakes in one error with their lines.

docs/control-room.md lists the keys.
"""
from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fledge.ground.server.access import KEYS, Access, own
from fledge.errors import SetupError
from fledge.frames import Frames
from registers.checked_toml import Tables, TomlError, parse, shown, text_of

MORE = ("postgres",)        # tables that the modules of these names read
PASSWORD = re.compile(r"//[^/]*:[^/]*@|password *=")    # in the address of a database
NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True)
class Derived:
    """A parameter that is computed from others: by an expression, or by a function in a file."""
    name: str
    of: dict[str, str]          # name in the expression -> parameter
    expression: str = ""
    function: str = ""          # file.py:name, relative to FILE
    unit: str = ""
    description: str = ""
    limits: dict[str, list[float | None]] = field(default_factory=dict)


@dataclass(frozen=True)
class CraftSettings:
    name: str
    mission: str = ""           # a mission of Fledge; or
    database: tuple[Path, ...] = ()     # files of XTCE
    lenient: bool = False       # leave out what is wrong in them, and what refers to it
    process: str | None = None          # of a mission with several flight processes
    link: str = ""              # an address of fledge.ground; without it the server flies the mission
    root: str | None = None     # the container with which packets of a database begin
    header: str = "ccsds"       # of commands of a database: ccsds: sequence and length; cfs: the checksum too; none
    scenario: str = ""
    speed: float = 1.0          # times real time; 0: as fast as possible
    radio: str = ""             # of a mission that the server flies: the world's model by which packets pass
    keys: Path | None = None    # of a secured link
    role: int = 0
    light_time: float = 0.0     # [s] to the spacecraft: all answers may take twice that longer
    derived: tuple[Derived, ...] = ()


@dataclass(frozen=True)
class Settings:
    file: Path
    folder: Path = Path("runs/ground")      # archive and journal
    crafts: tuple[CraftSettings, ...] = ()
    access: Access = field(default_factory=Access)
    more: dict[str, Any] = field(default_factory=dict)      # the tables of MORE
    stamp: tuple[tuple[int, ...], ...] = field(default=(), compare=False)   # of the file when it was read

    @property
    def displays(self) -> Path:
        """Where displays are: NAME.toml."""
        return self.file.parent / "displays"

    def guarded(self) -> list[str]:
        """What other users of this machine may read of a server that has users. Raises SetupError for what they may
        change, and for the file, which has what passwords are checked by, and maybe that of a database."""
        if self.access.closed or PASSWORD.search(str(self.more.get("postgres"))):
            own(self.file, "it has passwords, or what they are checked by")
        if not self.access.closed or not self.folder.is_dir() or not self.folder.stat().st_mode & 0o77:
            return []
        modes = {path: path.stat().st_mode for path in (self.folder, *self.folder.iterdir()) if path.exists()}
        if open_ones := [path for path, mode in modes.items() if mode & 0o22]:
            raise SetupError(f"others may change {open_ones[0]}, where the server keeps what happened: "
                             f"chmod -R go-w {self.folder}")
        return [f"others may read {self.folder}: chmod -R go= {self.folder} keeps it its owner's"]


def stamp(*files: Path) -> tuple[tuple[int, ...], ...]:
    """What differs once files or their modes were changed."""
    def of(file: Path) -> tuple[int, ...]:
        try:
            status = file.stat()
        except OSError:
            return ()
        return status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns

    return tuple(map(of, files))


def read(file: Path) -> Settings:
    """The settings of a file. Raises SetupError with all mistakes."""
    if not file.is_file():
        raise SetupError(f"there is no file {file}")
    when = stamp(file)
    try:
        data, lines = parse(text_of(file), file)
    except TomlError as error:
        raise SetupError(str(error)) from None
    reader = _Reader(file, lines)
    settings = replace(reader.read(data), stamp=when)
    if wrong := reader.complaints():
        raise SetupError(wrong)
    return settings


class _Reader(Tables):
    def __init__(self, file: Path, lines: dict[Any, int]) -> None:
        super().__init__(str(file), lines)
        self.at = file.resolve().parent

    def read(self, data: dict[str, Any]) -> Settings:
        self.keys(data, (), ("folder", "craft", *MORE, *sorted(KEYS)))
        access = Access()
        try:
            access = Access.read(data, self.at)
        except SetupError as error:
            self.refuse((next((key for key in KEYS if key in data and str(error).startswith(key)), "host"),),
                        "users and addresses are as docs/control-room.md says", str(error), "mend it")
        crafts = [self.craft(craft, ("craft", i)) for i, craft in enumerate(self.tables(data, (), "craft"))]
        if not crafts and not self.problems:
            self.refuse((), "a control room has spacecraft", "there is none", "write [[craft]] with a mission")
        for i, craft in enumerate(crafts):
            if craft.name in [other.name for other in crafts[:i]]:
                self.refuse(("craft", i, "name"), "names differ", f"{craft.name} is there already", "give it a `name`")
        return Settings(
            Path(self.file), self.at / (self.text(data, (), "folder", "") or Settings.folder), tuple(crafts), access,
            {key: data[key] for key in MORE if key in data})

    def craft(self, table: dict[str, Any], at: tuple[Any, ...]) -> CraftSettings:
        self.keys(table, at, tuple(CraftSettings.__dataclass_fields__))
        mission = self.text(table, at, "mission", "")
        files = self.files(table, at)
        if bool(mission) == bool(files):
            self.refuse((*at, "mission"), "a spacecraft has a `mission` or a `database`",
                        f"there are {'both' if mission else 'neither'}", 'write mission = "nadir_spin"')
        link = self.text(table, at, "link", "")
        for key in ("scenario", "speed", "radio"):
            if key in table and link:
                self.refuse((*at, key), f"`{key}` is of a mission that the server flies", "there is a `link`",
                            "leave one of them out")
        for key in ("process", "keys", "role"):
            if key in table and files:
                self.refuse((*at, key), f"`{key}` is of a `mission`", "there is a `database`", "leave it out")
        if files and not link:
            self.refuse((*at, "link"), "a spacecraft with a `database` has a `link`", "there is none",
                        'write link = "udp://127.0.0.1:10025?listen=10015"')
        if link:
            self.address(link, (*at, "link"), Frames() if mission else None)
        speed = self.number(table, at, "speed", 1.0)
        if speed < 0:
            self.refuse((*at, "speed"), "`speed` is >= 0", f"it is {speed:g}", "0 is as fast as possible")
        light_time = self.number(table, at, "light_time", 0.0)
        if not 0 <= light_time <= 1e5:
            self.refuse((*at, "light_time"), "`light_time` is of seconds, from 0 to 1e5", f"it is {light_time:g}",
                        "it is 640 at Mars in February 2021")
        name = self.text(table, at, "name", Path(mission).name if mission else files[0].stem if files else "")
        if name and not NAME.fullmatch(name):
            self.refuse((*at, "name"), "a name is of letters, digits, `_`, `-` and `.`, up to 64",
                        f"it is {shown(name)}", "it stands in addresses and names folders")
        keys = self.text(table, at, "keys", "")
        header = self.choice(table, at, "header", ("ccsds", "cfs", "none"), "ccsds") or "ccsds"
        return CraftSettings(
            name or "?", str(self.at / mission) if "/" in mission else mission, files,
            bool(self.value(table, at, "lenient", (bool,), "true or false", False)),
            self.text(table, at, "process", "") or None, link, self.text(table, at, "root", "") or None, header,
            self.text(table, at, "scenario", ""), speed, self.text(table, at, "radio", ""),
            self.at / keys if keys else None, self.integer(table, at, "role", 0, 3, 0) or 0, light_time,
            tuple(self.derived(self.table(table["derived"], (*at, "derived"), key), (*at, "derived", key), key)
                  for key in self.table(table, at, "derived")))

    def address(self, link: str, at: tuple[Any, ...], frames: Frames | None) -> None:
        """frames: those of a mission, which may speak them, so that the address may have their options."""
        from fledge.ground.scripts.address import link_of

        try:
            link_of(link, frames=frames)
        except SetupError as error:
            self.refuse(at, "a link has an address", str(error), "docs/ground.md lists them")

    def files(self, table: dict[str, Any], at: tuple[Any, ...]) -> tuple[Path, ...]:
        given = self.value(table, at, "database", (list, str), "files of XTCE", []) or []
        names = [given] if isinstance(given, str) else given
        files = [self.at / name for name in names if isinstance(name, str)]
        for file in files:
            if not file.is_file():
                self.refuse((*at, "database"), "files of a database are there", f"there is no {file}",
                            "it is relative to this file's folder")
        return tuple(files)

    def derived(self, table: dict[str, Any], at: tuple[Any, ...], name: str) -> Derived:
        self.keys(table, at, ("of", "expression", "function", "unit", "description", "limits"))
        inputs = self.table(table, at, "of")
        if not inputs or not all(isinstance(path, str) and key.isidentifier() for key, path in inputs.items()):
            self.refuse((*at, "of"), "`of` has names and their parameters", f"it is {shown(inputs)}",
                        'write of = { h = "flight.tracking.error.sigma_BR[0]" }')
        given = [key for key in ("expression", "function") if table.get(key)]
        if len(given) != 1:
            self.refuse((*at, "expression"), "a derived parameter has an `expression` or a `function`",
                        f"there are {'both' if given else 'neither'}", 'write expression = "2 * h"')
        expression, function, unit, description = (self.text(table, at, key, "") for key in (
            "expression", "function", "unit", "description"))
        return Derived(name, dict(inputs), expression, function, unit, description, self.table(table, at, "limits"))
