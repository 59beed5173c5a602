# SPDX-License-Identifier: Apache-2.0
"""A mission as the folder of an application of RTEMS."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from fledge import export
from fledge.disk import ROOT, write_files
from fledge.targets.cfs.export import sources
from fledge.targets.leon3 import board

if TYPE_CHECKING:
    from fledge.export.read import Mission

HERE = Path(__file__).resolve().parent
RUNNER = [*board.FLIGHT, board.SAY, board.FOLDER / "devices.c", HERE / "board.c", HERE / "rtems.c"]


def write(mission: Mission, folder: Path | str, files: Sequence[Path | str] = (), outputs: Sequence[str] | str = (),
          roots: Sequence[Path | str] = ()) -> list[Path]:
    """Write it; returns the paths. files, outputs: of boards that its messages pass, as export.emit_board. roots:
    folders of modules that are not Fledge's own."""
    mission = replace(mission, form="rtems")
    exported = (export.emit_c(mission) | export.emit_board(mission, files, outputs) | export.emit_commands(mission)
                | export.emit_host(mission))
    code = {file: text for file, text in exported.items() if file.endswith((".c", ".h"))}
    code |= sources.collect(mission, [*map(Path, roots), ROOT], code,
                            [str(path.relative_to(ROOT)) for path in RUNNER])
    texts = {f"src/{file}": text for file, text in code.items()}
    texts |= {file: text for file, text in exported.items() if file not in code}
    return write_files(texts | {"Makefile": (HERE / "Makefile").read_text(encoding="utf-8"),
                                "mission.mk": f"NAME := {mission.name}\nTASKS := {len(mission.tasks)}\n",
                                "README.md": readme(mission)}, Path(folder))


def readme(mission: Mission) -> str:
    tasks = sorted(enumerate(mission.tasks), key=lambda task: (task[1].period, task[0]))
    rows = "\n".join(f"| {task.title} | T{i:03} | {task.period / 1e9:g} s | {11 + place} |"
                     for place, (i, task) in enumerate(tasks))
    return f"""# {mission.title} as an application of RTEMS 6

Written by `fledge export rtems {mission.words}`; change the mission instead. The folder needs nothing else of Fledge.

    make RTEMS=/opt/rtems/6 BSP=leon3

RTEMS is the folder into which you installed RTEMS 6 with its compiler, for a BSP of a LEON3; `{mission.name}` is the
program. The processor needs an FPU, and the board the register space of `*.toml`, as one device of the AHB
(`src/registers/plug_and_play.h`): its interrupt of a tick gives flight its time. Commands and telemetry pass its
queues, as `*_packets.json` describes them. A record of all outputs goes through the last APBUART.

| task | thread | period | priority |
|---|---|---|---|
| flight: exchange, commands, telemetry, record | UI1 | each tick | 10 |
{rows}

At a tick, flight lets the tasks that are due run one after the other, in the order of the mission: so its outputs are
the same bits as on the desktop. The priorities count beside threads of yours: those from {11 + len(tasks)} on run when
flight waits. `make CFLAGS="-Os -DFLIGHT_PRIORITY=20 -DTASK_STACK=32768"` changes priorities and stacks. When flight has
not been idle for 10 s, the watchdog resets the board. In an application of yours, `src/targets/leon3_rtems/rtems.c` is
what to change: its end configures RTEMS.
"""
