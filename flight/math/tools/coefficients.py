#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Derive every constant of flight/math: polynomials, tables, and the bits of 2/pi.

    coefficients.py                 print the constants as C text, with each polynomial's error
    coefficients.py --check FILE... exit 1 unless every constant derived here stands in the files

The polynomials are minimax in relative error of the final result. A Remez exchange runs on a
Chebyshev grid in 60-digit arithmetic. Its coefficients are not doubles: in the variable z >= 0 they
are fixed one at a time, the lowest is rounded to a double and the exchange is run again for the
rest, which then make up for that rounding. (On an interval with 0 inside that theory fails, but
there the rounding is harmless.) The error printed is that of the rounded polynomial.
Needs python3-mpmath.
"""

import re
import struct
import sys

try:
    from mpmath import mp, mpf
except ImportError:
    print("not installed: python3-mpmath", file=sys.stderr)
    sys.exit(77)

mp.dps = 60


# ---- doubles ------------------------------------------------------------------------------------

def hexfloat(x):
    """C99 text of a value that is a double already."""
    text = float(x).hex()
    mantissa, exponent = text.split("p")
    if "." in mantissa:
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}p{exponent}"


def keep_bits(x, bits):
    """x truncated to its leading `bits` bits."""
    if x == 0:
        return mpf(0)
    lsb = mpf(2) ** (int(mp.floor(mp.log(abs(x), 2))) + 1 - bits)
    return mp.sign(x) * mp.floor(abs(x) / lsb) * lsb


def on_grid(x, lsb):
    """x rounded to a multiple of lsb."""
    return mp.nint(x / lsb) * lsb


def double(x):
    return mpf(float(x))


# ---- minimax polynomials ------------------------------------------------------------------------

def exchange(points, values, weights, powers):
    """Coefficients c of sum c_i x^powers[i] with the least max |weight (value - sum)|."""
    n = len(powers)
    last = len(points) - 1
    chosen = [round(last * (1 - mp.cos(mp.pi * i / n)) / 2) for i in range(n + 1)]
    for _ in range(40):
        system = mp.matrix(n + 1, n + 1)
        right = mp.matrix(n + 1, 1)
        for row, j in enumerate(chosen):
            for column, power in enumerate(powers):
                system[row, column] = points[j] ** power * weights[j]
            system[row, n] = (-1) ** row
            right[row] = values[j] * weights[j]
        coefficients = list(mp.lu_solve(system, right))[:n]
        new = alternation(errors(points, values, weights, powers, coefficients), n + 1)
        if new == chosen:
            break
        chosen = new
    return coefficients


def errors(points, values, weights, powers, coefficients):
    return [w * (v - mp.fsum(c * x**p for c, p in zip(coefficients, powers)))
            for x, v, w in zip(points, values, weights)]


def alternation(curve, count):
    """Indices of the largest error in each run of equal sign, trimmed at the ends to `count`."""
    peaks = []
    for j, e in enumerate(curve):
        if peaks and mp.sign(e) == mp.sign(curve[peaks[-1]]):
            if abs(e) > abs(curve[peaks[-1]]):
                peaks[-1] = j
        else:
            peaks.append(j)
    while len(peaks) > count:
        peaks.pop(0 if abs(curve[peaks[0]]) < abs(curve[peaks[-1]]) else -1)
    return peaks


def minimax(function, weight, low, high, terms):
    """Doubles c_0..c_(terms-1) of the best polynomial, and log2 of its largest weighted error."""
    grid = 40 * terms
    points = [(low + high) / 2 - (high - low) / 2 * mp.cos(mp.pi * (2 * j + 1) / (2 * grid))
              for j in range(grid)]
    values = [function(x) for x in points]
    weights = [abs(weight(x)) for x in points]
    powers = list(range(terms))
    if low < 0:
        fixed = [double(c) for c in exchange(points, values, weights, powers)]
    else:
        fixed, rest = [], values
        for power in powers:
            c = double(exchange(points, rest, weights, powers[power:])[0])
            fixed.append(c)
            rest = [v - c * x**power for v, x in zip(rest, points)]
    return fixed, mp.log(max(map(abs, errors(points, values, weights, powers, fixed))), 2)


# Each entry: name, f, weight (error of f -> relative error of the result), interval, terms.
# A result that is r + r^3 f(r^2), say, has the weight r^3 / result.
EIGHTH = mp.tan(mp.pi / 8)
EXP_HALF = mp.log(2) / 128
LOG_LOW, LOG_HIGH = mpf("-0.0172"), mpf("0.0172")      # asserted in log_table()


def sine(z):
    r = mp.sqrt(z)
    return (mp.sin(r) - r) / r**3


def cosine(z):
    return (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2


def arctangent(z):
    u = mp.sqrt(z)
    return (mp.atan(u) - u) / u**3


def arcsine(z):
    s = mp.sqrt(z)
    return (mp.asin(s) - s) / s**3


def polynomials():
    quarter = (mp.pi / 4) ** 2 * mpf("1.0001")
    return {
        "SIN": minimax(sine, lambda z: z ** 1.5 / mp.sin(mp.sqrt(z)), mpf(0), quarter, 6),
        "COS": minimax(cosine, lambda z: z**2 / mp.cos(mp.sqrt(z)), mpf(0), quarter, 6),
        "ATAN": minimax(arctangent, lambda z: z ** 1.5 / mp.atan(mp.sqrt(z)),
                        mpf(0), EIGHTH**2 * mpf("1.0001"), 11),
        "ASIN": minimax(arcsine, lambda z: z ** 1.5 / mp.asin(mp.sqrt(z)), mpf(0), mpf("0.25"), 13),
        "EXP": minimax(lambda r: (mp.expm1(r) - r) / r**2, lambda r: r**2,
                       -EXP_HALF * mpf("1.001"), EXP_HALF * mpf("1.001"), 4),
        "LOG": minimax(lambda r: (mp.log1p(r) - r) / r**2, lambda r: r**2 / mp.log1p(r),
                       LOG_LOW, LOG_HIGH, 7),
        "LOG_CUBE": minimax(lambda r: (mp.log1p(r) - r + r**2 / 2) / r**3, lambda r: r**3 / mp.log1p(r),
                            LOG_LOW, LOG_HIGH, 8),
    }


# ---- tables -------------------------------------------------------------------------------------

def split(value, *bits):
    """value as a sum of doubles: the leading ones cut to the given bits, the last one rounded."""
    parts = []
    for b in bits:
        parts.append(keep_bits(value - mp.fsum(parts), b))
    parts.append(double(value - mp.fsum(parts)))
    return parts


def exp_table():
    """2^(j/64) as double and remainder."""
    return [split_nearest(mpf(2) ** (mpf(j) / 64)) for j in range(64)]


def split_nearest(value):
    high = double(value)
    return [high, double(value - high)]


# log: m runs over [LOG_START, 2 LOG_START) in 32 steps of equal length in the bit pattern, of
# which one straddles 1.  c ~ 1/m is short, so that c times the top 44 bits of m is exact.
LOG_START_BITS = 0x3FE6A000_00000000
LOG_STEP_BITS = 1 << 47
LN2_LSB = mpf(2) ** -42


def log_table():
    """Rows c, and -log(c) as a multiple of 2^-42 and the remainder."""
    rows = []
    for i in range(32):
        low, high = (mpf(from_bits(LOG_START_BITS + k * LOG_STEP_BITS)) for k in (i, i + 1))
        c = on_grid(2 / (low + high), mpf(2) ** -8)
        if low < 1 < high:
            c = mpf(1)
        assert LOG_LOW < low * c - 1 and high * c - 1 < LOG_HIGH, (i, low * c - 1, high * c - 1)
        assert c < 2
        value = -mp.log(c)
        high_part = on_grid(value, LN2_LSB)
        rows.append([c, high_part, double(value - high_part)])
    return rows


def from_bits(bits):
    return struct.unpack(">d", struct.pack(">Q", bits))[0]


def two_over_pi():
    """The bits of 2/pi after the binary point, in 32-bit words, behind 64 zeros."""
    words = 39
    with mp.workprec(32 * words + 64):
        digits = int(mp.floor(2 / mp.pi * mpf(2) ** (32 * (words - 2))))
    return [0, 0] + [digits >> 32 * (words - 3 - i) & 0xFFFFFFFF for i in range(words - 2)]


def constants():
    """Name -> (list of constants as C text, comment)."""
    out = {}
    for name, (coefficients, error) in polynomials().items():
        out[name] = ([hexfloat(c) for c in coefficients], f"relative error 2^{float(error):.1f}")
    for name, parts in {
        "PIO2 (33 + 33 + 53 bits)": split(mp.pi / 2, 33, 33),
        "PIO2 (nearest + rest)": split_nearest(mp.pi / 2),
        "TWO_OVER_PI": [double(2 / mp.pi)],
        "LN2/64 (32 + 53 bits)": split(mp.log(2) / 64, 32),
        "64/LN2": [double(64 / mp.log(2))],
        "LN2 (multiple of 2^-42 + rest)":
            [on_grid(mp.log(2), LN2_LSB), double(mp.log(2) - on_grid(mp.log(2), LN2_LSB))],
        "1/6": [double(mpf(1) / 6)],
        "TAN_PI_8": [double(EIGHTH)],
        "PI/4 k": [p for k in range(5) for p in split_nearest(mp.pi / 4 * k)],
        "EXP2": [p for row in exp_table() for p in row],
        "LOGC": [p for row in log_table() for p in row],
    }.items():
        out[name] = ([hexfloat(p) for p in parts], "")
    out["TWO_OVER_PI bits"] = ([f"0x{w:08x}" for w in two_over_pi()], "")
    return out


NUMBER = re.compile(r"0x[0-9a-f.]+p[+-]\d+|0x[0-9a-f]+|\d+\.\d+")


def number(text):
    return float.fromhex(text) if text.lstrip("-").startswith("0x") else float(text)


def main(arguments):
    derived = constants()
    if arguments[:1] == ["--check"] and len(arguments) > 1:
        text = "".join(open(name, encoding="utf-8").read() for name in arguments[1:])
        known = {number(n) for n in NUMBER.findall(text)}
        missing = [(name, c) for name, (texts, _) in derived.items() for c in texts
                   if abs(number(c)) not in known]
        for name, c in missing:
            print(f"{name}: {c} is not in the source", file=sys.stderr)
        print(f"{sum(len(v) for v, _ in derived.values())} constants, {len(missing)} missing")
        return 1 if missing else 0
    for name, (values, comment) in derived.items():
        print(f"{name}  {comment}")
        for value in values:
            print(f"    {value},")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
