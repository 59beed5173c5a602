# SPDX-License-Identifier: Apache-2.0
"""A mission as a simulation of several programs, one for each of its processes."""
from __future__ import annotations

from fledge.cosim.up.description import Plan, Program


def plan_of(name: str, scenario: str | None, parameters: dict) -> Plan:
    """One node per process, for the duration of the scenario's first run. Raises SetupError."""
    from fledge.mission import load
    from fledge.mission.scenario import chosen, set_up

    sim = load(name, **parameters)
    assert sim.mission      # load() gives one
    nodes = [Program(p.name, mission=str(sim.mission.folder), process=p.name, scenario=scenario,
                     parameters=parameters) for p in sim.processes if p.tasks]
    duration = set_up(sim, chosen(sim, scenario)[1]) if scenario or sim.mission.scenarios else None
    return Plan(sim.name, duration, nodes, file=sim.name)
