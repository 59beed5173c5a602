# SPDX-License-Identifier: Apache-2.0
"""`fledge new`: begin a module, model, mission or project.

What it writes is what stands in templates/, a project that works, under other names. It checks
everything before it writes, and never writes over a file.
"""

import keyword
import re
import shlex
from pathlib import Path

TEMPLATES = Path(__file__).with_name("templates")
FLEDGE = Path(__file__).resolve().parents[2]

# Of C and C++; Python's are in `keyword`. Those that no lower-case name could be are left out.
_C_KEYWORDS = set("""
    alignas alignof and asm auto bitand bitor bool break case catch char class compl concept const
    consteval constexpr constinit continue decltype default delete do double else enum explicit export
    extern false float for friend goto if inline int long mutable namespace new noexcept not nullptr
    operator or private protected public register requires restrict return short signed sizeof static
    struct switch template this thread_local throw true try typedef typeid typename typeof union
    unsigned using virtual void volatile wchar_t while xor""".split())

# Libraries, namespaces and CMake targets that a project's name would hide.
_TAKEN = set("all clean fledge flight help install math package record sim std tables test tests world".split())


class NewError(Exception):
    """What is wrong with the name, or in the way of the files."""


def snake(name):
    """MrpFeedback -> mrp_feedback, as the reader of headers has it."""
    words = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name)
    return re.sub(r"([A-Z])([A-Z][a-z])", r"\1_\2", words).lower()


def module(name, project=None):
    """Begin a flight module: its face, its C, its test, and its line for CMake.

    name: "SunSlew", or "guidance/SunSlew" for a subfolder of flight/; project: its folder, else Fledge
    itself. Returns (files written, what to do next). Raises NewError.
    """
    return _type("module", name, project)


def model(name, project=None):
    """Begin a model of the world: its face, its class in C++, its test, and its line for CMake."""
    return _type("model", name, project)


_KINDS = {  # kind: top folder, subfolder within Fledge, name and endings of the template, list in CMake
    "module": ("flight", "control", "TorqueLimiter", (".h", ".c", "_test.cpp"), "FLIGHT"),
    "model": ("world", "dynamics", "EddyDamping", (".h", "_model.h", "_model.cpp", "_model_test.cpp"), "WORLD"),
}


def _type(kind, name, project):
    top, default, theirs, endings, keyword_ = _KINDS[kind]
    root = Path(project) if project else FLEDGE
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

    names = {old: path, old.upper().replace("/", "_"): path.upper().replace("/", "_"),
             theirs: name, snake(theirs): snake(name), "my_sat": _namespace(root) if project else "fledge::world"}
    texts = {root / (path + ending): _text(old + ending, names) for ending in endings}
    cmake = (_project_line(root, keyword_, path) if project
             else _module_line(root, path) if kind == "module" else _model_line(root, path))
    _write(texts, cmake)
    where = "flight.py" if kind == "module" else "world.py"
    library = "fsw" if kind == "module" else "world"
    return [*texts, cmake[0]], f"In a mission's {where}, it is {library}.{name}. Its test: ./fledge test -k {name}"


def mission(name, project=None):
    """Begin a mission: what flies, the truth, a scenario, and the test that flies it."""
    name = snake(name) if name[:1].isupper() else name
    _no_keyword(name, name)
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise NewError(f"a mission's name is of small letters, digits and _, such as first_light; found '{name}'")
    root = Path(project) if project else FLEDGE
    folder, files = root / "missions" / name, ("flight.py", "world.py", "scenarios.py")
    if folder.exists():
        raise NewError(f"{folder} is there already; choose another name")
    names = {"first_light": name}
    texts = {folder / file: _text(f"missions/first_light/{file}", names) for file in files}
    texts[folder / f"{name}_test.py"] = _text("missions/first_light/first_light_test.py", names)
    _write(texts)
    return list(texts), f"Fly it: ./fledge run {name}"


def project(folder):
    """Begin a project: a folder outside Fledge for modules, models and missions of one's own."""
    folder = Path(folder)
    name = snake(folder.resolve().name).replace("-", "_")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise NewError(f"a project's folder is named with letters, digits, _ and -; found '{folder.resolve().name}'")
    _no_keyword(name, name)
    if name in _TAKEN or name.startswith("fledge_"):
        raise NewError(f"the name {name} is Fledge's or CMake's own; choose another for the project")
    empty = re.sub(r"^ +(?:flight|world)/.*\n", "", _text("CMakeLists.txt", {"my_sat": name}), flags=re.M)
    texts = {folder / "CMakeLists.txt": empty, folder / ".gitignore": "build/\nruns/\n__pycache__/\n"}
    _write(texts)
    for part in ("flight", "world", "missions"):
        (folder / part).mkdir(exist_ok=True)
    return list(texts), f"Use it: ./fledge --project {shlex.quote(str(folder))} COMMAND, or set FLEDGE_PROJECT to it"


# --- names -----------------------------------------------------------------------------------------

def _no_keyword(name, given):
    for language, words in (("C or C++", _C_KEYWORDS), ("Python", set(keyword.kwlist))):
        if name in words:
            raise NewError(f"{given}: '{name}' is a keyword of {language}; choose another name")


def _declared(root):
    """(name, header) of each struct and enum in the headers of flight/ and world/."""
    for top in ("flight", "world"):
        for header in sorted((root / top).rglob("*.h")):
            for name in re.findall(r"^\} *(\w+);", header.read_text(encoding="utf-8", errors="replace"), re.M):
                yield name, header.relative_to(root)


def _namespace(root):
    """The name that a project gives to fledge_project()."""
    return _search(root / "CMakeLists.txt", r"^\s*fledge_project\(\s*(\w+)", "its fledge_project(NAME ...)")[1]


# --- text ------------------------------------------------------------------------------------------

def _text(template, names):
    """A template with other names, longer ones first."""
    text = (TEMPLATES / template).read_text(encoding="utf-8")
    pattern = "|".join(sorted(map(re.escape, names), key=len, reverse=True))
    return re.sub(pattern, lambda match: names[match[0]], text)


def _search(file, pattern, what):
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise NewError(f"there is no {file}; './fledge new project' makes one") from None
    found = re.search(pattern, text, re.M)
    if not found:
        raise NewError(f"{file}: cannot find {what}")
    return found


def _project_line(root, keyword_, path):
    """(CMakeLists.txt, its text with the path at the end of a list of fledge_project())."""
    file = root / "CMakeLists.txt"
    found = _search(file, rf"^( *){keyword_}\n(?:\1 +[\w/]+\n)*", f"a line {keyword_} in fledge_project(), for {path}")
    return file, f"{found.string[:found.end()]}{found[1]}    {path}\n{found.string[found.end():]}"


def _module_line(root, path):
    """The same for Fledge's own: after the modules of the same folder, else after all."""
    file, short = root / "flight/CMakeLists.txt", path.removeprefix("flight/")
    folder = short.rpartition("/")[0]
    lines = r"(?:^flight_module\(.*\)\n)*"
    _search(file, r"^flight_module\(", "the list of flight_module(...)")
    for place in (rf"(?:^flight_module\({folder}/.*\)\n)+", rf"^flight_module\(.*\)\n{lines}"):
        found = list(re.finditer(place, file.read_text(encoding="utf-8"), re.M))
        if found:
            break
    end, text = found[-1].end(), found[-1].string
    return file, f"{text[:end]}flight_module({short})\n{text[end:]}"


def _model_line(root, path):
    """The same for Fledge's own: among the sources, and a test."""
    file, short = root / "world/CMakeLists.txt", path.removeprefix("world/")
    found = _search(file, r"^add_library\(fledge_world STATIC\n((?: +.*\n)+)\)", "the sources of fledge_world")
    sources = sorted([*found[1].splitlines(), f"    {short}_model.cpp"])
    text = found.string[:found.start(1)] + "\n".join(sources) + "\n" + found.string[found.end(1):]
    test = f"world_{short.replace('/', '_')}_test"
    return file, f"{text}fledge_add_test({test} SOURCES {short}_model_test.cpp LIBRARIES fledge::world)\n"


def _write(texts, edit=None):
    """Write new files, and one that changes; nothing if one of the new is there."""
    for path in texts:
        if path.exists():
            raise NewError(f"{path} is there already, and stays as it is")
    for path, text in texts.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "x", encoding="utf-8") as file:
            file.write(text)
    if edit:
        edit[0].write_text(edit[1], encoding="utf-8")
