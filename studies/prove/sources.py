# SPDX-License-Identifier: Apache-2.0
"""What of the tree a proof reads: modules by their headers, and the C that belongs to a header or source.

A header's C is the source beside it that has its name; that of flight/math is in several sources.
"""
from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from fledge.disk import ROOT
from introspect.model import Kind, Struct
from introspect.reader import read
from introspect.sources import Source

INCLUDED = re.compile(r'^[ \t]*#[ \t]*include[ \t]+"([^"]+)"', re.M)
MATH = tuple(f"flight/math/{name}.c" for name in ("exp_log", "inverse_trig", "reduction", "trig"))
OWN = ("flight", "ccsds")       # folders whose C is proved


@dataclass(frozen=True)
class Tree:
    """roots: what #include is relative to; the first is the project's or checkout's, whose code is proved."""
    roots: tuple[Path, ...]

    @classmethod
    def of(cls, project: Path | None) -> Tree:
        """That of a project, else of Fledge."""
        return cls((project, ROOT) if project and project != ROOT else (ROOT,))

    def find(self, name: str) -> Path | None:
        """The file that `#include "NAME"` means."""
        return next((root / name for root in self.roots if (root / name).is_file()), None)

    def closure(self, *names: str, with_c: bool = True, without: Collection[str] = ()) -> dict[str, str]:
        """The texts of these files and of all that they include, by name; with_c: with the C of each header, but for
        the files `without`."""
        texts: dict[str, str] = {}
        left = list(names)
        while left:
            name = left.pop()
            if name in texts or name in without or (path := self.find(name)) is None:
                continue
            texts[name] = path.read_text(encoding="utf-8", errors="replace")
            left += [near for included in INCLUDED.findall(texts[name]) for near in self._near(included, name)]
            if with_c:
                left += [name.removesuffix(".h") + ".c"] * name.endswith(".h")
                left += MATH if name.startswith("flight/math/") else ()
        return dict(sorted(texts.items()))

    def _near(self, included: str, name: str) -> list[str]:
        """An included file may also be named from the folder of the file that includes it."""
        beside = f"{Path(name).parent.as_posix()}/{included}"
        return [included if self.find(included) else beside]

    def modules(self) -> dict[str, Struct]:
        """The modules of the first root, by name. Raises HeaderError."""
        if not (self.roots[0] / "flight").is_dir():
            return {}
        model = read([Source(self.roots[0], "flight", Kind.MODULE, "own")], self.roots[1:])
        return {s.name: s for s in model.structs.values() if s.kind is Kind.MODULE and s.library == "own"}

    def proofs(self) -> Iterator[str]:
        """The drivers that are written by hand, x_proof.c beside what they drive."""
        for folder in OWN:
            for path in sorted((self.roots[0] / folder).rglob("*_proof.c")):
                yield path.relative_to(self.roots[0]).as_posix()


def named(of: Sequence[str], name: str) -> bool:
    """Whether a name of the command line means one of these: a module, or a folder of its file."""
    return any(name == word or word.startswith(name.rstrip("/") + "/") for word in of)
