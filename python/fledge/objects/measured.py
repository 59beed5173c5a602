# SPDX-License-Identifier: Apache-2.0
"""A field as one number, to be compared with a constant."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from typing import Any, Self

from fledge.errors import SetupError
from fledge.objects.si import enumerator, to_si


class Measured:
    """A field. `.norm()`, `.max_abs()` and `[i]` make a number of an array. Subclasses define comparisons."""

    _path: str                              # of the field
    _field: Any                             # its Field
    _shape: tuple[int, ...]
    _measure: str | tuple[int, ...] = ""    # "norm", "max_abs" or indices; "" of the whole field

    def norm(self) -> Self:
        """The root of the sum of the elements' squares."""
        return self._reduced("norm", "norm()")

    def max_abs(self) -> Self:
        """The largest magnitude of the elements."""
        return self._reduced("max_abs", "max_abs()")

    def __getitem__(self, index: int | tuple[int, ...]) -> Self:
        index = index if isinstance(index, tuple) else (index,)
        element = self._reduced(index, "[...]")
        if len(index) != len(self._shape) or not all(isinstance(i, int) and 0 <= i < n
                                                     for i, n in zip(index, self._shape)):
            raise SetupError(
                f"{self._path}{list(index)}: expected {len(self._shape)} whole numbers below {self._shape}")
        return element

    def _with(self, **changes: object) -> Self:
        other = copy(self)
        vars(other).update(changes)
        return other

    def _reduced(self, measure: str | tuple[int, ...], what: str) -> Self:
        if not self._shape or self._measure:
            raise SetupError(f"{self!r}: {what} is for arrays")
        return self._with(_measure=measure)

    @property
    def measure_text(self) -> str:
        """ "norm(flight.tracking.error.sigma_BR)" """
        if isinstance(self._measure, tuple):
            return f"{self._path}[{', '.join(map(str, self._measure))}]"
        return f"{self._measure}({self._path})" if self._measure else self._path

    def _constant(self, constant: object, comparison: str) -> float:
        """A constant to compare with, as a number in the field's unit."""
        if self._shape and not self._measure:
            raise SetupError(f"{self!r} has shape {self._shape}: compare an element, norm() or max_abs()")
        if self._field.type == "enum":
            return enumerator(self._field.ctype, self._field.enumerators, constant, f"{self!r} {comparison}")
        value = to_si(constant, repr(self), self._field.unit, self._field.dims, "a number")
        if not isinstance(value, (int, float)):
            raise SetupError(f"{self!r} {comparison} {constant!r}: expected a number")
        return value

    def _compare(self, comparison: str, constant: object) -> Any:
        raise NotImplementedError

    def __lt__(self, constant: object) -> Any:
        return self._compare("<", constant)

    def __le__(self, constant: object) -> Any:
        return self._compare("<=", constant)

    def __gt__(self, constant: object) -> Any:
        return self._compare(">", constant)

    def __ge__(self, constant: object) -> Any:
        return self._compare(">=", constant)


def flat_index(index: Iterable[int], shape: Iterable[int]) -> int:
    """The place of an element in an array's memory."""
    flat = 0
    for i, n in zip(index, shape):
        flat = flat * n + i
    return flat


def unit_after(unit: str) -> str:
    """ " N m", to follow a number; "" if it is dimensionless."""
    return f" {unit}" if unit not in ("", "-") else ""
