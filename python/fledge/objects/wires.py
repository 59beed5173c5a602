# SPDX-License-Identifier: Apache-2.0
"""Wires between modules and models, as `a.output >> b.input` makes them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from typing import Any, NoReturn

from fledge import _core
from fledge.errors import SetupError
from fledge.disk import shown
from fledge.objects.si import Time, time_ns

# --- lines of the user's files ---------------------------------------------------------------------

_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep


def caller() -> tuple[str, int]:
    """(file, line) of the caller outside this package."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def as_shown(at: tuple[str, int]) -> tuple[str, int]:
    """(file, line) as the errors of the kernel give it."""
    return str(shown(at[0])), at[1]


# --- wires -----------------------------------------------------------------------------------------

class Wire:
    """Wires from one output, or from several of which one counts, as `a.output >> b.input` or
    `a.output >> [b.input, c.input]` makes them.

    They take effect in connect(). With `(a >> b).latency(1)` the consumer reads the producer's message at the
    end of the previous exchange, so that both may run in parallel; `(a >> b).stale_after(2 * s)` lowers the
    quality of a message that is older. Both return the wire, so that calls can be chained.
    """

    def __init__(self, source: _core.Message | Choice, targets: list[_core.Message]) -> None:
        self.source: Any = source
        self.targets = targets
        # (output, what chooses it as in ExecChoice of flight/exec/message.h, the mode of its own)
        self.sources = source.sources if isinstance(source, Choice) else [(source, 0, "")]
        self.declared_at = caller()
        self.options = {"latency": 0, "stale_after": 0}

    def latency(self, exchanges: int) -> Wire:
        """0: the newest message; 1: that of the previous exchange."""
        self.options["latency"] = exchanges
        return self

    def stale_after(self, age: Time) -> Wire:
        """A message older than `age`, a time, reaches the consumer as stale."""
        self.options["stale_after"] = time_ns(age, f"{self!r}: stale_after")
        return self

    def __rshift__(self, target: object) -> NoReturn:
        raise TypeError(f"{self!r} >> ...: a wire ends here; write a >> [b, c] for several")

    def __repr__(self) -> str:
        targets = [_core.path(t) for t in self.targets]
        return f"{_path(self.source)} >> " + (targets[0] if len(targets) == 1 else f"[{', '.join(targets)}]")


class Choice:
    """Outputs of which an input takes one: `newest(a.torque, b.torque) >> motor.torque`. See newest(), first(), best()
    and by_mode(), which raise SetupError for fewer than two outputs, for what is no output, and if one stands in it
    twice."""

    def __init__(self, name: str, by: int, outputs: Iterable[tuple[_core.Message, str]]) -> None:
        self.sources = [(output, by, mode) for output, mode in outputs]
        self.name = name
        for output, _, _ in self.sources:
            if not isinstance(output, _core.Message):
                raise SetupError(f"{name}: expected outputs, as in {name}(a.torque, b.torque); found "
                                 + (_core.path(output) if isinstance(output, (_core.Module, _core.Model)) else
                                    repr(output)))
        seen = [(id(_core.root(output)), _core.path(output), mode) for output, _, mode in self.sources]
        for key in seen:
            if seen.count(key) > 1:
                raise SetupError(f"{self!r}: {key[1]} stands in it twice")
        if len(seen) < 2:
            raise SetupError(f"{self!r}: expected two outputs or more")

    def __rshift__(self, target: object) -> Wire:
        return wire(self, target)

    def __repr__(self) -> str:
        return f"{self.name}({', '.join((f'{mode}=' if mode else '') + _path(one) for one, _, mode in self.sources)})"


def newest(*outputs: _core.Message) -> Choice:
    """The output with the latest time; of equal ones the first. So modules in tasks of different modes drive one
    reader: one that its mode has suspended writes nothing new."""
    return Choice("newest", 1, [(output, "") for output in outputs])


def first(*outputs: _core.Message) -> Choice:
    """In order of preference: the first output whose quality is DEGRADED or GOOD; if none has it, as best(). With
    stale_after() an output that is older counts as STALE."""
    return Choice("first", 2, [(output, "") for output in outputs])


def best(*outputs: _core.Message) -> Choice:
    """The output with the highest quality; of equal ones the first. With stale_after() an output that is older counts
    as STALE."""
    return Choice("best", 3, [(output, "") for output in outputs])


def by_mode(**outputs: _core.Message) -> Choice:
    """The output of the mode in force: `by_mode(safe=a.torque, point=b.torque, slew=b.torque)`. In a mode that it does
    not name the input keeps its message, which grows old as on any wire."""
    return Choice("by_mode", 4, [(output, mode) for mode, output in outputs.items()])


def _path(source: _core.Message | Choice) -> str:
    return repr(source) if isinstance(source, Choice) else _core.path(source)


def wire(source: _core.Message | Choice, target: Any) -> Wire:
    """The Wire of `source >> target`, to one input or a list of them. Raises SetupError if they cannot be connected."""
    if isinstance(target, list):
        wires = [wire(source, part) for part in target]
        return Wire(source, [t for w in wires for t in w.targets])
    if isinstance(source, Choice):
        for output, _, _ in source.sources:
            wire(output, target)
        return Wire(source, [target])
    start = f"{_core.path(source)} >> "
    if not isinstance(target, _core.Message):
        if isinstance(target, (_core.Module, _core.Model)):
            raise SetupError(f"{start}{_core.path(target)}: name an input, not the module; it has "
                             + _ports(target, "in"))
        raise SetupError(f"{start}{target!r}: expected an input or a list of inputs")
    start += _core.path(target)
    for port, group, word in ((source, "out", "output"), (target, "in", "input")):
        field, root = _core.field(port), _core.root(port)
        if field is None or root is None or field.group != group:
            if _groups(source, target) == ["in", "out"]:
                raise SetupError(f"{start}: a wire leads from an output to an input: write {_core.path(target)} >> "
                                 f"{_core.path(source)}")
            raise SetupError(f"{start}: {_core.path(port)} is no {word}"
                             + (f"; {_core.path(root)} has {_ports(root, group)}" if root is not None else ""))
    theirs, ours = _core.struct(source), _core.struct(target)
    if (theirs.name, theirs.hash) != (ours.name, ours.hash):
        root = _core.root(target)
        assert root is not None
        fitting = [f.name for f in _core.struct(root).fields
                   if f.group == "in" and f.struct.name == theirs.name]
        alike = _fields(theirs) == _fields(ours)        # then it is their meanings that differ
        given, taken = (f"{struct.name} ({struct.doc.partition('. ')[0].removesuffix('.')})" if alike else struct.name
                        for struct in (theirs, ours))
        raise SetupError(f"{start}: the output is {given}, the input takes {taken}"
                         + (f"; {_core.path(root)} takes {theirs.name} at {', '.join(fitting)}"
                            if fitting else ""))
    return Wire(source, [target])


def _fields(struct: _core.Struct) -> list[tuple[Any, ...]]:
    return [(f.name, f.type, f.shape, f.unit) for f in struct.fields]


def _groups(*ports: _core.Message) -> list[str | None]:
    return [field.group if field else None for field in map(_core.field, ports)]


def _ports(obj: _core.Module | _core.Model, group: str) -> str:
    names = [f.name for f in _core.struct(obj).fields if f.group == group]
    return ("the inputs " if group == "in" else "the outputs ") + (", ".join(names) or "(none)")
