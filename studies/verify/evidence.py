# SPDX-License-Identifier: Apache-2.0
"""The verdict of each requirement, what shows it, traces to and from it, and the differences to an earlier report."""
from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.requirements.formula import number_text
from fledge.requirements.judge import HOLDS, UNKNOWN, VIOLATED
from fledge.verify.flight import Flown, Shown, number

if TYPE_CHECKING:
    from fledge.requirements import Requirements

NOT_SHOWN = "not shown"
ORDER = (VIOLATED, UNKNOWN, NOT_SHOWN, HOLDS)       # the worst first
CHANGED = 0.01      # of a margin: a smaller change is none


@dataclass(eq=False)
class Row:
    """A requirement with what shows it.

    sentence, mathematics: of its formula, "" without one; shown_by: the scenarios that are to show it; place: file and
    line of requirements.py; shown: (flight, its verdict) in the order of the flights; children: their ids
    """
    id: str
    text: str
    rationale: str = ""
    parent: str = ""
    method: str = "test"
    evidence: str = ""
    group: str = ""
    sentence: str = ""
    mathematics: str = ""
    place: str = ""
    shown_by: list[str] = field(default_factory=list)
    shown: list[tuple[Flown, Shown]] = field(default_factory=list)
    missing: list[Flown] = field(default_factory=list)     # flights that were to show it, and ended before
    children: list[Row] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """The worst of all flights; without a formula, the worst of its children, or by its method."""
        if self.sentence:
            verdicts = [shown.verdict for _, shown in self.shown] + [UNKNOWN] * len(self.missing)
        elif self.method != "test":
            return f"by {self.method}"
        else:
            verdicts = [child.verdict for child in self.children]
        # What an analysis shows counts where no test shows anything.
        tested = [verdict for verdict in verdicts if verdict in ORDER]
        return min(tested, key=ORDER.index) if tested else next(iter(verdicts), NOT_SHOWN)

    @property
    def decided(self) -> tuple[Flown, Shown] | None:
        """The flight that decided: of those with the worst verdict, the one with the least margin."""
        worst = [pair for pair in self.shown if pair[1].verdict == self.verdict]
        return min(worst, key=lambda pair: math.inf if pair[1].margin is None else pair[1].margin) if worst else None

    @property
    def of_children(self) -> bool:
        """Whether its verdict is that of its children."""
        return not self.sentence and self.method == "test" and bool(self.children)


def rows(requirements: Requirements, scenarios: Mapping[str, Sequence[str]], flown: Sequence[Flown]) -> list[Row]:
    """A Row of each requirement. scenarios: name -> ids that it shows"""
    result = []
    for requirement in requirements.all:
        row = Row(requirement.id, requirement.text, requirement.rationale, requirement.parent, requirement.method,
                  requirement.evidence, requirement.group,
                  place=f"{Path(requirement.file).name}, line {requirement.line}",
                  shown_by=[name for name, ids in scenarios.items() if requirement.id in ids])
        if requirement.formula is not None:
            row.sentence, row.mathematics = str(requirement.formula), requirement.formula.mathematics
        for flight in flown:
            shown = flight.of(row.id)
            if shown:
                row.shown.append((flight, shown))
            elif flight.scenario in row.shown_by:
                row.missing.append(flight)
        result.append(row)
    return result


def adopt(rows: Sequence[Row]) -> None:
    """Give each row its children. Raises SetupError if one descends from itself."""
    by_id = {row.id: row for row in rows}
    for row in rows:
        if row.parent in by_id:
            by_id[row.parent].children.append(row)
    for row in rows:
        line = [row]
        while line[-1].parent in by_id and len(line) <= len(rows):
            line.append(by_id[line[-1].parent])
            if line[-1] is row:
                raise SetupError(f"{row.place}: the parents of {row.id} go round: "
                                 + " has the parent ".join(row.id for row in line))


def with_children(chosen: Iterable[Row]) -> set[str]:
    """The ids of rows, of their children, and so on."""
    ids: set[str] = set()
    open_ = list(chosen)
    while open_:
        row = open_.pop()
        if row.id not in ids:
            ids.add(row.id)
            open_ += row.children
    return ids


def margin_text(shown: Shown) -> str:
    """ "0.012 deg", "12 % of the limit"; "" where there is none."""
    if shown.margin is None or not math.isfinite(shown.margin):
        return ""
    return number_text(shown.margin, shown.unit) if shown.unit else f"{100 * shown.margin:.3g} % of the limit"


# --- traces ----------------------------------------------------------------------------------------

def traces(rows: Sequence[Row], scenarios: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """What is missing in either direction, in words -> ids or names."""
    ids = {row.id for row in rows}
    bare = [row for row in rows if not row.sentence and row.method == "test" and not row.children]
    return {
        "requirements without a test": [row.id for row in bare if row.parent],
        "requirements that no flight of this report shows": [row.id for row in rows
                                                             if row.sentence and not row.shown and not row.missing],
        "top requirements without children": [row.id for row in bare if not row.parent],
        "parents that no requirement defines": sorted({row.parent for row in rows if row.parent} - ids),
        "analyses and inspections without evidence": [row.id for row in rows
                                                      if row.method != "test" and not row.evidence],
        "scenarios that show no requirement": [name for name, shown in scenarios.items() if not shown],
    }


# --- the report before -----------------------------------------------------------------------------

def facts(row: Row) -> dict[str, Any]:
    """What the next report compares with, and other programs read."""
    flown, shown = row.decided or (None, None)
    return {"id": row.id, "text": row.text, "parent": row.parent, "method": row.method, "verdict": row.verdict,
            "formula": row.sentence, "margin": shown.margin if shown else None, "unit": shown.unit if shown else "",
            "scenario": flown.scenario if flown else "", "target": flown.target if flown else "",
            "at": shown.at if shown else None, "where": shown.where if shown else ""}


def earlier(path: Path) -> dict[str, Any] | None:
    """The results of the report before, in a file; None if there are none that this version can read."""
    try:
        results = json.loads(path.read_text(encoding="utf-8"))
        return results if isinstance(results, dict) and {"made", "requirements"} <= results.keys() else None
    except (OSError, ValueError):
        return None


def differences(before: Mapping[str, Any], rows: Sequence[Row], whole: bool) -> list[tuple[str, str]]:
    """(id, change from the report before). whole: this report has all requirements, so that others are gone."""
    old = {row["id"]: row for row in before.get("requirements", ())}
    changes = []
    for row in rows:
        was, now = old.pop(row.id, None), facts(row)
        if was is None:
            changes.append((row.id, f"is new: {now['verdict']}"))
            continue
        if was["verdict"] != now["verdict"]:
            changes.append((row.id, f"was {was['verdict']}, is {now['verdict']}"))
        elif (moved := _moved(number(was["margin"]), now["margin"])) and was["unit"] == now["unit"]:
            unit = f" {now['unit']}" if now["unit"] else ""
            changes.append((row.id, f"its margin {moved} from {number(was['margin']):.4g} to "
                                    f"{now['margin']:.4g}{unit}"))
        for name in ("text", "formula", "parent", "method"):
            if was[name] != now[name]:
                changes.append((row.id, f"its {name} was “{was[name]}”"))
    return changes + [(id, "is gone") for id in old if whole]


def _moved(was: float | None, now: float | None) -> str:
    """ "fell", "rose" or ""."""
    if was is None or now is None or was == now or not math.isfinite(was - now):
        return ""
    return "" if abs(now - was) <= CHANGED * abs(was) else "rose" if now > was else "fell"
