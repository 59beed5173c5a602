# SPDX-License-Identifier: Apache-2.0
"""For tests: small folders of headers, written and read."""
from __future__ import annotations

from pathlib import Path

from introspect.model import Kind, Model
from introspect.reader import read
from introspect.sources import Source

ROOT = Path(__file__).resolve().parent.parent

PRELUDE = '#include "flight/math/vec.h"\n#include "flight/msg/head.h"\n'


def write_header(root: Path, path: str, body: str) -> Path:
    """A header with an include guard of its own, and vectors and Head at hand."""
    file = root / path
    file.parent.mkdir(parents=True, exist_ok=True)
    guard = path.upper().replace("/", "_").replace(".", "_")
    text = f"#ifndef {guard}\n#define {guard}\n{PRELUDE}{body}\n#endif\n"
    file.write_text(text, encoding="utf-8")
    return file


def read_tree(root: Path) -> Model:
    """Modules in m/, models in w/, both of a library `user` that stands outside this repository."""
    sources = [Source(root, path, kind, "user") for path, kind in
               (("m", Kind.MODULE), ("w", Kind.MODEL)) if (root / path).is_dir()]
    return read(sources, include=[ROOT])


def read_this() -> Model:
    """The headers of this repository."""
    return read([Source(ROOT, "flight", Kind.MODULE, "flight"),
                 Source(ROOT, "world", Kind.MODEL, "world")])
