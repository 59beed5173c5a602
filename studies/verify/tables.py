# SPDX-License-Identifier: Apache-2.0
"""The requirements as CSV, in and out, and the verdicts as JUnit's XML for a CI."""
from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from fledge.errors import Failure, did_you_mean
from fledge.junit import ERROR, FAILURE, SKIPPED, Case, Suite, document
from fledge.requirements.declared import METHODS
from fledge.requirements.judge import UNKNOWN, VIOLATED
from fledge.verify.evidence import NOT_SHOWN, Row, facts
from fledge.verify.flight import Flown

GIVEN = ("id", "text", "rationale", "parent", "method")     # which both directions have


def write(rows: Sequence[Row]) -> str:
    """All requirements as CSV: the declarations first, then the results."""
    out = io.StringIO()
    more = ("group", "formula", "evidence", "verdict", "margin", "unit", "scenario", "target", "at_s", "where")
    table = csv.writer(out, lineterminator="\n")
    table.writerow((*GIVEN, *more))
    for row in rows:
        of = facts(row)
        table.writerow((*(getattr(row, name) for name in GIVEN), row.group, row.sentence, row.evidence, row.verdict,
                        *("" if of[name] is None else of[name] for name in
                          ("margin", "unit", "scenario", "target", "at", "where"))))
    return out.getvalue()


def read(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV with the columns `id`, `text`, and any of the others that are given; further ones do not count.
    Raises Failure that names the file and the line."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise Failure(f"{path}: it is no text in UTF-8: {error.reason} at byte {error.start}") from None
    table = csv.reader(io.StringIO(text), strict=True)
    entries: list[dict[str, str]] = []
    lines: dict[str, int] = {}
    try:
        heads = [head.strip().lower() for head in next(table, [])]
        for name in ("id", "text"):
            if name not in heads:
                raise Failure(f"{path}, line 1: it has no column '{name}'{did_you_mean(name, heads)} expected "
                              f"{', '.join(GIVEN)}; found {', '.join(heads) or 'none'}")
        for cells in table:
            at = f"{path}, line {table.line_num}"
            if not any(map(str.strip, cells)):
                continue
            if len(cells) > len(heads):
                raise Failure(f"{at}: {len(cells)} cells below {len(heads)} heads; put a text with commas into "
                              "quotation marks")
            row = {name: cell.strip() for name, cell in zip(heads, cells) if name in GIVEN}
            if not row.get("id"):
                raise Failure(f"{at}: it has no id")
            if row["id"] in lines:
                raise Failure(f"{at}: two requirements are called {row['id']}; the first is in line "
                              f"{lines[row['id']]}")
            if row.get("method") and row["method"].lower() not in METHODS:
                raise Failure(f"{at}: the method of {row['id']} must be {', '.join(METHODS[:-1])} or {METHODS[-1]}, "
                              f"found '{row['method']}'")
            lines[row["id"]] = table.line_num
            entries.append(row)
    except csv.Error as error:
        raise Failure(f"{path}, line {table.line_num}: {error}") from None
    if not entries:
        raise Failure(f"{path}: it has no requirements")
    return entries


def differences(given: Sequence[dict[str, str]], rows: Sequence[Row], whole: bool) -> list[tuple[str, str]]:
    """(id, difference) between the rows of a CSV and the requirements of the mission. whole: these are all."""
    by_id = {row.id: row for row in rows}
    changes: list[tuple[str, str]] = []
    for entry in given:
        row = by_id.pop(entry["id"], None)
        if row is None:
            if whole:
                changes.append((entry["id"], "is in the CSV alone"))
            continue
        for name in GIVEN[1:]:
            here = (getattr(row, name) or "").strip()
            there = entry.get(name, here)
            if name == "method":
                there = there.lower() or here
            if " ".join(here.split()) != " ".join(there.split()):
                changes.append((row.id, f"its {name} is “{there}” in the CSV, “{here}” in requirements.py"))
    return changes + [(id, "is in requirements.py alone") for id in by_id]


def only_there(given: Sequence[dict[str, str]], rows: Sequence[Row]) -> list[Row]:
    """Rows of those that the CSV alone has."""
    known = {row.id for row in rows}
    return [Row(entry["id"], entry["text"], entry.get("rationale", ""), entry.get("parent", ""),
                entry.get("method", "").lower() or "test", group="In the CSV alone", place="the CSV alone")
            for entry in given if entry["id"] not in known]


# --- JUnit -----------------------------------------------------------------------------------------

def junit(mission: str, rows: Sequence[Row], flown: Sequence[Flown]) -> str:
    """A suite for each flight, with a case for each requirement that it shows, and one for those that none shows."""
    suites = []
    for flight in flown:
        cases = [Case("flight", ERROR, flight.error)] if flight.error else []
        for row in rows:
            shown = flight.of(row.id)
            if shown is None:
                continue
            margin = "" if shown.margin is None else f"margin {shown.margin:g} {shown.unit}".rstrip()
            at = "" if shown.at is None else f" at t = {shown.at:g} s"
            if shown.verdict == VIOLATED:
                cases.append(Case(row.id, FAILURE, f"{row.text} {shown.where}{at}: {margin}"))
            elif shown.verdict == UNKNOWN:
                cases.append(Case(row.id, ERROR, f"unknown: {shown.reason}"))
            else:
                cases.append(Case(row.id, text=f"{margin}{at}"))
        suites.append(Suite(f"{mission}.{flight.target}.{flight.scenario}", flight.wall, cases))
    others = []
    for row in (row for row in rows if not row.shown):
        by = f"{row.evidence or row.verdict}" + (
            " by " + ", ".join(child.id for child in row.children) if row.of_children else "")
        others.append(Case(row.id, SKIPPED, by if row.verdict != NOT_SHOWN else "no flight shows it"))
    return document(f"verify {mission}", suites + [Suite(f"{mission}.without_flight", 0.0, others)] * bool(others))
