# SPDX-License-Identifier: Apache-2.0
"""Files in a folder, all or none of them."""
from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.export.c_source import emit
from fledge.files import create

if TYPE_CHECKING:
    from fledge.export.read import Mission


def write(mission: Mission, folder: Path | str, more: dict[str, str] | None = None) -> list[Path]:
    """Write mission.h and mission.c, named after the mission, and more files by name; returns their paths."""
    return write_files(emit(mission) | (more or {}), folder)


def write_files(files: Mapping[str, str | bytes], folder: Path | str) -> list[Path]:
    """Write name -> text or bytes into a folder; names may have folders of their own. No file is left half
    written: each gets its name only after all are written, and another program cannot write them meanwhile. A
    file that has the same content already is not touched, so that a build does not start anew."""
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "it is a file; give a folder", str(folder))
    fresh, made = [], []
    locks = []
    done = False
    try:
        for name, content in files.items():
            part = folder / (name + ".part")
            made += make(part.parent)
            locks.append(create(part))
            fresh.append((part, folder / name))
            part.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
        for part, whole in fresh:
            if whole.exists() and whole.read_bytes() == part.read_bytes():
                part.unlink()
            else:
                os.replace(part, whole)
        done = True
    finally:
        for part, _ in fresh:
            part.unlink(missing_ok=True)
        for lock in locks:
            os.close(lock)
        for one in reversed([] if done else made):
            one.rmdir()
    return [whole for _, whole in fresh]


def make(folder: Path) -> list[Path]:
    """Make a folder and those above it; returns those that were not there."""
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return made[::-1]
