# SPDX-License-Identifier: Apache-2.0
"""Programs for a LEON3 board."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fledge.targets import bare, build
from fledge.targets.leon3 import toolchain

FOLDER = build.ROOT / "targets/leon3"
BOARD = build.ROOT / "emulator/boards/leon3.toml"       # Leon3.board
SAY = build.ROOT / "targets/bare/say.c"
SUPPORT = [*(FOLDER / name for name in ("traps.S", "devices.c", "board.c", "runtime.c", "system.c")), SAY]
# Flight on it, besides the mission's sources.
FLIGHT = [*bare.FLIGHT, FOLDER / "flight.c"]


def read_board(path: Path) -> dict[str, Any]:
    """A board's file. Raises SetupError if it is no TOML; what it holds the emulator checks."""
    from fledge.errors import SetupError
    from registers.checked_toml import TomlError, parse, text_of

    try:
        return parse(text_of(path), path)[0]
    except TomlError as error:
        raise SetupError(str(error)) from None


def program(folder: Path, name: str, sources: Sequence[Path], includes: Sequence[Path], flags: Sequence[str] = (),
            board: Path = BOARD, archives: Sequence[Path] = ()) -> Path:
    """Build a program for a LEON3 board, with its board support."""
    described = read_board(board)
    linked = toolchain.link(FOLDER / "leon3.ld", LEON3_RAM=described["ram"]["base"],
                            LEON3_RAM_SIZE=described["ram"]["size"], LEON3_CLOCK=described["clock"])
    return build.program(folder, name, [*SUPPORT, *sources], [*includes, build.ROOT], toolchain.COMPILER,
                         [*toolchain.headers(), "-g", '-DTARGET="leon3"', *flags], linked, machine=toolchain.MACHINE,
                         archives=archives)
