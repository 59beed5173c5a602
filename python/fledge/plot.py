# SPDX-License-Identifier: Apache-2.0
"""Plots of recorded fields against time, of a Log or of an Archive.

Labels come from the headers: `sigma_BR` is shown as a Greek letter with its frames, the unit beside it,
the components in the legend.
"""

import re
import sys
from pathlib import Path

from fledge.errors import SetupError


GREEK = ("alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi "
         "psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega").split()
STYLE = Path(__file__).with_name("style.mplstyle")


# --- words -----------------------------------------------------------------------------------------

def symbol(name):
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


def _frames(text):
    """ "BN" -> [B, N], "BcB" -> [B_c, B]; None if the text names no two frames."""
    parts = re.findall(r"[A-Z][a-z0-9]*", text)
    if len(parts) != 2 or "".join(parts) != text:
        return None
    return [p[0] + (f"_{{{p[1:]}}}" if p[1:] else "") for p in parts]


def unit_label(unit):
    """ "kg m^2" -> kg·m², as mathtext within dollars; "" for none."""
    if unit in ("", "-"):
        return ""
    text = re.sub(r"\^(-?\d+)", r"$^{\1}$", unit)
    return re.sub(r"(?<! /) (?!/)", "·", text).replace(" / ", "/").replace("/ ", "/")


def component_labels(name, meaning, shape):
    """The legend of an array: the meaning's own words if it lists them, else numbered symbols."""
    import itertools

    words = [w.strip() for w in re.sub(r"\(.*?\)", "", meaning).split(",")]
    if len(shape) == 1 and len(words) == shape[0] and all(re.fullmatch(r"\w+", w) for w in words):
        return [f"${symbol(w)}$" for w in words]
    # Frames stand at the axis already; the components get only their number.
    base = symbol(name.split("_")[0])
    base = base if "mathrm" not in base else ""
    return [f"${base}_{{{','.join(str(i + 1) for i in index)}}}$" if base else
            ",".join(str(i + 1) for i in index) for index in itertools.product(*map(range, shape))]


# --- data ------------------------------------------------------------------------------------------

def time_unit(seconds):
    """The unit that suits a time axis: ("h", 3600)."""
    for limit, name, factor in ((180, "s", 1.0), (7200, "min", 60.0), (4 * 86400, "h", 3600.0)):
        if seconds < limit:
            return name, factor
    return "d", 86400.0


# --- drawing ---------------------------------------------------------------------------------------

def plot(source, *panels, titles=None, columns=1, units=None, title=None, name=None, size=None):
    """Plot fields against time; returns a matplotlib Figure.

    source: a Log or an Archive
    panels: for each panel the name of a field, or a list of names that share it
    titles: of the panels; default: the port and the meaning of the field
    columns: of panels
    units: field name -> unit to show it in, as in {"euler.angles": "deg"}
    title, name: of the figure, and of its file; size: (width, height) in inches
    Raises SetupError for names that are not there.
    """
    import matplotlib.style
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    if not panels:
        raise SetupError("plot: name at least one field, as in plot('error.sigma_BR')")
    groups = [[source.series(key) for key in ([p] if isinstance(p, str) else p)] for p in panels]
    rows = -(-len(groups) // columns)
    with matplotlib.style.context(STYLE):
        figure = Figure(figsize=size or (7.2 if columns == 1 else 5.0 * columns, 0.5 + 2.3 * rows),
                        layout="constrained")
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False).flatten()
        last = max((one.time[-1] for group in groups for one in group if len(one.time)), default=1.0)
        unit, factor = time_unit(last)
        axes[0].xaxis.set_major_locator(MaxNLocator(steps=[1, 2, 5, 10]))  # whole minutes; all share it
        for i, (axis, group) in enumerate(zip(axes, groups)):
            _panel(axis, group, factor, units or {}, titles[i] if titles and i < len(titles) else None)
        for i, axis in enumerate(axes):
            if i >= len(groups):
                axis.set_visible(False)
            elif i + columns >= len(groups):
                axis.set_xlabel(f"time [{unit}]")
                axis.tick_params(labelbottom=True)
        figure.align_ylabels()
        if title:
            figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold", color="#222222")
    figure.fledge_name = name or _file_name(groups)
    return figure


def _panel(axis, group, factor, units, title):
    import numpy as np

    labels = []
    for one in group:
        values, shown_unit = _in_unit(one, units)
        values = values.reshape(len(values), -1)
        used = _used(values, one.shape)
        names = component_labels(one.name, one.meaning, one.shape) if one.shape else [
            f"${symbol(one.name.split('[')[0])}$"]
        shown = np.array(values, dtype=float)
        shown[1:][_jumps(shown, one, shown_unit)] = np.nan
        for k in range(used):
            text = names[k] if len(group) == 1 else f"{names[k]} ({one.port.rpartition('.')[2]})"
            axis.plot(one.time / factor, shown[:, k], label=text)
        label = f"${symbol(one.name.split('[')[0])}$"
        unit = unit_label(shown_unit)
        labels.append(f"{label}  [{unit}]" if unit else label)
    axis.set_ylabel(", ".join(dict.fromkeys(labels)))
    axis.set_title(title if title is not None else _title(group))
    if len(axis.lines) > 1:
        # Outside, where no line can run through it.
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), handlelength=1.2)
    lines = [line.get_ydata() for line in axis.lines]
    if lines and all(len(y) and min(y) == max(y) for y in lines):  # all constant: show them apart from the frame
        low, high = min(y[0] for y in lines), max(y[0] for y in lines)
        pad = 0.1 * max(high - low, abs(high), 1e-3)
        axis.set_ylim(low - pad, high + pad)


def _in_unit(one, units):
    """The values in the unit that the caller wants."""
    wanted = next((u for k, u in units.items() if one.key == k or one.key.endswith("." + k)), None)
    if wanted is None:
        return one.values, one.unit
    from fledge import units as table

    return one.values / getattr(table, wanted).value, wanted


def _used(values, shape):
    """How many elements to draw: of long arrays, those after the last that is ever used are left out."""
    n = values.shape[1]
    if len(shape) == 1 and shape[0] > 3:
        busy = [k for k in range(n) if values[:, k].any()]
        return max(busy, default=0) + 1
    return n


def _jumps(values, one, unit):
    """Where not to draw a line: at a jump to the shadow set (MRPs) or across half a turn (angles)."""
    import numpy as np

    steps = np.abs(np.diff(values, axis=0))
    if one.name.startswith("sigma"):
        return np.linalg.norm(steps, axis=1) > 0.5
    if unit in ("rad", "deg"):
        return steps.max(axis=1) > (np.pi if unit == "rad" else 180.0)
    return np.zeros(len(steps), bool)


def _title(group):
    one = group[0]
    port = one.port.partition(".")[2] or one.port
    meaning = re.split(r"[,;(]", one.meaning)[0].strip() if one.shape and one.meaning else ""
    return port if len(group) > 1 or not meaning else f"{port}: {meaning}"


def _file_name(groups):
    keys = dict.fromkeys(re.sub(r"\W+", "_", one.key.strip("/")).strip("_") for group in groups for one in group)
    return "-".join(list(keys)[:3]) + ("-etc" if len(keys) > 3 else "")


# --- delivery --------------------------------------------------------------------------------------

def deliver(figure, plots):
    """Hand a figure to what collects plots, or without one to pyplot, to be shown as the user is used to."""
    if plots is not None:
        plots.add(figure)
    elif "matplotlib.pyplot" in sys.modules or "IPython" in sys.modules:
        import matplotlib.pyplot as plt

        # pyplot's own way to take a figure made elsewhere: a new number, this figure as its content.
        plt.figure(FigureClass=lambda *_, **__: figure)
    return figure


def save(figure, folder):
    """Save a figure as PNG under its name; returns the path."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from fledge.files import Part

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{figure.fledge_name}.png"
    FigureCanvasAgg(figure)
    with Part(path) as part:
        figure.savefig(part, format="png", metadata={"Software": None})
    return path
