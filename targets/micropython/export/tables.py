# SPDX-License-Identifier: Apache-2.0
"""A mission's types, memory and names as data for its script, targets/micropython/tables.h: MISSION_script.c."""
from __future__ import annotations

import binascii
import struct as packing
import sys
from collections.abc import Iterable, Sequence
from enum import EnumMeta
from typing import TYPE_CHECKING, Any

from fledge import flight, units
from fledge.commands import parameters, reversed_numbers
from fledge.export import names
from fledge.export.c_source import row, written
from fledge.export.c_text import string, wrap
from fledge.export.read import ExportError

if TYPE_CHECKING:
    from fledge import _core
    from fledge.export.read import Mission, Module

GROUPS = {"": "NONE", "in": "IN", "out": "OUT", "par": "PAR", "mem": "MEM"}


HEAP = 64 * 1024     # [bytes] of the interpreter
LARGE = 16 * 1024    # [bytes] of a module for which it has more


def emit_tables(mission: Mission, module: str, whole: bool, processes: Sequence[str], computed: bool = False,
                named: Iterable[str] = ()) -> dict[str, str]:
    """File name -> text. module: what the program imports, "nadir_spin.flight"; whole: its build(sim) builds all
    processes, or else its build(f) this one; processes: their names; computed: it has COMPUTED of script.py; named:
    names that the scripts use, among which are enumerations of fledge.flight that no field of the mission has.

    The file defines `MISSION_memory`, the mission's struct, besides fledge_script.
    """
    name = mission.name
    types = types_of(mission)
    enums = enums_of(types, named)
    largest = max((m.struct.size for m in mission.modules), default=0)      # it is made in the heap, then moved
    heap = HEAP + (largest if largest > LARGE else 0)
    tables = Tables([*written(mission), '#include "targets/micropython/tables.h"', "", f'#include "{name}_commands.h"',
                     "", f"{mission.struct()} {name}_memory;", f"static uint64_t heap[{heap // 8}];", "",
                     *type_tables(types, enums, {m.type for m in mission.modules})])
    places, inputs, constants = tables.places(mission), tables.inputs(mission), tables.constants()
    unit_names, unit_texts = tables.units(), tables.unit_texts()
    process_names = tables.texts("processes", processes, "0")
    tasks = tables.texts("tasks", [t.title for t in mission.tasks])
    modes = tables.texts("modes", [mission.mode_titles[m] for m in mission.modes])
    events = tables.texts("events", [e.title for e in mission.events])
    members = {
        "module": quoted(module), "process": quoted(mission.process), "processes": process_names, "whole": int(whole),
        "computed": int(computed), "commands": f"&{name}_commands", "memory": f"&{name}_memory",
        "size": f"sizeof {name}_memory", "heap_size": "sizeof heap", "heap": "heap", "names": "names",
        "field_units": "field_units", "enums": "enums", "types": "types", "places": places, "inputs": inputs,
        "constants": constants, "units": unit_names, "unit_texts": unit_texts, "tasks": tasks, "modes": modes,
        "events": events, "n_types": f"{len(types)}u", "n_enums": f"{len(enums)}u",
        "n_places": f"{len(mission.modules)}u",
        "n_inputs": "0u" if inputs == "0" else "sizeof inputs / sizeof *inputs",
        "n_constants": f"{len(matrices())}u", "n_units": f"{len(units.UNITS)}u",
        "n_unit_texts": f"{len(units._NAMES)}u", "n_tasks": f"{len(mission.tasks)}u",
        "n_modes": f"{len(mission.modes)}u", "n_events": f"{len(mission.events)}u"}
    lines = [*tables.lines, *wrap([f"&{t}_type," for t in types], "static const ScriptType *const types[] = {", "    ",
                                  "};"), "", "const ScriptMission fledge_script = {",
             *(f"    .{key} = {value}," for key, value in members.items()), "};", ""]
    return {f"{name}_script.c": "\n".join(lines)}


class Tables:
    """The lines of tables. Each method returns what refers to its table: the name, or "0" of an empty one."""

    def __init__(self, lines: list[str]) -> None:
        self.lines = lines

    def table(self, head: str, rows: Iterable[Sequence[object]]) -> str:
        entries = [line for items in rows for line in row(*map(str, items))]
        if entries:
            self.lines += [f"static const {head}[] = {{", *entries, "};", ""]
        return head.split()[-1] if entries else "0"

    def texts(self, name: str, these: Sequence[str], *end: str) -> str:
        if these:
            texts = [*map(quoted, these), *end]
            self.lines += wrap([*(f"{text}," for text in texts[:-1]), texts[-1]],
                               f"static const char *const {name}[] = {{", "    ", "};")
        return name if these else "0"

    def places(self, mission: Mission) -> str:
        adjustable = [m.name for m in mission.modules if parameters(m.struct)[0]]
        return self.table("ScriptPlace places", (
            (quoted(script_name(module)), f"&{module.type}_type", f"offsetof({mission.struct()}, {module.name})",
             f"{parameters(module.struct)[1]}u", adjustable.index(module.name) if module.name in adjustable else -1,
             f"{parameters_crc(module):#06x}u") for module in mission.modules))

    def inputs(self, mission: Mission) -> str:
        struct = mission.struct()
        return self.table("ScriptInput inputs", (
            (f"{i}u", f"offsetof({struct}, {wire.source})", f"offsetof({struct}, {wire.target})",
             f"sizeof((({struct} *)0)->{wire.source})", wire.stale_after)
            for i, m in enumerate(mission.modules) for wire in mission.wires[m.name] if wire.source.startswith("in.")))

    def constants(self) -> str:
        constants = matrices()
        for constant, rows in constants.items():
            self.lines += [f"static const double constant_{constant}[] = {{",
                           *(f"    {', '.join(map(repr, line))}," for line in rows), "};"]
        return self.table("ScriptConstant constants", (
            (quoted(constant), f"constant_{constant}", f"{{{len(rows)}u, {len(rows[0])}u}}")
            for constant, rows in constants.items()))

    def units(self) -> str:
        return self.table("ScriptUnitName unit_names", (
            (quoted(unit), f"{{&script_quantity_type, SCRIPT_NUMBER({bits(quantity.value)}), {braced(quantity.dims)}}}")
            for unit, quantity in ((unit, getattr(units, unit)) for unit in units.UNITS)))

    def unit_texts(self) -> str:
        return self.table("ScriptUnit unit_texts", (
            (quoted(text), braced(dims)) for dims, text in units._NAMES.items()))


def braced(numbers: Iterable[int]) -> str:
    return f"{{{', '.join(map(str, numbers))}}}"


def bits(x: float) -> str:
    """Of a double."""
    return f"{packing.unpack('=Q', packing.pack('=d', x))[0]:#018x}"


def quoted(text: str) -> str:
    return string(text.encode())


def script_name(module: Module) -> str:
    """As flight.py calls it."""
    return module.path.partition(".")[2]


def parameters_crc(module: Module) -> int:
    """command_crc of the parameters as flight.py left them, big-endian."""
    fields, start, end = parameters(module.struct)
    block = module.memory[start:end]
    return binascii.crc_hqx(reversed_numbers(fields, block, start) if sys.byteorder == "little" else block, 0xFFFF)


def matrices() -> dict[str, list[list[float]]]:
    """The constants of fledge.flight: rows of numbers, by name."""
    return {name: value for name, value in vars(flight).items() if not name.startswith("_") and isinstance(value, list)}


# --- types -----------------------------------------------------------------------------------------

def types_of(mission: Mission) -> dict[str, Any]:
    """The structs of the mission's modules, and of all that they hold, by name; what a struct holds comes before it."""
    members: dict[str, Any] = {}

    def add(struct: _core.Struct) -> None:
        if struct.name not in members:
            for f in struct.fields:
                if f.type == "struct":
                    add(f.struct)
            members[struct.name] = struct

    for module in mission.modules:
        add(module.struct)
    return members


def visible(struct: _core.Struct) -> list[Any]:
    """The fields that a script sees."""
    fields = [f for f in struct.fields if not f.spare]
    for f in fields:
        if len(f.shape) > 3 or any(n > 65535 for n in f.shape):
            raise ExportError(f"{struct.name}.{f.name} has shape {tuple(f.shape)}; a script has arrays of up to 3 "
                              "dimensions, each of up to 65535")
    if len(fields) > 254:
        raise ExportError(f"{struct.name} has {len(fields)} fields; a script has up to 254 of a struct")
    return fields


def enums_of(types: dict[str, Any], named: Iterable[str]) -> dict[str, Sequence[tuple[str, int]]]:
    """The enumerators by enumeration: of all fields that a script sees, and of what `named` has of fledge.flight."""
    enums = {f.ctype: f.enumerators for struct in types.values() for f in visible(struct) if f.type == "enum"}
    for name in sorted({*named} & {*dir(flight)} - {*enums}):
        if isinstance(known := getattr(flight, name), EnumMeta):
            enums[name] = [(member, getattr(known, member).value) for member in known.__members__]
    return enums


def type_tables(types: dict[str, Any], enums: dict[str, Sequence[tuple[str, int]]], modules: set[str]) -> list[str]:
    """What types consist of: names, units and enumerations first, each once."""
    fields = [f for struct in types.values() for f in visible(struct)]
    names_at: dict[str, int] = {}
    at = 0
    for f in fields:
        if f.name not in names_at:
            names_at[f.name] = at
            at += len(f.name) + 1
    known = list(dict.fromkeys((f.unit or "-", tuple(f.dims)) for f in fields))
    if at > 65535 or len(known) > 255:
        raise ExportError(f"the modules have {len(known)} units and {at} bytes of names of fields; a script has up to "
                          "255 and 65535")
    lines = [*wrap([f'"{name}\\0"' for name in names_at], "static const char names[] = ", "    ", ";"), "",
             "static const ScriptUnit field_units[] = {"]
    for text, dims in known:
        lines += row(quoted(text), braced(dims))
    lines += ["};", ""]
    for name, values in enums.items():
        lines += [f"static const ScriptEnumerator {name}_values[] = {{"]
        for enumerator, value in values:
            lines += row(quoted(enumerator), str(value))
        lines += ["};"]
    lines += ["static const ScriptEnum enums[] = {",
              *(f'    {{&script_enum_type, "{name}", {name}_values, {len(values)}u}},'
                for name, values in enums.items()), "};", ""]
    places, enum_places = list(types), list(enums)
    for name, struct in types.items():
        members = visible(struct)
        lines += [f"static const ScriptField {name}_fields[] = {{"]
        for f in members:
            of = places.index(f.struct.name) if f.type == "struct" else enum_places.index(f.ctype) if (
                f.type == "enum") else 0
            count = next((f"{i}u" for i, member in enumerate(members) if member.name == f.count), "SCRIPT_NO_FIELD")
            line, = row(f"{f.offset}u", f"{names_at[f.name]}u", f"{of}u",
                        f"{{{', '.join(f'{n}u' for n in f.shape or (0,))}}}", f"FLEDGE_{f.type.upper()}",
                        f"SCRIPT_{GROUPS[f.group]}", "SCRIPT_REQUIRED" if f.required else "0u", f"{len(f.shape)}u",
                        f"{known.index((f.unit or '-', tuple(f.dims)))}u", count)
            lines += [f"{line} /* {f.name} */"]
        function = names.snake(name)
        calls = [f"(void (*)(void *)){function}_reset", f"(void (*)(void *, Tick)){function}_update"]
        head = ["&script_class_type,", f"{quoted(name)},", f"{name}_fields,", f"{len(members)}u,", f"sizeof({name}),"]
        lines += ["};", *wrap([*head, *([f"{calls[0]},", calls[1]] if name in modules else ["0,", "0"])],
                              f"static const ScriptType {name}_type = {{", "    ", "};"), ""]
    return lines
