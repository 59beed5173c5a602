# SPDX-License-Identifier: Apache-2.0
"""What a command needs besides what all need, for the launcher, which asks before it builds:

    python3 -P -m fledge.cli.packages fly nadir_spin --on leon3

prints a line for each: a section of cmake/packages.txt, the folder of a target with a packages.txt of its own, or
"build PART" of a part of Fledge's build. Nothing but the standard library is imported. A wrong command line needs
nothing: the command itself refuses it.
"""
from __future__ import annotations

import contextlib
import io
import sys

from fledge.errors import Failure
from fledge.targets import TARGETS

TYPE_CHECKING = False   # of `typing`
if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


def needed(words: list[str]) -> list[str]:
    """The lines for the words of a command."""
    if words[0] == "setup":
        return list(lines(words[1].split(",")))
    if words[0] == "test":
        return list(lines(TARGETS))
    from fledge.cli import parsed

    try:
        with contextlib.redirect_stderr(io.StringIO()):
            options = parsed(words)
            return list(lines(options.needs(options)))
    except (SystemExit, Failure):
        return []


def lines(purposes: Iterable[str]) -> Iterator[str]:
    """A line for each: a target has those of the targets that it uses, too."""
    for one in purposes:
        used = TARGETS[one].with_used() if one in TARGETS else []
        folders = [TARGETS.folders[target.name] for target in used]
        yield from [str(folder) for folder in folders if (folder / "packages.txt").is_file()] if used else [one]
        yield from (f"build {part}" for target in used for part in target.parts)


if __name__ == "__main__":
    print("\n".join(dict.fromkeys(needed(sys.argv[1:]))))
