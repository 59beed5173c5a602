# SPDX-License-Identifier: Apache-2.0
"""The command line: `python3 -m registers --help`."""
from __future__ import annotations

import argparse
import sys
from pathlib import Path

from introspect.files import depfile, write_if_changed
from registers import emit_c, emit_markdown
from registers.checked_toml import TomlError
from registers.description import files_of, read_all

_HELP = """\
Read boards, and write the C header and tables (BOARD.h, BOARD.c) and the documentation (BOARD.md) of each. If a board
has a mistake, no file is written. Files that would not change are not written again.

example:
  python3 -m registers io_board_a.toml io_board_b.toml --out build"""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="registers", description=_HELP,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("boards", nargs="+", type=Path, metavar="BOARD.toml",
                        help="a file, or a folder with files *.toml")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="where to write")
    parser.add_argument("--depfile", type=Path, metavar="FILE",
                        help="write for Ninja or make on what DIR/stamp depends")
    options = parser.parse_args(arguments)
    try:
        boards = read_all(options.boards)
    except (TomlError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    files: dict[str, str] = {}
    for board in boards:
        files |= emit_c.emit(board) | emit_markdown.emit(board)
    try:
        for name, text in files.items():
            if write_if_changed(options.out / name, text):
                print(f"wrote {options.out / name}")
        if options.depfile:
            write_if_changed(options.depfile, depfile(options.out / "stamp", files_of(options.boards)))
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
