# SPDX-License-Identifier: Apache-2.0
"""The module `math` of Python that flies (flying.py): what the interpreter of targets has (targets/micropython/math.c),
with its bits. Functions whose last bit IEEE 754 leaves open are flight's own; of Python's others, those that no target
has are there for what the desktop alone computes.

They raise as Python's: ValueError for an argument outside of the domain, OverflowError for a result beyond a double.
"""
from __future__ import annotations

import math as _python
from collections.abc import Callable
from math import inf, isfinite, isinf
from typing import Any

from fledge.flight_math import fm_acos, fm_asin, fm_atan, fm_atan2, fm_cos, fm_exp, fm_log, fm_pow, fm_sin, fm_tan

# Of Python's functions, those that a target has, too: they are exact, or one product.
SAME = {"ceil", "copysign", "degrees", "fabs", "floor", "fmod", "isfinite", "isinf", "isnan", "radians", "sqrt",
        "trunc"}
globals().update({name: value for name, value in vars(_python).items() if not name.startswith("_")})


def _number(x: Any) -> float:
    """What Python's own take as a number."""
    return x if type(x) is float else _python.ldexp(x, 0)


def _of(function: Callable[[float], float]) -> Callable[[Any], float]:
    name = function.__name__.removeprefix("fm_")

    def of_one(x: Any, /) -> float:
        number = _number(x)
        result = function(number)
        if not isfinite(result):
            if result != result and number == number or result == -inf:
                raise ValueError("math domain error")
            if isinf(result) and isfinite(number):
                raise OverflowError("math range error")
        return result

    of_one.__name__ = of_one.__qualname__ = name
    of_one.__doc__ = getattr(_python, name).__doc__
    return of_one


acos, asin, atan, cos, exp, sin, tan = map(_of, (fm_acos, fm_asin, fm_atan, fm_cos, fm_exp, fm_sin, fm_tan))
_natural = _of(fm_log)


def log(x: Any, base: Any = None, /) -> float:
    """The natural logarithm, or that to a base, as a quotient of natural ones."""
    return _natural(x) if base is None else _natural(x) / _natural(base)


def atan2(y: Any, x: Any, /) -> float:
    """The angle of the point (x, y) from the x axis, in [-pi, pi]."""
    return fm_atan2(_number(y), _number(x))


def pow(x: Any, y: Any, /) -> float:
    """x to the power of y."""
    x, y = _number(x), _number(y)
    result = fm_pow(x, y)
    if not isfinite(result) and isfinite(x) and isfinite(y):
        if x == 0 or result != result:
            raise ValueError("math domain error")
        raise OverflowError("math range error")
    return result
