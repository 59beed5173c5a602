# SPDX-License-Identifier: Apache-2.0
"""Random databases in XTCE, packets for them and values for their commands."""
from __future__ import annotations

import random
import struct
from typing import Any

LABELS = ["OFF", "ON", "SAFE"]


class Random:
    """A database from a seed. text: the file."""

    def __init__(self, seed: int) -> None:
        self.r = random.Random(seed)
        self.types: dict[str, str] = {"u8": _number("Integer", "u8", "Integer", "sizeInBits='8'"),
                                      "u16": _number("Integer", "u16", "Integer", "sizeInBits='16'"),
                                      "u2": _number("Integer", "u2", "Integer", "sizeInBits='2'")}
        self.parameters = {"id": "u8", "n": "u2"}
        self.scalars = [self.scalar(f"t{i}") for i in range(8)]
        self.texts = [self.text_type(f"s{i}", True) for i in range(2)]
        kinds = self.scalars + self.texts + [self.group("g"), self.array("l")]
        for i in range(12):
            self.parameters[f"p{i}"] = self.r.choice(kinds)
        self.parameters["crc"] = "u16"
        self.tail = self.chance(0.4)    # a checksum behind what extends the root
        containers = [self.container("Root", ["id", "n"], "abstract='true'", at_end("crc", 0) if self.tail else "")]
        names, values = ["Root"], list(range(8))
        self.r.shuffle(values)
        self.identifiers = [*values[:6], *values]
        included = self.r.sample(sorted(self.parameters), 2)
        containers.append(self.container("Part", included))
        for i in range(6):
            base = "Root" if self.chance(0.6) else self.r.choice(names)
            names.append(f"C{i}")
            entries = [self.entry() for _ in range(self.r.randint(1, 5))]
            if self.r.random() < 0.3:
                entries.append("<ContainerRefEntry containerRef='Part'/>")
            containers.append(
                f"<SequenceContainer name='C{i}' abstract='{'true' if self.r.random() < 0.2 else 'false'}'><EntryList>"
                f"{''.join(entries)}</EntryList><BaseContainer containerRef='{base}'><RestrictionCriteria>"
                f"{self.criteria(values[i], base)}</RestrictionCriteria></BaseContainer></SequenceContainer>")
        self.text = "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>" + "".join(self.types.values()) + \
            "</ParameterTypeSet><ParameterSet>" + "".join(
                f"<Parameter name='{name}' parameterTypeRef='{kind}'/>" for name, kind in self.parameters.items()) + \
            "</ParameterSet><ContainerSet>" + "".join(containers) + "</ContainerSet></TelemetryMetaData>" + \
            self.commands() + "</SpaceSystem>"

    def chance(self, p: float) -> bool:
        return self.r.random() < p

    def encoding(self, real: bool) -> str:
        """The attributes of a number's encoding."""
        if real:
            form, bits = self.r.choice([("IEEE754", 16), ("IEEE754_1985", 32), ("IEEE754", 64), ("MILSTD_1750A", 32),
                                        ("MILSTD_1750A", 48)])
        else:
            form = self.r.choice(["unsigned", "twosComplement", "onesComplement", "signMagnitude", "BCD", "packedBCD"])
            bits = self.r.choice([8, 16, 32, 64, self.r.randint(2, 64)])
            bits = bits // 8 * 8 or 8 if form == "BCD" else bits // 4 * 4 or 4 if form == "packedBCD" else bits
        layout = f"sizeInBits='{bits}' encoding='{form}'"
        if bits % 8 == 0 and self.chance(0.4):
            order = list(range(bits // 8))
            self.r.shuffle(order)
            layout += f" byteOrder='{self.r.choice(['leastSignificantByteFirst', ','.join(map(str, order))])}'"
        elif self.chance(0.1):
            layout += " bitOrder='leastSignificantBitFirst'"
        return layout

    def scalar(self, name: str) -> str:
        kind = self.r.choice(["Integer", "Integer", "Float", "Float", "Enumerated", "Boolean", "Binary"])
        if kind == "Binary":
            self.types[name] = f"<BinaryParameterType name='{name}'><BinaryDataEncoding><SizeInBits><FixedValue>" \
                f"{self.r.randint(1, 40)}</FixedValue></SizeInBits></BinaryDataEncoding></BinaryParameterType>"
            return name
        real = kind == "Float" and self.chance(0.5)
        calibrator = self.calibrator(kind) if not real and kind in ("Integer", "Float") and self.chance(0.5) else ""
        layout = self.encoding(real) if not calibrator else \
            f"sizeInBits='{self.r.randint(2, 16)}' encoding='twosComplement'"
        inside = "<EnumerationList>" + "".join(
            f"<Enumeration value='{3 * i}' maxValue='{4 * i}' label='{label}'/>" for i, label in enumerate(LABELS)) + \
            "</EnumerationList>" if kind == "Enumerated" else ""
        self.types[name] = _number(kind, name, "Float" if real else "Integer", layout, calibrator, inside)
        return name

    def calibrator(self, kind: str) -> str:
        whole = kind == "Integer"

        def value():
            return self.r.randint(-9, 9) if whole else round(self.r.uniform(-9, 9), 3)

        form = "Polynomial" if whole else self.r.choice(["Polynomial", "Spline", "MathOperation"])
        if form == "Polynomial":
            inside = "".join(f"<Term exponent='{i}' coefficient='{value()}'/>" for i in range(self.r.randint(1, 4)))
        elif form == "Spline":
            points = sorted(self.r.sample(range(-600, 600), 5))
            inside = "".join(f"<SplinePoint raw='{x}' calibrated='{value()}'/>" for x in points)
            form += f"Calibrator order='{self.r.randint(0, 3)}' extrapolate='{self.r.choice(['true', 'false'])}"
            return f"<DefaultCalibrator><{form}'>{inside}</SplineCalibrator></DefaultCalibrator>"
        else:
            inside = f"<ThisParameterOperand/><ValueOperand>{value()}</ValueOperand><Operator>" + \
                self.r.choice(["+", "-", "*", "max", "&gt;"]) + "</Operator>"
        return f"<DefaultCalibrator><{form}Calibrator>{inside}</{form}Calibrator></DefaultCalibrator>"

    def text_type(self, name: str, varies: bool) -> str:
        ends = self.r.choice(["", "<TerminationChar>00</TerminationChar>", "<LeadingSize sizeInBitsOfSizeTag='8'/>"])
        codec = self.r.choice(["UTF-8", "US-ASCII", "ISO-8859-1", "Windows-1252", "UTF-16BE", "UTF-16LE"])
        ends = "" if ends[:2] == "<T" and "16" in codec else ends
        if varies and self.chance(0.5):
            known = self.chance(0.5) or not ends
            size = "<DynamicValue><ParameterInstanceRef parameterRef='" + ("n" if known else "_yamcs_ignore") + \
                "'/><LinearAdjustment slope='16' intercept='8'/></DynamicValue>"
            inside = f"<Variable maxSizeInBits='48'>{size}{ends}</Variable>"
        else:
            bits = 8 * self.r.randint(1, 6)
            inside = f"<SizeInBits><Fixed><FixedValue>{bits}</FixedValue></Fixed>{ends}</SizeInBits>"
        self.types[name] = f"<StringParameterType name='{name}'><StringDataEncoding encoding='{codec}'>{inside}" \
            "</StringDataEncoding></StringParameterType>"
        return name

    def group(self, name: str) -> str:
        members = "".join(f"<Member name='m{i}' typeRef='{self.r.choice(self.scalars)}'/>" for i in range(3))
        self.types[name] = f"<AggregateParameterType name='{name}'><MemberList>{members}</MemberList>" \
            "</AggregateParameterType>"
        return name

    def array(self, name: str) -> str:
        last = "<FixedValue>2</FixedValue>" if self.chance(0.5) else \
            "<DynamicValue><ParameterInstanceRef parameterRef='n'/></DynamicValue>"
        self.types[name] = f"<ArrayParameterType name='{name}' arrayTypeRef='{self.r.choice([*self.scalars, 'g'])}'>" \
            "<DimensionList><Dimension><StartingIndex><FixedValue>0</FixedValue></StartingIndex><EndingIndex>" \
            f"{last}</EndingIndex></Dimension></DimensionList></ArrayParameterType>"
        return name

    def criteria(self, value: int, base: str) -> str:
        test = f"<Comparison parameterRef='id' value='{value}'/>" if base == "Root" else \
            f"<Comparison parameterRef='n' value='{self.r.randint(0, 3)}' useCalibratedValue='false'/>"
        other = f"<Condition><ParameterInstanceRef parameterRef='n'/><ComparisonOperator>&lt;=</ComparisonOperator>" \
            f"<Value>{self.r.randint(0, 3)}</Value></Condition>"
        any_ = f"<BooleanExpression><ORedConditions>{other}{other}</ORedConditions></BooleanExpression>"
        return self.r.choice([test, test, f"<ComparisonList>{test}{test}</ComparisonList>", any_])

    def entry(self) -> str:
        name = self.r.choice([name for name in self.parameters if name not in ("id", "n")])
        inside = ""
        if self.chance(0.15):
            place = self.r.choice(["containerStart'><FixedValue>24", "previousEntry'><FixedValue>3",
                                   *["containerEnd'><FixedValue>16", "containerEnd'><FixedValue>41"] * self.tail])
            inside += f"<LocationInContainerInBits referenceLocation='{place}</FixedValue></LocationInContainerInBits>"
        if self.chance(0.15):
            count = self.r.choice(["<FixedValue>3</FixedValue>",
                                   "<DynamicValue><ParameterInstanceRef parameterRef='n'/></DynamicValue>"])
            inside += f"<RepeatEntry><Count>{count}</Count><Offset><FixedValue>{self.r.randint(0, 5)}</FixedValue>" \
                "</Offset></RepeatEntry>"
        if self.chance(0.1):
            inside += "<IncludeCondition><Comparison parameterRef='n' comparisonOperator='&gt;=' value='2'/>" \
                "</IncludeCondition>"
        return f"<ParameterRefEntry parameterRef='{name}'>{inside}</ParameterRefEntry>"

    def container(self, name: str, parameters: list[str], attributes: str = "", more: str = "") -> str:
        entries = "".join(f"<ParameterRefEntry parameterRef='{parameter}'/>" for parameter in parameters) + more
        return f"<SequenceContainer name='{name}' {attributes}><EntryList>{entries}</EntryList></SequenceContainer>"

    # --- commands: the same types, without those that vary

    def commands(self) -> str:
        self.fixed = [*self.scalars, self.text_type("as", False), "g"]
        kinds = "".join(self.types[name].replace("ParameterType", "ArgumentType") for name in ["u8", *self.fixed])
        self.arguments = {f"a{i}": self.r.choice(self.fixed) for i in range(5)}
        trailer = f"<FixedValueEntry binaryValue='2a5' sizeInBits='{self.r.randint(1, 12)}'>" \
            "<LocationInContainerInBits referenceLocation='containerEnd'><FixedValue>16</FixedValue>" \
            "</LocationInContainerInBits></FixedValueEntry>" if self.tail and self.chance(0.5) else ""
        return "<CommandMetaData><ArgumentTypeSet>" + kinds + "</ArgumentTypeSet><CommandContainerSet>" + \
            self.container("Command", ["id"], more=at_end("crc", 0)) + "</CommandContainerSet><MetaCommandSet>" \
            "<MetaCommand name='K'><ArgumentList>" + "".join(f"<Argument name='{name}' argumentTypeRef='{kind}'/>"
                                                             for name, kind in self.arguments.items()) + \
            "</ArgumentList><CommandContainer name='KC'><EntryList><FixedValueEntry binaryValue='abc' sizeInBits='" + \
            f"{self.r.randint(1, 12)}'/>" + "".join(f"<ArgumentRefEntry argumentRef='{name}'/>" for name in
                                                    self.arguments) + trailer + "</EntryList>" + \
            ("<BaseContainer containerRef='Command'/>" if self.tail else "") + \
            "</CommandContainer></MetaCommand></MetaCommandSet></CommandMetaData>"

    def given(self, second: Any) -> dict[str, Any]:
        """Values for the command K, that its types hold."""
        return {name: self._value(second, second.types[kind]) for name, kind in self.arguments.items()} | (
            {"id": self.r.getrandbits(8), "crc": self.r.getrandbits(16)} if self.tail else {})

    def _value(self, second, kind):
        from fledge.ground.testing.second import number

        if kind.tag.startswith("Aggregate"):
            return {member.get("name"): self._value(second, second.types[member.get("typeRef")])
                    for member in kind.iter("Member")}
        encoding = next(child for child in kind if child.tag.endswith("DataEncoding"))
        if kind.tag.startswith("Enumerated"):
            wide = number(encoding, int(encoding.get("sizeInBits")), 2 ** int(encoding.get("sizeInBits")) - 1) is None \
                or int(encoding.get("sizeInBits")) > 4
            return self.r.choice(LABELS if wide else LABELS[:1])
        if kind.tag.startswith("Boolean"):
            return self.chance(0.5) and int(encoding.get("sizeInBits")) > 2
        if encoding.tag == "BinaryDataEncoding":
            n = int(encoding.findtext("SizeInBits/FixedValue"))
            return self.r.getrandbits(n).to_bytes((n + 7) // 8, "big")
        if encoding.tag == "StringDataEncoding":
            room = int(encoding.findtext("SizeInBits/Fixed/FixedValue")) // 8
            room -= 0 if encoding.find("SizeInBits/LeadingSize") is None else 1
            unit = 2 if "16" in encoding.get("encoding") else 1
            return "".join(self.r.choice("abcXYZ 09") for _ in range(self.r.randint(0, room // unit)))
        n = int(encoding.get("sizeInBits"))
        if encoding.find("DefaultCalibrator") is not None:
            return self.r.choice([0, 1])
        if "BCD" in encoding.get("encoding"):
            return self.r.randrange(10 ** (n // (4 if encoding.get("encoding") == "packedBCD" else 8)))
        while True:
            raw = self.r.getrandbits(n)
            value = number(encoding, n, raw)
            if value is not None and value == value and abs(value) != float("inf"):
                return value

    def packet(self) -> bytes:
        """Random bytes, of which the first chooses a container."""
        size = self.r.choice([0, 5, 20, 60, 100, 200, 400, 400])
        return bytes([self.r.choice(self.identifiers)] * (size > 0)) + self.r.randbytes(max(size - 1, 0))


def at_end(parameter: str, offset: int) -> str:
    """An entry that ends so many bits before the end of the packet."""
    return f"<ParameterRefEntry parameterRef='{parameter}'><LocationInContainerInBits " \
        f"referenceLocation='containerEnd'><FixedValue>{offset}</FixedValue></LocationInContainerInBits>" \
        "</ParameterRefEntry>"


def _number(kind: str, name: str, encoding: str, layout: str, calibrator: str = "", inside: str = "") -> str:
    return f"<{kind}ParameterType name='{name}'><{encoding}DataEncoding {layout}>{calibrator}" \
        f"</{encoding}DataEncoding>{inside}</{kind}ParameterType>"


def same(a: Any, b: Any) -> bool:
    """Whether two values are equal; numbers with a fraction up to the rounding of their calibrator."""
    if isinstance(a, float) and isinstance(b, float):
        return a == b or (a != a and b != b) or abs(a - b) <= 1e-9 * max(1.0, abs(a), abs(b)) or \
            struct.pack(">f", min(abs(a), 1e30)) == struct.pack(">f", min(abs(b), 1e30))
    return type(a) is type(b) and a == b
