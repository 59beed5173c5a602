# SPDX-License-Identifier: Apache-2.0
"""SPK kernels against jplephem, an independent reader of the same files."""

import ctypes
import os
import random
import sys
from pathlib import Path

import numpy as np
import pytest

jplephem_spk = pytest.importorskip("jplephem.spk", reason="python3-jplephem is not installed")

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("FLEDGE_TEST_DATA", ROOT.parent / "shared" / "data"))
DAY = 86400
J2000 = 2451545.0


@pytest.fixture(scope="module")
def library():
    paths = [Path(folder) / "libfledge_ephemeris_calls.so" for folder in sys.path]
    found = [path for path in paths if path.exists()]
    if not found:
        pytest.skip("libfledge_ephemeris_calls.so is not built; the target `tests` builds it")
    lib = ctypes.CDLL(str(found[0]))
    lib.spk_state.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_int, ctypes.c_longlong,
                              ctypes.POINTER(ctypes.c_double)]
    return lib


def kernel(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"not here: {path}")
    return path


def ours(library, path, target, center, seconds):
    """Position [m] and velocity [m/s]."""
    state = (ctypes.c_double * 9)()
    assert library.spk_state(str(path).encode(), target, center, seconds, state) == 0
    return np.array(state[:3]), np.array(state[3:6])


def theirs(segment, seconds):
    """Position [m] and velocity [m/s], which jplephem gives per second or per day by type."""
    days, rest = divmod(seconds, DAY)
    r, v = segment.compute_and_differentiate(J2000 + days, rest / DAY)
    return 1e3 * r[:3], 1e3 * (v[:3] / DAY if segment.data_type == 2 else r[3:])


@pytest.mark.parametrize("name", ["de430-2015-03-02.bsp", "de441-1969.bsp", "jup310-excerpt.bsp"])
def test_every_segment_is_as_jplephem_reads_it(library, name):
    path = kernel(name)
    generator = random.Random(1)
    with jplephem_spk.SPK.open(str(path)) as spk:
        assert spk.segments
        for segment in spk.segments:
            # Strictly inside, and within what 64-bit nanoseconds reach.
            first = max(int(segment.start_second), -9_000_000_000) + 1
            last = min(int(segment.end_second), 9_000_000_000) - 1
            for seconds in [first, last] + [generator.randint(first, last) for _ in range(8)]:
                r, v = ours(library, path, segment.target, segment.center, seconds)
                r_expected, v_expected = theirs(segment, seconds)
                assert np.linalg.norm(r - r_expected) < 0.01  # doubles at Pluto: 1 mm
                assert np.linalg.norm(v - v_expected) < 1e-8


def test_the_moon_from_the_earth_is_the_difference_of_two_segments(library):
    path = kernel("de430-2015-03-02.bsp")
    seconds = 478_569_600
    with jplephem_spk.SPK.open(str(path)) as spk:
        moon, earth, emb, sun = (theirs(spk[pair], seconds)
                                 for pair in [(3, 301), (3, 399), (0, 3), (0, 10)])
    r, v = ours(library, path, 301, 399, seconds)
    assert np.linalg.norm(r - (moon[0] - earth[0])) < 1e-3
    assert np.linalg.norm(v - (moon[1] - earth[1])) < 1e-6
    r, v = ours(library, path, 301, 10, seconds)
    assert np.linalg.norm(r - (moon[0] + emb[0] - sun[0])) < 0.01
    assert np.linalg.norm(v - (moon[1] + emb[1] - sun[1])) < 1e-6
