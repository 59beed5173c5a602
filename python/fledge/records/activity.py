# SPDX-License-Identifier: Apache-2.0
"""The activity of the processes of a run, from any record: modes that began, events that fired, commands with their
answers, resets.

    happenings(log), happenings(Archive("run.mcap"))
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from fledge.commands import Code, Reason
from fledge.records.series import MODE, P, Records

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fledge.mission.simulation import Simulation

EVENT, ACCEPTED, EXECUTED, RESET = 1, 2, 3, 4   # ActivityKind


class Happening(NamedTuple):
    """t: [s]; kind: "mode", "event", "command" or "reset"; name: of the mode or event, or the function of the command;
    text: what fired the event, or the answer to the command"""
    t: float
    process: str
    kind: str
    name: str
    text: str


def happenings(records: Records) -> list[Happening]:
    """All recorded happenings, by time; at the same time modes first."""
    unsorted = [happening for port in records.executives() for happening in _of_port(records, port)]
    return sorted(unsorted, key=lambda happening: (happening.t, happening.kind != "mode"))


def modes(records: Records) -> dict[str, list[tuple[float, str]]]:
    """Process -> (t [s], mode) of each mode that began."""
    return {port.name.rpartition(".")[0]: [(mode.t, mode.name) for mode in _of_port(records, port)]
            for port in records.executives() if port.type == MODE and len(records._time(port))}


def _of_port(records: Records[P], port: P) -> Iterator[Happening]:
    process = port.name.rpartition(".")[0]
    last = None
    for row in records._values(port):
        t = row["head"]["t"] / 1e9
        if port.type == MODE:
            if last != (last := row["head"]["sequence"]):   # a record of samples has a message many times
                yield Happening(t, process, "mode", row["name"].decode(), "")
        elif row["kind"] == EVENT:
            dropped = "; its mode was refused" if row["reason"] == Reason.GUARDED else ""
            yield Happening(t, process, "event", row["name"].decode(), row["cause"].decode() + dropped)
        elif row["kind"] == RESET:
            yield Happening(t, process, "reset", "computer", f"for the {row['index']}. time")
        else:
            reason, later = Reason(row["reason"]), row["kind"] == EXECUTED
            answer = ("executed" if later else "accepted") if reason == Reason.OK else (
                f"refused {'at its execution' if later else 'at its arrival'}: {reason.name.lower().replace('_', ' ')}")
            yield Happening(t, process, "command", f"{_function(row['code'])}, sequence {row['index']}", answer)


def _function(code: int) -> str:
    return Code(code).name.lower().replace("_", " ") if code in Code._value2member_map_ else f"function {code}"


def facts(simulation: Simulation) -> dict[str, Any]:
    """The happenings of each process of a run with modes, events, commands or resets, as plain data."""
    plain: dict[str, Any] = {}
    happened = happenings(simulation.activity)
    for process in simulation.processes:
        own = [happening for happening in happened if happening.process == process.name]
        rows: dict[str, Any] = {
            "mode": process.active_mode,
            "modes": {name: {"entered": n, "first": first} for name, (n, first) in process.entered.items()},
            "events": {name: {"fired": event.fired[0], "first": event.fired[1], "when": event.text}
                       for name, event in process.events.items()},
            "commands": [{"t": command.t, "command": command.name, "answer": command.text}
                         for command in own if command.kind == "command"],
            "resets": [reset.t for reset in own if reset.kind == "reset"]}
        if rows := {key: value for key, value in rows.items() if value}:
            plain[process.name] = rows
    return plain
