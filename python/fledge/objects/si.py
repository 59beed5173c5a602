# SPDX-License-Identifier: Apache-2.0
"""Quantities, numpy's and pint's numbers, as plain numbers in SI."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import Enum, IntEnum
from functools import cache
from typing import Any, SupportsFloat

from fledge.elements import short_names
from fledge.errors import SetupError, nearest
from fledge.units import Quantity, UnitError, nanoseconds

Number = Quantity | SupportsFloat   # pint's and numpy's, too; without a unit in SI
Time = Number                       # [s]


def to_si(value: Any, path: str, unit: str, dims: Any, expected: str) -> Any:
    """A quantity, a numpy scalar or a list of them as plain numbers in the header's unit.

    path: "flight.control.K"; unit: as in the header; dims: its exponents; expected: in words.
    Raises SetupError for another dimension, or if the value is no number.
    """
    def plain(x: Any) -> Any:
        if isinstance(x, Quantity):
            if x.dims[:7] != dims[:7] and unit != "SI":
                wanted = f"a quantity in {unit}" if unit not in ("", "-") else "a number without unit"
                raise SetupError(f"{path}: expected {wanted}; found {Quantity(_rounded(x.value), x.dims)}"
                                 + ("" if any(x.dims) else ", which has no unit"))
            if unit == "ns":
                return nanoseconds(x)
            return plain(x.value)
        if isinstance(x, (list, tuple)):
            return [plain(y) for y in x]
        if isinstance(x, (float, int)):
            return x
        if hasattr(x, "to_base_units") and hasattr(x, "magnitude"):
            return plain(_from_pint(x))
        if hasattr(x, "tolist"):  # numpy's arrays and scalars, pandas' series
            kind = getattr(getattr(x, "dtype", None), "kind", "O")
            if kind == "f" and not x.shape and x.tolist() is not None:  # which of a longdouble is a longdouble
                return float(x)
            if kind in "fiubO":
                return plain(x.tolist())
        elif hasattr(x, "__index__"):
            return int(x)
        elif hasattr(x, "__float__"):
            return float(x)
        raise SetupError(f"{path}: expected {expected}; found {_short(value)}")

    return plain(value)


def _rounded(value: Any) -> Any:
    """Numbers as a person reads them."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_rounded(element) for element in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _short(value: object) -> str:
    text = repr(value).replace("\n", " ")
    return text if len(text) <= 80 else text[:77] + "..."


# pint's names of the base dimensions, in the order of our exponents.
_PINT = ("[length]", "[mass]", "[time]", "[current]", "[temperature]", "[substance]", "[luminosity]")


def _from_pint(x: Any) -> Quantity:
    """A pint quantity as one of ours. pint itself is not imported."""
    base = x.to_base_units()
    dims = dict(base.dimensionality)
    exponents = []
    for name in _PINT:
        n = dims.pop(name, 0)
        if n != int(n):
            return Quantity(base.magnitude, (99,) * 8)
        exponents.append(int(n))
    magnitude = base.magnitude
    return Quantity(magnitude.tolist() if hasattr(magnitude, "tolist") else magnitude, (*exponents, 0))


def to_number(value: object, path: str, unit: str, dims: Any) -> float:
    """One plain number in `unit`, "-" for none, as to_si() converts it. Raises SetupError for anything else."""
    number = to_si(value, path, unit, dims, f"a number in {unit}" if unit != "-" else "a number")
    if not isinstance(number, (int, float)):
        raise SetupError(f"{path}: expected one number; found {value!r}")
    return float(number)


def to_vector(value: object, path: str, unit: str, dims: Any) -> list[float]:
    """Three plain numbers in `unit`, as to_si() converts them. Raises SetupError for anything else."""
    numbers = to_si(value, path, unit, dims, f"3 numbers in {unit}")
    if not isinstance(numbers, list) or len(numbers) != 3 or not all(isinstance(x, (int, float)) for x in numbers):
        raise SetupError(f"{path}: expected 3 numbers; found {value!r}")
    return [float(x) for x in numbers]


def time_ns(value: Time, path: str) -> int:
    """A time, a quantity or a number of seconds, in whole nanoseconds. Raises SetupError for anything else.

    path: the beginning of the error text, "task flight.gnc: every"
    """
    try:
        return nanoseconds(value)
    except (UnitError, ValueError, TypeError) as error:
        raise SetupError(f"{path}: {error}") from None


def enumerator_names(field: Any) -> dict[int, str]:
    """Number -> short name, "GOOD" of QUALITY_GOOD, of a field; {} if it is no enumeration."""
    short = short_names((name for name, _ in field.enumerators), field.ctype)
    return {number: short[name] for name, number in field.enumerators}


def enumerator(ctype: str, enumerators: Sequence[tuple[str, int]], value: Any, path: str) -> int:
    """The number of an enumerator (name, number), given by its name, short or whole, by its number, or as a Python
    enum. Raises SetupError for anything else."""
    foreign = isinstance(value, Enum) and type(value).__name__ != ctype
    if hasattr(value, "__index__") and not isinstance(value, bool) and not foreign:
        value = int(value)
    whole = [name for name, _ in enumerators]
    names = list(short_names(whole, ctype).values())
    for known in (names, whole) if isinstance(value, str) else ():
        if value in known:
            return enumerators[known.index(value)][1]
    endings = [number for name, number in enumerators if isinstance(value, str) and name.endswith(f"_{value}")]
    if len(endings) == 1:
        return endings[0]
    if type(value) is int and any(number == value for _, number in enumerators):
        return value
    near = nearest(value, names) if isinstance(value, str) else ""
    raise SetupError(f"{path}: expected one of {', '.join(names)}; found {value!r}"
                     + (f"; did you mean '{near}'?" if near else ""))


def to_enumerators(ctype: str, enumerators: Sequence[tuple[str, int]], value: Any, path: str) -> Any:
    """The number of an enumerator, or nested lists of them, from what enumerator() takes."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [to_enumerators(ctype, enumerators, element, path) for element in value]
    return enumerator(ctype, enumerators, value, path)


def enumeration(name: str, doc: str, values: Iterable[tuple[str, int, str]]) -> Any:
    """A Python enum for one of C, made once: its members by their short names; the whole ones are aliases."""
    return _enumeration(name, doc, tuple(values))


@cache
def _enumeration(name: str, doc: str, values: tuple[tuple[str, int, str], ...]) -> Any:
    short = short_names((n for n, _, _ in values), name)
    make: Any = IntEnum  # mypy knows only enumerations with a literal name
    made = make(name, {short[n]: v for n, v, _ in values} | {n: v for n, v, _ in values}, module="fledge")
    made.__doc__ = doc + "\n\n" + "\n".join(f"{short[n]}: {d}" for n, _, d in values)
    return made
