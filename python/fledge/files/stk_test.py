# SPDX-License-Identifier: Apache-2.0
"""Files of STK: published ones, round trips, and each refusal."""

from contextlib import suppress

import numpy as np
import pytest

from fledge import attitude, files
from fledge.errors import SetupError
from fledge.files import ndm, stk
from fledge.files.ephemeris import AemSegment, OemSegment
from fledge.files.testing.examples import OPM, damaged, replaced

# The first lines of Orekit's example of an ephemeris that STK wrote: positions, velocities, accelerations.
ROWS = """
 0.0000000000000000e+00 -4.2001828159554983e+06 -3.9105939267270239e+06 -4.5819301444368772e+06
 6.0000000000000000e+01 -3.8641543651398388e+06 -4.1811384442211185e+06 -4.6384904619383067e+06
 1.2000000000000000e+02 -3.5141462265661480e+06 -4.4365570058648754e+06 -4.6782248721729051e+06
 1.8000000000000000e+02 -3.1514214711790215e+06 -4.6759211491462803e+06 -4.7009847013899973e+06
 2.4000000000000000e+02 -2.7772858927748781e+06 -4.8983541175281964e+06 -4.7066768626843216e+06
 3.0000000000000000e+02 -2.3930847437297828e+06 -5.1030332553920103e+06 -4.6952642374704480e+06
""".strip("\n").split("\n")
VELOCITIES = """
 5.4770282903204152e+03 -4.6296785954320931e+03 -1.0817325337227874e+03
 5.7202901814599727e+03 -4.3855912442681747e+03 -8.0287100854531127e+02
 5.9428768124875878e+03 -4.1256141594350274e+03 -5.2107176536950249e+02
 6.1440495799890250e+03 -3.8505887646286237e+03 -2.3725719698217702e+02
 6.3231236746481936e+03 -3.5613966825084581e+03  4.7643476529094748e+01
 6.4794691416813621e+03 -3.2589590411954355e+03  3.3269516839203544e+02
""".strip("\n").split("\n")
HEAD = """stk.v.12.0

# WrittenBy    STK_v12.2.0

BEGIN Ephemeris

    NumberOfEphemerisPoints\t\t 6
    ScenarioEpoch\t\t 12 Jan 2007 00:00:00.000883
    InterpolationMethod\t\t Lagrange
    InterpolationSamplesM1\t\t 5
    CentralBody\t\t Earth
    CoordinateSystem\t\t J2000
# Time of first point: 12 Jan 2007 00:00:00.000883000 UTCG

"""
POSITIONS = "\n".join([f"{HEAD}    EphemerisTimePos", *ROWS, "END Ephemeris", ""])
ORBIT = "\n".join([f"{HEAD}    EphemerisTimePosVel", *(a + b for a, b in zip(ROWS, VELOCITIES)), "END Ephemeris", ""])
# The example of STK's help, "AttitudeTimeQuatAngVels Format": a spin of 6 deg/s about the third axis,
# its tiny numbers with fewer digits.
SPIN = """stk.v.5.0
BEGIN Attitude
ScenarioEpoch           1 Jun 2002 12:00:00.000000000
NumberOfAttitudePoints  4
BlockingFactor          20
InterpolationOrder      1
CentralBody             Earth
CoordinateAxes        \tJ2000
AttitudeTimeQuatAngVels
0.0e+000 -2.424e-017 0.0e+000 0.0e+000 1.000e+000 4.798e-017 -4.004e-017 6.000e+000
1.00e+001 -2.097e-017 1.215e-017 5.00e-001 8.660254037844e-001 3.618e-017 2.477e-017 6.000e+000
2.00e+001 -1.198e-017 2.114e-017 8.660254037844e-001 5.00e-001 2.111e-017 -1.161e-017 6.000e+000
3.00e+001 8.289e-020 2.417e-017 1.000e+000 1.110e-016 -2.391e-018 -4.475e-018 6.000e+000
END Attitude
"""


def test_an_ephemeris_of_stk_is_an_oem(tmp_path):
    (tmp_path / "craft.e").write_text(ORBIT)
    message = files.read(tmp_path / "craft.e")
    segment = message.segment
    assert message.kind == "OEM" and len(segment.times) == 6 and segment.interpolation == ("LAGRANGE", 5)
    assert [segment.meta[key] for key in ("OBJECT_NAME", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM")] == [
        "CRAFT", "EARTH", "J2000", "UTC"]
    assert [segment.clock.text(t) for t in segment.times[[0, 5]]] == ["2007-01-12T00:00:00.000883",
                                                                      "2007-01-12T00:05:00.000883"]
    assert segment.r[5].tolist() == [-2.3930847437297828e+06, -5.1030332553920103e+06, -4.6952642374704480e+06]
    assert segment.v[5].tolist() == [6.4794691416813621e+03, -3.2589590411954355e+03, 3.3269516839203544e+02]
    assert segment.a is None
    files.write(message, tmp_path / "craft.oem")
    assert np.array_equal(files.read(tmp_path / "craft.oem").segment.r, segment.r)


def test_of_positions_alone_velocities_are_the_rates_of_the_polynomial():
    alone, segment = files.read(POSITIONS).segment, files.read(ORBIT).segment
    assert np.array_equal(alone.r, segment.r)
    derivative = np.polynomial.Polynomial.fit(np.arange(6) * 60, segment.r[:, 0], 5).deriv()
    np.testing.assert_allclose(alone.v[:, 0], derivative(np.arange(6) * 60), rtol=1e-9)
    t = segment.times[2] + 30 * 10**9
    np.testing.assert_allclose(alone.at(t)[1][:, 0], derivative(150), rtol=1e-9)
    assert np.abs(alone.v - segment.v).max() < 0.2       # STK's are no exact rates of its positions


def test_segments_end_at_the_boundaries():
    """As in Orekit's example of an impulsive maneuver; without a second line at it, both have that of the boundary."""
    twice = [a + b for a, b in zip(ROWS, VELOCITIES)]
    begin = "BEGIN SegmentBoundaryTimes\n 0.0\n 1.2e2\nEND SegmentBoundaryTimes\n    EphemerisTimePosVel"
    text = replaced(ORBIT, "    EphemerisTimePosVel", begin)
    first, second = files.read(text).segments
    assert [len(first.times), len(second.times)] == [3, 4] and second.times[0] == first.times[-1]
    assert first.interpolation == ("LAGRANGE", 2) and np.array_equal(second.v[0], first.v[-1])
    text = replaced(replaced(text, twice[2], twice[2] + "\n" + ROWS[2] + VELOCITIES[3]), "Points\t\t 6", "Points 7")
    first, second = files.read(text).segments
    assert [len(first.times), len(second.times)] == [3, 4] and second.times[0] == first.times[-1]
    assert second.v[0].tolist() == [6.1440495799890250e+03, -3.8505887646286237e+03, -2.3725719698217702e+02]
    for segments in ([first, second], [second, first]):
        message = ndm.create("OEM", segments, originator="TEAM", created="2026-01-01T00:00:00")
        again = files.read(stk.text_of(message))
        assert [len(segment.times) for segment in again.segments] == [3, 4]
        assert np.array_equal(again.segments[1].v, second.v)


def test_covariances_are_those_of_an_oem(tmp_path):
    """In a lower triangle over three lines, as STK breaks it, and in an upper one of kilometers."""
    random = np.random.default_rng(3)
    root = random.normal(size=(6, 6))
    matrix = root @ root.T
    for form, (i, j), unit in (("LowerTriangular", np.tril_indices(6), ""),
                               ("UpperTriangular", np.triu_indices(6), "    DistanceUnit Kilometers\n")):
        words = ["6.0e1", *(repr(float(x)) for x in matrix[i, j])]
        rows = [" ".join(words[:8]), "   " + " ".join(words[8:15]), "   " + " ".join(words[15:])]
        text = replaced(ORBIT, "END Eph", "\n".join(["", "CovarianceTimePosVel", *rows, "END Eph"]))
        text = replaced(text, "    CentralBody", f"{unit}    CovarianceFormat {form}\n    CentralBody")
        message = files.read(text)
        section, = message.segment.covariances
        np.testing.assert_allclose(section.covariance(), matrix * (1e6 if unit else 1), rtol=1e-15)
        assert section["EPOCH"] == message.segment.times[1]
        for again in (files.read(stk.text_of(message)), ndm.read(ndm.text_of(message))):
            assert again.segment.covariances[0].values == section.values
        for old, new, expected in (
                (words[-1] + "\n", "\n", "expected a time and 21 numbers of CovarianceTimePosVel; found 21"),
                ("CovarianceFormat", "#", "CovarianceFormat: expected LowerTriangular or UpperTriangular; found none"),
                (words[3], "1e", "expected a number; found '1e'"), ("\n6.0e1", "\n6.0x", "expected a time, EpSec")):
            with pytest.raises(SetupError, match=expected):
                files.read(replaced(text, old, new))


def test_an_attitude_of_stk_is_an_aem():
    segment = files.read(SPIN).segment
    assert segment.meta["ATTITUDE_TYPE"] == "QUATERNION/ANGVEL" and segment.meta["REF_FRAME_A"] == "J2000"
    turned = [attitude.euler_to_quaternion(np.radians([angle, 0, 0]), "321") for angle in (0, 60, 120, 180)]
    np.testing.assert_allclose(segment.beta_BA, turned, atol=1e-12)
    np.testing.assert_allclose(segment.table.columns["ANGVEL_Z"], np.radians(6), rtol=1e-15)
    t = segment.times[0] + 5 * 10**9
    expected = [[np.cos(np.radians(15)), 0, 0, np.sin(np.radians(15))]]
    np.testing.assert_allclose(segment.at(t), expected, atol=1e-12)         # order 1 turns about a fixed axis
    assert "QUATERNION/ANGVEL" in ndm.text_of(files.read(SPIN))
    alone = "\n".join(" ".join(line.split()[:5]) for line in SPIN.split("\n"))
    for block in ("AttitudeTimeQuaternions", "AttitudeTimeQuatScalarFirst"):
        found = files.read(alone.replace("AttitudeTimeQuatAngVels", block)).segment.table.columns
        order = ("Q1", "Q2", "Q3", "QC") if block.endswith("ions") else ("QC", "Q1", "Q2", "Q3")
        assert [found[name][1] for name in order] == [-2.097e-17, 1.215e-17, 0.5, 0.8660254037844]


def test_angular_velocities_are_the_rates_of_a_hermite_polynomial():
    coarse = files.read(replaced(SPIN, "InterpolationOrder", "InterpolationMethod Hermite\nInterpolationOrder")).segment
    t = coarse.times[0] + np.arange(0, 30, 2) * 10**9
    half = np.radians(3) * np.arange(0, 30, 2)
    expected = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    assert coarse._method("INTERPOLATION_METHOD") == ("HERMITE", 3)
    assert np.abs(coarse.at(t) - expected).max() < (np.pi / 6)**4 / 384     # the bound of a cubic
    beta = coarse.beta_BA
    turned = np.radians(6) / 2 * np.stack([-beta[:, 3], beta[:, 2], -beta[:, 1], beta[:, 0]], axis=1)
    np.testing.assert_allclose(coarse.rates(beta), turned, atol=1e-12)


def test_what_is_written_is_read_with_its_bits(tmp_path):
    random = np.random.default_rng(2)
    clock = OemSegment.of({"TIME_SYSTEM": "UTC"}, [0], [[0, 0, 0]], [[0, 0, 0]]).clock
    begin = clock.ns("2016-12-31T23:59:57.5")       # before a leap second
    for i, (method, frame, center) in enumerate([("HERMITE", "ICRF", "EARTH"), ("LAGRANGE", "TEMEOfDate", "EARTH"),
                                                 ("LAGRANGE", "Fixed", "EARTH"), ("LAGRANGE", "IAU_MARS", "MARS")]):
        times = begin + np.cumsum(random.integers(1, 2 * 10**9, 20))
        meta = {"OBJECT_NAME": f"X{i}", "OBJECT_ID": "UNKNOWN", "CENTER_NAME": center, "TIME_SYSTEM": "UTC"}
        orbit = OemSegment.of({**meta, "REF_FRAME": frame, "INTERPOLATION": method, "INTERPOLATION_DEGREE": 7}, times,
                              *random.normal(size=(2, 20, 3)) * 10.0**random.integers(-9, 9, (2, 20, 3)))
        beta = random.normal(size=(20, 4))
        turn = AemSegment.of({**meta, "REF_FRAME_A": frame, "REF_FRAME_B": "SC_BODY_1"}, times,
                             beta / np.linalg.norm(beta, axis=1, keepdims=True))
        for kind, segment in (("OEM", orbit), ("AEM", turn)):
            message = ndm.create(kind, [segment], originator="TEAM", created="2026-01-01T00:00:00")
            files.write(message, tmp_path / f"x{i}.stk", "stk")
            again = files.read(tmp_path / f"x{i}.stk").segment
            assert {**again.meta.values, **segment.meta.values} == {**again.meta.values, "START_TIME": times[0],
                                                                    "STOP_TIME": times[-1]}
            assert np.array_equal(again.times, segment.times)
            assert all(np.array_equal(again.table.columns[key], values) for key, values in segment.table.columns.items()
                       if key != "EPOCH")


def test_units_times_and_frames_are_those_of_the_file():
    segment = files.read(ORBIT).segment
    with pytest.warns(UserWarning, match="line 7: NumberOfEphemerisPoints is 146, and EphemerisTimePosVel has 6 lines"):
        fewer = files.read(replaced(ORBIT, "Points\t\t 6", "Points\t\t 146"))
    assert np.array_equal(fewer.segment.times, segment.times)
    for key, given, degree in (("SamplesM1", 2, 5), ("Order", 5, 5), ("Order", 1, 3), ("Order", 7, 7)):
        text = replaced(ORBIT, "InterpolationSamplesM1\t\t 5", f"Interpolation{key} {given}")
        assert files.read(replaced(text, "Lagrange", "Hermite")).segment.interpolation == ("HERMITE", degree)
    text = replaced(ORBIT, "    CentralBody", "    DistanceUnit Kilometers\n    TimeScale TDB\n    CentralBody")
    found = files.read(text).segment
    np.testing.assert_allclose(found.r, segment.r * 1000, rtol=1e-15)
    np.testing.assert_allclose(found.v, segment.v * 1000, rtol=1e-15)
    assert np.array_equal(np.diff(found.times), np.full(5, 60 * 10**9)) and found.times[0] == segment.times[0]
    dated = ORBIT.replace("    CentralBody", "    TimeFormat UTCG\n    CentralBody")
    for i, row in enumerate(ROWS):
        dated = dated.replace(row[:23], f"12 Jan 2007 00:0{i}:00.000883")
    assert np.array_equal(files.read(dated).segment.times, segment.times)
    for system, body, expected in (("Fixed", "Earth", "Fixed"), ("fixed", "Mars", "IAU_MARS"),
                                   ("TEMEOfDate", "Earth", "TEMEOfDate"), ("Custom A Satellite/B", "Earth",
                                                                           "Custom A Satellite/B")):
        text = ORBIT.replace("J2000", system).replace("Body\t\t Earth", f"Body {body}")
        assert files.read(text).segment.meta["REF_FRAME"] == expected
        assert files.read(stk.text_of(files.read(text))).segment.meta["REF_FRAME"] == expected
    text = ORBIT.replace("J2000", "TEMEOfEpoch\n    CoordinateSystemEpoch 1 Feb 2007 00:00:00")
    again = files.read(stk.text_of(files.read(text))).segment
    assert again.meta["REF_FRAME_EPOCH"] == again.clock.ns("2007-02-01")
    for epoch, expected in (("29 Dec 2005 19: 0: 0.000268221", "2005-12-29T19:00:00.000268221"),
                            ("\"5 June 2006  7:58:18\"", "2006-06-05T07:58:18"),
                            ("2006-06-05T07:58:18", "2006-06-05T07:58:18")):
        text = ORBIT.replace("12 Jan 2007 00:00:00.000883\n", epoch + "\n")
        text = text.replace("J2000", "TEME\nCoordinateSystemEpoch " + epoch)
        found = files.read(text).segment
        assert found.meta["REF_FRAME"] == "TEMEOfEpoch" and found.clock.text(found.times[0]) == expected
        assert found.meta["REF_FRAME_EPOCH"] == found.times[0]


@pytest.mark.parametrize("text, expected", [
    (ORBIT[:ORBIT.index("END Eph")], "line 21: expected END Ephemeris; found the end of the file, which may be cut"),
    (replaced(ORBIT, "Points\t\t 6", "Points\t\t 5"),
     "line 7: NumberOfEphemerisPoints: expected 6 or more, the lines of EphemerisTimePosVel; found 5"),
    (replaced(ORBIT, ROWS[2][:23], " 6.0e1"), "line 18: expected a time after 6.0000000000000000e+01, that of the line "
     "before, or the same where SegmentBoundaryTimes has it; found 6.0e1"),
    (replaced(replaced(ORBIT, ROWS[1][:23], " 0.0"), "    Eph", "BEGIN SegmentBoundaryTimes\n0\n"
              "END SegmentBoundaryTimes\n    Eph"), "line 20: expected a time after 0.0"),
    (replaced(ORBIT, "    CentralBody", "DistanceUnit Furlongs\n    CentralBody"),
     "line 11: DistanceUnit: expected METERS or KILOMETERS; found Furlongs"),
    (replaced(ORBIT, "    CentralBody", "TimeFormat JDate\n    CentralBody"),
     "line 11: TimeFormat: expected EPSEC or ISO-YMD or UTCG; found JDate"),
    (replaced(ORBIT, "    CentralBody", "TimeScale UT1\n    CentralBody"), "TimeScale: expected TAI or TDB; found UT1"),
    (replaced(ORBIT, "EphemerisTimePosVel", "EphemerisLLATimePos"), "line 15: expected a table EphemerisTimePos, "
     "EphemerisTimePosVel, EphemerisTimePosVelAcc; found EphemerisLLATimePos"),
    (replaced(ORBIT, "EphemerisTimePosVel", "EphemerisTimePos"),
     "line 16: expected a time, EpSec, and 3 numbers, X Y Z; found 0.0"),
    (replaced(ORBIT, "12 Jan 2007 00:00:00.000883\n", "21545.0\n"),
     "line 8: ScenarioEpoch: expected a date of UTC, 1 Jun 2002 12:00:00.000; found 21545.0"),
    (replaced(ORBIT, "ScenarioEpoch", "# "), "line 5: ScenarioEpoch: expected a date of UTC"),
    (replaced(ORBIT, "Lagrange", "Hermite").replace("EphemerisTimePosVel", "EphemerisTimePos"), "found 0.0"),
    (replaced(POSITIONS, "Lagrange", "Hermite"), "InterpolationMethod: expected Lagrange, for EphemerisTimePos has no "
     "rates; found Hermite"),
    (replaced(ORBIT, "SamplesM1\t\t 5", "SamplesM1 five"),
     "SamplesM1: expected a whole number from 1 of up to 18 digits; found five"),
    (replaced(ORBIT, "Points\t\t 6", "Points\t\t " + "9" * 5000), "Points: expected a whole number from 0 of up to 18"),
    (replaced(ORBIT, "SamplesM1\t\t 5", "SamplesM1 \u0665"), "expected a whole number from 1"),
    (replaced(ORBIT, "12 Jan", "\u0661\u0662 Jan"), "ScenarioEpoch: expected a date of UTC"),
    (replaced(ORBIT, "Method\t\t Lagrange", "Method"), "line 9: InterpolationMethod: expected a value; there is none"),
    (replaced(ORBIT, "CentralBody", "CentralBdy"), "line 11: Ephemeris has no CentralBdy; did you mean 'CentralBody'?"),
    (replaced(ORBIT, "    CentralBody", "CentralBody Mars\n    CentralBody"),
     "line 12: CentralBody is given twice; the first is in line 11"),
    (replaced(ORBIT, "Body\t\t Earth", "Body Mars").replace("J2000", "TrueOfDate"), "line 12: CoordinateSystem: "
     "expected ICRF, J2000, Fixed, Inertial about MARS, as others are known of the Earth only; found TrueOfDate"),
    (replaced(ORBIT, "END Eph", "BEGIN Covariance\nEND Eph"), "line 22: expected BEGIN Ephemeris or BEGIN Attitude"),
    (replaced(ORBIT, "END Eph", "CovarianceTimePos\nEND Eph"),
     "line 22: expected a line of EphemerisTimePosVel, or END Ephemeris; found CovarianceTimePos"),
    (replaced(ORBIT, "END Ephemeris", "END Attitude"), "line 22: expected the end of what began last; found END Att"),
    (ORBIT + "1 2 3", "line 23: expected the end of the file; found 1 2 3"),
    (replaced(ORBIT, "BEGIN", ""), "line 5: expected BEGIN Ephemeris or Attitude; found Ephemeris"),
    (replaced(ORBIT, ROWS[1][:23], "1e1x"), "line 17: expected a time, EpSec; found '1e1x'"),
    (replaced(ORBIT, ROWS[1][:23], "1e99"), "line 17: expected a time, EpSec; found '1e99'"),
    (replaced(ORBIT, "5.7202901814599727e+03", "5.7e"), "line 17: expected a number; found '5.7e'"),
    (HEAD + "EphemerisTimePos\nEND Ephemeris", "line 5: expected a table, EphemerisTimePos, EphemerisTimePosVel, "
     "EphemerisTimePosVelAcc, with lines; there is none"),
    (replaced(SPIN, "CoordinateAxes        \tJ2000\n", ""),
     "line 2: CoordinateAxes: expected J2000, ICRF, Fixed ...; found none"),
    (replaced(SPIN, "AttitudeTimeQuatAngVels", "AttitudeTimeYPRAngles"), "line 9: expected a table "
     "AttitudeTimeQuaternions, AttitudeTimeQuatScalarFirst, AttitudeTimeQuatAngVels; found AttitudeTimeYPRAngles"),
])
def test_what_is_not_as_it_should_be_is_refused(text, expected):
    with pytest.raises(SetupError) as error:
        files.read(text)
    assert expected in str(error.value), str(error.value)


def test_any_damage_is_refused_or_harmless():
    """No error but SetupError, whatever a character turns into."""
    for text in damaged([ORBIT, POSITIONS, SPIN], 1500, 3):
        with suppress(SetupError):
            for segment in files.read(text).segments:
                segment.at(segment.times[:1])


def test_what_stk_does_not_have_is_not_written():
    orbit, spin = files.read(ORBIT), files.read(SPIN)

    def message(**meta):
        return ndm.create("OEM", [OemSegment.of({**orbit.segment.meta.values, "START_TIME": segment.times[0], **meta},
                                                segment.times, segment.r, segment.v) for segment in orbit.segments],
                          originator="TEAM", created="2026-01-01T00:00:00")

    for found, expected in (
            (files.read(OPM), "expected an OEM or AEM, which STK has as .e or .a; found OPM"),
            (message(REF_FRAME="RTN"), "expected a body and axes of STK, EARTH and ICRF, .*; found EARTH and RTN"),
            (message(CENTER_NAME="MARS", REF_FRAME="ITRF"), "found MARS and ITRF"),
            (message(CENTER_NAME="MARS BARYCENTER"), "found MARS BARYCENTER and J2000"),
            (message(TIME_SYSTEM="MET"), "TIME_SYSTEM: expected UTC, TAI, TT, TDB or GPS; found MET"),
            (ndm.create("OEM", [orbit.segment, orbit.segment], originator="T", created="2026-01-01T00:00:00"),
             "expected a segment that begins where the one before ends")):
        with pytest.raises(SetupError, match=expected):
            stk.text_of(found)
    spin.segment.meta.values.update(REF_FRAME_A="SC_BODY_1", REF_FRAME_B="J2000")       # of the axes in the body
    again = files.read(stk.text_of(spin)).segment
    np.testing.assert_allclose(again.beta_BA, spin.segment.beta_BA * [1, -1, -1, -1], atol=1e-15)
    assert again.meta["ATTITUDE_TYPE"] == "QUATERNION"
