# SPDX-License-Identifier: Apache-2.0
"""The command line: `python3 -m registers --help`."""
from __future__ import annotations

import argparse
import sys
from pathlib import Path

from registers import emit_c, emit_markdown
from registers.checked_toml import TomlError
from registers.description import read

_HELP = """\
Read boards and write, of each, its C header and tables (BOARD.h, BOARD.c) and documentation
(BOARD.md). Nothing is written unless all boards are right, and only what reads differently.

example:
  python3 -m registers registers/boards/io_board_a.toml --out build"""


def _write(path: Path, text: str) -> None:
    """Unchanged files keep their time, and no reader sees half a file."""
    data = text.encode()
    if path.is_file() and path.read_bytes() == data:
        return
    part = path.with_name(path.name + ".part")
    part.write_bytes(data)
    part.replace(path)
    print(f"wrote {path}")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="registers", description=_HELP,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("boards", nargs="+", type=Path, metavar="BOARD.toml")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="where to write")
    options = parser.parse_args(arguments)
    files: dict[str, str] = {}
    complaints = []
    places: list = []
    for path in options.boards:
        try:
            board = read(path)
        except (TomlError, OSError, UnicodeDecodeError) as error:
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
        options.out.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            _write(options.out / name, text)
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
