# SPDX-License-Identifier: Apache-2.0
"""The trajectory of a craft past a body, in the plane of its orbit, with the axes of the craft along it.

    log = sim.record(w.craft.state, every=1 * s)
    sim.run(160 * minute)
    trajectory.plot(log, "craft.state", world.MARS, {"$b_2$, along the velocity": 2}, every=10 * minute)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge.plot import deliver, drawn, silent, time_unit
from fledge.units import nanoseconds

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure

    from numpy.typing import NDArray

    from fledge.records.series import Records
    from fledge.world import Body

COLORS = ("#d0248f", "#1b2f6e", "#3d8b57")
SOFT, PALE, GROUND = "#6f7780", "#aab4bf", "#d9835f"


def plot(source: Records, state: str, body: Body, axes: dict[str, int], *, every: Any,
         colors: Sequence[str] = COLORS, title: str | None = None, name: str = "trajectory",
         size: tuple[float, float] = (9.4, 4.4)) -> Figure | None:
    """Draw the trajectory; returns a matplotlib Figure, or None if the simulation draws nothing.

    source: a Log, whose simulation collects plots, or an Archive
    state: the name of a CraftState in it, as in "craft.state", of a craft whose N has its origin in the body
    body: a world.Body, drawn by its radius
    axes: label -> axis of the craft, 1, 2 or 3
    every: the time from one set of axes to the next
    colors: one for each label; title, name: of the figure, and of its file; size: (width, height) in inches

    Up is the point nearest to the body, and to the right is the velocity there.
    """
    if silent(source):
        return None
    import numpy as np
    from matplotlib.patches import Circle

    past = _passage(source, state)
    every = nanoseconds(every) / 1e9
    some = np.searchsorted(past.time, np.arange(past.time[0], past.time[-1] + 1e-9, every))
    arrow = 0.04 * np.ptp(past.way, axis=0).max()
    with drawn(size, name, title) as figure:
        axis = figure.add_subplot()
        axis.add_patch(Circle((0, 0), body.radius / 1e6, facecolor=GROUND, edgecolor=SOFT))
        axis.annotate(body.name.capitalize(), (0, 0), ha="center", va="center", color="white", fontweight="bold")
        axis.plot(*past.way.T, color=PALE, linewidth=2.5)
        for (label, k), color in zip(axes.items(), colors):
            axis.quiver(*past.way[some].T, *past.axes[some, k - 1].T, color=color, label=label, angles="xy",
                        scale_units="xy", scale=1 / arrow, width=0.0032, zorder=3)
        unit, factor = time_unit(2 * every)
        for i in some[::2]:
            since = past.time[i] - past.time[past.nearest]
            text = f"{since / factor:+.0f} {unit}" if abs(since) > every / 2 else "nearest"
            axis.annotate(text, past.way[i] + 1.6 * arrow * past.outward[i], ha="center", va="center", fontsize=8,
                          color=SOFT)
        # matplotlib's limits ignore the arrows and texts beside the trajectory.
        low = np.minimum(past.way.min(axis=0), -body.radius / 1e6) - 2.4 * arrow
        high = np.maximum(past.way.max(axis=0), body.radius / 1e6) + 2.4 * arrow
        axis.set_xlim(low[0], high[0])
        axis.set_ylim(low[1], high[1])
        axis.set_aspect("equal")
        axis.set_xlabel("along the velocity at the nearest point  [1000 km]")
        axis.set_ylabel("towards that point  [1000 km]")
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(axes))
    return deliver(figure, source)


class _Passage(NamedTuple):
    """A trajectory in the plane of its orbit: to the right is the velocity at the nearest point, which is up."""
    time: NDArray[np.float64]       # (n,) [s]
    nearest: np.intp                # which of them
    way: NDArray[np.float64]        # (n, 2) [1000 km]
    axes: NDArray[np.float64]       # (n, 3, 2) of the craft
    outward: NDArray[np.float64]    # (n, 2) to the left of the way, away from the body


def _passage(source: Records, state: str) -> _Passage:
    import numpy as np

    from fledge.attitude import mrp_to_dcm

    r, v, sigma = (source.series(f"{state}.{field}").values for field in ("r_BN_N", "v_BN_N", "sigma_BN"))
    nearest = np.linalg.norm(r, axis=1).argmin()
    up = r[nearest] / np.linalg.norm(r[nearest])
    right = v[nearest] - up * (up @ v[nearest])
    plane = np.stack([right / np.linalg.norm(right), up], axis=-1)
    heading = v @ plane
    outward = heading / np.linalg.norm(heading, axis=1, keepdims=True) @ [[0, 1], [-1, 0]]
    return _Passage(source.series(f"{state}.r_BN_N").time, nearest, r @ plane / 1e6, mrp_to_dcm(sigma) @ plane, outward)
