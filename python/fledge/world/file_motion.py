# SPDX-License-Identifier: Apache-2.0
"""Where a spacecraft is and how it stands over time, in N of a sky, by files of others.

    file_motion.of_file("precise.oem", sky).at(times)
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fledge import files
from fledge.attitude import dcm_to_quaternion, quaternion_product
from fledge.errors import SetupError, listed
from fledge.files import mean_elements, spk
from fledge.files.ephemeris import AemSegment, OemSegment, R, Tabulated, V
from fledge.files.mean_elements import MeanElements
from fledge.files.sections import Message, Section, Segment
from fledge.world import reference_frames
from fledge.world.bodies import BODIES
from fledge.world.sky import Sky

if TYPE_CHECKING:
    import os

EVER = 2**62        # [ns]


@dataclass
class Motion:
    """A spacecraft at instants, in N.

    times: (n,) [ns] of the run; r_N [m], v_N [m/s] (n, 3); beta_BN (n, 4) quaternions of B relative to N, scalar first;
    omega_BN_B [rad/s] (n, 3). None where it is not known; NaN at instants of which a file says nothing.
    """
    name: str
    sky: Sky
    times: np.ndarray
    r_N: np.ndarray | None = None
    v_N: np.ndarray | None = None
    beta_BN: np.ndarray | None = None
    omega_BN_B: np.ndarray | None = None

    @property
    def epochs(self) -> np.ndarray:
        """[ns] (n,) of TDB past J2000."""
        return self.times - zero(self.sky)


def zero(sky: Sky) -> int:
    """[ns] The time of the run at 2000-01-01T12:00:00 TDB."""
    return sky.time_ns_of("2000-01-01T12:00:00 TDB")


@dataclass
class Part:
    """A span of a file [ns of the run], and what gives (r_N, v_N) or beta_BN at times within it.

    knots: what gives the lines of the file in N: (degree, times, r_N, v_N), where v_N is empty if a polynomial goes
    through the positions alone; or (times, beta_BN, their rates [1/s], or empty).
    """
    begin: int
    end: int
    at: Callable[[np.ndarray], Any]
    knots: Callable[[], tuple[Any, ...]] | None = None


@dataclass
class FileMotion:
    """The motion by a file: its orbits and attitudes, each of a span. center: about which the orbits are."""
    name: str
    sky: Sky
    orbits: list[Part] = field(default_factory=list)
    attitudes: list[Part] = field(default_factory=list)
    center: int = 399

    def at(self, times: np.ndarray) -> Motion:
        """The motion at times of the run [ns] (n,)."""
        found = Motion(self.name, self.sky, times)
        if self.orbits:
            found.r_N, found.v_N = (np.full((len(times), 3), np.nan) for _ in range(2))
        for part in self.orbits:
            inside = (times >= part.begin) & (times <= part.end)
            if inside.any() and found.r_N is not None and found.v_N is not None:
                found.r_N[inside], found.v_N[inside] = part.at(times[inside])
        if self.attitudes:
            found.beta_BN = np.full((len(times), 4), np.nan)
        for part in self.attitudes:
            inside = (times >= part.begin) & (times <= part.end)
            if inside.any() and found.beta_BN is not None:
                found.beta_BN[inside] = part.at(times[inside])
        return found

    @property
    def span(self) -> tuple[int, int]:
        """[ns] of the run: from when to when the file says anything."""
        parts = self.orbits + self.attitudes
        return min(part.begin for part in parts), max(part.end for part in parts)


def of_file(source: str | os.PathLike[str], sky: Sky) -> FileMotion:
    """The motion by a file: OEM, AEM, OPM, OMM, STK's .e and .a, SPICE's .bsp or two-line elements. Raises SetupError
    for a file of another kind, and for frames that are not known."""
    if spk.is_kernel(source):
        return _of_spk(source, sky)
    found = files.read(source)
    if getattr(found, "kind", "") == "OMM":
        found = mean_elements.read(source)
    if isinstance(found, MeanElements):
        return FileMotion(found.title, sky, [_of_elements(found, sky)])
    if not isinstance(found, Message) or found.kind not in ("OEM", "AEM", "OPM"):
        kind = getattr(found, "kind", type(found).__name__)
        raise SetupError(f"{source}: expected an OEM, AEM, OPM, OMM or two-line elements; found {kind}")
    first = found.segments[0].meta
    motion = FileMotion(str(first["OBJECT_NAME"]), sky)
    if found.kind == "OPM":
        motion.orbits.append(_of_opm(found.segment, sky))
        motion.center = _body(first)
    tables = [segment for segment in found.segments if isinstance(segment, Tabulated)]
    for before, after in zip(tables, tables[1:]):
        if after.span[0] < before.span[1]:
            begin, end = (after.clock.text(t) for t in (after.span[0], before.span[1]))
            after.meta.refuse(f"expected a segment from {end} on, until when that before it may be used; found it from "
                              f"{begin} on: write segments of the same time into files of their own")
    for segment in found.segments:
        if isinstance(segment, OemSegment):
            motion.orbits.append(_of_oem(segment, sky))
            motion.center = _body(segment.meta)
        elif isinstance(segment, AemSegment):
            motion.attitudes.append(_of_aem(segment, sky))
    return motion


def _body(meta: Section) -> int:
    """The NAIF number of the center of a segment."""
    name = str(meta["CENTER_NAME"]).upper()
    center = BODIES.get(name)
    if center is None or center.naif is None:
        meta.refuse(f"CENTER_NAME: expected {listed(list(BODIES))}; found {name}")
    return center.naif


def _place(section: Section) -> str:
    return f"{section.where}, line {section.line}"


def _shift(segment: Segment, sky: Sky) -> int:
    """[ns] What turns times of a segment into those of the run."""
    if not segment.clock.absolute:
        segment.meta.refuse(f"TIME_SYSTEM: expected UTC, TAI, TT, TDB or GPS, whose times are instants; found "
                            f"{segment.clock.scale}")
    return zero(sky)


def _of_opm(segment: Segment, sky: Sky) -> Part:
    """The state at its epoch alone."""
    state, frame, center = segment["STATE"], str(segment.meta["REF_FRAME"]), _body(segment.meta)
    r, v = (np.array([[state[name] for name in names]], float) for names in (R, V))
    t = int(state["EPOCH"]) + _shift(segment, sky)
    found = reference_frames.to_N(sky, frame, center, np.array([t]), r, v, _place(segment.meta))
    return Part(t, t, lambda times: found)


def _of_spk(path: str | os.PathLike[str], sky: Sky) -> FileMotion:
    """A kernel's only target that is a spacecraft, a comet or an asteroid: no planet or moon has such a number."""
    segments = [segment for segment in spk.read(path) if not 0 <= segment.target < 1_000_000]
    targets = sorted({segment.target for segment in segments})
    if len(targets) != 1:
        raise SetupError(f"{path}: expected the orbit of a single spacecraft, comet or asteroid; found "
                         f"{listed([str(target) for target in targets]) or 'none'}")

    def part(segment: spk.SpkSegment) -> Part:
        shift, lines = zero(sky), segment.times

        def at(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return reference_frames.to_N(sky, "J2000", segment.center, times, *segment.at(times - shift), str(path))

        knots = None if lines is None else lambda: (segment.degree, lines + shift, *at(lines + shift))
        return Part(segment.begin + shift, segment.end + shift, at, knots)

    return FileMotion(segments[0].name, sky, [part(segment) for segment in segments], center=segments[0].center)


def _of_oem(segment: OemSegment, sky: Sky) -> Part:
    shift, frame, center = _shift(segment, sky), str(segment.meta["REF_FRAME"]), _body(segment.meta)

    def at(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return reference_frames.to_N(sky, frame, center, times, *segment.at(times - shift), _place(segment.meta))

    def knots() -> tuple[Any, ...]:
        times, (method, degree) = segment.times + shift, segment.interpolation
        r, v = reference_frames.to_N(sky, frame, center, times, segment.r, segment.v, _place(segment.meta))
        return degree, times, r, v[:0] if method == "LINEAR" else v

    begin, end = (t + shift for t in segment.span)
    reference_frames.turning(sky, frame, np.array([begin]), _place(segment.meta))
    return Part(begin, end, at, knots)


def _of_aem(segment: AemSegment, sky: Sky) -> Part:
    """Of a body relative to a known frame, or the reverse."""
    shift = _shift(segment, sky)
    frames = [str(segment.meta[key]) for key in ("REF_FRAME_A", "REF_FRAME_B")]
    known = [frame for frame in frames if reference_frames.is_known(frame)]
    if not known:
        segment.meta.refuse(f"REF_FRAME_A, REF_FRAME_B: expected a frame of {reference_frames.KNOWN} and that of the "
                            f"body; found {' and '.join(frames)}")
    body_is_b = known[0] == frames[0]

    def in_N(times: np.ndarray, beta: np.ndarray) -> np.ndarray:
        """Of quaternions of the file; of their rates where the frame does not turn."""
        dcm_FN, _ = reference_frames.turning(sky, known[0], times, _place(segment.meta))
        return quaternion_product(beta if body_is_b else beta * [1, -1, -1, -1], dcm_to_quaternion(dcm_FN))

    def at(times: np.ndarray) -> np.ndarray:
        return in_N(times, segment.at(times - shift))

    def knots() -> tuple[Any, ...]:
        times, beta_BA = segment.times + shift, segment.beta_BA
        beta, rates = in_N(times, beta_BA), segment.rates(beta_BA)
        sides = np.cumprod(np.concatenate([[1.0], np.where(np.sum(beta[1:] * beta[:-1], axis=1) < 0, -1.0, 1.0)]))
        if rates is None or not reference_frames.is_inertial(known[0]):
            return times, beta * sides[:, None], beta[:0]
        return times, beta * sides[:, None], in_N(times, rates) * sides[:, None]

    begin, end = (t + shift for t in segment.span)
    return Part(begin, end, at, knots)


def by_sgp4(elements: dict[str, Any], sky: Sky, t: Any) -> tuple[list[float], list[float]]:
    """Position [m] and velocity [m/s] relative to the Earth, in axes of N, where SGP4 puts mean elements, the
    parameters of fsw.OrbitOnBoard, at a time of the run. Raises SetupError where it gives none."""
    from fledge import flight

    sgp4 = flight.OrbitOnBoard(**elements)
    sgp4.time.head.quality, sgp4.time.time = "GOOD", sky.utc_ns(t)
    sgp4.update(t=0)
    if not int(sgp4.orbit.head.quality):
        raise SetupError(f"SGP4 gives no position from these elements at {sky.utc(t)}: {sgp4.state.code.name}")
    return [float(x) for x in sgp4.orbit.r_BN_N], [float(x) for x in sgp4.orbit.v_BN_N]


def _of_elements(elements: MeanElements, sky: Sky) -> Part:
    def at(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        states = np.array([by_sgp4(elements.parameters(), sky, int(t) / 1e9) for t in times])
        about = reference_frames.origins(sky, 399, times)
        return states[:, 0] + about[:, 0], states[:, 1] + about[:, 1]

    return Part(-EVER, EVER, at)
