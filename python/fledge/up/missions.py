# SPDX-License-Identifier: Apache-2.0
"""A mission as a simulation of several programs, one for each of its processes."""
from __future__ import annotations

import ast

from fledge._console import Failure
from fledge.up.description import Plan, Program


class _Runs(BaseException):
    """The scenario asks for its run; with how long [s]."""


def plan_of(name: str, scenario: str | None, parameters: list[str]) -> Plan:
    """One node per process, for as long as the scenario runs first. Raises SetupError, Failure."""
    import fledge

    given = {}
    for text in parameters:
        key, equals, value = text.partition("=")
        if not equals or not key.isidentifier():
            raise Failure(f"--set {text}: expected NAME=VALUE, as in spacecraft=8")
        try:
            given[key] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            given[key] = value
    sim = fledge.load(name, **given)
    processes = [p.name for p in getattr(sim, "processes", ())] or ["world", "flight"]
    nodes = [Program(process, mission=str(sim.mission.folder), process=process, scenario=scenario, parameters=given)
             for process in processes]
    return Plan(sim.name, _duration(sim, scenario), nodes, file=sim.name)


def _duration(sim, scenario: str | None) -> float | None:
    """How long a scenario runs, [s]: it is followed up to its first run."""
    known = sim.mission.scenarios
    if not known and scenario is None:
        return None
    name = scenario or next(iter(known))
    if name not in known:
        raise Failure(f"the mission {sim.name} has no scenario '{name}'; it has {', '.join(known) or 'none'}")

    def run(duration, *_, **__):
        from fledge.process import _time

        raise _Runs(_time(duration, "run") / 1e9)

    sim.plots, sim.run = False, run
    try:
        known[name](sim)
    except _Runs as asked:
        return asked.args[0]
    return None
