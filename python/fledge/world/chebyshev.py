# SPDX-License-Identifier: Apache-2.0
"""Chebyshev coefficients for the ephemerides of flight software, from a Sky."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError, suggesting
from fledge.objects.computed import for_flight
from fledge.objects.si import time_ns, to_number
from fledge.world.bodies import LENGTH, Body
from fledge.world.sky import Sky

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

SEGMENTS, TERMS = 8, 16  # as flight/msg/ephemeris.h


@for_flight
@suggesting()
def fit_ephemeris(sky: Sky, body: Body | str | int, *, within: Any, duration: Any, start: Any = 0,
                  center: Body | str | int | None = None) -> dict[str, Any]:
    """The parameters of a ChebyshevEphemeris that holds the position of a body within a bound.

        f.sun = fsw.ChebyshevEphemeris(**world.fit_ephemeris(sky, world.SUN, within=1 * km, duration=10 * day))

    body, center: whose position, and relative to what; None: to N's origin. within: the largest error [m], over the
    whole span. start, duration: the span, in the time of the run; the segments may outlast it by some nanoseconds.

    Takes the fewest segments of equal length that suffice, at most 8, and then the fewest coefficients, at most 16. The
    coefficients interpolate at Chebyshev's nodes, with the same bits on every machine; the error is sampled eight times
    as densely, ends included. Raises SetupError if the bound cannot be held, with the error that can be reached, or if
    the Sky does not cover the span.
    """
    from numpy import array, linspace, zeros
    from numpy.linalg import norm
    from numpy.polynomial import chebyshev

    path = "fit_ephemeris"
    bound = to_number(within, f"{path}: within", "m", LENGTH)
    begin, span = time_ns(start, f"{path}: start"), time_ns(duration, f"{path}: duration")
    if not bound > 0 or span <= 0:
        raise SetupError(f"{path}: within and duration must be > 0; found {bound:g} m and {span / 1e9:g} s")

    def positions(first: int, length: int, x: Iterable[float]) -> NDArray[Any]:
        """(n, 3), at the whole nanoseconds nearest to x in [-1, 1]."""
        return array([sky.state(body, (first + min(round((1 + at) / 2 * length), begin + span - first)) / 1e9, center)
                      .r_PN_N for at in x])

    nodes = _nodes()
    between = linspace(-1, 1, 8 * TERMS + 1)
    best = float("inf")
    for segments in range(1, SEGMENTS + 1):
        length = -(-span // segments)
        firsts = [begin + k * length for k in range(segments)]
        whole = [zeros((TERMS, 3)) for _ in firsts]
        for c, first in zip(whole, firsts):     # term by term: a matrix product has other bits on other processors
            for terms, r in zip(chebyshev.chebvander(nodes, TERMS - 1), positions(first, length, nodes)):
                c += 2 / TERMS * terms[:, None] * r
        truth = [positions(first, length, between) for first in firsts]
        for c in whole:
            c[0] /= 2

        def error(n: int) -> float:
            return max(norm(chebyshev.chebval(between, c[:n]).T - r, axis=1).max() for c, r in zip(whole, truth))

        best = min(best, error(TERMS))
        if best <= bound:
            n = next(n for n in range(1, TERMS + 1) if error(n) <= bound)
            coefficients = zeros((SEGMENTS, TERMS, 3))
            coefficients[:segments, :n] = [c[:n] for c in whole]
            return {"start": begin, "duration": length, "segments": segments, "n": n, "c": coefficients}
    raise SetupError(f"{path}: {SEGMENTS} segments of {TERMS} coefficients hold {body} within {best:.3g} m over "
                     f"{span / 1e9:g} s, not within {bound:g} m; take a shorter duration")


def _nodes() -> list[float]:
    """Those of Chebyshev's polynomial of degree TERMS, a power of 2, rising: -cos(pi (2 k + 1) / (2 TERMS)), by roots
    of half angles, which have the same bits everywhere; cosines of C libraries and numpy differ."""
    from math import sqrt

    cosines = [sqrt(0.5)]       # of odd multiples of pi / 4 below pi / 2, then of pi / 8, and so on
    while len(cosines) < TERMS // 2:
        cosines = [sqrt((1 + sign * c) / 2) for sign in (1, -1) for c in cosines]
    return sorted([-c for c in cosines] + cosines)
