# SPDX-License-Identifier: Apache-2.0
"""The functions of flight/math from Python: the bits of their formulas, their shapes, their refusals."""
import inspect
import math
import random
import re

import numpy as np
import pytest

from fledge import flight_math as fm
from fledge.units import m


def vectors(n, size=3):
    draw = random.Random(5)
    return [[draw.uniform(-2, 2) * 10 ** draw.randint(-8, 8) for _ in range(size)] for _ in range(n)]


def test_they_have_the_bits_of_their_formulas():
    """Written again with Python's doubles, in the order of flight/math/vec.h."""
    for a, b in zip(vectors(200), vectors(200)[::-1]):
        assert fm.vec_dot(a, b) == a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        assert fm.vec_norm(a) == math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        assert fm.vec_cross(np.array(a), b).tolist() == [
            a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        rows = np.array([a, b, a])
        assert fm.mat_vec(rows, b).tolist() == [r[0] * b[0] + r[1] * b[1] + r[2] * b[2] for r in rows.tolist()]
        assert fm.mat_transpose(rows).tolist() == rows.T.tolist() == fm.mat_transpose(rows[:, :]).tolist()
        assert fm.mat_transpose(rows.T).tolist() == rows.tolist()       # an array that is not contiguous


def test_elementary_functions_are_near_the_ones_of_python():
    for x, in vectors(300, 1):
        for ours, theirs in ((fm.fm_sin, math.sin), (fm.fm_cos, math.cos), (fm.fm_atan, math.atan)):
            assert abs(ours(x) - theirs(x)) <= 2 * math.ulp(theirs(x))
    assert fm.fm_sincos(0.5) == (fm.fm_sin(0.5), fm.fm_cos(0.5))


def test_what_c_fills_by_pointers_is_given_back():
    s, c = fm.vec_sincos([0.1, 0.2, 0.3])
    assert s.tolist() == [fm.fm_sin(x) for x in (0.1, 0.2, 0.3)] and c[2] == fm.fm_cos(0.3)
    inverse, rank = fm.mat_sym_pinv(np.diag([2.0, 4.0, 0.0]))
    assert rank == 2 and type(rank) is int
    np.testing.assert_allclose(inverse, np.diag([0.5, 0.25, 0]), atol=1e-15)


def test_a_turn_and_back_is_none():
    for sigma in ([0.1, -0.2, 0.3], [0.6, 0.2, -0.5]):
        quaternion = fm.mrp_to_quat(sigma)
        assert quaternion.shape == (4,)
        np.testing.assert_allclose(fm.mrp_relative(sigma, fm.quat_to_mrp(quaternion)), 0, atol=1e-15)


@pytest.mark.parametrize("call, complaint", [
    (lambda: fm.vec_add([1, 2], [1, 2, 3]), "vec_add: a: expected numbers of the shape (3,); found the shape (2,)"),
    (lambda: fm.vec_add([1, 2, 3], 1), "vec_add: b: expected numbers of the shape (3,); found the shape ()"),
    (lambda: fm.mat_vec(np.eye(4), [1, 2, 3]),
     "mat_vec: a: expected numbers of the shape (3, 3); found the shape (4, 4)"),
    (lambda: fm.fm_sin(np.zeros(1)), "fm_sin: x: expected a number; found the shape (1,)"),
    (lambda: fm.fm_sin("1"), "fm_sin: x: expected a number; found '1'"),
    (lambda: fm.vec_norm(["1", "2", "3"]), "vec_norm: a: expected numbers of the shape (3,); found ['1', '2', '3']"),
    (lambda: fm.vec_norm([1j, 2, 3]), "vec_norm: a: expected numbers"),
    (lambda: fm.vec_norm([1, 2, 3] * m), "vec_norm: a: expected numbers of the shape (3,); found [1.0, 2.0, 3.0] m"),
    (lambda: fm.fm_sin(1 * m), "fm_sin: x: expected a number; found 1.0 m"),
    (lambda: fm.fm_sin(), "fm_sin takes 1 arguments; found 0"),
])
def test_other_shapes_and_kinds_are_refused(call, complaint):
    with pytest.raises(TypeError, match=re.escape(complaint)):
        call()


def test_all_functions_of_the_headers_are_there_with_their_arguments():
    assert len(fm.__all__) > 50 and {"mrp_compose", "fm_exp", "euler_to_dcm", "mat_mul"} <= set(fm.__all__)
    assert list(inspect.signature(fm.mrp_compose).parameters) == ["sigma_CB", "sigma_BA"]
    assert "sigma_CA, of [CA] = [CB][BA]" in fm.mrp_compose.__doc__
    assert fm.fm_sincos.__doc__.startswith("*s = fm_sin(x) and *c = fm_cos(x), to the bit")
    assert "Returns s: shape (3,), c: shape (3,). Declared in flight/math/attitude.h." in fm.vec_sincos.__doc__
