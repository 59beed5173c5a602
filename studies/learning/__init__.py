# SPDX-License-Identifier: Apache-2.0
"""Simulations with the reset and step of reinforcement learning, one or many at once.

Example:

    import fledge
    import numpy as np
    from fledge.mission.learning import VectorEnv
    from fledge.units import minute, s

    def reward(before, action, after):
        return -np.sum(after["flight.tracking.error.sigma_BR"]**2, axis=1)

    env = VectorEnv(fledge.load("nadir_spin"), 256, actions=["flight.motor.command.u[:4]"], low=-0.2, high=0.2,
                    observations=["flight.tracking.error.sigma_BR", "flight.tracking.error.omega_BR_B"],
                    every=0.5 * s, limit=10 * minute, reward=reward)
    seen, info = env.reset(seed=1)
    seen, reward, terminated, truncated, info = env.step(env.action_space.sample())

Where Gymnasium is installed, `Env` and `VectorEnv` are environments of it, with its spaces; Fledge does not need it.
Without it they have the same methods, spaces with the same attributes, and the same rules of autoreset. So

    gymnasium.register("mine/Turn-v0", entry_point=make, vector_entry_point=make_many)

takes functions that return them, for gymnasium.make() and make_vec().
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

from fledge.errors import SetupError, listed
from fledge.mission.batch import ByPath
from fledge.objects.si import Time, time_ns
from fledge.requirements import Formula, Judged, Requirement, Requirements
from fledge.requirements.judge import highest

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, DTypeLike, NDArray

    from fledge.mission.batch import Batch
    from fledge.mission.simulation import Simulation

AUTORESET = ("SameStep", "NextStep", "Disabled")

Arrays: TypeAlias = "Mapping[str, NDArray[Any]]"     # by path, (n, ...)
Reward: TypeAlias = "Callable[[Arrays, Arrays, Arrays], ArrayLike]"
Ends: TypeAlias = "Callable[[Arrays], ArrayLike]"
Required: TypeAlias = "str | Formula"               # the id of a requirement, or a formula
Info: TypeAlias = "dict[str, Any]"                   # arrays; of an Env, numbers
Begun: TypeAlias = "tuple[NDArray[Any], Info]"
Stepped: TypeAlias = "tuple[NDArray[Any], NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], Info]"


def _gymnasium() -> Any:
    try:
        importlib.import_module("gymnasium.vector")
        return importlib.import_module("gymnasium")
    except ImportError:
        return None


GYMNASIUM = _gymnasium()


class Box:
    """Arrays of one shape and type, between bounds, which they include.

    low, high: arrays of that shape; shape; dtype
    """

    def __init__(self, low: ArrayLike, high: ArrayLike, shape: tuple[int, ...], dtype: DTypeLike = float) -> None:
        import numpy as np

        self.shape, self.dtype = tuple(shape), np.dtype(dtype)
        try:
            self.low, self.high = (np.broadcast_to(np.asarray(x, self.dtype), self.shape) for x in (low, high))
        except ValueError:
            raise SetupError(
                f"bounds: expected a number, or {self.shape}; found {low!r:.60} and {high!r:.60}") from None
        if not (self.low <= self.high).all():
            raise SetupError("bounds: a lower one is above the upper one, or none")
        self._random = np.random.default_rng()

    def seed(self, seed: int | None = None) -> None:
        """Begin the random numbers of sample() anew."""
        import numpy as np

        self._random = np.random.default_rng(seed)

    def sample(self) -> NDArray[Any]:
        """Anything in the box: uniform between two bounds; exponential above or below one; normal without any."""
        import numpy as np

        low, high, random = self.low.astype(float), self.high.astype(float), self._random
        below, above = np.isfinite(low), np.isfinite(high)
        start, end = np.where(below, low, 0.0), np.where(above, high, 1.0)
        far = random.exponential(size=self.shape)
        drawn = np.where(below & above, start + (end - start) * random.random(self.shape),
                         np.where(below, start + far, np.where(above, end - far, random.normal(size=self.shape))))
        return np.clip(drawn.astype(self.dtype), self.low, self.high)

    def contains(self, x: object) -> bool:
        """Whether it is an array of this shape and type, within the bounds."""
        import numpy as np

        return bool(isinstance(x, np.ndarray) and x.shape == self.shape and np.can_cast(x.dtype, self.dtype)
                    and (x >= self.low).all() and (x <= self.high).all())

    def __contains__(self, x: object) -> bool:
        return self.contains(x)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Box) and (self.shape, self.dtype) == (other.shape, other.dtype) \
            and bool((self.low == other.low).all() and (self.high == other.high).all())

    def __repr__(self) -> str:
        return f"Box({self.low.min(initial=0):g}, {self.high.max(initial=0):g}, {self.shape}, {self.dtype})"


def _space(low: ArrayLike, high: ArrayLike, shape: tuple[int, ...], dtype: DTypeLike) -> Any:
    """A Box, Gymnasium's where it is installed."""
    box = Box(low, high, shape, dtype)
    return GYMNASIUM.spaces.Box(box.low.copy(), box.high.copy(), dtype=box.dtype.type) if GYMNASIUM else box


class _Plain:
    """What the classes of Gymnasium have, without it."""

    render_mode = None
    spec = None
    _np_random: Any = None

    @property
    def unwrapped(self) -> Any:
        return self

    @property
    def np_random(self) -> np.random.Generator:
        """For random numbers of the user's; reset(seed=) begins it anew."""
        import numpy as np

        if self._np_random is None:
            self._np_random = np.random.default_rng()
        return self._np_random

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> Any:
        import numpy as np

        if seed is not None:
            self._np_random = np.random.default_rng(seed)


_VectorBase: Any = GYMNASIUM.vector.VectorEnv if GYMNASIUM else _Plain
_EnvBase: Any = GYMNASIUM.Env if GYMNASIUM else _Plain


class VectorEnv(_VectorBase):
    """n simulations that are stepped together.

    actions, observations, every, seed, dispersions, threads, delay: of Simulation.batch()
    reward(before, action, after): (n,) of a step, from path -> (n, ...) of its observations and actions
    terminated(after): (n,) whether an episode ends there, because of what happened; not given: none does. Or
    requirements of the mission by their ids, or formulas, a single one or several: an episode ends where any is
    violated, whatever may follow, and info["violated"] says which, when and by how much. `after` and `before` then have
    the largest margin that each can still have, (n,) under its id, a formula's under "formula 1" and so on, for the
    reward; inf before it counts.
    limit: the duration of an episode, a time, after which it is truncated; not given: it goes on
    low, high: the bounds of actions, in SI: a number, or one for each column. Actions are not cut to them.
    observation_low, observation_high: the same of observations
    failed: the reward of a step in which a simulation fails. Its episode terminates, with the last observation.
    autoreset: when an episode that has ended begins anew. "SameStep": in that step, whose observation is then the first
    of the next episode; info["final_obs"] has the last one. "NextStep": in the next step, whose action does not count
    and whose reward is 0. "Disabled": by reset(options={"reset_mask": mask}).
    dtype: of observations and actions

    num_envs, single_observation_space, single_action_space, observation_space, action_space, metadata; batch: the
    Batch.
    """

    def __init__(self, simulation: Simulation, n: int, actions: Iterable[str], observations: Iterable[str], *,
                 every: Time, reward: Reward,
                 terminated: Ends | Required | Iterable[Required] | None = None, limit: Time | None = None,
                 low: ArrayLike = -float("inf"), high: ArrayLike = float("inf"),
                 observation_low: ArrayLike = -float("inf"), observation_high: ArrayLike = float("inf"),
                 failed: float = 0.0, seed: int = 0, dispersions: Any = None, threads: int | None = None,
                 delay: int = 0, autoreset: str = "SameStep", dtype: DTypeLike = float) -> None:
        import numpy as np

        if autoreset not in AUTORESET:
            raise SetupError(f"autoreset: expected {listed(AUTORESET)}; found {autoreset!r}")
        self.batch: Any = simulation.batch(n, actions, observations, every=every, seed=seed, dispersions=dispersions,
                                           threads=threads, delay=delay)
        self._limit = np.inf if limit is None else time_ns(limit, "limit") / 1e9
        if self._limit < self.batch.every:
            raise SetupError(f"limit must be at least a step, {self.batch.every:g} s; found {self._limit:g} s")
        self._reward, self._failed, self._autoreset = reward, failed, autoreset
        self._ends = terminated if callable(terminated) else None
        required: Any = [] if self._ends or terminated is None else terminated
        self._judged = _judged(self.batch, simulation, [required] if isinstance(required, (str, Formula)) else required)
        self._highest = highest(self._judged)
        self._margins: Any = None                       # (n, requirements) after the last step
        columns = len(self.batch.observation_names), len(self.batch.action_names)
        self.num_envs = self.batch.n
        self.single_observation_space = _space(observation_low, observation_high, columns[:1], dtype)
        self.single_action_space = _space(low, high, columns[1:], dtype)
        self.observation_space = _space(observation_low, observation_high, (n, columns[0]), dtype)
        self.action_space = _space(low, high, (n, columns[1]), dtype)
        self.metadata = {"autoreset_mode": GYMNASIUM.vector.AutoresetMode(autoreset) if GYMNASIUM else autoreset,
                         "render_modes": []}
        self._seen: Any = None                          # (n, ...) the last observations
        self._begun = np.zeros(n)                       # [s] when each episode began
        self._ended = np.ones(n, bool)                  # it waits for a reset

    def reset(self, *, seed: int | Iterable[int] | None = None, options: Mapping[str, Any] | None = None) -> Begun:
        """(observations, info). Begin all episodes, or those of options["reset_mask"].

        seed: environment i flies run i of it; a list: run 0 of its own one, as an Env does
        options: "reset_mask": (n,); "runs", "snapshot": of Batch.reset()
        """
        import numpy as np

        options = dict(options or {})
        mask = options.pop("reset_mask", None)
        if unknown := set(options) - {"runs", "snapshot"}:
            raise SetupError(f"options: expected reset_mask, runs and snapshot; found {listed(sorted(unknown))}")
        several = seed is not None and np.ndim(seed) > 0     # type: ignore[arg-type]
        if several:
            options.setdefault("runs", 0)
        super().reset(seed=None if several else seed)
        self._begin(np.ones(self.num_envs, bool) if mask is None else np.asarray(mask), seed=seed, **options)
        return self._typed(self._seen), self._info()

    def step(self, actions: ArrayLike) -> Stepped:
        """(observations, rewards, terminated, truncated, info), arrays of n rows.

        info: "time" [s] and "run" of each, as the observations; "final_obs", the last observations of the episodes that
        ended, and "failure", texts: object arrays with the masks "_final_obs" and "_failure".
        """
        import numpy as np

        if self._seen is None or (self._autoreset == "Disabled" and self._ended.any()):
            which = listed([str(i) for i in np.flatnonzero(self._ended)], most=8)
            raise SetupError("reset() first" if self._seen is None else
                             f"reset() first: these episodes have ended: {which}")
        waiting = self._ended
        action = self.batch._rows(actions)
        before, self._seen = self._seen, self.batch.step(action)
        failed = self.batch.failed
        self._seen[failed] = before[failed]
        margins, self._margins = self._margins, self._still()
        after = self._named(self._seen, self._margins)
        given = ByPath({b.path: action[:, b.columns].reshape(self.num_envs, *b.shape)
                        for b in self.batch.actions.values()})
        rewards = self._checked(self._reward(self._named(before, margins), given, after), float, "reward")
        ended = self._checked(self._ends(after), bool, "terminated") if self._ends is not None else np.zeros(
            self.num_envs, bool)
        rewards = np.where(failed, self._failed, rewards) * ~waiting
        violated = (self._margins < 0).any(axis=1)
        terminated = (ended | failed | violated) & ~waiting
        # Half a step less: the sum of steps may be a rounding away from the limit.
        truncated = (self.batch.time - self._begun > self._limit - 0.5 * self.batch.every) & ~terminated & ~waiting
        info = self._failures(failed & ~waiting) | self._violations(violated & ~waiting)
        self._ended = terminated | truncated
        if self._autoreset == "NextStep" and waiting.any():
            self._begin(waiting)
        if self._autoreset == "SameStep" and self._ended.any():
            info |= _masked("final_obs", dict(zip(np.flatnonzero(self._ended),
                                                  self._typed(self._seen[self._ended]))), self.num_envs)
            self._begin(self._ended)
        return self._typed(self._seen), rewards, terminated, truncated, self._info() | info

    def close(self, **kwargs: Any) -> None:
        """End its threads."""
        self.batch = self._seen = None
        self.closed = True

    def _begin(self, mask: NDArray[np.bool_], **options: Any) -> None:
        fresh = self.batch.reset(mask, **options)
        self._ended = self._ended & ~mask
        if self._seen is None:
            self._seen = fresh
        self._seen[mask] = fresh[mask]
        self._begun[mask] = self.batch.time[mask]
        if self._margins is None:
            self._margins = self._still()
        self._margins[mask] = self._still()[mask]
        if self.batch.failed[mask].any():
            i, text = next((i, t) for i, t in self.batch.failures.items() if mask[i])
            raise SetupError(f"run {self.batch.runs[i]} of seed {self.batch.seeds[i]} cannot begin: {text}")

    def _still(self) -> NDArray[Any]:
        """(n, requirements) the largest margin that each can still have."""
        return self._highest().reshape(self.num_envs, -1)

    def _named(self, rows: NDArray[Any], margins: NDArray[Any]) -> ByPath:
        own = [requirement.id for requirement in self._judged[0].requirements] if self._judged else []
        return ByPath(self.batch.by_name(rows) | dict(zip(own, margins.T)))

    def _violations(self, violated: NDArray[np.bool_]) -> Info:
        import numpy as np

        if not violated.any():
            return {}
        return _masked("violated", {i: "; ".join(str(outcome) for outcome in self._judged[i].outcomes(so_far=True)
                                                 if outcome.verdict == "violated")
                                    for i in np.flatnonzero(violated)}, self.num_envs)

    def _checked(self, values: ArrayLike, kind: type, what: str) -> NDArray[Any]:
        import numpy as np

        values_ = np.asarray(values)
        if values_.shape != (self.num_envs,):
            raise SetupError(f"{what}() must give an array of the shape {(self.num_envs,)}; found {values_.shape}")
        return values_.astype(kind)

    def _typed(self, rows: NDArray[Any]) -> NDArray[Any]:
        return rows.astype(self.observation_space.dtype)

    def _info(self) -> Info:
        return {"time": self.batch.time, "run": self.batch.runs}

    def _failures(self, failed: NDArray[np.bool_]) -> Info:
        if not failed.any():
            return {}
        return _masked("failure", {i: t for i, t in self.batch.failures.items() if failed[i]}, self.num_envs)


class Env(_EnvBase):
    """One simulation: the arguments of VectorEnv without n and autoreset. Its `reward` and `terminated` get arrays of
    one row, so that the same functions serve both.

    observation_space, action_space, metadata; batch: the Batch of one clone.
    """

    def __init__(self, simulation: Simulation, actions: Iterable[str], observations: Iterable[str],
                 **arguments: Any) -> None:
        self._vector = VectorEnv(simulation, 1, actions, observations, autoreset="Disabled", **arguments)
        self.observation_space = self._vector.single_observation_space
        self.action_space = self._vector.single_action_space
        self.metadata: dict[str, Any] = {"render_modes": []}

    @property
    def batch(self) -> Batch:
        return self._vector.batch

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> Begun:
        """(observation, info). With a seed: its run 0; without one: the next run."""
        super().reset(seed=seed)
        seen, info = self._vector.reset(seed=seed, options=options)
        return seen[0], _first(info)

    def step(self, action: ArrayLike) -> tuple[NDArray[Any], float, bool, bool, Info]:
        """(observation, reward, terminated, truncated, info); reset() must follow the end of an episode."""
        import numpy as np

        seen, rewards, terminated, truncated, info = self._vector.step(np.asarray(action)[None])
        return seen[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), _first(info)

    def close(self) -> None:
        """End its threads."""
        self._vector.close()


def _judged(batch: Batch, simulation: Simulation, terminated: Iterable[Required]) -> list[Judged]:
    """Of each clone, the requirements that are judged while it flies; none: []."""
    required: list[Requirement] = []
    for given in terminated:
        if not isinstance(given, (str, Formula)):
            raise SetupError("terminated: expected a function, an id of a requirement or a formula; found "
                             f"{given!r:.60}")
        found = Requirements(simulation).of(given) if isinstance(given, str) else Requirement(
            f"formula {len(required) + 1}", repr(given), given)
        if found.formula is None:
            raise SetupError(f"terminated: {found.id} is shown by {found.method}, not by a run")
        required.append(found)
    judged = [Judged(required, batch.watched(i)) for i in range(batch.n)] if required else []
    for clone in judged:
        clone.watch(stop=False)
    return judged


def _first(info: Info) -> Info:
    return {key: values[0].item() if hasattr(values[0], "item") else values[0] for key, values in info.items()
            if key[0] != "_"}


def _masked(name: str, values: Mapping[int, object], n: int) -> Info:
    """What some of n environments have, as an object array and its mask."""
    import numpy as np

    column, mask = np.full(n, None), np.zeros(n, bool)
    for i, value in values.items():
        column[i], mask[i] = value, True
    return {name: column, f"_{name}": mask}
