# SPDX-License-Identifier: Apache-2.0
"""Choices for inputs of the world: `w.connect(fsw.newest(f.a.command, f.b.command) >> w.rods.command)`.

A wire chooses among outputs of the process of its reader, and an actuator has one command. So flight chooses: such a
connection adds a module of flight/actuation/command_choices.h to the process of the outputs, and a task that runs it
behind them. It then flies as any module does, on each target.
"""
from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, count
from math import gcd
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import _core
from fledge.errors import SetupError, listed
from fledge.objects.wires import Choice, Wire

if TYPE_CHECKING:
    from fledge.mission.process import Process


class CommandChoice(NamedTuple):
    """A module that a connection added to a process.

    name: of the module, and of its task; type: of the module; rule: "newest", as in fledge.flight; outputs:
    (MODULE.PORT, the mode of its own or ""); stale_after [ns]; task: period, offset [ns], priority; None: not every
    output has a task yet
    """

    name: str
    type: str
    rule: str
    outputs: list[tuple[str, str]]
    stale_after: int
    task: tuple[int, int, int] | None = None


def routed(wire: Wire, processes: type[Process]) -> Iterator[Wire]:
    """The wires that stand for a wire: two where it is a choice of outputs of one process for inputs of another.

    processes: the class of processes whose outputs may be chosen so.
    """
    process = _process(wire.source.sources[0][0]) if isinstance(wire.source, Choice) else None
    outside = [target for target in wire.targets if _process(target) not in (process, None)]
    if not isinstance(process, processes) or not outside or any(
            _process(output) is not process for output, *_ in wire.sources):
        yield wire
        return
    if inside := [target for target in wire.targets if target not in outside]:
        yield _like(wire, wire.source, inside)
    module = _module(wire)
    name = "_".join(_core.path(outside[0]).split(".")[1:])
    names = chain([name], (f"{name}_{i}" for i in count(2)))
    name = next(free for free in names if free not in dir(process))
    setattr(process, name, module)
    process.command_choices.append(CommandChoice(
        name, _core.struct(module).name, wire.source.name,
        [(_core.path(output).partition(".")[2], mode) for output, _, mode in wire.sources],
        wire.options["stale_after"]))
    yield _like(wire, wire.source, [module.chosen], latency=0)
    yield _like(wire, module.command, outside)
    schedule(process)


def schedule(process: Process) -> None:
    """Give a task to each module of a choice whose outputs all have one: at all of their times, behind them."""
    waiting = [i for i, choice in enumerate(process.command_choices) if choice.task is None]
    tasks = {name: task for task in process.tasks for name in task.run} if waiting else {}
    for i in waiting:
        choice = process.command_choices[i]
        of = [tasks.get(output.partition(".")[0]) for output, _ in choice.outputs]
        if None not in of:
            known = [task for task in of if task is not None]
            first = known[0].offset
            period = gcd(*(task.period for task in known), *(task.offset - first for task in known))
            offset = min(task.offset for task in known)
            task = period, offset, min(task.priority for task in known) - 1
            process.command_choices[i] = choice._replace(task=task)
            process._core_process.add_task(choice.name, *task, [process.instances[choice.name]])


def _process(port: Any) -> Process | None:
    """The process of a port's module; None if it has no name yet."""
    root = _core.root(port)
    context = _core.context(root) if root is not None else None
    return context() if context else None


def _like(wire: Wire, source: Any, targets: list[Any], **options: int) -> Wire:
    copy = Wire(source, targets)
    copy.declared_at, copy.options = wire.declared_at, {**wire.options, **options}
    return copy


def _module(wire: Wire) -> Any:
    """A new module that passes on what the wire carries."""
    from fledge import flight

    message = _core.struct(wire.targets[0]).name
    known = [name.removesuffix("Choice") for name, module in flight.TYPES.items()
             if name.endswith("Choice") and [f.name for f in _core.struct(module).fields][:1] == ["chosen"]]
    if message not in known:
        raise SetupError(f"{wire!r}: flight chooses among commands to actuators ({listed(known)}), not among "
                         f"{message}; let a module of flight read the outputs, and give the world its own")
    return flight.TYPES[f"{message}Choice"]()
