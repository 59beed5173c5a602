# SPDX-License-Identifier: Apache-2.0
"""The interface of an FMU as a model: its parameters, and messages whose fields are its variables."""
from __future__ import annotations

import math
import re
from bisect import bisect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from keyword import iskeyword
from typing import Any

import numpy as np

from fledge import _core
from fledge.elements import ELEMENTS, Element
from fledge.errors import SetupError, did_you_mean, listed
from fledge.fmi.archive import Archive
from fledge.fmi.description import NUMBERS, Variable
from fledge.objects import project
from fledge.objects.layout import described, head, lay_out
from fledge.units import unit_text
from introspect import units
from introspect.emit import schema
from introspect.files import fnv1a
from introspect.model import Bounds, Enumeration, Enumerator, Field, Group, Kind, Struct, Type, Unit

ROOM = 256              # [bytes] of a text, with its end
DIMS_MAX = 4            # as sim/table.h
MOST_FIELDS = 100_000   # with the names of their enumerations: each takes 3 KB
KINDS = (*NUMBERS, "String", "Enumeration", "Boolean")      # as Kind of fmi/importer/fmu.h
_TYPES = dict(zip(KINDS, (Type.F64, Type.F32, Type.I8, Type.U8, Type.I16, Type.U16, Type.I32, Type.U32, Type.I64,
                          Type.U64, Type.CHAR, Type.ENUM, Type.U8)))
_STEP = re.compile(r"(\w+)((?:\[\d{1,9}\])*)", re.ASCII)

Messages = Mapping[str, tuple[Any, Mapping[str, str]]]


@dataclass
class Place:
    """What a number or array in the interface is in the FMU, as FmuField of fmi/importer/fmu_model.h."""
    kind: int
    references: tuple[int, ...]
    type: int
    offset: int
    n: int
    factor: float = 1.0
    shift: float = 0.0
    discrete: bool = False


@dataclass
class Port:
    """As FmuPort there."""
    name: str
    offset: int
    first: int
    n: int
    headed: bool


@dataclass
class Plan:
    """As FmuPlan there, and `image`, the bytes of the interface with which a model begins."""
    file: str
    library: str
    resources: str
    token: str
    version: int
    event_mode: bool
    saves: bool
    single: bool
    keeps: Archive
    clocks: list[int] = field(default_factory=list)
    fields: list[Place] = field(default_factory=list)
    parameters: int = 0
    tunable: int = 0
    inputs: list[Port] = field(default_factory=list)
    outputs: list[Port] = field(default_factory=list)
    counters: list[int] = field(default_factory=list)
    assumptions: list[str] = field(default_factory=list)
    image: bytes = b""


@dataclass
class _Member:
    """A field of the interface that belongs to a variable. path: in its message, of a mapped one."""
    name: str
    variable: Variable
    path: str = ""


class Interface:
    """The type of the models of an FMU. messages: name of a port -> (type, path of a field -> variable); extra: local
    variables that are outputs, too, or True: all. Raises SetupError.

    names: path in the model -> variable, "world_nav_attitude.sigma_BN" -> "world.nav.attitude.sigma_BN".
    """

    def __init__(self, archive: Archive, messages: Messages = {}, extra: Sequence[str] | bool = ()) -> None:
        self.archive, self.description = archive, archive.description
        self.names: dict[str, str] = {}
        self._used: dict[str, int] = {}
        self._fields: dict[int, dict[str, Field]] = {}
        self._extra = extra
        self._image = bytearray()
        d = self.description
        self._own = _identifier(d.name, {})
        self.plan = Plan(archive.path.name, str(archive.library), str(archive.resources), d.token, d.version,
                         d.event_mode, d.saves, d.single, archive)
        mapped: Messages = {**self._of_fledge(messages), **messages}
        self._taken = {name for _, fields in mapped.values() for name in fields.values()}
        self._build(mapped)

    # --- which variables are what ---

    def _of_fledge(self, messages: Messages) -> dict[str, tuple[Any, dict[str, str]]]:
        """The messages of an FMU that Fledge made, by their true types."""
        given = {name for _, fields in messages.values() for name in fields.values()}
        types = {**_core.library("flight"), **_core.library("world"), **project.types("flight"),
                 **project.types("world")}
        found = {}
        every = sorted(self.description.variables)
        for path, (type_, causality) in self.description.messages.items():
            if type_ in types and (causality != "local" or self._extra is True):
                names = every[bisect(every, f"{path}."):bisect(every, f"{path}/")]      # "/" follows "."
                if given.isdisjoint(names):
                    found[path.replace(".", "_")] = types[type_], {_from_zero(name[len(path) + 1:]): name
                                                                   for name in names}
        return found

    def _wanted(self, v: Variable) -> bool:
        """Whether it is a field of the outputs that have no message of their own."""
        local = v.causality in ("local", "calculatedParameter")
        return v.causality == "output" or local and (self._extra is True
                                                     or self._extra is not False and v.name in self._extra)

    def _build(self, mapped: Messages) -> None:
        d, plan = self.description, self.plan
        for name in self._extra if not isinstance(self._extra, bool) else ():
            d[name]
        rest = [v for v in d.variables.values() if v.name not in self._taken]
        wide = {id(v.items): v.items for v in rest}         # variables share those of their type
        wide = {key: items for key, items in wide.items() if not all(-2**31 <= n < 2**31 for _, n, _ in items)}
        can = [_can_be(v) and id(v.items) not in wide for v in rest]
        unused = [v for v, it in zip(rest, can) if not it and v.causality in ("input", "output", "parameter")]
        rest = [v for v, it in zip(rest, can) if it]
        if unused:
            names = listed([f"{v.name} ({v.type})" for v in unused], 8)
            plan.assumptions.append(f"inputs and outputs: variables of {plan.file} that no message can hold keep their "
                                    f"starts: {names}")
        unknown = sorted({v.unit.name for v in d.variables.values() if v.unit and v.unit.dims is None})
        if unknown:
            plan.assumptions.append(f"units: {plan.file} does not explain {listed(unknown, 8)}; numbers in these are "
                                    "taken as they are, without unit")
        settable = [v for v in rest if v.start and v.type != "Clock"]
        tunable = [v for v in settable if v.causality == "parameter" and v.variability == "tunable"]
        fixed = [v for v in settable if v.causality == "parameter" and v.variability != "tunable"
                 or v.causality == "output" and v.initial == "exact" and v.variability != "constant"]
        inputs, outputs = [v for v in rest if v.causality == "input"], [v for v in rest if self._wanted(v)]
        own = [*inputs, *outputs, *tunable, *fixed]
        items = sum(len(v.items) for v in own)
        if len(own) + items > MOST_FIELDS:
            with_names = f" with {items:,} names of values" if items else ""
            raise SetupError(f"{self.archive.where}: {len(inputs):,} inputs, {len(outputs):,} outputs and "
                             f"{len(tunable) + len(fixed):,} parameters{with_names}; at most {MOST_FIELDS:,} can be "
                             "fields: export the FMU with fewer")
        ports: list[tuple[str, Group, Any, list[_Member]]] = []
        for name, (type_, fields) in mapped.items():
            group = self._direction(name, fields.values())
            ports.append((self._name(name), group, type_, [_Member("", d[v], path) for path, v in fields.items()]))
        for name, group, variables in (("inputs", Group.IN, inputs), ("outputs", Group.OUT, outputs)):
            if variables:
                ports.append((self._name(name), group, *self._own_message(name, variables)))
        parameters = [_Member(self._name(v.name), v) for v in [*tunable, *fixed]]
        self._lay_out(ports, parameters, len(tunable))

    def _direction(self, name: str, variables: Any) -> Group:
        inputs = {self.description[v].causality == "input" for v in variables}
        if len(inputs) != 1:
            raise SetupError(f"{self.archive.where}: the message {name} needs variables that are all inputs, or none is"
                             if inputs else f"{self.archive.where}: the message {name} has no variables")
        return Group.IN if inputs.pop() else Group.OUT

    def _own_message(self, name: str, variables: Sequence[Variable]) -> tuple[Any, list[_Member]]:
        types: dict[str, Any] = {}
        used = {"head": 1}
        members = [_Member(_identifier(v.name, used), v) for v in variables]
        fields, size, align = lay_out([head(types), *(_field(m.name, m.variable) for m in members)])
        where = f"world/{self.archive.path.name}"
        struct = Struct(self._own + name.capitalize(), f"The {name} of {self.archive.path.name}.", Kind.MESSAGE, size,
                        align, tuple(fields), where, where, 0)
        return _core.declare(struct, types, schema.text(struct)), members

    def _name(self, name: str) -> str:
        return _identifier(name, self._used)

    # --- the struct, and what of it is where in the FMU ---

    def _lay_out(self, ports: Sequence[tuple[str, Group, Any, list[_Member]]], parameters: Sequence[_Member],
                 tunable: int) -> None:
        types: dict[str, Any] = {}
        fields = []
        for name, group, type_, _ in ports:
            memory = getattr(type_, "_memory", type_)       # of a prototype, or the type itself
            sub = described(_core.struct(memory))
            types[sub.name] = memory
            fields.append(Field(name, Type.STRUCT, sub.name, (), 0, sub.size, 0, group, None, frozenset(["optional"]),
                                doc=f"of {self.archive.path.name}", struct=sub))
        for i, m in enumerate(parameters):
            initial = frozenset(["initial"] if i >= tunable else [])
            f = _field(m.name, m.variable)
            fields.append(replace(f, group=Group.PAR, clauses=initial, bounds=_bounds(m.variable, f)))
        placed, size, align = lay_out(fields)
        where, d = f"world/{self.archive.path.name}", self.description
        origin = f"From {self.archive.path.name}, FMI {d.version}.0" + (f", by {d.tool}" if d.tool else "")
        doc = ". ".join(part.strip().rstrip(".") for part in (d.about or d.name, origin))
        struct = Struct(self._own, doc + ".", Kind.MODEL, size, align, tuple(placed), where, where, 0)
        vars(struct)["hash"] = fnv1a(f"{struct.hash} {d.token} {doc}")
        self.type = _core.declare_fmu(struct, types)
        self._image = bytearray(size)
        at = {f.name: f for f in placed}
        for m in parameters:
            self._add(m.variable, at[m.name], at[m.name].offset, m.name)
        self.plan.parameters, self.plan.tunable = len(parameters), tunable
        for name, group, type_, members in ports:
            self._port(name, group, at[name], members)
        self.plan.image = bytes(self._image)

    def _port(self, name: str, group: Group, outer: Field, members: Sequence[_Member]) -> None:
        plan, first = self.plan, len(self.plan.fields)
        headed = True
        for m in members:
            path = m.path or m.name
            if m.variable.type == "Clock":
                plan.clocks.append(m.variable.references[0])
                plan.counters.append(outer.offset + self._find(outer.struct, m.name, name)[1])
                self.names[f"{name}.{path}"] = m.variable.name
                continue
            headed = headed and not path.startswith("head.")
            found, offset, size = self._find(outer.struct, path, name)
            if m.path:
                self._check(found, size, m.variable, f"{name}.{path}")
            self._add(m.variable, found, outer.offset + offset, f"{name}.{path}", group is Group.IN)
        (plan.inputs if group is Group.IN else plan.outputs).append(
            Port(name, outer.offset, first, len(plan.fields) - first, headed))

    def _find(self, struct: Any, path: str, port: str) -> tuple[Field, int, int]:
        """(field, offset in the struct, elements) of "cards[0].voltage", or of "torque[2]"."""
        offset, count = 0, 1
        found: Field | None = None
        inside: Struct | None = struct
        for step in path.split("."):
            parts = _STEP.fullmatch(step)
            known = self._known(inside) if inside else {}
            if not parts or parts[1] not in known:
                raise SetupError(f"{self.archive.where}: {port} ({struct.name}) has no field '{path}'"
                                 f"{did_you_mean(step, known)}".rstrip(";"))
            found = known[parts[1]]
            inside = found.struct
            indices = [int(i) for i in re.findall(r"\d+", parts[2])]
            if any(i >= n for i, n in zip(indices, found.shape)) or len(indices) > len(found.shape):
                raise SetupError(f"{self.archive.where}: {port}.{path} is beyond the shape {found.shape} of "
                                 f"{found.name}; indices count from 0")
            flat, count = 0, math.prod(found.shape[len(indices):])
            for i, n in zip(indices, found.shape):
                flat = flat * n + i
            offset += found.offset + flat * count * found.element_size
        assert found
        return found, offset, count

    def _known(self, struct: Struct) -> dict[str, Field]:
        """Its fields by name; made once, not for each of them."""
        if id(struct) not in self._fields:
            self._fields[id(struct)] = {f.name: f for f in struct.fields if not f.is_spare}
        return self._fields[id(struct)]

    def _check(self, f: Field, n: int, v: Variable, path: str) -> None:
        """That a field of a known message can hold a variable."""
        where = f"{self.archive.where}: {path} and {v.name}"
        text = f.type is Type.CHAR
        if f.struct or text != (v.type == "String") or not _can_be(v):
            raise SetupError(f"{where} do not fit: a field of {f.ctype}, a variable of {v.type}")
        if not text and n != v.size:
            raise SetupError(f"{where} do not fit: {n} and {v.size} elements")
        if f.unit and v.unit and v.unit.dims is not None and f.unit.text != "SI" and f.unit.dims[:7] != v.unit.dims[:7]:
            raise SetupError(f"{where} have different dimensions: {f.unit.text} and {v.unit.name}")

    def _add(self, v: Variable, f: Field, offset: int, path: str, given: bool = True) -> None:
        """Put a variable into the plan, and its start into the image, which is 0 of outputs."""
        factor, shift = _conversion(v, f)
        text = v.type == "String"
        n = math.prod(f.shape) if text else v.size
        discrete = self.plan.event_mode and v.causality == "input" and v.variability != "continuous"
        self.plan.fields.append(Place(KINDS.index(v.type), v.references, f.type.value - 1, offset, n, factor, shift,
                                      discrete))
        self.names[path] = v.name
        if v.start and given:
            try:
                if text:
                    data = v.start[0].encode()[:n - 1]
                else:
                    raw = [_number(t, v.type) for t in v.start]
                    values = raw if factor == 1.0 and shift == 0.0 else [factor * x + shift for x in raw]
                    data = _array(values, np.dtype(_element(f.type).dtype)).tobytes()
            except (ValueError, OverflowError):
                raise SetupError(f"{self.description.where}: the start of {v.name} is no {v.type}: "
                                 f"{' '.join(v.start[:60])[:60]}") from None
            self._image[offset:offset + len(data)] = data


def _element(type_: Type) -> Element:
    return ELEMENTS[type_.name.lower()]


def _number(text: str, type_: str) -> float:
    """Raises ValueError."""
    if type_ == "Boolean":
        return ("false", "true", "0", "1").index(text) % 2
    return float(text) if type_.startswith("Float") else int(text)


def _array(values: Sequence[float], dtype: np.dtype[Any]) -> np.ndarray[Any, Any]:
    """Raises ValueError for what the type cannot hold."""
    if dtype.kind != "f" and not all(np.iinfo(dtype).min <= x <= np.iinfo(dtype).max for x in values):
        raise ValueError
    if dtype.kind != "f":
        return np.array([int(x) for x in values], dtype)    # numpy makes doubles of small and large ones together
    with np.errstate(over="ignore"):
        return np.array(values).astype(dtype)


def _from_zero(path: str) -> str:
    """The path of a field with indices from 0, which FMI counts from 1."""
    return re.sub(r"\[(\d{1,9})\]", lambda found: f"[{int(found[1]) - 1}]", path)


def _identifier(name: str, used: dict[str, int]) -> str:
    """The name as an identifier, and none that differs in its capitals alone: der(h) is der_h. used: those, and the
    last number that was appended to each."""
    text = re.sub(r"_+", "_", re.sub(r"\W+", "_", name, flags=re.ASCII)).strip("_")
    text = f"v_{text}" if not text or text[0].isdigit() or iskeyword(text) else text
    found, i = text, used.get(text.lower(), 1)
    while found.lower() in used:
        found, i = f"{text}_{i + 1}", i + 1
    used[text.lower()] = i
    used.setdefault(found.lower(), 1)
    return found


def _can_be(v: Variable) -> bool:
    """Whether a field can hold it."""
    if v.type == "Clock":
        return v.causality == "output" and v.clock == "triggered"
    return v.type in KINDS and len(v.shape) <= DIMS_MAX and v.size > 0 and (v.type != "String" or not v.shape)


def _raw(v: Variable, f: Field | None = None) -> bool:
    """Whether a whole number stays as it is, although its unit is not that of SI."""
    return (v.unit is not None and not v.type.startswith("Float") and (v.unit.factor, v.unit.offset) != (1.0, 0.0)
            and (f is None or f.type not in (Type.F64, Type.F32)) and v.unit.name != "ns")


def _unit(v: Variable) -> Unit:
    if v.unit is None or v.unit.dims is None or _raw(v):
        return units.DIMENSIONLESS
    if v.unit.name == "ns" and not v.type.startswith("Float"):
        return units.NANOSECONDS
    return units.parse(unit_text(v.unit.dims) or "-")


def _field(name: str, v: Variable) -> Field:
    """A field for a variable, without its place."""
    type_ = Type.U32 if v.type == "Clock" else _TYPES[v.type]
    shape = (ROOM,) if type_ is Type.CHAR else v.shape
    enumeration = None
    if type_ is Type.ENUM:
        used: dict[str, int] = {}
        prefix = _identifier(name, {}).upper()
        enumeration = Enumeration(_identifier(f"{name}_type", {}), "", tuple(
            Enumerator(f"{prefix}_{_identifier(item, used).upper()}", value, about) for item, value, about in v.items),
            "")
    ctype = enumeration.name if enumeration else _element(type_).ctype
    number = type_ is not Type.CHAR and type_ is not Type.ENUM
    words = [v.about or v.name, f"({v.name})" if v.about and v.name != name else "",
             "number of ticks" if v.type == "Clock" else "",
             f"in '{v.unit.name}'" if v.unit and (v.unit.dims is None or _raw(v)) else ""]
    return Field(name, type_, ctype, shape, 0, _element(type_).size * math.prod(shape), 0, Group.NONE,
                 _unit(v) if number else None, doc=" ".join(word for word in words if word), enum=enumeration)


def _conversion(v: Variable, f: Field) -> tuple[float, float]:
    """(factor, shift): a value of the field is factor * (value of the variable) + shift."""
    if v.unit is None or v.unit.dims is None or _raw(v, f):
        return 1.0, 0.0
    scale = f.unit.scale if f.unit else 1.0
    return v.unit.factor / scale, v.unit.offset / scale


def _bounds(v: Variable, f: Field) -> Bounds | None:
    if v.type not in NUMBERS or v.lo is v.hi is None:
        return None
    factor, shift = _conversion(v, f)
    lo, hi = (None if text is None else factor * float(text) + shift for text in (v.lo, v.hi))
    return Bounds(lo, hi) if factor > 0 else Bounds(hi, lo)
