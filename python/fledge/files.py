# SPDX-License-Identifier: Apache-2.0
"""Files that are written whole or not at all, and paths as users see them."""

from __future__ import annotations

import os
from pathlib import Path


class Part:
    """A file that takes its name once it is whole: until then it is NAME.part.

        with Part(path) as part:
            part.write_text(text)

    If writing fails, it removes the part, and the OSError names the file.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")

    def __enter__(self) -> Path:
        return self.part

    def __exit__(self, failed: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        if not failed:
            os.replace(self.part, self.path)
            return
        self.part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OSError(error.errno, f"cannot be written: {error.strerror}", str(self.path)) from None


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
