# SPDX-License-Identifier: Apache-2.0
"""A figure of the comparison that decided on a requirement: its signal over time, and its limit."""
from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

from fledge.objects.si import enumerator_names
from fledge.requirements.formula import shown_in

if TYPE_CHECKING:
    import numpy as np

    from fledge.requirements import Comparison

POINTS = 250        # stretches of time, of which the least and the largest value are drawn
DECADES = 4         # below the limit, on a logarithmic axis


def draw(time: np.ndarray, values: np.ndarray, comparison: Comparison, at: float | None, verdict: str) -> str:
    """An SVG element for a page, with its texts as such; "" without a sample.

    time: (n,) [s]; values: (n,) of the signal in SI, NaN where unknown; at: [s], which is marked."""
    import numpy as np
    from matplotlib import rc_context, style
    from matplotlib.figure import Figure

    from fledge.plot import STYLE, time_unit, unit_label

    if not len(time):
        return ""
    signal = comparison.signal
    unit, scale = shown_in(comparison.unit, comparison.limit)
    limit, values = scale * comparison.limit, scale * np.asarray(values, float)
    name, factor = time_unit(float(time[-1]))
    with style.context(STYLE), rc_context({"svg.fonttype": "none", "svg.hashsalt": "fledge"}):
        figure = Figure(figsize=(4.6, 2.1), layout="constrained")
        axes = figure.add_subplot()
        field = signal.field.field if signal.field else None
        names = enumerator_names(field) if field else {}
        if signal.event:
            axes.vlines(time[values > 0] / factor, 0, 1, color="C0")
            axes.set_ylim(0, 1.1)
            axes.set_yticks([])
        else:
            axes.plot(*thinned(time / factor, values), color="C0",
                      drawstyle="default" if comparison.measured else "steps-post")
            axes.axhline(limit, color="C6", linestyle=(0, (5, 3)), linewidth=1.1)
        if names:
            axes.set_yticks(list(names), list(names.values()))
        elif not signal.event:
            _limit(axes, values[np.isfinite(values)], limit, comparison)
            axes.set_ylabel(f"[{unit_label(unit)}]" if unit_label(unit) else "")
        nearest = int(np.abs(time - (at or 0.0)).argmin())
        if at is not None and np.isfinite(values[nearest]):
            axes.plot(at / factor, values[nearest], "o", markersize=4.5, markeredgecolor="white", clip_on=False,
                      color="C2" if verdict == "holds" else "C6")
        axes.set_xlim(time[0] / factor, max(time[-1], time[0] + 1e-9) / factor)
        axes.set_xlabel(f"time [{name}]")
        axes.set_title(shortened(signal.text), fontsize=8.5)
        out = io.StringIO()
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return element(out.getvalue())


def _limit(axes: Any, known: np.ndarray, limit: float, comparison: Comparison) -> None:
    """The limit's text, the side on which the comparison does not hold, and the scale that shows both."""
    below = comparison.relation.startswith("<")
    if limit > 0 and len(known) and known.min() >= 0 and known.max() > 30 * limit:
        axes.set_yscale("log")
        axes.set_ylim(max(known.min() / 2, limit / 10**DECADES), 2 * known.max())
    else:
        low, high = axes.get_ylim()
        room = 0.12 * (high - low)
        axes.set_ylim(min(low, limit - room), max(high, limit + room))
    low, high = axes.get_ylim()
    if comparison.measured:
        axes.axhspan(limit, high if below else low, color="C6", alpha=0.07, linewidth=0)
        axes.set_ylim(low, high)
    text = comparison.text.rpartition(f" {comparison.relation} ")[2]
    axes.annotate(f"{comparison.relation} {text}", (1, limit), xycoords=("axes fraction", "data"), fontsize=8,
                  ha="right", va="bottom" if below else "top", color="C6", xytext=(0, 2 if below else -2),
                  textcoords="offset points")


def shortened(text: str, most: int = 64) -> str:
    """A text that fits the title of a figure."""
    return text if len(text) <= most else f"{text[:most // 2]} \N{HORIZONTAL ELLIPSIS} {text[-most // 2:]}"


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A line that looks the same with fewer points: of each stretch of time its first, least, largest and last."""
    import numpy as np

    if len(time) <= 4 * POINTS:
        return time, values
    chosen = set()
    for part in np.array_split(np.arange(len(time)), POINTS):
        there = part[np.isfinite(values[part])]
        chosen |= {part[0], part[-1], *((there[values[there].argmin()], there[values[there].argmax()])
                                        if len(there) else ())}
    at = sorted(chosen)
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
