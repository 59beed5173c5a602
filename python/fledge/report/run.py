# SPDX-License-Identifier: Apache-2.0
"""The facts of a run, for the template of its page."""
from __future__ import annotations

import ast
import inspect
import math
import platform
import re
import sys
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from fledge import __version__, objects, scene
from fledge.errors import SetupError
from fledge.disk import Part
from fledge.folders import source
from fledge.mission.log import dtype_of, leaves
from fledge.mission.provenance import Revisions, added, in_words, members, plain
from fledge.mission.simulation import Simulation
from fledge.mission.wiring import Wiring, action_text, event_name
from fledge.plot.wiring import NAMES, dot, render
from fledge.records.activity import happenings
from fledge.report.numbers import duration, number, unit, value
from fledge.scene import bundle, page

HAPPENINGS = 200    # in the table of a page
QUALITIES = ("none", "stale", "degraded", "good")


@dataclass
class Outcome:
    """What came of a run: "passed", "failed", "interrupted", or "flown" where nothing was checked."""
    verdict: str
    message: str = ""                       # what is wrong
    record: Path | None = None              # the archive
    plots: Sequence[Path] | None = ()       # the figures; None: they were left out
    command: str = ""                       # it repeats the run


class Report:
    """The report of a simulation's run. Made before it.

    scenario: its name; function: it flies the scenario, and its docstring is the purpose
    """

    def __init__(self, simulation: Simulation, scenario: str, function: Callable | None = None):
        self._simulation, self._scenario = simulation, scenario
        self._about = _paragraphs(function.__doc__ if function else "")
        self._begun = datetime.now(timezone.utc)
        wiring = Wiring(simulation)
        self._modes = {process.name: process.mode for process in wiring.processes}
        self._before = {path: _parameters(node.instance) for path, node in wiring.nodes.items()}

    def write(self, path: Path | str, outcome: Outcome) -> Path:
        """Write the page; returns its path."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with Part(path) as part:
            part.write_text(self.page(outcome), encoding="utf-8")
        return path

    def page(self, outcome: Outcome) -> str:
        """The page as text."""
        sim = self._simulation
        wiring, logs = Wiring(sim), [log for log in sim.records if len(log)]
        first = {log.path: log for log in reversed(logs)}
        try:
            svg, no_svg = _inline_svg(render(dot(wiring, links=True), "svg")), ""
        except SetupError as error:
            svg, no_svg = None, str(error)
        view, not_shown = self._view()
        return templates().get_template("run.html").render(
            sim=sim, scenario=self._scenario, about=self._about, begun=self._begun, outcome=outcome,
            message=_without_paths(outcome.message, sim.mission), documents=_documents(sim.mission),
            pictures=[(plot.stem, b64encode(plot.read_bytes()).decode()) for plot in outcome.plots or ()],
            view=view, not_shown=not_shown, wiring=wiring, svg=svg, no_svg=no_svg, colours=NAMES,
            schedule=[(title, *_used(titles, rows)) for title, titles, rows in self._schedule(wiring)],
            parameters=[(path, objects.struct(node.instance), self._changes(path, node.instance))
                        for path, node in wiring.nodes.items()],
            finals=[_final(log) for log in logs if first[log.path] is log],
            versions=versions(sim.mission))

    def _view(self) -> tuple[Markup, str]:
        """The flight in 3-D with its plots, and what of them is not shown, and why."""
        if not any(len(log) for log in self._simulation.records):
            return Markup(), "Nothing was recorded"
        if not bundle.is_built():
            return Markup(), bundle.ADVICE
        try:
            shown, missing = scene.of(self._simulation), ""
        except SetupError as error:
            shown = scene.of(self._simulation, plots_only=True)
            missing = f"There is no 3-D view: {str(error).removeprefix('the log: ')}"
        return Markup(page.fragment(shown)), missing

    def _schedule(self, wiring: Wiring) -> Iterator[tuple[str, list[str], list]]:
        """(heading, titles, rows) of the tables of tasks, modes and events."""
        yield "", ["process", "task", "every", "from", "priority", "runs in this order", "#updates"], [
            [process.name, task.name, duration(task.period / 1e9), task.offset and duration(task.offset / 1e9),
             task.priority, Markup(", ").join(map(Markup("<code>{}</code>").format, task.run)),
             _updates(process, task, self._simulation.time_ns)]
            for process in wiring.processes for task in process.tasks]
        yield "Modes", ["process", "mode", "tasks", "began", "when"], [
            [process.name, name, tasks, _began(*self._simulation.process(process.name).entered[name]),
             ", ".join((["began in it"] if name == self._modes[process.name] else [])
                       + (["ended in it"] if name == process.mode else []))]
            for process in wiring.processes for name, tasks in process.modes]
        yield "Events", ["process", "event", "when", "held for", "does", "repeats", "fired", "happened last"], [
            [process.name, event_name(event),
             Markup("<code>{}</code>").format(event.text) + (
                 f" in {' or '.join(event.modes)}" if event.modes else ""),
             " and ".join(([duration(event.hold / 1e9)] if event.hold else [])
                          + ([f"{event.count} instants"] if event.count > 1 else [])), action_text(event),
             "once" if event.once else f"after {event.until!r}" if event.until is not None else "each time",
             f"{event.fired[0]} times" if event.fired[0] != 1 else "once",
             "never" if event.fired_at is None else Markup("t = {}").format(duration(event.fired_at))]
            for process in wiring.processes for event in process.handles]
        happened = happenings(self._simulation.activity)
        yield "What happened" + (f", the first {HAPPENINGS}" if len(happened) > HAPPENINGS else ""), [
            "#t", "process", "what", "name", "why"], [
            [f"{event.t:g} s", event.process, event.kind, event.name, event.text] for event in happened[:HAPPENINGS]]

    def _changes(self, path: str, instance: objects.Module | objects.Model) -> list[_Value]:
        """The parameters as the run began, each with its value now."""
        now = {row.name: row.value for row in _parameters(instance) if not row.derived}
        for row in self._before[path]:
            row.after = now.get(row.name, row.value)
        return self._before[path]


def templates() -> jinja2.Environment:
    """The templates with their filters. They escape text, and replace control characters, which HTML cannot hold."""
    def printable(item: object) -> object:
        return item if isinstance(item, Markup) else "" if item is None else re.sub(
            r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]", "\N{REPLACEMENT CHARACTER}", str(item))

    item = jinja2.Environment(loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")), autoescape=True,
                              finalize=printable, undefined=jinja2.StrictUndefined)
    item.filters.update(number=number, value=value, unit=unit, duration=duration)
    return item


# --- values ----------------------------------------------------------------------------------------

@dataclass
class _Value:
    """A row of a table of parameters or fields."""
    name: str
    value: str | float | list
    unit: str = ""
    meaning: str = ""
    rule: str = ""
    given: bool = True
    derived: bool = False                       # a property that Python adds, as text
    after: str | float | list | None = None     # at the end of the run

    @property
    def changed(self) -> bool:
        return self.after is not None and repr(self.after) != repr(self.value)  # not a number equals itself

    @property
    def degrees(self) -> float | list | None:
        """The same angle or rate in degrees; None of other values, and of 0."""
        def convert(x: Any) -> Any:
            return list(map(convert, x)) if isinstance(x, list) else float(f"{math.degrees(x):.12g}")

        def empty(x: Any) -> bool:
            return all(map(empty, x)) if isinstance(x, list) else x == 0

        return convert(self.value) if re.fullmatch(r"rad(/s)?", self.unit) and not empty(self.value) else None


def _parameters(instance: objects.Module | objects.Model) -> list[_Value]:
    """The parameters of a module or model, those that Python adds last."""
    struct, given = objects.struct(instance), set(objects.given(instance))
    counts = {f.count for f in struct.fields if f.count} - given
    rows = [row for field in struct.fields if field.group == "par" and not field.spare and field.name not in counts
            for row in _rows(instance, field, field.name in given)]
    for name, added_property in added(instance):
        shown = in_words(instance, name)
        meaning = (added_property.__doc__ or "").partition(";")[0].rstrip(".")  # what follows is about assigning it
        rows.append(_Value(name, shown, meaning=meaning, given=bool(shown), derived=True))
    return rows


def _rows(owner: Any, field: Any, given: bool) -> list[_Value]:
    return [_Value(name, plain(inner, leaf), leaf.unit, leaf.doc, leaf.rule, given)
            for name, inner, leaf in members(owner, field)]


def _final(log: Any) -> tuple:
    """(log, time [ns], quality, rows) of its last sample; no rows if its message was never written."""
    import numpy as np

    sample = np.frombuffer(log.last(), dtype_of(log.struct))[0]

    def read(name: str) -> Any:
        value = sample
        for part in name.split("."):
            value = value[part]
        return value.decode(errors="replace") if isinstance(value, bytes) else value.tolist()

    quality = dict(enumerate(QUALITIES)).get(read("head.quality"), read("head.quality"))
    return log, read("head.t"), quality, [_Value(name, read(name), field.unit, field.doc)
                                          for name, field, _ in leaves(log.struct)
                                          if quality != QUALITIES[0] and not name.startswith("head.")]


# --- words -----------------------------------------------------------------------------------------

def _used(titles: list[str], rows: list[list]) -> tuple[list[str], list[list]]:
    """A table without its empty columns."""
    used = [i for i in range(len(titles)) if any(row[i] for row in rows)]
    return [titles[i] for i in used], [[row[i] or "" for i in used] for row in rows]


def _began(times: int, first: float | None) -> str:
    """How often a mode began, and when first."""
    return "never" if first is None else f"t = {first:g} s" + (f", {times} times" if times > 1 else "")


def _updates(process: Any, task: Any, now: int) -> str:
    """How often a task ran until now [ns]; "" for one that modes start and stop."""
    if any(task.name in tasks.partition(";")[0].split(", ") for _, tasks in process.modes):
        return ""
    return f"{(now - task.offset) // task.period + 1:,}" if now >= task.offset else "0"


def _paragraphs(doc: str | None) -> list[str]:
    """The paragraphs of a docstring, each on one line."""
    return [" ".join(p.split()) for p in re.split(r"\n\s*\n", inspect.cleandoc(doc or "")) if p.strip()]


def _documents(mission: Any) -> list[tuple[str, list[str]]]:
    """(subject, paragraphs) of the mission's files, from their docstrings."""
    documents = []
    for file, word in (("mission.py", "the processes"), ("flight.py", "what flies"), ("world.py", "the world"),
                       ("scenarios.py", "scenarios")):
        path = mission.folder / file if mission else None
        if path and path.exists():
            doc = ast.get_docstring(ast.parse(source(path))) or ""
            doc = re.sub(r"^(What flies|The truth|The world): *(.)", lambda m: m[2].upper(), doc)
            documents.append((word, _paragraphs(doc)))
    return [(word, paragraphs) for word, paragraphs in documents if paragraphs]


def _without_paths(message: str, mission: Any) -> str:
    """A message without the folders of this machine."""
    folders = {mission.folder: mission.name} if mission else {}
    for folder, shown in {**folders, Path.cwd(): ".", Path.home(): "~"}.items():
        if len(str(folder)) > 1:
            message = message.replace(str(folder), shown)
    return message


def _inline_svg(picture: bytes) -> Markup:
    """graphviz' SVG as an element of the page: without prolog, comments, and sizes, which CSS gives."""
    svg = picture.decode()
    svg = re.sub(r"<!--.*?-->", "", svg[svg.index("<svg"):], flags=re.DOTALL)
    svg = re.sub(r'<svg width="(\d+)pt" height="\d+pt"',
                 lambda match: f'<svg style="max-width: {1.25 * int(match[1]):.0f}px"', svg)
    return Markup(re.sub(r"\n\s*\n*", "\n", re.sub(r' xmlns(:xlink)?="[^"]*"', "", svg)))


# --- where it comes from ---------------------------------------------------------------------------

def versions(mission: Any) -> list[tuple[str, str]]:
    """(what, its version) of all that a run is made by."""
    revisions = Revisions(mission.folder if mission else None).read()
    try:
        import _core_build  # the compiler and its options

        build = " ".join(_core_build.TEXT.split())
    except ImportError:
        build = ""
    try:
        system = platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        system = platform.system()
    ours, theirs = (f"revision {revisions[name]}" if name in revisions else "" for name in ("fledge", "mission"))
    versions_ = {"Fledge": ", ".join(filter(None, [__version__, ours])), "mission": theirs if theirs != ours else "",
                 "built by": build, "Python": platform.python_version(),
                 **{name: sys.modules[name].__version__ for name in ("numpy", "matplotlib") if name in sys.modules},
                 "system": f"{system}, {platform.machine()}"}
    return [(name, version) for name, version in versions_.items() if version]
