# SPDX-License-Identifier: Apache-2.0
import pytest

from introspect.errors import Refusal
from introspect.units import ANY, BASES, NANOSECONDS, parse


def dims(**powers):
    return tuple(powers.get(base, 0) for base in BASES)


@pytest.mark.parametrize("text, expected", [
    ("m", dims(m=1)),
    ("rad/s^2", dims(rad=1, s=-2)),
    ("kg m^2", dims(kg=1, m=2)),
    ("N m", dims(kg=1, m=2, s=-2)),
    ("N m / s", dims(kg=1, m=2, s=-3)),
    ("J/kg K", dims(m=2, s=-2, K=1)),      # a slash divides by the next factor only
    ("J/kg/K", dims(m=2, s=-2, K=-1)),
    ("W/m^2", dims(kg=1, s=-3)),
    ("V", dims(kg=1, m=2, s=-3, A=-1)),
    ("Pa m^2", dims(kg=1, m=1, s=-2)),
    ("Hz", dims(s=-1)),
    ("s^-1", dims(s=-1)),
    ("1/s", dims(s=-1)),
    ("1 / m^2", dims(m=-2)),
    ("1/T s", dims(kg=-1, s=3, A=1)),
    ("T", dims(kg=1, s=-2, A=-1)),
    ("V s/m^2", dims(kg=1, s=-2, A=-1)),
    ("ohm", dims(kg=1, m=2, s=-3, A=-2)),
    ("kg m^-3", dims(kg=1, m=-3)),
    ("cd mol", dims(cd=1, mol=1)),
    ("-", dims()),
])
def test_units_have_the_exponents_of_their_factors(text, expected):
    unit = parse(text)
    assert (unit.text, unit.dims, unit.scale) == (text, expected, 1.0)


def test_nanoseconds_are_the_one_scaled_unit():
    assert parse("ns") == NANOSECONDS
    assert parse("SI") == ANY
    assert NANOSECONDS.dims == dims(s=1) and NANOSECONDS.scale == 1e-9


def test_spaces_do_not_matter_but_between_factors():
    assert parse("  N   m ") == parse("N m")


@pytest.mark.parametrize("text", ["", "/s", "m/", "m//s", "m^", "m^2.5", "m^s", "2 m", "m*s", "N-m",
                                  "m^999", "m -", "1", "1/", "1//s", "1 s", "m 1/s", "s/1", "2/s"])
def test_malformed_units_are_refused(text):
    with pytest.raises(Refusal, match="a unit is factors `symbol` or `symbol\\^integer`"):
        parse(text)


@pytest.mark.parametrize("text, symbol, advice", [
    ("deg", "deg", "angles are in rad"),
    ("km/s", "km", "give the value in SI"),
    ("m/ns", "ns", "ns stands alone, for integer times; else use s"),
])
def test_unknown_symbols_are_named(text, symbol, advice):
    with pytest.raises(Refusal) as refusal:
        parse(text)
    assert refusal.value.found == f"`{symbol}` in [{text}]"
    assert refusal.value.advice == advice
    assert "m kg s A K mol cd rad N J W V Hz Pa T ohm" in refusal.value.rule
