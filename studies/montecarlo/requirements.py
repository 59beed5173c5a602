# SPDX-License-Identifier: Apache-2.0
"""The variables that a campaign retains of each run, and the requirements on them: on a variable, or formulas.

    error = d.retain("flight.tracking.error.sigma_BR")
    d.check(error.norm().after(5 * minute) < 1e-3, "the attitude did not settle")
    d.check(settles(d.signal("flight.tracking.error.sigma_BR").norm() < 1e-3, within=5 * minute))
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.mission.field_path import FieldPath, port
from fledge.objects.measured import Measured, unit_after
from fledge.objects.si import enumerator_names, time_ns
from fledge.records.series import GOOD, NONE
from fledge.requirements.formula import Formula, Signal, number_text
from fledge.requirements.judge import STALE, Judged

if TYPE_CHECKING:
    import numpy as np

    from fledge.mission.simulation import Simulation
    from fledge.montecarlo.dispersions import Dispersions
    from fledge.montecarlo.shares import Series
    from fledge.requirements.declared import Requirement as Declared


class Variable(Measured):
    """A retained variable over time, or a number made of it, for checks and plots.

    `.norm()`, `.max_abs()` and `[i]` make a number of an array; `.after(t)`, `.before(t)` and `.final`
    select a part of its time. Comparing a number with a constant makes a requirement: it must hold at
    every sample of that time.
    """

    def __init__(self, field_path: FieldPath, path: str, duration: Callable[[], int | None]) -> None:
        self.field_path, self.path, self._duration = field_path, path, duration
        self.raw = path != field_path.path  # with what messages hold that were never written
        self.hidden = True                  # until it is retained by name
        self._path, self._field, self._shape = path, field_path.field, field_path.shape
        self._start: int | None = 0     # None: the end alone
        self._end: int | None = None    # None: until the end

    # --- times ---

    def after(self, t: Any) -> Variable:
        """From a time on. Raises SetupError for one that is not within the run."""
        return self._with(_start=self._within(t, "after"))

    def before(self, t: Any) -> Variable:
        """Until a time. Raises SetupError for one that is not within the run."""
        return self._with(_end=self._within(t, "before"))

    @property
    def final(self) -> Variable:
        """At the end of the run."""
        return self._with(_start=None)

    def _within(self, t: Any, what: str) -> int:
        ns = time_ns(t, f"{self!r}: {what}")
        if not 0 <= ns <= (self._duration() or ns):
            raise SetupError(f"{self!r}: {what}({ns / 1e9:g} s) is not within the run")
        return ns

    def _compare(self, comparison: str, limit: Any) -> Requirement:
        value = self._constant(limit, comparison)
        if not math.isfinite(value):
            raise SetupError(f"{self!r} {comparison} {limit!r}: expected a finite number")
        return Requirement(self, comparison, value)

    def __eq__(self, limit: Any) -> Any:
        return self._compare("==", limit)

    def __ne__(self, limit: Any) -> Any:
        return self._compare("!=", limit)

    __hash__ = object.__hash__

    # --- values ---

    @property
    def unit(self) -> str:
        """As in the header; "-" if dimensionless."""
        return self.field_path.unit

    def port(self, simulation: Simulation) -> Any:
        """The input or output that holds it, in this simulation or another of the same mission."""
        assert self.field_path.port
        return port(simulation, self.field_path.port)

    @property
    def when(self) -> str:
        """The part of the time, in words."""
        if self._start is None:
            return "at the end"
        parts = ([f"after {self._start / 1e9:g} s"] if self._start else []) + (
            [f"before {self._end / 1e9:g} s"] if self._end is not None else [])
        return " and ".join(parts)

    @property
    def summary(self) -> Variable:
        """It as one number: of a vector the norm, of another array the largest element."""
        shape = self.field_path.shape
        return self if not shape else self.norm() if shape == (3,) else self.max_abs()

    @property
    def panels(self) -> list[Variable]:
        """What a figure of it shows: its summary, and each element of an array."""
        import numpy as np

        shape = self.field_path.shape
        return [self.summary, *(self[index] for index in np.ndindex(shape))] if shape else [self.summary]

    def values(self, result: Series, part: slice = slice(None)) -> np.ndarray:
        """(runs, samples): its number in each run at each of these samples, also outside its part of the time."""
        import numpy as np

        values = result.retained[self.path][:, part]
        if self._measure == "norm":
            return np.sqrt(np.sum(np.square(values.reshape(*values.shape[:2], -1)), axis=2))
        if self._measure == "max_abs":
            return np.max(np.abs(values.reshape(*values.shape[:2], -1)), axis=2)
        return values[(slice(None), slice(None), *self._measure)] if self._measure else values

    def samples(self, ns: np.ndarray) -> slice:
        """The samples within its part of the time. ns: the times of all samples"""
        import numpy as np

        if self._start is None:
            return slice(len(ns) - 1, len(ns))
        end = len(ns) if self._end is None else int(np.searchsorted(ns, self._end, "right"))
        return slice(int(np.searchsorted(ns, self._start, "left")), end)

    def __repr__(self) -> str:
        return " ".join(filter(None, [self.measure_text, self.when]))


class Reported:
    """Of what a formula reads, and no message has: whether an event fired, a command became something or a packet was
    sent since the sample before, or numbers of the newest packet. In the place of a Variable that was not retained by
    name."""

    def __init__(self, signal: Signal) -> None:
        self.signal, self.path, self.doc = signal, self.name(signal), signal.text
        self.unit, self.shape = signal.unit, signal.shape
        self.elements = list(range(math.prod(signal.shape)))
        self.field_path = self.field = self     # it describes itself, where a Variable has a FieldPath

    @staticmethod
    def name(signal: Signal) -> str:
        """Where the results have it."""
        assert signal.event
        return " ".join(signal.event)

    @property
    def happened(self) -> bool:
        """Whether it is one number, 1 if it happened."""
        return self.signal.operation == "event"


class Watch:
    """Looks at a simulation from now on, and finds of a run by hand what the kernel finds of those of a campaign."""

    def __init__(self, dispersions: Dispersions, simulation: Simulation) -> None:
        self._core, atoms = dispersions.watch(simulation)
        self._atoms = dict(zip([reported.path for reported in dispersions.reported], atoms))

    def found(self, reported: Reported, samples: int) -> np.ndarray:
        """(samples, elements): between two instants a sample is that of the first, at which alone things happen."""
        import numpy as np

        at, again = repeated(self._core.times, self._core.every, samples)
        values = np.column_stack([self._core.trace(atom) for atom in self._atoms[reported.path]])[at]
        if reported.happened:
            values[again] = 0.0
        return values


def repeated(times: np.ndarray, every: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Of each sample the number of the time [ns] whose values it has, and whether the sample before has them, too.

    As the kernel keeps them: between two instants a sample is that of the first.
    """
    import numpy as np

    taken = times // every
    at = np.maximum(np.searchsorted(taken, np.arange(samples), "right") - 1, 0)
    return at, taken[at] != np.arange(samples)


class Requirement:
    """A number that must stay on one side of a limit, or be one, or not. `message`: the meaning of a failure"""

    def __init__(self, variable: Variable, comparison: str, limit: float) -> None:
        self.variable, self.comparison, self.limit, self.message = variable, comparison, limit, ""
        self.quality: Variable | None = None    # of its messages; None: they need not be good

    def __bool__(self) -> bool:
        raise TypeError(f"{self!r} is only known when the campaign has flown; hand it to d.check()")

    def worst(self, result: Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(values, times [s], whether they hold): of each run, the sample closest to the limit or furthest beyond it,
        of those that exist. NaN, and not held, for runs that were not flown to their end, and where no sample is good;
        the time is then NaN if none exists."""
        import numpy as np

        part = self.variable.samples(result.ns)
        values = self.variable.values(result, part)
        there = np.ones(values.shape, bool)
        good = there[:, 0]
        if self.quality:
            quality = self.quality.values(result, part)
            there, good = ~(quality == NONE), (quality == GOOD).any(axis=1) | np.isnan(quality).any(axis=1)
        if self.comparison in ("==", "!="):
            badness = ((values != self.limit) == (self.comparison == "==")).astype(float)
        else:
            badness = values if self.comparison in ("<", "<=") else -values
        # argmax takes the first NaN there is, and no NaN holds.
        at = np.argmax(np.where(there, badness, -np.inf), axis=1)
        rows = np.arange(len(values))
        worst = np.where(good & there[rows, at], values[rows, at], np.nan)
        return worst, np.where(there[rows, at], result.ns[part][at] / 1e9, np.nan), self.holds(worst)

    def holds(self, values: Any) -> Any:
        """Whether values fulfil it; NaN does not."""
        import numpy as np

        return {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
                "==": operator.eq, "!=": operator.ne}[self.comparison](values, self.limit) & ~np.isnan(values)

    def failure(self, value: float, time: float) -> str:
        """The text for a run that does not fulfil it."""
        if math.isnan(value):
            text = f"{self!r} cannot be judged: {self.variable.field_path.port} was never " + (
                "written" if math.isnan(time) else "good") + (f" {self.variable.when}" if self.variable.when else "")
            return f"{self.message}: {text}" if self.message else text
        text = (f"{self.variable.measure_text} is {self._shown(value, '.4g')} at {time:g} s, "
                f"not {self.comparison} {self._shown(self.limit)}")
        return f"{self.message}: {text}" if self.message else text

    def __repr__(self) -> str:
        return f"{self.variable!r} {self.comparison} {self._shown(self.limit)}"

    def _shown(self, value: float, form: str = "g") -> str:
        """A number of the variable with its unit, or the name of an enumerator."""
        field = self.variable.field_path.field
        names: dict[Any, str] = {**enumerator_names(field)}
        return names.get(value, f"{value:{form}}{unit_after(self.variable.unit)}")


class Margin:
    """The margin of a formula, one number for each run, in the place of a Variable: it has no values over time."""

    when, _start = "", None

    def __init__(self, name: str, unit: str) -> None:
        self.measure_text, self.unit = f"margin of {name}", "" if unit == "-" else unit

    def samples(self, ns: np.ndarray) -> slice:
        """The samples that the formula reads: all."""
        return slice(0, len(ns))

    def finite(self, values: np.ndarray) -> np.ndarray:
        """Margins for figures: those of names alone as far out as the furthest of the others, 1 if there is none."""
        import numpy as np

        most = np.abs(values[np.isfinite(values)]).max(initial=0.0) or 1.0
        return np.clip(values, -most, most)

    def __repr__(self) -> str:
        return self.measure_text


class FormulaCheck(Requirement):
    """A formula that each run must fulfil: its margin is above 0, +-inf where names alone decide."""

    def __init__(self, declared: Declared, message: str) -> None:
        assert declared.formula is not None
        self._judged = Judged([declared])
        self.declared, self.message = declared, message
        self.variable: Any = Margin(declared.id, self._judged.units[0])
        self.comparison, self.limit, self.quality = ">", 0.0, None

    @property
    def formula(self) -> Formula:
        """What must hold."""
        assert self.declared.formula is not None
        return self.declared.formula

    def worst(self, result: Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(margins, when they were decided [s], whether it holds) of each run; NaN, and not held, where unknown."""
        import numpy as np

        ns = result.ns
        slots = ns // (self.declared.every or 1)    # as while it flies: the first sample at or after each multiple
        taken = np.flatnonzero(np.r_[True, slots[1:] != slots[:-1]])
        columns = []
        for source in self._judged.sources:
            field = None if source.event else source.fields[0]
            values = result.retained[field.path if field else Reported.name(source)].astype(float)
            values = values.reshape(*values.shape[:2], -1)
            if field and field.has_quality:
                values[result.retained[f"{field.port}.head.quality"] <= STALE] = math.nan
            if source.operation == "event":     # since the sample before of those that are taken
                values = np.maximum.reduceat(values[:, :taken[-1] + 1], np.r_[0, taken[:-1] + 1], axis=1)
            else:
                values = values[:, taken]
            columns.append(values)
        runs = len(next(iter(result.retained.values())))
        margins, times = np.full(runs, math.nan), np.full(runs, math.nan)
        ns = ns[taken]
        for run in range(runs):
            self._judged.play_samples(ns, [column[run] for column in columns])
            outcome = self._judged.outcomes()[0]
            if outcome.margin is not None:
                margins[run] = outcome.margin
                times[run] = math.nan if outcome.at is None else outcome.at
        return margins, times, self.holds(margins)

    def failure(self, value: float, time: float) -> str:
        """The text for a run that does not fulfil it."""
        text = (f"{self!r} cannot be judged" if math.isnan(value) else f"{self!r} is violated"
                + (f" by {self._shown(-value)}" if math.isfinite(value) else "")
                + (f" at {time:g} s" if time == time else ""))
        return f"{self.message}: {text}" if self.message else text

    def __repr__(self) -> str:
        return self.declared.id if self.declared.id != str(self.formula) else str(self.formula)

    def _shown(self, value: float, form: str = "g") -> str:
        return number_text(value, self.variable.unit) if math.isfinite(value) else ""
