# SPDX-License-Identifier: Apache-2.0
"""The ground's plan of the orbit insertion: where the orbiter comes from, the burn that captures it, and what flight is
sent for both.

The orbiter leaves the Earth and arrives at Mars at real dates, on the ellipse about the Sun that joins the planets of
DE405. Its hyperbola at Mars has a periapsis of our choice, in the plane nearest Mars' equator. The burn turns its
thrust at a constant rate in N, and ends where the orbit has its planned period; start, direction and rate are those
that need the least propellant. Mars is a point mass here; the flight has all that the world has.
"""
from dataclasses import dataclass
from math import sqrt, tau
from typing import Any

from numpy import arctan2, array, concatenate, cos, cross, log, sin
from numpy.linalg import norm
from scipy.integrate import solve_ivp
from scipy.optimize import minimize, root

from fledge import Orbit, world
from fledge import flight as fsw
from fledge.units import hour, km, minute, s

from .mission import DATE
from .vehicle import (ATTITUDE_FUEL, DRY, ENGINE_THRUST, ENGINES, ISP, MAIN_FUEL, RCS, RCS_THRUST, SLOSH)

LAUNCH    = "2020-07-19T22:00:00"           # from the Earth
PERIAPSIS = 90 * minute                     # after DATE
ALTITUDE  = 1000 * km                       # of the periapsis
PERIOD    = 40 * hour                       # of the capture orbit
OFF_PULSE = 0.78                            # of their time the attitude thrusters are open while the engines burn

MU, SUN_MU = world.MARS.mu, world.SUN.mu
MASS   = DRY.value + ATTITUDE_FUEL.value + MAIN_FUEL.value + sum(SLOSH.value)
THRUST = (len(ENGINES["axes_B"]) * ENGINE_THRUST.value                                                      # [N]
          + OFF_PULSE * sum(axis[2] for axis in RCS["axes_B"]) * RCS_THRUST.value)
ENERGY  = -0.5 * (tau * MU / PERIOD.value)**(2 / 3)    # [J/kg] of the capture orbit
EXHAUST = 9.80665 * ISP.value               # [m/s], that of the attitude thrusters too


@dataclass(frozen=True)
class Plan:
    """N components; times [s] of the run, which begins at DATE."""

    v_infinity: Any     # [m/s] of the arrival, (3,)
    normal: Any         # of the orbit's plane, (3,)
    r_0: Any            # [m] at DATE, (3,)
    v_0: Any            # [m/s]
    start: float        # of the burn
    ends: float
    dv_N: Any           # [m/s] its size, along the thrust at its start, (3,)
    rate_N: Any         # [rad/s] at which the thrust turns, (3,)
    used: float         # [kg] propellant
    r_end: Any          # [m] at the end of the burn, (3,)
    v_end: Any          # [m/s]

    @property
    def capture(self) -> Orbit:
        """The orbit at the end of the burn."""
        return Orbit.from_state(world.MARS, self.r_end, self.v_end)


def arrival() -> Any:
    """[m/s] The velocity at Mars, without Mars' gravity and relative to it, of the ellipse that leaves the Earth at
    LAUNCH: (3,)."""
    sky = world.Sky(LAUNCH, center=world.SUN)
    last = sky.time_of(DATE)
    earth, mars = sky.state(world.EARTH, 0), sky.state(world.MARS, last)

    def flown(v):
        return _flown(SUN_MU, concatenate([earth.r_PN_N, v]), last)

    v = root(lambda v: (flown(1e4 * v)[:3] - array(mars.r_PN_N)) / 1e11, 1.1e-4 * array(earth.v_PN_N)).x
    return flown(1e4 * v)[3:] - array(mars.v_PN_N)


def plan() -> Plan:
    """The burn with the least propellant."""
    v_infinity = arrival()
    along, pole = v_infinity / norm(v_infinity), world.Sky(DATE, center=world.MARS).equator(world.MARS)[2]
    normal = pole - (pole @ along) * along
    normal /= norm(normal)

    # At the periapsis the velocity has turned by half of what it turns in all, whose sine is 1 / e.
    radius = world.MARS.radius + ALTITUDE.value
    speed = sqrt(v_infinity @ v_infinity + 2 * MU / radius)
    e = radius * speed**2 / MU - 1
    forward = sqrt(1 - 1 / e**2) * along + cross(normal, along) / e
    periapsis = concatenate([radius * cross(forward, normal), speed * forward])
    middle = PERIAPSIS.value

    def burn(x):
        """The run of r, v and mass, from the start [s] on, with the angle and the rate of the thrust against it."""
        start, angle, rate = middle + 1e3 * x[0], x[1], 1e-3 * x[2]
        first = _flown(MU, periapsis, start - middle)
        return start, rate, _thrust(-forward, normal, angle, 0), _burn(first, start, -forward, normal, angle, rate)

    best = minimize(lambda x: MASS - burn(x)[3].y[6, -1], [-0.7, -0.3, 0.4], method="Nelder-Mead",
                    options={"xatol": 1e-4, "fatol": 1e-4})
    start, rate, direction, flown = burn(best.x)
    left = flown.y[6, -1]
    at_0 = _flown(MU, periapsis, -middle)
    return Plan(v_infinity, normal, at_0[:3], at_0[3:], start, flown.t[-1], EXHAUST * log(MASS / left) * direction,
                rate * normal, MASS - left, flown.y[:3, -1], flown.y[3:6, -1])


def _flown(mu, state, time):
    """The position and velocity [m, m/s] a time [s] later, about one body."""
    if time == 0:
        return state
    return solve_ivp(lambda t, y: concatenate([y[3:], -mu / norm(y[:3])**3 * y[:3]]), (0, time), state,
                     method="DOP853", rtol=1e-11, atol=1e-3).y[:, -1]


def _thrust(base, normal, angle, turned):
    """A unit vector of the orbit's plane, at an angle [rad] against a base in it."""
    return cos(angle + turned) * base + sin(angle + turned) * cross(normal, base)


def _burn(state, start, base, normal, angle, rate):
    """Until the orbit has the planned period. Raises ValueError if the propellant does not suffice."""
    def slope(t, y):
        push = THRUST / y[6] * _thrust(base, normal, angle, rate * (t - start))
        return concatenate([y[3:6], push - MU / norm(y[:3])**3 * y[:3], [-THRUST / EXHAUST]])

    def captured(t, y):
        return (y[3:6] @ y[3:6] / 2 - MU / norm(y[:3])) / ENERGY - 1

    captured.terminal = True
    longest = MAIN_FUEL.value * EXHAUST / THRUST
    flown = solve_ivp(slope, (start, start + longest), concatenate([state, [MASS]]), method="DOP853", rtol=1e-9,
                      atol=1e-3, events=captured)
    if flown.status != 1:
        raise ValueError(f"all propellant does not capture the orbiter into an orbit of {PERIOD}")
    return flown


def elements(orbit: Orbit, time: float) -> fsw.ElementEphemeris:
    """The parameters on board of an orbit, by where the orbiter is on it at a time [s]."""
    e = orbit.e
    E = 2 * arctan2(sqrt(1 - e) * sin(orbit.f / 2), sqrt(1 + e) * cos(orbit.f / 2))
    return fsw.ElementEphemeris(epoch=time * s, mu=orbit.body.mu, a=orbit.p / (1 - e**2), e=e, i=orbit.i,
                                node=orbit.Omega, periapsis=orbit.omega, M=E - e * sin(E))
