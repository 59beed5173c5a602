# SPDX-License-Identifier: Apache-2.0
"""Packets and tables as C structs that need nothing of Fledge: for the app, for its tables, for the ground."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from fledge.elements import ELEMENTS
from fledge.export import names
from fledge.export.c_text import comment, doc, plain, with_notes, wrap

if TYPE_CHECKING:
    from fledge.export.cfs.app import App
    from fledge.export.read import Mission


def members(fields: Sequence[Any], indent: str = "    ") -> list[str]:
    """Lines that declare fields, with units and meanings; nested structs in full."""
    lines: list[str] = []
    rows: list[tuple[str, str]] = []

    def flush():
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


def msgids(mission: Mission, app: App) -> str:
    ids = app.ids(mission)
    width = max(map(len, ids))
    lines = [f"#define {name.ljust(width)} 0x{value:04X}" for name, value in ids.items()]
    return guarded(app, "msgids", f"The message ids of {app.prefix}: topics from {app.topic:#x} on.",
                   ["/* commands, requests for housekeeping, wake-ups from its own child task */", *lines[:3], "",
                    "/* telemetry: housekeeping, and a packet for each output of flight */", *lines[3:], ""])


def msg(mission: Mission, app: App) -> str:
    prefix = app.prefix
    codes = ["NOOP", "RESET_COUNTERS", "ENTER_MODE", "LOAD_PARAMETERS", "RESET_FLIGHT"]
    modes = [f"{i} {mission.mode_titles[m]}" for i, m in enumerate(mission.modes)] or ["this mission has none"]
    parts = ['#include "cfe.h"', "", "/* Function codes. */",
             *(f"#define {prefix}_{code + '_CC':<19} {i}" for i, code in enumerate(codes)), "",
             f"typedef struct {prefix}_NoArgsCmd {{", "    CFE_MSG_CommandHeader_t CommandHeader;",
             f"}} {prefix}_NoArgsCmd_t;", "",
             f"typedef struct {prefix}_EnterModeCmd {{", "    CFE_MSG_CommandHeader_t CommandHeader;",
             "    struct {", *wrap(f"uint32 Mode; /* {plain(', '.join(modes))} */".split(), " " * 8, " " * 11),
             "    } Payload;", f"}} {prefix}_EnterModeCmd_t;", "",
             f"typedef struct {prefix}_LoadParametersCmd {{", "    CFE_MSG_CommandHeader_t CommandHeader;",
             "    struct {", f"        char Table[16]; /* without the app's name: Control, not {prefix}.Control */",
             "        char File[64];  /* as /cf/x.tbl */", "    } Payload;", f"}} {prefix}_LoadParametersCmd_t;", "",
             f"typedef struct {prefix}_HkTlm_Payload {{",
             *with_notes([("int64 Time;", "[ns] of flight, at the last tick; -1: none yet"),
                          ("uint8 CommandCounter;", "commands that were done"),
                          ("uint8 CommandErrorCounter;", "commands and requests that were refused, for:"),
                          ("uint16 Spare;", ""),
                          ("uint32 BadChecksum;", ""), ("uint32 BadLength;", ""), ("uint32 UnknownCode;", ""),
                          ("uint32 Refused;", "what they ask for is not possible"),
                          ("uint32 Mode;", ", ".join(modes)),
                          ("uint32 TableUpdates;", "parameters that were taken over since the start"),
                          ("uint32 TableRefusals;", "parameters that break their rules"),
                          ("uint32 Ticks;", "of the registers' clock"),
                          ("uint32 Overdue;", "ticks that took longer than they may"),
                          ("uint32 WakeupsIgnored;", "without a tick"),
                          ("uint32 IoRefused;", "messages that a lane did not take"),
                          ("uint32 IoCorrupt;", "messages that were none"),
                          ("uint32 IoSaturated;", "numbers beyond the range of their field")], "    "),
             f"}} {prefix}_HkTlm_Payload_t;", "",
             f"typedef struct {prefix}_HkTlm {{", "    CFE_MSG_TelemetryHeader_t TelemetryHeader;",
             f"    {prefix}_HkTlm_Payload_t Payload;", f"}} {prefix}_HkTlm_t;", "",
             "/* The outputs of flight: host byte order, without padding. */", ""]
    done = {}
    for message in mission.outputs:
        name = names.camel(message.name)
        payload = f"{prefix}_{message.struct.name}"
        if message.struct.name not in done:
            parts.append(struct(payload, message.struct.fields, message.struct.doc or message.struct.name))
            done[message.struct.name] = payload
        parts += [f"/** {message.path} */", f"typedef struct {prefix}_{name}Tlm {{",
                  "    CFE_MSG_TelemetryHeader_t TelemetryHeader;", f"    {payload}_t Payload;",
                  f"}} {prefix}_{name}Tlm_t;", ""]
    return guarded(app, "msg", f"The packets of {prefix}.", parts)
