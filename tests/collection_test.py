# SPDX-License-Identifier: Apache-2.0
"""Every test of the tree is run: pytest collects those in Python, and CMake builds those in C and C++ for ctest."""

import configparser
import os
from pathlib import Path

import pytest

from tests.tree import ROOT, files

BUILD = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release")
TEMPLATES = Path("python/fledge/templates")     # tests of projects: project_test.py begins some, and tests them


def named_tests(*suffixes):
    return {path for path in files() if path.stem.endswith("_test") and path.suffix in suffixes
            and TEMPLATES not in path.parents}


def uncollected(paths):
    """Those in none of the folders that pytest.ini names."""
    settings = configparser.ConfigParser()
    settings.read(ROOT / "pytest.ini")
    places = set(map(Path, settings["pytest"]["testpaths"].split()))
    return {path for path in paths if not places & set(path.parents)}


def test_pytest_collects_every_test_in_python():
    assert uncollected(named_tests(".py")) == set(), "add their folder to the testpaths of pytest.ini"
    assert uncollected([Path("cellar/a_test.py"), Path("sim/a_test.py")]) == {Path("cellar/a_test.py")}


@pytest.mark.skipif("BUILD_TESTING:BOOL=ON" not in (BUILD / "CMakeCache.txt").read_text(encoding="utf-8"),
                    reason="./fledge setup --test configures the tests")
def test_cmake_builds_every_test_in_c_and_cpp():
    built = {Path(os.path.normpath(line.split()[1])) for line in open(BUILD / "tests.txt", encoding="utf-8")}
    assert named_tests(".c", ".cpp") - built == set(), \
        "add them to a fledge_add_test() in a CMakeLists.txt"
