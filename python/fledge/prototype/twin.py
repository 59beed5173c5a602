# SPDX-License-Identifier: Apache-2.0
"""A prototype beside the module in C, or model in C++, that takes its place: both fly on the same recorded inputs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fledge import _core
from fledge.errors import SetupError, did_you_mean, listed
from fledge.objects.si import time_ns


def load(text: str) -> Any:
    """The class "FILE:CLASS", as in "missions/turn/prototypes.py:SunSlew". Raises SetupError."""
    from fledge.mission.folder import Mission, MissionFiles

    file, _, name = text.rpartition(":")
    path = Path(file)
    if not file or path.suffix != ".py":
        raise SetupError(f"a prototype is FILE:CLASS, as in missions/turn/prototypes.py:SunSlew; found '{text}'")
    if not path.is_file():
        raise SetupError(f"there is no {path}")
    with MissionFiles(Mission(path.resolve().parent)) as files:
        module = files.execute(path.stem)
    known = [n for n, value in vars(module).items() if isinstance(value, type) and "_struct" in vars(value)]
    if name not in known:
        raise SetupError(f"{path} has no prototype '{name}'{did_you_mean(name, known)} it has {listed(known)}")
    return getattr(module, name)


def compare(mission: str | os.PathLike[str], first: Any, second: Any, duration: Any, *, within: float = 0.0,
            seed: int = 0) -> float:
    """Fly a mission that has one of two types, record the inputs of that instance at each of its updates, then fly
    each of both types alone on this record, and compare their outputs, bit for bit or within a bound.

    first, second: the prototype's class, and the type that shall do the same. Both take the parameters of the mission's
    instance. within: how far numbers may lie apart, as a part of themselves, or of 1 if they are smaller; 0: no bit.
    Returns the greatest such distance. Raises AssertionError that names the first difference, SetupError if the mission
    has none of both.
    """
    from fledge.mission import load as load_mission

    sim = load_mission(mission, seed)
    name = _core.struct(first._memory if hasattr(first, "_memory") else first).name
    matches = [(process, key, instance) for process in sim.processes for key, instance in process.instances.items()
               if _core.struct(instance).name in (name, getattr(second, "__name__", name))]
    if not matches:
        raise SetupError(
            f"the mission {sim.name} flies no {name}: name one that flies the prototype or what replaces it")
    process, key, live = matches[0]
    task = next((candidate for candidate in process.tasks if key in candidate.run), None)
    if task is None:
        raise SetupError(f"{process.name}.{key} stands in no task of {sim.name}: nothing updates it")
    inputs = [f.name for f in _core.struct(live).fields if f.group == "in" and not f.spare
              and any(target == f"{process.name}.{key}.{f.name}" for _, target, *_ in sim.kernel.wires)]
    every = task.period / 1e9
    parameters = {n: getattr(live, n) for n in _core.given(live)}
    record = sim.record(*(getattr(live, n) for n in inputs), every=every) if inputs else None
    if record is not None:
        sim.run(time_ns(duration, "compare: duration") / 1e9)
    first_log, second_log = (_flown(kind, parameters, record, process.name, key, inputs, task, duration, seed)
                             for kind in (first, second))
    return _compare(first_log, second_log, within)


def _flown(kind: Any, parameters: Any, record: Any, process: str, name: str, inputs: Any, task: Any, duration: Any,
           seed: int) -> Any:
    """The log of the outputs of one instance that flies alone, under the same name, which seeds its random numbers."""
    from fledge.mission.simulation import Simulation

    instance = kind(**parameters)
    sim = Simulation("compare", seed)
    there = sim.flight if isinstance(instance, _core.Module) else sim.world
    setattr(there, name, instance)
    for port in inputs:
        sim.feed(getattr(instance, port), record, topic=f"{process}.{name}.{port}")
    there.task("task", every=task.period / 1e9, offset=task.offset / 1e9, run=[instance])
    log = sim.record(instance, every=task.period / 1e9)
    sim.run(time_ns(duration, "compare: duration") / 1e9)
    return log


def _compare(first: Any, second: Any, within: float) -> float:
    """The greatest distance of the numbers in two logs of the same ports."""
    import numpy as np

    from fledge.mission.log import leaves

    worst, text = 0.0, ""
    for ours, theirs in zip(first._ports(), second._ports()):
        (times, a), (_, b) = ours.decoded(), theirs.decoded()
        for name, field, parts in leaves(ours.core.struct):
            x, y = a, b
            for part, _ in parts:
                x, y = x[part], y[part]
            if field.type in ("f64", "f32"):
                size = np.maximum(1.0, np.maximum(abs(x), abs(y)))
                apart = np.where(x == y, 0.0, abs(x - y) / size)
                apart[~np.isfinite(apart)] = np.inf
                wrong = apart > within
                bits = x.view(f"u{x.itemsize}") != y.view(f"u{y.itemsize}") if within == 0 else wrong
                wrong = wrong | bits
                worst = max(worst, float(apart.max(initial=0.0)))
            else:
                wrong = x != y
            at = next(iter(np.argwhere(wrong)), None)
            if at is not None:
                here = "".join(f"[{i}]" for i in at[1:])
                n = int(wrong.reshape(len(wrong), -1).any(axis=1).sum())
                first, second = x[tuple(at)].item(), y[tuple(at)].item()
                text = text or (f"{ours.name}.{name}{here} at {times[at[0]] / 1e9:g} s: {first!r} of the first, "
                                f"{second!r} of the second; {n} of {len(wrong)} samples differ")
    if text:
        raise AssertionError(text + (f"; numbers lie up to {worst:.3g} apart, allowed are {within:.3g}"))
    return worst
