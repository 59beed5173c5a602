# SPDX-License-Identifier: Apache-2.0
"""A project: a folder outside Fledge with modules, models and missions of one's own.

`./fledge --project DIR COMMAND` builds the libraries of DIR/CMakeLists.txt into DIR/build/<preset>, or into a folder
beside it if another Fledge has that one, and sets FLEDGE_PROJECT, FLEDGE_PROJECT_BUILD and FLEDGE_PRESET. Then
`fledge.flight` also has the project's modules, `fledge.world` its models, and the search for missions begins in
DIR/missions.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Any

from fledge import _core
from fledge.errors import SetupError
from fledge.folders import has_code, project as folder


def types(part: str) -> dict[str, Any]:
    """Name -> type of the project's modules, models and messages with headers in `part`/: "flight" or "world".
    Raises SetupError if the project is not built or declares a name of Fledge's."""
    return {name: type_ for _, theirs in _libraries().values() for name, type_ in theirs.items()
            if _core.struct(type_).folder.split("/")[0] == part}


def unbuilt(part: str, name: str) -> str:
    """Why the project has no type of this name although a header for it lies in `part`/; "" if there is none."""
    project = folder()
    headers = sorted((project / part).rglob("*.h")) if project else []
    header = next((h for h in headers if h.stem.replace("_", "") == name.lower()), None)
    if not project or not header:
        return ""
    path = header.relative_to(project).with_suffix("").as_posix()
    file = project / "CMakeLists.txt"
    listed = path in file.read_text(encoding="utf-8", errors="replace")
    reason = ("it is not built: ./fledge setup builds it" if listed else
              f"{file} does not list it: add {path} below {part.upper()} in fledge_project()")
    return f"there is no {name}: {path}.h exists, but {reason}"


def owners() -> dict[str, tuple[str, Path] | None]:
    """Type -> (name, file) of its library, of all types that have headers; None: it is Fledge's."""
    fledge = {name: None for part in ("flight", "world") for name in _core.library(part)}
    return fledge | {name: (library, file) for library, (file, theirs) in _libraries().items() for name in theirs}


def files() -> list[Path]:
    """What is loaded: the extension, and the project's libraries."""
    return [Path(str(_core.__file__)), *(file for file, _ in _libraries().values())]


@cache
def _libraries() -> dict[str, tuple[Path, dict[str, Any]]]:
    """Name -> (file, types by name) of the project's libraries."""
    project = folder()
    if project is None or not has_code(project):
        return {}
    build = Path(os.environ.get("FLEDGE_PROJECT_BUILD")
                 or project / "build" / os.environ.get("FLEDGE_PRESET", "release"))
    if observed := os.environ.get("FLEDGE_OBSERVED"):
        build /= f"python_{observed}"
    try:
        lines = (build / "fledge-libraries.txt").read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        raise SetupError(f"the project {project} is not built ({build}); "
                         f"./fledge --project {project} setup builds it") from None
    fledge = {**_core.library("flight"), **_core.library("world")}
    types_: dict[str, Any] = {}
    found = {}
    for line in lines:
        name, path = line.split(" ", 1)
        theirs = _core.load_library(path, name)
        for taken in sorted(theirs.keys() & (fledge.keys() | types_.keys())):
            owner = _core.struct({**types_, **fledge}[taken]).header
            raise SetupError(f"the library {name} declares {taken}, and so does {owner} of "
                             f"{'Fledge' if taken in fledge else 'this project'}: rename it")
        types_.update(theirs)
        found[name] = Path(path), theirs
    return found
