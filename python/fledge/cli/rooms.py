# SPDX-License-Identifier: Apache-2.0
"""The commands of rooms: the modules in the folder `cli` of a room, as ground/cli, which a link here names. Each has
the add() of a command, and may have READERS, for `fledge check`: the name of a file in a mission's folder, or a key at
the top of a TOML file there ("": of one without keys), and the function that reads it and returns a summary.
"""
from __future__ import annotations

from importlib import import_module
from pathlib import Path

from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType


def modules() -> list[ModuleType]:
    """All of them. Raises Failure where git wrote files in the place of links."""
    here = Path(__file__).parent
    if files := [path.name for path in here.iterdir() if path.is_file() and not path.suffix]:
        raise Failure(f"{here / files[0]} is a file, and has to be a symbolic link: git config core.symlinks true; git "
                      "checkout -- .")
    return [import_module(f"fledge.cli.{file.parent.name}.{file.stem}")
            for file in sorted(here.glob("*/[!_]*.py")) if not file.stem.endswith("_test")]


def readers() -> dict[str, Callable[[Path], str]]:
    """The READERS of all of them."""
    return {kind: read for module in modules() for kind, read in getattr(module, "READERS", {}).items()}
