# SPDX-License-Identifier: Apache-2.0
"""A mission's types, memory and names as data for its script, targets/micropython/tables.h: MISSION_script.c."""
from __future__ import annotations

import binascii
import struct as packing
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from fledge import flight, units
from fledge.commands import parameters, reversed_numbers
from fledge.export import names
from fledge.export.c_source import row, written
from fledge.export.c_text import string, wrap

if TYPE_CHECKING:
    from fledge.export.read import Mission, Module

GROUPS = {"": "NONE", "in": "IN", "out": "OUT", "par": "PAR", "mem": "MEM"}


HEAP = 64 * 1024     # [bytes] of the interpreter


def emit_tables(mission: Mission, module: str, whole: bool, processes: Sequence[str]) -> dict[str, str]:
    """File name -> text. module: what the program imports, "nadir_spin.flight"; whole: its build(sim) builds all
    processes, or else its build(f) this one; processes: their names.

    The file defines `MISSION_memory`, the mission's struct, besides fledge_script.
    """
    name, struct = mission.name, mission.struct()
    types = types_of(mission)
    blocks: dict[str, int] = {}
    for one in mission.modules:
        if parameters(one.struct)[0]:
            blocks[one.name] = len(blocks)
    lines = [*written(mission), '#include "targets/micropython/tables.h"', "", f'#include "{name}_commands.h"', "",
             f"{struct} {name}_memory;", f"static uint64_t heap[{HEAP // 8}];", "",
             *type_tables(types, {m.type for m in mission.modules})]

    def table(head: str, rows: Iterable[Sequence[Any]]) -> str:
        """The lines of a table, and what refers to it: "0" of an empty one."""
        found = [line for items in rows for line in row(*map(str, items))]
        if found:
            lines.extend([f"static const {head}[] = {{", *found, "};", ""])
        return head.split()[-1] if found else "0"

    places = table("ScriptPlace places", (
        (quoted(script_name(one)), f"&{one.type}_type", f"offsetof({struct}, {one.name})",
         f"{parameters(one.struct)[1]}u", blocks.get(one.name, -1), f"{parameters_crc(one):#06x}u")
        for one in mission.modules))
    inputs = table("ScriptInput inputs", (
        (f"{i}u", f"offsetof({struct}, {wire.source})", f"offsetof({struct}, {wire.target})",
         f"sizeof((({struct} *)0)->{wire.source})", wire.stale_after)
        for i, one in enumerate(mission.modules) for wire in mission.wires[one.name] if wire.source.startswith("in.")))
    constants = matrices()
    for constant, rows in constants.items():
        lines += [f"static const double constant_{constant}[] = {{",
                  *(f"    {', '.join(map(repr, line))}," for line in rows), "};"]
    shapes = table("ScriptConstant constants", (
        (quoted(constant), f"constant_{constant}", f"{{{len(rows)}u, {len(rows[0])}u}}")
        for constant, rows in constants.items()))
    unit_names = table("ScriptUnitName unit_names", (
        (quoted(unit), f"{{&script_quantity_type, SCRIPT_NUMBER({bits(one.value)}), {braced(one.dims)}}}")
        for unit, one in ((unit, getattr(units, unit)) for unit in units.UNITS)))
    unit_texts = table("ScriptUnit unit_texts", (
        (quoted(text), braced(dims)) for dims, text in units._NAMES.items()))

    def list_of(what: str, these: Sequence[str], *end: str) -> str:
        if these:
            texts = [*map(quoted, these), *end]
            lines.extend(wrap([*(f"{one}," for one in texts[:-1]), texts[-1]],
                              f"static const char *const {what}[] = {{", "    ", "};"))
        return what if these else "0"

    process_names = list_of("processes", processes, "0")
    tasks = list_of("tasks", [t.title for t in mission.tasks])
    modes = list_of("modes", [mission.mode_titles[m] for m in mission.modes])
    events = list_of("events", [e.title for e in mission.events])
    lines += [*wrap([f"&{t}_type," for t in types], "static const ScriptType *const types[] = {", "    ", "};"), "",
              "const ScriptMission fledge_script = {"]
    lines += [f"    .{key} = {value}," for key, value in (
        ("module", quoted(module)), ("process", quoted(mission.process)), ("processes", process_names),
        ("whole", int(whole)), ("commands", f"&{name}_commands"), ("memory", f"&{name}_memory"),
        ("size", f"sizeof {name}_memory"), ("heap_size", "sizeof heap"), ("heap", "heap"),
        ("types", "types"), ("places", places), ("inputs", inputs), ("constants", shapes),
        ("units", unit_names), ("unit_texts", unit_texts), ("tasks", tasks), ("modes", modes), ("events", events),
        ("n_types", f"{len(types)}u"), ("n_places", f"{len(mission.modules)}u"),
        ("n_inputs", "0u" if inputs == "0" else "sizeof inputs / sizeof *inputs"),
        ("n_constants", f"{len(constants)}u"), ("n_units", f"{len(units.UNITS)}u"),
        ("n_unit_texts", f"{len(units._NAMES)}u"), ("n_tasks", f"{len(mission.tasks)}u"),
        ("n_modes", f"{len(mission.modes)}u"), ("n_events", f"{len(mission.events)}u"))]
    return {f"{name}_script.c": "\n".join([*lines, "};", ""])}


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
    found: dict[str, Any] = {}

    def add(struct: Any) -> None:
        if struct.name not in found:
            for f in struct.fields:
                if f.type == "struct":
                    add(f.struct)
            found[struct.name] = struct

    for module in mission.modules:
        add(module.struct)
    return found


def visible(struct: Any) -> list[Any]:
    """The fields that a script sees. 255 is no index: SCRIPT_NO_FIELD."""
    fields = [f for f in struct.fields if not f.spare]
    assert len(fields) < 255, struct.name
    return fields


def type_tables(types: dict[str, Any], modules: set[str]) -> list[str]:
    """What types consist of: units and enumerations first, each once."""
    fields = [f for struct in types.values() for f in visible(struct)]
    known: dict[tuple[str, tuple[int, ...]], int] = {}
    for f in fields:
        known.setdefault((f.unit or "-", tuple(f.dims)), len(known))
    enums = {f.ctype: f.enumerators for f in fields if f.type == "enum"}
    lines = ["static const ScriptUnit units[] = {"]
    for text, dims in known:
        lines += row(quoted(text), braced(dims))
    lines += ["};", ""]
    for name, values in enums.items():
        lines += [f"static const ScriptEnumerator {name}_values[] = {{"]
        for enumerator, value in values:
            lines += row(quoted(enumerator), str(value))
        lines += ["};", f'static const ScriptEnum {name}_enum = {{"{name}", {name}_values, {len(values)}u}};', ""]
    for name, struct in types.items():
        members = visible(struct)
        lines += [f"static const ScriptField {name}_fields[] = {{"]
        for f in members:
            count = next((f"{i}u" for i, one in enumerate(members) if one.name == f.count), "SCRIPT_NO_FIELD")
            lines += row(
                quoted(f.name), f"&{f.struct.name}_type" if f.type == "struct" else "0",
                f"&{f.ctype}_enum" if f.type == "enum" else "0", f"&units[{known[f.unit or '-', tuple(f.dims)]}]",
                f"{f.offset}u", f"{{{', '.join(f'{n}u' for n in f.shape or (0,))}}}", f"FLEDGE_{f.type.upper()}",
                f"SCRIPT_{GROUPS[f.group]}", "SCRIPT_REQUIRED" if f.required else "0u", f"{len(f.shape)}u", count)
        function = names.snake(name)
        calls = [f"(void (*)(void *)){function}_reset", f"(void (*)(void *, Tick)){function}_update"]
        head = ["&script_class_type,", f"{quoted(name)},", f"{name}_fields,", f"{len(members)}u,", f"sizeof({name}),"]
        lines += ["};", *wrap([*head, *([f"{calls[0]},", calls[1]] if name in modules else ["0,", "0"])],
                              f"static const ScriptType {name}_type = {{", "    ", "};"), ""]
    return lines
