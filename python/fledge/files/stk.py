# SPDX-License-Identifier: Apache-2.0
"""Ephemerides (.e) and attitudes (.a) of STK, as the OEMs and AEMs of CCSDS that hold the same.

    message = stk.read("craft.e")           # .kind "OEM": .segments[0].at(times)
    stk.write(message, "again.e")

Source: Ansys, *STK Help*, "Ephemeris File Format (*.e)" and "Attitude File Format (*.a)".
"""
from __future__ import annotations

import os
import re
import warnings
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from fledge.disk import Part
from fledge.errors import SetupError, did_you_mean, listed, printable
from fledge.files import kvn, ndm
from fledge.files.ephemeris import A, AemSegment, OemSegment, R, RATES, V
from fledge.files.kvn import refuse
from fledge.files.sections import Message, Section
from fledge.files.tables import ENTRIES
from fledge.files.values import DEG, NUMBER, WHOLE, Clock, from_si, to_si

QUATERNION, BODY, COVARIANCES = ("Q1", "Q2", "Q3", "QC"), "SC_BODY_1", "CovarianceTimePosVel"
# The columns of the lines of a block, after their time; rates are in deg/s, in axes of the body.
BLOCKS = {"EphemerisTimePos": R, "EphemerisTimePosVel": R + V, "EphemerisTimePosVelAcc": R + V + A,
          "AttitudeTimeQuaternions": QUATERNION, "AttitudeTimeQuatScalarFirst": ("QC", *QUATERNION[:3]),
          "AttitudeTimeQuatAngVels": QUATERNION + RATES}
COMMON = ("ScenarioEpoch", "CentralBody", "TimeFormat", "TimeScale", "InterpolationMethod", "InterpolationOrder")
KEYWORDS = {
    "Ephemeris": (*COMMON, "NumberOfEphemerisPoints", "CoordinateSystem", "CoordinateSystemEpoch", "DistanceUnit",
                  "InterpolationSamplesM1", "CovarianceFormat", "NumberOfCovariancePoints"),
    "Attitude": (*COMMON, "NumberOfAttitudePoints", "CoordinateAxes", "CoordinateAxesEpoch")}
UNUSED = ("BlockingFactor", "MessageLevel", "ComputeVelocity", "SmoothData", "AttitudeDeviations",  # how STK reads
          "CovarianceInterpolationMethod")
# The entries of a line of covariances, after its time: row by row of a triangle.
TRIANGLES = {"LOWERTRIANGULAR": ENTRIES,
             "UPPERTRIANGULAR": [ENTRIES[j * (j + 1) // 2 + i] for i in range(6) for j in range(i, 6)]}
LENGTHS = {"METERS": 0, "KILOMETERS": 3}
WIDTHS = {"EPSEC": 1, "ISO-YMD": 1, "UTCG": 4}      # words of a time, by TimeFormat
# Axes by their names here, which are known in runs too, and by those of STK; others of STK are kept by name.
FRAMES = {**dict.fromkeys(("ICRF", "GCRF"), "ICRF"), **dict.fromkeys(("J2000", "EME2000"), "J2000"),
          **dict.fromkeys(("FIXED", "ITRF", "ITRF2000", "ITRF2005", "ITRF2008", "ITRF2014", "ITRF2020"), "Fixed"),
          **dict.fromkeys(("TOD", "TRUEOFDATE"), "TrueOfDate"), **dict.fromkeys(("TEME", "TEMEOFDATE"), "TEMEOfDate"),
          **{name.upper(): name for name in ("Inertial", "MeanOfDate", "MeanOfEpoch", "TrueOfEpoch", "TEMEOfEpoch",
                                             "B1950", "AlignmentAtEpoch")}}
OF_ANY_BODY = ("ICRF", "J2000", "Fixed", "Inertial")
MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
DATE = re.compile(r"(\d{1,2}) ([A-Za-z]{3,9}) (\d{4}) (\d{1,2}): ?(\d{1,2}): ?(\d{1,2})(\.\d*)?",
                  re.ASCII)


@dataclass
class _File:
    """A file before its numbers are converted. keys: line and text of each keyword; rows: lines and their words."""
    where: str
    kind: str = ""          # "Ephemeris" or "Attitude"
    line: int = 1
    keys: dict[str, tuple[int, str]] = field(default_factory=dict)
    boundaries: list[tuple[int, str]] = field(default_factory=list)
    block: str = ""
    rows: list[tuple[int, list[str]]] = field(default_factory=list)
    covariances: list[tuple[int, str]] | None = None        # line and word, where there is a block of them

    def get(self, key: str, default: str = "") -> str:
        return self.keys[key][1] if key in self.keys else default

    def refuse(self, key: str, expected: str) -> None:
        """Raise SetupError for the value of a keyword."""
        line, text = self.keys.get(key, (self.line, "none"))
        refuse(self.where, line, f"{key}: expected {expected}; found {text}")

    def whole(self, key: str, default: int, least: int) -> int:
        """The value of a keyword. Raises SetupError unless it is a whole number from the least."""
        text = self.get(key, str(default))
        if not WHOLE.fullmatch(text) or int(text) < least:
            self.refuse(key, f"a whole number from {least} of up to 18 digits")
        return int(text)

    def choice(self, key: str, known: tuple[str, ...] | dict[str, Any]) -> str:
        """The value of a keyword in capitals; the first of those known without."""
        value = self.get(key, next(iter(known))).upper()
        if value not in known:
            self.refuse(key, " or ".join(known))
        return value


def _parse(text: str, where: str) -> _File:
    """Order the lines of a text."""
    file, inside, number = _File(where), [""], 0
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words or (not file.kind and words[0].lower().startswith(("stk.v.", "writtenby"))):
            continue
        mark, name = words[0].lower(), " ".join(words[1:])
        if mark == "begin":
            if inside == [""] and not file.kind and name.title() in KEYWORDS:
                file.kind, file.line = name.title(), number
            elif name.lower() != "segmentboundarytimes" or len(inside) != 2 or file.kind != "Ephemeris" or file.block:
                refuse(where, number, f"expected {' or '.join(f'BEGIN {kind}' for kind in KEYWORDS)}, with keywords, "
                                      f"SegmentBoundaryTimes and then a single table; found {' '.join(words)}")
            inside.append(name.lower())
        elif len(inside) == 1:
            refuse(where, number, f"expected {'the end of the file' if file.kind else 'BEGIN Ephemeris or Attitude'}; "
                                  f"found {' '.join(words)}")
        elif mark == "end":
            if name.lower() != inside.pop():
                refuse(where, number, f"expected the end of what began last; found {' '.join(words)}")
        elif len(inside) == 3:
            file.boundaries.append((number, " ".join(words)))
        elif file.covariances is not None and words[0][0] in "+-.0123456789":
            file.covariances += [(number, word) for word in words]
        elif file.block and words[0][0] in "+-.0123456789":
            file.rows.append((number, words))
        else:
            _keyword(file, number, words)
    if len(inside) > 1 or not file.kind:
        refuse(where, number, f"expected END {file.kind or 'Ephemeris'}; found the end of the file, which may be cut")
    return file


def _keyword(file: _File, line: int, words: list[str]) -> None:
    """Take a keyword, or the name of the table that follows."""
    if file.kind == "Ephemeris" and file.rows and words == [COVARIANCES] and file.covariances is None:
        file.covariances = []
        return
    if file.block:
        refuse(file.where, line, f"expected a line of {file.block}, or END {file.kind}; found {' '.join(words)}")
    names = {name.lower(): name for name in (*KEYWORDS[file.kind], *UNUSED)}
    blocks = {name.lower(): name for name in BLOCKS if name.startswith(file.kind)}
    word = words[0].lower()
    if word in blocks:
        file.block = blocks[word]
    elif word not in names and word.startswith((f"{file.kind.lower()}time", "ephemeris", "covariance")):
        refuse(file.where, line, f"expected a table {listed(list(blocks.values()))}; found {words[0]}")
    elif word not in names:
        known = [*names.values(), *blocks.values()]
        refuse(file.where, line, f"{file.kind} has no {words[0]}{did_you_mean(words[0], known)} expected of "
                                 f"{listed(known)}")
    elif names[word] in file.keys:
        refuse(file.where, line, f"{names[word]} is given twice; the first is in line {file.keys[names[word]][0]}")
    elif len(words) == 1:
        refuse(file.where, line, f"{names[word]}: expected a value; there is none")
    else:
        file.keys[names[word]] = line, " ".join(words[1:]).strip('"')


def _iso(text: str) -> str:
    """A date as CCSDS has it, of "1 Jun 2002 12:00:00.000" or such already. Raises ValueError."""
    found = DATE.fullmatch(text)
    if not found:
        return text
    day, month, year, hour, minute, second, part = found.groups()
    date = f"{year}-{MONTHS.index(month[:3].title()) + 1:02}-{day:0>2}"
    return f"{date}T{hour:0>2}:{minute:0>2}:{second:0>2}{part or ''}"


def _epoch(file: _File, key: str) -> str:
    """A date of a keyword, as CCSDS has it."""
    try:
        text = _iso(file.keys[key][1])
        Clock("UTC").ns(text)
        return text
    except (KeyError, ValueError, SetupError):
        file.refuse(key, "a date of UTC, 1 Jun 2002 12:00:00.000")
        raise


def _time(file: _File, clock: Clock, line: int, text: str) -> int:
    """[ns] of a time of a line, as Clock has it."""
    kind = file.get("TimeFormat", "EpSec")
    try:
        if bool(NUMBER.fullmatch(text)) != (kind.upper() == "EPSEC"):
            raise ValueError(text)
        return clock.ns(_iso(text))
    except (ValueError, SetupError):
        refuse(file.where, line, f"expected a time, {kind}; found {text!r}")


def _clock(file: _File) -> Clock:
    """That of the times of lines: dates of UTC, or seconds of TAI or TDB past ScenarioEpoch."""
    epoch = _epoch(file, "ScenarioEpoch")
    if file.choice("TimeScale", ("TAI", "TDB")) == "TDB" and file.choice("TimeFormat", WIDTHS) == "EPSEC":
        return Clock("TDB", zero=Clock("TDB").text(Clock("UTC").ns(epoch)))
    return Clock("UTC", zero=epoch)


def read_all(source: str | os.PathLike[str]) -> list[Message]:
    """The message of a file, as read() gives it, alone in a list."""
    return [read(source)]


def read(source: str | os.PathLike[str]) -> Message:
    """A file, or a text of several lines: an OEM of an ephemeris, an AEM of an attitude. Raises SetupError.

    The name of the object is that of the file. Of segments, which interpolation does not cross, there are several.
    Positions alone are a table without X_DOT...: `at` gives the rate of the polynomial.
    """
    data, where = kvn.content(source)
    file = _parse(kvn.decoded(data, where), where)
    orbit = file.kind == "Ephemeris"
    clock = _clock(file)
    columns = _columns(file, clock)
    name, center = "UNKNOWN" if where == "the text" else Path(where).stem.upper(), file.get("CentralBody", "Earth")
    meta: dict[str, Any] = {"OBJECT_NAME": name, "OBJECT_ID": "UNKNOWN", "CENTER_NAME": center.upper()}
    axes = "CoordinateSystem" if orbit else "CoordinateAxes"
    frame = _frame(file, axes, center.upper())
    meta |= {"REF_FRAME": frame} if orbit else {"REF_FRAME_A": frame, "REF_FRAME_B": BODY}
    if f"{axes}Epoch" in file.keys:
        meta["REF_FRAME_EPOCH"] = Clock("UTC").ns(_epoch(file, f"{axes}Epoch"))
    meta["TIME_SYSTEM"] = "UTC"
    if not orbit:
        meta["ATTITUDE_TYPE"] = "QUATERNION/ANGVEL" if RATES[0] in columns else "QUATERNION"
        meta |= {"ANGVEL_FRAME": BODY} if RATES[0] in columns else {}
    segments = []
    for begin, end in _spans(file, clock, columns["EPOCH"]):
        times = columns["EPOCH"][begin:end]
        span = {"START_TIME": int(times[0]), "STOP_TIME": int(times[-1])}
        lines = {key: values[begin:end] for key, values in columns.items()}
        segments.append([
            Section("META", {**meta, **span, **_interpolation(file, end - begin)}, [], {}, where, file.line),
            Section("STATE" if orbit else "DATA", {}, [], lines, where, file.rows[begin][0])])
    for section in _covariances(file, clock):
        segment = next((found for found in segments if section["EPOCH"] <= found[0]["STOP_TIME"]), segments[-1])
        segment.append(section)
    header = Section("HEADER", {"CREATION_DATE": "", "ORIGINATOR": "UNKNOWN"}, [], {}, where, file.line)
    return ndm.message_of(*(("OEM", "3.0") if orbit else ("AEM", "2.0")), [header], segments)


def _columns(file: _File, clock: Clock) -> dict[str, np.ndarray]:
    """The table as columns [ns, SI, rad/s]."""
    if not file.rows:
        known = listed([block for block in BLOCKS if block.startswith(file.kind)])
        refuse(file.where, file.line, f"expected a table, {known}, with lines; there is none")
    width, names = WIDTHS[file.choice("TimeFormat", WIDTHS)], BLOCKS[file.block]
    length = LENGTHS[file.choice("DistanceUnit", LENGTHS)]
    units: list[int | Decimal] = [DEG if name in RATES else length if name in R + V + A else 0 for name in names]
    times, numbers = [], []
    for line, words in file.rows:
        if len(words) != width + len(names):
            refuse(file.where, line, f"expected a time, {file.get('TimeFormat', 'EpSec')}, and {len(names)} numbers, "
                                     f"{' '.join(names)}; found {' '.join(words)}")
        times.append(_time(file, clock, line, " ".join(words[:width])))
        try:
            numbers.append([to_si(text, unit) for text, unit in zip(words[width:], units)])
        except ValueError as error:
            refuse(file.where, line, f"expected a number; found {str(error)!r}")
    _check_count(file, f"NumberOf{file.kind}Points", len(times), file.block)
    return {"EPOCH": np.array(times, dtype=np.int64), **dict(zip(names, np.array(numbers).T))}


def _check_count(file: _File, key: str, found: int, block: str) -> None:
    """Raise SetupError where a table has more lines than its file promises, of which STK reads no more. Warn of fewer,
    which many files have."""
    promised = file.whole(key, found, 0)
    if promised < found:
        file.refuse(key, f"{found} or more, the lines of {block}")
    if promised > found:
        warnings.warn(printable(f"{file.where}, line {file.keys[key][0]}: {key} is {promised}, and {block} has {found} "
                                "lines: the file may be cut"), stacklevel=5)


def _covariances(file: _File, clock: Clock) -> list[Section]:
    """Those of positions and velocities in the axes of the ephemeris; a line may be broken."""
    if not file.covariances:
        return []
    names = TRIANGLES.get(file.get("CovarianceFormat").upper(), [])
    if not names:
        file.refuse("CovarianceFormat", "LowerTriangular or UpperTriangular")
    width, unit = WIDTHS[file.choice("TimeFormat", WIDTHS)], 2 * LENGTHS[file.choice("DistanceUnit", LENGTHS)]
    found, size = [], width + len(names)
    for at in range(0, len(file.covariances), size):
        line, words = file.covariances[at][0], [word for _, word in file.covariances[at:at + size]]
        if len(words) != size:
            refuse(file.where, line, f"expected a time and {len(names)} numbers of {COVARIANCES}; found {len(words)}")
        values: dict[str, Any] = {"EPOCH": _time(file, clock, line, " ".join(words[:width]))}
        try:
            values |= {name: to_si(text, unit) for name, text in zip(names, words[width:])}
        except ValueError as error:
            refuse(file.where, line, f"expected a number; found {str(error)!r}")
        found.append(Section("COVARIANCE", values, [], {}, file.where, line))
    _check_count(file, "NumberOfCovariancePoints", len(found), COVARIANCES)
    return found


def _frame(file: _File, key: str, center: str) -> str:
    """The axes, by their name here."""
    if key == "CoordinateAxes" and key not in file.keys:
        file.refuse(key, "J2000, ICRF, Fixed ...")
    name = file.get(key, "Fixed")
    known = FRAMES.get(name.upper(), "")
    if center != "EARTH" and known and known not in OF_ANY_BODY:
        file.refuse(key, f"{', '.join(OF_ANY_BODY)} about {center}, as others are known of the Earth only")
    if name.upper() == "TEME" and f"{key}Epoch" in file.keys:       # as files of stk.v.4 have it
        return "TEMEOfEpoch"
    return f"IAU_{center}" if known == "Fixed" and center != "EARTH" else known or name


def _interpolation(file: _File, lines: int) -> dict[str, str | int]:
    """The keywords of an OEM or AEM for the polynomial that STK takes."""
    key = "InterpolationSamplesM1" if "InterpolationSamplesM1" in file.keys else "InterpolationOrder"
    orbit = file.kind == "Ephemeris"
    method, more = file.get("InterpolationMethod", "Lagrange").upper().split()[0], file.whole(key, 5 if orbit else 1, 1)
    if method == "HERMITE" and orbit and key.endswith("Order"):     # a degree: two lines with rates give 3
        more = max(more - 1, 2) // 2
    more = min(more, lines - 1)
    if method == "HERMITE" and file.block in ("EphemerisTimePos", "AttitudeTimeQuaternions",
                                              "AttitudeTimeQuatScalarFirst"):
        file.refuse("InterpolationMethod", f"Lagrange, for {file.block} has no rates")
    degree = 2 * more + 1 if method == "HERMITE" else more
    method = "LINEAR" if degree == 1 and not orbit else method
    if not degree:
        return {}
    return {"INTERPOLATION" if orbit else "INTERPOLATION_METHOD": method, "INTERPOLATION_DEGREE": degree}


def _spans(file: _File, clock: Clock, times: np.ndarray) -> list[tuple[int, int]]:
    """The first line of each segment, and that past its last. A line at a boundary ends a segment and begins the next,
    unless there are two."""
    bounds = sorted({_time(file, clock, line, text) for line, text in file.boundaries})
    for i in np.flatnonzero(np.diff(times) <= 0):
        again = times[max(i - 1, 0)] < times[i] == times[i + 1] < times[-1] and times[i] in bounds
        if not again:
            line, words = file.rows[i + 1]
            refuse(file.where, line, f"expected a time after {file.rows[i][1][0]}, that of the line before, or the "
                                     f"same where SegmentBoundaryTimes has it; found {words[0]}")
    spans, begin = [], 0
    for bound in bounds:
        if times[0] < bound < times[-1]:
            first, after = int(np.searchsorted(times, bound)), int(np.searchsorted(times, bound, side="right"))
            spans.append((begin, min(first + 1, after)))
            begin = max(first, after - 1)
    return [*spans, (begin, len(times))]


# --- writing ---------------------------------------------------------------------------------------

def write(message: Message, path: str | os.PathLike[str]) -> None:
    """Write an OEM as an ephemeris, an AEM as an attitude. Raises SetupError for what STK's forms do not have."""
    text = text_of(message)
    with Part(path) as part:
        part.write_text(text, encoding="utf-8")


def text_of(message: Message) -> str:
    """An OEM or AEM as text. Raises SetupError as write()."""
    if message.kind not in ("OEM", "AEM"):
        message.header.refuse(f"expected an OEM or AEM, which STK has as .e or .a; found {message.kind}")
    segments: list[Any] = sorted(message.segments, key=lambda segment: int(segment.times[0]))
    for before, segment in zip(segments, segments[1:]):
        if segment.times[0] != before.times[-1] or _head(segment) != _head(before):
            segment.meta.refuse("expected a segment that begins where the one before ends, with its axes and center, "
                                "for STK has no others in a file: write a file for each segment")
    if not segments[0].clock.absolute:
        segments[0].meta.refuse(f"TIME_SYSTEM: expected UTC, TAI, TT, TDB or GPS; found {segments[0].clock.scale}")
    epoch = Clock("UTC").text(int(segments[0].times[0]))
    clock = Clock("UTC", zero=epoch)
    tables = [_table(segment) for segment in segments]
    names = tuple(tables[0])
    block = next((block for block, columns in BLOCKS.items() if columns == names), "")
    if not block or any(tuple(table) != names for table in tables):
        segments[-1].meta.refuse(f"expected a table as {listed(list(BLOCKS))}, the same in all segments; found "
                                 f"{' '.join(tables[-1])}")
    kind = "Ephemeris" if message.kind == "OEM" else "Attitude"
    lines = ["stk.v.11.0", f"BEGIN {kind}", f"NumberOf{kind}Points {sum(len(segment.times) for segment in segments)}",
             f"ScenarioEpoch {_gregorian(epoch)}", *(f"{key} {value}" for key, value in _head(segments[0]).items()),
             *_method(segments, names)]
    written = [section for segment in segments for section in segment.all("COVARIANCE")
               if section.get("COV_REF_FRAME") in (None, segment.meta["REF_FRAME"])]
    lines += [f"NumberOfCovariancePoints {len(written)}", "CovarianceFormat LowerTriangular"] if written else []
    if len(segments) > 1:
        lines += ["BEGIN SegmentBoundaryTimes", *(_seconds(clock, segment.times[0]) for segment in segments[1:]),
                  "END SegmentBoundaryTimes"]
    lines.append(block)
    for segment, table in zip(segments, tables):
        columns = [[from_si(x, DEG if name in RATES else 0) for x in values.tolist()] for name, values in table.items()]
        lines += [" ".join(row) for row in zip([_seconds(clock, t) for t in segment.times], *columns)]
    lines += [COVARIANCES] if written else []
    for section in written:
        numbers = [from_si(section[name], 0) for name in ENTRIES]
        lines.append(" ".join([_seconds(clock, section["EPOCH"]), *numbers]))
    text = "\n".join([*lines, f"END {kind}"]) + "\n"
    read(text)
    return text


def _head(segment: OemSegment | AemSegment) -> dict[str, str]:
    """CentralBody and axes of a segment."""
    meta, axes = segment.meta, "CoordinateSystem" if isinstance(segment, OemSegment) else "CoordinateAxes"
    center = str(meta.get("CENTER_NAME", "EARTH"))
    frames = [str(meta[key]) for key in ("REF_FRAME", "REF_FRAME_A", "REF_FRAME_B") if key in meta.values]
    known = [name for name in (_axes(frame, center.upper()) for frame in frames) if name]
    if not known or not center.isalpha():
        meta.refuse(f"expected a body and axes of STK, EARTH and {listed(list(dict.fromkeys(FRAMES.values())))}; found "
                    f"{center} and {' and '.join(frames)}")
    epoch = {f"{axes}Epoch": _gregorian(Clock("UTC").text(meta["REF_FRAME_EPOCH"]))} if "REF_FRAME_EPOCH" in (
        meta.values) else {}
    return {"CentralBody": center.title(), axes: known[0], **epoch}


def _axes(frame: str, center: str) -> str:
    """The name that STK has for axes, "" if it has none."""
    name = FRAMES.get(frame.upper(), frame if " " in frame else "")
    if center == "EARTH":
        return name
    return "Fixed" if frame.upper() == f"IAU_{center}" else name if name in OF_ANY_BODY and name != "Fixed" else ""


def _table(segment: OemSegment | AemSegment) -> dict[str, np.ndarray]:
    """The columns after the times, in SI, in the order of STK."""
    columns, meta = segment.table.columns, segment.meta
    if isinstance(segment, OemSegment):
        return {name: values for name, values in columns.items() if name != "EPOCH"}
    of_b = bool(_axes(str(meta["REF_FRAME_A"]), str(meta.get("CENTER_NAME", "EARTH")).upper()))
    as_they_are = of_b and "QC" in columns and str(meta.get("ATTITUDE_DIR", "A2B")).upper() == "A2B"
    beta = segment.beta_BA * [1, *[1 if of_b else -1] * 3]
    found = {name: columns[name] if as_they_are else beta[:, (i + 1) % 4] for i, name in enumerate(QUATERNION)}
    rates = RATES[0] in columns and of_b and meta.get("ANGVEL_FRAME") == meta["REF_FRAME_B"]
    return {**found, **({name: columns[name] for name in RATES} if rates else {})}


def _method(segments: list[Any], names: tuple[str, ...]) -> list[str]:
    """The keywords of the interpolation: of the segment with the most lines for a polynomial."""
    orbit = isinstance(segments[0], OemSegment)
    method, degree = max((segment.interpolation for segment in segments), key=lambda item: item[1])
    hermite = method == "HERMITE" and (V[0] in names or RATES[0] in names)
    return [f"InterpolationMethod {'Hermite' if hermite else 'Lagrange'}",
            f"Interpolation{'SamplesM1' if orbit else 'Order'} {max(degree // 2, 1) if hermite else degree}"]


def _gregorian(text: str) -> str:
    """A date of CCSDS as STK has it, 1 Jun 2002 12:00:00.0"""
    date, _, time = text.partition("T")
    year, month, day = date.split("-")
    return f"{int(day)} {MONTHS[int(month) - 1]} {year} {time}{'' if '.' in time else '.0'}"


def _seconds(clock: Clock, ns: Any) -> str:
    """A time as seconds past the clock's zero."""
    seconds, part = divmod(clock.since(int(ns)), 10**9)
    return f"{seconds}.{part:09}"
