# SPDX-License-Identifier: Apache-2.0
"""What a campaign keeps of each run, and what it must fulfil:

    error = d.retain("flight.tracking.error.sigma_BR")
    d.check(error.norm().after(5 * minute) < 1e-3, "the attitude did not settle")
"""

import math

from fledge.errors import SetupError
from fledge.objects.si import time_ns, to_si
from fledge.montecarlo.field_path import port


class Series:
    """A retained variable over time, or a number made of it, for checks and plots.

    `.norm()`, `.max_abs()` and `[i]` make a number of an array; `.after(t)`, `.before(t)` and `.final`
    keep a part of its time. Comparing a number with a constant makes a requirement: it must hold at
    every sample of that time.
    """

    def __init__(self, field_path, duration, measure="", start=0, end=None):
        self.field_path, self._duration = field_path, duration
        self._measure, self._start, self._end = measure, start, end

    def _with(self, **changes):
        other = object.__new__(Series)
        other.__dict__.update(self.__dict__)
        other.__dict__.update({f"_{k}": v for k, v in changes.items()})
        return other

    # --- numbers ---

    def norm(self):
        """The root of the sum of the elements' squares."""
        return self._reduced("norm", "norm()")

    def max_abs(self):
        """The largest magnitude of the elements."""
        return self._reduced("max_abs", "max_abs()")

    def __getitem__(self, index):
        index = index if isinstance(index, tuple) else (index,)
        shape = self.field_path.shape
        measure = self._reduced(index, "[...]")
        if len(index) != len(shape) or not all(isinstance(i, int) and 0 <= i < n for i, n in zip(index, shape)):
            raise SetupError(f"{self.field_path.path}{list(index)}: expected {len(shape)} whole numbers below {shape}")
        return measure

    def _reduced(self, measure, what):
        if not self.field_path.shape or self._measure:
            raise SetupError(f"{self!r}: {what} is for arrays")
        return self._with(measure=measure)

    # --- times ---

    def after(self, t):
        """From a time on."""
        return self._with(start=self._within(t, "after"))

    def before(self, t):
        """Until a time."""
        return self._with(end=self._within(t, "before"))

    @property
    def final(self):
        """At the end of the run."""
        return self._with(start=None)

    def _within(self, t, what):
        ns = time_ns(t, f"{self!r}: {what}")
        if not 0 <= ns <= (self._duration() or ns):
            raise SetupError(f"{self!r}: {what}({ns / 1e9:g} s) is not within the run")
        return ns

    # --- requirements ---

    def _compare(self, comparison, limit):
        target = self.field_path
        if target.shape and not self._measure:
            raise SetupError(f"{self!r} has shape {target.shape}: compare an element, norm() or max_abs()")
        value = to_si(limit, repr(self), target.field.unit, target.field.dims, "a number")
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            raise SetupError(f"{self!r} {comparison} {limit!r}: expected a finite number")
        return Requirement(self, comparison, float(value))

    def __lt__(self, limit):
        return self._compare("<", limit)

    def __le__(self, limit):
        return self._compare("<=", limit)

    def __gt__(self, limit):
        return self._compare(">", limit)

    def __ge__(self, limit):
        return self._compare(">=", limit)

    __hash__ = object.__hash__

    # --- values ---

    @property
    def path(self):
        """The variable's path, as it was retained."""
        return self.field_path.path

    @property
    def unit(self):
        return self.field_path.unit

    def port(self, simulation):
        """The input or output that holds it, in this simulation or another of the same mission."""
        return port(simulation, self.field_path.port)

    @property
    def measure_text(self):
        """ "norm(flight.tracking.error.sigma_BR)" """
        if isinstance(self._measure, tuple):
            return f"{self.path}[{', '.join(map(str, self._measure))}]"
        return f"{self._measure}({self.path})" if self._measure else self.path

    @property
    def when(self):
        """The part of the time, in words."""
        if self._start is None:
            return "at the end"
        parts = ([f"after {self._start / 1e9:g} s"] if self._start else []) + (
            [f"before {self._end / 1e9:g} s"] if self._end is not None else [])
        return " and ".join(parts)

    def values(self, result):
        """(runs, samples): its number in each run at each sample, whatever its part of the time."""
        import numpy as np

        values = result.retained[self.path]
        if self._measure == "norm":
            return np.sqrt(np.sum(np.square(values.reshape(*values.shape[:2], -1)), axis=2))
        if self._measure == "max_abs":
            return np.max(np.abs(values.reshape(*values.shape[:2], -1)), axis=2)
        return values[(slice(None), slice(None), *self._measure)] if self._measure else values

    def samples(self, ns):
        """Which of the samples at these times belong to its part of the time: a slice."""
        import numpy as np

        if self._start is None:
            return slice(len(ns) - 1, len(ns))
        end = len(ns) if self._end is None else int(np.searchsorted(ns, self._end, "right"))
        return slice(int(np.searchsorted(ns, self._start, "left")), end)

    def __repr__(self):
        return " ".join(filter(None, [self.measure_text, self.when]))


class Requirement:
    """A number that must stay on one side of a limit; `message` says what it means if it does not."""

    def __init__(self, series, comparison, limit):
        self.series, self.comparison, self.limit, self.message = series, comparison, limit, ""

    def __bool__(self):
        raise TypeError(f"{self!r} is only known when the campaign has flown; hand it to d.check()")

    def worst(self, result):
        """(values, times [s], whether they hold): of each run, where it comes closest to the limit or
        passes it furthest. NaN, and not held, for runs that were not flown to their end."""
        import numpy as np

        part = self.series.samples(result.ns)
        values = self.series.values(result)[:, part]
        # argmin and argmax take the first NaN there is, and no NaN holds.
        at = np.argmax(values, axis=1) if self.comparison in ("<", "<=") else np.argmin(values, axis=1)
        worst = values[np.arange(len(values)), at]
        holds = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}[self.comparison]
        return worst, result.ns[part][at] / 1e9, holds(worst, self.limit)

    def failure(self, value, time):
        """What to say of a run that does not fulfil it."""
        unit = f" {self.series.unit}" if self.series.unit else ""
        text = (f"{self.series.measure_text} is {value:.4g}{unit} at {time:g} s, "
                f"not {self.comparison} {self.limit:g}{unit}")
        return f"{self.message}: {text}" if self.message else text

    def __repr__(self):
        unit = f" {self.series.unit}" if self.series.unit else ""
        return f"{self.series!r} {self.comparison} {self.limit:g}{unit}"
