# SPDX-License-Identifier: Apache-2.0
"""The report of a verification: one HTML page that needs no other file, script or network."""
from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from fledge.report.numbers import number, unit
from fledge.report.run import templates, versions
from fledge.requirements.formula import shown_in
from fledge.requirements.judge import HOLDS
from fledge.verify import coverage, decisions, evidence
from fledge.verify.evidence import Row
from fledge.verify.figure import with_ids
from fledge.verify.flight import Flown, Shown


def page(mission: Any, rows: Sequence[Row], flown: Sequence[Flown], scenarios: Mapping[str, Sequence[str]],
         command: Callable[[Flown], str], **more: Any) -> str:
    """The page as text. mission: a Mission; scenarios: name -> ids that it shows; command: repeats a flight.

    more: what the template takes as it is: seed, made, about, only, repeat; changed: differences to the report before,
    or None, changed_since; csv: file and differences, or None; decided: name -> decisions of a source, or {}.
    """
    verdicts = [row.verdict for row in rows]
    ids = {row.id for row in rows}
    roots = [row for row in rows if not row.parent]
    for parent in dict.fromkeys(row.parent for row in rows if row.parent and row.parent not in ids):
        roots.append(Row(parent, "(no requirement of this report)", method="",
                         children=[row for row in rows if row.parent == parent]))
    counts = Counter({word: verdicts.count(word) for word in
                      ("holds", *sorted({verdict for verdict in verdicts if verdict.startswith("by ")}), "violated",
                       "unknown", "not shown")})
    covered = [flight for flight in flown if flight.coverage]
    whole = coverage.joined(flight.coverage for flight in covered)
    return templates().get_template("verification.html").render(
        mission=mission.name, rows=rows, roots=roots, flights=flown, scenarios=scenarios, command=command,
        counts=counts,
        failed=[flight for flight in flown if flight.error], before_count=sum(flight.before for flight in flown),
        flown=sum(flight.time for flight in flown), targets=list(dict.fromkeys(flight.target for flight in flown)),
        anchors={row.id: f"r{i}-{_slug(row.id)}" for i, row in enumerate(rows, 1)},
        flight_anchors={flight.title: f"f{i}-{_slug(flight.title)}" for i, flight in enumerate(flown, 1)},
        margin=margin, figures={row.id: list(_figures(i, row)) for i, row in enumerate(rows)},
        traces=evidence.traces(rows, scenarios), boards=list(dict.fromkeys(flight.target for flight in covered)),
        covered=per_requirement(rows), coverage_share=coverage.share(whole),
        branches_of={file: coverage.share({file: counts}) for file, counts in whole.items()},
        coverage=[(file, coverage.share({file: counts}), coverage.never(counts))
                  for file, counts in sorted(whole.items())],
        versions=versions(mission), total=decisions.total, **more)


def per_requirement(rows: Sequence[Row]) -> dict[str, coverage.Share]:
    """The coverage of the flights that show a requirement, by its id."""
    return {row.id: coverage.share(coverage.joined(flight.coverage for flight, _ in row.shown))
            for row in rows if any(flight.coverage for flight, _ in row.shown)}


def margin(shown: Shown) -> Markup:
    """A margin with its unit, and as a share of the limit, where there is one."""
    if shown.margin is None or not math.isfinite(shown.margin):
        return Markup("\N{EN DASH}")
    if not shown.unit:
        return Markup("{} % of the limit").format(number(100 * shown.margin, 3))
    name, factor = shown_in(shown.unit, shown.margin)
    text = Markup(Markup("{} {}").format(number(shown.margin * factor, 4), unit(name)).strip())
    if shown.limit and shown.verdict == HOLDS:
        return text + Markup('<br><small class="aside">{:.3g} % of the limit</small>').format(
            100 * shown.margin / abs(shown.limit))
    return text


def _figures(number_: int, row: Row) -> Iterator[tuple[str, Markup]]:
    """(caption, figure) of each scenario; targets with the same one share it."""
    groups: dict[tuple[str, str], list[tuple[Flown, Shown]]] = {}
    for flight, shown in row.shown:
        if shown.figure:
            groups.setdefault((flight.scenario, shown.figure), []).append((flight, shown))
    for i, ((scenario, figure), pairs) in enumerate(groups.items()):
        where = f": {pairs[0][1].where}" if pairs[0][1].where else ""
        yield (f"{scenario} on {', '.join(flight.target for flight, _ in pairs)}{where}",
               Markup(with_ids(figure, f"g{number_}-{i}-")))


def _slug(text: str) -> str:
    return re.sub(r"[^\w.-]+", "-", text)
