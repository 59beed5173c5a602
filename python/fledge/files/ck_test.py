# SPDX-License-Identifier: Apache-2.0
"""Kernels of attitudes, laid out word by word as NAIF describes type 3."""

import numpy as np
import pytest

from fledge import files, motion
from fledge.attitude import quaternion_to_dcm
from fledge.errors import SetupError
from fledge.files import ck, daf, ndm, sclk
from fledge.files.sclk_test import BEPI
from fledge.world import Sky
from tests.needs import needs

RATE, AXIS = 2e-3, np.array([2.0, -1.0, 2.0]) / 3


def c_matrix(t):
    """That of NAIF, from J2000 to axes that turn about AXIS since t = 0 [s] (Rodrigues' formula)."""
    x = np.array([[0, -AXIS[2], AXIS[1]], [AXIS[2], 0, -AXIS[0]], [-AXIS[1], AXIS[0], 0]])
    return np.eye(3) - np.sin(RATE * t) * x + (1 - np.cos(RATE * t)) * x @ x


def quaternion(t):
    """(n, 4) Of the C-matrix as NAIF's Q2M has them: it turns vectors by the angle, here the negative of the axes'."""
    t = np.asarray(t, float)[:, None]
    return np.hstack([np.cos(RATE * t / 2), -AXIS * np.sin(RATE * t / 2)])


@pytest.fixture
def clock(tmp_path):
    (tmp_path / "a.tsc").write_text(BEPI)
    return sclk.read(tmp_path / "a.tsc")


def write(path, seconds, spans, rates=True, kind=3, bounds=None, **other):
    """A kernel of attitudes at seconds (n,) of the clock, with spans that begin at some of them. other: wrong words."""
    rows = quaternion(seconds)
    if rates:
        rows = np.hstack([rows, np.tile(RATE * AXIS, (len(seconds), 1))])
    ticks, starts = np.asarray(seconds, float) * 65536, np.asarray(spans, float) * 65536
    words = {"rows": rows.ravel(), "ticks": ticks, "directory": ticks[99:-1:100], "starts": starts,
             "more": starts[99:-1:100], "counts": [len(starts), len(ticks)], **other}
    first, last = np.multiply(bounds or (seconds[0], seconds[-1]), 65536)
    segment = daf.Segment(first, last, (-69000, 1, kind, int(rates)), "BUS", np.concatenate(list(words.values())))
    daf.write(path, daf.Daf("DAF/CK  ", [segment]))
    return path


@pytest.mark.parametrize("rates", [True, False])
def test_attitudes_are_those_of_the_c_matrix_and_spans_end_at_gaps(tmp_path, clock, rates):
    seconds = np.concatenate([np.arange(0, 2200, 10.0), [5000.0], np.arange(6000, 6100, 7.0)])
    first, single, last = ck.read(write(tmp_path / "a.bc", seconds, [0, 5000, 6000], rates), clock)
    assert (len(first.times), len(single.times), len(last.times)) == (220, 1, 15)
    assert (first.meta["REF_FRAME_A"], first.meta["REF_FRAME_B"], first.meta["OBJECT_ID"]) == ("J2000", "-69000", "-69")
    for segment, at in ((first, 1234.5), (single, 5000.0), (last, 6093.0)):
        beta = segment.at(clock.ns(at * 65536))[0]
        assert np.allclose(quaternion_to_dcm(beta), c_matrix(at), rtol=0, atol=1e-12)
        assert segment.span == (segment.times[0], segment.times[-1])
        assert ("ANGVEL_X" in segment.table.columns) == rates
    if rates:
        assert np.allclose([first.table.columns[name][7] for name in ck.RATES], RATE * AXIS, rtol=0, atol=1e-15)
        later = (c_matrix(1e-3) - c_matrix(-1e-3)) / 2e-3       # dC/dt = -C [rate x], of the rate in J2000
        assert np.allclose(later[[1, 2, 0], [2, 0, 1]], RATE * AXIS, rtol=0, atol=1e-9)
    assert clock.text(clock.ticks(last.times[:1])[0]) == "1/0000006000.00000"
    message = ndm.create("AEM", [first, single, last], originator="TEAM", created="2026-01-02T00:00:00")
    files.write(message, tmp_path / "a.aem")
    assert np.array_equal(files.read(tmp_path / "a.aem").segments[2].beta_BA, last.beta_BA)
    with pytest.raises(SetupError, match="may be used from"):
        first.at(clock.ns(2195 * 65536))


def test_attitudes_outside_the_summarys_times_are_not_used(tmp_path, clock):
    path = write(tmp_path / "a.bc", np.arange(0, 100, 10.0), [0, 50], bounds=(55, 80))
    segment, = ck.read(path, clock)
    assert segment.span == tuple(clock.ns([55 * 65536, 80 * 65536]))
    assert segment.times[0] == clock.ns(50 * 65536)[0]


@needs("casacore-data-jpl-de405")
def test_of_segments_that_overlap_the_last_counts(tmp_path, clock):
    spun, = ck.read(write(tmp_path / "a.bc", np.arange(0, 1001, 10.0), [0]), clock)
    still, = ck.read(write(tmp_path / "b.bc", np.arange(400, 601, 10.0), [400], False,
                           rows=np.tile([0.8, 0, 0.6, 0], 21)), clock)
    seconds = np.array([5.0, 399.0, 400, 500, 600, 601, 999])
    for segments, hidden in (([spun, still], (seconds >= 400) & (seconds <= 600)), ([still, spun], seconds < 0)):
        message = ndm.create("AEM", segments, originator="TEAM", created="2026-01-02T00:00:00")
        files.write(message, tmp_path / "a.aem")
        sky = Sky(f"{spun.clock.text(int(spun.times[0]))} TDB", center=399)
        times = clock.ns(seconds * 65536) - spun.times[0]
        found = motion.of_file(tmp_path / "a.aem", sky)
        expected = np.where(hidden[:, None, None], quaternion_to_dcm([0.8, 0, -0.6, 0]), [c_matrix(t) for t in seconds])
        assert np.allclose(quaternion_to_dcm(found.at(times).beta_BN), expected, rtol=0, atol=1e-9)


def test_other_types_and_damaged_kernels_are_refused(tmp_path, clock):
    path, seconds = tmp_path / "a.bc", np.arange(0, 50, 10.0)
    for wrong, text in (({"kind": 5}, "a.bc: segment 1, BUS: expected type 3; found 5"),
                        ({"counts": [1, 6]}, "6 attitudes in 1 spans do not fill its 43 words"),
                        ({"counts": [np.nan, 5]}, "5 attitudes in 0 spans do not fill"),
                        ({"rows": np.zeros(35)}, "unit quaternions"), ({"ticks": -seconds}, "ticks that increase"),
                        ({"starts": [5.0]}, "at which the spans begin")):
        with pytest.raises(SetupError, match=text):
            ck.read(write(path, seconds, [0], **wrong), clock)
    with pytest.raises(SetupError, match="a.bc: segment 1, BUS: .*a.tsc: expected ticks from 0"):
        ck.read(write(path, seconds - 5, [-5]), clock)
