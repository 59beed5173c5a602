# SPDX-License-Identifier: Apache-2.0
"""`fledge new`: begin a module, model, mission or project.

It fills the frames of templates/ with a kind of module or model, and copies missions under other names. It checks all
names and files before it writes, and never overwrites a file.
"""
from __future__ import annotations

import ast
import os
import re
import shlex
import shutil
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from string import Template

from fledge import __version__, folders
from fledge.disk import write_files
from fledge.errors import did_you_mean
from introspect import keywords

TEMPLATES = Path(__file__).with_name("templates")
FLEDGE = Path(__file__).resolve().parents[2]
FILES = ("CMakeLists.txt", "pyproject.toml", ".clangd")     # for the build; for editors: types, compilation commands

# Libraries, namespaces and CMake targets that a project's name would hide.
_TAKEN = set("all clean fledge flight help install math package record sim std tables test tests world".split())


class NewError(Exception):
    """Why a name or a file cannot be made."""


def snake(name: str) -> str:
    """MrpFeedback -> mrp_feedback, as the reader of headers does it."""
    words = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name)
    return re.sub(r"([A-Z])([A-Z][a-z])", r"\1_\2", words).lower()


def module(name: str, project: Path | str | None = None, source: str | None = None,
           kind: str | None = None) -> tuple[list[Path], str]:
    """Begin a flight module: its interface, its C, its test, and its line for CMake.

    name: "SunSlew", or "guidance/SunSlew" for a subfolder of flight/; project: its folder, else Fledge
    itself; source: of a prototype whose interface it gets, "missions/turn/prototypes.py:SunSlew"; kind: "guidance",
    "control", "determination", "sensing" or "bare", else that of which its subfolder has the name, else "bare". Returns
    (files written, advice for the next step). Raises NewError.
    """
    return _type("module", name, project, "flight", "control", (".h", ".c", "_test.cpp"), source, kind)


def model(name: str, project: Path | str | None = None, source: str | None = None,
          kind: str | None = None) -> tuple[list[Path], str]:
    """Begin a model of the world, "sensing" or "bare": its interface, its class in C++, its test, and its line for
    CMake."""
    return _type("model", name, project, "world", "dynamics", (".h", "_model.h", "_model.cpp", "_model_test.cpp"),
                 source, kind)


def _type(what: str, name: str, project: Path | str | None, top: str, default: str, endings: tuple[str, ...],
          source: str | None, kind: str | None) -> tuple[list[Path], str]:
    """top: the folder; default: its subfolder within Fledge; endings: of the files"""
    root = _root(project)
    *parts, name = name.removeprefix(f"{top}/").split("/")
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
        raise NewError(f"a {what}'s name is CamelCase, of letters and digits, such as SunSlew; found '{name}'")
    if not all(re.fullmatch(r"[a-z][a-z0-9_]*", f) for f in parts):
        raise NewError(f"folders in {top}/ are in small letters; found '{'/'.join(parts)}'")
    _no_keyword(snake(name), name)
    for tree in dict.fromkeys((root, FLEDGE)):
        for declared, header in _declared(tree):
            if declared.lower() == name.lower():
                raise NewError(f"{declared} is declared in {tree / header} already; choose another name")
    path = "/".join([top, *(parts or ([] if project else [default])), snake(name)])
    namespace = _namespace(root) if project else "fledge::world"
    if source is None:
        texts = _framed(what, top, kind, parts[-1] if parts else "", endings, {
            "Name": name, "name": snake(name), "path": path, "GUARD": path.upper().replace("/", "_"),
            "namespace": namespace})
    else:
        texts = _from_prototype(what, source, name, path, root, namespace)
    file, text = (_project_line(root, top.upper(), path) if project
                  else _module_line(root, path) if what == "module" else _model_line(root, path, source is None))
    written = {root / (path + ending): text for ending, text in texts.items()}
    _write(written)
    write_files({file.name: text.encode("utf-8", "surrogateescape")}, file.parent)
    library = "fsw" if what == "module" else "world"
    return [*written, file], (f"In a mission's {top}.py, it is {library}.{name}. "
                              f"Its test: {_command(project)} test -k {name}")


def _framed(what: str, top: str, kind: str | None, folder: str, endings: tuple[str, ...],
            names: Mapping[str, str]) -> dict[str, str]:
    """Ending -> text: the frames of modules or models, filled with a kind's pieces from kinds.toml."""
    kinds = tomllib.loads((TEMPLATES / "kinds.toml").read_text(encoding="utf-8"))[what]
    kind = kind or (folder if folder in kinds else "bare")
    if kind not in kinds:
        raise NewError(f"there is no {what} of the kind {kind}; there are {', '.join(kinds)}")
    pieces = {piece: Template(text).substitute(names) for piece, text in kinds[kind].items()}
    return {ending: Template((TEMPLATES / top / f"{what}{ending}.in").read_text(encoding="utf-8")).substitute(
        defaultdict(str, names | pieces)) for ending in endings}


def _from_prototype(what: str, source: str, name: str, path: str, root: Path, namespace: str) -> dict[str, str]:
    """Ending -> text of a module or model whose interface is that of a prototype."""
    from fledge import prototype
    from fledge.errors import SetupError
    from fledge.prototype import frame

    try:
        cls = prototype.load(source)
    except SetupError as error:
        raise NewError(f"--from {source}: {error}") from None
    if cls._kind.value != what:
        raise NewError(f"--from {source}: it is a {cls._kind.value}: ./fledge new {cls._kind.value} {name} --from ...")
    declared = dict((type_, str(header)) for tree in (FLEDGE, root) for type_, header in _declared(tree))
    return frame.files(cls, Path(source.rpartition(":")[0]).resolve(), name, path, root.resolve(), namespace, declared)


def mission(name: str, project: Path | str | None = None, source: str | None = None) -> tuple[list[Path], str]:
    """Begin a mission: its flight software, its world, a scenario, and the test that flies it.

    source: name or folder of another mission that it copies, else that of templates/. If that has no test, such as a
    mission of an installed Fledge, it gets one that flies all scenarios.
    """
    name = snake(name) if name[:1].isupper() else name
    _no_keyword(name, name)
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise NewError(f"a mission's name is of small letters, digits and _, such as first_light; found '{name}'")
    root = _root(project)
    folder = root / "missions" / name
    if folder.exists():
        raise NewError(f"{folder} is there already; choose another name")
    known = _missions(root)
    if name in known:
        raise NewError(f"{known[name]} has this name, and would be hidden; choose another name")
    template = TEMPLATES / "missions/first_light"
    texts = _copied(template if source is None else _source(source, root, known), folder)
    if not any(text.name.endswith("_test.py") for text in texts):
        texts[folder / f"{name}_test.py"] = _read(template / "first_light_test.py")
    _write(texts)
    return list(texts), f"Fly it: {_command(project)} run {name}"


def _missions(root: Path) -> dict[str, Path]:
    """The folder of each mission that a project finds, by its name."""
    own = [path for path in sorted((root / "missions").glob("*")) if folders.is_mission(path)]
    return folders.missions() | {mission.name: mission for mission in own}


def _source(source: str, root: Path, known: Mapping[str, Path]) -> Path:
    """The folder of a mission, by its name or path, which flies in the project `root` too."""
    folder = known.get(source) or Path(source)
    if not folders.is_mission(folder):
        if folder.is_dir():
            raise NewError(f"--from {source}: a mission is a folder with a flight.py or a mission.py")
        raise NewError(f"--from {source}: there is no such mission{did_you_mean(source, known)} there are "
                       f"{', '.join(known)}")
    folder = folder.resolve()
    home = next((parent for parent in folder.parents if "fledge_project(" in _read(parent / "CMakeLists.txt")), FLEDGE)
    used = {word for file in folder.rglob("*.py") for word in _words(file)}
    there = {declared for tree in (FLEDGE, root) for declared, _ in _declared(tree)}
    if own := {declared: header for declared, header in _declared(home) if declared in used - there}:
        sources = ", ".join(str(header.with_suffix(".*")) for header in own.values())
        raise NewError(f"--from {source}: it flies {', '.join(own)} of the project {home}; first copy {sources} "
                       "and the lines in CMakeLists.txt")
    for other in {module[1:] for module in used if module.startswith(".")} - known.keys():
        if folders.is_mission(folder.parent / other) and not (folder / f"{other}.py").exists():
            raise NewError(f"--from {source}: it imports from the mission {other} beside it; copy that first")
    return folder


def _read(file: Path) -> str:
    return file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""


def _words(file: Path) -> Iterator[str]:
    """The names, attributes and imports in a file of Python; behind a dot, the files of relative imports."""
    try:
        tree = ast.parse(_read(file))
    except SyntaxError as error:
        raise NewError(f"{file}, line {error.lineno}: {error.msg}") from None
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.ImportFrom):
            yield from (name.name for name in node.names)
            if node.level:      # from .other.world import build
                yield f".{(node.module or '').partition('.')[0]}"


def _copied(source: Path, folder: Path) -> dict[Path, str | bytes]:
    """The files of a mission's folder under the name of another. A README.md, which is about the first, is left out."""
    texts: dict[Path, str | bytes] = {}
    first = [source / name for name in ("flight.py", "world.py", "scenarios.py")]      # as one reads them
    for file in dict.fromkeys([*first, *sorted(source.rglob("*"))]):
        part = file.relative_to(source)
        hidden = any(name == "__pycache__" or name.startswith(".") for name in part.parts)
        if hidden or part.name == "README.md" or not file.is_file():
            continue
        there = folder / part.with_name(re.sub(rf"^{re.escape(source.name)}(?=_test\.py$)", folder.name, part.name))
        texts[there] = file.read_bytes()
        if file.suffix in (".py", ".toml"):
            texts[there] = _renamed(_moved(_read(file), file, there), source.name, folder.name)
    return texts


# Where a text speaks of a mission by its name: where it is loaded, in command lines, in tables, and in paths.
_COMMANDS = ("check|command|compare|console|convert|export|falsify|faults|fetch|flips|fly|montecarlo|node|plot|profile|"
             "run|send|show|sweep|up|verify|versions|view|--mission|--to")
_NAMED = (rf"""(\b(?:load|find|Campaign|Sweep|Controller)\(\s*["']|(?:\b|\\n)(?:mission|name|simulation)\s*=\s*["']|"""
          rf"""["'](?:{_COMMANDS})["'],\s*["']|\bmissions[./]|\b(?:runs|verification)/|"""
          rf"""fledge (?:\w+ )?(?:{_COMMANDS}) |--(?:to|mission) |["'](?=\w+[:,]\ )|\b(?=\w+_test\.py\b))""")


def _renamed(text: str, old: str, name: str) -> str:
    return re.sub(rf"{_NAMED}{re.escape(old)}(?:\b|(?=_test\.py))", rf"\g<1>{name}", text)


def _moved(text: str, file: Path, there: Path) -> str:
    """A text in which paths such as "../shared/field.csv" lead from another place to the same files."""
    def path(match: re.Match) -> str:
        target = file.parent / match[2]
        same = not target.is_file() or (there.parent / match[2]).is_file()
        return match[1] + (match[2] if same else os.path.relpath(target.resolve(), there.parent.resolve()))

    return re.sub(r"""(["'])(\.\./[^"'\n]+)(?=\1)""", path, text)


def project(folder: Path | str) -> tuple[list[Path], str]:
    """Begin a project: a folder outside Fledge for the user's own modules, models and missions."""
    folder = Path(folder)
    name = snake(folder.resolve().name).replace("-", "_")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise NewError(f"a project's folder is named with letters, digits, _ and -; found '{folder.resolve().name}'")
    _no_keyword(name, name)
    if name in _TAKEN or name.startswith("fledge_"):
        raise NewError(f"the name {name} is Fledge's or CMake's own; choose another for the project")
    if why := folders.not_for_cmake(folder.resolve()):
        raise NewError(f"{why}; choose another folder")
    texts: dict[Path, str | bytes] = {
        folder / file: _read(TEMPLATES / file).replace("my_sat", name).replace("FLEDGE_VERSION", __version__)
        for file in FILES}
    texts[folder / ".gitignore"] = "build/\nruns/\nverification/\n__pycache__/\n.*cache/\n"
    _write(texts)
    for part in ("flight", "world", "missions"):
        (folder / part).mkdir(exist_ok=True)
    command, place = _command(folder), shlex.quote(str(folder))
    return list(texts), (f"Use it: in {place} and below, commands find it, such as {command} new mission first_light; "
                         f"elsewhere, {command} --project {place} COMMAND")


def _command(project: Path | str | None) -> str:
    """How a user calls fledge: in a project's folder there is no ./fledge."""
    return "./fledge" if not project else "fledge" if shutil.which("fledge") else shlex.quote(str(FLEDGE / "fledge"))


def _root(project: Path | str | None) -> Path:
    """The project's folder, else Fledge's own from within. Raises NewError elsewhere, and for an installed Fledge."""
    if not project and not ((FLEDGE / "CMakeLists.txt").exists() and Path.cwd().is_relative_to(FLEDGE)):
        command = f"{_command(Path.cwd())} new project NAME"
        raise NewError(f"there is no project here; '{command}' makes one, and it takes what is new")
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

def _last(file: Path, what: str, *patterns: str) -> re.Match:
    """The last match of the first pattern that matches the text of a file. what: to name in the error"""
    try:
        text = file.read_text(encoding="utf-8", errors="surrogateescape")
    except FileNotFoundError:
        raise NewError(f"there is no {file}; './fledge new project' makes one") from None
    matches = next(filter(None, (list(re.finditer(pattern, text, re.M)) for pattern in patterns)), None)
    if not matches:
        raise NewError(f"{file}: cannot find {what}")
    return matches[-1]


def _namespace(root: Path) -> str:
    """The name that a project gives to fledge_project()."""
    return _last(root / "CMakeLists.txt", "its fledge_project(NAME ...)", r"^\s*fledge_project\(\s*(\w+)")[1]


def _project_line(root: Path, list_: str, path: str) -> tuple[Path, str]:
    """(CMakeLists.txt, its text with the path at the end of a list of fledge_project())."""
    file = root / "CMakeLists.txt"
    match = _last(file, f"a line {list_} in fledge_project(), for {path}", rf"^( *){list_}\n(?:\1 +[\w/]+\n)*")
    return file, f"{match.string[:match.end()]}{match[1]}    {path}\n{match.string[match.end():]}"


def _module_line(root: Path, path: str) -> tuple[Path, str]:
    """The same for Fledge's own: after the modules of the same folder, else after all."""
    file, short = root / "flight/CMakeLists.txt", path.removeprefix("flight/")
    match = _last(file, "the list of flight_module(...)", rf"^flight_module\({short.rpartition('/')[0]}/.*\)\n",
                  r"^flight_module\(.*\)\n")
    return file, f"{match.string[:match.end()]}flight_module({short})\n{match.string[match.end():]}"


def _model_line(root: Path, path: str, tested: bool) -> tuple[Path, str]:
    """The same for Fledge's own: among the sources, and a test, if that is in C++."""
    file, short = root / "world/CMakeLists.txt", path.removeprefix("world/")
    match = _last(file, "the sources of fledge_world", r"^add_library\(fledge_world STATIC\n((?: +.*\n)+)\)")
    sources = sorted([*match[1].splitlines(), f"    {short}_model.cpp"])
    text = match.string[:match.start(1)] + "\n".join(sources) + "\n" + match.string[match.end(1):]
    test = f"world_{short.replace('/', '_')}_test"
    line = f"fledge_add_test({test}\n    SOURCES {short}_model_test.cpp LIBRARIES fledge::world)\n"
    return file, text + line * tested


def _write(texts: Mapping[Path, str | bytes]) -> None:
    """Write new files; none if one of them exists."""
    for path in texts:
        if path.exists():
            raise NewError(f"{path} is there already, and stays as it is")
    for path, text in texts.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "xb") as file:
            file.write(text.encode() if isinstance(text, str) else text)
