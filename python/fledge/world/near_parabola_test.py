# SPDX-License-Identifier: Apache-2.0
"""Orbits of e near 1, on board and of the world, against Kepler's equation in 60 digits and Barker's parabola."""
import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

from fledge import Orbit, flight as fsw, world

MU, Q = 3.986004415e14, 7e6
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")
TINY = Decimal(10)**-58


def odd_even(x, sign):
    """sine and cosine (sign -1) or their hyperbolic ones (1), by their series."""
    sums, term, k = [Decimal(0), Decimal(0)], Decimal(1), 0
    while abs(term) > TINY * abs(sums[0] + (k == 0)) or k < 4:
        sums[k % 2] += term * (sign if k % 4 > 1 else 1)
        k += 1
        term *= x / k
    return sums[1], sums[0]


def exact(mu, a, e, M):
    """Position and velocity in the plane of the orbit, the first axis to periapsis."""
    with localcontext() as context:
        context.prec = 60
        mu, a, e, M = (Decimal(x) for x in (mu, a, e, M))
        sign, size = (-1 if e < 1 else 1), abs(M)
        x = min(PI if e < 1 else (2 * size + 3).ln() + 2, size / abs(1 - e))    # at or above the solution
        for _ in range(300):
            s, c = odd_even(x, sign)
            step = (sign * (e * s - x) - size) / (sign * (e * c - 1))
            x -= step
            if abs(step) < Decimal(10)**-50 * x:
                break
        s, c = odd_even(x if M > 0 else -x, sign)
        b, n = abs(a) * abs(1 - e * e).sqrt(), (mu / abs(a)**3).sqrt()
        rate = n / abs(1 - e * c)
        return (np.array([a * (c - e), b * s]), rate * np.array([-abs(a) * s, b * c]))


def apart(found, expected):
    difference = [Decimal(float(x)) - y for x, y in zip(found, expected)]
    return math.hypot(*map(float, difference)) / math.hypot(*map(float, expected))


def ephemeris(e, M=0.0):
    return fsw.ElementEphemeris(mu=MU, a=Q / (1 - e), e=e, M=M)


def test_elements_of_any_eccentricity_near_1_lose_no_digits():
    rng = np.random.default_rng(1)
    for i in range(300):
        e = 1 + 10**rng.uniform(-15.5, -2.001) * (1 if i % 2 else -1)
        M = 10**rng.uniform(-24, 0.49) * rng.choice([-1, 1])
        m = ephemeris(e, M)
        m.update(t=0.0)
        r, v = exact(MU, m.a, e, M)
        assert apart(m.orbit.r_BN_N[:2], r) < 3e-15, (e, M)
        assert apart(m.orbit.v_BN_N[:2], v) < 3e-15, (e, M)
        assert not m.orbit.r_BN_N[2]


def test_the_exact_motion_is_that_of_any_ellipse_too():
    """The other way round: where e is ordinary the same 60 digits are those of the module."""
    for e, M in ((0.1, 2.0), (0.7, -3.0), (1.5, 4.0)):
        m = ephemeris(e, M)
        m.update(t=0.0)
        r, v = exact(MU, m.a, e, M)
        assert max(apart(m.orbit.r_BN_N[:2], r), apart(m.orbit.v_BN_N[:2], v)) < 3e-15


@pytest.mark.parametrize("e", [math.nextafter(1, 0), math.nextafter(1, 2), 1 - 1e-14, 1 + 1e-14])
def test_the_next_numbers_to_1_fly_barkers_parabola(e):
    m = ephemeris(e)
    for t in (-1e6, -1e4, -100, 0.001, 10, 1000, 1e5, 1e7):
        m.update(t=t)
        b = math.sqrt(MU / (2 * Q**3)) * t
        s = 2 * math.sinh(math.asinh(1.5 * b) / 3)      # tan(f / 2): s + s^3 / 3 = b
        expected = np.array([Q * (1 - s * s), 2 * Q * s])
        r = np.array(m.orbit.r_BN_N[:2])
        assert np.linalg.norm(r - expected) < (1e-14 + abs(1 - e) * s * s) * np.linalg.norm(expected), t
        assert m.orbit.head.quality.name == "GOOD"


@pytest.mark.parametrize("d", [1e-3, 1e-6, 1e-9, 1e-12, -1e-3, -1e-6, -1e-9, -1e-12])
def test_an_orbit_by_its_periapsis_keeps_its_digits_out_to_the_far_end(d):
    e, body = 1 - d, world.EARTH.with_surface(0)
    for f in (0.0, 1.0, math.pi - 100 * abs(d)**0.5) if d > 0 else (0.0, 1.0, 3.0):
        orbit = Orbit(body, rp=Q, e=e, f=f)
        with localcontext() as context:
            context.prec = 60
            s, c = odd_even(Decimal(f), -1)
            p = Decimal(Q) * (1 + Decimal(e))
            r, speed = p / (1 + Decimal(e) * c), (Decimal(body.mu) / p).sqrt()
            where, ahead = [r * c, r * s], [-speed * s, speed * (Decimal(e) + c)]
        # What f as a double says of it.
        scale = 1e-15 + 1e-15 / (math.pi - f)
        assert apart(orbit.r_BN_N[:2], where) < scale and apart(orbit.v_BN_N[:2], ahead) < scale, f
    assert orbit.a == pytest.approx(Q / (1 - e), rel=1e-15)
    if d > 0:
        assert orbit.period == pytest.approx(2 * math.pi * math.sqrt((Q / (1 - e))**3 / body.mu), rel=1e-15)


def test_sizes_are_those_that_were_given():
    body = world.EARTH.with_surface(0)
    assert Orbit(body, a=7e14, e=1 - 1e-8).a == 7e14
    assert Orbit(body, rp=7e6, ra=7e15).a == (7e6 + 7e15) / 2
    assert Orbit(body, a=-7e14, e=1 + 1e-8).a == -7e14
    assert Orbit(body, p=1.4e7, e=1).a == Orbit(body, p=1.4e7, e=1).period == math.inf
    assert Orbit(body, p=1e7, e=0.5).a == 1e7 / 0.75
    far = Orbit(body, rp=7e6, ra=1e25)      # e rounds to 1; the size says more
    assert far.period == pytest.approx(2 * math.pi * math.sqrt(far.a**3 / body.mu), rel=1e-15)
    assert Orbit(body, a=1e300, e=1 - 2**-53).period == math.inf      # beyond the range of double


@pytest.mark.parametrize("r, speed", [(7e15, 0.99), (7e12, 0.9), (1e13, 1.5), (7e9, 1 - 1e-9), (7e6, 1 - 1e-12),
                                      (7e6, 1 + 1e-9)])
def test_an_orbit_through_a_state_keeps_the_state_and_its_energy(r, speed):
    """speed: by that of the parabola there; the way leads past the body at about 7,000 km."""
    v = speed * math.sqrt(2 * world.EARTH.mu / r)
    sine = math.sqrt(7e6 / r)
    position, velocity = [0.6 * r, 0.8 * r, 0.0], [v * (0.8 * sine - 0.6 * math.sqrt(1 - sine**2)),
                                                   -v * (0.6 * sine + 0.8 * math.sqrt(1 - sine**2)), 0.0]
    orbit = Orbit.from_state(world.EARTH, position, velocity)
    with localcontext() as context:
        context.prec = 60
        x, y = ([Decimal(k) for k in a] for a in (position, velocity))
        alpha = 2 / sum(k * k for k in x).sqrt() - sum(k * k for k in y) / Decimal(world.EARTH.mu)
        h = x[0] * y[1] - x[1] * y[0]
        w = h * h / Decimal(world.EARTH.mu) * alpha       # 1 - e^2
        e = (1 - w).sqrt()
    assert math.dist(orbit.r_BN_N, position) < 2e-12 * r and math.dist(orbit.v_BN_N, velocity) < 2e-12 * v
    assert abs(1 / orbit.a - float(alpha)) < 1e-15 / r
    assert abs(orbit.e - float(e)) < 1e-15
    assert math.dist(orbit.v_BN_N, Orbit.from_state(world.EARTH, orbit.r_BN_N, orbit.v_BN_N).v_BN_N) < 2e-12 * v
