# SPDX-License-Identifier: Apache-2.0
"""Layers into the module and back, by memory and by file; and what does not fit."""
import numpy as np
import pytest

from fledge import SetupError
from fledge import flight as fsw
from fledge.mission import neural


def network(*sizes, seed=1):
    random = np.random.default_rng(seed)
    return [(random.normal(size=(n, m)), random.normal(size=n)) for m, n in zip((6, *sizes), (*sizes, 3))]


def same(a, b):
    return len(a) == len(b) and all(np.array_equal(x, y) for p, q in zip(a, b) for x, y in zip(p, q))


@pytest.mark.parametrize("sizes", [(), (1,), (32,), (7, 5), (32, 32)])
def test_layers_come_back_from_module_and_file(sizes, tmp_path):
    given = network(*sizes)
    module = fsw.NeuralFeedback(sigma_unit=1, omega_unit=1, torque_max=1)
    neural.give(module, network(9, 9))
    neural.give(module, given, activation="RELU")
    assert same(neural.layers(module), given) and module.hidden == len(sizes) and module.activation.name == "RELU"
    neural.give(module, given)
    assert same(neural.layers(module), given) and module.activation.name == "RELU"      # as it was
    neural.write(tmp_path / "w.csv", given)
    assert same(neural.read(tmp_path / "w.csv"), given)


@pytest.mark.parametrize("sizes", [(), (4,), (7, 5)])
@pytest.mark.parametrize("activation", ["TANH", "RELU"])
def test_nothing_else_of_the_module_is_overwritten(sizes, activation):
    own = dict(sigma_unit=0.3, omega_unit=0.02, torque_max=0.08, hold=7.5)
    module = fsw.NeuralFeedback(activation=activation, **own)
    neural.give(module, network(*sizes))
    assert {name: getattr(module, name) for name in own} == own
    assert module.activation == fsw.NeuralActivation[activation]
    with pytest.raises(SetupError):
        neural.give(module, network(40))
    assert module.hidden == len(sizes) and same(neural.layers(module), network(*sizes)), "a bad one changes nothing"
    neural.give(module, network(*sizes), "TANH")
    assert module.activation == fsw.NeuralActivation.TANH and {name: getattr(module, name) for name in own} == own


@pytest.mark.parametrize("given, message", [
    ([], "expected 1 to 3 layers, found 0"),
    (network(4, 4, 4), "expected 1 to 3 layers, found 4"),
    ([(np.ones((8, 5)), np.ones(8)), (np.ones((3, 8)), np.ones(3))],
     r"W0: expected the shape \(1 to 32, 6\), found \(8, 5\)"),
    ([(np.ones((33, 6)), np.ones(33)), (np.ones((3, 33)), np.ones(3))],
     r"W0: expected the shape \(1 to 32, 6\), found \(33, 6\)"),
    ([(np.ones((8, 6)), np.ones(8)), (np.ones((3, 7)), np.ones(3))],
     r"W1: expected the shape \(3, 8\), found \(3, 7\)"),
    ([(np.ones((8, 6)), np.ones(7)), (np.ones((3, 8)), np.ones(3))], r"b0: expected the shape \(8,\), found \(7,\)"),
    ([(np.ones((3, 6)), np.full(3, np.nan))], "layer 0 has a number that is not finite"),
])
def test_a_wrong_shape_says_which_layer(given, message):
    with pytest.raises(SetupError, match=message):
        neural.give(fsw.NeuralFeedback(), given)


@pytest.mark.parametrize("change, message", [
    (lambda rows: rows[:-1], r"b0\[2\] is missing|b0: expected the shape \(3,\), found \(2,\)"),
    (lambda rows: rows[:3] + rows[4:], r"W0\[0, 1\] is missing, or no number"),
    (lambda rows: [*rows, rows[-1]], r"line 24: b0\[2\] is there twice"),
    (lambda rows: [*rows, "W0[1],2\n"], r'line 24: expected a row as "W0\[2, 5\]",0.25; found W0\[1\],2'),
    (lambda rows: [*rows, "b0[1]\n"], "line 24: expected a row"),
    (lambda rows: [*rows, "b1[0],1\n"], "expected W0, b0; found W0, b0, b1"),
    (lambda rows: [], "expected W0, b0; found no numbers"),
])
def test_a_file_that_is_not_whole_says_where(change, message, tmp_path):
    neural.write(tmp_path / "w.csv", network())
    rows = (tmp_path / "w.csv").read_text().splitlines(keepends=True)
    (tmp_path / "w.csv").write_text("".join(change(rows)))
    with pytest.raises(SetupError, match=message):
        neural.read(tmp_path / "w.csv")


def test_a_wrong_count_of_numbers_is_refused():
    with pytest.raises(SetupError, match=r"expected 163 numbers for layers of \[16, 3\] neurons, found \(162,\)"):
        neural.unflat(np.zeros(162), [16])
