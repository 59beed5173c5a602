# SPDX-License-Identifier: Apache-2.0
"""Every #include and import goes in the direction that tests/layers.py allows.

Flight code must build for a flight computer, and the simulation kernel must know no physics: one include in the wrong
direction ends that.
"""

import ast
import re
import sys
from functools import cache
from pathlib import Path
from typing import Iterable, Iterator

import pytest

from tests import layers
from tests.tree import ROOT, files, library, module_of

TOPS = {folder.split("/")[0] for folder in layers.RULES}

# Headers that C that flies may include from the language's library: what a freestanding compiler has, and the
# two whose few functions used here (sqrt, memcpy) every compiler turns into instructions.
FLIGHT_LIBRARY = {"float.h", "limits.h", "math.h", "stdbool.h", "stddef.h", "stdint.h", "string.h"}

# The parts that may use an extension; all others use the public functions of these.
EXTENSIONS = {
    "_core": {"errors", "disk", "files", "archive", "objects", "flight", "flight_math", "world", "prototype", "mission",
              "requirements", "montecarlo", "cosim", "fmi"},
    "_cosim": {"cosim"},
    "_emulator": {"emulator"},
    "_ground": {"ground", "commands"},
}

# flight.py also runs under MicroPython, which has nothing but these. (sqrt is exact in both.)
FLIGHT_PY_MODULES = {"fledge.flight", "fledge.units", "math.sqrt"}

# Where an #include starts: the root, within the extension the package, within the templates theirs,
# and cFE's headers have no folder.
INCLUDE_ROOTS = ("", "python/fledge/", "python/fledge/templates/", "targets/cfs/inc/")

C_SUFFIXES = {".c", ".h", ".cpp", ".hpp"}
INCLUDE = re.compile(r'^\s*#\s*include\s*(?:"([^"]+)"|<([^>]+)>)')


def resolve(include: str) -> str:
    """The path from the root of what `include` names; `include` itself if there is no such file."""
    return next((start + include for start in INCLUDE_ROOTS if (ROOT / start / include).is_file()),
                include)


def is_test(path: Path) -> bool:
    """Whether it is a test, a program that a test builds, or what tests share in testing/."""
    return path.stem.endswith("_test") or path.name in {"conftest.py", "elementary_hash.c"} \
        or "testing" in path.parts


def may_include_helper(folder: str, helper: str) -> bool:
    """Whether a test in `folder` may include a test helper: its own, or of a folder it may use."""
    tops = {name.split("/")[0] for name in [folder, *layers.uses(folder)]}
    return helper.split("/")[0] in tops


def check_c(path: Path, text: str) -> list[str]:
    """Complaints about the includes of a C or C++ file at `path` (relative to the root)."""
    complaints = []
    folder = layers.rule_of(path.as_posix())
    for number, line in enumerate(text.splitlines(), 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        ours, library = match.groups()
        if ours and "testing" in Path(ours).parts:
            if not is_test(path) or not may_include_helper(folder, ours):
                complaints.append(f'{path}:{number}: "{ours}" is for the tests of its folder and of '
                                  f"those that may use it")
        elif ours and not layers.may_use(folder, layers.rule_of(resolve(ours))) and not (
                is_test(path) and ours.startswith("tests/")):
            complaints.append(f'{path}:{number}: {folder} may not include "{ours}"; '
                              f"it may include {allowed_text(folder)}")
        if library and folder.startswith("flight") and not is_test(path) \
                and library not in FLIGHT_LIBRARY:
            complaints.append(f"{path}:{number}: <{library}> is not for flight code, which has "
                              f"{', '.join(sorted(FLIGHT_LIBRARY))}")
    return complaints


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements in a node; much fewer than ast.walk(node) gives."""
    for block in ("body", "orelse", "finalbody", "handlers", "cases"):
        for child in getattr(node, block, ()):
            yield child
            yield from statements(child)


def imported(nodes: Iterable[ast.AST]) -> Iterator[tuple[int, str, str]]:
    """(line, module, name) of each import among these nodes of a Python file; the name is "" in `import module`."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield from ((node.lineno, node.module, alias.name) for alias in node.names)


def check_python(path: Path, text: str) -> list[str]:
    """Complaints about the imports of a Python file at `path` (relative to the root)."""
    complaints = []
    folder = layers.rule_of(path.as_posix())
    third_parties = layers.THIRD_PARTIES.get(folder.split("/")[0], set())
    for line, module, inner in imported(statements(ast.parse(text))):
        name = f"{module}.{inner}".strip(".")
        top = name.split(".")[0]
        if path.parts[0] == "missions" and path.name == "flight.py":
            if not any(name == allowed or name.startswith(allowed + ".")
                       for allowed in FLIGHT_PY_MODULES):
                complaints.append(f"{path}:{line}: flight.py may not import {name}; it "
                                  f"may import {', '.join(sorted(FLIGHT_PY_MODULES))}")
        elif top in TOPS:
            if not layers.may_use(folder, top) and not (is_test(path) and top == "tests"):
                complaints.append(f"{path}:{line}: {folder} may not import {name}; "
                                  f"it may import {allowed_text(folder)}")
        elif top not in sys.stdlib_module_names and not is_test(path) \
                and top not in third_parties:
            complaints.append(f"{path}:{line}: {folder} may not import {name}; of other "
                              f"projects it may import "
                              f"{', '.join(sorted(third_parties)) or 'nothing'}")
    return complaints


def allowed_text(folder: str) -> str:
    return ", ".join([folder, *layers.uses(folder)])


def check(path: Path, text: str) -> list[str]:
    if path.suffix in C_SUFFIXES:
        return check_c(path, text)
    return check_python(path, text) if path.suffix == ".py" else []


def test_every_include_and_import_goes_the_right_way():
    complaints = []
    for path in files():
        if len(path.parts) > 1 and path.suffix in C_SUFFIXES | {".py"}:
            complaints += check(path, (ROOT / path).read_text(encoding="utf-8"))
    assert not complaints, "\n" + "\n".join(complaints)


def test_every_folder_with_code_has_a_rule():
    folders = {layers.rule_of(path.as_posix()).split("/")[0] for path in files()
               if len(path.parts) > 1 and path.suffix in C_SUFFIXES | {".py"}}
    assert folders <= TOPS


def test_every_quoted_include_is_found_from_the_root():
    missing = []
    for path in files():
        if path.suffix not in C_SUFFIXES:
            continue
        for number, line in enumerate((ROOT / path).read_text(encoding="utf-8").splitlines(), 1):
            match = INCLUDE.match(line)
            if match and match[1] and not (ROOT / resolve(match[1])).is_file():
                missing.append(f'{path}:{number}: "{match[1]}" is no path from the root')
    assert not missing, "\n" + "\n".join(missing)


# --- the parts of the package fledge ---------------------------------------------------------------


def imports_of(path: Path, text: str, modules: set[str]) -> list[tuple[int, str]]:
    """(line, module) of each import of the package by a file in it: "mission.process"; "" of what
    only its __init__.py knows. modules: all there are. Imports for type checkers alone never run, and do not count."""
    imports, nodes = [], [*statements(ast.parse(text))]
    unused = {inner for node in nodes if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
              for branch in node.body for inner in (branch, *statements(branch))}
    for line, module, name in imported(node for node in nodes if node not in unused):
        if module in EXTENSIONS or module == "fledge" and name in EXTENSIONS:
            imports.append((line, name if module == "fledge" else module))
        elif module.split(".")[0] == "fledge" and name != "__version__":
            inner = module.partition(".")[2]
            whole = f"{inner}.{name}".strip(".")
            imports.append((line, whole if whole in modules else inner))
    return imports


@cache
def library_imports() -> dict[str, list[tuple[int, str]]]:
    """The imports of each module of the package fledge, tests apart."""
    paths = {name.removeprefix("fledge."): path for path in files() if path.suffix == ".py" and not is_test(path)
             and "templates" not in path.parts and (name := module_of(path)) not in ("", "fledge")}
    return {module: imports_of(path, (ROOT / path).read_text(encoding="utf-8"), set(paths))
            for module, path in paths.items()}


ROOMS = {f"targets.{path.parent.name}" for path in ROOT.glob("targets/*/__init__.py")}


def room(module: str) -> str:
    """The target of a module, as "targets.leon3", or what targets share, as "targets.job"."""
    return ".".join(module.split(".")[:2])


def check_parts(imports: dict[str, list[tuple[int, str]]]) -> list[str]:
    """Complaints about the imports between the parts of the package."""
    complaints = []
    for module, others in imports.items():
        part = layers.part_of(module)
        if part not in layers.LEVEL:
            complaints.append(f"fledge.{module}: the part {part} has no layer; add it to PARTS in tests/layers.py")
            continue
        for line, other in others:
            there = layers.part_of(other)
            if part == there == "targets" and room(module) not in ROOMS and room(other) in ROOMS:
                complaints.append(f"fledge.{module}:{line}: what targets share may not import fledge.{other}, one of "
                                  "them; ask TARGETS for it by name")
            elif other in EXTENSIONS:
                if part not in EXTENSIONS[other]:
                    complaints.append(f"fledge.{module}:{line}: {part} may not use {other}; it may use the public "
                                      "functions of the library")
            elif other == "":
                if part.split(".")[0] not in ("cli", "launcher"):
                    complaints.append(f"fledge.{module}:{line}: {part} may not import fledge as a whole; name the "
                                      "module")
            elif there != part and layers.LEVEL.get(there, len(layers.PARTS)) >= layers.LEVEL[part]:
                complaints.append(f"fledge.{module}:{line}: {part} may not import fledge.{other}, which is not "
                                  "below it")
    return complaints


def circle(imports: dict[str, list[tuple[int, str]]]) -> list[str]:
    """Modules that import one another in a circle; [] if there are none."""
    done: set[str] = set()

    def follow(module: str, way: list[str]) -> list[str]:
        if module in way:
            return [*way[way.index(module):], module]
        if module not in done:
            for _, other in imports.get(module, []):
                circle_back = follow(other, [*way, module])
                if circle_back:
                    return circle_back
            done.add(module)
        return []

    return next(filter(None, (follow(module, []) for module in imports)), [])


def test_the_parts_of_the_library_import_downwards():
    complaints = check_parts(library_imports())
    assert not complaints, "\n" + "\n".join(complaints)


def test_no_modules_of_the_library_import_one_another_in_a_circle():
    assert circle(library_imports()) == []


def test_no_folder_stands_on_two_floors():
    """A part with a dot has a folder of its own, to which a link leads."""
    apart = {package.removeprefix("fledge.") for package in library().values()}
    assert {part for part in layers.LEVEL if "." in part} <= apart
    inside = {module for module in library_imports()
              if not any(f"{module}.".startswith(f"{part}.") for part in apart)}
    for folder in {module.rpartition(".")[0] for module in inside} - {""}:
        assert len({layers.part_of(module) for module in inside if module.startswith(f"{folder}.")}) == 1, folder


@pytest.mark.parametrize("module, other, complaint", [
    ("mission.simulation", "cli.console", "mission may not import fledge.cli.console"),
    ("objects.hooks", "mission.process", "objects may not import fledge.mission.process"),
    ("montecarlo", "cosim", "montecarlo may not import fledge.cosim"),
    ("cli.check", "ground.server", "cli may not import fledge.ground.server"),
    ("report", "_core", "report may not use _core"),
    ("targets.job", "", "targets may not import fledge as a whole"),
    ("targets.job", "targets.leon3.board", "what targets share may not import fledge.targets.leon3.board"),
    ("cellar.a", "units", "the part cellar has no layer"),
])
def test_an_import_upwards_is_refused(module, other, complaint):
    (message,) = check_parts({module: [(1, other)]})
    assert complaint in message


def test_a_circle_is_found():
    assert circle({"a": [(1, "b")], "b": [(1, "c")], "c": [(1, "b")]}) == ["b", "c", "b"]


@pytest.mark.parametrize("path, line, complaint", [
    ("flight/control/a.c", '#include "flight/guidance/b.h"', "flight/control may not include"),
    ("flight/msg/a.h", '#include "flight/control/b.h"', "flight/msg may not include"),
    ("flight/math/a.h", '#include "flight/msg/head.h"', "flight/math may not include"),
    ("flight/control/a.c", "#  include <stdlib.h>", "<stdlib.h> is not for flight code"),
    ("flight/control/a.c", '#include "flight/testing/b.h"', "is for the tests"),
    ("sim/a.cpp", '#include "sim/testing/toys.h"', "is for the tests"),
    ("sim/a_test.cpp", '#include "world/testing/b.h"', "is for the tests"),
    ("record/mcap.c", '#include "flight/math/vec.h"', "record may not include"),
    ("sim/a.cpp", '#include "world/models.h"', "sim may not include"),
    ("sim/a_test.cpp", '#include "world/models.h"', "sim may not include"),
    ("world/dynamics/a.cpp", '#include "flight/control/mrp_feedback.h"', "world may not include"),
    ("cosim/controller/a.cpp", '#include "cosim/transport/link.h"', "cosim/controller may not include"),
    ("emulator/cpu/a.cpp", '#include "sim/model.h"', "emulator may not include"),
    ("introspect/a.py", "import fledge.units", "introspect may not import"),
    ("introspect/a.py", "import numpy", "introspect may not import numpy"),
    ("python/fledge/a.py", "from missions import nadir_spin", "fledge may not import"),
    ("python/fledge/a.py", "import pint", "fledge may not import pint"),
    ("targets/leon3/a.py", "import pint", "fledge may not import pint"),
    ("targets/leon3/a.c", '#include "python/fledge/core/b.h"', "targets may not include"),
    ("missions/a/flight.py", "import numpy as np", "flight.py may not import numpy"),
    ("missions/a/flight.py", "from fledge import sim", "flight.py may not import fledge.sim"),
])
def test_a_shortcut_is_refused_with_its_place_and_rule(path, line, complaint):
    (message,) = check(Path(path), "\n" + line + "\n")
    assert message.startswith(f"{path}:2: ")
    assert complaint in message


@pytest.mark.parametrize("path, line", [
    ("flight/control/a.c", '#include "flight/control/a.h"'),
    ("flight/control/a.h", '#include "flight/msg/head.h"'),
    ("flight/control/a_test.cpp", "#include <gtest/gtest.h>"),
    ("flight/math/a_test.cpp", '#include "flight/testing/eigen.h"'),
    ("flight/testing/eigen.h", "#include <random>"),
    ("world/dynamics/a_test.cpp", '#include "flight/testing/kepler.h"'),
    ("world/dynamics/a.cpp", '#include "sim/model.h"'),
    ("python/fledge/core.cpp", '#include "world/models.h"'),
    ("python/fledge/a.py", "from . import units"),
    ("missions/a/flight.py", "from fledge import flight as fsw"),
    ("missions/a/flight.py", "from fledge.units import N, deg"),
])
def test_what_goes_the_right_way_passes(path, line):
    assert check(Path(path), line + "\n") == []


def test_the_architecture_document_shows_these_rules():
    text = layers.DOCUMENT.read_text(encoding="utf-8")
    assert text == layers.with_tables(text), "a table is outdated; mend it with: /usr/bin/python3 -m tests.layers"
