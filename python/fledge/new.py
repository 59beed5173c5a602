# SPDX-License-Identifier: Apache-2.0
"""`fledge new`: begin a module, model, mission or project.

It copies templates/, a project that works, under other names. It checks all names and files before it writes, and
never overwrites a file.
"""
from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

from introspect import keywords

TEMPLATES = Path(__file__).with_name("templates")
FLEDGE = Path(__file__).resolve().parents[2]
EDITOR = ("pyproject.toml", ".clangd")      # how an editor finds types and compilation commands

# Libraries, namespaces and CMake targets that a project's name would hide.
_TAKEN = set("all clean fledge flight help install math package record sim std tables test tests world".split())


class NewError(Exception):
    """Why a name or a file cannot be made."""


def snake(name: str) -> str:
    """MrpFeedback -> mrp_feedback, as the reader of headers does it."""
    words = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name)
    return re.sub(r"([A-Z])([A-Z][a-z])", r"\1_\2", words).lower()


def module(name: str, project: Path | str | None = None, source: str | None = None) -> tuple[list[Path], str]:
    """Begin a flight module: its interface, its C, its test, and its line for CMake.

    name: "SunSlew", or "guidance/SunSlew" for a subfolder of flight/; project: its folder, else Fledge
    itself; source: of a prototype whose interface it gets, "missions/turn/prototypes.py:SunSlew". Returns (files
    written, advice for the next step). Raises NewError.
    """
    return _type("module", name, project, "flight", "control", "TorqueLimiter", (".h", ".c", "_test.cpp"), source)


def model(name: str, project: Path | str | None = None, source: str | None = None) -> tuple[list[Path], str]:
    """Begin a model of the world: its interface, its class in C++, its test, and its line for CMake."""
    return _type("model", name, project, "world", "dynamics", "EddyDamping",
                 (".h", "_model.h", "_model.cpp", "_model_test.cpp"), source)


def _type(kind: str, name: str, project: Path | str | None, top: str, default: str, theirs: str,
          endings: tuple[str, ...], source: str | None) -> tuple[list[Path], str]:
    """top: the folder; default: its subfolder within Fledge; theirs, endings: the name and the files of the template"""
    root = _root(project)
    *folders, name = name.removeprefix(f"{top}/").split("/")
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
        raise NewError(f"a {kind}'s name is CamelCase, of letters and digits, such as {theirs}; found '{name}'")
    if not all(re.fullmatch(r"[a-z][a-z0-9_]*", f) for f in folders):
        raise NewError(f"folders in {top}/ are in small letters; found '{'/'.join(folders)}'")
    _no_keyword(snake(name), name)
    for tree in dict.fromkeys((root, FLEDGE)):
        for declared, header in _declared(tree):
            if declared.lower() == name.lower():
                raise NewError(f"{declared} is declared in {tree / header} already; choose another name")
    folder = "/".join([top, *(folders or ([] if project else [default]))])
    path, old = f"{folder}/{snake(name)}", f"{top}/{snake(theirs)}"

    namespace = _namespace(root) if project else "fledge::world"
    names = {old: path, old.upper().replace("/", "_"): path.upper().replace("/", "_"),
             theirs: name, snake(theirs): snake(name), "my_sat": namespace}
    texts = {root / (path + ending): _text(old + ending, names) for ending in endings} if source is None else \
        _from_prototype(kind, source, name, path, root, namespace)
    file, text = (_project_line(root, top.upper(), path) if project
                  else _module_line(root, path) if kind == "module" else _model_line(root, path, source is None))
    _write(texts)
    file.write_text(text, encoding="utf-8")
    library = "fsw" if kind == "module" else "world"
    return [*texts, file], (f"In a mission's {top}.py, it is {library}.{name}. "
                            f"Its test: {_command(project)} test -k {name}")


def _from_prototype(kind: str, source: str, name: str, path: str, root: Path, namespace: str) -> dict[Path, str]:
    """The texts of a module or model whose interface is that of a prototype."""
    from fledge import prototype
    from fledge.errors import SetupError
    from fledge.prototype import frame

    try:
        cls = prototype.load(source)
    except SetupError as error:
        raise NewError(f"--from {source}: {error}") from None
    if cls._kind.value != kind:
        raise NewError(f"--from {source}: it is a {cls._kind.value}: ./fledge new {cls._kind.value} {name} --from ...")
    declared = {one: str(header) for tree in (FLEDGE, root) for one, header in _declared(tree)}
    texts = frame.files(cls, Path(source.rpartition(":")[0]).resolve(), name, path, root.resolve(), namespace, declared)
    return {root / (path + ending): text for ending, text in texts.items()}


def mission(name: str, project: Path | str | None = None) -> tuple[list[Path], str]:
    """Begin a mission: its flight software, its world, a scenario, and the test that flies it."""
    name = snake(name) if name[:1].isupper() else name
    _no_keyword(name, name)
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise NewError(f"a mission's name is of small letters, digits and _, such as first_light; found '{name}'")
    root = _root(project)
    folder = root / "missions" / name
    if folder.exists():
        raise NewError(f"{folder} is there already; choose another name")
    texts = {folder / file.replace("first_light", name): _text(f"missions/first_light/{file}", {"first_light": name})
             for file in ("flight.py", "world.py", "scenarios.py", "first_light_test.py")}
    _write(texts)
    return list(texts), f"Fly it: {_command(project)} run {name}"


def project(folder: Path | str) -> tuple[list[Path], str]:
    """Begin a project: a folder outside Fledge for the user's own modules, models and missions."""
    folder = Path(folder)
    name = snake(folder.resolve().name).replace("-", "_")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise NewError(f"a project's folder is named with letters, digits, _ and -; found '{folder.resolve().name}'")
    _no_keyword(name, name)
    if name in _TAKEN or name.startswith("fledge_"):
        raise NewError(f"the name {name} is Fledge's or CMake's own; choose another for the project")
    empty = re.sub(r"^ +(?:flight|world)/.*\n", "", _text("CMakeLists.txt", {"my_sat": name}), flags=re.M)
    texts = {folder / "CMakeLists.txt": empty, **{folder / file: _text(file, {"my_sat": name}) for file in EDITOR},
             folder / ".gitignore": "build/\nruns/\nverification/\n__pycache__/\n.*cache/\n"}
    _write(texts)
    for part in ("flight", "world", "missions"):
        (folder / part).mkdir(exist_ok=True)
    return list(texts), (f"Use it: commands in this folder and below find it; elsewhere, "
                         f"{_command(folder)} --project {shlex.quote(str(folder))} COMMAND")


def _command(project: Path | str | None) -> str:
    """How a user calls fledge: in a project's folder there is no ./fledge."""
    return "./fledge" if not project else "fledge" if shutil.which("fledge") else shlex.quote(str(FLEDGE / "fledge"))


def _root(project: Path | str | None) -> Path:
    """The project's folder, else Fledge's own. Raises NewError for an installed Fledge, which is no place for more."""
    if not project and not (FLEDGE / "CMakeLists.txt").exists():
        raise NewError("there is no project here; './fledge new project NAME' makes one, and it takes what is new")
    return Path(project) if project else FLEDGE


# --- names -----------------------------------------------------------------------------------------

def _no_keyword(name: str, given: str) -> None:
    for language, words in (("C or C++", keywords.C | keywords.CPP), ("Python", keywords.PYTHON)):
        if name in words:
            raise NewError(f"{given}: '{name}' is a keyword of {language}; choose another name")


def _declared(root: Path) -> Iterator[tuple[str, Path]]:
    """(name, header) of each struct and enum in the headers of flight/ and world/."""
    for top in ("flight", "world"):
        for header in sorted((root / top).rglob("*.h")):
            for name in re.findall(r"^\} *(\w+);", header.read_text(encoding="utf-8", errors="replace"), re.M):
                yield name, header.relative_to(root)


# --- text ------------------------------------------------------------------------------------------

def _text(template: str, names: dict[str, str]) -> str:
    """A template with other names, longer ones first."""
    pattern = "|".join(re.escape(name) for name in sorted(names, key=len, reverse=True))
    return re.sub(pattern, lambda match: names[match[0]], (TEMPLATES / template).read_text(encoding="utf-8"))


def _last(file: Path, what: str, *patterns: str) -> re.Match:
    """The last match of the first pattern that matches the text of a file. what: to name in the error"""
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise NewError(f"there is no {file}; './fledge new project' makes one") from None
    found = next(filter(None, (list(re.finditer(pattern, text, re.M)) for pattern in patterns)), None)
    if not found:
        raise NewError(f"{file}: cannot find {what}")
    return found[-1]


def _namespace(root: Path) -> str:
    """The name that a project gives to fledge_project()."""
    return _last(root / "CMakeLists.txt", "its fledge_project(NAME ...)", r"^\s*fledge_project\(\s*(\w+)")[1]


def _project_line(root: Path, list_: str, path: str) -> tuple[Path, str]:
    """(CMakeLists.txt, its text with the path at the end of a list of fledge_project())."""
    file = root / "CMakeLists.txt"
    found = _last(file, f"a line {list_} in fledge_project(), for {path}", rf"^( *){list_}\n(?:\1 +[\w/]+\n)*")
    return file, f"{found.string[:found.end()]}{found[1]}    {path}\n{found.string[found.end():]}"


def _module_line(root: Path, path: str) -> tuple[Path, str]:
    """The same for Fledge's own: after the modules of the same folder, else after all."""
    file, short = root / "flight/CMakeLists.txt", path.removeprefix("flight/")
    found = _last(file, "the list of flight_module(...)", rf"^flight_module\({short.rpartition('/')[0]}/.*\)\n",
                  r"^flight_module\(.*\)\n")
    return file, f"{found.string[:found.end()]}flight_module({short})\n{found.string[found.end():]}"


def _model_line(root: Path, path: str, tested: bool) -> tuple[Path, str]:
    """The same for Fledge's own: among the sources, and a test, if that is in C++."""
    file, short = root / "world/CMakeLists.txt", path.removeprefix("world/")
    found = _last(file, "the sources of fledge_world", r"^add_library\(fledge_world STATIC\n((?: +.*\n)+)\)")
    sources = sorted([*found[1].splitlines(), f"    {short}_model.cpp"])
    text = found.string[:found.start(1)] + "\n".join(sources) + "\n" + found.string[found.end(1):]
    test = f"world_{short.replace('/', '_')}_test"
    line = f"fledge_add_test({test}\n    SOURCES {short}_model_test.cpp LIBRARIES fledge::world)\n"
    return file, text + line * tested


def _write(texts: dict[Path, str]) -> None:
    """Write new files; none if one of them exists."""
    for path in texts:
        if path.exists():
            raise NewError(f"{path} is there already, and stays as it is")
    for path, text in texts.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "x", encoding="utf-8") as file:
            file.write(text)
