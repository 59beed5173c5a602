# SPDX-License-Identifier: Apache-2.0
"""A flight with a fault, compared with the flight of the same scenario without it."""

from __future__ import annotations

import functools
import math
import operator
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from fledge.analysis.matrix import Fault, Matrix
from fledge.mission.field_path import FieldPath
from fledge.objects.si import enumerator_names


@dataclass
class Flight:
    """A flight with a fault, or with two. Times are [s] since the fault began; None: it did not happen.

    mode: that flight was in as the fault began, "" of a process without modes
    effect: "none", where no output of flight and no attitude differs from the undisturbed flight by a bit; "tolerated",
    or "unjudged" where nothing judges the flight; "violated": a requirement does not hold that held without the fault;
    of a mission without requirements: a check of the scenario; "unknown": one cannot be judged; "failed": the run did
    not come to its end
    detected, by: when flight first reported a problem, and how
    isolated, as_: when it took a unit that has the fault out of use; wrongly: units without a fault that it took out
    back: when flight was back for good: in the modes of the undisturbed flight, and with each comparison of a violated
    requirement true that is true there; None: it was not by the end. 0: it never left
    ends: the mode at the end; violated, unknown: requirement -> its margin in words; least: of those that hold, the one
    that lost most: (requirement, share of the undisturbed margin that is left, the margin in words)
    text: the check or the error that ended it; off, off_end: [deg] from the attitude of the undisturbed flight, at most
    and at the end
    """
    scenario: str
    mode: str
    begin: float
    faults: list[Fault]
    effect: str = "none"
    detected: float | None = None
    by: str = ""
    isolated: float | None = None
    as_: str = ""
    wrongly: list[str] = field(default_factory=list)
    back: float | None = None
    ends: str = ""
    violated: dict[str, str] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    least: tuple[str, float, str] | None = None
    text: str = ""
    off: float = 0.0
    off_end: float = 0.0


class Seen(NamedTuple):
    """The results of a flight that are compared."""
    activity: list[Any]     # its happenings
    modes: dict[str, list[tuple[float, str]]]       # (t [s], mode) of each process with modes
    records: dict[str, tuple[Any, Any]]             # (times [ns], messages) of each port
    flights: set[str]       # the processes that fly
    duration: float         # [s]
    problem: str            # a check that does not hold, or an error
    failed: str             # "RunError" or "SetupError" that ended it; else ""
    judged: bool            # whether something holds that a fault can violate: a requirement; without any, a check
    outcomes: dict[str, Any]        # of requirements, by id
    traces: dict[tuple[str, str], Any]      # whether their comparisons held, over time


def mode_at(seen: Seen, t: float) -> str:
    """The modes in force, "safe", or "a: x, b: y" of several processes."""
    now = {process: [name for at, name in stays if at <= t][-1:] for process, stays in seen.modes.items()}
    return ", ".join(f"{process}: {names[0]}" if len(now) > 1 else names[0] for process, names in now.items() if names)


def compare(matrix: Matrix, name: str, baseline: Seen, seen: Seen, ns: int, faults: list[Fault]) -> Flight:
    """The changes in a scenario by faults that began at a time [ns]."""
    begin = ns / 1e9
    flight = Flight(name, mode_at(baseline, begin), begin, faults, text=seen.problem,
                    ends=mode_at(seen, seen.duration))
    reports = [*_new_happenings(baseline, seen, begin), *_worse(baseline, seen, ns)]
    for path in matrix.detecting:
        names = enumerator_names(FieldPath(matrix.simulation, path).field)
        reports += [(t, f"{path} is {names.get(ours, ours)}, not {names.get(theirs, theirs)}")
                    for t, ours, theirs in _differences(baseline, seen, path, ns)]
    isolated = []       # (t, unit, whether it has a fault)
    for path, units in matrix.isolating.items():
        own = functools.reduce(operator.or_, (units.get(fault.unit, 0) for fault in faults))
        named = matrix.named.get(path) or {bits.bit_length() - 1: unit for unit, bits in units.items()}
        for t, ours, theirs in _differences(baseline, seen, path, ns):
            for bit in range(32):
                if ours & ~theirs & 1 << bit:
                    isolated.append((t, named.get(bit, f"bit {bit} of {path}"), bool(own & 1 << bit)))
                    reports.append((t, f"{path}: {isolated[-1][1]}"))
    for t, unit, right in sorted(isolated):
        if right and flight.isolated is None:
            flight.isolated, flight.as_ = t - begin, unit
        elif not right and unit not in flight.wrongly:
            flight.wrongly.append(unit)
    if reports:
        t, flight.by = min(reports)
        flight.detected = t - begin
    flight.off, flight.off_end = _off(baseline, seen, begin)
    _judge(flight, baseline, seen, begin)
    return flight


def _new_happenings(baseline: Seen, seen: Seen, begin: float) -> Iterator[tuple[float, str]]:
    """(t, text) of each event, mode, command or reset of flight that the undisturbed flight has not as often."""
    left = Counter(happening[1:4] for happening in baseline.activity if happening.t >= begin)
    for happening in seen.activity:
        if happening.t >= begin and happening.process in seen.flights:
            left[happening[1:4]] -= 1
            if left[happening[1:4]] < 0:
                yield happening.t, f"{happening.kind} {happening.process}.{happening.name}"


def _ports(baseline: Seen, seen: Seen, ns: float) -> Iterator[tuple[str, Any, Any, Any]]:
    """(name, times [ns], messages of this flight, of the undisturbed one) of each output of flight since the fault."""
    for name, (t, ours) in seen.records.items():
        other_t, theirs = baseline.records.get(name, (t[:0], ours[:0]))
        n = min(len(t), len(other_t))
        if name.partition(".")[0] in seen.flights and (t[:n] == other_t[:n]).all():
            first = int(t[:n].searchsorted(ns))
            yield name, t[first:n], ours[first:n], theirs[first:n]


def _worse(baseline: Seen, seen: Seen, ns: int) -> Iterator[tuple[float, str]]:
    """(t, text) where the quality of an output of flight is first worse than in the undisturbed flight."""
    for name, t, ours, theirs in _ports(baseline, seen, ns):
        if "head" in (ours.dtype.names or ()):
            at = (ours["head"]["quality"] < theirs["head"]["quality"]).nonzero()[0]
            if len(at):
                yield t[at[0]] / 1e9, f"quality of {name}"


def _differences(baseline: Seen, seen: Seen, path: str, ns: int) -> Iterator[tuple[float, int, int]]:
    """(t [s], this number, that of the undisturbed flight) of a path, at each sample at which they differ."""
    import numpy as np

    port, _, rest = path.partition(".")
    instance, _, rest = rest.partition(".")
    output, _, member = rest.partition(".")
    for name, t, ours, theirs in _ports(baseline, seen, ns):
        if name == f"{port}.{instance}.{output}":
            ours, theirs = (np.asarray(_member(values, member)).reshape(len(t), -1) for values in (ours, theirs))
            for i, k in zip(*(ours != theirs).nonzero()):
                yield t[i] / 1e9, int(ours[i, k]), int(theirs[i, k])


def _member(values: Any, member: str) -> Any:
    for name, index in re.findall(r"(\w+)(?:\[(\d+)\])?", member):
        values = values[name]
        values = values[..., int(index)] if index else values
    return values


def _off(baseline: Seen, seen: Seen, begin: float) -> tuple[float, float]:
    """[deg] Between the attitudes of both flights, at most and at the end."""
    import numpy as np

    from fledge import attitude

    most = end = 0.0
    for name, (t, ours) in seen.records.items():
        if name in baseline.records and "sigma_BN" in (ours.dtype.names or ()) and name.partition(".")[0] not in \
                seen.flights:
            theirs = baseline.records[name][1]["sigma_BN"]
            n = min(len(ours), len(theirs))
            ours, theirs = ours["sigma_BN"][:n], theirs[:n]
            apart = np.degrees(attitude.angle(attitude.relative(ours, theirs)))
            apart = np.where((ours == theirs).all(axis=-1), 0.0, apart)[t[:n] >= begin * 1e9]
            if len(apart):
                most, end = max(most, float(apart.max())), max(end, float(apart[-1]))
    return most, end


def _judge(flight: Flight, baseline: Seen, seen: Seen, begin: float) -> None:
    """The effect of the fault, and whether flight is back."""
    for name, outcome in seen.outcomes.items():
        if baseline.outcomes[name].verdict == "holds":
            if outcome.verdict != "holds":
                (flight.violated if outcome.verdict == "violated" else flight.unknown)[name] = outcome.margin_text
            else:
                share = outcome.margin / baseline.outcomes[name].margin if baseline.outcomes[name].margin else 0.0
                if math.isfinite(share) and (flight.least is None or share < flight.least[1]):
                    flight.least = name, share, outcome.margin_text
    same = not flight.text and flight.detected is None and flight.off == 0.0 and all(
        ours.tobytes() == theirs.tobytes() for _, _, ours, theirs in _ports(baseline, seen, begin * 1e9))
    # A check counts where there are no requirements, or where it has ended the run before they could be judged.
    broken = bool(seen.problem and not baseline.problem and (flight.unknown or not seen.outcomes))
    flight.effect = "failed" if seen.failed else "violated" if broken or flight.violated else "unknown" if \
        flight.unknown else "none" if same else "tolerated" if baseline.judged else "unjudged"
    if seen.failed or broken or seen.duration < baseline.duration:
        return
    away = [begin, *(t for process, stays in seen.modes.items() for t in _apart(stays, baseline.modes[process], begin))]
    never = set(flight.violated)     # those in which a comparison never holds
    for key, (times, held) in seen.traces.items():
        n = min(len(times), len(baseline.traces[key][0]))
        wrong = (~held[:n] & baseline.traces[key][1][:n] & (times[:n] >= begin)).nonzero()[0]
        if key[0] in flight.violated and len(wrong):
            never.discard(key[0])
            away.append(times[wrong[-1]] if wrong[-1] < n - 1 else math.inf)
    if not never and max(away) < math.inf and all(stays[-1:] and stays[-1][1] == baseline.modes[process][-1][1]
                                                  for process, stays in seen.modes.items()):
        flight.back = float(max(away)) - begin


def _apart(stays: Sequence[tuple[float, str]], others: Sequence[tuple[float, str]], begin: float) -> Iterator[float]:
    """The times at which a mode begins that both flights have, after a time in which they differed."""
    ours = theirs = ""
    for t in sorted({t for t, _ in (*stays, *others)}):
        before = ours == theirs
        ours = next((name for at, name in reversed(stays) if at <= t), "")
        theirs = next((name for at, name in reversed(others) if at <= t), "")
        if t >= begin and not before and ours == theirs:
            yield t
