# SPDX-License-Identifier: Apache-2.0
"""Attributes of the world's models besides the parameters of their headers: parts, gravity, orbit, sky, bodies."""

from __future__ import annotations

import weakref
from collections.abc import Collection, Iterable
from contextlib import suppress
from math import isfinite
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from fledge import _core
from fledge.errors import SetupError, did_you_mean, suggesting
from fledge.objects.si import to_vector
from fledge.units import N, m, s
from fledge.world.bodies import Body, body_of
from fledge.world.orbit import Orbit
from fledge.world.sky import Sky, SpaceWeather, number

# A body for the kernel: name, mu, radius, J, pole_N, r_PN_N, v_PN_N, naif, field, surface, pole_stays.
BodyFields = tuple[str, float, float, Any, Any, Any, Any, int | None, Any, float | None, bool]


def _changes(model: _core.Model) -> None:
    """Make the simulation of a model set it up anew. Raises SetupError if the simulation has run."""
    process = (_core.context(model) or (lambda: None))()
    if process is not None:
        process._core_simulation.set_up_again()


def _set_parts(craft: _core.Model, parts: Any) -> None:
    _changes(craft)
    for part in parts if isinstance(parts, (list, tuple)) else [parts]:
        _core.attach(craft, part)


def _fields(body: Any, path: str) -> BodyFields:
    b = body_of(body, path)
    return b.name, b.mu, b.radius, b.J, b.pole_N, b.r_PN_N, b.v_PN_N, b.naif, b.field, b.surface, b.pole_stays


def _bodies(rows: Iterable[BodyFields]) -> list[Body]:
    bodies = []
    for name, mu, radius, J, pole_N, r_PN_N, v_PN_N, naif, field, surface, stays in rows:
        body = Body(name, mu, radius, naif=naif)
        vars(body).update(J=tuple(J), pole_N=pole_N, r_PN_N=r_PN_N, v_PN_N=v_PN_N, field=field, surface=surface,
                          pole_stays=stays)
        bodies.append(body)
    return bodies


def _set_gravity(craft: _core.Model, bodies: Any) -> None:
    _changes(craft)
    for body in bodies if isinstance(bodies, (list, tuple)) else [bodies]:
        _core.add_gravity(craft, _fields(body, f"{_core.path(craft)}.gravity"))


def _get_gravity(craft: _core.Model) -> list[Body]:
    return _bodies(_core.gravity(craft))


def _set_orbit(craft: _core.Model, orbit: Any) -> None:
    if not isinstance(orbit, Orbit):
        raise SetupError(f"{_core.path(craft)}.orbit: expected Orbit(body, ...); found {orbit!r}")
    orbit.require_outside(f"{_core.path(craft)}.orbit")
    _orbits[craft] = orbit
    craft.r_BN_N, craft.v_BN_N = _state(craft, orbit)
    _core.expect_orbit(craft, _fields(orbit.body, f"{_core.path(craft)}.orbit"))


def _state(craft: _core.Model, orbit: Orbit) -> tuple[list[float], list[float]]:
    """Position and velocity of an orbit in N, with those of its body in the craft's sky."""
    r, v = orbit.r_BN_N, orbit.v_BN_N
    if (sky := _get_sky(craft)) is not None:
        at = sky.state(number(orbit.body, f"{_core.path(craft)}.orbit"))
        r, v = [x + y for x, y in zip(r, at.r_PN_N)], [x + y for x, y in zip(v, at.v_PN_N)]
    return r, v


def given_orbit(craft: Any) -> Orbit | None:
    """The orbit that was assigned to a craft, if its initial state is still that of the orbit."""
    orbit = _orbits.get(craft)
    if orbit is None or [*craft.r_BN_N, *craft.v_BN_N] != [x for part in _state(craft, orbit) for x in part]:
        return None
    return orbit


def _get_orbit(craft: _core.Model) -> Orbit:
    bodies = _get_gravity(craft)
    if not bodies:
        raise SetupError(f"{_core.path(craft)}.orbit: no body attracts it")
    context, t = _core.context(craft), craft.state.head.t
    process = context() if context is not None else None
    runs = process is None or process._core_simulation.now >= 0     # else a change of the initial state counts
    state, body = craft.state if runs and craft.state.head.sequence else craft, bodies[0]
    if (sky := _get_sky(craft)) is not None:
        at = sky.state(body, t / 1e9)
        r_PN_N, v_PN_N = at.r_PN_N, at.v_PN_N
    else:
        r_PN_N, v_PN_N = [x + t / 1e9 * y for x, y in zip(body.r_PN_N, body.v_PN_N)], body.v_PN_N
    r = [float(x - y) for x, y in zip(state.r_BN_N, r_PN_N)]
    v = [float(x - y) for x, y in zip(state.v_BN_N, v_PN_N)]
    return Orbit.from_state(body.at([0, 0, 0]), r, v)


_IMPULSE = {"dv": ("m/s", m / s), "momentum": ("N s", N * s), "angular": ("N m s", N * m * s), "r": ("m", m)}


@suggesting(dv="dv_N", force_N="momentum_N", force_B="momentum_B", torque_N="angular_N", torque_B="angular_B")
def impulse(craft: _core.Model, /, *, dv_N: Any = None, dv_B: Any = None, momentum_N: Any = None,
            momentum_B: Any = None, angular_N: Any = None, angular_B: Any = None, r_PB_B: Any = None) -> None:
    """Change the motion at once, as a collision or a separation does: `craft.impulse(dv_B=[0, 0, 0.1] * m / s)`.

    dv_N, dv_B: [m/s] change of the velocity of the centre of mass, N or B components; momentum_N, momentum_B: [N s] the
    linear momentum that the spacecraft gets; angular_N, angular_B: [N m s] the angular momentum about its centre of
    mass. What is given adds up. r_PB_B: [m] the point, relative to B's origin, where the linear part acts; not given:
    the centre of mass of all.

    It acts on the hub, at the time of the state: between two runs, or in a function of an event,
    `w.at(5 * minute, lambda: w.craft.impulse(...))`. Panels and fuel that move keep their own motion but for what the
    hub does to them; all momentum that is given is in the whole. Sensors and flight see it from the next instant on.

    Raises SetupError before the run, on other shapes and units, and if it needs a mass and there is none.
    """
    path = f"{_core.path(craft)}.impulse"
    given = {"dv_N": dv_N, "dv_B": dv_B, "momentum_N": momentum_N, "momentum_B": momentum_B, "angular_N": angular_N,
             "angular_B": angular_B, "r_PB_B": r_PB_B}
    vectors = {}
    for name, value in given.items():
        if value is not None:
            unit, quantity = _IMPULSE[name.partition("_")[0]]
            vectors[name] = to_vector(value, f"{path}: {name}", unit, quantity.dims)
            if not all(map(isfinite, vectors[name])):
                raise SetupError(f"{path}: {name}: expected finite numbers; found {value!r}")
    at = vectors.pop("r_PB_B", None)
    del given["r_PB_B"]
    if not vectors:
        raise SetupError(f"{path}: give at least one of {', '.join(given)}")
    _core.strike(craft, [vectors.get(name, [0.0, 0.0, 0.0]) for name in given], at)


# As they were set: their state depends on a sky that is set later.
_orbits: weakref.WeakKeyDictionary[Any, Orbit] = weakref.WeakKeyDictionary()


def _set_sky(model: _core.Model, sky: Any) -> None:
    path = f"{_core.path(model)}.sky"
    if not isinstance(sky, Sky):
        raise SetupError(f"{path}: expected world.Sky(epoch, center, ...); found {sky!r}")
    _changes(model)
    if _core.sky(model) is not None:
        raise SetupError(f"{path}: it already has one, {_get_sky(model)!r}")
    _core.set_sky(model, sky._core)
    if model in _orbits:
        _set_orbit(model, _orbits[model])


def _get_sky(model: _core.Model) -> Sky | None:
    core = _core.sky(model)
    return None if core is None else Sky._of(core)


_IN_SKY = property(_get_sky, _set_sky, None, "The Sky in which it is.")


def _set_body(model: _core.Model, body: Any) -> None:
    model.id = number(body, f"{_core.path(model)}.body")


def _get_body(model: _core.Model) -> str:
    return _core.body_name(model.id)


def _first_body(name: str) -> property:
    def set_body(model: _core.Model, body: Any) -> None:
        _changes(model)
        _core.set_body(model, _fields(body, f"{_core.path(model)}.{name}"))

    return property(lambda model: next((b for b in _bodies(_core.bodies(model))[:1] if b.mu), None), set_body, None,
                    "The body that it is of, such as world.EARTH; without a sky, where `body.at(r, v)` says.")


def _set_shadows(light: _core.Model, bodies: Any) -> None:
    _changes(light)
    for body in bodies if isinstance(bodies, (list, tuple)) else [bodies]:
        _core.add_body(light, _fields(body, f"{_core.path(light)}.shadows"))


def _set_serves(radio: _core.Model, process: Any) -> None:
    _changes(radio)
    _core.set_serves(radio, process if isinstance(process, str) else process.name)


# Models of the Earth's magnetic field that come with Fledge; the last two names are those of FieldOnBoard.
MAGNETIC = {"WMM2025": "WMM2025", "IGRF-14": "IGRF-14", "WMM": "WMM2025", "IGRF": "IGRF-14"}
_MAGNETIC_FILES = Path(__file__).with_name("magnetic")


def _set_coefficients(field: _core.Model, file: Any) -> None:
    expected = f'{_core.path(field)}.coefficients: expected "WMM2025", "IGRF-14" or the path of a .COF file'
    if not isinstance(file, (str, PathLike)):
        raise SetupError(f"{expected}; found {file!r}")
    if isinstance(file, str) and file in MAGNETIC:
        file = _MAGNETIC_FILES / f"{MAGNETIC[file]}.COF"
    elif isinstance(file, str) and not Path(file).suffix and not Path(file).exists():
        raise SetupError(f"{expected}; found {file!r}{did_you_mean(file, MAGNETIC)}".rstrip(";"))
    _changes(field)
    _core.set_coefficients(field, fspath(file))


def _get_coefficients(field: _core.Model) -> str:
    file = Path(_core.coefficients(field))
    return file.stem if file.parent == _MAGNETIC_FILES else _core.coefficients(field)


def _set_weather(air: _core.Model, weather: Any) -> None:
    _changes(air)
    if not isinstance(weather, SpaceWeather):
        raise SetupError(f"{_core.path(air)}.weather: expected world.SpaceWeather(file); found {weather!r}")
    _core.set_weather(air, weather._core)


def _get_weather(air: _core.Model) -> SpaceWeather | None:
    core = _core.weather(air)
    return None if core is None else SpaceWeather._of(core)


def _file_of(name: str, doc: str) -> property:
    """A file that an EphemerisCraft follows."""
    def set_file(craft: _core.Model, file: Any) -> None:
        _changes(craft)
        if not isinstance(file, (str, PathLike)):
            raise SetupError(f"{_core.path(craft)}.{name}: expected the path of a file; found {file!r}")
        _follow(craft, **{name: fspath(file)})

    return property(lambda craft: _core.ephemeris_files(craft)[name == "attitude"], set_file, None, doc)


def _set_sky_of_files(craft: _core.Model, sky: Any) -> None:
    _set_sky(craft, sky)
    _follow(craft)


def _follow(craft: _core.Model, **changes: str) -> None:
    """Give an EphemerisCraft what its files say in its sky, once both are there."""
    sky = _get_sky(craft)
    files = dict(zip(("orbit", "attitude"), _core.ephemeris_files(craft))) | changes
    rows: dict[str, list[Any]] = {"orbit": [], "attitude": []}
    for name, file in files.items():
        if file and sky is not None:
            from fledge.world import file_motion

            motion = file_motion.of_file(file, sky)
            parts = motion.orbits if name == "orbit" else motion.attitudes
            if not parts or not all(part.curve for part in parts):
                raise SetupError(f"{_core.path(craft)}.{name}: expected an {'OEM' if name == 'orbit' else 'AEM'}, or "
                                 f"another file of an {name} over time; found {file}")
            rows[name] = motion.followed(parts, f"{_core.path(craft)}.{name}: {file}")
    if any(files.values()):
        _core.set_ephemeris(craft, files["orbit"], files["attitude"], rows["orbit"], rows["attitude"])


def _source_of(name: str, doc: str) -> property:
    def set_source(part: _core.Model, source: Any) -> None:
        _changes(part)
        _core.set_source(part, source, name)

    return property(lambda part: _core.source(part, name), set_source, None, doc)


class _Signature:
    """The signature of a model's class with all its keywords, for help(). It is built at its first use, since importing
    inspect takes longer than importing the world."""

    def __init__(self, names: list[str]) -> None:
        self.names = names

    def __get__(self, model: Any, cls: Any) -> Any:
        import inspect

        own = inspect.signature(eval(f"lambda {cls.__text_signature__[1:-1]}: 0"))
        more = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None) for name in self.names]
        return own.replace(parameters=[*own.parameters.values(), *more])


def add_attributes(types: dict[str, Any], own: Collection[str] = ()) -> None:
    """Give the models of `types`, by name, their further attributes, which are keywords of their classes too.
    Those in `own` are a project's."""
    before = {name: set(vars(cls)) for name, cls in types.items()}
    _add_attributes(types)
    for name in own:
        _add_surroundings(types[name])
    for name, cls in types.items():
        if more := [n for n, value in vars(cls).items() if n not in before[name] and isinstance(value, property)]:
            cls.__signature__ = _Signature(more)


def _add_surroundings(cls: Any) -> None:
    """Give a project's model a `body` and a `sky`, if its class in C++ takes them, as an EnvironmentModel does."""
    for name, read, attribute in (("body", _core.bodies, _first_body("body")), ("sky", _core.sky, _IN_SKY)):
        with suppress(TypeError):
            read(cls())
            setattr(cls, name, attribute)


def _add_attributes(types: dict[str, Any]) -> None:
    craft = types["Spacecraft"]
    craft.parts = property(_core.parts, _set_parts, None, "The parts, such as reaction wheels; assigning adds.")
    craft.gravity = property(_get_gravity, _set_gravity, None, "The bodies that attract it; assigning adds.")
    craft.orbit = property(_get_orbit, _set_orbit, None,
                           "When set, the initial orbit; when read, the present one about the first body.")
    craft.sky = property(_get_sky, _set_sky, None, "The Sky that says where the bodies of `gravity` are, or None.")

    craft.impulse = impulse

    following = types["EphemerisCraft"]
    following.orbit = _file_of("orbit", "The file of the orbit that it follows, as an OEM.")
    following.attitude = _file_of("attitude", "The file of the attitude that it follows, as an AEM.")
    following.sky = property(_get_sky, _set_sky_of_files, None, "The Sky that says what dates and frames are.")

    celestial = types["CelestialBody"]
    celestial.body = property(_get_body, _set_body, None, "The body: world.MARS, a name or a NAIF number.")
    in_sky = ("CelestialBody", "Atmosphere", "EarthAtmosphere", "Magnetism", "GroundStation", "PlanetRadiation",
              "Sunlight", "Radio")
    for name in in_sky:
        types[name].sky = _IN_SKY
    for name in ("Atmosphere", "Magnetism", "GroundStation", "PlanetRadiation"):
        types[name].body = _first_body("body")
    for name, hidden in (("Sunlight", "Sun"), ("Radio", "station")):
        types[name].sun = _first_body("sun")
        types[name].shadows = property(lambda model: _bodies(_core.bodies(model))[1:], _set_shadows, None,
                                       f"The bodies that may hide the {hidden}; assigning adds.")
    types["Radio"].station = _source_of("station", "The GroundStation with which it speaks.")
    types["Radio"].serves = property(_core.serves, _set_serves, None,
                                     "The flight process whose bytes it carries, or its name.")
    types["EarthAtmosphere"].weather = property(_get_weather, _set_weather, None,
                                                "The SpaceWeather, in place of a constant activity.")
    types["Magnetism"].coefficients = property(
        _get_coefficients, _set_coefficients, None,
        'A model of the Earth\'s field by its name, "WMM2025" or "IGRF-14", or by its file (.COF); or empty.')
    for name in ("Thrusters", "Drag", "SolarPressure"):
        types[name].panels = _source_of("panels", "The HingedPanels on which some of it is mounted.")
    types["Drag"].air = _source_of("air", "The air that it feels: an EarthAtmosphere, or any other model of air.")
    types["TorqueRods"].field = _source_of("field", "The Magnetism in which they are.")
    types["PlanetRadiation"].light = _source_of("light", "The Sunlight that shines on it.")
    types["SolarPressure"].light = _source_of("light", "The Sunlight that it feels.")
    for name in ("SolarPressure", "CoarseSunSensors", "SunSensor", "SolarArray"):
        types[name].radiation = _source_of("radiation", "The PlanetRadiation of a planet that shines on it, or None.")
