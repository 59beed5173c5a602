# SPDX-License-Identifier: Apache-2.0
"""Attributes of the world's models besides the parameters of their headers: parts, gravity, orbit, sky, body."""

from __future__ import annotations

import weakref
from typing import Any

from fledge import _core
from fledge.errors import SetupError
from fledge.world.bodies import Body, body_of
from fledge.world.orbit import Orbit
from fledge.world.sky import Sky, number


def _set_parts(craft, parts):
    for part in parts if isinstance(parts, (list, tuple)) else [parts]:
        _core.attach(craft, part)


def _set_gravity(craft, bodies):
    for one in bodies if isinstance(bodies, (list, tuple)) else [bodies]:
        b = body_of(one, f"{_core.path(craft)}.gravity")
        _core.add_gravity(craft, b.name, b.mu, b.radius, b.J, b.pole_N, b.r_PN_N, b.v_PN_N, b.naif, b.field,
                          b.surface)


def _get_gravity(craft):
    bodies = []
    for name, mu, radius, J, pole_N, r_PN_N, v_PN_N, naif, field, surface in _core.gravity(craft):
        body = Body(name, mu, radius, naif=naif)
        vars(body).update(J=tuple(J), pole_N=pole_N, r_PN_N=r_PN_N, v_PN_N=v_PN_N, field=field, surface=surface)
        bodies.append(body)
    return bodies


def _set_orbit(craft, orbit):
    if not isinstance(orbit, Orbit):
        raise SetupError(f"{_core.path(craft)}.orbit: expected Orbit(body, ...); found {orbit!r}")
    orbit.require_outside(f"{_core.path(craft)}.orbit")
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


# As they were set: their state depends on a sky that is set later.
_orbits: weakref.WeakKeyDictionary[Any, Orbit] = weakref.WeakKeyDictionary()


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


def add_attributes(types: dict[str, Any]) -> None:
    """Give the models of `types`, by name, their further attributes."""
    craft = types["Spacecraft"]
    craft.parts = property(_core.parts, _set_parts, None, "The parts, such as reaction wheels; assigning adds.")
    craft.gravity = property(_get_gravity, _set_gravity, None, "The bodies that attract it; assigning adds.")
    craft.orbit = property(_get_orbit, _set_orbit, None,
                           "When set, the initial orbit; when read, the present one about the first body.")
    craft.sky = property(_get_sky, _set_sky, None, "The Sky that says where the bodies of `gravity` are, or None.")

    celestial = types["CelestialBody"]
    celestial.body = property(_get_body, _set_body, None, "The body: world.MARS, a name or a NAIF number.")
    celestial.sky = property(_get_sky, _set_sky, None, "The Sky in which it is.")
