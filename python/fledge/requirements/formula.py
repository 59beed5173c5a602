# SPDX-License-Identifier: Apache-2.0
"""Formulas of signal temporal logic as Python objects, which print as a sentence and as mathematics.

Their semantics are pointwise and quantitative, as in sim/formula.h: a comparison x < c has the margin c - x, `&` has
the smaller one, `|` the larger one, a window the least or greatest of its samples.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, TypeAlias

from fledge.errors import SetupError, suggesting
from fledge.mission.field_path import FieldPath
from fledge.objects.measured import flat_index, unit_after
from fledge.objects.si import Number, Time, enumerator, enumerator_names, time_ns, to_si, to_vector
from fledge.world.bodies import ANGLE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Limit: TypeAlias = "Number | str | Signal"      # a text names an enumerator

_NUMBER = (0,) * 8
SHOWN = {"rad": ("deg", 180 / math.pi), "rad/s": ("deg/s", 180 / math.pi)}     # what people read: (unit, factor)


# --- signals ---------------------------------------------------------------------------------------

class Signal:
    """Numbers of a message over time, or numbers computed from them. Created by `r.signal()`, `r.mode()`.

    `[i]`, `.norm()`, `.max_abs()`, `abs()`, `+`, `-` and `*` with a number make others; comparing one number with a
    constant or with another signal makes a formula.
    """

    def __init__(self, operation: str, operands: Sequence[Signal] = (), *, text: str, shape: tuple[int, ...] = (),
                 unit: str = "", dims: Sequence[int] = _NUMBER, number: float = 0.0, place: int = -1,
                 numbers: Sequence[float] = (), field: FieldPath | None = None,
                 event: tuple[str, ...] | None = None) -> None:
        self.operation, self.operands, self.text, self.shape = operation, tuple(operands), text, shape
        self.unit, self.dims, self.number, self.place = unit, tuple(dims), number, place
        self.numbers, self.field, self.event = tuple(numbers), field, event

    @classmethod
    def of_field(cls, field: FieldPath) -> Signal:
        """The numbers that a path selects."""
        return cls("source", text=field.path, shape=field.shape, unit=field.unit, dims=field.field.dims, field=field)

    @property
    def key(self) -> tuple[object, ...]:
        """The same of signals that are the same."""
        return (self.operation, self.event or self.field and self.field.path, self.number, self.place,
                self.numbers, *(operand.key for operand in self.operands))

    @property
    def fields(self) -> list[FieldPath]:
        """The fields that it reads, those of packets apart."""
        own = [self.field] if self.field and not self.event else []
        return own + [field for operand in self.operands for field in operand.fields]

    @property
    def paths(self) -> list[str]:
        """Their paths."""
        return [field.path for field in self.fields]

    @property
    def events(self) -> list[tuple[str, ...]]:
        """(process, "event", name), (process, "command", name, what became of it), (process, "packet", name) or
        (process, "telemetry", path) of those that it reads."""
        return [signal.event for signal in self.reported if signal.event]

    @property
    def reported(self) -> list[Signal]:
        """The signals of these."""
        return [self] * bool(self.event) + [signal for operand in self.operands for signal in operand.reported]

    # --- others of it ---

    def named(self, text: str) -> Signal:
        """The same by a name, for sentences and figures: `angle(b1_N, r_N).named("the angle to Mars")`."""
        renamed = copy(self)
        renamed.text = text
        return renamed

    def norm(self) -> Signal:
        """The root of the sum of the elements' squares."""
        return self._reduced("norm")

    def max_abs(self) -> Signal:
        """The largest magnitude of the elements."""
        return self._reduced("max_abs")

    def _reduced(self, measure: str) -> Signal:
        if not self.shape:
            raise SetupError(f"{self.text}: {measure}() is for arrays")
        return self._made(measure, self, text=f"{measure}({self.text})", shape=())

    def __getitem__(self, index: int | tuple[int, ...]) -> Signal:
        index = index if isinstance(index, tuple) else (index,)
        if len(index) != len(self.shape) or not all(isinstance(i, int) and 0 <= i < n
                                                    for i, n in zip(index, self.shape)):
            raise SetupError(f"{self.text}{list(index)}: " + (
                f"expected {len(self.shape)} whole numbers below {self.shape}" if self.shape else "it is one number"))
        return self._made("element", self, text=f"{self.text}[{', '.join(map(str, index))}]", shape=(),
                          place=flat_index(index, self.shape))

    def __abs__(self) -> Signal:
        return self._made("abs", self, text=f"|{self.text}|")

    def __add__(self, other: Signal | Number) -> Signal:
        return self._joined("+", other)

    def __sub__(self, other: Signal | Number) -> Signal:
        return self._joined("-", other)

    def __mul__(self, factor: float) -> Signal:
        if not isinstance(factor, (int, float)):
            raise SetupError(f"{self.text} * {factor!r}: expected a number without unit")
        return self._made("scaled", self, text=f"{factor:g} {self.text}", number=float(factor))

    __rmul__ = __mul__

    def _made(self, operation: str, *operands: Signal, **changes: Any) -> Signal:
        own: dict[str, Any] = {"shape": self.shape, "unit": self.unit, "dims": self.dims}
        return Signal(operation, operands, **{**own, **changes})

    def _joined(self, sign: str, other: Signal | Number) -> Signal:
        if not isinstance(other, Signal):
            value = to_si(other, f"{self.text} {sign} {other!r}", self.unit or "-", self.dims, "a number")
            if self.shape or not isinstance(value, (int, float)):
                raise SetupError(f"{self.text} {sign} {other!r}: expected one number and one number")
            other = Signal("constant", text=number_text(value, self.unit), unit=self.unit, dims=self.dims,
                           numbers=[float(value)])
        if other.shape != self.shape or tuple(other.dims[:7]) != tuple(self.dims[:7]):
            raise SetupError(f"{self.text} {sign} {other.text}: they differ in shape or unit: {_kind(self)} and "
                             f"{_kind(other)}")
        return self._made(sign, self, other, text=f"({self.text} {sign} {other.text})")

    # --- comparisons ---

    def __lt__(self, limit: Limit) -> Comparison:
        return self._compare("<", limit)

    def __le__(self, limit: Limit) -> Comparison:
        return self._compare("<=", limit)

    def __gt__(self, limit: Limit) -> Comparison:
        return self._compare(">", limit)

    def __ge__(self, limit: Limit) -> Comparison:
        return self._compare(">=", limit)

    def __eq__(self, limit: Limit) -> Comparison:  # type: ignore[override]
        return self._compare("==", limit)

    def __ne__(self, limit: Limit) -> Comparison:  # type: ignore[override]
        return self._compare("!=", limit)

    __hash__ = object.__hash__

    def _compare(self, relation: str, limit: Limit) -> Comparison:
        if self.shape:
            raise SetupError(f"{self.text} has shape {self.shape}: compare an element, norm() or max_abs()")
        if isinstance(limit, Signal):
            difference = self - limit
            return Comparison(difference, relation, 0.0, f"{self.text} {relation} {limit.text}")
        field = self.field.field if self.field else None
        if field is not None and field.type == "enum":
            value: float = enumerator(field.ctype, field.enumerators, limit, f"{self.text} {relation}")
            name = enumerator_names(field)[int(value)]
            return Comparison(self, relation, float(value), f"{self.text} {relation} {name}")
        value = to_si(limit, f"{self.text} {relation} {limit!r}", self.unit or "-", self.dims, "a number")
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            raise SetupError(f"{self.text} {relation} {limit!r}: expected a finite number")
        if relation in ("==", "!=") and (field is None or field.type.startswith("f")):
            raise SetupError(f"{self.text} {relation} {limit!r}: a real number is hardly ever equal to another; "
                             "compare it by < or >, as in abs(x - c) < 0.01")
        return Comparison(self, relation, float(value), f"{self.text} {relation} {number_text(value, self.unit)}")

    def __repr__(self) -> str:
        return self.text


def angle(a: Signal | ArrayLike, b: Signal | ArrayLike) -> Signal:
    """[rad] Between two vectors, signals or 3 numbers: `angle(turned(sigma_BN, s_N), [0, 0, 1])`."""
    first, second = _vector("angle", a), _vector("angle", b)
    return Signal("angle", (first, second), text=f"angle({first.text}, {second.text})", unit="rad", dims=ANGLE)


def turned(sigma: Signal | ArrayLike, v: Signal | ArrayLike) -> Signal:
    """A vector in the frame that an attitude (MRP sigma_BN) turns to: v_N becomes v_B. Signals or 3 numbers."""
    attitude, vector = _vector("turned", sigma), _vector("turned", v)
    return Signal("turned", (attitude, vector), text=f"turned({attitude.text}, {vector.text})", shape=(3,),
                  unit=vector.unit, dims=vector.dims)


def _vector(what: str, signal: Signal | ArrayLike) -> Signal:
    if not isinstance(signal, Signal):
        numbers = to_vector(signal, what, "-", _NUMBER)
        return Signal("constant", text=f"[{', '.join(f'{x:g}' for x in numbers)}]", shape=(3,), numbers=numbers)
    if signal.shape != (3,):
        raise SetupError(f"{what}: expected 3 numbers; {signal.text} has {signal.shape or 'one'}")
    return signal


def _kind(signal: Signal) -> str:
    return f"{signal.shape or 'a number'} in {signal.unit or '-'}"


def shown_in(unit: str, value: float) -> tuple[str, float]:
    """(unit, factor) in which people read a number in SI."""
    return SHOWN.get(unit, (unit, 1.0)) if abs(value) < 10 else (unit, 1.0)


def number_text(value: float, unit: str) -> str:
    """A number in SI as people read it: "0.5 deg"; what turns fast stays in rad/s."""
    shown, factor = shown_in(unit, value)
    return f"{value * factor:.6g}{unit_after(shown)}"


def time_text(ns: int) -> str:
    """ "90 s", "10 min" """
    seconds = ns / 1e9
    return f"{seconds / 60:g} min" if seconds >= 120 and seconds % 60 == 0 else f"{seconds:g} s"


# --- formulas --------------------------------------------------------------------------------------

class Formula:
    """What holds or does not, at each sample. `&`, `|` and `~` join formulas; str() is a sentence."""

    #: ("and", "always", ...) as sim/formula.h has them, and the operands
    kind: str = ""
    operands: tuple[Formula, ...] = ()
    begin: int = 0              # [ns] of a window, from the sample on
    end: int | None = None      # [ns]; None: the end of the run
    mathematics: str = ""       #: in the notation of signal temporal logic

    def __and__(self, other: Formula) -> Formula:
        return _join("and", " and ", " ∧ ", self, other)

    def __or__(self, other: Formula) -> Formula:
        return _join("or", " or ", " ∨ ", self, other)

    def __invert__(self) -> Formula:
        return Node("not", [self], f"not {_inner(self)}", f"¬{_symbols(self)}")

    def __bool__(self) -> bool:
        raise TypeError(f"whether it holds is only known after a run: {self}; join formulas by &, | and ~")

    @property
    def comparisons(self) -> list[Comparison]:
        """Those in it, each once."""
        by_key: dict[tuple[object, ...], Comparison] = {}
        for part in self.walk():
            if isinstance(part, Comparison):
                by_key.setdefault(part.key, part)
        return list(by_key.values())

    def walk(self) -> Iterator[Formula]:
        """The nodes, operands before what has them."""
        for operand in self.operands:
            yield from operand.walk()
        yield self

    @property
    def reach(self) -> int:
        """[ns] How far from the first sample its windows reach, those without an end apart."""
        own = self.begin if self.kind == "clock" else self.end or 0
        return own + max((operand.reach for operand in self.operands), default=0)

    def __repr__(self) -> str:
        return str(self)


class Comparison(Formula):
    """A signal and a limit, both in SI. text: in words; unit: of the signal"""

    kind = "atom"

    def __init__(self, signal: Signal, relation: str, limit: float, text: str) -> None:
        self.signal, self.relation, self.limit, self.text = signal, relation, limit, text
        self.unit = signal.unit
        self.mathematics = text

    @property
    def key(self) -> tuple[object, ...]:
        return (self.signal.key, self.relation, self.limit)

    @property
    def measured(self) -> bool:
        """Whether its margin is a distance, and not only true or false."""
        return self.relation not in ("==", "!=")

    def __str__(self) -> str:
        return self.text


class Node(Formula):
    def __init__(self, kind: str, operands: Sequence[Formula], sentence: str, mathematics: str, begin: int = 0,
                 end: int | None = None, joins: bool = False) -> None:
        self.kind, self.operands, self.sentence, self.mathematics = kind, tuple(operands), sentence, mathematics
        self.begin, self.end, self.joins = begin, end, joins

    def __str__(self) -> str:
        return self.sentence


def _join(kind: str, word: str, sign: str, a: Formula, b: Formula) -> Node:
    for operand in (a, b):
        if not isinstance(operand, Formula):
            raise SetupError(f"{operand!r} is no formula: compare a signal with a limit")
    return Node(kind, (a, b), f"{_inner(a)}{word}{_inner(b)}", f"{_symbols(a)}{sign}{_symbols(b)}", joins=True)


def _inner(formula: Formula) -> str:
    """Its sentence as a part of another one."""
    return f"({formula})" if isinstance(formula, Node) and formula.operands else str(formula)


def _symbols(formula: Formula) -> str:
    joins = isinstance(formula, Node) and formula.joins
    return f"({formula.mathematics})" if joins or isinstance(formula, Comparison) else formula.mathematics


def _formula(x: object, what: str) -> Formula:
    if not isinstance(x, Formula):
        raise SetupError(f"{what}({x!r}): expected a formula, such as a signal that is compared with a limit")
    return x


def _window(begin: Time, end: Time | None, what: str) -> tuple[int, int | None, str, str]:
    first = time_ns(begin, what)
    last = None if end is None else time_ns(end, what)
    if first < 0 or (last is not None and last < first):
        raise SetupError(f"{what}: a window begins at 0 or later and ends after its beginning; found from "
                         f"{begin!r} to {end!r}")
    words = "" if not first and last is None else f"from {time_text(first)} on" if last is None else (
        f"for {time_text(last)}" if not first else f"from {time_text(first)} to {time_text(last)} later")
    span = "" if not words else f"[{first / 1e9:g},{'∞' if last is None else f'{last / 1e9:g}'}]"
    return first, last, words, span


@suggesting()
def always(x: Formula, begin: Time = 0, end: Time | None = None) -> Formula:
    """At all samples of a window from each sample on, `begin` to `end` later (times); None: until the end."""
    first, last, words, span = _window(begin, end, "always")
    return Node("always", [_formula(x, "always")], f"always {words + ' ' if words else ''}{_inner(x)}",
                f"□{span}{_symbols(x)}", first, last)


@suggesting()
def eventually(x: Formula, begin: Time = 0, end: Time | None = None) -> Formula:
    """At one sample at least of such a window."""
    first, last, words, span = _window(begin, end, "eventually")
    words = words.replace("for ", "within ") if not first else words
    return Node("eventually", [_formula(x, "eventually")],
                f"at some time {words + ' ' if words else ''}{_inner(x)}", f"◇{span}{_symbols(x)}", first, last)


def within(duration: Time, x: Formula) -> Formula:
    """At one sample at least of the next `duration`, a time."""
    last = time_ns(duration, "within")
    if last <= 0:
        raise SetupError(f"within({duration!r}): expected a time above 0")
    return Node("eventually", [_formula(x, "within")], f"within {time_text(last)} {_inner(x)}",
                f"◇[0,{last / 1e9:g}]{_symbols(x)}", 0, last)


def never(x: Formula) -> Formula:
    """At no sample from now on."""
    inner = Node("not", [_formula(x, "never")], f"not {_inner(x)}", f"¬{_symbols(x)}")
    return Node("always", [inner], f"never {_inner(x)}", f"□¬{_symbols(x)}")


@suggesting()
def until(a: Formula, b: Formula, within: Time | None = None) -> Formula:
    """b holds at a sample of the next `within` (a time; None: until the end), and a at all samples before that."""
    _, last, _, span = _window(0, within, "until")
    limit = f" within {time_text(last)}" if last is not None else ""
    return Node("until", [_formula(a, "until"), _formula(b, "until")], f"{_inner(a)} until{limit} {_inner(b)}",
                f"{_symbols(a)} U{span} {_symbols(b)}", 0, last, joins=True)


def implies(a: Formula, b: Formula) -> Formula:
    """Where a holds, b holds."""
    return Node("or", [~_formula(a, "implies"), _formula(b, "implies")], f"if {_inner(a)} then {_inner(b)}",
                f"{_symbols(a)} → {_symbols(b)}", joins=True)


def after(x: Formula | Time) -> Formula:
    """Of a formula: it has held at this sample or one before. Of a time: the run has lasted so long."""
    if isinstance(x, Formula):
        return Node("once", [x], f"{_inner(x)} has held", f"◆{_symbols(x)}")
    ns = time_ns(x, "after")
    return Node("clock", [], f"after {time_text(ns)}", f"t ≥ {ns / 1e9:g}", ns, None, joins=True)


def before(t: Time) -> Formula:
    """The run has not lasted so long, a time."""
    ns = time_ns(t, "before")
    clock = Node("clock", [], f"after {time_text(ns)}", f"t ≥ {ns / 1e9:g}", ns)
    return Node("not", [clock], f"before {time_text(ns)}", f"t < {ns / 1e9:g}", joins=True)


def begins(x: Formula) -> Formula:
    """It holds, and did not at the sample before."""
    return Node("begins", [_formula(x, "begins")], f"{_inner(x)} begins", f"↑{_symbols(x)}")


@suggesting()
def settles(x: Formula, within: Time, lasting: Time | None = None) -> Formula:
    """It begins to hold within a time, and keeps on for `lasting`, a time; None: until the end of the run."""
    first = time_ns(within, "settles: within")
    last = None if lasting is None else time_ns(lasting, "settles: lasting")
    settled = always(_formula(x, "settles"), 0, lasting)
    if first < 0:
        raise SetupError(f"settles: within {within!r}: expected a time of 0 or more")
    stays = "stays so" if last is None else f"stays so for {time_text(last)}"
    return Node("eventually", [settled], f"within {time_text(first)} {_inner(x)}, and {stays}",
                f"◇[0,{first / 1e9:g}]{settled.mathematics}", 0, first)
