# SPDX-License-Identifier: Apache-2.0
"""A matrix of faults as text, as CSV, as JSON, and as one HTML page with a table that a person filters: no other file,
no network."""
from __future__ import annotations

import csv
import io
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fledge.analysis.comparison import Flight
from fledge.analysis.matrix import Matrix
from fledge.columns import columns
from fledge.disk import write_files
from fledge.mission.provenance import identity

EFFECTS = {"failed": "the run did not come to its end", "violated": "a requirement or a check does not hold",
           "unknown": "a requirement cannot be judged", "tolerated": "all that held without the fault holds",
           "unjudged": "nothing judges it: the scenario has no check, and no requirement holds without the fault",
           "none": "nothing in flight differs by a bit"}


FILTERS = ("scenario", "mode", "begin [s]", "unit", "kind", "effect", "detected", "isolated", "recovered")


def cells(flight: Flight) -> dict[str, Any]:
    """A flight as a row of the table: column -> number, text or None."""
    def joined(texts: Sequence[object]) -> str:
        return " + ".join(map(str, texts))

    details = [fault.details for fault in flight.faults]
    return {
        "scenario": flight.scenario, "mode": flight.mode, "begin [s]": flight.begin,
        "unit": joined([fault.unit for fault in flight.faults]),
        "kind": joined([fault.kind for fault in flight.faults]),
        "details": joined(details) if any(details) else "", "effect": flight.effect,
        "detected": "yes" if flight.detected is not None else "no", "after [s]": flight.detected, "by": flight.by,
        "isolated": "yes" if flight.isolated is not None else "wrongly" if flight.wrongly else "no",
        "isolated after [s]": flight.isolated, "isolated as": flight.as_, "isolated wrongly": joined(flight.wrongly),
        "recovered": "yes" if flight.back is not None else "no", "recovered after [s]": flight.back,
        "mode at the end": flight.ends,
        "violated": ", ".join(f"{name} ({by})" if by else name for name, by in flight.violated.items()),
        "not judged": ", ".join(flight.unknown), "most lost of": flight.least[0] if flight.least else "",
        "margin left [%]": round(100 * flight.least[1], 2) if flight.least else None,
        "margin": flight.least[2] if flight.least else "",
        "attitude off [deg]": round(flight.off, 4), "at the end [deg]": round(flight.off_end, 4), "text": flight.text}


def hidden(flight: Flight) -> bool:
    """Whether the worst has happened: a requirement is violated, and flight did not report it."""
    return flight.effect in ("violated", "failed") and flight.detected is None


def worst_first(flights: Sequence[Flight]) -> list[Flight]:
    """In front what flight did not report, then by effect, then by the margin that is left."""
    return sorted(flights, key=lambda flight: (not hidden(flight), list(EFFECTS).index(flight.effect),
                                               flight.least[1] if flight.least else 1.0))


def text(flights: Sequence[Flight]) -> list[str]:
    """Lines: for each scenario and mode the effect of each unit's faults by kind; then the counts. A mark shows where
    flight did not notice."""
    lines: list[str] = []
    worst = list(EFFECTS)
    single = [flight for flight in flights if len(flight.faults) == 1]
    kinds = list(dict.fromkeys(flight.faults[0].kind for flight in single))
    for scenario, mode, begin in dict.fromkeys((flight.scenario, flight.mode, flight.begin) for flight in single):
        rows: dict[str, dict[str, str]] = {}
        for flight in single:
            if (flight.scenario, flight.begin) == (scenario, begin):
                shown = flight.effect + ("!" if hidden(flight) else "")
                row, kind = rows.setdefault(flight.faults[0].unit, {}), flight.faults[0].kind
                if worst.index(row.get(kind, "none").rstrip("!")) >= worst.index(flight.effect):
                    row[kind] = shown
        lines += [f"{scenario}, {begin:g} s" + (f", in {mode}" if mode else ""),
                  *columns([("", *kinds), *((unit, *(row.get(kind, "") for kind in kinds))
                                            for unit, row in rows.items())], indent="  "), ""]
    counted = Counter((flight.effect, flight.detected is not None) for flight in flights)
    rows_ = [(effect, str(counted[effect, True] + counted[effect, False]),
              f"{counted[effect, True]} detected" if effect != "none" else "", what)
             for effect, what in EFFECTS.items() if counted[effect, True] + counted[effect, False]]
    return [*lines, *columns(rows_, right={1, 2}, indent="  ")]


def as_csv(flights: Sequence[Flight]) -> str:
    """A line for each flight."""
    out = io.StringIO()
    rows = [cells(flight) for flight in flights]
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def write(flights: Sequence[Flight], matrix: Matrix, folder: Path, command: str) -> list[Path]:
    """Write report.html, faults.csv and results.json; returns their paths. command: repeats the flights."""
    from fledge.report.run import templates

    assert matrix.simulation.mission
    about = {"mission": matrix.simulation.name, "seed": matrix.simulation.seed, "command": command,
             "versions": identity(matrix.simulation.mission.folder)}
    worst = worst_first(flights)
    rows = [cells(flight) for flight in worst]
    chosen = {name: [f"{row[name]:g}" if isinstance(row[name], float) else row[name] for row in rows]
              for name in FILTERS}
    filters = {name: list(dict.fromkeys(values)) for name, values in chosen.items() if len(set(values)) > 1}
    counts = Counter(flight.effect for flight in flights)
    page = templates().get_template("faults.html").render(
        about=about, rows=rows, filters=filters,
        values=[[chosen[name][i] for name in filters] for i in range(len(rows))],
        hidden=[hidden(flight) for flight in worst],
        effects={name: (counts[name], what) for name, what in EFFECTS.items()},
        scenarios=list(dict.fromkeys(flight.scenario for flight in flights)))
    data: dict[str, Any] = {**about, "flights": [{**asdict(flight), "faults": [
        {"unit": fault.unit, "kind": fault.kind, **{k: str(v) for k, v in fault.fields.items()}}
        for fault in flight.faults]} for flight in flights]}
    return write_files({"report.html": page, "faults.csv": as_csv(flights),
                        "results.json": json.dumps(data, indent=1) + "\n"}, folder)
