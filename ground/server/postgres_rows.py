# SPDX-License-Identifier: Apache-2.0
"""The values of a spacecraft's archive as rows of PostgreSQL, in the binary format of its COPY."""
from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import blake2b
from typing import TYPE_CHECKING, Any

import numpy as np
import psycopg
from numpy.typing import NDArray

from fledge.errors import SetupError
from fledge.ground.database import TIMES
from fledge.ground.server.limits import InForce

if TYPE_CHECKING:
    from fledge.ground.server.room import Room
    from fledge.ground.server.spacecraft import Spacecraft

Connection = psycopg.Connection[Any]

YEAR_2000 = 946_684_800 * 10**6         # [us] since 1970, from which PostgreSQL counts
MOST = 200_000                          # values of a transaction
LOCK = 0x464C4447                       # number of the advisory lock for changes of tables
# Distinguishes parameters: an index takes no name or labels of more than 2.7 kB.
DIGEST = r"md5(array[name, unit, kind, labels::text]::text)"

VALUES = np.dtype([("slot", "<u4"), ("concern", "u1"), ("status", "u1"), ("zero", "<u2"), ("t", "<i8"),
                   ("word", "<u8")])
HEAD = 32                               # [bytes] in front of a frame's values
COLUMNS = (("server", ">i2"), ("parameter", ">i4"), ("session", ">i4"), ("t", ">i8"), ("ns", ">i2"),
           ("received", ">i8"), ("packet", ">i8"), ("concern", ">i2"))
COPY = f"copy fledge.value ({', '.join(name for name, _ in COLUMNS)}, value, text) from stdin (format binary)"
ROW = np.dtype([("n", ">i2"), *(pair for name, kind in COLUMNS for pair in ((f"_{name}", ">i4"), (name, kind)))])
NUMBER = np.dtype([("row", ROW), ("_value", ">i4"), ("value", ">f8"), ("_text", ">i4")])
NEITHER = np.dtype([("row", ROW), ("_value", ">i4"), ("_text", ">i4")])
GOOD, UNLABELLED = 0, 2                 # statuses of a value


@dataclass
class Rows:
    """Values in the format of COPY, and the position behind them."""
    bytes: list[bytes]
    t_us: NDArray[np.int64]             # [us] since 1970 of each
    position: tuple[int, int, int]      # session, t [ns], packets of that t


class Tail:
    """The values of a spacecraft's archive behind what the database has."""

    def __init__(self, craft: Spacecraft, room: Room, names: tuple[str, ...], base: Connection,
                 server: int) -> None:
        self.craft, self.names, self.base, self.server = craft, names, base, server
        self.database = craft.telemetry.database
        self.history = self.database.history(room.settings.folder / "archive", craft.name, craft.settings.root)
        self.monitor = self.database.monitor(craft.settings.root)
        self.limits = InForce(craft.limits.changes, self.monitor)
        self.epoch = (craft.epoch_ns or 0) if craft.clock.simulated else 0
        with base.transaction():
            base.execute("select pg_advisory_xact_lock(%s)", (LOCK,))
            self.craft_id: int = number_of(base, "spacecraft", craft.name)
        row = base.execute("select session, t_ns, packets from fledge.progress where (server, spacecraft) = (%s, %s)",
                           (server, self.craft_id)).fetchone()
        self.position: tuple[int, int, int] = row or (0, -2**63, 0)
        self.ids = np.zeros(0, ">i4")
        self.kinds: list[str] = []
        self._register(0)

    def _register(self, first: int) -> None:
        """The numbers of parameters from a slot on."""
        pattern = re.compile("|".join(re.escape(name).replace(r"\*", ".*").replace(r"\?", ".") for name in self.names))
        slots = self.monitor.slots(first)
        chosen = [slot for slot in slots if pattern.fullmatch(slot["name"])]
        if first == 0 and slots and not chosen:
            raise SetupError(f"{self.craft.name} has no parameter as {', '.join(self.names)}; one is "
                             f"{slots[0]['name']}")
        ids = {}
        with self.base.transaction():
            self.base.execute("select pg_advisory_xact_lock(%s)", (LOCK,))
            cursor = self.base.cursor()
            cursor.executemany(f"""insert into fledge.parameter
                (spacecraft, name, unit, kind, labels, description, first_server, digest)
                select spacecraft, name, unit, kind, labels, description, first_server, {DIGEST} from (
                    values (%s::smallint, %s, %s, %s, %s::text[], %s, %s::smallint))
                    as v (spacecraft, name, unit, kind, labels, description, first_server)
                on conflict (spacecraft, digest)
                do update set first_server = least(fledge.parameter.first_server, excluded.first_server)
                returning id""", [
                (self.craft_id, slot["name"], slot["unit"] or "", slot["kind"], list(slot["labels"] or ()),
                 slot["description"] or "", self.server) for slot in chosen], returning=True)
            for slot in chosen:
                row = cursor.fetchone()
                assert row
                ids[slot["slot"]] = row[0]
                cursor.nextset()
        self.ids = np.append(self.ids, np.array([ids.get(slot["slot"], 0) for slot in slots], ">i4"))
        self.kinds += [slot["kind"] for slot in slots]
        self.wanted = np.flatnonzero(self.ids).astype("<u4").tobytes()
        self.codes = np.array(self.kinds)

    def rows(self) -> Iterator[Rows]:
        """What is new, in pieces of about MOST values."""
        for session in sorted(known["session"] for known in self.history.sessions()):
            number_, t, packets = self.position
            if session < number_:
                continue
            if session > number_:
                t, packets = -2**63, 0
            skip, frames, count = packets, [], 0
            for batch in self.history.replay(t, session=session):
                batch, skip = batch[skip:], max(skip - len(batch), 0)
                for arrival in batch:
                    packets = packets + 1 if arrival[0] == t else 1
                    t = arrival[0]
                    frames.append(self._values(*arrival))
                    count += len(frames[-1][0]) // VALUES.itemsize
                if count >= MOST:
                    yield self._piece(frames, (session, t, packets))
                    frames, count = [], 0
            if frames:
                yield self._piece(frames, (session, t, packets))

    def _values(self, t: int, received: int, packet: bytes) -> tuple[bytes, bytes, int, int]:
        """The values of a packet and their texts, as a frame has them; when it was received, what it is."""
        self.limits.at(received)
        before = self.monitor.version
        for note in self.monitor.take([(t, received, packet)]):
            if note[0] == "slots":
                self._register(note[1])
                self.limits.learn(note[1])
        frame = b""
        if self.monitor.version != before:
            _, frame = self.monitor.changes(before, self.wanted)
        n = int.from_bytes(frame[24:28], "little")
        end = HEAD + n * VALUES.itemsize
        identity = int.from_bytes(blake2b(packet, digest_size=8).digest(), "little", signed=True)
        return frame[HEAD:end], frame[end:], received, identity

    def _piece(self, frames: list[tuple[bytes, bytes, int, int]], position: tuple[int, int, int]) -> Rows:
        counts = [len(frame[0]) // VALUES.itemsize for frame in frames]
        values = np.frombuffer(b"".join(frame[0] for frame in frames), VALUES)
        slot, word = values["slot"], values["word"]
        t = values["t"] + self.epoch
        row = np.zeros(len(values), ROW)
        row["n"] = len(COLUMNS) + 2
        for name, kind in COLUMNS:
            row[f"_{name}"] = np.dtype(kind).itemsize
        row["server"], row["parameter"], row["session"] = self.server, self.ids[slot], position[0]
        row["t"], row["ns"] = t // 1000 - YEAR_2000, t % 1000
        row["received"] = np.repeat(np.array([frame[2] for frame in frames], np.int64) // 1000 - YEAR_2000, counts)
        row["packet"] = np.repeat(np.array([frame[3] for frame in frames], np.int64), counts)
        row["concern"] = values["concern"]

        kind = self.codes[slot]
        value = np.where(kind == "real", word.view("<f8"), np.where(kind == "natural", word, word.view("<i8")))
        value = np.where(np.isin(kind, TIMES), word.view("<i8") / 1e9, value)
        worded = (kind == "text") | (kind == "binary") | (values["status"] == UNLABELLED)
        is_number = ~worded & (values["status"] == GOOD) & ~np.isnan(value)
        numbers = np.zeros(int(is_number.sum()), NUMBER)
        numbers["row"], numbers["value"], numbers["_value"], numbers["_text"] = row[is_number], value[is_number], 8, -1
        neither = np.zeros(int((~worded & ~is_number).sum()), NEITHER)
        neither["row"], neither["_value"], neither["_text"] = row[~worded & ~is_number], -1, -1
        out = [numbers.tobytes(), neither.tobytes()]
        if worded.any():
            texts = [frame[1] for frame in frames]
            of = np.repeat(np.arange(len(frames)), counts)
            for i in np.flatnonzero(worded):
                text = self._text(kind[i], int(word[i]), int(values["status"][i]), texts[of[i]])
                out.append(row[i].tobytes() + b"\xff\xff\xff\xff" + len(text).to_bytes(4, "big") + text)
        self.position = position
        return Rows([part for part in out if part], t // 1000, position)

    @staticmethod
    def _text(kind: str, word: int, status: int, texts: bytes) -> bytes:
        """A text, bytes in hex, or the number of a label that no enumerator has."""
        if status == UNLABELLED:
            return str(word - (word >> 63 << 64)).encode()
        data = texts[word >> 32:(word >> 32) + (word & 0xFFFFFFFF)]
        return data.hex().encode() if kind == "binary" else \
            data.decode("utf-8", "replace").replace("\0", "\N{REPLACEMENT CHARACTER}").encode()


def find(base: Connection, query: str, *values: Any) -> Any:
    """The first column of the first row."""
    row = base.execute(query, values).fetchone()      # type: ignore[arg-type]
    return row[0] if row else None


def number_of(base: Connection, table: str, name: str) -> int:
    """The number of a name in a table, which a new name gets. A sequence would skip a number at each start."""
    number = find(base, f"select id from fledge.{table} where name = %s", name)
    if number is None:
        number = find(base, f"insert into fledge.{table} (name) values (%s) returning id", name)
    return int(number)
