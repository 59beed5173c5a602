# SPDX-License-Identifier: Apache-2.0
"""Files that are written whole or not at all, by one program at a time, temporary folders, and paths as users see
them."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from collections.abc import Mapping
from pathlib import Path

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from subprocess import Popen

ROOT = Path(__file__).resolve().parents[2]      # flight/, targets/ and python/ lie there, in this tree or installed


def sources() -> list[Path]:
    """All files of the package fledge, also of the folders to which its links lead."""
    return sorted(Path(place, name).resolve() for place, _, names in os.walk(Path(__file__).parent, followlinks=True)
                  for name in names)


class Part:
    """A file that takes its name once it is whole: until then it is NAME.part.

        with Part(path) as part:
            part.write_text(text)

    If writing fails, it removes the part, and the OSError names the file. Only one program at a time writes a part:
    a second one has an OSError. No symbolic link is followed.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        self._lock = -1

    def __enter__(self) -> Path:
        try:
            self._lock = create(self.part)
        except OSError as error:
            raise _named(error, self.path) from None
        return self.part

    def __exit__(self, failed: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        try:
            if not failed:
                os.replace(self.part, self.path)
                return
            self.part.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise _named(error, self.path) from None
        finally:
            os.close(self._lock)


def _named(error: OSError, path: Path) -> OSError:
    return OSError(error.errno, f"cannot be written: {error.strerror}", str(path))


# Its standard input ends when this process and its copies have ended, however they did; a line says that all is done.
_KEEPER = 'trap "" HUP INT TERM; read -r line || rm -rf -- "$1"'


class Scratch:
    """A temporary folder that is there until remove(), or as long as this object or this process. Raises OSError.

    path: of it, in the folder that TMPDIR names.
    """

    def __init__(self, prefix: str) -> None:
        import subprocess       # here, because most commands need none of these
        import tempfile
        import weakref

        self.path = Path(tempfile.mkdtemp(prefix=prefix))
        # A signal may kill this process, so another one removes what is left then.
        try:
            keeper = subprocess.Popen(["sh", "-c", _KEEPER, "sh", self.path], stdin=subprocess.PIPE, cwd="/",
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        except OSError:
            self.path.rmdir()
            raise
        self.remove = weakref.finalize(self, _end_scratch, self.path, keeper, os.getpid())


def _end_scratch(path: Path, keeper: Popen[bytes], owner: int) -> None:
    import shutil

    if os.getpid() == owner:        # a copy of the process leaves it to the original
        shutil.rmtree(path, ignore_errors=True)
        keeper.communicate(b"\n")


def create(part: Path) -> int:
    """Create a file in place of that of a program that ended; returns a descriptor that holds its lock. The same
    steps as record/file_sink.c: both write into the folders of runs."""
    for _ in range(100):
        try:
            file, fresh = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666), True
        except FileExistsError:
            try:
                file, fresh = os.open(part, os.O_WRONLY | os.O_NOFOLLOW | os.O_NONBLOCK), False
            except FileNotFoundError:
                continue
            except OSError as error:
                text = "is a symbolic link" if error.errno == errno.ELOOP else error.strerror
                raise OSError(error.errno, f"{part.name} {text}", str(part)) from None
        ours = False
        try:
            opened = os.fstat(file)
            if not stat.S_ISREG(opened.st_mode):
                raise FileExistsError(errno.EEXIST, f"{part.name} is no regular file", str(part))
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if fresh:
                    continue    # another program found it before it was locked, deletes it and creates its own
                raise OSError(errno.EBUSY, "another program writes it now", str(part)) from None
            except OSError:
                pass            # a file system without locks
            try:
                there = os.lstat(part)
            except FileNotFoundError:
                continue
            if (there.st_dev, there.st_ino) == (opened.st_dev, opened.st_ino):
                ours = fresh
                if not fresh:
                    part.unlink()
        finally:
            if not ours:
                os.close(file)
        if ours:
            return file
    raise OSError(errno.EBUSY, "other programs write it all the time", str(part))


def write_files(files: Mapping[str, str | bytes], folder: Path | str) -> list[Path]:
    """Write name -> text or bytes into a folder; names may have folders of their own. No file is left half
    written: each gets its name only after all are written, and another program cannot write them meanwhile. A
    file that has the same content already is not touched, so that a build does not start anew."""
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "it is a file; give a folder", str(folder))
    fresh, created = [], []
    locks = []
    done = False
    try:
        for name, content in files.items():
            part = folder / (name + ".part")
            created += make(part.parent)
            locks.append(create(part))
            fresh.append((part, folder / name))
            try:
                part.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
            except OSError as error:
                raise _named(error, folder / name) from None
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
        for parent in reversed([] if done else created):
            parent.rmdir()
    return [whole for _, whole in fresh]


def keep(path: Path, text: str) -> None:
    """Write what spares a later command some work: not in a tree that this user may only read, nor while another
    program writes it."""
    try:
        write_files({path.name: text}, path.parent)
    except OSError:
        pass


def reserve(path: Path) -> None:
    """Give a sparse file its room on the disk: where that is full, a write to its mapped memory ends the process."""
    with path.open("r+b") as file:
        try:
            os.posix_fallocate(file.fileno(), 0, os.fstat(file.fileno()).st_size)
        except OSError as error:
            raise _named(error, path) from None


def make(folder: Path, mode: int = 0o777) -> list[Path]:
    """Make a folder and those above it; returns those that were not there. mode: 0o700 of runs, which are their
    owner's."""
    created = [parent for parent in (folder, *folder.parents) if not parent.exists()][::-1]
    for parent in created:
        parent.mkdir(mode, exist_ok=True)
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "it is a file; give a folder", str(folder))
    return created


def may_write(*folders: Path) -> bool:
    """Whether files can be made there. Folders that do not exist are made."""
    for folder in folders:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            return False
        if not os.access(folder, os.W_OK):
            return False
    return True


def build_folder() -> Path:
    """The folder of the build whose extension is loaded: build/release. Its cosim/ has the programs."""
    from fledge import _core

    return Path(_core.__file__).resolve().parents[1]


def shown(path: str | os.PathLike[str]) -> str | os.PathLike[str]:
    """The path relative to the current folder if it lies in it, else as it is."""
    try:
        return Path(path).relative_to(Path.cwd())
    except ValueError:
        return path
