# SPDX-License-Identifier: Apache-2.0
"""Plots of recorded fields against time, of a Log or of an Archive.

Labels come from the headers: `sigma_BR` becomes a Greek letter with its frames and its unit, and the legend names the
components.
"""
from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.display import shown_by_pyplot
from fledge.errors import SetupError, suggesting
from fledge.records.series import GOOD, NONE, Series

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fledge.records.series import Records

GREEK = ("alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi "
         "psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega").split()
POOR = "degraded or stale"
MODE_COLOURS = ["#c9d6e6", "#f0cfa8", "#bfdcc3", "#dfc8e4", "#ecd98f", "#b9dcda", "#efc3c8", "#cfd4d8"]
STYLE = Path(__file__).with_name("style.mplstyle")
TITLE = {"x": 0.01, "ha": "left", "fontsize": 11, "fontweight": "bold", "color": "#222222"}     # of a figure


# --- words -----------------------------------------------------------------------------------------

def symbol(name: str) -> str:
    """A field's name as mathtext without dollars: "omega_BN_B" -> {}^{B}\\omega_{B/N}.

    Names that are words rather than symbols are returned upright.
    """
    base, *rest = name.split("_")
    dots = ""
    if re.fullmatch(r"d{1,2}(%s|[a-zA-Z])" % "|".join(GREEK), base) and base not in GREEK:
        dots = {1: r"\dot", 2: r"\ddot"}[len(base) - len(base.lstrip("d"))]
        base = base.lstrip("d")
    if base in GREEK:
        shown = "\\" + base
    elif len(base) == 1:
        shown = base
    else:
        return r"\mathrm{%s}" % name.replace("_", r"\ ")
    if dots:
        shown = f"{dots}{{{shown}}}"
    frames = _frames(rest[0]) if rest else None
    if frames:
        shown += "_{%s}" % "/".join(frames)
        rest = rest[1:]
    if rest and len(rest[-1]) <= 2 and rest[-1][:1].isupper():
        shown = "{}^{%s}" % rest.pop() + shown
    if rest:
        shown += "_{%s}" % r"\mathrm{%s}" % ",".join(rest)
    return shown


def _frames(text: str) -> list[str] | None:
    """ "BN" -> [B, N], "BcB" -> [B_c, B]; None if the text names no two frames."""
    parts = re.findall(r"[A-Z][a-z0-9]*", text)
    if len(parts) != 2 or "".join(parts) != text:
        return None
    return [p[0] + (f"_{{{p[1:]}}}" if p[1:] else "") for p in parts]


def unit_label(unit: str) -> str:
    """ "kg m^2" -> kg·m², as mathtext within dollars; "" for none."""
    if unit in ("", "-"):
        return ""
    text = re.sub(r"\^(-?\d+)", r"$^{\1}$", unit)
    return re.sub(r"(?<! /) (?!/)", "·", text).replace(" / ", "/").replace("/ ", "/")


def component_labels(name: str, meaning: str, shape: tuple[int, ...]) -> list[str]:
    """The legend of an array: the meaning's own words if it lists them, else numbered symbols."""
    words = [w.strip() for w in re.sub(r"\(.*?\)", "", meaning).split(",")]
    if len(shape) == 1 and len(words) == shape[0] and all(re.fullmatch(r"\w+", w) for w in words):
        return [f"${symbol(w)}$" for w in words]
    # The axis names the frames already; the components need only their number.
    base = symbol(name.split("_")[0])
    base = base if "mathrm" not in base else ""
    return [f"${base}_{{{','.join(str(i + 1) for i in index)}}}$" if base else
            ",".join(str(i + 1) for i in index) for index in itertools.product(*map(range, shape))]


# --- data ------------------------------------------------------------------------------------------

def time_unit(seconds: float) -> tuple[str, float]:
    """The unit that suits a time axis: ("h", 3600)."""
    for limit, name, factor in ((180, "s", 1.0), (7200, "min", 60.0), (4 * 86400, "h", 3600.0)):
        if seconds < limit:
            return name, factor
    return "d", 86400.0


# --- drawing ---------------------------------------------------------------------------------------

@suggesting()
def plot(source: Records, *panels: str | Series | Sequence[str | Series], titles: Sequence[str] | None = None,
         columns: int = 1, units: dict[str, str] | None = None, title: str | None = None, name: str | None = None,
         size: tuple[float, float] | None = None) -> Figure:
    """Plot fields against time; returns a matplotlib Figure.

    panels: for each panel the name of a field, or a list of names that share it; a fledge.records.series.Series of
    computed values stands for a name, as replace(source.series("error.sigma_BR"), key="off", name="off", values=...)
    titles: of the panels; default: the port and the meaning of the field
    columns: the number of panels side by side
    units: field name -> unit of the axis, as in {"euler.angles": "deg", "error.omega_BR_B": "deg/s"}
    title, name: of the figure, and of its file; size: (width, height) in inches
    Raises SetupError for unknown names, and for units of another dimension.
    """
    from matplotlib.ticker import MaxNLocator

    from fledge.records.activity import modes

    if not panels:
        raise SetupError("plot: name at least one field, as in plot('error.sigma_BR')")
    groups = [[series if isinstance(series, Series) else source.series(series)
               for series in ([p] if isinstance(p, (str, Series)) else p)] for p in panels]
    chosen = _chosen_units([series for group in groups for series in group], units or {})
    rows = -(-len(groups) // columns)
    size = size or (7.2 if columns == 1 else 5.0 * columns, 0.5 + 2.3 * rows)
    with drawn(size, name or _file_name(groups), title) as figure:
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False).flatten()
        times = [series.time for group in groups for series in group if len(series.time)]
        first, last = min((t[0] for t in times), default=0.0), max((t[-1] for t in times), default=1.0)
        unit, factor = time_unit(last)
        axes[0].xaxis.set_major_locator(MaxNLocator(steps=[1, 2, 5, 10]))  # whole minutes; all share it
        for i, (axis, group) in enumerate(zip(axes, groups)):
            _panel(axis, group, factor, chosen, titles[i] if titles and i < len(titles) else None)
        left, right = axes[0].get_xlim()    # of all panels; fields that were never written do not extend it
        axes[0].set_xlim(min(left, first / factor), max(right, last / factor))
        began = modes(source)
        for i, (axis, group) in enumerate(zip(axes, groups)):
            _mode_band(axis, group, began, last / factor, factor, named=i < columns)
        label_time(axes, len(groups), columns, unit)
    return figure


@contextmanager
def drawn(size: tuple[float, float], name: str, title: str | None = None) -> Iterator[Figure]:
    """A figure to draw in, in the style of all figures. size: (width, height) in inches; name: of its file."""
    import matplotlib.style
    from matplotlib.figure import Figure

    with matplotlib.style.context(STYLE):
        figure = Figure(figsize=size, layout="constrained")
        figure.fledge_name = name
        yield figure
        if title:
            figure.suptitle(title, **TITLE)


def label_time(axes: Sequence[Axes], count: int, columns: int, unit: str) -> None:
    """Label the time at the lowest panel of each column. count: of the panels; the other axes are hidden."""
    for i, axis in enumerate(axes):
        if i >= count:
            axis.set_visible(False)
        elif i + columns >= count:
            axis.set_xlabel(f"time [{unit}]")
            axis.tick_params(labelbottom=True)
    axes[0].figure.align_ylabels()


def axis_label(shown: str, unit: str) -> str:
    """A symbol, with its unit in brackets."""
    return f"{shown}  [{unit}]" if unit else shown


def _panel(axis: Axes, group: list[Series], factor: float, units: dict[str, tuple[str, float]],
           title: str | None) -> None:
    import numpy as np

    labels = []
    for n, series in enumerate(group):
        shown_unit, size = units.get(series.key, (series.unit, 1.0))
        values = (series.values / size if size != 1.0 else series.values).reshape(len(series.values), -1)
        label = f"${symbol(series.name.split('[')[0])}$"
        names = component_labels(series.name, series.meaning, series.shape) if series.shape else [label]
        shown = np.array(values, dtype=float)
        shown[1:][_jumps(shown, series, shown_unit)] = np.nan
        if series.words:   # side by side, for equal ones would hide each other
            shown += 0.06 * (n - (len(group) - 1) / 2)
        for k in range(used(values, series.shape)):
            text = names[k] if len(group) == 1 else f"{names[k]} ({series.port.rpartition('.')[2]})"
            axis.plot(series.time / factor, shown[:, k], label=text,
                      drawstyle="steps-post" if series.words else "default")  # an enumeration has no values between
        _shade(axis, series, factor)
        labels.append(axis_label(label, unit_label(shown_unit)))
    axis.set_ylabel(", ".join(dict.fromkeys(labels)))
    words = group[0].words
    if words and all(series.words == words for series in group):
        axis.set_yticks(list(words), list(words.values()))
        axis.set_ylim(min(words) - 0.3, max(words) + 0.3)
        axis.set_ylabel(", ".join(dict.fromkeys(series.name.rpartition(".")[2] for series in group)))
    axis.set_title(title if title is not None else _title(group))
    if len(axis.lines) > 1 or POOR in axis.get_legend_handles_labels()[1]:
        # Outside, where no line can run through it.
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), handlelength=1.2)
    lines = [line.get_ydata() for line in axis.lines]
    lines = [y[~np.isnan(y)] for y in lines]
    if lines and not any(map(len, lines)):
        axis.text(0.5, 0.5, "never written", transform=axis.transAxes, ha="center", va="center", color="0.45")
        axis.set_yticks([])
    # all constant: keep them apart from the frame
    elif lines and not words and all(len(y) and min(y) == max(y) for y in lines):
        low, high = min(y[0] for y in lines), max(y[0] for y in lines)
        pad = 0.1 * max(high - low, abs(low), abs(high)) or 1.0
        axis.set_ylim(low - pad, high + pad)


def _mode_band(axis: Axes, group: list[Series], began: dict[str, list[tuple[float, str]]], last: float, factor: float,
               named: bool) -> None:
    """A strip above a panel with the modes of its process, or of the only process with modes. named: write their names
    """
    entered = began.get(group[0].port.partition(".")[0]) or (next(iter(began.values())) if len(began) == 1 else [])
    order = list(dict.fromkeys(name for _, name in entered))
    if len(order) < 2:
        return
    left, right = axis.get_xlim()
    for (t, name), end in zip(entered, [*(t / factor for t, _ in entered[1:]), max(last, right)]):
        begin, end = max(t / factor, left), min(end, right)
        if begin >= end:
            continue
        axis.axvspan(begin, end, ymin=0.965, color=MODE_COLOURS[order.index(name) % len(MODE_COLOURS)], lw=0)
        if named and end - begin > 0.02 * len(name) * (right - left):
            axis.annotate(name, ((begin + end) / 2, 0.955), xycoords=("data", "axes fraction"), ha="center", va="top",
                          fontsize=7, color="0.35")
    axis.set_xlim(left, right)


def _shade(axis: Axes, series: Series, factor: float) -> None:
    """Shade the times of messages that were written and are not good."""
    import numpy as np

    if series.quality is None or not len(series.time):
        return
    poor = np.append((series.quality > NONE) & (series.quality < GOOD), False)
    ends = np.append(series.time, series.time[-1]) / factor
    turns = np.flatnonzero(np.diff(poor, prepend=False))
    for begin, end in zip(turns[::2], turns[1::2]):
        axis.axvspan(ends[begin], ends[end], color="0.5", alpha=0.15, lw=0,
                     label="" if POOR in axis.get_legend_handles_labels()[1] else POOR)


def _chosen_units(plotted: list[Series], units: dict[str, str]) -> dict[str, tuple[str, float]]:
    """The caller's units by the keys of the series, with their sizes in SI. Raises SetupError for a name that is not
    plotted, and for a unit that is none or has another dimension."""
    from fledge.units import unit_of

    sizes = {}
    for name, wanted in units.items():
        fits = [series for series in plotted if series.key == name or series.key.endswith("." + name)]
        if not fits:
            raise SetupError(f"plot: units names '{name}', which is not plotted; there are "
                             + ", ".join(dict.fromkeys(series.key for series in plotted)))
        try:
            size = unit_of(wanted)
        except ValueError as error:
            raise SetupError(f"plot: units of {name}: {error}") from None
        for series in fits:
            own = unit_of(series.unit)
            if size.dims != own.dims:   # radians count: a rate is no frequency, and an MRP no angle
                near = [other for other in (f"{wanted}/s", wanted.removesuffix("/s"))
                        if other and unit_of(other).dims == own.dims]
                raise SetupError(f"plot: {series.key} is in {series.unit.strip('-') or 'no unit'}, which cannot be "
                                 f"shown in {wanted}" + "".join(f"; did you mean {other}?" for other in near))
            sizes[series.key] = wanted, size.value / own.value
    return sizes


def used(values: np.ndarray, shape: tuple[int, ...]) -> int:
    """The number of elements to draw: of a long array, those up to the last that is not always zero."""
    import numpy as np

    if len(shape) == 1 and shape[0] > 3:
        return max((k for k in range(shape[0]) if np.nan_to_num(values[:, k]).any()), default=0) + 1
    return values.shape[1]


def _jumps(values: np.ndarray, series: Series, unit: str) -> np.ndarray:
    """Where to interrupt a line: at a jump to the shadow set (MRPs) or across half a turn (angles)."""
    import numpy as np

    steps = np.abs(np.diff(values, axis=0))
    if series.name.startswith("sigma"):
        return np.linalg.norm(steps, axis=1) > 0.5
    if unit in ("rad", "deg"):
        return steps.max(axis=1) > (np.pi if unit == "rad" else 180.0)
    return np.zeros(len(steps), bool)


def _title(group: list[Series]) -> str:
    series = group[0]
    ports = ", ".join(dict.fromkeys(series.port.partition(".")[2] or series.port for series in group))
    meaning = re.split(r"[,;(]", series.meaning)[0].strip() if (series.shape or series.words) and series.meaning else ""
    return ports if len(group) > 1 or not meaning else f"{ports}: {meaning}"


def _file_name(groups: list[list[Series]]) -> str:
    keys = dict.fromkeys(re.sub(r"\W+", "_", series.key.strip("/")).strip("_") for group in groups for series in group)
    return "-".join(list(keys)[:3]) + ("-etc" if len(keys) > 3 else "")


# --- delivery --------------------------------------------------------------------------------------

def silent(source: Records) -> bool:
    """Whether the simulation of a Log draws no plots."""
    return getattr(source, "plots", None) is False


def deliver(figure: Figure, source: Records) -> Figure:
    """Add the figure of a Log to the plots of its simulation; if it has none, give it to pyplot, which shows it."""
    if not hasattr(source, "plots"):
        return figure
    if source.plots is not None:
        source.plots.add(figure)
    elif "matplotlib.pyplot" in sys.modules or "IPython" in sys.modules:
        import matplotlib.pyplot as plt

        # pyplot takes a figure from elsewhere in this way only: a new number, this figure as its content.
        plt.figure(FigureClass=lambda *_, **__: figure)
        shown_by_pyplot(figure)
    return figure


def file_name(figure: Figure) -> str:
    """The name of a figure's file, without its ending: of one that pyplot made, its label, or else figure-1."""
    name = getattr(figure, "fledge_name", "") or figure.get_label() or f"figure-{getattr(figure, 'number', 1)}"
    return re.sub(r"[/\\\x00-\x1f]", "_", str(name)).lstrip(".")[:100] or "figure"


def save(figure: Figure, folder: Path | str, name: str | None = None) -> Path:
    """Save a figure as PNG in a folder, which is made, under a name, by default its own; returns the path."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from fledge.disk import Part

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name or file_name(figure)}.png"
    FigureCanvasAgg(figure)
    with Part(path) as part:
        figure.savefig(part, format="png", metadata={"Software": None})
    return path
