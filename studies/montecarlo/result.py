# SPDX-License-Identifier: Apache-2.0
"""What came of a campaign."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.mission.simulation import Finding

if TYPE_CHECKING:
    import numpy as np

    from fledge.montecarlo.campaign import Campaign
    from fledge.montecarlo.counts import Counts
    from fledge.montecarlo.requirements import Requirement, Variable
    from fledge.montecarlo.store import Store


class Result:
    """The results of a campaign.

    flown: (runs,) whether a run came to its end, or failed; False after Ctrl-C for those not finished
    complete: (runs,) flown without an error; passed: (runs,) and with every requirement fulfilled
    failures: index -> text of each run that failed; errors: of each that did not come to its end
    draws: path of each dispersed element -> (runs,), NaN where not flown
    ns: (samples,) times of the samples [ns]; time: the same [s]
    interrupted: whether Ctrl-C stopped it; len(): how many runs it was to have
    """

    def __init__(self, campaign: Campaign, seed: int, store: Store, interrupted: bool = False) -> None:
        import numpy as np

        d = campaign.dispersions
        self.campaign, self.seed, self.interrupted, self.store = campaign, seed, interrupted, store
        self.ns = d.ns
        self.time = self.ns / 1e9
        self.flown, self.errors = store.done, dict(sorted(store.errors.items()))   # which come in any order
        self.complete = self.flown.copy()
        self.complete[list(self.errors)] = False
        self.draws = _Lazy(d.columns, store.column, d.columns.__contains__)
        self.passed = self.complete.copy()
        for requirement in d.requirements:
            self.passed &= self.reached(requirement)[2]
        if store.strict:
            self.passed &= store.column("findings") == 0
        failed = self.flown & ~self.passed
        self.failures = _Lazy(np.flatnonzero(failed), self._failure, lambda run: 0 <= run < len(failed) and failed[run])

    def _failure(self, run: int) -> str:
        texts = [self.errors[run]] if run in self.errors else []
        for i, requirement in enumerate(self.campaign.dispersions.requirements if not texts else ()):
            value = self.store.value(f"worst {i}", run)
            if not requirement.holds(value):
                texts.append(requirement.failure(value, self.store.value(f"time {i}", run)))
        if not texts:
            of_run = self.store.health.get(run)
            texts.append("health: " + (of_run[0].text if of_run else f"{self.store.value('findings', run):g} findings"))
        return "; ".join(texts)

    # --- numbers of each run ---

    def reached(self, requirement: Requirement) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(values, times [s], whether they hold): of each run, the sample closest to the limit or furthest beyond.
        Each is (runs,); NaN, and not held, where not flown. Raises ValueError for a requirement of another campaign."""
        at = self.campaign.dispersions.requirements.index(requirement)
        values = self.store.column(f"worst {at}")
        return values, self.store.column(f"time {at}"), requirement.holds(values)

    def final(self, measure: Variable) -> np.ndarray:
        """(runs,) a measure at the end of each run, in SI; NaN where not flown. measure: of dispersions.measures();
        ValueError for others."""
        return self.store.column(repr(measure.final))

    def entered(self, mode: str) -> np.ndarray:
        """(runs,) [s] when a mode, "flight.mode.SAFE", first began; NaN where it did not. Raises ValueError on an
        unknown mode."""
        return self.store.column(mode)

    # --- over time ---

    @property
    def exact(self) -> bool:
        """Whether the retained variables are kept one by one. Else bands() come from counts, and `retained` and
        `health` are not there."""
        return self.store.exact

    @property
    def retained(self) -> dict[str, np.ndarray]:
        """Path -> (runs, samples, ...), NaN where not flown or after an error; read-only. Raises SetupError if they are
        not kept one by one."""
        return self.store.series().retained

    def bands(self, variable: Variable, percentiles: Sequence[float]) -> np.ndarray:
        """(percentiles, samples) of the complete runs; beyond store.EXACT within counts.BOUND of a run's value."""
        import numpy as np

        if not self.exact:
            return self._counts(variable).percentiles(percentiles)
        values = variable.values(self.store.series())[self.complete]
        if not np.isnan(values).any():
            return np.percentile(values, percentiles, axis=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)     # of times at which no run has a value
            return np.nanpercentile(values, percentiles, axis=0)

    def least_positive(self, variable: Variable) -> float:
        """The least number above 0 at any time in the complete runs; infinite or NaN if there is none."""
        import numpy as np

        if not self.exact:
            return self._counts(variable).least_positive()
        values = variable.values(self.store.series())[self.complete]
        return float(values[values > 0].min(initial=np.inf))

    def is_zero(self, variable: Variable) -> bool:
        """Whether it is 0 at all times in all complete runs."""
        import numpy as np

        if not self.exact:
            return self._counts(variable).only_zero()
        return not np.nan_to_num(variable.values(self.store.series())[self.complete]).any()

    def runs_of(self, variable: Variable, wanted: Sequence[int]) -> dict[int, np.ndarray]:
        """Index -> (samples,) of those of the runs that are kept."""
        from fledge.montecarlo.shares import Series

        if self.exact:
            values = variable.values(self.store.series())
            return {run: values[run] for run in wanted}
        at = list(self.campaign.dispersions.retained).index(variable.path)
        return {run: variable.values(Series(self.ns, {variable.path: self.store.lines[run][at].reshape(
            1, -1, *variable.field_path.shape)}))[0] for run in wanted if run in self.store.lines}

    def _counts(self, variable: Variable) -> Counts:
        texts = [panel.measure_text for panel in self.store.panels]
        return self.store.counts[texts.index(variable.measure_text)]

    # --- health ---

    @property
    def health(self) -> list[list[Finding]]:
        """(runs,) lists of Findings, as of Simulation.health. Raises SetupError if they are not kept one by one."""
        if not self.exact:
            raise SetupError("the findings of so many runs are counted, not kept one by one")
        return [self.store.health.get(run, []) for run in range(len(self))]

    def unhealthy(self) -> list[tuple[Finding, int, int]]:
        """(as of the first run, how many runs, the first) of each kind of finding at each path; the most frequent come
        first."""
        return sorted(((finding, n, first) for n, first, finding in self.store.unhealthy.values()),
                      key=lambda entry: (-entry[1], entry[0].path, entry[0].kind))

    def close(self) -> None:
        """Delete what fly(folder=...) left on disk for a campaign that goes on later."""
        self.store.close()

    def __len__(self) -> int:
        return len(self.flown)

    def _repr_html_(self) -> str:
        from fledge.display import table

        d = self.campaign.dispersions
        rows = [(repr(requirement), f"{self.reached(requirement)[2][self.complete].sum()} of {self.complete.sum()}",
                 requirement.message)
                for requirement in d.requirements]
        shown = list(itertools.islice(self.failures.items(), 8))
        more = [("", f"and {len(self.failures) - len(shown)} more")] if len(self.failures) > len(shown) else []
        return table(repr(self)[1:-1], [("requirements, and the complete runs that fulfil them", rows),
                                        ("failures", [(f"run {run}", text) for run, text in shown] + more)])

    def __repr__(self) -> str:
        return (f"<{len(self)} runs of {self.campaign.nominal.name}, {self.campaign.name}, seed {self.seed}: "
                f"{self.passed.sum()} passed, {len(self.failures)} failed"
                + (f", {(~self.flown).sum()} not flown" if not self.flown.all() else "") + ">")


class _Lazy(Mapping):
    """A mapping whose values are computed when they are read. keys: texts, or an array of numbers; has: whether there
    is such a key"""

    def __init__(self, keys: Any, make: Callable[[Any], Any], has: Callable[[Any], Any]) -> None:
        self._keys, self._make, self._has = keys, make, has

    def __contains__(self, key: object) -> bool:
        return bool(self._has(key))

    def __getitem__(self, key: Any) -> Any:
        if key not in self:
            raise KeyError(key)
        return self._make(key)

    def __iter__(self) -> Iterator[Any]:
        return (key if isinstance(key, str) else int(key) for key in self._keys)

    def __len__(self) -> int:
        return len(self._keys)

    def _ipython_key_completions_(self) -> list[Any]:
        return list(self)

    def __repr__(self) -> str:
        return f"{{{', '.join(f'{key!r}: {value!r}' for key, value in self.items())}}}"
