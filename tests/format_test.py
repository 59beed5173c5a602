# SPDX-License-Identifier: Apache-2.0
"""clang-format and autopep8 have nothing to change in the tree; mypy and clang-tidy find nothing.

With all long tests, in all files; else in those that changed since this branch began (tests/changed.py).
"""

import os
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests import changed, tidy
from tests.needs import needs, skip_without
from tests.tree import ROOT, files

pytestmark = pytest.mark.spread
SHARES = 8      # of the product's sources, so that clang-tidy has work on all processors


def run(*command):
    """(exit code, output)"""
    done = subprocess.run([*map(str, command)], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.returncode, done.stdout


@pytest.fixture(scope="module")
def selected(request):
    """The files to check; all where git does not know which changed."""
    if request.config.getoption("--long") == "all":
        return files()
    try:
        return sorted(set(files()) & {Path(path) for path in changed.changed_files(ROOT)})
    except changed.Failure:
        return files()


def paths(selected, suffixes):
    chosen = [str(path) for path in selected if path.suffix in suffixes]
    return chosen or pytest.skip("no such file changed")


def of_debian_12(tool):
    """Skip where the tool of LLVM is not version 14, since others lay out and find otherwise."""
    skip_without(tool)
    if " version 14." not in run(tool, "--version")[1]:
        pytest.skip(f"{tool} is not that of Debian 12, version 14")


def test_c_and_cpp_are_formatted(selected):
    of_debian_12("clang-format")
    _, printed = run("clang-format", "--dry-run", *paths(selected, {".c", ".h", ".cpp"}))
    differ = sorted({line.split(":")[0] for line in printed.splitlines() if "-Wclang-format-violations" in line})
    assert not differ, f"mend it with: clang-format -i {' '.join(differ)}"


def test_python_is_formatted(selected):
    _, printed = run("autopep8", "--diff", "--jobs", os.cpu_count(), *paths(selected, {".py"}))
    differ = sorted(line.removeprefix("--- original/") for line in printed.splitlines()
                    if line.startswith("--- original/"))
    assert not differ, f"mend it with: autopep8 -i {' '.join(differ)}"


@pytest.mark.long("mypy reads all of Python's types: a minute")
@needs("mypy")
def test_the_types_of_python_hold():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    if "mypy" not in settings["tool"]:
        pytest.skip("pyproject.toml has no [tool.mypy]")
    code, printed = run("/usr/bin/mypy", "--config-file", "pyproject.toml", "--cache-dir", "build/.mypy_cache")
    assert code == 0, printed


@pytest.mark.parametrize("share", range(SHARES))
def test_clang_tidy_finds_nothing(share, selected):
    of_debian_12("clang-tidy")
    chosen = {path.with_suffix("") for path in selected if path.suffix in {".c", ".cpp", ".h"}}
    sources = [path for path in tidy.sources() if path.with_suffix("") in chosen]
    findings = "".join(map(tidy.tidy, tidy.units(sources)[share::SHARES]))
    assert not findings, findings


@needs("clang-tidy")
def test_clang_tidy_reads_what_does_not_fit_into_a_file_apart(monkeypatch, tmp_path):
    """Two sources that both define a function without `static`, one of them with a finding."""
    first, second = (tmp_path / "record" / name for name in ("a.c", "b.c"))
    first.parent.mkdir()
    first.write_text("int f(void) { return 0; }\n")
    second.write_text("int f(void) { return (int)sizeof(sizeof(int)); }\n")
    monkeypatch.setattr(tidy, "FOLDER", tmp_path / "unit")
    findings = tidy.tidy((["-std=c99"], [first, second]))
    assert "bugprone-sizeof-expression" in findings and "redefinition" not in findings
