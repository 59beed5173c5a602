# SPDX-License-Identifier: Apache-2.0
"""The whole folder of an app."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.export import board as boards_of
from fledge.export import c_source
from fledge.targets.cfs.export import around, eds, joint, packets, sources, tables
from fledge.targets.cfs.export.app import CMD, TLM, App, check_taken, has_files
from fledge.export.commands import emit_commands
from fledge.export.host import emit_host
from fledge.export.read import ExportError, Mission
from fledge.disk import ROOT, write_files

if TYPE_CHECKING:
    from registers.description import Board


def emit(mission: Mission, app: App, files: Sequence[Path | str] | None = None, outputs: Sequence[str] | str = (),
         roots: Sequence[Path | str] = (), simulated: bool = False, watched: bool = False) -> dict[str, str | bytes]:
    """Path in the folder -> text or bytes. files, outputs: of boards whose registers bring and take messages, as
    export.emit_board; None: there are none. roots: folders of modules that are not Fledge's own. simulated: the
    registers are in a file that a simulation maps too. watched: with a record of its own, for `fledge fly`."""
    app.check_topics(mission)
    tables_ = tables.tables(mission, app)
    registers = simulated or files is not None
    flown, boards = flown_by(mission, files or (), outputs) if registers else (c_source.emit(mission), [])
    of_bus = emit_commands(mission, CMD + app.topic, TLM + app.topic, app.order)
    of_board = emit_commands(mission) if registers else of_bus
    flown |= {file: text for file, text in of_board.items() if not file.endswith(".json")}
    flown |= emit_host(mission) if watched else {}
    if registers and app.timer:
        raise ExportError("--wakeup own: the clock of a board gives flight its time; leave it out")
    name = app.name
    src = templates(mission, app, registers, simulated, watched)
    inc = {f"{name}_eventids.h": src.pop(f"{name}_eventids.h")}
    sheets = sources.renamed(app, src.pop(f"{name}_eds.c"))     # a source that only a build with data sheets compiles
    headers = packets.config(mission, app, tables_, simulated)
    config = {f"{name}_{part}.h": text for part, text in headers.items()}
    src |= {f"{name}_mission.h": joint.header(mission, app, tables_, boards, watched),
            f"{name}_mission.c": joint.source(mission, app, tables_),
            f"{name}_version.h": around.version(app, headers)}
    for file in src.keys() & flown.keys():
        raise ExportError(f"--app {name}: {mission.title} or one of its boards has a file {file} of its own; choose "
                          "another name")
    src |= {file: text for file, text in flown.items() if file.endswith((".c", ".h"))}
    src |= sources.collect(mission, [*map(Path, roots), ROOT], src | inc | config,
                           [*(sources.REGISTERS if registers else []), *(sources.SIMULATED if simulated else []),
                            *(sources.WATCHED if watched else [])])
    code = {file: text for file, text in src.items() if file.endswith(".c")}
    src |= {file: sources.renamed(app, text) for file, text in code.items()}
    src[f"{name}_names.h"] = sources.names_header(app, code.values())
    out = {f"fsw/inc/{file}": text for file, text in inc.items()}
    out |= {f"config/default_{file}": text for file, text in config.items()}
    out |= {f"fsw/src/{file}": text for file, text in src.items()}
    out |= {f"fsw/eds/{name}_eds.c": sheets, f"ground/{mission.name}.xml": packets.database(mission, app)}
    out |= {f"ground/{file}": text for file, text in of_bus.items() if file.endswith(".json")}
    out |= {f"board/{file}": text for file, text in flown.items() if not file.endswith((".c", ".h"))}
    return dict(sorted((out | of_tables(app, tables_) | surroundings(mission, app, sorted(code), tables_)).items()))


def templates(mission: Mission, app: App, registers: bool, simulated: bool, watched: bool) -> dict[str, str]:
    """The app's own C, of the templates that it needs."""
    needed = {"keep.c": bool(joint.kept(mission, app)), "registers.c": registers, "timer.c": app.timer,
              "files.c": has_files(mission) and not watched, "attach_file.c": simulated,
              "attach_memory.c": registers and not simulated}
    names = (template.name.removesuffix(".in") for template in sorted(around.TEMPLATES.glob("*.[ch].in")))
    return {f"{app.name}_{'attach.c' if what.startswith('attach') else what}": around.filled(mission, app, what)
            for what in names if needed.get(what, True)}


def of_tables(app: App, tables_: Sequence[tables.Table]) -> dict[str, str | bytes]:
    """The tables' sources, and the files that are loaded."""
    return {f"fsw/tables/{t.stem}.c": tables.source(app, t) for t in tables_} | {
        f"cf/{t.stem}.tbl": tables.tbl(app, t) for t in tables_}


def surroundings(mission: Mission, app: App, code: Sequence[str], tables_: Sequence[tables.Table]) -> dict[str, str]:
    """The build of an app of this C, its unit test, its data sheet, and how to get it into a tree."""
    test = f"coveragetest_{app.name}.c"
    return {"CMakeLists.txt": around.cmake(app, code, tables_), "README.md": around.readme(mission, app, tables_),
            "mission_build.cmake": around.configured(app, "mission", packets.MISSION),
            "arch_build.cmake": around.configured(app, "platform", packets.PLATFORM),
            f"eds/{app.name}.xml": eds.sheet(mission, app, tables_),
            "unit-test/CMakeLists.txt": around.unit_test(app, code),
            f"unit-test/{test}": around.filled(mission, app, "unit-test/coveragetest.c"),
            "install/targets.cmake": around.targets(app), "install/cfe_es_startup.scr": around.startup(app),
            **{f"install/sch_lab_table.{version}.c": around.schedule(mission, app, version)
               for version in around.SCHEDULERS},
            "install/to_lab_sub.c": around.downlink(mission, app)}


def flown_by(mission: Mission, files: Sequence[Path | str], outputs: Sequence[str] | str) -> tuple[dict[str, str],
                                                                                                   list[Board]]:
    """The mission's C with its boards', and the boards."""
    own = Path(f"{boards_of.board_name(mission)}.toml")
    boards = boards_of.read(mission, boards_of.texts_of(files) or [(own, boards_of.toml(mission, outputs))])
    return c_source.emit(mission) | boards_of.emit_board(mission, files, outputs), boards


def write(mission: Mission, app: App, folder: Path | str, files: Sequence[Path | str] | None = None,
          outputs: Sequence[str] | str = (), roots: Sequence[Path | str] = (), simulated: bool = False,
          watched: bool = False, others: Sequence[Path | str] = ()) -> list[Path]:
    """Write the folder, whole or not at all; returns the paths. others: folders of apps whose ids must differ."""
    texts = emit(mission, app, files, outputs, roots, simulated, watched)
    check_taken(mission, app, folder, others)
    return write_files(texts, folder)
