# SPDX-License-Identifier: Apache-2.0
"""SPK kernels against jplephem, an independent reader of the same files."""

import ctypes
import os
import random
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy import polynomial
from scipy import integrate, interpolate, optimize

from tests.needs import module

jplephem_spk = module("jplephem.spk")

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


def state_of(library, path, target, center, seconds):
    """Position [m], velocity [m/s] and acceleration [m/s^2]."""
    state = (ctypes.c_double * 9)()
    assert library.spk_state(str(path).encode(), target, center, seconds, state) == 0
    return np.array(state[:3]), np.array(state[3:6]), np.array(state[6:])


def ours(library, path, target, center, seconds):
    return state_of(library, path, target, center, seconds)[:2]


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


# What follows evaluates the other types a second time, from NAIF's description, on kernels made here.

EPOCHS = 1000.0 + np.cumsum(np.random.default_rng(1).uniform(40.0, 80.0, 250))
MU = 398600.4418        # [km^3/s^2]


def made(path, kind, words, first, last, frame=1):
    """A kernel with a segment of body -999 relative to the Earth."""
    words = np.asarray(words, "<f8")
    head = (b"DAF/SPK " + struct.pack("<2i", 2, 6)).ljust(76) + struct.pack("<3i", 2, 2, 385 + len(words)) + b"LTL-IEEE"
    summary = struct.pack("<5d6i", 0, 0, 1, first, last, -999, 399, frame, kind, 385, 384 + len(words))
    path.write_bytes(head.ljust(1024) + summary.ljust(1024, b"\0") + bytes(1024) + words.tobytes())
    return path


def curve(t):
    """A state [km, km/s] (n, 6) that no polynomial is."""
    t = np.atleast_1d(np.asarray(t, float))
    w = np.array([1.1e-3, 0.9e-3, 0.7e-3])
    return np.concatenate([7000 * np.sin(np.outer(t, w)), 7000 * w * np.cos(np.outer(t, w))], axis=1)


def window_of(epochs, t, size, cut):
    """The records NAIF takes: around the nearest for odd sizes, the later of two; half on each side for even."""
    low = min(max(int(np.searchsorted(epochs, t, side="right")) - 1, 0), len(epochs) - 1)
    nearest = len(epochs) - 1 - int(np.argmin(np.abs(epochs - t)[::-1]))
    begin = low - size // 2 + 1 if size % 2 == 0 else nearest - size // 2
    if cut:
        return slice(max(begin, 0), min(begin + size, len(epochs)))
    begin = min(max(begin, 0), len(epochs) - size)
    return slice(begin, begin + size)


def through(epochs, values, t, rates=None):
    """Value, first and second derivative at t of the polynomial, by scipy."""
    x = epochs - t
    if rates is not None:
        x, values = np.repeat(x, 2), np.stack([values, rates], axis=1).reshape(-1, 3)
    scale = np.abs(x).max()
    if rates is not None:
        values = values * np.where(np.arange(len(x)) % 2, scale, 1.0)[:, None]
    found = interpolate.KroghInterpolator(x / scale, values).derivatives(0.0, 3)
    return found[0], found[1] / scale, found[2] / scale**2


def expected_states(kind, epochs, records, t, size, subtype=None):
    rows = window_of(epochs, t, size, kind == 18)
    e, y = epochs[rows], records[rows]
    if kind in (8, 9) or subtype == 1:
        v, a, _ = through(e, y[:, 3:6], t)
        return through(e, y[:, :3], t)[0], v, a
    if subtype == 0:
        v, a, _ = through(e, y[:, 6:9], t, y[:, 9:12])
        return through(e, y[:, :3], t, y[:, 3:6])[0], v, a
    return through(e, y[:, :3], t, y[:, 3:6])


def tail_of(kind, epochs, size, subtype=None):
    directory = epochs[99:len(epochs) - 1:100]
    if kind in (8, 12):
        return [epochs[0], epochs[1] - epochs[0], size - 1, len(epochs)]
    last = [size - 1, len(epochs)] if kind != 18 else [subtype, size, len(epochs)]
    return np.concatenate([epochs, directory, last])


@pytest.mark.parametrize("kind, size, subtype, count", [
    (8, 3, None, 120), (8, 4, None, 120), (8, 7, None, 120), (9, 2, None, 250), (9, 8, None, 250), (9, 9, None, 250),
    (9, 28, None, 250), (12, 2, None, 120), (12, 5, None, 120), (13, 2, None, 250), (13, 4, None, 250),
    (13, 7, None, 250), (13, 14, None, 250), (18, 4, 0, 250), (18, 8, 1, 250), (18, 6, 2, 250), (18, 8, 1, 3),
    (18, 6, 2, 5)])
def test_polynomials_through_states_are_as_scipy_has_them(library, tmp_path, kind, size, subtype, count):
    epochs = EPOCHS[:count] if kind not in (8, 12) else 1000.0 + 60.0 * np.arange(count)
    records = curve(epochs)
    if subtype == 0:    # positions and velocities that are not each other's rates
        records = np.concatenate([records, curve(epochs + 500.0)], axis=1)
    path = made(tmp_path / "a.bsp", kind, np.concatenate([records.ravel(), tail_of(kind, epochs, size, subtype)]),
                epochs[0], epochs[-1])
    generator = random.Random(2)
    first, last = int(epochs[0]) + 1, int(epochs[-1]) - 1
    for t in [first, first + 29, last - 29, last, *(generator.randint(first, last) for _ in range(40))]:
        found = state_of(library, path, -999, 399, t)
        for x, y, tolerance in zip(found, expected_states(kind, epochs, records, t, size, subtype),
                                   (1e-6, 1e-8, 1e-9)):
            assert np.allclose(x, 1e3 * y, rtol=0, atol=1e3 * tolerance * (30 if size > 20 else 1)), (t, size)


def test_states_of_type_5_follow_a_conic_and_the_cosine_between_two(library, tmp_path):
    # Two orbits that do not agree, an ellipse and a hyperbola, so that the weights show.
    epochs = np.array([1000.0, 2500.0])
    records = np.array([[7000.0, 0, 0, 0, 8.5, 1.0], [-2000.0, 9000.0, 500.0, -9.0, -5.5, 1.0]])
    path = made(tmp_path / "a.bsp", 5, [*records.ravel(), *epochs, MU, 2], 0.0, 4000.0)

    def fall(i, t):
        found = integrate.solve_ivp(lambda _, y: [*y[3:], *(-MU * y[:3] / np.linalg.norm(y[:3])**3)],
                                    (epochs[i], t), records[i], method="DOP853", rtol=1e-13, atol=1e-13)
        return found.y[:, -1]

    def weighted(t):
        if t <= 1000 or t >= 2500:
            return fall(0 if t <= 1000 else 1, t)[:3]
        w = 0.5 * (1 + np.cos(np.pi * (t - 1000.0) / 1500.0))
        return w * fall(0, t)[:3] + (1 - w) * fall(1, t)[:3]

    for t in (0, 700, 1000, 1001, 1600, 2400, 2500, 3900):
        r, v, a = state_of(library, path, -999, 399, t)
        assert np.allclose(r, 1e3 * weighted(t), rtol=0, atol=1e-3)
        if t not in (0, 1000, 2500):
            before, at, after = (weighted(t + h) for h in (-0.5, 0.0, 0.5))
            assert np.allclose(v, 1e3 * (after - before), rtol=0, atol=1e-2)
            assert np.allclose(a, 1e3 * 4 * (after - 2 * at + before), rtol=0, atol=1e-3)


@pytest.mark.parametrize("e", [1.5, 5.0, 30.0])
def test_a_hyperbola_of_type_5_may_be_followed_far(library, tmp_path, e):
    a = 7000.0 / (e - 1)
    state = [7000.0, 0, 0, 0, np.sqrt(MU * (1 + e) / 7000.0), 0]
    path = made(tmp_path / "a.bsp", 5, [*state, 0.0, MU, 1], -1e8, 1e8)
    for t in (-99_999_999, -1_000_000, 100, 2_000_000, 50_000_000):
        H = optimize.brentq(lambda H: e * np.sinh(H) - H - np.sqrt(MU / a**3) * t, -30, 30, xtol=1e-14, rtol=1e-14)
        expected = 1e3 * np.array([a * (e - np.cosh(H)), a * np.sqrt(e * e - 1) * np.sinh(H), 0])
        assert np.allclose(state_of(library, path, -999, 399, t)[0], expected, rtol=1e-11, atol=1e-3)


def differences(record, n, t):
    """State [km] of a record of differences: its acceleration as a polynomial, which numpy integrates."""
    x = polynomial.Polynomial([0.0, 1.0])
    g, reference, table = record[1:n + 1], record[n + 1:n + 7], record[n + 7:4 * n + 7].reshape(3, n)
    r, v, a = np.zeros(3), np.zeros(3), np.zeros(3)
    for axis in range(3):
        factor, total = polynomial.Polynomial([1.0]), polynomial.Polynomial([0.0])
        for j in range(int(record[4 * n + 8 + axis])):
            total += table[axis, j] * factor
            factor *= (x + (g[j - 1] if j else 0.0)) / g[j]
        dt = t - record[0]
        a[axis] = total(dt)
        v[axis] = reference[2 * axis + 1] + total.integ()(dt)
        r[axis] = reference[2 * axis] + reference[2 * axis + 1] * dt + total.integ(2)(dt)
    return r, v, a


@pytest.mark.parametrize("kind, n", [(1, 15), (21, 15), (21, 20), (21, 25)])
def test_differences_are_integrals_of_the_acceleration(library, tmp_path, kind, n):
    generator = np.random.default_rng(3)
    records, epochs = [], 1000.0 + 100.0 * np.arange(1, 124)
    epochs[40:42] = epochs[39]      # two records of no length, which integrators write
    for epoch in epochs:
        steps = np.cumsum(generator.uniform(80.0, 120.0, n))
        table = generator.uniform(-1e-3, 1e-3, (3, n)) * 0.5**np.arange(n)
        orders = generator.integers(1, n, 3)
        records.append([epoch - generator.uniform(0, 50), *steps, *generator.uniform(-7000, 7000, 6), *table.ravel(),
                        max(orders) + 1, *orders])
    last = [n, len(epochs)] if kind == 21 else [len(epochs)]
    path = made(tmp_path / "a.bsp", kind, np.concatenate([np.ravel(records), epochs, epochs[99::100], last]), 1000.0,
                epochs[-1])
    for t in [1000, 1050, 1100, 1101, *(int(epochs[i]) for i in (39, 41, -1)), int(epochs[39]) + 1,
              *generator.integers(1000, epochs[-1], 40)]:
        record = np.array(records[int(np.searchsorted(epochs, t))])
        for x, y in zip(state_of(library, path, -999, 399, int(t)), differences(record, n, t)):
            assert np.allclose(x, 1e3 * y, rtol=1e-12, atol=1e-7), t


def about(axis, angle):
    """Components in axes that are turned [rad]."""
    i, j = axis % 3, (axis + 1) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = np.sin(angle), -np.sin(angle)
    return matrix


def test_frames_that_do_not_turn_are_those_of_erfa_and_of_the_iau(library, tmp_path):
    erfa = module("erfa")
    epochs, records = EPOCHS[:20], curve(EPOCHS[:20])
    words, t = np.concatenate([records.ravel(), epochs, [3, 20]]), int(epochs[10])

    def vectors(frame):     # of a position, a velocity and an acceleration, by columns
        path = made(tmp_path / f"{frame}.bsp", 13, words, epochs[0], epochs[-1], frame)
        return np.stack(state_of(library, path, -999, 399, t), axis=1)

    plain, arcsec, besselian = vectors(1), np.pi / 648000, (2433282.42345905, 0.0)
    b1950, in_ecliptic = erfa.pmat76(*besselian), about(1, erfa.obl80(2451545.0, 0.0))
    angles = [np.array(erfa.icrs2g(np.arctan2(x[1], x[0]), np.arcsin(x[2]))) for x in np.eye(3)]
    galactic = np.stack([[np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)] for a, b in angles], axis=1)
    mars = about(1, np.radians(90 - 52.886)) @ about(3, np.radians(90 + 317.681))       # its pole by the IAU, 1988
    for frame, dcm_FN, within in (
            (17, in_ecliptic, 1e-12), (2, b1950, 1e-3 * arcsec), (16, mars, 1e-12), (13, galactic, 2 * arcsec),
            (3, about(3, 0.525 * arcsec) @ b1950, 1e-3 * arcsec),                       # Fricke's equinox of FK4
            (18, about(1, erfa.obl80(*besselian)) @ b1950, 0.02 * arcsec),
            *((other, b1950, 0.6 * arcsec) for other in range(4, 13)), (14, np.eye(3), 0), (15, np.eye(3), 0),
            *((other, b1950, 2 * arcsec) for other in (19, 20, 21))):
        dcm_NF = vectors(frame) @ np.linalg.inv(plain)
        assert np.abs(dcm_NF - dcm_FN.T).max() <= within + 1e-12, frame
        assert np.abs(dcm_NF.T @ dcm_NF - np.eye(3)).max() < 1e-12
