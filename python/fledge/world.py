# SPDX-License-Identifier: Apache-2.0
"""The world's models by name, celestial bodies, orbits and methods of integration.

    w.craft = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[world.MARS],
        orbit=Orbit(world.MARS, a=7471.618 * km, e=0.4, f=270 * deg))
    w.integrator = world.Adaptive(relative=1e-10, absolute=1e-9)

N is an inertial frame; where a body's pole matters, N is the mean equator and equinox of J2000. With a
Sky, bodies are where an ephemeris has them, and N has its origin in one of them.
"""

import weakref
from os import fspath

from fledge import _core, project as _project
from fledge._hooks import strip
from fledge._names import lookup
from fledge.sky import Sky, number

TYPE_CHECKING = False
if TYPE_CHECKING:  # Type checkers and editors take it for true. The build writes these stubs from the headers.
    from _fledge_world import *
    from _project_world import *
del TYPE_CHECKING

TYPES = {**_core.library("world"), **_project.types("world")}
SetupError = _core.SetupError

_LENGTH = (1, 0, 0, 0, 0, 0, 0, 0)
_SPEED = (1, 0, -1, 0, 0, 0, 0, 0)
_ANGLE = (0, 0, 0, 0, 0, 0, 0, 1)
_NUMBER = (0,) * 8


def _number(value, path, unit, dims):
    number = strip(value, path, unit, dims, f"a number in {unit}" if unit != "-" else "a number")
    if not isinstance(number, (int, float)):
        raise SetupError(f"{path}: expected one number; found {value!r}")
    return float(number)


def _vector(value, path, unit, dims):
    numbers = strip(value, path, unit, dims, f"3 numbers in {unit}")
    if not isinstance(numbers, list) or len(numbers) != 3 or not all(isinstance(x, (int, float)) for x in numbers):
        raise SetupError(f"{path}: expected 3 numbers; found {value!r}")
    return [float(x) for x in numbers]


# --- bodies ----------------------------------------------------------------------------------------

class Body:
    """A celestial body: gravity, size and pole.

    name; mu [m^3/s^2]; radius [m], equatorial, to which J belongs; J: (J2, ..., J6); pole_N: unit
    vector; r_PN_N [m], v_PN_N [m/s]: where it is at time 0, and its uniform motion; naif: the number by
    which a Sky finds it; field: its gravity in spherical harmonics, or None.

    As it stands, a body attracts as a point mass; `MARS.zonal(6)` adds J2 to J6, `MARS.harmonics(file)`
    is the body with a whole field, `SUN.at(r, v)` the same body elsewhere, where there is no Sky.
    """

    def __init__(self, name, mu, radius, J=(), pole=(0.0, 90.0), naif=None):
        from math import cos, radians, sin

        self.name, self.mu, self.radius, self.naif = name, mu, radius, naif
        self.field = None
        self._known = tuple(J) + (0.0,) * (5 - len(J))
        self.J = (0.0,) * 5
        alpha, delta = radians(pole[0]), radians(pole[1])
        self.pole_N = [cos(delta) * cos(alpha), cos(delta) * sin(alpha), sin(delta)]
        self.r_PN_N = [0.0, 0.0, 0.0]
        self.v_PN_N = [0.0, 0.0, 0.0]

    def _copy(self):
        other = object.__new__(Body)
        other.__dict__.update(self.__dict__)
        return other

    def zonal(self, degree=6, pole_N=None):
        """The same body with the zonal harmonics up to a degree from 2 to 6.

        pole_N: a unit vector, where the orbit's N is not J2000; [0, 0, 1] for N on the body's equator.
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
            other.pole_N = _vector(pole_N, f"{self.name}.zonal: pole_N", "-", _NUMBER)
        return other

    def harmonics(self, file, degree=None):
        """The same body with the gravity field of a SHADR or ICGEM (.gfc) file, turning with the body.

        degree: up to which; None: all there is. mu and radius are then the file's. Raises SetupError with
        the line if the file is damaged or foreign, or if its mu is not this body's within 10 %.
        """
        path = f"{self.name}.harmonics"
        if degree is not None and (not isinstance(degree, int) or degree < 0):
            raise SetupError(f"{path}: degree must be a whole number >= 0; found {degree!r}")
        other = self._copy()
        try:
            other.field = _core.harmonics(fspath(file), degree)
        except SetupError as error:
            raise SetupError(f"{path}: {error}") from None
        if abs(other.field.mu - self.mu) > 0.1 * self.mu:
            raise SetupError(f"{path}: {fspath(file)} is another body's field: its mu is {other.field.mu:.9g} m^3/s^2, "
                             f"that of {self.name} {self.mu:.9g}")
        other.mu, other.radius, other.J = other.field.mu, other.field.radius, (0.0,) * 5
        return other

    def at(self, r_PN_N, v_PN_N=(0.0, 0.0, 0.0)):
        """The same body at a position [m] at time 0, in uniform motion [m/s]."""
        other = self._copy()
        other.r_PN_N = _vector(r_PN_N, f"{self.name}.at: r_PN_N", "m", _LENGTH)
        other.v_PN_N = _vector(v_PN_N, f"{self.name}.at: v_PN_N", "m/s", _SPEED)
        return other

    def __repr__(self):
        return (f"<{self.name}, mu = {self.mu:.9g} m^3/s^2, radius = {self.radius / 1e3:g} km"
                + (f", J2..J6 = {self.J}" if any(self.J) else "")
                + (f", harmonics to degree {self.field.degree}" if self.field is not None else "") + ">")


# mu: Mars as in the thesis; the Sun, Mercury, Venus, Earth and Moon from DE430, the outer planets
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
MARS = Body("MARS", 4.2828314e13, 3397.0e3,
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
SSB = Body("SOLAR SYSTEM BARYCENTER", 0.0, 0.0, naif=0)  # where N may have its origin; it attracts nothing

BODIES = {b.name: b for b in (SUN, MERCURY, VENUS, EARTH, MOON, MARS, JUPITER, SATURN, URANUS, NEPTUNE, PLUTO)}


def _body(value, path):
    if isinstance(value, Body):
        return value
    if isinstance(value, str) and value.upper() in BODIES:
        return BODIES[value.upper()]
    raise SetupError(f"{path}: expected a body, such as world.MARS; found {value!r}. The bodies are "
                     + ", ".join(BODIES))


# --- orbits ----------------------------------------------------------------------------------------

class Orbit:
    """A Keplerian orbit of any shape, by classical elements.

        Orbit(world.MARS, a=7471.618 * km, e=0.4, f=270 * deg)
        Orbit(world.EARTH, altitude=500 * km, i=97.4 * deg)

    The size and shape are given by one of
        a and e            semi-major axis (negative for a hyperbola), eccentricity (default 0)
        p and e            semi-latus rectum, which every conic has
        rp and ra          radii of periapsis and apoapsis
        rp and e           radius of periapsis, and eccentricity >= 0
        altitude           above the equatorial radius, of a circular orbit
    i, Omega, omega, f: inclination, right ascension of the ascending node, argument of periapsis and
    true anomaly [rad], about the axes of N; default 0.

    r_BN_N [m] and v_BN_N [m/s] hold the state, the body's own position and velocity included.
    Raises SetupError on elements that describe no orbit.
    """

    def __init__(self, body, *, a=None, e=None, p=None, rp=None, ra=None, altitude=None,
                 i=0.0, Omega=0.0, omega=0.0, f=0.0):
        self.body = _body(body, "Orbit")
        given = {k: v for k, v in (("a", a), ("p", p), ("rp", rp), ("ra", ra), ("altitude", altitude))
                 if v is not None}
        sizes = {k: _number(v, f"Orbit: {k}", "m", _LENGTH) for k, v in given.items()}
        for name, value in sizes.items():
            if name != "a" and name != "altitude" and not value > 0:
                raise SetupError(f"Orbit: {name} must be > 0, found {value:g} m")
        e_given = e is not None
        e = _number(e, "Orbit: e", "-", _NUMBER) if e_given else 0.0
        names = set(sizes)
        if names == {"a"}:
            p = _core.semi_latus_rectum(sizes["a"], e)
        elif names == {"p"}:
            p = sizes["p"]
        elif names == {"rp"} and e_given:
            p = sizes["rp"] * (1.0 + e)
        elif names == {"rp", "ra"} and not e_given:
            rp, ra = sizes["rp"], sizes["ra"]
            if rp > ra:
                raise SetupError(f"Orbit: the radius of periapsis, {rp:g} m, is above that of apoapsis, {ra:g} m")
            e = (ra - rp) / (ra + rp)
            p = rp * (1.0 + e)
        elif names == {"altitude"} and not e_given:
            p = self.body.radius + sizes["altitude"]
        else:
            found = ", ".join([*sizes] + ["e"] * e_given) or "none"
            raise SetupError(f"Orbit: expected a and e, p and e, rp and ra, rp and e, or altitude; found {found}")
        self.p, self.e = p, e
        self.i, self.Omega, self.omega, self.f = (
            _number(x, f"Orbit: {name}", "rad", _ANGLE)
            for name, x in (("i", i), ("Omega", Omega), ("omega", omega), ("f", f)))
        r, v = _core.orbit_state(self.body.mu, p, e, self.i, self.Omega, self.omega, self.f)
        self.r_BN_N = [x + y for x, y in zip(r, self.body.r_PN_N)]
        self.v_BN_N = [x + y for x, y in zip(v, self.body.v_PN_N)]

    @classmethod
    def from_state(cls, body, r, v):
        """The orbit through a position [m] with a velocity [m/s], relative to the body."""
        body = _body(body, "Orbit.from_state")
        r = _vector(r, "Orbit.from_state: r", "m", _LENGTH)
        v = _vector(v, "Orbit.from_state: v", "m/s", _SPEED)
        p, e, i, Omega, omega, f = _core.orbit_elements(body.mu, r, v)
        return cls(body, p=p, e=e, i=i, Omega=Omega, omega=omega, f=f)

    @property
    def a(self):
        """The semi-major axis [m]: negative for a hyperbola, infinite for a parabola."""
        return self.p / (1.0 - self.e**2) if self.e != 1.0 else float("inf")

    @property
    def period(self):
        """The orbital period [s]; infinite for open orbits."""
        from math import pi, sqrt

        return 2.0 * pi * sqrt(self.a**3 / self.body.mu) if self.e < 1.0 else float("inf")

    def __repr__(self):
        from math import degrees

        angles = ", ".join(f"{n} = {degrees(getattr(self, n)):g} deg" for n in ("i", "Omega", "omega", "f"))
        return f"<Orbit about {self.body.name}: a = {self.a / 1e3:.8g} km, e = {self.e:g}, {angles}>"


# --- methods of integration ------------------------------------------------------------------------

def RK4():
    """The classical fourth-order method of Runge and Kutta: one step per update."""
    return _core.rk4()


def Adaptive(relative=1e-10, absolute=1e-12):
    """A method of order 8 with error control: as many steps per update as the tolerances ask for.

    relative, absolute: tolerances of each state, in its own unit.
    """
    for name, value in (("relative", relative), ("absolute", absolute)):
        if not isinstance(value, (int, float)) or not value > 0:
            raise SetupError(f"Adaptive: {name} must be a number > 0, found {value!r}")
    return _core.adaptive(float(relative), float(absolute))


# --- what a spacecraft takes besides its parameters ------------------------------------------------

def _set_parts(craft, parts):
    for part in parts if isinstance(parts, (list, tuple)) else [parts]:
        _core.attach(craft, part)


def _set_gravity(craft, bodies):
    for one in bodies if isinstance(bodies, (list, tuple)) else [bodies]:
        b = _body(one, f"{_core.path(craft)}.gravity")
        _core.add_gravity(craft, b.name, b.mu, b.radius, b.J, b.pole_N, b.r_PN_N, b.v_PN_N, b.naif, b.field)


def _get_gravity(craft):
    bodies = []
    for name, mu, radius, J, pole_N, r_PN_N, v_PN_N, naif, field in _core.gravity(craft):
        body = Body(name, mu, radius, naif=naif)
        body.J, body.pole_N, body.r_PN_N, body.v_PN_N, body.field = tuple(J), pole_N, r_PN_N, v_PN_N, field
        bodies.append(body)
    return bodies


def _set_orbit(craft, orbit):
    if not isinstance(orbit, Orbit):
        raise SetupError(f"{_core.path(craft)}.orbit: expected Orbit(body, ...); found {orbit!r}")
    _orbits[craft] = orbit
    r, v = orbit.r_BN_N, orbit.v_BN_N
    if _core.sky(craft) is not None:
        at = _get_sky(craft).state(number(orbit.body, f"{_core.path(craft)}.orbit"))
        r, v = [x + y for x, y in zip(r, at.r_PN_N)], [x + y for x, y in zip(v, at.v_PN_N)]
    craft.r_BN_N, craft.v_BN_N = r, v


def _get_orbit(craft):
    bodies = _get_gravity(craft)
    if not bodies:
        raise SetupError(f"{_core.path(craft)}.orbit: no body attracts it")
    t = craft.state.head.t
    state, body = craft.state if craft.state.head.sequence else craft, bodies[0]
    if _core.sky(craft) is not None:
        at = _get_sky(craft).state(body, t / 1e9)
        r_PN_N, v_PN_N = at.r_PN_N, at.v_PN_N
    else:
        r_PN_N, v_PN_N = [x + t / 1e9 * y for x, y in zip(body.r_PN_N, body.v_PN_N)], body.v_PN_N
    r = [float(x - y) for x, y in zip(state.r_BN_N, r_PN_N)]
    v = [float(x - y) for x, y in zip(state.v_BN_N, v_PN_N)]
    return Orbit.from_state(body.at([0, 0, 0]), r, v)


_orbits = weakref.WeakKeyDictionary()  # as they were set: a sky that comes later says where their body is


def _set_sky(model, sky):
    path = f"{_core.path(model)}.sky"
    if not isinstance(sky, Sky):
        raise SetupError(f"{path}: expected world.Sky(epoch, center, ...); found {sky!r}")
    if _core.sky(model) is not None:
        raise SetupError(f"{path}: it already has one, {_get_sky(model)!r}")
    _core.set_sky(model, sky._core)
    if model in _orbits:
        _set_orbit(model, _orbits[model])


def _get_sky(model):
    core = _core.sky(model)
    return None if core is None else Sky._of(core)


def _set_body(model, body):
    model.id = number(body, f"{_core.path(model)}.body")


def _get_body(model):
    return _core.body_name(model.id)


_craft = TYPES["Spacecraft"]
_craft.parts = property(_core.parts, _set_parts, None, "The parts, such as reaction wheels; assigning adds.")
_craft.gravity = property(_get_gravity, _set_gravity, None, "The bodies that attract it; assigning adds.")
_craft.orbit = property(_get_orbit, _set_orbit, None,
                        "The initial orbit, to be set; read, the present one about the first body.")
_craft.sky = property(_get_sky, _set_sky, None, "The Sky that says where the bodies of `gravity` are, or None.")

_celestial = TYPES["CelestialBody"]
_celestial.body = property(_get_body, _set_body, None, "The body: world.MARS, a name or a NAIF number.")
_celestial.sky = property(_get_sky, _set_sky, None, "The Sky in which it is.")

__getattr__, __dir__ = lookup(__name__, TYPES, globals())
