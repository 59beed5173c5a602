# SPDX-License-Identifier: Apache-2.0
"""clang-format and autopep8 have nothing to change in the tree; mypy and clang-tidy find nothing."""

import os
import subprocess
import tomllib

import pytest

from tests.tree import ROOT, files

# clang-tidy reads some sources here, because all of them take minutes. .clang-tidy has the command for all.
TIDIED = ["flight/control/mrp_feedback.c", "flight/math/trig.c", "record/mcap.c", "registers/lane.c"]


def run(*command):
    """(exit code, what it printed)"""
    done = subprocess.run([*map(str, command)], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.returncode, done.stdout


def paths(suffixes):
    return [str(path) for path in files() if path.suffix in suffixes]


def test_c_and_cpp_are_formatted():
    _, printed = run("clang-format", "--dry-run", *paths({".c", ".h", ".cpp"}))
    differ = sorted({line.split(":")[0] for line in printed.splitlines() if "-Wclang-format-violations" in line})
    assert not differ, f"mend it with: clang-format -i {' '.join(differ)}"


def test_python_is_formatted():
    _, printed = run("autopep8", "--diff", "--jobs", os.cpu_count(), *paths({".py"}))
    differ = sorted(line.removeprefix("--- original/") for line in printed.splitlines()
                    if line.startswith("--- original/"))
    assert not differ, f"mend it with: autopep8 -i {' '.join(differ)}"


def test_the_types_of_python_hold():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    if "mypy" not in settings["tool"]:
        pytest.skip("pyproject.toml has no [tool.mypy]")
    code, printed = run("/usr/bin/mypy", "--config-file", "pyproject.toml", "--cache-dir", "build/.mypy_cache")
    assert code == 0, printed


@pytest.mark.parametrize("source", TIDIED)
def test_clang_tidy_finds_nothing(source):
    code, printed = run("clang-tidy", "--quiet", "-p", "build/release", source)
    assert code == 0, printed
