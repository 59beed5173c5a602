# SPDX-License-Identifier: Apache-2.0
"""Modules and world models that are classes in Python, until their C is written (docs/prototypes.md).

Example:

    from fledge import flight as fsw, prototype
    from fledge.prototype import Vec3, input, mem, out, par

    class SunSlew(prototype.Module):
        \"\"\"Turns the reference at a constant rate.\"\"\"

        attitude  = input(fsw.NavAttitude)
        reference = out(fsw.AttReference, "where the body shall point")
        rate      = par(float, "[rad/s] required, > 0: of the turn")
        phase     = mem(float, "[rad] the angle so far")

        def reset(self):
            self.phase = 0.1

        def update(self, t, dt):
            self.phase += self.rate * dt
            self.reference.omega_RN_N = [0, 0, self.rate]
            self.publish(self.reference)

The words after a type are those of a comment in a header (introspect/README.md). In a mission,
`f.slew = SunSlew(rate=...)` is a module as any other: wires, tasks, records, campaigns, snapshots and reports see no
difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from fledge import _core
from fledge.errors import SetupError
from fledge.prototype.declaration import ARRAYS, Array, Declaration, declare, refuse_methods
from fledge.prototype.twin import compare, load
from introspect.model import Group, Kind, Struct

__all__ = ["Mat3", "Message", "Model", "Module", "Vec3", "compare",
           "field", "input", "load", "mem", "out", "par", "quality"]

Vec3: Array = ARRAYS["Vec3"]
Mat3: Array = ARRAYS["Mat3"]


def input(type: Any, text: str = "") -> Any:
    """An input: a type of messages, such as fsw.NavAttitude, and what its comment would say."""
    return Declaration(Group.IN, type, text)


def out(type: Any, text: str = "") -> Any:
    """An output: a type of messages, and what its comment would say."""
    return Declaration(Group.OUT, type, text)


def par(type: Any, text: str = "", *, shape: int | Sequence[int] = ()) -> Any:
    """A parameter.

    type: float, int (64 bits) or bool (8 bits), a type of numpy such as np.uint32, Vec3, Mat3, str for a text, a type
    of messages or plain structs, an IntEnum, or the name of an enumeration that a header declares.
    text: as the comment in a header, "[unit] clause, clause: meaning".
    shape: of an array of these; of a text, its largest length and one.
    """
    return Declaration(Group.PAR, type, text, shape)


def mem(type: Any, text: str = "", *, shape: int | Sequence[int] = ()) -> Any:
    """What the prototype remembers from one update to the next, as par() declares it. Each reset makes it zero."""
    return Declaration(Group.MEM, type, text, shape)


def field(type: Any, text: str = "", *, shape: int | Sequence[int] = ()) -> Any:
    """What a message holds besides its head, as par() declares it."""
    return Declaration(Group.NONE, type, text, shape)


def quality(*inputs: Any) -> Any:
    """The quality of what is computed from these inputs: that of the worst, where a stale one counts as DEGRADED, and
    NONE, which is false, if one of them was never written. In C: quality_min() of quality_through()."""
    worst = min(message.head.quality for message in inputs)
    return type(worst).DEGRADED if worst.name == "STALE" else worst


class _Class(type):
    """A subclass of Message, Module or Model is checked, and gets its table, where it is defined. Calling it makes an
    object on the memory that the table describes."""

    _kind: ClassVar[Kind | None] = None
    _struct: Struct
    _memory: Any

    def __init__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **options: Any) -> None:
        super().__init__(name, bases, namespace, **options)
        if "_kind" not in namespace:    # none of the three bases below
            refuse_methods(cls)
            cls._struct, cls._memory = declare(cls)

    def __call__(cls, *arguments: Any, **parameters: Any) -> Any:
        if "_struct" not in vars(cls):
            raise SetupError(f"{cls.__name__} is a base; write a class that is derived from it")
        if arguments:
            raise TypeError(f"{cls.__name__} takes keywords only")
        if cls._kind is Kind.MESSAGE:
            return cls._memory(**parameters)
        return _core.make_prototype(cls._memory, cls, parameters)


class _Keywords:
    if TYPE_CHECKING:
        def __init__(self, **parameters: Any) -> None: ...


class Message(_Keywords, metaclass=_Class):
    """A message that has no header yet, for ports of prototypes: a subclass has its fields as attributes. The head is
    there by itself. It is the message of a header with the same name and fields."""

    _kind = Kind.MESSAGE


class _Base(_Keywords):
    if TYPE_CHECKING:   # the objects have these from the extension
        def publish(self, output: Any, /, quality: Any = ...) -> None: ...
        def held(self, output: Any, /) -> None: ...


class Module(_Base, metaclass=_Class):
    """A flight module in Python.

    A subclass has ports, parameters and memory as attributes, `update(self, t, dt)`, and, if its memory does not begin
    at zero, `reset(self)`. t is the time [s], dt the time since the last update [s], 0 at the first one after a reset.
    `self.publish(output)` and `self.held(output)` are those of a module in Python (docs/guide.md). Raises SetupError,
    with the line, for a declaration that a header could not have, and for functions that keep state elsewhere.
    """

    _kind = Kind.MODULE


class Model(_Base, metaclass=_Class):
    """A world model in Python. As Module, but `reset(self, t)` may publish for the time t [s], and `prepare(self)`,
    before the run, may refuse parameters by an exception.

    A model with a method `air_at(self, t, r_BN_N)` is air for `Drag(air=...)`, which calls it at each stage of the
    integrator, for t [s] and a position in N [m]. It returns the density [kg/m^3], or (density, v_AN_N), the velocity
    of the air relative to N [m/s], or (density, v_AN_N, temperature [K], molar_mass [kg/mol])."""

    _kind = Kind.MODEL

    def normal(self) -> float:
        """The next standard normal number of the model's own stream, which the run's seed and its name begin."""
        return _core.draw(self, True)

    def uniform(self) -> float:
        """The next number in [0, 1) of the same stream."""
        return _core.draw(self, False)
