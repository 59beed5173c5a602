# SPDX-License-Identifier: Apache-2.0
"""The numbers of the protocol between flight and its ground. Codes, reasons and records of packets are those of the C
headers, flight/command/command.h and flight/telemetry/telemetry.h, from which the build writes `_fledge_protocol`."""
from __future__ import annotations

from collections.abc import Sequence
from struct import calcsize

from fledge.elements import ELEMENTS
from _fledge_protocol import (ALL, CHOICES, COMMAND_MAX, DATA_MAX, EVENT_RECORD, FLAGS, HEADER,
                              HOUSEKEEPING_RECORD as WHOLE_HOUSEKEEPING, LISTS, OF_LIST, OF_MONITOR, OF_RULE,
                              REPORT_RECORD, RULES, STORED, STORED_MAX, TEXT_RECORD, Action, Code, FileAction, Kind,
                              Number, Reason, Record, Stage, Stream, UnitState)

COMMANDS, TELEMETRY = 0x1880, 0x0880     # the streams of a mission's own board
HOUSEKEEPING, REPORTS, OUTPUTS = 0, 1, 2  # of telemetry: places behind its first stream; texts follow the outputs
SERVICES = [stream.name.lower() for stream in Stream]     # in the order of their streams, behind that of the texts
PROCEDURE_MAX = 2048                     # [bytes] of bytecode: a slot's room
TURNS = 10_000                           # of a procedure in one instant, by default
LARGEST = 1e100                          # of a parameter
NAME_MAX = 127                           # [bytes] of a file's name on board
NUMBERS = [number.name.lower() for number in Number if number != Number.STRUCT]      # FledgeType
UNIT_STATES = [state.name.lower() for state in UnitState if state != UnitState.ABSENT]
HOUSEKEEPING_RECORD = WHOLE_HOUSEKEEPING[:-1]       # the spare at its end is not sent

WHY = {
    Reason.LENGTH: "its length is wrong", Reason.CHECKSUM: "its checksum is wrong",
    Reason.STREAM: "it is for another stream", Reason.UNKNOWN: "there is no such command",
    Reason.VERSION: "it is for another version of the mission's dictionary",
    Reason.PLACE: "it names a mode, module, event, output, slot, number, file or transaction that is not there",
    Reason.VALUE: "one of its arguments is out of range", Reason.RULE: "the parameters would break a rule",
    Reason.INITIAL: "an initial value counts only before flight's first instant",
    Reason.BUSY: "the commands that wait for the next instant leave no room",
    Reason.NOT_STAGED: "nothing of this module is staged", Reason.CRC: "what is staged is not what it names",
    Reason.ABSENT: "this flight software has no interpreter, none that evaluates text, or not this service",
    Reason.RUNNING: "a procedure or list runs, stands or is held already",
    Reason.BYTECODE: "the procedure is no bytecode for this interpreter",
    Reason.FAILED: "it was not done to its end",
    Reason.SEQUENCE: "it came before, or a later one did", Reason.LATE: "it was stored and came due too long ago",
    Reason.INHIBITED: "its list is inhibited",
    Reason.FULL: "the store of files is full, or too many files are under way",
    Reason.ROLE: "whose key protected its frame may not give it",
    Reason.LAST: "it would leave no unit of its kind in use",
    Reason.GUARDED: "the mode's condition does not hold",
    Reason.CONFLICT: "another list asks for another mode at the same time"}

# Of each command behind its header: "version", which a packet gets by itself, and "bytes", which end it, of any length.
ARGUMENTS: dict[Code, list[str]] = {
    Code.NOOP: [], Code.RESET_COUNTERS: [], Code.RESET_FLIGHT: ["version"], Code.MODE: ["version", "mode"],
    Code.WRITE: ["version", "module", "offset", "bytes"], Code.STAGE: ["version", "module", "offset", "bytes"],
    Code.COMMIT: ["version", "module", "crc"], Code.PUBLISH: ["version", "module"],
    Code.ARM: ["version", "event", "on"], Code.READ: ["version", "module", "offset", "n"],
    Code.TELEMETRY: ["version", "output", "on", "every"],
    Code.STAGE_PROCEDURE: ["version", "slot", "offset", "bytes"],
    Code.START_PROCEDURE: ["version", "slot", "length", "crc", "turns"], Code.STOP_PROCEDURE: ["version", "slot"],
    Code.EVALUATE: ["version", "zero", "turns", "bytes"],
    Code.STORE: ["version", "crc", "list", "step", "time", "bytes"], Code.DELETE: ["version", "list", "step"],
    Code.CONTROL: ["version", "list", "action", "crc"], Code.LIST: ["version", "list"],
    Code.PDU: ["bytes"], Code.FILE_SEND: ["version", "class", "bytes"],
    Code.FILE_CONTROL: ["version", "file_action", "own", "transaction"], Code.FILE_REMOVE: ["version", "zero", "bytes"],
    Code.TABLE_LOAD: ["version", "module", "bytes"], Code.TABLE_DUMP: ["version", "module", "bytes"],
    Code.CHECK: ["version", "module"], Code.EVENTS: ["version"],
    Code.UNIT: ["version", "unit", "state", "even"]}
#: the type of the module that flight must have for a command
SERVICE_OF = {code: name for name, codes in {
    "StoredCommands": (Code.STORE, Code.DELETE, Code.CONTROL, Code.LIST),
    "Files": (Code.PDU, Code.FILE_SEND, Code.FILE_CONTROL, Code.FILE_REMOVE, Code.TABLE_LOAD, Code.TABLE_DUMP),
    "EventLog": (Code.EVENTS,), "FaultProtection": (Code.UNIT,)}.items() for code in codes}
NAMED = (Code.FILE_SEND, Code.FILE_REMOVE, Code.TABLE_LOAD, Code.TABLE_DUMP)     # their bytes are a name
WIDE = {"time": "i64", "offset": "u32", "length": "u32", "turns": "u32", "transaction": "u32"}   # the others: u16


def argument_type(name: str) -> str:
    """Of an argument that is a number: u16, u32, i64."""
    return WIDE.get(name, "u16")


#: of struct: the numbers of a command's arguments, without its version and its bytes
LAYOUTS = {code: ">" + "".join(ELEMENTS[argument_type(name)].code for name in names if name not in ("version", "bytes"))
           for code, names in ARGUMENTS.items()}


def layout(record: Record) -> str:
    """Of struct, without a byte order: the numbers of a record."""
    return "".join(f"{n * ELEMENTS[type_].size}x" if name.startswith("spare") else f"{n}{ELEMENTS[type_].code}"
                   for name, type_, n in record)


def cuts(begin: int, end: int) -> Sequence[tuple[int, int]]:
    """(from, to) of the commands for a part of a block: of one if it holds all, else cut at multiples of DATA_MAX,
    which cut no number of 8 bytes."""
    inner = range((begin // DATA_MAX + 1) * DATA_MAX, end, DATA_MAX) if end - begin > DATA_MAX else ()
    places = [begin, *inner, end]
    return list(zip(places, places[1:]))


REPORT_LEAST = HEADER + calcsize("=" + layout(REPORT_RECORD))      # [bytes] of a packet with a report or a text
