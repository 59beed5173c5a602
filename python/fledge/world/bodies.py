# SPDX-License-Identifier: Apache-2.0
"""Celestial bodies, with their gravity, size and pole."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike, fspath
from typing import Any

from fledge import _core
from fledge.errors import SetupError, suggesting
from fledge.objects.si import to_number, to_vector

# The exponents of the base units, as in fledge.units.
LENGTH = (1, 0, 0, 0, 0, 0, 0, 0)
SPEED = (1, 0, -1, 0, 0, 0, 0, 0)
MU = (3, 0, -2, 0, 0, 0, 0, 0)
ANGLE = (0, 0, 0, 0, 0, 0, 0, 1)
NUMBER = (0,) * 8


@suggesting()
class Body:
    """A celestial body: gravity, size and pole.

    name; mu [m^3/s^2]; radius [m], equatorial, to which J belongs; J: (J2, ..., J6); pole_N: unit vector, of
    J2000; with a Sky the pole of date replaces it; r_PN_N [m], v_PN_N [m/s]: its position at time 0, and its
    uniform motion; naif: its number in a Sky; field: its gravity in spherical harmonics, or None; surface
    [m]: the radius of the sphere that no spacecraft may enter, None for that of the body; 0, as for bodies of
    unknown size, for no such sphere.

    A body attracts as a point mass; `MARS.zonal(6)` adds J2 to J6, `MARS.harmonics(file)` is the body with a
    whole field, `MARS.with_kernel(file)` has the numbers of a SPICE kernel, `SUN.at(r, v)` is the same body
    elsewhere, for simulations without a Sky.
    """

    def __init__(self, name: str, mu: float, radius: float, J: Sequence[float] = (),
                 pole: tuple[float, float] = (0.0, 90.0), naif: int | None = None) -> None:
        from math import cos, radians, sin

        self.name, self.mu, self.radius, self.naif = name, mu, radius, naif
        self.field: Any = None
        self.surface: float | None = None
        self._known = tuple(J) + (0.0,) * (5 - len(J))
        self.J: tuple[float, ...] = (0.0,) * 5
        alpha, delta = radians(pole[0]), radians(pole[1])
        self.pole_N = [cos(delta) * cos(alpha), cos(delta) * sin(alpha), sin(delta)]
        self.pole_stays = False
        self.r_PN_N = [0.0, 0.0, 0.0]
        self.v_PN_N = [0.0, 0.0, 0.0]

    def _copy(self) -> Body:
        other = object.__new__(Body)
        other.__dict__.update(self.__dict__)
        return other

    def zonal(self, degree: int = 6, pole_N: Any = None) -> Body:
        """The same body with the zonal harmonics up to a degree from 2 to 6.

        They turn about the pole of date if the spacecraft has a Sky, else about that of J2000.
        pole_N: a unit vector in place of both, [0, 0, 1] for N on the body's equator.
        """
        if degree not in range(2, 7):
            raise SetupError(f"{self.name}.zonal({degree}): expected a degree from 2 to 6")
        if not any(self._known):
            raise SetupError(f"{self.name}.zonal({degree}): no harmonics are known here")
        if self.field is not None:
            raise SetupError(f"{self.name}.zonal({degree}): it has a whole field already")
        other = self._copy()
        other.J = tuple(j if n <= degree else 0.0 for n, j in enumerate(self._known, 2))
        if pole_N is not None:
            other.pole_N = to_vector(pole_N, f"{self.name}.zonal: pole_N", "-", NUMBER)
            other.pole_stays = True
        return other

    def harmonics(self, file: str | PathLike[str], degree: int | None = None, tides: bool | str = False,
                  epoch: str | None = None) -> Body:
        """The same body with the gravity field of a SHADR or ICGEM (.gfc) file, turning with the body.

        degree: the highest, above which the file may lack what it promises; None: that of the file. mu and radius are
        then the file's. tides: whether the Moon, the Sun and the polar motion of the Sky change the Earth's field (IERS
        Conventions 2010, sections 6.2 and 6.4); where the file does not state its tide system, give it: "tide_free", or
        "zero_tide" if C20 holds the permanent tide. epoch: the date, in the words of a Sky's, at which coefficients
        that change in time (gfct) hold for the whole run; files without such need none. Raises SetupError with the line
        if the file is damaged or foreign, or changes and has no epoch, if its mu is not this body's within 10 % (or 0),
        or if the tide system is not known.
        """
        path = f"{self.name}.harmonics"
        if degree is not None and (not isinstance(degree, int) or degree < 0):
            raise SetupError(f"{path}: degree must be a whole number >= 0; found {degree!r}")
        if tides not in (False, True, "tide_free", "zero_tide"):
            raise SetupError(f'{path}: tides must be True, False, "tide_free" or "zero_tide"; found {tides!r}')
        if not isinstance(epoch, str | None):
            raise SetupError(f'{path}: epoch: expected a text like "2015-03-02T12:00:00"; found {epoch!r}')
        if tides and self.naif != 399:
            raise SetupError(f"{path}: tides are those of the solid Earth; found them for {self.name}")
        other = self._copy()
        try:
            other.field = _core.harmonics(fspath(file), degree, tides if isinstance(tides, str) else "file" * tides,
                                          epoch, self.mu)
        except SetupError as error:
            raise SetupError(f"{path}: {error}") from None
        if self.mu and abs(other.field.mu - self.mu) > 0.1 * self.mu:
            raise SetupError(f"{path}: {fspath(file)} is another body's field: its mu is {other.field.mu:.9g} m^3/s^2, "
                             f"that of {self.name} {self.mu:.9g}")
        other.mu, other.radius, other.J = other.field.mu, other.field.radius, (0.0,) * 5
        return other

    def at(self, r_PN_N: Any, v_PN_N: Any = (0.0, 0.0, 0.0)) -> Body:
        """The same body at a position [m] at time 0, in uniform motion [m/s]."""
        other = self._copy()
        other.r_PN_N = to_vector(r_PN_N, f"{self.name}.at: r_PN_N", "m", LENGTH)
        other.v_PN_N = to_vector(v_PN_N, f"{self.name}.at: v_PN_N", "m/s", SPEED)
        return other

    def with_mu(self, mu: Any) -> Body:
        """The same body with another gravitational parameter [m^3/s^2]."""
        other = self._copy()
        other.mu = to_number(mu, f"{self.name}.with_mu", "m^3/s^2", MU)
        if not 0 < other.mu < float("inf"):
            raise SetupError(f"{self.name}.with_mu: mu must be > 0 m^3/s^2, found {other.mu:g} m^3/s^2")
        if self.field is not None:
            raise SetupError(f"{self.name}.with_mu: its field has a mu, {self.mu:.9g} m^3/s^2")
        return other

    def with_kernel(self, file: str | PathLike[str]) -> Body:
        """The same body with what a SPICE text kernel (.tpc) says of its number: mu, radii and zonal harmonics.

        These are BODYnnn_GM [km^3/s^2], BODYnnn_RADII [km], of which the mean of the first two counts, and
        BODYnnn_J2 to _J6, for `zonal`, which belong to these radii. What the kernel does not have stays. A body that
        is not built in: `world.Body("EROS", 0, 0, naif=2000433).with_kernel("gm_de440.tpc")`. Raises SetupError with
        the line if the kernel is damaged, or if it says nothing of the body.
        """
        path = f"{self.name}.with_kernel"
        if self.naif is None:
            raise SetupError(f"{path}: the body has no NAIF number, by which a kernel would name it; give it, naif=499")
        if self.field is not None or any(self.J):
            raise SetupError(f"{path}: it has harmonics already; call zonal or harmonics afterwards")
        try:
            mu, radius, J = _core.body_in_kernel(fspath(file), self.naif)
        except SetupError as error:
            raise SetupError(f"{path}: {error}") from None
        other = self._copy()
        other.mu = self.mu if mu is None else mu
        if radius is not None:
            other.radius = radius
            other._known = tuple(j * (self.radius / radius)**n for n, j in enumerate(self._known, 2))
        if any(J):
            other._known = tuple(J)
        return other

    def equator(self) -> list[list[float]]:
        """The axes, in N, of the body's equator of J2000, for Orbit(frame=...); sky.equator(body) is that of date.

        The first one is where the equator ascends over N's plane of the axes 1 and 2.
        """
        return equator(self.pole_N)

    def with_surface(self, radius: Any) -> Body:
        """The same body, which a spacecraft must not approach to less than `radius` [m] from its centre.

        Give a smaller radius than the body's for an orbit over the poles of an oblate planet, and 0 for a
        landing: then nothing ends a run inside the body.
        """
        other = self._copy()
        other.surface = to_number(radius, f"{self.name}.with_surface", "m", LENGTH)
        if not 0 <= other.surface < float("inf"):
            raise SetupError(f"{self.name}.with_surface: radius must be >= 0 m, found {other.surface:g} m")
        return other

    def __repr__(self) -> str:
        return (f"<{self.name}, mu = {self.mu:.9g} m^3/s^2, radius = {self.radius / 1e3:g} km"
                + (f", J2..J6 = {self.J}" if any(self.J) else "")
                + (f", harmonics to degree {self.field.degree}" if self.field is not None else "")
                + (", tides" if self.field is not None and self.field.has_tides else "") + ">")


# mu: the Sun, Mercury, Venus, Mars and Moon from DE430, the Earth as in its field GGM03S, the outer planets
# without their moons from the JPL satellite ephemerides. Radii that J refer to, or equatorial ones
# (IAU 2009). J: Earth GGM03S, Mars GGM2B, Moon GRAIL, Jupiter and Saturn from Juno and Cassini,
# the others from the NASA planetary fact sheets. Poles: right ascension and declination at J2000
# in degrees, IAU 2000 to 2009.
SUN = Body("SUN", 1.32712440041939e20, 695700e3, (2.2e-7,), (286.13, 63.87), naif=10)
MERCURY = Body("MERCURY", 2.203178e13, 2439.7e3, (5.03e-5,), (281.01, 61.45), naif=199)
VENUS = Body("VENUS", 3.24858592e14, 6051.8e3, (4.458e-6,), (272.76, 67.16), naif=299)
EARTH = Body("EARTH", 3.986004415e14, 6378.1363e3,
             (1.0826353865e-3, -2.5325205e-6, -1.6199892e-6, -2.277385e-7, 5.406871e-7),
             (0.0, 90.0), naif=399)
MOON = Body("MOON", 4.902800066e12, 1738.0e3, (2.0323e-4, 8.46e-6, -9.6e-6), (269.9949, 66.5392), naif=301)
MARS = Body("MARS", 4.282837362069909e13, 3397.0e3,
            (1.955453679e-3, 3.14498094e-5, -1.53773962e-5, 5.7185472e-6, -4.8488418e-6),
            (317.68143, 52.88650), naif=499)
JUPITER = Body("JUPITER", 1.26686534e17, 71492e3, (1.469657e-2, -4.2e-8, -5.86609e-4, -6.9e-8, 3.4198e-5),
               (268.05, 64.49), naif=599)
SATURN = Body("SATURN", 3.79312077e16, 60330e3, (1.629057e-2, 6e-8, -9.3531e-4, -2.2e-7, 8.634e-5),
              (40.589, 83.537), naif=699)
URANUS = Body("URANUS", 5.7939513e15, 25559e3, (3.5107e-3, 0.0, -3.42e-5), (257.311, -15.175), naif=799)
NEPTUNE = Body("NEPTUNE", 6.8350995e15, 25225e3, (3.4084e-3, 0.0, -3.34e-5), (299.36, 43.46), naif=899)
PLUTO = Body("PLUTO", 8.6961381776e11, 1195e3, (), (313.02, 9.09), naif=999)

# Planets together with their moons; without size or shape. mu from JPL's ephemerides.
EMB, JUPITER_SYSTEM, SATURN_SYSTEM, URANUS_SYSTEM, NEPTUNE_SYSTEM, PLUTO_SYSTEM = (
    Body(_core.body_name(n).rsplit(" ", 1)[0], _core.body_mu(n), 0.0, naif=n) for n in (3, 5, 6, 7, 8, 9))
SSB = Body("SOLAR SYSTEM BARYCENTER", 0.0, 0.0, naif=0)  # N may have its origin here; it attracts nothing

BODIES = {b.name: b for b in (SUN, MERCURY, VENUS, EARTH, MOON, MARS, JUPITER, SATURN, URANUS, NEPTUNE, PLUTO)}


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Of vectors with three elements. sum() of floats has other bits from Python 3.12 on."""
    return 0.0 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence[float], b: Sequence[float]) -> list[float]:
    """Of vectors with three elements."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def equator(pole_N: Sequence[float]) -> list[list[float]]:
    """Three axes: the third along the pole, the first where its equator ascends over N's."""
    from math import hypot

    x, y, z = (float(p) for p in pole_N)
    off = hypot(x, y)
    length = hypot(off, z)
    third = [x / length, y / length, z / length]
    first = [-y / off, x / off, 0.0] if off > 1e-12 * length else [1.0, 0.0, 0.0]
    return [first, cross(third, first), third]


def body_of(value: Any, path: str) -> Body:
    """A Body, also by its name. Raises SetupError that lists the names."""
    if isinstance(value, Body):
        return value
    if isinstance(value, str) and value.upper() in BODIES:
        return BODIES[value.upper()]
    raise SetupError(f"{path}: expected a body, such as world.MARS; found {value!r}. The bodies are "
                     + ", ".join(BODIES))
