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


def table(profiles: Sequence[Profile]) -> list[tuple[str, ...]]:
    """Rows of the table for the terminal."""
    rows: list[tuple[str, ...]] = [("", *(profile.target for profile in profiles))]
    for title, lines in GROUPS:
        rows += [(title, *("" for _ in profiles)),
                 *((f"  {name.strip()}", *(value(profile) for profile in profiles)) for name, value in lines)]
    if parts := _parts(profiles):
        rows += [("Code", *("" for _ in profiles)),
                 *((f"  {name}", *(_bytes(profile.code.get(name)) for profile in profiles)) for name in parts)]
    return rows


def _parts(profiles: Sequence[Profile]) -> list[str]:
    return [name for name in NAMES if any(name in profile.code for profile in profiles)]


# --- the page --------------------------------------------------------------------------------------

def page(mission: str, scenario: str, duration: float | None, profiles: Sequence[Profile]) -> str:
    """The page as text."""
    from fledge import __version__
    from fledge.report.run import templates

    groups = [(title, [(name.strip(), [value(profile) for profile in profiles]) for name, value in lines])
              for title, lines in GROUPS]
    if parts := _parts(profiles):
        groups.append(("Code and constants by part", [
            (name, [_bytes(profile.code.get(name)) for profile in profiles]) for name in parts]))
    return templates().get_template("profile.html").render(
        mission=mission, scenario=scenario, duration=duration, profiles=profiles, groups=groups, version=__version__,
        made=datetime.now(timezone.utc),
        problems=[(profile.target, text) for profile in profiles for text in profile.problems()],
        figures=[(title, note, b64encode(png).decode()) for title, note, png in _figures(profiles)],
        heapless=[profile.target for profile in profiles if profile.init_heap == 0 and profile.loop_heap == 0],
        short=[profile.target for profile in profiles if not profile.heap],
        functions=[profile for profile in profiles if profile.functions])


def _figures(profiles: Sequence[Profile]) -> list[tuple[str, str, bytes]]:
    """(title, note, PNG) of each plot."""
    plots = []
    for profile in profiles:
        if profile.heap and (profile.init_heap or profile.loop_heap):
            note = f"At most {_bytes(profile.init_heap)} in initialisation, {_bytes(profile.loop_heap)} in the loop."
            plots.append((f"Heap over time, {profile.target}", note, _png(partial(_heap, profile))))
    counted = [profile for profile in profiles if profile.instructions]
    if counted:
        plots.append(("Instructions per cycle", "The mean of the cycles between two marks; on a logarithmic scale, the "
                      "targets side by side.", _png(partial(_instructions, counted))))
    coded = [profile for profile in profiles if profile.code]
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


def _heap(profile: Profile, axes: Any) -> None:
    """The start stands left of cycle 0, in a strip of its own."""
    peak = max(profile.init_heap or 0, profile.loop_heap or 0)
    scale, unit = (1024, "KiB") if peak >= 4096 else (1, "B")
    strip = profile.cycles * 0.06
    axes.fill_between([-strip, 0], [(profile.init_heap or 0) / scale] * 2, step="post", color="C1", alpha=0.85,
                      linewidth=0,
                      label="initialisation, most")
    cycles = [cycle for cycle, _ in profile.heap] + [profile.cycles]
    heap = [bytes_ / scale for _, bytes_ in profile.heap]
    axes.fill_between(cycles, heap + heap[-1:], step="post", color="C0", alpha=0.85, linewidth=0, label="loop")
    axes.set(xlim=(-strip, profile.cycles), ylim=(0, 1.15 * peak / scale or 1), xlabel="cycle", ylabel=f"heap [{unit}]")
    axes.legend(loc="upper right", ncols=2)


def _instructions(profiles: Sequence[Profile], axes: Any) -> None:
    for profile in profiles:
        cycles = [100 * cycle / profile.cycles for cycle, _ in profile.instructions] + [100]
        counts = [count for _, count in profile.instructions]
        axes.step(cycles, counts + counts[-1:], where="post", label=profile.target)
    axes.set(xlabel="share of the loop [%]", ylabel="instructions", yscale="log", xlim=(0, 100))
    low, high = axes.get_ylim()
    axes.set_ylim(low / 2, high * 3)
    axes.legend(loc="upper right", ncols=len(profiles))


def _code(profiles: Sequence[Profile], axes: Any) -> None:
    left = [0.0] * len(profiles)
    names = [profile.target for profile in profiles]
    for part in _parts(profiles):
        if part == LIBRARY:
            continue
        sizes = [profile.code.get(part, 0) / 1024 for profile in profiles]
        axes.barh(names, sizes, left=left, label=part, height=0.6)
        left = [a + b for a, b in zip(left, sizes)]
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.set(xlabel="code and constants [KiB]")
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=4)
