# SPDX-License-Identifier: Apache-2.0
"""Flight on the emulated LEON3 as the system of an FMU: the program, the board, and the mission as data for
fmi/board/system.cpp."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.commands import byte_runs
from fledge.disk import write_files
from fledge.errors import Failure
from fledge.export.c_source import row, written
from fledge.export.commands import numbers
from fledge.export.fmu import mission as exported
from fledge.export.fmu.build import System, compiler_for, prebuilt
from fledge.export.fmu.variables import Layout
from fledge.targets import TARGETS, Job, build
from fledge.targets.leon3.board import BOARD

if TYPE_CHECKING:
    from fledge.export.read import Mission
    from fledge.targets.job import Part


def board_fmu(mission: str, process: str | None = None, boards: Sequence[Path | str] = (),
              folder: Path | str | None = None, roots: Sequence[Path] = (), heads: bool = True,
              **parameters: Any) -> System:
    """The system of a flight process that runs on the emulated LEON3.

    process: None: the only one. boards: files of boards that its messages pass; none: one that carries them whole.
    folder: for what is built; default: runs/MISSION/fmu. heads: see variables.listed(). parameters: of the mission, as
    fledge.load() takes them. Raises SetupError, Failure.
    """
    [target] = TARGETS.ready(["leon3"], "export fmu")
    job = Job(mission, folder=folder or Path("runs") / Path(mission).name / "fmu", duration=1.0, free=True,
              boards={process or "": boards} if boards else None, parameters=parameters, roots=roots)
    if process is None and len(job.parts) > 1:
        raise Failure(f"{mission} has several flight processes; name one: {', '.join(p.process for p in job.parts)}")
    part = job.part(process) if process else job.parts[0]
    target.check(part)
    variables = exported.layout(part.mission, heads)
    packets = {name: text for name, text in part.files.items() if name.endswith(".json")}
    return System(exported.facts(part.mission, "leon3"), variables,
                  resources={"flight.elf": target.build(part), "board.toml": BOARD, **packets},
                  libraries=lambda platform: [prebuilt("libfledge_fmu_board.so", platform),
                                              tables(part, variables, platform)])


def tables(part: Part, variables: Layout, platform: str) -> Path:
    """mission.so for a platform: the mission as data, fmi/board/board.h."""
    folder = part.folder.resolve() / "board"
    own = write_files(emit(part.mission, variables), folder)
    return build.program(folder / platform, "mission.so", [*part.table_sources(), *own],
                         part.includes(), compiler_for(platform), ["-fPIC"],
                         ["-shared", "-s", "-Wl,-Bsymbolic,-z,defs"], entry="fmu_board")


def emit(mission: Mission, variables: Layout) -> dict[str, str]:
    """MISSION_fmu_board.c"""
    struct, outputs = mission.struct(), {m.member: m.struct for m in mission.outputs}
    lines = [*written(mission), f'#include "{mission.name}.h"',
             '#include "fmi/board/board.h"', "", *variables.c_table()]
    rows: list[str] = []
    if mission.modes:
        lines += numbers("mode", [(4, 2), (8, 1)])
        rows += row("runs_mode", "2u", f"offsetof({struct}, mode)", f"sizeof((({struct} *)0)->mode)")
    if mission.events:
        lines += numbers("event", [(8, 2), (4, 4)])
    for event in mission.events:
        rows += row("runs_event", "2u", f"offsetof({struct}, event.{event.name})", "sizeof(ExecEvent)")
    copies = [(wire.target, outputs[wire.source]) for m in mission.configuration for wire in mission.published[m.name]]
    runs = {type_.name: byte_runs(type_.fields) for _, type_ in copies}
    for name, each in runs.items():
        lines += numbers(name, each)
    for target, type_ in copies:
        rows += row(f"runs_{type_.name}", f"{len(runs[type_.name])}u", f"offsetof({struct}, {target})",
                    f"sizeof({type_.name})")
    if rows:
        lines += ["", "static const TelemetryOutput parts[] = {", *rows, "};"]
    n = len(mission.events) + len(copies) + bool(mission.modes)
    parameters = f"{mission.name}_parameters" if any(m.fields("par") for m in mission.modules) else "0"
    return {f"{mission.name}_fmu_board.c": "\n".join([
        *lines, "", "const FmuBoard fmu_board = {",
        f"    &fledge_mission, &layout, {parameters}, {'parts' if rows else '0'}, {n}u, sizeof({struct})", "};", ""])}
