# SPDX-License-Identifier: Apache-2.0
"""Python functions of a simulation, made anew for a clone of it: where one uses the simulation or a part of it, the new
one uses that of the clone.

Example:

    import fledge
    from fledge.mission import rebinding
    from fledge.units import s

    sim = fledge.load("nadir_spin")
    speeds = sim.world.wheels.speeds
    sim.world.at(5 * s, lambda: speeds.Omega.fill(0))
    other = rebinding.separate(sim, sim.clone())    # its event has an effect on the wheels of the clone

A function that keeps anything else which may change is refused, because clones would share it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from enum import Enum
from types import BuiltinFunctionType, CellType, FunctionType, MethodType, ModuleType
from typing import TYPE_CHECKING, Any

from fledge import _core
from fledge.errors import SetupError
from fledge.mission.process import Event, Mode, Process
from fledge.objects.outside import globals_of, is_library, stores
from fledge.objects.script import function_text, prototype, script
from fledge.units import Quantity

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation

_CONSTANTS = (int, float, complex, str, bytes, type(None), range, Enum, Quantity, ModuleType, type)


def has_functions(simulation: Simulation) -> bool:
    """Whether it has any; those of prototypes, which keep all in their memory, are none."""
    return any(True for _ in _events(simulation)) or any(True for _ in _scripts(simulation))


def separate(original: Simulation, clone: Simulation) -> Simulation:
    """Give a clone functions of its own, and return it. Raises SetupError for one that keeps what clones would
    share."""
    for event in _events(clone):
        rebound = _Rebound(original, clone, f"event {event._process().name}.{event.name}")
        vars(event).update({name: rebound(function) for name, function in vars(event).items()
                            if name in ("when", "do") and function in event.functions})
    for instance, functions in _scripts(clone):
        rebound = _Rebound(original, clone, _core.path(instance))
        update, reset = (function and rebound(function) for function in functions)
        _core.give_script(instance, update, reset)
    return clone


def _events(simulation: Simulation) -> Iterator[Event]:
    return (event for process in simulation.processes for event in process.events.values()
            if event.do or not isinstance(event.when, _core.Condition))


def _scripts(simulation: Simulation) -> Iterator[tuple[Any, Any]]:
    for process in simulation.processes:
        for instance in process.instances.values():
            if prototype(instance) is None and (functions := script(instance)):
                yield instance, functions


class _Rebound:
    """What the functions of an event or module use, in a clone; each is made once."""

    def __init__(self, original: Simulation, clone: Simulation, what: str) -> None:
        self._original, self._clone, self._what = original, clone, what
        self._made: dict[int, Any] = {}

    def __call__(self, function: Any) -> Any:
        return self._of(function, "", function)

    def _of(self, value: Any, name: str, user: Any) -> Any:
        """The clone's for a value that a function, the user, has under a name."""
        if id(value) in self._made:
            return self._made[id(value)]
        if isinstance(value, FunctionType) and not is_library(value):
            return self._function(value)
        if isinstance(value, MethodType):
            return MethodType(self._of(value.__func__, name, user), self._of(value.__self__, name, user))
        if isinstance(value, (tuple, frozenset)) and type(value) in (tuple, frozenset):
            return type(value)(self._of(part, name, user) for part in value)
        if isinstance(value, (FunctionType, *_CONSTANTS)) or _is_fixed_array(value):
            return value
        if isinstance(value, BuiltinFunctionType) and isinstance(value.__self__, (ModuleType, type(None))):
            return value
        try:
            found = self._counterpart(value)
        except (AttributeError, IndexError, KeyError, SetupError):
            found = None
        if found is None:
            kind = type(value).__name__
            raise SetupError(
                f"{self._what}: {function_text(user)} uses {name or 'itself'}, {'an' if kind[0] in 'aeiou' else 'a'} "
                f"{kind} outside of the simulation, which clones would share: make it a tuple or an array that cannot "
                "be written, or a mem() of a prototype")
        return found

    def _counterpart(self, value: Any) -> Any:
        """The same part of the clone; None if it is no part of the original."""
        if value is self._original:
            return self._clone
        if isinstance(value, Process):
            return self._clone.process(value.name) if self._original.process(value.name) is value else None
        if isinstance(value, (Event, Mode)):
            process = value._process()
            return self._clone.process(process.name)._handles[value.name] if self._counterpart(process) else None
        if not isinstance(value, (_core.Module, _core.Model, _core.Message)):
            return None
        path = _core.path(value)
        own = _walk(self._original, path)
        # A message or struct is a new view each time.
        same = own is value if isinstance(value, (_core.Module, _core.Model)) else type(own) is type(value)
        return _walk(self._clone, path) if same else None

    def _function(self, function: FunctionType) -> FunctionType:
        code = function.__code__
        for name, line in stores(code, code.co_freevars):
            raise SetupError(f"{self._what}: {function_text(function)} assigns {name} in line {line}, a variable "
                             "outside of it, which clones would share: declare it as mem() of a prototype")
        if "random" in code.co_names:
            raise SetupError(f"{self._what}: {function_text(function)} draws random numbers that clones would share: a "
                             "prototype of the world draws by self.normal() and self.uniform()")
        cells = tuple(CellType() for _ in code.co_freevars)
        names = dict(function.__globals__)
        made = self._made[id(function)] = FunctionType(code, names, function.__name__, None, cells)
        made.__dict__.update({name: self._of(value, f"{function.__name__}.{name}", function)
                              for name, value in vars(function).items()})
        names.update({name: self._of(names[name], name, function) for name, _ in globals_of(code) if name in names})
        for name, cell, old in zip(code.co_freevars, cells, function.__closure__ or ()):
            try:
                content = old.cell_contents
            except ValueError:      # not assigned yet
                continue
            cell.cell_contents = self._of(content, name, function)
        made.__defaults__ = self._of(function.__defaults__, "a default", function)
        if function.__kwdefaults__:
            made.__kwdefaults__ = {name: self._of(value, name, function)
                                   for name, value in function.__kwdefaults__.items()}
        return made


def _walk(simulation: Simulation, path: str) -> Any:
    """The part of a simulation at a path, as "world.wheels.speeds"."""
    process, instance, *rest = path.split(".")
    found = simulation.process(process).instances[instance]
    for name, indices in (re.fullmatch(r"(\w+)((?:\[\d+\])*)", part).groups() for part in rest):   # type: ignore
        found = getattr(found, name)
        for i in re.findall(r"\d+", indices):
            found = found[int(i)]
    return found


def _is_fixed_array(value: Any) -> bool:
    import numpy as np

    return isinstance(value, np.generic) or isinstance(value, np.ndarray) and value.base is None \
        and not value.flags.writeable and value.dtype != object
