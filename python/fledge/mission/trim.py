# SPDX-License-Identifier: Apache-2.0
"""Where a simulation is at rest: states, inputs and parameters for which rates and outputs have chosen values."""
from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from fledge import _core
from fledge.columns import columns
from fledge.errors import RunError, SetupError, listed
from fledge.mission.state import Number, Paths, State, paths_of
from fledge.objects.si import Time, time_ns, to_si

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from fledge.mission.simulation import Simulation

STEP = 1e-4     # of a number's size, for differences
ENOUGH = 1e-9   # of what the free numbers can change by their size
EXAMPLE = "world.craft.sigma_BN"

Wanted: TypeAlias = "Paths | Mapping[str, object]"      # a dict has values, with units


class Trim:
    """What trim() has found.

    free: path -> value; left: path -> what the rate or output still lacks; evaluations: how many; units: path -> unit
    """

    def __init__(self, free: dict[str, float], left: dict[str, float], evaluations: int, units: dict[str, str]) -> None:
        self.free, self.left, self.evaluations, self.units = free, left, evaluations, units

    def __repr__(self) -> str:
        rows = [[name, f"{value:.9g}", self.units[name]] for name, value in self.free.items()]
        rest = [[name, f"{value:.3g}", self.units[name]] for name, value in self.left.items()]
        return "\n".join([f"trimmed with {self.evaluations} evaluations", *columns(rows, {1}, "  "), "left",
                          *columns(rest, {1}, "  ")])


def trim(simulation: Simulation, free: Paths, rates: Wanted, outputs: Wanted, after: Time) -> Trim:
    """See Simulation.trim()."""
    fresh = simulation.kernel.now < 0
    state = State(simulation, "trim", fresh)
    numbers = [number for path in paths_of(free, "trim: free", EXAMPLE) for number in _free(state, path)]
    if not numbers:
        raise SetupError("trim: name what is free: states, inputs or parameters")
    wanted = _wanted(state, rates, "rates", _rates) + _wanted(state, outputs, "outputs", lambda s, p: s.outputs(p))
    if not wanted:
        raise SetupError("trim: name the rates or outputs that are to vanish, or to have a value")
    for what, names in (("free", [number.name for number in numbers]), ("wanted", [n.name for n, _ in wanted])):
        if len(set(names)) < len(names):
            raise SetupError(f"trim: {next(n for n in names if names.count(n) > 1)} is {what} twice")
    lacks = _Lacks(state, numbers, wanted, time_ns(after, "trim: after"))
    if not fresh:
        state.arrive()
        for number in numbers:
            state.written(number)
    state.measure(numbers)
    try:
        values, left, weight = _solved(lacks)
    except RunError as error:
        raise SetupError(f"trim: the run ended on the way: {error}") from None
    result = Trim({number.name: float(x) for number, x in zip(numbers, values)},
                  {number.name: float(x) for (number, _), x in zip(wanted, left)}, lacks.count,
                  {number.name: number.unit or "-" for number in (*numbers, *(number for number, _ in wanted))})
    if not np.isfinite(left).all() or (abs(left) > ENOUGH * weight).any():
        raise SetupError(f"trim: no such state was found, from where the simulation stands; the nearest is\n{result}")
    simulation.kernel.restore(lacks.data(values).tobytes(), edited=True)
    if fresh:
        simulation.reset()
    else:
        simulation.kernel.follow(False)
    return result


class _Lacks:
    """What the wanted numbers lack (m,), as a function of the values of the free ones (n,).

    length: [ns] that the simulation runs before they are read; count: of the evaluations
    """

    def __init__(self, state: State, numbers: list[Number], wanted: list[tuple[Number, float]], length: int) -> None:
        self.state, self.numbers, self.wanted, self.length = state, numbers, wanted, length
        self.places = [number.places[0] for number, _ in wanted]
        self.values = np.array([value for _, value in wanted])
        self.count = 0

    def data(self, x: NDArray[np.float64]) -> NDArray[np.uint8]:
        """The snapshot in which the free numbers have these values."""
        data = self.state.base.copy()
        for number, value in zip(self.numbers, x):
            self.state.put(data, number, value)
        return data

    def __call__(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        self.count += 1
        core = self.state.core
        self.state.take(self.data(x), begin=True)
        if self.length:
            core.run_until(max(core.time, core.now) + self.length, 0.0, None)
        core.follow(True)
        return self.state.read(self.state.snapshot(), self.places) - self.values

    def slopes(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, n)"""
        return np.array([(self(_moved(x, i, h)) - self(_moved(x, i, -h))) / (2 * h)
                         for i, h in enumerate(STEP * np.array([number.size for number in self.numbers]))]).T


def _solved(lacks: _Lacks) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The values of the free numbers, what the wanted ones then lack, and what these change by the sizes of those."""
    from scipy.optimize import least_squares

    start, sizes = (np.array(x) for x in zip(*((number.value, number.size) for number in lacks.numbers)))
    first = lacks(start)
    weight = abs(lacks.slopes(start) * sizes).max(axis=1)
    if (weight == 0).any():
        unmoved = int(np.argmin(weight))
        if first[unmoved]:
            raise SetupError(f"trim: {lacks.wanted[unmoved][0].name} does not depend on "
                             + listed([n.name for n in lacks.numbers], most=6))
    weight[weight == 0] = 1
    solution = least_squares(lambda x: lacks(x) / weight, start, lambda x: lacks.slopes(x) / weight[:, None],
                             x_scale=sizes, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=200)
    return solution.x, lacks(solution.x), weight


def _moved(x: NDArray[np.float64], i: int, h: float) -> NDArray[np.float64]:
    x = x.copy()
    x[i] += h
    return x


def _free(state: State, path: str) -> list[Number]:
    if not state.fresh and (states := state.states(path)):
        return states
    numbers = state.inputs(path)
    for number in numbers:
        for view, _ in number.incoming:
            target = _core.path(view)
            if number.name.rpartition(".")[0] != target and number.name.partition("[")[0].rpartition(".")[0] != target:
                raise SetupError(f"trim: {number.name} is an output, which its module writes anew")
            if any(target == wired for _, wired, *_ in state.simulation.wires):
                raise SetupError(f"trim: a wire writes {target}, so it cannot be free")
            if any(target == fed for fed, *_ in state.simulation.feeds):
                raise SetupError(f"trim: {target} is fed by hand, so it cannot be free")
    if state.fresh and any(number.incoming for number in numbers):
        raise SetupError(f"trim: before the first instant, parameters are free; {path} is an input")
    return numbers


def _rates(state: State, path: str) -> list[Number]:
    states = state.states(path)
    if not states:
        raise state.unknown(path, "differential state")
    return [Number(f"the rate of {n.name}", f"{n.unit} per s", [at]) for n, at in zip(states, state.rates(states))]


def _wanted(state: State, wanted: Wanted, what: str,
            numbers: Callable[[State, str], list[Number]]) -> list[tuple[Number, float]]:
    """(Number, value) of each."""
    pairs = []
    items = wanted.items() if isinstance(wanted, Mapping) else [
        (path, 0) for path in paths_of(wanted, f"trim: {what}", EXAMPLE)]
    for path, value in items:
        targets = numbers(state, path)
        dims = state.field(path).field.dims if what == "outputs" else None
        flat = np.ravel(to_si(value, f"trim: {path}", targets[0].unit,
                        dims, "numbers") if dims else np.array(value, float))
        if len(flat) not in (1, len(targets)):
            raise SetupError(f"trim: {path}: expected one number or {len(targets)}; found {value!r:.80}")
        pairs += [(number, float(flat[i if len(flat) > 1 else 0])) for i, number in enumerate(targets)]
    return pairs
