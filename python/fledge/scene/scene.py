# SPDX-License-Identifier: Apache-2.0
"""The parts of a picture of a mission: bodies and spacecraft over time, with parts, cones, directions and estimates.

A Scene is derived from a record and the parameters, types and wires in it (derive.py). A mission adds cameras, meshes
and colours, which no record has, by a function in its view.py:

    def build(view):
        craft = view.craft()                                     # view.craft("chief_world") where there are several
        craft.box([0.6, 0.6, 1.0] * m)
        craft.panel([0, 1.2, 0] * m, [1.6, 0.6] * m, normal_B=[1, 0, 0])
        craft.cone("camera", [1, 0, 0], half_angle=5 * deg)
        craft.cone("tracker's baffle", [0, 0, 1], half_angle=30 * deg, keep_out="Sun")
        craft.mesh("craft.glb")

Lengths are in m, angles in rad, in frames whose letters follow: `_B` of the body, `_N` inertial.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import pi
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError, listed
from fledge.objects.si import to_number, to_vector

if TYPE_CHECKING:
    import numpy as np

    from fledge.records.activity import Happening
    from fledge.scene.tracks import Motion, Signal, Turning

LENGTH, ANGLE, NUMBER = (1, 0, 0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 0, 0, 1), (0,) * 8
MESHES = {".glb": "model/gltf-binary", ".obj": "text/plain"}
LARGEST_MESH = 50_000_000   # [bytes]


@dataclass
class Part:
    """A part of a spacecraft, in its body's frame.

    kind: "box", "panel", "wheel", "thruster", "rod", "cone" or "mesh"
    at_B [m] (3,): where; axis_B (3,): the unit vector of its boresight, spin, force, dipole or normal
    size [m]: of a box (3,), of a panel (2,); half_angle [rad], length [m]: of a cone
    keep_out: of a cone, the body that must not be in it; "": it is a field of view
    level: its speed [rad/s], thrust [N], dipole [A m^2] or angle [rad] over time; full: the largest value
    hinge_B [m], hinge_axis_B: of a panel that `level` turns
    file: of a mesh, its bytes in `data`; scale [-] of it
    """
    kind: str
    name: str
    at_B: Sequence[float] = (0.0, 0.0, 0.0)
    axis_B: Sequence[float] = (0.0, 0.0, 1.0)
    size: Sequence[float] = ()
    half_angle: float = 0.0
    length: float = 0.0
    keep_out: str = ""
    color: str = ""
    level: Signal | None = None
    full: float = 0.0
    hinge_B: Sequence[float] | None = None
    hinge_axis_B: Sequence[float] | None = None
    data: bytes = b""
    scale: float = 1.0


@dataclass
class Pose:
    """Another attitude, and perhaps another place, of a spacecraft: an estimate, or a reference to follow.

    kind: "estimate" or "reference"; motion: None where the spacecraft is
    """
    kind: str
    name: str
    turning: Turning
    motion: Motion | None = None


@dataclass
class Direction:
    """A direction over time: the unit vectors (n, 3) in N of `signal`."""
    name: str
    signal: Signal


@dataclass
class Planet:
    """A celestial body.

    radius [m], flattening [-]: of its ellipsoid; mu [m^3/s^2]: 0 if unknown
    motion, turning: None at rest in the origin of N, and without a known rotation
    """
    name: str
    radius: float
    motion: Motion | None = None
    turning: Turning | None = None
    flattening: float = 0.0
    mu: float = 0.0


@dataclass
class RadioLink:
    """The radio link of a station with the spacecraft of a name. down, up: (n, 2), locked or not [-] and Eb/N0 [dB];
    None of a link that is not recorded"""
    name: str
    craft: str
    down: Signal | None
    up: Signal | None


@dataclass
class Station:
    """A station on the ground of a planet, at rest in its frame P. r_P [m] (3,); up_P (3,): its zenith; mask [rad]: the
    lowest elevation of a contact"""
    name: str
    planet: str
    r_P: Sequence[float]
    up_P: Sequence[float]
    mask: float
    links: list[RadioLink] = field(default_factory=list)


class Craft:
    """A spacecraft: its motion, its attitude, and its parts.

    name: of the process of its world; path: of the instance with its motion; label: its name in the picture
    """

    def __init__(self, name: str, path: str, motion: Motion, turning: Turning, folder: Path | None) -> None:
        self.name, self.path, self.motion, self.turning = name, path, motion, turning
        self.process = path.partition(".")[0]
        self.label = name.removesuffix("_world")
        self.parts: list[Part] = []
        self.poses: list[Pose] = []
        self.directions: list[Direction] = []
        self.signals: dict[str, Signal] = {}    # more numbers for the read-out: "rate", "attitude error"
        self._folder = folder

    @property
    def extent(self) -> float:
        """[m] The distance of its farthest box, panel or thruster from the origin of B."""
        reach = 0.0
        for part in self.parts:
            if part.kind in ("box", "panel", "thruster"):
                reach = max(reach, _length(part.at_B) + _length(part.size) / 2)
        return reach or 1.0

    def box(self, size: Any, at_B: Any = (0, 0, 0), color: str = "") -> None:
        """A box with edges along the body's axes, in place of the box by the inertia.

        size [m] (3,); at_B [m]: its centre
        """
        self.parts = [part for part in self.parts if part.kind != "box" or part.name != "hub"]
        self.parts.insert(0, Part("box", "box", _vector(at_B, "box: at_B", "m", LENGTH),
                                  size=_positive(_vector(size, "box: size", "m", LENGTH), "box: size"), color=color))

    def panel(self, at_B: Any, size: Any, normal_B: Any, color: str = "") -> None:
        """A flat panel with solar cells on the side of its normal.

        at_B [m]: its centre; size [m] (2,): along the body axis nearest to its plane, and across it
        """
        from fledge.objects.si import to_si

        edges = to_si(size, "panel: size", "m", LENGTH, "2 numbers in m")
        if not isinstance(edges, list) or len(edges) != 2:
            raise SetupError(f"panel: size: expected 2 numbers in m; found {size!r}")
        self.parts.append(Part("panel", "panel", _vector(at_B, "panel: at_B", "m", LENGTH),
                               _unit(normal_B, "panel: normal_B"), _positive(edges, "panel: size"), color=color))

    def cone(self, name: str, boresight_B: Any, half_angle: Any, *, at_B: Any = (0, 0, 0), length: Any = 0,
             keep_out: str = "", color: str = "") -> None:
        """The field of view of a sensor or an instrument, or a cone that a body must stay out of.

        half_angle [rad]: in (0, pi / 2); at_B [m]: its apex; length [m]: as it is drawn; 0: 4 extents at most
        keep_out: "Sun" or the name of another body: the cone warns while its centre is inside
        """
        angle = to_number(half_angle, f"cone {name}: half_angle", "rad", ANGLE)
        if not 0 < angle < pi / 2:
            raise SetupError(f"cone {name}: half_angle must be in (0, pi/2) rad; found {angle:g} rad")
        self.parts.append(Part("cone", name, _vector(at_B, f"cone {name}: at_B", "m", LENGTH),
                               _unit(boresight_B, f"cone {name}: boresight_B"), half_angle=angle, keep_out=keep_out,
                               length=to_number(length, f"cone {name}: length", "m", LENGTH), color=color))

    def mesh(self, file: str | PathLike[str], scale: float = 1.0, at_B: Any = (0, 0, 0)) -> None:
        """A model of the spacecraft in metres, in place of the box: a glTF (.glb) or Wavefront (.obj) file.

        file: relative to the mission's folder; its axes are those of B
        Raises SetupError for a file that is missing, of another kind, or larger than 50 MB.
        """
        path = Path(file) if self._folder is None else self._folder / file
        if path.suffix.lower() not in MESHES:
            raise SetupError(f"mesh: {file}: expected a {' or '.join(MESHES)} file")
        try:
            data = path.read_bytes()
        except OSError as error:
            raise SetupError(f"mesh: {path}: {error.strerror}") from None
        if len(data) > LARGEST_MESH:
            raise SetupError(f"mesh: {path}: {len(data)} bytes; at most {LARGEST_MESH} go into a page")
        if path.suffix.lower() == ".glb" and data[:4] != b"glTF":
            raise SetupError(f"mesh: {path}: it is no binary glTF file")
        self.parts = [part for part in self.parts if part.kind != "box" or part.name != "hub"]
        self.parts.append(Part("mesh", path.name, _vector(at_B, "mesh: at_B", "m", LENGTH), data=data, scale=scale))

    def __repr__(self) -> str:
        return f"<craft {self.name}: {listed([f'{part.kind} {part.name}' for part in self.parts], most=12)}>"


@dataclass
class Plot:
    """A recorded field for a plot. name: "flight.tracking.error.sigma_BR"; labels: of its elements"""
    name: str
    unit: str
    meaning: str
    labels: list[str]
    signal: Signal


@dataclass
class Scene:
    """All that a picture of a run shows.

    title, about: of the page; begin, end [s]: of the run; epoch: the UTC of t = 0, or ""
    sun: its motion relative to the origin of N, None if unknown; sun_N: a constant direction to it, or None
    notes: which data the record lacks, and how to record them
    """
    title: str
    about: str = ""
    begin: float = 0.0
    end: float = 0.0
    epoch: str = ""
    planets: list[Planet] = field(default_factory=list)
    crafts: list[Craft] = field(default_factory=list)
    stations: list[Station] = field(default_factory=list)
    sun: Motion | None = None
    sun_N: np.ndarray | None = None
    plots: list[Plot] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    modes: dict[str, list[tuple[float, str]]] = field(default_factory=dict)     # process -> (t [s], mode) as they began
    happened: list[Happening] = field(default_factory=list)     # events, commands and resets

    def craft(self, name: str | None = None) -> Craft:
        """The spacecraft of a process; without a name, the only one. Raises SetupError that lists them."""
        matches = [craft for craft in self.crafts if name in (None, craft.name)]
        if len(matches) == 1:
            return matches[0]
        problem = "which spacecraft" if name is None else f"there is no spacecraft {name!r}"
        raise SetupError(f"view: {problem}; there are {listed([craft.name for craft in self.crafts])}")


def _vector(value: Any, path: str, unit: str, dims: Any) -> list[float]:
    return to_vector(value, path, unit, dims)


def _positive(values: list[float], path: str) -> list[float]:
    if not all(0 < x < float("inf") for x in values):
        raise SetupError(f"{path}: expected lengths > 0 m; found {values}")
    return values


def _unit(value: Any, path: str) -> list[float]:
    direction = to_vector(value, path, "-", NUMBER)
    size = _length(direction)
    if not 0 < size < float("inf"):
        raise SetupError(f"{path}: expected a direction; found {value!r}")
    return [x / size for x in direction]


def _length(vector: Iterable[float]) -> float:
    return sum(x * x for x in vector) ** 0.5
