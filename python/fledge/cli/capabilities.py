# SPDX-License-Identifier: Apache-2.0
"""The commands of capabilities: the modules in the folder `cli` of each, as ground/cli, to which a link here leads.

A module has the add() of a command. It may have READERS, for `fledge check`: by the name of a file in a mission's
folder, or by a key at the top of its TOML files, the function that reads such a file and returns a summary. The key ""
stands for a TOML file without keys.
"""
from __future__ import annotations

from importlib import import_module
from pathlib import Path

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType


def modules() -> list[ModuleType]:
    """All of them."""
    return [import_module(f"fledge.cli.{file.parent.name}.{file.stem}")
            for file in sorted(Path(__file__).parent.glob("*/[!_]*.py")) if not file.stem.endswith("_test")]


def readers() -> dict[str, Callable[[Path], str]]:
    """The READERS of all of them, in the order of their keys."""
    found = {kind: read for module in modules() for kind, read in getattr(module, "READERS", {}).items()}
    return dict(sorted(found.items()))
