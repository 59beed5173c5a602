# SPDX-License-Identifier: Apache-2.0
"""Errors and warnings in the words that a user reads."""
from __future__ import annotations

import errno
import os
from pathlib import Path

from fledge.cli.console import cannot_fly, complain

_PACKAGE = Path(__file__).parents[1]


def say_warning(message: object, category: type, file: str, line: int, *_: object) -> None:
    """With the line of the user's file, if it is about one."""
    from fledge.disk import shown

    complain(("" if Path(file).is_relative_to(_PACKAGE) else f"{shown(file)}, line {line}: ") + str(message))


def expected(error: BaseException) -> bool:
    """Whether an error is about the input of the user or a missing package, and no defect of this program."""
    if isinstance(error, (OSError, ImportError)):
        return True
    from fledge import RunError, SetupError
    from fledge.archive import ArchiveError

    return isinstance(error, (SetupError, RunError, ArchiveError))


def in_words(error: BaseException, folder: str | os.PathLike[str] = ".") -> str:
    """The text of an error; of an error of the operating system the file and the reason, without the number. folder:
    into which the command writes"""
    if type(error).__name__ == "CompositionError":
        return cannot_fly(str(error).splitlines())
    if isinstance(error, PermissionError) and isinstance(error.filename, str):
        return f"this user may not write or read {os.path.abspath(error.filename)}"
    if isinstance(error, ModuleNotFoundError) and (package := _package_of(str(error.name))):
        return f"{error.name} is not installed; as root, run: apt-get install {package}"
    if isinstance(error, OSError) and error.strerror:
        if error.filename:
            return f"{error.filename}: {error.strerror}"
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        return error.strerror + (f", in {os.path.abspath(folder)} or the folder of temporary files" if full else "")
    return str(error)


def _package_of(module: str) -> str:
    """The package of Debian, among those that Fledge names, which has a module of Python; "" if there is none."""
    from fledge.disk import ROOT

    package = f"python3-{module.partition('.')[0].lower()}"
    files = [ROOT / "cmake/packages.txt", *_PACKAGE.glob("*/packages.txt")]
    return package if any(package in file.read_text(encoding="utf-8").split() for file in files) else ""
