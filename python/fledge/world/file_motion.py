# SPDX-License-Identifier: Apache-2.0
"""Where a spacecraft is and how it stands over time, in N of a sky, by files of others.

    file_motion.of_file("precise.oem", sky).at(times)
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Any

import numpy as np

from fledge import files
from fledge.attitude import dcm_to_quaternion, quaternion_product, quaternion_rate
from fledge.errors import SetupError, listed
from fledge.files import mean_elements, spk
from fledge.files.ephemeris import AemSegment, OemSegment, R, V, interpolate
from fledge.files.mean_elements import MeanElements
from fledge.files.sections import Message, Section, Segment
from fledge.world import reference_frames
from fledge.world.bodies import BODIES
from fledge.world.sky import Sky

if TYPE_CHECKING:
    import os

EVER = 2**61        # [ns]
LEAST = 10**7       # [ns] between knots
MOST = 200_000      # knots between the lines of a file
WITHIN = 1e-3, 1e-9     # [m], and of quaternions: how near a polynomial through knots is to the file
CLOCK = 2e-7        # [s] to which a kernel of SPICE has its times


States = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]     # of times [ns] (n,)


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
    """A span of a file [ns of the run], and what it says at times within it.

    at: gives (r_N, v_N), or (beta_BN, its rate [1/s]). What moves has more, for who goes along it by polynomials:
    curve: gives (r_N, its rate [m/s]), or what `at` does; lines: [ns] (n,) of the file; degree: of the polynomial
    through lines; kinks: whether the rate leaps at them. turns: B turns about an axis that stands from line to line.
    """
    begin: int
    end: int
    at: States
    curve: States | None = None
    lines: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    degree: int = 7
    kinks: bool = False
    turns: bool = False


Span = tuple[int, int, Part]


def spans(parts: list[Part]) -> list[Span]:
    """From when to when [ns] which part counts, in the order of time: of several the last of the file."""
    waiting = sorted((part.begin, i) for i, part in enumerate(parts))[::-1]
    edges = sorted({part.begin for part in parts} | {part.end + 1 for part in parts})
    found: list[Span] = []
    begun: list[int] = []
    for begin, end in zip(edges, edges[1:]):
        while waiting and waiting[-1][0] <= begin:
            heappush(begun, -waiting.pop()[1])
        while begun and parts[-begun[0]].end < begin:
            heappop(begun)
        if begun and found and found[-1][2] is parts[-begun[0]] and found[-1][1] == begin - 1:
            found[-1] = (found[-1][0], end - 1, found[-1][2])
        elif begun:
            found.append((begin, end - 1, parts[-begun[0]]))
    return found


def knots(begin: int, end: int, part: Part, where: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [ns] (n,), positions or quaternions in N, and their rates, or none, such that polynomials through them are
    where the part is from begin to end, within WITHIN: its lines, and as many between them as that needs. The
    polynomials are those of EphemerisCraft: of part.degree, through the nearest knots on both sides; without rates an
    attitude turns about an axis that stands. Raises SetupError, which begins with `where`, if that takes more than
    MOST."""
    assert part.curve
    lines = part.lines[(part.lines > begin + LEAST) & (part.lines < end - LEAST)]
    times = np.unique(np.concatenate([[begin, end], lines]))
    y, rates = part.curve(times)
    if part.kinks:          # a line is two knots at one time: as it is come to, and as it is left
        come, rate = part.curve(lines - 1)
        at = np.searchsorted(times, lines)
        times, y, rates = (np.insert(x, at, more, axis=0) for x, more in zip((times, y, rates),
                                                                             (lines, come + rate * 1e-9, rate)))
    attitude = y.shape[1] == 4
    left, right = times[:-1], times[1:]
    while True:
        if attitude:        # a quaternion on the side of that before it
            sides = np.cumprod(np.where(np.sum(y[1:] * y[:-1], axis=1, keepdims=True) < 0, -1.0, 1.0), axis=0)
            y[1:], rates[1:] = y[1:] * sides, rates[1:] * sides
        if part.turns:
            return times, y, rates[:0]
        wide = right - left > LEAST
        left, right = left[wide], right[wide]
        if not len(left):
            return times, y, rates
        probes = np.concatenate([left + (right - left) // 10 * share for share in (3, 6)])
        (truth, speed), (found, _) = part.curve(probes), interpolate(times, y, probes, part.degree, rates)
        if attitude:
            found = found / np.linalg.norm(found, axis=1, keepdims=True)
            truth = truth * np.where(np.sum(truth * found, axis=1, keepdims=True) < 0, -1, 1)
        margin = WITHIN[attitude] + CLOCK * np.linalg.norm(speed, axis=1) * (not attitude)
        far = (np.linalg.norm(found - truth, axis=1) > margin).reshape(2, -1).any(axis=0)
        left, right = left[far], right[far]
        middle = left + (right - left) // 2
        if len(times) + len(middle) > MOST + 2 * len(lines):
            raise SetupError(f"{where}: {MOST} instants between its lines are too few for its motion: expected "
                             "velocities that are the rates of positions, and a span not much longer than the run")
        at = np.searchsorted(times, middle)
        times, y, rates = (np.insert(x, at, more, axis=0) for x, more in zip((times, y, rates),
                                                                             (middle, *part.curve(middle))))
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])


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
            found.r_N, found.v_N = _at(spans(self.orbits), times, 3)
        if self.attitudes:
            found.beta_BN, _ = _at(spans(self.attitudes), times, 4)
        return found

    def followed(self, parts: list[Part], where: str) -> list[tuple[Any, ...]]:
        """Of the orbits or the attitudes, what an EphemerisCraft takes: (begin, end, degree, times, r_N, v_N) of each
        span, or (begin, end, times, beta_BN, rates). A span that joins another begins with its last instant, which
        remains that of the other."""
        rows: list[tuple[Any, ...]] = []
        for begin, end, part in spans(parts):
            row = (*([part.degree] if parts is self.orbits else []), *knots(begin, end, part, where))
            rows.append((rows[-1][1] if rows and rows[-1][1] == begin - 1 else begin, end, *row))
        return rows

    @property
    def span(self) -> tuple[int, int]:
        """[ns] of the run: from when to when the file says anything."""
        parts = self.orbits + self.attitudes
        return min(part.begin for part in parts), max(part.end for part in parts)


def _at(found: list[Span], times: np.ndarray, width: int) -> np.ndarray:
    """(2, n, width) What the parts say at times; NaN where they say nothing."""
    begins, ends = (np.array([span[i] for span in found]) for i in (0, 1))
    which = np.searchsorted(begins, times, side="right") - 1
    which[times > ends[which]] = -1
    values = np.full((2, len(times), width), np.nan)
    for i in np.unique(which[which >= 0]):
        values[:, which == i] = found[i][2].at(times[which == i])
    return values


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

    shift = zero(sky)

    def part(segment: spk.SpkSegment) -> Part:
        at, curve = (_in_N(sky, "J2000", segment.center, states, str(path)) for states in (segment.at, segment.curve))
        begin, end = (min(max(t + shift, -EVER), EVER) for t in (segment.begin, segment.end))
        return Part(begin, end, at, curve, segment.times + shift,
                    **_knots_of("LAGRANGE" if segment.type in spk.LAGRANGE else "HERMITE", segment.degree))

    return FileMotion(segments[0].name, sky, [part(segment) for segment in segments], center=segments[0].center)


def _in_N(sky: Sky, frame: str, center: int, states: States, where: str) -> States:
    """Of states in a frame, at times of the file."""
    shift = zero(sky)
    return lambda times: reference_frames.to_N(sky, frame, center, times, *states(times - shift), where)


def _knots_of(method: str, degree: int) -> dict[str, Any]:
    """Of a Part, by the interpolation of a file: its degree where polynomials take as many lines on both sides, as
    those of knots() do."""
    if method == "LINEAR" or degree == 1:
        return {"degree": 3, "kinks": True}
    return {"degree": degree} if method == "HERMITE" and degree % 4 == 3 and degree < 32 else {}


def _of_oem(segment: OemSegment, sky: Sky) -> Part:
    shift, frame, center = _shift(segment, sky), str(segment.meta["REF_FRAME"]), _body(segment.meta)
    at, curve = (_in_N(sky, frame, center, states, _place(segment.meta)) for states in (segment.at, segment.curve))
    begin, end = (t + shift for t in segment.span)
    reference_frames.turning(sky, frame, np.array([begin]), _place(segment.meta))
    return Part(begin, end, at, curve, segment.times + shift, **_knots_of(*segment.interpolation))


def _of_aem(segment: AemSegment, sky: Sky) -> Part:
    """Of a body relative to a known frame, or the reverse."""
    shift = _shift(segment, sky)
    frames = [str(segment.meta[key]) for key in ("REF_FRAME_A", "REF_FRAME_B")]
    known = [frame for frame in frames if reference_frames.is_known(frame)]
    if not known:
        segment.meta.refuse(f"REF_FRAME_A, REF_FRAME_B: expected a frame of {reference_frames.KNOWN} and that of the "
                            f"body; found {' and '.join(frames)}")
    conjugate = np.array([1, 1, 1, 1] if known[0] == frames[0] else [1, -1, -1, -1])

    def at(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        beta_BF, rates = (conjugate * x for x in segment.curve(times - shift))
        dcm_FN, omega_FN_F = reference_frames.turning(sky, known[0], times, _place(segment.meta))
        beta_FN = dcm_to_quaternion(dcm_FN)
        return (quaternion_product(beta_BF, beta_FN), quaternion_product(rates, beta_FN)
                + quaternion_product(beta_BF, quaternion_rate(beta_FN, omega_FN_F)))

    begin, end = (t + shift for t in segment.span)
    method, _ = segment.interpolation
    turns = method == "LINEAR" and reference_frames.is_inertial(known[0])
    return Part(begin, end, at, at, segment.times + shift, 3, method != "HERMITE", turns)


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
        try:
            states = np.array([by_sgp4(elements.parameters(), sky, int(t) / 1e9) for t in times])
        except SetupError as error:
            raise SetupError(f"{elements.source}: {error}") from None
        about = reference_frames.origins(sky, 399, times)
        return states[:, 0] + about[:, 0], states[:, 1] + about[:, 1]

    return Part(-EVER, EVER, at)
