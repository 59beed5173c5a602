# SPDX-License-Identifier: Apache-2.0
"""The source that an app takes along: every file that it needs, and a name of its own for every function and table
in them, so that two apps can be linked into one core.

The names are changed by a header of #defines, which each file includes first; otherwise a copy equals the file.
"""
from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.export.read import ExportError, Mission

if TYPE_CHECKING:
    from fledge.targets.cfs.export.app import App

# Of Fledge's own, what every app needs besides its modules.
ALWAYS = ["flight/command/command.c", "flight/command/rules.c", "flight/telemetry/telemetry.c"]
REGISTERS = ["registers/lane.c", "registers/field.c",
             "registers/clock.c", "registers/message.c", "targets/mission_io.c"]
SIMULATED = ["registers/shared_file.c"]
WATCHED = ["targets/mission_host.c", "targets/cfs/watch.c", "record/mcap.c", "record/mcap_crc.c", "record/file_sink.c"]
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)"', re.MULTILINE)
WORD = re.compile(r"[A-Za-z_]\w*")
NO_NAMES = frozenset(["if", "for", "while", "switch", "return", "sizeof", "do", "else"])


def collect(mission: Mission, roots: Sequence[Path], generated: dict[str, str], more: Sequence[str] = ()) -> dict[str,
                                                                                                                  str]:
    """Path -> text of the C files and headers that the mission's modules, the registers and `generated` (name ->
    text) include and call, from the folders `roots`."""
    files = {}

    def take(path: str, by: str) -> None:
        if path in files or path in generated:
            return
        file = next((root / path for root in roots if (root / path).is_file()), None)
        if file is None:
            raise ExportError(f"{by} needs {path}, which is in none of {', '.join(map(str, roots))}")
        files[path] = file.read_text(encoding="utf-8")
        for other in INCLUDE.findall(files[path]):
            take(relative(other, path, roots), path)

    for name, text in generated.items():
        for other in INCLUDE.findall(text):
            if "/" in other:
                take(other, name)
    for path in [*mission.sources(roots), *ALWAYS, *more]:
        take(path, mission.title)
    if "targets/mission_packets.h" in files:    # a board has numbers in packets
        take("targets/mission_packets.c", mission.title)
    # Functions that are called and not defined yet: take the C files beside the headers that define them.
    beside = candidates(files, roots)
    while True:
        words = set(WORD.findall("\n".join(files.values())))
        more = [path for path, names in beside.items() if path not in files and names & words]
        if not more:
            return dict(sorted(files.items()))
        for path in more:
            take(path, mission.title)


def relative(include: str, path: str, roots: Sequence[Path]) -> str:
    """What a file includes, from a root: beside itself, or from there."""
    beside = (Path(path).parent / include).as_posix()
    return beside if any((root / beside).is_file() for root in roots) else include


def candidates(files: Iterable[str], roots: Sequence[Path]) -> dict[str, set[str]]:
    """Path -> what it defines, of the C files in the folders of those found, without tests and tools."""
    folders = {Path(path).parent for path in files}
    result = {}
    for folder in sorted(folders):
        for root in roots:
            for file in sorted((root / folder).glob("*.c")):
                path = (folder / file.name).as_posix()
                if path not in result and not path.endswith("_proof.c") and folder.parts[:1] not in (
                        ("registers",), ("targets",), ("record",)):
                    names = external(file.read_text(encoding="utf-8"))
                    if "main" not in names:
                        result[path] = names
    return result


def external(text: str) -> set[str]:
    """The functions and objects that a C file defines for others."""
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL)
    text = re.sub(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', '""', text)
    text = re.sub(r"//[^\n]*", " ", text)
    text = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", " ", text, flags=re.MULTILINE)
    names = set()
    for head, body in declarations(text):
        head = " ".join(head.split())
        words = WORD.findall(head)
        if not words or {"static", "typedef"} & set(words) or "extern" in words and "=" not in head:
            continue
        before = head.partition("=")[0]
        call = re.match(r"(?:[\w*\s]|__attribute__\s*\(\(.*?\)\)\s)*?\b(\w+)\s*\(", before)
        if call:
            if body and "=" not in head and call[1] not in NO_NAMES:
                names.add(call[1])
            continue
        if len(words) > 1 and not re.fullmatch(r"(?:struct|enum|union)\s+\w+", before.strip()):
            for word in before.split(","):               # `S *two, x[3];` has two
                declared = re.search(r"([A-Za-z_]\w*)\s*(?:\[[^\]]*\]\s*)*$", word.strip())
                if declared:
                    names.add(declared[1])
    return names


def declarations(text: str) -> Iterator[tuple[str, bool]]:
    """(text, whether a body follows) of what stands outside of all braces."""
    depth, start, i = 0, 0, 0
    head = ""
    while i < len(text):
        c = text[i]
        if c == "{":
            if depth == 0:
                head += text[start:i]
            depth += 1
        elif c == "}":
            depth -= 1
            if depth == 0:
                start = i + 1
                is_function = head.rstrip().endswith(")") and "=" not in head
                if is_function:
                    yield head, True
                    head = ""
        elif c == ";" and depth == 0:
            yield head + text[start:i], False
            head, start = "", i + 1
        i += 1


def names_header(app: App, texts: Iterable[str]) -> str:
    """The header of #defines for all that is external in these C files; the entry point stays."""
    names = sorted(set().union(*(external(text) for text in texts)) - {f"{app.prefix}_AppMain"})
    names = [name for name in names if not name.startswith(f"{app.prefix}_")]
    guard = f"{app.prefix}_NAMES_H"
    return "\n".join(["/* SPDX-License-Identifier: Apache-2.0 */",
                      f"/* All external names of {app.prefix} begin with {app.prefix}_: other apps may contain the",
                      " * same source, and one core may be linked with all of them. */",
                      f"#ifndef {guard}", f"#define {guard}", "",
                      *(f"#define {name} {app.prefix}_{name}" for name in names), "", "#endif", ""])


def renamed(app: App, text: str) -> str:
    """A C file with the header of names in front."""
    return f'#include "{app.name}_names.h"\n' + text
