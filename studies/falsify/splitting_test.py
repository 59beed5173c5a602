# SPDX-License-Identifier: Apache-2.0
"""Probabilities that are known in closed form."""

import math

import numpy as np
import pytest
from scipy.stats import chi2, norm

from fledge.errors import RunError
from fledge.falsify.space import Space
from fledge.falsify.space_test import marginal
from fledge.falsify.splitting import probability
from tests.circles import long_after


def normals(n):
    return Space({f"x{i}": marginal("normal", 0, 1) for i in range(n)})


def linear(n, p):
    """A limit state: the sum of normal numbers beyond a limit."""
    limit = -norm.ppf(p)
    return normals(n), lambda x, _: limit - x.sum(axis=1) / math.sqrt(n)


@pytest.mark.parametrize("n, p", long_after(1, [(2, 1e-4), (2, 1e-8), (10, 1e-6)], "many draws"))
def test_a_linear_limit_state(n, p):
    space, margin = linear(n, p)
    found = [probability(margin, space, 1000, 8, seed) for seed in range(6)]
    assert sum(estimate.low <= p <= estimate.high for estimate in found) >= 5      # of intervals of 95 %
    assert np.mean([estimate.value for estimate in found]) == pytest.approx(p, rel=0.2)
    if p == 1e-6:
        parts = [x for estimate in found for x in estimate.parts]     # against counting with the same relative error
        assert (np.mean(parts) / np.std(parts))**2 / p / (found[0].runs / 8) > 1000


def test_counting_agrees_where_it_can():
    space = normals(2)
    found = probability(lambda x, _: 2 - np.abs(x).max(axis=1), space, 2000, 8, 3)      # four regions
    assert found.low <= 1 - (1 - 2 * norm.sf(2))**2 <= found.high and found.high < 1.3 * found.low


@pytest.mark.parametrize("margin, p", [
    (lambda x, _: 5.5**2 - (x**2).sum(axis=1), chi2.sf(5.5**2, 3)),                      # outside a ball, around it
    (lambda x, _: np.minimum(4.2 - x[:, 0], 4.2 + x[:, 0]), 2 * norm.sf(4.2)),          # on two sides
    (lambda x, _: np.floor(4 * (4 - x[:, 1])), norm.sf(4)),                             # in steps
], ids=["ball", "two sides", "steps"])
def test_other_limit_states(margin, p):
    found = probability(margin, normals(3), 1000, 8, 1)
    assert found.low <= p <= found.high and found.high < 5 * found.low


def test_uniform_numbers_and_choices():
    space = Space({"u": marginal("uniform", 0, 10), "v": marginal("uniform", 0, 10),
                   "k": marginal("choice", choices=(0, 1, 2, 3))})

    def margin(x, _):
        return np.hypot(x[:, 0], x[:, 1]) - np.where(x[:, 2] == 3, 0.1, 0.0)

    p = math.pi / 4 * 0.1**2 / 100 / 4
    found = probability(margin, space, 1000, 8, 2)
    assert found.low <= p <= found.high and found.high < 10 * found.low


def test_the_repetition_is_reported():
    seen = set()
    probability(lambda x, k: (seen.add(k), 3 - x[:, 0])[1], normals(1), 100, 3)
    assert seen == {0, 1, 2}


def test_what_never_fails_has_an_upper_bound():
    found = probability(lambda x, _: 1 + np.exp(-x[:, 0]), normals(1), 200, 4)
    assert found.value == 0 and 0 < found.high < 1e-10 and "no run of" in str(found)


def test_margins_without_a_slope_are_refused():
    with pytest.raises(RunError, match="the margins of all draws are the same"):
        probability(lambda x, _: np.full(len(x), np.inf), normals(2), 100)
