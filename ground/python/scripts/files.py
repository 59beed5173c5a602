# SPDX-License-Identifier: Apache-2.0
"""Files to a spacecraft and from it, by CFDP (ccsds/cfdp.h): PDUs up as commands, down in the telemetry of files.

    craft.put("plan.bin", to="plans/next").completed(within=10 * minute)
    craft.fetch("science", to="science.bin", within=1 * hour)
    craft.directory("plans")

Time is that of the link, and passes while the script waits for anything.
"""
from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from enum import IntEnum
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from fledge import _ground
from fledge.commands import Packets
from fledge.errors import SetupError, printable
from fledge.ground.scripts.links import NoAnswer
from fledge.objects.si import time_ns

if TYPE_CHECKING:
    from typing import Self

    from fledge.ground.scripts.craft import Craft

GROUND, CRAFT = 1, 2        # entities
RATE = 4000.0               # [bytes/s] of packets to the spacecraft
TICK = 50_000_000           # [ns] between checks of the timers and of the link's room
BURST = 1.0                 # [s] of the rate that may go at once after a pause
LISTING = 1_000_000         # characters of the names in a directory on board


class Message(IntEnum):
    """CfdpMessageType of ccsds/cfdp_pdu.h."""
    PROXY_PUT = 0x00
    PROXY_MODE = 0x04
    PROXY_PUT_RESPONSE = 0x07
    PROXY_CANCEL = 0x09
    ORIGIN = 0x0A
    LIST = 0x10
    LISTED = 0x11
    REMOTE_SUSPEND = 0x30
    REMOTE_RESUME = 0x38


STARTED, ENDED, ABANDONED, MESSAGE = 0, 1, 5, 6     # CfdpEventKind

CONDITIONS = {
    1: "it was sent again and again, and not acknowledged", 2: "the other end is too far behind",
    3: "the other end does not know this class of transmission", 4: "the file store refused it",
    5: "its checksum is wrong", 6: "its size is wrong", 7: "what is missing was asked for again and again, in vain",
    8: "the other end has gone silent", 9: "a part of the protocol is not as it must be",
    10: "parts of it did not arrive", 11: "the other end does not know its checksum", 14: "it was suspended",
    15: "it was cancelled"}
REFUSALS = {-1: "there is no such file", -2: "a name has at most 127 bytes, and does not lead out of its folder",
            -3: "too many files are on their way; wait for one", -4: "the file cannot be read"}


class Transfer:
    """A file on its way, or a request for one."""

    def __init__(self, files: Files, title: str, place: str, local: Path | None, fetches: bool,
                 progress: Callable[[Transfer], Any] | None) -> None:
        self.title = title          #: in words
        self.done = 0               #: [bytes] that were sent once, or received
        self.size = 0               #: [bytes]; 0: not known
        self.ended = False
        self.problem = ""           #: why it failed
        self.local, self.fetches, self.place = local, fetches, place
        self.id = self.data = (0, 0)    # of the request, and of the file
        self.replaces = True        #: a local file of its name; else it gets another name, in `local`
        self._files, self._progress = files, progress

    def completed(self, within: Any) -> Self:
        """Wait until the file is there, whole; of class 1 that is sent: until it is sent. within: a duration on the
        link's clock. Raises NoAnswer with the reason."""
        def over(_: Any) -> bool:
            if self.problem:
                raise NoAnswer(f"{self.title}: {self.problem}")
            return self.ended

        self._files.craft.wait(over, within, lambda: f"{self.title}: {self.done} of {self.size or '?'} bytes went, "
                               "and it did not end")
        return self

    def suspend(self) -> None:
        """Suspend it at both ends, if the other end accepts the request."""
        self._files.entity.suspend(self.data)
        self._files.ask(Message.REMOTE_SUSPEND, self.data)

    def resume(self) -> None:
        """Go on, at both ends."""
        self._files.ask(Message.REMOTE_RESUME, self.data)
        self._files.entity.resume(self.data)

    def cancel(self) -> None:
        """End it without a file; completed() then raises NoAnswer."""
        entity = self._files.entity
        entity.cancel(self.data)
        if self.fetches:
            self._files.request(entity.message(Message.PROXY_CANCEL) + entity.message(Message.ORIGIN, self.id))

    def moved(self, done: int, size: int) -> None:
        """Set the progress [bytes], and report a change of it."""
        if (done, size) != (self.done, self.size):
            self.done, self.size = done, size
            if self._progress:
                self._progress(self)

    def __repr__(self) -> str:
        return f"<{self.title}: {self.problem or ('complete' if self.ended else f'{self.done} of {self.size} bytes')}>"


class Files:
    """The ground's entity of CFDP: it works while its craft waits.

    folder: where files arrive that flight sends unasked; None: a temporary one
    rate: [bytes/s] of the packets that go up
    timeout: a duration, longer than light takes there and back, after which something is sent or requested again,
    limit: so many times
    inactivity: a duration without a word of the other end that ends a file
    own, peer: numbers of the entities
    sequence: of the first transaction, larger than those before; None: by the clock of the link
    """

    def __init__(self, craft: Craft, folder: str | os.PathLike[str] | None = None, rate: float = RATE,
                 timeout: Any = 10.0, limit: int = 10, inactivity: Any = 600.0, own: int = GROUND, peer: int = CRAFT,
                 sequence: int | None = None, crc: bool = False) -> None:
        if not rate > 0 or not 0 < limit < 256:
            raise SetupError(f"files: the rate is more than 0 bytes/s and the limit 1 to 255; found {rate}, {limit}")
        self.craft, self.rate, self.peer, self.own = craft, rate, peer, own
        self.received: list[Path] = []              #: files that flight has sent unasked
        self.failed: list[tuple[str, str]] = []     #: those of them that did not arrive: the name, and why
        self._temporary = TemporaryDirectory(prefix="fledge-files-") if folder is None else None
        self.folder = Path(self._temporary.name if self._temporary else os.fspath(folder or ""))
        if not self.folder.is_dir():
            raise SetupError(f"files: there is no folder {self.folder}")
        self.entity: Any = _ground.Entity(
            folder=str(self.folder), own=own, peer=peer, timeout=time_ns(timeout, "timeout"), limit=limit, crc=crc,
            inactivity=time_ns(inactivity, "inactivity"), keeps=True,
            sequence=craft.link.origin if sequence is None else sequence)
        self._packets = Packets(craft.dictionary)   # counted apart: no command is missed for a PDU that is lost
        self._transfers: list[Transfer] = []
        self._messages: dict[tuple[int, int], list[bytes]] = {}
        self._places = 0
        self._credit, self._at = 0.0, craft.link.t

    def put(self, local: str | os.PathLike[str], to: str | None, class1: bool,
            progress: Callable[[Transfer], Any] | None) -> Transfer:
        """Begin to send a file, as Craft.put() does. Raises SetupError if it cannot begin."""
        path, to = Path(local), to or Path(local).name
        if not path.is_file():
            raise SetupError(f"{path}: there is no such file")
        transfer = Transfer(self, f"send {path.name} as {to}", self._place(path.name), None, False, progress)
        try:
            os.link(path.resolve(), self.folder / transfer.place)
        except OSError:
            shutil.copyfile(path, self.folder / transfer.place)
        transfer.size = path.stat().st_size
        return self._begin(transfer, transfer.place, to, b"", class1)

    def fetch(self, name: str, to: str | os.PathLike[str] | None, class1: bool,
              progress: Callable[[Transfer], Any] | None) -> Transfer:
        """Ask for a file on board, as Craft.fetch() does. Raises SetupError if it cannot begin."""
        local = Path(to if to is not None else Path(name).name)
        if not local.absolute().parent.is_dir():
            raise SetupError(f"{local}: there is no folder {local.absolute().parent}")
        transfer = Transfer(self, f"fetch {name}", self._place(local.name), local, True, progress)
        options = self._request(transfer, Message.PROXY_PUT, (self.own, 0), name)
        return self._begin(transfer, "", "", options + self.entity.message(Message.PROXY_MODE, value=int(class1)))

    def listing(self, name: str) -> Transfer:
        """Ask for the names in a directory on board; names() has them when it has ended."""
        transfer = Transfer(self, f"list {name or 'the files'}", self._place("list"), None, True, None)
        return self._begin(transfer, "", "", self._request(transfer, Message.LIST, (0, 0), name))

    def names(self, transfer: Transfer) -> list[str]:
        """The names that a listing has brought, sorted. Raises NoAnswer."""
        try:
            with open(self.folder / transfer.place, encoding="utf-8", errors="surrogateescape") as file:
                text = file.read(LISTING + 1)
        except OSError as error:
            raise NoAnswer(f"{transfer.title}: {error.strerror}") from None
        finally:
            self._forget(transfer)
        if len(text) > LISTING:
            raise NoAnswer(f"{transfer.title}: what came has more than {LISTING} characters")
        return sorted(name for name in text.split("\n") if name)

    def directory(self, name: str, within: Any) -> list[str]:
        """As of Craft."""
        return self.names(self.listing(name).completed(within))

    def request(self, options: bytes) -> tuple[int, int]:
        """Send messages alone; their transaction."""
        transaction = self.entity.put("", "", options, False)
        if isinstance(transaction, int):
            raise SetupError(f"files: {REFUSALS[transaction]}")
        return transaction

    def _request(self, transfer: Transfer, message: Message, about: tuple[int, int], name: str) -> bytes:
        """A message that asks for a file of a name; the file is expected."""
        try:
            options: bytes = self.entity.message(message, about, name, transfer.place)
        except ValueError as wrong:
            raise SetupError(f"{transfer.title}: {wrong}") from None
        self.entity.expect(transfer.place)
        return options

    def ask(self, message: Message, about: tuple[int, int]) -> None:
        """Send a message about a transaction, (0, 0) for none yet."""
        if about != (0, 0):
            self.request(self.entity.message(message, about))

    def close(self) -> None:
        """Delete the temporary folder."""
        if self._temporary:
            self._temporary.cleanup()

    # --- for the craft ---

    def work(self) -> int:
        """Send what the rate allows; when to look again [ns]."""
        now = self.craft.link.t
        self.entity.time(now)
        self._credit = min(self._credit + self.rate * (now - self._at) / 1e9, self.rate * BURST)
        self._at = now
        while self._credit >= 0 and (pdu := self.entity.next()):
            packet = self._packets.pdu(pdu)
            self._credit -= len(packet)
            self.craft.link.send(packet)
        self._poll()
        return now + TICK if self.entity.busy else 1 << 62

    def take(self, pdu: bytes) -> None:
        """Take a PDU that has come."""
        self.entity.time(self.craft.link.t)
        self.entity.take(pdu)
        self._poll()

    def absent(self) -> None:
        """Flight has no service for files."""
        for transfer in list(self._transfers):
            self._end(transfer, "this flight software has no service for files")

    # --- events of the entity ---

    def _poll(self) -> None:
        while event := self.entity.event():
            if event.kind == STARTED:
                for transfer in self._transfers:
                    if transfer.fetches and transfer.place == event.to:
                        transfer.data = event.id
            elif event.kind == MESSAGE:
                self._messages.setdefault(event.id, []).append(event.text)
            elif event.kind in (ENDED, ABANDONED):
                self._ended(event)
        for transfer in self._transfers:
            if progress := self.entity.progress(transfer.data):
                transfer.moved(progress.done, progress.size)

    def _ended(self, event: Any) -> None:
        problem = CONDITIONS.get(event.condition, f"condition {event.condition}") if event.condition else \
            "it is not whole" if event.incomplete else ""
        transfer = next((transfer for transfer in self._transfers if event.id in (transfer.id, transfer.data)), None)
        if transfer and (problem or event.receiver == transfer.fetches):
            self._end(transfer, problem)
        elif event.receiver and event.to and not problem and not transfer:
            try:
                self.received.append(self._renamed(event.to))
            except OSError as error:
                self.failed.append((event.to, f"{error.strerror}; it is in {self.folder}"))
        elif event.receiver and event.to and not transfer:
            self.failed.append((event.to, problem))
        if event.receiver:
            self._answered([message for text in self._messages.pop(event.id, [])
                            if (message := self.entity.read_message(text))])

    def _answered(self, messages: list[tuple[int, tuple[int, int], int]]) -> None:
        """Take the messages of a transaction; one may be the answer to a request of this ground."""
        about = next((about for kind, about, _ in messages if kind == Message.ORIGIN), None)
        transfer = next((transfer for transfer in self._transfers if transfer.id == about), None)
        if transfer is None:
            return
        for kind, _, value in messages:
            if kind == Message.PROXY_PUT_RESPONSE and value >> 4:
                self._end(transfer, f"{CONDITIONS.get(value >> 4, f'condition {value >> 4}')} on board")
            elif kind == Message.PROXY_PUT_RESPONSE and transfer.data == (0, 0):
                self._end(transfer, "it was sent, and did not arrive")
            elif kind == Message.LISTED and value:
                self._end(transfer, "there is no such directory on board")

    def _begin(self, transfer: Transfer, source: str, to: str, options: bytes, class1: bool = False) -> Transfer:
        transaction = self.entity.put(source, to, options, class1)
        if isinstance(transaction, int):
            self._forget(transfer)
            raise SetupError(f"{transfer.title}: {REFUSALS[transaction]}")
        transfer.id = transaction
        if not transfer.fetches:
            transfer.data = transaction
        self._transfers.append(transfer)
        return transfer

    def _end(self, transfer: Transfer, problem: str) -> None:
        self._transfers.remove(transfer)
        arrived = self.folder / transfer.place
        if not problem and transfer.local:
            try:
                if transfer.replaces:
                    _move(arrived, transfer.local)
                else:
                    transfer.local = _named(arrived, transfer.local)
            except OSError as error:
                problem = f"{transfer.local}: {error.strerror}; it is at {arrived}"
        transfer.ended, transfer.problem = not problem, problem
        if not problem:
            transfer.moved(transfer.size, transfer.size)
        if not transfer.fetches:
            self._forget(transfer)

    def _renamed(self, name: str) -> Path:
        """The place of a file that has come under a name of the other end's, which becomes a plain one."""
        arrived = self.folder / name
        plain = plain_name(arrived.name)
        if plain == arrived.name:
            return arrived
        return _named(arrived, arrived.with_name(plain.encode()[:200].decode(errors="ignore")))

    def _forget(self, transfer: Transfer) -> None:
        (self.folder / transfer.place).unlink(missing_ok=True)

    def _place(self, name: str) -> str:
        """A name in the folder for a file on its way; hidden, for a file that has arrived may have any other."""
        self._places += 1
        return f".way{self._places}-{name.encode()[-80:].decode(errors='ignore')}"


def plain_name(name: str) -> str:
    """A file's name without what a person does not see, and which a shell takes for no option."""
    plain = printable(name, lines=False)
    return "_" + plain[1:] if plain.startswith("-") else plain


def _named(source: Path, to: Path) -> Path:
    """Give a file its name, or, if another one has that, one with a number; the entity does so, too."""
    for place in (to if n == 1 else to.with_name(f"{to.stem}.{n}{to.suffix}") for n in count(1)):
        with suppress(FileExistsError):
            os.link(source, place)
            source.unlink()
            break
    return place


def _move(source: Path, to: Path) -> None:
    """To another place, whole or not at all, also on another file system."""
    part = to.with_name(f".{to.name}.part")
    try:
        shutil.move(source, part)
        os.replace(part, to)
    finally:
        part.unlink(missing_ok=True)
