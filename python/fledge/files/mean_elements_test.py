# SPDX-License-Identifier: Apache-2.0
"""Elements in all formats against python3-sgp4; and their flight against its theory in ERFA's frames."""

import csv
import io
import itertools
import json
import math
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from fledge import flight as fsw, mean_elements
from fledge.errors import SetupError
from fledge.files.testing.examples import damaged
from tests.needs import module

sgp4 = module("sgp4.api")
FOLDER = Path(sgp4.__file__).parent

ISS = """ISS (ZARYA)
1 25544U 98067A   20287.20334972  .00001264  00000-0  31212-4 0  9995
2 25544  51.6431 132.5211 0001357  54.3017  42.4190 15.49309239250274
"""
KVN = """CCSDS_OMM_VERS = 2.0
CREATION_DATE = 2020-10-13T04:52:48
ORIGINATOR = US

OBJECT_NAME = VANGUARD 1
OBJECT_ID = 1958-002B
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
MEAN_ELEMENT_THEORY = SGP/SGP4
COMMENT elements
EPOCH = 2020-10-13T04:52:48.472320
MEAN_MOTION = 10.84869164 [rev/day]
ECCENTRICITY = .1845686
INCLINATION = 34.2443 [deg]
RA_OF_ASC_NODE = 225.5254 [deg]
ARG_OF_PERICENTER = 162.2516
MEAN_ANOMALY = 205.2356
NORAD_CAT_ID = 5
BSTAR = -.22483E-4
"""


def signed(line):
    return line[:68] + str(mean_elements.checksum(line))


def refused(source, text, name=None):
    with pytest.raises(SetupError) as error:
        mean_elements.read(source, name)
    assert text in str(error.value), str(error.value)


def is_as(ours, theirs):
    """Whether elements are those of python3-sgp4's Satrec, to roundings."""
    epoch = round((theirs.jdsatepoch - 2451545.0) * 86400) * 10**9 + round(theirs.jdsatepochF * 86400e9)
    assert abs(ours.epoch - epoch) <= 1000 and ours.number == theirs.satnum
    for key, value in [("n", theirs.no_kozai / 60), ("e", theirs.ecco), ("i", theirs.inclo), ("node", theirs.nodeo),
                       ("periapsis", theirs.argpo), ("M", theirs.mo), ("bstar", theirs.bstar)]:
        assert getattr(ours, key) == pytest.approx(value, rel=1e-14, abs=1e-300), key


def lines():
    """The pairs of lines of the verification that keep the format, without what follows them."""
    rows = [row[:69].rstrip() for row in (FOLDER / "SGP4-VER.TLE").read_text().splitlines() if row[0] != "#"]
    pairs = zip(rows[::2], rows[1::2])
    return [pair for pair in pairs if all(row == signed(row) for row in pair)]


def test_two_lines_are_as_another_reader_has_them():
    assert len(lines()) == 30
    for first, second in lines():
        if first[2:7] == "28872":     # which falls within the hour
            refused(f"{first}\n{second}\n",
                    "line 2: its perigee is 49 km below the Earth's surface: the object has decayed")
        else:
            is_as(mean_elements.read(f"{first}\n{second}\n"), sgp4.Satrec.twoline2rv(first, second))


def in_xml(fields):
    text = "".join(f"<{key}>{value}</{key}>\n" for key, value in fields.items())
    return ('<?xml version="1.0"?>\n<ndm><omm id="CCSDS_OMM_VERS" version="2.0"><header/><body><segment><data>\n'
            f"{text}</data></segment></body></omm></ndm>")


def in_csv(fields):
    file = io.StringIO()
    writer = csv.DictWriter(file, fields)
    writer.writeheader()
    writer.writerow(fields)
    return file.getvalue()


def test_all_formats_give_the_same_elements(tmp_path):
    exporter = module("sgp4.exporter")
    for first, second in lines():
        if first[2:7] in ("28872", "11801", "88888"):     # the last two were not launched, as far as they say
            continue
        theirs = sgp4.Satrec.twoline2rv(first, second)
        fields = {key: str(value) for key, value in exporter.export_omm(theirs, "A, B").items()}
        texts = {"kvn": "CCSDS_OMM_VERS = 2.0\n" + "".join(f"{key} = {value}\n" for key, value in fields.items()),
                 "xml": in_xml(fields), "json": json.dumps([fields], indent=1), "csv": in_csv(fields)}
        for name, text in texts.items():
            (tmp_path / name).write_text(text)
            found = mean_elements.read(tmp_path / name)
            assert (found.name, found.number) == ("A, B", theirs.satnum)
            is_as(found, theirs)


def test_the_published_samples():
    for name in ("sample_omm.csv", "sample_omm.xml"):
        found = mean_elements.read(FOLDER / name)
        assert (found.title, found.designator) == ("VANGUARD 1 (5)", "1958-002B")
        assert found.parameters() == mean_elements.read(KVN).parameters()
        assert found.utc == "2020-10-13T04:52:48.472320" and found.bstar == -2.2483e-5
    station = mean_elements.read(ISS)
    assert (station.title, station.designator, station.epoch % 864_000) == ("ISS (ZARYA) (25544)", "1998-067A", 0)
    assert station.n == pytest.approx(15.49309239 * 2 * math.pi / 86400, rel=1e-15)


def changed(old, new, text=ISS):
    """The text with another piece, and its checksums right."""
    assert old in text
    rows = text.replace(old, new).splitlines()
    return "\n".join(signed(row) if row[:2] in ("1 ", "2 ") else row for row in rows) + "\n"


def test_numbers_and_years():
    for text, number in (("E8493", 148493), ("Z9999", 339999), ("    5", 5), ("J0001", 180001)):
        assert mean_elements.read(changed("25544", text)).number == number
    for text, year in (("57", 1957), ("99", 1999), ("00", 2000), ("56", 2056)):
        assert mean_elements.read(changed(" 20287", f" {text}287")).utc.startswith(str(year))
    assert mean_elements.read(KVN.replace("2020-10-13T", "2020-287T")).epoch == mean_elements.read(KVN).epoch


def test_an_epoch_in_a_leap_second_is_counted_as_the_second_after_it():
    after = mean_elements.read(KVN.replace("2020-10-13T04:52:48.472320", "2017-01-01T00:00:00.25")).parameters()
    for epoch in ("2016-12-31T23:59:60.25Z", "2016-366T23:59:60.25"):
        assert mean_elements.read(KVN.replace("2020-10-13T04:52:48.472320", epoch)).parameters() == after
    refused(KVN.replace("04:52:48.47", "23:59:60.47"), "line 12: EPOCH: time \"2020-10-13T23:59:60 UTC\": second 60 "
                                                       "exists only at 23:59 UTC before a leap second")


def test_one_of_several():
    second = changed("25544", "00005", "0 VANGUARD 1\n" + ISS.split("\n", 1)[1])
    both = ISS + "\n" + second
    assert [mean_elements.read(both, name).number for name in ("vanguard 1", 5, "00005")] == [5] * 3
    refused(both, "has no object '999", "9" * 5000)
    assert mean_elements.read(both, 25544).name == "ISS (ZARYA)"
    assert [elements.source for elements in mean_elements.read_all(both)] == ["the text, line 2", "the text, line 6"]
    refused(both, "the text: has 2 objects; give the name or the number of one: ISS (ZARYA) (25544), VANGUARD 1 (5)")
    refused(both, "the text: has no object 'VANGARD 1'; did you mean 'VANGUARD 1'? it has ISS (ZARYA) (25544), "
                  "VANGUARD 1 (5)", "VANGARD 1")
    refused(ISS + ISS, "the text: has 2 element sets of one object", 25544)


XML = (FOLDER / "sample_omm.xml").read_text()


@pytest.mark.parametrize("source, text", [
    (ISS.replace("-4 0  999", "-4 0  998"), "line 2: column 69: expected 4, the checksum of what stands before;"),
    (ISS.replace("  .000", " .000"), "the text, line 2: expected 69 columns of a line of elements; found 68"),
    (changed("51.6431 ", "51.643 1"), "line 3: columns 9 to 16: expected the inclination [deg], 'nnn.nnnn';"),
    (changed("0001357", "000135x"), "line 3: columns 27 to 33: expected the eccentricity without its point"),
    (changed("2 25544", "2 25545"), "line 3: columns 3 to 7: expected 25544, as in line 1; found 25545"),
    (changed("25544", "I5544"), "line 2: columns 3 to 7: expected the number in the catalogue, of five digits or"),
    (changed("20287", "20367"), "line 2: columns 21 to 32: expected a day of 2020, 1 to 366; found 367"),
    (changed(" 0  999", " 4  999"), "line 2: column 63: expected elements of SGP4, 0; found 4, which are"),
    (changed("25544  51", "25544x 51"), "line 3: column 8: expected a space; found 'x'"),
    (changed("51.6431", "91.6431").replace(" 91.", "191."), "column 69"),
    (changed(" 51.6431", "181.0000"), "line 3: INCLINATION: expected 0 to 180 deg; found 181"),
    (changed("15.49309239", "17.49309239"), "km below the Earth's surface: the object has decayed"),
    (changed("0001357", "0801357"), "the object has decayed, or mean motion or eccentricity are wrong"),
    (changed("15.49309239", " 0.00000000"), "MEAN_MOTION: expected revolutions a day, > 0; found 0"),
    (ISS[:ISS.index("2 25544")], "the text, line 3: expected line 2 of the element set, '2 nnnnn...'; found the end"),
    (ISS + "MIR\n", "the text, line 4: expected line 1 of a two-line element set after the name 'MIR'; found the end"),
    (ISS[12:].replace("\n2", "\n\n3"), "line 3: expected line 2 of the element set"),
    (KVN.replace("TEME", "EME2000"), "the text, line 8: REF_FRAME: expected TEME; found EME2000"),
    (KVN.replace("UTC", "UT1"), "line 9: TIME_SYSTEM: expected UTC; found UT1"),
    (KVN.replace("SGP/SGP4", "DSST"), "line 10: MEAN_ELEMENT_THEORY: expected SGP4 or SGP/SGP4; found DSST"),
    (KVN.replace("CENTER_NAME = EARTH\n", ""), "line 1: expected CENTER_NAME in the OMM of VANGUARD 1; there is none"),
    (KVN.replace("BSTAR =", "BSTAR"), "line 20: expected KEYWORD = value; found 'BSTAR -.22483E-4'"),
    (KVN.replace("BSTAR", "EPOCH"), "line 20: EPOCH is given twice; the first is in line 12"),
    (KVN.replace("10.84869164", "nan"), "line 13: MEAN_MOTION: expected a number; found 'nan'"),
    (KVN.replace("rev/day", "rad/s"), "line 13: MEAN_MOTION: expected the unit rev/day; found rad/s"),
    (KVN.replace("2020-10-13T", "2020-13-13T"), "line 12: EPOCH: expected UTC from 1957 to 2200"),
    (KVN + "EPHEMERIS_TYPE = 4\n", "line 21: EPHEMERIS_TYPE: expected 0, elements of SGP4; found 4"),
    (KVN + "DECAY_DATE = 2021-01-01\n", "line 21: VANGUARD 1 decayed on 2021-01-01"),
    ("\n" + XML.replace("<BSTAR>-.22483E-4</BSTAR>", ""), "line 4: expected BSTAR in the OMM of VANGUARD 1"),
    (XML.replace("</omm>", ""), "expected XML; mismatched tag"),
    ("[" + "9" * 5000 + "]", "line 1: expected an object with the fields of an OMM; found '999"),
    (KVN.replace("= 5\n", "= \u0665\n"), "line 19: NORAD_CAT_ID: expected up to nine digits, or Alpha-5"),
    (KVN.replace("= .184", "= .\u0661"), "line 14: ECCENTRICITY: expected a number"),
    (KVN.replace("= 2020-10", "= 202\u0660-10"), "line 12: EPOCH: expected UTC from"),
    ('[{"OBJECT_NAME": "A",\n "MEAN_MOTION": [1]}]', "line 1: MEAN_MOTION: expected a text or a number; found ['1']"),
    ('[\n{"OBJECT_NAME": "A"}]', "line 2: expected EPOCH, MEAN_MOTION, ECCENTRICITY, INCLINATION, "),
    ('{"OBJECT_NAME": \n', "line 2: expected JSON; Expecting value"),
    ("EPOCH,MEAN_MOTION\n1\n", "line 2: expected 2 columns, as the first line names; found 1"),
    ("\n\n", "the text: expected two-line elements, or an OMM in KVN, XML, JSON or CSV; it has none"),
    ("no_such_file.txt", "no_such_file.txt: expected a file, or a text of several lines; No such file"),
], ids=map(str, itertools.count()))
def test_bad_elements_are_refused(source, text):
    refused(source, text)


def test_any_damage_is_refused_or_harmless():
    """No error but SetupError, whatever a character turns into."""
    texts = [ISS, KVN, XML, (FOLDER / "sample_omm.csv").read_text(), json.dumps([{"EPOCH": "x", "NORAD_CAT_ID": 5}])]
    for text in damaged(texts, 2000, 1):
        with suppress(SetupError):
            mean_elements.read_all(text)


def test_the_module_flies_the_elements_where_another_program_does():
    """In N, by the whole theories of 1976 and 1980: 2 m, what the nutation on board leaves out."""
    erfa = module("erfa")
    _, first, second = ISS.splitlines()
    theirs, elements = sgp4.Satrec.twoline2rv(first, second), mean_elements.read(ISS)
    m = fsw.OrbitOnBoard(**elements.parameters(), age_max=86400)
    m.time.head.quality = "GOOD"
    for minutes in range(-1000, 2000, 100):
        m.time.time = elements.epoch + minutes * 60 * 10**9
        m.update(t=1.0)
        code, r, v = theirs.sgp4_tsince(minutes)
        tt = m.time.time / 86400e9 + 69.184 / 86400
        dpsi, deps = erfa.nut80(2451545.0, tt)
        eps = erfa.obl80(2451545.0, tt)
        teme = erfa.rz(dpsi * math.cos(eps + deps), erfa.pnm80(2451545.0, tt))
        assert code == 0 and m.state.code.name == "GOOD" and m.state.age == minutes * 60
        assert np.linalg.norm(m.orbit.r_BN_N - teme.T @ r * 1000) < 2
        assert np.linalg.norm(m.orbit.v_BN_N - teme.T @ v * 1000) < 0.002
        assert m.orbit.head.quality.name == ("GOOD" if abs(minutes) <= 1440 else "DEGRADED")
    assert elements.utc == datetime(2020, 10, 13, 4, 52, 49, 415808).isoformat()
