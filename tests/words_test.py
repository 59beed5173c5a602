# SPDX-License-Identifier: Apache-2.0
"""Comments, names, strings and documents do without the words that CONTRIBUTING.md rules out."""

import re
from pathlib import Path

import pytest

from tests.tree import ROOT, files

C_LIKE = {".c", ".h", ".cpp", ".hpp", ".js", ".mjs", ".S"}
STRING = re.compile(r"""R"\((?:.|\n)*?\)"|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*'|`(?:[^`\\]|\\.)*`""")
FENCE = re.compile(r"^ *```.*?^ *```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
LIST = re.compile(r"Do not use ((?:\"[a-z ]+\"[,:] ?)+)")
LIST_OF_NAMES = re.compile(r"No name is ([^:]+):")
NOT_CODE = re.compile(r"/\*(?:.|\n)*?\*/|(?<!:)//[^\n]*|" + STRING.pattern)
NOT_CODE_IN_PYTHON = re.compile(r"""#[^\n]*|\"{3}(?:[^\\]|\\.)*?\"{3}|'{3}(?:[^\\]|\\.)*?'{3}"""
                                r"""|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*'""", re.DOTALL)


def ruled_out() -> re.Pattern[str]:
    """The words of CONTRIBUTING.md: in a text, and in names as theWord, TheWord and the_word; of "is X" all forms."""
    (words,) = LIST.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").replace("\n", " "))
    forms = [re.sub(r"^is ", "(?:is|are|was|were|be|been|being)[ _]", word) for word in re.findall(r'"([^"]+)"', words)]
    return re.compile(r"(?:(?<![a-zA-Z])|(?<=[a-z])(?=[A-Z]))(?:%s)(?![a-z])" % "|".join(forms), re.IGNORECASE)


def names_ruled_out() -> re.Pattern[str]:
    """The first word of CONTRIBUTING.md's list of names as a whole name, the others as a part of one: told_x, xTold."""
    (words,) = LIST_OF_NAMES.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").replace("\n", " "))
    whole, *parts = re.findall(r'"([a-z]+)"', words)
    small, large = "|".join(parts), "|".join(part.title() for part in parts)
    return re.compile(rf"\b_*{whole}_*\b|\b\w*(?:(?<![a-zA-Z])(?:{small}|{large})|(?<=[a-z])(?:{large}))(?![a-z])\w*")


RULED_OUT = ruled_out()
NAMES_RULED_OUT = names_ruled_out()


def complaints(path: Path, text: str) -> list[str]:
    """The words that are ruled out, in a source with its strings, or in the prose of a document."""
    prose = FENCE.sub(" ", text) if path.suffix == ".md" else text
    return [f"{path}: {match[0]}" for match in RULED_OUT.finditer(prose)]


def misnamed(path: Path, text: str) -> list[str]:
    code = (NOT_CODE_IN_PYTHON if path.suffix == ".py" else NOT_CODE).sub("", text)
    return [f"{path}: {match[0]}" for match in NAMES_RULED_OUT.finditer(code)]


def test_no_name_has_a_word_that_is_ruled_out():
    problems = [problem for path in files() if path.suffix in C_LIKE - {".S"} | {".py"} and "oracle" not in path.parts
                for problem in misnamed(path, (ROOT / path).read_text(encoding="utf-8"))]
    assert not problems, "\n" + "\n".join(problems)


@pytest.mark.parametrize("name, text, found", [
    ("a.c", "for (int one = 0; one < 3; one++)", True),
    ("a.cpp", "one_ = oneOf(none, onePacket, \"one\"); // one", True),
    ("a.cpp", "oneOf(none, onePacket, \"told\"); /* one\n told */", False),
    ("a.js", "const wasTold = 1;", True),
    ("a.py", '""\"What one\ntold."""\nx = "one", \'one\'     # one', False),
    ("a.py", "self._asked_again = retold", True),
    ("a.py", "retold, whole, on_e, who_le = None", True),
    ("a.py", "retold, whole, on_e = None", False),
    ("a.py", "def test_the_craft_is_Told_all(): pass", True),
])
def test_names_are_found_in_code(name, text, found):
    assert bool(misnamed(Path(name), text)) == found


def test_no_file_has_a_word_that_is_ruled_out():
    found = [complaint for path in files() if path.suffix in C_LIKE | {".py", ".md", ".yaml", ".yml"}
             and path.name not in ("CONTRIBUTING.md", "words_test.py") and "oracle" not in path.parts
             for complaint in complaints(path, (ROOT / path).read_text(encoding="utf-8"))]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize("name, text, found", [
    ("a.c", "int x; // nobody reads it\n", True),
    ("a.c", "/* It's here.\n * Whoever reads it */\n", True),
    ("a.c", "#define NOBODY 3\n", True),
    ("a.c", 'say("nobody");\n', True),
    ("a.cpp", "TEST(A, SeenByNobody)\n", True),
    ("a.h", "/// They are told the time.\n", True),
    ("a.py", "def test_nobody_waits():\n    pass\n", True),
    ("a.py", '"""What is told."""\n', True),
    ("a.py", 'user = "nobody"\n', True),
    ("a.py", "retold = 1     # is toldable\n", False),
    ("a.js", 'put(user ?? "nobody");\n', True),
    ("a.yaml", "summary: (nobody has logged in)\n", True),
    ("a.md", "It works for whoever asks.\n", True),
    ("a.md", "```\nnobody\n```\nThe user `nobody`.\n", False),
])
def test_words_are_found_where_people_read_them(name, text, found):
    assert bool(complaints(Path(name), text)) == found
