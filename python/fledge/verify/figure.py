# SPDX-License-Identifier: Apache-2.0
"""A figure of the comparison that decided on a requirement: its signal over time, and its limit."""
from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError

if TYPE_CHECKING:
    import numpy as np

POINTS = 400        # stretches of time, of which the least and the largest value are drawn
DECADES = 4         # below the limit, on a logarithmic axis


def comparison(outcome: Any) -> Any:
    """The comparison of a number that decided; None where there is none."""
    return next((one for one in outcome.requirement.formula.comparisons if one.text == outcome.where), None)


def draw(requirements: Any, records: Any, outcome: Any, decided: Any) -> str:
    """An SVG element for a page, with its texts as such; "" where its signal was not recorded."""
    try:
        time, values = requirements.values(records, decided)
    except SetupError:      # the flight ended before
        return ""
    return svg(time, values, decided, outcome.at, outcome.verdict) if len(time) else ""


def svg(time: np.ndarray, values: np.ndarray, comparison: Any, at: float | None, verdict: str) -> str:
    """time: (n,) [s]; values: (n,), NaN where unknown; at: [s], which is marked."""
    import numpy as np
    from matplotlib import rc_context, style
    from matplotlib.figure import Figure

    from fledge.plot import STYLE, axis_label, time_unit, unit_label

    limit = float(comparison.limit)
    values = np.asarray(values, float)
    name, factor = time_unit(float(time[-1]))
    known = values[np.isfinite(values)]
    with style.context(STYLE), rc_context({"svg.fonttype": "none", "svg.hashsalt": "fledge"}):
        figure = Figure(figsize=(4.6, 2.1), layout="constrained")
        axes = figure.add_subplot()
        axes.plot(*thinned(time / factor, values), color="C0")
        axes.axhline(limit, color="C6", linestyle=(0, (5, 3)), linewidth=1.1)
        if limit > 0 and len(known) and known.min() >= 0 and known.max() > 30 * limit:
            axes.set_yscale("log")
            axes.set_ylim(max(known.min() / 2, limit / 10**DECADES), 2 * known.max())
        below = comparison.relation.startswith("<")
        low, high = axes.get_ylim()
        if comparison.relation[0] in "<>":      # where it does not hold
            axes.axhspan(limit, high if below else low, color="C6", alpha=0.07, linewidth=0)
            axes.set_ylim(low, high)
        axes.annotate(f"{comparison.relation} {limit:g}", (1, limit), xycoords=("axes fraction", "data"), fontsize=8,
                      ha="right", va="bottom" if below else "top", color="C6", xytext=(0, 2 if below else -2),
                      textcoords="offset points")
        if at is not None and len(time):
            nearest = int(np.abs(time - at).argmin())
            if np.isfinite(values[nearest]):
                axes.plot(at / factor, values[nearest], "o", markersize=4.5, markeredgecolor="white",
                          color="C2" if verdict == "holds" else "C6")
        axes.set_xlabel(f"time [{name}]")
        axes.set_ylabel(axis_label("", unit_label(comparison.unit)).strip())
        axes.set_title(str(comparison.signal), fontsize=8.5)
        out = io.StringIO()
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return element(out.getvalue())


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A line that looks the same with fewer points: of each stretch of time its first, least, largest and last."""
    import numpy as np

    if len(time) <= 4 * POINTS:
        return time, values
    kept = set()
    for part in np.array_split(np.arange(len(time)), POINTS):
        there = part[np.isfinite(values[part])]
        kept |= {part[0], part[-1], *((there[values[there].argmin()], there[values[there].argmax()])
                                      if len(there) else ())}
    at = sorted(kept)
    return time[at], values[at]


def element(text: str) -> str:
    """An SVG file as an element of a page: without prolog, size and metadata."""
    text = text[text.index("<svg"):]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r' (xmlns(:xlink)?|version|width|height)="[^"]*"', "", text, count=5)
    return re.sub(r"\n\s*", "\n", text)


def with_ids(text: str, start: str) -> str:
    """The same with ids that begin with `start`, for a page of several."""
    text = re.sub(r'\bid="', f'id="{start}', text)
    return re.sub(r'(url\(#|xlink:href="#)', rf"\g<1>{start}", text)
