# SPDX-License-Identifier: Apache-2.0
"""Units: a quantity is its value in SI and the exponents of the base units.

    from fledge.units import N, deg, kg, m, s

    gain = 2.531 * N * m
    inertia = [700, 700, 800] * kg * m**2
    (0.3 * deg / s).value       # 0.00523..., in rad/s
    (2 * minute).to(s)          # 120.0

A bare number is SI wherever a quantity is expected. Angles are dimensionless: rad is remembered for
display and ignored when dimensions are compared. Lists and numpy arrays may be given units; quantities
only add, compare and convert between like dimensions.

targets/micropython/units.c does the same under MicroPython, with the units of this file.
"""

from __future__ import annotations

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from typing import Any, SupportsFloat

# The order of the exponents, the same as in the tables made from the C headers.
BASE = ("m", "kg", "s", "A", "K", "mol", "cd", "rad")


class UnitError(ValueError):
    """Quantities of unlike dimensions were added, compared or converted."""


def _map(f: Callable[[Any], Any], value: Any) -> Any:
    """Apply f to a number, to each number of a nested list, or to an array as a whole."""
    if isinstance(value, (list, tuple)):
        return [_map(f, x) for x in value]
    return f(value)


def _zip(f: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
    """Apply f to two values of the same shape, or to a value and a number."""
    if isinstance(a, (list, tuple)):
        if isinstance(b, (list, tuple)):
            if len(a) != len(b):
                raise ValueError("lists of %d and %d values do not match" % (len(a), len(b)))
            return [_zip(f, x, y) for x, y in zip(a, b)]
        return [_zip(f, x, b) for x in a]
    if isinstance(b, (list, tuple)):
        return [_zip(f, a, y) for y in b]
    return f(a, b)


def _multiply(a: Any, b: Any) -> Any:
    return a * b


def _power(x: Any, n: float) -> Any:
    """x to the power of n. Of a whole n by products, whose bits do not depend on a library."""
    if n != int(n) or n == 0:
        return x**n
    product = x
    for _ in range(abs(int(n)) - 1):
        product = product * x
    return product if n > 0 else 1 / product


def unit_text(dims: Iterable[int]) -> str:
    """The SI unit of those exponents as text: "N m", "rad/s", "kg m^2/s"; "" if dimensionless."""
    known = _NAMES.get(tuple(dims))
    if known is not None:
        return known

    def factors(sign: int) -> list[str]:
        return [name if n == sign else "%s^%d" % (name, n * sign) for name, n in zip(BASE, dims) if n * sign > 0]

    above, below = factors(1), factors(-1)
    return (" ".join(above) or ("1" if below else "")) + "".join(["/" + x for x in below])


class Quantity:
    """A number, nested list or numpy array in SI, with the exponents of m, kg, s, A, K, mol, cd, rad.

    `value` is in SI; `dims` holds the exponents. Made by multiplying with a unit: `3 * m`.
    """

    # numpy must leave `array * m` to __rmul__ below instead of looking into the quantity.
    __array_ufunc__ = None

    def __init__(self, value: Any, dims: Iterable[int]) -> None:
        self.value = value
        self.dims = tuple(dims)

    # --- making new ones ---

    def __mul__(self, other: object) -> Quantity:
        if isinstance(other, Quantity):
            dims = [a + b for a, b in zip(self.dims, other.dims)]
            return Quantity(_zip(_multiply, self.value, other.value), dims)
        return Quantity(_zip(_multiply, self.value, other), self.dims)

    def __rmul__(self, other: object) -> Quantity:
        return Quantity(_zip(_multiply, other, self.value), self.dims)

    def __truediv__(self, other: object) -> Quantity:
        if not isinstance(other, Quantity):
            other = Quantity(other, _NONE)
        dims = [a - b for a, b in zip(self.dims, other.dims)]
        return Quantity(_zip(lambda a, b: a / b, self.value, other.value), dims)

    def __rtruediv__(self, other: object) -> Quantity:
        return Quantity(other, _NONE) / self

    def __pow__(self, n: float) -> Quantity:
        dims = [a * n for a in self.dims]
        whole = [int(round(a)) for a in dims]
        if any([abs(a - b) > 1e-9 for a, b in zip(dims, whole)]):
            raise UnitError("%s to the power of %s has no whole exponents" % (self._unit(), n))
        return Quantity(_map(lambda x: _power(x, n), self.value), whole)

    def __neg__(self) -> Quantity:
        return Quantity(_map(lambda x: -x, self.value), self.dims)

    def __pos__(self) -> Quantity:
        return self

    def __abs__(self) -> Quantity:
        return Quantity(_map(abs, self.value), self.dims)

    def __add__(self, other: object) -> Quantity:
        return Quantity(_zip(lambda a, b: a + b, self.value, self._like(other, "add")), self.dims)

    def __radd__(self, other: object) -> Quantity:
        return self + other

    def __sub__(self, other: object) -> Quantity:
        return Quantity(_zip(lambda a, b: a - b, self.value, self._like(other, "subtract")), self.dims)

    def __rsub__(self, other: object) -> Quantity:
        return -self + other

    # --- comparing: unlike dimensions are never equal, and have no order ---

    def __eq__(self, other: object) -> bool:
        try:
            return self.value == self._like(other, "compare")
        except UnitError:
            return False

    def __lt__(self, other: object) -> bool:
        return self.value < self._like(other, "compare")

    def __le__(self, other: object) -> bool:
        return self.value <= self._like(other, "compare")

    def __gt__(self, other: object) -> bool:
        return self.value > self._like(other, "compare")

    def __ge__(self, other: object) -> bool:
        return self.value >= self._like(other, "compare")

    # --- reading ---

    def to(self, unit: Quantity) -> Any:
        """The value in another unit, as a number, list or array: `(2 * minute).to(s)` is 120.0.

        Raises UnitError if the dimensions differ.
        """
        if not isinstance(unit, Quantity) or isinstance(unit.value, (list, tuple)):
            raise UnitError("to() needs a unit, as in x.to(km); found %r" % (unit,))
        self._like(unit, "convert")
        return _map(lambda x: x / unit.value, self.value)

    def __float__(self) -> float:
        return float(self._like_number())

    def __len__(self) -> int:
        return len(self.value)

    def __getitem__(self, index: int | slice | tuple) -> Quantity:
        return Quantity(self.value[index], self.dims)

    def __iter__(self) -> Iterator[Quantity]:
        return iter([Quantity(x, self.dims) for x in self.value])

    def __bool__(self) -> bool:
        return bool(self.value)

    def __repr__(self) -> str:
        unit = self._unit()
        return str(self.value) + (" " + unit if unit else "")

    def _unit(self) -> str:
        return unit_text(self.dims)

    def _like_number(self) -> Any:
        if any(self.dims[:7]):
            raise UnitError("%s is not a plain number; write x.to(unit) or x.value" % (self,))
        return self.value

    def _like(self, other: object, verb: str) -> Any:
        """The other's value if its dimensions are like these; rad is ignored."""
        if isinstance(other, Quantity):
            if self.dims[:7] == other.dims[:7]:
                return other.value
            theirs = other._unit() or "a plain number"
        else:
            if not any(self.dims[:7]):
                return other
            theirs = "a plain number"
        raise UnitError("cannot %s %s and %s" % (verb, self._unit() or "a plain number", theirs))


_NONE = (0, 0, 0, 0, 0, 0, 0, 0)


# Of the type Any, because mypy knows only whole numbers as factors of a list, as in [1, 2, 3] * m.
def _base(index: int) -> Any:
    return Quantity(1.0, [int(i == index) for i in range(8)])


def _times(factor: float, unit: Quantity) -> Any:
    return Quantity(factor * unit.value, unit.dims)


m, kg, s, A, K, mol, cd, rad = [_base(i) for i in range(8)]

# length, mass
km = _times(1e3, m)
cm = _times(1e-2, m)
mm = _times(1e-3, m)
um = _times(1e-6, m)
au = _times(149597870700.0, m)  # IAU 2012 Resolution B2
g = _times(1e-3, kg)

# time
ms = _times(1e-3, s)
us = _times(1e-6, s)
ns = _times(1e-9, s)
minute = _times(60.0, s)
hour = _times(3600.0, s)
day = _times(86400.0, s)
Hz = 1.0 / s
kHz = _times(1e3, Hz)
MHz = _times(1e6, Hz)

# angle
_PI = 3.141592653589793
deg = _times(_PI / 180.0, rad)
arcmin = _times(_PI / 10800.0, rad)
arcsec = _times(_PI / 648000.0, rad)
mrad = _times(1e-3, rad)
urad = _times(1e-6, rad)
rpm = 2.0 * _PI / 60.0 * rad / s

# mechanics
N = kg * m / s**2
mN = _times(1e-3, N)
uN = _times(1e-6, N)
kN = _times(1e3, N)
J = N * m
W = J / s
mW = _times(1e-3, W)
kW = _times(1e3, W)
Pa = N / m**2
kPa = _times(1e3, Pa)

# electricity
V = W / A
mV = _times(1e-3, V)
mA = _times(1e-3, A)
ohm = V / A
T = V * s / m**2
uT = _times(1e-6, T)
nT = _times(1e-9, T)

UNITS = (
    "m km cm mm um au kg g s ms us ns minute hour day Hz kHz MHz rad deg arcmin arcsec mrad urad rpm "
    "N mN uN kN J W mW kW Pa kPa A mA K mol cd V mV ohm T uT nT"
).split()
__all__ = UNITS + ["Quantity", "UnitError"]

# How compound units are shown.
_NAMES = {}
for _name, _unit in (
    ("N", N),
    ("N m", N * m),
    ("N m s", N * m * s),
    ("N m/s", N * m / s),
    ("N s", N * s),
    ("W", W),
    ("Pa", Pa),
    ("V", V),
    ("ohm", ohm),
    ("T", T),
    ("kg m^2", kg * m**2),
):
    _NAMES[_unit.dims] = _name


def unit_of(text: str) -> Quantity:
    """The unit of a text, as headers and unit_text() write it: "deg/s", "N m / s", "kg m^2"; "" and "-" are 1.

    Raises UnitError for a name that is no unit.
    """
    result, power = Quantity(1.0, _NONE), 1
    for word in text.replace("/", " / ").split():
        if word == "/":
            power = -1      # of what follows, as in unit_text
            continue
        name, _, exponent = word.partition("^")
        if name not in UNITS and word not in ("1", "-") or not (exponent or "1").lstrip("-").isdigit():
            raise UnitError("'%s' is no unit; the units are %s" % (word, ", ".join(UNITS)))
        if name in UNITS:
            result = result * globals()[name] ** (power * int(exponent or "1"))
    return result


def nanoseconds(t: Quantity | SupportsFloat) -> int:
    """A time, a quantity or a number of seconds, as the nearest whole number of nanoseconds.

    Raises UnitError for what is no time, texts included, ValueError for what is not finite or beyond 292 years, which
    is what 64 bits hold.
    """
    if isinstance(t, Quantity):
        if t.dims[:7] != s.dims[:7]:
            raise UnitError("expected a time, found %s" % (t,))
        t = t.value
    kind = getattr(getattr(t, "dtype", None), "kind", "f")      # of numpy: also differences of dates have __float__
    if isinstance(t, bool) or kind not in "fiuO" or not isinstance(t, (int, float)) and not hasattr(t, "__float__"):
        raise UnitError("expected a time, such as 10 * s; found %r" % (t,))
    if not isinstance(t, int):
        t = float(t)
        if t != t or t in (float("inf"), float("-inf")):
            raise ValueError("expected a finite time, found %s" % t)
    near = abs(t) < 1e10  # looked at first, for the product may overflow
    ns = t * 1000000000 if isinstance(t, int) else int(round(t * 1e9)) if near else 0
    if not near or not -9223372036854775808 <= ns <= 9223372036854775807:
        raise ValueError("expected a time within 292 years, found %s s" % t)
    return ns


def __getattr__(name: str) -> Any:
    if name[:2] == "__":
        raise AttributeError(name)
    # ImportError, because units are reached by `from fledge.units import ...`, which would replace
    # the text of an AttributeError.
    products = ["%s * %s" % (name[:i], name[i:]) for i in range(1, len(name))
                if name[:i] in UNITS and name[i:] in UNITS]
    try:
        from fledge.basilisk import WORDS
    except ImportError:     # under MicroPython
        WORDS = {}
    advice = "write %s; " % products[0] if products else (
        "here, Basilisk's is %s; " % WORDS[name] if name in WORDS else "")
    raise ImportError("fledge.units has no unit '%s'; %sthe units are %s" % (name, advice, ", ".join(UNITS)))
