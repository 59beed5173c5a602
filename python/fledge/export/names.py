# SPDX-License-Identifier: Apache-2.0
"""Names in C for what has a name in Python."""
from __future__ import annotations

import re
from collections.abc import Iterable

from introspect.keywords import C
from introspect.model import snake as snake


def camel(name: str) -> str:
    """nadir_spin -> NadirSpin"""
    return "".join(word[:1].upper() + word[1:] for word in name.split("_"))


def identifier(text: str) -> str:
    """An identifier of C: what is no letter or digit becomes one underscore, a keyword gets one behind it."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "unnamed"
    if name[0].isdigit():
        name = "n" + name
    return name + "_" if name in C else name


def distinct(texts: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Text -> identifier for each. Where two would share one, or differ in case only, which enumerators do not
    show, the later has a number behind it."""
    names, used = {}, {name.lower() for name in taken}
    for text in texts:
        name = stem = identifier(text)
        n = 2
        while name.lower() in used:
            name, n = f"{stem}_{n}", n + 1
        used.add(name.lower())
        names[text] = name
    return names
