# SPDX-License-Identifier: Apache-2.0
"""A run on one HTML page, as `fledge run --report` writes it: no other file, no script, no network.

    report = Report(sim, "spin", scenario)   # before the run: notes the parameters it begins with
    ...
    report.write(path, outcome)              # after it, whatever came of it
"""

import ast
import re
from datetime import datetime, timezone
from pathlib import Path

from fledge import objects
from fledge.errors import SetupError
from fledge._html import Html, join, number, tag, text, value
from fledge.mission.process import World
from fledge.mission.wiring import Wiring, action_text, condition_text, event_name

STYLE = Path(__file__).with_name("report.css")


class Outcome:
    """What came of a run: "passed", "failed", "interrupted", or "flown" where nothing was checked.

    message: what is wrong; record: the path of the archive; plots: the paths of the figures, or None if
    they were left out; command: what repeats the run
    """

    def __init__(self, verdict, message="", record=None, plots=(), command=""):
        self.verdict, self.message = verdict, message
        self.record, self.plots, self.command = record, plots, command


class Report:
    """The report of a simulation's run. Made before it.

    scenario: its name; function: what flies it, whose docstring says what it shows
    """

    def __init__(self, simulation, scenario, function=None):
        self._simulation, self.scenario = simulation, scenario
        self.about = _docstring(function.__doc__) if function is not None else []
        self._parameters = {objects.path(one): _parameters(one) for one in _instances(simulation)}
        self._begun = datetime.now(timezone.utc)
        self._modes = {p.name: p.active_mode for p in simulation.flights}

    def write(self, path, outcome):
        """Write the page; returns its path."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        from fledge.files import Part

        with Part(path) as part:
            part.write_text(self.page(outcome), encoding="utf-8")
        return path

    def page(self, outcome):
        """The page as text."""
        title = f"{self._simulation.name}, {self.scenario}"
        body = join([self._header(outcome), self._figures(outcome), self._wiring(), self._schedule(),
                     self._parameter_tables(), self._assumptions(), self._final_values(), self._provenance(outcome)])
        style = STYLE.read_text(encoding="utf-8") + _wiring_style()
        head = join([tag("meta", charset="utf-8"),
                     tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
                     tag("meta", name="color-scheme", content="light dark"),
                     tag("title", title), tag("style", Html(style))], "\n")
        page = tag("html", "\n", tag("head", head), "\n", tag("body", tag("main", body)), lang="en")
        return f"<!doctype html>\n{str(page)}\n"

    # --- sections ---

    def _header(self, outcome):
        sim = self._simulation
        facts = [("flown", _duration(sim.time)), ("seed", number(sim.seed)),
                 ("took", join([number(sim.wall, digits=3), "\N{NO-BREAK SPACE}s"])),
                 ("speed", f"{_thousands(sim.time / sim.wall)} times real time" if sim.wall > 0 else None),
                 ("record", f"{outcome.record.name}, {_size(outcome.record)}" if outcome.record else "none"),
                 ("begun", f"{self._begun:%Y-%m-%d %H:%M:%S} UTC")]
        facts = [tag("div", tag("dt", word), tag("dd", fact)) for word, fact in facts if fact is not None]
        about = [join([tag("dt", word), tag("dd", *paragraphs)]) for word, paragraphs in _documents(sim.mission)]
        message = _without_paths(outcome.message, sim.mission)
        return tag("header",
                   tag("p", sim.name, class_="mission"),
                   tag("h1", self.about[0] if self.about else self.scenario),
                   tag("p", tag("span", outcome.verdict, class_=f"verdict {outcome.verdict}"),
                       f"scenario {self.scenario}", class_="status"),
                   tag("pre", message, class_="message") if message else None,
                   *(tag("p", paragraph) for paragraph in self.about[1:]),
                   tag("dl", *about, class_="about") if about else None,
                   tag("dl", *facts, class_="facts"))

    def _figures(self, outcome):
        from base64 import b64encode

        if outcome.plots is None:
            return _section("Figures", tag("p", "The plots were left out of this run.", class_="empty"))
        pictures = [tag("figure", tag("img", alt=f"figure {plot.stem}",
                                      src=f"data:image/png;base64,{b64encode(plot.read_bytes()).decode()}"))
                    for plot in outcome.plots]
        return _section("Figures", *(pictures or [tag("p", "The scenario plotted nothing.", class_="empty")]))

    def _wiring(self):
        from fledge.wiring_picture import dot, render

        wiring = Wiring(self._simulation)
        try:
            picture = _inline_svg(render(dot(wiring, links=True), "svg"))
            return _section("Wiring", tag("div", picture, class_="wiring"))
        except SetupError as error:
            return _section("Wiring", tag("p", f"An outline only: {error}", class_="empty"),
                            tag("pre", wiring.outline(), class_="outline"))

    def _schedule(self):
        sim = self._simulation
        rows = []
        for process in _processes(sim):
            for name, period, offset, priority, run in process.tasks:
                rows.append([process.name, name, _duration(period / 1e9), _duration(offset / 1e9) if offset else "",
                             number(priority) if priority else "", join([tag("code", one) for one in run], ", "),
                             _updates(process, name, period, offset, sim.time_ns)])
        parts = [_table(["process", "task", "every", "from", "priority", "runs in this order", "#updates"], rows)]
        rows = []
        for process in _processes(sim):
            for name, tasks in process.modes:
                began = process.name in self._modes and name == self._modes[process.name]
                ended = process.name in self._modes and name == process.active_mode
                when = ["began in it"] * began + ["ended in it"] * ended
                rows.append([process.name, name, ", ".join(tasks), ", ".join(when)])
        if rows:
            parts += [tag("h3", "Modes"), _table(["process", "mode", "tasks", ""], rows)]
        rows = []
        for process in _processes(sim):
            for event in process.events.values():
                fired = "never" if event.fired_at is None else join(["t = ", _duration(event.fired_at)])
                rows.append([process.name, event_name(event), tag("code", condition_text(event)),
                             _duration(event.hold / 1e9) if event.hold else "", action_text(event),
                             "once" if event.once else "each time", fired])
        if rows:
            titles = ["process", "event", "when", "held for", "does", "", "happened last"]
            parts += [tag("h3", "Events"), _table(titles, rows)]
        return _section("Tasks", *parts)

    def _parameter_tables(self):
        parts = [tag("p", "As the run began. ", tag("span", "Grey", class_="default"),
                     " is what was left at its default.", class_="note")]
        for process in _processes(self._simulation):
            for one in process:
                struct = objects.struct(one)
                before = self._parameters[objects.path(one)]
                after = {row.name: row.value for row in _parameters(one) if not row.derived}
                rows = [row.cells(after.get(row.name, row.value)) for row in before]
                parts.append(tag("h3", tag("code", objects.path(one)), " ", tag("span", struct.name, class_="type"),
                                 id=objects.path(one)))
                parts.append(tag("p", " ".join(struct.doc.split()), class_="doc"))
                if rows:
                    parts.append(_values("parameter", "value", rows, [row.given for row in before]))
        return _section("Parameters", *parts)

    def _assumptions(self):
        lines = self._simulation.assumptions
        if not lines:
            return _section("Assumptions",
                            tag("p", "No parameter that matters was left at its default.", class_="empty"))
        return _section("Assumptions", tag("ul", *(tag("li", line) for line in lines)))

    def _final_values(self):
        parts = []
        seen = set()
        for log in self._simulation.records:
            if log.path in seen or not len(log):
                continue
            seen.add(log.path)
            head, rows = _message(log)
            every = ["every ", _duration(log.every / 1e9)] if log.every else ["at every instant"]
            parts.append(tag("h3", tag("code", log.path), " ", tag("span", log.struct.name, class_="type")))
            parts.append(tag("p", f"{len(log):,} samples, ", *every, "; the last was written at ",
                             _duration(head.t / 1e9), f", quality {head.quality}", class_="doc"))
            parts.append(_values("field", "last value", rows))
        return _section("Final values of what was recorded",
                        *(parts or [tag("p", "Nothing was recorded.", class_="empty")]))

    def _provenance(self, outcome):
        import platform
        import sys

        from fledge import __version__

        ours = _revision(Path(__file__).parent)
        theirs = _revision(self._simulation.mission.folder) if self._simulation.mission else ""
        rows = [("Fledge", __version__ + (f", {ours}" if ours else ""))]
        if theirs != ours and theirs:
            rows.append(("mission", theirs))
        if build := _build():
            rows.append(("built by", build))
        rows.append(("Python", platform.python_version()))
        rows += [(name, sys.modules[name].__version__) for name in ("numpy", "matplotlib") if name in sys.modules]
        rows.append(("system", f"{_system()}, {platform.machine()}"))
        rows.append(("seed", str(self._simulation.seed)))
        if outcome.command:
            rows.append(("to repeat it", tag("code", outcome.command)))
        return _section("Versions", tag("dl", *(join([tag("dt", a), tag("dd", b)]) for a, b in rows), class_="about"),
                        tag("p", "The times on this page are the wall clock's. The record has none, so that the same "
                            "run gives the same record, bit for bit.", class_="note"))


# --- parameters ------------------------------------------------------------------------------------

class _Parameter:
    """A row of a table of parameters. derived: a property that Python adds, as text."""

    def __init__(self, name, value, unit="", meaning="", rule="", given=True, derived=False):
        self.name, self.value, self.unit = name, value, unit if unit != "-" else ""
        self.meaning, self.rule, self.given, self.derived = meaning, rule, given, derived

    def cells(self, after, digits=7):
        shown = [value(self.value, digits)]
        if (aside := _in_degrees(self.value, self.unit)) is not None:
            unit = self.unit.replace("rad", "deg")
            shown += [" ", tag("small", "= ", value(aside, digits), f" {unit}", class_="aside")]
        if repr(after) != repr(self.value):  # not a number equals itself
            shown.append(tag("div", "at the end ", value(after, digits), class_="changed"))
        return [tag("code", self.name), join(shown), _unit(self.unit),
                join([self.meaning, " ", tag("small", self.rule.replace(">=", "\N{GREATER-THAN OR EQUAL TO}")
                                             .replace("<=", "\N{LESS-THAN OR EQUAL TO}"), class_="rule")])]


def _parameters(instance):
    """The parameters of a module or model, those that Python adds last."""
    struct = objects.struct(instance)
    given = set(objects.given(instance))
    counts = {f.count for f in struct.fields if f.count}
    rows = []
    for field in struct.fields:
        if field.group == "par" and not field.spare and not (field.name in counts and field.name not in given):
            rows += _rows(instance, field, field.name, field.name in given)
    for name, one in vars(type(instance)).items():
        if isinstance(one, property):
            shown = _property(instance, name)
            meaning = (one.__doc__ or "").partition(";")[0].rstrip(".")  # what follows is about assigning it
            rows.append(_Parameter(name, shown, meaning=meaning, given=bool(shown), derived=True))
    return rows


def _property(instance, name):
    """What Python adds to a model, in words: its parts, the bodies that attract it, its orbit. "" for nothing."""
    try:
        found = getattr(instance, name)
    except (SetupError, AttributeError):
        return ""

    def words(one):
        if isinstance(one, objects.Model):
            return objects.path(one)
        return one if isinstance(one, str) else repr(one).strip("<>")

    if isinstance(found, (list, tuple)):
        return "; ".join(map(words, found))
    return "" if found is None else words(found)


def _rows(owner, field, name, given):
    found = getattr(owner, field.name)
    if field.type != "struct":
        return [_Parameter(name, _plain(found), field.unit, field.doc, field.rule, given)]
    if isinstance(found, tuple):
        return [row for i, one in enumerate(found) for row in _members(one, f"{name}[{i}]", given)]
    return _members(found, name, given)


def _members(message, name, given):
    return [row for field in objects.struct(message).fields if not field.spare
            for row in _rows(message, field, f"{name}.{field.name}", given)]


def _plain(found):
    """A field's value as numbers, text and lists."""
    if hasattr(found, "tolist"):
        return found.tolist()
    return found.name if hasattr(found, "name") else found


def _in_degrees(found, unit):
    """The same angle or rate in degrees, or None for what is no such thing, or 0."""
    from math import degrees

    def convert(x):
        return [convert(one) for one in x] if isinstance(x, list) else float(f"{degrees(x):.12g}")

    def empty(x):
        return all(map(empty, x)) if isinstance(x, list) else x == 0

    if not re.fullmatch(r"rad(/s)?", unit) or empty(found):
        return None
    return convert(found)


def _unit(unit):
    """A unit with its exponents raised."""
    if unit in ("", "-"):
        return Html("")
    return join([tag("sup", part[1:].replace("-", "\N{MINUS SIGN}")) if part.startswith("^") else part
                 for part in re.split(r"(\^-?\d+)", unit)])


# --- messages --------------------------------------------------------------------------------------

class _Head:
    def __init__(self, t, quality):
        self.t, self.quality = t, quality


def _message(log):
    """(head, rows) of the last sample of a record."""
    import numpy as np

    from fledge.mission.log import dtype_of, leaves

    sample = np.frombuffer(log.last(), dtype_of(log.struct))[0]

    def read(name):
        found = sample
        for part in name.split("."):
            found = found[part]
        return found.decode(errors="replace") if isinstance(found, bytes) else found.tolist()

    rows = []
    for name, field in leaves(log.struct):
        if not name.startswith("head."):
            rows.append(_Parameter(name, read(name), field.unit, field.doc))
    quality = ("none", "stale", "degraded", "good")
    level = read("head.quality")
    head = _Head(read("head.t"), quality[level] if 0 <= level < len(quality) else level)
    return head, [row.cells(row.value, digits=5) for row in rows]


# --- words -----------------------------------------------------------------------------------------

def _section(title, *children):
    return tag("section", tag("h2", title), *children)


def _table(titles, rows):
    """A table, without the columns that are empty. A title that begins with # is of numbers."""
    used = [i for i, title in enumerate(titles) if any(row[i] for row in rows)]
    kinds = ["number" if titles[i].startswith("#") else None for i in used]
    head = tag("tr", *(tag("th", titles[i].lstrip("#"), class_=kind) for i, kind in zip(used, kinds)))
    lines = [tag("tr", *(tag("td", row[i], class_=kind) for i, kind in zip(used, kinds))) for row in rows]
    return tag("div", tag("table", tag("thead", head), tag("tbody", *lines)), class_="scroll")


def _values(name, value, rows, given=()):
    """A table of values: all such have columns of the same widths. given: of each, whether it is no default."""
    head = tag("tr", *(tag("th", title) for title in (name, value, "unit", "meaning")))
    lines = [tag("tr", *(tag("td", cell) for cell in row), class_=None if not given or given[i] else "default")
             for i, row in enumerate(rows)]
    return tag("div", tag("table", tag("thead", head), tag("tbody", *lines), class_="values"), class_="scroll")


def _processes(simulation):
    """Its processes as a reader wants them: flight first."""
    return sorted(simulation.processes, key=lambda process: isinstance(process, World))


def _instances(simulation):
    return [one for process in _processes(simulation) for one in process]


def _duration(seconds):
    """ "160 min", "2.5 h" beside the plain seconds where those are many."""
    plain = join([number(seconds, digits=9), "\N{NO-BREAK SPACE}s"])
    for name, factor in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * factor:
            return join([plain, tag("small", f" = {seconds / factor:.4g} {name}", class_="aside")])
    return plain


def _thousands(x):
    return f"{x:,.0f}" if x >= 10 else f"{x:.3g}"


def _size(path):
    size = path.stat().st_size
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"


def _updates(process, task, period, offset, now):
    """How often a task ran until now [ns]; "" for one that modes start and stop."""
    if any(task in tasks for _, tasks in process.modes):
        return ""
    return f"{(now - offset) // period + 1:,}" if now >= offset else "0"


def _docstring(doc):
    """The paragraphs of a docstring, each on one line."""
    import inspect

    return [" ".join(p.split()) for p in re.split(r"\n\s*\n", inspect.cleandoc(doc or "")) if p.strip()]


def _documents(mission):
    """(what it is about, its paragraphs) of the mission's files, from their docstrings."""
    found = []
    for file, word in (("flight.py", "what flies"), ("world.py", "the world"), ("scenarios.py", "scenarios")):
        path = mission.folder / file if mission else None
        if path and path.exists():
            paragraphs = _docstring(ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))))
            if paragraphs:
                paragraphs[0] = re.sub(r"^(What flies|The truth|The world): *(.)",
                                       lambda m: m[2].upper(), paragraphs[0])
                found.append((word, [tag("p", p) for p in paragraphs]))
    return found


def _without_paths(message, mission):
    """A message without the folders of this machine."""
    for folder, shown in ((mission.folder if mission else None, mission.name if mission else ""), (Path.cwd(), "."),
                          (Path.home(), "~")):
        if folder is not None and len(str(folder)) > 1:
            message = message.replace(str(folder), shown)
    return message


def _inline_svg(picture):
    """graphviz' SVG as an element of the page: without prolog, comments, and sizes, which CSS gives."""
    svg = picture.decode()
    svg = re.sub(r"<!--.*?-->", "", svg[svg.index("<svg"):], flags=re.DOTALL)
    width = re.match(r'<svg width="(\d+)pt"', svg)[1]
    svg = re.sub(r'<svg width="\d+pt" height="\d+pt"', f'<svg style="max-width: {1.25 * int(width):.0f}px"', svg)
    svg = re.sub(r' xmlns(:xlink)?="[^"]*"', "", svg)
    return Html(re.sub(r"\n\s*\n*", "\n", svg))


def _wiring_style():
    """CSS that gives each colour of the wiring the variable that has its counterparts."""
    from fledge import wiring_picture as picture

    variables = {picture.INK: "ink", picture.SOFT: "soft", picture.PALE: "pale", picture.PAPER: "ground",
                 picture.ACCENT: "accent"}
    for process, shades in picture.SHADES.items():
        variables.update(zip(shades, (process, f"{process}-ground", f"{process}-box")))
    return "".join(f'.wiring [{what}="{colour}"] {{ {what}: var(--{name}); }}\n'
                   for colour, name in variables.items() for what in ("fill", "stroke"))


# --- where it comes from ---------------------------------------------------------------------------

def _revision(folder):
    """The revision of the git repository that a folder is in, or ""."""
    import subprocess

    try:
        done = subprocess.run(["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=12"],
                              capture_output=True, text=True)
    except FileNotFoundError:
        return ""
    return f"revision {done.stdout.strip()}" if done.returncode == 0 else ""


def _build():
    """The compiler and its options, or "" where the build did not note them."""
    try:
        import _core_build
    except ImportError:
        return ""
    return " ".join(_core_build.TEXT.split())


def _system():
    import platform

    try:
        return platform.freedesktop_os_release().get("PRETTY_NAME", platform.system())
    except OSError:
        return platform.system()
