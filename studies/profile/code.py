# SPDX-License-Identifier: Apache-2.0
"""Code by its parts: the map of the linker has each section of each object, and the build its source."""
from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

from fledge.targets import build

# The part of a source: the first beginning of its path that fits.
PARTS = (("flight/command/", "commands and telemetry"), ("flight/telemetry/", "commands and telemetry"),
         ("flight/math/", "modules"), ("flight/", "modules"), ("targets/micropython/", "executive and binding"),
         ("registers/", "registers, record and host"), ("record/", "registers, record and host"),
         ("targets/", "registers, record and host"))
INTERPRETER, EXECUTIVE = "interpreter", "executive and binding"
TABLES, LIBRARY = "tables and scripts", "C library"
NAMES = (INTERPRETER, EXECUTIVE, TABLES, "modules", "commands and telemetry",
         "registers, record and host", LIBRARY)
CODE = (".text", ".rodata", ".data.rel.ro", ".traps", ".init", ".fini", ".eh_frame")
DATA = (".data", ".bss", ".noinit", "COMMON", ".tbss")


def by_part(built: Path) -> tuple[dict[str, int], int]:
    """(bytes of code and constants of each part, bytes of static memory) of a program that `build.program` linked."""
    sources = dict(re.findall(r"^build (\S+): cc (.+)$", (built.parent / "build.ninja").read_text(), re.MULTILINE))
    code: Counter[str] = Counter()
    memory = 0
    for section, size, file in sections(built.with_name(f"{built.name}.map").read_text(errors="replace")):
        if section.startswith(DATA) and not section.startswith(".data.rel.ro"):
            memory += size
        elif section.startswith(CODE):
            code[part_of(file, sources)] += size
    return {name: code[name] for name in NAMES if code[name]}, memory


def sections(text: str) -> list[tuple[str, int, str]]:
    """(section, bytes, file) of what a program contains, from GNU ld's map."""
    _, _, linked = text.partition("Linker script and memory map")
    linked = re.sub(r"^( \S+)\n +0x", r"\1 0x", linked, flags=re.MULTILINE)      # long names have a line of their own
    rows = re.findall(r"^ (\.?[\w.$*-]+) +0x[0-9a-f]+ +0x([0-9a-f]+) (\S.*)$", linked, re.MULTILINE)
    return [(name, int(size, 16), file) for name, size, file in rows if int(size, 16)]


def part_of(file: str, sources: dict[str, str]) -> str:
    """The part of an object, or of a member of an archive."""
    shared = re.search(r"/objects/[0-9a-f]{16}/(.+)$", file)
    if shared or file in sources:
        path = Path(shared[1] if shared else sources[file])
        if path.is_relative_to(build.ROOT):
            path = path.relative_to(build.ROOT)
        inside = path.as_posix()
        known = next((part for begin, part in PARTS if inside.startswith(begin)), None)
        return known or ("modules" if "/flight/" in inside else TABLES)
    archive, _, member = file.partition("(")
    if "micropython" in archive:        # the interpreter and our part of it, in one library
        return EXECUTIVE if member.startswith("micropython_") else INTERPRETER
    return LIBRARY


def stripped(built: Path, size: str) -> int:
    """The size of the file without its symbols. size: the tool of that name of the same toolchain."""
    tool = f"{size.removesuffix('size')}strip"
    if not shutil.which(tool):
        return built.stat().st_size
    out = built.with_name(f"{built.name}.stripped")
    subprocess.run([tool, "-s", "-R", ".comment", "-o", out, built], check=True)
    n = out.stat().st_size
    out.unlink()
    return n
