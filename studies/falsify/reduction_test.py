# SPDX-License-Identifier: Apache-2.0
"""A reduced counterexample keeps the changes that make it fail."""

import numpy as np

from fledge.falsify.reduction import smallest
from fledge.montecarlo.dispersions import Marginal

PARTS = {"world.a.faults[0]": "world.a.faults[0].kind", "world.b.faults[2]": "world.b.faults[2].kind",
         "flight.commands[0]": "flight.commands[0].which"}


def marginal(declared, kind="uniform", nominal=0.0):
    return Marginal(kind, 0.0, 1.0, 0.0, 1.0, "", (), nominal, False, declared)


MARGINALS = {
    "world.a.faults[0].begin": marginal("world.a.faults[0].begin"),
    "world.b.faults[2].kind": marginal("world.b.faults[2].kind", "choice"),
    "world.b.faults[2].size": marginal("world.b.faults[2].size"),
    **{f"w[{i}]": marginal("w", nominal=1.0) for i in range(3)},
    **{f"sigma[{i}]": marginal("sigma", "attitude", 0.3) for i in range(3)},
    "J": marginal("J", nominal=5.0),
    "flight.commands[0].which": marginal("flight.commands[0].which", "choice"),
    "flight.commands[0].at": marginal("flight.commands[0].at"),
}
START = {"world.a.faults[0].begin": 7.0, "world.b.faults[2].kind": 3.0, "world.b.faults[2].size": 0.5,
         "w[0]": 2.0, "w[1]": 1.0, "w[2]": 4.0, "sigma[0]": 0.1, "sigma[1]": 0.2, "sigma[2]": 0.4, "J": 6.0,
         "flight.commands[0].which": 2.0, "flight.commands[0].at": 9.0,
         "world.a.faults[0].kind": 2.0}     # the kind of the first is no draw


def reduced(margin):
    batches = []

    def fly(values):
        runs = [dict(zip(values, numbers)) for numbers in zip(*values.values())]
        batches.append(len(runs))
        return np.array([margin(run) for run in runs])

    return smallest(fly, MARGINALS, PARTS, START, margin(START)), batches


def test_only_what_is_needed_stays():
    found, _ = reduced(lambda x: 1.0 if x["world.b.faults[2].kind"] != 3 or x["w[2]"] < 3 else -0.1 * x["J"])
    assert found.kept == ["world.b.faults[2]", "w[2]"] and found.margin == -0.5
    assert set(found.removed) == {"world.a.faults[0]", "flight.commands[0]", "J", "sigma"}
    assert found.values["w[0]"] == 1.0 and found.values["w[2]"] == 4.0 and found.values["sigma[1]"] == 0.3
    assert found.values["world.a.faults[0].kind"] == 0 and found.values["world.b.faults[2].size"] == 0.5


def test_nothing_that_is_left_can_go_by_itself():
    def margin(x):      # any two of three make it fail
        return 1.5 - (x["w[0]"] != 1) - (x["J"] != 5) - (x["sigma[0]"] != 0.3)

    found, _ = reduced(margin)
    assert len(found.kept) == 2 and found.margin == -0.5


def test_a_nominal_run_that_fails_keeps_nothing():
    found, batches = reduced(lambda x: -1.0)
    assert found.kept == [] and sum(batches) < 30


def test_runs_without_a_margin_do_not_count_as_failing():
    found, _ = reduced(lambda x: np.nan if x["J"] == 5 else -1.0)
    assert found.kept == ["J"]
