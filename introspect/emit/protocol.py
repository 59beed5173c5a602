# SPDX-License-Identifier: Apache-2.0
"""What a ground and a flight process must agree on, for Python: the numbers of commands and reports, and the records
in packets. `_fledge_protocol` has the enumerations by the names below, and of each record (name, type, how many) of
its numbers, in the order of memory, which is that of the packet.
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

_PROLOGUE = '''\
# Written by introspect from the C headers: do not edit.
import enum

Record = tuple[tuple[str, str, int], ...]
'''


def emit(library: Library) -> dict[str, str]:
    enums = {e.name: e for e in library.enums}
    structs = {s.name: s for s in library.structs}
    if missing := sorted((ENUMERATIONS.keys() | RECORDS.keys()) - enums.keys() - structs.keys()):
        raise ValueError(f"library `{library.name}` lacks {', '.join(missing)}, of the protocol with the ground")
    text = "".join([_PROLOGUE, *(_enum(enums[name], own) for name, own in ENUMERATIONS.items()),
                    *(_record(structs[name], own) for name, own in RECORDS.items())])
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
