# SPDX-License-Identifier: Apache-2.0
"""An .fmu file, unpacked: what a simulation needs of it, and nothing that could leave its folder."""
from __future__ import annotations

import os
import platform
import stat
import tempfile
import weakref
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from fledge.disk import shown
from fledge.errors import SetupError, listed
from fledge.files.kvn import refuse
from fledge.fmi.description import Description

# Limits of what is unpacked.
MOST_FILES = 20_000
MOST_BYTES = 4 << 30
MOST_RATIO, RATIO_FROM = 500, 64 << 20  # [-], of files of so many bytes

_opened: weakref.WeakValueDictionary[tuple[str, int, int], Archive] = weakref.WeakValueDictionary()


def opened(path: str | os.PathLike[str]) -> Archive:
    """The archive, unpacked once while a model of it lives. Raises SetupError."""
    try:
        file = os.stat(path)
        key = (os.path.realpath(path), file.st_mtime_ns, file.st_size)
    except (OSError, ValueError):
        return Archive(path)
    archive = _opened.get(key) or Archive(path)
    _opened[key] = archive
    return archive


class Archive:
    """The FMU at `path`, in a temporary folder that is there as long as this object.

    description: of its model; library: the path of the library for this system; resources: of that folder. Raises
    SetupError for what is no FMU for co-simulation on this system, and for archives that are not safe to unpack.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path, self.where = Path(path), str(shown(path))
        try:
            with zipfile.ZipFile(self.path) as archive:
                entries = {name: entry for entry in archive.infolist() if (name := self._checked(entry))}
                self._check_sizes(list(entries.values()))
                if "modelDescription.xml" not in entries:
                    tops = sorted({name.split("/")[0] for name in entries})
                    refuse(self.where, 0, "expected an FMU; this archive has no modelDescription.xml at its top, but "
                           + listed(tops, 8))
                self.description = Description.read(archive.read(entries["modelDescription.xml"]),
                                                    f"{self.where}: modelDescription.xml")
                binary = self._binary(entries)
                self._folder = tempfile.TemporaryDirectory(prefix="fledge-fmu-")
                root = Path(self._folder.name)
                for name, entry in entries.items():
                    if name.startswith(("resources/", f"{binary.parent}/")):
                        to = root / name
                        to.parent.mkdir(parents=True, exist_ok=True)
                        to.write_bytes(archive.read(entry))
        except SetupError:
            raise
        except OSError as error:
            refuse(self.where, 0, f"expected an FMU; {error.strerror or error}")
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, ValueError) as error:
            refuse(self.where, 0, f"expected an FMU, which is a zip archive; {error}")
        self.library, self.resources = root / binary, root / "resources"
        self.resources.mkdir(exist_ok=True)

    def _checked(self, entry: zipfile.ZipInfo) -> str:
        """The name of a file of the archive; "" of a folder."""
        name = entry.orig_filename
        parts = PurePosixPath(name).parts
        if "\\" in name or "\0" in name or ".." in parts or name.startswith("/") or ":" in parts[0]:
            refuse(self.where, 0, f"the archive has '{name}', which leaves its folder; do not use this file")
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            refuse(self.where, 0, f"the archive has '{name}', which is a link or device; do not use this file")
        return "" if entry.is_dir() else str(PurePosixPath(name))

    def _check_sizes(self, entries: list[zipfile.ZipInfo]) -> None:
        total = sum(entry.file_size for entry in entries)
        if len(entries) > MOST_FILES or total > MOST_BYTES:
            refuse(self.where, 0, f"the archive has {len(entries):,} files of {total:,} bytes; at most {MOST_FILES:,} "
                   f"files and {MOST_BYTES:,} bytes are unpacked")
        for entry in entries:
            if entry.file_size > max(RATIO_FROM, MOST_RATIO * entry.compress_size):
                refuse(self.where, 0, f"'{entry.filename}' grows from {entry.compress_size:,} to {entry.file_size:,} "
                       f"bytes; more than {MOST_RATIO} times is refused")

    def _binary(self, entries: dict[str, zipfile.ZipInfo]) -> PurePosixPath:
        machine = platform.machine()
        wanted = [f"{machine}-linux"]
        if self.description.version == 2:
            wanted.insert(0, {"x86_64": "linux64", "aarch64": "aarch64-linux"}.get(machine, machine))
        file = f"{self.description.identifier}.so"
        for folder in wanted:
            if f"binaries/{folder}/{file}" in entries:
                return PurePosixPath("binaries", folder, file)
        there = sorted({name.split("/")[1] for name in entries if name.startswith("binaries/") and name.count("/") > 1})
        sources = ("; it has sources, from which its vendor's tools, or gcc, make one"
                   if any(name.startswith("sources/") for name in entries) else "")
        refuse(self.where, 0, f"the FMU has no binaries/{wanted[0]}/{file} for this system; it has binaries for "
               f"{listed(there) if there else 'no system'}{sources}")
