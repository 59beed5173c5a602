# SPDX-License-Identifier: Apache-2.0
"""Values that are implausible for their unit, their body or their mass, configuration that nothing reads, and torques
that outlive their mode. They warn, because a mission may mean them.

All limits stand here. Those of RULES are for numbers without a unit: with a unit, the user means the number.
"""
from __future__ import annotations

import functools
import re
import warnings
from collections.abc import Iterable, Iterator
from math import degrees, sqrt
from struct import iter_unpack
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import _core
from fledge.elements import ELEMENTS
from fledge.errors import listed
from fledge.objects.wires import caller

if TYPE_CHECKING:
    from fledge.mission.process import Process


class Rule(NamedTuple):
    """Parameters of a unit whose names match are implausible above a size. advice: with {x}, that of the value, and
    {deg}, the same in degrees."""
    unit: str
    name: str
    most: float
    advice: str


RULES = (
    Rule("rad", ".*", 6.2832, "{x:g} rad is more than a turn; for degrees write {x:g} * deg"),
    Rule("rad/s", "omega_.*|rates?", 1.0, "{x:g} rad/s is {deg:.4g} deg/s; for degrees write {x:g} * deg / s"),
    Rule("m", "r_(.B_)?B|center_B", 30.0, "{x:g} m is far from the body's origin; for millimetres write {x:g} * mm"),
)
LONGEST = 864_000_000_000_000   # [ns] of a task's period: ten days
LOWEST = 0.01               # of a body's radius: an orbit nearer to its surface meets its atmosphere or its mountains
GYRATION = (1e-3, 100.0)    # [m] the root of inertia by mass: of a chip, of a station


@functools.cache
def _rules(kind: Any) -> list[tuple[Any, Rule]]:
    """The parameters of a type that have a rule."""
    return [(field, rule) for field in _core.struct(kind).fields if field.group == "par"
            for rule in RULES if field.unit == rule.unit and re.fullmatch(rule.name, field.name)]


def _numbers(instance: Any, field: Any) -> list[float]:
    """The numbers of a field, without numpy, whose import takes longer than to build a mission."""
    code = ELEMENTS[field.type].code
    return [x for x, in iter_unpack(code, _core.memory(instance)[field.offset:field.offset + field.size])]


def _of_instance(instance: _core.Module | _core.Model) -> Iterator[str]:
    """What is implausible of the parameters of a module or model, in words."""
    kind: Any = type(instance)
    rules = _rules(kind)
    bare = set(_core.bare(instance)) if rules else ()
    for field, rule in rules:
        if field.name in bare:
            x = max((abs(number) for number in _numbers(instance, field)), default=0.0)
            if x > rule.most:
                yield f"{_core.path(instance)}.{field.name}: {rule.advice.format(x=x, deg=degrees(x))}"
    if hasattr(type(instance), "I_B") and isinstance(mass := getattr(instance, "mass", None), float) and mass > 0:
        inertia = max(_numbers(instance, next(f for f in _core.struct(kind).fields if f.name == "I_B")))
        size = sqrt(max(inertia, 0.0) / mass)
        if size and not GYRATION[0] <= size <= GYRATION[1]:
            yield (f"{_core.path(instance)}: {mass:g} kg with an inertia of {inertia:g} kg m^2 is a body of some "
                   f"{size:.2g} m; look at both units")


def check(processes: Iterable[Any]) -> None:
    """Warn of implausible parameters, at the lines that made their modules and models, and of tasks that run once; of
    each of these once in the life of a process."""
    for process in processes:
        found = [(path, f"{path} runs every {task.period / 86_400e9:g} days; every is in seconds")
                 for task in process.tasks if task.period > LONGEST for path in [f"{process.name}.{task.name}"]]
        found += [(name, text) for name, instance in process.instances.items() for text in _of_instance(instance)]
        for name, text in found:
            if text not in process.warned:
                process.warned.add(text)
                _warn(f"implausible: {text}", process.declared_at(name) or caller())


def check_read(process: Process, wires: Iterable[Any]) -> None:
    """Warn of configuration whose outputs nothing reads. wires: of the simulation."""
    used = {source.rpartition(".")[0] for source, *_ in wires} | {
        f"{process.name}.{name}" for task in process.tasks for name in task.run}
    for name, instance in process.instances.items():
        fields = _core.struct(instance).fields
        outputs = [field.name for field in fields if field.group == "out"]
        takes = any(field.group == "in" for field in fields)    # then it must stand in a task, and cannot fly
        if isinstance(instance, _core.Module) and f"{process.name}.{name}" not in used and outputs and not takes:
            kind = _core.struct(instance).name
            _warn(f"{process.name}.{name}: nothing reads {', '.join(outputs)} of this {kind}, so that its "
                  "parameters have no effect; wire it, or leave it out", process.declared_at(name) or caller())


def check_kept(process: Process, wires: Iterable[Any]) -> None:
    """Warn of inputs of modules with a `hold`, which let a torque end, in modes that suspend all writers of the input
    but not the module: the last message stays good, and the torque does not end. A reference may be kept.

    process: of flight; wires: of the simulation.
    """
    if not process.modes:
        return
    suspended = {mode: {f"{process.name}.{name}" for task in process.tasks for name in task.run
                        if task.name not in tasks and any(task.name in other for _, other in process.modes)}
                 for mode, tasks in process.modes}
    inputs: dict[str, list[tuple[str, int, str]]] = {}
    for source, target, _, stale_after, choice in wires:
        inputs.setdefault(target, []).append((source, stale_after, choice))
    for instance in process.instances.values():
        path, fields = _core.path(instance), _core.struct(instance).fields
        if not any(field.group == "par" and field.name == "hold" for field in fields):
            continue
        for field in fields:
            if field.group != "in" or field.struct.name == "AttReference":
                continue
            writers = inputs.get(f"{path}.{field.name}", [])
            lines: list[str] = []
            by: dict[str, bool] = {}
            for mode, idle in suspended.items():
                carried = {source: not stale and source.rpartition(".")[0] in idle for source, stale, choice in writers
                           if choice in ("", "newest", "first", "best", f"in {mode}")}
                if carried and all(carried.values()) and path not in idle:
                    lines.append(mode)
                    by |= carried
            if lines:
                _warn(f"{path}.{field.name}: the mode {listed(lines)} suspends {listed(list(by))}, so that the last "
                      "value stays good and acts on; write .stale_after(2 * s) behind its wire, or let a module that "
                      "runs then write it", process.declared_at(f"{path}.{field.name}") or caller())


def check_orbit(orbit: Any) -> None:
    """Warn of an ellipse that comes near to the surface of its body, unless a `surface` says that it may."""
    body = orbit.body
    height = orbit.p / (1.0 + orbit.e) - body.radius
    if body.surface is None and orbit.e < 1.0 and height < LOWEST * body.radius:
        advice = f"for kilometres write {height:.6g} * km, and " if height > 0 else ""
        _warn(f"implausible: Orbit: its lowest point is {height:.6g} m above {body.name}; {advice}"
              f"{body.name}.with_surface({body.radius:.9g} * m) if it is meant", caller())


_shown: dict[Any, Any] = {}     # each text once


def _warn(text: str, at: tuple[str, int]) -> None:
    file, line = at
    warnings.warn_explicit(text, UserWarning, file, line, registry=_shown)
