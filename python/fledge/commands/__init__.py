# SPDX-License-Identifier: Apache-2.0
"""Commands to a flight process as packets, and what it sends (flight/command/command.h, flight/telemetry/telemetry.h).

Example:

    import fledge

    packets = fledge.load("nadir_spin").flight.commands.packets    # or Packets(Dictionary.load("packets.json"))
    packets.noop()                                                 # the bytes of one command
    packets.write("flight.control", K=3.0)                         # a list of them; in SI

A Dictionary is what a mission can be commanded and what it sends: the export writes it as MISSION_packets.json, and the
desktop makes the same one of the live objects.

    protocol.py     codes, reasons and records, which the build reads from the C headers
    fields.py       fields of parameters and messages, and their values
    dictionary.py   a mission's dictionary
    packets.py      commands
    reports.py      telemetry
    tables.py       files of parameters
    scripts.py      packets and their times in files
"""
from fledge.commands.fields import (Enumerator, Field, byte_runs, described, encoded, leaves, parameters,
                                    reversed_numbers, values)
from fledge.commands.protocol import (ALL, ARGUMENTS, CHOICES, COMMAND_MAX, COMMANDS, DATA_MAX, FLAGS, HEADER,
                                      HOUSEKEEPING, LISTS, NAMED, NUMBERS, OUTPUTS, REPORT_LEAST, REPORTS, SERVICES,
                                      STORED, STORED_MAX, TELEMETRY, TURNS, UNIT_STATES, WHY, Action, Code, FileAction,
                                      Kind, Reason, Stage)
from fledge.commands.dictionary import (Block, Choice, Dictionary, EventId, Output, Rule, block_of, events_of,
                                        frames_of, rules_of)
from fledge.commands.packets import Packets, checksummed, moved, numbered, sequence_of
from fledge.commands.reports import Event, Report, Selected, Stored, Telemetry, Text, decoded, origins, stored, storing
from fledge.commands.scripts import Timed, read_script, script
from fledge.commands.tables import checked, read_table, table

__all__ = ["ALL", "ARGUMENTS", "Action", "Block", "CHOICES", "COMMANDS", "COMMAND_MAX", "Choice", "Code", "DATA_MAX",
           "Dictionary", "Enumerator", "Event", "EventId", "FLAGS", "Field", "FileAction", "HEADER", "HOUSEKEEPING",
           "Kind", "LISTS", "NAMED", "NUMBERS", "OUTPUTS", "Output", "Packets", "REPORTS", "REPORT_LEAST", "Reason",
           "Report", "Rule", "SERVICES", "STORED", "STORED_MAX", "Selected", "Stage", "Stored", "TELEMETRY", "TURNS",
           "Telemetry", "Text", "Timed", "UNIT_STATES", "WHY", "block_of", "byte_runs", "checked", "checksummed",
           "decoded", "described", "encoded", "events_of", "frames_of", "leaves", "moved", "numbered", "origins",
           "parameters", "read_script", "read_table", "reversed_numbers", "rules_of", "script", "sequence_of",
           "stored", "storing", "table", "values"]
