# SPDX-License-Identifier: Apache-2.0
"""The trained controller as numbers, on turns that its training has not seen; and its training."""
import math

import numpy as np
import pytest

import fledge
from fledge import flight as fsw
from fledge.commands.tables import read_table, table
from fledge.flight_math import fm_exp
from fledge.mission import neural
from fledge.mission.learning import VectorEnv
from fledge.montecarlo import Campaign
from fledge.units import minute, s
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


@pytest.mark.parametrize("activation", ["TANH", "RELU"])
def test_the_network_outside_flies_the_bits_of_the_module(activation):
    """An agent trains on what flies: the same network in Python, by an environment, and as the module in C."""
    sim = fledge.load("learned_pointing")
    control = sim.flight.control
    control.activation = activation
    layers, units = neural.layers(control), [[control.sigma_unit] * 3 + [control.omega_unit] * 3]

    def tanh(x):    # as the module computes it
        e = fm_exp(-2.0 * abs(x))
        return math.copysign((1.0 - e) / (1.0 + e), x)

    def exact(sums):
        return np.vectorize(tanh)(sums) if activation == "TANH" else np.maximum(sums, 0.0)

    def torques(seen, activated):
        values = seen / units
        for k, (W, b) in enumerate(layers):
            sums = np.tile(b, (len(seen), 1))
            for j in range(W.shape[1]):
                sums = sums + W[:, j] * values[:, j, None]
            values = activated(sums) if k == 0 else sums
        return control.torque_max * np.clip(values, -1.0, 1.0)

    error, rate, torque = (f"flight.{path}" for path in ("tracking.error.sigma_BR", "tracking.error.omega_BR_B",
                                                         "control.torque.torque_B"))
    env = VectorEnv(sim, 2, [torque], [error, rate, torque], every=0.5 * s, reward=lambda b, a, after: np.zeros(2))
    inside, most = fledge.load("learned_pointing"), 0.0
    inside.flight.control.activation = activation
    log = inside.record(inside.flight.tracking.error, inside.flight.control.torque, every=0.5 * s)
    inside.run(2 * minute)
    seen, _ = env.reset()
    for k in range(240):
        np.testing.assert_array_equal(seen[0], [*log["error.sigma_BR"][k], *log["error.omega_BR_B"][k],
                                                *log["torque.torque_B"][k]])
        action = torques(seen[:, :6], exact)
        np.testing.assert_array_equal(action[0], log["torque.torque_B"][k])
        # numpy's own functions, on what the same law sees: within roundings of the module's.
        most = max(most, np.abs(torques(seen[:, :6], np.tanh if activation == "TANH" else exact) - action).max())
        seen = env.step(action)[0]
    assert most < 1e-15


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
