# SPDX-License-Identifier: Apache-2.0
"""A mission as data for a host that is made without it, targets/mission_host.h: its functions, the topics and
definitions of its messages, and its rates."""
from __future__ import annotations

from typing import TYPE_CHECKING

from fledge import flight, objects
from fledge.export.c_source import memory, row, written
from fledge.export.c_text import string
from fledge.export.commands import dictionary
from fledge.records.series import ACTIVITY, MODE

if TYPE_CHECKING:
    from fledge import _core
    from fledge.export.read import Mission


def emit_host(mission: Mission) -> dict[str, str]:
    """File name -> text."""
    name, composed = mission.name, mission.form == "micropython"
    messages = [*mission.inputs, *mission.outputs]
    types = {m.struct.name: m.struct for m in messages}
    n_schemas, n_channels = len({m.struct.name for m in mission.outputs}) + 2, len(mission.outputs) + 2
    lines = [*written(mission), f'#include "{name}_commands.h"', f'#include "{name}_io.h"',
             *['#include "targets/micropython/arena.h"', '#include "targets/micropython/executive.h"'] * composed,
             '#include "targets/mission_host.h"', "", f"extern const MissionDefinition {name}_definitions[];",
             *[f"static {mission.struct()} m;"] * (not composed), f"static McapSchema schemas[{n_schemas}];",
             f"static McapChannel channels[{n_channels}];", "static CommandState commands;",
             "static MissionStart start;", "", *functions(mission), "static const MissionTopic topics[] = {"]
    places = list(types)
    for message in messages:
        lines += row(f'"{topic(message.path)}"', f"{places.index(message.struct.name)}u",
                     f"MISSION_{message.latency.upper()}", f"{int(message.optional)}u")
    lines += ["};", "", "static const ExecRate rates[] = {"]
    lines += [f"    {{{task.period}, {task.offset}}}," for task in mission.tasks]
    lines += ["};", "", *executive(mission, len(types)), "const MissionHost fledge_mission = {"]
    own = "executive_" if composed else ""
    frames = dictionary(mission).frames
    secured = frames is not None and frames.secured > 0
    lines += [f"    .{key} = {value}," for key, value in (
        ("name", f'"{mission.folder}"'), ("mission", f"&{memory(mission) if composed else 'm'}"), ("start", "&start"),
        ("init", "init" if mission.changed or mission.begins else own + "init"),
        *((call, own + call) for call in ("restart", "next", "tick")),
        *((call, own + call) for call in ("failure", "describe", "figures") if composed),
        *[("heap", "heap"), ("clock", "&executive_clock")] * composed, ("io", f"&{name}_io"), ("topics", "topics"),
        ("definitions", f"{name}_definitions"), ("rates", "rates"), ("commands", f"&{name}_commands"),
        ("telemetry", f"&{name}_telemetry"), ("executive", "&mission_executive"),
        *[("store", f"&{name}_services.store")] * any(module.type == "Files" for module in mission.modules),
        *[("keys", f"&{name}_services.keys")] * secured, ("state", "&commands"), ("schemas", "schemas"),
        ("channels", "channels"), ("n_schemas", f"{n_schemas}u"), ("n_channels", f"{n_channels}u"),
        ("n_rates", f"{len(mission.tasks)}u"),
        ("reset", "MISSION_NO_RESET" if mission.reset is None else f"{mission.reset}u"), ("down", mission.down))]
    return {f"{name}_host.c": "\n".join([*lines, "};", ""]),
            f"{name}_definitions.c": definitions(mission, [*types.values(), *message_types()])}


def functions(mission: Mission) -> list[str]:
    """What the host calls: the mission's functions, and its start."""
    name, lines = mission.name, []
    if mission.form == "micropython":
        lines += ["static MissionHeap heap(void)", "{",
                  "    return (MissionHeap){arena_in_use->used, arena_in_use->peak};", "}", ""]
    else:
        for function, result, parameter, argument in (
                ("init", "void", "void", ""), ("next", "int64_t", "void", ""),
                ("restart", "void", "int64_t t", ", t"), ("tick", "void", "int64_t t", ", t")):
            back = "return " if result != "void" else ""
            lines += [f"static {result} {function}({parameter})", "{", f"    {back}{name}_{function}(&m{argument});",
                      "}", ""]
    set_up = [f"    {name}_set_up();"] * bool(mission.changed)
    if mission.begins:
        set_up.append(f"    executive_start_in({mission.modes.index(mission.begins)}u); /* {mission.begins} */")
    if set_up:
        lines += ["static void init(void)", "{", "    executive_init();", *set_up, "}", ""]
    return lines


def message_types() -> list[_core.Struct]:
    """The messages of executives."""
    return [objects.struct(getattr(flight, name)) for name in (MODE, ACTIVITY)]


def executive(mission: Mission, first: int) -> list[str]:
    """What the executive does, for records. first: the place of its messages' definitions."""
    name, struct, composed = mission.name, mission.struct(), mission.form == "micropython"
    lines = []
    if mission.modes:
        lines += ["static const char *const modes[] = {",
                  *(f"    {string(mission.mode_titles[mode].encode())}," for mode in mission.modes), "};", ""]
    if mission.events:
        lines += ["static const MissionEvent events[] = {"]
        for event in mission.events:
            lines += row(string(event.title.encode()), string(cut(event.when)))
        lines += ["};", ""]
    mode = "executive_mode()" if composed else f"(uint16_t)((const {struct} *)mission)->mode.current"
    lines += ["static uint16_t mode(const void *mission)", "{", "    (void)mission;",
              f"    return {mode if mission.modes else '0u'};", "}", "",
              "static const ExecEvent *event(const void *mission, uint16_t i)", "{"]
    if composed or not mission.events:
        lines += ["    (void)mission;", *["    (void)i;"] * (not composed),
                  f"    return {'executive_event(i)' if composed else 'NULL'};"]
    else:
        lines += ["    static const size_t places[] = {",
                  *(f"        offsetof({struct}, event.{event.name})," for event in mission.events), "    };",
                  "    return (const void *)((const uint8_t *)mission + places[i]);"]
    lines += ["}", "", "static const MissionExecutive mission_executive = {"]
    lines += [f"    .{key} = {value}," for key, value in (
        ("mode_topic", f'"{topic(mission.process)}/mode"'), ("activity_topic", f'"{topic(mission.process)}/activity"'),
        ("definitions", f"&{name}_definitions[{first}]"), *[("modes", "modes")] * bool(mission.modes),
        *[("events", "events")] * bool(mission.events), ("mode", "mode"), ("event", "event"))]
    return [*lines, "};", ""]


def cut(text: str) -> bytes:
    """A text as much as an Activity has room for."""
    return text.encode()[:87]


def definitions(mission: Mission, types: list[_core.Struct]) -> str:
    """What the messages look like, for records and the exchange."""
    name = f"{mission.name}_definitions"
    lines = [*written(mission), '#include "targets/mission_host.h"', "", f"extern const MissionDefinition {name}[];",
             f"const MissionDefinition {name}[] = {{"]
    for type_ in types:
        lines += [f'    {{"{type_.name}", "fledge/msg/{type_.name}",',
                  *(f"     {string(line.encode())}" for line in type_.schema.splitlines(keepends=True))]
        lines[-1] += "},"
    return "\n".join([*lines, "};", ""])


def topic(path: str) -> str:
    """The name in records and in the exchange: flight.motor.command -> /flight/motor/command."""
    return "/" + path.replace(".", "/")
