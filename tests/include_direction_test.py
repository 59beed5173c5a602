# SPDX-License-Identifier: Apache-2.0
"""Who may include whom. The folders are the architecture; this keeps them so.

Flight code must build for a flight computer and the simulation kernel must know no physics: both
stay true only while nobody takes a shortcut through an #include or an import.
"""

import ast
import re
import sys
from pathlib import Path

import pytest

from tests.tree import ROOT, files

# A folder may include itself and these. The longest name that fits a path is its rule.
MAY_INCLUDE = {
    "flight":      ["flight/math", "flight/msg"],  # its subfolders never include one another
    "flight/math": [],
    "flight/msg":  ["flight/math"],
    "registers":   ["flight/math", "flight/msg"],
    "record":      [],                             # a writer any target can take as it is
    "sim":         ["flight/math", "flight/msg", "record"],
    "world":       ["flight/math", "flight/msg", "sim"],
    "cosim":       ["flight/math", "flight/msg", "record", "sim", "registers", "targets", "cosim"],  # bindings
    "cosim/protocol":   ["record"],
    "cosim/security":   [],
    "cosim/transport":  ["cosim/protocol", "cosim/security"],
    "cosim/controller": ["cosim/protocol", "sim"],
    "cosim/node":       ["cosim/protocol", "cosim/security", "cosim/transport", "flight/math", "flight/msg", "sim",
                         "registers", "targets"],
    "cosim/router":     ["cosim/protocol", "cosim/security", "cosim/transport", "cosim/controller", "cosim/node",
                         "sim"],
    "cosim/tools":      ["cosim/protocol", "cosim/security", "cosim/transport", "cosim/controller", "cosim/node",
                         "cosim/router", "sim", "registers", "targets"],
    "emulator":    ["flight/math", "registers"],
    "ground":      ["flight/math"],
    "targets":     ["flight", "registers", "record"],
    "introspect":  [],
    "fledge":      ["flight", "registers", "record", "sim", "world", "cosim"],
    "missions":    ["fledge"],
    "bench":       ["flight", "record", "sim", "world", "cosim", "fledge"],
    "tests":       ["flight", "registers", "record", "sim", "world", "cosim", "emulator", "ground",
                    "targets", "introspect", "fledge", "missions"],
}

# What C that flies may take from the language's library: what a freestanding compiler has, and the
# two whose few functions used here (sqrt, memcpy) every compiler turns into instructions.
FLIGHT_LIBRARY = {"float.h", "limits.h", "math.h", "stdbool.h", "stddef.h", "stdint.h", "string.h"}

# Python's third parties: Debian's packages, each only where it is needed.
THIRD_PARTIES = {
    "flight":     {"mpmath"},                      # flight/math/tools: how coefficients were found
    "introspect": {"clang"},
    "fledge":     {"_core", "_core_build", "h5py", "matplotlib", "numpy", "pandas",
                   "zmq"},
    "cosim":      {"zmq"},
    "missions":   {"fledge_node", "numpy"},        # nodes in Python have the one, and nothing else
    "bench":      {"_core", "jplephem", "mpmath", "numpy"},
    "tests":      {"_core", "numpy"},
}

# flight.py also runs under MicroPython, which has nothing but these. (sqrt is exact in both.)
FLIGHT_PY_MODULES = {"fledge.flight", "fledge.units", "math.sqrt"}

# Where an #include starts: the root, within the extension the package, within the templates theirs,
# and cFE's headers have no folder.
INCLUDE_ROOTS = ("", "python/fledge/", "python/fledge/templates/", "targets/cfs/inc/")

C_SUFFIXES = {".c", ".h", ".cpp", ".hpp"}
INCLUDE = re.compile(r'^\s*#\s*include\s*(?:"([^"]+)"|<([^>]+)>)')


def folder_of(path: str) -> str:
    """The folder whose rule holds for `path`: the subfolder in flight/ and cosim/, else the first one."""
    parts = path.removeprefix("python/").split("/")
    return "/".join(parts[:2]) if parts[0] in ("flight", "cosim") and len(parts) > 2 else parts[0]


def resolve(include: str) -> str:
    """The path from the root of what `include` names; `include` itself if there is no such file."""
    return next((start + include for start in INCLUDE_ROOTS if (ROOT / start / include).is_file()),
                include)


def may_include(folder: str, other: str) -> bool:
    """Whether a file in `folder` may include one in the folder `other`."""
    allowed = MAY_INCLUDE.get(folder, MAY_INCLUDE.get(folder.split("/")[0], []))
    return other == folder or any(other == name or other.startswith(name + "/") for name in allowed)


def is_test(path: Path) -> bool:
    """Whether it is a test, a program that a test builds, or what tests share in testing/."""
    return path.stem.endswith("_test") or path.name in {"conftest.py", "elementary_hash.c"} \
        or "testing" in path.parts


def may_include_helper(folder: str, helper: str) -> bool:
    """Whether a test in `folder` may include a test helper: its own, or of a folder it may use."""
    tops = {name.split("/")[0] for name in [folder, *MAY_INCLUDE.get(folder.split("/")[0], [])]}
    return helper.split("/")[0] in tops


def check_c(path: Path, text: str) -> list[str]:
    """Complaints about the includes of a C or C++ file at `path` (relative to the root)."""
    complaints = []
    folder = folder_of(path.as_posix())
    for number, line in enumerate(text.splitlines(), 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        ours, library = match.groups()
        if ours and "testing" in Path(ours).parts:
            if not is_test(path) or not may_include_helper(folder, ours):
                complaints.append(f'{path}:{number}: "{ours}" is for the tests of its folder and of '
                                  f"those that may use it")
        elif ours and not may_include(folder, folder_of(resolve(ours))):
            complaints.append(f'{path}:{number}: {folder} may not include "{ours}"; '
                              f"it may include {allowed_text(folder)}")
        if library and folder.startswith("flight") and not is_test(path) \
                and library not in FLIGHT_LIBRARY:
            complaints.append(f"{path}:{number}: <{library}> is not for flight code, which has "
                              f"{', '.join(sorted(FLIGHT_LIBRARY))}")
    return complaints


def check_python(path: Path, text: str) -> list[str]:
    """Complaints about the imports of a Python file at `path` (relative to the root)."""
    complaints = []
    folder = folder_of(path.as_posix())
    third_parties = THIRD_PARTIES.get(folder.split("/")[0], set())
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            top = name.split(".")[0]
            if path.parts[0] == "missions" and path.name == "flight.py":
                if not any(name == module or name.startswith(module + ".")
                           for module in FLIGHT_PY_MODULES):
                    complaints.append(f"{path}:{node.lineno}: flight.py may not import {name}; it "
                                      f"may import {', '.join(sorted(FLIGHT_PY_MODULES))}")
            elif top in MAY_INCLUDE:
                if not may_include(folder, top) and not (is_test(path) and top == "tests"):
                    complaints.append(f"{path}:{node.lineno}: {folder} may not import {name}; "
                                      f"it may import {allowed_text(folder)}")
            elif top not in sys.stdlib_module_names and not is_test(path) \
                    and top not in third_parties:
                complaints.append(f"{path}:{node.lineno}: {folder} may not import {name}; of other "
                                  f"projects it may import "
                                  f"{', '.join(sorted(third_parties)) or 'nothing'}")
    return complaints


def allowed_text(folder: str) -> str:
    allowed = MAY_INCLUDE.get(folder, MAY_INCLUDE.get(folder.split("/")[0], []))
    return ", ".join([folder, *allowed])


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
    folders = {folder_of(path.as_posix()).split("/")[0] for path in files()
               if len(path.parts) > 1 and path.suffix in C_SUFFIXES | {".py"}}
    assert folders <= MAY_INCLUDE.keys()


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
    ("python/fledge/a.py", "from introspect import reader", "fledge may not import"),
    ("python/fledge/a.py", "import pint", "fledge may not import pint"),
    ("missions/a/flight.py", "import numpy as np", "flight.py may not import numpy"),
    ("missions/a/flight.py", "from fledge import sim", "flight.py may not import fledge.sim"),
])
def test_a_shortcut_is_refused_with_its_place_and_rule(path, line, complaint):
    (found,) = check(Path(path), "\n" + line + "\n")
    assert found.startswith(f"{path}:2: ")
    assert complaint in found


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
