# SPDX-License-Identifier: Apache-2.0
"""The coefficients of an ephemeris, as flight evaluates them, against the Sky that they come from."""

import hashlib

import numpy as np
import pytest

import fledge
from fledge import SetupError, Simulation, world
from fledge import flight as fsw
from fledge.units import day, hour, km, m, minute, s
from fledge.world import chebyshev
from tests.needs import needs

pytestmark = needs("casacore-data-jpl-de405")


@pytest.fixture(scope="module")
def sky():
    return world.Sky("2015-03-02T12:00:00 TDB", center=world.EARTH)


def fly(fit, duration, step):
    sim = Simulation("ephemeris")
    sim.flight.body = fsw.ChebyshevEphemeris(**fit)
    sim.flight.task("flight", every=step, run=[sim.flight.body])
    log = sim.record(sim.flight.body.body, every=step)
    sim.run(duration)
    return sim, log


@pytest.mark.parametrize("body, within, duration", [(world.MOON, 10 * m, 8 * day), (world.SUN, 1 * km, 30 * day),
                                                    (world.MARS, 100 * m, 1 * day)])
def test_flight_holds_the_bound_over_the_whole_span(sky, body, within, duration):
    fit = world.fit_ephemeris(sky, body, within=within, duration=duration)
    _, log = fly(fit, duration, duration / 977)
    truth = [sky.state(body, t) for t in log.time]
    off = np.linalg.norm(log["body.r_PN_N"] - [state.r_PN_N for state in truth], axis=1)
    assert len(off) >= 977 and off.max() < 1.001 * float(within / m)
    speed = np.linalg.norm(log["body.v_PN_N"] - [state.v_PN_N for state in truth], axis=1)
    assert speed.max() < 100 * float(within / m) / (fit["duration"] / 1e9 / fit["n"])
    assert set(log["body.head.quality"]) == {3}


def test_a_tighter_bound_takes_more_and_the_fewest_that_suffice(sky):
    sizes = []
    for within in (100 * km, 1 * km, 10 * m):
        fit = world.fit_ephemeris(sky, world.MOON, within=within, duration=4 * day)
        sizes.append(fit["segments"] * fit["n"])
        assert not fit["c"][fit["segments"]:].any() and not fit["c"][:, fit["n"]:].any()
    assert sizes == sorted(set(sizes))


def test_the_coefficients_have_the_same_bits_on_every_machine(sky):
    """They are numbers of flight: no processor, library or version of Python may change them."""
    fit = world.fit_ephemeris(sky, world.SUN, within=1 * km, duration=10 * day)
    assert hashlib.sha256(fit["c"].tobytes()).hexdigest()[:16] == "608d751d67e77950"
    nodes = chebyshev._nodes()
    assert max(abs(x + np.cos(np.pi * (2 * k + 1) / 32)) for k, x in enumerate(nodes)) < 3e-16


def test_beyond_its_span_flight_says_so(sky):
    fit = world.fit_ephemeris(sky, world.MOON, within=1 * km, start=1 * hour, duration=1 * hour)
    sim, _ = fly(fit, 30 * minute, 1 * minute)
    assert sim.flight.body.body.head.quality == 0 and sim.flight.body.state.left == 0
    sim.run(1 * hour)
    assert sim.flight.body.body.head.quality == 3 and 1799 < sim.flight.body.state.left < 1801
    sim.run(1 * hour)
    assert sim.flight.body.body.head.quality == 2


def test_positions_may_be_relative_to_another_body(sky):
    fit = world.fit_ephemeris(sky, world.EARTH, center=world.SUN, within=1 * km, duration=1 * day)
    sim, _ = fly(fit, 12 * hour, 12 * hour)
    expected = sky.state(world.EARTH, 12 * hour, center=world.SUN)
    assert np.linalg.norm(sim.flight.body.body.r_PN_N - expected.r_PN_N) < 1e3


@pytest.mark.parametrize("words, given", [
    ("within and duration must be > 0", {"within": 0, "duration": 1 * day}),
    ("within and duration must be > 0", {"within": 1 * m, "duration": 0}),
    ("take a shorter duration", {"within": 1 * m, "duration": 4000 * day}),
    ("within", {"within": 1 * s, "duration": 1 * day}),
])
def test_impossible_fits_are_refused(sky, words, given):
    with pytest.raises(SetupError, match=words):
        world.fit_ephemeris(sky, world.MOON, **given)


def test_a_span_beyond_the_sky_is_refused(sky):
    with pytest.raises(SetupError):
        world.fit_ephemeris(sky, world.MOON, within=1 * km, start=40000 * day, duration=1 * day)
