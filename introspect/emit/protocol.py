# SPDX-License-Identifier: Apache-2.0
"""What a ground and a flight process must agree on, for Python: the numbers of commands and reports, and the records
in packets. `_fledge_protocol` has the enumerations and constants by the names below, and of each record (name, type,
how many) of its numbers, in the order of memory, which is that of the packet.
"""
from __future__ import annotations

import math
from collections.abc import Iterator

from introspect.emit.stubs import doc_string
from introspect.model import Enumeration, Library, Struct, snake

ENUMERATIONS = {"CommandCode": "Code", "CommandReason": "Reason", "CommandStage": "Stage", "ListAction": "Action",
                "FileAction": "FileAction", "TelemetryTextKind": "Kind", "CommandStream": "Stream",
                "UnitState": "UnitState", "FledgeType": "Number"}
RECORDS = {"TelemetryHousekeeping": "HOUSEKEEPING_RECORD", "CommandReport": "REPORT_RECORD",
           "TelemetryText": "TEXT_RECORD", "EventRecord": "EVENT_RECORD"}
CONSTANTS = {"COMMAND_DATA": "HEADER", "COMMAND_DATA_MAX": "DATA_MAX", "COMMAND_MAX": "COMMAND_MAX",
             "COMMAND_STORED": "STORED", "COMMAND_STORED_MAX": "STORED_MAX", "COMMAND_ALL": "ALL",
             "COMMAND_OF_LIST": "OF_LIST", "COMMAND_OF_MONITOR": "OF_MONITOR", "COMMAND_OF_RULE": "OF_RULE",
             "STORED_LISTS": "LISTS", "FAULT_RULES": "RULES", "HOUSEKEEPING_CHOICES": "CHOICES"}
FLAGS = ("FLEDGE_HAS_LO", "FLEDGE_HAS_HI", "FLEDGE_LO_OPEN", "FLEDGE_HI_OPEN", "COMMAND_NON_ZERO", "COMMAND_INERTIA",
         "COMMAND_START")       # of a CommandRule

_PROLOGUE = '''\
# Written by introspect from the C headers: do not edit.
import enum

Record = tuple[tuple[str, str, int], ...]
'''


def emit(library: Library) -> dict[str, str]:
    enums = {e.name: e for e in library.enums}
    structs = {s.name: s for s in library.structs}
    if not ENUMERATIONS.keys() & enums.keys():      # as of a project
        return {}
    known = enums.keys() | structs.keys() | library.constants.keys()
    if missing := sorted({*ENUMERATIONS, *RECORDS, *CONSTANTS, *FLAGS} - known):
        raise ValueError(f"library `{library.name}` lacks {', '.join(missing)}, of the protocol with the ground")
    text = "".join([_PROLOGUE, *(_enum(enums[name], own) for name, own in ENUMERATIONS.items()),
                    *(_record(structs[name], own) for name, own in RECORDS.items()), "\n\n",
                    *(f"{own} = {library.constants[name]}\n" for name, own in CONSTANTS.items()),
                    f"FLAGS = {({name: library.constants[name] for name in FLAGS})}\n"])
    return {"../python/_fledge_protocol.py": text, "stubs/_fledge_protocol.pyi": text}


def _enum(e: Enumeration, name: str) -> str:
    """Without the last enumerator if it only counts the others, as COMMAND_CODES."""
    counts = f"{snake(e.name).upper()}S"
    values = tuple(v for v in e.values if v.name != counts)
    short = Enumeration(e.name, e.doc, values, e.header).short_names
    return f"\n\nclass {name}(enum.IntEnum):\n" + doc_string(e.doc) + "".join(
        f"    {own} = {v.value}\n" + doc_string(v.doc) for own, v in zip(short, values))


def _record(s: Struct, name: str) -> str:
    rows = "".join(f"    {row!r},\n" for row in _numbers(s))
    return f"\n\n#: {' '.join(s.doc.split())}\n{name}: Record = (\n{rows})\n"


def _numbers(s: Struct) -> Iterator[tuple[str, str, int]]:
    for f in s.fields:
        if f.struct:
            yield from _numbers(f.struct)
        else:
            yield f.name, f.type.name.lower(), math.prod(f.shape)
