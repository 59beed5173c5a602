# SPDX-License-Identifier: Apache-2.0
"""The files around an app's C: its build, what a tree needs to know of it, and how to get it there."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.export.cfs.app import CMD, App
from fledge.export.cfs.tables import HEAD_SIZE, Table

if TYPE_CHECKING:
    from fledge.export.read import Mission

STACK, PRIORITY = 16384, 55
ROOT = Path(__file__).resolve().parents[4]


def cmake(app: App, sources: Sequence[str], tables: Sequence[Table]) -> str:
    """CMakeLists.txt"""
    listed = "\n".join(f"    fsw/src/{path}" for path in sources)
    lines = ["# SPDX-License-Identifier: Apache-2.0", f"project(CFE_{app.prefix} C)", "",
             "include_directories(fsw/inc fsw/src)", "", f"add_cfe_app({app.name}", listed + ")",
             f"target_include_directories({app.name} PUBLIC fsw/inc)", "",
             "# The same bits on every machine: each operation is rounded once.",
             f"target_compile_options({app.name} PRIVATE -ffp-contract=off -fno-math-errno)",
             "# A 32-bit x86 has them with its vector unit only.",
             "if(CMAKE_SIZEOF_VOID_P EQUAL 4 AND CMAKE_SYSTEM_PROCESSOR MATCHES \"86\")",
             f"    target_compile_options({app.name} PRIVATE -msse2 -mfpmath=sse)", "endif()",
             "# Without optimisation sqrt is a call: of an app that is loaded, or of the core that it is linked with.",
             "if(UNIX)", f"    set_property(TARGET {app.name} APPEND PROPERTY LINK_LIBRARIES m)",
             f"    set_property(TARGET {app.name} APPEND PROPERTY INTERFACE_LINK_LIBRARIES m)", "endif()"]
    if tables:
        lines += ["", f"add_cfe_tables({app.name}", "\n".join(f"    fsw/tables/{t.stem}.c" for t in tables) + ")"]
    return "\n".join([*lines, ""])


def startup(app: App) -> str:
    return f"CFE_APP, {app.name}, {app.prefix}_AppMain, {app.prefix}, {PRIORITY}, {STACK}, 0x0, 0;\n"


def targets(app: App) -> str:
    return f"list(APPEND cpu1_APPLIST {app.name})\n"


def schedule(app: App) -> str:
    """Entries for sch_lab's table. The app makes its wake-ups itself."""
    mid = f"{app.prefix}_SEND_HK_MID"
    return "\n".join(["/* SPDX-License-Identifier: Apache-2.0 */",
                      f"/* For fsw/tables/sch_lab_table.c: {app.prefix}'s housekeeping every second (TickRate 100).",
                      " * Above:", " *", f' *     #include "{app.name}_msgids.h"', " *",
                      " * and in the table, of Draco and 7.x, where an entry has a function code: */",
                      f"{{CFE_SB_MSGID_WRAP_VALUE({mid}), 100, 0}},", "",
                      "/* or of Caelum, where the rate counts seconds:", " *",
                      f" *     {{CFE_SB_MSGID_WRAP_VALUE({mid}), 1}},", " */", ""])


def pocket_sources() -> list[Path]:
    """The pocket cFE and its host, to compile beside an app."""
    return sorted(file for file in (ROOT / "targets/cfs").glob("*.c") if file.name != "watch.c")


def app_list(apps: Sequence[App]) -> str:
    """The C file with the table of the apps that the host can start."""
    return "\n".join(["/* SPDX-License-Identifier: Apache-2.0 */", '#include "targets/cfs/pocket.h"', "",
                      *(f"void {app.prefix}_AppMain(void);" for app in apps), "",
                      "extern const PocketApp fledge_apps[];", "extern const uint32 fledge_apps_n;",
                      "const PocketApp fledge_apps[] = {",
                      *(f'    {{"{app.prefix}_AppMain", {app.prefix}_AppMain}},' for app in apps), "};",
                      f"const uint32 fledge_apps_n = {len(apps)};", ""])


def readme(mission: Mission, app: App, found: Sequence[Table]) -> str:
    prefix, name = app.prefix, app.name
    ids = app.ids(mission)
    tables = "\n".join(f"| `{prefix}.{t.name}` | {t.module.path}: {t.module.type} | {HEAD_SIZE + len(t.content)} | "
                       f"`{t.file}` |" for t in found)
    packets = "\n".join(f"| {ids[f'{prefix}_{m.name.upper()}_TLM_MID']:#06x} | {m.path} | {m.struct.name} | "
                        f"{16 + m.struct.size} |" for m in mission.outputs)
    boards = f"`fsw/src/{mission.name}_io.c`"
    return f"""# {prefix}: {mission.title} as an app of the core Flight System

Written by `fledge export cfs {mission.title} --app {name}`; change the mission instead. The folder needs nothing
else of Fledge. It is made for cFS Caelum, Draco and 7.x, in pure C99.

## Into a tree, in five steps

1. Copy this folder to `apps/{name}`.
2. Add the line of `install/targets.cmake` at the end of your `targets.cmake`.
3. Add the line of `install/cfe_es_startup.scr` to your start-up script, before its `!`.
4. Add the entry of `install/sch_lab_table.c` to your scheduler's table, so that housekeeping is asked for.
5. `make prep && make install`. The tables are built with it; without that tool, or for another byte order,
   copy `cf/*.tbl` to the target's `/cf`: they are {app.order}-endian (`--order`).

## Its surroundings

Flight has its time and its data from registers ({boards} says which message is where). The app's child
task waits for their clock, and turns each tick into the app's wake-up; the app reads, flies, writes and
answers the clock, which does not go on before. So the outside decides how fast time goes, and nothing is
taken from the host's clock.

- Under POSIX the registers are a file: `$FLEDGE_REGISTERS`, or `{name}.registers` in the folder of the process.
- On a board they are memory at the board's base: compile with `-D{prefix}_REGISTERS_IN_MEMORY`.

## Commands, on {CMD + app.topic:#06x}

| code | | payload |
|---|---|---|
| 0 | no operation | |
| 1 | reset the counters | |
| 2 | enter a mode, at the next tick | `uint32` number of the mode |
| 3 | load a table from a file, now | `char[16]` its name without `{prefix}.`, `char[64]` the file |
| 4 | reset flight: what it remembers begins anew, its parameters stay | |

Length and checksum are both looked at; what is refused is an event and a counter. {CMD + 1 + app.topic:#06x} asks for
housekeeping and lets the tables take over what the ground loaded; {CMD + 2 + app.topic:#06x} is the wake-up.

## Tables

The parameters of each module, behind a word that tells byte order and version: a file of another is refused. What
breaks its rules (finite, within its range, ...) is refused, with an event that
names the number. `fsw/inc/{name}_tbl.h` has their structs, with units.

| table | parameters of | bytes | file |
|---|---|---|---|
{tables}

They are also replaced the usual way: load, validate and activate by cFE's table services; the next request for
housekeeping takes them over, between two ticks.

## Telemetry

Flight's time is the packets' time. Payloads are in the processor's byte order, without padding
(`fsw/inc/{name}_msg.h`). An output is sent when it was written anew.

| id | | payload | bytes |
|---|---|---|---|
| {ids[f"{prefix}_HK_TLM_MID"]:#06x} | housekeeping | | 80 |
{packets}
"""
