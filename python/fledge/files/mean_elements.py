# SPDX-License-Identifier: Apache-2.0
"""Mean elements of SGP4 as they are published: two-line element sets, with or without a line of the name, and OMMs in
KVN, XML, JSON or CSV.

    elements = mean_elements.read("stations.txt", "ISS (ZARYA)")    # or its number in the catalogue
    fsw.OrbitOnBoard(**elements.parameters(), age_max=3 * day)
    for name, value in elements.parameters().items():               # in a scenario
        setattr(sim.flight.orbit, name, value)

What is not as its format says is refused with its file, its line and what was expected: columns and checksums of lines,
frames, time systems and theories of OMMs, and elements of no orbit or of one that has decayed.

Source: CelesTrak, NORAD Two-Line Element Set Format; Space-Track, Alpha-5; CCSDS 502.0, Orbit Data Messages.
"""
from __future__ import annotations

import csv
import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import NamedTuple

from fledge.errors import SetupError, did_you_mean, listed
from fledge.files import kvn, xml
from fledge.files.kvn import Token, refuse, refuse_at
from fledge.files.values import NUMBER, Clock

DAY = 86_400_000_000_000                    # [ns]
J2000 = datetime(2000, 1, 1, 12)
RADIUS, MU = 6378.135e3, 398600.8e9         # of WGS 72, as SGP4 has them

TURN = 2 * math.pi
TIME = re.compile(r"(\d{4})-(?:(\d\d)-(\d\d)|(\d{3}))T(\d\d):(\d\d):(\d\d)(?:\.(\d+))?Z?", re.ASCII)
LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ"        # of Alpha-5: from 10 on, without I and O


@dataclass(frozen=True)
class MeanElements:
    """The mean elements of an object by SGP4, in TEME of their epoch."""
    name: str           # "" if it has none
    number: int         # in the catalogue, 0 if it has none
    designator: str     # of its launch, "1998-067A"
    epoch: int          # [ns] UTC since 2000-01-01T12:00:00, 86,400 s a day
    n: float            # [rad/s] mean motion (Kozai's)
    e: float            # [-] eccentricity
    i: float            # [rad] inclination
    node: float         # [rad] right ascension of the ascending node
    periapsis: float    # [rad] argument of perigee
    M: float            # [rad] mean anomaly
    bstar: float        # [-] B* for lengths in Earth radii
    source: str = ""    # "stations.txt, line 2"

    def parameters(self) -> dict[str, int | float]:
        """What fsw.OrbitOnBoard takes."""
        return {key: getattr(self, key) for key in ("epoch", "n", "e", "i", "node", "periapsis", "M", "bstar")}

    @property
    def utc(self) -> str:
        """The epoch, "2020-10-13T04:52:48.472320", to microseconds."""
        return (J2000 + timedelta(microseconds=round(self.epoch / 1000))).isoformat(timespec="microseconds")

    @property
    def title(self) -> str:
        """Name and number, as far as it has them."""
        return " ".join([*([self.name] if self.name else []), *([f"({self.number})"] if self.number else [])]) or "?"


def read(source: str | os.PathLike[str], name: str | int | None = None) -> MeanElements:
    """The elements of one object in a file, or in a text of several lines.

    name: its name or its number in the catalogue, where there are several. Raises SetupError, with what is wrong where.
    """
    sets = read_all(source)
    matches = [e for e in sets if name is None or _is_named(e, name)]
    if not matches:
        names = [e.name or str(e.number) for e in sets]
        refuse_at(kvn.content(source)[1], f"has no object {name!r}{did_you_mean(str(name), names)} it has "
                                          f"{listed([e.title for e in sets], 10)}")
    if len(matches) > 1:
        several = len({e.number for e in matches}) > 1
        what = ("objects; give the name or the number of one" if several else
                "element sets of one object; give a file of one, or choose among read_all(...)")
        found = [e.title if several else f"{e.title} of {e.utc}" for e in matches]
        refuse_at(kvn.content(source)[1], f"has {len(matches)} {what}: {listed(found, 10)}")
    return matches[0]


def read_all(source: str | os.PathLike[str]) -> list[MeanElements]:
    """The elements of all objects in a file, or in a text of several lines. Raises SetupError."""
    data, where = kvn.content(source)
    text = kvn.decoded(data, where)
    sets = list(_reader(text)(text, where))
    if not sets:
        raise SetupError(f"{where}: expected two-line elements, or an OMM in KVN, XML, JSON or CSV; it has none")
    return sets


def _is_named(elements: MeanElements, name: object) -> bool:
    text = str(name).strip()
    return elements.name.casefold() == text.casefold() or text.lstrip("0") == str(elements.number)


def _reader(text: str) -> Callable[[str, str], Iterator[MeanElements]]:
    begin = text.lstrip("\ufeff \t\r\n")
    if begin[:1] in ("{", "["):
        return _json
    if begin[:1] == "<":
        return _xml
    if re.search(r"^\s*CCSDS_OMM_VERS\s*=", text, re.MULTILINE):
        return _kvn
    if re.match(r"[^\n]*\bMEAN_MOTION\b[^\n]*,|[^\n]*,[^\n]*\bMEAN_MOTION\b", begin):
        return _csv
    return _lines


def _elements(places: Callable[[str], str], name: str, number: int, designator: str, epoch: int,
              values: Mapping[str, float], source: str) -> MeanElements:
    """MeanElements, of published units. places: where a value stands, by its name in an OMM."""
    for key, least, most in (("ECCENTRICITY", 0.0, 1.0), ("INCLINATION", 0.0, 180.0)):
        if not least <= values[key] <= most or (key == "ECCENTRICITY" and values[key] == 1.0):
            refuse_at(places(key), f"{key}: expected {least:g} to {most:g}{' deg' if most > 1 else ', less than 1'}; "
                                   f"found {values[key]:g}")
    if not values["MEAN_MOTION"] > 0.0:
        refuse_at(places("MEAN_MOTION"),
                  f"MEAN_MOTION: expected revolutions a day, > 0; found {values['MEAN_MOTION']:g}")
    n = values["MEAN_MOTION"] * TURN / 86400
    perigee = (MU / n**2) ** (1 / 3) * (1 - values["ECCENTRICITY"]) - RADIUS
    if perigee < 0.0:
        refuse_at(places("MEAN_MOTION"), f"its perigee is {-perigee / 1000:.0f} km below the Earth's surface: the "
                                         "object has decayed, or mean motion or eccentricity are wrong")
    i, node, periapsis, M = (math.radians(values[key]) for key in (
        "INCLINATION", "RA_OF_ASC_NODE", "ARG_OF_PERICENTER", "MEAN_ANOMALY"))
    return MeanElements(name, number, designator, epoch, n, values["ECCENTRICITY"], i, node, periapsis, M,
                        values["BSTAR"], source)


# --- two-line elements ------------------------------------------------------------------------------

class _Field(NamedTuple):
    first: int      # columns, from 1
    last: int
    pattern: str
    what: str


_ANGLE = r" *\d{1,3}\.\d{4}"
_POWER = r"[ +-]\d{5}[+-]\d"
_NUMBER = f" *[0-9]{{1,5}}|[{LETTERS}][0-9]{{4}}"
_COLUMNS = {
    "1": {
        "number": _Field(3, 7, _NUMBER, "the number in the catalogue, of five digits or Alpha-5"),
        "class": _Field(8, 8, "[UCS ]", "the classification, U, C or S"),
        "designator": _Field(10, 17, r"\d{5}[A-Z]{1,3} *| *", "the designator of the launch, '98067A'"),
        "epoch": _Field(19, 32, r"\d\d(\d{3}| \d\d|  \d)\.\d{8}", "the epoch, year and day, 'yyddd.dddddddd'"),
        "ndot": _Field(34, 43, r"[ +-]\.\d{8}|[ +-]?\d\.\d{8}", "half the rate of the mean motion, ' .nnnnnnnn'"),
        "nddot": _Field(45, 52, _POWER, "a sixth of its second rate, ' nnnnn-n'"),
        "bstar": _Field(54, 61, _POWER, "B*, ' nnnnn-n'"),
        "type": _Field(63, 63, "[0-9 ]", "the type of the elements"),
        "set": _Field(65, 68, r" *\d*", "the number of the set"),
    },
    "2": {
        "number": _Field(3, 7, _NUMBER, "the number in the catalogue, of five digits or Alpha-5"),
        "INCLINATION": _Field(9, 16, _ANGLE, "the inclination [deg], 'nnn.nnnn'"),
        "RA_OF_ASC_NODE": _Field(18, 25, _ANGLE, "the right ascension of the node [deg], 'nnn.nnnn'"),
        "ECCENTRICITY": _Field(27, 33, r"\d{7}", "the eccentricity without its point, 'nnnnnnn'"),
        "ARG_OF_PERICENTER": _Field(35, 42, _ANGLE, "the argument of perigee [deg], 'nnn.nnnn'"),
        "MEAN_ANOMALY": _Field(44, 51, _ANGLE, "the mean anomaly [deg], 'nnn.nnnn'"),
        "MEAN_MOTION": _Field(53, 63, r" *\d{1,2}\.\d{8}", "the mean motion [rev/day], 'nn.nnnnnnnn'"),
        "revolution": _Field(64, 68, r" *\d*", "the revolution at the epoch"),
    },
}


def checksum(line: str) -> int:
    """The last digit of a line of elements, of the 68 columns before it: the sum of digits, minus signs as 1."""
    return sum(int(c) if c.isdecimal() else c == "-" for c in line[:68]) % 10


def _columns(line: str, place: str) -> dict[str, str]:
    """The fields of a line, each as its columns have it."""
    if not line.isascii() or len(line) != 69:
        refuse_at(place, f"expected 69 columns of a line of elements; found {len(line)}: {line!r}")
    if line[68] != str(checksum(line)):
        refuse_at(place,
                  f"column 69: expected {checksum(line)}, the checksum of what stands before; found {line[68]!r}")
    fields, column = {}, 2
    for key, (first, last, pattern, what) in _COLUMNS[line[0]].items():
        if line[column - 1:first - 1].strip():
            refuse_at(place, f"column {column}: expected a space; found {line[column - 1:first - 1]!r}")
        fields[key] = line[first - 1:last]
        if not re.fullmatch(pattern, fields[key]):
            columns = f"columns {first} to {last}" if last > first else f"column {first}"
            refuse_at(place, f"{columns}: expected {what}; found {fields[key]!r}")
        column = last + 1
    return fields


def _catalogue(text: str) -> int:
    """A number of five columns; Alpha-5 has a letter for 10 to 33 in front."""
    return int(text) if not text[0].isalpha() else int(f"{LETTERS.index(text[0]) + 10}{text[1:]}")


def _power(text: str) -> float:
    """' 28098-4' is 0.28098e-4."""
    return float(f"{text[0].strip()}0.{text[1:6]}e{text[6:]}")


def _lines(text: str, where: str) -> Iterator[MeanElements]:
    rows = [(number, line.rstrip()) for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1) if
            line.strip()]
    name, at = "", 0
    while at < len(rows):
        number, line = rows[at]
        place = f"{where}, line {number}"
        at += 1
        if not line.startswith("1 "):
            if name or line.startswith("2 "):
                refuse_at(place, f"expected line 1 of a two-line element set, '1 nnnnn...'; found {line!r}")
            name = line.removeprefix("0 ").strip()
            continue
        if at == len(rows) or not rows[at][1].startswith("2 "):
            refuse(where, rows[at][0] if at < len(rows) else number + 1,
                   f"expected line 2 of the element set, '2 nnnnn...'; found "
                   f"{repr(rows[at][1]) if at < len(rows) else 'the end'}")
        second = f"{where}, line {rows[at][0]}"
        row_1, row_2 = _columns(line, place), _columns(rows[at][1], second)
        at += 1
        if row_1["number"] != row_2["number"]:
            refuse_at(second, f"columns 3 to 7: expected {row_1['number']}, as in line 1; found {row_2['number']}")
        if row_1["type"] not in " 023":
            refuse_at(place, f"column 63: expected elements of SGP4, 0; found {row_1['type']}"
                             f"{', which are of SGP4-XP' if row_1['type'] == '4' else ''}")
        year = int(row_1["epoch"][:2])
        first = date(year + (1900 if year >= 57 else 2000), 1, 1)
        day, within = int(row_1["epoch"][2:5]), int(row_1["epoch"][6:]) * (DAY // 10**8)
        most = (date(first.year + 1, 1, 1) - first).days
        if not 1 <= day <= most:
            refuse_at(place, f"columns 21 to 32: expected a day of {first.year}, 1 to {most}; found {day}")
        values = {key: float(row_2[key]) for key in row_2 if key.isupper()} | {
            "ECCENTRICITY": float("0." + row_2["ECCENTRICITY"]), "BSTAR": _power(row_1["bstar"])}
        launch = row_1["designator"].strip()
        if launch:
            launch = f"{'19' if launch[:2] >= '57' else '20'}{launch[:2]}-{launch[2:]}"
        epoch = ((first - J2000.date()).days + day - 1) * DAY + within - DAY // 2
        yield _elements(lambda _: second, name, _catalogue(row_1["number"]), launch, epoch, values, place)
        name = ""
    if name:
        refuse_at(place, f"expected line 1 of a two-line element set after the name {name!r}; found the end")


# --- orbit mean-elements messages -------------------------------------------------------------------

_REQUIRED = {"EPOCH": "", "MEAN_MOTION": "rev/day", "ECCENTRICITY": "", "INCLINATION": "deg", "RA_OF_ASC_NODE": "deg",
             "ARG_OF_PERICENTER": "deg", "MEAN_ANOMALY": "deg", "BSTAR": "1/ER"}
# What CelesTrak leaves out in JSON and CSV.
_ASSUMED = {"CENTER_NAME": ["EARTH"], "REF_FRAME": ["TEME"], "TIME_SYSTEM": ["UTC"],
            "MEAN_ELEMENT_THEORY": ["SGP4", "SGP/SGP4"]}


def _of_omm(fields: Mapping[str, Token], where: str, line: int, strict: bool) -> MeanElements:
    """The elements of an OMM that begins at a line. strict: what says which elements they are must not be missing."""
    def place(key: str) -> str:
        return f"{where}, line {fields[key].line if key in fields else line}"

    def value(key: str) -> str:
        return fields[key].text.strip() if key in fields else ""

    def number(key: str) -> float:
        if not NUMBER.fullmatch(value(key)) or not math.isfinite(float(value(key))):
            refuse_at(place(key), f"{key}: expected a number; found {value(key)!r}")
        return float(value(key))

    needed = [*_REQUIRED, *(_ASSUMED if strict else ())]
    missing = [key for key in needed if not value(key)]
    if missing:
        refuse_at(place(missing[0]), f"expected {listed(missing)} in the OMM of {value('OBJECT_NAME') or 'an object'}; "
                                     "there is none")
    for key, allowed in _ASSUMED.items():
        if value(key) and value(key).upper() not in allowed:
            refuse_at(place(key), f"{key}: expected {' or '.join(allowed)}; found {value(key)}")
    for key, unit in _REQUIRED.items():
        found = fields[key].unit or ""
        if found and found.lower() != unit.lower():
            refuse_at(place(key), f"{key}: expected the unit {unit or 'of a bare number'}; found {found}")
    if value("EPHEMERIS_TYPE") not in ("", "0", "2", "3", "SGP", "SGP4"):
        refuse_at(place("EPHEMERIS_TYPE"), f"EPHEMERIS_TYPE: expected 0, elements of SGP4; found "
                                           f"{value('EPHEMERIS_TYPE')}")
    if value("DECAY_DATE"):
        refuse_at(place("DECAY_DATE"), f"{value('OBJECT_NAME')} decayed on {value('DECAY_DATE')}")
    catalogue = value("NORAD_CAT_ID") or "0"
    if not re.fullmatch(f"[0-9]{{1,9}}|[{LETTERS}][0-9]{{4}}", catalogue):
        refuse_at(place("NORAD_CAT_ID"), f"NORAD_CAT_ID: expected up to nine digits, or Alpha-5; found {catalogue!r}")
    return _elements(place, value("OBJECT_NAME"), _catalogue(catalogue), value("OBJECT_ID"),
                     _epoch(value("EPOCH"), place("EPOCH")), {key: number(key) for key in _REQUIRED if key != "EPOCH"},
                     f"{where}, line {line}")


def _epoch(text: str, place: str) -> int:
    """[ns] since J2000, of "2020-10-13T04:52:48.472320" or "2020-287T04:52:48"."""
    match = TIME.fullmatch(text)
    try:
        if not match:
            raise ValueError
        year, month, day, of_year, hours, minutes, seconds = (int(part or 1) for part in match.groups()[:7])
        if leap := seconds == 60:       # the calendar counts it as the second after it, as SGP4 does
            Clock("UTC").ns(text)
        whole = datetime(year, month, day, hours, minutes, seconds - leap) + timedelta(days=of_year - 1)
        if not 1957 <= whole.year == year <= 2200:
            raise ValueError
    except SetupError as error:
        refuse_at(place, f"EPOCH: {error}")
    except ValueError:
        refuse_at(place, f"EPOCH: expected UTC from 1957 to 2200, '2020-10-13T04:52:48.472320'; found {text!r}")
    since = whole - J2000
    return since.days * DAY + (since.seconds + leap) * 10**9 + int(f"{match.group(8) or '':0<9}"[:9])


def _kvn(text: str, where: str) -> Iterator[MeanElements]:
    fields: dict[str, Token] = {}
    begin = 1
    for token in kvn.tokens(text):
        if token.kind == "row":
            refuse(where, token.line, f"expected KEYWORD = value; found {token.text!r}")
        if token.kind != "key":
            continue
        if token.name == "CCSDS_OMM_VERS":
            if fields:
                yield _of_omm(fields, where, begin, True)
            fields, begin = {}, token.line
        elif not fields:
            refuse(where, token.line, f"expected CCSDS_OMM_VERS = ... first; found {token.name} = {token.text}")
        _add(fields, token, where)
    yield _of_omm(fields, where, begin, True)


def _xml(text: str, where: str) -> Iterator[MeanElements]:
    entries: list[dict[str, Token]] = []
    for token in xml.tokens(text, where):
        if token.kind == "key" and token.name == "CCSDS_OMM_VERS":
            entries.append({})
        if token.kind == "key" and entries:
            _add(entries[-1], token, where)
    for fields in entries:
        yield _of_omm(fields, where, fields["CCSDS_OMM_VERS"].line, True)


def _add(fields: dict[str, Token], token: Token, where: str) -> None:
    if token.name in fields:
        refuse(where, token.line, f"{token.name} is given twice; the first is in line {fields[token.name].line}")
    text, unit = token.split()
    fields[token.name] = token._replace(text=text, unit=unit)


def _json(text: str, where: str) -> Iterator[MeanElements]:
    try:
        sets = json.loads(text.lstrip("\ufeff"), parse_int=str, parse_float=str)      # numbers as they are written
    except (json.JSONDecodeError, RecursionError) as error:
        refuse(where, getattr(error, "lineno", 1), f"expected JSON; {getattr(error, 'msg', error)}")
    at = 0
    for entry in sets if isinstance(sets, list) else [sets]:
        at = text.find("{", at)
        line = text.count("\n", 0, max(at, 0)) + 1
        if not isinstance(entry, dict):
            refuse(where, line, f"expected an object with the fields of an OMM; found {entry!r}")
        end, fields = at, {}
        for key, value in entry.items():
            if isinstance(value, (dict, list, bool)):
                refuse(where, line, f"{key}: expected a text or a number; found {value!r}")
            end = max(end, text.find(f'"{key}"', at))
            fields[key] = Token("key", key, "" if value is None else str(value), text.count("\n", 0, max(end, 0)) + 1)
        yield _of_omm(fields, where, line, False)
        at = max(end, at) + 1


def _csv(text: str, where: str) -> Iterator[MeanElements]:
    rows = csv.reader(text.lstrip("\ufeff").splitlines())
    try:
        keys: Sequence[str] = []
        for row in rows:
            place = f"{where}, line {rows.line_num}"
            if not any(cell.strip() for cell in row):
                continue
            if not keys:
                keys = [cell.strip() for cell in row]
                continue
            if len(row) != len(keys):
                refuse_at(place, f"expected {len(keys)} columns, as the first line names; found {len(row)}")
            fields = {key: Token("key", key, cell, rows.line_num) for key, cell in zip(keys, row)}
            yield _of_omm(fields, where, rows.line_num, False)
    except csv.Error as error:
        refuse(where, rows.line_num, f"expected CSV; {error}")
