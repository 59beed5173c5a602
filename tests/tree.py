# SPDX-License-Identifier: Apache-2.0
"""The repository's own files, for the tests that read their text."""

import os
from functools import cache
from pathlib import Path
from typing import Iterator

ROOT = Path(__file__).resolve().parents[1]
NOT_OURS = {".git", "build", "runs", "__pycache__", ".pytest_cache", ".mypy_cache", ".cache"}


def files(root: Path = ROOT) -> Iterator[Path]:
    """Every file below `root`, relative to it, in a stable order; nothing that was built."""
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(set(folders) - NOT_OURS)
        for name in sorted(names):
            yield (Path(folder) / name).relative_to(root)


@cache
def library() -> dict[str, str]:
    """Folder -> the package fledge, or a part of it, that it holds: python/fledge and targets, and the folders to which
    links in the package lead."""
    found, folders = {"python/fledge": "fledge", "targets": "fledge.targets"}, ["python/fledge"]
    for place in folders:       # the loop appends to it
        for folder, names, _ in os.walk(ROOT / place):
            for link in sorted(Path(folder, name) for name in names if Path(folder, name).is_symlink()):
                folders.append(link.resolve().relative_to(ROOT).as_posix())
                found[folders[-1]] = ".".join([found[place], *link.relative_to(ROOT / place).parts])
    return found


def module_of(path: Path) -> str:
    """The name by which the library has a file, as fledge.ground.database; "" of a file outside it."""
    for folder in path.parents:
        if package := library().get(folder.as_posix()):
            return ".".join([package, *path.relative_to(folder).with_suffix("").parts]).removesuffix(".__init__")
    return ""
