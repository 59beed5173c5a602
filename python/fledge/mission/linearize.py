# SPDX-License-Identifier: Apache-2.0
"""Linear systems of a simulation about its present state, by differences of clones that run.

Of the differential equations of the world, the derivatives at the present instant are differentiated; of the loop, or
of a part of it, what one period makes of its memory. A number of the memory that reaches no output is left out: what
it holds is written anew before anything reads it.
"""
from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from math import frexp, lcm
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fledge import _core
from fledge.errors import RunError, SetupError, listed
from fledge.mission.field_path import port
from fledge.mission.linear import Linear
from fledge.mission.process import Process
from fledge.mission.state import Number, Paths, State, flat, paths_of
from fledge.objects.si import Time, time_ns
from fledge.objects.words import Instance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from fledge.mission.simulation import Simulation

STEP = 2.0**-10     # of a number's size. Errors: its fourth power, and rounding over it
BENT = 0.02         # slopes that differ by more, on both sides, are reported
SLIGHT = 1e-4       # a part of a row that is smaller is not
NEARER = (2.0**-8, 2.0**-16)    # shorter steps, where a function bends in reach of the first
MOST = 1_000_000    # instants in a period
EXAMPLE = "world.craft.state.omega_BN_B"

Part: TypeAlias = "str | Process | Instance"


def linearize(simulation: Simulation, inputs: Paths, outputs: Paths, hold: Paths, discrete: bool,
              part: Part | Iterable[Part] | None, period: Time | None) -> Linear:
    """See Simulation.linearize()."""
    state = State(simulation, "linearize")
    if not discrete and (part is not None or period is not None):
        raise SetupError("linearize: part and period are for discrete=True")
    into = [number for path in paths_of(inputs, "linearize", EXAMPLE) for number in state.inputs(path)]
    out = [output for path in paths_of(outputs, "linearize", EXAMPLE) for output in state.outputs(path)]
    for names in ([number.name for number in into], [number.name for number in out]):
        if twice := [name for name in names if names.count(name) > 1]:
            raise SetupError(f"linearize: {twice[0]} is named twice")
    held = {number.name for path in paths_of(hold, "linearize", EXAMPLE) for number in state.states(path)}
    for path in paths_of(hold, "linearize", EXAMPLE):
        if not state.states(path):
            raise state.unknown(path, "differential state")
    state.differential = [number for number in state.differential if number.name not in held]
    lin = _discrete(state, into, out, part, period) if discrete else _continuous(state, into, out)
    if lin.notes:
        warnings.warn("\n".join(["linearize:", *lin.notes]), stacklevel=4)
    return lin


# --- the world's differential equations ------------------------------------------------------------

def _continuous(state: State, into: Sequence[Number], out: Sequence[Number]) -> Linear:
    if not state.differential:
        raise state.no_state()
    for number in into:
        outside = [_core.path(view) for view, _ in number.incoming
                   if _core.path(view).rpartition(".")[0] not in state.integrated]
        owner = ".".join(number.name.split(".")[:2])
        if outside or not number.incoming and owner not in state.integrated:
            raise SetupError(f"linearize: {outside[0] if outside else number.name} is read by no model that integrates "
                             f"differential equations ({listed(sorted(state.integrated))}); with discrete=True, "
                             "everything may be an input")
    for number in out:
        if ".".join(number.name.split(".")[:2]) not in state.integrated:
            raise SetupError(f"linearize: {number.name} does not follow from the differential equations of "
                             f"{listed(sorted(state.integrated))} alone; with discrete=True, every output may be one")
    state.arrive()
    for number in into:
        state.written(number)
    numbers = [*state.differential, *into]
    state.measure(numbers)
    places = [*state.rates(state.differential), *(number.places[0] for number in out)]

    def evaluate(number: Number | None, value: float) -> NDArray[Any]:
        data = state.base
        if number is not None:
            data = state.base.copy()
            state.put(data, number, value)
        state.take(data)
        state.core.follow(True)
        return state.read(state.snapshot(), places)

    slopes = _Slopes(state, evaluate, numbers, [f"the rate of {number.name}" for number in state.differential]
                     + [number.name for number in out])
    n = len(state.differential)
    J = slopes.matrix
    keep = _reaching(J[:n, :n], J[n:, :n]) if out else np.arange(n)
    rows = [*keep, *range(n, len(J))]
    return Linear(J[np.ix_(keep, keep)], J[keep, n:], J[n:, keep], J[n:, n:],
                  **_about([state.differential[i] for i in keep], into, out), y0=slopes.base[n:],
                  drift=slopes.base[keep], notes=slopes.notes(rows, [*keep, *range(n, len(numbers))]))


def _about(states: Sequence[Number], into: Sequence[Number], out: Sequence[Number]) -> dict[str, Any]:
    """What a Linear says of its numbers."""
    return {"states": [state.name for state in states], "inputs": [number.name for number in into],
            "outputs": [number.name for number in out], "x0": np.array([state.value for state in states]),
            "u0": np.array([number.value for number in into]),
            "units": {state.name: state.unit or "-" for state in (*states, *into, *out)}}


def _reaching(A: NDArray[Any], C: NDArray[Any]) -> NDArray[Any]:
    """The states that reach an output."""
    observed = (C != 0).any(axis=0)
    while True:
        more = observed | (A[observed] != 0).any(axis=0)
        if (more == observed).all():
            return np.flatnonzero(observed)
        observed = more


# --- the loop, period by period --------------------------------------------------------------------

def _discrete(state: State, into: Sequence[Number], out: Sequence[Number], part: Part | Iterable[Part] | None,
              period: Time | None) -> Linear:
    run = _instances(state, part)
    for number in out:
        if ".".join(number.name.split(".")[:2]) not in run:
            raise SetupError(f"linearize: {number.name} is not of the part: {listed(sorted(run))}")
    loop = _Loop(state, run, _period(state, run, period), into, out)
    memory, names = loop.memory, [number.name for number in out]
    numbers = [*memory, *loop.late, *loop.at_once]
    slopes = _Slopes(state, loop.evaluate, numbers, [number.name for number in memory] + 2 * names)
    n, p, k, J = len(memory), len(out), len(loop.late), slopes.matrix
    A, B = J[:n, :n], J[:n, n:]
    C, D, now = J[n:n + p, :n], J[n:n + p, n:], J[n + p:, :n]
    # What nothing changes, such as a constant in a message, is no state.
    constant = (A == np.eye(n)).all(axis=1) & ~B.any(axis=1) & [number not in state.differential for number in memory]
    A[:, constant] = C[:, constant] = now[:, constant] = 0
    before = bool(loop.at_once)     # the state is that before an instant, at which inputs are read and outputs written
    keep = _reaching(A, C if before else now) if out else np.flatnonzero((A != 0).any(axis=0))
    A, B, C, now = A[np.ix_(keep, keep)], B[keep], C[:, keep], now[:, keep]
    states = [memory[i] for i in keep]
    drift = slopes.base[keep] - np.array([number.value for number in states])
    held, reads = loop.inputs_of(0), loop.inputs_of(1)
    if before:
        # What acts from now on is a state: it acts until the next instant.
        A = np.block([[A, B[:, :k]], [np.zeros((k, len(keep) + k))]])
        B, C, D = np.vstack([B[:, k:] @ reads, held]), np.hstack([C, D[:, :k]]), D[:, k:] @ reads
        states += [Number(f"{number.name} (held)", number.unit, value=number.value) for number in loop.late]
        drift = np.append(drift, np.zeros(k))
    else:
        B, C, D = B[:, :k] @ held, now, np.zeros((p, len(into)))
    shown = range(n, n + p) if before else range(n + p, n + 2 * p)      # rows of the outputs
    for number, (a, b) in zip(into, loop.both):
        number.value = (a or b or number).value
    return Linear(A, B, C, D, loop.length / 1e9, **_about(states, into, out), y0=slopes.base[shown.start:shown.stop],
                  drift=drift, notes=[*slopes.notes([*keep, *shown], [*keep, *range(n, len(numbers))]),
                                      *loop.changes.notes([memory[i].name for i in keep] + [i.name for i in into])])


class _Loop:
    """A period of the part, as a function of what it carries over and of its inputs.

    length: [ns]; both: of each input, what acts from now on and what is read at an instant, either or both of
    `late` and `at_once`; memory: the numbers that may be carried over; changes: what moves by steps
    """

    def __init__(self, state: State, run: set[str], length: int, into: Sequence[Number], out: Sequence[Number]) -> None:
        self.state, self.length = state, length
        for view, place, value in _from_outside(state, run):
            state.core.override_input(view, place, value)
        for number in into:
            state.written(number)
        self.both = [_split(state, number) for number in into]
        self.late = [late for late, _ in self.both if late]
        self.at_once = [at_once for _, at_once in self.both if at_once]
        state.measure([*self.late, *self.at_once])
        for number in (*self.late, *self.at_once):
            _hold(state, number, number.value)
        self.memory = _memory(state, run)
        state.measure(self.memory)
        self.end = max(state.core.time, state.core.now) + length
        self.carried = [number.places[0] for number in self.memory]
        self.shown = [number.places[0] for number in out]
        self.changes = _Changes(state, run)

    def inputs_of(self, half: int) -> NDArray[np.float64]:
        """Which input each number of `late` (0) or `at_once` (1) is: (numbers, inputs), a 1 in each row."""
        return np.eye(len(self.both))[[i for i, pair in enumerate(self.both) if pair[half]]]

    def evaluate(self, number: Number | None, value: float) -> NDArray[np.float64]:
        """The memory and the outputs after a period, and the outputs now, with this value of a number."""
        state, data = self.state, self.state.base
        if number is not None:
            data = state.base.copy()
            _hold(state, number, value, data)
        try:
            state.take(data)
            state.core.follow(False)
            now = state.read(state.snapshot(), self.shown)
            state.core.run_until(self.end, 0.0, None)
        finally:
            if number is not None:
                _hold(state, number, number.value)
        after = state.snapshot()
        self.changes.compare(number, after)
        return np.concatenate([state.read(after, self.carried), state.read(after, self.shown), now])


def _instances(state: State, part: Any) -> set[str]:
    """The paths of the instances that run."""
    if part is None:
        return set(state.nodes)
    instances: set[str] = set()
    for member in [part] if isinstance(part, (str, Process, _core.Module, _core.Model)) else part:
        name = member.name if isinstance(member, Process) else member if isinstance(member, str) else _core.path(member)
        some = {path for path in state.nodes if path == name or path.startswith(f"{name}.")}
        if not some:
            raise SetupError(f"linearize: part: there is no '{name}'; expected processes, modules and models of "
                             f"{state.simulation.name}: {listed([*state.order, *state.nodes], most=12)}")
        instances |= some
    return instances | {node.path for node in state.nodes.values() if node.host in instances}


def _period(state: State, run: set[str], period: Time | None) -> int:
    """[ns]"""
    periods = []
    for process in state.simulation.processes:
        named = {task for _, tasks in process.modes for task in tasks}
        active = {task for mode, tasks in process.modes if mode == process.active_mode for task in tasks}
        periods += [task.period for task in process.tasks if (task.name not in named or task.name in active)
                    and any(f"{process.name}.{instance}" in run for instance in task.run)]
    if not periods:
        raise SetupError("linearize: no task is active, so nothing happens from now on")
    whole = lcm(*periods)
    if period is not None:
        wanted = time_ns(period, "linearize: period")
        if wanted <= 0 or wanted % whole:
            raise SetupError(f"linearize: period: expected a multiple of {whole / 1e9:g} s, the common one of the "
                             f"tasks; found {wanted / 1e9:g} s")
        whole = wanted
    if whole // min(periods) > MOST:
        raise SetupError(f"linearize: the tasks have the common period of {whole / 1e9:g} s, which is too long: "
                         + listed([f"{p / 1e9:g} s" for p in sorted(set(periods))]) + "; name a part")
    return whole


def _from_outside(state: State, run: set[str]) -> Iterator[tuple[Any, int, float]]:
    """(input, place, number) of all that the rest of the simulation gives to the part, as it is now."""
    for source, target, *_ in state.simulation.wires:
        if target.rpartition(".")[0] in run and source.rpartition(".")[0] not in run:
            view = port(state.simulation, target)
            raw = np.frombuffer(state.core.process(target.partition(".")[0]).incoming(view), np.uint8)
            for _, leaf, _, at in flat(_core.struct(view), (), 0):
                if leaf.type == "f64":
                    for place in range(at, at + leaf.size, 8):
                        yield view, place, float(raw[place:place + 8].view(np.float64)[0])


def _split(state: State, number: Number) -> tuple[Number | None, Number | None]:
    """(what of an input acts from now on, what is read at an instant), each a Number or None."""
    if not number.incoming:
        owner = ".".join(number.name.split(".")[:2])
        return (number, None) if isinstance(state.nodes[owner].instance, _core.Model) else (None, number)
    pair: list[Number | None] = []
    for late in (True, False):
        chosen = [(at, view) for at, view in zip(number.places, number.incoming)
                  if state.acts_late(_core.path(view[0])) == late]
        pair.append(Number(number.name, number.unit, [at for at, _ in chosen], [view for _, view in chosen])
                    if chosen else None)
    for half in pair:
        if half:
            view, place = half.incoming[0]
            raw = state.core.process(_core.path(view).partition(".")[0]).incoming(view)
            state.put(state.base, half, float(np.frombuffer(raw[place:place + 8])[0]))
    return pair[0], pair[1]


def _hold(state: State, number: Number, value: float, data: NDArray[Any] | None = None) -> None:
    """Give an input this value: in place of what comes, and where nothing comes, in its memory."""
    state.put(state.base if data is None else data, number, value)
    for view, place in number.incoming:
        state.core.override_input(view, place, value)


def _memory(state: State, run: set[str]) -> list[Number]:
    """All numbers that may be carried over from one instant to the next."""
    numbers = [number for number in state.differential if ".".join(number.name.split(".")[:2]) in run]
    for path, node in state.nodes.items():
        if path in run and path not in state.integrated and (node.slot or isinstance(node.instance, _core.Model)):
            numbers += state.memory(node)
    return numbers + [number for number in state.held() if ".".join(number.name.split(".")[:2]) in run]


class _Changes:
    """What moves by steps, or has no name, where a number was changed a little."""

    def __init__(self, state: State, run: set[str]) -> None:
        self.state = state
        self.base: Any = None
        self.reasons: dict[str, list[str]] = {}
        self.steps = [step for path in sorted(run) for step in state.steps(state.nodes[path])]
        named = {host for host in state.integrated}
        self.unnamed = [(path, at, size) for (kind, path), (at, size) in state.blocks.items()
                        if kind == "model" and path in run and path not in named]
        inside = np.zeros(len(state.base), bool)
        inside[8:16] = True     # the checksum
        for at, size in state.blocks.values():
            inside[at:at + size] = True
        self.rest = np.flatnonzero(~inside)
        self.places = np.array([k for _, at, size in self.steps for k in range(at, at + size)], int)

    def compare(self, number: Number | None, after: NDArray[Any]) -> None:
        if self.base is None or number is None:
            self.base = after
            return
        if (after[self.places] != self.base[self.places]).any():
            for name, at, size in self.steps:
                if (after[at:at + size] != self.base[at:at + size]).any():
                    self.reasons.setdefault(f"{name} changes by a step", []).append(number.name)
        for path, at, size in self.unnamed:
            if (after[at:at + size] != self.base[at:at + size]).any():
                self.reasons.setdefault(f"{path} remembers it in a memory without names, whose part of the dynamics is "
                                        "missing here", []).append(number.name)
        explained = any(number.name in names for names in self.reasons.values())
        if not explained and (after[self.rest] != self.base[self.rest]).any():
            self.reasons.setdefault("modes, events, tasks or the health go another way", []).append(number.name)

    def notes(self, names: Iterable[str]) -> list[str]:
        """Of the states and inputs that count."""
        base, notes = self.base, []
        for name, at, size in self.steps:
            if name.endswith(".saturated") and (base[at:at + size] != self.state.base[at:at + size]).any():
                notes.append(f"{name.rpartition('.')[0]} is at its limits, where more has no effect")
        known = set(names)
        for what, whose in self.reasons.items():
            if counts := list(dict.fromkeys(name for name in whose if name in known)):
                notes.append(f"with another {listed(counts, most=3)}: {what}")
        return notes


# --- slopes ----------------------------------------------------------------------------------------

class _Slopes:
    """The derivatives of a function of numbers, (rows, numbers), by differences at two distances to both sides.

    The error is of the order of the fourth power of the distance. Where the slopes on the two sides differ and the
    difference does not vanish with the distance, the function bends or jumps there: notes() tells it.
    """

    def __init__(self, state: State, evaluate: Callable, numbers: Sequence[Number], rows: Sequence[str]) -> None:
        self.numbers, self.rows = numbers, rows
        self.base = evaluate(None, 0.0)
        shape = (len(rows), len(numbers))
        self.matrix, self.bends = np.zeros(shape), np.zeros(shape, bool)
        self.sides = np.zeros((2, *shape))
        self.weight = np.zeros(shape)
        self._state, self._evaluate = state, evaluate
        for j, number in enumerate(numbers):
            self._column(j, STEP * 2.0**frexp(number.size)[1])
        for nearer in NEARER:
            for j in np.flatnonzero((self.bends & (self.weight > SLIGHT * self._most(...))).any(axis=0)):
                arrays = self.matrix, self.bends, self.weight, *self.sides
                before = [array[:, j].copy() for array in arrays]
                self._column(j, STEP * nearer * 2.0**frexp(numbers[j].size)[1])
                if (self.bends[:, j] & before[1]).sum() == before[1].sum():     # it bends here, not only near by
                    for array, column in zip(arrays, before):
                        array[:, j] = column

    def _most(self, columns: Any) -> NDArray[Any]:
        """The largest weight in each row."""
        return self.weight[:, columns].max(axis=1, initial=0)[:, None]

    def _column(self, j: int, h: float) -> None:
        number, values = self.numbers[j], []
        for step in (-h, -h / 2, h / 2, h):
            try:
                values.append(self._evaluate(number, number.value + step))
            except RunError as error:
                raise self._state.failed(number, number.value + step, error) from None
        self._differences(j, h, values)

    def _differences(self, j: int, h: float, values: list[NDArray[Any]]) -> None:
        far_low, low, high, far_high = values
        number, base = self.numbers[j], self.base
        # As the numbers were written: one.value + h is rounded.

        def gap(a: float, b: float) -> float:
            return (number.value + b) - (number.value + a)

        wide, narrow = (far_high - far_low) / gap(-h, h), (high - low) / gap(-h / 2, h / 2)
        self.matrix[:, j] = (4 * narrow - wide) / 3
        below, above = (base - low) / gap(-h / 2, 0), (high - base) / gap(0, h / 2)
        far = abs((far_high - base) / gap(0, h) - (base - far_low) / gap(-h, 0))
        noise = 256 * np.finfo(float).eps * np.max(np.abs([base, *values]), axis=0) / h
        size = np.maximum(abs(below), abs(above))
        bend = abs(above - below)
        self.bends[:, j] = (bend > BENT * size + noise) & (bend > 0.7 * far) | (
            abs(wide - narrow) > BENT * np.maximum(abs(wide), abs(narrow)) + noise)
        self.sides[:, :, j] = below, above
        self.weight[:, j] = np.maximum(np.maximum(size, abs(wide)), bend) * number.size

    def notes(self, rows: Iterable[int], columns: Iterable[int]) -> list[str]:
        """Where the slope is not the same on both sides, of rows and numbers that count."""
        rows, columns = list(rows), list(columns)
        notes = []
        most = self._most(columns)[:, 0]
        for j in columns:
            bent = [i for i in rows if self.bends[i, j] and self.weight[i, j] > SLIGHT * most[i]]
            if bent:
                i = max(bent, key=lambda i: self.weight[i, j] / most[i])
                below, above = self.sides[:, i, j]
                notes.append(f"{self.rows[i]} is not smooth in {self.numbers[j].name}: its slope is {below:.6g} below "
                             f"and {above:.6g} above" + (f"; so are {len(bent) - 1} more" if bent[1:] else ""))
        return notes
