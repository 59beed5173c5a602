# SPDX-License-Identifier: Apache-2.0
"""The tables and plots of profiles: for the terminal, and on one HTML page."""
from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from functools import partial
from typing import Any

from fledge.profile.code import LIBRARY, NAMES
from fledge.profile.measure import Profile
from fledge.targets.table import cpu

Row = tuple[str, Callable[[Profile], Any]]


def _bytes(n: float | None) -> str:
    if n is None:
        return "-"
    return f"{n:,.0f} B" if n < 10240 else f"{n / 1024:,.1f} KiB" if n < 2**20 * 10 else f"{n / 2**20:,.1f} MiB"


def _count(n: float | None) -> str:
    if n is None:
        return "-"
    return f"{n:,.0f}" if n < 1e7 else f"{n / 1e6:,.1f} million" if n < 1e9 else f"{n / 1e9:,.3g} billion"


def _third(which: int, values: Sequence[float]) -> float | None:
    return values[which] if values else None


GROUPS: list[tuple[str, list[Row]]] = [
    ("Initialisation", [
        ("instructions", lambda p: _count(p.init_instructions)),
        ("heap, most", lambda p: _bytes(p.init_heap)),
        ("stack, most", lambda p: _bytes(p.init_stack))]),
    ("Loop", [
        ("cycles", lambda p: _count(p.cycles)),
        ("instructions per cycle", lambda p: _count(p.per_cycle)),
        ("in the first third", lambda p: _count(_third(0, p.thirds()[0]))),
        ("in the last third", lambda p: _count(_third(2, p.thirds()[0]))),
        ("processor time per cycle, median", lambda p: cpu(p.time.get("median", p.time.get("mean")))),
        ("most", lambda p: cpu(p.time.get("most"))),
        ("heap in the first third", lambda p: _bytes(_third(0, p.thirds()[1]))),
        ("heap in the last third", lambda p: _bytes(_third(2, p.thirds()[1]))),
        ("requests for memory", lambda p: _count(p.allocations)),
        ("stack, most ", lambda p: _bytes(p.loop_stack))]),
    ("Program", [
        ("static memory", lambda p: _bytes(p.static)),
        ("file, stripped; of a board: code", lambda p: _bytes(p.executable)),
        ("instructions in all", lambda p: _count(p.total_instructions)),
        ("outputs as on the desktop", lambda p: {True: "yes", False: "NO", None: "-"}[p.same])]),
]


def table(found: Sequence[Profile]) -> list[tuple[str, ...]]:
    """Rows of the table for the terminal."""
    rows: list[tuple[str, ...]] = [("", *(one.target for one in found))]
    for title, lines in GROUPS:
        rows += [(title, *("" for _ in found)),
                 *((f"  {name.strip()}", *(value(one) for one in found)) for name, value in lines)]
    if parts := _parts(found):
        rows += [("Code", *("" for _ in found)),
                 *((f"  {name}", *(_bytes(one.code.get(name)) for one in found)) for name in parts)]
    return rows


def _parts(found: Sequence[Profile]) -> list[str]:
    return [name for name in NAMES if any(name in one.code for one in found)]


# --- the page --------------------------------------------------------------------------------------

def page(mission: str, scenario: str, duration: float | None, found: Sequence[Profile]) -> str:
    """The page as text."""
    from fledge import __version__
    from fledge.report.run import templates

    groups = [(title, [(name.strip(), [value(one) for one in found]) for name, value in lines])
              for title, lines in GROUPS]
    if parts := _parts(found):
        groups.append(("Code and constants by part", [
            (name, [_bytes(one.code.get(name)) for one in found]) for name in parts]))
    return templates().get_template("profile.html").render(
        mission=mission, scenario=scenario, duration=duration, found=found, groups=groups, version=__version__,
        made=datetime.now(timezone.utc), problems=[(one.target, text) for one in found for text in one.problems()],
        figures=[(title, note, b64encode(png).decode()) for title, note, png in _figures(found)],
        heapless=[one.target for one in found if one.init_heap == 0 and one.loop_heap == 0],
        short=[one.target for one in found if not one.heap],
        functions=[one for one in found if one.functions])


def _figures(found: Sequence[Profile]) -> list[tuple[str, str, bytes]]:
    """(title, note, PNG) of each plot."""
    plots = []
    for one in found:
        if one.heap and (one.init_heap or one.loop_heap):
            note = f"At most {_bytes(one.init_heap)} in initialisation, {_bytes(one.loop_heap)} in the loop."
            plots.append((f"Heap over time, {one.target}", note, _png(partial(_heap, one))))
    counted = [one for one in found if one.instructions]
    if counted:
        plots.append(("Instructions per cycle", "The mean of the cycles between two marks; on a logarithmic scale, the "
                      "targets side by side.", _png(partial(_instructions, counted))))
    coded = [one for one in found if one.code]
    if coded:
        plots.append(("Code and constants by part", "What the linker took, by the folder of its source; the C "
                      "library, which is static on some targets, is left out here.",
                      _png(partial(_code, coded), 0.8 + 0.5 * len(coded))))
    return plots


def _png(draw: Callable[[Any], None], height: float = 2.4) -> bytes:
    from matplotlib import style
    from matplotlib.figure import Figure

    from fledge.plot import STYLE

    with style.context(STYLE):
        figure = Figure(figsize=(8.4, height), layout="constrained")
        draw(figure.add_subplot())
        out = io.BytesIO()
        figure.savefig(out, format="png")
    return out.getvalue()


def _heap(one: Profile, axes: Any) -> None:
    """The start stands left of cycle 0, in a strip of its own."""
    peak = max(one.init_heap or 0, one.loop_heap or 0)
    scale, unit = (1024, "KiB") if peak >= 4096 else (1, "B")
    strip = one.cycles * 0.06
    axes.fill_between([-strip, 0], [(one.init_heap or 0) / scale] * 2, step="post", color="C1", alpha=0.85, linewidth=0,
                      label="initialisation, most")
    cycles = [cycle for cycle, _ in one.heap] + [one.cycles]
    heap = [bytes_ / scale for _, bytes_ in one.heap]
    axes.fill_between(cycles, heap + heap[-1:], step="post", color="C0", alpha=0.85, linewidth=0, label="loop")
    axes.set(xlim=(-strip, one.cycles), ylim=(0, 1.15 * peak / scale or 1), xlabel="cycle", ylabel=f"heap [{unit}]")
    axes.legend(loc="upper right", ncols=2)


def _instructions(found: Sequence[Profile], axes: Any) -> None:
    for one in found:
        cycles = [100 * cycle / one.cycles for cycle, _ in one.instructions] + [100]
        counts = [count for _, count in one.instructions]
        axes.step(cycles, counts + counts[-1:], where="post", label=one.target)
    axes.set(xlabel="share of the loop [%]", ylabel="instructions", yscale="log", xlim=(0, 100))
    low, high = axes.get_ylim()
    axes.set_ylim(low / 2, high * 3)
    axes.legend(loc="upper right", ncols=len(found))


def _code(found: Sequence[Profile], axes: Any) -> None:
    left = [0.0] * len(found)
    names = [one.target for one in found]
    for part in _parts(found):
        if part == LIBRARY:
            continue
        sizes = [one.code.get(part, 0) / 1024 for one in found]
        axes.barh(names, sizes, left=left, label=part, height=0.6)
        left = [a + b for a, b in zip(left, sizes)]
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.set(xlabel="code and constants [KiB]")
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=4)
