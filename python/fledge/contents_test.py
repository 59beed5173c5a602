# SPDX-License-Identifier: Apache-2.0
"""What is built is what the sources say, whatever their times are. Ninja alone would miss each change here."""

import os
import subprocess
from pathlib import Path

import pytest

from fledge import contents
from fledge.contents import by_contents, changed
from fledge.launcher.build import Build
from fledge.launcher.context import Context
from fledge.targets import build

HOUR = 3_600_000_000_000


def restore(path, text, age=HOUR):
    """As `cp -p`: with an older time [ns]."""
    path.write_text(text)
    back(path, age)


def back(path, age=HOUR):
    now = path.stat().st_mtime_ns
    os.utime(path, ns=(now - age, now - age))


@pytest.fixture
def sources(tmp_path):
    """A program that prints a number of its source and one of a header."""
    folder = tmp_path / "a folder: of $ources"
    folder.mkdir()
    (folder / "main.c").write_text('#include <stdio.h>\n#include "more.h"\nint main(void) {printf("%d", MORE + 1);}\n')
    (folder / "more.h").write_text("#define MORE 10\n")
    return folder


def printed(folder, tmp_path):
    path = build.program(tmp_path / "out", "prints", [folder / "main.c"], [folder])
    return int(subprocess.run([path], capture_output=True, text=True, check=True).stdout), path.stat().st_mtime_ns


def test_a_source_and_a_header_of_an_older_time_are_compiled(sources, tmp_path):
    assert printed(sources, tmp_path)[0] == 11
    main = (sources / "main.c").read_text()
    restore(sources / "main.c", main.replace("+ 1", "+ 2"))
    assert printed(sources, tmp_path)[0] == 12
    restore(sources / "more.h", "#define MORE 20\n")
    assert printed(sources, tmp_path)[0] == 22
    restore(sources / "more.h", "#define MORE 10\n", 2 * HOUR)
    assert printed(sources, tmp_path)[0] == 12


def test_the_time_and_size_of_another_source_hide_nothing(sources, tmp_path):
    assert printed(sources, tmp_path)[0] == 11
    time = (sources / "more.h").stat().st_mtime_ns
    (sources / "more.h").write_text("#define MORE 30\n")
    os.utime(sources / "more.h", ns=(time, time))
    assert printed(sources, tmp_path)[0] == 31


def test_the_same_contents_are_not_compiled_again(sources, tmp_path):
    first = printed(sources, tmp_path)
    back(sources / "main.c")
    back(sources / "more.h", 2 * HOUR)
    assert printed(sources, tmp_path) == first


def test_what_did_not_compile_does_not_stay(sources, tmp_path):
    printed(sources, tmp_path)
    restore(sources / "more.h", "#define MORE ten\n")
    with pytest.raises(build.Failure, match="ten"):
        printed(sources, tmp_path)
    restore(sources / "more.h", "#define MORE 10\n")
    assert printed(sources, tmp_path)[0] == 11
    (sources / "more.h").rename(sources / "away.h")
    with pytest.raises(build.Failure, match="more.h"):
        printed(sources, tmp_path)
    restore(sources / "more.h", "#define MORE 40\n")
    assert printed(sources, tmp_path)[0] == 41


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project of CMake: a library of C, and a text that a program makes from another one. `project(targets)` builds
    it as the launcher does."""
    tree = tmp_path / "tree"
    tree.mkdir()
    (tree / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.20)\nproject(small LANGUAGES C)\nset(answer 1)\n"
        "configure_file(answer.in ${CMAKE_BINARY_DIR}/answer.txt)\nadd_library(small SHARED small.c)\n"
        "add_custom_command(OUTPUT made.txt COMMAND cp ${CMAKE_SOURCE_DIR}/given.txt made.txt DEPENDS given.txt)\n"
        "add_custom_target(texts ALL DEPENDS made.txt)\n")
    for name, text in (("answer.in", "@answer@\n"), ("given.txt", "one\n"), ("small.c", "int small = 1;\n")):
        (tree / name).write_text(text)
    folder = tree / "build/release"

    def make(*targets):
        Build(tree, folder, ["-G", "Ninja", "-S", ".", "-B", str(folder)]).make(Context(), targets, False)

    make()
    make.tree, make.folder = tree, folder
    return make


@pytest.mark.parametrize("source, text, made", [
    ("given.txt", "two\n", lambda folder: (folder / "made.txt").read_text() == "two\n"),
    ("answer.in", "of @answer@\n", lambda folder: (folder / "answer.txt").read_text() == "of 1\n"),
    ("small.c", "int small = 1, other = 2;\n", lambda folder: b"\0other\0" in (folder / "libsmall.so").read_bytes())])
def test_a_project_is_built_from_what_it_has(project, source, text, made):
    restore(project.tree / source, text)
    assert not made(project.folder) and changed(project.folder) == [str(project.tree / source)]
    project()
    assert made(project.folder) and not changed(project.folder)


def test_a_file_of_cmake_of_an_older_time_configures(project):
    file = project.tree / "CMakeLists.txt"
    restore(file, file.read_text().replace("answer 1", "answer 42"))
    project()
    assert (project.folder / "answer.txt").read_text() == "42\n"


def test_what_ninja_has_built_by_hand_stays(project):
    (project.tree / "small.c").write_text("int small = 2;\n")
    subprocess.run(["ninja", "-C", project.folder], check=True, stdout=subprocess.DEVNULL)
    built = (project.folder / "libsmall.so").stat().st_mtime_ns
    project()
    assert (project.folder / "libsmall.so").stat().st_mtime_ns == built


def test_where_nothing_changes_nothing_is_written_or_read(project, monkeypatch):
    record = (project.folder / contents.RECORD).stat()
    monkeypatch.setattr(Path, "read_bytes", lambda path: (_ for _ in ()).throw(AssertionError(path))
                        if path.name != contents.RECORD else path.open("rb").read())
    monkeypatch.setattr(contents, "_made_of", None)
    with by_contents(project.folder):
        pass
    assert (project.folder / contents.RECORD).stat() == record
