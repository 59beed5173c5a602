# SPDX-License-Identifier: Apache-2.0
"""`fledge run MISSION [SCENARIO]`: a scenario on this desktop, with its record, plots, verdicts and page.

Exit codes: 0 it passed, or nothing judges it; 1 a check or requirement does not hold, or the run failed; 2 the command
line or the mission is wrong; 130 Ctrl-C.
"""
from __future__ import annotations

import argparse
import os
from pathlib import Path

from fledge.cli.arguments import (add_mission, add_parameters, add_seed, add_update_limit, flight_time,
                                  given_parameters, number)
from fledge.cli.console import Plots, cannot_fly, placed, say, size_of
from fledge.cli.failures import in_words
from fledge.cli.runs import RUNS, alone, folder_of
from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from fledge.mission.simulation import Simulation


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub = command("run", run, "run nadir_spin --pace 10")
    add_mission(sub)
    sub.add_argument("scenario", nargs="?", help="default: the mission's first")
    sub.add_argument("--out", metavar="DIR", help="for the record and plots; default: runs/MISSION/SCENARIO")
    sub.add_argument("--as", dest="name", metavar="NAME", help="keep the run under this name, in runs/kept/NAME: plot, "
                     "compare and convert find it by NAME")
    sub.add_argument("--replace", action="store_true", help="with --as: in place of the run that has the name")
    add_seed(sub)
    sub.add_argument("--pace", type=number(), default=0.0, metavar="X",
                     help="X simulated seconds per second; default: as fast as possible")
    sub.add_argument("--strict", action="store_true", help="a run with a finding about its health has failed")
    sub.add_argument("--stop", action="store_true", help="end the run at the first violation of a requirement, and "
                     "keep the state in violated.snapshot")
    sub.add_argument("--no-plots", action="store_true", help="leave out the scenario's plots")
    sub.add_argument("--report", action="store_true", help="write all about the run into one page, report.html")
    sub.add_argument("--for", dest="duration", metavar="DURATION",
                     help="fly without a scenario for this long (90s, 10min, 2h), recording all outputs")
    sub.add_argument("--outputs", metavar="FILE", help="write a record of all outputs too, each at the instants at "
                     "which it has changed")
    sub.add_argument("--check-replay", action="store_true", help="fly it again, in another process with another "
                     "environment; the run has failed if an output differs, which is named")
    add_update_limit(sub)
    sub.set_defaults(needs=lambda options: ["try view"] * options.report)
    add_parameters(sub)


def run(options: argparse.Namespace) -> int:
    import fledge

    from fledge.mission.scenario import lacking

    if options.name and options.out:
        raise Failure("run: give a name with --as, or a folder with --out; not both")
    if options.replace and not options.name:
        raise Failure("run: --replace is for --as")
    if options.outputs and options.check_replay:
        raise Failure("run: give --outputs or --check-replay, which writes such records of its own; not both")
    sim = fledge.load(options.mission, options.seed, **given_parameters(options))
    name, fly = _scenario(sim, options)
    for problems in lacking(sim, [name] if not options.duration else []).values():
        raise Failure(cannot_fly(placed(problems)))
    folder = folder_of(options.name, replace=True) if options.name else \
        Path(options.out) if options.out else RUNS / sim.name / name
    with alone(folder, "give another folder with --out, or a name with --as"):
        if options.name:    # again: another run may have taken the name meanwhile
            folder_of(options.name, options.replace)
        flight = _Run(options, sim, name, fly, folder)
        flight.fly()
        flight.show()
        return flight.verdict()


class _Run:
    """A scenario that flies into a folder, and what comes of it."""

    def __init__(self, options: argparse.Namespace, sim: Simulation, name: str,
                 scenario: Callable[[Simulation], object], folder: Path) -> None:
        import fledge
        from fledge.cli import check_replay

        assert sim.mission
        self.options, self.sim, self.name, self.scenario, self.folder = options, sim, name, scenario, folder
        sim.pace = options.pace
        sim.plots = Plots(folder) if not options.no_plots else False
        sim.archives_motion = True
        sim.archive(folder / "run.mcap", mission=sim.name, scenario=name, fledge=fledge.__version__,
                    **sim.mission.metadata())
        self.replay = check_replay.Replay(folder) if options.check_replay else None
        if self.replay or options.outputs:
            sim.archive_outputs(self.replay.first if self.replay else options.outputs)
        self.report = _report(sim, name) if options.report else None
        self.title = f"{sim.name}, {name}"
        about = sim.mission.summaries().get(name)
        say(self.title + (f": {about}" if about else ""))

    def fly(self) -> None:
        """Fly it, and judge it by all that may."""
        from fledge.cli import health
        from fledge.cli.judge import attempt
        from fledge.mission.checks import has_checks

        options, sim = self.options, self.sim
        try:
            self.problem, self.code, self.outcomes = attempt(
                options, sim, self.name, self.scenario, self.folder / "violated.snapshot" if options.stop else None)
        except Exception:
            if self.replay:
                self.replay.give_up()
            raise
        sim.close_outputs()
        self.judged = not options.duration and (has_checks(self.scenario) or bool(self.outcomes))
        self.again = ""     # what a second flight had the same
        if self.replay:
            different, self.again = self.replay.fly(options, sim, self.code)
            self.problem = "; ".join(filter(None, [self.problem, different])) or None
            self.code = self.code or int(different != "")
        self.findings = sim.health
        if options.strict and self.findings and not self.problem:
            self.problem, self.code = health.refusal(self.findings), 1
        self.plots = self._plots()

    def _plots(self) -> list[Path]:
        plots = self.sim.plots
        if not isinstance(plots, Plots):
            return []
        return self._written(plots.whole) or plots.saved

    def _written(self, write: Callable[[], Any]) -> Any:
        """The result of a function that writes; None where it cannot, as on a full disk, by which the run has failed,
        besides what else was wrong with it."""
        try:
            return write()
        except OSError as error:
            self.problem = f"{self.problem}\n  {in_words(error)}" if self.problem else f"failed: {in_words(error)}"
            self.code = self.code or 1
            return None

    def show(self) -> None:
        """Print what came of it, and write the summary and the page."""
        from fledge.cli import health
        from fledge.cli.judge import show_required

        sim = self.sim
        self._show_times()
        record = sim.close_archive(outcome=self.problem or "passed", ended=f"{sim.time:g} s")
        self._show_record(record)
        for plot in self.plots:
            say(f"  plot     {plot}")
        show_required(self.outcomes)
        for line in sim.assumptions:
            say(f"  assumed  {line}")
        health.show_modes(sim)
        health.show(self.findings)
        if summary := self._written(lambda: health.write(self.folder / "summary.json", sim, self.name, self.problem,
                                                         self.findings, self.outcomes)):
            say(f"  summary  {summary}")
        if record:
            self._put_aside()
        if self.report and (report := self._written(lambda: self._write_report(record))):
            say(f"  report   {report}")

    def _show_times(self) -> None:
        sim = self.sim
        say(f"  flown    {sim.time:g} s in {sim.wall:.3g} s"
            + (f", {sim.time / sim.wall:,.0f} times real time" if sim.wall > 0 else "")
            + (f"; no task runs at the end, the state is that of {sim.state_time:g} s"
               if sim.state_time < sim.time else ""))
        if self.again:
            say(f"  replay   {self.again}")
        if sim.pace and sim.pace_report["overruns"]:
            late = sim.pace_report
            say(f"  pace     {late['overruns']} of {late['instants']} instants were late, by up to "
                f"{1e3 * late['worst']:.1f} ms")

    def _show_record(self, record: Any) -> None:
        if record:
            say(f"  record   {record} ({size_of(record)})")
            return
        earlier = self.folder / "run.mcap"
        say("  record   none" + ("" if self.problem else ": the scenario records nothing")
            + (f"; {earlier} is of an earlier run" if earlier.exists() else ""))

    def _put_aside(self) -> None:
        """Rename the pages that show the record of the run before."""
        for page in ["view.html"] + ["report.html"] * (not self.report):
            if os.path.lexists(self.folder / page):
                earlier = self.folder / f"earlier-{page}"
                os.replace(self.folder / page, earlier)
                say(f"  earlier  {earlier}: {page} of the run before")

    def _write_report(self, record: Any) -> Path:
        import shlex

        from fledge.report import Outcome

        options = self.options
        verdict = {0: "passed" if self.judged else "flown", 130: "interrupted"}.get(self.code, "failed")
        command = ["./fledge", "run", Path(options.mission).name, *([options.scenario] if options.scenario else []),
                   *(["--for", options.duration] if options.duration else []),
                   *(["--seed", str(options.seed)] if options.seed else []),
                   *(["--as", options.name, "--replace"] if options.name else []),
                   *(word for text in options.parameters for word in ("--set", text))]
        message = (self.problem or "").removeprefix("failed: ") if self.code != 130 else ""
        return self.report.write(self.folder / "report.html", Outcome(
            verdict, message, Path(record) if record else None, None if options.no_plots else self.plots,
            shlex.join(command)))

    def verdict(self) -> int:
        """Print the last line. Raises Failure of a run that has failed."""
        if self.problem:
            say("  interrupted" if self.code == 130 else "  failed")
            raise Failure(f"{self.title} {self.problem}" if self.code == 130 else f"{self.title}: {self.problem}",
                          self.code)
        if self.judged:
            say("  passed")
        elif not self.options.duration:
            say("  ended    nothing judges it: the scenario has no check, and the mission no requirement for it")
        return 0


def _scenario(sim: Simulation, options: argparse.Namespace) -> tuple[str, Callable[[Simulation], object]]:
    """(name, function of a simulation) to fly."""
    duration = flight_time(options)
    if duration is not None:
        if options.scenario:
            raise Failure("run: give a scenario, or --for a duration to fly freely; not both")
        every = min(1.0, duration / 10)

        def free(sim: Simulation) -> None:
            sim.record(*(instance for process in sim.processes for instance in process), every=every)
            sim.run(duration)

        return "free", free
    assert sim.mission
    if not sim.mission.scenarios and options.scenario not in sim.mission.functions:
        raise Failure(f"the mission {sim.name} has no scenarios: write one in scenarios.py, or fly it with --for 10min")
    from fledge.mission.scenario import chosen

    return chosen(sim, options.scenario)


def _report(sim: Simulation, name: str) -> Any:
    from fledge.report import Report

    assert sim.mission
    return Report(sim, name, sim.mission.scenarios.get(name))
