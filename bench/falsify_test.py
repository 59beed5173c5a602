# SPDX-License-Identifier: Apache-2.0
"""A planted bug that the scenarios of sun_safe pass, and what both searches need to find it."""
import pytest

from fledge.verify.decisions import has_clang

from bench import falsify
from bench.mutants import ROOT, mutants_of
from bench.mutation import Change
from bench.relinked import extension


@pytest.fixture(scope="module")
def program():
    if not has_clang():
        pytest.skip("there is no clang-19 or clang-18, which counts branches")
    return extension("branches")


def mutant(file, before, after):
    """The change of a line that reads so before and after."""
    return next(mutant for mutant in mutants_of(ROOT, [file], ["flight"]) if before in mutant.lines()[0]
                and mutant.lines()[0].replace(before, after) == mutant.lines()[1])


@pytest.mark.long("a search of 15 s")
def test_a_bug_that_the_scenarios_pass_is_found(program):
    bug = mutant("flight/sensing/sun_line.c", "vec_norm2(u) - along * along;", "vec_norm2(u) - along / along;")
    *rows, seen = falsify.study(program, [bug], 1, 2, 200)
    assert len(rows) == 1 and rows[0]["requirement"] == "SUN-3" and not any(seen.values())
    assert all(min(filter(None, pair)) <= 200 for pair in rows[0]["needed"]) and rows[0]["ratio"] > 0
    assert any("along / along" in line for line in falsify.lines_of(rows[0]))


@pytest.mark.long("a search")
def test_changes_that_are_no_planted_bugs_are_counted(program):
    file = "flight/guidance/sun_safe.c"
    noticed = mutant(file, "*out = error;", ";")
    refused = mutant(file, "return vec_scale(fm_tan(0.25 * angle), e);", "return 0;")
    same = noticed._replace(change=Change(0, 0, ""))
    assert falsify.study(program, [noticed, refused, same], 1, 1, 100) == [
        {"not compiled": 1, "equivalent": 1, "scenarios fail": 1, "not found": 0,
         "alike": 0}]


@pytest.mark.long("searches")
def test_without_a_change_nothing_is_found(tmp_path):
    """The search of seed 2 comes to a run that violates SUN-1, which counts as none."""
    assert falsify.ask(tmp_path, easy=5, screening=100) == [True, None]
    assert falsify.ask(tmp_path, requirement="SUN-1", seeds=[2], runs=240) == [[None, None]]


def test_what_a_search_needed_counts_all_runs_where_it_found_nothing():
    assert falsify.needed([[3, 7], [None, 9], [5, None]], 100) == (5, 9)
