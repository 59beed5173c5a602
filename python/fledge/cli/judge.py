# SPDX-License-Identifier: Apache-2.0
"""A scenario with its checks, plots and report: of this program's flight, or of what a target's flight put out."""
from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from fledge.cli.console import Plots, say, trace

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable

    from fledge.archive import Archive
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
    from fledge.report import Outcome, Report
    from fledge.targets.playback import stand_in

    sim = fledge.load(job.asked, job.seed, **job.parameters)
    assert sim.mission
    packets = {one.process: read_script(one.telemetry(target).read_text()) for one in job.parts
               if one.telemetry(target).exists()}
    stand_in(sim, records, exchange, packets)
    function = sim.mission.scenarios[job.scenario]
    if not options.report:
        sim.plots = False
        return attempt(options, sim, function)[0] or ""
    folder = job.folder / f"{target}_run"
    folder.mkdir(exist_ok=True)
    plots = sim.plots = Plots(folder)
    report = Report(sim, f"{job.scenario}, on {target}", function)
    sim.archive(folder / "run.mcap", mission=sim.name, scenario=job.scenario, target=target,
                fledge=fledge.__version__, **sim.mission.metadata())
    problem, code = attempt(options, sim, function)
    path = sim.close_archive(outcome=problem or "passed", ended=f"{sim.time:g} s")
    page = report.write(folder / "report.html", Outcome(
        "failed" if problem else "passed", (problem or "").removeprefix("failed: "), Path(path) if path else None,
        plots.whole(), shlex.join(["./fledge", *options.words])))
    say(f"  report   {page}")
    return problem or ""
