# SPDX-License-Identifier: Apache-2.0
"""Keplerian orbits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from os import PathLike
from typing import Any

from fledge import _core
from fledge.errors import SetupError, suggesting
from fledge.objects.plausible import check_orbit
from fledge.objects.si import time_ns, to_number, to_si, to_vector
from fledge.units import Quantity
from fledge.world.bodies import ANGLE, EARTH, LENGTH, NUMBER, SPEED, Body, body_of, dot
from fledge.world.sky import TIME, Sky


def _angle(value: Any, name: str) -> float:
    """An angle in rad: the inclination within pi; without a unit within one turn, as more is meant in degrees."""
    from math import isfinite, pi

    angle = to_number(value, f"Orbit: {name}", "rad", ANGLE)
    if not isfinite(angle):
        raise SetupError(f"Orbit: {name} must be finite; found {angle:g} rad")
    most, text = (pi, "pi") if name == "i" else (2 * pi, "2 pi, or have a unit")
    if abs(angle) > most * (1 + 1e-12) and (name == "i" or not isinstance(value, Quantity)):
        degrees = "" if isinstance(value, Quantity) else f": write {angle:g} * deg for degrees"
        raise SetupError(f"Orbit: {name} must be within {text}; found {angle:g} rad{degrees}")
    return angle


def _axes(frame: Any) -> list[list[float]]:
    """Three unit vectors at right angles, right-handed, as lists."""
    if callable(frame):
        raise SetupError(f"Orbit: frame: expected three axes; found a method: write {frame.__name__}(...)")
    rows = to_si(frame, "Orbit: frame", "-", NUMBER, "three rows, the frame's axes in N")
    if not isinstance(rows, list) or len(rows) != 3:
        raise SetupError(f"Orbit: frame: expected three rows, the frame's axes in N; found {frame!r}")
    a, b, c = rows = [to_vector(row, "Orbit: frame", "-", NUMBER) for row in rows]
    third = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    lengths = [sum(x * x for x in row) for row in rows]
    if not max(abs(x - y) for x, y in zip([*third, *lengths], [*c, 1, 1, 1])) < 1e-9:
        raise SetupError(f"Orbit: frame: the axes must be unit vectors at right angles, right-handed; found {rows}")
    return rows


# [d] of a revolution about the Sun relative to the stars, by the mean longitudes of JPL's approximate elements.
YEARS = {name: 36525 * 360 / rate for name, rate in (
    ("MERCURY", 149472.67411175), ("VENUS", 58517.81538729), ("EARTH", 35999.37244981), ("MARS", 19140.30268499),
    ("JUPITER", 3034.74612775), ("SATURN", 1222.49362201), ("URANUS", 428.48202785), ("NEPTUNE", 218.45945325))}


def _osculating(n: float, a: float, k: float, i: float, u: float) -> tuple[list[float], list[float]]:
    """Position and velocity, about an ascending node at [1, 0, 0], of a mean circular orbit at the argument of latitude
    u. n: mean motion, k = J2 (R / a)^2 / 2, which makes it oblate."""
    from math import cos, sin

    c = cos(i)
    s2, c2 = sin(2 * u), cos(2 * u)
    r = a * (1 - 1.5 * k * (3 * c * c - 1) + 0.5 * k * (1 - c * c) * c2)
    rate = -a * n * k * (1 - c * c) * s2
    along = a * n * (1 + k * ((1 - c * c) * c2 - 1.5 * (1 - 3 * c * c)))
    u, node, i = u - k * (7 * c * c - 1) / 4 * s2, 1.5 * k * c * s2, i + 1.5 * k * c * sin(i) * c2

    def turned(x: float, y: float) -> list[float]:
        """x along the position in the plane, y across."""
        p, q = x * cos(u) - y * sin(u), x * sin(u) + y * cos(u)
        return [p * cos(node) - q * cos(i) * sin(node), p * sin(node) + q * cos(i) * cos(node), q * sin(i)]

    return turned(r, 0.0), turned(rate, along)


def _local_time(sky: Sky, t: Any, direction: Sequence[float], body: Body, apparent: bool) -> float:
    """[s] The local time of the meridian of a direction in N, by its right ascension about the body's true equator
    relative to that of the Sun."""
    from math import atan2, pi, radians

    def ascension(d: Iterable[float]) -> float:
        x, y, _ = axes @ list(d)
        return atan2(y, x)

    earth = body.naif == EARTH.naif
    axes = sky.true_of_date(t) if earth else sky.equator(body, t)
    if apparent:
        sun = ascension(sky.state("SUN", t, body).r_PN_N)
    elif earth:     # that of the mean Sun, as sidereal time has it
        sun = radians(280.46061837 + 0.98564736629 * sky.utc_ns(t) / 86400e9)
    else:
        raise SetupError(f"mean local time is the Earth's, found {body.name}: write apparent=True for that of the Sun")
    return (43200 + 43200 / pi * (ascension(direction) - sun)) % 86400


def _node_at(sky: Sky, t: Any, local: float, body: Body, apparent: bool, frame: Sequence[Sequence[float]]) -> float:
    """[rad] Right ascension, about the axes of a frame, of the node whose local time is `local` [s]."""
    from math import pi

    return (local - _local_time(sky, t, frame[0], body, apparent)) * pi / 43200 % (2 * pi)


@suggesting(inc="i", incl="i", inclination="i", raan="Omega", RAAN="Omega", LAN="Omega", node="Omega", argp="omega",
            aop="omega", nu="f", true_anomaly="f", sma="a", ecc="e", height="altitude", radius="a")
class Orbit:
    """A Keplerian orbit of any shape, by classical elements.

        Orbit(world.MARS, a=7471.618 * km, e=0.4, f=270 * deg)
        Orbit(world.EARTH, altitude=500 * km, i=97.4 * deg)

    One of these gives the size and shape:
        a and e            semi-major axis (negative for a hyperbola), eccentricity (default 0)
        p and e            semi-latus rectum, which every conic has
        rp and ra          radii of periapsis and apoapsis
        rp and e           radius of periapsis, and eccentricity >= 0
        altitude           above the equatorial radius, of a circular orbit
    i, Omega, omega, f: inclination, right ascension of the ascending node, argument of periapsis and
    true anomaly [rad], about the axes of N; default 0.
    frame: other axes for them, as three rows in N: sky.true_of_date() of the Earth, sky.equator(body) of any body
    at a date, body.equator() of J2000.

    r_BN_N [m] and v_BN_N [m/s] hold the state, the body's own position and velocity included. Near a parabola rp and e
    lose no digits; a, or ra, of e = 1 - d is as exact as a double holds d: within 1e-16 / d of itself.
    Raises SetupError on elements that describe no orbit, on a position inside the body, on an ellipse that enters
    the body (`body.with_surface(0)` allows both), on an inclination beyond pi, and on another angle beyond 2 pi
    without a unit. A hyperbola or parabola may lead into the body: then the run ends there.
    """

    def __init__(self, body: Body | str, *, a: Any = None, e: Any = None, p: Any = None, rp: Any = None,
                 ra: Any = None, altitude: Any = None, i: Any = 0.0, Omega: Any = 0.0, omega: Any = 0.0,
                 f: Any = 0.0, frame: Any = None) -> None:
        self.frame = None if frame is None else _axes(frame)
        self.body = body_of(body, "Orbit")
        given = {k: v for k, v in (("a", a), ("p", p), ("rp", rp), ("ra", ra), ("altitude", altitude))
                 if v is not None}
        sizes = {k: to_number(v, f"Orbit: {k}", "m", LENGTH) for k, v in given.items()}
        for name, value in sizes.items():
            if name != "a" and name != "altitude" and not value > 0:
                raise SetupError(f"Orbit: {name} must be > 0, found {value:g} m")
        e_given = e is not None
        e = to_number(e, "Orbit: e", "-", NUMBER) if e_given else 0.0
        names, a = set(sizes), None
        if names == {"a"}:
            p, a = _core.semi_latus_rectum(sizes["a"], e), sizes["a"]
        elif names == {"p"}:
            p = sizes["p"]
        elif names == {"rp"} and e_given:
            p = sizes["rp"] * (1.0 + e)
        elif names == {"rp", "ra"} and not e_given:
            rp, ra = sizes["rp"], sizes["ra"]
            if rp > ra:
                raise SetupError(f"Orbit: the radius of periapsis, {rp:g} m, is above that of apoapsis, {ra:g} m")
            e = (ra - rp) / (ra + rp)
            p, a = rp * (1.0 + e), (rp + ra) / 2.0
        elif names == {"altitude"} and not e_given:
            p = self.body.radius + sizes["altitude"]
        else:
            given_names = ", ".join([*sizes] + ["e"] * e_given) or "none"
            raise SetupError(f"Orbit: expected a and e, p and e, rp and ra, rp and e, or altitude; found {given_names}")
        self.p, self.e = p, e
        self._a = a if a is not None else p / ((1.0 - e) * (1.0 + e)) if e != 1.0 else float("inf")
        self.i, self.Omega, self.omega, self.f = (
            _angle(x, name) for name, x in (("i", i), ("Omega", Omega), ("omega", omega), ("f", f)))
        self.require_outside("Orbit")
        check_orbit(self)
        r, v = _core.orbit_state(self.body.mu, p, e, self.i, self.Omega, self.omega, self.f)
        if self.frame is not None:
            r, v = ([dot(a, column) for column in zip(*self.frame)] for a in (r, v))
        self.r_BN_N = [x + y for x, y in zip(r, self.body.r_PN_N)]
        self.v_BN_N = [x + y for x, y in zip(v, self.body.v_PN_N)]

    @classmethod
    def from_state(cls, body: Body | str, r: Any, v: Any, *, frame: Any = None) -> Orbit:
        """The orbit through a position [m] with a velocity [m/s], relative to the body; its elements in `frame`."""
        from math import dist, sqrt

        body = body_of(body, "Orbit.from_state")
        r = r_N = to_vector(r, "Orbit.from_state: r", "m", LENGTH)
        v = v_N = to_vector(v, "Orbit.from_state: v", "m/s", SPEED)
        if frame is not None:
            r, v = ([dot(axis, a) for axis in _axes(frame)] for a in (r, v))
        p, e, i, Omega, omega, f = _core.orbit_elements(body.mu, r, v)
        orbit = cls(body.with_surface(0), p=p, e=e, i=i, Omega=Omega, omega=omega, f=f, frame=frame)
        vars(orbit)["body"] = body
        alpha = 2.0 / sqrt(dot(r, r)) - dot(v, v) / body.mu
        if alpha * (1.0 - e) > 0.0:     # p and e of a far point near a parabola have fewer digits of it
            vars(orbit)["_a"] = 1.0 / alpha
        # Far out near a parabola, or near an asymptote, the elements have fewer digits than the state.
        for name, given, origin in (("r_BN_N", r_N, body.r_PN_N), ("v_BN_N", v_N, body.v_PN_N)):
            kept = [x + y for x, y in zip(given, origin)]
            if dist(kept, getattr(orbit, name)) > 1e-12 * sqrt(dot(given, given)):
                vars(orbit)[name] = kept
        return orbit

    @classmethod
    def from_elements(cls, sky: Sky, t: Any = 0, **elements: Any) -> Orbit:
        """The orbit about the Earth where SGP4 puts mean elements at a time of the run.

            w.craft.orbit = Orbit.from_elements(sky, **mean_elements.read("my_sat.tle").parameters())

        elements: parameters of fsw.OrbitOnBoard, so that flight and world begin alike. Raises SetupError where SGP4
        gives no position.
        """
        from fledge.world.file_motion import by_sgp4

        return cls.from_state(EARTH, *by_sgp4(elements, sky, t))

    @classmethod
    def from_file(cls, sky: Sky, source: str | PathLike[str], t: Any = 0, *, body: Body | str = EARTH) -> Orbit:
        """The orbit about a body at a time of the run, by a file of others: an OPM of that time, an OEM, an OMM or
        two-line elements.

            sky = world.Sky("2026-03-20T10:00:00", center=world.EARTH)
            w.craft.orbit = Orbit.from_file(sky, "craft.opm")

        Raises SetupError where the file says nothing of that time.
        """
        from numpy import array

        from fledge.world import file_motion

        ns = time_ns(t, "Orbit.from_file: t")
        motion = file_motion.of_file(source, sky)
        begin, end = motion.span
        if not motion.orbits or not begin - 1000 <= ns <= end + 1000:     # [ns] by which dates are rounded
            raise SetupError(f"{source}: " + (
                f"its orbit is of {sky.utc(begin / 1e9)} to {sky.utc(end / 1e9)}, and the time {ns / 1e9:g} s of the "
                f"run is {sky.utc(ns / 1e9)}: begin the sky within it" if motion.orbits else "has no orbit"))
        found = motion.at(array([min(max(ns, begin), end)]))
        assert found.r_N is not None and found.v_N is not None
        if found.r_N[0, 0] != found.r_N[0, 0]:
            raise SetupError(f"{source}: says nothing of the time {ns / 1e9:g} s of the run, {sky.utc(ns / 1e9)}: "
                             "it lies between its segments")
        about = sky.state(body, ns / 1e9)
        return cls.from_state(body, found.r_N[0] - about.r_PN_N, found.v_N[0] - about.v_PN_N)

    @classmethod
    def sun_synchronous(cls, sky: Sky, altitude: Any, *, ltan: Any, u: Any = 0.0, body: Body | str = EARTH,
                        apparent: bool = False) -> Orbit:
        """The circular orbit whose plane follows the Sun, through the year, by the body's J2; at time 0 of the sky.

            Orbit.sun_synchronous(sky, 500 * km, ltan=10.5 * hour)

        altitude: of the mean orbit, its semi-major axis over the equatorial radius. ltan: local time at which it passes
        the equator northwards; mean local time, or with `apparent` that of the true Sun, as local_time_of_node() has
        it. u: mean argument of latitude, the angle from the ascending node. The elements are the osculating ones, about
        the true equator of the body at time 0: mean ones with the terms of the first order in J2 of short period.

        Raises SetupError where no plane is fast enough: too high, or about a body whose J2 or year is not known.
        Source: Vallado, section 11.4.1; Spacetrack Report 3 for the short period.
        """
        from math import acos, cos, fmod, pi, sin, sqrt

        name = "Orbit.sun_synchronous"
        body = body_of(body, name)
        u, local = _angle(u, "u"), to_number(ltan, f"{name}: ltan", "s", TIME)
        a = body.radius + to_number(altitude, f"{name}: altitude", "m", LENGTH)
        if not a > (surface := body.radius if body.surface is None else body.surface):
            raise SetupError(f"{name}: the orbit must lie outside {body.name}, of radius {surface:.9g} m; found "
                             f"{a:.9g} m from its centre")
        J2 = body.zonal(2).J[0]
        if body.name not in YEARS or not J2 > 0:
            raise SetupError(f"{name}: expected a planet with a known J2, of {', '.join(YEARS)}; found {body.name}")
        n, k = sqrt(body.mu / a**3) if a < 1e100 else 0.0, J2 * (body.radius / a) ** 2 / 2     # a**3 has a bound
        turn = 2 * pi / (YEARS[body.name] * 86400)      # [rad/s]
        if not turn <= (fastest := 3 * n * k):
            raise SetupError(f"{name}: {(a - body.radius) / 1e3:g} km over {body.name} no plane turns fast enough to "
                             "follow the Sun")
        i = acos(-turn / fastest)
        frame = sky.true_of_date() if body.naif == EARTH.naif else sky.equator(body)
        r, v = _osculating(n, a, k, i, fmod(u, 2 * pi))
        node = _node_at(sky, 0, local, body, apparent, frame)
        x, y = cos(node), sin(node)
        r, v = ([float(dot(column, (x * b[0] - y * b[1], y * b[0] + x * b[1], b[2]))) for column in zip(*frame)]
                for b in (r, v))
        return cls.from_state(body, r, v, frame=frame)

    def local_time_of_node(self, sky: Sky, t: Any = 0, *, apparent: bool = False) -> float:
        """The local time at the ascending node at a time of the run [s of a day]: 37800 is half past ten.

        Mean local time, of the Earth, is UTC and 240 s for each degree of longitude east. With `apparent` it is that of
        the true Sun, of any body: 12 h where the Sun is over the node's meridian.
        """
        from math import cos, sin

        axes: Any = [[1, 0, 0], [0, 1, 0]] if self.frame is None else self.frame
        node = [cos(self.Omega) * x + sin(self.Omega) * y for x, y in zip(axes[0], axes[1])]
        return _local_time(sky, t, node, self.body, apparent)

    def __setattr__(self, name: str, value: Any) -> None:
        if "v_BN_N" in vars(self):
            raise SetupError(f"Orbit: '{name}' cannot be set, for nothing would follow it: make another Orbit(...), "
                             "and give it to the craft, craft.orbit = ...")
        object.__setattr__(self, name, value)

    def require_outside(self, path: str) -> None:
        """Raise SetupError if the orbit begins inside the body, or if it is an ellipse that enters the body."""
        from math import cos

        body, divisor = self.body, 1.0 + self.e * cos(self.f)
        surface = body.radius if body.surface is None else body.surface
        periapsis = self.p / (1.0 + self.e)
        closed = self.e < 1.0
        # At and beyond an asymptote there is no position, which orbit_state() says.
        lowest = periapsis if closed else self.p / divisor if divisor > 0 else surface
        if not lowest < surface:
            return
        km = ": are these kilometres? write a = 7000 * km" if periapsis < 0.01 * surface < 1e3 * periapsis else ""
        raise SetupError(f"{path}: {'the periapsis' if closed else 'the position'} must lie outside {body.name}, of "
                         f"radius {surface:.9g} m; found {lowest:.9g} m from its centre{km}"
                         f" ({body.name}.with_surface(0) allows it)")

    @property
    def a(self) -> float:
        """The semi-major axis [m]: negative for a hyperbola, infinite for a parabola."""
        return self._a

    @property
    def period(self) -> float:
        """The orbital period [s]; infinite for open orbits."""
        from math import pi, sqrt

        return 2.0 * pi * self.a * sqrt(self.a / self.body.mu) if 0.0 < self.a < float("inf") else float("inf")

    def __repr__(self) -> str:
        from math import degrees

        angles = ", ".join(f"{n} = {degrees(getattr(self, n)):g} deg" for n in ("i", "Omega", "omega", "f"))
        return f"<Orbit about {self.body.name}: a = {self.a / 1e3:.8g} km, e = {self.e:g}, {angles}>"
