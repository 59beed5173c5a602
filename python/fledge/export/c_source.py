# SPDX-License-Identifier: Apache-2.0
"""A mission in C99: one struct that holds all that flies, and the functions that set it up and run it.

It runs by the rules of flight/exec, as the desktop's loop does (sim/runtime.cpp). The same mission gives the same
bytes.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

from fledge.errors import SetupError
from fledge.export import c_run
from fledge.export.c_text import COLUMNS, broken, comment, doc, plain, seconds, with_notes, wrap
from fledge.export.c_values import Setting, settings

if TYPE_CHECKING:
    from fledge.export.read import Mission


def emit(mission: Mission) -> dict[str, str]:
    """File name -> text. Raises ExportError if an update is Python."""
    return {f"{mission.name}.h": header(mission), f"{mission.name}.c": source(mission)}


# --- the header ------------------------------------------------------------------------------------

def header(mission: Mission) -> str:
    """mission.h"""
    name, guard = mission.name, f"{mission.name.upper()}_H"
    includes = sorted({s.header for s in (*(m.struct for m in mission.modules), *(i.struct for i in mission.inputs))})
    composed = mission.form == "micropython"
    parts = [
        "\n".join([*written(mission), ""]) if composed else head(mission),
        f"#ifndef {guard}\n#define {guard}\n",
        "".join(f'#include "{path}"\n' for path in includes) + '#include "targets/mission.h"\n',
        "" if composed else modes(mission), ids(mission), inputs(mission), whole(mission),
        composed_functions(mission) if composed else functions(mission),
        "/** All messages, by id. */\n" + extern("MissionMessage", f"{name}_messages[{name.upper()}_MESSAGES]"),
        parameter_list(mission),
        "#endif\n",
    ]
    return "\n".join(part for part in parts if part)


def head(mission: Mission) -> str:
    name = mission.name
    about = plain(mission.about) or f"The mission {mission.title}."
    left_out = f" Left out: {', '.join(mission.left_out)}." if mission.left_out else ""
    lines = [*written(mission), *comment(about + left_out)]
    lines[-1] = lines[-1].removesuffix(" */")
    lines += [" *", f" *     {name}_init(&m);", " *     for (;;) {",
              f" *         const int64_t t = {name}_next(&m);"]
    lines += [" *         m.in... = what the world says at t;"] if mission.inputs else []
    lines += [f" *         {name}_tick(&m, t);"]
    out = next((m for m in mission.outputs if m.direction == "out"), None)
    lines += [f" *         ... = m.{out.member};"] if out else []
    return "\n".join([*lines, " *     }", " */", ""])


def written(mission: Mission) -> list[str]:
    """The first line of both files."""
    return comment(f"{mission.name}: written by `fledge export {mission.form} {mission.words}`; change the mission "
                   "instead.")


def memory(mission: Mission) -> str:
    """The name of a composed mission's memory."""
    return f"{mission.name}_memory"


def modes(mission: Mission) -> str:
    if not mission.modes:
        return ""
    rows = []
    for i, mode in enumerate(mission.modes):
        runs = [t.title for t in mission.tasks if t.modes is not None and mode in t.modes]
        rows.append((f"{c_run.mode(mission, mode)} = {i}" + ("," if i + 1 < len(mission.modes) else ""),
                     f"{mission.mode_titles[mode]}: " + (", ".join(runs) or "no task of its own")
                     + (f"; only {mission.guards[mode].text}" if mode in mission.guards else "")))
    return "\n".join([*doc("The modes, and what runs in each. A task that no mode names runs in all."),
                      f"typedef enum {mission.struct()}Mode {{", *with_notes(rows, "    ", "///<", ""),
                      f"}} {mission.struct()}Mode;", ""])


def ids(mission: Mission) -> str:
    """The messages' ids."""
    upper = mission.name.upper()
    rows, n = [], 0
    for message in (*mission.inputs, *mission.outputs):
        note = message.struct.name
        if message.direction == "in":
            note += f" from {message.fed or message.path}"
        elif message.ends:
            note += f" to {', '.join(message.ends)}"
        rows.append((f"{upper}_MSG_{message.name.upper()} = {n},", note))
        n += 1
    rows.append((f"{upper}_MESSAGES = {n}", "how many there are"))
    return "\n".join([*doc("The ids of the messages: what comes in, then all that the modules put out."),
                      f"typedef enum {mission.struct()}Message {{", *with_notes(rows, "    ", "///<", ""),
                      f"}} {mission.struct()}Message;", ""])


def inputs(mission: Mission) -> str:
    if not mission.inputs:
        return ""
    rows = [(f"{m.struct.name} {m.name};", f"{m.fed or m.path} >> {', '.join(m.ends)}") for m in mission.inputs]
    return "\n".join([*doc("The messages that flight reads: to be filled before each tick, each copied whole, head "
                           "included."),
                      f"typedef struct {mission.struct()}In {{", *with_notes(rows, "    ", "///<", ""),
                      f"}} {mission.struct()}In;", ""])


def whole(mission: Mission) -> str:
    """The struct of the mission."""
    name = mission.struct()
    rows = [] if mission.form == "micropython" else times(mission)
    if mission.inputs:
        rows += [*([""] if rows else []), f"    {name}In in;"]
    for title, modules in (("published when their parameters change", mission.configuration),
                           *((f"the task {t.title}", t.run) for t in mission.tasks)):
        if modules:
            rows += [*([""] if rows else []), f"    /* {plain(title)} */",
                     *(f"    {m.type} {m.name};" for m in modules)]
    return "\n".join([*doc("All that flies. It holds no pointers: a copy of its bytes is a snapshot."),
                      f"typedef struct {name} {{", *rows, f"}} {name};", ""])


def times(mission: Mission) -> list[str]:
    """What the rules of time keep of it."""
    name = mission.struct()
    rows = ["    struct {", *with_notes([(f"ExecTask {t.name};", f"every {seconds(t.period)}"
                                          + (f", from {seconds(t.offset)} on" if t.offset else "")
                                          + (f"; in {', '.join(mission.mode_titles[m] for m in t.modes)}"
                                             if t.modes is not None else "")) for t in mission.tasks],
                                        "        ", "///<", ""), "    } task;"]
    if mission.modes:
        rows += ["    struct {",
                 *with_notes([(f"{name}Mode current;", ""),
                              (f"{name}Mode requested;", "takes effect at the next tick"),
                              ("int64_t t;", "[ns] the last tick; -1: none yet")], "        ", "///<", ""),
                 "    } mode;"]
    if mission.events:
        rows += ["    struct {",
                 *with_notes([(f"ExecEvent {e.name};", e.text) for e in mission.events], "        ", "///<", ""),
                 "    } event;"]
    return rows


def functions(mission: Mission) -> str:
    name, struct = mission.name, mission.struct()
    entries = [("Set the parameters of flight.py, then reset.", f"void {name}_init({struct} *m);"),
               ("Back to the start; the parameters stay.", f"void {name}_reset({struct} *m);"),
               ("Begin again at t [ns], in flight: the first tick is at or after it. The parameters stay.",
                f"void {name}_restart({struct} *m, int64_t t);"),
               ("The time of the next tick [ns]; INT64_MAX if no task is active.",
                f"int64_t {name}_next(const {struct} *m);"),
               ("Run what is due at t [ns], in the order of the desktop. Times rise from tick to tick; one at which "
                "nothing is due does no harm.", f"void {name}_tick({struct} *m, int64_t t);")]
    if mission.modes:
        entries.append(("Ask for a mode; it takes effect at the next tick.",
                        f"void {name}_enter({struct} *m, {struct}Mode mode);"))
    if mission.guards:
        entries.append((f"Whether a mode may be entered now: {name}_enter does not ask.",
                        f"int {name}_may_enter(const {struct} *m, {struct}Mode mode);"))
    for module in mission.configuration:
        entries.append((f"Publish {module.name} anew at t [ns], after its parameters were changed.",
                        f"void {name}_publish_{module.name}({struct} *m, int64_t t);"))
    return "\n".join(line for text, declaration in entries for line in (*doc(text), declaration, ""))


def composed_functions(mission: Mission) -> str:
    """The memory of a mission that its script composes, and what a scenario changes of it."""
    lines = [f"extern {mission.struct()} {memory(mission)};", ""]
    if mission.changed:
        lines += [*doc("After the script has composed the mission: what the scenario changes of it before it runs."),
                  f"void {mission.name}_set_up(void);", ""]
    return "\n".join(lines)


def parameter_list(mission: Mission) -> str:
    n = sum(bool(m.fields("par")) for m in mission.modules)
    if not n:
        return ""
    name, upper = mission.name, mission.name.upper()
    return (f"/** The parameters of each module that has any. */\n#define {upper}_PARAMETERS {n}\n"
            + extern("MissionParameters", f"{name}_parameters[{upper}_PARAMETERS]"))


def extern(kind: str, name: str) -> str:
    whole = f"extern const {kind} {name};\n"
    return whole if len(whole) <= COLUMNS + 1 else f"extern const {kind}\n    {name};\n"


# --- the source ------------------------------------------------------------------------------------

def refuse_scripts(mission: Mission) -> None:
    """Raise ExportError for modules whose update is Python, a line each."""
    if texts := [module.script for module in mission.modules if module.script]:
        raise SetupError("\n".join(texts))


def source(mission: Mission) -> str:
    """mission.c"""
    if mission.form == "micropython":
        return "\n".join(part for part in (
            "\n".join([*written(mission), f'#include "{mission.name}.h"', "",
                       *(['#include <string.h>', ""] if mission.changed else [])]),
            set_up(mission), messages(mission), parameters(mission)) if part)
    refuse_scripts(mission)
    parts = ["\n".join([*written(mission), f'#include "{mission.name}.h"', "", "#include <string.h>", ""]),
             *c_run.rates(mission), init(mission), *c_run.configuration(mission), *c_run.tasks(mission),
             c_run.restart(mission), c_run.reset(mission), *c_run.modes(mission), *c_run.events(mission),
             c_run.tick(mission),
             c_run.next_tick(mission), messages(mission), parameters(mission)]
    return "\n".join(part for part in parts if part)


def init(mission: Mission) -> str:
    """What flight.py set, and nothing that is zero."""
    wired = {f"m->{w.target}" for wires in (*mission.wires.values(), *mission.published.values()) for w in wires}
    lines = ["    memset(m, 0, sizeof *m);"]
    for module in mission.modules:
        rows = list(settings(module.struct, module.memory, f"m->{module.name}", module.name, wired))
        if rows:
            lines += ["", *paragraph(f"{module.name}: {first_words(module.struct.doc)}", rows)]
    return "\n".join([f"void {mission.name}_init({mission.struct()} *m)", "{", *lines, "",
                      f"    {mission.name}_reset(m);", "}", ""])


def set_up(mission: Mission) -> str:
    lines: list[str] = []
    for module in mission.changed:
        place = f"{memory(mission)}.{module.name}"
        lines += ([""] if lines else []) + [f"    memset(&{place}, 0, sizeof {place});",
                                            f"    {module.function}_reset(&{place});"]
        rows = list(settings(module.struct, module.memory, place, module.name))
        if rows:
            lines += paragraph(f"{module.name}: {first_words(module.struct.doc)}", rows)
    return "\n".join([f"void {mission.name}_set_up(void)", "{", *lines, "}", ""]) if lines else ""


def paragraph(title: str, settings: list[Setting]) -> list[str]:
    """A module's settings. A note stands beside the first line that it is about, if there is room."""
    lines, rows = comment(title, "    "), []
    for setting in settings:
        first, *others = setting.lines
        if beside(first, setting.note):
            rows += [(first, setting.note), *((line, "") for line in others)]
            continue
        lines += with_notes(rows, "    ")
        note = comment(setting.note, "    ")
        if not rows and lines[-1].endswith(" */") and lines[-1].startswith(("    /*", "     *")):
            lines[-1] = lines[-1].removesuffix(" */") + "."  # two comments in a row are one
            note = comment(f"{setting.name}: {setting.note}", "    ")
            note[0] = note[0].replace("/*", " *", 1)
        lines += [*note, *("    " + line if "\n" in line else broken(line) for line in setting.lines)]
        rows = []
    return lines + with_notes(rows, "    ")


def beside(code: str, note: str) -> bool:
    return "\n" not in code and len(f"    {code} /* {plain(note)} */") <= COLUMNS


def first_words(text: str) -> str:
    """The first sentence of a header's comment, to go on after a colon."""
    text = " ".join(text.split()).split(". ")[0].rstrip(".")
    return text[:1].lower() + text[1:] if text[1:2].islower() or text[1:2] == " " else text


def messages(mission: Mission) -> str:
    name, struct = mission.name, mission.struct()
    rows = []
    for m in (*mission.inputs, *mission.outputs):
        rows += row(f'"{m.path}"', f'"{m.struct.name}"', f"offsetof({struct}, {m.member})",
                    f"sizeof({m.struct.name})", f"MISSION_{m.direction.upper()}")
    return "\n".join([f"const MissionMessage {name}_messages[] = {{", *rows, "};", ""])


def row(*items: str) -> list[str]:
    """One row of a table."""
    return wrap([f"{item}," for item in items[:-1]] + [items[-1]], "    {", "     ", "},")


def parameters(mission: Mission) -> str:
    name, struct = mission.name, mission.struct()
    rows = [line for m in mission.modules if m.fields("par")
            for line in row(f'"{m.path}"', f'"{m.type}"', f"offsetof({struct}, {m.name}.par)",
                            f"sizeof((({struct} *)0)->{m.name}.par)")]
    return "\n".join([f"const MissionParameters {name}_parameters[] = {{", *rows, "};", ""]
                     ) if rows else ""
