# SPDX-License-Identifier: Apache-2.0
"""The files around an app's C: its build, what a tree needs to know of it, and how to get it there."""
from __future__ import annotations

import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.commands import HEADER, Reason
from fledge.export.c_text import comment, wrap
from fledge.disk import ROOT
from fledge.targets.cfs.export import joint
from fledge.targets.cfs.export.app import App, has_files
from fledge.targets.cfs.export.packets import MISSION, PLATFORM, guarded, housekeeping
from fledge.targets.cfs.export.tables import HEAD_SIZE, Table

if TYPE_CHECKING:
    from fledge.export.read import Message, Mission

TEMPLATES = Path(__file__).resolve().parent / "templates"
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

    def id_of(packet: str) -> str:
        return f"{ids[f'{prefix}_{packet}_MID']:#06x}"

    def packets(messages: Sequence[Message], end: str) -> str:
        return "\n".join(f"| {id_of(f'{m.name.upper()}_{end}')} | {m.path} | {m.struct.name} | {16 + m.struct.size} |"
                         for m in messages)

    files = "" if not has_files(mission) else (
        f"## Files\n\nThey are in `/cf/{name}`, which the app makes (`{prefix}_FILES_FOLDER`).\n\n")
    period = f"every {joint.step(mission) / 1e9:g} s"
    waking = (f"A child task wakes the app, {period}, by the message {id_of('WAKEUP')}." if app.timer else
              f"The message {id_of('WAKEUP')} wakes the app, {period}.")
    return filled(
        mission, app, "README.md", words=mission.words, order=app.order, waking=waking, files=files,
        inputs=packets(mission.inputs, "IN"), outputs=packets(mission.outputs, "TLM"), command=id_of("CMD"),
        request=id_of("SEND_HK"), housekeeping=id_of("HK_TLM"), counters=id_of("FLIGHT_TLM"),
        reports=id_of("REPORT_TLM"), housekeeping_size=16 + sum(size(type_) for _, type_, _ in housekeeping(mission)),
        counters_size=HEADER + 32 + 4 * len(Reason), tables="\n".join(
            f"| `{prefix}.{t.name}` | {t.module.path}: {t.module.type} | {HEAD_SIZE + len(t.content)} | `{t.file}` |"
            for t in tables))


def size(type_: str) -> int:
    """[bytes] of a number or array, as in "uint8[16]"."""
    number, _, count = type_.rstrip("]").partition("[")
    return {"uint8": 1, "uint16": 2, "uint32": 4, "int64": 8}[number] * int(count or 1)


def filled(mission: Mission, app: App, template: str, **values: object) -> str:
    """A file of templates/, with what its words between @ stand for."""
    values |= {"APP": app.prefix, "app": app.name, "mission": mission.name, "title": mission.title}
    return re.sub(r"@(\w+)@", lambda found: str(values[found[1]]),
                  (TEMPLATES / f"{template}.in").read_text(encoding="utf-8"))
