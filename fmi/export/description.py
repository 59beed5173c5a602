# SPDX-License-Identifier: Apache-2.0
"""The model description of an FMU for co-simulation, by FMI 3.0 and 2.0, with the terminals and the description of its
build, which FMI 3.0 has beside it.

Annotations of the vendor "fledge" say which variables form a message: `<Message path= type= causality=>`, whose
variables are those whose names begin with the path. An input that flight sees later than at the same instant has
`latency=`, too.
"""
from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field as with_default, replace
from itertools import product
from typing import Any
from xml.etree import ElementTree

from fledge.elements import short_names
from fledge.export.fmu.variables import Enumeration, Layout, Variable
from fledge.units import BASE

Element = ElementTree.Element
CAUSALITY = {**dict.fromkeys(("input", "request", "uplink"), "input"),
             **dict.fromkeys(("output", "mode", "fired", "downlink", "clock_mode", "clock_event"), "output"),
             "local": "local", "parameter": "parameter", "fixed": "parameter", "time": "independent"}
TAGS3 = {"f64": "Float64", "f32": "Float32", "char": "String", "enum": "Enumeration",
         **{f"{sign}{bits}": f"{name}{bits}" for sign, name in (("i", "Int"), ("u", "UInt"))
            for bits in (8, 16, 32, 64)}}
TAGS2 = {"f64": "Real", "f32": "Real", "u32": "Real", "i64": "Real", "u64": "Real", "char": "String",
         "enum": "Enumeration", **dict.fromkeys(("i8", "u8", "i16", "u16", "i32"), "Integer")}
LANGUAGES = {".c": "C99", ".cpp": "C++20"}
PACKETS = "application/vnd.ccsds.space-packet"
CATEGORIES = {"modes": "modes that begin", "events": "events that fire", "commands": "commands that are refused",
              "console": "what a flight computer prints", "warnings": "what the importer should look at",
              "errors": "why a call failed"}


@dataclass(frozen=True)
class Facts:
    """What the description says of the FMU besides its variables."""
    name: str
    identifier: str             # of the library, as in nadir_spin
    about: str
    tool: str
    step: float                 # [s]
    sources: Sequence[str] = ()     # files to compile, from the folder sources on
    #: libraries that the sources need and which are not among them: name -> what to do
    needs: Mapping[str, str] = with_default(default_factory=dict)


def description(facts: Facts, layout: Layout, version: str, token: str) -> str:
    """modelDescription.xml. version: "3.0" or "2.0"."""
    return _text(_Writer(facts, layout, version).root(token))


def terminals(layout: Layout) -> str:
    """terminalsAndIcons.xml of FMI 3.0: a terminal for each message."""
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    rows = ElementTree.SubElement(root, "Terminals")
    for message in layout.messages:
        if message.role != "local":
            terminal = ElementTree.SubElement(rows, "Terminal", {
                "name": message.path, "matchingRule": "bus", "terminalKind": f"fledge.{message.struct.name}"})
            for variable in layout.variables[message.first:message.first + message.n]:
                ElementTree.SubElement(terminal, "TerminalMemberVariable", {
                    "variableName": variable.name, "memberName": variable.name.removeprefix(f"{message.path}."),
                    "variableKind": "signal"})
    return _text(root) if len(rows) else ""


def build_description(facts: Facts, options: str) -> str:
    """sources/buildDescription.xml of FMI 3.0. options: of the compilers, besides the language."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = ElementTree.SubElement(root, "BuildConfiguration", {"modelIdentifier": facts.identifier})
    for suffix, language in LANGUAGES.items():
        names = [name for name in facts.sources if name.endswith(suffix)]
        if not names:
            continue
        files = ElementTree.SubElement(build, "SourceFileSet", {
            "language": language, "compilerOptions": f"-std={language.lower()} {options}"})
        for name in names:
            ElementTree.SubElement(files, "SourceFile", {"name": name})
        ElementTree.SubElement(files, "IncludeDirectory", {"name": "."})
    for name, about in facts.needs.items():
        ElementTree.SubElement(build, "Library", {"name": name, "external": "true", "description": about})
    return _text(root)


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


class _Writer:
    def __init__(self, facts: Facts, layout: Layout, version: str) -> None:
        self.facts, self.layout, self.three = facts, layout, version == "3.0"
        self.tags = TAGS3 if self.three else TAGS2
        self.variables = layout.variables if self.three else list(_scalars(layout.variables))
        self.types: dict[str, Enumeration] = {}
        self.units: dict[str, Variable] = {}

    def root(self, token: str) -> Element:
        facts = self.facts
        root = Element("fmiModelDescription", {
            "fmiVersion": "3.0" if self.three else "2.0", "modelName": facts.name,
            "instantiationToken" if self.three else "guid": token, "description": _line(facts.about),
            "generationTool": facts.tool, "variableNamingConvention": "structured"})
        variables, structure = Element("ModelVariables"), Element("ModelStructure")
        for variable in self.variables:
            variables.append(self.variable(variable) if self.three else self.scalar(variable))
        self.structure(structure)
        root.append(self.interface())
        root.extend(part for part in (self.unit_definitions(), self.type_definitions(), self.categories(),
                                      self.experiment()) if len(part) or part.attrib)
        annotations = self.annotations()
        root.extend([variables, structure, *annotations] if self.three else [*annotations, variables, structure])
        return root

    def interface(self) -> Element:
        state = "State" if self.three else "state"
        found = Element("CoSimulation", {"modelIdentifier": self.facts.identifier,
                                         f"canGetAndSetFMU{state}": "true", f"canSerializeFMU{state}": "true",
                                         "canHandleVariableCommunicationStepSize": "true"})
        if self.three and (self.layout.processes or self.layout.events):
            found.attrib |= {"hasEventMode": "true", "mightReturnEarlyFromDoStep": "true"}
        if not self.three:
            found.set("canNotUseMemoryManagementFunctions", "true")
        if not self.three and self.facts.sources:
            files = ElementTree.SubElement(found, "SourceFiles")
            for name in self.facts.sources:
                ElementTree.SubElement(files, "File", {"name": name})
        return found

    # --- what variables refer to ---

    def unit_definitions(self) -> Element:
        found = Element("UnitDefinitions")
        for name, variable in self.units.items():
            unit = ElementTree.SubElement(found, "Unit", {"name": name})
            base = {letter: str(n) for letter, n in zip(BASE, variable.dims) if n}
            ElementTree.SubElement(unit, "BaseUnit", base | ({"factor": "1e-09"} if name == "ns" else {}))
        return found

    def type_definitions(self) -> Element:
        found = Element("TypeDefinitions")
        for name, (kind, about, rows) in self.types.items():
            more = {"name": name} | ({"description": _line(about)} if about else {})
            if self.three:
                owner = ElementTree.SubElement(found, "EnumerationType", more)
            else:
                owner = ElementTree.SubElement(ElementTree.SubElement(found, "SimpleType", more), "Enumeration")
            short, values = short_names([row[0] for row in rows], kind), set[int]()
            for item, value, meaning in rows:
                if value not in values:         # of names with the same value, the first
                    ElementTree.SubElement(owner, "Item", {"name": short[item], "value": str(value)}
                                           | ({"description": _line(meaning)} if meaning else {}))
                values.add(value)
        return found

    def categories(self) -> Element:
        found = Element("LogCategories")
        for name, about in CATEGORIES.items():
            ElementTree.SubElement(found, "Category", {"name": name, "description": about})
        return found

    def experiment(self) -> Element:
        return Element("DefaultExperiment", {"startTime": "0", "stepSize": _number(self.facts.step)})

    def annotations(self) -> list[Element]:
        rows = Element("Messages")
        for message in self.layout.messages:
            ElementTree.SubElement(rows, "Message", {"path": message.path, "type": message.struct.name,
                                                     "causality": CAUSALITY[message.role]}
                                   | ({"latency": message.latency} if message.latency != "same_instant" else {}))
        if not len(rows):
            return []
        found = Element("Annotations" if self.three else "VendorAnnotations")
        owner = ElementTree.SubElement(found, *(("Annotation", {"type": "fledge"}) if self.three
                                                else ("Tool", {"name": "fledge"})))
        owner.append(rows)
        return [found]

    def declared(self, variable: Variable) -> str:
        """The name of the type of an enumeration."""
        kind, about, rows = variable.enumeration or ("Number", "", [])
        if all(value for _, value, _ in rows) and variable.role != "mode":      # memory begins with zeros
            rows = [("UNSET", 0, "not written yet"), *rows]
        whole, name, n = (kind, about, rows), kind, 2
        while self.types.setdefault(name, whole) != whole:
            name, n = f"{kind}_{n}", n + 1
        return name

    # --- variables ---

    def facts_of(self, variable: Variable) -> dict[str, str]:
        causality = CAUSALITY[variable.role]
        meaning = variable.meaning
        if self.unit(variable) is None and variable.unit not in ("", "-", "SI"):
            meaning = f"[{variable.unit}] {meaning}"
        found = {"name": variable.name, "valueReference": str(variable.reference)}
        if meaning:
            found["description"] = _line(meaning)
        return found | {"causality": causality, "variability": {
            "parameter": "tunable", "fixed": "fixed", "time": "continuous"}.get(
                variable.role, "continuous" if variable.type in ("f64", "f32") else "discrete")}

    def unit(self, variable: Variable) -> str | None:
        """Its unit, if its tag may have one; the unit is then defined."""
        if self.tags[variable.type] not in ("Float64", "Float32", "Real") or variable.unit in ("", "-", "SI"):
            return None
        self.units.setdefault(variable.unit, variable)
        return variable.unit

    def details(self, variable: Variable) -> dict[str, str]:
        """The attributes of its type."""
        found = {}
        if variable.type == "enum":
            found["declaredType"] = self.declared(variable)
        if unit := self.unit(variable):
            found["unit"] = unit
        if variable.type not in ("enum", "char"):
            is_float = self.tags[variable.type] in ("Float64", "Float32", "Real")
            found |= {end: _number(float(bound) if is_float else round(bound))
                      for end, bound in zip(("min", "max"), variable.bounds) if bound is not None}
        if variable.start and (variable.type != "char" or not self.three):
            same = len(set(map(repr, variable.start))) == 1
            found["start"] = " ".join(map(_number, variable.start[:1] if same else variable.start))
        return found

    def variable(self, variable: Variable) -> Element:
        """In FMI 3.0."""
        if variable.role in ("clock_mode", "clock_event"):
            return Element("Clock", self.facts_of(variable) | {"intervalVariability": "triggered"})
        if variable.role in ("uplink", "downlink"):
            found = Element("Binary", self.facts_of(variable) | {"mimeType": PACKETS})
            if variable.role == "uplink":
                found.set("maxSize", _number(variable.bounds[1]))
                ElementTree.SubElement(found, "Start", {"value": ""})
            return found
        found = Element(self.tags[variable.type], self.facts_of(variable) | self.details(variable))
        for length in variable.shape:
            ElementTree.SubElement(found, "Dimension", {"start": str(length)})
        if variable.type == "char" and variable.start:
            ElementTree.SubElement(found, "Start", {"value": _number(variable.start[0])})
        return found

    def scalar(self, variable: Variable) -> Element:
        """In FMI 2.0."""
        found = Element("ScalarVariable", self.facts_of(variable))
        ElementTree.SubElement(found, self.tags[variable.type], self.details(variable))
        return found

    def structure(self, found: Element) -> None:
        """All outputs are unknowns at the beginning, too. They depend on all that is known."""
        places = [(i, variable.reference) for i, variable in enumerate(self.variables, 1)
                  if CAUSALITY[variable.role] == "output"]
        for three, two in (("Output", "Outputs"), ("InitialUnknown", "InitialUnknowns")):
            if self.three:
                found.extend(Element(three, {"valueReference": str(reference)}) for _, reference in places)
            elif places:
                rows = ElementTree.SubElement(found, two)
                rows.extend(Element("Unknown", {"index": str(i)}) for i, _ in places)


def _scalars(variables: Sequence[Variable]) -> Iterator[Variable]:
    """The elements of arrays, for FMI 2.0, which has neither arrays nor clocks, nor binary variables."""
    for variable in variables:
        if variable.role in ("clock_mode", "clock_event", "uplink", "downlink"):
            continue
        if not variable.shape:
            yield variable
            continue
        for i, index in enumerate(product(*(range(1, length + 1) for length in variable.shape))):
            yield replace(variable, name=f"{variable.name}[{','.join(map(str, index))}]", shape=(), n=1,
                          reference=variable.reference + i, start=variable.start[i:i + 1])


def _line(text: str) -> str:
    return " ".join(text.split())


def _number(value: Any) -> str:
    """A number as XML has it; a text without what XML cannot have."""
    if isinstance(value, str):
        return "".join(c if c.isprintable() else "?" for c in value)
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "INF" if value > 0 else "-INF"
    return repr(value)
