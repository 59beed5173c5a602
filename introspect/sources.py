# SPDX-License-Identifier: Apache-2.0
"""Which headers are read, and how they are named: in full, in the model, to people."""
from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from introspect.errors import HeaderError, Problem
from introspect.model import Kind


@dataclass(frozen=True)
class Source:
    """Headers to be read: those of a folder and its subfolders, or a single one.

    root     what `#include "..."` and the model's `header` are relative to
    path     of the folder or header, relative to root
    kind     what its interfaces are: Kind.MODULE (reset and update in C) or Kind.MODEL
    library  to which its declarations belong
    """
    root: Path
    path: str
    kind: Kind
    library: str


def find_headers(source: Source) -> tuple[list[str], list[str]]:
    """The headers (`*.h`) of a source, C++ too, and the folders that were searched for them."""
    top = os.path.normpath(os.path.join(source.root, source.path))
    if os.path.isfile(top):
        return [top], []
    if not os.path.isdir(top):
        raise FileNotFoundError(f"{top}: no such folder or header")
    headers, folders = [], []
    for folder, subfolders, files in os.walk(top):
        subfolders[:] = sorted(name for name in subfolders if not name.startswith((".", "__")))
        folders.append(folder)
        headers += [os.path.join(folder, name) for name in sorted(files) if name.endswith(".h")]
    return headers, folders


_CPP = re.compile(r"^\s*(?:(?:inline\s+)?namespace\s+\w|#\s*include\s*<\w+>|template\s*<)", re.M)
_COMMENT = re.compile(r"""//[^\n]*|/\*.*?\*/|("(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')""", re.S)
_CONDITION = re.compile(r"\s*#\s*(ifdef|ifndef|if|elif|else|endif)\b(.*)")


def is_cpp(text: str) -> bool:
    """Whether a header is C++, as those of the models' behaviour are: it opens a namespace,
    declares a template, or includes a header without .h; and does so for a compiler of C, too."""
    return bool(_CPP.search(_for_c(uncommented(text))))


def uncommented(text: str) -> str:
    """The same lines of C without comments."""
    return _COMMENT.sub(lambda match: match[1] or "\n" * match[0].count("\n"), text)


def _for_c(text: str) -> str:
    """Without the lines that stand there for C++ alone, by #if and the like."""
    lines, holds = [], []       # of the conditions around a line: whether they hold in C; None: it may be
    for line in text.splitlines():
        if match := _CONDITION.match(line):
            word, condition = match.groups()
            if word.startswith("if"):
                holds.append(_holds(word, condition))
            elif holds and word == "elif":
                holds[-1] = False if holds[-1] else _holds(word, condition)
            elif holds and word == "else":
                holds[-1] = None if holds[-1] is None else not holds[-1]
            elif holds:
                holds.pop()
        elif False not in holds:
            lines.append(line)
    return "\n".join(lines)


def _holds(word: str, condition: str) -> bool | None:
    """Whether a condition holds in C; None if it is about something else than C++."""
    if "__cplusplus" not in condition or "||" in condition:
        return None
    return word == "ifndef" or bool(re.search(r"!\s*defined\W+__cplusplus", condition))


class Headers:
    """All C headers of some sources. Paths are absolute except where a comment says otherwise."""

    def __init__(self, sources: Sequence[Source], include: Iterable[Path]):
        self.sources: dict[str, Source] = {}  # by header, in the order of paths
        self.folders: set[str] = set()        # that were searched
        self.ignored: set[str] = set()        # headers in C++
        self._shown: dict[str, str] = {}      # as the caller would write it
        texts: dict[str, str] = {}
        for source in sources:
            headers, folders = find_headers(source)
            self.folders.update(map(os.path.abspath, folders))
            for header in headers:
                path = os.path.abspath(header)
                text = Path(header).read_text(encoding="utf-8", errors="replace")
                if is_cpp(text):
                    self.ignored.add(path)
                else:
                    self.sources[path], self._shown[path], texts[path] = source, header, text
        self.sources = dict(sorted(self.sources.items()))
        self.roots = list(dict.fromkeys(
            os.path.abspath(path) for path in [s.root for s in sources] + list(include)))
        self.libraries = tuple(dict.fromkeys(source.library for source in sources))
        self._refuse_shared_guards(texts)

    def show(self, path: str) -> str:
        """As the caller would write it."""
        return self._shown.get(os.path.abspath(path), path)

    def no_utf8(self, path: str) -> HeaderError:
        """Why the comments of a header cannot be read: each line that is not in UTF-8."""
        problems = []
        for n, line in enumerate(Path(path).read_bytes().splitlines(), 1):
            try:
                line.decode("utf-8")
            except UnicodeDecodeError as error:
                problems.append(Problem(self.show(path), n, "a header is in UTF-8",
                                        f"0x{line[error.start]:02X}, byte {error.start + 1} of the line",
                                        "save it as UTF-8"))
        return HeaderError(problems)

    def relative(self, path: str) -> str:
        """As `#include` would write it."""
        for root in self.roots:
            if path.startswith(root + os.sep):
                return os.path.relpath(path, root).replace(os.sep, "/")
        return path

    def library(self, path: str) -> str:
        """The library that owns a header; empty if the command does not name it."""
        source = self.sources.get(path)
        return source.library if source else ""

    def _refuse_shared_guards(self, texts: dict[str, str]) -> None:
        """The preprocessor would skip the second header with the same guard, without a message."""
        first: dict[str, str] = {}
        problems = []
        for path, text in sorted(texts.items()):
            text = uncommented(text)
            guard = re.search(r"^\s*#\s*ifndef\s+(\w+)\s+#\s*define\s+\1\b", text, re.M)
            if guard and first.setdefault(guard[1], path) != path:
                line = text.count("\n", 0, guard.start(1)) + 1
                problems.append(Problem(
                    self.show(path), line, "an include guard is a header's own",
                    f"`{guard[1]}` also guards {self.show(first[guard[1]])}",
                    "name it after the header's path"))
        if problems:
            raise HeaderError(problems)
