# SPDX-License-Identifier: Apache-2.0
"""Attitude representations and all conversions between them.

Conventions. An attitude of B relative to N is one of

    dcm_BN     (3, 3)  direction cosine matrix: v_B = dcm_BN @ v_N; its rows are b1, b2, b3 in N
    sigma_BN   (3,)    Modified Rodrigues Parameters, tan(angle / 4) * axis, |sigma| <= 1
    beta_BN    (4,)    quaternion, scalar first, (cos(angle / 2), sin(angle / 2) * axis), beta[0] >= 0
    prv_BN     (3,)    principal rotation vector, angle * axis [rad], angle <= pi
    euler_BN   (3,)    Euler angles [rad] of a sequence such as "321": about the third axis first,
                       then about the new second, then about the new first

where angle and axis turn N into B. Every function takes arrays with any leading dimensions and
returns new arrays. Results lie in the ranges above; inputs need not.

Composition of dcm_CN = dcm_CB @ dcm_BN is `compose(sigma_CB, sigma_BN)`, or `quaternion_product(beta_CB, beta_BN)`.
Quaternions of others are often scalar last: `from_scalar_last` and `to_scalar_last` change the order. One that turns
components of B into those of N, as scipy's `Rotation.from_quat(to_scalar_last(beta_BN)).apply(v_B)` does, is the same
quaternion in its other order, not its inverse.

Source: Schaub, Junkins, Analytical Mechanics of Space Systems, chapter 3; Shepperd (1978) for the
quaternion of a matrix.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SEQUENCES = ("121", "123", "131", "132", "212", "213", "231", "232", "312", "313", "321", "323")


def _array(x: ArrayLike, shape: tuple[int, ...], name: str) -> np.ndarray:
    x = np.asarray(x, dtype=float)
    if x.shape[-len(shape):] != shape:
        raise ValueError(f"{name} needs trailing dimensions {shape}, found shape {x.shape}")
    return x


def _vector(x: ArrayLike, name: str = "a vector") -> np.ndarray:
    return _array(x, (3,), name)


def tilde(v: ArrayLike) -> np.ndarray:
    """The matrix of the cross product: tilde(a) @ b = a x b."""
    v = _vector(v)
    out = np.zeros(v.shape + (3,))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


# --- quaternions: the other conversions use them ---------------------------------------------------

def _upper(beta: np.ndarray) -> np.ndarray:
    """The quaternion of the same attitude with scalar part >= 0."""
    return np.where(beta[..., :1] < 0.0, -beta, beta)


def to_scalar_last(beta: ArrayLike) -> np.ndarray:
    """(beta1, beta2, beta3, beta0) of a quaternion: the order of scipy, ROS and many star trackers."""
    return np.roll(_array(beta, (4,), "a quaternion"), -1, axis=-1)


def from_scalar_last(q: ArrayLike) -> np.ndarray:
    """The quaternion, scalar first, of one with its scalar last. Its sign stays."""
    return np.roll(_array(q, (4,), "a quaternion"), 1, axis=-1)


def quaternion_to_dcm(beta: ArrayLike) -> np.ndarray:
    """beta_BN -> dcm_BN. The quaternion is normalised first."""
    b = _array(beta, (4,), "a quaternion")
    b = b / np.linalg.norm(b, axis=-1, keepdims=True)
    b0, b1, b2, b3 = np.moveaxis(b, -1, 0)
    out = np.empty(b.shape[:-1] + (3, 3))
    out[..., 0, 0] = b0 * b0 + b1 * b1 - b2 * b2 - b3 * b3
    out[..., 0, 1] = 2.0 * (b1 * b2 + b0 * b3)
    out[..., 0, 2] = 2.0 * (b1 * b3 - b0 * b2)
    out[..., 1, 0] = 2.0 * (b1 * b2 - b0 * b3)
    out[..., 1, 1] = b0 * b0 - b1 * b1 + b2 * b2 - b3 * b3
    out[..., 1, 2] = 2.0 * (b2 * b3 + b0 * b1)
    out[..., 2, 0] = 2.0 * (b1 * b3 + b0 * b2)
    out[..., 2, 1] = 2.0 * (b2 * b3 - b0 * b1)
    out[..., 2, 2] = b0 * b0 - b1 * b1 - b2 * b2 + b3 * b3
    return out


def dcm_to_quaternion(dcm: ArrayLike) -> np.ndarray:
    """dcm_BN -> beta_BN. Shepperd's method: divide by the largest of the four."""
    c = _array(dcm, (3, 3), "a direction cosine matrix")
    trace = np.trace(c, axis1=-2, axis2=-1)
    diagonal = np.diagonal(c, axis1=-2, axis2=-1)
    # Row k holds 4 beta_k times the whole quaternion.
    products = np.empty(c.shape[:-2] + (4, 4))
    products[..., 0, 0] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        products[..., i + 1, i + 1] = 1.0 + 2.0 * diagonal[..., i] - trace
        products[..., 0, i + 1] = products[..., i + 1, 0] = c[..., j, k] - c[..., k, j]
        products[..., j + 1, k + 1] = products[..., k + 1, j + 1] = c[..., j, k] + c[..., k, j]
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    return _upper(row / np.linalg.norm(row, axis=-1, keepdims=True))


def quaternion_to_mrp(beta: ArrayLike) -> np.ndarray:
    """beta_BN -> sigma_BN with |sigma| <= 1."""
    beta = _array(beta, (4,), "a quaternion")
    beta = _upper(beta / np.linalg.norm(beta, axis=-1, keepdims=True))
    return beta[..., 1:] / (1.0 + beta[..., :1])


def mrp_to_quaternion(sigma: ArrayLike) -> np.ndarray:
    """sigma_BN -> beta_BN. Any norm is allowed."""
    sigma = _vector(sigma, "an MRP")
    s2 = np.sum(sigma * sigma, axis=-1, keepdims=True)
    return _upper(np.concatenate([1.0 - s2, 2.0 * sigma], axis=-1) / (1.0 + s2))


def quaternion_to_prv(beta: ArrayLike) -> np.ndarray:
    """beta_BN -> prv_BN with an angle in [0, pi]."""
    beta = _upper(_array(beta, (4,), "a quaternion"))
    n = np.linalg.norm(beta[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(n, beta[..., :1])
    # Near zero, angle / sin(angle / 2) tends to 2 over the quaternion's norm.
    small = n < 1e-150
    factor = np.where(small, 2.0, angle / np.where(small, 1.0, n))
    return factor * beta[..., 1:]


def prv_to_quaternion(prv: ArrayLike) -> np.ndarray:
    """prv_BN -> beta_BN. Any angle is allowed."""
    prv = _vector(prv, "a principal rotation vector")
    half = 0.5 * np.linalg.norm(prv, axis=-1, keepdims=True)
    return _upper(np.concatenate([np.cos(half), 0.5 * prv * np.sinc(half / np.pi)], axis=-1))


def quaternion_product(beta_CB: ArrayLike, beta_BN: ArrayLike) -> np.ndarray:
    """beta_CN of two rotations in a row: dcm_CN = dcm_CB @ dcm_BN. Linear in both, for rates too, so of either sign."""
    c, b = _array(beta_CB, (4,), "a quaternion"), _array(beta_BN, (4,), "a quaternion")
    scalar = c[..., :1] * b[..., :1] - np.sum(c[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    vector = c[..., :1] * b[..., 1:] + b[..., :1] * c[..., 1:] + np.cross(b[..., 1:], c[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def quaternion_rate(beta_BN: ArrayLike, omega_BN_B: ArrayLike) -> np.ndarray:
    """The derivative [1/s] of beta_BN when B turns relative to N at omega_BN_B [rad/s], in axes of B."""
    b, w = _array(beta_BN, (4,), "a quaternion"), _vector(omega_BN_B)
    return np.concatenate([-np.sum(w * b[..., 1:], axis=-1, keepdims=True),
                           b[..., :1] * w - np.cross(w, b[..., 1:])], axis=-1) / 2


# --- Euler angles ----------------------------------------------------------------------------------

def _axes(sequence: str | int) -> list[int]:
    sequence = "".join(str(a) for a in sequence) if not isinstance(sequence, int) else str(sequence)
    if sequence not in SEQUENCES:
        raise ValueError(f"unknown Euler sequence '{sequence}'; the sequences are " + ", ".join(SEQUENCES))
    return [int(a) - 1 for a in sequence]


def axis_rotation(axis: int, angle: ArrayLike) -> np.ndarray:
    """The matrix of a frame turned by `angle` [rad] about its own axis 1, 2 or 3."""
    angle = np.asarray(angle, dtype=float)
    i, (j, k) = axis - 1, (axis % 3, (axis + 1) % 3)
    out = np.zeros(angle.shape + (3, 3))
    out[..., i, i] = 1.0
    out[..., j, j] = out[..., k, k] = np.cos(angle)
    out[..., j, k] = np.sin(angle)
    out[..., k, j] = -out[..., j, k]
    return out


def euler_to_dcm(euler: ArrayLike, sequence: str | int = "321") -> np.ndarray:
    """euler_BN [rad] of a sequence -> dcm_BN."""
    euler = _vector(euler, "Euler angles")
    first, second, third = (axis_rotation(a + 1, euler[..., n]) for n, a in enumerate(_axes(sequence)))
    return third @ second @ first


def dcm_to_euler(dcm: ArrayLike, sequence: str | int = "321") -> np.ndarray:
    """dcm_BN -> euler_BN [rad] of a sequence.

    The second angle lies in [-pi/2, pi/2], or in [0, pi] for sequences such as "313". Where it makes
    the first and the third axis parallel, only their sum or difference is defined: the third is 0.
    """
    c = _array(dcm, (3, 3), "a direction cosine matrix")
    i, j, last = _axes(sequence)
    k = 3 - i - j  # the axis besides the first two
    even = 1.0 if (j - i) % 3 == 1 else -1.0
    if i == last:
        sine = np.hypot(c[..., i, j], c[..., i, k])
        second = np.arctan2(sine, c[..., i, i])
        first = np.arctan2(c[..., i, j], -even * c[..., i, k])
        third = np.arctan2(c[..., j, i], even * c[..., k, i])
        locked = sine < 1e-12
    else:
        cosine = np.hypot(c[..., k, k], c[..., k, j])
        second = np.arctan2(even * c[..., k, i], cosine)
        first = np.arctan2(-even * c[..., k, j], c[..., k, k])
        third = np.arctan2(-even * c[..., j, i], c[..., i, i])
        locked = cosine < 1e-12
    # With the third angle at 0 the frame after the first two shares its axis j with the one before.
    first = np.where(locked, np.arctan2(even * c[..., j, k], c[..., j, j]), first)
    third = np.where(locked, 0.0, third)
    return np.stack([first, second, third], axis=-1)


# --- the other pairs -------------------------------------------------------------------------------

def mrp_to_dcm(sigma: ArrayLike) -> np.ndarray:
    """sigma_BN -> dcm_BN."""
    return quaternion_to_dcm(mrp_to_quaternion(sigma))


def dcm_to_mrp(dcm: ArrayLike) -> np.ndarray:
    """dcm_BN -> sigma_BN with |sigma| <= 1."""
    return quaternion_to_mrp(dcm_to_quaternion(dcm))


def prv_to_dcm(prv: ArrayLike) -> np.ndarray:
    """prv_BN [rad] -> dcm_BN."""
    return quaternion_to_dcm(prv_to_quaternion(prv))


def dcm_to_prv(dcm: ArrayLike) -> np.ndarray:
    """dcm_BN -> prv_BN [rad] with an angle in [0, pi]."""
    return quaternion_to_prv(dcm_to_quaternion(dcm))


def mrp_to_prv(sigma: ArrayLike) -> np.ndarray:
    """sigma_BN -> prv_BN [rad] with an angle in [0, pi]."""
    return quaternion_to_prv(mrp_to_quaternion(sigma))


def prv_to_mrp(prv: ArrayLike) -> np.ndarray:
    """prv_BN [rad] -> sigma_BN with |sigma| <= 1."""
    return quaternion_to_mrp(prv_to_quaternion(prv))


def mrp_to_euler(sigma: ArrayLike, sequence: str | int = "321") -> np.ndarray:
    """sigma_BN -> euler_BN [rad]; see dcm_to_euler for the ranges."""
    return dcm_to_euler(mrp_to_dcm(sigma), sequence)


def euler_to_mrp(euler: ArrayLike, sequence: str | int = "321") -> np.ndarray:
    """euler_BN [rad] -> sigma_BN with |sigma| <= 1."""
    return dcm_to_mrp(euler_to_dcm(euler, sequence))


def quaternion_to_euler(beta: ArrayLike, sequence: str | int = "321") -> np.ndarray:
    """beta_BN -> euler_BN [rad]; see dcm_to_euler for the ranges."""
    return dcm_to_euler(quaternion_to_dcm(beta), sequence)


def euler_to_quaternion(euler: ArrayLike, sequence: str | int = "321") -> np.ndarray:
    """euler_BN [rad] -> beta_BN with beta[0] >= 0."""
    return dcm_to_quaternion(euler_to_dcm(euler, sequence))


def prv_to_euler(prv: ArrayLike, sequence: str | int = "321") -> np.ndarray:
    """prv_BN [rad] -> euler_BN [rad]; see dcm_to_euler for the ranges."""
    return dcm_to_euler(prv_to_dcm(prv), sequence)


def euler_to_prv(euler: ArrayLike, sequence: str | int = "321") -> np.ndarray:
    """euler_BN [rad] -> prv_BN [rad] with an angle in [0, pi]."""
    return dcm_to_prv(euler_to_dcm(euler, sequence))


# --- working with MRPs -----------------------------------------------------------------------------

def shadow(sigma: ArrayLike) -> np.ndarray:
    """The other set of MRPs of the same attitude, -sigma / |sigma|^2. Undefined at zero."""
    sigma = _vector(sigma, "an MRP")
    return -sigma / np.sum(sigma * sigma, axis=-1, keepdims=True)


def switch(sigma: ArrayLike) -> np.ndarray:
    """The set with |sigma| <= 1. |sigma| = 1 stays as it is."""
    sigma = _vector(sigma, "an MRP")
    s2 = np.sum(sigma * sigma, axis=-1, keepdims=True)
    return np.where(s2 > 1.0, -sigma / np.where(s2 > 1.0, s2, 1.0), sigma)


def compose(sigma_CB: ArrayLike, sigma_BN: ArrayLike) -> np.ndarray:
    """sigma_CN of two rotations in a row: dcm_CN = dcm_CB @ dcm_BN."""
    return quaternion_to_mrp(quaternion_product(mrp_to_quaternion(sigma_CB), mrp_to_quaternion(sigma_BN)))


def relative(sigma_BN: ArrayLike, sigma_RN: ArrayLike) -> np.ndarray:
    """sigma_BR of two attitudes: dcm_BR = dcm_BN @ dcm_RN.T."""
    return compose(sigma_BN, -_vector(sigma_RN, "an MRP"))


def angle(sigma: ArrayLike) -> np.ndarray:
    """The principal angle of an attitude [rad], in [0, pi]."""
    return 4.0 * np.arctan(np.linalg.norm(switch(sigma), axis=-1))
