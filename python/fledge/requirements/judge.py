# SPDX-License-Identifier: Apache-2.0
"""Requirements, judged while a simulation runs or from a record: verdict, margin, when and where."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from fledge import _core
from fledge.commands import NUMBERS, Code, Reason
from fledge.errors import SetupError, Stopped
from fledge.records.series import ACTIVITY, MODE, Records
from fledge.requirements.formula import Comparison, Formula, Signal, number_text, time_text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fledge.mission.simulation import Simulation
    from fledge.requirements.declared import Requirement

CODES = {code.name.lower(): code for code in Code}
BECOMES = ("executed", "accepted", "refused")
HOLDS, VIOLATED, UNKNOWN = "holds", "violated", "unknown"
STALE = 1   # of Quality: this and less is unknown
_EVENT, _ACCEPTED, _EXECUTED = 1, 2, 3      # of ActivityKind

Key: TypeAlias = "tuple[object, ...]"       # equal of what is the same


@dataclass
class Outcome:
    """verdict: "holds", "violated" or "unknown"; margin: how far the formula is from the other truth, > 0 if it holds,
    +-inf where only names decide, None if unknown; low, high: what is known of it; unit: of the margin, "-" of a plain
    number, "" of a fraction of the limit;
    at: [s] when the margin was decided; where: the comparison that decided; reason: why it is unknown"""
    requirement: Requirement
    verdict: str
    margin: float | None
    low: float
    high: float
    unit: str
    at: float | None
    where: str
    reason: str = ""

    @property
    def margin_text(self) -> str:
        """ "0.012 rad", "12 % of the limit"; "" where there is none."""
        if self.margin is None or math.isinf(self.margin):
            return ""
        return number_text(self.margin, self.unit) if self.unit else f"{100 * self.margin:.3g} % of the limit"

    def __str__(self) -> str:
        reason = {HOLDS: f"margin {self.margin_text}" if self.margin_text else "",
                  VIOLATED: f"by {self.margin_text.lstrip('-')}" if self.margin_text else "",
                  UNKNOWN: self.reason}[self.verdict]
        when = f"at {self.at:g} s, {self.where}" if self.at is not None and self.verdict != UNKNOWN else ""
        return f"{self.requirement.id} {self.verdict}" + "".join(f", {text}" for text in (reason, when) if text)


def problem_of(outcomes: Sequence[Outcome], time: float, problem: str = "") -> str:
    """The verdict on a run of a scenario, in every command and on every target: the problem in words, "" of a run that
    has passed. outcomes: of the requirements that the scenario shows; time: [s] flown; problem: what the scenario
    raised, in words."""
    violated = [outcome for outcome in outcomes if outcome.verdict == VIOLATED]
    if not problem and violated:
        return "failed: " + "; ".join(map(str, violated))
    return problem or ("" if time > 0 else "failed: it flew 0 s, which shows nothing")


def unit_of(formula: Formula) -> str | None:
    """The unit of its margin; None if its comparisons differ, so that each is taken as a fraction of its limit."""
    units = {tuple(comparison.signal.dims): comparison.unit
             for comparison in formula.comparisons if comparison.measured}
    return next(iter(units.values()), "") or "-" if len(units) <= 1 else None


class Judged:
    """Requirements that share their samples. Of a simulation: live; without one: of records."""

    def __init__(self, requirements: Sequence[Requirement], simulation: Simulation | None = None, *,
                 traces: bool = False) -> None:
        self.requirements, self._simulation = list(requirements), simulation
        self._judges: dict[int, _Judge] = {}    # by the time between samples
        self._formulas: list[tuple[_Judge, int]] = []
        for requirement in self.requirements:
            assert requirement.formula is not None
            judge = self._judges.setdefault(requirement.every, _Judge(simulation, requirement.every, traces))
            self._formulas.append((judge, judge.add(requirement.formula)))
        self._end: int | None = None

    def watch(self, stop: bool) -> None:
        """From now on the simulation's runs are judged."""
        assert self._simulation is not None
        for judge in self._judges.values():
            judge.core.stops = stop
            judge.core.watch(self._simulation.kernel)
        self._simulation.watches.append(self)

    def refuse_violation(self) -> None:
        """Raise Stopped if a violation has ended the run."""
        if any(judge.core.stop for judge in self._judges.values()):
            for judge in self._judges.values():
                judge.core.stop = judge.core.stops = False      # the user may go on
            violated = [outcome for outcome in self.outcomes(so_far=True) if outcome.verdict == VIOLATED]
            raise Stopped("; ".join(map(str, violated)), violated)

    def play(self, records: Records, end: int | None) -> None:
        """Judge the samples of a record. end: [ns] None: the last of them."""
        ends = [judge.play(records, end) for judge in self._judges.values()]
        self._end = max(ends, default=0)

    @property
    def units(self) -> list[str]:
        """Of the margins, as in Outcome."""
        return [unit_of(requirement.formula) or ""
                for requirement in self.requirements if requirement.formula is not None]

    @property
    def sources(self) -> list[Signal]:
        """Of requirements with one time between samples: the fields that play_samples() takes."""
        return [source for judge in self._judges.values() for source in judge.sources]

    def play_samples(self, times: NDArray[np.int64], values: Sequence[NDArray[np.float64]]) -> None:
        """Judge samples. times: (n,) [ns]; values: (n, elements) of each of the sources, NaN where unknown."""
        for judge in self._judges.values():
            judge.core.play(times, values)
        self._end = int(times[-1])

    def outcomes(self, so_far: bool = False) -> list[Outcome]:
        """Of each requirement, in their order. The runs have ended; so_far: verdicts that no later sample changes."""
        if so_far:
            return self._outcomes()
        end = self._end if self._simulation is None else max(self._simulation.time_ns, 0)
        assert end is not None
        self._end = end
        for judge in self._judges.values():
            judge.core.finish(end)
        return self._outcomes()

    def _outcomes(self) -> list[Outcome]:
        return [self._outcome(requirement, judge, number)
                for requirement, (judge, number) in zip(self.requirements, self._formulas)]

    def _outcome(self, requirement: Any, judge: _Judge, number: int) -> Outcome:
        low, high, low_t, low_atom, high_t, high_atom, unknown_t, unknown = judge.core.value(number)
        verdict = HOLDS if low > 0 else VIOLATED if high < 0 else UNKNOWN
        if judge.core.went_back:
            verdict, low, high = UNKNOWN, -math.inf, math.inf
        margin = {HOLDS: low, VIOLATED: high, UNKNOWN: None}[verdict]
        t, atom = (low_t, low_atom) if verdict != VIOLATED else (high_t, high_atom)
        where = judge.atoms[atom].text if atom >= 0 else ""
        reason = self._reason(requirement, judge, unknown, unknown_t) if verdict == UNKNOWN else ""
        if margin is not None and abs(margin) < 1e-300:
            margin = 0.0
        return Outcome(requirement, verdict, margin, low, high, unit_of(requirement.formula) or "",
                       t / 1e9 if t >= 0 else None, where, reason)

    def _reason(self, requirement: Any, judge: _Judge, atom: int, t: int) -> str:
        if judge.core.went_back:
            return "the simulation went back to an earlier state"
        if atom >= 0:
            written = "sent" if judge.atoms[atom].signal.events else "written"
            return f"{judge.atoms[atom].text}: what it reads was never {written}, or is stale, at {t / 1e9:g} s"
        reach = requirement.formula.reach
        if self._end is not None and reach > self._end:
            return f"the run ends at {time_text(self._end)}, and a window reaches to {time_text(reach)}"
        return "what decides it comes after the end of the run"

    def values(self, comparison: Comparison) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(time [s], the values that the comparison read), both (n,): for figures. Only with traces."""
        for judge in self._judges.values():
            number = judge.numbers.get(comparison.key)
            if number is not None:
                return judge.core.times / 1e9, judge.core.trace(number)
        raise SetupError(f"{comparison.text} is in no formula that was judged")


def highest(judged: Sequence[Judged]) -> Callable[[], NDArray[np.float64]]:
    """What reads, of each requirement of all of these, the largest margin that it can still have; < 0: it is violated,
    whatever may follow."""
    return _core.Highest([(judge.core, number) for each in judged for judge, number in each._formulas]).margins


def watched(simulation: Simulation, signals: Sequence[Signal], every: int) -> tuple[_core.Judge, list[list[int]]]:
    """A judge that looks at a simulation from now on, every so many ns, and of each signal the atoms whose traces are
    its elements."""
    judge = _Judge(simulation, every, traces=True)
    core = judge.core
    atoms = [[core.atom(core.expression("element", judge._signal(signal), i, 0.0), ">", 0.0, 1.0)
              for i in range(math.prod(signal.shape))] for signal in signals]
    core.watch(simulation.kernel)
    return core, atoms


class _Judge:
    """The formulas with one time between samples."""

    def __init__(self, simulation: Simulation | None, every: int, traces: bool) -> None:
        self.core = _core.Judge()
        self.core.every, self.core.traces = every, traces
        self._simulation, self._every = simulation, every
        self.atoms: list[Comparison] = []
        self.numbers: dict[Key, int] = {}       # of atoms of scale 1, and of others for their traces
        self._known: dict[Key, int] = {}        # atoms by their key and scale
        self._signals: dict[Key, int] = {}
        self.sources: list[Signal] = []

    def add(self, formula: Formula) -> int:
        """The number of a formula."""
        mixed = unit_of(formula) is None
        rows: list[tuple[str, int, int, int, int | None]] = []

        def node(formula: Formula) -> int:
            operands = [node(operand) for operand in formula.operands]
            if isinstance(formula, Comparison):
                operands = [self._atom(formula, abs(formula.limit) or 1.0 if mixed and formula.measured else 1.0)]
            a, b = [*operands, -1, -1][:2]
            rows.append((formula.kind, a, b, formula.begin, formula.end))
            return len(rows) - 1

        node(formula)
        return self.core.formula(rows)

    def _atom(self, comparison: Comparison, scale: float) -> int:
        key = (comparison.key, scale)
        if key not in self._known:
            self._known[key] = self.core.atom(self._signal(comparison.signal), comparison.relation, comparison.limit,
                                              scale)
            self.atoms.append(comparison)
            self.numbers.setdefault(comparison.key, self._known[key])
        return self._known[key]

    def _signal(self, signal: Signal) -> int:
        if signal.key not in self._signals:
            self._signals[signal.key] = self._made(signal)
        return self._signals[signal.key]

    def _made(self, signal: Signal) -> int:
        if signal.operation in ("source", "event", "telemetry"):
            source = self._source(signal)
            self.sources.append(signal)
            return self.core.expression("source", source, -1, 0.0)
        if signal.operation == "constant":
            return self.core.constant(signal.numbers)
        operands = [self._signal(operand) for operand in signal.operands]
        a, b = [*operands, -1, -1][:2]
        return self.core.expression(signal.operation, a, signal.place if signal.place >= 0 else b, signal.number)

    def _source(self, signal: Signal) -> int:
        if self._simulation is None:
            return self.core.given(math.prod(signal.shape))
        kernel, field = self._simulation.kernel, signal.field
        if signal.event:
            process, what, name, *became = signal.event
            if what == "command":
                return self.core.command(kernel, process, CODES.get(name, -1), *became)
            if what == "event":
                return self.core.event(kernel, process, name)
            if self._simulation.process(process).sends_unseen:
                return self.core.given(math.prod(signal.shape))
            if field is None:
                return self.core.packet(kernel, process, signal.place)
            return self.core.telemetry(kernel, process, signal.place, field.offset + field.width * field.elements[0],
                                       NUMBERS.index(field.stored.type), len(field.elements), field.has_quality)
        assert field is not None and field.port is not None
        owner, _, port = field.port.rpartition(".")
        return self.core.source(kernel, owner, port, field.offset + field.width * field.elements[0], field.stored,
                                len(field.elements), field.has_quality or field.of_mode)

    def play(self, records: Records, end: int | None) -> int:
        """Judge the samples of records; returns when the run ended [ns]."""
        import numpy as np

        series = [self._series(records, source) for source in self.sources]
        regular = [times for source, (times, _) in zip(self.sources, series)
                   if source.field and not source.field.of_mode]
        clocks = [times for times in regular or [times for times, _ in series] if len(times)]
        times = np.unique(np.concatenate(clocks)) if clocks else np.zeros(0, np.int64)
        if end is not None:
            times = times[times <= end]
        if self._every and len(times):      # the first at or after each multiple
            slots = times // self._every
            times = times[np.r_[True, slots[1:] != slots[:-1]]]
        columns = []
        for source, (own, values) in zip(self.sources, series):
            if source.event:
                counts = np.searchsorted(own, times, "right")
                columns.append(np.diff(counts, prepend=0).astype(bool).astype(float)[:, None])
                continue
            at = np.searchsorted(own, times, "right") - 1
            rows = np.full((len(times), math.prod(source.shape)), math.nan)
            rows[at >= 0] = values[at[at >= 0]]
            columns.append(rows)
        self.core.play(times, columns)
        return int(end if end is not None else times[-1] if len(times) else 0)

    def _series(self, records: Records, signal: Signal) -> tuple[Any, Any]:
        """(times [ns], values (n, elements)) of a source; of an event the times at which it fired."""
        import numpy as np

        if signal.event:
            process, what, name, *became = signal.event
            if what in ("packet", "telemetry"):
                raise SetupError(f"{signal.text}: records have no packets; they are judged while a scenario flies")
            ports = [port for port in records.executives() if port.type == ACTIVITY
                     and port.name.rpartition(".")[0] == process]
            events: Any = records._values(ports[0]) if ports else []
            return np.array([_seen(row) for row in events if (
                _has_become(row, name, became[0]) if became else
                row["kind"] == _EVENT and row["name"].decode() == name)], np.int64), None
        field = signal.field
        assert field is not None
        if field.of_mode:
            process = field.path.partition(".")[0]
            ports = [port for port in records.executives() if port.type == MODE
                     and port.name.rpartition(".")[0] == process]
            if not ports:
                raise SetupError(f"{signal.text} was not recorded")
            rows = records._values(ports[0])
            return rows["head"]["t"].astype(np.int64), rows["index"].astype(float)[:, None]
        try:
            port, _, _ = records._find(field.recorded)
        except Exception as error:
            raise SetupError(f"{signal.text} was not recorded: {error}") from None
        values = np.asarray(records[field.recorded], np.float64)
        values = values.reshape(len(values), -1).copy()
        quality = records._quality(port) if field.has_quality else None
        if quality is not None:
            values[quality <= STALE] = math.nan
        return np.rint(records._time(port) * 1e9).astype(np.int64), values


def _has_become(row: Any, name: str, became: str) -> bool:
    """Whether an Activity is that of a command, of any if there is no name, that has become so."""
    good = row["reason"] == Reason.OK
    return row["kind"] in (_ACCEPTED, _EXECUTED) and (not name or row["code"] == CODES[name]) and (
        not good if became == "refused" else good and (row["kind"] == _EXECUTED) == (became == "executed"))


def _seen(row: Any) -> int:
    """[ns] From when on it is seen: a command arrives after the instant that its acceptance bears."""
    return int(row["head"]["t"]) + int(row["kind"] == _ACCEPTED)
