# SPDX-License-Identifier: Apache-2.0
"""Writes the documentation of a board in Markdown: its addresses, lanes and fields."""
from __future__ import annotations

from registers.description import Board, Lane, Snorkel


def emit(board: Board) -> dict[str, str]:
    parts = [f"# {board.name}\n\n", f"{board.doc}\n\n" if board.doc else "",
             f"Base {board.base:#010x}, {board.size:#x} bytes, {board.order}-endian words. "
             f"Addresses are relative to the base. Written from {board.file}.\n\n",
             "| address | snorkel | flight | form | depth | bytes | interrupt | meaning |\n"
             "|---|---|---|---|---|---|---|---|\n"]
    rows: list[tuple] = []
    if board.clock is not None:
        rows.append((board.clock, "clock", "reads", "tick, time, step", "", "32",
                     board.clock_interrupt or "", "simulated time"))
    if board.slave:
        rows.append((board.slave.address, "slave clock", "both", "time, pulses, commands", "", "48",
                     board.slave.interrupt or "", f"drifts by {board.slave.drift / 1e3:g} ppm"))
    if board.interrupts is not None:
        rows.append((board.interrupts, "interrupts", "both", "counters", "",
                     str(8 * len(board.lines)), "", ", ".join(board.lines)
                     + (f"; level {board.level} of the processor" if board.level else "")))
    for snorkel in board.snorkels:
        rows += [_row(snorkel, lane) for lane in snorkel.lanes]
        rows += [(lane.descriptor.address, f"{lane.name}: descriptors", "", "words",
                  str(lane.depth), str(4 * lane.depth), "", "") for lane in snorkel.lanes
                 if lane.descriptor.address is not None]
    for row in sorted(rows):
        parts.append("| " + " | ".join([f"{row[0]:#06x}", *map(_cell, row[1:])]) + " |\n")
    parts += [_fields(snorkel, lane) for snorkel in board.snorkels for lane in snorkel.lanes
              if lane.fields and (lane is snorkel.lanes[0] or lane.fields is not snorkel.lanes[0].fields)]
    return {f"{board.name}.md": "".join(parts)}


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _row(snorkel: Snorkel, lane: Lane) -> tuple:
    form = snorkel.message or lane.form
    notes = [snorkel.doc] if snorkel.doc else []
    if lane.remove:
        notes.append(f"the outside's end removes {lane.remove} bytes")
    if lane.add:
        notes.append(f"it adds {bytes(lane.add).hex(' ')}")
    if lane.swap:
        notes.append(f"it swaps units of {lane.unit} bytes")
    policy = "overwrite" if lane.overwrite else "refuse"
    depth = f"{lane.depth}, {policy}" if lane.queued else "last"
    size = f"up to {lane.capacity}" if lane.variable else str(lane.capacity)
    if lane.form == "word":
        size = f"{lane.count} x 4" if lane.count > 1 else "4"
    return (lane.address, lane.name, "writes" if lane.from_flight else "reads", form, depth, size,
            lane.interrupt or "", "; ".join(notes))


def _fields(snorkel: Snorkel, lane: Lane) -> str:
    """Of one direction; of both, if they have the same ones."""
    packet = lane.form == "packet"
    name = snorkel.name if lane.fields == snorkel.fields else lane.name
    head = (f"\n## {name}\n\n| {'bytes, tag' if packet else 'bits'} | field | value | range | meaning |\n"
            "|---|---|---|---|---|\n")
    rows = []
    for f in lane.fields:
        low, high = sorted(f.offset + f.scale * count for count in (f.low, f.high))
        value = f"{f.scale:g} {f.unit} per count, from {f.offset:g}" if (f.scale, f.offset) != (1.0, 0.0) else f.unit
        if packet:
            count = f"{f.count} x " if f.count > 1 else ""
            rows.append(f"| {f.at}..{f.end - 1}, {f.tag} | {f.name} | {count}{f.type}, {f.order}-endian, {value} | "
                        f"| {_cell(f.doc)} |\n")
            continue
        sign = "signed, " if f.signed else ""
        rows.append(f"| {f.lsb + f.bits - 1}..{f.lsb} | {f.name} | {sign}{value} | {low:g} to {high:g} "
                    f"| {_cell(f.doc)} |\n")
    return head + "".join(rows)
