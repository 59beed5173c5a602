# SPDX-License-Identifier: Apache-2.0
"""Clones of a simulation that are stepped together, from numpy arrays to numpy arrays.

    batch = sim.batch(1024, actions=["flight.motor.command.u[:4]"], every=0.5 * s, seed=1,
                      observations=["flight.tracking.error.sigma_BR", "flight.tracking.error.omega_BR_B"])
    seen = batch.reset()                          # (1024, 6)
    seen = batch.step(-seen @ gains)              # actions (1024, 4)
    batch.by_name(seen)["flight.tracking.error.sigma_BR"]       # (1024, 3)
    batch.reset(batch.failed)                     # those that failed, each with its next run

A clone is fixed by its seed, its run and its actions: neither threads nor the other clones change a bit of it. Where
events or functions of modules are Python, each clone has its own, which uses that clone (fledge.mission.rebinding).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from fledge import _core
from fledge.errors import RunError, SetupError, did_you_mean, listed
from fledge.mission import rebinding
from fledge.mission.field_path import FieldPath
from fledge.objects.si import Time, time_ns
from fledge.units import s

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from fledge.mission.simulation import Simulation

Actions: TypeAlias = "ArrayLike | Mapping[str, ArrayLike]"


@dataclass
class Block:
    """The columns of one field in the actions or the observations.

    path: of the field; columns: a slice; shape: of the field in one clone; unit, meaning: of the header
    late: of an observation: its module runs behind the actions, so that it is of the instant before
    """

    path: str
    columns: slice
    shape: tuple[int, ...]
    unit: str
    meaning: str
    late: bool = False


class ByPath(dict):
    """Arrays by the paths of their fields."""

    def __missing__(self, path: str) -> Any:
        raise SetupError(f"there is no '{path}' here{did_you_mean(path, self)} there are {listed(list(self))}")


class Batch:
    """n clones of a simulation; made by Simulation.batch().

    n: of the clones; every: the duration of a step [s]; delay: of actions [periods of flight]; actions, observations:
    their Blocks, by path; action_names, observation_names: of each column, "flight.motor.command.u[0]"
    """

    def __init__(self, simulation: Simulation, n: int, actions: Iterable[str], observations: Iterable[str], every: Time,
                 seed: int, dispersions: Any, threads: int | None, delay: int = 0) -> None:
        import numpy as np

        period = time_ns(every, "batch: every")
        threads = len(os.sched_getaffinity(0)) if threads is None else threads
        for value, what in ((n, "n"), (threads, "threads")):
            if not isinstance(value, (int, np.integer)) or value < 1:
                raise SetupError(f"batch: {what} must be a whole number >= 1, found {value!r}")
        delay = _seed(delay, "delay")
        dispersions = getattr(dispersions, "dispersions", dispersions)     # of a campaign
        # Functions of the user's: each clone gets its own, and so does what the batch was made of.
        self._separate = rebinding.has_functions(simulation)
        if self._separate:
            simulation = rebinding.separate(simulation, simulation.clone())
        plan = _core.BatchPlan(n, period, threads, dispersions._plan if dispersions is not None else None,
                               self._separate, delay)
        self.n, self.every, self.delay = int(n), period / 1e9, delay
        self.actions, self.action_names = _blocks(simulation, actions, plan.act, "actions")
        self.observations, self.observation_names = _blocks(simulation, observations, plan.observe, "observations")
        self._dispersions = dispersions
        self._drawn = list(dispersions.columns) if dispersions is not None else []
        self._simulation = simulation
        self._core = _core.Batch(simulation.kernel, plan)
        for i, block in enumerate(self.observations.values()):
            block.late = self._core.is_late(i)
        self._clones = [self._around(self._core.clone(i)) for i in range(n)] if self._separate else []
        self._seeds = np.full(n, _seed(seed), np.uint64)
        self._nothing = np.empty((n, 0))                # a step without actions takes microseconds
        self._next = np.arange(n, dtype=np.uint64)      # the run that each begins at its next reset

    def reset(self, which: ArrayLike | None = None, *, seed: int | ArrayLike | None = None,
              runs: int | ArrayLike | None = None, snapshot: bytes | None = None) -> NDArray[np.float64]:
        """Begin clones anew, and return the observations of all, (n, ...).

        which: a mask (n,), or indices; not given: all
        seed: of their runs from now on, one or one for each of them
        runs: the index of the run for each of them, as in a campaign of that seed. Not given: clone i flies the runs
        i, i + n, i + 2 n, ..., and i again after a new seed
        snapshot: of Simulation.snapshot(), in place of time 0. It has its own parameters, so nothing is dispersed; the
        random streams begin anew there. No action is on its way.

        A clone then stands in the first instant in which an action can count: with tasks without an offset, at 0. From
        a snapshot of a simulation whose instant is over, it flies on to there, less than a period of flight; a snapshot
        of one of these clones is in one. Parameters are those of the simulation when the batch was made, and what is
        dispersed. Raises SetupError for other clones, numbers or bytes.
        """
        import numpy as np

        chosen = self._chosen(which)
        if snapshot is not None and not isinstance(snapshot, bytes):
            raise SetupError(f"batch: snapshot: expected the bytes that snapshot() gives; found {snapshot!r:.40}")
        if seed is not None:
            self._seeds[chosen] = _numbers(seed, len(chosen), "seed")
            self._next[chosen] = chosen
        if runs is not None:
            self._next[chosen] = _numbers(runs, len(chosen), "runs")
        self._core.reset(chosen, self._seeds[chosen], self._next[chosen], snapshot or b"")
        self._next[chosen] += np.uint64(self.n)
        return self._core.observe()

    def step(self, actions: Actions | None = None) -> NDArray[np.float64]:
        """Give each clone its actions, run it for `every`, and return the observations, (n, ...).

        actions: (n, ...) in SI, a column for each of action_names; or path -> (n, *shape) or what numpy broadcasts to
        that. An action in an input is a message that is made now, of quality GOOD; the fields that no action names stay
        as they are. One in an output is the same in each input that it feeds.

        The step begins inside of the instant that was observed, before the first module of flight that has an action:
        it counts there and then, as what a law in flight puts out, or `delay` periods of flight later. The rest of that
        instant runs, and what follows, up to the same place `every` later.

        A clone that fails stands still, and its observations are NaN: `failed`, `failures`. Its actions do not count
        until it is reset. After Ctrl-C, the next step() takes up this one: clones that had ended it wait, those that
        had begun it keep the actions that they had.
        Raises SetupError before any clone moves if a number is not finite, if the shape is another, or if a clone has
        not begun.
        """
        if actions is None and not self.actions:
            return self._core.step(self._nothing)
        return self._core.step(self._rows({} if actions is None else actions))

    def observe(self) -> NDArray[np.float64]:
        """The observations as they stand: (n, ...) in SI, a column for each of observation_names."""
        return self._core.observe()

    def by_name(self, observed: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """path -> view (n, *shape) of the rows that step(), reset() or observe() gave."""
        return ByPath({b.path: observed[:, b.columns].reshape(len(observed), *b.shape)
                       for b in self.observations.values()})

    @property
    def failed(self) -> NDArray[np.bool_]:
        """(n,) whether each stands still, because its run has failed."""
        return self._core.failed

    @property
    def failures(self) -> dict[int, str]:
        """Why, by the index of the clone."""
        import numpy as np

        return {int(i): self._core.failure(i) for i in np.flatnonzero(self.failed)}

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,) [s]; NaN of a clone that has not begun."""
        import numpy as np

        ns = self._core.time
        return np.where(ns < 0, np.nan, ns / 1e9)

    @property
    def runs(self) -> NDArray[np.uint64]:
        """(n,) the index of the run that each flies."""
        return self._core.runs

    @property
    def seeds(self) -> NDArray[np.uint64]:
        """(n,) the seeds of these runs."""
        return self._core.seeds

    @property
    def draws(self) -> dict[str, NDArray[np.float64]]:
        """Path of each dispersed element -> (n,); NaN of clones that go on from a snapshot."""
        return {path: self._core.draws[:, i] for i, path in enumerate(self._drawn)}

    def simulation(self, clone: int) -> Simulation:
        """A clone as a simulation of its own, as it stands: to look at, to record, or to take a snapshot of. Where it
        runs on, it first ends its instant. Raises SetupError if there is no such clone."""
        self._check_clone(clone)
        return self._around(self._core.copy(clone))

    def watched(self, clone: int) -> Simulation:
        """The clone itself, not a copy: to judge requirements while it flies. Only the batch may run or change it.
        Raises SetupError if there is no such clone."""
        self._check_clone(clone)
        return self._clones[clone] if self._clones else self._simulation._around(self._core.clone(clone))

    def _check_clone(self, clone: int) -> None:
        if not 0 <= clone < self.n:
            raise SetupError(f"batch: there is no clone {clone}; there are {self.n}")

    def repeat(self, clone: int, actions: ArrayLike) -> Simulation:
        """The run of a clone flown alone from its start, with a row of actions for each step, as step() takes it.

        actions: (steps, ...) in SI, a column for each of action_names

        From time 0, also of a clone that went on from a snapshot. The simulation then stands where the clone stood
        after those steps, with its bits. Raises SetupError where the clone has not begun, RunError where the run fails.
        """
        self._check_clone(clone)
        rows = _floats(actions, "actions")
        if rows.shape[1:] != (len(self.action_names),):
            raise SetupError(f"batch: actions: expected the shape (steps, {len(self.action_names)}), "
                             f"found {rows.shape}")
        if not self._separate:
            return self._around(self._core.repeat(clone, rows))
        if self._core.time[clone] < 0:
            raise SetupError(f"batch: clone {clone} has not begun")
        alone = Batch(self._simulation, 1, self.actions, self.observations, self.every * s, 0,
                      self._dispersions, 1, self.delay)
        alone.reset(seed=int(self.seeds[clone]), runs=int(self.runs[clone]))
        for row in rows:
            alone.step(row[None])
        for text in alone.failures.values():
            raise RunError(text)
        return alone.simulation(0)

    def _around(self, core: _core.Simulation) -> Simulation:
        """A clone in the extension as one for users."""
        clone = self._simulation._around(core)
        return rebinding.separate(self._simulation, clone) if self._separate else clone

    def _chosen(self, which: ArrayLike | None) -> NDArray[np.int64]:
        import numpy as np

        if which is None:
            return np.arange(self.n)
        indices = np.atleast_1d(np.asarray(which))
        if indices.dtype == bool and indices.shape == (self.n,):
            return np.flatnonzero(indices)
        if indices.size == 0:
            return np.arange(0)
        if indices.ndim != 1 or indices.dtype.kind not in "iu" or indices.min() < 0 or indices.max() >= self.n \
                or len(np.unique(indices)) != len(indices):
            raise SetupError(f"batch: which: expected a mask of {self.n}, or different indices from 0 to {self.n - 1}; "
                             f"found {which!r:.60}")
        return indices

    def _rows(self, actions: Actions) -> NDArray[np.float64]:
        """The actions as the kernel takes them."""
        import numpy as np

        shape = (self.n, len(self.action_names))
        if isinstance(actions, Mapping):
            if set(actions) != set(self.actions):
                raise SetupError(f"batch: the actions are {listed(list(self.actions))}; found {listed(list(actions))}")
            rows = np.empty(shape)
            for path, block in self.actions.items():
                value = _floats(actions[path], path)
                try:
                    rows[:, block.columns] = np.broadcast_to(value, (self.n, *block.shape)).reshape(self.n, -1)
                except ValueError:
                    raise SetupError(f"batch: {path}: expected the shape {(self.n, *block.shape)}, found {value.shape}"
                                     ) from None
            return rows
        rows = _floats(actions, "actions")
        if rows.shape != shape:
            raise SetupError(f"batch: actions: expected the shape {shape}, found {rows.shape}")
        return rows

    def _repr_html_(self) -> str:
        from fledge.display import table

        groups = [(title, [(b.path, "x".join(map(str, b.shape)), b.unit, b.meaning) for b in blocks.values()])
                  for title, blocks in (("actions", self.actions), ("observations", self.observations))]
        return table(repr(self).partition("\n")[0], groups, ("", "shape", "unit", "meaning"),
                     [f"clone {i}: {text}" for i, text in self.failures.items()])

    def __len__(self) -> int:
        return self.n

    def __repr__(self) -> str:
        lines = [f"{self.n} clones of {self._simulation.name}, steps of {self.every:g} s"]
        for title, blocks in (("action", self.actions), ("observation", self.observations)):
            lines += [f"  {title:<12} {b.path}  {b.shape or ''} {b.unit}".rstrip() +
                      "  of the instant before" * b.late for b in blocks.values()]
        return "\n".join(lines)


def _blocks(simulation: Simulation, paths: str | Iterable[str],
            add: Callable[[Any, _core.Field, int, list[str]], object], what: str) -> tuple[dict[str, Block], list[str]]:
    """(path -> Block, the names of all columns) of fields, which `add` adds to the plan."""
    blocks: dict[str, Block] = {}
    names: list[str] = []
    for path in [paths] if isinstance(paths, str) else paths:
        whole, _, rows = path.partition("[:")       # "u[:4]": the first rows alone
        target = FieldPath(simulation, whole)
        if path in blocks:
            raise SetupError(f"batch: {what}: {path} is there twice")
        own, shape = target.names(), target.shape
        if rows:
            n = int(rows[:-1]) if re.fullmatch(r"\d+\]", rows) else 0
            if not shape or not 0 < n <= shape[0]:
                raise SetupError(f"batch: {path}: {whole} has the shape {shape}; name some of its first rows, as in "
                                 "command.u[:4]")
            own, shape = own[:len(own) // shape[0] * n], (n, *shape[1:])
        add(target.holder, target.field, target.elements[0], own)
        blocks[path] = Block(path, slice(len(names), len(names) + len(own)), shape, target.unit, target.field.doc)
        names += own
    return blocks, names


def _floats(values: ArrayLike, what: str) -> NDArray[np.float64]:
    import numpy as np

    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise SetupError(f"batch: {what}: expected numbers, found {values!r:.60}")
    return np.ascontiguousarray(array, float)


def _numbers(values: int | ArrayLike, n: int, what: str) -> NDArray[np.uint64]:
    """Whole numbers from 0 to 2^64 - 1, one for each."""
    import numpy as np

    seeds = [_seed(v, what) for v in np.ravel(np.asarray(values, object))]
    if len(seeds) not in (1, n):
        raise SetupError(f"batch: {what}: expected one number, or {n}; found {len(seeds)}")
    return np.array(seeds, np.uint64)


def _seed(value: Any, what: str = "seed") -> int:
    try:
        number = int(value)
    except (TypeError, ValueError):
        number = -1
    if number != value or not 0 <= number < 2**64:
        raise SetupError(f"batch: {what}: expected a whole number from 0 to 2^64 - 1; found {value!r}")
    return number
