# SPDX-License-Identifier: Apache-2.0
"""The command line: `python3 -m registers --help`."""
from __future__ import annotations

import argparse
import sys
from pathlib import Path

from introspect.files import depfile, write_if_changed
from registers import emit_c, emit_markdown
from registers.checked_toml import TomlError
from registers.description import read

_HELP = """\
Read boards, and write the C header and tables (BOARD.h, BOARD.c) and the documentation (BOARD.md) of each. If a board
has a mistake, no file is written. Files that would not change are not written again.

example:
  python3 -m registers registers/boards/io_board_a.toml --out build"""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="registers", description=_HELP,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("boards", nargs="+", type=Path, metavar="BOARD.toml")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="where to write")
    parser.add_argument("--depfile", type=Path, metavar="FILE",
                        help="write for Ninja or make on what DIR/stamp depends")
    options = parser.parse_args(arguments)
    files: dict[str, str] = {}
    complaints = []
    places: list = []
    for path in options.boards:
        try:
            board = read(path)
        except (TomlError, OSError) as error:
            complaints.append(str(error) if isinstance(error, TomlError) else f"{path}: {error}")
            continue
        for other, theirs in places:
            if board.name == other.name:
                complaints.append(f"{path}:1: boards' names differ; `{board.name}` is also "
                                  f"{theirs}'s; rename one")
            elif board.base < other.base + other.size and other.base < board.base + board.size:
                complaints.append(f"{path}:1: boards do not overlap; {board.name} "
                                  f"[{board.base:#x}, {board.base + board.size:#x}) overlaps "
                                  f"{other.name} of {theirs}; move one")
        places.append((board, path))
        files |= emit_c.emit(board) | emit_markdown.emit(board)
    if complaints:
        print("\n".join(complaints), file=sys.stderr)
        return 1
    try:
        for name, text in files.items():
            if write_if_changed(options.out / name, text):
                print(f"wrote {options.out / name}")
        if options.depfile:
            write_if_changed(options.depfile, depfile(options.out / "stamp", options.boards))
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
