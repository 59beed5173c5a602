# SPDX-License-Identifier: Apache-2.0
"""A campaign on one HTML page, as `fledge montecarlo` and `fledge sweep` write it: no other file, no script, no
network.

The same campaign gives the same page, however it was flown: it has no time of the wall clock.
"""
from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path

from fledge import __version__
from fledge.disk import Part
from fledge.mission.provenance import Revisions
from fledge.report.run import templates

FAILURES_MAX = 100      # on the page

# The sections of figures, by the beginnings of their files' names.
_FIGURES = {"axes": "Over the axes", "bands-": "Over time", "requirements": "What the runs reached",
            "final": "At the end", "drivers": "What matters most", "draws": "Draws"}


def write(path: Path, data: dict, pictures: Sequence[Path], command: str, mission: Path) -> Path:
    """Write the page; returns its path.

    data: of fledge.montecarlo.report; pictures: its figures; command: repeats the campaign; mission: its folder
    """
    figures: dict[str, list] = {title: [] for title in _FIGURES.values()}
    for picture in pictures:
        title = next(title for start, title in _FIGURES.items() if picture.stem.startswith(start))
        figures[title].append((picture.stem, b64encode(picture.read_bytes()).decode()))
    revisions = Revisions(mission).read()
    versions = {"Fledge": ", revision ".join(filter(None, [__version__, revisions.get("fledge")])),
                "mission": revisions.get("mission", "")}
    with Part(path) as part:
        part.write_text(templates().get_template("campaign.html").render(
            data=data, figures=figures, failures=data["failures"][:FAILURES_MAX], command=command,
            draws=_draws(data), versions={name: text for name, text in versions.items() if text}), encoding="utf-8")
    return path


def _draws(data: dict) -> list[tuple[str, dict]]:
    """(the declaration, the row of the draw) of each dispersed number; the declaration of an array once."""
    declared, rows = dict(data["declared"]), []
    for row in data["draws"]:
        longest = max((path for path in data["declared"] if row["path"].startswith(path)), key=len, default="")
        rows.append((declared.pop(longest, ""), row))
    return rows
