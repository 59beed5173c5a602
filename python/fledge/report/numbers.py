# SPDX-License-Identifier: Apache-2.0
"""HTML from Python: text is escaped, and only what these functions made is not.

    tag("p", "a < b, ", tag("b", "c"), class_="note")      # <p class="note">a &lt; b, <b>c</b></p>
"""

import re
from html import escape


class Html(str):
    """Text that is HTML already. It is joined to other text, for within a format it would be escaped later."""

    def __format__(self, spec):
        raise TypeError("HTML is joined, with join() or tag(), not formatted into text")


def tag(name, /, *children, **attributes):
    """An element. Attributes that are None or False are left out; `class_` is class, `_` becomes a dash."""
    opened = name
    for key, value in attributes.items():
        if value is not None and value is not False:
            opened += " " + key.rstrip("_").replace("_", "-") + ("" if value is True else '="' + text(value) + '"')
    if name in ("img", "meta", "br"):
        return Html(f"<{opened}>")
    return Html("<" + opened + ">" + join(children) + "</" + name + ">")


def join(children, between=""):
    """Several pieces as one; None is left out."""
    return Html(between.join(c if isinstance(c, Html) else text(c) for c in children if c is not None))


def text(value):
    """Escaped, without control characters, which HTML cannot hold."""
    return Html(escape(re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]",
                              "\N{REPLACEMENT CHARACTER}", str(value))))


# --- numbers, as a person writes them --------------------------------------------------------------

def number(x, digits=7):
    """An int or float, with so many significant digits, a true minus and powers of ten."""
    if isinstance(x, bool):
        return text("yes" if x else "no")
    if isinstance(x, int):
        return text(str(x).replace("-", "\N{MINUS SIGN}"))
    if x != x:
        return text("not a number")
    if x in (float("inf"), float("-inf")):
        return text("\N{INFINITY}" if x > 0 else "\N{MINUS SIGN}\N{INFINITY}")
    mantissa, _, power = f"{x + 0.0:.{digits}g}".replace("-", "\N{MINUS SIGN}").partition("e")
    if not power:
        return text(mantissa)
    power = power.replace("+", "").replace("\N{MINUS SIGN}0", "\N{MINUS SIGN}").lstrip("0")
    return join([f"{mantissa}\N{MULTIPLICATION SIGN}10", tag("sup", power)])


ROWS_MAX = 12       # of a matrix; more are cut
NUMBERS_MAX = 16    # of a vector


def value(x, digits=7):
    """A number, text or nested list: vectors in brackets, matrices as such, diagonal ones by their diagonal."""
    if isinstance(x, str):
        return text(x) if x else tag("i", "none")
    if not isinstance(x, list):
        return number(x, digits)
    if not x:
        return tag("i", "none")
    if isinstance(x[0], list):
        return _matrix(x, digits)
    if all(isinstance(one, (int, float)) and one == 0 for one in x):
        return text("0")
    if len(x) > 3 and all(one == x[0] for one in x):
        return join([value(x[0], digits), f", each of {len(x)}"])
    used = len(x)
    while used > 1 and x[used - 1] == 0:
        used -= 1
    if len(x) - used < 3:
        used = len(x)
    cut = min(used, NUMBERS_MAX)
    tail = []
    if cut < used:
        tail = [f"\N{HORIZONTAL ELLIPSIS} {len(x)} in all"]
    elif used < len(x):
        tail = ["0 \N{HORIZONTAL ELLIPSIS}"]
    return tag("span", "[", join([*(value(one, digits) for one in x[:cut]), *tail], ", "), "]", class_="vector")


def _matrix(rows, digits):
    if all(not isinstance(one, (list, str)) and one == 0 for row in rows for one in row):
        return text("0")
    if len(rows) == len(rows[0]) and not isinstance(rows[0][0], (list, str)):
        diagonal = [row[i] for i, row in enumerate(rows)]
        if all(one == 0 for i, row in enumerate(rows) for j, one in enumerate(row) if i != j):
            if all(one == diagonal[0] for one in diagonal):
                return join([number(diagonal[0], digits), " \N{MULTIPLICATION SIGN} identity"])
            return join(["diagonal ", value(diagonal, digits)])
    lines = [tag("tr", *(tag("td", value(one, digits)) for one in row)) for row in rows[:ROWS_MAX]]
    shown = tag("table", *lines, class_="matrix")
    more = len(rows) - ROWS_MAX
    return join([shown, tag("small", f"and {more} more rows")]) if more > 0 else shown
