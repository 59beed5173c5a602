# SPDX-License-Identifier: Apache-2.0
"""Files up and down, by CFDP. All of it but `files` is for the spacecraft's own thread."""
from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.ground.scripts.files import Files, Transfer, plain_name
from fledge.ground.scripts.links import NoAnswer

if TYPE_CHECKING:
    from fledge.ground.scripts.craft import Craft
    from fledge.ground.server.link import Connection
    from fledge.ground.server.reporter import Reporter

FILE = 4096         # [bytes] that a file counts besides its own
PERIOD = 0.2        # [s] between two texts of a transfer's progress


class Transfers:
    """folder: of the files that come down; light_time: [s] to the spacecraft, one way."""

    def __init__(self, folder: Path, light_time: float, connection: Connection, reporter: Reporter) -> None:
        self.folder, self._light_time = folder, light_time
        self._connection, self._clock, self._reporter = connection, reporter.clock, reporter
        self._open: dict[int, tuple[dict[str, Any], Transfer]] = {}
        self._listings: list[tuple[Transfer, Future[list[str]]]] = []
        self._published = self._measured = 0.0
        self._full: set[str] = set()    # the limits that are reached
        self.bytes = 0                  #: of the files here
        self._received = 0
        for row in reporter.all("transfers", is_open=True):
            self._change(row, state="failed", text="the server ended before it did")

    def put(self, name: str, data: bytes) -> dict[str, Any]:
        """Send a file to the spacecraft. Raises SetupError."""
        self._files()
        if not name:
            raise SetupError("give the file's name on board, as in files?name=plan.bin")
        bounds, size = self._reporter.bounds, len(data)
        for bound, over in (("files of a spacecraft", self.bytes + size > bounds["files of a spacecraft"]),
                            ("disk that stays free", shutil.disk_usage(self.folder).free - size
                             < bounds["disk that stays free"])):
            if over:
                raise SetupError(f"{name} cannot be kept here to be sent: {bounds.refuses(bound)}")
        self.bytes += size      # until it is measured again
        local = self.folder / f".up-{time.time_ns()}"
        try:
            local.write_bytes(data)
            return self._began(True, name, len(data), lambda: self._connection.reach().put(local, name))
        except OSError as error:
            raise SetupError(f"{name} cannot be kept here to be sent: {error.strerror}") from None
        finally:
            local.unlink(missing_ok=True)      # the transfer has its own

    def fetch(self, name: str) -> dict[str, Any]:
        """Ask for a file on board. Raises SetupError."""
        self._files()
        if not name:
            raise SetupError("give the file's name on board")
        local = self.folder / (plain_name(name.replace("/", "_").lstrip(".")) or "file")

        def fetch() -> Transfer:
            transfer = self._connection.reach().fetch(name, local)
            transfer.replaces = False
            return transfer

        return self._began(False, name, 0, fetch)

    def directory(self, path: str) -> Future[list[str]]:
        """The names in a directory on board."""
        answer: Future[list[str]] = Future()
        answer.set_running_or_notify_cancel()   # it is answered also if its client has gone
        self._listings.append((self._files().listing(path), answer))
        return answer

    def action(self, number: int, what: str) -> dict[str, Any]:
        """cancel, suspend or resume. Raises SetupError."""
        if number not in self._open:
            raise SetupError(f"there is no transfer {number} under way")
        if what not in ("cancel", "suspend", "resume"):
            raise SetupError(f"a transfer can cancel, suspend and resume; found '{what}'")
        row, transfer = self._open[number]
        getattr(transfer, what)()
        if what != "cancel":
            self._change(row, state="suspended" if what == "suspend" else "active")
        else:
            row["cancelled"] = True
        return row

    def files(self) -> list[dict[str, Any]]:
        """The files that have come down. For any thread."""
        files = [path for path in self.folder.glob("[!.]*") if path.is_file()] if self.folder.is_dir() else []
        return [{"name": file.name, "size": file.stat().st_size, "t_ns": str(file.stat().st_mtime_ns)}
                for file in sorted(files)]

    def poll(self) -> None:
        """Publish how far they are."""
        craft = self._connection.craft
        if craft and craft.has_files and time.monotonic() >= self._measured:
            self._bound(craft.files)
        for number, (row, transfer) in list(self._open.items()):
            if transfer.ended or transfer.problem:
                del self._open[number]
                state = "completed" if transfer.ended else "cancelled" if row.pop("cancelled", None) else "failed"
                here = transfer.local.name if transfer.local else row["name"]
                text = transfer.problem or f"it is {here} here" * (here != row["name"])
                self._change(row, done=transfer.done, size=transfer.size, state=state, text=text)
            elif (row["done"], row["size"]) != (transfer.done, transfer.size) and \
                    time.monotonic() - self._published > PERIOD:
                self._published = time.monotonic()
                row.update(done=transfer.done, size=transfer.size)
                self._reporter.publish("transfer", row)
        for listing, answer in list(self._listings):
            if listing.ended or listing.problem:
                self._listings.remove((listing, answer))
                try:
                    if listing.problem:
                        raise SetupError(listing.problem)
                    answer.set_result(self._files().names(listing))
                except (SetupError, NoAnswer) as error:
                    answer.set_exception(SetupError(str(error)))
        if craft and craft.has_files:
            received, failed = craft.files.received, craft.files.failed
            new, self._received = received[self._received:], len(received)
            for path in new:        # that the craft sent by itself; another program may have deleted it already
                self._began(False, path.name, path.stat().st_size if path.is_file() else 0, None)
            for name, why in failed:
                self._change(self._began(False, name[:200], 0, None), state="failed", text=why)
            failed.clear()

    def lost(self, why: str) -> None:
        """The link is another one: what was under way is not."""
        for row, _ in self._open.values():
            self._change(row, state="failed", text=why)
        for _, answer in self._listings:
            answer.set_exception(SetupError(why))
        self._open.clear()
        self._listings.clear()
        if (craft := self._connection.craft) and craft.has_files:
            craft.files = self._entity(craft)
            self._received = 0

    def _files(self) -> Files:
        craft = self._connection.reach()
        if not craft.has_files:
            self.folder.mkdir(parents=True, exist_ok=True)
            for left in [*self.folder.glob(".way*"), *self.folder.glob(".up-*")]:
                left.unlink()
            craft.files = self._entity(craft)
        return craft.files

    def _entity(self, craft: Craft) -> Files:
        there_and_back = 2 * self._light_time
        return Files(craft, folder=self.folder, timeout=10 + there_and_back, inactivity=600 + 2 * there_and_back)

    def _bound(self, files: Files) -> None:
        """Tell the entity how many bytes it may still write: what comes beyond is refused on its way."""
        began, bounds = time.monotonic(), self._reporter.bounds
        size = 0
        with os.scandir(self.folder) as entries:
            for entry in entries:
                with suppress(FileNotFoundError):       # another program has deleted it
                    size += entry.stat(follow_symlinks=False).st_blocks * 512 + FILE
        self.bytes = size
        free = shutil.disk_usage(self.folder).free - bounds["disk that stays free"]
        left = bounds["files of a spacecraft"] - self.bytes
        for name, rest in (("files of a spacecraft", left), ("disk that stays free", free)):
            if rest <= 0 and name not in self._full:
                self._reporter.event("warning", "files", f"files that come are refused: {bounds.says(name)}")
            self._full = {*self._full, name} if rest <= 0 else self._full - {name}
        files.entity.room(max(0, int(min(left, free))))
        self._measured = began + max(1.0, 50 * (time.monotonic() - began))

    def _began(self, up: bool, name: str, size: int, begin: Callable[[], Transfer] | None) -> dict[str, Any]:
        """A transfer that a user wants is in the journal before it begins; one that has come (None), afterwards. Raises
        SetupError."""
        row = {"up": up, "name": name, "done": 0 if begin else size, "size": size, "text": "",
               "state": "active" if begin else "completed", "t_ns": str(self._clock.now)}
        self._reporter.keep("transfers", row, must=begin is not None)
        if begin:
            try:
                self._open[row["id"]] = row, begin()    # type: ignore[index]
            except (SetupError, OSError) as error:
                self._change(row, state="failed", text=str(error))
                raise
        return row

    def _change(self, row: dict[str, Any], **changes: Any) -> None:
        row.update(changes)
        self._reporter.keep("transfers", row)
