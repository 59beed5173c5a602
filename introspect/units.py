# SPDX-License-Identifier: Apache-2.0
"""Units as headers write them: `[N m / s]`, `[rad/s^2]`, `[kg m^2]`, `[1/s]`, `[-]`, `[ns]`.

    unit   = "-" | "ns" | "SI" | ( factor | "1" "/" factor ) { ("/" | " ") factor }
    factor = symbol [ "^" integer ]

A "/" divides by the next factor only, so `J/kg K` is J kg^-1 K. Only SI units without prefix are
known, because every number in a header is SI; the one exception is time in integer nanoseconds,
which stands alone. What has the unit of something else, such as the size of a fault, is in [SI]: a
quantity of any dimension.
"""
from __future__ import annotations

import re

from introspect.errors import Refusal
from introspect.model import Unit

BASES = ("m", "kg", "s", "A", "K", "mol", "cd", "rad")


def _exponents(**powers: int) -> tuple[int, ...]:
    return tuple(powers.get(base, 0) for base in BASES)


SYMBOLS = {base: _exponents(**{base: 1}) for base in BASES} | {
    "N": _exponents(kg=1, m=1, s=-2),
    "J": _exponents(kg=1, m=2, s=-2),
    "W": _exponents(kg=1, m=2, s=-3),
    "V": _exponents(kg=1, m=2, s=-3, A=-1),
    "Hz": _exponents(s=-1),
    "Pa": _exponents(kg=1, m=-1, s=-2),
    "T": _exponents(kg=1, s=-2, A=-1),
    "ohm": _exponents(kg=1, m=2, s=-3, A=-2),
}

DIMENSIONLESS = Unit("-", _exponents())
NANOSECONDS = Unit("ns", _exponents(s=1), 1e-9)
ANY = Unit("SI", _exponents())

_FACTOR = re.compile(r"([A-Za-z]+)(?:\^([+-]?[0-9]+))?")
_LARGEST = 127  # an exponent fits into an int8_t


def parse(text: str) -> Unit:
    """The unit that `text`, without its brackets, stands for. Raises Refusal."""
    text = " ".join(text.split())
    if text == "-":
        return DIMENSIONLESS
    if text == "ns":
        return NANOSECONDS
    if text == "SI":
        return ANY
    dims = [0] * len(BASES)
    tokens = re.findall(r"/|[^/\s]+", text)
    sign, expected = 1, True
    if tokens[:2] == ["1", "/"]:
        del tokens[0]
        expected = False
    for token in tokens:
        if token == "/":
            if expected:
                raise _malformed(text)
            sign, expected = -1, True
            continue
        factor = _FACTOR.fullmatch(token)
        if not factor:
            raise _malformed(text)
        symbol, power = factor[1], int(factor[2] or 1)
        if symbol not in SYMBOLS:
            raise Refusal(f"a unit is made of {' '.join(SYMBOLS)}, or is ns or -",
                          f"`{symbol}` in [{text}]", _advice(symbol))
        for i, exponent in enumerate(SYMBOLS[symbol]):
            dims[i] += sign * power * exponent
        sign, expected = 1, False
    if expected or max(abs(exponent) for exponent in dims) > _LARGEST:
        raise _malformed(text)
    return Unit(text, tuple(dims))


def _malformed(text: str) -> Refusal:
    return Refusal("a unit is factors `symbol` or `symbol^integer`, separated by spaces or `/`",
                   f"[{text}]", "write for example [N m / s], [1/s], or [-] for none")


def _advice(symbol: str) -> str:
    if symbol in ("deg", "rpm", "arcsec"):
        return "angles are in rad"
    if symbol == "ns":
        return "ns stands alone, for integer times; else use s"
    return "give the value in SI"
