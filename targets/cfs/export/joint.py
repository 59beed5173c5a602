# SPDX-License-Identifier: Apache-2.0
"""Where an app's C, the same for all missions, meets the one that it flies."""
from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from fledge.export.c_source import row
from fledge.export.c_text import comment
from fledge.targets.cfs.export.app import has_files, services
from fledge.targets.cfs.export.packets import guarded
from fledge.targets.cfs.export.tables import HEAD_SIZE, Table, described, layout_checks
from fledge.export.read import ExportError

if TYPE_CHECKING:
    from fledge.targets.cfs.export.app import App
    from fledge.export.read import Mission
    from registers.description import Board


def step(mission: Mission) -> int:
    """[ns] The widest grid that has all of flight's instants."""
    return math.gcd(*(n for task in mission.tasks for n in (task.period, task.offset)))


def kept(mission: Mission, app: App) -> list[tuple[str, str, str]]:
    """(member, offset, size) of what outlives the app, as C: of a module its parameters and its memory."""
    ranges = []
    for what in app.keep:
        if what != "parameters" and what not in [m.path for m in mission.modules]:
            raise ExportError(f"--keep {what}: {mission.title} has no such module; keep parameters, or any of "
                              f"{', '.join(m.path for m in mission.modules)}")
    for module in mission.modules:
        for group in ("par", "mem"):
            if module.fields(group) and (module.path in app.keep or group == "par" and "parameters" in app.keep):
                member = f"{module.name}.{group}"
                ranges.append((member, f"offsetof({mission.struct()}, {member})",
                              f"sizeof((({mission.struct()} *)0)->{member})"))
    return ranges


def header(mission: Mission, app: App, tables: Sequence[Table], boards: Sequence[Board], watched: bool = False) -> str:
    prefix, upper = app.prefix, mission.name.upper()
    longest_table = HEAD_SIZE + max((len(t.content) for t in tables), default=0)
    return guarded(app, "mission", f"What {prefix} flies: {mission.title}.", [
        '#include "cfe.h"', "", f'#include "{mission.name}.h"',
        *([f'#include "{mission.name}_io.h"'] if boards else []), f'#include "{mission.name}_commands.h"', "",
        f"typedef {mission.struct()} {prefix}_Mission_t;", "",
        *(['#include "targets/cfs/watch.h"', f"#define {prefix}_WATCH fledge_watch", ""] if watched else []),
        f"#define {prefix}_MESSAGES {upper}_MESSAGES",
        f"#define {prefix}_INPUTS {len(mission.inputs)}u /* the first of the messages */",
        f"#define {prefix}_STEP_NS INT64_C({step(mission)}) /* between two wake-ups */",
        f"#define {prefix}_BOARDS {len(boards)}",
        f"#define {prefix}_TIMER {int(app.timer)} /* 1: the app wakes itself */",
        f"#define {prefix}_FILES {int(has_files(mission) and not watched)} /* 1: files are in cFE's file system */",
        *keeping(mission, app),
        f"#define {prefix}_TABLES {len(tables)}",
        f"#define {prefix}_TABLE_HEAD {HEAD_SIZE} /* [bytes] in front of the parameters */",
        f"#define {prefix}_LONGEST_TABLE {longest_table} /* [bytes] */", "",
        "/** The parameters of a module as a table. */", f"typedef struct {prefix}_Table {{",
        "    const char *Name; /* as the bus knows it, without the app's */",
        "    const char *File; /* what it is loaded from at the start */",
        "    uint32 Layout;    /* what its first word must be */",
        "    int32 (*Validate)(void *Content);", f"}} {prefix}_Table_t;", "",
        f"extern const {prefix}_Table_t {prefix}_Tables[{prefix}_TABLES + 1];", "",
        "/** The message ids of inputs, and of flight's telemetry, in their orders. */",
        f"extern CFE_SB_MsgId_Atom_t {prefix}_InputIds[{prefix}_INPUTS + 1];",
        f"extern CFE_SB_MsgId_Atom_t {prefix}_TelemetryIds[];", f"void {prefix}_FindIds(void);", "",
        "/** Look at what a table shall hold: CFE_SUCCESS, or an error after an event. */",
        f"int32 {prefix}_ValidateTable(uint32 Index, const void *Content);", ""])


def keeping(mission: Mission, app: App) -> list[str]:
    prefix, ranges = app.prefix, kept(mission, app)
    lines = [f"#define {prefix}_KEPT {len(ranges)}"]
    if ranges:
        layout = [(m.path, described(m.fields(group))) for m in mission.modules for group in ("par", "mem")
                  if f"{m.name}.{group}" in [name for name, _, _ in ranges]]
        lines += [f"#define {prefix}_KEPT_LAYOUT 0x{zlib.crc32(repr(layout).encode()):08X}u",
                  f"#define {prefix}_KEPT_BYTES ( \\", *(f"    {size} + \\" for _, _, size in ranges), "    0)",
                  "", "/** A part of flight's memory that is kept. */", f"typedef struct {prefix}_Range {{",
                  "    uint32 Offset;", "    uint32 Size;", f"}} {prefix}_Range_t;",
                  f"extern const {prefix}_Range_t {prefix}_Kept[{prefix}_KEPT];", ""]
    return lines


def source(mission: Mission, app: App, tables: Sequence[Table]) -> str:
    prefix = app.prefix
    lines = ["/* SPDX-License-Identifier: Apache-2.0 */",
             *comment(f"What is {mission.title}'s own in {prefix}: its tables and message ids."),
             f'#include "{app.name}_mission.h"', f'#include "{app.name}_msgids.h"', f'#include "{app.name}_tbl.h"', "",
             "#include <stddef.h>", "",
             "/* A table is the bytes of its module's parameters: a compiler refuses another layout. */",
             "#define SAME(a, b, name) typedef char same_##name[(a) == (b) ? 1 : -1]",
             *layout_checks(app, tables), ""]
    for i, table in enumerate(tables):
        lines += [f"static int32 Validate{table.name}(void *Content)", "{",
                  f"    return {prefix}_ValidateTable({i}, Content);", "}", ""]
    lines += [f"const {prefix}_Table_t {prefix}_Tables[{prefix}_TABLES + 1] = {{"]
    for table in tables:
        lines += row(f'"{table.name}"', f'"{table.file}"', f"{prefix}_{table.name.upper()}_LAYOUT",
                     f"Validate{table.name}")
    lines += ["    {NULL, NULL, 0, NULL},", "};", ""]
    if kept(mission, app):
        lines += [f"const {prefix}_Range_t {prefix}_Kept[{prefix}_KEPT] = {{",
                  *(f"    {{{offset}, {size}}}," for _, offset, size in kept(mission, app)), "};", ""]
    # In the place of texts, which this target does not send, its housekeeping.
    telemetry = ["FLIGHT", "REPORT", *(m.name.upper() for m in mission.outputs), "HK", *services(mission)]
    inputs = [f"{m.name.upper()}_IN" for m in mission.inputs]
    lines += [f"CFE_SB_MsgId_Atom_t {prefix}_InputIds[{prefix}_INPUTS + 1];",
              f"CFE_SB_MsgId_Atom_t {prefix}_TelemetryIds[{len(telemetry)}];", "",
              "/* Data sheets make ids of topics while the core runs. */", f"void {prefix}_FindIds(void)", "{",
              *(f"    {prefix}_InputIds[{i}] = {prefix}_{name}_MID;" for i, name in enumerate(inputs)),
              *(f"    {prefix}_TelemetryIds[{i}] = {prefix}_{name}_TLM_MID;" for i, name in enumerate(telemetry)),
              "}", ""]
    return "\n".join(lines)
