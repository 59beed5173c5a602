# SPDX-License-Identifier: Apache-2.0
"""An .fmu file, unpacked: what a simulation needs of it, and nothing that could leave its folder."""
from __future__ import annotations

import errno
import os
import platform
import shutil
import stat
import struct
import tempfile
import weakref
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from fledge.disk import Scratch, shown
from fledge.errors import SetupError, listed
from fledge.files.kvn import refuse
from fledge.fmi.description import MOST_BYTES as MOST_DESCRIPTION, Description

# Limits of what is unpacked.
MOST_FILES = 20_000
MOST_BYTES = 4 << 30
MOST_RATIO, RATIO_FROM = 500, 64 << 20  # [-], of an archive that grows to so many bytes

_TEXT = "modelDescription.xml"
# Those that the standards of FMI allow. zipfile unpacks others without a limit.
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
# What zipfile raises for damaged archives.
_DAMAGED = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, ValueError, LookupError,
            ArithmeticError)

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
        with self._reading():
            archive = zipfile.ZipFile(self.path)
        with archive:
            with self._reading():
                entries = {name: entry for entry in archive.infolist() if (name := self._checked(entry))}
                self._check_sizes(entries)
                text = archive.read(entries[_TEXT])
            self.description = Description.read(text, f"{self.where}: {_TEXT}")
            binary = self._binary(entries)
            wanted = {name: entry for name, entry in entries.items()
                      if name.startswith(("resources/", f"{binary.parent}/"))}
            with self._reading():
                self._scratch = self._unpacked(archive, wanted)
        self.library, self.resources = self._scratch.path / binary, self._scratch.path / "resources"

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """What goes wrong with the archive, in words."""
        try:
            yield
        except SetupError:
            raise
        except OSError as error:
            if error.errno == errno.EINVAL:     # a place before the file's begin
                refuse(self.where, 0, "expected an FMU, which is a zip archive; its table of files is damaged")
            refuse(self.where, 0, f"expected an FMU; {error.strerror or error}")
        except _DAMAGED as error:
            refuse(self.where, 0, f"expected an FMU, which is a zip archive; {error}")

    def _checked(self, entry: zipfile.ZipInfo) -> str:
        """The name of a file of the archive; "" of a folder."""
        name = entry.orig_filename
        parts = PurePosixPath(name).parts
        if "\\" in name or "\0" in name or ".." in parts or name.startswith("/") or ":" in "".join(parts[:1]):
            refuse(self.where, 0, f"the archive has '{name}', which leaves its folder; do not use this file")
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            refuse(self.where, 0, f"the archive has '{name}', which is a link or device; do not use this file")
        if not parts or entry.is_dir():
            return ""
        if entry.compress_type not in _METHODS:
            refuse(self.where, 0, f"'{name}' is packed by method {entry.compress_type} of zip, and FMI allows 0 "
                   "(none) and 8 (deflate); pack the FMU anew")
        return "/".join(parts)

    def _check_sizes(self, entries: Mapping[str, zipfile.ZipInfo]) -> None:
        packed, total = os.path.getsize(self.path), sum(entry.file_size for entry in entries.values())
        if len(entries) > MOST_FILES or total > MOST_BYTES:
            refuse(self.where, 0, f"the archive has {len(entries):,} files of {total:,} bytes; at most {MOST_FILES:,} "
                   f"files and {MOST_BYTES:,} bytes are unpacked")
        if total > max(RATIO_FROM, MOST_RATIO * packed):    # two entries may have the same packed bytes
            refuse(self.where, 0, f"the archive grows from {packed:,} to {total:,} bytes; more than {MOST_RATIO} times "
                   "is refused")
        if _TEXT not in entries:
            tops = sorted({name.split("/")[0] for name in entries})
            refuse(self.where, 0, f"expected an FMU; this archive has no {_TEXT} at its top, but {listed(tops, 8)}")
        if entries[_TEXT].file_size > MOST_DESCRIPTION:
            refuse(self.where, 0, f"{_TEXT} has {entries[_TEXT].file_size:,} bytes; at most {MOST_DESCRIPTION:,} are "
                   "read")

    def _unpacked(self, archive: zipfile.ZipFile, entries: Mapping[str, zipfile.ZipInfo]) -> Scratch:
        name = ""
        try:
            scratch = Scratch("fledge-fmu-")
            try:
                (scratch.path / "resources").mkdir()
                for name, entry in entries.items():
                    to = scratch.path / name
                    to.parent.mkdir(parents=True, exist_ok=True)
                    with archive.open(entry) as source, to.open("wb") as target:
                        shutil.copyfileobj(source, target, 1 << 20)
                return scratch
            except BaseException:
                scratch.remove()
                raise
        except OSError as error:
            place = tempfile.tempdir or "a temporary folder"
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                refuse(self.where, 0, f"no room to unpack it in {place}: {error.strerror or error}; make room there, "
                       "or give another folder by TMPDIR")
            refuse(self.where, 0, f"{name or 'it'} cannot be unpacked into {place}: {error.strerror or error}")

    def _binary(self, entries: Mapping[str, zipfile.ZipInfo]) -> PurePosixPath:
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
