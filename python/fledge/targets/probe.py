# SPDX-License-Identifier: Apache-2.0
"""A program into the memory of a board, by openocd and a debug probe. Files targets/NAME/boards/BOARD.toml describe
boards, those of Fledge and of a project:

    about       what it is
    processor   as a program's header names it: ARM, RISC-V, ... (fledge/elf.py)
    bits        32 or 64
    big_endian  true: it has its high byte first
    doubles     whether it has 64-bit floating point in hardware
    scripts     files of openocd, in its own folders or beside the board's file
    commands    of openocd, before it connects
    load        commands of openocd that load {file}, whose first instruction is at {entry}, and start it
    [[memory]]  name, begin, size; loads = true: openocd writes there
"""
from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from pathlib import Path

from fledge import elf
from fledge.errors import Failure, did_you_mean, printable

MISSING = "openocd is not installed here; as root, run: apt-get install openocd"


@dataclass
class Memory:
    """A range of a board's addresses."""
    name: str
    begin: int
    size: int
    loads: bool

    def holds(self, address: int) -> bool:
        return self.begin <= address < self.begin + self.size


@dataclass
class Board:
    """A board that openocd can load."""
    name: str
    about: str
    processor: str
    bits: int
    big_endian: bool
    doubles: bool
    scripts: list[str]
    commands: list[str]
    load: list[str]
    memory: list[Memory]

    def check(self, program: elf.Elf) -> None:
        """Raises Failure if a program cannot run there."""
        own = f"{self.processor}, {self.bits} bits" + ", big-endian" * self.big_endian
        if program.processor != own:
            raise Failure(f"{program.path} is for another processor: it is for {program.processor}, {self.name} has "
                          f"{own}; build it by the compiler of that one")
        if program.kind != elf.EXECUTABLE or not program.segments:
            raise Failure(f"{program.path} is no linked program; name the one that the linker made, not an object or "
                          "a library")
        if program.doubles and not self.doubles:
            raise Failure(f"{program.path} is built for 64-bit floating point in hardware, which {self.name} lacks; "
                          "build it with software doubles (-mfloat-abi=soft of ARM, -mabi=ilp32 or lp64 of RISC-V)")
        for segment in program.segments:
            if segment.stored:
                self._fits(program.path, segment.load, segment.stored, [area for area in self.memory if area.loads])
            self._fits(program.path, segment.begin, segment.size, self.memory)

    def _fits(self, path: Path, begin: int, size: int, areas: Sequence[Memory]) -> None:
        area = next((area for area in areas if area.holds(begin)), None)
        known = ", ".join(f"{area.name} at {area.begin:#010x}, {area.size // 1024} KiB" for area in areas)
        if area is None:
            raise Failure(f"{path} has {size} bytes at {begin:#010x}, where {self.name} has no memory for them; link "
                          f"it for {known}")
        if begin + size > area.begin + area.size:
            raise Failure(f"{path} is larger than the {area.name} of {self.name}: {size} bytes from {begin:#010x} on, "
                          f"and {area.begin + area.size - begin} are there; make it smaller, or link it for more of "
                          f"{known}")

    def command(self, program: elf.Elf, probe: str = "") -> list[str]:
        """The command that loads a program, and starts it. probe: the serial number of the debug probe."""
        if re.search(r"[{}\\\n]", path := str(program.path.resolve())):
            raise Failure(f"{path}: openocd takes no path with braces, a backslash or a line feed; copy it elsewhere")
        words = ["openocd", *["-c", f"adapter serial {probe}"] * bool(probe)]
        for script in self.scripts:
            words += ["-f", script]
        for command in self.commands:
            words += ["-c", command]
        for command in self.load:
            words += ["-c", command.replace("{file}", "{" + path + "}").replace("{entry}", hex(program.entry))]
        return words


def board(name: str) -> Board:
    """Raises Failure if there is none, or if its file is wrong."""
    from fledge.targets import boards

    known = boards()
    if name not in known:
        near = did_you_mean(name, known)
        raise Failure(f"load: there is no board '{name}'{near} there are {', '.join(known)}, and ssh:HOST; a file "
                      "targets/NAME/boards/BOARD.toml describes one more")
    return _board(name, known[name])


def _board(name: str, path: Path) -> Board:
    from registers.checked_toml import TomlError, Tables, parse, text_of

    try:
        data, lines = parse(text_of(path), path)
    except TomlError as error:
        raise Failure(str(error)) from None
    take = Tables(str(path), lines)
    take.keys(data, (), ("about", "processor", "bits", "big_endian", "doubles", "scripts", "commands", "load",
                         "memory"))

    def words(key: str) -> list[str]:
        value = take.value(data, (), key, (list,), "a list of texts", []) or []
        if not all(isinstance(entry, str) for entry in value):
            take.refuse((key,), f"`{key}` is a list of texts", "another value is in it", "put quotes around each")
            return []
        return value

    def flag(table: dict[str, Any], path: tuple[Any, ...], key: str) -> bool:
        return bool(take.value(table, path, key, (bool,), "true or false", False))

    memory = []
    for i, table in enumerate(take.tables(data, (), "memory")):
        where = ("memory", i)
        take.keys(table, where, ("name", "begin", "size", "loads"))
        memory.append(Memory(take.text(table, where, "name", ...), take.integer(table, where, "begin", 0, 2**64) or 0,
                             take.integer(table, where, "size", 1, 2**64) or 0, flag(table, where, "loads")))
    board = Board(name, take.text(data, (), "about", ""), take.choice(data, (), "processor", sorted(
        {*elf.MACHINES.values()})) or "", take.choice(data, (), "bits", (32, 64)) or 0, flag(data, (), "big_endian"),
        flag(data, (), "doubles"), [str(beside) if (beside := path.parent / word).is_file() else word
                                    for word in words("scripts")], words("commands"), words("load"), memory)
    if not board.load:
        take.refuse(("load",), "`load` has the commands that load a program", "it has none",
                    'write load = ["program {file} verify reset exit"]')
    if not any(area.loads for area in memory):
        take.refuse(("memory",), "openocd writes into some [[memory]]", "none has loads = true", "add one")
    if take.problems:
        raise Failure(take.complaints())
    return board


def run(command: list[str], name: str) -> None:
    """Load by a command; its output goes to the user. Raises Failure with the remedy if it fails."""
    import subprocess

    from fledge.programs import without_preload

    try:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                   errors="replace", env=without_preload(os.environ))
    except FileNotFoundError:
        raise Failure(f"load: {MISSING}") from None
    assert process.stdout
    lines = []
    with process:
        for line in process.stdout:
            if line.strip():
                lines.append(line.rstrip())
                print(f"  | {printable(lines[-1])}", flush=True)
    if process.returncode:
        raise Failure(f"load: openocd has not loaded {name}: {_reason(lines)}", 1)


def _reason(lines: list[str]) -> str:
    text = "\n".join(lines)
    for pattern, what in ((r"LIBUSB_ERROR_ACCESS", "this user may not use the debug probe; join the group plugdev, and "
                           "log in again"),
                          (r"LIBUSB_ERROR_BUSY|unable to claim|already in use", "another program holds the debug "
                           "probe; end it"),
                          (r"open failed|no device found|No J-Link|unable to open ftdi", "no debug probe of this board "
                           "is found; connect its USB cable, or name one of several by --probe"),
                          (r"Verify Failed|checksum mismatch", "what the board holds now is not the program; load it "
                           "again, and look at cable and supply"),
                          (r"UNEXPECTED|unexpected idcode|init mode failed|IR capture error|unable to connect to the "
                           r"target", "the probe answers, but not this processor; look at the board's name, its supply "
                           "and the probe's cable"),
                          (r"couldn't open|Can't find", "a file that it needs is not there, see above")):
        if re.search(pattern, text, re.IGNORECASE):
            return what
    return next((line for line in reversed(lines) if "rror" in line), lines[-1] if lines else "it gives no reason")
