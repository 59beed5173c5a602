# SPDX-License-Identifier: Apache-2.0
"""The files around an app's C: its build, what a tree needs to know of it, and how to get it there."""
from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.commands import HEADER, Reason
from fledge.export.c_text import comment, wrap
from fledge.files import ROOT
from fledge.targets.cfs.export import joint
from fledge.targets.cfs.export.app import App, has_files
from fledge.targets.cfs.export.packets import MISSION, PLATFORM, guarded, housekeeping
from fledge.targets.cfs.export.tables import HEAD_SIZE, Table

if TYPE_CHECKING:
    from fledge.export.read import Mission

STACK, PRIORITY = 16384, 55


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
    lines += ["", "if(CFE_EDS_ENABLED)", f"    target_sources({app.name} PRIVATE fsw/eds/{app.name}_eds.c)", "endif()"]
    if tables:
        lines += ["", f"add_cfe_tables({app.name}", "\n".join(f"    fsw/tables/{t.stem}.c" for t in tables) + ")"]
    lines += ["", "if(ENABLE_UNIT_TESTS AND NOT CFE_EDS_ENABLED)", "    add_subdirectory(unit-test)", "endif()"]
    return "\n".join([*lines, ""])


def unit_test(app: App, sources: Sequence[str]) -> str:
    """unit-test/CMakeLists.txt: all sources of the app, with coverage, linked with cFE's stubs."""
    listed = "\n".join(f"    ../fsw/src/{path}" for path in sources)
    return "\n".join(["# SPDX-License-Identifier: Apache-2.0",
                      f'add_cfe_coverage_test({app.name} ALL "${{CMAKE_CURRENT_SOURCE_DIR}}/coveragetest_{app.name}.c"',
                      listed + ")", f"target_link_libraries(coverage-{app.name}-ALL-testrunner m)", ""])


def startup(app: App) -> str:
    return f"CFE_APP, {app.name}, {app.prefix}_AppMain, {app.prefix}, {PRIORITY}, {STACK}, 0x0, 0;\n"


def targets(app: App) -> str:
    return f"list(APPEND cpu1_APPLIST {app.name})\n"


def version(app: App, config: Mapping[str, str]) -> str:
    """A number that changes with the app's packets and tables."""
    number = zlib.crc32("".join(config[name] for name in ("msgids", "fcncodes", "msgdefs", "tblstruct")).encode())
    return guarded(app, "version", f"The version of {app.prefix}'s packets and tables, as no operation tells it.",
                   [f'#define {app.prefix}_VERSION "{number:08X}"', ""])


def configured(app: App, scope: str, headers: Sequence[str]) -> str:
    """mission_build.cmake or arch_build.cmake: a header for each of config/, which a mission may replace."""
    listed = " ".join(f"{app.name}_{header}.h" for header in headers)
    return "\n".join(["# SPDX-License-Identifier: Apache-2.0",
                      f"# The headers of a {scope}: a file of this name in the definitions counts, or that of config/.",
                      *wrap(f"foreach(FILE {listed})".split(), "", "        "),
                      '    generate_config_includefile(FILE_NAME "${FILE}"',
                      '        FALLBACK_FILE "${CMAKE_CURRENT_LIST_DIR}/config/default_${FILE}")',
                      "endforeach()", ""])


def wrappers(app: App) -> dict[str, str]:
    """The same headers for a build without cFS's CMake: name -> text."""
    return {f"{app.name}_{name}.h": f'#include "config/default_{app.name}_{name}.h"\n'
            for name in (*MISSION, *PLATFORM)}


# The ticks per second of sch_lab, as each version comes.
SCHEDULERS = {"caelum": 1, "draco": 100, "7.0.1": 10}


def schedule(mission: Mission, app: App, version: str) -> str:
    """Entries for the table of a version's sch_lab."""
    rate = SCHEDULERS[version]
    ticks = joint.step(mission) * rate / 1e9
    file = "sample_defs/tables" if version == "7.0.1" else "apps/sch_lab/fsw/tables"
    period = f"every {joint.step(mission) / 1e9:g} s"
    hk, wakeup = f"{app.prefix}_SEND_HK_MID", f"{app.prefix}_WAKEUP_MID"
    entries = [f"{{CFE_SB_MSGID_WRAP_VALUE({hk}), {4 * rate}, 0}}, /* housekeeping, every 4 s */"]
    note = [f"{app.prefix} wakes itself, {period}."]
    if not app.timer and ticks >= 1 and ticks == int(ticks):
        entries.insert(0, f"{{CFE_SB_MSGID_WRAP_VALUE({wakeup}), {ticks:.0f}, 0}}, /* wake-ups, {period} */")
        note = []
    elif not app.timer:
        note = [f"It cannot wake {app.prefix} {period}: export with --wakeup own."]
    return "\n".join(["/* SPDX-License-Identifier: Apache-2.0 */",
                      *comment(" ".join([f"For {file}/sch_lab_table.c, whose scheduler ticks "
                                         f"{'once' if rate == 1 else f'{rate} times'} a second.", *note])),
                      f'/* #include "{app.name}_msgids.h" */', *entries, ""])


def downlink(mission: Mission, app: App) -> str:
    """Entries for to_lab's table."""
    ids = [id for id in app.ids(mission) if id.endswith("_TLM_MID")]
    return "\n".join(["/* SPDX-License-Identifier: Apache-2.0 */",
                      f"/* For fsw/tables/to_lab_sub.c: what of {app.prefix} goes to the ground; its table has room "
                      "for few.", " * Above:", " *", f' *     #include "{app.name}_msgids.h"', " */",
                      *(f"{{CFE_SB_MSGID_WRAP_VALUE({id}), {{0, 0}}, 4}}," for id in ids), ""])


def pocket_sources() -> list[Path]:
    """The pocket cFE and its host, to compile beside an app."""
    return sorted(file for file in (ROOT / "targets/cfs").glob("*.c") if file.name != "watch.c")


def app_list(apps: Sequence[App]) -> str:
    """The C file with the table of the apps that the host can start."""
    return "\n".join(["/* SPDX-License-Identifier: Apache-2.0 */", '#include "targets/cfs/pocket.h"', "",
                      *(f"void {app.prefix}_AppMain(void);" for app in apps), "",
                      "extern const PocketApp fledge_apps[];", "extern const uint32 fledge_apps_n;",
                      "const PocketApp fledge_apps[] = {",
                      *(f'    {{"{app.prefix}_AppMain", {app.prefix}_AppMain}},' for app in apps),
                      "    {0, 0},", "};", f"const uint32 fledge_apps_n = {len(apps)};", ""])


def readme(mission: Mission, app: App, tables: Sequence[Table]) -> str:
    prefix, name = app.prefix, app.name
    ids = app.ids(mission)
    tables = "\n".join(f"| `{prefix}.{t.name}` | {t.module.path}: {t.module.type} | {HEAD_SIZE + len(t.content)} | "
                       f"`{t.file}` |" for t in tables)

    def packets(messages: Sequence[Any], end: str) -> str:
        return "\n".join(f"| {ids[f'{prefix}_{m.name.upper()}_{end}_MID']:#06x} | {m.path} | {m.struct.name} | "
                         f"{16 + m.struct.size} |" for m in messages)

    files = "" if not has_files(mission) else f"""## Files

They are in `/cf/{name}`, which the app makes (`{prefix}_FILES_FOLDER`).

"""
    command, request, wakeup = (ids[f"{prefix}_{name}_MID"] for name in ("CMD", "SEND_HK", "WAKEUP"))
    period = f"every {joint.step(mission) / 1e9:g} s"
    waking = (f"A child task wakes the app, {period}, by the message {wakeup:#06x}." if app.timer else
              f"The message {wakeup:#06x} wakes the app, {period}.")
    sizes = {"uint8": 1, "uint16": 2, "uint32": 4, "int64": 8}
    hk_size = 16 + sum(sizes[kind] * int(count[:-1] or 1) for _, type_, _ in housekeeping(mission)
                       for kind, _, count in [f"{type_}[1]".replace("][1", "").partition("[")])
    return f"""# {prefix}: {mission.title} as an app of the core Flight System

Written by `fledge export cfs {mission.words} --app {name}`; change the mission instead. The folder needs nothing
else of Fledge. It is made for cFS Caelum, Draco and 7.x, in pure C99.

## Into a tree, in five steps

1. Copy this folder to `apps/{name}`.
2. Add the line of `install/targets.cmake` at the end of your `targets.cmake`.
3. Add the line of `install/cfe_es_startup.scr` to your start-up script, before its `!`. The bundle of 7.0.1 writes its
   script by `generate_startup.cmake`: add the line there, in a `file (APPEND ${{STARTUP_FILE}} "...\\n")`.
4. Add the entries of `install/sch_lab_table.VERSION.c`, of your version, and of `install/to_lab_sub.c` to the tables of
   your scheduler and of your telemetry output. The build finds the app's headers without further include paths.
5. `make prep && make install`; with gcc 12 in Caelum, whose OSAL needs it, after `export CFLAGS=-Wno-error=restrict`.
   In the bundle of 7.0.1 `make native_std.prep native_std.install`, or of another configuration: `native_eds` builds
   with the data sheet, `eds/{name}.xml`. The tables are built with it; without that tool, or for another byte order,
   copy `cf/*.tbl` to the target's `/cf`: they are {app.order}-endian (`--order`), for builds without data sheets.

Under Linux, `/proc/sys/fs/mqueue/msg_max` limits the depth of pipes; cFE's own need 40 messages.

## Its surroundings

{waking}
It takes its inputs from packets that it subscribes to, flies, and sends its outputs. Flight's time is the mission
elapsed time to the nearest step (`{prefix}_TIME_FROM_MET`). However many wake-ups are missing, flight takes one step;
it ignores those that come too often; if that time is set back, it begins anew with its parameters. Each is an event,
and a count in housekeeping. A mission replaces any header of `config/` by one in its definitions, named without
`default_`: topics, message ids, depth of the pipe, priorities, marks of performance logs.

| input | | payload | bytes |
|---|---|---|---|
{packets(mission.inputs, "IN")}

An input's packet is a telemetry header, and the message as `config/default_{name}_msgdefs.h` declares it. If its head
is zero, the app writes one: the time of the next wake-up, the next sequence, good quality. The option `--input PATH=ID`
of the export makes an input of another app's packets, `--wakeup ID` takes a scheduler's message.

## Commands, on {command:#06x}

`ground/{mission.name}_packets.json` describes all commands and telemetry. The numbers of a command are big-endian,
and the first is the version of that dictionary: a command for another version is refused.

| code | | arguments |
|---|---|---|
| 0, 1 | no operation (the event tells {prefix}'s version); reset the counters | |
| 2 | enter a mode | its place |
| 3 | write parameters | module, offset (32 bits), bytes |
| 4, 5 | stage a part of a block; commit the staged block | module, offset, bytes; module, CRC |
| 6 | publish configuration | module |
| 7 | reset flight; its parameters stay | |
| 8 | arm or disarm an event | event, 1 or 0 |
| 9 | read parameters back, into the report | module, offset, count |
| 10 | telemetry of an output | output, 1 or 0, every how many of its writings |

Each command is reported twice, when it is accepted and when it is executed, at the next wake-up; without registers, 0,
1 and 7 are executed at once. A refused one is an event and a counter too, with its reason. {request:#06x} asks for
housekeeping and lets the tables take over what the ground loaded.

{files}## Tables

The parameters of each module, behind a word that tells byte order and version: a file of another is refused. What
breaks its rules (finite, within its range, ...) is refused, with an event that
names the number. `config/default_{name}_tblstruct.h` has their structs, with units.

| table | parameters of | bytes | file |
|---|---|---|---|
{tables}

They are replaced by load, validate and activate of cFE's table services; the next request for housekeeping takes
them over, between two ticks. Parameters that a command writes are shown in the table: a dump has what flies.

## Telemetry

Packets carry spacecraft time, as the core's own do, and heads of payloads flight's. Payloads are in the processor's
byte order, without padding (`config/default_{name}_msgdefs.h`). An output is sent when it was written anew, at the rate
of command 10: from the start those that others read (`{prefix}_OUTPUTS_ON`), the rest after a command. What was not
sent between two requests for housekeeping is sent again, so that an app that was started alone has the configuration of
others.

| id | | payload | bytes |
|---|---|---|---|
| {ids[f"{prefix}_HK_TLM_MID"]:#06x} | housekeeping of the app, when it is asked for | | {hk_size} |
| {ids[f"{prefix}_FLIGHT_TLM_MID"]:#06x} | counters of commands, by command 10 | | {HEADER + 32 + 4 * len(Reason)} |
| {ids[f"{prefix}_REPORT_TLM_MID"]:#06x} | reports of commands | | 40, and the bytes read |
{packets(mission.outputs, "TLM")}
"""
