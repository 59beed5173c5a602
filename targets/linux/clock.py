# SPDX-License-Identifier: Apache-2.0
"""A process in real time: paced by the machine's clock, with the inputs of the closed loop, and a report of how late it
woke and how long a cycle took."""
from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.errors import Failure
from fledge.targets.flown import new_record
from fledge.targets.linux import inputs
from fledge.targets.table import cpu

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fledge.targets.job import Part

DURATIONS = {"late_ns": "late after wake-up", "cycle_cpu_ns": "cycle, processor time", "cycle_wall_ns": "cycle, in all"}
QUANTILES = ("least", "median", "p99", "most")


@dataclass
class Paced:
    """The report of a flight by the clock."""
    target: str
    cycles: int
    overruns: int                           # cycles that ended after the next should have begun
    faults: int                             # page faults in the loop
    scheduling: str
    memory: str
    quantiles: dict[str, dict[str, int]]    # [ns]
    histograms: dict[str, list[list[int]]]  # [up to (ns), how many cycles]
    same: bool                              # it put out the bits of the desktop
    record: str

    def lines(self) -> list[tuple[str, ...]]:
        """The rows of a table."""
        rows = [("", *("99 %" if name == "p99" else name for name in QUANTILES))]
        return rows + [(name, *(cpu(self.quantiles[key][name] / 1e9) for name in QUANTILES))
                       for key, name in DURATIONS.items()]


def fly(target: Any, part: Part, desktop: Path) -> Paced:
    """Fly a part by the clock. desktop: the record of its flight there."""
    if target.profiled_by != "process":
        raise Failure(f"--clock: {target.name} does not run by the clock of this machine")
    file = inputs.write(part.folder / "inputs", inputs.capture(part, desktop))
    built, record = target.build(part), new_record(part.folder, target.name)
    command = [built.resolve(), "--clock", "--inputs", file.resolve(), "--record", record.name]
    done = subprocess.run(list(map(str, command)), cwd=part.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True)
    if done.returncode:
        raise Failure(f"{target.name}: {done.stderr.strip()}", 1)
    figures = dict(line.split(maxsplit=1) for line in done.stdout.splitlines() if " " in line)
    with Archive(desktop) as ours, Archive(record) as its:
        same = not compare(ours, its, part.outputs, times=part.is_instant)
    return Paced(target.name, int(figures["ticks"]), int(figures["overruns"]), int(figures["faults"]),
                 figures["scheduling"], figures["memory"],
                 {key: {name: int(figures[f"{key}_{name}"]) for name in QUANTILES} for key in DURATIONS},
                 {key: [[int(n) for n in word.split(":")] for word in figures[f"{key}_histogram"].split()]
                  for key in DURATIONS}, same, str(record))


def plot(paced: Paced, title: str) -> Figure:
    """The histograms."""
    from matplotlib import style
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullLocator

    from fledge.plot import STYLE, TITLE

    with style.context(STYLE):
        figure = Figure(figsize=(8.4, 6.0), layout="constrained")
        figure.suptitle(title, **TITLE)
        for axes, (key, name) in zip(figure.subplots(3), DURATIONS.items()):
            widths = [_width(end) / 1e3 for end, _ in paced.histograms[key]]
            begins = [(end + 1) / 1e3 - width for (end, _), width in zip(paced.histograms[key], widths)]
            axes.bar(begins, [n for _, n in paced.histograms[key]], widths, align="edge", color="C0")
            for name, colour in (("median", "C2"), ("p99", "C1"), ("most", "C6")):
                x = paced.quantiles[key][name] / 1e3
                label = f"{'99 %' if name == 'p99' else name} {cpu(x / 1e6)}"
                axes.axvline(x, color=colour, linewidth=1, linestyle="--", label=label)
            axes.set(xscale="log", yscale="log", xlabel=f"{name} [us]", ylabel="cycles", ylim=(0.7, None))
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.xaxis.set_major_formatter("{x:g}")
            axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3)
    return figure


def _width(end: int) -> int:
    """[ns] of the bin with this end (targets/linux/pace.c)."""
    return 1 << max(0, end.bit_length() - 4)
