# SPDX-License-Identifier: Apache-2.0
"""Commands as packets."""
from __future__ import annotations

import binascii
import struct as packing
from collections.abc import Sequence
from functools import reduce
from operator import xor
from typing import TYPE_CHECKING, Any

from fledge.commands.dictionary import Block, Dictionary
from fledge.commands.fields import Field, encoded, leaves, place_of
from fledge.commands.protocol import (ALL, CHOICES, DATA_MAX, HEADER, LARGEST, LAYOUTS, LISTS, NAME_MAX, NUMBERS,
                                      PROCEDURE_MAX, STORED_MAX, TURNS, UNIT_STATES, Action, Code, FileAction, cuts)
from fledge.errors import SetupError
from introspect.comment import SEVERITIES

if TYPE_CHECKING:
    from fledge.commands.reports import Stored


class Packets:
    """Makes packets by a dictionary, with a sequence of their own.

    sequence: of the first packet. A ground that begins anew counts on from the last one that flight has accepted:
    housekeeping has it, and the report of a refusal for Reason.SEQUENCE.
    """

    def __init__(self, dictionary: Dictionary, sequence: int = 0) -> None:
        self.dictionary = dictionary
        self.sequence = sequence

    def packet(self, code: int, rest: bytes = b"", version: int | None = None) -> bytes:
        """A packet with any code and any bytes behind its header: version, None: that of the dictionary."""
        if code > Code.RESET_COUNTERS and code != Code.PDU:
            rest = (self.dictionary.version if version is None else version).to_bytes(2, "big") + rest
        return self.numbered(packing.pack(">3H2B", self.dictionary.stream, 0, 0, code, 0) + rest)

    def _command(self, code: Code, *arguments: int, data: bytes = b"") -> bytes:
        """A packet with the arguments of its code in their order, and the bytes behind them."""
        return self.packet(code, packing.pack(LAYOUTS[code], *arguments) + data)

    def numbered(self, packet: bytes) -> bytes:
        """A command with the next sequence, its length and its checksum."""
        raw = numbered(packet, self.sequence)
        self.sequence += 1
        return checksummed(raw)

    def noop(self) -> bytes:
        return self._command(Code.NOOP)

    def pdu(self, pdu: bytes) -> bytes:
        """A PDU of CFDP for the files of flight."""
        return self._command(Code.PDU, data=pdu)

    def reset_counters(self) -> bytes:
        return self._command(Code.RESET_COUNTERS)

    def mode(self, mode: Any) -> bytes:
        """Request a mode, by its name or handle."""
        return self._command(Code.MODE, self._mode(mode))

    def _mode(self, mode: Any) -> int:
        modes = self.dictionary.modes
        return place_of(modes, modes, getattr(mode, "name", mode), "mode", self.dictionary.name)[0]

    def arm(self, event: Any, on: bool = True) -> bytes:
        """Arm an event, by its name or handle, or disarm it."""
        events = self.dictionary.events
        place, _ = place_of(events, events, getattr(event, "name", event), "event", self.dictionary.name)
        return self._command(Code.ARM, place, bool(on))

    def publish(self, module: str) -> bytes:
        """Publish the parameters of a module of the configuration."""
        return self._command(Code.PUBLISH, self.dictionary.block(module)[0])

    def reset(self) -> bytes:
        """Flight begins again; its parameters stay."""
        return self._command(Code.RESET_FLIGHT)

    def telemetry(self, output: str | None = None, on: bool = True, every: int = 1) -> bytes:
        """Send packets of an output, or of all, at every so many of its writings. output: its path, or "housekeeping",
        which is written at each instant."""
        place = ALL if output is None else len(self.dictionary.outputs) if output == "housekeeping" else \
            self.dictionary.output(output)[0]
        return self._command(Code.TELEMETRY, place, bool(on), every)

    def read(self, module: str, field: str | None = None) -> list[bytes]:
        """Read back a field of the parameters, or all; their reports have the bytes."""
        place, block = self.dictionary.block(module)
        row = self._field(block, field) if field else None
        at, end = (row.offset, row.offset + row.size) if row else (0, block.size)
        return [self._command(Code.READ, place, low, high - low) for low, high in cuts(at, end)]

    def write(self, module: str, **values: Any) -> list[bytes]:
        """Write fields of the parameters: numbers in the units of the header, arrays as lists, enumerators by name,
        structs as dicts. Fields that lie side by side are one command, as far as it holds them."""
        block = self.dictionary.block(module)[1]
        pieces = {f.offset: encoded(f, values[f.name]) for f in
                  sorted((self._field(block, name) for name in values), key=lambda f: f.offset)}
        return self.write_bytes(module, pieces)

    def write_bytes(self, module: str, pieces: dict[int, bytes]) -> list[bytes]:
        """The same of big-endian bytes by their offsets, which rise."""
        place = self.dictionary.block(module)[0]
        runs: list[tuple[int, bytearray]] = []
        for at, data in pieces.items():
            if runs and runs[-1][0] + len(runs[-1][1]) == at:
                runs[-1][1].extend(data)
            else:
                runs.append((at, bytearray(data)))
        return [self._command(Code.WRITE, place, low, data=data[low - at:high - at])
                for at, data in runs for low, high in cuts(at, at + len(data))]

    def load(self, module: str, block: bytes) -> list[bytes]:
        """The whole block of a module, big-endian, staged and committed."""
        place, owner = self.dictionary.block(module)
        if len(block) != owner.size:
            raise SetupError(f"{module} has {owner.size} bytes of parameters; found {len(block)}")
        parts = [self._command(Code.STAGE, place, low, data=block[low:high]) for low, high in cuts(0, len(block))]
        return [*parts, self._command(Code.COMMIT, place, binascii.crc_hqx(block, 0xFFFF))]

    def change(self, module: str, before: bytes, after: bytes) -> list[bytes]:
        """The commands that change a module's block, big-endian, from `before` to `after`, as a whole."""
        fields = self.dictionary.block(module)[1].fields
        changed = [(at, at + f.size) for _, f, at in leaves(fields) if before[at:at + f.size] != after[at:at + f.size]]
        if not changed:
            return []
        low, high = changed[0][0], changed[-1][1]
        return self.write_bytes(module, {low: after[low:high]}) if high - low <= DATA_MAX else self.load(module, after)

    def procedure(self, bytecode: bytes, turns: int = TURNS, slot: int = 0) -> list[bytes]:
        """Stage a procedure and start it. turns: of its loops and calls that it may take in one instant."""
        if not 0 < len(bytecode) <= PROCEDURE_MAX:
            raise SetupError(f"a procedure has 1 to {PROCEDURE_MAX} bytes of bytecode; found {len(bytecode)}")
        parts = [self._command(Code.STAGE_PROCEDURE, slot, low, data=bytecode[low:high])
                 for low, high in cuts(0, len(bytecode))]
        crc = binascii.crc_hqx(bytecode, 0xFFFF)
        return [*parts, self._command(Code.START_PROCEDURE, slot, len(bytecode), crc, turns)]

    def stop(self, slot: int = 0) -> bytes:
        """Stop the procedure of a slot."""
        return self._command(Code.STOP_PROCEDURE, slot)

    def evaluate(self, text: str, turns: int = TURNS) -> bytes:
        """Evaluate a text in flight, by a development build."""
        raw = text.encode()
        if not 0 < len(raw) <= DATA_MAX:
            raise SetupError(f"a text for flight has 1 to {DATA_MAX} bytes; found {len(raw)}")
        return self._command(Code.EVALUATE, 0, turns, data=raw)

    # --- stored commands (flight/services/stored_commands.h) ---

    def store(self, number: int, step: int, time: int, packet: bytes) -> bytes:
        """Store a command on board, as the step of a list, in place of one that is there. time [ns]: of list 0 that of
        its clock, of a sequence that since its start."""
        if not 0 <= number < LISTS or not 0 <= step < ALL or not 0 <= time < 2**63:
            raise SetupError(f"a stored command has a list from 0 to {LISTS - 1}, a step from 0 to {ALL - 1} and a "
                             f"time from 0 ns on; found {number}, {step}, {time} ns")
        if not 8 <= len(packet) <= STORED_MAX:
            raise SetupError(f"a stored command has 8 to {STORED_MAX} bytes; found {len(packet)}: write fewer "
                             "parameters at once")
        stored = packing.pack(LAYOUTS[Code.STORE], 0, number, step, time)[2:] + packet      # behind its CRC
        return self._command(Code.STORE, binascii.crc_hqx(stored, 0xFFFF), number, step, time, data=packet)

    def store_sequence(self, number: int, steps: Sequence[tuple[int, bytes]]) -> list[bytes]:
        """Store a block of commands as a list: (time since its start [ns], packet) of each."""
        return [self.store(number, i, t, packet) for i, (t, packet) in enumerate(steps)]

    def control(self, action: Action, number: int = ALL, stored: Sequence[Stored] | None = None) -> bytes:
        """Start, stop, hold, release, inhibit or allow a list, or all. stored: what a list that starts must be."""
        crc = binascii.crc_hqx(b"".join(packing.pack(">qHHHH", *command) for command in stored or []), 0xFFFF)
        return self._command(Code.CONTROL, number, action, crc if stored else 0)

    def delete(self, number: int = ALL, step: int = ALL) -> bytes:
        """Delete a stored command, a list, or all."""
        return self._command(Code.DELETE, number, step)

    def stored(self, number: int) -> bytes:
        """Ask for what a list has: stored() reads the data of the report."""
        return self._command(Code.LIST, number)

    def monitor(self, place: int, number: str = "", **check: Any) -> bytes:
        """Write a monitor (flight/services/monitors.h), or turn it off by on=False alone.

        number: "flight.tracking.error.sigma_BR[2]" or, with the measure "norm" or "max_abs", all numbers of a field.
        It is right from low to high, where it equals a number, or, with bits, where none of the bits of that mask is
        set in a whole number of up to 32 bits; with change, its change from writing to writing is.
        hold [ns], count: how long, and at how many instants, it is wrong before the monitor fires. starts: a list.
        """
        return self._write_row("Monitors", "monitors", place, self._check(number, **check))

    def _check(self, number: str, *, on: bool = True, low: float | None = None, high: float | None = None,
               equals: float | None = None, bits: int | None = None, change: bool = False, measure: str = "",
               hold: int = 0, count: int = 0, starts: int = 0) -> dict[str, Any]:
        """The values of a Monitor."""
        if (low is not None or high is not None or change) + (equals is not None) + (bits is not None) > 1:
            raise SetupError("a monitor has either equals, or bits, or low and high")
        values: dict[str, Any] = dict.fromkeys(("output", "type", "offset", "n", "measure"), 0) | {"bits": bits or 0}
        if number:
            output, field, offset, n = self.dictionary.number(number, measure)
            if bits is not None:
                width = 0 if field.type not in ("i8", "u8", "i16", "u16", "i32",
                                                "u32") or measure else int(field.type[1:])
                if not width:
                    raise SetupError(f"{number}: bits are of one whole number of up to 32 bits, not of "
                                     + (f"its {measure}" if measure else f"{field.type}"))
                if not isinstance(bits, int) or not 0 < bits < 1 << width:
                    raise SetupError(f"{number} is a {field.type}: expected bits from 1 to {hex((1 << width) - 1)}; "
                                     f"found {bits!r}")
            values |= {"output": output, "type": NUMBERS.index(field.type), "offset": offset, "n": n,
                       "measure": ["", "norm", "max_abs"].index(measure)}
        elif on:
            raise SetupError("a monitor that is on needs a number")
        kind = 0 if not number else 4 if bits is not None else 3 if equals is not None else 2 if change else 1
        return values | {"kind": kind, "on": int(on), "hold": hold, "count": count, "list": starts,
                         "low": equals if equals is not None else -LARGEST if low is None else low,
                         "high": LARGEST if high is None else high}

    def rule(self, place: int, number: str = "", *, unit: int | None = None, becomes: str = "", mode: Any = None,
             limit: int = 0, **check: Any) -> bytes:
        """Write a rule of the fault protection (flight/services/fault_protection.h), or turn it off by on=False alone.

        number, check: as of a monitor. What follows where it stays wrong: a unit becomes something ("faulted", "off",
        "primary", "redundant"), a mode is requested, a list started; at most `limit` times, 0: always.
        """
        if becomes and unit is None:
            raise SetupError(f"a rule by which a unit becomes {becomes} has a unit")
        return self._write_row("FaultProtection", "rules", place, {
            "check": self._check(number, **check), "unit": 0 if unit is None else 1 + unit,
            "becomes": _unit_state(becomes) if becomes else 0, "mode": 0 if mode is None else 1 + self._mode(mode),
            "limit": limit})

    def unit(self, unit: int, state: str, even: bool = False) -> bytes:
        """Set the state of a unit (flight/services/fault_protection.h): "off", "primary", "redundant", "faulted".
        Flight refuses it where no unit of the kind would stay in use; even: it does not."""
        return self._command(Code.UNIT, unit, _unit_state(state), bool(even))

    def clear_fault(self, unit: int | None = None) -> bytes:
        """Clear the fault of a unit, or of all, and what counts against the rules that accuse it."""
        return self._command(Code.UNIT, ALL if unit is None else unit, 0, 0)

    def events(self) -> bytes:
        """Ask for what the log of events has (flight/services/event_log.h), to be sent again."""
        return self._command(Code.EVENTS)

    def filter_events(self, place: int, output: str = "", *, least: str = "info", most: int = 0, on: bool = True
                      ) -> bytes:
        """Write one of the filters of the log of events, or turn it off by on=False alone: of an output log what is at
        least so grave (info, low, medium, high, none), and at most so many in each window of time (0: all)."""
        known = [*SEVERITIES, "none"]
        values = {"on": int(on), "least": place_of(known, known, least, "severity", "an event")[0] + 1, "most": most,
                  "output": self.dictionary.output(output)[0] if on else 0}
        return self._write_row("EventLog", "filters", place, values)

    def housekeeping(self, place: int, numbers: Sequence[str] = (), *, every: int = 0, on: bool = True) -> bytes:
        """Define a report of chosen numbers (flight/services/housekeeping.h) and turn it on; without numbers, turn the
        one that is defined on or off.

        numbers: "flight.motor.command.u[0]", or "flight.tracking.error.sigma_BR" with all of its numbers. every [ns].
        """
        path, rows, at = self._row("Housekeeping", "reports", place)
        if not numbers:
            switch = next(f for f in rows.fields if f.name == "on")
            return self.write_bytes(path, {at + switch.offset: encoded(switch, int(on))})[0]
        if len(numbers) > CHOICES:
            raise SetupError(f"a report has up to {CHOICES} numbers or fields; found {len(numbers)}")
        choices = [dict(zip(("output", "type", "offset", "n"), (output, NUMBERS.index(field.type), offset, n)))
                   for output, field, offset, n in (self.dictionary.number(number, "any") for number in numbers)]
        none = dict.fromkeys(("output", "type", "offset", "n"), 0)
        packet = self._write_row("Housekeeping", "reports", place, {
            "period": every, "on": int(on), "n": len(choices), "choices": choices + [none] * (CHOICES - len(choices))})
        self.dictionary.learn(packet[HEADER:])
        return packet

    def _row(self, kind: str, name: str, place: int) -> tuple[str, Field, int]:
        """(path of the only module of a kind, its parameter, [bytes] up to an element of that)."""
        path, block = next(((b.path, b) for b in self.dictionary.blocks if b.type == kind), ("", None))
        if block is None:
            raise SetupError(f"{self.dictionary.name} has no module {kind}")
        rows = self._field(block, name)
        if not 0 <= place < rows.shape[0]:
            raise SetupError(f"{path} has the {name} 0 to {rows.shape[0] - 1}; found {place}")
        return path, rows, rows.offset + place * (rows.size // rows.shape[0])

    def _write_row(self, kind: str, name: str, place: int, values: dict[str, Any]) -> bytes:
        """Write an element of an array of structs; what is not given is 0."""
        path, rows, at = self._row(kind, name, place)
        raw = encoded(rows, dict.fromkeys((f.name for f in rows.fields), 0) | values, [])
        return self.write_bytes(path, {at: raw})[0]

    # --- files (flight/services/files.h) ---

    def send_file(self, name: str, to: str = "", unacknowledged: bool = False) -> bytes:
        """Send a file from on board to the ground, there under the same name or another one. unacknowledged: in CFDP's
        class 1, without repetition."""
        return self._named(Code.FILE_SEND, 1 if unacknowledged else 2, f"{name}>{to}" if to else name, 2)

    def control_file(self, action: FileAction, transaction: int, own: bool = True) -> bytes:
        """Suspend, resume or cancel a transaction. own: one that flight began, else the ground. Raises SetupError from
        2^32 on: a command names none of those, but a Transfer suspends, resumes and cancels itself."""
        if not 0 <= transaction < 2**32:
            raise SetupError(f"control_file: a command names a transaction below 2^32, not {transaction}; suspend, "
                             "resume or cancel it by its Transfer")
        return self._command(Code.FILE_CONTROL, action, bool(own), transaction)

    def remove_file(self, name: str) -> bytes:
        """Remove a file on board."""
        return self._named(Code.FILE_REMOVE, 0, name)

    def load_table(self, module: str, name: str) -> bytes:
        """Let the parameters of a module become those of a file on board, which table() makes."""
        return self._named(Code.TABLE_LOAD, self.dictionary.block(module)[0], name)

    def dump_table(self, module: str, name: str) -> bytes:
        """Write the parameters of a module to a file on board, which read_table() reads."""
        return self._named(Code.TABLE_DUMP, self.dictionary.block(module)[0], name)

    def check(self, module: str) -> bytes:
        """Ask for the size and CRC of the parameters of a module: checked() reads the data of the report."""
        return self._command(Code.CHECK, self.dictionary.block(module)[0])

    def _named(self, code: Code, first: int, name: str, most: int = 1) -> bytes:
        parts = [word.encode() for word in name.split(">")]
        if len(parts) > most or not all(0 < len(part) <= NAME_MAX and b"\0" not in part for part in parts):
            raise SetupError(f"a file on board has a name of 1 to {NAME_MAX} bytes without '>' and NUL; found '{name}'")
        return self._command(code, first, data=name.encode())

    def _field(self, block: Block, name: str) -> Field:
        return place_of(block.fields, [f.name for f in block.fields], name, "parameter", block.path)[1]


def _unit_state(state: str) -> int:
    return 1 + place_of(UNIT_STATES, UNIT_STATES, state, "state", "a unit")[0]


def numbered(packet: bytes, sequence: int) -> bytes:
    """A space packet that is whole, with this sequence, and its length."""
    return packet[:2] + packing.pack(">HH", 0xC000 | sequence & 0x3FFF, len(packet) - 7) + packet[6:]


def checksummed(packet: bytes) -> bytes:
    """A command with its checksum: the XOR of all bytes is 0xFF."""
    return packet[:7] + bytes([reduce(xor, packet[:7] + packet[8:], 0xFF)]) + packet[8:]


def moved(packet: bytes, by: int) -> bytes:
    """The same command with a sequence that is `by` further. A wrong checksum stays wrong."""
    if len(packet) < 8:
        return packet
    raw, word = bytearray(packet), int.from_bytes(packet[2:4], "big")
    raw[2:4] = (word & 0xC000 | word + by & 0x3FFF).to_bytes(2, "big")
    raw[7] ^= reduce(xor, raw[2:4] + packet[2:4])
    return bytes(raw)


def sequence_of(packet: bytes) -> int:
    """The number that the report of a command has."""
    return int.from_bytes(packet[2:4], "big") & 0x3FFF
