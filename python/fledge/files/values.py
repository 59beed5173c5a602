# SPDX-License-Identifier: Apache-2.0
"""Numbers and times of CCSDS messages: as text in the units of the file, in SI and int64 nanoseconds here.

A decimal number and its unit are one exact number, which is rounded once; so that what is written from SI reads back
with the same bits.
"""
from __future__ import annotations

import re
from calendar import isleap
from datetime import date, timedelta
from decimal import Context, Decimal
from functools import cache
from typing import Any

from fledge.errors import SetupError
from fledge.files.kvn import refuse

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,9})?", re.ASCII)
WHOLE = re.compile(r"[-+]?\d{1,18}", re.ASCII)      # of 64 bits
TIME = re.compile(r"(\d{4})-(?:(\d\d)-(\d\d)|(\d{3}))(?:T(\d\d):(\d\d):(\d\d)(?:\.(\d*))?)?Z?", re.ASCII)
EXACT = Context(prec=40)
PI = Decimal("3.14159265358979323846264338327950288419716939937510")
DEG, REV = EXACT.divide(PI, Decimal(180)), 2 * PI
DAY = 86_400_000_000_000                    # [ns]
LONGEST = 2**63 - 1                         # [ns] before and after the epoch
EPOCH = date(2000, 1, 1)

# Of a unit, its power of ten in SI or, where it is none, its value.
UNITS: dict[str, int | Decimal] = {
    "1": 0, "m": 0, "m/s": 0, "m/s**2": 0, "m**2": 0, "m**2/s": 0, "m**2/s**2": 0, "m**2/s**3": 0, "m**2/s**4": 0,
    "m**3/kg": 0, "m**3/(kg*s)": 0, "m**3/(kg*s**2)": 0, "m**4/kg**2": 0, "m**2/kg": 0, "kg": 0, "kg*m**2": 0, "s": 0,
    "1/s": 0, "N": 0, "N*m": 0, "W/kg": 0, "1/ER": 0, "#/yr": EXACT.divide(Decimal(1), Decimal(31_557_600)),
    "km": 3, "km/s": 3, "km/s**2": 3, "km**2": 6, "km**2/s": 6, "km**2/s**2": 6, "km**3/s**2": 9, "%": -2, "nT": -9,
    "SFU": -22, "d": Decimal(86400), "deg": DEG, "deg/s": DEG, "km**0.5": EXACT.sqrt(Decimal(1000)),
    "km/s**0.5": 3, "rev/day": EXACT.divide(REV, Decimal(86400)), "rev/day**2": EXACT.divide(REV, Decimal(86400)**2),
    "rev/day**3": EXACT.divide(REV, Decimal(86400)**3)}
# Other spellings of them, without blanks and in small letters.
_SPELLINGS = {**{unit.lower(): unit for unit in UNITS}, "": "1", "n/a": "1", "none": "1", "day": "d", "°": "deg",
              "kg*m²": "kg*m**2", "n.m": "N*m", "nm": "N*m", "rev/d": "rev/day", "rev/d**2": "rev/day**2",
              "rev/d**3": "rev/day**3", "1/r_e": "1/ER"}
# Scales whose seconds relate to one another by fledge's leap seconds and theory, and others that messages name.
SCALES, OTHER_SCALES = ("UTC", "TAI", "TT", "TDB", "GPS"), ("UT1", "GMST", "MET", "MRT", "SCLK", "TCB", "TCG")


def unit_of(text: str) -> str | None:
    """A unit by the name it has here; None: unknown."""
    return _SPELLINGS.get(re.sub(r"\s", "", text).replace("^", "**").lower())


def times(a: int | Decimal, b: int | Decimal) -> int | Decimal:
    """The value of the product of two units."""
    if isinstance(a, int) and isinstance(b, int):
        return a + b
    return EXACT.multiply(*(Decimal(1).scaleb(x) if isinstance(x, int) else x for x in (a, b)))


def to_si(text: str, unit: int | Decimal) -> float:
    """A number in SI of one in a unit. Raises ValueError."""
    if not NUMBER.fullmatch(text) or not abs(float(text)) < float("inf"):
        raise ValueError(text)
    if unit == 0 and isinstance(unit, int):
        value = float(text)
    elif isinstance(unit, int):
        digits, _, power = text.lower().partition("e")
        value = float(f"{digits}e{int(power or 0) + unit}")
    else:
        value = float(EXACT.multiply(Decimal(text), unit))
    if not abs(value) < float("inf"):
        raise ValueError(text)
    return value


def from_si(value: float, unit: int | Decimal) -> str:
    """The shortest number in a unit that reads back as the value."""
    exact = Decimal(repr(float(value)))
    if not exact.is_finite():
        raise SetupError(f"a message has finite numbers only; found {value}")
    if isinstance(unit, int):
        return _plain(exact.scaleb(-unit))
    exact = EXACT.divide(Decimal(float(value)), unit)
    texts = (_plain(Context(prec=digits).plus(exact)) for digits in range(15, 20))
    return next(text for text in texts if to_si(text, unit) == value)


def _plain(number: Decimal) -> str:
    """Without an exponent where that is short."""
    if number == 0:
        return "-0.0" if number.is_signed() else "0.0"
    number = number.normalize()
    if not -7 < number.adjusted() < 16:
        return str(number)
    text = f"{number:f}"
    return text if "." in text else text + ".0"


@cache
def _core() -> Any:
    """What has the leap seconds and the theory of TDB."""
    from fledge import _core

    return _core.Sky("2000-01-01T12:00:00 TDB", 10, ["DE405"], None, None, None, False)


class Clock:
    """The times of a message: int64 nanoseconds of TDB past 2000-01-01T12:00:00 TDB, as a Sky has them; on a scale that
    relates to none of fledge's, such as UT1 or MET, those of its own calendar, 86,400 s a day.

    zero: the time from which an OCM counts seconds.
    """

    def __init__(self, scale: str, where: str = "the message", line: int = 0, zero: str = "") -> None:
        self.scale = scale.upper()
        known = [*SCALES, *OTHER_SCALES]
        if self.scale not in known:
            refuse(where, line, f"TIME_SYSTEM: expected {', '.join(known)}; found {scale}")
        self.zero = self._ns(zero) if zero else None

    @property
    def absolute(self) -> bool:
        """Whether its times are instants, of TDB."""
        return self.scale in SCALES

    def ns(self, text: str) -> int:
        """[ns] of a time, by calendar, day of the year or seconds past zero. Raises ValueError and SetupError."""
        if self.zero is not None and NUMBER.fullmatch(text):
            if not abs(float(text)) < LONGEST / 1e9:
                raise ValueError(text)
            return self.past(int((Decimal(text) * 10**9).to_integral_value()))
        return self._ns(text)

    def time(self, name: str, text: str, line: int, where: str) -> int:
        """[ns] of the time of a keyword or column in a line of a file. Raises SetupError."""
        try:
            return self.ns(text)
        except SetupError as error:
            refuse(where, line, f"{name}: {error}")
        except ValueError:
            refuse(where, line, f"{name}: expected a time on {self.scale}, 2020-10-13T04:52:48.472 or "
                                f"2020-287T04:52:48.472; found {text!r}")

    def past(self, ns: int) -> int:
        """[ns] of a time by those past zero, which the message's own clock counts."""
        if not self.absolute or self.zero is None:
            return _within(ns + (self.zero or 0))
        if self.scale != "UTC":
            core, scale = _core(), self.scale
            return self._ns(_calendar(_count(core.text(self.zero, scale).split(" ")[0].rstrip("Z")) + ns))
        return Clock("TAI")._ns(_calendar(_tai(self.zero) + ns))       # seconds of SI, so that a leap second counts

    def since(self, ns: int) -> int:
        """[ns] past zero of a time on UTC: those that past() takes."""
        return _tai(ns) - _tai(self.zero or 0)

    def _ns(self, text: str) -> int:
        normal = _normal(text)
        if not self.absolute:
            return _count(normal)
        return int(_core().time_of(normal if self.scale == "UTC" else f"{normal} {self.scale}"))

    def text(self, ns: int) -> str:
        """A time by calendar, on the scale of the message."""
        if not self.absolute:
            return _calendar(int(ns))
        return str(_core().text(int(ns), self.scale)).split(" ")[0].rstrip("Z")


def _tai(ns: int) -> int:
    """[ns] that a calendar of TAI shows at a time."""
    return _count(_core().text(ns, "TAI").split(" ")[0])


def _normal(text: str) -> str:
    """A time by calendar, with at most nine decimals; those beyond are cut. Raises ValueError."""
    match = TIME.fullmatch(text.strip())
    if not match:
        raise ValueError(text)
    year, month, day, of_year, hour, minute, second, part = match.groups()
    if of_year:
        if not 1 <= int(of_year) <= 365 + isleap(int(year)):
            raise ValueError(text)
        found = date(int(year), 1, 1) + timedelta(int(of_year) - 1)
        month, day = f"{found.month:02}", f"{found.day:02}"
    part = (part or "")[:9].rstrip("0")
    return f"{year}-{month}-{day}T{hour or '00'}:{minute or '00'}:{second or '00'}" + (f".{part}" if part else "")


def _count(text: str) -> int:
    """[ns] past 2000-01-01T12:00:00 of a calendar without leap seconds. Raises ValueError."""
    match = TIME.fullmatch(text)
    assert match
    days = (date(int(match[1]), int(match[2]), int(match[3])) - EPOCH).days
    hour, minute, second = (int(x or 0) for x in match.group(5, 6, 7))
    if hour > 23 or minute > 59 or second > 59:
        raise ValueError(text)
    seconds = (hour * 60 + minute) * 60 + second
    return _within(days * DAY - DAY // 2 + seconds * 10**9 + int(f"{match[8] or '':0<9}"))


def _within(ns: int) -> int:
    """The time, unless it has more than 64 bits. Raises ValueError."""
    if abs(ns) > LONGEST:
        raise ValueError(ns)
    return ns


def _calendar(ns: int) -> str:
    days, rest = divmod(ns + DAY // 2, DAY)
    seconds, part = divmod(rest, 10**9)
    text = f"{EPOCH + timedelta(days)}T{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}"
    return text + (f".{part:09}".rstrip("0") if part else "")
