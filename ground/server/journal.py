# SPDX-License-Identifier: Apache-2.0
"""What must not be lost besides packets: commands and their stages, events, alarms, limits, transfers, and what
operators did. Each call is on the disk when it returns (SQLite, WAL, synchronous=FULL)."""
from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar, cast

from fledge.errors import SetupError, printable

Answer = TypeVar("Answer")
Row = dict[str, Any]        # an object of JSON

LISTS = ("sent", "events", "alarms", "limits", "transfers", "stored", "log")
MOST = 500          # rows of an answer
# What has not ended, by words in its row's JSON: a server that starts rebuilds it. A text cannot have them, for JSON
# escapes its quotes.
OPEN = {"alarms": ('"ended_ns": ""',), "transfers": ('"state": "active"', '"state": "suspended"'),
        "sent": ('"open": {',)}
BY = "iif(json_valid(content), json_extract(content, '$.user'), NULL)"      # the user that acted
SCHEMA = "".join(f"""
CREATE TABLE IF NOT EXISTS {name} (id INTEGER PRIMARY KEY AUTOINCREMENT, craft TEXT NOT NULL, t INTEGER NOT NULL,
    content TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS {name}_of ON {name} (craft, id);""" for name in LISTS) + f"""
CREATE INDEX IF NOT EXISTS log_by ON log ({BY}, id);"""


def _is_open(kind: str) -> str:
    return "(" + " OR ".join(f"instr(content, '{words}') > 0" for words in OPEN[kind]) + ")"


SCHEMA += "".join(f"""
CREATE INDEX IF NOT EXISTS {kind}_open ON {kind} (craft, id) WHERE {_is_open(kind)};""" for kind in OPEN)


class JournalError(SetupError):
    """The journal cannot be written: commanding must not go on."""


class Journal:
    """Rows of JSON objects by kind and spacecraft; an object's `id` is its row's."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / "journal.sqlite"
        self.problem = ""       #: why the last writing failed; "": it did not
        self._lock = Lock()
        try:
            self._db = sqlite3.connect(self.path, check_same_thread=False, isolation_level=None)
            for line in ("PRAGMA journal_mode=WAL", "PRAGMA synchronous=FULL"):
                self._db.execute(line)
            self._db.executescript(SCHEMA)
        except (sqlite3.Error, UnicodeError) as error:      # a damaged schema may be no text
            raise SetupError(f"{self.path}: {error}") from None

    def save(self, kind: str, craft: str, *contents: Mapping[str, Any]) -> None:
        """Write objects as they are now, all or none; a new one gets an `id`. Raises JournalError."""
        self.save_all([(kind, craft, content) for content in contents])

    def save_all(self, rows: Sequence[tuple[str, str, Mapping[str, Any]]]) -> None:
        """The same of (kind, craft, object) each."""
        for (_, _, content), number in zip(rows, self._write(lambda: [self._put(*row) for row in rows])):
            cast(Row, content)["id"] = number

    def _put(self, kind: str, craft: str, content: Mapping[str, Any]) -> int | None:
        text = json.dumps({key: value for key, value in content.items() if key != "id"})
        if "id" in content:
            self._db.execute(f"UPDATE {kind} SET content = ? WHERE id = ?", (text, content["id"]))
            return int(content["id"])
        t = int(content.get("t_ns") or content.get("time_ns") or 0)
        return self._db.execute(f"INSERT INTO {kind} (craft, t, content) VALUES (?, ?, ?)", (craft, t, text)).lastrowid

    def rows(self, kind: str, craft: str | None = None, before: int | None = None, limit: int = MOST,
             before_ns: int | None = None, seen: tuple[list[str], str] | None = None,
             user: str | None = None) -> list[Row]:
        """The newest objects first, of a spacecraft or of all. before: those whose id is lower; before_ns: those of
        this time of the spacecraft's clock (the log: UTC) at most; user: of this one; seen: of
        some spacecraft, or of a user."""
        if seen is not None:
            parts = [self.rows(kind, name, before, limit, before_ns) for name in seen[0]]
            newest = {row["id"]: row for part in [*parts, self.rows(kind, None, before, limit, before_ns, user=seen[1])]
                      for row in part}
            return [newest[number] for number in sorted(newest, reverse=True)[:min(limit, MOST)]]
        where = ["id < ?"] * (before is not None) + ["craft = ?"] * (craft is not None) + ["t <= ?"] * (
            before_ns is not None) + [f"{BY} = ?"] * (user is not None)
        given = [value for value in (before, craft, before_ns, user) if value is not None]
        text = f"SELECT id, content FROM {kind}{' WHERE ' * bool(where)}{' AND '.join(where)} ORDER BY id DESC LIMIT ?"
        return self._read(text, (*given, min(limit, MOST)))

    def all(self, kind: str, craft: str, is_open: bool = False) -> list[Row]:
        """All objects of a spacecraft, the oldest first. is_open: those that have not ended."""
        where = f" AND {_is_open(kind)}" if is_open else ""
        return self._read(f"SELECT id, content FROM {kind} WHERE craft = ?{where} ORDER BY id", (craft,))

    def _read(self, query: str, given: Sequence[Any]) -> list[Row]:
        """The objects of (id, content). Raises SetupError if the journal is damaged."""
        number = 0
        try:
            with self._lock:
                rows = self._db.execute(query, given).fetchall()
            objects = []
            for number, content in rows:
                objects.append(dict(json.loads(content)) | {"id": number})
            return objects
        except (sqlite3.Error, ValueError, TypeError) as error:
            where = f" at row {number}" if number else ""
            raise SetupError(f"{self.path} is damaged{where}: {printable(str(error), lines=False)[:200]}") from None

    def close(self) -> None:
        with self._lock:
            self._db.close()

    def _write(self, action: Callable[[], Answer]) -> Answer:
        with self._lock:
            try:
                self._db.execute("BEGIN IMMEDIATE")
                try:
                    result = action()
                    self._db.execute("COMMIT")
                except BaseException:
                    if self._db.in_transaction:
                        self._db.execute("ROLLBACK")
                    raise
            except sqlite3.Error as error:
                self.problem = f"{self.path} cannot be written: {error}"
                raise JournalError(self.problem) from None
            self.problem = ""
            return result
