# SPDX-License-Identifier: Apache-2.0
"""A record with its scene for Foxglove's 3-D panel: transforms, and primitives that follow them.

The root of all frames, "inertial", has N's axes and moves with the first spacecraft, so that the panel shows this
spacecraft in its middle and in metres, and numbers stay small near it. Frames below it:

    NAME                a spacecraft's body; NAME/estimate ..., NAME/panels 1, ...: its estimates and turning parts
    N                   the origin of N, with the planets and the paths of the spacecraft
    NAME/to the Sun     a frame whose first axis points there; also NAME/nadir and NAME/velocity

The file is the record's, byte for byte up to its end of data, with the topics /scene/transforms and /scene/entities
after it. Messages are CDR by the definitions below, which name the fields of Foxglove's schemas FrameTransforms and
SceneUpdate.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.archive import Archive
from fledge.archive.append import append
from fledge.errors import SetupError
from fledge.disk import Part as PartFile

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from fledge.scene.scene import Craft, Part, Pose, Scene

MOST = 50_000           # transforms of a frame; of a longer record, each n-th sample

DEFINITIONS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "foxglove_msgs/Color": "float64 r\nfloat64 g\nfloat64 b\nfloat64 a",
    "foxglove_msgs/KeyValuePair": "string key\nstring value",
    "foxglove_msgs/FrameTransform": "builtin_interfaces/Time timestamp\nstring parent_frame_id\nstring child_frame_id\n"
                                    "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "foxglove_msgs/FrameTransforms": "foxglove_msgs/FrameTransform[] transforms",
    "foxglove_msgs/ArrowPrimitive": "geometry_msgs/Pose pose\nfloat64 shaft_length\nfloat64 shaft_diameter\n"
                                    "float64 head_length\nfloat64 head_diameter\nfoxglove_msgs/Color color",
    "foxglove_msgs/CubePrimitive": "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfoxglove_msgs/Color color",
    "foxglove_msgs/SpherePrimitive": "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfoxglove_msgs/Color color",
    "foxglove_msgs/CylinderPrimitive": "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 size\nfloat64 bottom_scale\n"
                                       "float64 top_scale\nfoxglove_msgs/Color color",
    "foxglove_msgs/LinePrimitive": "uint8 type\ngeometry_msgs/Pose pose\nfloat64 thickness\nbool scale_invariant\n"
                                   "geometry_msgs/Point[] points\nfoxglove_msgs/Color color\n"
                                   "foxglove_msgs/Color[] colors\nuint32[] indices",
    "foxglove_msgs/TriangleListPrimitive": "geometry_msgs/Pose pose\ngeometry_msgs/Point[] points\n"
                                           "foxglove_msgs/Color color\nfoxglove_msgs/Color[] colors\nuint32[] indices",
    "foxglove_msgs/TextPrimitive": "geometry_msgs/Pose pose\nbool billboard\nfloat64 font_size\nbool scale_invariant\n"
                                   "foxglove_msgs/Color color\nstring text",
    "foxglove_msgs/ModelPrimitive": "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nfoxglove_msgs/Color color\n"
                                    "bool override_color\nstring url\nstring media_type\nuint8[] data",
    "foxglove_msgs/SceneEntityDeletion": "builtin_interfaces/Time timestamp\nuint8 type\nstring id",
    "foxglove_msgs/SceneEntity": "builtin_interfaces/Time timestamp\nstring frame_id\nstring id\n"
                                 "builtin_interfaces/Duration lifetime\nbool frame_locked\n"
                                 "foxglove_msgs/KeyValuePair[] metadata\nfoxglove_msgs/ArrowPrimitive[] arrows\n"
                                 "foxglove_msgs/CubePrimitive[] cubes\nfoxglove_msgs/SpherePrimitive[] spheres\n"
                                 "foxglove_msgs/CylinderPrimitive[] cylinders\nfoxglove_msgs/LinePrimitive[] lines\n"
                                 "foxglove_msgs/TriangleListPrimitive[] triangles\n"
                                 "foxglove_msgs/TextPrimitive[] texts\n"
                                 "foxglove_msgs/ModelPrimitive[] models",
    "foxglove_msgs/SceneUpdate": "foxglove_msgs/SceneEntityDeletion[] deletions\nfoxglove_msgs/SceneEntity[] entities",
}
TOPICS = {"/scene/transforms": "foxglove_msgs/FrameTransforms", "/scene/entities": "foxglove_msgs/SceneUpdate"}
PLANETS = {"EARTH": (0.16, 0.36, 0.6), "MARS": (0.7, 0.4, 0.24), "MOON": (0.6, 0.6, 0.58), "SUN": (1.0, 0.9, 0.6)}
CODES = {"bool": "?", "uint8": "B", "int32": "i", "uint32": "I", "float64": "d"}


# --- messages --------------------------------------------------------------------------------------

def definition(name: str) -> str:
    """The text of a message's definition, with the definitions of its members."""
    texts: dict[str, str] = {}

    def add(kind_: str) -> None:
        if kind_ not in texts:
            texts[kind_] = DEFINITIONS[kind_]
            for line in DEFINITIONS[kind_].splitlines():
                kind = line.split()[0].removesuffix("[]")
                if "/" in kind:
                    add(kind)

    add(name)
    rest = "".join(f"\n{80 * '='}\nMSG: {kind}\n{text}" for kind, text in texts.items() if kind != name)
    return texts[name] + rest + "\n"


def encoded(name: str, message: dict[str, Any]) -> bytes:
    """A message as CDR. Members that the dict does not have are empty or zero."""
    out = bytearray(b"\0\1\0\0")
    _encode(out, name, message)
    return bytes(out)


def _align(out: bytearray, size: int) -> None:
    out += bytes(-(len(out) - 4) % size)


def _number(out: bytearray, code: str, value: Any) -> None:
    _align(out, struct.calcsize(code))
    out += struct.pack(f"<{code}", value)


def _encode(out: bytearray, kind: str, value: Any) -> None:
    if kind == "string":
        data = value.encode() + b"\0"
        _number(out, "I", len(data))
        out += data
    elif kind in CODES:
        _number(out, CODES[kind], value)
    else:
        for line in DEFINITIONS[kind].splitlines():
            inner, name = line.split()
            many = inner.endswith("[]")
            inner = inner.removesuffix("[]")
            given = value.get(name, [] if many else "" if inner == "string" else 0 if inner in CODES else {})
            if not many:
                _encode(out, inner, given)
                continue
            _number(out, "I", len(given))
            if isinstance(given, bytes):
                out += given
                continue
            for element in given:
                _encode(out, inner, element)


def _time(t: float) -> dict[str, int]:
    ns = round(t * 1e9)
    return {"sec": ns // 10**9, "nanosec": ns % 10**9}


def _xyz(v: Iterable[float]) -> dict[str, float]:
    return dict(zip("xyz", map(float, v)))


def _xyzw(q: Iterable[float]) -> dict[str, float]:
    return dict(zip("xyzw", map(float, q)))


def _rgba(color: Sequence[float], alpha: float = 1.0) -> dict[str, float]:
    return {**dict(zip("rgb", color)), "a": alpha}


# --- geometry --------------------------------------------------------------------------------------

def _turn(start: Any, axis: Any) -> list[float]:
    """The quaternion, scalar last, of the shortest turn from one unit vector to another."""
    import numpy as np

    start, axis = np.array(start, dtype=float), np.array(axis, dtype=float)
    if start @ axis < -1 + 1e-12:
        other = np.cross(start, [0.0, 1.0, 0.0] if abs(start[1]) < 0.9 else [1.0, 0.0, 0.0])
        return [*(other / np.linalg.norm(other)), 0.0]
    q = np.array([*np.cross(start, axis), 1 + start @ axis])
    return (q / np.linalg.norm(q)).tolist()


def _pose(at: Any = (0, 0, 0), q: Any = (0, 0, 0, 1)) -> dict[str, Any]:
    return {"position": _xyz(at), "orientation": _xyzw(q)}


def _arrow(axis: Any, length: float, color: Sequence[float], at: Any = (0, 0, 0),
           width: float = 0.012) -> dict[str, Any]:
    return {"pose": _pose(at, _turn([1, 0, 0], axis)), "shaft_length": 0.88 * length, "head_length": 0.12 * length,
            "shaft_diameter": 2 * width * length, "head_diameter": 6 * width * length, "color": _rgba(color)}


def _cylinder(axis: Any, at: Any, radius: float, length: float, color: Sequence[float], alpha: float = 1.0,
              bottom: float = 1.0, top: float = 1.0) -> dict[str, Any]:
    return {"pose": _pose(at, _turn([0, 0, 1], axis)), "size": _xyz([2 * radius, 2 * radius, length]),
            "bottom_scale": bottom, "top_scale": top, "color": _rgba(color, alpha)}


def _panel(part: Part) -> tuple[list[float], list[float]]:
    """(pose relative to its hinge or the body, edges with its thickness)"""
    import numpy as np

    from fledge.attitude import dcm_to_quaternion

    normal, at = np.array(part.axis_B, dtype=float), np.array(part.at_B, dtype=float)
    out = at - normal * (at @ normal)
    if np.linalg.norm(out) < 1e-6:
        out = np.eye(3)[np.argmin(np.abs(normal))]
        out = out - normal * (out @ normal)
    out /= np.linalg.norm(out)
    beta = dcm_to_quaternion(np.array([out, np.cross(normal, out), normal]))
    return [*beta[1:], beta[0]], [*part.size, 0.02 * min(part.size)]


def _primitives(part: Part, extent: float) -> dict[str, list]:
    """The primitives of a part, at rest, in its frame."""
    import numpy as np

    at, axis = np.array(part.at_B, dtype=float), np.array(part.axis_B, dtype=float)
    if part.kind == "box":
        return {"cubes": [{"pose": _pose(at), "size": _xyz(part.size), "color": _rgba((0.86, 0.7, 0.36))}]}
    if part.kind == "panel":
        q, size = _panel(part)
        centre = at - np.array(part.hinge_B) if part.hinge_B is not None else at
        return {"cubes": [{"pose": _pose(centre, q), "size": _xyz(size), "color": _rgba((0.12, 0.22, 0.5))}]}
    if part.kind == "wheel":
        place = at if at.any() else 0.27 * extent * axis
        return {"cylinders": [_cylinder(axis, place, 0.14 * extent, 0.04 * extent, (0.56, 0.64, 0.72))]}
    if part.kind == "rod":
        return {"cylinders": [_cylinder(axis, at, 0.018 * extent, 0.7 * extent, (0.7, 0.74, 0.78))]}
    if part.kind == "thruster":
        long = 0.06 * extent
        return {"cylinders": [_cylinder(-axis, at - axis * long / 2, 0.7 * long, long, (0.36, 0.38, 0.41), 1, 0.4, 1)]}
    if part.kind == "cone":
        color = (1.0, 0.35, 0.3) if part.keep_out else (0.31, 0.7, 1.0)
        radius = part.length * np.tan(part.half_angle)
        return {"cylinders": [_cylinder(axis, at + axis * part.length / 2, radius, part.length, color, 0.2, 0, 1)]}
    kind = "model/gltf-binary" if part.name.lower().endswith(".glb") else "model/obj"
    return {"models": [{"pose": _pose(at), "scale": _xyz(3 * [part.scale]), "color": _rgba((1, 1, 1)),
                        "media_type": kind, "data": part.data}]}


# --- the messages of a scene -----------------------------------------------------------------------

def messages(scene: Scene) -> Iterator[tuple[float, str, dict[str, Any]]]:
    """(time [s], topic, message) of a scene, in the order of time."""
    import numpy as np

    first = scene.crafts[0]
    times = first.turning.time[:: -(-len(first.turning.time) // MOST)]
    yield float(times[0]), "/scene/entities", {"entities": list(_standing(scene, float(times[0])))}
    frames = list(_frames(scene, times))
    plumes = [(craft, part, part.level.at(times)[:, 0] / (part.full or 1)) for craft in scene.crafts
              for part in craft.parts if part.kind == "thruster" and part.level is not None]
    burning = np.zeros(len(plumes), bool)
    poses = [(craft, pose, pose.turning.age(times) > 0) for craft in scene.crafts for pose in craft.poses]
    for i, t in enumerate(times.tolist()):
        stamp = _time(t)
        yield t, "/scene/transforms", {"transforms": [
            {"timestamp": stamp, "parent_frame_id": parent, "child_frame_id": child,
             "translation": _xyz(r[i]), "rotation": _xyzw(q[i])} for parent, child, r, q in frames
            if np.isfinite(r[i]).all() and np.isfinite(q[i]).all()]}
        if changed := [_pose_axes(craft, pose, stale[i], stamp) for craft, pose, stale in poses
                       if stale[i] != (i > 0 and stale[i - 1])]:
            yield t, "/scene/entities", {"entities": changed}
        now = np.array([share[i] > 0.002 for *_, share in plumes], bool)
        if now.any() or burning.any():
            yield t, "/scene/entities", _plumes(plumes, now, burning, i, stamp)
        burning = now


def _frames(scene: Scene, times: NDArray[Any]) -> Iterator[tuple[str, str, NDArray[Any], NDArray[Any]]]:
    """(parent, child, translations (n, 3), rotations (n, 4)) of all frames."""
    import numpy as np

    still, level = np.zeros((len(times), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1))
    origin = scene.crafts[0].motion.at(times)
    yield "inertial", "N", -origin, level
    for planet in scene.planets:
        yield ("N", planet.name, still if planet.motion is None else planet.motion.at(times),
               level if planet.turning is None else planet.turning.at(times))
    for craft in scene.crafts:
        here = craft.motion.at(times)
        yield "inertial", craft.name, here - origin, craft.turning.at(times)
        for pose in craft.poses:
            place = here if pose.motion is None else pose.motion.at(times)
            yield "inertial", f"{craft.name}/{pose.kind} {pose.name}", place - origin, pose.turning.at(times)
        for part in craft.parts:
            if part.hinge_B is not None:
                angle = part.level.at(times) if part.level is not None else np.zeros((len(times), 1))
                yield (craft.name, f"{craft.name}/{part.name}", np.tile(part.hinge_B, (len(times), 1)), np.hstack(
                    [np.sin(angle / 2) * np.array(part.hinge_axis_B), np.cos(angle / 2)]))
        for name, ways in _ways(scene, craft, times):
            q = np.array([_turn([1, 0, 0], way) for way in ways])
            yield "inertial", f"{craft.name}/{name}", here - origin, q


def _ways(scene: Scene, craft: Craft, times: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """(name, unit vectors in N (n, 3)) of the directions at a spacecraft."""
    import numpy as np

    here, directions = craft.motion.at(times), {}
    if scene.sun is not None:
        directions["to the Sun"] = scene.sun.at(times) - here
    elif scene.sun_N is not None:
        directions["to the Sun"] = np.tile(scene.sun_N, (len(times), 1))
    if scene.planets:
        nearest = min(scene.planets, key=lambda planet: np.linalg.norm(
            here[0] - (planet.motion.at(times[:1])[0] if planet.motion else 0)) / planet.radius)
        directions["nadir"] = (nearest.motion.at(times) if nearest.motion else 0) - here
    if craft.motion.v.any():
        directions["velocity"] = craft.motion.v[np.searchsorted(
            craft.motion.time, times).clip(max=len(craft.motion.time) - 1)]
    for name, ways in directions.items():
        size = np.linalg.norm(ways, axis=1, keepdims=True)
        yield name, np.where(size > 0, ways / np.where(size > 0, size, 1), [1.0, 0.0, 0.0])


def _standing(scene: Scene, begin: float) -> Iterator[dict[str, Any]]:
    """The entities that follow their frames from the beginning to the end."""
    import numpy as np

    def entity(frame: str, id_: str, **primitives: Any) -> dict[str, Any]:
        return {"timestamp": _time(begin), "frame_id": frame, "id": id_, "frame_locked": True, **primitives}

    for planet in scene.planets:
        yield entity(planet.name, planet.name, spheres=[
            {"pose": _pose(), "size": _xyz(3 * [2 * planet.radius]),
             "color": _rgba(PLANETS.get(planet.name, (0.6, 0.6, 0.6)))}])
    for craft in scene.crafts:
        size = craft.extent
        axes = [_arrow(axis, 1.9 * size, color) for axis, color in zip(np.eye(3), ((1, .36, .36), (.37, .82, .41),
                                                                                   (.36, .61, 1)))]
        yield entity(craft.name, f"{craft.name}/axes", arrows=axes, texts=[
            {"pose": _pose((0, 0, 1.4 * size)), "billboard": True, "font_size": 14.0, "scale_invariant": True,
             "color": _rgba((1, 1, 1)), "text": craft.label}])
        for k, part in enumerate(craft.parts):
            frame = craft.name if part.hinge_B is None else f"{craft.name}/{part.name}"
            yield entity(frame, f"{craft.name}/{k} {part.name}", **_primitives(part, size))
        yield from (_pose_axes(craft, pose, False, _time(begin)) for pose in craft.poses)
        colors = {"to the Sun": (1, .83, .3), "nadir": (1, .44, .68), "velocity": (.7, .9, .4)}
        for name, _ in _ways(scene, craft, craft.turning.time[:1]):
            color = colors[name]
            yield entity(f"{craft.name}/{name}", f"{craft.name}/{name}",
                         arrows=[_arrow([1, 0, 0], 2.4 * size, color, width=0.007)])
        way = craft.motion.at(np.linspace(scene.begin, scene.end, 1000))
        yield entity("N", f"{craft.name}/way", lines=[
            {"pose": _pose(), "thickness": 1.5, "scale_invariant": True, "points": [_xyz(r) for r in way],
             "color": _rgba((0.35, 0.72, 1.0), 0.7)}])


def _pose_axes(craft: Craft, pose: Pose, stale: bool, stamp: dict[str, int]) -> dict[str, Any]:
    """The entity of another attitude of a spacecraft: grey where it is stale."""
    import numpy as np

    color = (.54, .58, .62) if stale else (1.0, 0.69, 0.18) if pose.kind == "estimate" else (0.7, 0.55, 1.0)
    frame = f"{craft.name}/{pose.kind} {pose.name}"
    return {"timestamp": stamp, "frame_id": frame, "id": frame, "frame_locked": True,
            "arrows": [_arrow(axis, 2.1 * craft.extent, color, width=0.006) for axis in np.eye(3)]}


def _plumes(plumes: list[tuple[Craft, Part, NDArray[Any]]], now: NDArray[Any], burning: NDArray[Any], i: int,
            stamp: dict[str, int]) -> dict[str, list]:
    """The update of the plumes at a sample: burning ones are entities, ended ones deletions."""
    import numpy as np

    update: dict[str, list] = {"deletions": [], "entities": []}
    for (craft, part, share), burns, burnt in zip(plumes, now, burning):
        name = f"{craft.name}/{part.name}, plume"
        if burns:
            axis, length = np.array(part.axis_B), 0.6 * craft.extent * float(share[i])
            update["entities"].append({
                "timestamp": stamp, "frame_id": craft.name, "id": name, "frame_locked": True, "cylinders": [_cylinder(
                    -axis, np.array(part.at_B) - axis * length / 2, 0.12 * length, length, (.5, .75, 1), .6, 0.4, 1)]})
        elif burnt:
            update["deletions"].append({"timestamp": stamp, "type": 0, "id": name})
    return update


# --- the file --------------------------------------------------------------------------------------

def write(scene: Scene, record: str | PathLike[str], path: str | PathLike[str]) -> Path:
    """Write a record with its scene. Returns the path of the file.

    Raises SetupError if the record is damaged, or has a scene already.
    """
    with Archive(record) as archive:
        if archive.problem:
            raise SetupError(archive.problem)
        if TOPICS.keys() & archive.topics.keys():
            raise SetupError(f"{record}: it has a scene already")
    topics = {topic: (name.replace("/", "/msg/"), definition(name)) for topic, name in TOPICS.items()}
    with PartFile(path) as part, open(part, "wb") as out:
        append(Path(record).read_bytes(), topics, ((round(t * 1e9), topic, encoded(TOPICS[topic], message))
                                                   for t, topic, message in messages(scene)), out)
    return Path(path)
