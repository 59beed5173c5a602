# SPDX-License-Identifier: Apache-2.0
"""Which tests a change can reach: for `./fledge test --changed` and for CI.

    /usr/bin/python3 -m tests.changed [BASE]            the near tests, in three lines: programs, cases, paths
    /usr/bin/python3 -m tests.changed --reach [--turn I/N] [BASE]
                        in two lines: the programs, and the tests in Python, that the change can reach; with --turn, for
                        CI: of the other programs the share I of N, and in Python the near tests and that share of all
                        others

The change is what differs from BASE: commits, uncommitted and untracked files. Without BASE, it is the work of this
branch: what differs from where it left `main`, `origin/main` or its upstream, the nearest of these. If nothing differs
(`main` itself with a clean tree), it is what no pass of CI has checked (.ci/passed), or else the last commit.

The near tests are:

- of C and C++: the cases in test sources that include a changed file, or a header whose source includes it, and so on;
- of Python: a changed test; the tests of a changed folder; the tests that import a changed part of the package, or an
  extension into which a changed file goes; the tests that name a changed mission, or file of data;
- of a module or model: X/X_test.py of USERS missions X, and USERS other tests, with the fewest modules of all users;
- of a document: the cases that follow it, and the links.

The reach is all of these, all users, and each test whose folder or part may use the changed one by tests/layers.py.
C++ of cosim/, emulator/ and ground/ reaches the package from `targets` up, whose flights start their programs; that of
every other folder reaches all of it by the extension that all parts share; with --turn, a test that only uses that
extension is not near. A change of the build or of the settings of pytest reaches every test; with --turn, every
program.
"""

import argparse
import ast
import fnmatch
import os
import re
import subprocess
import sys
import zlib
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Iterable, NamedTuple

from tests import circles, layers
from tests.include_direction_test import (C_SUFFIXES, EXTENSIONS, INCLUDE, ROOMS, TOPS, imported, is_test,
                                          library_imports, resolve)
from tests.tree import ROOT, files, library, module_of
from tests.used_test import used_in

USERS = 3       # of a module or model: their tests pass within a minute
EVERYTHING = ["CMakeLists.txt", "CMakePresets.json", "cmake/*.cmake", "conftest.py", "pytest.ini"]
GENERATES = ["introspect/*.py", "registers/*.py", "*/boards/*.toml", "registers/*.toml",
             "introspect/CMakeLists.txt", "registers/CMakeLists.txt"]
CHECKS = {".md": "tests/links_test.py", "CMakeLists.txt": "tests/collection_test.py",
          "fledge": "tests/launcher_test.py", **dict.fromkeys([*C_SUFFIXES, ".py"], "tests/include_direction_test.py")}
CASE = re.compile(r"^(TYPED_)?TEST(?:_F|(_P))?\(\s*(\w+)", re.MULTILINE)
TEMPLATES = "python/fledge/templates/"
APART = {name.removeprefix("_") for name in EXTENSIONS} - {"core"}     # folders with an extension of their own


class Failure(Exception):
    """A message for the user, of one line."""


# --- the change ------------------------------------------------------------------------------------

def git(root: Path, *words: str) -> str:
    """The output of git, or "" where it fails."""
    try:
        return subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True,
                              errors="surrogateescape").stdout.strip()
    except FileNotFoundError:
        raise Failure("test: --changed needs git, which is not installed") from None


def changed_files(root: Path, base: str | None = None) -> list[str]:
    """The files, relative to the root, that differ from the base; deleted ones, too."""
    def differing(place: str) -> list[str]:
        """The files that differ from a commit, except .ci/passed, which .ci/run writes."""
        names = git(root, "diff", "--name-only", "--no-renames", "--relative", "-z", place, "--") + "\0" + \
            git(root, "ls-files", "--others", "--exclude-standard", "-z")
        return sorted(set(filter(None, names.split("\0"))) - {".ci/passed"})

    def commit(name: str) -> str:
        return git(root, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}")

    if not commit("HEAD"):
        raise Failure(f"test: --changed needs a repository of git with a commit, and {root} is none")
    if base is not None:
        if not commit(base):
            raise Failure(f"test: git knows no commit '{base}'; give a commit, branch or tag")
        return differing(git(root, "merge-base", base, "HEAD") or base)
    places = [git(root, "merge-base", "HEAD", name) for name in ("main", "origin/main", "@{upstream}")]
    nearest = min(filter(None, places), key=lambda place: int(git(root, "rev-list", "--count", f"{place}..HEAD")),
                  default="HEAD")
    passed = [words[0] for words in circles.passes(root / ".ci/passed")[:1]]
    earlier = [place for place in [*passed, "HEAD~1"] if commit(place) and git(root, "merge-base", place, "HEAD") ==
               commit(place) != commit("HEAD")]
    return differing(nearest) or (differing(earlier[0]) if earlier else [])


# --- what uses what --------------------------------------------------------------------------------

def text_of(path: str) -> str:
    """Its text; "" of a link that leads nowhere."""
    file = ROOT / path
    return file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""


def nodes_of(path: str) -> list[ast.AST]:
    """What a file in Python consists of."""
    try:
        return list(ast.walk(ast.parse(text_of(path))))
    except SyntaxError as error:
        raise Failure(f"test: {path}:{error.lineno}: {error.msg}") from None


@cache
def includers() -> dict[str, set[str]]:
    """File in C or C++ -> those that include it, and of a source the header whose functions it has: its own, or those
    of its folder that it includes."""
    users = defaultdict(set)
    sources = {str(path) for path in files() if path.suffix in C_SUFFIXES}
    for path in sources:
        included = {resolve(match[1]) for match in map(INCLUDE.match, text_of(path).splitlines()) if match and match[1]}
        for header in included:
            users[header].add(path)
        if path.endswith((".c", ".cpp")) and not path.endswith("_test.cpp"):
            own = str(Path(path).with_suffix(".h"))
            users[path] |= {own} if own in sources else {
                header for header in included if os.path.dirname(header) == os.path.dirname(path)}
    return users


def closure(changed: Iterable[str]) -> set[str]:
    """The changed files, and the C and C++ that can depend on them."""
    todo = list(changed)
    seen = set(todo)
    while todo:
        new = includers().get(todo.pop(), set()) - seen
        seen |= new
        todo += new
    return seen


def unit(name: str) -> str:
    """The unit that a test imports: a part of the package, a target, introspect/, or a module elsewhere."""
    parts = name.strip(".").split(".")
    is_room = parts[0] == "fledge" and parts[1:2] != ["cli"] and ".".join(parts[1:3]) in {*ROOMS, *layers.LEVEL}
    return ".".join(parts[:3 if is_room else 1 if parts[0] == "introspect" else 2])


def unit_of(path: str) -> str:
    """The unit of a file."""
    file = Path(path.replace(TEMPLATES, "python/fledge/new/"))
    outside = re.sub(r"^cosim/bindings/python/|(/__init__)?\.py$", "", str(file)).replace("/", ".")
    return unit(module_of(file) or outside)


@cache
def part_of(path: str) -> str:
    """The part of the package that has a file, or from which on up the file reaches the package, or ""."""
    root, _, module = unit_of(path).removesuffix("_test").partition(".")
    part = layers.part_of(module) if root == "fledge" else "targets" if root in APART else ""
    return part if part in layers.LEVEL else ""


class Named(NamedTuple):
    """The names in a test in Python."""

    units: set[str]         # that it imports
    words: set[str]         # of its strings
    modules: set[str]       # of flight, and models of the world, in small letters without _


@cache
def tests() -> dict[str, Named]:
    """Every test file that pytest collects, with the names in it."""
    declaration = next(node.value for node in ast.parse(text_of("python/fledge/__init__.py")).body
                       if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_LAZY")
    lazy = {name: module if module in EXTENSIONS else f"fledge.{module}"
            for name, (module, _) in ast.literal_eval(declaration).items()}
    table = {}
    for path in map(str, files()):
        if path.endswith("_test.py") and not path.startswith(TEMPLATES):
            nodes = nodes_of(path)
            names = [lazy.get(name, f"{module}.{name}") if module == "fledge" else f"{module}.{name}"
                     for _, module, name in imported(nodes)]
            names += [lazy[node.attr] for node in nodes if isinstance(node, ast.Attribute) and node.attr in lazy
                      and isinstance(node.value, ast.Name) and node.value.id == "fledge"]
            prose = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
            words = {word for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)
                     and id(node) not in prose for whole in re.findall(r"[\w.-]+", node.value)
                     for word in (whole, whole.split(".")[0])}
            table[path] = Named(set(map(unit, names)), words, modules_in(nodes))
    return table


def modules_in(nodes: list[ast.AST]) -> set[str]:
    return {name.lower() for library in ("flight", "world") for name in used_in(library, nodes)}


# --- the choice ------------------------------------------------------------------------------------

@cache
def tests_of_folders() -> dict[str, set[str]]:
    folders = defaultdict(set)
    for test in tests():
        folders[os.path.dirname(test)].add(test)
    return folders


@cache
def tests_of_users(part: str) -> set[str]:
    """The tests of the parts that import this one."""
    users = {layers.part_of(module) for module, others in library_imports().items()
             if any(layers.part_of(other) == part for _, other in others)}
    return {test for test in tests() if part_of(test) in users}


def own_tests(path: str) -> set[str]:
    """The test beside a file, and those in its folder or the next one above that has tests; in the folders of modules
    that are parts by themselves, only the former."""
    file = Path(path)
    beside = {str(file.with_name(f"{file.stem}_test.py"))} & tests().keys()
    for folder in map(str, file.parents):
        if folder in ("python/fledge", "tests", "bench"):
            return beside
        if folder in tests_of_folders():
            return beside | tests_of_folders()[folder]
    return beside


@cache
def missions() -> dict[str, set[str]]:
    """Mission -> the modules and models in its Python."""
    used = defaultdict(set)
    for path in files(ROOT / "missions"):
        if len(path.parts) > 1 and path.suffix == ".py" and not is_test(path):
            used[path.parts[0]] |= modules_in(nodes_of(f"missions/{path}"))
    return used


def of_modules(names: set[str], wide: bool) -> set[str]:
    """The tests of the missions X, X/X_test.py, and those among the other tests, that use these modules and models: of
    the smallest, without flights on targets, for which more must be built; wide: of all, and all tests of the missions.
    """
    by_mission = {f"missions/{name}/{'' if wide else f'{name}_test.py'}": used for name, used in missions().items()}
    by_test = {path: named.modules for path, named in tests().items() if not path.startswith("missions/")
               and (wide or not any(name.startswith("fledge.targets") for name in named.units))}
    chosen = [user for users in (by_mission, by_test) for _, user in sorted(
        (len(modules), user) for user, modules in users.items() if modules & names)[:None if wide else USERS]]
    return {test for test in tests() if test.startswith(tuple(chosen))}


def python_tests(changed: list[str], reached: set[str], wide: bool = False) -> set[str]:
    """The near tests in Python, of the changed files and the C and C++ that they reach; wide: of all users."""
    near = {"tests/hygiene_test.py"}
    units = {unit_of(path) for path in changed if "/" in path}
    for path in changed:
        file = Path(path)
        near |= {CHECKS[key] for key in (file.name, file.suffix) if key in CHECKS}
        if path in tests():
            near.add(path)
        elif file.suffix == ".md":
            near |= {f"tests/docs_test.py::{node.name}" for node in ast.parse(text_of("tests/docs_test.py")).body
                     if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
                     and {path, file.name} & {leaf.value for leaf in ast.walk(node) if isinstance(leaf, ast.Constant)}}
        elif file.name != "CMakeLists.txt":
            own = own_tests(path)
            if path.startswith("fmi/"):     # what it compiles into the extension of all is used by few
                own |= {test for test in tests() if "fmi" in test or "fmu" in test}
            if not own and path.startswith("python/"):      # such as fledge.elements
                own = tests_of_users(part_of(path))
            words = {file.parts[1]} if path.startswith("missions/") else \
                {file.name} - {file.stem} if file.suffix not in CHECKS else set()
            near |= own | {test for test, named in tests().items() if words & named.words}
    modules = set()
    for path in reached:
        top, _, inner = path.partition("/")
        if is_test(Path(path)) or Path(path).suffix not in C_SUFFIXES:
            continue
        if top in ("flight", "world"):
            modules.add(Path(path).stem.removesuffix("_model").replace("_", ""))
        elif top in APART or top == "targets":
            units.add(f"fledge.{top}" if top in APART else unit_of(path))
            if top in APART and module_of(Path(path)):      # it is compiled into the extension
                units |= {f"fledge.{part}" for part in EXTENSIONS[f"_{top}"]}
        elif (extension := f"_{inner.split('/')[1]}" if top == "python" else "") in EXTENSIONS:
            units |= {extension, *(f"fledge.{part}" for part in EXTENSIONS[extension])}
    return near | of_modules(modules, wide) | {test for test, named in tests().items() if named.units & units}


def reach(changed: list[str]) -> set[str]:
    """The tests in Python that can see the change, by the tables of folders and parts, and by what they name."""
    reached = python_tests(changed, closure(changed), wide=True)
    for path in changed:
        folder, part = layers.rule_of(path), part_of(path)
        if is_test(Path(path)) or path.endswith(".md") or folder.split("/")[0] not in TOPS - {"bench", "docs", "tests"}:
            continue
        above = {folder} if folder != "missions" else {"bench", "tests"}    # a mission uses no other
        above |= {"fledge"} if module_of(Path(path)) else set()
        while new := {rule for rule in layers.RULES if any(layers.may_use(rule, other) for other in above)} - above:
            above |= new
            above |= {"fledge"} if above & library().keys() else set()
        reached |= {test for test in tests() if layers.rule_of(test) in above and not (
            module_of(Path(test)) and part and part_of(test) != part
            and layers.LEVEL.get(part_of(test), 99) <= layers.LEVEL[part])}
    return reached


def programs_of(build: Path) -> list[tuple[str, str]]:
    """The programs of tests in C and C++, each with each of its sources, as a build was configured."""
    listed = build / "tests.txt"
    lines = map(str.split, listed.read_text().splitlines() if listed.exists() else ())
    return [(program, source) for program, *sources in lines for source in sources]


def programs_and_cases(reached: set[str], build: Path) -> tuple[set[str], list[str]]:
    """The programs of the tests in C and C++ that are reached, and GoogleTest's patterns of their suites; the target
    `tests`, if the build does not know one of them yet."""
    program_of = defaultdict(set)
    for program, source in programs_of(build):
        program_of[os.path.normpath(source)].add(program)
    sources = {path for path in reached if path.endswith(("_test.c", "_test.cpp")) and (ROOT / path).exists()
               and not path.startswith(TEMPLATES)}
    programs = set().union(*(program_of.get(source, {"tests"}) for source in sources))
    cases = {f"{suite}/*" if typed else f"*/{suite}.*" if with_parameter else f"{suite}.*"
             for source in sources for typed, with_parameter, suite in CASE.findall(text_of(source))}
    return ({"tests"} if "tests" in programs else programs), sorted(cases)


@cache
def linked(build: Path) -> dict[str, set[str]]:
    """Program of tests in C and C++ -> the files that it is made of, as Ninja and the compiler know them; none before
    it was built."""
    def ninja(*words: str) -> list[str]:
        """Lines that one of Ninja's tools prints. -n keeps it from writing its logs, which another ninja may use."""
        try:
            return subprocess.run(["ninja", "-n", "-C", build, "-t", *words], capture_output=True, text=True,
                                  errors="replace").stdout.splitlines()
        except FileNotFoundError:
            return []

    read: dict[str, list[str]] = {}     # object -> what the compiler read for it
    for line in ninja("deps"):
        if line.startswith(" "):
            of_object.append(line.strip())
        else:
            of_object = read.setdefault(line.partition(": #deps")[0], [])
    return {program: {os.path.relpath(build / file, ROOT) for part in ninja("inputs", program)
                      for file in (part, *read.get(part, []))} for program in {name for name, _ in programs_of(build)}}


def programs_reached(changed: list[str], build: Path) -> set[str]:
    """The programs of tests in C and C++ that a change can reach: by what includes what; of a source, and of a header
    whose includers reach none, also those of its folder, or of the next one above, that link it; and if there is none,
    all that link it. The CMakeLists.txt of a folder reaches those of the folder, and below."""
    programs, _ = programs_and_cases(closure(changed), build)
    listed = programs_of(build)

    def below(folder: str) -> set[str]:
        return {program for program, source in listed if source.startswith(f"{folder}/")}

    for path in changed:
        if path.endswith("/CMakeLists.txt"):
            programs |= below(os.path.dirname(path))
        elif Path(path).suffix in C_SUFFIXES and not Path(path).stem.endswith("_test") and (
                path.endswith((".c", ".cpp")) or not programs_and_cases(closure([path]), build)[0]):
            linking = {program for program, parts in linked(build).items() if path in parts}
            folders = map(str, Path(path).parents[:-1])
            programs |= next(filter(None, (linking & below(folder) for folder in folders)), linking)
    return programs


def build_of_programs() -> Path:
    """The build that knows the programs: that of the release, whose list is whole, unless there is none."""
    own, release = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release"), ROOT / "build/release"
    return release if (release / "tests.txt").exists() else own


def print_reach(changed: list[str], everything: bool, turn: tuple[int, int] | None) -> None:
    """Print the targets to build, then the files of Python to test, as --reach says. everything: all may have
    changed. turn: I and N of the share of the programs and files that run besides those."""
    def in_turn(name: str) -> bool:
        return bool(turn) and zlib.crc32(name.encode()) % shares == share

    (share, shares), build = turn or (0, 0), build_of_programs()
    if everything or any(fnmatch.fnmatch(path, pattern) for path in changed if not path.endswith("_test.py")
                         for pattern in GENERATES):
        programs = {"tests"}    # the sources that these generate show in no #include
    else:
        programs = programs_reached(changed, build)
        programs |= {name for name, source in programs_of(build) if in_turn(name) and (ROOT / source).exists()}
        programs = {"tests"} if "tests" in programs else programs
    if turn:
        by_name = {path for path in closure(changed) if path in changed or not module_of(Path(path))}
        paths = {path for path in tests() if in_turn(path)} | python_tests(changed, by_name)
    else:
        paths = set(tests()) if everything else reach(changed) if changed else set()
    print(" ".join(sorted(programs)), " ".join(sorted(paths)), sep="\n")


def main() -> None:
    parser = argparse.ArgumentParser(prog="changed", description=__doc__.splitlines()[0])
    parser.add_argument("base", nargs="?", help="commit to compare with; default: where this branch began")
    parser.add_argument("--reach", action="store_true", help="all tests that the change can reach")
    parser.add_argument("--turn", metavar="I/N", type=circles.share_of, help="with --reach: in C and C++ the share I "
                        "of N of the other programs, too; in Python the near tests and that share of the others alone")
    arguments = parser.parse_args()
    changed = changed_files(ROOT, arguments.base)
    everything = any(fnmatch.fnmatch(path, pattern) for path in changed for pattern in EVERYTHING)
    if arguments.reach:
        print_reach(changed, everything, arguments.turn)
    elif not changed:
        print("fledge: nothing has changed", file=sys.stderr)
    else:
        reached = closure(changed)
        programs, cases = programs_and_cases(reached, ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release"))
        paths = python_tests(changed, reached)
        if everything:
            programs, cases, paths = {"tests"}, ["*"], set(tests())
        print(f"fledge: changed files: {len(changed)}; near tests: {len(cases)} suites in C++, {len(paths)} files in "
              "Python", file=sys.stderr)
        print(" ".join(sorted(programs)), ":".join(cases), " ".join(sorted(paths)), sep="\n")


if __name__ == "__main__":
    try:
        main()
    except Failure as failure:
        print(f"fledge: {failure}", file=sys.stderr)
        sys.exit(2)
