# SPDX-License-Identifier: Apache-2.0
"""The plan against closed forms and an integration of its own, and the insertion with what may go wrong."""
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fledge
from fledge import ground, world
from fledge.ground import NoAnswer
from fledge.units import minute, s
from missions.mars_orbiter import insertion
from missions.mars_orbiter.plan import (ALTITUDE, DATE, ENERGY, EXHAUST, LAUNCH, MASS, MU, PERIAPSIS, PERIOD, THRUST,
                                        plan)

PLAN = plan()


def test_the_arrival_is_an_ellipse_from_the_earth_to_mars():
    """Its energy and momentum about the Sun are those of the departure, and the time is Lambert's."""
    sky = world.Sky(LAUNCH, center=world.SUN)
    last = sky.time_of(DATE)
    earth, mars = sky.state(world.EARTH, 0), sky.state(world.MARS, last)
    r1, r2 = np.array(earth.r_PN_N), np.array(mars.r_PN_N)
    v2 = PLAN.v_infinity + mars.v_PN_N
    a = 1 / (2 / np.linalg.norm(r2) - v2 @ v2 / world.SUN.mu)
    c = np.linalg.norm(r2 - r1)
    total = (np.linalg.norm(r1) + np.linalg.norm(r2) + c) / 2
    alpha, beta = 2 * np.arcsin(np.sqrt(total / (2 * a))), 2 * np.arcsin(np.sqrt((total - c) / (2 * a)))
    times = [np.sqrt(a**3 / world.SUN.mu) * ((angle - np.sin(angle)) - (beta - np.sin(beta)))
             for angle in (alpha, 2 * np.pi - alpha)]
    assert min(abs(time / last - 1) for time in times) < 1e-6
    assert 2.5e3 < np.linalg.norm(PLAN.v_infinity) < 3e3


def test_the_hyperbola_has_its_velocity_and_periapsis():
    r, v = PLAN.r_0, PLAN.v_0
    assert v @ v / 2 - MU / np.linalg.norm(r) == pytest.approx(PLAN.v_infinity @ PLAN.v_infinity / 2, rel=1e-8)
    orbit = fledge.Orbit.from_state(world.MARS, r, v)
    assert orbit.p / (1 + orbit.e) == pytest.approx(world.MARS.radius + ALTITUDE.value, rel=1e-8)
    assert orbit.e == pytest.approx(1 + (world.MARS.radius + ALTITUDE.value) * (PLAN.v_infinity @ PLAN.v_infinity) / MU)
    # Far before, it comes along the velocity at infinity.
    before = solve_ivp(lambda t, y: [*y[3:], *(-MU / np.linalg.norm(y[:3])**3 * y[:3])], (0, -4e7), [*r, *v],
                       rtol=1e-10, atol=1).y[3:, -1]
    np.testing.assert_allclose(before / np.linalg.norm(before), PLAN.v_infinity / np.linalg.norm(PLAN.v_infinity),
                               atol=1e-3)


def test_the_burn_captures_into_the_period_with_the_least_propellant():
    """By steps of its own: the thrust of BurnPointing, rotated about N's axes."""
    def flown(start, rate):
        y = solve_ivp(lambda t, y: [*y[3:], *(-MU / np.linalg.norm(y[:3])**3 * y[:3])], (0, start),
                      [*PLAN.r_0, *PLAN.v_0], rtol=1e-10, atol=1e-3).y[:, -1]
        r, v, u, k = y[:3], y[3:], PLAN.dv_N / np.linalg.norm(PLAN.dv_N), rate / np.linalg.norm(rate)
        t, dt, left = 0.0, 0.5, MASS
        while v @ v / 2 - MU / np.linalg.norm(r) > ENERGY:
            turn = np.linalg.norm(rate) * (t + dt / 2)
            along = u * np.cos(turn) + np.cross(k, u) * np.sin(turn) + k * (k @ u) * (1 - np.cos(turn))
            left -= THRUST / EXHAUST * dt
            half = r + v * dt / 2
            v = v + dt * (THRUST / (left + THRUST / EXHAUST * dt / 2) * along - MU / np.linalg.norm(half)**3 * half)
            r, t = half + v * dt / 2, t + dt
        return t, MASS - left
    lasts, used = flown(PLAN.start, PLAN.rate_N)
    assert lasts == pytest.approx(PLAN.ends - PLAN.start, abs=1) and used == pytest.approx(PLAN.used, abs=0.4)
    assert np.linalg.norm(PLAN.dv_N) == pytest.approx(EXHAUST * np.log(MASS / (MASS - PLAN.used)))
    for start, rate in ((PLAN.start + 120, 1), (PLAN.start - 120, 1), (PLAN.start, 1.3), (PLAN.start, 0.7)):
        assert flown(start, rate * PLAN.rate_N)[1] > used
    assert 2 * np.pi * np.sqrt((MU / (-2 * ENERGY))**3 / MU) == pytest.approx(PERIOD.value)
    assert PLAN.start < PERIAPSIS.value < PLAN.ends


def flown(*first, **changes):
    return insertion.fly(fledge.load("mars_orbiter"), *first, **changes)


def test_the_insertion():
    sim = fledge.load("mars_orbiter")
    sim.plots = False
    sim.scenarios["insertion"]()


@pytest.mark.long("flies the insertion again")
def test_an_engine_that_is_10_percent_weak():
    captured = flown(engines=lambda planned: {"F": [108, *[120] * 5]})
    insertion.check_captured(captured)


@pytest.mark.long("flies the insertion again")
def test_resets_in_the_main_burn():
    """Two unplanned ones: the burn goes on each time, and no command is executed twice."""
    captured = flown(power=lambda planned: {"reset_at": [planned.start + 600, planned.start + 900, 0, 0]})
    insertion.check_captured(captured, hours=6, miss=0.5)
    assert [event.name for event in captured.events_of("burned.event")][-3:] == ["RESUMED", "CUT", "RESUMED"]
    commands = [report for report in captured.sim.flight.commands.reports if report.stored_on == 0 and report.executed]
    assert len(commands) == 7 and all(report.good for report in commands)
    assert all(a.t < b.t for a, b in pairwise(commands)) and captured.sim.flight.boot.boot.boots == 4


@pytest.mark.long("flies the insertion again")
def test_a_link_that_is_lost_while_the_plan_is_sent():
    """What has come is no file; once the link is back, the ground sends all again."""
    def loses(sim):
        files = sim.flight.files
        files.ack_timer = files.nak_timer = files.inactivity = 0 * s        # as they are without the radio
        with ground.connect(sim) as craft:
            craft.listen(60 * s)
            path = sim.mission.folder / "plan.py"
            with pytest.raises(NoAnswer):
                craft.put(path, to="boot/plan", within=0.3 * s)
        sim.run(9 * minute)
        assert sim.flight.files.state.failed == 1 and sim.flight.files.state.receiving == 0
    captured = flown(loses)
    insertion.check_captured(captured)
    assert [event.name for event in captured.events_of("files.event")] == ["FAULT", "FAILED"]


@pytest.mark.long("flies the insertion again")
@pytest.mark.parametrize("name, channel, why", [("rcs", 5, "OFF_POINT"), ("engines", 2, "OFF_POINT")])
def test_a_valve_that_is_stuck_shut(name, channel, why):
    captured = flown(**{name: lambda planned: {"faults": [
        {"kind": "DEAD", "channels": 1 << channel, "begin": (planned.start + 300) * s}]}})
    insertion.check_safe(captured, why)
