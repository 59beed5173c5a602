# SPDX-License-Identifier: Apache-2.0
"""A planted bug that the scenarios of sun_safe pass, and what both searches need to find it."""
import math

import numpy as np
import pytest

from bench import falsify
from bench.mutants import ROOT, mutants_of
from bench.mutation import Change
from bench.relinked import extension
from tests.needs import section, skip_without


@pytest.fixture(scope="module")
def program():
    skip_without(*section("decisions"))
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
    assert all(min(filter(None, pair)) <= 200 for pair in rows[0]["needed"])
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


def test_the_median_of_draws_follows_from_their_rate():
    """Of a geometric distribution, whatever part of it is cut off."""
    random = np.random.default_rng(0)
    drawn = random.geometric(0.002, 4000)
    for runs in (100, 300, 10_000):
        found = [[3, int(x) if x <= runs else None] for x in drawn]
        search, draws, more = falsify.needed(found, runs)
        assert draws == pytest.approx(np.median(drawn), rel=0.15) and search == 3 and not more


def test_a_search_that_finds_nothing_counts_with_all_its_runs():
    search, draws, more = falsify.needed([[3, None], [None, None], [5, None]], 100)
    assert search == 5 and draws == pytest.approx(math.log(2) * 100) and more


def test_the_rarer_half_is_that_of_the_draws():
    rows = [{"file": "flight/a.c", "line": n, "requirement": "R-1", "needed": [[10, draws]] * 3}
            for n, draws in ((1, 1000), (2, 10), (3, 20), (4, 800))]
    *lines, last = falsify.table(rows, 2000)
    assert [line.split()[0] for line in lines] == ["mutant", "a.c:2", "a.c:3", "a.c:4", "a.c:1"]
    assert last == f"median ratio {math.log(2) * 41:.3g}, of the rarer half {math.log(2) * 90:.3g}"
