# SPDX-License-Identifier: Apache-2.0
"""An app's electronic data sheet (CCSDS 876.0): its packets, tables and topics, for a build of cFS with
CFE_EDS_ENABLED and other tools that read eds/NAME.xml.

In a sheet all topics of a mission are one list, in which commands and telemetry have a part each: CFE_MISSION's
TELECOMMAND_BASE_TOPICID and TELEMETRY_BASE_TOPICID. A type has one size, so there is a command for each parameter that
is written or staged, instead of bytes.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

from fledge.commands import DATA_MAX, Code
from fledge.elements import ELEMENTS
from fledge.export import dictionary, names
from fledge.export import packets as model
from fledge.targets.cfs.export.app import services
from fledge.targets.cfs.export.packets import arguments, housekeeping, title

if TYPE_CHECKING:
    from fledge import _core
    from fledge.export.read import Mission
    from fledge.targets.cfs.export.app import App
    from fledge.targets.cfs.export.tables import Table

TYPES = {"f32": "float", "f64": "double"}


def base(element: str) -> str:
    """The type in cFE's data sheet of base types."""
    name = TYPES.get(element) or ELEMENTS[element].ctype.removesuffix("_t")
    return f"BASE_TYPES/{name}"


class Types:
    """The data types of a package, each once, in an order in which all are known when they are used."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.known: dict[str, str] = {}

    def add(self, kind: str, name: str, attributes: str, body: Sequence[str]) -> str:
        """The name that it gets: one of another content has a number at its end."""
        text = "\n".join([kind, attributes, *body])
        first, n = name, 2
        while self.known.get(name, text) != text:
            name, n = f"{first}_{n}", n + 1
        if name not in self.known:
            self.known[name] = text
            self.lines += [f'      <{kind} name="{name}"{attributes}>', *(f"        {line}" for line in body),
                           f"      </{kind}>"]
        return name

    def array(self, of: str, shape: Sequence[int]) -> str:
        sizes = [f'  <Dimension size="{n}" />' for n in shape]
        name = f"{of.rpartition('/')[2]}_{'x'.join(map(str, shape))}"
        return self.add("ArrayDataType", name, f' dataTypeRef="{of}"', ["<DimensionList>", *sizes, "</DimensionList>"])

    def number(self, element: str) -> str:
        """A number of a command: big-endian, whatever the mission's byte order."""
        element_ = ELEMENTS[element]
        bits, order = 8 * element_.size, 'byteOrder="bigEndian"'
        if element_.is_float:
            precision = "double" if bits == 64 else "single"
            return self.add("FloatDataType", f"{element_.ctype}_be", "", [
                f'<FloatDataEncoding encodingAndPrecision="IEEE754_2008_{precision}" {order} sizeInBits="{bits}" />',
                f"<Range><PrecisionRange>{precision}</PrecisionRange></Range>"])
        signed = element_.code.islower() and element != "char"
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        encoding = "twosComplement" if signed else "unsigned"
        return self.add("IntegerDataType", f"{'' if signed else 'u'}int{bits}_be", "", [
            f'<IntegerDataEncoding sizeInBits="{bits}" encoding="{encoding}" {order} />',
            f'<Range><MinMaxRange min="{low}" max="{high}" rangeType="inclusiveMinInclusiveMax" /></Range>'])

    def container(self, name: str, entries: Sequence[tuple[str, str, str]], parent: str = "", about: str = "",
                  where: Sequence[tuple[str, int]] = ()) -> str:
        """entries: (name, type, meaning). where: (path, value) of what tells it from others of its parent."""
        body = ["<ConstraintSet>", *(f'  <ValueConstraint entry="{path}" value="{value}" />' for path, value in where),
                "</ConstraintSet>"] if where else []
        if entries:
            rows = [f'  <Entry name="{name}" type="{type_}"{described(doc)} />' for name, type_, doc in entries]
            body += ["<EntryList>", *rows, "</EntryList>"]
        return self.add("ContainerDataType", name, (f' baseType="{parent}"' if parent else "") + described(about), body)

    def struct(self, struct: _core.Struct) -> str:
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


def numbers(fields: Sequence[Any], start: int, prefix: str = "") -> Iterator[tuple[str, str, int, int, str]]:
    """(name, element, offset in the block, how many, meaning) of all that a command can write at once."""
    for field in fields:
        n = 1
        for dimension in field.shape:
            n *= dimension
        if field.type == "struct":
            for i in range(n):
                yield from numbers(field.struct.fields, start - field.offset - i * field.struct.size,
                                   f"{prefix}{field.name}_{i}_" if field.shape else f"{prefix}{field.name}_")
            continue
        size = ELEMENTS[field.type].size
        about = field.doc + (f" [{field.unit}]" if field.unit else "")
        for first in range(0, n, DATA_MAX // size):
            many = min(n - first, DATA_MAX // size)
            name = f"{prefix}{field.name}" + (f"_from_{first}" if many < n else "")
            yield name, field.type, field.offset - start + first * size, many, about


def commands(types: Types, command: str, tables: Sequence[Table], mission: Mission) -> None:
    """All commands but those without arguments, and the one that stores another, of any length."""
    for code, sizes in arguments(mission).items():
        if code == Code.STORE:
            continue
        payload = types.container(f"{title(code)}Cmd_Payload", [
            (name, types.number("u16" if size == 2 else "u32"), "")
            for name, size in ({"Version": 2} | sizes).items() if name != "Bytes"])
        packet = types.container(f"{title(code)}Cmd", [("Payload", payload, "")], command,
                                 where=[("Sec.FunctionCode", int(code))])
        if "Bytes" in sizes:
            for i, table in enumerate(tables):
                for name, element, offset, n, about in numbers(table.fields, table.start):
                    of = types.number(element)
                    types.container(f"{title(code)}{table.name}_{name}Cmd",
                                    [("Value", types.array(of, [n]) if n > 1 else of, about)], packet,
                                    where=[("Payload.Module", i), ("Payload.Offset", offset)])


def sheet(mission: Mission, app: App, tables: Sequence[Table]) -> str:
    """eds/NAME.xml"""
    types = Types()
    interfaces = packets_of(types, mission, app, tables)
    topics = app.topics(mission)
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<!-- SPDX-License-Identifier: Apache-2.0 -->",
             '<PackageFile xmlns="http://www.ccsds.org/schema/sois/seds">',
             f'  <Package name="{app.prefix}"{described(mission.about)}>', "    <DataTypeSet>", *types.lines,
             "    </DataTypeSet>", "    <ComponentSet>", '      <Component name="Application">',
             "        <RequiredInterfaceSet>"]
    for name, kind, packet in interfaces:
        lines += interface(name, f"CFE_SB/{kind}", kind, packet)
    for table in tables:
        lines += interface(table.name, "CFE_TBL/Table", "Table", table.name)
    lines += ["        </RequiredInterfaceSet>", "        <Implementation>", "          <VariableSet>"]
    for name, kind, _ in interfaces:
        number = topics[f"{app.prefix}_MISSION_{name}_TOPICID"]
        lines.append(f'            <Variable type="BASE_TYPES/uint16" readOnly="true" name="{names.camel(name.lower())}'
                     f'TopicId" initialValue="${{CFE_MISSION/{kind.upper()}_BASE_TOPICID}} + {number}" />')
    lines += ["          </VariableSet>", "          <ParameterMapSet>"]
    lines += [f'            <ParameterMap interface="{name}" parameter="TopicId" variableRef="'
              f'{names.camel(name.lower())}TopicId" />' for name, _, _ in interfaces]
    return "\n".join([*lines, "          </ParameterMapSet>", "        </Implementation>", "      </Component>",
                      "    </ComponentSet>", "  </Package>", "</PackageFile>", ""])


def packets_of(types: Types, mission: Mission, app: App, tables: Sequence[Table]) -> list[tuple[str, str, str]]:
    """Add the tables and packets of an app to its types. Returns (name, kind, type of packets) of each interface."""
    for table in tables:             # first, so that a table has the name that it has in C
        types.container(table.name, [("Layout", base("u32"), ""), ("Check", base("u32"), ""), *(
            (f.name, types.field(table.name, f), f.doc + (f" [{f.unit}]" if f.unit else "")) for f in table.fields)],
            about=f"{table.module.path}: {table.module.type}")
    command = types.container("CommandBase", [], "CFE_HDR/CommandHeader")
    request = types.container("RequestCmd", [], "CFE_HDR/CommandHeader")
    for plain in (Code.NOOP, Code.RESET_COUNTERS):
        types.container(f"{title(plain)}Cmd", [], command, where=[("Sec.FunctionCode", int(plain))])
    commands(types, command, tables, mission)
    interfaces = [("CMD", "Telecommand", command), ("SEND_HK", "Telecommand", request)]
    interfaces += [("WAKEUP", "Telecommand", request)] if app.wakeup is None else []

    def telemetry(name: str, packet: str, entry: tuple[str, str, str], about: str = "") -> tuple[str, str, str]:
        return name, "Telemetry", types.container(packet, [entry], "CFE_HDR/TelemetryHeader", about)

    known = dictionary(mission)
    for name, rows in (("FLIGHT", of_model(model.housekeeping(mission, known))),
                       ("REPORT", of_model(model.reports(mission, known))), ("HK", housekeeping(mission))):
        entries = []
        for entry, type_, doc in rows:
            of, _, count = type_.partition("[")
            of = f"BASE_TYPES/{of}"
            entries.append((entry, types.array(of, [int(count[:-1])]) if count else of, doc))
        payload = types.container(f"{name.title()}Tlm_Payload", entries)
        interfaces.append(telemetry(f"{name}_TLM", f"{name.title()}Tlm", ("Payload", payload, "")))
    types.container("ReadReportTlm", [("Data", types.array("BASE_TYPES/uint8", [DATA_MAX]), "the first Count of them")],
                    "ReportTlm", where=[("Payload.Code", int(Code.READ)), ("Payload.Executed", 1)])
    for kind, messages in (("TLM", mission.outputs), ("IN", mission.inputs)):
        for message in messages:
            packet = telemetry(f"{message.name.upper()}_{kind}", names.camel(message.name) + kind.title(),
                               ("Payload", types.struct(message.struct), ""), message.path)
            if kind == "TLM" or message.path not in app.wires:      # others have it in the sheet of their writer
                interfaces.append(packet)
    for name in services(mission):
        data = ("Data", types.array("BASE_TYPES/uint8", [DATA_MAX]), "big-endian, and zeros behind")
        interfaces.append(telemetry(f"{name}_TLM", f"{name.title()}Tlm", data))
    return interfaces


def of_model(packet: model.Packet) -> list[tuple[str, str, str]]:
    """(name, type, meaning) of a packet's numbers; bytes at its end are in a packet of their own."""
    renamed = {"t": "Time", "n": "Count"}
    lines = []
    for item in packet.items:
        labels = ", ".join(f"{value} {label}" for label, value in item.enumerators.items())
        if not item.count:
            lines.append((renamed.get(item.name) or names.camel(item.name.replace(".", "_")),
                          base(item.type).rpartition("/")[2], ": ".join(filter(None, (item.meaning, labels)))
                          + (f" [{item.unit}]" if item.unit else "")))
    return lines


def interface(name: str, type_: str, kind: str, content: str) -> list[str]:
    return [f'          <Interface name="{name}" type="{type_}">', "            <GenericTypeMapSet>",
            f'              <GenericTypeMap name="{kind}DataType" type="{content}" />',
            "            </GenericTypeMapSet>", "          </Interface>"]
