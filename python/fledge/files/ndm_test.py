# SPDX-License-Identifier: Apache-2.0
"""Messages of CCSDS: values against those written by hand, round trips of random messages, and each refusal."""

import bz2
import gzip
import itertools
import lzma
import math
import random
import re
from contextlib import suppress
from decimal import Decimal

import numpy as np
import pytest

from fledge import files
from fledge.errors import SetupError
from fledge.files import messages, ndm, tables, values
from fledge.files.sections import Section, Segment
from fledge.files.testing.examples import AEM, APM, CDM, CDM_OBJECT, OCM, OEM, OMM, OPM, damaged, replaced
from tests.needs import module


def refused(text, expected):
    with pytest.raises(SetupError) as error:
        files.read_all(text)
    assert expected in str(error.value), str(error.value)


def test_values_are_in_si_and_stand_by_keyword():
    opm = files.read(OPM)
    state = opm["STATE"]
    assert (opm.kind, opm.version, opm.header["ORIGINATOR"]) == ("OPM", "3.0", "TEAM")
    assert opm.header.comments == ["of the header"] and state.comments == ["of the state"]
    assert [state[key] for key in ("X", "Y", "Z", "Y_DOT", "Z_DOT")] == [6878137.0, -15000.0, 0.0, 7612.5, 1.0]
    # TDB - TT is within 2 ms, and is -0.1 ms or so at J2000.
    assert abs(state["EPOCH"] - 1_000_000_001) < 200_000
    assert opm.segment.clock.text(state["EPOCH"]) == "2000-01-01T12:00:01.000000001"
    assert [maneuver["MAN_DV_2"] for maneuver in opm.segment.all("MANEUVER")] == [10.0, -10.0]
    assert opm["USER"]["USER_DEFINED_MODEL"] == "A = [b]" and opm["SPACECRAFT"]["MASS"] == 100.0
    covariance = opm["COVARIANCE"].covariance()
    assert covariance.shape == (6, 6) and covariance[0, 3] == covariance[3, 0] == 1e-3
    assert np.diag(covariance).tolist() == [4.0] * 3 + [1e-6] * 3
    rows = OPM.split("\n")
    at = rows.index("CX_X = 4e-6")
    turned = files.read("\n".join([*rows[:at], *rows[at:at + 21][::-1], *rows[at + 21:]]))
    assert np.array_equal(turned["COVARIANCE"].covariance(), covariance)
    with pytest.raises(SetupError, match="line 11: STATE has no Q; it has EPOCH, X, "):
        state["Q"]
    with pytest.raises(SetupError, match="the segment has no KEPLERIAN; it has META, STATE, SPACECRAFT, COVARIANCE"):
        opm["KEPLERIAN"]


def test_a_conjunction_has_two_objects():
    cdm = files.read(CDM)
    assert [part.meta["OBJECT_NAME"] for part in cdm.segments] == ["CRAFT 1", "CRAFT 2"]
    assert [part["STATE"]["Y"] for part in cdm.segments] == [1000.0, 2000.0]
    relative, second = cdm["RELATIVE"], cdm.segments[1]
    assert (relative["MISS_DISTANCE"], relative["COLLISION_PROBABILITY"]) == (1000.0, 4.8e-5)
    assert relative["TCA"] == values.Clock("UTC").ns("2026-01-03T00:00:00.5")
    assert second["OD"]["ACTUAL_OD_SPAN"] == 216000.0 and second["OD"]["RESIDUALS_ACCEPTED"] == 0.975
    covariance = second["COVARIANCE"].covariance()
    assert np.diag(covariance).tolist() == [100, 400, 25, 4e-4, 1e-4, 1e-4]
    assert covariance[4, 0] == covariance[0, 4] == -0.08 and covariance[3, 1] == -0.3


def test_an_attitude_and_mean_elements():
    apm = files.read(APM)
    assert (apm["QUATERNION"]["QC"], apm["RATE"]["ANGVEL_Z"], apm["INERTIA"]["IZZ"]) == (0.8, math.pi / 2, 30.0)
    assert apm.segment.clock.text(apm["TIME"]["EPOCH"]) == "2026-01-03T00:00:00"
    omm = files.read(OMM)
    assert omm["ELEMENTS"]["MEAN_MOTION"] == pytest.approx(30 * math.pi / 86400, rel=1e-15)
    assert omm["ELEMENTS"]["INCLINATION"] == math.pi / 4 and omm["TLE"]["BSTAR"] == 1e-4


def test_the_times_are_those_of_erfa():
    erfa = module("erfa")
    for scale, seconds in (("TAI", 32.184), ("GPS", 51.184), ("TT", 0.0)):
        for date in ((1999, 12, 31), (2016, 7, 1), (2031, 2, 3)):
            day, part = erfa.dtf2d("TT", *date, 1, 2, 3.0)
            tt = (day - 2451545.0 + part) * 86400 + seconds
            ours = values.Clock(scale).ns("{}-{:02}-{:02}T01:02:03".format(*date)) / 1e9
            assert abs(ours - tt - erfa.dtdb(day, part, 0, 0, 0, 0)) < 1e-4
    tai = erfa.utctai(*erfa.dtf2d("UTC", 2016, 12, 31, 23, 59, 60.5))
    ours = values.Clock("TAI").text(values.Clock("UTC").ns("2016-12-31T23:59:60.5"))
    assert ours == "2017-01-01T00:00:36.5" and (tai[0] - 2457754.5 + tai[1]) * 86400 == pytest.approx(36.5, abs=1e-5)


def test_orbits_of_an_ocm_count_seconds_of_si_from_their_zero():
    ocm = files.read(OCM)
    clock, trajectory = ocm.segment.clock, ocm["TRAJ"].columns
    assert [clock.text(t) for t in trajectory["TIME"].tolist()] == ["2016-12-31T23:59:59", "2017-01-01T00:00:00.5"]
    assert [trajectory[f"KEPLERIAN_{i}"][0] for i in (1, 2, 3, 6)] == [7e6, 0.001, math.pi / 2, math.pi]
    _, (matrix,) = tables.history(ocm["COV"])
    assert matrix.tolist() == [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1]]
    assert ocm["MAN"].columns["DEPLOY_ID"].tolist() == ["BEE"] and ocm["MAN"].columns["DV_X"].tolist() == [1.0]


def test_a_number_has_the_same_bits_after_a_round_trip():
    generator = random.Random(1)
    for _ in range(3000):
        unit = generator.choice(sorted(values.UNITS))
        value = generator.choice([-1, 1]) * generator.random() * 10.0 ** generator.randint(-12, 12)
        text = values.from_si(value, values.UNITS[unit])
        assert values.to_si(text, values.UNITS[unit]) == value
    assert values.to_si("6878.1370", 3) == 6878137.0 and values.from_si(6878137.0, 3) == "6878.137"
    assert values.to_si("180", values.DEG) == math.pi and values.from_si(math.pi, values.DEG) == "180.0"
    assert values.to_si("0.1", values.UNITS["rev/day"]) == pytest.approx(0.2 * math.pi / 86400, rel=1e-15)
    assert float(values.PI / 180) == pytest.approx(math.pi / 180, rel=1e-15)
    assert float(values.times(3, values.DEG)) == pytest.approx(1000 * math.pi / 180, rel=1e-15)
    assert values.times(3, 3) == 6 and isinstance(values.DEG, Decimal)


SPAN = ("START_TIME", "USEABLE_START_TIME", "USEABLE_STOP_TIME", "STOP_TIME")


def random_value(generator, name, kind, clock):
    if name in messages.CHOICES:
        return messages.CHOICES[name][0]
    if name == "EULER_ROT_SEQ":
        return generator.choice(["321", "ZXZ"])
    if kind == "date":
        return f"20{generator.randint(10, 30)}-{generator.randint(1, 365):03}T00:00:00"
    if kind == "time":
        return clock.ns(f"20{generator.randint(10, 30)}-01-02T03:04:05.{generator.randrange(10**9):09}")
    if kind == "int":
        return generator.randint(1, 9)
    if kind == "text":
        return generator.choice(["EARTH", "A B", "a < b & c", "x = [1, 2]"])
    return generator.uniform(0 if name in messages.NOT_NEGATIVE else -1, 1) * 10.0 ** generator.randint(-9, 9)


def random_section(generator, block, clock, settings):
    chosen = {}
    for name, item in block.fields.items():
        optional = block.name == "COVARIANCE" and name.startswith(messages.OPTIONAL_ROWS)
        if name.endswith("_UNITS") or name in dict(messages.RIVALS).values():
            continue
        if name in settings or (not optional and name not in block.either and name not in messages.PAIRS and (
                item.required or generator.random() < 0.5)) or name in block.either[:1]:
            chosen[name] = settings.get(name) or random_value(generator, name, item.type, clock)
    if block.name == "USER":
        chosen = {"USER_DEFINED_A": "1", "USER_DEFINED_B": "x <y>"}
    return Section(block.name, chosen, ["of " + block.name, "a < b"])


def random_columns(generator, columns, clock):
    rows, first = range(generator.randint(1, 5)), clock.ns("2020-01-01T00:00:00")
    draw = {"time": lambda i: first + i * 10**9 + generator.randrange(10**9),
            "text": lambda i: generator.choice(["ON", "OFF"])}
    return {name: np.array([draw.get(unit, lambda i: generator.uniform(-1e3, 1e3))(i) for i in rows],
                           dtype=object if unit == "text" else None) for name, unit in columns}


def random_message(generator):
    form = generator.choice(list(messages.FORMS.values()))
    version = generator.choice(form.versions)
    scale = "UTC" if form.name == "CDM" else generator.choice([*values.SCALES, "UT1"])
    clock, blocks = values.Clock(scale), form.of(version)
    settings = {"TIME_SYSTEM": scale, "TRAJ_TYPE": generator.choice(sorted(messages.ORBITS)), "COV_TYPE": "CARTPV",
                "COV_ORDERING": generator.choice(tables.ORDERINGS), "OBJECT_NAME": "A", "OBJECT_ID": "B",
                "MAN_COMPOSITION": "TIME_ABSOLUTE, DV_X, ACC_INTERP, THR_DIR_SIGMA",
                "EULER_ROT_SEQ": generator.choice(["321", "ZXZ"]),
                "QUATERNION_TYPE": "FIRST" if version[0] == "1" else "LAST",
                "ATTITUDE_TYPE": generator.choice(sorted(messages.ATTITUDES.get(version[0], "-")))}
    if form.name in ("OEM", "AEM"):
        settings |= dict.fromkeys(SPAN, clock.ns("2020-01-01T00:00:00"))
    front = [random_section(generator, block, values.Clock("UTC"), {}) for block in blocks[:1 + len(form.front)]]
    segments = []
    for number in range(2 if form.name == "CDM" else generator.randint(1, 3) if form.segments else 1):
        sections = []
        for block in blocks[1 + len(form.front):]:
            needed = block.required or (block.name in form.some and version == "2.0")
            for _ in range((needed or generator.random() < 0.6) * (generator.randint(1, 3) if block.many else 1)):
                keep = {key: value for key, value in settings.items() if key in block.fields}
                section = random_section(generator, block, clock, keep)
                section.values |= {"OBJECT": f"OBJECT{number + 1}"} if "OBJECT" in block.fields else {}
                if block.rows and block.name != "COVARIANCE":
                    section.values = {key: value for key, value in section.values.items() if block.mark}
                    columns = tables.columns_of(section, sections[0], form.name, version, generator.choice([7, 10]))
                    section.columns = random_columns(generator, columns, clock)
                sections += [section] if section.values or section.columns else []
        segments.append(sections)
    return ndm.message_of(form.name, version, front, segments)


def is_same(a, b):
    assert (a.kind, a.version, len(a.segments)) == (b.kind, b.version, len(b.segments))
    for x, y in zip([*a.front, *(s for part in a.segments for s in part.sections)],
                    [*b.front, *(s for part in b.segments for s in part.sections)], strict=True):
        assert (x.name, x.values, x.comments, sorted(x.columns)) == (y.name, y.values, y.comments, sorted(y.columns))
        assert all(np.array_equal(x.columns[name], y.columns[name]) for name in x.columns)


def test_random_messages_are_the_same_after_a_round_trip():
    generator = random.Random(1)
    kinds = set()
    for _ in range(100):
        message = random_message(generator)
        for form in ("kvn", "xml"):
            is_same(message, ndm.read(ndm.text_of(message, form)))
            kinds.add((message.kind, message.version, form))
    assert len(kinds) == 2 * sum(len(form.versions) for form in messages.FORMS.values())


def test_blocks_with_marks_come_in_any_order():
    apm = files.read(APM)
    head, *blocks = re.split("(?=QUAT_START|ANGVEL_START|INERTIA_START)", APM)
    for order in itertools.permutations(blocks):
        is_same(files.read(head + "".join(order)), apm)
    head, *blocks = re.split("(?=<quaternionState>|<angularVelocity>|<inertia>)", ndm.text_of(apm, "xml"))
    blocks[-1], tail = blocks[-1].split("</data>")
    is_same(files.read("".join([head, *blocks[::-1], "</data>", tail])), apm)


XML = ndm.text_of(files.read(OPM), "xml")
OEM_XML, OCM_XML = (ndm.text_of(files.read(text), "xml") for text in (OEM, OCM))
BOMB = '<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>\n'
EULER_AEM = replaced(AEM, "= QUATERNION\nQUATERNION_TYPE = FIRST", "= EULER_ANGLE")


@pytest.mark.parametrize("text, expected", [
    (replaced(OPM, "3.0", "4.0"), "line 1: CCSDS_OPM_VERS: expected 1.0 or 2.0 or 3.0; found '4.0'"),
    (replaced(OPM, "OPM", "TDM"),
     "line 1: expected a message of OPM, OMM, OEM, OCM, AEM, APM, CDM; found TDM, tracking data"),
    ("COMMENT x\n" + OPM, "line 1: expected CCSDS_..._VERS = ... first"),
    (replaced(OPM, "[km]", "[m]"), "line 12: X: expected the unit km, or none; found m: convert the value"),
    (replaced(OPM, "6878.137", "6878,137"), "line 12: X: expected a number; found '6878,137 [km]'"),
    (replaced(OPM, "6878.137 [km]", ""), "line 12: X: expected a value; there is none"),
    (replaced(OPM, "6878.137", "1e999999999"), "line 12: X: expected a number; found '1e999999999 [km]'"),
    (replaced(OMM, "45 [deg]", "1e999999999"), "INCLINATION: expected a number; found '1e999999999'"),
    (replaced(OPM, "TT", "UT1").replace("2000-001", "9999-001"), "line 11: EPOCH: expected a time on UT1, "),
    (replaced(OCM, "\n2.5 7000", "\n1e999999999 7000"), "line 12: TIME: expected a time on UTC, "),
    (replaced(OCM, "\n2.5 7000", "\n9e9 7000"), "line 12: TIME: "),
    (replaced(OCM, "UTC", "UT1").replace("\n2.5 7000", "\n9.2e9 7000"), "line 12: TIME: expected a time on UT1"),
    (replaced(OPM, "6878.137", "nan"), "line 12: X: expected a number; found 'nan [km]'"),
    (replaced(OPM, "Z = 0\n", ""), "line 11: expected Z in STATE; there is none"),
    (replaced(OPM, "Z = 0\n", "X = 0\n"), "line 14: X is given twice; the first is in line 12"),
    (replaced(OPM, "REF_FRAME", "REF_FRAMES"), "line 8: OPM 3.0 has no REF_FRAMES; did you mean 'REF_FRAME'?"),
    (replaced(OPM, "MASS = 100 [kg]\n", "") + "MASS = 1\n", "line 55: MASS: expected in SPACECRAFT, before USER"),
    (replaced(OPM, "TT", "TTT"), "line 9: TIME_SYSTEM: expected UTC, TAI, TT, TDB, GPS, UT1, "),
    (replaced(OPM, "TT", "UTC").replace("2000-001", "1970-001"), "line 11: EPOCH: time \"1970-01-01T12:00:01 UTC\": "
     "UTC had no whole leap seconds before 1972-01-01"),
    (replaced(OPM, "2000-001T", "2001-366T"), "line 11: EPOCH: expected a time on TT, 2020-10-13T04:52:48.472 or"),
    (replaced(OPM, "TT", "MET").replace("2000-001T12:00:01.000000001", "12.5"), "EPOCH: expected a time on MET"),
    (replaced(OPM, "2026-01-02T", "2 January "), "line 3: CREATION_DATE: expected a time, 2020-10-13T04:52:48; found"),
    (OPM + "KEY\n", "line 56: expected KEYWORD = value; found 'KEY'"),
    (replaced(OEM, "2017-01-01T00:00:00 ", "2016-12-31T23:59:59 "),
     "line 19: expected a time after 2016-12-31T23:59:60, that of the line before; found 2016-12-31T23:59:59"),
    (replaced(OEM, "15 0 0 7.5 0", "15 0 0 7.5"),
     "line 19: expected 7 columns, EPOCH, X, Y, Z, X_DOT, Y_DOT, Z_DOT; found 6"),
    (replaced(OEM, "0 0 0 1e-12\n", "0 0 1e-12\n"), "line 27: expected 4 numbers, line 4 of a lower triangle "),
    (replaced(OEM, "0 0 0 0 0 1e-12\nE", "E"), "line 29: expected six lines of a lower triangle; found 5"),
    (replaced(OEM, "META_STOP", ""), "line 17: expected KEYWORD = value; found '2016-12-31T23:59:59 7000 0 0 0 7.5 0'"),
    (replaced(OEM, "META_STOP", "DATA_STOP"), "line 15: expected META_STOP; found DATA_STOP"),
    (replaced(OEM, "COVARIANCE_STOP\n", ""), "COVARIANCE: expected its end, COVARIANCE_STOP; found the end of "),
    (replaced(OEM, "INTERPOLATION_DEGREE = 1\n", ""), "line 13: expected INTERPOLATION_DEGREE with INTERPOLATION"),
    (replaced(OEM, "START_TIME = 2016", "START_TIME = 2018"), "line 5: START_TIME: expected before STOP_TIME"),
    (OEM + OEM[OEM.index("META_START"):OEM.index("COV")].replace("001A", "002A"),
     "OBJECT_ID: expected 2026-001A, as in the first segment of the OEM; found 2026-002A: write another"),
    (replaced(OEM, "2.0", "1.0"), "line 22: expected META_START; found COVARIANCE_START"),
    (replaced(AEM, "= QUATERNION\n", "= RODRIGUES\n"), "ATTITUDE_TYPE: expected QUATERNION, QUATERNION/DERIVATIVE, "),
    (replaced(AEM, "1.0", "2.0"), "QUATERNION_TYPE: expected LAST, which is fixed since version 2.0; found FIRST"),
    (replaced(AEM, "A2B", "A2C"), "line 9: ATTITUDE_DIR: expected A2B or B2A; found A2C"),
    (replaced(EULER_AEM, "META_STOP", "EULER_ROT_SEQ = 331\nMETA_STOP"), "EULER_ROT_SEQ: expected three axes of "),
    (replaced(OCM, "TRAJ_UNITS = [km", "TRAJ_UNITS = [m"),
     "TRAJ_UNITS: expected [km,1,deg,deg,deg,deg], those of KEPLERIAN"),
    (replaced(OCM, "KEPLERIAN", "KEPLER"), "TRAJ_TYPE: expected CARTP, CARTPV, CARTPVA, "),
    (replaced(OCM, "UTMWCC", "UPPER"), "COV_ORDERING: expected LTM, UTM, FULL, LTMWCC, UTMWCC; found UPPER"),
    (replaced(OCM, "MAN_UNITS = [s,", "MAN_UNITS = [kg,"), "MAN_UNITS: expected [s,km/s,1], those of MAN_COMPOSITION"),
    (replaced(OCM, "TIME_RELATIVE, ", ""), "MAN_COMPOSITION: expected TIME_ABSOLUTE or TIME_RELATIVE, then of "),
    (XML.replace("<opm", BOMB + "<opm"), "line 2: expected no document type, whose entities could fill the memory"),
    (replaced(XML, "</opm>", ""), "expected XML; no element found: the file may be cut"),
    (replaced(XML, 'units="km"', 'units="m"'), "X: expected the unit km, or none; found m"),
    (replaced(XML, "<stateVector>", "<stateVector>\n<GM>1</GM>"), "the block STATE has no GM; "),
    (replaced(CDM, CDM_OBJECT.format(2), ""), "line 1: expected OBJECT1 and OBJECT2; found 1 objects"),
    (replaced(CDM, "OBJECT = OBJECT2", "OBJECT = OBJECT3"), "OBJECT: expected OBJECT1 or OBJECT2; found OBJECT3"),
    (replaced(CDM, "CN_N = 25\n", ""), "expected CN_N in COVARIANCE; there is none"),
    (CDM + "CDRG_R = 1\n", "expected CDRG_T, CDRG_N, CDRG_RDOT, CDRG_TDOT, CDRG_NDOT and 1 more in COVARIANCE"),
    (replaced(CDM, "TCA = 2026-01-03", "TCA = 2026-01-32"), "line 6: TCA: time \"2026-01-32T00:00:00 UTC\": day 32"),
    (replaced(APM, "ANGVEL_STOP", "QUAT_STOP"), "line 25: expected ANGVEL_STOP; found QUAT_STOP"),
    (replaced(APM, "QUAT_START", "QUATERNION_START"), "line 10: expected META_START, QUAT_START, EULER_START, "),
    (replaced(APM, "ANGVEL_START", "INERTIA_START\nANGVEL_START"), "expected the end of INERTIA; found ANGVEL_START"),
    (APM[:APM.index("QUAT")], "line 4: expected QUATERNION or EULER or RATE or SPIN or INERTIA in the "),
    (APM + APM[APM.index("ANGVEL_START"):], "line 43: INERTIA is given twice"),
    (APM + APM[APM.index("INERTIA_START"):], "line 35: INERTIA is given twice"),
    (replaced(OMM, "MEAN_MOTION = 15 [rev/day]\n", ""), "expected SEMI_MAJOR_AXIS or MEAN_MOTION; found none"),
    (replaced(OMM, "MEAN_MOTION =", "SEMI_MAJOR_AXIS = 7000\nMEAN_MOTION ="), "found SEMI_MAJOR_AXIS, MEAN_MOTION"),
    (OMM[:OMM.index("OBJECT")], "line 1: expected META in the OMM; there is none"),
    (OMM + "OBJECT_NAME = CRAFT\n", "line 19: OBJECT_NAME: expected in META, before TLE"),
    (replaced(OMM, "BSTAR", "AGOM"), "line 9: expected BSTAR for SGP4; there is none"),
    (replaced(OMM, "SGP4", "SGP4-XP"), "line 9: expected BTERM, AGOM for SGP4-XP; there is none"),
    (OMM + "BTERM = 1\n", "line 19: expected BSTAR or BTERM; found both"),
    (replaced(OMM, "3.0\n", "2.0\nMESSAGE_ID = 7\n"), "line 2: OMM 2.0 has no MESSAGE_ID"),
    (replaced(OEM, "0 15 0 0 7.5 0", "0 15 0 0 7.5 0 0 0"), "line 19: expected 7 columns, EPOCH, X, Y, Z, X_DOT, "
     "Y_DOT, Z_DOT, or 10 with X_DDOT, Y_DDOT, Z_DDOT; found 9"),
    (OEM + OEM[OEM.index("META_START"):OEM.index("COV")].replace("= UTC", "= TT").replace(":60", ":59.5"),
     "TIME_SYSTEM: expected UTC, as in the first segment of the OEM; found TT"),
    (replaced(AEM, "QUATERNION_TYPE = FIRST\n", ""),
     "line 4: expected QUATERNION_TYPE, FIRST or LAST, for QUATERNION; there is none"),
    (replaced(AEM, "ATTITUDE_DIR = A2B\n", ""), "line 4: expected ATTITUDE_DIR in META; there is none"),
    (OEM[:OEM.index("COMMENT over")], "line 5: expected STATE in the OEM; there is none"),
    (replaced(OEM, "DEGREE = 1", "DEGREE = 1.5"), "expected a whole number of up to 18 digits; found '1.5'"),
    (replaced(OEM, "DEGREE = 1", "DEGREE = " + "9" * 5000), "expected a whole number of up to 18 digits; found '999"),
    (replaced(OEM, "DEGREE = 1", "DEGREE = ++1"), "expected a whole number of up to 18 digits; found '++1'"),
    (replaced(OEM, "7000 15", "\u0667 15"), "line 19: X: expected a number; found '\u0667'"),
    (replaced(OPM, "6878.137", "6878.1\u0663"), "line 12: X: expected a number; found '6878.1\u0663 [km]'"),
    (replaced(OEM, "STOP_TIME = 2017", "STOP_TIME = 201\u0667"), "line 12: STOP_TIME: expected a time on UTC"),
    (replaced(OPM, "MASS = 100", "MASS = -100"), "line 18: MASS: expected a number that is not negative; found -100"),
    (replaced(CDM, "MASS = 250", "MASS = -1e-9"), "MASS: expected a number that is not negative; found -1e-9"),
    (replaced(APM, "IYY = 20", "IYY = -20"), "IYY: expected a number that is not negative; found -20"),
    (OEM[:OEM.index("META_START")] + "META_STOP\n", "line 5: META_STOP: expected its beginning before it"),
    (replaced(OCM, "0.001 BEE", "x BEE"), "DV_X: expected a number; found 'x'"),
    (replaced(OCM, "1 10 0.001 BEE\n", ""), "expected the lines of MAN; there are none"),
    (replaced(OCM, "= 2016-12-31T23:59:59", "= 9999-366"), "line 6: EPOCH_TZERO: expected a time"),
    (replaced(OCM, "= 2016-12-31T23:59:59", "= 0"), "line 6: EPOCH_TZERO: expected a time"),
    (replaced(XML, "<X ", "<X><Y>1</Y></X>\n<X "), "X: expected a value; found <Y>"),
    (replaced(OEM_XML, "</X_DOT>", "</X_DOT>\n<X_DOT>1</X_DOT>"), "X_DOT is given twice"),
    *((re.sub("(<stateVector>).*?(</stateVector>)", empty, OEM_XML, count=times, flags=re.S),
       "expected 7 columns, EPOCH, X, Y, Z, X_DOT, Y_DOT, Z_DOT; found 0")
      for empty in (r"\1\2", "<stateVector/>") for times in (0, 1)),
    *((re.sub("<trajLine>[^<]*", "<trajLine> ", OCM_XML, count=times), "expected 7 columns, TIME, ")
      for times in (0, 1)),
    (replaced(OEM_XML, "<X_DOT>", "<X_DDT>").replace("</X_DOT>", "</X_DDT>", 1), "expected EPOCH X Y Z X_DOT Y_DOT "),
    (replaced(XML, "<opm", '<opm encoding="x"').replace("UTF-8", "x-none"), "expected XML; unknown encoding"),
    ("<ndm></ndm>", "the text: expected a message of OPM, OMM, OEM, OCM, AEM, APM, CDM, in KVN or XML; it has none"),
    (OPM + OPM.replace("3.0", "5.0"), "line 56: CCSDS_OPM_VERS: expected 1.0 or 2.0 or 3.0; found '5.0'"),
], ids=map(str, itertools.count()))
def test_bad_messages_are_refused(text, expected):
    refused(text, expected)


def test_what_others_leave_empty_or_give_twice_is_read():
    assert files.read(OPM.replace("2026-01-02T03:04:05", "")).header["CREATION_DATE"] == ""
    line = "2017-01-01T00:00:01 7000 22.5 0 0 7.5 0\n"
    assert len(files.read(OEM.replace(line, line * 2)).segment.times) == 4
    empty = files.read(replaced(OPM, "MASS = 100 [kg]", "MASS ="))
    assert not empty.segment.all("SPACECRAFT")
    is_same(empty, ndm.read(ndm.text_of(empty, "kvn")))
    assert files.read(XML.replace("TEAM", "THE\n  TEAM")).header["ORIGINATOR"] == "THE TEAM"


def test_lines_of_an_ephemeris_may_have_accelerations():
    oem = files.read(replaced(OEM, "7000 15 0 0 7.5 0", "7000 15 0 0 7.5 0 -8e-3 0 1e-9"))
    assert np.array_equal(oem.segment.a, [[np.nan] * 3] * 2 + [[-8, 0, 1e-6]] + [[np.nan] * 3], equal_nan=True)
    for form in ("kvn", "xml"):
        again = ndm.read(ndm.text_of(oem, form)).segment
        assert np.array_equal(again.a, oem.segment.a, equal_nan=True) and np.array_equal(again.v, oem.segment.v)
    assert "0.0 7.5 0.0\n2017-01-01T00:00:00 7000.0 15.0 0.0 0.0 7.5 0.0 -0.008 0.0 1E-9\n" in ndm.text_of(oem)


@pytest.mark.parametrize("data, expected", [
    (b"", "line 1: expected a message of CCSDS (CCSDS_..._VERS = ... first), an ephemeris or attitude of STK (stk.v... "
     "first), or mean elements in two lines, JSON or CSV; found ''"),
    (b"Dear colleague,\nsee below.\n", "line 1: expected a message of CCSDS"),
    (OEM.encode("utf-16"), "line 1: expected a text in UTF-8; found another encoding, or no text: save it as UTF-8"),
    (OEM.replace("TEAM", "\u00e9quipe").encode("latin-1"), "line 3: expected a text in UTF-8"),
    (bytes(range(256)), "line 2: expected a text in UTF-8"),
    (b"stk.v.11.0\n\xff\n", "line 2: expected a text in UTF-8"),
    (b"<!DOCTYPE html>\n<html>404</html>\n", "line 1: expected a message in XML; found a page of the web"),
    (OEM.replace("TEAM", "TEAM\nZ" + "Z" * 10**6).encode(), "line 4: expected KEYWORD = value; found 'ZZZ"),
])
def test_what_is_no_message_is_refused_in_a_few_words(tmp_path, data, expected):
    (tmp_path / "x.oem").write_bytes(data)
    with pytest.raises(SetupError) as error:
        files.read(tmp_path / "x.oem")
    assert f"x.oem, {expected}" in str(error.value) and len(str(error.value)) < 2000, str(error.value)


def test_lines_may_end_as_on_any_system():
    for end in ("\r\n", "\r"):
        found = files.read(OEM.replace("\n", end) + "\n").segment
        assert np.array_equal(found.times, files.read(OEM).segment.times)


def test_a_packed_file_is_named(tmp_path):
    for program, module in (("gzip", gzip), ("bzip2", bz2), ("xz", lzma)):
        (tmp_path / "x").write_bytes(module.compress(OEM.encode()))
        with pytest.raises(SetupError, match=f"x: expected a file that is not packed; found one of {program}: unpack"):
            files.read(tmp_path / "x")


def test_several_messages_in_a_file_are_read_one_by_one():
    both = files.read_all("CCSDS_NDM_VERS = 1.0\nCOMMENT two\n" + OPM + OEM)
    assert [message.kind for message in both] == ["OPM", "OEM"]
    document = XML[XML.index("<opm"):]
    assert len(files.read_all(f"<ndm>\n<COMMENT>two</COMMENT>{document}{document}</ndm>")) == 2
    with pytest.raises(SetupError, match="the text: has 2 messages, OPM, OEM: choose among read_all"):
        files.read(OPM + OEM)
    with pytest.raises(SetupError, match="line 1: expected a single segment; found 2: choose among .segments"):
        files.read(OEM + OEM[OEM.index("META_START"):]).segment


def test_mean_elements_are_known_by_their_content():
    two = ("1 25544U 98067A   20287.20334972  .00001264  00000-0  31212-4 0  9995\n"
           "2 25544  51.6431 132.5211 0001357  54.3017  42.4190 15.49309239250274\n")
    assert files.read(two).number == 25544


def test_other_clocks_are_kept_and_refused_where_an_instant_is_needed():
    opm = files.read(OPM.replace("TIME_SYSTEM = TT", "TIME_SYSTEM = UT1"))
    assert not opm.segment.clock.absolute and opm["STATE"]["EPOCH"] == 1_000_000_001
    is_same(opm, ndm.read(ndm.text_of(opm, "xml")))


@pytest.mark.parametrize("change, expected", [
    ({"X": math.nan}, "a message has finite numbers only; found nan"),
    ({"QQ": 1.0}, "STATE: expected of EPOCH, X, Y, Z, X_DOT, Y_DOT, Z_DOT; found QQ"),
])
def test_what_would_not_read_back_is_not_written(tmp_path, change, expected):
    opm = files.read(OPM)
    opm["STATE"].values.update(change)
    with pytest.raises(SetupError) as error:
        files.write(opm, tmp_path / "a.opm")
    assert expected in str(error.value) and not list(tmp_path.iterdir())
    with pytest.raises(SetupError, match="form: expected 'kvn' or 'xml'; found 'json'"):
        ndm.text_of(opm, "json")
    with pytest.raises(SetupError, match="expected Z_DOT in STATE"):
        ndm.write(ndm.create("OPM", [Segment([files.read(OPM).segment.meta, Section("STATE", {
            "EPOCH": 0, "X": 1.0, "Y": 0.0, "Z": 0.0, "X_DOT": 0.0, "Y_DOT": 0.0})])], originator="T",
            created="2026-01-01T00:00:00"), tmp_path / "b")


def test_any_damage_is_refused_or_harmless():
    """No error but SetupError, whatever a character turns into."""
    for text in damaged([OPM, OEM, AEM, OCM, XML, ndm.text_of(files.read(OCM), "xml")], 1500, 2):
        with suppress(SetupError):
            files.read_all(text)
