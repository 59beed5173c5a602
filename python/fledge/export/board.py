# SPDX-License-Identifier: Apache-2.0
"""The interface of an exported mission to the outside: the board that carries its messages whole, and the table of
the messages and numbers in the lanes of any board, targets/mission_io.h.

In a board's file, a snorkel or field names what it carries by its path: `carries = "world.nav.attitude"` of a message
snorkel, `carries = "world.nav.attitude.sigma_BN"` of a field of words, of which the i-th holds the i-th number, or of a
field of packets, which holds its `count` numbers in a row. A packet without fields carries all numbers of a message, of
a part of it, or of a list of parts.
"""
from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.commands import REPORT_LEAST, byte_runs, leaves
from fledge.elements import ELEMENTS
from fledge.errors import listed
from fledge.export import names
from fledge.export.c_source import extern, row, written
from fledge.export.commands import dictionary
from fledge.export.read import ExportError, Message, Mission
from introspect.keywords import C, CPP

if TYPE_CHECKING:
    from fledge import _core
    from registers.description import Board, Lane as LaneOfBoard, Number

BASE, CLOCK, INTERRUPTS, FIRST = 0xA0000000, 0x0, 0x20, 0x40
PACKETS = {"commands": "packets to flight, flight/command/command.h",
           "telemetry": "packets from flight, flight/telemetry/telemetry.h"}


@dataclass
class Lane:
    """A message, or some of its numbers, in a lane."""
    message: Message
    id: int                          # of the message
    board: int
    lane: int                        # its place among the board's
    field: int                       # of words or packets
    offset: int                      # [bytes] of the first number in the message
    number: str | None               # its type, "f64"; None: a message whole
    count: int
    scale: float                     # of the field
    tag: int | None = None           # of packets, or 0 of queued words


# --- the board that carries messages whole ---------------------------------------------------------

def toml(mission: Mission, outputs: Sequence[str] | str = ()) -> str:
    """The file of the mission's own board: a message snorkel for every message that flight or the outside reads, and
    for further outputs by their paths; `outputs` "all": for every one; and queues of commands and telemetry. Words are
    big-endian; it has the clock."""
    known = {m.path for m in mission.outputs}
    unknown = [] if outputs == "all" else sorted(set(outputs) - known)
    if unknown:
        raise ExportError(f"{mission.title}: flight puts out no {unknown[0]}; it has {listed(sorted(known))}")
    carried = [m for m in (*mission.inputs, *mission.outputs)
               if m.direction != "inside" or outputs == "all" or m.path in outputs]
    snorkels = _distinct([*PACKETS, *(m.name for m in carried)])[len(PACKETS):]
    at, parts = FIRST, []
    for message, name in zip(carried, snorkels):
        # registers/lane.h: a control block, then four slots with their heads.
        parts.append(_snorkel(name, _doc(message), "message", "read" if message.direction == "in" else "write", at,
                              _typed(message) + f"size      = {message.struct.size}", message.path))
        at += 32 + 4 * -(-(8 + 4 + message.struct.size) // 8) * 8
    commands = dictionary(mission)
    for name, direction, capacity, queue in (
            ("commands", "read", commands.uplink, commands.packets),
            ("telemetry", "write", commands.downlink,
             1 << (2 * commands.packets + len(commands.outputs)).bit_length())):
        parts.append(_snorkel(name, PACKETS[name], "packet", direction, at,
                              f"capacity  = {capacity}\nqueue     = {queue}", name))
        at += 32 + queue * (-(-(8 + capacity) // 8) * 8)
    return f'''# SPDX-License-Identifier: Apache-2.0
# The board of {mission.title}: its messages as they are. Written by `fledge export`; a board of your own
# says with `carries`, as this one, what passes through a snorkel.
name  = "{board_name(mission)}"
doc   = "All that passes between {mission.title} and its surroundings"
base  = {BASE:#x}
size  = {-(-at // 64) * 64:#x}
order = "big"

[clock]
address   = {CLOCK:#x}
interrupt = "tick"

[interrupts]
address = {INTERRUPTS:#x}
lines   = ["tick"]
''' + "".join(parts)


def _snorkel(name: str, doc: str, form: str, direction: str, address: int, sizes: str, carries: str) -> str:
    return f'''
[[snorkel]]
name      = "{name}"
doc       = "{doc}"
form      = "{form}"
direction = "{direction}"
address   = {address:#x}
{sizes}
carries   = "{carries}"
'''


def board_name(mission: Mission) -> str:
    return _distinct([f"{mission.name}_board"])[0]


def _typed(message: Message) -> str:
    return f'message   = "{message.struct.name}"\nheader    = "{message.struct.header}"\n'


def _doc(message: Message) -> str:
    ends = ", ".join(message.ends)
    return f"{message.path} >> {ends}" if ends else message.path


def _distinct(texts: Iterable[str]) -> list[str]:
    """Names as boards have them: lower case, no two underscores in a row."""
    distinct = names.distinct([re.sub("_+", "_", text.lower()).strip("_") or "unnamed" for text in texts])
    return [name.strip("_") if name.rstrip("_") not in C | CPP else name + "2" for name in distinct.values()]


def texts_of(paths: Iterable[Path | str]) -> list[tuple[Path, str]]:
    """(path, text) of the files of boards, and of those in folders. Raises ExportError, OSError."""
    from registers.checked_toml import TomlError, text_of
    from registers.description import files_of

    try:
        return [(path, text_of(path)) for path in files_of(paths)]
    except TomlError as error:
        raise ExportError(str(error)) from None


def carried(mission: Mission, path: str) -> list[Number] | None:
    """The numbers of a message or of a part of it, without its head and what only fills gaps; None: queues."""
    from registers.description import Number

    if path in PACKETS:
        return None
    messages = {m.path: m for m in (*mission.inputs, *mission.outputs)}
    message = next((m for name, m in messages.items() if path == name or path.startswith(f"{name}.")), None)
    if not message:
        raise LookupError(f"there is no message {path} in {mission.title}; choose of "
                          f"{', '.join((*messages, *PACKETS))}")
    known = [(f"{message.path}.{name}", field) for name, field, _ in leaves(message.struct.fields)
             if not field.spare and field.type != "char" and not name.startswith("head.")]
    matching = [(name, field) for name, field in known if name == path or name.startswith((f"{path}.", f"{path}["))]
    if not matching:
        raise LookupError(f"{message.path} has no numbers {path}; it has {', '.join(name for name, _ in known)}")
    return [Number(name, "i32" if field.type == "enum" else field.type, math.prod(field.shape), field.unit or "-",
                   field.doc or ", ".join(f"{value}: {text}" for text, value in dict(field.enumerators).items()))
            for name, field in matching]


def read(mission: Mission, texts: Iterable[tuple[Path, str]]) -> list[Board]:
    """The boards of (path, text) pairs, registers.description.Board each. Raises ExportError with all that is wrong."""
    from registers.checked_toml import TomlError
    from registers.description import parse_all

    try:
        boards = parse_all(texts, lambda path: carried(mission, path))
    except TomlError as error:
        raise ExportError(str(error)) from None
    clocks = [board for board in boards if board.clock is not None]
    if len(clocks) > 1:
        raise ExportError(f"{clocks[1].path}: {clocks[0].path} has a [clock] already, which paces flight; write "
                          "[slave_clock] here")
    if not clocks:
        raise ExportError(f"{boards[0].path}: no board has a clock, which paces flight; give one of them a [clock]")
    return boards


# --- messages in lanes ----------------------------------------------------------------

def lanes(mission: Mission, boards: Sequence[Board]) -> list[Lane]:
    """The table of `boards`, in the order of the messages' ids. Raises ExportError with all that is wrong with it."""
    finder = _Finder(mission)
    for i, board in enumerate(boards):
        places = {lane.name: k for k, lane in enumerate(board.lanes)}
        for snorkel in board.snorkels:
            for lane in snorkel.lanes:
                finder.snorkel(board, i, snorkel, lane, places[lane.name])
    finder.complete(boards)
    if finder.wrong:
        raise ExportError("\n".join(finder.wrong))
    return sorted(finder.lanes, key=lambda lane: (lane.id, lane.board, lane.lane, lane.tag or 0))


class _Finder:
    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.messages = {m.path: (i, m) for i, m in enumerate((*mission.inputs, *mission.outputs))}
        self.lanes: list[Lane] = []
        self.wrong: list[str] = []
        self.taken: dict[str, Any] = {}
        self.kinds: dict[tuple[int, int, int], tuple[Message, int]] = {}

    def refuse(self, board: Board, line: int, text: str) -> None:
        self.wrong.append(f"{board.path}:{line}: {text}")

    def snorkel(self, board: Board, i: int, snorkel: Any, lane: LaneOfBoard, place: int) -> None:
        if snorkel.carries in PACKETS:
            self.packets(board, snorkel, lane)
        elif lane.carries:
            output = self.message(board, lane.line, lane.carries, lane)
            if not output:
                return
            id, message = output
            if snorkel.message_size != message.struct.size and not (
                    lane.variable and snorkel.message_size > message.struct.size):
                self.refuse(board, lane.line, f"{message.path} has {message.struct.size} bytes; write size = "
                            f"{message.struct.size}")
            elif snorkel.message not in (None, message.struct.name):
                self.refuse(board, lane.line, f"{message.path} is a {message.struct.name}, no {snorkel.message}")
            elif self.take(board, lane.line, message, range(message.struct.size)):
                self.lanes.append(Lane(message, id, i, place, 0, 0, None, 1, 1.0))
        shared = lane is not snorkel.lanes[0] and lane.fields is snorkel.lanes[0].fields
        for k, field in enumerate(() if shared else lane.fields):
            if field.carries:
                self.field(board, i, lane, place, k, field)

    def packets(self, board: Board, snorkel: Any, lane: LaneOfBoard) -> None:
        """A snorkel of commands or telemetry."""
        what = snorkel.carries
        commands = dictionary(self.mission)
        least = commands.uplink if what == "commands" else commands.downlink if commands.frames else REPORT_LEAST
        units = what if not commands.frames else "frames of commands" if what == "commands" else "frames"
        if lane.form != "packet" or lane.from_flight != (what == "telemetry") or not lane.variable or not lane.queued:
            self.refuse(board, snorkel.line, f"{what} pass in a queue of packets of variable size: form = \"packet\", "
                        f"direction = \"{'write' if what == 'telemetry' else 'read'}\", a capacity and a queue")
        elif lane.capacity < least:
            self.refuse(board, snorkel.line, f"{units} need a capacity of {least} bytes; it is {lane.capacity}")
        elif what in self.taken:
            self.refuse(board, snorkel.line, f"{what} pass already by {self.taken[what]}")
        else:
            self.taken[what] = f"{board.path}:{snorkel.line}"

    def message(self, board: Board, line: int, path: str, lane: LaneOfBoard) -> tuple[int, Message] | None:
        """(id, message) of a path, if it passes in that direction."""
        if path not in self.messages:
            self.refuse(board, line, f"there is no message {path} in {self.mission.title}; choose of "
                        f"{', '.join((*self.messages, *PACKETS))}")
            return None
        id, message = self.messages[path]
        if lane.from_flight == (message.direction == "in"):
            way, fits = ("reads", "read") if message.direction == "in" else ("puts out", "write")
            self.refuse(board, line, f"flight {way} {path}; the snorkel's direction must be \"{fits}\"")
            return None
        return id, message

    def field(self, board: Board, i: int, lane: LaneOfBoard, place: int, k: int, field: Any) -> None:
        parts = field.carries.split(".")
        if len(parts) < 4:
            self.refuse(board, field.line, f"`{field.carries}` is no number; write the message and its field, as "
                        "in \"world.nav.attitude.sigma_BN\"")
            return
        output = self.message(board, field.line, ".".join(parts[:3]), lane)
        if not output:
            return
        id, message = output
        try:
            type_, unit, offset, n = _numbers(message.struct, parts[3:], ".".join(parts[:3]))
        except ExportError as error:
            self.refuse(board, field.line, str(error))
            return
        count = field.count if lane.form == "packet" else lane.count
        tag = field.tag if lane.form == "packet" else 0 if lane.queued else None
        here = message, field.line
        other, first = here if tag is None else self.kinds.setdefault((i, place, tag), here)
        if other is not message:
            self.refuse(board, field.line, "a packet carries numbers of one message, and line "
                        f"{first} of {other.path}; give {message.path} a packet of its own, or another tag")
        elif count > n:
            self.refuse(board, field.line, f"{field.carries} has {n} numbers from there on; the "
                        + (f"field has {count}" if lane.form == "packet" else f"snorkel has {count} words"))
        elif field.unit not in ("-", unit) and unit:
            self.refuse(board, field.line, f"{field.carries} is in {unit}, the field in {field.unit}; write unit = "
                        f"\"{unit}\", and scale and offset in it")
        elif self.take(board, field.line, message, range(offset, offset + count * ELEMENTS[type_].size)):
            self.lanes.append(Lane(message, id, i, place, k, offset, type_, count, field.scale, tag))

    def take(self, board: Board, line: int, message: Message, places: range) -> bool:
        """Each byte of a message passes once."""
        taken = self.taken.setdefault(message.path, {})
        first = next((taken[b] for b in places if b in taken), None)
        if first:
            self.refuse(board, line, f"{message.path} passes already by {first}")
            return False
        taken.update(dict.fromkeys(places, f"{board.path}:{line}"))
        return True

    def complete(self, boards: Sequence[Board]) -> None:
        files = ", ".join(str(board.path) for board in boards)
        for message in (*self.mission.inputs, *self.mission.outputs):
            if message.path not in self.taken and message.direction != "inside" and not message.optional:
                what = "reads" if message.direction == "in" else "puts out"
                ends = ", ".join(message.ends)
                self.wrong.append(f"{files}: flight {what} {message.path} ({ends}), which no snorkel carries; add one "
                                  f"with carries = \"{message.path}\", or words for its fields")


def _numbers(struct: _core.Struct, parts: Sequence[str], path: str) -> tuple[str, str, int, int]:
    """(type, unit, offset, how many to the end of the field) of a path such as ["wheels[2]", "axis_B"]."""
    offset = 0
    for depth, part in enumerate(parts):
        match = re.fullmatch(r"(\w+)((?:\[\d+\])*)", part)
        field = next((f for f in struct.fields if match and f.name == match[1]), None)
        if not match or not field:
            raise ExportError(f"{path} has no field {part}; choose of "
                              f"{', '.join(f.name for f in struct.fields if not f.spare)}")
        index = [int(i) for i in re.findall(r"\d+", match[2])]
        if len(index) > len(field.shape) or any(i >= n for i, n in zip(index, field.shape)):
            raise ExportError(f"{path}.{field.name} has shape {list(field.shape)}; there is no {part}")
        first = 0
        for i, n in zip(index + [0] * (len(field.shape) - len(index)), field.shape):
            first = first * n + i
        total = math.prod(field.shape)
        offset += field.offset + first * (field.size // total)
        path += f".{part}"
        if field.type == "struct":
            if depth + 1 == len(parts):
                raise ExportError(f"{path} is a struct; name one of its numbers: "
                                  f"{', '.join(f.name for f in field.struct.fields if not f.spare)}")
            if len(index) < len(field.shape):
                raise ExportError(f"{path} is an array of structs; choose one, as in {part}[0]")
            struct = field.struct
        elif depth + 1 < len(parts):
            raise ExportError(f"{path} is a number or array, and has no {parts[depth + 1]}")
        elif field.type == "char":
            raise ExportError(f"{path} is a text; words carry numbers")
        else:
            return field.type, field.unit, offset, total - first
    raise ExportError(f"{path} is a whole message; name one of its numbers")


# --- in C ------------------------------------------------------------------------------------------

def emit_board(mission: Mission, files: Sequence[Path | str] = (), outputs: Sequence[str] | str = ()
               ) -> dict[str, str]:
    """File name -> text: the boards' headers, tables and documentation, and the table of messages in lanes.

    files: of boards of the user, or folders of them. Without any, the mission's own, whose file is among the results;
    `outputs` are paths of outputs that it carries besides what the world reads, or "all".
    """
    from registers import emit_c, emit_markdown

    texts = texts_of(files)
    own = {} if texts else {f"{board_name(mission)}.toml": toml(mission, outputs)}
    boards = read(mission, texts or [(Path(name), text) for name, text in own.items()])
    all_lanes = lanes(mission, boards)
    for board in boards:
        own |= emit_c.emit(board) | emit_markdown.emit(board)
    return own | emit(mission, boards, all_lanes)


def emit(mission: Mission, boards: Sequence[Board], lanes: list[Lane]) -> dict[str, str]:
    """The table of messages in lanes. boards: of `read`; lanes: of the function of that name."""
    return {f"{mission.name}_io.h": header(mission), f"{mission.name}_io.c": source(mission, boards, lanes)}


def header(mission: Mission) -> str:
    name, guard = mission.name, f"{mission.name.upper()}_IO_H"
    return "\n".join([*written(mission), f"#ifndef {guard}\n#define {guard}\n",
                      f'#include "{name}.h"', '#include "targets/mission_io.h"\n',
                      "/** Which message passes through which lane. */", extern("MissionIo", f"{name}_io"), "#endif\n"])


def source(mission: Mission, boards: Sequence[Board], entries: list[Lane]) -> str:
    name, upper = mission.name, mission.name.upper()
    kinds = any(lane.tag is not None for lane in entries)
    lines = [*written(mission), f'#include "{name}_io.h"', *['#include "targets/mission_packets.h"']
             * kinds, "", *(f'#include "{b.name}.h"' for b in boards)]
    whole = {lane.message.struct.name: lane.message.struct for lane in entries if lane.number is None}
    for struct in whole.values():
        declared = f"const RegisterMessage fledge_message_{struct.name}"
        lines += message(struct, declared, [f"extern {declared};"])
    lines += ["", "static const RegisterBoard *const boards[] = {" + ", ".join(f"&{b.name}" for b in boards) + "};",
              *(["", "static const MissionLane lanes[] = {"] if entries else [])]
    for lane in entries:
        board = boards[lane.board]
        lines += row("0" if lane.number else f"&fledge_message_{lane.message.struct.name}",
                     f"{upper}_MSG_{lane.message.name.upper()}", f"{lane.board}u",
                     f"{board.name.upper()}_LANE_{board.lanes[lane.lane].name.upper()}", f"{lane.field}u",
                     f"{lane.offset}u", f"FLEDGE_{(lane.number or 'enum').upper()}")
    places = packet_lanes(boards)
    room = max((lane.capacity for b in boards for snorkel in b.snorkels if snorkel.carries == "commands"
                for lane in snorkel.lanes),
               default=0)
    lines += [*(["};"] if entries else []), *_packets(boards, entries), "",
              *([f"static uint8_t packet[{room}];", ""] if room else []), f"const MissionIo {name}_io = {{",
              f"    {name}_messages, boards, {'lanes' if entries else 0}, {upper}_MESSAGES, {len(boards)}u, "
              f"{len(entries)}u,",
              "    &packets," if kinds else "    0,",
              *(f"    {places.get(what, '{MISSION_NO_BOARD, 0u}')}," for what in PACKETS),
              f"    {'packet' if room else '0'}, {room}u", "};", ""]
    return "\n".join(lines)


def _packets(boards: Sequence[Board], lanes: list[Lane]) -> list[str]:
    """Lines that define the kinds of packets, and memory for each."""
    rows: list[str] = []
    lines: list[str] = []
    longest = 0
    for board, place, tag in sorted({(lane.board, lane.lane, lane.tag) for lane in lanes if lane.tag is not None}):
        lane = boards[board].lanes[place]
        size = lane.capacity
        if lane.variable:
            size = max(field.end for field in lane.fields if field.tag == tag)
        longest = max(longest, lane.capacity)
        lines.append(f"static uint8_t packet_{len(lines)}[{size + 1}];")
        rows += row(f"{board}u", f"{boards[board].name.upper()}_LANE_{lane.name.upper()}", f"{size}u", f"{tag}u",
                    f"{int(lane.newest)}u", f"packet_{len(lines) - 1}")
    return ["", *lines, f"static uint8_t scratch[{longest}];", "", "static const MissionPacket kinds[] = {", *rows,
            "};", "", "static const MissionPackets packets = {",
            "    &mission_packet_functions, kinds, sizeof kinds / sizeof kinds[0], scratch};"] if rows else []


def packet_lanes(boards: Sequence[Board]) -> dict[str, str]:
    """The MissionQueue of the snorkels of commands and telemetry that there are, as C."""
    return {snorkel.carries: f"{{{i}u, {board.name.upper()}_LANE_{snorkel.lanes[0].name.upper()}}}"
            for i, board in enumerate(boards) for snorkel in board.snorkels if snorkel.carries in PACKETS}


def message(struct: _core.Struct, declared: str, before: Sequence[str] = ()) -> list[str]:
    """Lines that define a RegisterMessage."""
    runs = byte_runs(struct.fields)
    rows = ", ".join(f"{{{width}u, {n}u}}" for width, n in runs)
    return ["", f"static const RegisterRun runs_{struct.name}[] = {{{rows}}};", *before,
            f'{declared} = {{"{struct.name}", {struct.size}u, {len(runs)}u,', f"    runs_{struct.name}}};"]
