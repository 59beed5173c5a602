# SPDX-License-Identifier: Apache-2.0
"""The tables of a mission's commands and telemetry, flight/command/command.h and flight/telemetry/telemetry.h, in C,
and their description for the ground, MISSION_packets.json (fledge.commands)."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fledge.commands import COMMANDS, FLAGS, TELEMETRY, Dictionary, Rule, byte_runs, frames_of
from fledge.export.c_source import extern, row, written
from fledge.export.c_text import string, wrap

if TYPE_CHECKING:
    from fledge.export.read import Mission


def dictionary(mission: Mission, stream: int = COMMANDS, telemetry: int = TELEMETRY, order: str = "big"
               ) -> Dictionary:
    """What a mission can be commanded, and what it sends."""
    modules = [(m.path, m.struct, m in mission.configuration) for m in mission.modules]
    dictionary_ = Dictionary.of(mission.title, modules, [mission.mode_titles[m] for m in mission.modes],
                                [e.title for e in mission.events], stream, telemetry, order)
    dictionary_.guards = {mission.mode_titles[mode]: guard.text for mode, guard in mission.guards.items()}
    if stream == COMMANDS:      # a software bus carries packets
        dictionary_.frames = next((frames for m in mission.modules if (frames := frames_of(m.struct, m.memory))), None)
    return dictionary_


def emit_commands(mission: Mission, stream: int = COMMANDS, telemetry: int = TELEMETRY, order: str = "big"
                  ) -> dict[str, str]:
    """File name -> text. stream: of commands; telemetry: the first of telemetry; order: of telemetry's numbers where
    the ground reads it."""
    facts = dictionary(mission, stream, telemetry, order)
    name = mission.name
    return {f"{name}_commands.h": header(mission), f"{name}_commands.c": source(mission, facts),
            f"{name}_packets.json": facts.text()}


def header(mission: Mission) -> str:
    name, guard = mission.name, f"{mission.name.upper()}_COMMANDS_H"
    return "\n".join([*written(mission), f"#ifndef {guard}\n#define {guard}\n", f'#include "{name}.h"',
                      '#include "flight/telemetry/telemetry.h"\n',
                      f"/** What can be commanded; the `mission` of its functions is a {mission.struct()}. */",
                      extern("CommandTable", f"{name}_commands"), "/** What is sent. */",
                      extern("TelemetryTable", f"{name}_telemetry"),
                      *(["/** The modules that commands drive; the host may put a store of files there. */",
                         f"extern CommandServices {name}_services;"] if mission.services else []), "#endif\n"])


def source(mission: Mission, facts: Dictionary) -> str:
    name, struct, n = mission.name, mission.struct(), len(mission.outputs)
    largest = max((b.size for b in facts.blocks), default=1)
    composed = mission.form == "micropython"
    script = [f'#include "targets/micropython/{header}.h"' for header in ("executive", "procedure")] if composed else []
    lines = [*written(mission), f'#include "{name}_commands.h"', *script, "", f"static uint8_t staged[{largest}];",
             f"static uint8_t queue[{facts.room}];", f"static uint8_t packet[{facts.longest}];",
             f"static TelemetryRate rates[{3 + n} + COMMAND_STREAMS];", ""]
    for i, block in enumerate(facts.blocks):
        lines += numbers(str(i), block.runs)
        if block.rules:
            lines += [f"static const CommandRule rules_{i}[] = {{ /* {block.path} */", *rules(block.rules), "};"]
    if facts.blocks:
        lines += ["", "static const CommandBlock blocks[] = {"]
        for i, block in enumerate(facts.blocks):
            lines += row(f"runs_{i}", f"rules_{i}" if block.rules else "0", f"{block.size}u", f"{len(block.runs)}u",
                         f"{len(block.rules)}u", f"{int(block.configuration)}u", "0u")
        lines += ["};"]
    if n:
        runs = {message.struct.name: byte_runs(message.struct.fields) for message in mission.outputs}
        lines += ["", *(line for item in runs.items() for line in numbers(*item)),
                  "static const TelemetryOutput outputs[] = {"]
        for message in mission.outputs:
            type_ = message.struct.name
            lines += row(f"runs_{type_}", f"{len(runs[type_])}u",
                         f"offsetof({struct}, {message.member})", f"sizeof({type_})")
        lines += ["};"]
    lines += ["", *functions(mission, facts), f"const TelemetryTable {name}_telemetry = {{",
              f"    {facts.telemetry:#06x}u, {n}u, {'outputs' if n else '0'}, rates, packet, mode, "
              f"{'&executive_texts' if script else '0'}", "};", "",
              *function("static void telemetry(void *mission, uint16_t output, int on, uint16_t every)",
                        ["    (void)mission;", f"    telemetry_rate(&{name}_telemetry, output, on, every);"]),
              *drives(mission), f"const CommandTable {name}_commands = {{"]
    lines += [f"    .{key} = {value}," for key, value in (
        ("stream", f"{facts.stream:#06x}u"), ("version", f"{facts.version:#06x}u"),
        ("n_blocks", f"{len(facts.blocks)}u"), ("n_modes", f"{len(facts.modes)}u"),
        ("n_events", f"{len(facts.events)}u"), ("n_outputs", f"{n}u"), ("blocks", "blocks" if facts.blocks else "0"),
        ("staged", "staged"), ("queue", "queue"), ("room", "sizeof queue"), ("parameters", "parameters"),
        ("enter", "enter"), ("publish", "publish"), ("arm", "arm"), ("reset", "reset"), ("telemetry", "telemetry"),
        *[("may_enter", "may_enter")] * bool(mission.guards), *[("mode", "mode")] * bool(facts.modes),
        *[("procedures", "&script_procedures")] * composed,
        *[("services", f"&{name}_services")] * bool(mission.services))]
    return "\n".join([*lines, "};", ""])


def functions(mission: Mission, facts: Dictionary) -> list[str]:
    """What the commands do to the mission."""
    name, struct = mission.name, mission.struct()
    memory = ([f"    return (uint8_t *)mission + {name}_parameters[block].offset;"] if facts.blocks
              else ["    (void)block;", "    return mission;"])
    if mission.form == "micropython":
        return executive(memory, bool(mission.guards))
    enter = ([f"    {name}_enter(mission, ({struct}Mode)mode);"] if mission.modes
             else ["    (void)mission;", "    (void)mode;"])
    mode = [f"    return (uint16_t)((const {struct} *)mission)->mode.current;"] if mission.modes else [
        "    (void)mission;", "    return 0u;"]
    published = {m.path: m.name for m in mission.configuration}
    publish = [f"    case {i}: {name}_publish_{published[b.path]}(mission, t); break;"
               for i, b in enumerate(facts.blocks) if b.path in published]
    publish = ["    switch (block) {", *publish, "    default: break;", "    }"] if publish else [
        "    (void)mission;", "    (void)block;", "    (void)t;"]
    arm = [f"    case {i}: m->event.{e.name}.armed = on; break;" for i, e in enumerate(mission.events)]
    arm = [f"    {struct} *m = mission;", "    switch (event) {", *arm, "    default: break;", "    }"] if arm else [
        "    (void)mission;", "    (void)event;", "    (void)on;"]
    return [*function("static void *parameters(void *mission, uint16_t block)", memory),
            *function("static void enter(void *mission, uint16_t mode)", enter),
            *(function("static int may_enter(void *mission, uint16_t mode)",
                       [f"    return {name}_may_enter(mission, ({struct}Mode)mode);"]) if mission.guards else []),
            *function("static uint16_t mode(const void *mission)", mode),
            *function("static void publish(void *mission, uint16_t block, int64_t t)", publish),
            *function("static void arm(void *mission, uint16_t event, int on)", arm),
            *function("static void reset(void *mission, int64_t t)", [f"    {name}_restart(mission, t);"])]


def executive(memory: list[str], guarded: bool) -> list[str]:
    """The same for a mission that its script composes."""
    return [*function("static void *parameters(void *mission, uint16_t block)", memory),
            *(line for head, call in (
                ("void enter(void *mission, uint16_t mode)", "executive_enter(mode)"),
                *[("int may_enter(void *mission, uint16_t mode)", "return executive_may_enter(mode)")] * guarded,
                ("uint16_t mode(const void *mission)", "return executive_mode()"),
                ("void publish(void *mission, uint16_t block, int64_t t)", "executive_publish(block, t)"),
                ("void arm(void *mission, uint16_t event, int on)", "executive_arm(event, on)"),
                ("void reset(void *mission, int64_t t)", "executive_restart(t)"))
              for line in function(f"static {head}", ["    (void)mission;", f"    {call};"]))]


def drives(mission: Mission) -> list[str]:
    """The table of the services, where they are, and the outputs, which they may see."""
    struct, outputs = mission.struct(), mission.outputs
    if not mission.services:
        return []
    framed = any(service.type == "SpaceLink" for service in mission.services)
    events = [i for i, output in enumerate(outputs) if output.struct.name == "FlightEvent"]
    return [*wrap([f"&{service.function}_service," for service in mission.services],
                  "static const CommandService *const list[] = {", "    ", "};"), "",
            *function("static void *module(void *mission, uint32_t place)",
                      [*wrap([f"offsetof({struct}, {service.name})," for service in mission.services],
                             "    static const size_t places[] = {", "        ", "};"),
                       "    return (uint8_t *)mission + places[place];"]),
            *function("static const void *output(const void *mission, uint16_t place, uint32_t *size)",
                      ["    *size = outputs[place].size;",
                       "    return (const uint8_t *)mission + outputs[place].offset;"] if outputs else
                      ["    (void)mission;", "    (void)place;", "    *size = 0u;", "    return 0;"]),
            *(wrap([f"{i}u," for i in events], "static const uint16_t events[] = {", "    ", "};") if events else []),
            f"CommandServices {mission.name}_services = {{",
            f"    list, {len(mission.services)}u, module, output, {'events' if events else '0'}, {len(events)}u, 0, 0,",
            "    command_service_check, command_service_execute, command_service_run, telemetry_services,",
            f"    {'command_service_unwrap, command_service_wrap' if framed else '0, 0'}}};", ""]


def function(head: str, lines: Sequence[str]) -> list[str]:
    return [head, "{", *lines, "}", ""]


def numbers(name: str, runs: Sequence[tuple[int, int]]) -> list[str]:
    """Their table of ExecRuns."""
    each = [f"{{{width}u, {count}u}}" for width, count in runs]
    return wrap([*(f"{item}," for item in each[:-1]), *each[-1:]], f"static const ExecRun runs_{name}[] = {{", "    ",
                "};")


def rules(rows: Sequence[Rule]) -> list[str]:
    """Rows of CommandRules."""
    return [line for r in rows for line in row(
        string(r.name.encode()), string(r.text.encode()), f"{r.offset}u", f"{r.n}u", f"{r.row}u",
        "COMMAND_ALL_ROWS" if r.rows_at is None else f"{r.rows_at}u",
        " | ".join(name for name, bit in FLAGS.items() if r.flags & bit) or "0u", f"FLEDGE_{r.number.upper()}",
        repr(r.low), repr(r.high))]
