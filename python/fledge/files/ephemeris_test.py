# SPDX-License-Identifier: Apache-2.0
"""OEMs and AEMs as arrays: between their lines by closed forms and other programs, and each refusal."""

import math

import numpy as np
import pytest

from fledge import attitude, files
from fledge.errors import SetupError
from fledge.files import ndm, tables
from fledge.files.ephemeris import AemSegment, OemSegment
from fledge.files.testing.examples import AEM, OCM, OEM, OPM, replaced
from tests.needs import module


def test_an_ephemeris_counts_leap_seconds_and_is_interpolated_within_its_span():
    segment = files.read(OEM).segment
    assert np.abs(np.diff(segment.times) - 10**9).max() <= 1      # TDB, rounded
    r, v = segment.at(segment.times[0] + np.array([0, 1_500_000_000, 3 * 10**9]))
    assert np.allclose(r, [[7e6, 0, 0], [7e6, 11250, 0], [7e6, 22500, 0]], atol=2e-5) and np.all(v == [0, 7500, 0])
    first, last = segment.span
    for t, text in ((first - 1, "2016-12-31T23:59:58.999999999"), (last + 1, "00:00:01.00000000")):
        with pytest.raises(SetupError, match=f"from 2016-12-31T23:59:59 to 2017-01-01T00:00:01 UTC; found .*{text}"):
            segment.at(t)
    with pytest.raises(SetupError, match="expected times \\[ns\\] as whole numbers; found float64"):
        segment.at(0.5)
    assert segment.covariances[0].covariance().shape == (6, 6)
    with pytest.raises(SetupError, match="line 30: expected a covariance that is positive semi-definite; found the "
                                         "least eigenvalue -1 "):
        segment.covariances[1].covariance()


def test_without_a_method_the_polynomial_goes_through_the_lines_that_there_are():
    times, power = np.arange(4) * 10**9, np.arange(4.0)[:, None]**[3, 2, 1]
    segment = OemSegment.of({"TIME_SYSTEM": "TDB"}, times, power, power)
    assert np.allclose(segment.at(1_500_000_000)[0], [[1.5**3, 1.5**2, 1.5]], rtol=1e-14)
    alone = OemSegment.of({"TIME_SYSTEM": "TDB"}, times[:1], power[:1], power[:1])
    assert np.array_equal(alone.at(0)[0], power[:1])


def test_attitudes_are_quaternions_and_turn_about_a_fixed_axis():
    segment = files.read(AEM).segment
    found = segment.at(segment.times[0] + np.arange(3) * 5 * 10**9)
    half = np.radians([0, 22.5, 45])
    assert np.allclose(found, np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=-1), atol=1e-15)
    opposite = files.read(AEM.replace("A2B", "B2A")).segment.at(segment.times[-1])
    assert np.allclose(opposite, found[2] * [1, -1, -1, -1])
    euler = AEM.replace("= QUATERNION\nQUATERNION_TYPE = FIRST", "= EULER_ANGLE\nEULER_ROT_SEQ = 321").replace(
        "1 0 0 0", "30 20 10").replace("-0.7071067811865476 0 0 -0.7071067811865476", "31 20 10")
    beta = files.read(euler).segment.beta_BA[0]
    assert np.allclose(beta, attitude.euler_to_quaternion(np.radians([30, 20, 10]), "321"), atol=1e-15)


def test_a_spin_is_the_attitude_that_another_program_makes_of_it():
    """The numbers are those of Orekit's tests of APMs."""
    spin = AEM.replace("= QUATERNION\nQUATERNION_TYPE = FIRST", "= SPIN").replace(
        "1 0 0 0", "93.41653162826968 -4.086638116176034 126.92845735704692 0").replace(
        "-0.7071067811865476 0 0 -0.7071067811865476", "0 0 0 0")
    expected = [0.6184633325084984, -0.6447327809733585, -0.3463409538535587, -0.28613054916357517]
    assert abs(files.read(spin).segment.beta_BA[0] @ expected) == pytest.approx(1, abs=1e-15)
    assert np.allclose(files.read(spin).segment.beta_BA[0] * -1, expected, atol=1e-14)


@pytest.mark.parametrize("method, degree, tolerance", [
    ("LAGRANGE", 7, 3e-3), ("LAGRANGE", 8, 1e-3), ("HERMITE", 7, 2e-5), ("HERMITE", 11, 1e-6),
    ("LINEAR", 1, 7e6 * (0.001078 * 30)**2 / 8)])     # the height of the arc over its chord
def test_interpolation_follows_an_orbit(method, degree, tolerance):
    n = math.sqrt(3.986004418e14 / 7e6**3)
    times = np.arange(0, 3000, 30)

    def orbit(t):
        zero = np.zeros_like(t, dtype=float)
        return (7e6 * np.stack([np.cos(n * t), np.sin(n * t), zero], axis=-1),
                7e6 * n * np.stack([-np.sin(n * t), np.cos(n * t), zero], axis=-1))

    meta = {"TIME_SYSTEM": "TDB", "INTERPOLATION": method, "INTERPOLATION_DEGREE": degree}
    segment = OemSegment.of(meta, times * 10**9, *orbit(times))
    t = np.linspace(0, 2970, 1000).round(3)
    r, v = segment.at(np.round(t * 1e9).astype(np.int64))
    inside = (t > 150) & (t < 2820)
    assert np.abs(r - orbit(t)[0])[inside].max() < tolerance
    assert np.abs(v - orbit(t)[1])[inside].max() < tolerance * n * 50
    for i in range(0, 100, 7):      # through the lines themselves
        assert np.abs(segment.at(segment.times[i])[0][0] - segment.r[i]).max() < 1e-8


def test_rates_are_those_of_what_is_between_the_lines():
    # Against differences of a ms, with velocities and derivatives that are not quite those of the positions.
    generator, times = np.random.default_rng(3), np.arange(8) * 10 * 10**9
    angles = np.cumsum(generator.uniform(0.1, 0.4, 8))
    beta = np.stack([np.cos(angles), np.sin(angles), 0.1 * np.sin(angles), 0 * angles], axis=1)
    beta /= np.linalg.norm(beta, axis=1, keepdims=True)
    t = generator.integers(times[0] + 10**7, times[-1] - 10**7, 50)
    t = t[t % 10**10 > 2 * 10**6]
    for method, degree in (("LINEAR", 1), ("LAGRANGE", 3), ("HERMITE", 3), ("HERMITE", 7)):
        meta = {"TIME_SYSTEM": "TDB", "REF_FRAME_A": "ICRF", "REF_FRAME_B": "BODY", "INTERPOLATION_DEGREE": degree}
        orbit = OemSegment.of({**meta, "INTERPOLATION": method}, times, *generator.normal(size=(2, 8, 3)))
        turn = AemSegment.of({**meta, "INTERPOLATION_METHOD": method}, times, beta, generator.normal(size=(8, 3)) / 9)
        for segment, tolerance in ((orbit, 1e-6), (turn, 1e-6)):
            (before, _), (found, rates), (after, _) = (segment.curve(t + shift) for shift in (-10**6, 0, 10**6))
            assert np.allclose(rates, (after - before) / 2e-3, rtol=0, atol=tolerance)
            assert np.array_equal(found, segment.at(t) if segment is turn else segment.at(t)[0])


def test_an_attitude_with_derivatives_meets_them_unless_its_message_says_otherwise():
    # About an axis that stands, by an angle that grows with the square of time.
    times, axis = np.arange(0, 101, 10), np.array([2, -1, 2]) / 3

    def turned(t):
        return np.hstack([np.cos(1e-4 * t**2)[:, None], np.sin(1e-4 * t**2)[:, None] * axis])

    meta = {"TIME_SYSTEM": "TDB", "REF_FRAME_A": "ICRF", "REF_FRAME_B": "BODY"}
    t, rate = np.arange(0, 101, 3), (4e-4 * times)[:, None] * axis
    for more, omega, within in (({}, rate, 1e-5), ({}, None, 1.5e-2),
                                ({"INTERPOLATION_METHOD": "LINEAR", "INTERPOLATION_DEGREE": 1}, rate, 1.5e-2)):
        segment = AemSegment.of({**meta, **more}, times * 10**9, turned(times), omega)
        far = np.abs(segment.at(t * 10**9) - turned(t)).max()
        assert within / 10 < far < within


def test_interpolation_is_that_of_another_program():
    scipy = module("scipy.interpolate")
    generator = np.random.default_rng(1)
    times = np.sort(generator.choice(1000, 4, replace=False)) * 10**9
    r, v = generator.normal(size=(2, 4, 3)) * 1e6
    segment = OemSegment.of({"TIME_SYSTEM": "TDB", "INTERPOLATION": "HERMITE", "INTERPOLATION_DEGREE": 7}, times, r, v)
    t = generator.integers(times[0], times[-1], 20)
    theirs = scipy.KroghInterpolator(np.repeat(times / 1e9, 2), np.stack([r, v], axis=1).reshape(8, 3))
    ours = segment.at(t)
    assert np.allclose(ours[0], theirs(t / 1e9), rtol=1e-9, atol=1e-2)
    assert np.allclose(ours[1], theirs.derivative(t / 1e9), rtol=1e-9, atol=1e-2)


def test_a_frame_of_pandas_goes_there_and_back(tmp_path):
    module("pandas")
    segment = files.read(OEM).segment
    frame = segment.to_pandas()
    assert frame["Y"].tolist() == [0, 7500, 15000, 22500] and len(frame) == 4
    meta = {key: value for key, value in segment.meta.values.items() if not key.startswith("INTERP")}
    with pytest.raises(SetupError, match="expected the columns X, Y, Z; there is no Y"):
        OemSegment.from_pandas(frame.drop(columns="Y"), meta).r
    again = OemSegment.from_pandas(frame, meta)
    files.write(ndm.create("OEM", [again], originator="TEAM", created="2026-01-01T00:00:00"), tmp_path / "a.oem")
    found = files.read(tmp_path / "a.oem").segment
    assert np.array_equal(found.times, segment.times) and np.array_equal(found.r, segment.r)
    attitudes = files.read(AEM).segment
    again = AemSegment.from_pandas(attitudes.to_pandas(), attitudes.meta.values)
    assert np.array_equal(again.beta_BA, attitudes.beta_BA)


@pytest.mark.parametrize("text, expected", [
    (replaced(OEM, "LAGRANGE", "SPLINE"), "INTERPOLATION: expected LINEAR, LAGRANGE, HERMITE; found SPLINE"),
    (replaced(OEM, "INTERPOLATION_DEGREE = 1", "INTERPOLATION_DEGREE = 4"), "up to 3, which 4 lines allow; found 4"),
    (replaced(OEM, "INTERPOLATION_DEGREE = 1", "INTERPOLATION_DEGREE = 0"), "INTERPOLATION_DEGREE: expected 1 or more"),
    (replaced(AEM, "1 0 0 0", "2 0 0 0"), "line 1 of the table: expected a unit quaternion; found one of length 2"),
    (AEM[:AEM.index("= QUAT")] + "= SPIN/NUTATION\nMETA_STOP\nDATA_START\n2026-01-01T00:00:00 0 0 0 0 0 0 0\nDATA_STOP",
     "ATTITUDE_TYPE: expected quaternions, Euler angles or SPIN; found SPIN/NUTATION: use the columns"),
])
def test_what_cannot_be_interpolated_is_refused_when_it_is_used(text, expected):
    segment = files.read(text).segment
    with pytest.raises(SetupError) as error:
        segment.at(segment.times[0])
    assert expected in str(error.value), str(error.value)


def test_arrays_that_are_no_segment_are_refused():
    r = np.zeros((2, 3))
    for times, lines in (([1, 1], r), ([1, 2, 3], r), ([1.0, 2.0], r), (["2026-01-01", "2026-01-02"], r),
                         ([1, 2], r[0])):
        with pytest.raises(SetupError, match="OemSegment: expected EPOCH \\[ns\\], whole numbers that increase, and"):
            OemSegment.of({}, times, lines, lines)
    with pytest.raises(SetupError, match="create: expected a message of OPM, OMM, OEM, .*; found 'TDM'"):
        ndm.create("TDM", [], originator="T", created="2026-01-01T00:00:00")
    with pytest.raises(SetupError, match="no_such.oem: expected a file, or a text of several lines; No such file"):
        files.read("no_such.oem")
    with pytest.raises(SetupError, match="the correlations do not fit the covariances beside them"):
        tables.history(files.read(OCM.replace("5e-7 0 0.5", "5e-7 0 0.4"))["COV"])
    with pytest.raises(SetupError, match="STATE has no covariance; a block COVARIANCE of an OPM, OMM, OEM or CDM has"):
        files.read(OPM)["STATE"].covariance()
