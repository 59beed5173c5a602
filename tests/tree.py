# SPDX-License-Identifier: Apache-2.0
"""The repository's own files, for the tests that read their text."""

import os
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
