# SPDX-License-Identifier: Apache-2.0
"""Flights of a job on several targets, each compared with the desktop's."""
from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.archive import Archive, ArchiveError
from fledge.archive.compare import Difference, compare, digest
from fledge.errors import Failure, RunError, SetupError
from fledge.targets import TARGETS
from fledge.targets.flight import fly

if TYPE_CHECKING:
    from fledge.targets.flown import Flown
    from fledge.targets.job import Job, Part
    from fledge.targets.target import Target

Bound = tuple[str, float, float, str]   # a field, how much, [s] from when on, where it stands


class Comparison:
    """A job on several targets, each compared with the desktop.

    runs: name -> the target of each process; lacking: why a target, by its name, cannot fly; patience: [s] as of fly();
    pace: simulated seconds per second, 0 for none. Of what has flown, wrong: run -> what is wrong with it; rows: as of
    table.lines(); records: run -> process -> its record.
    """

    def __init__(self, job: Job, runs: dict[str, dict[str, Target]], bounds: list[Bound], lacking: dict[str, str],
                 patience: float, pace: float) -> None:
        self.job, self.bounds, self.lacking, self.patience, self.pace = job, bounds, lacking, patience, pace
        self.runs: dict[str, dict[str, Target]] = {"desktop": {}, **runs}
        self.interrupted = False
        self.wrong: dict[str, list[str]] = {name: [] for name in self.runs}
        self.rows: list[tuple[str, Flown | None, str, str]] = []
        self.notes: list[str] = []
        self.archives: dict[Path, Archive] = {}
        self.records: dict[str, dict[str, Archive]] = {}
        self._first: dict[str, tuple[str, Archive]] = {}        # process -> the first run through boards, its record
        self._bits: dict[tuple[str, Part], str] = {}            # (run, process) -> a hash of its outputs

    def title(self, name: str) -> str:
        """The name of a run; of one with targets for some of several processes, these, as --on has them."""
        return name if name != "apart" else ",".join(f"{process}={target.name}" for process, target
                                                     in self.runs[name].items() if target.name != "desktop") or "apart"

    def fly(self, complain: Callable[[str], None]) -> None:
        """All runs, one after the other, until Ctrl-C. complain: gets the reason of each that fails, at once."""
        for name, on in self.runs.items():
            if any(target.name in self.lacking for target in on.values()):     # whose reason was printed
                self._absent(name)
                continue
            try:
                flown = self._flown(name, on)
            except (Failure, SetupError, RunError, ArchiveError, OSError) as error:
                complain(f"{name}: {error}")
                self._absent(name)
                continue
            except KeyboardInterrupt:
                complain(f"{name}: interrupted")
                self._absent(name)
                self.interrupted = True
                for later in list(self.wrong)[list(self.wrong).index(name) + 1:]:
                    self.wrong[later].append("did not fly")
                break
            for part in self.job.parts:
                self._compare(name, part, flown[part.process])

    def _absent(self, name: str) -> None:
        self.rows.append((name, None, "", "did not fly"))
        self.wrong[name].append("did not fly")

    def _flown(self, name: str, on: dict[str, Target]) -> dict[str, Flown]:
        """Fly a run, and open its records."""
        if on and "desktop" not in self.records:
            raise Failure("there is no flight of the desktop to compare with")
        desktop: Any = TARGETS["desktop"]
        flown: dict[str, Flown] = fly(self.job, on, name, self.patience, self.pace) if on else desktop.fly(self.job)
        records = self.records[name] = {}
        for part in self.job.parts:
            path = flown[part.process].record
            if path not in self.archives:
                self.archives[path] = Archive(path)
            records[part.process] = self.archives[path]
        return flown

    def _compare(self, name: str, part: Part, flight: Flown) -> None:
        """Compare one process of a run with the desktop's, and add its row."""
        on, several = self.runs[name], len(self.job.parts) > 1
        place = on[part.process].name if on else "desktop"
        title = f"{part.process} on {place}" if several else place
        text, problem = self._differences(name, part, flight) if on else ("", "")
        bits = self._bits[name, part] = digest(self.records[name][part.process], part.outputs, part.is_instant)
        if on and bits == self._bits["desktop", part] and (other := part.unequal_telemetry(place)):
            text, problem = f"{text}; {other}", problem or "telemetry differs from the desktop's"
        refusals = part.refusals(flight.reports or (part.reports(place) if on else ()))
        self.notes += [f"refused  {title}: {refusal}" for refusal, _ in refusals]
        if on:
            self.notes += [f"script   {place}: {failure}" for failure in part.failures(place)]
        if not all(expected for _, expected in refusals):
            problem = problem or "a command was refused"
        if problem:
            self.wrong[name].append(f"{part.process} {problem}" if several else problem)
        self.rows.append((title, flight, bits, text))

    def _differences(self, name: str, part: Part, flight: Flown) -> tuple[str, str]:
        """(how a process differs from the desktop's, for the table; what is wrong or "")"""
        desktop, archive = (self.records[run][part.process] for run in ("desktop", name))
        if not self.job.rounds:
            found = compare(desktop, archive, part.compared(desktop, archive), times=part.is_instant)
            return (str(found[0]), "differs from the desktop") if found else ("none", "")
        text, problem = _rounded(desktop, archive, part, flight, self.bounds)
        first, its = self._first.setdefault(part.process, (name, archive))
        if first != name:
            others = compare(its, archive, part.outputs)
            problem = problem or (f"differs from {first}" if others else "")
            text = f"from {first}: {others[0]}" if others else f"none from {first}; {text}"
        return text, problem


def _rounded(desktop: Archive, archive: Archive, part: Part, flown: Flown, bounds: list[Bound]) -> tuple[str, str]:
    """(the text for the table, what is wrong or "") of a flight through words that round.

    bounds: (field, bound, [s] from when on, place) of each."""
    @cache
    def differences(after: float) -> list[Difference]:
        return compare(desktop, archive, part.outputs, ignore=["sequence"],
                       times=lambda t: part.is_instant(t) & (t >= after * 1e9))

    largest = differences(0.0)
    structure = next((difference for difference in largest if difference.what), None)
    if structure:
        return str(structure), "differs from the desktop"
    problem, texts = "", []
    for field, bound, after, _ in bounds:
        if not part.puts_out(field):
            continue    # of another process
        if after > part.job.duration:
            texts.append(f"{field} not judged, which has its bound from {after:g} s on")
            continue
        near = [difference for difference in differences(after)
                if f".{difference.topic}.{_plain(difference.name)}".endswith("." + field)]
        worst = max((difference.worst for difference in near), default=0.0)
        problem = problem if worst <= bound else f"{field} is beyond its bound"
        texts.append(f"{field} up to {worst:.3g}, {'within' if worst <= bound else 'BEYOND'} {bound:g}")
    if not texts:
        numbers = [difference for difference in largest if difference.worst]
        texts = [f"rounded; {max(numbers, key=lambda difference: difference.worst).topic} up to "
                 f"{max(difference.worst for difference in numbers):.3g}" if numbers else "none"]
    if flown.saturated:
        texts.append(f"{flown.saturated} numbers beyond the range of their words")
    if flown.lost:
        texts.append(f"{flown.lost} packets lost in queues, or skipped")
    return "; ".join(texts), problem


def _plain(name: str) -> str:
    return re.sub(r"\[\d+\]", "", name)
