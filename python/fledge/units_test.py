# SPDX-License-Identifier: Apache-2.0
"""Quantities: their values, dimensions and refusals."""

import itertools
import math

import numpy as np
import pytest

from fledge import units
from fledge.units import (
    A, Hz, J, K, N, Pa, Quantity, T, UnitError, V, W, arcsec, au, cm, day, deg, g, hour, kg, km, m,
    minute, mm, mrad, ms, nanoseconds, ns, rad, rpm, s, uT, unit_of, us,
)


@pytest.mark.parametrize(
    "quantity, value, text",
    [
        (3 * km, 3000.0, "m"),
        (3 * cm, 0.03, "m"),
        (5 * g, 0.005, "kg"),
        (2 * hour, 7200.0, "s"),
        (1 * day, 86400.0, "s"),
        (180 * deg, math.pi, "rad"),
        (1 * deg - 3600 * arcsec, 0.0, "rad"),
        (60 * rpm, 2 * math.pi, "rad/s"),
        (2.5 * N * m, 2.5, "N m"),
        (2.5 * J, 2.5, "N m"),
        (4 * W / A, 4.0, "V"),
        (T * m**2 / s, 1.0, "V"),
        (30 * uT, 3e-5, "T"),
        (7 * kg * m**2, 7.0, "kg m^2"),
        (1 * N / m**2, 1.0, "Pa"),
        (5 / s, 5.0, "1/s"),
        (2 * m / s**2, 2.0, "m/s^2"),
        (1 * m / m, 1.0, ""),
        (1 * au, 149597870700.0, "m"),
    ],
)
def test_value_and_unit(quantity, value, text):
    assert quantity.value == pytest.approx(value, rel=1e-15, abs=1e-17)
    assert units.unit_text(quantity.dims) == text


def test_every_unit_is_a_quantity_with_positive_value_and_converts_to_itself():
    for name in units.UNITS:
        unit = getattr(units, name)
        assert isinstance(unit, Quantity) and unit.value > 0
        assert (3 * unit).to(unit) == pytest.approx(3.0, rel=1e-15)


def test_unlike_units_neither_add_nor_compare_nor_convert():
    kinds = [m, kg, s, A, K, N, J, W, Pa, V, T, Hz, m / s]
    for a, b in itertools.permutations(kinds, 2):
        assert a != b
        for act in (lambda: a + b, lambda: a - b, lambda: a < b, lambda: a >= b, lambda: a.to(b)):
            with pytest.raises(UnitError):
                act()


def test_the_message_names_both_units():
    with pytest.raises(UnitError, match="cannot add N m and kg"):
        2 * N * m + 3 * kg
    with pytest.raises(UnitError, match="cannot compare s and a plain number"):
        3 * s < 4


def test_angles_are_plain_numbers_too():
    assert 1 * rad / s == 1 * Hz
    assert 0.5 * rad + 0.25 == 0.75 * rad
    assert math.sin(90 * deg) == pytest.approx(1.0)
    with pytest.raises(UnitError, match="not a plain number"):
        float(1 * m)


def test_lists_keep_their_nesting():
    q = [[1, 2], [3, 4]] * km
    assert q.value == [[1000.0, 2000.0], [3000.0, 4000.0]]
    assert (q / s).to(m / ms) == [[1.0, 2.0], [3.0, 4.0]]
    assert ([700, 700, 800] * kg * m**2).value == [700.0, 700.0, 800.0]
    assert [x.value for x in [1, 2] * mm] == [0.001, 0.002]
    assert -([1, 2] * m) + [1, 3] * m == [0.0, 1.0] * m
    assert len(q) == 2 and q[1] == [3, 4] * km
    with pytest.raises(ValueError, match="2 and 3"):
        [1, 2] * m + [1, 2, 3] * m


def test_numpy_arrays_get_units_whole():
    for q in (np.array([1.0, 2.0]) * km, km * np.array([1.0, 2.0])):
        assert isinstance(q, Quantity) and isinstance(q.value, np.ndarray)
        assert list(q.value) == [1000.0, 2000.0]
    assert isinstance(np.float64(2.0) * m, Quantity)


def test_powers():
    assert (4 * m**2) ** 0.5 == 2 * m
    assert (2 * m) ** -1 == 0.5 / m
    with pytest.raises(UnitError, match="no whole exponents"):
        m**0.5


def test_nanoseconds():
    assert nanoseconds(100 * ms) == 100_000_000
    assert nanoseconds(0.1) == 100_000_000
    assert nanoseconds(160 * minute) == 9_600_000_000_000
    assert nanoseconds(7 * ns) == 7 and nanoseconds(3 * us) == 3000
    assert nanoseconds(400_000_000) == 400_000_000_000_000_000
    with pytest.raises(UnitError, match="expected a time, found 3.0 m"):
        nanoseconds(3 * m)
    assert nanoseconds(np.float64(0.25)) == 250_000_000 and nanoseconds(np.int64(2)) == 2_000_000_000
    with pytest.raises(ValueError, match="finite"):
        nanoseconds(float("nan"))


@pytest.mark.parametrize("text", ["10 s", "10", "", None, True, [1, 2], [1, 2] * s, np.timedelta64(3, "ns"),
                                  np.datetime64("2026-01-01", "ns"), np.complex64(1)])
def test_what_is_no_number_is_no_time(text):
    with pytest.raises(UnitError, match=r"expected a time, such as 10 \* s; found"):
        nanoseconds(text)


def test_an_unknown_unit_lists_the_known():
    with pytest.raises(ImportError, match="no unit 'furlong'; the units are m, km,"):
        from fledge.units import furlong  # noqa: F401


def test_repr():
    assert repr(45.0 * N * m * s) == "45.0 N m s"
    assert repr(1 * mrad) == "0.001 rad"


def test_times_beyond_64_bits_are_refused():
    assert units.nanoseconds(9.2e9) == 9_200_000_000_000_000_000
    for t in (1e10, 10**10, -1e10, 400 * 365.25 * units.day):
        with pytest.raises(ValueError, match="within 292 years"):
            units.nanoseconds(t)


def test_units_are_read_as_headers_write_them():
    for text, unit in (("rad/s", rad / s), ("N m / s", N * m / s), ("kg m^2", kg * m**2), ("m^3/s^2", m**3 / s**2),
                       ("deg", deg)):
        found = unit_of(text)
        assert found.value == unit.value and found.dims == unit.dims, text
    assert unit_of("-").dims == unit_of("").dims == (0,) * 8 and unit_of("1/s").dims == Hz.dims
    for text in ("foo", "m^x", "N*m", "Quantity", "__name__"):
        with pytest.raises(UnitError, match="is no unit; the units are m, km"):
            unit_of(text)
