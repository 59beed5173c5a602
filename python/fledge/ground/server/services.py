# SPDX-License-Identifier: Apache-2.0
"""What the flight software of a mission of Fledge does by its services: files, tables of parameters, stored commands.
Call all of it in the spacecraft's own thread, unless its docstring allows any thread."""
from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.commands import ALL, LISTS, Action, Block, Code, Field, Stored, encoded, stored, storing, values
from fledge.ground.server.commanding import Hazardous
from fledge.errors import SetupError, did_you_mean
from fledge.ground.scripts.files import Files, Transfer, plain_name
from fledge.ground.scripts.links import NoAnswer

if TYPE_CHECKING:
    from fledge.ground.server.spacecraft import Spacecraft
    from fledge.ground.scripts.craft import Craft, Sent

FILE = 4096         # [bytes] that a file counts besides its own
ASKED = 0.2         # [s] between two texts of a transfer's progress


def _ground(craft: Spacecraft) -> Craft:
    if craft.ground is None or craft.silent:
        raise SetupError(f"{craft.name}: {craft.silent}" if craft.dictionary else
                         f"{craft.name} is no mission of Fledge: its files, tables and stored commands are not known")
    return craft.ground


# --- files -----------------------------------------------------------------------------------------

class Transfers:
    """Files up and down, by CFDP."""

    def __init__(self, craft: Spacecraft) -> None:
        self.craft = craft
        self.folder = craft.room.settings.folder / "files" / craft.name
        self._open: dict[int, tuple[dict[str, Any], Transfer]] = {}
        self._listings: list[tuple[Transfer, Future[list[str]]]] = []
        self._told = self._measured = 0.0
        self._full: set[str] = set()    # the limits that are reached
        self.bytes = 0                  #: of the files here
        self._received = 0
        for row in craft.room.journal.all("transfers", craft.name, True):
            self._change(row, state="failed", text="the server ended before it did")

    def put(self, name: str, data: bytes) -> dict[str, Any]:
        """Send a file to the spacecraft. Raises SetupError."""
        self._files()
        if not name:
            raise SetupError("give the file's name on board, as in files?name=plan.bin")
        bounds, size = self.craft.room.bounds, len(data)
        for bound, over in (("files of a spacecraft", self.bytes + size > bounds["files of a spacecraft"]),
                            ("disk that stays free", shutil.disk_usage(self.folder).free - size
                             < bounds["disk that stays free"])):
            if over:
                raise SetupError(f"{name} cannot be kept here to be sent: {bounds.refuses(bound)}")
        self.bytes += size      # until it is measured again
        local = self.folder / f".up-{time.time_ns()}"
        try:
            local.write_bytes(data)
            return self._began(True, name, len(data), lambda: _ground(self.craft).put(local, name))
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
            one = _ground(self.craft).fetch(name, local)
            one.replaces = False
            return one

        return self._began(False, name, 0, fetch)

    def directory(self, path: str) -> Future[list[str]]:
        """The names in a directory on board."""
        made: Future[list[str]] = Future()
        made.set_running_or_notify_cancel()     # who asks may go: it is answered all the same
        self._listings.append((self._files().listing(path), made))
        return made

    def action(self, number: int, what: str) -> dict[str, Any]:
        """cancel, suspend or resume. Raises SetupError."""
        if number not in self._open:
            raise SetupError(f"there is no transfer {number} under way")
        if what not in ("cancel", "suspend", "resume"):
            raise SetupError(f"a transfer can cancel, suspend and resume; found '{what}'")
        row, one = self._open[number]
        getattr(one, what)()
        if what != "cancel":
            self._change(row, state="suspended" if what == "suspend" else "active")
        else:
            row["cancelled"] = True
        return row

    def files(self) -> list[dict[str, Any]]:
        """The files that have come down. For any thread."""
        found = [one for one in self.folder.glob("[!.]*") if one.is_file()] if self.folder.is_dir() else []
        return [{"name": one.name, "size": one.stat().st_size, "t_ns": str(one.stat().st_mtime_ns)}
                for one in sorted(found)]

    def look(self) -> None:
        """Note how far they are."""
        if self.craft.ground and self.craft.ground.has_files and time.monotonic() >= self._measured:
            self._bound(self.craft.ground.files)
        for number, (row, one) in list(self._open.items()):
            if one.ended or one.problem:
                del self._open[number]
                state = "completed" if one.ended else "cancelled" if row.pop("cancelled", None) else "failed"
                here = one.local.name if one.local else row["name"]
                text = one.problem or f"it is {here} here" * (here != row["name"])
                self._change(row, done=one.done, size=one.size, state=state, text=text)
            elif (row["done"], row["size"]) != (one.done, one.size) and time.monotonic() - self._told > ASKED:
                self._told = time.monotonic()
                row.update(done=one.done, size=one.size)
                self.craft.room.publish("transfer", self.craft.name, row)
        for listing, answer in list(self._listings):
            if listing.ended or listing.problem:
                self._listings.remove((listing, answer))
                try:
                    if listing.problem:
                        raise SetupError(listing.problem)
                    answer.set_result(self._files().names(listing))
                except (SetupError, NoAnswer) as error:
                    answer.set_exception(SetupError(str(error)))
        if self.craft.ground and self.craft.ground.has_files:
            received, failed = self.craft.ground.files.received, self.craft.ground.files.failed
            new, self._received = received[self._received:], len(received)
            for path in new:        # that the craft sent unasked; somebody may have taken it away already
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
        if self.craft.ground and self.craft.ground.has_files:
            self.craft.ground.files = self._entity(self.craft.ground)
            self._received = 0

    def _files(self) -> Files:
        ground = _ground(self.craft)
        if not ground.has_files:
            self.folder.mkdir(parents=True, exist_ok=True)
            for left in [*self.folder.glob(".way*"), *self.folder.glob(".up-*")]:
                left.unlink()
            ground.files = self._entity(ground)
        return ground.files

    def _entity(self, ground: Craft) -> Files:
        there_and_back = 2 * self.craft.settings.light_time
        return Files(ground, folder=self.folder, timeout=10 + there_and_back, inactivity=600 + 2 * there_and_back)

    def _bound(self, files: Files) -> None:
        """Tell the entity how many bytes it may still write: what comes beyond is refused on its way."""
        began, bounds = time.monotonic(), self.craft.room.bounds
        size = 0
        with os.scandir(self.folder) as found:
            for one in found:
                with suppress(FileNotFoundError):       # somebody has taken it away
                    size += one.stat(follow_symlinks=False).st_blocks * 512 + FILE
        self.bytes = size
        free = shutil.disk_usage(self.folder).free - bounds["disk that stays free"]
        left = bounds["files of a spacecraft"] - self.bytes
        for name, rest in (("files of a spacecraft", left), ("disk that stays free", free)):
            if rest <= 0 and name not in self._full:
                self.craft.room.tell(self.craft.name, "warning", "files", f"files that come are refused: "
                                     f"{bounds.says(name)}")
            self._full = {*self._full, name} if rest <= 0 else self._full - {name}
        files.entity.room(max(0, int(min(left, free))))
        self._measured = began + max(1.0, 50 * (time.monotonic() - began))

    def _began(self, up: bool, name: str, size: int, begin: Callable[[], Transfer] | None) -> dict[str, Any]:
        """A transfer that a user wants is in the journal before it begins; one that has come (None) is told. Raises
        SetupError."""
        row = {"up": up, "name": name, "done": 0 if begin else size, "size": size, "text": "",
               "state": "active" if begin else "completed", "t_ns": str(self.craft.now)}
        self.craft.room.keep("transfers", self.craft.name, row, must=begin is not None)
        if begin:
            try:
                self._open[row["id"]] = row, begin()    # type: ignore[index]
            except (SetupError, OSError) as error:
                self._change(row, state="failed", text=str(error))
                raise
        return row

    def _change(self, row: dict[str, Any], **changes: Any) -> None:
        row.update(changes)
        self.craft.room.keep("transfers", self.craft.name, row)


# --- tables ----------------------------------------------------------------------------------------

class Tables:
    """The parameters of modules, as they were last read."""

    def __init__(self, craft: Spacecraft) -> None:
        self.craft = craft
        self._read: dict[str, tuple[bytes, str]] = {}       # the block, big-endian, and when

    def rows(self) -> list[dict[str, Any]]:
        """For all."""
        return [self._told(one) for one in self._blocks()]

    def _told(self, one: Block) -> dict[str, Any]:
        block, when = self._read.get(one.path, (None, None))
        return {"name": one.path, "meaning": one.type, "fields": [_field(f) for f in one.fields if not _spare(f)],
                "values": values(one.fields, block) if block is not None else None, "read_ns": when}

    def read(self, user: str, name: str) -> dict[str, Any]:
        """Ask for the values on board: the row of the command. Raises SetupError."""
        ground, block = _ground(self.craft), self._block(name)

        def done(sent: Sent) -> None:
            if len(sent.data) == block.size:
                self._keep(block, sent.data)

        return self.craft.commanding.release(user, "read", {"module": name}, ground.made("read", name), done)

    def write(self, user: str, name: str, given: dict[str, Any], confirmed: bool) -> dict[str, Any]:
        """Change values on board, by stage and commit. Raises Hazardous, if the write of one is; SetupError."""
        ground, block = _ground(self.craft), self._block(name)
        if name not in self._read:
            raise SetupError(f"read {name} first: what is not changed stays as it is on board")
        whole = bytearray(self._read[name][0])
        fields = {one.name: one for one in block.fields}
        for key, value in given.items():
            if key not in fields:
                raise SetupError(f"{name} has no parameter '{key}'{did_you_mean(key, list(fields))}")
            try:
                whole[fields[key].offset:fields[key].offset + fields[key].size] = encoded(fields[key], value)
            except (TypeError, AttributeError) as error:
                raise SetupError(f"{name}.{key}: {error}") from None
        process, _, module = name.partition(".")
        why = self.craft.commanding.hazard_of(*(f"{process}.write.{module}.{key}" for key in given))
        if why and not confirmed:
            raise Hazardous(why)
        return self.craft.commanding.release(user, "load", {"module": name, **given},
                                             ground.made("load", name, bytes(whole)),
                                             lambda _: self._keep(block, bytes(whole)))

    def _keep(self, block: Block, data: bytes) -> None:
        self._read[block.path] = data, str(self.craft.now)
        self.craft.room.publish("table", self.craft.name, self._told(block))

    def _blocks(self) -> list[Block]:
        return self.craft.dictionary.blocks if self.craft.dictionary else []

    def _block(self, name: str) -> Block:
        found = {one.path: one for one in self._blocks()}
        if name not in found:
            raise SetupError(f"{self.craft.name} has no table '{name}'{did_you_mean(name, list(found))}")
        return found[name]


def _spare(one: Field) -> bool:
    return one.name.startswith("spare")


def _field(one: Field) -> dict[str, Any]:
    return {"name": one.name, "type": one.type, "unit": "" if one.unit == "-" else one.unit, "shape": one.shape,
            "meaning": one.meaning, "enumerators": one.enumerators, "rule": one.rule,
            "fields": [_field(f) for f in one.fields]}


# --- stored commands -------------------------------------------------------------------------------

class StoredLists:
    """The commands that wait on board, as they were last reported."""

    def __init__(self, craft: Spacecraft) -> None:
        self.craft = craft
        blocks = craft.dictionary.blocks if craft.dictionary else []
        self.path = next((one.path for one in blocks if one.type == "StoredCommands"), "")
        self._lists: dict[int, tuple[list[dict[str, Any]], str | None]] = {}    # and when they were read
        self._names: dict[int, str] = {}        # of commands that were stored from here, by their CRC
        self._begun: dict[int, int] = {}        # [ns] of flight, when a sequence was started from here, and held
        self._held: dict[int, int] = {}
        self._rows: dict[int, dict[str, Any]] = {}      # of the journal
        if craft.clock == "utc":        # what a simulation had ends with it
            for row in craft.room.journal.all("stored", craft.name):
                number = row["list"]
                self._rows[number], self._lists[number] = row, (row["commands"], row["read_ns"])
                self._names |= {one["crc"]: one["name"] for one in row["commands"]}
                self._begun |= {} if row["begun"] is None else {number: row["begun"]}
                self._held |= {} if row["held"] is None else {number: row["held"]}

    def told(self) -> dict[str, Any]:
        """For all."""
        if not self.path:
            return {"lists": [], "text": f"the flight software of {self.craft.name} has no StoredCommands"}
        running, held, inhibited = (self._said(name) or 0 for name in ("running", "held", "inhibited"))
        ahead = self._ahead()
        now = self.craft.now - ahead        # of flight
        made = []
        for number in range(LISTS):
            bit = 1 << number
            if not running & bit and (self._said("head.t") or 0) > self._begun.get(number, now):
                self._begun.pop(number, None)       # it has ended: the next start may be that of others
            begun = self._begun.get(number) if running & bit and not held & bit else None
            rows, when = self._lists.get(number, ([], None))
            if number == 0 and not held & bit:      # they leave the store when they are due
                rows = [one for one in rows if int(one["time_ns"]) > now]
            due = None if held & bit or inhibited & bit else 0 if number == 0 else begun
            made.append({
                "list": number, "read_ns": when, "t_ns": None if begun is None else str(now - begun),
                "state": "inhibited" if inhibited & bit else "held" if held & bit else "running" if running & bit
                else "idle",
                "commands": [one | {"due_ns": None if due is None else str(due + ahead + int(one["time_ns"]))}
                             for one in rows]})
        due = self._said("next")
        return {"lists": made, "text": "", "flight_ns": str(now),
                "next_ns": None if due is None or due < 0 else str(due + ahead),
                **{name: self._said(name) for name in ("stored", "released", "skipped")}}

    def act(self, user: str, wish: dict[str, Any]) -> dict[str, Any]:
        """What a browser asks of a list: the row of the command. Raises SetupError."""
        ground, number = _ground(self.craft), wish.get("list", 0)
        if not self.path:
            raise SetupError(self.told()["text"])
        if not isinstance(number, int) or not 0 <= number < LISTS:
            raise SetupError(f"a list is a number from 0 to {LISTS - 1}; found {number!r}")
        action, step = wish.get("action"), wish.get("step", ALL)
        if not isinstance(step, int):
            raise SetupError(f"a step is a whole number; found {step!r}")
        commanding = self.craft.commanding
        if action is None:
            packet = commanding.made(str(wish.get("name", "")), wish.get("arguments", {}),
                                     wish.get("confirmed", False))
            try:
                made = ground.made("store", number, step, int(wish.get("time_ns", 0)), packet)
            except ValueError:
                raise SetupError(f"time_ns is a whole number; found '{wish['time_ns']}'") from None
            if ground.dictionary:
                self._names[int.from_bytes(made[0][10:12], "big")] = ground.dictionary.command(packet)
        elif action == "report":
            made = ground.made("stored", number)
        elif action == "delete":
            made = ground.made("delete", number, step)
        elif isinstance(action, str) and action.upper() in Action.__members__:
            made = ground.made("control", Action[action.upper()], number)
        else:
            raise SetupError(f"a list can report, delete, {', '.join(one.name.lower() for one in Action)}; found "
                             f"'{action}'")

        def then(sent: Sent) -> None:
            if action == "report":
                self._keep(number, stored(sent.data), str(self.craft.now))
            elif action is None:
                self._keep(number, [*(one for one in self._known(number) if one.step != step), *storing(sent.packets)])
            elif action == "delete":
                self._keep(number, [one for one in self._known(number) if step not in (ALL, one.step)])
            elif action == "start":
                self._begun[number] = sent.reports[-1].t
            elif action == "hold":
                self._held[number] = sent.reports[-1].t
            elif action == "release" and number in self._begun and number in self._held:
                self._begun[number] += sent.reports[-1].t - self._held.pop(number)      # its time stood
            self._save(number)

        given = {key: value for key, value in wish.items() if key != "action"}
        return commanding.release(user, action or "store", given, made, then)

    def _known(self, number: int) -> list[Stored]:
        return [Stored(int(one["time_ns"]), *(one[name] for name in ("step", "size", "crc", "code")))
                for one in self._lists.get(number, ([], None))[0]]

    def _keep(self, number: int, commands: list[Stored], read: str | None = None) -> None:
        """What a list has. read: when the spacecraft said so; else it follows from commands that it has executed."""
        rows = [{"step": one.step, "time_ns": str(one.time), "size": one.size, "crc": one.crc, "code": one.code,
                 "name": self._names.get(one.crc) or (Code(one.code).name.lower() if one.code in
                                                      Code._value2member_map_ else f"code {one.code}")}
                for one in sorted(commands)]
        self._lists[number] = rows, read or self._lists.get(number, ([], None))[1]

    def _save(self, number: int) -> None:
        """Into the journal, for the next server."""
        commands, read = self._lists.get(number, ([], None))
        row = self._rows.setdefault(number, {"list": number})
        row.update(t_ns=str(self.craft.now), commands=commands, read_ns=read, begun=self._begun.get(number),
                   held=self._held.get(number))
        self.craft.room.keep("stored", self.craft.name, row, told=lambda one: {"list": one["list"]})

    def _newest(self, name: str) -> Any:
        slot = self.craft.slot_numbers.get(f"{self.path}.state.{name}")
        return self.craft.monitor.newest(slot) if slot is not None else None

    def _said(self, name: str) -> int | None:
        """What telemetry says of all lists."""
        newest = self._newest(name)
        return int(newest[3]) if newest else None

    def _ahead(self) -> int:
        """[ns] of the spacecraft's clock here over flight's time."""
        newest = self._newest("head.t")
        return 0 if self.craft.clock == "simulated" or not newest else int(newest[0] - newest[3])
