# SPDX-License-Identifier: Apache-2.0
"""A part as an app that flies: as `fledge export cfs` writes it, with a record after each tick (watch.c), and with the
pocket cFE as one program."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fledge.disk import write_files
from fledge.targets import build
from fledge.targets.cfs import export as cfs
from fledge.targets.cfs.export import around

if TYPE_CHECKING:
    from fledge.targets.job import Part

APP = cfs.App("fsw")


def write_app(app: cfs.App, part: Part, parent: Path) -> Path:
    """Write a part as an app that `fledge fly` can start, and return its folder."""
    folder = (parent / app.name).resolve()
    written = cfs.write(part.mission, app, folder, part.board_files(), (), part.roots[:-1], simulated=True,
                        watched=True)
    for old in {file for file in folder.rglob("*") if file.is_file()} - set(written):
        old.unlink()                # of an earlier export
    return folder


def core(part: Part, folder: Path) -> Path:
    """Build a core with the app of a part; returns its path. Its files lie in cf/ beside it."""
    app, folder = write_app(APP, part, folder), folder.resolve()
    (folder / "cf").mkdir(exist_ok=True)
    write_files({"apps.c": around.app_list([APP]), "cf/cfe_es_startup.scr": around.startup(APP),
                 **{f"inc/{file}": text for file, text in around.wrappers(APP).items()},
                 **{f"cf/{file.name}": file.read_bytes() for file in sorted((app / "cf").iterdir())}}, folder)
    sources = [*sorted((app / "fsw/src").rglob("*.c")), folder / "apps.c", *around.pocket_sources()]
    return build.program(folder, "core", sources, [app, folder / "inc", app / "fsw/inc", app / "fsw/src",
                                                   build.ROOT, build.ROOT / "targets/cfs/inc"],
                         link=["-lpthread", "-lm"])
