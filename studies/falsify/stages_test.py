# SPDX-License-Identifier: Apache-2.0
"""The search on functions whose least value is known."""

import numpy as np
import pytest

from fledge.falsify.space import Space
from fledge.falsify.space_test import marginal
from fledge.falsify.stages import random_search, search


def cube(n, **others):
    return Space({**{f"x{i}": marginal("uniform", 0, 1, nominal=0.9) for i in range(n)}, **others})


def ball(n, radius):
    return cube(n), lambda x: np.linalg.norm(x - 0.31, axis=1) - radius


def of_choices():
    """One of 16 pairs of choices leads down to a ball."""
    space = cube(4, kind=marginal("choice", choices=(0, 1, 2, 3), whole=True),
                 channel=marginal("choice", choices=(1, 2, 4, 8), whole=True))

    def margin(x):
        off = np.linalg.norm(x[:, :4] - 0.7, axis=1)
        return np.where((x[:, 4] == 2) & (x[:, 5] == 8), off - 0.1, 0.5 + 0.2 * off)

    return space, margin


def in_tails(n):
    """Fails 4 standard deviations from the mean, in one direction of all."""
    return (Space({f"x{i}": marginal("normal", 0, 1) for i in range(n)}),
            lambda x: 4 - x.sum(axis=1) / np.sqrt(n))


def waves():
    """Many local minima."""
    return (Space({f"x{i}": marginal("uniform", -5, 5, nominal=3.3) for i in range(4)}),
            lambda x: (x**2 - 4 * np.cos(2 * np.pi * x) + 4).sum(axis=1) - 3)


@pytest.mark.parametrize("problem, least", [(ball(4, 0.1), -0.1), (ball(8, 0.2), -0.2), (of_choices(), -0.1)],
                         ids=["ball", "ball of 8", "choices"])
def test_it_finds_the_least_margin(problem, least):
    space, margin = problem
    for seed in range(3):
        tried = search(margin, space, 1000, seed)
        assert len(tried.margins) <= 1000 and sum(tried.stages.values()) == len(tried.margins)
        assert tried.margins == pytest.approx(margin(tried.values))
        assert tried.margins[tried.best] == pytest.approx(least, abs=0.02)


def test_it_finds_one_of_many_minima_that_fails():
    space, margin = waves()
    least = [search(margin, space, 1000, seed).margins.min() for seed in range(5)]
    assert max(least) < -0.9 and min(least) == pytest.approx(-3, abs=0.02)


@pytest.mark.parametrize("problem", [ball(8, 0.2), of_choices(), in_tails(10)], ids=["ball", "choices", "tails"])
def test_it_needs_fewer_runs_than_draws_alone(problem):
    space, margin = problem
    ours, theirs = (np.median([len(method(margin, space, 1500, seed, first=True).margins) for seed in range(5)])
                    for method in (search, random_search))
    assert 3 * ours < theirs


def watched(margin, sees):
    """A margin, and what its last runs saw."""
    flown = []

    def margins(x):
        flown.append(x)
        return margin(x)

    return margins, lambda: sees(flown[-1])


def doors(x):
    """Three doors, of which only runs behind the one before see the next."""
    return np.cumprod(abs(x[:, :3] - 0.4) < 0.05, axis=1).astype(np.uint8)


def test_branches_lead_it_where_margins_say_nothing():
    """A jump without a slope, behind the doors: draws alone need 1,000 runs in the mean."""
    needed = []
    for seed in range(9):
        margin, seen = watched(lambda x: 1.0 - 2 * doors(x)[:, 2], doors)
        tried = search(margin, cube(12), 1500, seed, first=True, seen=seen)
        assert tried.stages.get("breeding", 0) <= 0.35 * 1500 + 1
        needed.append(len(tried.margins))
    assert 2 * np.median(needed) < 1000, needed


def test_where_all_runs_see_the_same_nothing_is_bred():
    space, margin = ball(4, 0.1)
    margins, seen = watched(margin, lambda x: np.full((len(x), 7), 3, np.uint8))
    plain, same = search(margin, space, 300), search(margins, space, 300, seen=seen)
    assert np.array_equal(plain.values, same.values) and plain.stages == same.stages


def test_a_run_that_died_has_seen_nothing():
    widths = iter([3, *[5] * 1000])
    margin, seen = watched(lambda x: x[:, 0],
                           lambda x: np.repeat(x[:, :1] > 0.5, next(widths), axis=1).astype(np.uint8))
    tried = search(margin, cube(2), 200, seen=seen)
    assert len(tried.margins) == 200 and tried.stages["breeding"] == 70


def test_a_budget_of_few_runs_is_flown():
    space, margin = ball(3, 0.1)

    def not_empty(x):
        assert len(x)
        return margin(x)

    for runs in range(1, 25):
        margins, seen = watched(not_empty, doors)
        for tried in (search(not_empty, space, runs), search(margins, space, runs, seen=seen)):
            assert len(tried.margins) == runs == sum(tried.stages.values()) and np.isfinite(tried.values).all()


def test_the_first_violation_ends_it():
    space, margin = ball(4, 0.1)
    tried = search(margin, space, 1000, 1, first=True)
    assert tried.first is not None and len(tried.margins) <= tried.first + 60
    assert (tried.margins[:tried.first] >= 0).all()
    nominal = search(lambda x: -np.ones(len(x)), space, 1000, 1, first=True)
    assert len(nominal.margins) == 1 and nominal.values.tolist() == [[0.9] * 4]


def test_the_seed_determines_the_runs():
    space, margin = waves()
    first, same, other = (search(margin, space, 300, seed).values for seed in (5, 5, 6))
    assert np.array_equal(first, same) and not np.array_equal(first, other)


def test_margins_that_say_nothing():
    """Names alone decide (infinite), or nothing is known (NaN): the budget is flown all the same."""
    space = cube(3)
    flat = search(lambda x: np.full(len(x), np.inf), space, 200)
    assert len(flat.margins) > 150 and flat.first is None
    tried = search(lambda x: np.where(x[:, 0] < 0.5, np.nan, x[:, 1] - 0.02), space, 300)
    assert tried.margins[tried.best] == pytest.approx(-0.02, abs=1e-3) and tried.values[tried.best][0] >= 0.5
    unknown = search(lambda x: np.full(len(x), np.nan), space, 100)
    assert unknown.best is None and unknown.first is None
    jump = search(lambda x: np.where(x[:, 0] > 0.97, -np.inf, 1 - x[:, 0]), space, 300)
    assert jump.margins[jump.best] == -np.inf


def test_choices_alone_have_nothing_to_polish():
    space = Space({name: marginal("choice", choices=(0, 1, 2)) for name in "abc"})
    tried = search(lambda x: 6 - x.sum(axis=1), space, 100)
    assert tried.margins[tried.best] == 0 and tried.values[tried.best].tolist() == [2, 2, 2]


def test_ctrl_c_leaves_what_was_flown():
    space, calls = cube(2), []

    def margin(x):
        calls.append(len(x))
        if len(calls) == 4:
            raise KeyboardInterrupt
        return x[:, 0]

    tried = search(margin, space, 500)
    assert tried.interrupted and len(tried.margins) == sum(calls[:3])
