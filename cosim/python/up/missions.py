# SPDX-License-Identifier: Apache-2.0
"""A mission as a simulation of several programs, one for each of its processes."""
from __future__ import annotations

import math

from fledge.cosim.up.description import Plan, Program, processes_of
from fledge.errors import Failure


def plan_of(name: str, scenario: str | None, parameters: dict) -> Plan:
    """One node per process, for the duration of the scenario's first run. Raises SetupError."""
    sim, duration = processes_of(name, scenario, parameters)
    nodes = [Program(p.name, mission=str(sim.mission.folder), process=p.name, scenario=scenario,
                     parameters=parameters, flies=p in sim.flights) for p in sim.processes if p.tasks]
    return Plan(sim.name, duration, nodes, file=sim.name)


def whole_mission(plan: Plan) -> Program:
    """A program of the one mission that a Plan flies, with all its processes as they are. Raises Failure if there is
    none, or if its records stay elsewhere."""
    first = plan.nodes[0]
    for p in plan.nodes:
        if (p.mission, p.scenario, p.parameters) != (first.mission, first.scenario, first.parameters) or not p.mission:
            raise Failure(f"{plan.file}: a report is of a run of one mission, in which all nodes are its processes, of "
                          f"one scenario; {p.name} is another node than {first.name}")
        if p.host or p.free or p.prefix or p.topics:
            raise Failure(f"{plan.file}: a report needs the records of all processes here, by their own names, as the "
                          f"scenario flies them; {p.name} has a host, a prefix or topics, or is free")
    whole = plan_of(str(first.mission), first.scenario, first.parameters)
    if missing := {p.name for p in whole.nodes} - {p.process for p in plan.nodes}:
        raise Failure(f"{plan.file}: a report is of a whole mission; there is no node for {', '.join(sorted(missing))}")
    if (plan.until or 0) < (whole.until or math.inf):
        raise Failure(f"{plan.file}: a report is of a whole scenario" + (
            f", {whole.until:g} s; the run ends at {plan.until:g} s" if whole.until else "; the mission has none"))
    if any(p.steers for p in plan.programs):
        raise Failure(f"{plan.file}: a report is of a run that no program steers")
    return first
