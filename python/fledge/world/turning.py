# SPDX-License-Identifier: Apache-2.0
"""The turning of a body for the ground targets of flight software, from a Sky."""

from __future__ import annotations

from typing import Any

from fledge.errors import SetupError, suggesting
from fledge.flight_math import fm_sincos, fm_sqrt
from fledge.objects.computed import for_flight
from fledge.objects.si import time_ns, to_number
from fledge.world.bodies import LENGTH, Body, body_of, cross, dot
from fledge.world.sky import Sky

Matrix = list[list[float]]

SAMPLES = 65    # of a fit; its error is sampled eight times as densely


@for_flight
@suggesting()
def fit_orientation(sky: Sky, body: Body | str, *, within: Any, duration: Any, start: Any = 0) -> dict[str, Any]:
    """The parameters `dcm_PN` and `rate` of a GroundTarget, which turns at a constant rate about a pole that stands.

        f.target = fsw.GroundTarget(longitude=..., latitude=..., radius=world.MARS.radius * m,
                                    **world.fit_orientation(sky, world.MARS, within=10 * m, duration=30 * day))

    within: the largest error [m] of a place on the body's equatorial radius, over the whole span.
    start, duration: the span, in the time of the run.

    Attitude and rate have the least squares of the error over the span, with the same bits on every machine; its
    largest is sampled. Raises SetupError if the bound cannot be held, with the error that can be reached, or if the Sky
    does not cover the span.
    """
    from numpy import array

    path = "fit_orientation"
    bound = to_number(within, f"{path}: within", "m", LENGTH)
    body = body_of(body, path)
    begin, span = time_ns(start, f"{path}: start"), time_ns(duration, f"{path}: duration")
    if not bound > 0 or span <= 0:
        raise SetupError(f"{path}: within and duration must be > 0; found {bound:g} m and {span / 1e9:g} s")

    def attitudes(n: int) -> list[tuple[float, Matrix]]:
        """(time [s], dcm_PN), n times over the span, ends included."""
        ns = [begin + round(k * span / (n - 1)) for k in range(n)]
        return [(t / 1e9, sky.orientation(body, t / 1e9).dcm_PN.tolist()) for t in ns]

    def errors(samples: list[tuple[float, Matrix]], dcm: Matrix, rate: float) -> list[list[float]]:
        """[rad] The rotation vectors from the model to the truth: about p1, p2, p3."""
        found = []
        for t, truth in samples:
            model = _turned(dcm, rate * t)
            found.append([(dot(truth[i], model[j]) - dot(truth[j], model[i])) / 2 for i, j in ((1, 2), (2, 0), (0, 1))])
        return found

    samples = attitudes(SAMPLES)
    middle = begin / 1e9 + span / 2e9
    rate = float(sky.orientation(body, (begin + span // 2) / 1e9).omega_PN_P[2])
    for _ in range(4):
        mean = [[0.0] * 3 for _ in range(3)]
        for t, truth in samples:
            back = _turned(truth, -rate * t)
            mean = [[x + y / SAMPLES for x, y in zip(row, more)] for row, more in zip(mean, back)]
        dcm = _nearest_rotation(mean)
        slope = weight = 0.0
        for (t, _), (_, _, about_pole) in zip(samples, errors(samples, dcm, rate)):
            slope += (t - middle) * about_pole
            weight += (t - middle) * (t - middle)
        rate += slope / weight
    worst = body.radius * max(fm_sqrt(dot(e, e)) for e in errors(attitudes(8 * SAMPLES), dcm, rate))
    if not worst <= bound:
        raise SetupError(f"{path}: a constant rate about a pole that stands holds {body.name} within {worst:.3g} m "
                         f"over {span / 1e9:g} s, not within {bound:g} m; take a shorter duration")
    return {"dcm_PN": array(dcm), "rate": rate}


def _turned(dcm: Matrix, angle: float) -> Matrix:
    """R3(angle) dcm"""
    s, c = fm_sincos(angle)
    first, second, third = dcm
    return [[c * x + s * y for x, y in zip(first, second)], [c * y - s * x for x, y in zip(first, second)], third]


def _nearest_rotation(matrix: Matrix) -> Matrix:
    """The rotation nearest to a matrix with a positive determinant. Newton's iteration for the polar decomposition: the
    mean of the matrix and its inverse transposed (Higham, "Functions of Matrices", 2008, section 8.3)."""
    for _ in range(60):
        a, b, c = matrix
        cofactors = [cross(b, c), cross(c, a), cross(a, b)]
        determinant = dot(a, cofactors[0])
        matrix = [[(x + y / determinant) / 2 for x, y in zip(row, more)] for row, more in zip(matrix, cofactors)]
    return matrix
