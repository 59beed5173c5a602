# SPDX-License-Identifier: Apache-2.0
"""A mission's C as files in a folder."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fledge.export.c_source import emit
from fledge.disk import write_files

if TYPE_CHECKING:
    from fledge.export.read import Mission


def write(mission: Mission, folder: Path | str, more: dict[str, str] | None = None) -> list[Path]:
    """Write mission.h and mission.c, named after the mission, and more files by name; returns their paths."""
    return write_files(emit(mission) | (more or {}), folder)
