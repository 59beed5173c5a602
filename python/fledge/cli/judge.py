# SPDX-License-Identifier: Apache-2.0
"""A scenario with its checks, plots and report: of this program's flight, or of what a target's flight put out."""
from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from fledge.cli.console import Plots, say, trace
from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable

    from fledge.archive import Archive
    from fledge.cosim.up.description import Plan
    from fledge.mission.simulation import Simulation
    from fledge.targets import Job


def attempt(options: argparse.Namespace, sim: Simulation, fly: Callable) -> tuple[str | None, int]:
    """Fly a scenario; returns (what is wrong or None, the exit code)."""
    from fledge import SetupError, mission as missions

    assert sim.mission
    try:
        fly(sim)
    except KeyboardInterrupt:
        return "interrupted", 130
    except AssertionError as error:
        trace(options)
        return "failed: " + missions.explain(error, sim.mission.folder), 1
    except Exception as error:
        trace(options)
        return missions.explain(error, sim.mission.folder), 2 if isinstance(error, SetupError) else 1
    return None, 0


def judge(options: argparse.Namespace, job: Job, target: str, records: dict[str, Archive],
          exchange: Archive | None = None) -> str:
    """Run the job's scenario with the records in the place of its flight processes (fledge.targets.playback). Returns
    what is wrong in words; "" if its checks hold. With --report, what `fledge run --report` writes goes into the folder
    TARGET_run beside the records."""
    import fledge
    from fledge.commands import read_script
    from fledge.targets.playback import stand_in

    sim = fledge.load(job.asked, job.seed, **job.parameters)
    assert sim.mission
    packets = {one.process: read_script(one.telemetry(target).read_text()) for one in job.parts
               if one.telemetry(target).exists()}
    stand_in(sim, records, exchange, packets)
    if not options.report:
        sim.plots = False
        return attempt(options, sim, sim.mission.scenarios[job.scenario])[0] or ""
    return reported(options, sim, job.scenario, f"on {target}", job.folder / f"{target}_run", target=target)


def reported(options: argparse.Namespace, sim: Simulation, scenario: str, where: str, folder: Path,
             **metadata: str) -> str:
    """Run a scenario, and write what `fledge run --report` writes into a folder. Returns what is wrong in words; "" if
    its checks hold."""
    import fledge
    from fledge.report import Outcome, Report

    assert sim.mission
    function = sim.mission.scenarios[scenario]
    folder.mkdir(exist_ok=True)
    plots = sim.plots = Plots(folder)
    report = Report(sim, f"{scenario}, {where}", function)
    sim.archive(folder / "run.mcap", mission=sim.name, scenario=scenario, fledge=fledge.__version__, **metadata,
                **sim.mission.metadata())
    problem, code = attempt(options, sim, function)
    path = sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    page = report.write(folder / "report.html", Outcome(
        "failed" if problem else "passed", (problem or "").removeprefix("failed: "), Path(path) if path else None,
        plots.whole(), shlex.join(["./fledge", *options.words])))
    say(f"  report   {page}")
    return problem or ""


def flown(plan: Plan, folder: Path) -> tuple[Simulation, str]:
    """(the mission, the name of its scenario) of a finished run of `fledge up --report`: what its flight computers put
    out comes from their records; the world runs. Of a program that was lost, the record is what is left of it."""
    import fledge
    from fledge.archive import Archive
    from fledge.cosim.up.missions import whole_mission
    from fledge.mission.scenario import chosen
    from fledge.targets.playback import stand_in

    first = whole_mission(plan)
    sim = fledge.load(str(first.mission), plan.seed, **first.parameters)
    records = {}
    for p in plan.nodes:
        if p.flies:
            place = folder / p.name / str(p.process) / str(p.target) if p.target else folder / p.name
            kept = [file for file in (place.with_name(f"{place.name}.mcap{end}") for end in ("", ".part"))
                    if file.exists()]
            if not kept:
                raise Failure(f"{place}.mcap, the record of {p.name}, is missing")
            records[str(p.process)] = Archive(kept[0])
    stand_in(sim, records, Archive(folder / "exchange.mcap"))
    return sim, chosen(sim, first.scenario)[0]
