# SPDX-License-Identifier: Apache-2.0
"""Rules for every file of the repository: its licence, its size, its text."""

import re

from tests.tree import ROOT, files

CODE = {".c", ".h", ".cpp", ".hpp", ".py", ".sh", ".cmake", ".js"}
LARGEST = 1_000_000     # bytes
WIDEST = 120            # columns, as .clang-format and pyproject.toml have it

# A path of somebody's machine, and the words that promise work instead of doing it.
MACHINE_PATH = re.compile(r"(?<![\w.~-])/(?:work|root|Users)/")
PROMISE = re.compile(r"\b(?:TO" r"DO|FIX" r"ME|XX" r"X)\b")


def is_code(path):
    return path.suffix in CODE or path.name in {"CMakeLists.txt", "fledge", "run"}


def code():
    """(path, lines) of every source file that a person wrote."""
    for path in files():
        if is_code(path):
            yield path, (ROOT / path).read_text(encoding="utf-8").split("\n")


def test_every_source_file_names_its_licence():
    lacking = [str(path) for path, lines in code()
               if any(lines) and not any("SPDX-License-Identifier: Apache-2.0" in line
                                         for line in lines[:3])]
    assert lacking == []


def test_nothing_is_large():
    assert [str(path) for path in files() if (ROOT / path).stat().st_size > LARGEST] == []


def test_names_differ_in_more_than_case():
    """Some file systems ignore the case of letters."""
    names = [str(path).lower() for path in files()]
    assert sorted(set(names)) == sorted(names)


def test_no_text_names_a_machine_or_promises_work():
    problems = [f"{path}:{number}: {line.strip()}" for path, lines in code() for number, line in enumerate(lines, 1)
                if MACHINE_PATH.search(line) or PROMISE.search(line)]
    assert not problems, "\n" + "\n".join(problems)


def test_lines_are_tidy():
    untidy = []
    for path, lines in code():
        for number, line in enumerate(lines, 1):
            if len(line) > WIDEST:
                untidy.append(f"{path}:{number}: {len(line)} columns; {WIDEST} is the most")
            if line != line.rstrip() or "\t" in line:
                untidy.append(f"{path}:{number}: a tab, or a space at the end")
        if any(lines) and (lines[-1] != "" or lines[-2:] == ["", ""]):
            untidy.append(f"{path}: a file ends with one newline")
    assert not untidy, "\n" + "\n".join(untidy)
