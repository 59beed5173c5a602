# SPDX-License-Identifier: Apache-2.0
"""Frames of files against ERFA, SGP4 and numerical derivatives."""

import numpy as np
import pytest

from fledge import Orbit, SetupError, mean_elements, world
from fledge.world import reference_frames
from tests.needs import module, needs

pytestmark = needs("casacore-data-jpl-de405")
TLE = """1 25544U 98067A   20152.00000000  .00000000  00000-0  00000-0 0  9990
2 25544  51.6400  80.0000 0002000  30.0000 330.0000 15.49000000    06"""
FRAMES = ("ICRF", "EME2000", "TOD", "TEME", "ITRF2014", "IAU_MARS")


@pytest.fixture(scope="module")
def sky():
    return world.Sky("2020-06-01", center=world.EARTH, earth=world.EarthOrientation(ut1_tai=-37.2))


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("center", ["Earth", "Moon"])
def test_to_n_and_back_is_the_same(sky, frame, center):
    random = np.random.default_rng(1)
    times = np.array([0, 10**12, 86400 * 10**9])
    r, v = random.normal(size=(3, 3)) * 7e6, random.normal(size=(3, 3)) * 7e3
    r_N, v_N = reference_frames.to_N(sky, frame, center, times, r, v)
    back = reference_frames.from_N(sky, frame, center, times, r_N, v_N)
    np.testing.assert_allclose(back[0], r, atol=1e-6)
    np.testing.assert_allclose(back[1], v, atol=1e-9)
    assert (center == "Moon") == (np.linalg.norm(r_N - r, axis=1) > 1e8).all()


@pytest.mark.parametrize("frame", FRAMES)
def test_the_velocity_is_the_derivative_of_the_position(sky, frame):
    h = 10**9
    times = np.array([-h, 0, h]) + 5000 * 10**9
    # A straight way in the frame.
    r0, v = np.array([3e6, -5e6, 4e6]), np.array([3000.0, 2000.0, -6000.0])
    r = r0 + np.outer((times - times[1]) / 1e9, v)
    r_N, v_N = reference_frames.to_N(sky, frame, "Earth", times, r, np.tile(v, (3, 1)))
    np.testing.assert_allclose((r_N[2] - r_N[0]) / 2, v_N[1], atol=1e-4)


def test_teme_differs_from_the_true_equinox_by_the_equation_of_the_equinoxes(sky):
    erfa = module("erfa")
    for t in (0, 86400 * 100):
        turn = sky.teme_of_date(t) @ sky.true_of_date(t).T
        assert np.arctan2(turn[0, 1], turn[0, 0]) == pytest.approx(
            erfa.eqeq94(2451545.0, sky.epoch_at(t) / 86400), abs=0.1 / 206265)  # of IAU 1980 against IAU 2000A
        assert abs(turn[0, 1]) > 5 / 206265
        np.testing.assert_allclose(turn[2], [0, 0, 1], atol=0.1 / 206265)


def test_sgp4_in_teme_is_where_flight_has_it_in_n(sky):
    model = module("sgp4.api")
    satellite = model.Satrec.twoline2rv(*TLE.splitlines())
    elements = mean_elements.read(TLE).parameters()
    at = world.Sky("2020-06-01T01:00:00", center=world.EARTH)
    _, r, v = satellite.sgp4(2459001.5, 1 / 24)
    r_N, v_N = reference_frames.to_N(at, "TEME", "Earth", np.array([0]), 1e3 * np.array([r]), 1e3 * np.array([v]))
    orbit = Orbit.from_elements(at, **elements)
    assert np.linalg.norm(r_N[0] - orbit.r_BN_N) < 5        # flight has 13 terms of the nutation, to 0.1 arcsec
    assert np.linalg.norm(v_N[0] - orbit.v_BN_N) < 0.01


def test_unknown_frames_are_refused_with_the_known_ones(sky):
    times, rows = np.array([0]), np.zeros((1, 3))
    with pytest.raises(SetupError, match="a.oem, line 7: expected a reference frame of ICRF, GCRF, .*; found XYZ"):
        reference_frames.to_N(sky, "XYZ", "Earth", times, rows, rows, "a.oem, line 7")
    with pytest.raises(SetupError, match="frame: IAU_VESTA: "):
        reference_frames.turning(sky, "IAU_VESTA", times)
