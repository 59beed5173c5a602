# SPDX-License-Identifier: Apache-2.0
"""Packets and tables as C structs that need nothing of Fledge: for the app, for its tables, for the ground."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fledge.commands import ARGUMENTS, DATA_MAX, STORED_MAX, Code, Reason
from fledge.commands.protocol import SERVICE_OF, argument_type
from fledge.elements import ELEMENTS
from fledge.export import dictionary, ground, names
from fledge.export import packets as ground_packets
from fledge.export.c_text import comment, doc, plain, with_notes
from fledge.export.packets import Packet, number
from fledge.export.xtce import xtce
from fledge.targets.cfs.export.app import CMD, TLM, has_files

if TYPE_CHECKING:
    from fledge.export.read import Mission
    from fledge.targets.cfs.export.app import App
    from fledge.targets.cfs.export.tables import Table


def members(fields: Sequence[Any], indent: str = "    ") -> list[str]:
    """Lines that declare fields, with units and meanings; nested structs in full."""
    lines: list[str] = []
    rows: list[tuple[str, str]] = []

    def flush() -> None:
        lines.extend(with_notes(rows, indent, "/*", " */"))
        rows.clear()

    for field in fields:
        dims = "".join(f"[{n}]" for n in field.shape)
        if field.type == "struct":
            flush()
            lines.append(f"{indent}struct {{")
            lines.extend(members(field.struct.fields, indent + "    "))
            lines.append(f"{indent}}} {field.name}{dims};" + (f" /* {plain(field.doc)} */" if field.doc else ""))
            continue
        notes = [f"[{field.unit}]"] if field.unit else []
        notes += [field.doc] if field.doc else []
        if field.type == "enum":
            notes.append(", ".join(f"{value} {name}" for name, value in field.enumerators))
        rows.append((f"{ELEMENTS[field.type].ctype.removesuffix('_t')} {field.name}{dims};", " ".join(notes)))
    flush()
    return lines


def struct(name: str, fields: Sequence[Any], about: str, first: Sequence[str] = ()) -> str:
    """A typedef; `first` are lines of members in front."""
    return "\n".join([*doc(about), f"typedef struct {name} {{", *(f"    {line}" for line in first), *members(fields),
                      f"}} {name}_t;", ""])


def guarded(app: App, file: str, about: str, parts: Sequence[str]) -> str:
    """A header of the app."""
    guard = f"{app.prefix}_{file.upper()}_H"
    return "\n".join(["/* SPDX-License-Identifier: Apache-2.0 */", *comment(about),
                      f"#ifndef {guard}", f"#define {guard}", "", *parts, "#endif", ""])


MISSION = ("topicids", "fcncodes", "interface_cfg", "mission_cfg", "msgdefs", "msgstruct", "msg", "tbldefs",
           "tblstruct", "tbl")
PLATFORM = ("msgids", "internal_cfg", "platform_cfg", "perfids")
HEAD = ["uint32 Layout; /* ..._LAYOUT: tells byte order and version of what follows */",
        "uint32 Check;  /* 0x10000 and the CRC of what follows, as in PACKETS.json; 0: it is not looked at */"]


# The commands of the app, in the order of its headers; it has neither procedures nor files.
COMMANDS = (Code.MODE, Code.WRITE, Code.STAGE, Code.COMMIT, Code.PUBLISH, Code.RESET_FLIGHT, Code.ARM, Code.READ,
            Code.TELEMETRY, Code.CHECK, Code.STORE, Code.DELETE, Code.CONTROL, Code.LIST, Code.UNIT, Code.EVENTS)


def arguments(mission: Mission) -> dict[Code, dict[str, int]]:
    """Name -> bytes of the arguments behind the version, of each command that the mission has."""
    types = {m.type for m in mission.modules}
    return {code: sizes(code) for code in COMMANDS if SERVICE_OF.get(code, "") in {"", *types}}


def sizes(code: Code) -> dict[str, int]:
    if code == Code.STORE:
        last = {"Command": STORED_MAX}
    else:
        last = {"Bytes": DATA_MAX} if "bytes" in ARGUMENTS[code] else {}
    return {"Count" if name == "n" else name.title(): ELEMENTS[argument_type(name)].size
            for name in ARGUMENTS[code] if name not in ("version", "bytes")} | last


def config(mission: Mission, app: App, tables: Sequence[Any], simulated: bool = False) -> dict[str, str]:
    """The headers that a mission may replace by its own: name -> text, of all in MISSION and PLATFORM."""
    prefix, name = app.prefix, app.name
    topics = app.topics(mission)

    def defines(values: dict[str, Any]) -> list[str]:
        width = max(map(len, values), default=0)
        return [f"#define {name.ljust(width)} {value}" for name, value in values.items()] + [""]

    headers = {
        "topicids": (f"The topics of {prefix}: of commands and requests, of telemetry, and of the packets that are its "
                     "inputs.", defines({name: f"0x{value:02X}" for name, value in topics.items()})),
        "fcncodes": (f"The function codes of {prefix}'s commands.",
                     defines({f"{prefix}_{code.name}_CC": str(int(code))
                              for code in (Code.NOOP, Code.RESET_COUNTERS, *arguments(mission))})),
        "interface_cfg": (f"What others know of {prefix}: the names of its tables.",
                          defines({f"{prefix}_{t.name.upper()}_TABLE": f'"{prefix}.{t.name}"' for t in tables})),
        "mission_cfg": (f"What is the same on all processors of a mission with {prefix}.",
                        [f'#include "{name}_interface_cfg.h"', ""]),
        "msgdefs": (f"The payloads of {prefix}'s packets.", payloads(mission, app)),
        "msgstruct": (f"The packets of {prefix}.", packets(mission, app)),
        "msg": (f"The packets of {prefix}, with their codes and payloads.",
                [*(f'#include "{name}_{kind}.h"'
                   for kind in ("interface_cfg", "fcncodes", "msgdefs", "msgstruct")), ""]),
        "tbldefs": (f"The types in {prefix}'s tables.",
                    ['#include "common_types.h"', f'#include "{name}_mission_cfg.h"', ""]),
        "tblstruct": (f"The tables of {prefix}: the parameters of its modules.", structs(app, tables)),
        "tbl": (f"The tables of {prefix}.", [f'#include "{name}_tbldefs.h"', f'#include "{name}_tblstruct.h"', ""]),
        "msgids": (f"The message ids of {prefix}, from its topics.", msgids(mission, app)),
        "internal_cfg": (f"How {prefix} works inside.", internal(app, simulated)),
        "platform_cfg": (f"What {prefix} needs of a processor.", platform(mission, app)),
        "perfids": (f"The marks of {prefix} in performance logs.",
                    [f"#define {prefix}_APP_PERF_ID {64 + app.topic // 8 % 64}", ""])}
    return {name: guarded(app, name, *headers[name]) for name in (*MISSION, *PLATFORM)}


def internal(app: App, simulated: bool) -> list[str]:
    prefix = app.prefix
    return ["/* How long the app waits for a message before it looks whether it is to end [ms]. */",
            f"#define {prefix}_WAIT_MS 500", "",
            "/* An input is stale if nothing came for longer than so many times what lay between its last two. */",
            f"#define {prefix}_STALE_STEPS 10", "",
            "/* Without registers, flight's time is: 1: the mission elapsed time of a wake-up, to the nearest step;",
            " * 0: a step more than at the wake-up before. */", f"#ifndef {prefix}_TIME_FROM_MET",
            f"#define {prefix}_TIME_FROM_MET 1", "#endif", "",
            "/* 1: outputs that others read are sent from the start; 0: what a command turns on. */",
            f"#define {prefix}_OUTPUTS_ON {0 if simulated else 1}", ""]


def platform(mission: Mission, app: App) -> list[str]:
    prefix, name = app.prefix, app.name
    files = ["/* Where flight's files are, and how many are open at most. */",
             f'#define {prefix}_FILES_FOLDER "/cf/{name}"', f"#define {prefix}_OPEN_FILES 12", ""]
    return [f'#include "{name}_mission_cfg.h"', f'#include "{name}_internal_cfg.h"', "",
            "/* At most 4 messages of each id wait in a pipe of this depth, so none keeps out another. */",
            f"#define {prefix}_PIPE_DEPTH {16 + 4 * len(mission.inputs)}", "",
            "/* Of the child task that waits for registers. */", f"#define {prefix}_CHILD_PRIORITY 60", "",
            *files * has_files(mission)]


def msgids(mission: Mission, app: App) -> list[str]:
    prefix = app.prefix
    standard = {macro: macro.replace("_MISSION_", "_").replace("_TOPICID", "_MID") for macro in app.topics(mission)}
    own = replace(app, wakeup=None, wires={}).ids(mission)
    lines = ['#include "cfe_msgids.h"', f'#include "{app.name}_topicids.h"', "",
             "/* Caelum and Draco have bases, 7.x has a map of its own, and in data sheets all topics are one list. */",
             "#ifdef CFE_EDS_ENABLED", '#include "cfe_mission_eds_designparameters.h"', "#endif"]
    for kind, part in (("CMD", "TELECOMMAND"), ("TLM", "TELEMETRY")):
        lines += ["#if defined(CFE_EDS_ENABLED)", f"#define {prefix}_{kind}_MIDV(topic) \\",
                  f"    CFE_PLATFORM_{kind}_TOPICID_TO_MIDV(EdsParam_CFE_MISSION_{part}_BASE_TOPICID + (topic))",
                  f"#elif defined(CFE_PLATFORM_{kind}_TOPICID_TO_MIDV)",
                  f"#define {prefix}_{kind}_MIDV(topic) CFE_PLATFORM_{kind}_TOPICID_TO_MIDV(topic)", "#else",
                  f"#define {prefix}_{kind}_MIDV(topic) (CFE_PLATFORM_{kind}_MID_BASE + (topic))", "#endif"]
    lines.append("")
    width = max(map(len, standard.values()))
    for macro, mid in standard.items():
        given = app.ids(mission)[mid]
        kind = "CMD" if given & 0x1000 else "TLM"
        value = f"{prefix}_{kind}_MIDV({macro})" if given == own[mid] else f"0x{given:04X}"
        lines.append(f"#define {mid.ljust(width)} {value}")
    return [*lines, ""]


def structs(app: App, tables: Sequence[Table]) -> list[str]:
    """The structs of all tables, as lines."""
    parts = [f'#include "{app.name}_tbldefs.h"', ""]
    for table in tables:
        name = f"{app.prefix}_{table.name}"
        parts += [f"#define {name.upper()}_LAYOUT 0x{table.layout:08X}u",
                  struct(name, table.fields, f"{table.module.path}: {table.module.type}", HEAD)]
    return parts


def title(code: Code) -> str:
    return code.name.title().replace("_", "")


def command(prefix: str, code: Code, sizes: Mapping[str, int]) -> list[str]:
    """The payload of a command."""
    name = f"{prefix}_{title(code)}Cmd_Payload"
    return [f"typedef struct {name} {{", "    uint8 Version[2];",
            *(f"    uint8 {argument}[{size}];" for argument, size in sizes.items()), f"}} {name}_t;", ""]


def housekeeping(mission: Mission) -> list[tuple[str, str, str]]:
    """(name, type, meaning) of what the app's housekeeping has."""
    modes = [f"{i} {mission.mode_titles[m]}" for i, m in enumerate(mission.modes)] or ["this mission has none"]
    return [("Time", "int64", "[ns] of flight, at the last tick; -1: none yet"),
            ("CommandCounter", "uint8", "the low bits of Accepted"),
            ("CommandErrorCounter", "uint8", "the low bits of Refused and RequestErrors"),
            ("InputsStale", "uint16", "inputs that came, and come no more"),
            ("Mode", "uint32", ", ".join(modes)), ("Accepted", "uint32", "commands"),
            ("Executed", "uint32", ""), ("Refused", "uint32", "at acceptance or execution"),
            ("Reasons", f"uint32[{len(Reason)}]", "of the refusals: " + ", ".join(
                f"{int(reason)} {reason.name.lower()}" for reason in Reason)),
            ("RequestErrors", "uint32", "other messages that were not as expected"),
            ("TableUpdates", "uint32", "parameters that were taken over since the start"),
            ("TableRefusals", "uint32", "parameters that break their rules"), ("Ticks", "uint32", "of flight"),
            ("Overdue", "uint32", "ticks that took longer than they may"),
            ("WakeupsIgnored", "uint32", "without a tick"),
            ("IoRefused", "uint32", "messages that a lane did not take"),
            ("IoCorrupt", "uint32", "messages that were none"),
            ("IoSaturated", "uint32", "numbers beyond the range of their field"),
            ("Inputs", "uint32", "packets that are inputs"), ("InputsRefused", "uint32", "of the wrong length"),
            ("InputsMissing", "uint32", "inputs that never came, when this was asked for"),
            ("WakeupsEarly", "uint32", "of those ignored: within the step that was flown"),
            ("WakeupsMissing", "uint32", "steps that flight did not fly, by the mission elapsed time"),
            ("TimeSets", "uint32", "how often that time went back, and flight began anew"),
            *[("Spare", "uint32", "so that the size is a multiple of 8 bytes")] * (len(Reason) % 2)]


def database(mission: Mission, app: App) -> str:
    """The packets and commands on the software bus, as XTCE."""
    items = []
    for name, type_, about in housekeeping(mission):
        of, _, n = type_.removesuffix("]").partition("[")
        items += [number(f"{name}[{i}]" if n else name, of[0] + of.removeprefix("u").removeprefix("int"), about)
                  for i in range(int(n or 1))]
    commands = dictionary(mission, CMD + app.topic, TLM + app.topic, app.order)
    last = Packet(f"{mission.process}.app", f"housekeeping of the app {app.name}", commands.texts, items)
    databases = [ground_packets.database(mission, commands, last)]
    return xtce(mission.name, databases, ground.read(mission.place, databases))


def payloads(mission: Mission, app: App) -> list[str]:
    prefix = app.prefix
    parts = ['#include "common_types.h"', f'#include "{app.name}_fcncodes.h"', "",
             "/* Commands: numbers are big-endian, and the first is the version of the dictionary. */", "",
             *(line for item in arguments(mission).items() for line in command(prefix, *item)),
             f"typedef struct {prefix}_HkTlm_Payload {{",
             *with_notes([(f"{type_.partition('[')[0]} {name}{''.join(type_.partition('[')[1:])};", about)
                          for name, type_, about in housekeeping(mission)], "    "),
             f"}} {prefix}_HkTlm_Payload_t;", "",
             "/* Inputs and outputs of flight: host byte order, without padding. */", ""]
    done: set[str] = set()
    for message in (*mission.inputs, *mission.outputs):
        if message.struct.name not in done:
            done.add(message.struct.name)
            parts.append(struct(f"{prefix}_{message.struct.name}", message.struct.fields,
                                message.struct.doc or message.struct.name))
    return parts


def packets(mission: Mission, app: App) -> list[str]:
    prefix = app.prefix

    def packet(name: str, header: str, payload: str, about: str = "") -> list[str]:
        return [*([f"/** {about} */"] if about else []), f"typedef struct {prefix}_{name} {{",
                f"    CFE_MSG_{header}Header_t {header}Header;", *([f"    {payload}_t Payload;"] if payload else []),
                f"}} {prefix}_{name}_t;", ""]

    parts = ['#include "cfe.h"', "", f'#include "{app.name}_msgdefs.h"', "", *packet("NoArgsCmd", "Command", "")]
    for code in arguments(mission):
        parts += packet(f"{title(code)}Cmd", "Command", f"{prefix}_{title(code)}Cmd_Payload")
    parts += packet("HkTlm", "Telemetry", f"{prefix}_HkTlm_Payload")
    for message in (*mission.inputs, *mission.outputs):
        kind = "In" if message in mission.inputs else "Tlm"
        parts += packet(names.camel(message.name) + kind, "Telemetry", f"{prefix}_{message.struct.name}", message.path)
    return parts
