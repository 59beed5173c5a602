# SPDX-License-Identifier: Apache-2.0
"""A counterexample as a scenario of its mission: a regression test."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from fledge import objects
from fledge.commands import checksummed, numbered
from fledge.falsify.flights import Flights
from fledge.falsify.reduction import Counterexample
from fledge.mission.field_path import FieldPath, index_text
from fledge.objects.si import enumerator_names
from fledge.requirements.formula import number_text

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation


def name_of(requirement: str) -> str:
    """The name of the scenario: "PNT-1" gives keeps_pnt_1."""
    return "keeps_" + re.sub(r"\W+", "_", requirement).strip("_").lower()


def scenario(flights: Flights, example: Counterexample, command: str) -> str:
    """The text of a file in Python whose function flies the counterexample, for a mission's scenarios.py: it fails for
    as long as the requirement does."""
    sim = flights.simulation(example.values)
    commands = flights.campaign.dispersions.commands
    changed = [path for path, m in flights.marginals.items() if ".faults[" not in path
               and path.rpartition(".")[0] not in commands and example.values[path] != m.nominal]
    lines = [f'set_up(sim, chosen(sim, "{flights.scenario}")[1])'] if flights.scenario else []
    lines.append(f"sim.seed = {sim.seed}")
    for craft in dict.fromkeys(path.partition(".orbit.")[0] for path in changed if ".orbit." in path):
        lines += [f"sim.{craft}.{name} = {[float(x) for x in getattr(_owner(sim, craft), name)]}"
                  for name in ("r_BN_N", "v_BN_N")]
    lines += [line for path in changed if ".orbit." not in path
              for line in _assignments(sim, path, flights.marginals[path].nominal)]
    for model in dict.fromkeys(fault.rpartition(".")[0] for fault in flights.faults if fault in example.kept):
        rows = [row for i, row in enumerate(_owner(sim, model).faults) if f"{model}.faults[{i}]" not in example.removed]
        lines.append(f"sim.{model}.faults = [" + "".join(f"\n        {_fault(row)}," for row in rows) + "\n    ]")
    for process in dict.fromkeys(command.process for command in commands.values()):
        lines += _script(process, [(example.values.get(f"{place}.at", command.at), command,
                                    int(example.values[f"{place}.which"]))
                                   for place, command in commands.items() if command.process == process])
    margin = number_text(example.margin, flights.unit)
    return f'''"""A counterexample to {flights.requirement}, found by

    {command}

Copy what follows into the mission's scenarios.py; it fails until the requirement holds."""
{"from fledge.mission.scenario import chosen, set_up" + chr(10) if flights.scenario else ""}\
from fledge.requirements import Requirements
from fledge.units import s


def {name_of(flights.requirement)}(sim):
    """{flights.requirement} holds where a search has found a margin of {margin}."""
    {(chr(10) + "    ").join(lines)}
    watch = Requirements(sim).watch(only=["{flights.requirement}"])
    sim.run({_seconds(round(flights.duration * 1e9))})
    outcome = watch.outcomes()[0]
    assert outcome.verdict == "holds", f"{flights.requirement}: the margin is {{outcome.margin}} at {{outcome.at}} s"
'''


def _owner(sim: Simulation, path: str) -> Any:
    """The module or model "world.craft"."""
    process, _, name = path.partition(".")
    return sim.process(process).instances[name]


def _assignments(sim: Simulation, path: str, nominal: float) -> list[str]:
    """The lines that give a parameter its number; an inertia is symmetric."""
    target = FieldPath(sim, path)
    field, x = target.field, target.value()
    text = f'"{enumerator_names(field)[int(x)]}"' if field.type == "enum" else str(int(x)) if _whole(field) else repr(x)
    note = "" if field.type == "enum" else f"  # {target.unit}{'; ' if target.unit else ''}nominal {nominal:.6g}"
    mirror = target.elements[0] - target.elements[0] % 9 + target.elements[0] % 3 * 3 + target.elements[0] % 9 // 3
    places = [target.elements[0]] + ([mirror] if "inertia" in field.rule and mirror != target.elements[0] else [])
    return [f"sim.{target.full}{index_text(place, field.shape)} = {text}{note}" for place in places]


def _fault(row: Any) -> str:
    """A fault as Python; fields that are 0 are left out."""
    parts = []
    for field in objects.struct(row).fields:
        x = getattr(row, field.name)
        if field.type == "enum":
            parts.append(f'"{field.name}": "{enumerator_names(field)[int(x)]}"')
        elif x and not field.spare:
            parts.append(f'"{field.name}": {_seconds(x) if field.unit == "ns" else repr(x)}')
    return "{" + ", ".join(parts) + "}"


def _script(process: str, drawn: list[tuple[float, Any, int]]) -> list[str]:
    """The lines that send the commands of a process, of (time [s], command, which of its packets)."""
    rows: list[str] = []
    packets = 0
    for at, command, which in sorted((row for row in drawn if row[2]), key=lambda row: row[0]):
        for packet in command.packets[which - 1]:
            unit = checksummed(numbered(packet, packets))
            rows.append(f'\n        ({round(at * 1e9)}, bytes.fromhex("{unit.hex()}")),  # {command.names[which - 1]}')
            packets += 1
    return [f"sim.{process}.commands.script([" + "".join(rows) + "\n    ])"] if rows else []


def _seconds(ns: int) -> str:
    """[ns] as a time in Python."""
    return f"{ns / 1e9!r} * s"


def _whole(field: Any) -> bool:
    return field.type not in ("f64", "f32")
