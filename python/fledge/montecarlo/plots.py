# SPDX-License-Identifier: Apache-2.0
"""The figures of a campaign: percentile bands over time, the values that the runs reached, and the draws on which
these depend most."""
from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from fledge.objects.measured import flat_index, unit_after
from fledge.plot import STYLE, TITLE, axis_label, component_labels, label_time, symbol, time_unit, unit_label, used

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fledge.montecarlo import Result
    from fledge.montecarlo.requirements import Requirement, Variable

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)

BANDS = (("1", "99", "#e3ebf4"), ("5", "95", "#c3d5e8"), ("25", "75", "#8fb1d3"))
MEDIAN, FAILED, LIMIT = "#1f5a96", "#d1622b", "#a6394a"
DASHED = {"color": LIMIT, "linestyle": (0, (4, 1.5))}
LINES_MAX = 12      # single runs in a panel


def percentiles(n: int) -> tuple[int, ...]:
    """The percentiles that n runs determine: the 5th is one of the runs only if there are at least 19."""
    return tuple(p for p in PERCENTILES if (n + 1) * min(p, 100 - p) >= 100)


def summary_of(variable: Variable) -> Variable:
    """A variable as one number: of a vector the norm, of another array the largest element."""
    shape = variable.field_path.shape
    return variable if not shape else variable.norm() if shape == (3,) else variable.max_abs()


def figures(result: Result) -> list[Figure]:
    """All figures of a campaign."""
    import matplotlib.style

    if not result.complete.any():
        return []
    with matplotlib.style.context(STYLE):
        return [*(_bands(result, variable) for variable in result.campaign.dispersions.retained.values()),
                *_requirements(result), *_drivers(result)]


def _figure(rows, columns, name, title, result, sharex=False, height=2.3):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2 if columns == 1 else 5.0 * columns, 0.6 + height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=sharex, squeeze=False).flatten()
    d = result.campaign.dispersions
    figure.suptitle(f"{result.campaign.nominal.name}, {result.campaign.name}: {title}\n", **TITLE, linespacing=1.6)
    n = int(result.flown.sum())
    about = f"{_count(n, n, 'run')} of {d.duration:g} s, seed {result.seed}"
    figure.text(0.01, 1 - 0.32 / figure.get_figheight(), about, fontsize=8.5, color="#777777", va="top")
    figure.fledge_name = name
    return figure, axes


def _shown(variable: Variable) -> str:
    """The symbol of a variable in mathtext."""
    field = variable.field_path.field
    base = symbol(field.name)
    if variable._measure == "norm":
        base = rf"\left|{base}\right|"
    elif variable._measure == "max_abs":
        base = rf"\max\,\left|{base}\right|"
    elif isinstance(variable._measure, tuple):
        shape = variable.field_path.shape
        base = component_labels(field.name, field.doc, shape)[flat_index(variable._measure, shape)].strip("$")
    return f"${base}$"


def _axis_label(variable: Variable) -> str:
    return axis_label(_shown(variable), unit_label(variable.unit))


def _spans_decades(values) -> bool:
    """Whether a logarithmic axis shows the values better; they must be positive."""
    import numpy as np

    values = np.asarray(values)[np.isfinite(values)]
    if not len(values) or values.min() < 0 or not values.any():
        return False
    low, high = np.percentile(values[values > 0], [2, 98])
    return high > 20 * low and (values == 0).mean() < 0.05


def _bands(result: Result, variable: Variable) -> Figure:
    import numpy as np

    path, shape = variable.field_path, variable.field_path.shape
    panels = [summary_of(variable)]
    if shape:
        values = result.retained[variable.path][result.complete]
        shown = used(values.reshape(-1, math.prod(shape)), shape)
        panels += [variable[index] for index in list(np.ndindex(shape))[:shown]]
    columns = 1 if len(panels) == 1 else 2
    figure, axes = _figure(-(-len(panels) // columns), columns,
                           "bands-" + re.sub(r"\W+", "_", variable.path).strip("_"),
                           path.full.partition(".")[2].rpartition(".")[0] + ", "
                           + re.split(r"[,;(]", path.field.doc)[0].strip(), result, sharex=True)
    unit, factor = time_unit(result.time[-1])
    for axis, one in zip(axes, panels):
        _band_panel(axis, one, result, factor)
        axis.set_ylabel(_axis_label(one))
    label_time(axes, len(panels), columns, unit)
    axes[min(columns, len(panels)) - 1].legend(*axes[0].get_legend_handles_labels(), loc="upper left",
                                               bbox_to_anchor=(1.0, 1.0), handlelength=1.2)
    return figure


def _band_panel(axis: Axes, variable: Variable, result: Result, factor: float) -> None:
    import numpy as np

    values = variable.values(result)
    complete = values[result.complete]
    time = result.time / factor
    shown = percentiles(len(complete))
    curves = dict(zip(map(str, shown), np.percentile(complete, shown, axis=0))) if shown else {}
    logarithmic = variable._measure in ("norm", "max_abs") and _spans_decades(np.median(complete, axis=0))
    if logarithmic:
        axis.set_yscale("log")
        floor = complete[complete > 0].min()
        curves = {p: np.maximum(curve, floor) for p, curve in curves.items()}
    for low, high, colour in BANDS:
        if low in curves:
            axis.fill_between(time, curves[low], curves[high], color=colour, linewidth=0, label=f"{low} to {high} %")
    few = "5" not in curves
    if few:
        for i, run in enumerate(complete[:LINES_MAX]):
            axis.plot(time, run, color="#b0b0b0", linewidth=0.7, label=None if i else "single runs")
    if "25" in curves:  # at least three runs
        axis.plot(time, curves["50"], color=MEDIAN, label="median")
    failed = [i for i in result.failures if np.isfinite(values[i, 0])]
    for k, i in enumerate(failed[:LINES_MAX]):
        axis.plot(time, values[i], color=FAILED, linewidth=0.6, alpha=0.8,
                  label=None if k else _count(min(len(failed), LINES_MAX), len(failed), "failed run"))
    for one in result.campaign.dispersions.requirements:
        if one.variable.measure_text == variable.measure_text:
            _limit(axis, one, result, factor)


def _count(shown: int, n: int, what: str) -> str:
    return f"{what}s ({shown} of {n})" if shown < n else f"{n} {what}{'s' if n != 1 else ''}"


def _limit(axis: Axes, requirement: Requirement, result: Result, factor: float) -> None:
    """Draw the limit over the time in which it holds; a limit at the end as a short line."""
    part = requirement.variable.samples(result.ns)
    start, end = result.time[part.start] / factor, result.time[part.stop - 1] / factor
    if start == end:
        start = end - 0.06 * result.time[-1] / factor
    labels = axis.get_legend_handles_labels()[1]
    axis.plot([start, end], [requirement.limit] * 2, **DASHED, linewidth=1.4,
              label=None if "limit" in labels else "limit", zorder=5)


def _requirements(result: Result) -> list[Figure]:
    import numpy as np
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    requirements = result.campaign.dispersions.requirements
    if not requirements:
        return []
    columns = 1 if len(requirements) == 1 else 2
    figure, axes = _figure(-(-len(requirements) // columns), columns, "requirements", "what the runs reached", result,
                           height=2.6)
    for axis, one in zip(axes, requirements):
        values, _, holds = one.worst(result)
        used = result.complete & np.isfinite(values)
        if not used.any():
            axis.set_visible(False)
            continue
        good, bad = values[used & holds], values[used & ~holds]
        reach = np.append(values[used], one.limit)
        bins = min(40, max(5, int(2 * math.sqrt(used.sum()))))
        if _spans_decades(reach):
            axis.set_xscale("log")
            edges = np.geomspace(reach[reach > 0].min(), reach.max(), bins + 1)
            edges[0] = min(edges[0], reach.min())
        else:
            edges = np.linspace(reach.min(), reach.max() if reach.max() > reach.min() else reach.min() + 1, bins + 1)
        # The limit is an edge, so that no bar holds runs of both kinds.
        edges = np.unique(np.append(edges, one.limit))
        axis.hist([good, bad], edges, stacked=True, color=["#8fb1d3", FAILED])
        # A bar of one run among a thousand is invisible: each failed run has its mark.
        if len(bad):
            axis.plot(bad, np.zeros(len(bad)), linestyle="", marker="^", markersize=5, color=FAILED, clip_on=False,
                      zorder=6)
        axis.axvline(one.limit, **DASHED, linewidth=1.4)
        axis.set_title(f"{_shown(one.variable)} {one.variable.when} {one.comparison} {one.limit:.4g}"
                       + unit_after(one.variable.unit))
        axis.set_title(f"{len(good)} of {result.complete.sum()}", loc="right", color="#777777", fontsize=9)
        axis.set_xlabel(_axis_label(one.variable) + ("" if one.variable._start is None else ", the worst of each run"))
        axis.set_ylabel("runs")
        axis.yaxis.get_major_locator().set_params(integer=True)
        axis.grid(False, axis="x")
        axis.margins(x=0.02)
    axes[min(columns, len(requirements)) - 1].legend(
        [Patch(color="#8fb1d3"), Line2D([], [], linestyle="", marker="^", markersize=5, color=FAILED),
         Line2D([], [], **DASHED, linewidth=1.4)],
        ["runs that fulfil it", "each that does not", "limit"], loc="upper left", bbox_to_anchor=(1.0, 1.0))
    for axis in axes[len(requirements):]:
        axis.set_visible(False)
    return [figure]


def correlations(result: Result, requirement: Requirement) -> list[tuple[float, str, bool]]:
    """[(rank correlation, path of a draw, whether it is of the draw's distance from its median)] with the values that
    the runs reached, the strongest first."""
    import numpy as np

    values = requirement.worst(result)[0]
    used = result.complete & np.isfinite(values)
    n = int(used.sum())
    if n < 2:
        return []

    def ranks(x):
        order = np.empty(n)
        order[np.argsort(x, kind="stable")] = np.arange(n)
        return order - (n - 1) / 2

    own = ranks(values[used])
    found = []
    for path, draws in result.draws.items():
        drawn = draws[used]
        if drawn.min() < drawn.max():
            both = [(float(own @ ranks(x) / (own @ own)), path, distance)
                    for x, distance in ((drawn, False), (np.abs(drawn - np.median(drawn)), True))]
            found.append(max(both, key=lambda one: abs(one[0])))
    return sorted(found, key=lambda one: -abs(one[0]))


def _drivers(result: Result) -> list[Figure]:
    """Of each requirement, the three draws with the strongest correlation, unless it may be chance."""
    n = int(result.complete.sum())
    rows = []
    for one in result.campaign.dispersions.requirements:
        # Without any dependence the deviation of a rank correlation is 1 / sqrt(n - 1).
        strong = [c for c in correlations(result, one)[:3] if n >= 30 and abs(c[0]) > 4 / math.sqrt(n - 1)]
        if strong:
            rows.append((one, strong))
    if not rows:
        return []
    figure, axes = _figure(len(rows), 3, "drivers", "the draws that matter most", result, height=2.7)
    figure.set_figwidth(11)
    d = result.campaign.dispersions
    for axis in axes:
        axis.set_visible(False)
    for row, (one, strong) in enumerate(rows):
        values, _, holds = one.worst(result)
        for axis, (rho, path, distance) in zip(axes[3 * row:], strong):
            axis.set_visible(True)
            for chosen, colour, size in ((holds, "#5d8cbc", 4), (~holds, FAILED, 9)):
                chosen = chosen & result.complete
                axis.scatter(result.draws[path][chosen], values[chosen], s=size, color=colour, linewidths=0, alpha=0.7)
            if _spans_decades(values[result.complete]):
                axis.set_yscale("log")
            axis.axhline(one.limit, **DASHED, linewidth=1.2)
            unit = d.columns[path]
            axis.set_xlabel(axis_label(path.partition(".")[2], unit))
            axis.set_title(f"rank correlation {rho:+.2f}".replace("-", "\N{MINUS SIGN}")
                           + (" with |x \N{MINUS SIGN} median|" if distance else ""))
            axis.margins(x=0.03)
        axes[3 * row].set_ylabel(_axis_label(one.variable) + "\n" + one.variable.when)
    return [figure]
