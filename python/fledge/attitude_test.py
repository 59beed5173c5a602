# SPDX-License-Identifier: Apache-2.0
"""Attitude conversions, against the definition of a rotation and against each other."""

import itertools

import numpy as np
import pytest

from fledge import attitude as att
from tests.needs import module

RNG = np.random.default_rng(7)
N = 2000
AXIS = RNG.normal(size=(N, 3))
AXIS /= np.linalg.norm(AXIS, axis=1, keepdims=True)
ANGLE = np.concatenate([RNG.uniform(0, np.pi, N - 4), [0.0, 1e-9, np.pi - 1e-9, np.pi]])[:, None]


def rodrigues(axis, angle):
    """The matrix of a frame turned about an axis, from Rodrigues' formula: an independent oracle."""
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return c * np.eye(3) + (1 - c) * axis[:, :, None] * axis[:, None, :] - s * att.tilde(axis)


DCM = rodrigues(AXIS, ANGLE)
SETS = {
    "dcm": DCM,
    "mrp": np.tan(ANGLE / 4) * AXIS,
    "quaternion": np.concatenate([np.cos(ANGLE / 2), np.sin(ANGLE / 2) * AXIS], axis=1),
    "prv": ANGLE * AXIS,
}


@pytest.mark.parametrize("a, b", itertools.permutations([*SETS, "euler"], 2))
def test_every_conversion_gives_the_same_matrix(a, b):
    values = att.dcm_to_euler(DCM) if a == "euler" else SETS[a]
    out = getattr(att, f"{a}_to_{b}")(values)
    matrix = out if b == "dcm" else getattr(att, f"{b}_to_dcm")(out)
    np.testing.assert_allclose(matrix, DCM, atol=2e-8 if "prv" in (a, b) else 1e-12)


def test_a_known_attitude():
    # N turned by +90 degrees about n3: b1 = n2.
    quarter = np.array([0, 0, np.pi / 2])
    np.testing.assert_allclose(att.prv_to_dcm(quarter), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(att.prv_to_mrp(quarter), [0, 0, np.tan(np.pi / 8)])
    np.testing.assert_allclose(att.prv_to_quaternion(quarter), [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    np.testing.assert_allclose(att.prv_to_euler(quarter), [np.pi / 2, 0, 0], atol=1e-15)


@pytest.mark.parametrize("sequence", att.SEQUENCES)
def test_euler_sequences(sequence):
    angles = RNG.uniform(-np.pi, np.pi, (N, 3))
    angles[:, 1] = RNG.uniform(0.01, np.pi - 0.01, N)
    if sequence[0] != sequence[2]:
        angles[:, 1] -= np.pi / 2
    np.testing.assert_allclose(att.dcm_to_euler(att.euler_to_dcm(angles, sequence), sequence), angles,
                               atol=1e-11)
    # At the singularity the angles differ, the attitude does not.
    locked = angles.copy()
    locked[:, 1] = np.repeat([0, np.pi] if sequence[0] == sequence[2] else [-np.pi / 2, np.pi / 2], N // 2)
    matrix = att.euler_to_dcm(locked, sequence)
    back = att.dcm_to_euler(matrix, sequence)
    assert np.all(back[:, 2] == 0)
    np.testing.assert_allclose(att.euler_to_dcm(back, sequence), matrix, atol=1e-11)


def test_ranges():
    sigma = att.dcm_to_mrp(DCM)
    assert np.all(np.linalg.norm(sigma, axis=1) <= 1 + 1e-15)
    assert np.all(att.dcm_to_quaternion(DCM)[:, 0] >= 0)
    np.testing.assert_allclose(att.angle(sigma), ANGLE[:, 0], atol=4e-8)


def test_compose_and_relative():
    first, second = SETS["mrp"], SETS["mrp"][::-1]
    both = att.mrp_to_dcm(second) @ att.mrp_to_dcm(first)
    np.testing.assert_allclose(att.mrp_to_dcm(att.compose(second, first)), both, atol=1e-12)
    quaternions = att.mrp_to_quaternion(second), att.mrp_to_quaternion(first)
    np.testing.assert_allclose(att.quaternion_to_dcm(att.quaternion_product(*quaternions)), both, atol=1e-12)
    error = att.mrp_to_dcm(second) @ np.swapaxes(att.mrp_to_dcm(first), -1, -2)
    np.testing.assert_allclose(att.mrp_to_dcm(att.relative(second, first)), error, atol=1e-12)


def test_shadow_and_switch():
    sigma = RNG.normal(size=(50, 3)) * 2
    np.testing.assert_allclose(att.mrp_to_dcm(att.shadow(sigma)), att.mrp_to_dcm(sigma), atol=1e-13)
    assert np.all(np.linalg.norm(att.switch(sigma), axis=1) <= 1)
    assert list(att.switch([0, 0, 1])) == [0, 0, 1]


def test_scipy_has_the_same_attitudes():
    scipy = module("scipy.spatial.transform").Rotation
    turn = scipy.from_rotvec(ANGLE * AXIS)
    beta = att.from_scalar_last(turn.as_quat())
    np.testing.assert_allclose(np.swapaxes(att.quaternion_to_dcm(beta), -1, -2), turn.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(att.angle(att.relative(att.quaternion_to_mrp(beta), turn.as_mrp())), 0, atol=1e-7)
    np.testing.assert_array_equal(att.to_scalar_last(beta), turn.as_quat())
    body = np.array([1, -2, 3])
    np.testing.assert_allclose(scipy.from_quat(att.to_scalar_last(att.dcm_to_quaternion(DCM))).apply(body),
                               np.swapaxes(DCM, -1, -2) @ body, atol=1e-13)


def test_leading_dimensions():
    sigma = SETS["mrp"][:24].reshape(2, 3, 4, 3)
    assert att.mrp_to_dcm(sigma).shape == (2, 3, 4, 3, 3)
    assert att.mrp_to_euler(sigma, "313").shape == (2, 3, 4, 3)
    np.testing.assert_array_equal(att.mrp_to_dcm(sigma)[1, 2, 3], att.mrp_to_dcm(sigma[1, 2, 3]))


def test_errors():
    with pytest.raises(ValueError, match="unknown Euler sequence '311'; the sequences are 121, 123"):
        att.euler_to_dcm([0, 0, 0], "311")
    with pytest.raises(ValueError, match=r"needs trailing dimensions \(4,\), found shape \(3,\)"):
        att.quaternion_to_dcm([0, 0, 0])


def test_the_rate_of_a_quaternion_is_that_of_a_turn_about_an_axis():
    angle, rate, axis = np.linspace(-3, 3, 13)[:, None], 0.3, np.array([2, -1, 2]) / 3
    turned = np.hstack([np.cos(angle / 2), np.sin(angle / 2) * axis])
    expected = rate / 2 * np.hstack([-np.sin(angle / 2), np.cos(angle / 2) * axis])
    np.testing.assert_allclose(att.quaternion_rate(turned, np.tile(rate * axis, (13, 1))), expected, atol=1e-15)
