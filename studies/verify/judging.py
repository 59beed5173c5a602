# SPDX-License-Identifier: Apache-2.0
"""One flight: it is flown, and all requirements that its scenario shows are judged."""
from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any

from fledge.requirements.judge import UNKNOWN, Outcome, problem_of
from fledge.verify import decisions
from fledge.verify.flight import Flight, Flown, Shown

if TYPE_CHECKING:
    from fledge.archive import Archive
    from fledge.mission.simulation import Simulation
    from fledge.requirements import Judged, Requirement
    from fledge.targets import Job

COVERAGE = "flight.info"    # in the folder of each process


def judged(flight: Flight, hash: str) -> Flown:
    """Fly it, and judge all requirements that its scenario shows."""
    from fledge import __version__, mission as missions
    from fledge.requirements import Requirements

    flown = Flown(flight.scenario, flight.target, flight.seed, hash)
    start = perf_counter()
    records: dict[str, Archive] = {}
    packets: dict[str, Any] = {}
    if flight.target != "desktop":
        job, records = _on_target(flight, flown)
        packets = _packets(job, flight.target)
    sim = missions.load(flight.mission, flight.seed, **flight.parameters)
    assert sim.mission
    if records:
        from fledge.targets.playback import stand_in

        stand_in(sim, records, None, packets)
    requirements = Requirements(sim)
    shown = requirements.for_scenario(flight.scenario)
    watch = requirements.watch(only=[requirement.id for requirement in shown], traces=True)
    _record(sim, shown)
    sim.plots = False
    record = flight.folder / "run.mcap"
    sim.archive(record, mission=sim.name, scenario=flight.scenario, target=flight.target, fledge=__version__,
                **sim.mission.metadata())
    try:
        sim.mission.scenarios[flight.scenario](sim)
    except Exception as error:
        flown.error = missions.explain(error, sim.mission.folder)
    flown.time = sim.time
    outcomes = watch.outcomes(so_far=flown.error != "")
    problem = problem_of(outcomes, sim.time, flown.error)
    if not flown.error and not sim.time:
        flown.error = problem
    sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    flown.wall = perf_counter() - start
    flown.record = record.name if record.exists() else ""
    flown.shown = _shown(watch, outcomes, flown.error)
    if flight.coverage == decisions.KIND:
        decisions.write(flight.folder)
    return flown


def _record(sim: Simulation, requirements: Sequence[Requirement]) -> None:
    """Let the first run record all that they read. What the scenario records has its rate already, and keeps it."""
    from fledge.mission.field_path import port

    every: dict[str, int] = {}      # [ns] by port
    for requirement in requirements:
        for comparison in requirement.formula.comparisons if requirement.formula is not None else ():
            for field in comparison.signal.fields:
                assert field.port
                every[field.port] = min(requirement.every, every.get(field.port, requirement.every))

    def run(*arguments: Any, **options: Any) -> None:
        del sim.run
        known = {log.path for log in sim.records}
        for path in every:
            if path not in known:
                sim.record(port(sim, path), every=every[path] / 1e9)
        sim.run(*arguments, **options)

    setattr(sim, "run", run)


def _shown(watch: Judged, outcomes: Sequence[Outcome], error: str) -> list[Shown]:
    """The verdict of the flight on each requirement; of a failed flight, the verdicts before the failure."""
    from fledge.verify import figure

    results = []
    for outcome in outcomes:
        shown = Shown(outcome.requirement.id, outcome.verdict, outcome.margin, outcome.low, outcome.high, outcome.unit,
                      outcome.at, outcome.where,
                      outcome.reason)
        if error and shown.verdict == UNKNOWN:
            shown.at, shown.where, shown.reason = None, "", "the flight failed before it was decided"
        assert outcome.requirement.formula is not None
        comparisons = outcome.requirement.formula.comparisons
        decided = next((comparison for comparison in comparisons if comparison.text == outcome.where), None)
        if decided is not None and decided.measured:
            shown.limit = decided.limit
        # Where names decide, no comparison is the nearest: take the last one of the formula.
        if drawn := [decided] if decided is not None else comparisons[-1:]:
            shown.figure = figure.draw(*watch.values(drawn[0]), drawn[0], outcome.at, outcome.verdict)
        results.append(shown)
    return results


# --- on a target -----------------------------------------------------------------------------------

def _on_target(flight: Flight, result: Flown) -> tuple[Job, dict[str, Archive]]:
    """Fly on a target; returns the job, and the record of each flight process."""
    from fledge.archive import Archive
    from fledge.archive.compare import digest
    from fledge.targets import TARGETS, Job, fly
    from fledge.targets.desktop import Desktop
    from fledge.verify import coverage

    target, = TARGETS.ready([flight.target], "verify")
    if flight.coverage == "object":
        kind: Any = type(target)
        target = kind(["--coverage", COVERAGE])
    job = Job(flight.mission, flight.scenario, None, flight.seed, folder=flight.folder, parameters=flight.parameters)
    desktop = Desktop().fly(job)
    flown = fly(job, {part.process: target for part in job.parts}, flight.target)
    records = {process: Archive(flight.record) for process, flight in flown.items()}
    bits = [[digest(record, part.outputs, part.is_instant) for record in
             (records[part.process], Archive(desktop[part.process].record))] for part in job.parts]
    result.same = all(here == there for here, there in bits)
    for part in job.parts if flight.coverage == "object" else ():
        coverage.add(result.coverage, coverage.read(part.folder / COVERAGE, part.roots, part.folder / "c"))
    return job, records


def _packets(job: Job, target: str) -> dict[str, Any]:
    """The telemetry of each process that sent any."""
    from fledge.commands import read_script

    return {part.process: read_script(part.telemetry(target).read_text()) for part in job.parts
            if part.telemetry(target).exists()}
