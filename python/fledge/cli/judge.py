# SPDX-License-Identifier: Apache-2.0
"""A scenario with its checks, plots and report: of this program's flight, or of what a target's flight put out."""
from __future__ import annotations

import argparse
from pathlib import Path

from fledge.cli.arguments import command_line
from fledge.cli.console import Plots, say, trace
from fledge.cli.runs import alone
from fledge.errors import CompositionError, Failure, SetupError, Stopped
from fledge.requirements import Outcome, Requirements
from fledge.requirements.judge import HOLDS, UNKNOWN, VIOLATED, problem_of

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from fledge.archive import Archive
    from fledge.mission.simulation import Simulation
    from fledge.targets import Job


def attempt(options: argparse.Namespace, sim: Simulation, scenario: str, fly: Callable, stop: Path | None = None
            ) -> tuple[str | None, int, list[Outcome]]:
    """Fly a scenario, and judge the requirements that it shows; returns (what is wrong or None, the exit code, their
    outcomes). stop: end the run at the first violation, and write the state into this file. Raises CompositionError,
    and Failure of what goes wrong before the first instant: there is no run of which to speak."""
    required = Requirements(sim)
    ids = [requirement.id for requirement in required.for_scenario(scenario)] if required else []
    watch = required.watch(ids, stop is not None) if required else None
    problem, code = _attempt(options, sim, fly, stop)
    if problem and sim.time_ns < 0:
        raise Failure(f"{sim.name}, {scenario}: {problem}", code)
    outcomes = watch.outcomes() if watch else []
    verdict = problem_of(outcomes, sim.time, problem or "")
    return verdict or None, code or int(verdict != ""), outcomes


def _attempt(options: argparse.Namespace, sim: Simulation, fly: Callable[[Simulation], object],
             stop: Path | None) -> tuple[str | None, int]:
    from fledge import mission as missions

    assert sim.mission
    try:
        fly(sim)
    except Stopped as error:
        assert stop is not None
        stop.write_bytes(sim.snapshot())
        return f"stopped at {sim.time:g} s: {error}; the state is in {stop}", 1
    except KeyboardInterrupt:
        return "interrupted", 130
    except CompositionError:
        raise
    except AssertionError as error:
        trace(options)
        return "failed: " + missions.explain(error, sim.mission.folder), 1
    except Exception as error:
        trace(options)
        return missions.explain(error, sim.mission.folder), 2 if isinstance(error, SetupError) else 1
    return None, 0


def judge(options: argparse.Namespace, job: Job, target: str, records: dict[str, Archive],
          exchange: Archive | None = None) -> tuple[str | None, int, list[Outcome]]:
    """Run the job's scenario with the records in the place of its flight processes (fledge.targets.playback). Returns
    the same as attempt(). With --report, what `fledge run --report` writes goes into the folder TARGET_run beside the
    records."""
    import fledge
    from fledge.commands import read_script
    from fledge.targets.playback import stand_in

    sim = fledge.load(job.source, job.seed, **job.parameters)
    assert sim.mission
    packets = {part.process: read_script(part.telemetry(target).read_text()) for part in job.parts
               if part.telemetry(target).exists()}
    stand_in(sim, records, exchange, packets)
    if not options.report:
        sim.plots = False
        return attempt(options, sim, job.scenario, sim.mission.scenarios[job.scenario])
    return reported(options, sim, job.scenario, f"on {target}", job.folder / f"{target}_run", target=target)


def reported(options: argparse.Namespace, sim: Simulation, scenario: str, where: str, folder: Path,
             **metadata: str) -> tuple[str | None, int, list[Outcome]]:
    """Run a scenario, and write what `fledge run --report` writes into a folder. Returns the same as attempt()."""
    with alone(folder):
        return _reported(options, sim, scenario, where, folder, metadata)


def _reported(options: argparse.Namespace, sim: Simulation, scenario: str, where: str, folder: Path,
              metadata: dict[str, str]) -> tuple[str | None, int, list[Outcome]]:
    import fledge
    from fledge import report as pages

    assert sim.mission
    function = sim.mission.scenarios[scenario]
    plots = sim.plots = Plots(folder)
    report = pages.Report(sim, f"{scenario}, {where}", function)
    sim.archives_motion = True
    sim.archive(folder / "run.mcap", mission=sim.name, scenario=scenario, fledge=fledge.__version__, **metadata,
                **sim.mission.metadata())
    problem, code, outcomes = attempt(options, sim, scenario, function)
    path = sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    page = report.write(folder / "report.html", pages.Outcome(
        "failed" if problem else "passed", (problem or "").removeprefix("failed: "), Path(path) if path else None,
        plots.whole(), command_line(options)))
    say(f"  report   {page}")
    return problem, code, outcomes


def show_required(outcomes: Sequence[Outcome], where: str = "") -> None:
    """Print how many requirements hold, and each that does not. where: on which targets, if on several."""
    if not outcomes:
        return
    count = {verdict: sum(outcome.verdict == verdict for outcome in outcomes) for verdict in (HOLDS, VIOLATED, UNKNOWN)}
    counts = [f"{n} {word}" for n, word in zip(count.values(), ("hold", "violated", "unknown")) if n]
    say("  required " + (f"{where}: " if where else "") + ", ".join(counts))
    for outcome in outcomes:
        if outcome.verdict != HOLDS:
            say(f"           {outcome}")
            if outcome.verdict == VIOLATED and outcome.requirement.skew:
                say(f"           {outcome.requirement.id}: {outcome.requirement.skew}")
