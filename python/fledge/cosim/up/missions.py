# SPDX-License-Identifier: Apache-2.0
"""A mission as a simulation of several programs, one for each of its processes."""
from __future__ import annotations

from fledge.errors import Failure
from fledge.cosim.up.description import Plan, Program


class _Runs(BaseException):
    """The scenario starts its run; the argument is its duration [s]."""


def plan_of(name: str, scenario: str | None, parameters: dict) -> Plan:
    """One node per process, for the duration of the scenario. Raises SetupError, Failure."""
    from fledge.mission import load

    sim = load(name, **parameters)
    nodes = [Program(p.name, mission=str(sim.mission.folder), process=p.name, scenario=scenario,
                     parameters=parameters) for p in sim.processes]
    return Plan(sim.name, _duration(sim, scenario), nodes, file=sim.name)


def _duration(sim, scenario: str | None) -> float | None:
    """The duration of a scenario [s]: the scenario is executed up to its first run."""
    known = sim.mission.scenarios
    if not known and scenario is None:
        return None
    name = scenario or next(iter(known))
    if name not in known:
        raise Failure(f"the mission {sim.name} has no scenario '{name}'; it has {', '.join(known) or 'none'}")

    def run(duration, *_, **__):
        from fledge.objects.si import time_ns

        raise _Runs(time_ns(duration, "run") / 1e9)

    sim.plots, sim.run = False, run
    try:
        known[name](sim)
    except _Runs as asked:
        return asked.args[0]
    return None
