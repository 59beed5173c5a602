# SPDX-License-Identifier: Apache-2.0
"""The app of a part, with the pocket cFE, as a program for a LEON3 board."""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.export.c_text import wrap
from fledge.disk import ROOT, write_files
from fledge.targets.cfs import export as cfs
from fledge.targets.cfs.export import around
from fledge.targets.cfs.pocket import write_app
from fledge.targets.leon3 import board

if TYPE_CHECKING:
    from fledge.targets.job import Part

APP = cfs.App("fsw", order="big")
LEFT_OUT = {"fsw_attach.c", "shared_file.c", "watch.c", "file_sink.c"}      # what cfs.c has in place of them
BOARD = [ROOT / path for path in ("targets/bare/tasks.c", "targets/bare/files.c", "targets/bare/recorder.c",
                                  "targets/leon3/flight.c", "targets/leon3_cfs/cfs.c")]


def program(part: Part, folder: Path, machine: Path) -> Path:
    """Build it; machine: the file of its board."""
    folder = folder.resolve()
    app = write_app(APP, part, folder)
    files = {f"/cf/{file.name}": file.read_bytes() for file in sorted((app / "cf").iterdir())}
    write_files({"apps.c": around.app_list([APP]),
                 "files.c": files_in_memory(files | {"/cf/cfe_es_startup.scr": around.startup(APP).encode()}),
                 **{f"inc/{name}": text for name, text in around.wrappers(APP).items()}}, folder)
    own = [file for file in (app / "fsw/src").rglob("*.c") if file.name not in LEFT_OUT]
    pocket = [file for file in around.pocket_sources() if file.name not in ("host.c", "port_posix.c")]
    return board.program(folder, part.mission.name,
                         [*sorted(own), folder / "apps.c", folder / "files.c", *pocket, *BOARD],
                         [app, folder / "inc", app / "fsw/inc", app / "fsw/src", ROOT / "targets/cfs/inc"],
                         ["-DPOCKET_TASKS=8u", "-include", f"{APP.name}_names.h"], machine)


def files_in_memory(files: Mapping[str, bytes]) -> str:
    """C with these files: path -> bytes."""
    lines = ["/* SPDX-License-Identifier: Apache-2.0 */", '#include "targets/leon3_cfs/cfs.h"', ""]
    for i, content in enumerate(files.values()):
        lines += [f"static const uint8 file_{i}[] = {{", *wrap([f"{byte}," for byte in content], "    ", "    "), "};"]
    return "\n".join([*lines, "const Leon3File leon3_files[] = {",
                      *(f'    {{"{path}", file_{i}, sizeof file_{i}}},' for i, path in enumerate(files)), "};",
                      f"const uint32 leon3_files_n = {len(files)};", ""])
