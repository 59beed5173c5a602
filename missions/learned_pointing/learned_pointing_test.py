# SPDX-License-Identifier: Apache-2.0
"""The trained controller as numbers, on turns that its training has not seen; and its training."""
import numpy as np
import pytest

import fledge
from fledge import flight as fsw
from fledge.commands.tables import read_table, table
from fledge.mission import neural
from fledge.montecarlo import Campaign
from missions.learned_pointing import train
from missions.learned_pointing.weights import WEIGHTS


def test_the_scenario_passes():
    sim = fledge.load("learned_pointing")
    sim.plots = False
    sim.scenarios["turn"]()


@pytest.mark.parametrize("name", ["turns", "bodies"])
def test_it_meets_its_requirements_from_anywhere(name):
    result = Campaign("learned_pointing", name).fly(200, seed=77)
    assert result.passed.all()
    result.close()


def test_without_an_error_there_is_no_torque_and_a_turn_back_is_its_mirror():
    layers = neural.layers(fledge.load("learned_pointing").flight.control)
    assert [W.shape for W, _ in layers] == [(16, 6), (3, 16)] and not any(b.any() for _, b in layers)


def test_a_file_of_a_table_holds_the_network():
    f = fledge.load("learned_pointing").flight
    values = {name: getattr(f.control, name) for name in ("sigma_unit", "omega_unit", "torque_max", "hold", "weights")}
    file = table(f.commands.dictionary, "flight.control", **values, hidden=1, neurons=[16, 0],
                 activation=fsw.NeuralActivation.TANH)
    module, read = read_table(f.commands.dictionary, file)
    assert module == "flight.control" and list(read["weights"][:163]) == WEIGHTS and read["hidden"] == 1


def test_training_gains_and_gives_the_same_numbers_again():
    gained = []
    first = train.trained(30, report=lambda _, mean: gained.append(mean))
    assert np.mean(gained[-5:]) > np.mean(gained[:5]) + 5
    assert not first[96:112].any() and not first[-3:].any()
    np.testing.assert_array_equal(train.trained(2), train.trained(2))


@pytest.mark.long("trains for half a minute")
def test_the_weights_are_those_of_the_training():
    assert train.text(train.trained()) == (train.HERE / "weights.py").read_text()
    assert len(WEIGHTS) == 163
