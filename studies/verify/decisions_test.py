# SPDX-License-Identifier: Apache-2.0
import subprocess

import pytest

from fledge.disk import ROOT
from fledge.errors import Failure
from fledge.verify import decisions
from tests.needs import section, skip_without

HEADER = """
static inline int both(int a, int b)
{
    return a > 0 && b > 0;
}
#define WITHIN(x) ((x) > 0 && (x) < 9)
"""
SOURCE = """
#include "flight/shared.h"
int other(int a, int b);
int run(int a, int b)
{
    int n = 0;
    if (a > 0 && (b > 0 || b < -5))
        n += other(a, b);
    if (a > 10) /* undecided: nothing is that large,
                   here */
        n++;
    if (sizeof(int) == 4 && b > 0)
        n++;
    /* undecided: it has decided all the same */
    if (b > 0)
        n++;
    if (WITHIN(a))
        n += both(a, b);
    switch (b) {
    case 1:
        n++;
        break;
    case 77:
        n--;
        break;
    default:
        break;
    }
    for (int i = 0; i < (a > 5 ? 1 : 2) && n < 4; i++)
        n++;
    return n;
}
"""
OTHER = """
#include "flight/shared.h"
int other(int a, int b)
{
    return both(a, -b) + both(-a, b);
}
"""
NO_PAIR = "true and false, and no two evaluations differ in it alone"
SILENT = "int silent(int a) { return a > 0 ? 1 : 2; }\n"


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """(folder, program): run(A, B) with each pair of its arguments; what it counts is to be read below the folder."""
    return build(tmp_path_factory.mktemp("decisions"), {
        "flight/shared.h": HEADER, "flight/run.c": SOURCE, "flight/other.c": OTHER, "flight/silent.c": SILENT})


def build(folder, sources):
    skip_without(*section("decisions"))
    (folder / "flight/testing").mkdir(parents=True)
    for name, text in {**sources, "flight/testing/main.c": """
#include <stdlib.h>
int run(int a, int b);
int main(int n, char **words)
{
    for (int i = 1; i < n; i += 2)
        run(atoi(words[i]), atoi(words[i + 1]));
    return 0;
}
"""}.items():
        (folder / name).write_text(text)
    subprocess.run([ROOT / "cmake/by_clang.sh", "gcc", "-w", "-O1", "-fprofile-instr-generate", "-fcoverage-mapping",
                    "-fcoverage-mcdc", "-I.", "-o", "program", *sorted((folder / "flight").rglob("*.c"))], cwd=folder,
                   check=True)
    return folder, folder / "program"


def missing(built, *pairs, whole=False):
    """File -> line -> condition -> what is missing, of runs of the program, one for each tuple of numbers."""
    folder, program = built
    counts = [folder / f"{i}.profraw" for i in range(len(pairs))]
    for numbers, count in zip(pairs, counts):
        subprocess.run([program, *map(str, numbers)], check=True, env={"LLVM_PROFILE_FILE": str(count)})
    files = decisions.read(counts, [program], [folder], whole)
    return files, {name: {(condition.line, condition.text): condition.missing for condition in file.conditions}
                   for name, file in files.items()}


def test_each_condition_that_nothing_has_shown_to_decide_is_named_with_what_is_missing(built):
    files, of = missing(built, (3, 1))
    run = of["flight/run.c"]
    assert run[7, "a > 0"] == "never false" and run[7, "b < -5"] == "never evaluated"
    assert run[20, "case 1"] == "" and run[23, "case 77"] == run[26, "default"] == "never taken"
    assert run[9, "a > 10"] == "never true" and files["flight/run.c"].reasoned[0].reason == \
        "nothing is that large, here"
    assert (12, "sizeof(int) == 4") not in run and run[12, "b > 0"] == "never false"    # a constant decides nothing
    assert "flight/silent.c" not in of and of["flight/shared.h"].keys() == {
        (4, "a > 0"), (4, "b > 0")}
    assert run[17, "(x) > 0 in WITHIN(a)"] == "never false"     # where it is used
    whole = missing(built, (3, 1), whole=True)[1]
    assert whole["flight/silent.c"] == {(1, "a > 0"): "never evaluated"}


def test_a_condition_decides_when_a_pair_shows_it_in_runs_together_and_not_before(built):
    # b > 0 was true and false, but where it was false, the other condition made the same result.
    first = missing(built, (3, 1, 3, -9))[1]["flight/run.c"]
    assert first[7, "b > 0"] == NO_PAIR and first[7, "b < -5"] == "never false"
    files, of = missing(built, (3, 1, 3, -9), (3, -2), (-1, -2, 12, 3, 30, 77))
    assert [name for name, of_file in of.items() for text in of_file.values() if text] == []
    file = files["flight/run.c"]
    assert file.decided == len(file.conditions) == 14 and not file.open and not file.reasoned
    assert [condition.line for condition in file.stale] == [9, 15]
    assert any("line 15: b > 0: decides, and has a reason why not" in line for line in decisions.lines(files))


def test_an_inline_function_counts_once_over_its_sources(built):
    files, of = missing(built, (3, 1))
    assert [(c.line, c.column) for c in files["flight/shared.h"].conditions].count((4, 12)) == 1
    # other.c has a > 0 both ways, run.c true only; a pair must be of one source.
    assert of["flight/shared.h"][4, "a > 0"] == NO_PAIR
    assert missing(built, (3, 1, 3, -9))[1]["flight/shared.h"][4, "a > 0"] == ""


MACROS = """
#define SET(x) ((x) != 0)
#define BOTH(x, y) ((x) != 0 && SET(y))
#define BETWEEN(x, low, high) (SET(x) && (x) >= (low) && (x) <= (high))
#define LARGER(x, y) ((x) > (y) ? (x) : (y))
"""
# The same decision by macros, and written out.
ALIKE = [
    ("BOTH(a, b) || BOTH(b, c)", "(a != 0 && b != 0) || (b != 0 && c != 0)"),
    ("SET(a) && SET(c)", "a != 0 && c != 0"),
    ("BOTH(c, b)", "c != 0 && b != 0"),
    ("BOTH(a, c)", "a != 0 && c != 0"),
    ("BETWEEN(a, b, c) || b > 0", "(a != 0 && a >= b && a <= c) || b > 0"),
    ("SET(LARGER(a, b)) && c", "(a > b ? a : b) != 0 && c"),
    ("SET(a && b)", "(a && b) != 0"),
    ("sizeof(int) == 4 && BOTH(a, b)", "sizeof(int) == 4 && (a != 0 && b != 0)"),
]


def test_a_condition_in_a_macro_counts_where_the_macro_is_used_as_if_it_were_written_there(tmp_path):
    def source(column):
        return MACROS + "int run(int a, int b)\n{\n    int n = 0, c = b >> 4; b &= 15;\n" + "".join(
            f"    if ({pair[column]}) n++;\n" for pair in ALIKE) + "    return n;\n}\n"

    def build_(column):
        (folder := tmp_path / str(column)).mkdir()
        return build(folder, {"flight/run.c": source(column)})

    by_macro, by_hand = map(build_, range(2))
    first = MACROS.count("\n") + 4
    some = set()
    for tests in ([(1, 17)], [(1, 17), (0, 17), (1, 16)], [(1, 17), (1, 1), (0, 0), (0, 17)],
                  [(a, b | c << 4) for a in (-1, 0, 1, 2) for b in (0, 1, 2) for c in (0, 1, 2)]):
        def left(program):
            file = missing(program, [number for pair in tests for number in pair])[0]["flight/run.c"]
            lines = [[condition.missing for condition in file.conditions if condition.line == line]
                     for line in range(first, first + len(ALIKE))]
            assert sum(map(len, lines)) == len(file.conditions)
            return [sorted(line) for line in lines]     # a macro's ternary stands behind it

        assert left(by_macro) == left(by_hand)
        some.update(text for line in left(by_macro) for text in line)
    assert some == {"", NO_PAIR, "never true", "never false", "never evaluated"}


@pytest.mark.parametrize("decision", ["a && !(b > 0 && c)", "a && (b && c) == 1", "!(a || b) || !(b || c)",
                                      "BOTH(a && b, c)", "SET(a) || !BOTH(b, c)", "a && LARGER(b && c, 0)"])
def test_a_decision_of_which_clang_counts_no_pairs_has_not_decided(tmp_path, decision):
    built = build(tmp_path, {"flight/run.c": MACROS + f"""
int run(int a, int b)
{{
    int n = 0, c = b >> 4; b &= 15;
    if ({decision})
        n++;
    if (a && (b || c))
        n++;
    return n;
}}
"""})
    file = missing(built, [number for a in (0, 1) for b in (0, 1, 16, 17) for number in (a, b)])[0]["flight/run.c"]
    assert not any(condition.missing for condition in file.conditions if condition.line == 13)
    assert not decisions.closed({"flight/run.c": file})
    assert "clang counts no pairs here" in {condition.missing.partition(":")[0] for condition in file.open}


def test_the_facts_are_those_of_the_files(built):
    files, of = missing(built, (3, 1))
    facts = decisions.facts(files)
    assert list(facts) == sorted(of)
    for name, fact in facts.items():
        undecided = {(each["line"], each["text"]) for each in fact["undecided"]}
        assert undecided == {place for place, text in of[name].items() if text}
        assert fact["decided"] == fact["conditions"] - len(fact["undecided"])


def test_the_table_has_the_sums_of_folders_and_a_reason_closes_a_condition_as_a_decision_does():
    def file(*conditions):
        return decisions.File([decisions.Condition(1, 1, "x", *condition) for condition in conditions])

    shown, reasoned, left, stale = (), ("never true", "a guard"), ("never true",), ("", "a guard")
    files = {"flight/math/a.c": file(shown, reasoned), "flight/math/deep/b.c": file(shown),
             "ccsds/store/c.c": file(shown)}
    assert decisions.closed(files)
    assert decisions.table(files)[2:] == ["| `ccsds` | 1 | 1 | 0 | 0 |", "| `flight/math` | 3 | 2 | 1 | 0 |",
                                          "| all | 4 | 3 | 1 | 0 |"]
    for condition in (left, stale):
        assert not decisions.closed(files | {"flight/own.c": file(shown, condition)})
    files["flight/own.c"] = file(left)
    assert decisions.closed(files, ["flight/math", "ccsds/"]) and not decisions.closed(files, ["ccsds", "flight"])
    with pytest.raises(Failure, match="no condition is in flight/ma; take one of --table"):
        decisions.closed(files, ["ccsds", "flight/ma"])
    assert "| `flight` | 1 | 0 | 0 | 1 |" in decisions.table({"flight/own.c": file(left)})


def test_without_llvm_the_failure_says_what_to_install(monkeypatch):
    monkeypatch.setattr(decisions.shutil, "which", lambda name: None)
    with pytest.raises(Failure, match="there is no llvm-cov-19: apt-get install llvm-19 clang-19 libclang-rt-19-dev"):
        decisions.tool("llvm-cov")
