# SPDX-License-Identifier: Apache-2.0
"""Kernels of positions as Fledge writes them: their bytes, read by Fledge's reader of kernels, and by jplephem."""

import struct
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

from fledge import files
from fledge.errors import SetupError
from fledge.files import daf, spk
from tests.needs import module

TIMES = 700_000_000_000_000_000 + np.cumsum(np.random.default_rng(1).integers(50 * 10**9, 70 * 10**9, 230))
SECONDS = [float(Fraction(int(t), 10**9)) for t in TIMES]
RATE = np.array([1.1e-3, 0.9e-3, 0.7e-3])


def curve(times):
    """r [m], v [m/s]"""
    angle = np.outer((np.asarray(times) - TIMES[0]) / 1e9, RATE)
    return 7e6 * np.sin(angle), 7e6 * RATE * np.cos(angle)


def wrote(path, **other):
    r, v = curve(TIMES)
    spk.write(path, **{"target": -999, "center": "EARTH", "times": TIMES, "r": r, "v": v, **other})
    return path


@pytest.mark.parametrize("type, degree, within", [(13, 11, 1e-3), (9, 11, 1e-2), (13, 3, 10.0), (9, 8, 0.1)])
def test_between_the_states_the_reader_finds_the_curve(tmp_path, type, degree, within):
    segment, = spk.read(wrote(tmp_path / "a.bsp", type=type, degree=degree))
    assert (segment.target, segment.center, segment.frame, segment.type, segment.name) == (
        -999, 399, "J2000", type, "FLEDGE")
    assert TIMES[0] - 256 <= segment.begin <= TIMES[0] and TIMES[-1] <= segment.end <= TIMES[-1] + 256
    assert segment.degree == degree and np.abs(segment.times - TIMES).max() <= 128
    times = np.concatenate([np.linspace(segment.begin, segment.end, 301).astype(np.int64)[1:-1],
                            [segment.begin, segment.end], TIMES[1:-1]])
    r, v = segment.at(times)
    expected_r, expected_v = curve(times)
    assert np.abs(r - expected_r).max() < within
    assert np.abs(v - expected_v).max() < within
    with pytest.raises(SetupError, match="body -999 is given from 2022-03-08"):
        segment.at(TIMES[-1] + 10**9)


def test_a_hermite_polynomial_of_degree_3_is_between_two_states(tmp_path):
    t, r, v = np.array([0, 10 * 10**9]), np.array([[1e6, 0, 0], [2e6, 5e5, 0]]), np.array([[0, 3e3, 0], [1e5, 0, 7e3]])
    spk.write(tmp_path / "a.bsp", target=-1, center=399, times=t, r=r, v=v)
    found, rate = spk.read(tmp_path / "a.bsp")[0].at([3 * 10**9])
    s, h = 0.3, 10.0
    cubic = ((1 + 2 * s) * (1 - s)**2 * r[0] + s**2 * (3 - 2 * s) * r[1] + h * s * (1 - s)**2 * v[0]
             + h * s**2 * (s - 1) * v[1])
    assert np.allclose(found, cubic, rtol=0, atol=1e-6)
    slope = (6 * s * (s - 1) * (r[0] - r[1]) / h + (1 - s) * (1 - 3 * s) * v[0] + s * (3 * s - 2) * v[1])
    assert np.allclose(rate, slope, rtol=0, atol=1e-6)


def test_a_span_beyond_the_years_of_64_bits_ends_with_them(tmp_path):
    words = np.array([7000.0, 0, 0, 0, 7.5, 0, 0.0, 398600.4418, 1])    # a conic from J2000 on, without an end
    daf.write(tmp_path / "a.bsp", daf.Daf("DAF/SPK ", [daf.Segment(-1e10, 1e10, (-1, 399, 1, 5), "S", words)]))
    segment, = spk.read(tmp_path / "a.bsp")
    assert (segment.begin, segment.end) == (-2**63, 2**63 - 1)
    assert np.allclose(segment.at([0])[0], [7e6, 0, 0]) and np.isfinite(segment.at([segment.begin, segment.end])).all()


def test_jplephem_reads_the_same_container(tmp_path):
    jplephem = module("jplephem.daf")
    path = wrote(tmp_path / "a.bsp", comments=["of a test", "two"], name="A CRAFT")
    with open(path, "rb") as file:
        theirs = jplephem.DAF(file)
        assert theirs.comments() == "of a test\ntwo\n"
        (name, values), = theirs.summaries()
        assert (name.strip(), values[2:6]) == (b"A CRAFT", (-999, 399, 1, 13))
        assert values[:2] == (SECONDS[0], SECONDS[-1])
        words = theirs.read_array(*values[6:])
    assert np.array_equal(words[:1380].reshape(-1, 6), np.hstack(curve(TIMES)) / 1e3)
    assert np.array_equal(words[1380:1610], SECONDS)
    assert list(words[1610:]) == [SECONDS[99], SECONDS[199], 5, 230]


def test_the_head_is_as_naif_describes_it(tmp_path):
    data = wrote(tmp_path / "a.bsp", comments=["x" * 700, "y" * 700]).read_bytes()
    assert data[:8] == b"DAF/SPK " and data[88:96] == b"LTL-IEEE" and len(data) % 1024 == 0
    assert data[699:727] == b"FTPSTR:\r:\n:\r\n:\r\0:\x81:\x10\xce:ENDFTP"
    assert struct.unpack("<2i", data[8:16]) == (2, 6)
    first, last, free = struct.unpack("<3i", data[76:88])
    assert (first, last) == (4, 4)              # behind two records of comments
    assert free == struct.unpack_from("<i", data, 3 * 1024 + 24 + 36)[0] + 1
    assert (data[1024:2024] + data[2048:3048]).split(b"\x04")[0] == b"x" * 700 + b"\0" + b"y" * 700 + b"\0"


def test_many_segments_take_several_summary_records(tmp_path):
    path, words = tmp_path / "a.bsp", [np.arange(3.0 + i) for i in range(60)]
    daf.write(path, daf.Daf("DAF/SPK ", [daf.Segment(i, i + 1, (i, 0, 1, 5), f"S{i}", w) for i, w in enumerate(words)]))
    found = daf.read(path, "DAF/SPK ").segments
    assert [(s.first, s.last, s.integers, s.name) for s in found] == [
        (i, i + 1, (i, 0, 1, 5), f"S{i}") for i in range(60)]
    assert all(np.array_equal(s.words, w) for s, w in zip(found, words))
    jplephem = module("jplephem.daf")
    with open(path, "rb") as file:
        theirs = jplephem.DAF(file)
        assert [int(values[2]) for _, values in theirs.summaries()] == list(range(60))


def test_what_cannot_be_written_is_refused(tmp_path):
    path = tmp_path / "a.bsp"
    r, _ = curve(TIMES)
    for bad, text in [({"type": 5}, "found type 5"), ({"degree": 8}, "found type 13, degree 8"),
                      ({"degree": 29}, "degree 29"), ({"times": TIMES[::-1]}, "times that increase"),
                      ({"times": TIMES[1:]}, r"expected times \(n,\)"), ({"r": r * np.nan}, "finite states"),
                      ({"r": r[1:]}, r"expected times \(n,\)"), ({"center": "PERTH"}, "no body is named"),
                      ({"name": "x" * 41}, "up to 40 characters"), ({"comments": ["ä"]}, "in ASCII")]:
        with pytest.raises(SetupError, match=text):
            wrote(path, **bad)
        assert not path.exists()


def test_damaged_files_are_refused(tmp_path):
    path = wrote(tmp_path / "a.bsp")
    data = path.read_bytes()
    for bad, text in [(b"GIF89a", "begins with 'DAF/SPK '"), (data[:500], "cut short"),
                      (data[:4096], "a.bsp: segment 1, FLEDGE: is damaged or cut short"),
                      (data[:76] + b"\x63\0\0\0" + data[80:], "summary record 99"),
                      (data[:76] + b"\xff\xff\xff\x7f" + data[80:], "summary record 2147483647"),
                      (data[:2048] + b"\xa0\x1b" + data[2050:4096], "segment 1, .xa0\u27e81B\u27e9EDGE: is damaged"),
                      (data[:8] + b"\x03" + data[9:], "found 3 and 6"),
                      (data[:1024 + 24 + 28] + b"\x63" + data[1024 + 24 + 29:], "a.bsp.*99")]:
        path.write_bytes(bad)
        with pytest.raises(SetupError, match=text):
            spk.read(path)
    with pytest.raises(SetupError, match="cannot be read"):
        spk.read(tmp_path / "none.bsp")


def test_the_readers_are_attributes_of_files():
    code = "from fledge import files; print(files.ck.read, files.ndm.read, files.spk.read)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert found.count("<function read ") == 3
    with pytest.raises(AttributeError, match="fledge.files has no 'oem'; there are ck, "):
        getattr(files, "oem")


def test_files_read_says_what_reads_kernels(tmp_path):
    with pytest.raises(SetupError, match="x.bsp: is a kernel of SPICE.*: read it with files.spk.read"):
        files.read(wrote(tmp_path / "x.bsp"))
