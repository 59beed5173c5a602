# SPDX-License-Identifier: Apache-2.0
"""Wires between modules and models, as `a.output >> b.input` makes them."""

from __future__ import annotations

import os
import sys
from typing import Any

from fledge import _core
from fledge.errors import SetupError
from fledge.objects.si import time_ns

# --- lines of the user's files ---------------------------------------------------------------------

_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep


def caller() -> tuple[str, int]:
    """(file, line) of the caller outside this package."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


# --- wires -----------------------------------------------------------------------------------------

class Wire:
    """Wires from one output, as `a.output >> b.input` or `a.output >> [b.input, c.input]` makes them.

    They take effect in connect(). With `(a >> b).latency(1)` the consumer reads the producer's message at the
    end of the previous exchange, so that both may run in parallel; `(a >> b).stale_after(2 * s)` lowers the
    quality of a message that is older. Both return the wire, so that calls can be chained.
    """

    def __init__(self, source: Any, targets: list[Any]) -> None:
        self.source = source
        self.targets = targets
        self.declared_at = caller()
        self.options = {"latency": 0, "stale_after": 0}

    def latency(self, exchanges: int) -> Wire:
        """0: the newest message; 1: that of the previous exchange."""
        self.options["latency"] = exchanges
        return self

    def stale_after(self, age: Any) -> Wire:
        """A message older than `age`, a time, reaches the consumer as stale."""
        self.options["stale_after"] = time_ns(age, f"{self!r}: stale_after")
        return self

    def __rshift__(self, target):
        raise TypeError(f"{self!r} >> ...: a wire ends here; write a >> [b, c] for several")

    def __repr__(self):
        targets = [_core.path(t) for t in self.targets]
        return f"{_core.path(self.source)} >> " + (targets[0] if len(targets) == 1 else f"[{', '.join(targets)}]")


def wire(source: Any, target: Any) -> Wire:
    """`source >> target`. Raises SetupError if they cannot be connected."""
    if isinstance(target, list):
        wires = [wire(source, one) for one in target]
        return Wire(source, [t for w in wires for t in w.targets])
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
            raise SetupError(f"{start}: {_core.path(port)} is no {word}"
                             + (f"; {_core.path(root)} has {_ports(root, group)}" if root is not None else ""))
    theirs, ours = _core.struct(source), _core.struct(target)
    if (theirs.name, theirs.hash) != (ours.name, ours.hash):
        fitting = [f.name for f in _core.struct(_core.root(target)).fields
                   if f.group == "in" and f.struct.name == theirs.name]
        raise SetupError(f"{start}: the output is {theirs.name}, the input takes {ours.name}"
                         + (f"; {_core.path(_core.root(target))} takes {theirs.name} at {', '.join(fitting)}"
                            if fitting else ""))
    return Wire(source, [target])


def _ports(obj, group):
    names = [f.name for f in _core.struct(obj).fields if f.group == group]
    return ("the inputs " if group == "in" else "the outputs ") + (", ".join(names) or "(none)")
