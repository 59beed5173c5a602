# SPDX-License-Identifier: Apache-2.0
"""The tables of CCSDS messages, line by line: ephemerides, attitudes, covariances and maneuvers."""
from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from decimal import Decimal
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge.errors import listed
from fledge.files.kvn import refuse
from fledge.files.messages import ATTITUDES, COVARIANCE, DEFAULTS, MANEUVERS, OPTIONAL_ROWS, ORBITS, STATE, fields
from fledge.files.values import UNITS, Clock, from_si, times, to_si, unit_of

if TYPE_CHECKING:
    import numpy as np

    from fledge.files.sections import Section

Rows = list[tuple[int, list[tuple[str, str]]]]      # of each the line, and the names (XML, else "") and texts
ENTRIES = [name for name in fields(COVARIANCE) if name != "COV_REF_FRAME"]
ACCELERATION = "X_DDOT:km/s**2 Y_DDOT:km/s**2 Z_DDOT:km/s**2"      # which lines may have or not
A = tuple(fields(ACCELERATION))
ORDERINGS = ("LTM", "UTM", "FULL", "LTMWCC", "UTMWCC")


class Column(NamedTuple):
    """A column of a table, as the file has it."""
    name: str
    unit: int | Decimal | str       # "time", "text", or as values.UNITS


def _columns(text: str) -> list[Column]:
    return [Column(name, UNITS.get(item.type, item.type)) for name, item in fields(text).items()]


def columns_of(section: Section, meta: Section, kind: str, version: str, width: int) -> list[Column]:
    """The columns of a section's table. width: of its first line. Raises SetupError where its keywords do not fit."""
    if kind == "OEM":
        return _columns(STATE + " " + ACCELERATION)[:10 if width > 7 and version[0] != "1" else 7]
    if kind == "AEM":
        return [Column("EPOCH", "time"), *_attitude(meta, version)]
    if section.name == "MAN":
        return _maneuver(section)
    for key, value in DEFAULTS.items():
        if key.startswith(section.name):
            section.values.setdefault(key, value)
    first, units = Column("TIME", "time"), _units(section)
    if section.name == "TRAJ":
        return [first, *(Column(f"{section['TRAJ_TYPE']}_{i}", unit) for i, unit in enumerate(units, 1))]
    places = _places(section, len(units))
    correlated = section["COV_ORDERING"].endswith("WCC")
    return [first, *(Column(f"C{i + 1}_{j + 1}", 0 if _is_correlation(section, i, j) and correlated else
                            times(units[i], units[j])) for i, j in places)]


def attitude_type(meta: Section, version: str) -> str:
    """ATTITUDE_TYPE as messages.ATTITUDES has it: it was also published with blanks. Raises SetupError on another."""
    kind = re.sub(r"\s*[/ ]\s*", "/", str(meta["ATTITUDE_TYPE"]).strip().upper())
    if kind not in ATTITUDES[version[0]]:
        meta.refuse(f"ATTITUDE_TYPE: expected {', '.join(ATTITUDES[version[0]])}, those of version {version}; found "
                    f"{meta['ATTITUDE_TYPE']}")
    return kind


def _attitude(meta: Section, version: str) -> list[Column]:
    kind = attitude_type(meta, version)
    if kind.startswith("EULER") or kind == "QUATERNION/RATE":
        sequence(meta)
    if version[0] == "1" and kind.startswith("QUATERNION") and "QUATERNION_TYPE" not in meta.values:
        meta.refuse(f"expected QUATERNION_TYPE, FIRST or LAST, for {kind}; there is none")
    columns = _columns(ATTITUDES[version[0]][kind])
    for key, value in (("QUATERNION_TYPE", "LAST"), ("ATTITUDE_DIR", "A2B")):
        if version[0] != "1" and str(meta.get(key, value)).upper() != value:
            meta.refuse(f"{key}: expected {value}, which is fixed since version 2.0; found {meta[key]}")
    if str(meta.get("QUATERNION_TYPE", "LAST")).upper() == "FIRST" and kind.startswith("QUATERNION"):
        for i in range(0, 8 if kind.endswith("DERIVATIVE") else 4, 4):
            columns.insert(i, columns.pop(i + 3))
    return columns


def sequence(section: Section) -> str:
    """EULER_ROT_SEQ as digits, "321". Raises SetupError on another."""
    text = str(section["EULER_ROT_SEQ"]).upper().translate(str.maketrans("XYZ", "123"))
    if not re.fullmatch("[123]{3}", text) or text[0] == text[1] or text[1] == text[2]:
        section.refuse(f"EULER_ROT_SEQ: expected three axes of which neighbours differ, ZXZ or 321; found "
                       f"{section['EULER_ROT_SEQ']}")
    return text


def _units(section: Section) -> list[int | Decimal]:
    """The units of the elements of TRAJ and COV."""
    key = f"{section.name}_TYPE"
    kind = str(section[key]).upper()
    if kind not in ORBITS:
        section.refuse(f"{key}: expected {', '.join(ORBITS)}; found {section[key]}")
    known = ORBITS[kind]
    given = str(section.get(f"{section.name}_UNITS", "")).strip("[] ")
    if given:
        found = [unit_of(text) for text in given.split(",")]
        if found != known:
            section.refuse(f"{section.name}_UNITS: expected [{','.join(known)}], those of {kind}; found [{given}]")
    return [UNITS[unit] for unit in known]


def _places(section: Section, size: int) -> list[tuple[int, int]]:
    order = str(section["COV_ORDERING"]).upper()
    if order not in ORDERINGS:
        section.refuse(f"COV_ORDERING: expected {', '.join(ORDERINGS)}; found {order}")
    whole = order.endswith("WCC") or order == "FULL"
    return [(i, j) for i in range(size) for j in range(size)
            if whole or (j <= i if order == "LTM" else j >= i)]


def _is_correlation(section: Section, i: int, j: int) -> bool:
    return j > i if section["COV_ORDERING"].startswith("LTM") else j < i


def _maneuver(section: Section) -> list[Column]:
    names = [name.strip().upper() for name in str(section["MAN_COMPOSITION"]).split(",")]
    unknown = [name for name in names if name not in MANEUVERS]
    if unknown or not names[0].startswith("TIME_"):
        section.refuse(f"MAN_COMPOSITION: expected TIME_ABSOLUTE or TIME_RELATIVE, then of {', '.join(MANEUVERS)}; "
                       f"found {listed(unknown or names, 5)}")
    columns = [Column(name, UNITS.get(MANEUVERS[name], MANEUVERS[name])) for name in names]
    given = str(section.get("MAN_UNITS", "")).strip("[] ")
    if given:
        known = [MANEUVERS[name] for name in names if not name.startswith("TIME_")]
        known = ["1" if unit == "text" else unit for unit in known]
        found = [unit_of(text) for text in given.split(",")]
        if found[len(found) - len(known):] != known or not len(known) <= len(found) <= len(names):
            section.refuse(f"MAN_UNITS: expected [{','.join(known)}], those of MAN_COMPOSITION; found [{given}]")
    return columns


def fill(section: Section, rows: Rows, clock: Clock, meta: Section | None, kind: str, version: str) -> None:
    """Convert the lines of a table."""
    import numpy as np

    if section.name == "COVARIANCE":
        _fill_covariance(section, rows)
        return
    if not rows:
        section.refuse(f"expected the lines of {section.name}; there are none")
    assert meta
    columns = columns_of(section, meta, kind, version, max(len(row) for _, row in rows))
    widths = {len(columns), len(columns) - len(A)} if columns[-1].name in A else {len(columns)}
    texts: list[list[str]] = []
    rows = [row for before, row in zip([(0, None), *rows], rows) if row[1] != before[1]]    # a line given twice is once
    for line, row in rows:
        if row and row[0][0]:
            row = _in_order(row, columns, section, line)
        if len(row) not in widths:
            names = [column.name for column in columns[:min(widths)]]
            more = f", or {len(columns)} with {listed(list(A))}" if len(widths) > 1 else ""
            refuse(section.where, line, f"expected {len(names)} columns, {listed(names, 12)}{more}; found {len(row)}")
        texts.append([text for _, text in row])
    for column, cells in zip(columns, zip_longest(*texts)):
        if column.unit == "text":
            section.columns[column.name] = np.array(cells, dtype=object)
            continue
        convert = _converter(column, clock, section.where)
        values = [math.nan if text is None else convert(text, line) for text, (line, _) in zip(cells, rows)]
        section.columns[column.name] = np.array(values, dtype=np.int64 if column.unit == "time" else float)
    times_ = next(iter(section.columns.values()))
    back = np.flatnonzero(np.diff(times_) <= 0)
    if len(back) and section.name != "MAN":
        after, before = texts[back[0] + 1][0], texts[back[0]][0]
        refuse(section.where, rows[back[0] + 1][0], f"expected a time after {before}, that of the line before; found "
                                                    f"{after}")


def _in_order(row: list[tuple[str, str]], columns: list[Column], section: Section, line: int) -> list[tuple[str, str]]:
    """The elements of a row of XML as columns; angles about X, Y and Z come in the order of their turns."""
    names = [name for name, _ in row]
    twice = next((name for i, name in enumerate(names) if name in names[:i] and "_ANGLE" not in name and
                  "_RATE" not in name), None)
    if twice:
        refuse(section.where, line, f"{twice} is given twice")
    angles = iter(item for item in row if re.fullmatch("[XYZ]_(ANGLE|RATE)", item[0]))
    found = [next((item for item in row if item[0] == column.name), None) or next(angles, None) for column in columns]
    missing = [column.name for column, item in zip(columns, found) if item is None]
    missing = [] if missing == list(A) else missing
    unknown = [name for name in names if name not in [column.name for column in columns] and not
               re.fullmatch("[XYZ]_(ANGLE|RATE)", name)]
    if missing or unknown:
        refuse(section.where, line, f"expected {' '.join(column.name for column in columns)}; found {' '.join(names)}")
    return [item for item in found if item]


def _converter(column: Column, clock: Clock, where: str) -> Callable[[str, int], Any]:
    if isinstance(column.unit, str):
        return lambda text, line: clock.time(column.name, text, line, where)
    unit: int | Decimal = column.unit

    def number(text: str, line: int) -> float:
        try:
            return to_si(text, unit)
        except ValueError:
            refuse(where, line, f"{column.name}: expected a number; found {text!r}")

    return number


def _fill_covariance(section: Section, rows: Rows) -> None:
    """The six lines of a lower triangle, as the keywords that XML has for them."""
    if not rows:
        return
    kinds = fields(COVARIANCE)
    entries = iter(ENTRIES)
    for i, (line, row) in enumerate(rows):
        if i >= 6 or len(row) != i + 1:
            refuse(section.where, line,
                   f"expected {f'{i + 1} numbers, line {i + 1} of' if i < 6 else 'the end of'} a lower triangle of six "
                   f"lines; found {' '.join(text for _, text in row)}")
        for (_, text), name in zip(row, entries):
            try:
                section.values[name] = to_si(text, UNITS[kinds[name].type])
            except ValueError:
                refuse(section.where, line, f"{name}: expected a number; found {text!r}")
    if len(rows) != 6:
        refuse(section.where, rows[-1][0] + 1, f"expected six lines of a lower triangle; found {len(rows)}")


def missing_of_covariance(keys: Any, missing: list[str]) -> list[str]:
    """Of the keywords that a covariance has not, those that it must have: a row of a conjunction's ballistic terms is
    there as a whole or not at all."""
    rows = {key.partition("_")[0] for key in keys}
    return [key for key in missing if key.partition("_")[0] in rows or not key.startswith(OPTIONAL_ROWS)]


def history(section: Section) -> tuple[np.ndarray, np.ndarray]:
    """The times [ns] (n,) and the covariances (n, m, m), in SI, of a block COV of an OCM."""
    import numpy as np

    size = len(_units(section))
    times_, *entries = section.columns.values()
    matrices = np.zeros((len(times_), size, size))
    for (i, j), values in zip(_places(section, size), entries):
        matrices[:, i, j] = values
    order = str(section["COV_ORDERING"])
    if order.endswith("WCC"):
        sigma = np.sqrt(np.einsum("nii->ni", matrices))
        lower = np.tril(matrices) if order.startswith("LTM") else np.swapaxes(np.triu(matrices), 1, 2)
        ratio = np.triu(matrices, 1) if order.startswith("LTM") else np.swapaxes(np.tril(matrices, -1), 1, 2)
        stated = lower / (sigma[:, :, None] * sigma[:, None, :])
        if not np.allclose(np.tril(stated, -1), np.swapaxes(ratio, 1, 2), atol=1e-3):
            section.refuse("the correlations do not fit the covariances beside them")
        matrices = lower
    if order not in ("FULL",):
        matrices = matrices if not order.startswith("UTM") or order.endswith("WCC") else np.swapaxes(matrices, 1, 2)
        matrices = matrices + np.swapaxes(np.tril(matrices, -1), 1, 2)
    for matrix in matrices:
        section.require_positive(matrix)
    return times_, matrices


def lines(section: Section, meta: Section | None, clock: Clock, kind: str, version: str) -> list[list[tuple[str, str]]]:
    """The lines of a table as names and texts, for a writer."""
    if not section.columns:
        return []
    columns = columns_of(section, meta or section, kind, version, len(section.columns))
    names = [column.name for column in columns]
    if sorted(names) != sorted(section.columns):
        section.refuse(f"{section.name}: expected the columns {', '.join(names)}; found {', '.join(section.columns)}")
    texts: list[Sequence[str]] = []
    for column in columns:
        values, unit = section.columns[column.name], column.unit
        texts.append([str(value) for value in values] if unit == "text" else
                     [clock.text(value) for value in values.tolist()] if isinstance(unit, str) else
                     ["" if math.isnan(value) and column.name in A else from_si(value, unit)
                      for value in values.tolist()])
    return [[item for item in zip(names, row) if item[1]] for row in zip(*texts)]
