# SPDX-License-Identifier: Apache-2.0
"""Scan patterns: the directions of a boresight, in the plane of two angles and on the unit sphere.

    log = sim.record(f.guidance.reference, f.scan.reference, w.craft.state, every=1 * s)
    sim.run(160 * minute)

    wanted = scan.path(log, "scan.reference.sigma_RN", base="guidance.reference.sigma_RN")
    flown  = scan.path(log, "state.sigma_BN", base="guidance.reference.sigma_RN")
    flown.off(wanted).max()                                  # [rad]
    scan.plane(log, {"commanded": wanted, "achieved": flown})
    scan.sphere(log, {"commanded": wanted, "achieved": flown})

A boresight is an axis of the body: 1, 2, 3, or -1, -2, -3 for the opposite direction, or any vector in
body components. The plane's angles are those of an EulerRotation: they turn the base's axis, the
centre, to the boresight, first about the axis before it in the cycle 1, 2, 3 (axis 3, yaw, for the
centre 1), then about the new axis after it (axis 2, pitch).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.plot import deliver, drawn, silent

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from fledge.records.series import Records

# The colours of curves, in the order in which they are drawn.
DARK, MAGENTA, LIGHT = "#1b2f6e", "#d0248f", "#62b6e8"
INK, SOFT, PALE, PAPER = "#222222", "#6f7780", "#d4dae1", "#ffffff"
BLUE, GOLD = "#1f5fd0", "#f2b632"

TURNS = {1: r"roll $\phi$", 2: r"pitch $\theta$", 3: r"yaw $\psi$"}  # by the axis of the turn


# --- paths -----------------------------------------------------------------------------------------

class Path:
    """The directions of a boresight: `time` [s] (n,), `direction` (n, 3), unit vectors in the base frame.

    frame: the letter of that frame's axes in pictures.
    """

    def __init__(self, time: ArrayLike, direction: ArrayLike, frame: str = "r") -> None:
        import numpy as np

        self.time = np.asarray(time, dtype=float)
        direction = np.asarray(direction, dtype=float)
        self.frame = frame
        self.direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)

    def angles(self, centre: int = 1) -> np.ndarray:
        """The two angles from an axis of the base frame, the centre, to the boresight: (n, 2) [rad]. centre: 1, 2
        or 3, negative of the opposite direction; else SetupError."""
        import numpy as np

        k, sign = _axis(centre)
        d = sign * self.direction
        first = np.arctan2(d[:, (k + 1) % 3], d[:, k])
        second = np.arctan2(-d[:, (k + 2) % 3], np.hypot(d[:, k], d[:, (k + 1) % 3]))
        return np.stack([first, second], axis=-1)

    def during(self, start: float, end: float) -> Path:
        """The part from a time to another [s], both included."""
        inside = (self.time >= start) & (self.time <= end)
        return Path(self.time[inside], self.direction[inside], self.frame)

    def off(self, other: Path | ArrayLike) -> np.ndarray:
        """The angle to another path, or to one direction (3,), at each instant (n,) [rad]. Raises SetupError if
        the paths have different lengths."""
        import numpy as np

        there = other.direction if isinstance(other, Path) else np.broadcast_to(other, self.direction.shape)
        if there.shape != self.direction.shape:
            raise SetupError(f"off: the paths have {len(self)} and {len(there)} samples")
        return np.arctan2(np.linalg.norm(np.cross(self.direction, there), axis=-1),
                          np.sum(self.direction * there, axis=-1))

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        span = f", {self.time[0]:g} s to {self.time[-1]:g} s" if len(self) else ""
        return f"<path of {len(self)} samples{span}>"


def path(source: Records, attitude: str, base: str | None = None, boresight: int | ArrayLike = 1) -> Path:
    """The Path of a boresight.

    source: a Log or an Archive
    attitude: the name of a field with the MRPs of a frame relative to N, as in "state.sigma_BN"
    base: the same for the frame of the result; None: N
    boresight: in the components of the first frame
    Raises SetupError for unknown names, and for fields with different times.
    """
    import numpy as np

    from fledge.attitude import mrp_to_dcm
    body = source.series(attitude)
    d_N = np.einsum("nji,j->ni", mrp_to_dcm(body.values), _vector(boresight))
    if base is None:
        return Path(body.time, d_N, frame="n")
    other = source.series(base)
    if len(other.time) != len(body.time) or (other.time != body.time).any():
        raise SetupError(f"path: {attitude} and {base} were recorded at different times")
    return Path(body.time, np.einsum("nij,nj->ni", mrp_to_dcm(other.values), d_N))


def _axis(axis: int) -> tuple[int, float]:
    """1 -> (0, 1.0), -3 -> (2, -1.0)"""
    if axis not in (1, 2, 3, -1, -2, -3):
        raise SetupError(f"expected an axis 1, 2, 3, -1, -2 or -3; found {axis!r}")
    return abs(axis) - 1, 1.0 if axis > 0 else -1.0


def _vector(boresight: Any) -> NDArray[Any]:
    import numpy as np

    if np.ndim(boresight) == 0:
        k, sign = _axis(boresight)
        return sign * np.eye(3)[k]
    vector = np.asarray(boresight, dtype=float)
    if vector.shape != (3,) or not 0.0 < np.linalg.norm(vector) < np.inf:
        raise SetupError(f"boresight: expected an axis or 3 numbers, not all zero; found {boresight!r}")
    return vector / np.linalg.norm(vector)


# --- in the plane ----------------------------------------------------------------------------------

def plane(source: Records, paths: dict[str, Path | list[Path]], *, centre: int = 1,
          colors: Sequence[str] = (DARK, MAGENTA, LIGHT), numbered: str | None = None,
          marks: dict[str, ArrayLike] | None = None, title: str | None = None, name: str = "scan_plane",
          size: tuple[float, float] | None = None) -> Figure | None:
    """Draw paths in the plane of two angles, in degrees; returns a matplotlib Figure, or None if the simulation draws
    nothing. Raises SetupError without a path that has samples.

    source: the Log of the paths, whose simulation collects plots, or an Archive
    paths: label -> Path, or a list of Paths; drawn in this order
    centre: the axis of the base frame in the middle; colors: one for each label
    numbered: the label whose paths are numbered, from 1a at the first's beginning to 1b at its end
    marks: text -> the two angles [rad] of a point
    title, name: of the figure, and of its file; size: (width, height) in inches
    """
    if silent(source):
        return None
    import numpy as np
    from matplotlib.ticker import MaxNLocator

    k, _ = _axis(centre)
    groups = _groups(paths)
    everything = np.degrees(np.concatenate([p.angles(centre) for group in groups.values() for p in group]))
    low, high = everything.min(axis=0), everything.max(axis=0)
    pad = 0.07 * max(high - low) + 1e-9
    with drawn(size or _size(high - low + 2 * pad), name, title) as figure:
        axis = figure.add_subplot()
        for (label, group), color in zip(groups.items(), colors):
            for i, path in enumerate(group):
                axis.plot(*np.degrees(path.angles(centre)).T, color=color, label=label if i == 0 else None,
                          **_stroke(color, colors))
        reach = 12.5 * (max(high - low) + 2 * pad) / (72 * 5.4)  # from a point to its label
        for number, path in enumerate(groups.get(numbered or "", ()), 1):
            color = colors[list(groups).index(numbered or "")]
            _numbered(axis, np.degrees(path.angles(centre)), number, color, reach, everything)
        for text, point in (marks or {}).items():
            axis.plot(*np.degrees(point), "o", color=INK, markersize=5, zorder=6, label=text)
        axis.set_xlim(low[0] - pad, high[0] + pad)
        axis.set_ylim(low[1] - pad, high[1] + pad)
        axis.set_aspect("equal")
        axis.set_xlabel(f"{TURNS[(k + 2) % 3 + 1]}  [deg]")
        axis.set_ylabel(f"{TURNS[(k + 1) % 3 + 1]}  [deg]")
        for scale in (axis.xaxis, axis.yaxis):
            scale.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 3, 5, 10]))
        _legend(axis, len(groups) + len(marks or {}))
    return deliver(figure, source)


def _numbered(axis: Axes, xy: NDArray[Any], number: int, color: Any, reach: float, everything: NDArray[Any]) -> None:
    """The direction of a path (n, 2), and numbers at its ends, beside all curves."""
    middle = 0.5 * (everything.min(axis=0) + everything.max(axis=0))
    _arrow(axis, xy, color)
    for point, letter in ((xy[0], "a"), (xy[-1], "b")):
        axis.plot(*point, "o", color=color, markersize=3.6, zorder=4)
        x, y = _free(point, reach, everything, middle)
        axis.text(x, y, f"{number}{letter}", color=color, fontsize=9, fontweight="bold",
                  ha="center", va="center", zorder=5)


def _stroke(color: Any, colors: Iterable[Any], widths: Sequence[float] = (3.2, 1.1, 1.6)) -> dict[str, float]:
    """The first curve is below and broad, so that both are visible where the second follows it."""
    place = min(list(colors).index(color), 2)
    return {"linewidth": widths[place], "zorder": (2, 3, 2.5)[place]}


def _arrow(axis: Axes, xy: NDArray[Any], color: Any) -> None:
    """An arrow head a third along a line: off its middle, where lines cross."""
    import numpy as np

    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0), axis=1))])
    if not along[-1]:
        return
    i = int(np.clip(np.searchsorted(along, along[-1] / 3), 1, len(xy) - 1))
    step = xy[i] - xy[i - 1]
    before = xy[i] - 0.02 * np.ptp(xy, axis=0).max() * step / np.linalg.norm(step)
    axis.annotate("", xy[i], xytext=before, zorder=4, arrowprops=_head(color, 15))


def _head(color: Any, size: float = 10) -> dict[str, Any]:
    return {"arrowstyle": "-|>,head_length=0.55,head_width=0.28", "mutation_scale": size, "color": color,
            "linewidth": 1.0, "shrinkA": 0, "shrinkB": 0}


def _free(point: NDArray[Any], reach: float, curves: NDArray[Any], middle: NDArray[Any]) -> NDArray[Any]:
    """A position beside a point, far from all curves and from the middle of the pattern."""
    import numpy as np

    turn = np.radians(np.arange(0, 360, 15))
    places = point + reach * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    near = curves[np.abs(curves - point).max(axis=-1) < 3 * reach]
    room = np.linalg.norm(places[:, None] - near, axis=-1).min(axis=1)
    outward = np.linalg.norm(places - middle, axis=-1) - np.linalg.norm(point - middle)
    return places[np.argmax(np.minimum(room, 0.8 * reach) + 0.1 * outward)]


def _halo() -> dict[str, Any]:
    return {"boxstyle": "round,pad=0.12", "facecolor": PAPER, "edgecolor": "none", "alpha": 0.75}


def _size(extent: NDArray[Any]) -> tuple[float, float]:
    """Inches for axes of equal scales."""
    width, height = extent / max(extent)
    return 1.0 + 5.4 * max(width, 0.5), 1.1 + 5.4 * max(height, 0.4)


# --- on the sphere ---------------------------------------------------------------------------------

def sphere(source: Records, paths: dict[str, Path | list[Path]], *, centre: int = 1,
           colors: Sequence[str] = (DARK, MAGENTA, LIGHT), rays: str | None = None,
           marks: dict[str, ArrayLike] | None = None, view: tuple[float, float] | None = None,
           title: str | None = None, name: str = "scan_sphere",
           size: tuple[float, float] = (6.4, 6.1)) -> Figure | None:
    """Draw paths on the unit sphere about the spacecraft, seen from afar; returns a matplotlib Figure.

    rays: the label whose paths' ends are joined with the spacecraft
    marks: text -> direction (3,) in the base frame
    view: (longitude, latitude) of the eye in the base frame [rad]; default: beside the centre
    The others are as for plane(). Lines on the far side are faint.
    """
    if silent(source):
        return None
    import numpy as np

    groups = _groups(paths)
    k, sign = _axis(centre)
    reach = max(p.off(sign * np.eye(3)[k]).max() for group in groups.values() for p in group if len(p))
    screen = _screen(centre, view, np.clip(reach + np.radians(22), np.radians(36), np.radians(55)))
    with drawn(size, name, title) as figure:
        axis = figure.add_subplot()
        axis.set_axis_off()
        axis.set_aspect("equal")
        _globe(axis, screen)
        _axes_of(axis, screen, next(iter(groups.values()))[0].frame)
        for path in groups.get(rays or "", ()):
            for end in (path.direction[0], path.direction[-1]):
                right, up, _ = screen @ end
                axis.plot([0, right], [0, up], color=DARK, linewidth=0.6, alpha=0.35, zorder=2)
        for (label, group), color in zip(groups.items(), colors):
            for i, path in enumerate(group):
                _on_globe(axis, screen, path.direction, color, label if i == 0 else None,
                          **_stroke(color, colors, (2.0, 1.0, 1.1)))
        for text, direction in (marks or {}).items():
            right, up, near = screen @ _vector(direction)
            axis.plot(right, up, "*", color=GOLD if near > 0 else PALE, markeredgecolor=INK, markeredgewidth=0.6,
                      markersize=11, zorder=6 if near > 0 else 1.5)
            axis.annotate(text, (right, up), xytext=(9, 5), textcoords="offset points", color=INK, fontsize=9,
                          fontweight="bold", bbox=_halo(), zorder=7)
        axis.plot(0, 0, "o", color=BLUE, markersize=6, zorder=8)
        axis.annotate("spacecraft", (0, 0), xytext=(8, 6), textcoords="offset points", color=BLUE,
                      fontsize=8.5, bbox=_halo(), zorder=8)
        axis.set_xlim(-1.32, 1.32)
        axis.set_ylim(-1.12, 1.32)
        _legend(axis, len(groups))
    return deliver(figure, source)


def _axes_of(axis: Axes, screen: NDArray[Any], letter: str) -> None:
    """The axes of the base frame, which the letter names."""
    import numpy as np

    for i, inside in enumerate(screen.T):
        # Long enough to end beside the globe, within limits.
        length = np.clip(1.18 / max(np.hypot(*inside[:2]), 1e-9), 1.18, 1.5)
        tip = length * inside
        front = inside[2] > 0
        axis.plot([0, inside[0]], [0, inside[1]], color=SOFT, linewidth=0.8, linestyle=(0, (4, 3)),
                  zorder=2)
        axis.annotate("", tip[:2], xytext=inside[:2], zorder=7 if front else 0.5,
                      arrowprops=_head(INK if front else SOFT))
        axis.annotate(rf"$\hat {letter}_{{{i + 1}}}$", tip[:2] * (1.0 + 0.09 / length), ha="center", va="center",
                      color=INK if front else SOFT, fontsize=11, zorder=7)


def _screen(centre: int, view: Sequence[float] | None, beside: float) -> NDArray[Any]:
    """(3, 3): rows are right, up and towards the eye, which is `beside` [rad] off the centre."""
    import numpy as np

    if view is None:
        k, sign = _axis(centre)
        k_hat, side, above = sign * np.eye(3)[k], np.eye(3)[(k + 1) % 3], np.eye(3)[(k + 2) % 3]
        eye = np.cos(beside) * k_hat + np.sin(beside) * (0.9 * side + 0.44 * above)
    else:
        longitude, latitude = map(float, view)
        eye = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude),
                        np.sin(latitude)])
        above = np.array([0.0, 0.0, 1.0])
    eye = eye / np.linalg.norm(eye)
    right = np.cross(above, eye)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def _globe(axis: Axes, screen: NDArray[Any]) -> None:
    """The sphere: its outline, a little shade, and a net of 15 degrees."""
    import numpy as np
    from matplotlib.patches import Circle

    axis.add_patch(Circle((0, 0), 1.0, facecolor="#f6f8fb", edgecolor="#aab4bf", linewidth=1.0, zorder=1))
    fine = np.linspace(-np.pi, np.pi, 361)
    for latitude in np.radians(np.arange(-75, 76, 15)):
        ring = np.stack([np.cos(latitude) * np.cos(fine), np.cos(latitude) * np.sin(fine),
                         np.full_like(fine, np.sin(latitude))], axis=-1)
        _net(axis, screen, ring, 1.0 if latitude == 0 else 0.6)
    for longitude in np.radians(np.arange(0, 180, 15)):
        ring = np.stack([np.cos(fine) * np.cos(longitude), np.cos(fine) * np.sin(longitude), np.sin(fine)],
                        axis=-1)
        _net(axis, screen, ring, 1.0 if longitude == 0 else 0.6)


def _net(axis: Axes, screen: NDArray[Any], ring: NDArray[Any], width: float) -> None:
    xy = ring @ screen.T
    axis.plot(*_masked(xy, xy[:, 2] > 0), color=PALE, linewidth=width, zorder=1.6)
    axis.plot(*_masked(xy, xy[:, 2] <= 0), color="#e9edf2", linewidth=0.5, zorder=1.2)


def _on_globe(axis: Axes, screen: NDArray[Any], direction: NDArray[Any], color: Any, label: str | None,
              **stroke: Any) -> None:
    xy = direction @ screen.T
    axis.plot(*_masked(xy, xy[:, 2] > 0), color=color, label=label, **stroke)
    faint = {**stroke, "linewidth": 0.7, "zorder": 1.4, "alpha": 0.25}
    axis.plot(*_masked(xy, xy[:, 2] <= 0), color=color, **faint)


def _masked(xy: NDArray[Any], shown: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    import numpy as np

    return np.where(shown, xy[:, 0], np.nan), np.where(shown, xy[:, 1], np.nan)


# --- both ------------------------------------------------------------------------------------------

def _groups(paths: Mapping[str, Path | Iterable[Path]]) -> dict[str, list[Path]]:
    groups = {label: [group] if isinstance(group, Path) else list(group) for label, group in paths.items()}
    if not any(len(p) for group in groups.values() for p in group):
        raise SetupError("scan: there is nothing to draw; give at least one path with samples")
    return groups


def _legend(axis: Axes, entries: int) -> None:
    if entries > 1:
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=entries)
