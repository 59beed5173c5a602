# SPDX-License-Identifier: Apache-2.0
"""Files in a folder, all or none of them."""

import os
from pathlib import Path

from fledge.export.c_source import emit


def write(mission, folder, more=None):
    """Write mission.h and mission.c, named after the mission, and more files by name; returns their paths."""
    return write_files(emit(mission) | (more or {}), folder)


def write_files(files, folder):
    """Write name -> text into a folder. Nothing is half written: each file takes its name when whole, and only
    after all could be written. A file that already says the same is left alone, as builds like it."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    fresh = []
    try:
        for name, text in files.items():
            part = folder / (name + ".part")
            fresh.append((part, folder / name))
            part.write_text(text, encoding="utf-8", newline="\n")
        for part, whole in fresh:
            if whole.exists() and whole.read_bytes() == part.read_bytes():
                part.unlink()
            else:
                os.replace(part, whole)
    finally:
        for part, _ in fresh:
            part.unlink(missing_ok=True)
    return [whole for _, whole in fresh]
