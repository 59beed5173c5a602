# SPDX-License-Identifier: Apache-2.0
"""Writes a board in C99: a header with addresses, fields and accessors for flight, and the tables for both sides.

Flight takes or gets the lanes that it reads, and puts or sets the lanes that it writes.
"""
from __future__ import annotations

from introspect.emit.ctext import string
from registers.description import NUMBERS, Board, Descriptor, Field, Lane, Snorkel

_W = "const RegisterWindow *w"


def emit(board: Board) -> dict[str, str]:
    return {f"{board.name}.h": _header(board), f"{board.name}.c": _tables(board)}


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("/*", "/ *").replace("\n", " ").strip()


def _constants(board: Board) -> list[tuple[str, int, str]]:
    """(name, value, meaning) of the addresses, sizes and fields."""
    upper = board.name.upper()
    rows = [(f"{upper}_BASE", board.base, "where flight's processor finds the board"),
            (f"{upper}_SIZE", board.size, "[bytes]")]
    if board.clock is not None:
        rows.append((f"{upper}_CLOCK", board.clock, "from the base, as all below"))
    if board.slave:
        rows.append((f"{upper}_SLAVE_CLOCK", board.slave.address, "registers/clock.h"))
    rows += [(f"{upper}_INTERRUPT_{line.upper()}", i, "line") for i, line in enumerate(board.lines)]
    for snorkel in board.snorkels:
        for lane in snorkel.lanes:
            name = f"{upper}_{lane.name.upper()}"
            rows.append((f"{name}_ADDRESS", lane.address, snorkel.doc))
            if lane.descriptor.address is not None:
                rows.append((f"{name}_DESCRIPTORS", lane.descriptor.address, f"{lane.depth} words"))
            if lane.form != "word":
                rows.append((f"{name}_CAPACITY", lane.capacity, "[bytes]"))
            if lane.count > 1:
                rows.append((f"{name}_COUNT", lane.count, "words"))
        for f in snorkel.fields:
            name = f"{upper}_{snorkel.name.upper()}_{f.name.upper()}"
            scale = f"{f.scale!r} per count, from {f.offset!r}"
            rows += [(f"{name}_AT", f.at, f"[{f.unit}] {f.doc}"), (f"{name}_COUNT", f.count, f"{f.type}, {scale}")] \
                if f.type else [(f"{name}_LSB", f.lsb, f"[{f.unit}] {f.doc}"), (f"{name}_BITS", f.bits, scale)]
    return rows


def _header(board: Board) -> str:
    upper, rows = board.name.upper(), _constants(board)
    headers = {"registers/clock.h", "registers/field.h", "registers/message.h",
               *(s.header for s in board.snorkels if s.header)}
    width = max(len(name) for name, _, _ in rows)
    defines = "".join(f"#define {name:{width}} {value:#x}u"
                      f"{comment and f' /* {_comment(comment)} */'}\n"
                      for name, value, comment in rows)
    lanes = "".join(f"    {upper}_LANE_{lane.name.upper()} = {i},\n"
                    for i, lane in enumerate(board.lanes))
    accessors = "".join(_accessors(board, s) for s in board.snorkels)
    return f"""/* {_comment(board.doc or board.name)}
 * Written by registers from {_comment(board.file)}: do not edit. */
#ifndef BOARD_{upper}_H
#define BOARD_{upper}_H

{"".join(f'#include "{h}"{chr(10)}' for h in sorted(headers))}
#ifdef __cplusplus
extern "C" {{
#endif

{defines}
/* The lanes' places in {board.name}.lanes. */
enum {{
{lanes}    {upper}_LANES = {len(board.lanes)}
}};

extern const RegisterBoard {board.name};
{accessors}
#ifdef __cplusplus
}}
#endif

#endif
"""


def _function(result: str, name: str, arguments: str, body: str, doc: str) -> str:
    about = f"\n/* {doc} */" if doc else ""
    return f"{about}\nstatic inline {result} {name}({arguments})\n{{\n{body}}}\n"


def _accessors(board: Board, snorkel: Snorkel) -> str:
    parts = []
    if snorkel.message:
        name = snorkel.message
        parts.append(
            f"\n/* Generated from the header of {name}. */\n"
            f"extern const RegisterMessage fledge_message_{name};\n"
            f"typedef char {board.name}_{snorkel.name}_is_of_the_size_of_{name}\n"
            f"    [sizeof({name}) == {snorkel.message_size}u ? 1 : -1];\n")
    for lane in snorkel.lanes:
        parts.append(_lane_accessors(board, snorkel, lane))
    return "".join(parts)


def _lane_accessors(board: Board, snorkel: Snorkel, lane: Lane) -> str:
    table = f"&{board.name}.lanes[{board.name.upper()}_LANE_{lane.name.upper()}]"
    name = f"{board.name}_{snorkel.name}"
    doc = _comment(snorkel.doc)
    verb = "put" if lane.from_flight else "take"
    if lane.form == "word" and not lane.queued:
        return _word_accessors(name, table, lane, doc)
    if lane.form == "word":
        value = "value" if lane.from_flight else "*value"
        return _function("RegisterStatus", f"{name}_{verb}", f"{_W}, uint32_t {value}",
                         f"    return register_{verb}_word(w, {table}, 0u, value);\n", doc)
    if lane.form == "message":
        const, info, more = ("const ", "", "") if lane.from_flight else ("", ", RegisterInfo *info", ", info")
        arguments, type_ = ((f"{const}{snorkel.message} *message", f"&fledge_message_{snorkel.message}")
                            if snorkel.message else (f"const RegisterMessage *type, {const}void *message", "type"))
        return _function("RegisterStatus", f"{name}_{verb}", f"{_W}, {arguments}{info}",
                         f"    return register_{verb}_message(w, {table},\n        {type_}, message{more});\n", doc)
    if lane.from_flight:
        return _function("RegisterStatus", f"{name}_put",
                         f"{_W}, const void *bytes, uint32_t n,\n    uint32_t tag",
                         f"    return register_put(w, {table}, bytes, n, tag);\n", doc)
    return _function("RegisterStatus", f"{name}_take",
                     f"{_W}, void *bytes, uint32_t room,\n    RegisterInfo *info",
                     f"    return register_take(w, {table}, bytes, room, info);\n", doc)


def _word_accessors(name: str, table: str, lane: Lane, doc: str) -> str:
    """For words that are not queued: the word, and each field in its unit. A setter of a field keeps the other fields
    of the word that flight has written last."""
    index, i = (", uint32_t index", "index") if lane.count > 1 else ("", "0u")
    load = f"    uint32_t word = 0u;\n    (void)register_take_word(w, {table}, {i}, &word);\n"
    parts = []
    if lane.from_flight:
        parts.append(_function("void", f"{name}_set_word", f"{_W}{index}, uint32_t word",
                               f"    (void)register_put_word(w, {table}, {i}, word);\n", doc))
    else:
        parts.append(_function("uint32_t", f"{name}_word", f"{_W}{index}",
                               f"{load}    return word;\n", doc))
    for k, f in enumerate(lane.fields):
        field = f"{table[1:]}.fields[{k}]"
        about = _comment(f"[{f.unit}] {f.doc}")
        if lane.from_flight:
            parts.append(_function(
                "int", f"{name}_set_{f.name}", f"{_W}{index}, double value",
                f"    int saturated = 0;\n"
                f"    const RegisterField *field = &{field};\n"
                f"    const int64_t count = register_field_quantise(field, value, &saturated);\n"
                f"{load}"
                f"    word = register_field_place(field, word, count);\n"
                f"    (void)register_put_word(w, {table}, {i}, word);\n"
                f"    return saturated;\n", f"{about}; 1: beyond the range, and held at its end"))
        else:
            parts.append(_function(
                "double", f"{name}_{f.name}", f"{_W}{index}",
                f"    const RegisterField *field = &{field};\n{load}"
                f"    return register_field_value(field, register_field_count(field, word));\n",
                about))
    return "".join(parts)


def _tables(board: Board) -> str:
    parts = [f"/* The tables of {board.name}.\n"
             f" * Written by registers from {_comment(board.file)}: do not edit. */\n"
             f'#include "{board.name}.h"\n']
    for snorkel in board.snorkels:
        for lane in snorkel.lanes:
            if lane.fields:
                rows = "".join(_field(f) for f in lane.fields)
                parts.append(f"\nstatic const RegisterField fields_{lane.name}[] = {{\n{rows}}};\n")
            if lane.add:
                row = ", ".join(f"{b}u" for b in lane.add)
                parts.append(f"\nstatic const uint8_t head_{lane.name}[] = {{{row}}};\n")
    lanes = "".join(_lane(board, lane) for lane in board.lanes)
    if lanes:
        parts.append(f"\nstatic const RegisterLane lanes[] = {{\n{lanes}}};\n")
    if board.slave:
        s = board.slave
        parts.append(f"\nstatic const RegisterSlave slave = {{\n    {s.address:#x}u, {_line(board, s.interrupt)}, "
                     f"INT64_C({s.start}), INT64_C({s.pulse}),\n    {s.drift}, {s.slew},\n}};\n")
    members = [
        ("name", string(board.name)),
        ("hash", f"UINT64_C({board.hash:#018x})"),
        ("base", f"UINT64_C({board.base:#x})"),
        ("size", f"{board.size:#x}u"),
        ("big_endian", f"{int(board.order == 'big')}u"),
        ("clock", _address(board.clock)),
        ("clock_interrupt", str(_line(board, board.clock_interrupt))),
        ("interrupts", _address(board.interrupts)),
        ("n_interrupts", f"{len(board.lines)}u"),
        ("level", f"{board.level}u"),
        ("n_lanes", f"{len(board.lanes)}u"),
        ("lanes", "lanes" if lanes else "0"),
        ("slave", "&slave" if board.slave else "0"),
    ]
    body = "".join(f"    .{key} = {value},\n" for key, value in members)
    parts.append(f"\nconst RegisterBoard {board.name} = {{\n{body}}};\n")
    return "".join(parts)


def _address(address: int | None) -> str:
    return "REGISTER_NOWHERE" if address is None else f"{address:#x}u"


def _line(board: Board, name: str | None) -> int:
    return board.lines.index(name) if name else -1


def _field(f: Field) -> str:
    return (f"    {{.name = {string(f.name)}, .unit = {string(f.unit)}, .scale = {f.scale!r}, "
            f".offset = {f.offset!r},\n     .lsb = {f.lsb}u, .bits = {f.bits}u, "
            f".is_signed = {int(f.signed)}u{_packed(f)}}},\n")


def _packed(f: Field) -> str:
    return "" if f.type is None else (
        f", .is_float = {int(NUMBERS[f.type][2])}u,\n     .at = {f.at}u, .count = {f.count}u, "
        f".little_endian = {int(f.order == 'little')}u, .tag = {f.tag}u")


def _lane(board: Board, lane: Lane) -> str:
    flags = [name for name, holds in (("FROM_FLIGHT", lane.from_flight), ("QUEUED", lane.queued),
                                      ("VARIABLE", lane.variable), ("OVERWRITE", lane.overwrite))
             if holds]
    d: Descriptor = lane.descriptor
    bits = ", ".join(f"{v}u" for part in (d.length, d.tag, d.valid) for v in part)
    head = f"head_{lane.name}" if lane.add else "0"
    members = [
        ("name", string(lane.name)),
        ("form", f"REGISTER_{lane.form.upper()}"),
        ("flags", " | ".join(f"REGISTER_{flag}" for flag in flags) or "0u"),
        ("address", f"{lane.address:#x}u"),
        ("descriptors", _address(d.address)),
        ("capacity", f"{lane.capacity}u"),
        ("stride", f"{lane.stride}u"),
        ("depth", f"{lane.depth}u"),
        ("count", f"{lane.count}u"),
        ("interrupt", str(_line(board, lane.interrupt))),
        ("descriptor", f"{{{bits}}}"),
        ("outside", f"{{{lane.remove}u, {len(lane.add)}u, {head}, {lane.unit}u, "
                    f"{int(lane.swap)}u}}"),
        ("n_fields", f"{len(lane.fields)}u"),
        ("fields", f"fields_{lane.name}" if lane.fields else "0"),
    ]
    return "    {" + ",\n     ".join(f".{key} = {value}" for key, value in members) + "},\n"
