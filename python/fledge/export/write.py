# SPDX-License-Identifier: Apache-2.0
"""A mission's C as files in a folder."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fledge.errors import SetupError, listed
from fledge.export.c_source import emit
from fledge.disk import write_files

if TYPE_CHECKING:
    from fledge.export.read import Mission


def write(mission: Mission, folder: Path | str, more: dict[str, str] | None = None) -> list[Path]:
    """Write mission.h and mission.c, named after the mission, and more files by name; returns their paths. Raises
    SetupError where one of them, as of a board, has such a name, too."""
    files, more = emit(mission), more or {}
    if both := files.keys() & more.keys():
        raise SetupError(f"two exported files would be {listed(sorted(both))}: rename the board, which has the name of "
                         "the mission")
    return write_files(files | more, folder)
