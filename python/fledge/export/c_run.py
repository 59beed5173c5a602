# SPDX-License-Identifier: Apache-2.0
"""The functions of an exported mission that run it: tasks with their wires, modes, events, the tick.

The rules of time are those of flight/exec, as on the desktop (sim/runtime.cpp).
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from fledge.export.c_condition import assignments, condition, statement
from fledge.export.c_text import COLUMNS, doc, seconds, with_notes
from fledge.export.c_values import integer

if TYPE_CHECKING:
    from fledge.export.read import Mission, Task, Wire


def rate(task: Task) -> str:
    """The name of a task's rate."""
    return f"{task.name}_rate"


def rates(mission: Mission) -> Iterator[str]:
    rows = [(f"static const ExecRate {rate(t)} = {{{t.period}, {t.offset}}};",
             f"every {seconds(t.period)}" + (f", from {seconds(t.offset)} on" if t.offset else ""))
            for t in mission.tasks]
    yield "\n".join([*with_notes(rows, ""), ""])


def function(head: str, lines: list[str], about: str = "") -> str:
    return "\n".join([*(doc(about) if about else []), head, "{", *lines, "}", ""])


def carry(mission: Mission, wires: list[Wire]) -> list[str]:
    """The copies of messages, the choice of those that go to one input, and their ageing."""
    lines: list[str] = []
    begun: set[str] = set()
    for wire in wires:
        copy, by = f"m->{wire.target} = m->{wire.source};", wire.choice.partition(" ")
        if by[0] == "in":
            name = next(c for c, title in mission.mode_titles.items() if title == by[2])
            lines += [f"    if ({in_modes(mission, [name])}) {{", f"        {copy}", "    }"]
        elif wire.target in begun:
            lines += [f"    if (exec_takes(EXEC_{by[0].upper()}, m->{wire.target}.head, m->{wire.source}.head, t.t, "
                      f"{wire.stale_after})) {{", f"        {copy}", "    }"]
        else:
            lines.append(f"    {copy}")
        begun.add(wire.target)
        if wire.stale_after:
            lines.append(f"    exec_age(&m->{wire.target}.head, t.t, {wire.stale_after}); "
                         f"/* {seconds(wire.stale_after)} */")
    return lines


# --- modules that only publish their parameters ----------------------------------------------------

def configuration(mission: Mission) -> Iterator[str]:
    for module in mission.configuration:
        lines = [f"    {module.function}_update(&m->{module.name}, (Tick){{t, 0}});"]
        lines += carry(mission, mission.published[module.name])
        yield function(f"void {mission.name}_publish_{module.name}({mission.struct()} *m, int64_t t)", lines)


# --- tasks -----------------------------------------------------------------------------------------

def tasks(mission: Mission) -> Iterator[str]:
    struct = mission.struct()
    for i, task in enumerate(mission.tasks):
        lines: list[str] = []
        for module in task.run:
            lines += [""] if lines else []
            lines += carry(mission, mission.wires[module.name])
            lines.append(f"    {module.function}_update(&m->{module.name}, t);")
        where = f", in {', '.join(mission.mode_titles[m] for m in task.modes)}" if task.modes is not None else ""
        about = f"The task {task.title}, every {seconds(task.period)}{where}."
        if mission.form == "rtems":     # in a thread of its own
            yield function(f"static void thread_{task.name}(void *mission, Tick t)",
                           [f"    {struct} *m = mission;", *lines], about)
            lines, about = [f"    mission_run_task({i}u, thread_{task.name}, m, t);"], ""
        yield function(f"static void run_{task.name}({struct} *m, Tick t)", lines, about)


def restart(mission: Mission) -> str:
    """Wires to zero, modules, events and tasks to their beginning, and the configuration published."""
    lines = ["    memset(&m->in, 0, sizeof m->in);"] if mission.inputs else []
    wired = {w.target for wires in (*mission.wires.values(), *mission.published.values()) for w in wires}
    for module in mission.modules:
        ports = [f"{module.name}.in.{f.name}" for f in module.fields("in")]
        linked = {f"{module.name}.in.{f.name}" for f in module.fields("in")
                  if any(module.memory[f.offset:f.offset + f.size])}
        if wired & set(ports) and linked <= wired:
            lines.append(f"    memset(&m->{module.name}.in, 0, sizeof m->{module.name}.in);")
        else:
            lines += [f"    memset(&m->{p}, 0, sizeof m->{p});" for p in ports if p in wired]
    lines += ["", *(f"    {m.function}_reset(&m->{m.name});" for m in mission.modules), ""]
    if mission.modes:
        lines += [f"    m->mode.current = {mode(mission, mission.initial_mode)};",
                  "    m->mode.requested = m->mode.current;", "    m->mode.t = -1;"]
    for event in mission.events:
        lines.append(f"    m->event.{event.name} = exec_{'armed' if event.armed else 'disarmed'}();")
    for task in mission.tasks:
        active = 1 if task.modes is None else int(mission.initial_mode in task.modes)
        lines.append(f"    m->task.{task.name} = exec_start({rate(task)}, {active}, t);")
    if mission.configuration:
        lines += ["", *(f"    {mission.name}_publish_{m.name}(m, t);" for m in mission.configuration)]
    return function(f"void {mission.name}_restart({mission.struct()} *m, int64_t t)", lines)


def reset(mission: Mission) -> str:
    return function(f"void {mission.name}_reset({mission.struct()} *m)", [f"    {mission.name}_restart(m, 0);"])


# --- modes -----------------------------------------------------------------------------------------

def mode(mission: Mission, name: str | None) -> str:
    return f"{mission.name.upper()}_MODE_{str(name).upper()}"


def switched(mission: Mission) -> list[Task]:
    """The tasks that do not run in every mode."""
    return [t for t in mission.tasks if t.modes is not None and len(t.modes) < len(mission.modes)]


def modes(mission: Mission) -> Iterator[str]:
    """Which tasks run in which mode, entering one, and asking for one."""
    if not mission.modes:
        return
    struct = mission.struct()
    for task in switched(mission):
        terms = [f"mode == {mode(mission, m)}" for m in task.modes or ()]
        yield function(f"static int runs_{task.name}({struct}Mode mode)",
                       ["    return " + " ||\n           ".join(terms) + ";"])
    lines = ["    m->mode.current = m->mode.requested;"]
    for task in switched(mission):
        lines += [f"    if (exec_switch(&m->task.{task.name}, runs_{task.name}(m->mode.current), {rate(task)}, "
                  "t)) {",
                  *(f"        {m.function}_reset(&m->{m.name});" for m in task.run), "    }"]
    lines = [piece for line in lines for piece in call_broken(line)]
    if switched(mission):
        yield function(f"static void enter_mode({struct} *m, int64_t t)", lines,
                       "What becomes active is reset, and runs on its own grid of times.")
    yield function(f"void {mission.name}_enter({struct} *m, {struct}Mode mode)", ["    m->mode.requested = mode;"])
    yield from guards(mission)


def in_modes(mission: Mission, names: list[str]) -> str:
    """Whether one of these modes is in force."""
    return " || ".join(f"m->mode.current == {mode(mission, name)}" for name in names)


def guards(mission: Mission) -> Iterator[str]:
    """Whether a mode may be entered."""
    modules = {m.path: m for m in mission.modules}
    for name, guard in mission.guards.items():
        lines = statement("after", in_modes(mission, guard.after)) if guard.after else []
        lines += condition("holds", guard.condition, modules, "after" if lines else "") if guard.condition else []
        yield function(f"static int may_enter_{name}(const {mission.struct()} *m)",
                       [*lines, f"    return {'holds' if guard.condition else 'after'};"],
                       f"{mission.mode_titles[name]} is entered only {guard.text}")
    if mission.guards:
        lines = [line for name in mission.guards for line in (
            f"    if (mode == {mode(mission, name)}) {{", f"        return may_enter_{name}(m);", "    }")]
        yield function(f"int {mission.name}_may_enter(const {mission.struct()} *m, {mission.struct()}Mode mode)",
                       [*lines, "    return 1;"])


def call_broken(line: str) -> list[str]:
    """A long call continues below its first argument."""
    if len(line) <= COLUMNS:
        return [line]
    start = line.index("(", line.index("exec_")) + 1
    at = line.rindex(", ", start, COLUMNS) + 1
    return [line[:at], " " * start + line[at + 1:]]


# --- events ----------------------------------------------------------------------------------------

def events(mission: Mission) -> Iterator[str]:
    modules = {m.path: m for m in mission.modules}
    for event in mission.events:
        active = statement("watches", in_modes(mission, event.modes)) if event.modes else []
        again = condition("again", event.until, modules) if event.until else []
        lines = [*active, *condition("holds", event.condition, modules, "watches" if active else ""), *again]
        lines += call_broken(f"    if (!exec_fires(&m->event.{event.name}, holds, {'again' if again else '!holds'}, "
                             f"{integer(event.hold)}, {event.count}, {int(event.once)}, t)) {{")
        lines += ["        return;", "    }"]
        enter = f"m->mode.requested = {mode(mission, event.mode)};"
        if event.mode in mission.guards:
            lines += [f"    m->event.{event.name}.refused = !may_enter_{event.mode}(m);",
                      f"    if (m->event.{event.name}.refused == 0) {{", f"        {enter}", "    }"]
        elif event.mode:
            lines += [f"    {enter}"]
        lines += [f"    m->event.{name}.armed = {int(on)};" for name, on in event.arms]
        for module, offset, raw in event.settings:
            lines += assignments(module, offset, raw)
        lines += [f"    {mission.name}_publish_{m.name}(m, t);" for m in event.publishes]
        yield function(f"static void check_{event.name}({mission.struct()} *m, int64_t t)", lines,
                       f"{event.title}: {event.text}")
    if mission.events:
        yield function(f"static void check_events({mission.struct()} *m, int64_t t)",
                       [f"    check_{event.name}(m, t);" for event in mission.events])


# --- the tick --------------------------------------------------------------------------------------

def tick(mission: Mission) -> str:
    lines = []
    if mission.modes:
        if switched(mission):
            lines += ["    if (m->mode.requested != m->mode.current) {", "        enter_mode(m, t);", "    }"]
        else:
            lines += ["    m->mode.current = m->mode.requested;"]
    if mission.events:
        lines.append("    int ran = 0;")
    for task in mission.tasks:
        lines += [f"    if (exec_due(&m->task.{task.name}, t)) {{",
                  f"        run_{task.name}(m, exec_begin(&m->task.{task.name}, {rate(task)}, t));",
                  *(["        ran = 1;"] if mission.events else []), "    }"]
    if mission.modes:
        lines.append("    m->mode.t = t;")
    if mission.events:
        lines += ["    if (ran) {", "        check_events(m, t);", "    }"]
    return function(f"void {mission.name}_tick({mission.struct()} *m, int64_t t)", lines)


def next_tick(mission: Mission) -> str:
    """The earliest of the active tasks, and those of a requested mode."""
    lines = ["    int64_t t = INT64_MAX;"]
    for task in mission.tasks:
        requested, now = "0", "0"
        if task in switched(mission):
            requested, now = f"runs_{task.name}(m->mode.requested)", "m->mode.t"
        lines += call_broken(
            f"    t = exec_sooner(t, exec_next(&m->task.{task.name}, {rate(task)}, {requested}, {now}));")
    return function(f"int64_t {mission.name}_next(const {mission.struct()} *m)", [*lines, "    return t;"])
