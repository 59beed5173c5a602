# SPDX-License-Identifier: Apache-2.0
"""The health of a run, on the terminal and as JSON."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fledge.cli.console import counted, say

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.mission.simulation import Finding, Simulation
    from fledge.requirements import Outcome

SHOWN = 6


def show(findings: Sequence[Finding], process: str = "") -> Sequence[Finding]:
    """Print the first findings, a line each; returns all. process: of a program that prints beside others."""
    title = f"  health   {process + ': ' if process else ''}"
    groups: dict[tuple, list[Finding]] = {}     # a fault passes from module to module: at the same updates
    for finding in findings:
        groups.setdefault((finding.kind, finding.first, finding.updates) if finding.updates else (finding.text,),
                          []).append(finding)
    for group in list(groups.values())[:SHOWN]:
        say(title + group[0].text + (f"; and so {counted(len(group) - 1, 'other')}" if len(group) > 1 else ""))
    if len(groups) > SHOWN:
        say(f"{title}and {len(groups) - SHOWN} more kinds")
    if not findings:
        say(title + "no output was missing, held, degraded, stale, limited or not finite")
    return findings


def show_modes(sim: Simulation) -> None:
    """Print a line for each process with modes: those that it was in."""
    for process in sim.processes:
        began = [f"{name} at {first:g} s" + (f", {n} times" if n > 1 else "")
                 for name, (n, first) in process.entered.items() if first is not None]
        never = [name for name, (n, _) in process.entered.items() if not n]
        if began:
            say(f"  modes    {process.name}: {'; '.join(began)}" + (f"; never {', '.join(never)}" if never else ""))


def refusal(findings: Sequence[Finding]) -> str:
    """Why --strict fails a run."""
    return f"failed: --strict, and its health has {counted(len(findings), 'finding')}: {findings[0].text}"


def write(path: Path, sim: Simulation, scenario: str, problem: str | None, findings: Sequence[Finding],
          outcomes: Sequence[Outcome] = ()) -> Path:
    """Write the facts of a run as JSON, the same bytes for the same run; returns the path."""
    import json

    from fledge.disk import Part
    from fledge.records.activity import facts

    data = {"mission": sim.name, "scenario": scenario, "seed": sim.seed, "outcome": problem or "passed",
            "time": sim.time, "state_time": sim.state_time, "health": [finding._asdict() for finding in findings],
            "assumptions": sim.assumptions, "processes": facts(sim)}
    if outcomes:
        data["requirements"] = [{"id": outcome.requirement.id, "verdict": outcome.verdict,
                                 "margin": outcome.margin_text, "at": outcome.at, "where": outcome.where,
                                 "reason": outcome.reason} for outcome in outcomes]
    with Part(path) as part:
        part.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return path
