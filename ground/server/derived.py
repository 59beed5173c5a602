# SPDX-License-Identifier: Apache-2.0
"""Parameters that are computed from others, also from derived ones, on vectors: by an expression, or by a function of a
file of Python, which gets an array of each input and returns one of the same length."""
from __future__ import annotations

import ast
import importlib.util
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fledge.ground.server.limits import Change, InForce
from fledge.ground.server.past import Series
from fledge.ground.server.settings import Derived
from fledge.errors import SetupError, did_you_mean
from fledge.ground.database import Database

if TYPE_CHECKING:
    from fledge.ground.database import History, Monitor
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.telemetry import Note

Array = NDArray[Any]
FUNCTIONS = {name: getattr(np, name) for name in (
    "abs", "arccos", "arcsin", "arctan", "arctan2", "ceil", "clip", "cos", "cosh", "degrees", "exp", "floor", "hypot",
    "log", "log10", "log2", "maximum", "minimum", "radians", "sign", "sin", "sinh", "sqrt", "tan", "tanh", "where")}
CONSTANTS = {"pi": np.pi, "e": np.e}
PARTS = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.Compare, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv,
         ast.Mod, ast.Pow, ast.USub, ast.UAdd, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq, ast.Load)


def compiled(parameter: Derived, folder: Path) -> Callable[..., Array]:
    """A function from arrays by name to the parameter's array. Raises SetupError."""
    return _function(parameter, folder) if parameter.function else _expression(parameter)


def _expression(parameter: Derived) -> Callable[..., Array]:
    where = f"{parameter.name}: the expression '{parameter.expression}'"
    try:
        tree = ast.parse(parameter.expression, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise SetupError(f"{where}: {getattr(error, 'msg', error)}") from None
    known = [*parameter.of, *FUNCTIONS, *CONSTANTS]
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id not in known:
            raise SetupError(f"{where} has the name '{node.id}'{did_you_mean(node.id, known)} `of` names its inputs")
        if isinstance(node, ast.Call) and not (
                isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS and not node.keywords):
            raise SetupError(f"{where} may call {', '.join(FUNCTIONS)}")
        if isinstance(node, ast.Constant):
            if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
                raise SetupError(f"{where} has {node.value!r}, which is no number")
            node.value = float(node.value)
        elif not isinstance(node, (*PARTS, ast.Name, ast.Call)):
            raise SetupError(f"{where} has {type(node).__name__}: it is of numbers, + - * / // % **, comparisons and "
                             "functions")
    code = compile(tree, "expression", "eval")

    def compute(**inputs: Array) -> Array:
        return eval(code, {"__builtins__": {}}, FUNCTIONS | CONSTANTS | inputs)

    return compute


def _function(parameter: Derived, folder: Path) -> Callable[..., Array]:
    file, _, name = parameter.function.rpartition(":")
    path = folder / file
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if not file.endswith(".py") or not path.is_file() or spec is None or spec.loader is None:
        raise SetupError(f"{parameter.name}: a function is FILE.py:NAME; found '{parameter.function}'")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise SetupError(f"{parameter.name}: {path}: {type(error).__name__}: {error}") from None
    function = getattr(module, name, None)
    if not callable(function):
        raise SetupError(f"{parameter.name}: {path} has no function '{name}'")
    return function


class DerivedParameters:
    """The derived parameters of a spacecraft in its monitor. Raises SetupError if one cannot be computed.

    folder: of the files of functions; changes: of limits, by which the values of the past are judged
    """

    def __init__(self, parameters: Iterable[Derived], folder: Path, monitor: Monitor, changes: list[Change],
                 reporter: Reporter) -> None:
        self.monitor, self._changes, self._reporter = monitor, changes, reporter
        self._all = {parameter.name: (parameter, compiled(parameter, folder)) for parameter in parameters}
        self._inputs = {name: self._of_packets(name, ()) for name in self._all}     # of packets, at last
        self._problems: set[str] = set()
        self._rows: list[tuple[str, int, int]] = []     # name, trigger, slot
        for name, (parameter, _) in self._all.items():
            trigger = monitor.trigger([monitor.slot(path) for path in self._inputs[name]])
            slot = monitor.derive(name, parameter.unit, parameter.description, parameter.limits)
            self._rows.append((name, trigger, slot))

    def _of_packets(self, name: str, above: tuple[str, ...]) -> list[str]:
        """The parameters in packets that it comes from, and those that it is computed from."""
        if name in above:
            raise SetupError("derived parameters come from one another in a circle: "
                             + " -> ".join([*above[above.index(name):], name]))
        inputs: dict[str, None] = {}
        for path in self._all[name][0].of.values():
            inputs |= dict.fromkeys(self._of_packets(path, (*above, name)) if path in self._all else [path])
        return list(inputs)

    def turn(self) -> list[Note]:
        """Compute them from the packets since the last turn; returns the notes."""
        notes: list[Note] = []
        for name, trigger, slot in self._rows:
            data = self.monitor.rows(trigger)
            if data:
                rows = np.frombuffer(data).reshape(-1, 1 + len(self._inputs[name]))
                try:
                    values = self._values(name, rows)
                except SetupError as error:
                    if str(error) not in self._problems and len(self._problems) < 50:
                        self._problems.add(str(error))
                        self._reporter.event("warning", "derived", str(error))
                    continue
                notes += self.monitor.put(slot, rows[:, 0].tobytes(), values.tobytes())
        return notes

    def __contains__(self, name: str) -> bool:
        return name in self._all

    def series(self, name: str, history: History, begin: int, end: int, session: int, points: int) -> Series:
        """As History.series has it: low and high are those of each of so many buckets."""
        rows, received = history.rows(self._inputs[name], begin, end, session)
        rows = np.ascontiguousarray(rows)
        t = rows[:, 0].copy().view(np.int64)
        values = self._values(name, rows) if len(rows) else np.empty(0)
        concern = self._concerns(self._all[name][0], t, received, values)
        if not points or len(t) <= points:
            return Series(t, values, values, values, concern, concern, ("real", values.tolist()))
        place = (t - t[0]) // (int(t[-1] - t[0]) // points + 1)
        first = np.flatnonzero(np.r_[True, np.diff(place) > 0])
        last = np.r_[first[1:], len(t)] - 1
        return Series(t[last], values[last], np.minimum.reduceat(values, first), np.maximum.reduceat(values, first),
                      concern[last], np.maximum.reduceat(concern, first), ("real", values[last].tolist()))

    def _concerns(self, parameter: Derived, t: Array, received: Array, values: Array) -> Array:
        """By the limits in force when the packets were received, in a monitor of its own."""
        monitor = Database([]).monitor()
        slot = monitor.derive(parameter.name, parameter.unit, parameter.description, parameter.limits)
        limits = InForce([change for change in self._changes if change["name"] == parameter.name], monitor)
        concerns = np.zeros(len(t), np.uint8)
        at = 0
        for notes, rows in limits.parts([(i, int(when), b"") for i, when in enumerate(received)]):
            for place, now in [(at, note[4]) for note in notes] + [
                    (note[2], note[4]) for note in monitor.put(
                        slot, np.arange(at, at + len(rows)).tobytes(), values[at:at + len(rows)].tobytes())]:
                concerns[place:] = now
            at += len(rows)
        return concerns

    def _values(self, name: str, rows: Array) -> Array:
        columns = {path: rows[:, 1 + i] for i, path in enumerate(self._inputs[name])}

        def values(name: str) -> Array:
            if name not in columns:
                parameter, compute = self._all[name]
                inputs = {key: values(path) for key, path in parameter.of.items()}
                try:
                    column = np.asarray(compute(**inputs), float)
                    columns[name] = np.ascontiguousarray(np.broadcast_to(column, len(rows)))
                except Exception as error:      # of a function of the user's
                    raise SetupError(f"{name}: {type(error).__name__}: {error}") from None
            return columns[name]

        with np.errstate(all="ignore"):
            return values(name)
