# SPDX-License-Identifier: Apache-2.0
"""The figures of a campaign: percentile bands over time, the values that the runs reached, and the draws on which
these depend most."""
from __future__ import annotations

import math
import re
from itertools import islice
from typing import TYPE_CHECKING, Any

from fledge.montecarlo.drivers import drivers
from fledge.montecarlo.requirements import FormulaCheck, Margin
from fledge.montecarlo.sweep import Sweep, number, text
from fledge.objects.measured import flat_index, unit_after
from fledge.plot import STYLE, TITLE, axis_label, component_labels, label_time, symbol, time_unit, unit_label, used

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fledge.montecarlo.result import Result
    from fledge.montecarlo.requirements import Requirement, Variable

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)

BANDS = (("1", "99", "#e3ebf4"), ("5", "95", "#c3d5e8"), ("25", "75", "#8fb1d3"))
MEDIAN, FAILED, LIMIT = "#1f5a96", "#d1622b", "#a6394a"
DASHED = {"color": LIMIT, "linestyle": (0, (4, 1.5))}
LINES_MAX = 12      # single runs in a panel
POINTS_MAX = 5000   # runs in a scatter plot, those of the lowest indices
PANELS_MAX = 24     # histograms in a figure


def percentiles(n: int) -> tuple[int, ...]:
    """The percentiles that n runs determine: the 5th is one of the runs only if there are at least 19."""
    return tuple(p for p in PERCENTILES if (n + 1) * min(p, 100 - p) >= 100)


def figures(result: Result) -> list[Figure]:
    """All figures of a campaign; [] if no run is complete."""
    import matplotlib.style

    if not result.complete.any():
        return []
    with matplotlib.style.context(STYLE):
        return [*_axes(result),
                *(_bands(result, variable) for variable in result.campaign.dispersions.shown),
                *_requirements(result),
                *_histograms(result, "final", "at the end",
                             [(_axis_label(measure), result.final(measure)[result.complete])
                              for measure in result.campaign.dispersions.measures()]),
                *_drivers(result),
                *_histograms(result, "draws", "what was drawn", [
                    (axis_label(path.partition(".")[2], result.campaign.dispersions.columns[path]), values)
                    for path, values in result.draws.items()])]


def _figure(rows: int, columns: int, name: str, title: str, result: Result, sharex: bool = False,
            height: float = 2.3) -> tuple[Any, np.ndarray]:
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
    if isinstance(variable, Margin):
        return variable.measure_text
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


def _spans_decades(values: np.ndarray) -> bool:
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
    panels = variable.panels
    if shape:
        there = np.array([[0.0 if result.is_zero(panel) else 1.0 for panel in panels[1:]]])
        panels = panels[:1 + used(there, shape)]
    columns = 1 if len(panels) == 1 else 2
    figure, axes = _figure(-(-len(panels) // columns), columns,
                           "bands-" + re.sub(r"\W+", "_", variable.path).strip("_"),
                           path.full.partition(".")[2].rpartition(".")[0] + ", "
                           + re.split(r"[,;(]", path.field.doc)[0].strip(), result, sharex=True)
    unit, factor = time_unit(result.time[-1])
    for axis, panel in zip(axes, panels):
        _band_panel(axis, panel, result, factor)
        axis.set_ylabel(_axis_label(panel))
    label_time(list(axes), len(panels), columns, unit)
    axes[min(columns, len(panels)) - 1].legend(*axes[0].get_legend_handles_labels(), loc="upper left",
                                               bbox_to_anchor=(1.0, 1.0), handlelength=1.2)
    return figure


def _band_panel(axis: Axes, variable: Variable, result: Result, factor: float) -> None:
    import numpy as np

    time = result.time / factor
    shown = percentiles(int(result.complete.sum()))
    median, *bands = result.bands(variable, (50, *shown))
    curves = dict(zip(map(str, shown), bands))
    logarithmic = variable._measure in ("norm", "max_abs") and _spans_decades(median)
    if logarithmic:
        axis.set_yscale("log")
        floor = result.least_positive(variable)
        curves = {p: np.maximum(curve, floor) for p, curve in curves.items()}
    for low, high, colour in BANDS:
        if low in curves:
            axis.fill_between(time, curves[low], curves[high], color=colour, linewidth=0, label=f"{low} to {high} %")
    few = "5" not in curves
    if few:
        some = np.flatnonzero(result.complete)[:LINES_MAX].tolist()
        for i, run in enumerate(result.runs_of(variable, some).values()):
            axis.plot(time, run, color="#b0b0b0", linewidth=0.7, label=None if i else "single runs")
    if "25" in curves:  # at least three runs
        axis.plot(time, curves["50"], color=MEDIAN, label="median")
    n = len(result.failures)
    failed = [run for run in result.runs_of(variable, list(islice(result.failures, 2 * LINES_MAX))).values()
              if np.isfinite(run).any()]
    for k, run in enumerate(failed[:LINES_MAX]):
        axis.plot(time, run, color=FAILED, linewidth=0.6, alpha=0.8,
                  label=None if k else _count(min(len(failed), LINES_MAX), n, "failed run"))
    for requirement in result.campaign.dispersions.requirements:
        if requirement.variable.measure_text == variable.measure_text:
            _limit(axis, requirement, result, factor)


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
    for axis, requirement in zip(axes, requirements):
        variable = requirement.variable
        values, holds = _reached(result, requirement), result.reached(requirement)[2]
        used = result.complete & np.isfinite(values)
        if not used.any():
            axis.text(0.5, 0.5, "no good data", transform=axis.transAxes, ha="center", va="center", color="0.45")
            axis.set_title(f"{_shown(variable)} {variable.when}")
            axis.set_xticks([])
            axis.set_yticks([])
            continue
        good, bad = values[used & holds], values[used & ~holds]
        reach = np.append(values[used], requirement.limit)
        bins = min(40, max(5, int(2 * math.sqrt(used.sum()))))
        if _spans_decades(reach):
            axis.set_xscale("log")
            edges = np.geomspace(reach[reach > 0].min(), reach.max(), bins + 1)
            edges[0] = min(edges[0], reach.min())
        else:
            edges = np.linspace(reach.min(), reach.max() if reach.max() > reach.min() else reach.min() + 1, bins + 1)
        # The limit is an edge, so that no bar holds runs of both kinds.
        edges = np.unique(np.append(edges, requirement.limit))
        axis.hist([good, bad], edges, stacked=True, color=["#8fb1d3", FAILED])
        # A bar of one run among a thousand is invisible: each failed run has its mark.
        if len(bad):
            axis.plot(bad, np.zeros(len(bad)), linestyle="", marker="^", markersize=5, color=FAILED, clip_on=False,
                      zorder=6)
        axis.axvline(requirement.limit, **DASHED, linewidth=1.4)
        axis.set_title(f"{_shown(variable)} {variable.when} {requirement.comparison} {requirement.limit:.4g}"
                       + unit_after(variable.unit))
        axis.set_title(f"{len(good)} of {result.complete.sum()}", loc="right", color="#777777", fontsize=9)
        axis.set_xlabel(_axis_label(variable) + ("" if variable._start is None else ", the worst of each run"))
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


def _axes(result: Result) -> list[Figure]:
    """Of a sweep, each measure that is judged over each axis; over two axes together as a map."""
    import numpy as np

    sweep = result.campaign
    if not isinstance(sweep, Sweep):
        return []
    rows, paths = judged(result), list(sweep.axes)
    together = len(paths) == 2
    columns = min(len(rows), 2) if together or len(paths) == 1 else len(paths)
    n = len(rows) if together or len(paths) == 1 else len(rows) * len(paths)
    figure, axes = _figure(-(-n // columns), columns, "axes", "over the axes", result, height=3.2 if together else 2.6)
    for i, axis in enumerate(axes):
        if i >= n:
            axis.set_visible(False)
            continue
        which, shown = (i, paths) if together or len(paths) == 1 else (i // len(paths), [paths[i % len(paths)]])
        variable, when, values, requirement = rows[which]
        grid = sweep.on_grid(values)
        bad = sweep.on_grid(result.flown & ~result.passed if requirement is None else
                            result.flown & ~requirement.holds(values))
        places = [np.array([number(sweep.axes[path], value) for value in sweep.axes[path]]) for path in shown]
        if together:
            _map(axis, places[0], places[1], grid, bad, _axis_label(variable))
        else:
            _curve(axis, places[0], np.moveaxis(grid, grid.ndim - 1 - paths.index(shown[0]), -1),
                   np.moveaxis(bad, grid.ndim - 1 - paths.index(shown[0]), -1), requirement)
            axis.set_ylabel(_axis_label(variable) + "\n" + when)
        for path, place, side in zip(shown, places, (axis.xaxis, axis.yaxis)):
            listed = sweep.axes[path]
            if _is_geometric(place):
                (axis.set_xscale if side is axis.xaxis else axis.set_yscale)("log")
            if len(listed) <= 10 or any(isinstance(value, (str, list, tuple)) for value in listed):
                side.set_ticks([], minor=True)
                side.set_ticks(place, [f"{value:.3g}" if isinstance(value, float) else text(value) for value in listed])
        axis.set_xlabel(axis_label(shown[0], sweep.unit(shown[0])))
        if together:
            axis.set_ylabel(axis_label(shown[1], sweep.unit(shown[1])))
            axis.set_title(when if requirement is None else f"{when} {requirement.comparison} {requirement.limit:.4g}"
                           + unit_after(variable.unit))
    return [figure]


def _is_geometric(place: np.ndarray) -> bool:
    """Whether values stand on a logarithmic axis."""
    return bool(len(place) > 2 and place.min() > 0 and place[1] - place[0] < 0.6 * (place[-1] - place[-2]))


def _edges(place: np.ndarray) -> np.ndarray:
    """The borders of the cells about values, of which each is in the middle of its cell on its axis."""
    import numpy as np

    on_axis = np.log(place) if _is_geometric(place) else place
    gaps = np.diff(on_axis) if len(place) > 1 else np.ones(1)
    edges = np.concatenate([on_axis[:1] - gaps[0] / 2, on_axis[:-1] + gaps[:len(place) - 1] / 2,
                            on_axis[-1:] + gaps[-1] / 2])
    return np.exp(edges) if _is_geometric(place) else edges


def _map(axis: Axes, x: np.ndarray, y: np.ndarray, grid: np.ndarray, bad: np.ndarray, label: str) -> None:
    """The median of the runs at each point of two axes, with a cross where a run has failed."""
    import warnings

    import numpy as np
    from matplotlib.colors import LogNorm

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)     # of points where no run came to its end
        median = np.nanmedian(grid, axis=0)
    if not np.isfinite(median).any():
        return
    mesh = axis.pcolormesh(_edges(x), _edges(y), np.ma.masked_invalid(median), cmap="Blues",
                           norm=LogNorm() if _spans_decades(median) and np.nanmin(median) > 0 else None)
    axis.figure.colorbar(mesh, ax=axis, label=label)
    row, column = np.nonzero(bad.any(axis=0))
    axis.plot(x[column], y[row], linestyle="", marker="x", color=FAILED, markersize=5)
    axis.grid(False)


def _curve(axis: Axes, x: np.ndarray, grid: np.ndarray, bad: np.ndarray, requirement: Requirement | None) -> None:
    """All runs over one axis: their median and extremes; each that has failed."""
    import warnings

    import numpy as np

    runs, failed = grid.reshape(-1, len(x)), bad.reshape(-1, len(x))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)     # of points where no run came to its end
        low, median, high = np.nanmin(runs, axis=0), np.nanmedian(runs, axis=0), np.nanmax(runs, axis=0)
    if len(runs) > 1:
        axis.fill_between(x, low, high, color="#c3d5e8", linewidth=0)
    axis.plot(x, median, color=MEDIAN, marker="o", markersize=3)
    row, column = np.nonzero(failed)
    axis.plot(x[column], runs[row, column], linestyle="", marker="x", color=FAILED, markersize=5)
    if _spans_decades(runs):
        axis.set_yscale("log")
    if requirement is not None:
        axis.axhline(requirement.limit, **DASHED, linewidth=1.2)


def judged(result: Result) -> list[tuple[Variable, str, np.ndarray, Requirement | None]]:
    """(measure, when, (runs,) values, requirement) of each requirement; of each measure at the end if there is none."""
    d = result.campaign.dispersions
    return ([(requirement.variable, requirement.variable.when, _reached(result, requirement), requirement)
             for requirement in d.requirements]
            or [(measure, "at the end", result.final(measure), None) for measure in d.measures()])


def _reached(result: Result, requirement: Requirement) -> np.ndarray:
    values = result.reached(requirement)[0]
    return requirement.variable.finite(values) if isinstance(requirement, FormulaCheck) else values


def _drivers(result: Result) -> list[Figure]:
    """Of each measure that is judged, the three draws on which it depends most."""
    import numpy as np

    rows = [(row, strong) for row in judged(result) if (strong := drivers(result, row[2])[:3])]
    if not rows:
        return []
    figure, axes = _figure(len(rows), 3, "drivers", "the draws that matter most", result, height=2.7)
    figure.set_figwidth(11)
    d = result.campaign.dispersions
    for axis in axes:
        axis.set_visible(False)
    for row, ((variable, when, values, requirement), strong) in enumerate(rows):
        holds = requirement.holds(values) if requirement is not None else result.complete
        for axis, driver in zip(axes[3 * row:], strong):
            axis.set_visible(True)
            for chosen, colour, size in ((holds, "#5d8cbc", 4), (~holds, FAILED, 9)):
                shown = np.flatnonzero(chosen & result.complete)[:POINTS_MAX]
                axis.scatter(result.draws[driver.path][shown], values[shown],
                             s=size, color=colour, linewidths=0, alpha=0.7)
            if _spans_decades(values[result.complete]):
                axis.set_yscale("log")
            if requirement is not None:
                axis.axhline(requirement.limit, **DASHED, linewidth=1.2)
            axis.set_xlabel(axis_label(driver.path.partition(".")[2], d.columns[driver.path]))
            axis.set_title(
                f"explains {driver.share:.0%}, correlation {driver.correlation:+.2f}".replace("-", "\N{MINUS SIGN}"))
            axis.margins(x=0.03)
        axes[3 * row].set_ylabel(_axis_label(variable) + "\n" + when)
    return [figure]


def _histograms(result: Result, name: str, title: str, shown: list[tuple[str, np.ndarray]]) -> list[Figure]:
    """A figure of histograms. shown: (label, values of the runs)"""
    import numpy as np

    if len(shown) > PANELS_MAX:
        title += f", the first {PANELS_MAX} of {len(shown)}"
    shown = [(label, values[np.isfinite(values)]) for label, values in shown[:PANELS_MAX]]
    shown = [(label, values) for label, values in shown if len(values)]
    if not shown:
        return []
    columns = min(4, len(shown))
    figure, axes = _figure(-(-len(shown) // columns), columns, name, title, result, height=1.7)
    figure.set_figwidth(max(5.0, 2.75 * columns))
    for axis, (label, values) in zip(axes, shown):
        distinct = np.unique(values[:1000])
        if len(distinct) <= 10 and len(distinct) < len(values[:1000]):     # whole numbers, enumerations, choices
            distinct, counts = np.unique(values, return_counts=True)
            width = 0.8 * np.diff(distinct).min() if len(distinct) > 1 else 1.0
            axis.bar(distinct, counts, width, color="#8fb1d3")
        else:
            bins: Any = min(40, max(5, int(math.sqrt(len(values)))))
            if _spans_decades(values):
                axis.set_xscale("log")
                bins = np.geomspace(values[values > 0].min(), values.max(), bins + 1)
            axis.hist(values, bins, color="#8fb1d3")
        axis.set_xlabel(label)
        axis.yaxis.get_major_locator().set_params(integer=True)
        axis.grid(False, axis="x")
    for axis in axes[len(shown):]:
        axis.set_visible(False)
    return [figure]
