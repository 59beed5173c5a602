# SPDX-License-Identifier: Apache-2.0
"""Which changes are drawn, and what becomes of them in a small tree."""

import json
import subprocess

import pytest

from bench import mutants, mutation
from tests.needs import needs

ONLY_CODE = '''// a < b
#define LESS(a, b) \\
    ((a) < (b))
/* a && b */ static const char *text = "a < b", sign = '<';
std::vector<int> f(T *x, U &&y);
static_assert(sizeof(T) == 8);
constexpr double coefficient = 1.4426950408889634, mask = 0xff;
'''


def lines(name, text):
    """Each change, as the pieces of text before and after."""
    return [(text[c.start:c.stop], c.after) for c in mutation.changes(name, text)]


def test_comments_strings_types_and_the_preprocessor_stay():
    assert lines("a.cpp", ONLY_CODE) == []


@pytest.mark.parametrize("text, expected", [
    ("a < b", [("<", "<="), ("<", ">=")]),
    ("a && !b", [("&&", "||")]),
    ("a * -b", [("*", "/")]),
    ("a += b - 2", [("+=", "-="), ("-", "+"), ("2", "3")]),
    ("f(0, 1u, 1.0, 0.5, true)", [("0", "1"), ("1u", "0u"), ("1.0", "0.0"), ("0.5", "1.5"), ("true", "false")]),
])
def test_operators_and_constants_of_c(text, expected):
    assert lines("a.c", f"x = {text};") == expected


def test_statements_conditions_and_results_of_c():
    text = "int f(int n)\n{\n    if (n) {\n        g(n);\n    }\n    T *x;\n    x->n = n;\n    return n;\n}\n"
    assert lines("a.c", text) == [("n", "!(n)"), ("g(n)", ""), ("x->n = n", ""), ("n", "0")]
    assert lines("a.cpp", text)[-1] == ("n", "{}")


def test_python_is_read_by_its_own_parser():
    text = ('"""a < b"""\nif __name__ == "__main__":\n    f(1)\n\n\ndef f(*a, b=1):\n    """1 + 1"""\n    ü = -b\n'
            '    a.x = ü and "1"\n    return ü - b if b else g(a)\n')
    assert lines("a.py", text) == [("1", "0"), ('a.x = ü and "1"', "pass"), ("and", "or"),
                                   ("ü - b if b else g(a)", "None"), ("-", "+"), ("b", "(not (b))")]


def test_the_seed_determines_what_is_drawn():
    found = mutants.mutants_of(mutants.ROOT, mutants.files_of(mutants.ROOT), ["record", "bench"])

    def drawn(seed):
        return [(m.file, *m.lines()) for m in mutants.drawn(found, seed)[:20]]

    assert drawn(1) == drawn(1) != drawn(2)
    places = [(m.file, m.change.start) for m in mutants.drawn(found, 1)]
    assert len(places) == len(set(places))
    assert not any("_test" in name or "oracle" in name for name, _ in places)


TINY = {
    "CMakePresets.json": '{"version": 6, "configurePresets": [{"name": "release", "generator": "Ninja",'
                         ' "binaryDir": "${sourceDir}/build/release", "cacheVariables": {"CMAKE_C_FLAGS": "-O1"}}]}',
    "CMakeLists.txt": "cmake_minimum_required(VERSION 3.25)\nproject(tiny C)\ninclude(CTest)\n"
                      "add_executable(tiny_test part/tiny_test.c part/tiny.c)\n"
                      "add_custom_target(tests DEPENDS tiny_test)\n"
                      "add_test(NAME tiny COMMAND tiny_test)\nset_tests_properties(tiny PROPERTIES LABELS gtest)\n",
    "part/tiny.c": "int larger(int a, int b)\n{\n    return a > b ? 1 : 2;\n}\n"
                   "int untested(int a)\n{\n    return a - 7;\n}\n"
                   "int constant(void)\n{\n    return 5 > 3 ? 2 : 4;\n}\n"
                   "int named(int n)\n{\n    switch (n) {\n    case 0: return 8;\n    case 1: return 9;\n    }\n"
                   "    return 6;\n}\n"
                   "void wait(volatile int *n)\n{\n    while (*n > 0) {\n        (*n)--;\n    }\n}\n",
    "part/tiny_test.c": "int larger(int a, int b);\nint constant(void);\nint named(int n);\n"
                        "void wait(volatile int *n);\nint main(void)\n{\n    int n = 3;\n    wait(&n);\n"
                        "    return larger(1, 2) != 2 || larger(2, 2) != 2 || larger(3, 2) != 1 || constant() != 2 ||"
                        " named(0) != 8 || named(1) != 9 || named(2) != 6 || n;\n}\n",
    "part/rules.py": "def even(n):\n    return n % 2 == 0\n\n\ndef untested(n):\n    return n + 1\n",
    "part/rules_test.py": "from part.rules import even\n\n\ndef test_even():\n    assert even(4) and not even(3)\n",
}


@pytest.fixture
def tiny(tmp_path, monkeypatch):
    for name, text in TINY.items():
        (tmp_path / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "tree" / name).write_text(text)
    subprocess.run(["git", "init", "-q", tmp_path / "tree"], check=True)
    monkeypatch.setattr(mutants, "ROOT", tmp_path / "tree")
    monkeypatch.setattr(mutants, "LEAST_LIMIT", 1.0)
    return tmp_path


@pytest.mark.long("builds and tests mutants")
@needs("git")
def test_each_change_has_its_outcome(tiny, capsys):
    arguments = ["part", "--count", "1000", "--at", str(tiny / "at")]
    assert mutants.main([*arguments, "--json", str(tiny / "all.json")]) == 0
    rows = json.loads((tiny / "all.json").read_text())
    outcome = {(row["before"], row["after"]): row["outcome"] for row in rows}
    assert outcome["return a > b ? 1 : 2;", "return 0;"] == "killed"
    assert outcome["return 5 > 3 ? 2 : 4;", "return 6 > 3 ? 2 : 4;"] == "equivalent"
    assert outcome["case 0: return 8;", "case 1: return 8;"] == "not compiled"
    assert outcome["(*n)--;", ";"] == "killed by time"
    assert outcome["return n % 2 == 0", "return n % 3 == 0"] == "killed"
    survivors = {row["line"] for row in rows if row["outcome"] == "survived" and row["file"] == "part/tiny.c"}
    assert survivors == {7}
    assert outcome["return n + 1", "return None"] == outcome["return n + 1", "return n - 1"] == "survived"
    out = capsys.readouterr().out
    assert "part/tiny.c:7\n    return a - 7;\n" in out
    tested, *counts = map(int, out.splitlines()[-1].split()[1:])
    assert tested == sum(counts[:3]) and sum(counts) == len(rows)

    # The user's files are as before, and a test that is added notices the survivors.
    assert all((tiny / "tree" / name).read_text() == text for name, text in TINY.items())
    test = tiny / "tree/part/rules_test.py"
    test.write_text(TINY["part/rules_test.py"].replace("even\n", "even, untested\n", 1)
                    + "\n\ndef test_untested():\n    assert untested(1) == 2\n")
    assert mutants.main([*arguments, "--again", str(tiny / "all.json"), "--json", str(tiny / "again.json")]) == 0
    again = json.loads((tiny / "again.json").read_text())
    assert {row["file"] for row in again if row["outcome"] == "survived"} == {"part/tiny.c"}
    assert {row["outcome"] for row in again if row["file"] == "part/rules.py"} == {"killed"}
