# SPDX-License-Identifier: Apache-2.0
"""modelDescription.xml of FMI 2.0 and 3.0, for co-simulation: variables, units, and what the FMU can do."""
from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from fledge.errors import did_you_mean
from fledge.files.kvn import refuse
from fledge.units import BASE

OLD = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String", "Enumeration": "Enumeration"}
NUMBERS = ("Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
NEW = (*NUMBERS, "String", "Enumeration", "Boolean", "Binary", "Clock")
# Limits, so that a small file does not fill the memory.
MOST_BYTES = 64 << 20       # of a description
MOST_TAGS = 500_000         # of those that are read
MOST_ELEMENTS = 1_000_000   # of all arrays together
MOST_EXPONENT = 100         # of a unit
_READ = ("CoSimulation", "ModelExchange", "ScheduledExecution", "UnitDefinitions", "TypeDefinitions",
         "DefaultExperiment", "Annotations", "VendorAnnotations", "ModelVariables")     # in the root
_ELEMENT = re.compile(r"(.+)\[(\d{1,9}(?:, *\d{1,9})*)\]", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d{1,20}", re.ASCII)


@dataclass(frozen=True)
class Unit:
    """A unit by its name. In SI a value is factor * value + offset; dims: exponents of m, kg, s, A, K, mol, cd, rad,
    None where the description does not say them."""
    name: str
    dims: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable, or an array of scalars `name[1]`, `name[2]` ... that are listed with indices.

    references: one of a variable, or of each element in C's order; type: of 3.0, "Float64"; start: texts, as many as
    elements, or none; items: (name, value, meaning) of an enumeration; clock: the kind of a clock's interval.
    """
    name: str
    references: tuple[int, ...]
    type: str
    causality: str = "local"
    variability: str = "continuous"
    initial: str = ""
    start: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()
    unit: Unit | None = None
    lo: str | None = None
    hi: str | None = None
    items: tuple[tuple[str, int, str], ...] = ()
    about: str = ""
    clock: str = ""

    @property
    def size(self) -> int:
        return math.prod(self.shape)


@dataclass
class Description:
    """What a model description says. version: 2 or 3; step: [s] of its default experiment, or None; messages: path ->
    (type, causality) of those of FMUs that Fledge made."""
    where: str
    version: int
    name: str
    token: str
    identifier: str
    about: str
    tool: str
    saves: bool
    event_mode: bool
    single: bool
    step: float | None
    variables: dict[str, Variable] = field(default_factory=dict)
    messages: dict[str, tuple[str, str]] = field(default_factory=dict)

    @staticmethod
    def read(data: bytes, where: str) -> Description:
        """Raises SetupError, with the line, for anything but a description of an FMU for co-simulation."""
        return _Reader(_parsed(data, where), where).description()

    def __getitem__(self, name: str) -> Variable:
        if name not in self.variables:
            refuse(self.where, 0, f"there is no variable '{name}'{did_you_mean(name, self.variables)}".rstrip(";"))
        return self.variables[name]


def _parsed(data: bytes, where: str) -> Element:
    """The root, with what is read of it; each element has its line as the attribute "". Entities of a document type
    could fill the memory."""
    if len(data) > MOST_BYTES:
        refuse(where, 0, f"{len(data):,} bytes; at most {MOST_BYTES:,} are read")
    builder, parser = TreeBuilder(), expat.ParserCreate()
    depth = skipped = tags = 0      # skipped: the depth of the element of the root that is not read

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth, skipped, tags
        tag, line = name.rpartition(":")[2], parser.CurrentLineNumber
        depth += 1
        skipped = skipped or depth == 2 and tag not in _READ and depth
        if not skipped:
            tags += 1
            if tags > MOST_TAGS:
                refuse(where, line, f"more than {MOST_TAGS:,} elements")
            attributes[""] = str(line)
            builder.start(tag, attributes)

    def end(name: str) -> None:
        nonlocal depth, skipped
        if not skipped:
            builder.end(name.rpartition(":")[2])
        skipped = skipped if skipped < depth else 0
        depth -= 1

    def doctype(*_: object) -> None:
        refuse(where, parser.CurrentLineNumber, "expected no document type, whose entities could fill the memory; "
               "remove <!DOCTYPE ...>")

    parser.StartElementHandler, parser.EndElementHandler, parser.StartDoctypeDeclHandler = start, end, doctype
    try:
        parser.Parse(data, True)
        return builder.close()
    except expat.ExpatError as error:
        refuse(where, error.lineno, f"expected XML; {expat.ErrorString(error.code)}")
    except (LookupError, UnicodeError) as error:        # an encoding that Python does not know
        refuse(where, 1, f"expected XML; {error}")


class _Reader:
    def __init__(self, root: Element, where: str) -> None:
        self.root, self.where = root, where
        self.version = 0
        self.units: dict[str, Unit] = {}
        self.types: dict[str, Element] = {}
        self.items: dict[str, tuple[tuple[str, int, str], ...]] = {}    # of the types that are enumerations

    def refuse(self, element: Element, text: str) -> NoReturn:
        refuse(self.where, int(element.get("", "0")), text)

    def need(self, element: Element, name: str) -> str:
        if (value := element.get(name)) is None:
            self.refuse(element, f"<{element.tag}> has no {name}")
        return value

    def number(self, element: Element, name: str, default: float | None = None) -> float:
        text = element.get(name) if default is not None else self.need(element, name)
        try:
            value = float(text) if text is not None else default
        except ValueError:
            value = math.nan
        if value is None or not math.isfinite(value):
            self.refuse(element, f"{name} of <{element.tag}>: expected a number; found '{_short(text)}'")
        return value

    def whole(self, element: Element, name: str, most: int, least: int = 0, default: int | None = None) -> int:
        text = element.get(name) if default is not None else self.need(element, name)
        if text is None and default is not None:
            return default
        text = (text or "").strip()
        place = f"{name} of <{element.tag}>: expected a number"
        if not _WHOLE.fullmatch(text):
            self.refuse(element, f"{place}; found '{_short(text)}'")
        if not least <= int(text) <= most:
            self.refuse(element, f"{place} from {least:,} to {most:,}; found {text}")
        return int(text)

    def is_true(self, element: Element, name: str) -> bool:
        return element.get(name, "").strip() in ("true", "1")

    def description(self) -> Description:
        root, where = self.root, self.where
        if root.tag != "fmiModelDescription":
            self.refuse(root, f"expected <fmiModelDescription>; found <{root.tag}>")
        version = self.need(root, "fmiVersion")
        if not re.fullmatch(r"[23]\.0(\.\d+)?", version):
            self.refuse(root, f"this FMU is of FMI {version}; Fledge flies 2.0 and 3.0: export it anew as one of these")
        self.version = int(version[0])
        interface = root.find("CoSimulation")
        if interface is None:
            kinds = [kind for kind in ("ModelExchange", "ScheduledExecution") if root.find(kind) is not None]
            self.refuse(root, f"this FMU is for {' and '.join(kinds) or 'nothing'} alone; Fledge flies FMUs for "
                        "co-simulation: export it anew as one")
        if self.is_true(interface, "needsExecutionTool"):
            self.refuse(interface, "this FMU needs another program to run (needsExecutionTool), which Fledge does not "
                        "start; export one that stands alone")
        state = "State" if self.version == 3 else "state"
        experiment = root.find("DefaultExperiment")
        found = Description(
            where, self.version, self.need(root, "modelName"),
            self.need(root, "instantiationToken" if self.version == 3 else "guid"),
            self.need(interface, "modelIdentifier"), root.get("description", ""), root.get("generationTool", ""),
            all(self.is_true(interface, f"{can}FMU{state}") for can in ("canGetAndSet", "canSerialize")),
            self.is_true(interface, "hasEventMode"), self.is_true(interface, "canBeInstantiatedOnlyOncePerProcess"),
            None if experiment is None or "stepSize" not in experiment.attrib
            else self.number(experiment, "stepSize"))
        if not re.fullmatch(r"\w[\w.+-]*", found.identifier):
            self.refuse(interface, f"modelIdentifier: expected a name; found '{found.identifier}'")
        for unit in root.iterfind("UnitDefinitions/Unit"):
            name = self.need(unit, "name")
            self.units[name] = self.unit(name, unit)
        for type_ in root.iterfind("TypeDefinitions/*"):
            self.types[self.need(type_, "name")] = type_ if self.version == 3 or not len(type_) else type_[0]
        found.variables = self.variables()
        for message in root.iter("Message"):
            if "path" in message.attrib:
                found.messages[message.attrib["path"]] = (message.get("type", ""), message.get("causality", ""))
        return found

    def unit(self, name: str, unit: Element) -> Unit:
        base = unit.find("BaseUnit")
        if base is None:
            return Unit(name)
        factor = self.number(base, "factor", 1.0)
        if factor == 0.0:
            self.refuse(base, f"factor of the unit '{name}': expected a number that is not 0")
        return Unit(name, tuple(self.whole(base, letter, MOST_EXPONENT, -MOST_EXPONENT, 0) for letter in BASE), factor,
                    self.number(base, "offset", 0.0))

    # --- variables ---

    def variables(self) -> dict[str, Variable]:
        rows = self.root.findall("ModelVariables/*")
        found: dict[str, Variable] = {}
        elements: dict[str, tuple[Element, Element]] = {}
        for row in rows:
            value = row
            if self.version == 2:
                value = next((child for child in row if child.tag in OLD), row)
            if value.tag not in (OLD if self.version == 2 else NEW):
                self.refuse(row, f"expected a variable; found <{row.tag}>")
            name = self.need(row, "name")
            if name in found:
                self.refuse(row, f"two variables have the name '{name}'")
            found[name] = self.variable(row, value)
            elements[name] = row, value
        starts = {v.references[0]: v.start for v in found.values() if v.start}
        total = 0
        for name, (row, value) in elements.items():
            if dimensions := [child for child in value if child.tag == "Dimension"]:
                size, shape = 1, []
                for each in dimensions:
                    shape.append(self.dimension(each, starts))
                    size = min(size * shape[-1], 10**20)    # not a number of thousands of digits
                total += size
                if total > MOST_ELEMENTS:
                    with_others = f", and {total:,} with the arrays before it" if total > size else ""
                    self.refuse(row, f"'{name}' has {size:,} elements{with_others}; at most {MOST_ELEMENTS:,} are read")
                found[name] = replace(found[name], shape=tuple(shape))
            v = found[name]
            if len(v.start) == 1 < v.size:
                found[name] = replace(v, start=v.start * v.size)        # one value for all elements
            elif v.start and len(v.start) != v.size:
                self.refuse(row, f"'{name}' has {v.size} elements; its start has {len(v.start)}")
        return {v.name: v for v in _arrays(found)}

    def dimension(self, dimension: Element, starts: Mapping[int, tuple[str, ...]]) -> int:
        text = dimension.get("start") or "".join(starts.get(self.reference(dimension), ("",))[:1])
        if not text.isdecimal():
            self.refuse(dimension, f"<Dimension>: expected a whole number; found '{_short(text)}'")
        if len(text) > 19:
            self.refuse(dimension, f"<Dimension>: a number of {len(text):,} digits; at most {MOST_ELEMENTS:,} elements "
                        "are read")
        return int(text)

    def reference(self, element: Element) -> int:
        return self.whole(element, "valueReference", 2**32 - 1)

    def variable(self, row: Element, value: Element) -> Variable:
        type_ = OLD[value.tag] if self.version == 2 else value.tag
        declared = self.types.get(value.get("declaredType", ""))
        facts = {**(declared.attrib if declared is not None else {}), **value.attrib}
        texts = [child.get("value", "") for child in value if child.tag == "Start"]
        if "start" in value.attrib:
            texts = [facts["start"]] if type_ == "String" else facts["start"].split()
        items: tuple[tuple[str, int, str], ...] = ()
        if type_ == "Enumeration":
            if declared is None:
                self.refuse(row, f"'{row.get('name')}' is an enumeration without a declaredType")
            items = self.items_of(value.attrib["declaredType"], declared)
        if type_ in NUMBERS:
            for end in ("min", "max"):
                self.bound(row, end, facts.get(end))
        continuous = type_ in ("Float64", "Float32")
        unit = self.units.get(facts["unit"], Unit(facts["unit"])) if "unit" in facts else None
        return Variable(row.attrib["name"], (self.reference(row),), type_,
                        row.get("causality", "local"),
                        row.get("variability", "continuous" if continuous else "discrete"), row.get("initial", ""),
                        tuple(texts), (), unit, facts.get("min"), facts.get("max"), items,
                        row.get("description", facts.get("description", "")), facts.get("intervalVariability", ""))

    def items_of(self, name: str, type_: Element) -> tuple[tuple[str, int, str], ...]:
        """Read once for all variables of the type."""
        if name not in self.items:
            self.items[name] = tuple((self.need(item, "name"), self.whole(item, "value", 2**63 - 1, -2**63),
                                      item.get("description", "")) for item in type_.iter("Item"))
        return self.items[name]

    def bound(self, row: Element, name: str, text: str | None) -> None:
        try:
            if text is None or not math.isnan(float(text)):
                return
        except ValueError:
            pass
        self.refuse(row, f"{name} of '{row.get('name')}': expected a number; found '{_short(text)}'")


def _short(text: str | None) -> str:
    """A text of a file, for a message."""
    return f"{text[:37]}..." if text and len(text) > 40 else str(text)


def _arrays(found: Mapping[str, Variable]) -> Iterator[Variable]:
    """The variables, with scalars of complete indices `name[1,1]` ... as one."""
    groups: dict[str, dict[tuple[int, ...], Variable]] = {}
    for name, v in found.items():
        if (parts := _ELEMENT.fullmatch(name)) and not v.shape and v.type in NUMBERS:
            groups.setdefault(parts[1], {})[tuple(int(i) for i in parts[2].split(","))] = v
    whole: dict[str, Variable] = {}
    for base, elements in groups.items():
        first = next(iter(elements.values()))
        alike = {(len(i), v.type, v.causality, v.variability, v.initial, v.unit, bool(v.start))
                 for i, v in elements.items()}
        shape = tuple(max(sizes) for sizes in zip(*elements))
        lowest = min(i for index in elements for i in index)
        if base in found or len(alike) > 1 or lowest < 1 or math.prod(shape) != len(elements):
            continue
        rows = [elements[i] for i in sorted(elements)]
        array = replace(first, name=base, references=tuple(v.references[0] for v in rows), shape=shape,
                        start=tuple(text for v in rows for text in v.start))
        whole.update(dict.fromkeys((v.name for v in rows), array))
    yield from {id(v): v for v in (whole.get(name, v) for name, v in found.items())}.values()
