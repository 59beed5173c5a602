# SPDX-License-Identifier: Apache-2.0
"""Points of the cube are draws: their distributions are those of scipy, and those that the kernel draws."""

import numpy as np
import pytest
from scipy import stats

from fledge.errors import SetupError
from fledge.falsify.space import Axis, Space
from fledge.montecarlo import Campaign
from fledge.montecarlo.dispersions import Marginal
from fledge.units import deg, km, minute, s

INFINITY = float("inf")


def marginal(kind, a=0.0, b=0.0, low=-INFINITY, high=INFINITY, scale="", choices=(), nominal=0.0, whole=False):
    return Marginal(kind, a, b, low, high, scale, tuple(choices), nominal, whole, "x")


def column(values, u):
    return values(np.array(u, float)[:, None])[:, 0]


CONTINUOUS = [
    (marginal("uniform", -2, 3), stats.uniform(-2, 5)),
    (marginal("normal", 1, 2), stats.norm(1, 2)),
    (marginal("normal", 1, 2, 0.5, 9), stats.truncnorm(-0.25, 4, 1, 2)),
    (marginal("normal", 0, 1, 6, INFINITY), stats.truncnorm(6, INFINITY)),      # the tail alone
    (marginal("normal", 0, 1, -INFINITY, -6), stats.truncnorm(-INFINITY, -6)),
]


@pytest.mark.parametrize("given, oracle", CONTINUOUS)
def test_a_coordinate_gives_the_quantile(given, oracle):
    u = np.array([1e-9, 1e-3, 0.2, 0.5, 0.9, 0.999])
    assert column(Axis(["x"], given).values, u) == pytest.approx(oracle.ppf(u), rel=1e-6)


@pytest.mark.parametrize("given, oracle", CONTINUOUS)
def test_the_box_has_the_same_numbers_at_equal_distances(given, oracle):
    axis, c = Axis(["x"], given), np.linspace(0, 1, 9)
    x = column(axis.values, column(axis.from_box, c))
    assert np.diff(x) == pytest.approx(np.full(8, (x[-1] - x[0]) / 8), rel=1e-4)
    assert column(axis.to_box, column(axis.from_box, c)) == pytest.approx(c, abs=1e-6)
    assert oracle.cdf(x[0] - 1e-9) < 1e-4 and oracle.sf(x[-1] + 1e-9) < 1e-4


def test_choices_and_whole_numbers_have_equal_shares():
    u = (np.arange(1200) + 0.5) / 1200
    for given, expected in [(marginal("choice", choices=(1, 2, 8)), {1: 400, 2: 400, 8: 400}),
                            (marginal("uniform", 0.5, 4.5, whole=True), {1: 300, 2: 300, 3: 300, 4: 300}),
                            (marginal("choice", choices=(2, 3), scale="about", nominal=10), {12: 600, 13: 600}),
                            (marginal("choice", choices=(2, 3), scale="relative", nominal=10), {20: 600, 30: 600})]:
        found, counts = np.unique(column(Axis(["x"], given).values, u), return_counts=True)
        assert dict(zip(found, counts)) == expected and Axis(["x"], given).choices == len(expected)
    assert column(Axis(["x"], marginal("choice", choices=(1, 2))).values, [0, 1]).tolist() == [1, 2]


def test_whole_numbers_of_a_normal_distribution_are_rounded_then_cut():
    axis = Axis(["x"], marginal("normal", 3, 1, 2, 4.4, whole=True))
    found, counts = np.unique(column(axis.values, (np.arange(9000) + 0.5) / 9000), return_counts=True)
    inside = np.diff(stats.norm(3, 1).cdf([1.5, 2.5, 3.5, 4.5]))
    assert found.tolist() == [2, 3, 4] and counts / 9000 == pytest.approx(inside / inside.sum(), abs=1e-3)


def test_the_draws_of_the_kernel_have_the_same_distribution():
    def drawn(d):
        d.duration = 1 * s
        d["world.craft.sigma_BN"] = d.attitude()
        d["world.craft.omega_BN_B"] = d.nominal + d.normal(0, 1 * deg / s, low=-1 * deg / s)
        d["world.wheels.J"] = d.nominal * d.uniform(0.9, 1.2)
        d.orbit("world.craft", altitude=d.nominal + d.normal(0, 2 * km))
        d.fault("world.gyro", kind=d.choice("NONE", "BIAS"), begin=d.uniform(0 * s, 1 * minute))

    campaign = Campaign("sun_safe", drawn)
    space = Space(campaign.dispersions.marginals)
    nominal = campaign.drawn(campaign.nominal)
    assert set(space.columns) == set(campaign.dispersions.columns)
    assert space.nominal == pytest.approx([nominal[path] for path in space.columns], rel=1e-9)
    ours = space.values(np.random.default_rng(1).random((600, space.n)))
    theirs = campaign.fly(600, seed=1).draws
    for path, column in zip(space.columns, ours.T):
        assert stats.ks_2samp(column, theirs[path]).pvalue > 1e-4, path
    products = [(ours[:, i] * ours[:, k], theirs[space.columns[i]] * theirs[space.columns[k]])
                for i in range(3) for k in range(i)]    # an attitude is more than its three distributions
    assert all(stats.ks_2samp(*pair).pvalue > 1e-4 for pair in products)


def test_a_space_without_a_dispersion_is_refused():
    with pytest.raises(SetupError, match="nothing to search: nothing is dispersed"):
        Space({})
    with pytest.raises(SetupError, match="each of a, b has one value alone"):
        Space({"a": marginal("choice", choices=(2,)), "b": marginal("normal", 3, 0)})
