# SPDX-License-Identifier: Apache-2.0
"""An app's electronic data sheet (CCSDS 876.0): its packets and topics, for tools that read eds/NAME.xml."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

from fledge.commands import Code, Reason
from fledge.elements import ELEMENTS
from fledge.export import names
from fledge.targets.cfs.export.packets import ARGUMENTS, housekeeping, title

if TYPE_CHECKING:
    from fledge.targets.cfs.export.app import App
    from fledge.export.read import Mission

TYPES = {"f32": "float", "f64": "double"}


def base(element: str) -> str:
    """The type in cFE's data sheet of base types."""
    name = TYPES.get(element) or ELEMENTS[element].ctype.removesuffix("_t")
    return f"BASE_TYPES/{name}"


class Types:
    """The data types of a package, each once, in an order in which all are known when they are used."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.known: set[str] = set()

    def add(self, kind: str, name: str, attributes: str, body: Sequence[str]) -> str:
        if name not in self.known:
            self.known.add(name)
            self.lines += [f'      <{kind} name="{name}"{attributes}>', *(f"        {line}" for line in body),
                           f"      </{kind}>"]
        return name

    def array(self, of: str, shape: Sequence[int]) -> str:
        sizes = [f'  <Dimension size="{n}" />' for n in shape]
        name = f"{of.rpartition('/')[2]}_{'x'.join(map(str, shape))}"
        return self.add("ArrayDataType", name, f' dataTypeRef="{of}"', ["<DimensionList>", *sizes, "</DimensionList>"])

    def container(self, name: str, entries: Sequence[tuple[str, str, str]], parent: str = "", about: str = "",
                  code: int | None = None) -> str:
        """entries: (name, type, meaning)."""
        body = [] if code is None else ["<ConstraintSet>",
                                        f'  <ValueConstraint entry="Sec.FunctionCode" value="{code}" />',
                                        "</ConstraintSet>"]
        if entries:
            rows = [f'  <Entry name="{one}" type="{type_}"{described(doc)} />' for one, type_, doc in entries]
            body += ["<EntryList>", *rows, "</EntryList>"]
        return self.add("ContainerDataType", name, (f' baseType="{parent}"' if parent else "") + described(about), body)

    def struct(self, struct: Any) -> str:
        return self.container(struct.name, [(f.name, self.field(struct.name, f), f.doc + (f" [{f.unit}]" if f.unit
                                                                                          else ""))
                                            for f in struct.fields], about=struct.doc or "")

    def field(self, owner: str, field: Any) -> str:
        shape = list(field.shape)
        if field.type == "struct":
            of = self.struct(field.struct)
        elif field.type == "enum":
            rows = [f'  <Enumeration label="{label}" value="{value}" />' for label, value in field.enumerators]
            of = self.add("EnumeratedDataType", f"{owner}_{field.name}", "", [
                '<IntegerDataEncoding sizeInBits="32" encoding="twosComplement" />', "<EnumerationList>", *rows,
                "</EnumerationList>"])
        elif field.type == "char":
            length = shape.pop() if shape else 1
            of = self.add("StringDataType", f"char_{length}", f' length="{length}"', [])
        else:
            of = base(field.type)
        return self.array(of, shape) if shape else of


def described(text: str) -> str:
    return f" shortDescription={quoteattr(' '.join(text.split()))}" if text else ""


def sheet(mission: Mission, app: App) -> str:
    """eds/NAME.xml"""
    types = Types()
    command = types.container("CommandBase", [], "CFE_HDR/CommandHeader")
    request = types.container("RequestCmd", [], "CFE_HDR/CommandHeader")
    for plain in (Code.NOOP, Code.RESET_COUNTERS):
        types.container(f"{title(plain)}Cmd", [], command, code=int(plain))
    for code, arguments in ARGUMENTS.items():
        octets = {"Version": 2} | arguments
        payload = types.container(f"{title(code)}Cmd_Payload", [
            (name, types.array("BASE_TYPES/uint8", [size]), "big-endian") for name, size in octets.items()])
        types.container(f"{title(code)}Cmd", [("Payload", payload, "")], command, code=int(code))
    interfaces = [("CMD", "CMD", "Telecommand", command), ("SEND_HK", "SEND_HK", "Telecommand", request),
                  ("WAKEUP", "WAKEUP", "Telecommand", request)]
    report = [("Time", "int64", "of flight [ns]"), *((name, "uint16", "") for name in (
        "Sequence", "Code", "Executed", "Reason", "Detail", "Count", "Spare1", "Spare2"))]
    flight = [("Time", "int64", "of flight [ns]"), *((name, "uint32", "") for name in (
        "Mode", "Staged", "Accepted", "Executed", "Refused")), ("Reasons", f"uint32[{len(Reason)}]", ""), (
            "Begun", "uint16", "1: a command has come by the link from the ground"),
        ("Last", "uint16", "the sequence of the last one that was accepted")]
    for name, rows in (("FLIGHT", flight), ("REPORT", report), ("HK", housekeeping(mission))):
        entries = []
        for entry, type_, doc in rows:
            of, _, count = type_.partition("[")
            of = f"BASE_TYPES/{of}"
            entries.append((entry, types.array(of, [int(count[:-1])]) if count else of, doc))
        payload = types.container(f"{name.title()}Tlm_Payload", entries)
        interfaces.append((f"{name}_TLM", f"{name}_TLM", "Telemetry", types.container(
            f"{name.title()}Tlm", [("Payload", payload, "")], "CFE_HDR/TelemetryHeader")))
    for kind, messages in (("TLM", mission.outputs), ("IN", mission.inputs)):
        for message in messages:
            packet = types.container(names.camel(message.name) + kind.title(),
                                     [("Payload", types.struct(message.struct), "")], "CFE_HDR/TelemetryHeader",
                                     message.path)
            interfaces.append((f"{message.name.upper()}_{kind}",) * 2 + ("Telemetry", packet))
    topics = app.topics(mission)
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<!-- SPDX-License-Identifier: Apache-2.0 -->",
             '<PackageFile xmlns="http://www.ccsds.org/schema/sois/seds">',
             f'  <Package name="{app.prefix}"{described(mission.about)}>', "    <DataTypeSet>", *types.lines,
             "    </DataTypeSet>", "    <ComponentSet>", '      <Component name="Application">',
             "        <RequiredInterfaceSet>"]
    for name, _, kind, packet in interfaces:
        lines += [f'          <Interface name="{name}" type="CFE_SB/{kind}">', "            <GenericTypeMapSet>",
                  f'              <GenericTypeMap name="{kind}DataType" type="{packet}" />',
                  "            </GenericTypeMapSet>", "          </Interface>"]
    lines += ["        </RequiredInterfaceSet>", "        <Implementation>", "          <VariableSet>"]
    for name, topic, _, _ in interfaces:
        number = topics[f"{app.prefix}_MISSION_{topic}_TOPICID"]
        lines.append(f'            <Variable type="BASE_TYPES/uint16" readOnly="true" name="{names.camel(name.lower())}'
                     f'TopicId" initialValue="{number}" />')
    lines += ["          </VariableSet>", "          <ParameterMapSet>"]
    lines += [f'            <ParameterMap interface="{name}" parameter="TopicId" variableRef="'
              f'{names.camel(name.lower())}TopicId" />' for name, _, _, _ in interfaces]
    return "\n".join([*lines, "          </ParameterMapSet>", "        </Implementation>", "      </Component>",
                      "    </ComponentSet>", "  </Package>", "</PackageFile>", ""])
