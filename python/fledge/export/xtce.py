# SPDX-License-Identifier: Apache-2.0
"""The database of a mission as an XTCE 1.2 file, in the elements that both Yamcs and COSMOS read.

There is one SpaceSystem. Arrays are written out, because Yamcs and COSMOS disagree on arrays in commands, and neither
checks limits of elements. The numbers of a command's header are parameters with constant values, which no operator
sees; the sender sets sequence, length and checksum. An alias in the name space Fledge has a name as Fledge writes it.
"""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from xml.etree import ElementTree

from fledge.commands import DATA_MAX, Reason
from fledge.elements import ELEMENTS
from fledge.export import names
from fledge.export.ground import Ground, Shown
from fledge.export.packets import HEADER, Command, Database, Item, Packet, number

NAMESPACE = "http://www.omg.org/spec/XTCE/20180204"
SENT = "/yamcs/cmdHist/ccsds-seqcount"      # the sequence of a command that Yamcs has sent
Element = ElementTree.Element


def xtce(name: str, databases: Sequence[Database], ground: Ground, station: str = "") -> str:
    """The text of the file. name: of the SpaceSystem; station: "yamcs" or "cosmos", if only that is to read it: Yamcs
    then knows a command's reports by their sequence; COSMOS reads no verifiers, and no bytes whose number varies."""
    return _Writer(databases, ground, station).file(name)


def ends_open(packet: Packet) -> bool:
    """Whether it ends with bytes or a text whose length varies: COSMOS' reader of XTCE cannot have them."""
    return bool(packet.items and packet.items[-1].count)


class _Writer:
    def __init__(self, databases: Sequence[Database], ground: Ground, station: str) -> None:
        self.databases, self.ground, self.station = databases, ground, station
        paths = [f"{packet.path}.{item.name}" for database in databases for packet in self.packets(database)
                 for item in packet.items]
        paths += [f"{command.path}.{item.name}" for database in databases for command in database.commands
                  for item in command.items if item.value is not None and command.abstract]
        self.parameters = names.distinct(paths)
        self.containers = names.distinct(packet.path for database in databases for packet in self.packets(database))
        self.commands = names.distinct(command.path for database in databases for command in database.commands)

    def packets(self, database: Database) -> list[Packet]:
        """Those of a process, behind the one that is the header of all."""
        parents = {packet.parent for packet in database.packets}
        if self.station == "cosmos":
            reversed_ = [replace(packet, items=[*packet.items, *packet.rest]) for packet in database.packets
                         if not ends_open(packet) and not packet.parent]
        else:
            reversed_ = [packet if packet.path in parents else replace(packet, items=[*packet.items, *packet.rest])
                         for packet in database.packets]
        return [Packet(f"{database.process}.packet", "the header of a packet", 0, HEADER), *reversed_]

    def file(self, name: str) -> str:
        root = Element("SpaceSystem", {"xmlns": NAMESPACE, "name": names.identifier(name)})
        versions = ", ".join(f"{database.process} {database.dictionary.version:#06x}" for database in self.databases)
        ElementTree.SubElement(root, "Header", {"version": versions, "validationStatus": "Working"})
        telemetry, command = (ElementTree.SubElement(root, tag) for tag in ("TelemetryMetaData", "CommandMetaData"))
        types, parameters, containers = (ElementTree.SubElement(telemetry, tag) for tag in (
            "ParameterTypeSet", "ParameterSet", "ContainerSet"))
        for database in self.databases:
            for packet in self.packets(database):
                self.packet(database, packet, types, parameters, containers)
        types, parameters, arguments, metas = (ElementTree.SubElement(command, tag) for tag in (
            "ParameterTypeSet", "ParameterSet", "ArgumentTypeSet", "MetaCommandSet"))
        for database in self.databases:
            for each in database.commands:
                self.command(database, each, types, parameters, arguments, metas)
        ElementTree.indent(root)
        return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"

    # --- telemetry ---

    def packet(self, database: Database, packet: Packet, types: Element, parameters: Element,
               containers: Element) -> None:
        root = f"{database.process}.packet"
        container = named(containers, "SequenceContainer", self.containers[packet.path], packet.path, packet.about)
        entries = ElementTree.SubElement(container, "EntryList")
        header = [item.name for item in HEADER] if packet.path != root else []
        header += [item.name for each in database.packets if each.path == packet.parent for item in each.items]
        short = names.distinct((item.name for item in packet.items), header)
        for item in packet.items:
            path = f"{packet.path}.{item.name}"
            order = (packet.order or database.order) if packet.path != root else "big"
            count = self.parameters[f"{packet.path}.{item.count}"] if item.count else ""
            self.parameter(types, parameters, path, short[item.name], item, order,
                           self.ground.telemetry.get(path, Shown()), count)
            ElementTree.SubElement(entries, "ParameterRefEntry", {"parameterRef": self.parameters[path]})
        if packet.path == root:
            container.set("abstract", "true")
            return
        parent = packet.parent or root
        base = ElementTree.SubElement(container, "BaseContainer", {"containerRef": self.containers[parent]})
        where = ElementTree.SubElement(ElementTree.SubElement(base, "RestrictionCriteria"), "ComparisonList")
        for name, value in (packet.fixed or {"ccsds_apid": packet.stream & 0x7FF}).items():
            ElementTree.SubElement(where, "Comparison", {"parameterRef": self.parameters[f"{parent}.{name}"],
                                                         "value": str(value)})

    def parameter(self, types: Element, parameters: Element, path: str, short: str, item: Item, order: str,
                  shown: Shown, count: str = "") -> Element:
        """short: its name in its packet, which COSMOS shows."""
        name = self.parameters[path]
        self.type(types, "Parameter", name, item, order, shown, count)
        parameter = named(parameters, "Parameter", name, path, item.meaning, {"parameterTypeRef": name})
        ElementTree.SubElement(parameter[0], "Alias", {"nameSpace": "COSMOS", "alias": short})
        return parameter

    # --- types ---

    def type(self, types: Element, of: str, name: str, item: Item, order: str = "big", shown: Shown = Shown(),
             count: str = "") -> None:
        """The type of a parameter or an argument. count: the name of what has its bytes, if they vary."""
        element = ELEMENTS.get(item.type)
        is_float = bool(element and element.is_float)
        kind = "Enumerated" if item.enumerators else "Binary" if item.type == "bytes" else \
            "String" if item.type == "char" else "Float" if is_float or shown.polynomial else "Integer"
        about = item.meaning + (f" ({item.rule})" if item.rule else "")
        found = ElementTree.SubElement(types, f"{kind}{of}Type", {"name": name} | (
            {"shortDescription": about} if about else {}))
        signed = bool(element and element.code.islower()) and not is_float
        if kind == "Integer":
            found.attrib |= {"signed": str(signed).lower(), "sizeInBits": str(item.bits)}
        elif kind == "Float":
            found.set("sizeInBits", str(item.bits if is_float else 64))
        if item.value is not None:
            labels = [label for label, value in item.enumerators.items() if value == item.value]
            found.set("initialValue", labels[0] if labels else str(item.value))
        unit = item.unit if shown.unit is None else shown.unit
        if unit:
            ElementTree.SubElement(ElementTree.SubElement(found, "UnitSet"), "Unit").text = unit
        if kind in ("Binary", "String"):
            self.variable(found, kind, of, item, count)
            return
        encoding = ElementTree.SubElement(found, "FloatDataEncoding" if is_float else "IntegerDataEncoding",
                                          {"sizeInBits": str(item.bits)})
        if not is_float:
            encoding.set("encoding", "twosComplement" if signed else "unsigned")
        if order == "little":
            encoding.set("byteOrder", "leastSignificantByteFirst")
        if shown.polynomial:
            terms = ElementTree.SubElement(ElementTree.SubElement(encoding, "DefaultCalibrator"),
                                           "PolynomialCalibrator")
            for exponent, coefficient in enumerate(shown.polynomial):
                ElementTree.SubElement(terms, "Term", {"coefficient": repr(coefficient), "exponent": str(exponent)})
        if kind == "Enumerated":
            rows = ElementTree.SubElement(found, "EnumerationList")
            for label, value in item.enumerators.items():
                ElementTree.SubElement(rows, "Enumeration", {"value": str(value), "label": label})
            return
        self.range(found, of, item, kind == "Float", bool(shown.polynomial))
        self.limits(found, shown)

    def variable(self, element: Element, kind: str, of: str, item: Item, count: str) -> None:
        """The encoding of a text or of bytes."""
        encoding = ElementTree.SubElement(element, f"{kind}DataEncoding")
        if count:
            size = ElementTree.SubElement(encoding, "Variable" if kind == "String" else "SizeInBits")
            if kind == "String":
                size.set("maxSizeInBits", str(8 * DATA_MAX))
            dynamic = ElementTree.SubElement(size, "DynamicValue")
            ref = {"Parameter": "parameterRef", "Argument": "argumentRef"}[of]
            ElementTree.SubElement(dynamic, f"{of}InstanceRef", {ref: count})
            ElementTree.SubElement(dynamic, "LinearAdjustment", {"slope": "8"})
            return
        size = ElementTree.SubElement(encoding, "SizeInBits")
        fixed = ElementTree.SubElement(size, "Fixed") if kind == "String" else size
        ElementTree.SubElement(fixed, "FixedValue").text = str(item.bits)
        if kind == "String" and item.bits:
            ElementTree.SubElement(size, "TerminationChar").text = "00"

    def range(self, element: Element, of: str, item: Item, is_float: bool, calibrated: bool) -> None:
        """What a number may be, by its header."""
        ends = {}
        for end, bound, is_open in zip(("min", "max"), item.bounds, item.bounds[2:]):
            if bound is not None and is_float:
                ends[f"{end}{'Exclusive' if is_open else 'Inclusive'}"] = repr(float(bound))
            elif bound is not None:
                inside = math.floor(bound) + 1 if end == "min" else math.ceil(bound) - 1
                ends[f"{end}Inclusive"] = str(inside if is_open else int(bound))
        if ends:
            whole = element if of == "Parameter" else ElementTree.SubElement(element, "ValidRangeSet")
            raw = {"validRangeAppliesToCalibrated": "false"} if calibrated else {}
            ElementTree.SubElement(whole, "ValidRange", ends | raw)

    def limits(self, element: Element, shown: Shown) -> None:
        """Both ranges, where there is one: COSMOS takes one that is missing for 0 to 0."""
        if not shown.warning and not shown.critical:
            return
        ranges = ElementTree.SubElement(ElementTree.SubElement(element, "DefaultAlarm"), "StaticAlarmRanges")
        most = 1.7976931348623157e308
        for tag, pair in (("WarningRange", shown.warning or shown.critical),
                          ("CriticalRange", shown.critical or (-most, most))):
            low, high = (max(-most, min(most, x)) for x in pair or ())
            ElementTree.SubElement(ranges, tag, {"minInclusive": repr(low), "maxInclusive": repr(high)})

    # --- commands ---

    def command(self, database: Database, command: Command, types: Element, parameters: Element, arguments: Element,
                metas: Element) -> None:
        name = self.commands[command.path]
        meta = named(metas, "MetaCommand", name, command.path, command.about)
        if command.abstract:
            meta.set("abstract", "true")
        if command.parent:
            base = ElementTree.SubElement(meta, "BaseMetaCommand", {"metaCommandRef": self.commands[command.parent]})
            if command.fixed:
                rows = ElementTree.SubElement(base, "ArgumentAssignmentList")
                for argument, value in command.fixed.items():
                    ElementTree.SubElement(rows, "ArgumentAssignment", {"argumentName": argument,
                                                                        "argumentValue": str(value)})
        rows, entries = Element("ArgumentList"), Element("EntryList")
        inherited = [item.name for part in database.chain(command)[:-1] for item in part.items]
        short = names.distinct((item.name for item in command.items), inherited)
        for item in command.items:
            if item.count and self.station == "cosmos":
                continue
            if command.abstract and item.value is not None:
                path = f"{command.path}.{item.name}"
                parameter = self.parameter(types, parameters, path, item.name, item, "big", Shown())
                ElementTree.SubElement(parameter, "ParameterProperties", {"dataSource": "constant"})
                ElementTree.SubElement(entries, "ParameterRefEntry", {"parameterRef": self.parameters[path]})
                continue
            if item.count:                              # it is in no entry: only the size of the bytes
                self.argument(arguments, rows, name, item.count, number(item.count, "u16", "bytes"))
            self.argument(arguments, rows, name, short[item.name], item)
            ElementTree.SubElement(entries, "ArgumentRefEntry", {"argumentRef": short[item.name]})
        if len(rows):
            meta.append(rows)
        container = ElementTree.SubElement(meta, "CommandContainer", {"name": name})
        container.append(entries)
        if command.parent:
            ElementTree.SubElement(container, "BaseContainer", {"containerRef": self.commands[command.parent]})
        if why := self.ground.hazardous.get(command.path):
            ElementTree.SubElement(meta, "DefaultSignificance", {"reasonForWarning": why,
                                                                 "consequenceLevel": "critical"})
        codes = [each.fixed["code"] for each in database.chain(command) if "code" in each.fixed]
        if codes and not command.abstract and self.station != "cosmos":
            self.verifiers(meta, database, codes[-1])

    def argument(self, arguments: Element, rows: Element, command: str, name: str, item: Item) -> None:
        self.type(arguments, "Argument", f"{command}.{name}".replace(".", "_"), item, count=item.count)
        named(rows, "Argument", name, item.name, item.meaning,
              {"argumentTypeRef": f"{command}.{name}".replace(".", "_")})

    def verifiers(self, meta: Element, database: Database, code: int) -> None:
        """Accepted and completed by the reports of the command's code; failed by one that it was refused."""
        verifiers = ElementTree.SubElement(meta, "VerifierSet")
        for tag, executed, good, within in (("Accepted", 0, "==", self.ground.accepted_within),
                                            ("Complete", 1, "==", self.ground.completed_within),
                                            ("Failed", None, "!=", self.ground.completed_within)):
            verifier = ElementTree.SubElement(verifiers, f"{tag}Verifier")
            conditions = ElementTree.SubElement(ElementTree.SubElement(verifier, "BooleanExpression"),
                                                "ANDedConditions")
            reported = {"code": ("==", code), "executed": ("==", executed), "reason": (good, int(Reason.OK))}
            for item, (operator, value) in reported.items():
                if value is not None:
                    self.condition(conditions, database, item, operator, value)
            if self.station == "yamcs":
                self.condition(conditions, database, "sequence", "==", SENT)
            ElementTree.SubElement(verifier, "CheckWindow", {"timeToStopChecking": f"PT{within:g}S",
                                                             "timeWindowIsRelativeTo": "commandRelease"})
            if tag == "Failed":
                ElementTree.SubElement(verifier, "ReturnParmRef", {
                    "parameterRef": self.parameters[f"{database.process}.reports.reason"]})

    def condition(self, conditions: Element, database: Database, item: str, operator: str, value: int | str) -> None:
        condition = ElementTree.SubElement(conditions, "Condition")
        raw = {"useCalibratedValue": "false"}
        ElementTree.SubElement(condition, "ParameterInstanceRef", {
            "parameterRef": self.parameters[f"{database.process}.reports.{item}"]} | raw)
        ElementTree.SubElement(condition, "ComparisonOperator").text = operator
        if isinstance(value, str):
            ElementTree.SubElement(condition, "ParameterInstanceRef", {"parameterRef": value})
        else:
            ElementTree.SubElement(condition, "Value").text = str(value)


def named(parent: Element, tag: str, name: str, path: str, about: str = "", more: Mapping[str, str] | None = None
          ) -> Element:
    """An element with a name, and in an alias that of Fledge."""
    element = ElementTree.SubElement(parent, tag, {"name": name} | ({"shortDescription": about} if about else {})
                                     | dict(more or {}))
    ElementTree.SubElement(ElementTree.SubElement(element, "AliasSet"), "Alias", {"nameSpace": "Fledge", "alias": path})
    return element
