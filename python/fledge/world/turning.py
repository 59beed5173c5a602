# SPDX-License-Identifier: Apache-2.0
"""The turning of a body for the ground targets of flight software, from a Sky."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError, suggesting
from fledge.objects.computed import for_flight
from fledge.objects.si import time_ns, to_number
from fledge.world.bodies import LENGTH, Body, body_of
from fledge.world.sky import Sky

if TYPE_CHECKING:
    from numpy.typing import NDArray

SAMPLES = 65    # of a fit; its error is sampled eight times as densely


@for_flight
@suggesting()
def fit_orientation(sky: Sky, body: Body | str, *, within: Any, duration: Any, start: Any = 0) -> dict[str, Any]:
    """The parameters `dcm_PN` and `rate` of a GroundTarget, which turns at a constant rate about a pole that stands.

        f.target = fsw.GroundTarget(longitude=..., latitude=..., radius=world.MARS.radius * m,
                                    **world.fit_orientation(sky, world.MARS, within=10 * m, duration=30 * day))

    within: the largest error [m] of a place on the body's equatorial radius, over the whole span.
    start, duration: the span, in the time of the run.

    Attitude and rate have the least squares of the error over the span; its largest is sampled. Raises SetupError if
    the bound cannot be held, with the error that can be reached, or if the Sky does not cover the span.
    """
    from numpy import array, cos, einsum, linspace, polyfit, sin, stack, zeros_like
    from numpy.linalg import det, norm, svd

    path = "fit_orientation"
    bound = to_number(within, f"{path}: within", "m", LENGTH)
    body = body_of(body, path)
    begin, span = time_ns(start, f"{path}: start"), time_ns(duration, f"{path}: duration")
    if not bound > 0 or span <= 0:
        raise SetupError(f"{path}: within and duration must be > 0; found {bound:g} m and {span / 1e9:g} s")

    def attitudes(n: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """(times [s], (n, 3, 3)) over the span, ends included."""
        ns = [begin + round(x * span) for x in linspace(0, 1, n)]
        return array(ns) / 1e9, array([sky.orientation(body, t / 1e9).dcm_PN for t in ns])

    def turns(t: NDArray[Any], rate: float) -> NDArray[Any]:
        """R3 of the angles at times."""
        c, s, none = cos(rate * t), sin(rate * t), zeros_like(t)
        return stack([stack([c, s, none], -1), stack([-s, c, none], -1), stack([none, none, 1 + none], -1)], -2)

    def errors(t: NDArray[Any], truth: NDArray[Any], dcm: NDArray[Any], rate: float) -> NDArray[Any]:
        """(3, n) [rad] The rotation vectors from the model to the truth: about p1, p2, p3."""
        e = einsum("nij,nkj->nik", truth, turns(t, rate) @ dcm)
        return array([e[:, 1, 2] - e[:, 2, 1], e[:, 2, 0] - e[:, 0, 2], e[:, 0, 1] - e[:, 1, 0]]) / 2

    t, truth = attitudes(SAMPLES)
    rate = float(sky.orientation(body, (begin + span // 2) / 1e9).omega_PN_P[2])
    for _ in range(4):
        u, _, v = svd(einsum("nji,njk->ik", turns(t, rate), truth))
        dcm = u @ array([[1, 0, 0], [0, 1, 0], [0, 0, det(u @ v)]]) @ v
        rate += float(polyfit(t - t.mean(), errors(t, truth, dcm, rate)[2], 1)[0])
    t, truth = attitudes(8 * SAMPLES)
    worst = body.radius * float(norm(errors(t, truth, dcm, rate), axis=0).max())
    if not worst <= bound:
        raise SetupError(f"{path}: a constant rate about a pole that stands holds {body.name} within {worst:.3g} m "
                         f"over {span / 1e9:g} s, not within {bound:g} m; take a shorter duration")
    return {"dcm_PN": dcm, "rate": rate}
