# SPDX-License-Identifier: Apache-2.0
"""The folders of a project and of missions, and what the files of a mission declare. Nothing is executed here."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path


def project() -> Path | None:
    """The project's folder, or None. Raises SetupError if FLEDGE_PROJECT names no folder."""
    named = os.environ.get("FLEDGE_PROJECT")
    if not named:
        return None
    if not Path(named).is_dir():
        from fledge.errors import SetupError    # the extension's

        raise SetupError(f"FLEDGE_PROJECT: there is no folder {named}")
    return Path(named).resolve()


def has_code(project: Path) -> bool:
    """Whether CMake has something to compile in a project: its CMakeLists.txt does more than `fledge new project`
    writes, or lists sources in fledge_project()."""
    import re

    try:
        text = (project / "CMakeLists.txt").read_text(encoding="utf-8", errors="replace")
    except OSError:
        text = ""
    calls = [(name.lower(), words.split()) for name, words in
             re.findall(r"(\w+)\s*\(([^()]*)\)", re.sub("#.*", "", text))]
    of_ours = [set(words[1:]) - {"FLIGHT", "WORLD", "EXISTING", "NOT_FLOWN"} for name, words in calls
               if name == "fledge_project"]
    empty = {"cmake_minimum_required", "project", "find_package", "fledge_project"}
    return not of_ours or any(of_ours) or any(name not in empty for name, _ in calls)


def not_for_cmake(path: Path) -> str:
    """Why CMake and Ninja cannot build in a path; "" if they can."""
    bad = next((c for c in str(path) if c in '"#;\\' or c < " "), "")
    return f"{path}: CMake builds nothing in a path with {bad!r}" if bad else ""


def of_missions() -> Iterator[Path]:
    """The folders of missions: the project's, ./missions, then the one beside this package."""
    if own := project():
        yield own / "missions"
    yield Path.cwd() / "missions"
    for parent in Path(__file__).resolve().parents:
        if (parent / "missions").is_dir():
            yield parent / "missions"
            break


def missions() -> dict[str, Path]:
    """The folder of each mission by its name."""
    folders: dict[str, Path] = {}
    for place in of_missions():
        for folder in sorted(place.iterdir()) if place.is_dir() else ():
            if is_mission(folder):
                folders.setdefault(folder.name, folder)
    return folders


def is_mission(folder: Path) -> bool:
    return any((folder / file).is_file() for file in ("flight.py", "mission.py"))


def summaries(mission: Path, of_functions: str = "scenarios.py") -> dict[str, str]:
    """Name -> first line of the docstring, of the mission (under "") and of each scenario; of each campaign with
    "dispersions.py"."""
    import ast

    names = {"": ""}
    for file in ("mission.py", "flight.py", of_functions):
        path = mission / file
        if not path.exists():
            continue
        try:
            tree = ast.parse(source(path))
        except SyntaxError as error:
            return {"": f"{path}, line {error.lineno}: {error.msg}"}
        if file != of_functions:
            names[""] = first_line(ast.get_docstring(tree)) or names[""]
        else:
            names.update((node.name, first_line(ast.get_docstring(node))) for node in tree.body
                         if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
                         and len(node.args.args) == 1)
    return names


def source(path: Path) -> str:
    """The text of a file of Python. Raises SyntaxError if it is not in UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise SyntaxError(f"0x{error.object[error.start]:02X} is no UTF-8; save the file as UTF-8",
                          (str(path), line, None, None)) from None


def first_line(text: str | None) -> str:
    """The first line of a docstring."""
    return (text or "").strip().split("\n")[0]
