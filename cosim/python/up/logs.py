# SPDX-License-Identifier: Apache-2.0
"""The output of the programs: a file each, and all.log with the lines of all.

Programs write into their files themselves, so that nothing is lost and no program waits for a reader. The session
gathers all.log from the files some times a second.
"""
from __future__ import annotations

import re
import time
from collections import deque
from pathlib import Path
from typing import BinaryIO

from fledge.errors import printable

_MOST = 1 << 20     # bytes that are read of one file at a time
_LONGEST = 1000     # characters of a line that is kept for the table


class Logs:
    def __init__(self, folder: Path, width: int):
        """width: of the longest name. Deletes older logs in the folder."""
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.log"):
            old.unlink()
        self.folder = folder
        self.recent: deque[tuple[str, str]] = deque(maxlen=200)     #: (name, line) of all logs
        self._width = width
        self._begun = time.monotonic()
        self._all = open(folder / "all.log", "w", encoding="utf-8")
        self._files: dict[str, tuple] = {}      # name -> (reader, bytes of an incomplete line)

    def file(self, name: str) -> Path:
        return self.folder / f"{name}.log"

    def open(self, name: str) -> BinaryIO:
        """A file into which a program writes; the output of an earlier process of the program stays."""
        file = open(self.file(name), "ab", buffering=0)
        if name not in self._files:
            self._files[name] = (open(self.file(name), "rb"), b"")
        return file

    def say(self, name: str, text: str) -> None:
        """Add a line of Fledge to the log of a program."""
        with open(self.file(name), "ab") as file:
            file.write(f"--- {text}\n".encode())

    def gather(self, rest: bool = False) -> list[tuple[str, str]]:
        """The new lines as (name, line); they go into all.log too. rest: also incomplete lines."""
        lines = []
        for name, (reader, begun) in self._files.items():
            data = begun + reader.read(_MOST)
            whole, newline, begun = data.rpartition(b"\n")
            if rest and begun or len(begun) > _MOST:
                whole, newline, begun = data, b"\n", b""
            self._files[name] = (reader, begun)
            if newline:
                lines += [(name, line.decode("utf-8", "replace")) for line in whole.split(b"\n")]
        if lines:
            when = time.monotonic() - self._begun
            self._all.writelines(f"{when:9.3f} {name:{self._width}} | {line}\n" for name, line in lines)
            self._all.flush()
            self.recent.extend((name, line[:_LONGEST]) for name, line in lines)
        return lines

    def last(self, name: str, count: int) -> list[str]:
        """The last lines of a program, without control characters."""
        try:
            with open(self.file(name), "rb") as file:
                file.seek(max(0, file.seek(0, 2) - 65536))
                lines = file.read().decode("utf-8", "replace").splitlines()
        except FileNotFoundError:
            return []
        return [shown(line) for line in lines if line.strip()][-count:]

    def close(self) -> None:
        while self.gather():
            pass
        self.gather(rest=True)
        self._all.close()
        for reader, _ in self._files.values():
            reader.close()


# What a program sends to a terminal, to move its cursor or change colours.
_SEQUENCES = re.compile("\x1b\\[[0-?]*[ -/]*[@-~]|\x1b\\][^\x07\x1b]*(?:\x07|\x1b\\\\)")


def shown(line: str) -> str:
    """A line without what drives a terminal."""
    return printable(_SEQUENCES.sub("", line.rstrip("\r").rsplit("\r", 1)[-1])).expandtabs()
