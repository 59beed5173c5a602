# SPDX-License-Identifier: Apache-2.0
"""Numbers, vectors, matrices and units in HTML, as a person writes them."""
from __future__ import annotations

import re

from markupsafe import Markup, escape

ROWS_MAX = 12       # of a matrix; more are cut
NUMBERS_MAX = 16    # of a vector

NONE = Markup("<i>none</i>")


def number(x: float, digits: int = 7) -> str:
    """An int or float, with so many significant digits, a true minus and powers of ten."""
    if isinstance(x, bool):
        return "yes" if x else "no"
    if x != x:
        return "not a number"
    shown = str(x) if isinstance(x, int) else f"{x + 0.0:.{digits}g}"
    mantissa, _, power = shown.replace("inf", "\N{INFINITY}").partition("e")
    mantissa, power = (part.replace("-", "\N{MINUS SIGN}") for part in (mantissa, power and str(int(power))))
    return Markup(f"{mantissa}\N{MULTIPLICATION SIGN}10<sup>{power}</sup>") if power else mantissa


def value(x: str | float | list, digits: int = 7) -> str:
    """A number, text or nested list: vectors in brackets, matrices as such, diagonal ones by their diagonal."""
    if isinstance(x, (str, list)) and not x:
        return NONE
    if not isinstance(x, list):
        return x if isinstance(x, str) else number(x, digits)
    if isinstance(x[0], list):
        return _matrix(x, digits)
    if not any(x):
        return "0"
    if len(x) > 3 and all(item == x[0] for item in x):
        return Markup("{}, each of {}").format(value(x[0], digits), len(x))
    used = max(i for i, item in enumerate(x, 1) if item)
    shown = [value(item, digits) for item in (x if len(x) - used < 3 else x[:used])]
    if len(shown) > NUMBERS_MAX:
        shown[NUMBERS_MAX:] = [f"\N{HORIZONTAL ELLIPSIS} {len(x)} in all"]
    elif len(shown) < len(x):
        shown.append("0 \N{HORIZONTAL ELLIPSIS}")
    return Markup('<span class="vector">[{}]</span>').format(Markup(", ").join(shown))


def _matrix(rows: list[list], digits: int) -> str:
    if not any(map(any, rows)):
        return "0"
    if len(rows) == len(rows[0]) and not isinstance(rows[0][0], (list, str)):
        diagonal = [row[i] for i, row in enumerate(rows)]
        if not any(element for i, row in enumerate(rows) for j, element in enumerate(row) if i != j):
            if all(element == diagonal[0] for element in diagonal):
                return Markup("{} \N{MULTIPLICATION SIGN} identity").format(number(diagonal[0], digits))
            return Markup("diagonal {}").format(value(diagonal, digits))
    cells = [Markup("").join(Markup("<td>{}</td>").format(value(item, digits)) for item in row)
             for row in rows[:ROWS_MAX]]
    table = Markup('<table class="matrix">{}</table>').format(
        Markup("").join(map(Markup("<tr>{}</tr>").format, cells)))
    more = len(rows) - ROWS_MAX
    return table + Markup("<small>and {} more rows</small>").format(more) if more > 0 else table


def unit(text: str) -> Markup:
    """A unit with its exponents raised; "" of none."""
    return Markup(re.sub(r"\^(-?\d+)", lambda match: f"<sup>{match[1]}</sup>".replace("-", "\N{MINUS SIGN}"),
                         str(escape(text)) if text != "-" else ""))


def duration(seconds: float) -> Markup:
    """ "9000 s = 2.5 h": the plain seconds, and another unit where those are many."""
    plain = Markup("{}&nbsp;s").format(number(seconds, digits=9))
    for name, factor in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * factor:
            return plain + Markup('<small class="aside"> = {:.4g} {}</small>').format(seconds / factor, name)
    return plain
