# SPDX-License-Identifier: Apache-2.0
"""What every program that generates files needs: to write them, to say what they follow from, and to hash
descriptions."""
import os
import sys
from collections.abc import Iterable
from pathlib import Path


def write_if_changed(path: Path, text: str) -> bool:
    """Write a file unless it has this text already; True if it was written. An unchanged file keeps its time, and a
    reader never sees half a file."""
    data = text.encode()
    if path.is_file() and path.read_bytes() == data:
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_bytes(data)
    part.replace(path)
    return True


def depfile(target: Path, needed: Iterable[str | Path]) -> str:
    """For Ninja and make: the target depends on these files and folders, and on the modules of this program."""
    program = [getattr(module, "__file__", None) for name, module in sys.modules.items()
               if name.split(".")[0] in ("introspect", "registers", "__main__") and not name.endswith("_test")]
    paths = sorted({os.path.abspath(path) for path in [*needed, *filter(None, program)]})
    escaped = [path.replace(" ", "\\ ").replace("#", "\\#").replace("$", "$$") for path in paths]
    return f"{target}: \\\n  " + " \\\n  ".join(escaped) + "\n"


def fnv1a(text: str) -> int:
    """The 64-bit FNV-1a hash of a text."""
    value = 0xCBF29CE484222325
    for byte in text.encode():
        value = (value ^ byte) * 0x100000001B3 % (1 << 64)
    return value
