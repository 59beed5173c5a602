# SPDX-License-Identifier: Apache-2.0
"""A text, a number, a label and the raw number of one value are the same value wherever a database compares it or
computes with it; whole numbers are exact, as Python's are."""
import operator
import random
import struct
from html import escape

import pytest

from fledge import SetupError
from fledge.ground import Database

COMPARISONS = {"==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt,
               ">=": operator.ge}
SPECIAL = [sign * (2**bits + more) for bits in (0, 31, 32, 52, 53, 54, 62, 63, 64) for more in (-2, -1, 0, 1, 2)
           for sign in (1, -1)]


def integer(name, bits=64, signed=False, inside="", around="", kind="Parameter"):
    return (f"<Integer{kind}Type name='{name}' signed='{str(signed).lower()}'><IntegerDataEncoding sizeInBits='{bits}' "
            f"encoding='{'twosComplement' if signed else 'unsigned'}'>{inside}</IntegerDataEncoding>{around}"
            f"</Integer{kind}Type>")


def telemetry(tmp_path, types, parameters, containers):
    path = tmp_path / "s.xml"
    entries = "".join(f"<ParameterRefEntry parameterRef='{name}'/>" for name in parameters)
    path.write_text(
        f"<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>{types}</ParameterTypeSet><ParameterSet>"
        + "".join(f"<Parameter name='{name}' parameterTypeRef='{kind}'/>" for name, kind in parameters.items())
        + f"</ParameterSet><ContainerSet><SequenceContainer name='R'><EntryList>{entries}</EntryList>"
        f"</SequenceContainer>{containers}</ContainerSet></TelemetryMetaData></SpaceSystem>")
    return Database.load(path)


def heir(name, *comparisons):
    """A container that extends R where the comparisons (parameter, operator, value) hold."""
    return (f"<SequenceContainer name='{name}'><EntryList/><BaseContainer containerRef='R'><RestrictionCriteria>"
            "<ComparisonList>" + "".join(
                f"<Comparison parameterRef='{left}' comparisonOperator='{escape(op)}' value='{value}'/>"
                for left, op, value in comparisons)
            + "</ComparisonList></RestrictionCriteria></BaseContainer></SequenceContainer>")


def command(tmp_path, types, arguments, entries, parameters=""):
    """A command C with arguments {name: (type, initial value or None)}."""
    path = tmp_path / "c.xml"
    path.write_text(
        f"<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>{integer('P', 8)}</ParameterTypeSet><ParameterSet>"
        f"{parameters}</ParameterSet></TelemetryMetaData><CommandMetaData><ArgumentTypeSet>{types}</ArgumentTypeSet>"
        "<MetaCommandSet><MetaCommand name='C'><ArgumentList>"
        + "".join(f"<Argument name='{name}' argumentTypeRef='{kind}' "
                  + (f"initialValue='{initial}'" if initial is not None else "") + "/>"
                  for name, (kind, initial) in arguments.items())
        + f"</ArgumentList><CommandContainer name='Cc'><EntryList>{entries}</EntryList></CommandContainer>"
        "</MetaCommand></MetaCommandSet></CommandMetaData></SpaceSystem>")
    return Database.load(path)


def entry(name, condition=""):
    return (f"<ArgumentRefEntry argumentRef='{name}'>"
            + (f"<IncludeCondition>{condition}</IncludeCondition>" if condition else "") + "</ArgumentRefEntry>")


def compares(name, value, op="==", calibrated=True):
    return (f"<Comparison comparisonOperator='{escape(op)}' value='{value}'><ArgumentInstanceRef argumentRef='{name}' "
            f"useCalibratedValue='{str(calibrated).lower()}'/></Comparison>")


U8 = "<IntegerDataEncoding sizeInBits='8'/>"
STRING = ("<StringDataEncoding><SizeInBits><TerminationChar>00</TerminationChar></SizeInBits></StringDataEncoding>")
LABELS = ("<EnumerationList><Enumeration value='0' label='LO'/><Enumeration value='0x1' label='X_HI'/>"
          "</EnumerationList>")
TYPES = {
    "boolean": f"<BooleanArgumentType name='K'>{U8}</BooleanArgumentType>",
    "named": f"<BooleanArgumentType name='K' zeroStringValue='OFF' oneStringValue='ON'>{U8}</BooleanArgumentType>",
    "label": f"<EnumeratedArgumentType name='K'>{U8}{LABELS}</EnumeratedArgumentType>",
    "written label": f"<EnumeratedArgumentType name='K'>{STRING}{LABELS}</EnumeratedArgumentType>",
    "written boolean": f"<BooleanArgumentType name='K'>{STRING}</BooleanArgumentType>",
    "natural": integer("K", 8, kind="Argument"),
    "scaled": integer("K", 8, kind="Argument", inside="<DefaultCalibrator><PolynomialCalibrator><Term exponent='0' "
                      "coefficient='-10'/><Term exponent='1' coefficient='1'/></PolynomialCalibrator>"
                      "</DefaultCalibrator>"),
    "single": "<FloatArgumentType name='K'><FloatDataEncoding sizeInBits='32'/></FloatArgumentType>",
    "text": f"<StringArgumentType name='K'>{STRING}</StringArgumentType>",
    "bytes": "<BinaryArgumentType name='K'><BinaryDataEncoding><SizeInBits><FixedValue>16</FixedValue></SizeInBits>"
             "</BinaryDataEncoding></BinaryArgumentType>",
}
#: type, what the condition compares, whether calibrated; the value given in each way, and its bytes; another value
INCLUDED = [
    ("boolean", ["True", "true", "1"], True, [True, 1, "True", "true", "1", 1.0], b"\x01", False),
    ("boolean", ["1", "0x1"], False, [True, 1, "True", "true", "1"], b"\x01", "False"),
    ("named", ["ON", "true", "1"], True, [True, 1, "ON", "true", "1"], b"\x01", "OFF"),
    ("label", ["X_HI", "1", "0b1", "0o1", "+1"], True, ["X_HI", "HI", 1, "1", "0x01", True], b"\x01", "LO"),
    ("label", ["1", "0x1"], False, ["X_HI", "HI", 1, "1"], b"\x01", 0),
    ("written label", ["X_HI", "1"], True, ["X_HI", "HI", 1, "1"], b"X_HI\0", 0),
    ("written boolean", ["True", "1"], True, [True, 1, "True", "true"], b"True\0", 0),
    ("natural", ["26", "0x1A", "0X1a", "0b11010", "0o32"], True, [26, "26", "0x1A", 26.0, "0b11010"], b"\x1a", 27),
    ("scaled", ["15"], True, [15, "15", 15.0], b"\x05", 16),
    ("scaled", ["5", "0x5"], False, [15, "15", 15.0], b"\x05", 25),
    ("single", ["0.1"], True, [0.1, "0.1"], struct.pack(">f", 0.1), 0.2),
    ("text", ["abc"], True, ["abc"], b"abc\0", "abd"),
    ("bytes", ["1FFE", "1ffe", "0x1FFE"], True, [b"\x1f\xfe", "1FFE", "1ffe"], b"\x1f\xfe", b"\x1f\xff"),
]


@pytest.mark.parametrize("kind, literals, calibrated, ways, expected, other", INCLUDED)
@pytest.mark.parametrize("later", [False, True])
def test_an_argument_is_included_however_the_value_that_decides_is_given(
        tmp_path, kind, literals, calibrated, ways, expected, other, later):
    types = TYPES[kind] + integer("V", 8, kind="Argument")
    for literal in literals:
        entries = [entry("k"), entry("v", compares("k", literal, calibrated=calibrated))]
        database = command(tmp_path, types, {"k": ("K", None), "v": ("V", None)},
                           "".join(entries[::-1 if later else 1]))
        for way in ways:
            parts = [expected, b"\x07"]
            assert database.encode("C", k=way, v=7) == b"".join(parts[::-1 if later else 1]), (literal, way)
        assert len(database.encode("C", k=other, v=7)) == len(database.encode("C", k=other, v=8))
        assert b"\x07" not in database.encode("C", k=other, v=7), literal
        if not later:
            arguments = database.decode_command(database.encode("C", k=ways[0], v=7)).arguments
            assert arguments["v"] == 7, arguments


@pytest.mark.parametrize("kind, literals, calibrated, ways, expected, other", INCLUDED)
def test_a_context_applies_however_the_value_that_decides_is_given(
        tmp_path, kind, literals, calibrated, ways, expected, other):
    def by(factor):
        return f"<PolynomialCalibrator><Term exponent='1' coefficient='{factor}'/></PolynomialCalibrator>"
    for literal in literals:
        types = TYPES[kind] + integer("V", 16, kind="Argument", inside=(
            f"<DefaultCalibrator>{by(1)}</DefaultCalibrator><ContextCalibratorList><ContextCalibrator><ContextMatch>"
            f"{compares('k', literal, calibrated=calibrated)}</ContextMatch><Calibrator>{by(10)}</Calibrator>"
            "</ContextCalibrator></ContextCalibratorList>"))
        database = command(tmp_path, types, {"k": ("K", None), "v": ("V", None)}, entry("k") + entry("v"))
        for way in ways:
            assert database.encode("C", k=way, v=7) == expected + b"\x00\x46", (literal, way)
        assert database.encode("C", k=other, v=7)[-2:] == b"\x00\x07", literal


def test_members_decide_too_and_an_unknown_value_is_named(tmp_path):
    types = (TYPES["label"] + integer("V", 8, kind="Argument")
             + "<AggregateArgumentType name='A'><MemberList><Member name='k' typeRef='K'/></MemberList>"
             "</AggregateArgumentType>")
    for name in ("k", "a.k"):
        database = command(tmp_path, types, {"a": ("A", None), "v": ("V", None)},
                           entry("a") + entry("v", compares(name, "X_HI")))
        assert database.encode("C", a={"k": 1}, v=7) == b"\x01\x07"
        assert database.encode("C", a={"k": "LO"}, v=7) == b"\x00"
    mode = "<Comparison parameterRef='mode' value='2'/>"
    database = command(tmp_path, types, {"v": ("V", None)}, entry("v", mode),
                       parameters="<Parameter name='mode' parameterTypeRef='P'/>")
    with pytest.raises(SetupError, match="C needs mode, whose value decides .*: mode == 2"):
        database.encode("C", v=7)
    assert [database.encode("C", v=7, mode=value) for value in (2, "0x2", 3)] == [b"\x07", b"\x07", b""]


@pytest.mark.parametrize("op", ["==", "!="])
def test_no_condition_holds_on_an_argument_that_is_left_out(tmp_path, op):
    types = integer("V", 8, kind="Argument")
    database = command(tmp_path, types, {name: ("V", None) for name in "akv"},
                       entry("a") + entry("k", compares("a", 1)) + entry("v", compares("k", 5, op)))
    for a, k in ((0, 5), (0, 6), (1, 5), (1, 6)):
        packet = database.encode("C", a=a, k=k, v=7)
        included = a == 1 and (k == 5) == (op == "==")
        assert packet == bytes([a] + [k] * (a == 1) + [7] * included)
        assert database.decode_command(packet).arguments == \
            {"a": a} | ({"k": k} if a == 1 else {}) | ({"v": 7} if included else {})


def test_no_condition_holds_on_a_member_of_an_argument_that_is_left_out(tmp_path):
    types = (integer("V", 8, kind="Argument") + "<AggregateArgumentType name='G'><MemberList>"
             "<Member name='m' typeRef='V'/></MemberList></AggregateArgumentType>")
    database = command(tmp_path, types, {"a": ("V", None), "g": ("G", None), "v": ("V", None)},
                       entry("a") + entry("g", compares("a", 1)) + entry("v", compares("m", 2)))
    assert database.encode("C", a=1, g={"m": 2}, v=7) == b"\1\2\7"
    assert database.encode("C", a=0, g={"m": 2}, v=7) == b"\0"
    assert database.decode_command(b"\0").arguments == {"a": 0}


def test_a_name_with_a_dot_is_no_member(tmp_path):
    database = command(tmp_path, integer("V", 8, kind="Argument"), {name: ("V", None) for name in ("X", "A.X", "v")},
                       entry("X") + entry("A.X") + entry("v", compares("X", 1)))
    assert database.encode("C", X=1, **{"A.X": 2}, v=7) == b"\1\2\7"
    assert database.encode("C", X=2, **{"A.X": 1}, v=7) == b"\2\1"


def test_a_constant_that_no_argument_has_gets_a_note(tmp_path):
    types = TYPES["label"] + TYPES["boolean"].replace("'K'", "'B'") + integer("V", 8, kind="Argument")
    arguments = {"k": ("K", None), "b": ("B", None), "v": ("V", None)}
    for name, value, calibrated in [("k", "X_HI", True), ("k", "1", False), ("b", "true", True), ("v", "0x10", True)]:
        assert command(tmp_path, types, arguments, entry("v", compares(name, value, calibrated=calibrated))).notes == []
    for name, value, calibrated in [("k", "MID", True), ("k", "X_HI", False), ("b", "on", True), ("v", "many", True)]:
        (note,) = command(tmp_path, types, arguments, entry("v", compares(name, value, calibrated=calibrated))).notes
        assert f"'{value}' is no value of {name}" in note and note.endswith(": nothing equals it")
    by = "<PolynomialCalibrator><Term exponent='1' coefficient='2'/></PolynomialCalibrator>"
    scaled = integer("W", 8, kind="Argument", inside=(       # of a type, which knows no command
        "<ContextCalibratorList><ContextCalibrator><ContextMatch>" + compares("k", "MIDDLE") +
        f"</ContextMatch><Calibrator>{by}</Calibrator></ContextCalibrator></ContextCalibratorList>"))
    (note,) = command(tmp_path, types + scaled, arguments, entry("v")).notes
    assert "'MIDDLE' is no value of k" in note


def test_two_values_compare_in_a_command_as_in_telemetry(tmp_path):
    both = ("<BooleanExpression><Condition><ArgumentInstanceRef argumentRef='k'/><ComparisonOperator>=="
            "</ComparisonOperator><ArgumentInstanceRef argumentRef='{}'/></Condition></BooleanExpression>")
    types = (TYPES["label"] + integer("V", 8, kind="Argument")
             + TYPES["text"].replace("name='K'", "name='T'") + TYPES["named"].replace("name='K'", "name='B'"))
    arguments = {"k": ("K", None), "n": ("V", None), "t": ("T", None), "b": ("B", None), "v": ("V", None)}
    for name in ("n", "t", "b"):
        database = command(tmp_path, types, arguments,
                           "".join(map(entry, ("k", "n", "t", "b"))) + entry("v", both.format(name)))
        for k, n, t, b in [("X_HI", 1, "X_HI", "ON"), (1, "1", "X_HI", True), ("HI", 1, "X_HI", 1)]:
            packet = database.encode("C", k=k, n=n, t=t, b=b, v=7)
            assert packet == b"\x01\x01X_HI\0\x01\x07", name
            assert database.decode_command(packet).arguments["v"] == 7, name
        assert database.encode("C", k=0, n=1, t="X_HI", b=1, v=7) == b"\x00\x01X_HI\0\x01", name


# --- whole numbers of 64 bits

def step(text):
    kind = "ValueOperand" if text[0].isdigit() or text[1:].isdigit() else "Operator"
    return "<ThisParameterOperand/>" if text == "x" else f"<{kind}>{escape(text)}</{kind}>"


def calculation(*steps):
    return ("<DefaultCalibrator><MathOperationCalibrator>" + "".join(map(step, steps))
            + "</MathOperationCalibrator></DefaultCalibrator>")


def floor_of(a, b):
    """The quotient, rounded down, or up if it is divided by a negative number."""
    return a // b if b > 0 else -(a // -b)


def rest(a, b):
    """The rest of a division that rounds to zero: it has the sign of a."""
    return (abs(a) % abs(b)) * (1 if a >= 0 else -1)


OPERATIONS = {"&": operator.and_, "|": operator.or_, "xor": operator.xor, "+": operator.add, "-": operator.sub,
              "*": operator.mul, "div": floor_of, "%": rest, "min": min, "max": max,
              **{name: lambda a, b, f=f: int(f(a, b)) for name, f in COMPARISONS.items()},
              "<<": lambda a, b: a << b, ">>": lambda a, b: a >> b, "^": lambda a, b: a**b}


@pytest.mark.parametrize("name", [*OPERATIONS, "~", "abs", "int", "!"])
def test_calculations_with_whole_numbers_are_exact(tmp_path, name):
    chance = random.Random(name)
    operands = [chance.choice(SPECIAL) for _ in range(6)] + [chance.getrandbits(64) for _ in range(2)]
    if name in ("<<", ">>", "^"):
        operands = [0, 1, 2, 13, 31, 32, 52, 63][:8 if name != "^" else 4]
    operands = [number for number in operands if -2**63 <= number < 2**64 and (number or name not in ("div", "%"))]
    for signed in (False, True):
        for operand in operands if name in OPERATIONS else [0]:
            steps = ("x", str(operand), name) if name in OPERATIONS else ("x", name)
            database = telemetry(tmp_path, integer("T", 64, signed, calculation(*steps)), {"a": "T"}, "")
            for x in SPECIAL + [chance.getrandbits(64) - 2**63 * signed for _ in range(20)]:
                if not (-2**63 if signed else 0) <= x < (2**63 if signed else 2**64):
                    continue
                exact = {"~": ~x, "abs": abs(x), "int": x, "!": int(not x)}[name] if name not in OPERATIONS \
                    else OPERATIONS[name](x, operand)
                within = (-2**63 if signed else 0) <= exact < (2**63 if signed else 2**64)
                packet = (x % 2**64).to_bytes(8, "big")
                assert database.decode(packet).values["a"] == (exact if within else None), (signed, x, operand)


def test_polynomials_of_whole_numbers_are_exact(tmp_path):
    terms = "".join(f"<Term exponent='{i}' coefficient='{c}'/>" for i, c in enumerate((-7, 3, 2)))
    database = telemetry(tmp_path, integer("T", 64, False, "<DefaultCalibrator><PolynomialCalibrator>" + terms
                                           + "</PolynomialCalibrator></DefaultCalibrator>"), {"a": "T"}, "")
    for x in [2, 5, 2**26 + 1, 2**31 - 1, 2**31 + 1, 3037000497, 2**33, 2**64 - 1]:
        exact = 2 * x * x + 3 * x - 7
        assert database.decode(x.to_bytes(8, "big")).values["a"] == (exact if exact < 2**64 else None), x


def test_a_time_of_two_halves_of_64_bits_has_both(tmp_path):
    """Nanoseconds in the upper 32 bits, seconds in the lower."""
    steps = ("x", "32", ">>", "0xFFFFFFFF", "&", "1e-9", "*", "x", "4294967295", "&", "+")
    types = ("<FloatParameterType name='T' sizeInBits='64'><IntegerDataEncoding sizeInBits='64' "
             f"byteOrder='leastSignificantByteFirst'>{calculation(*steps)}</IntegerDataEncoding></FloatParameterType>")
    database = telemetry(tmp_path, types, {"t": "T"}, "")
    for ns, s in [(0, 1), (999_999_999, 1_700_000_001), (123_456_789, 2**32 - 1), (1, 2**31 + 1)]:
        assert database.decode((ns << 32 | s).to_bytes(8, "little")).values["t"] == ns * 1e-9 + s


def bounds():
    chance = random.Random(7)
    whole = [number for number in SPECIAL if 0 <= number < 2**64] + [chance.getrandbits(64) for _ in range(10)]
    for low, high in [sorted(chance.choices(whole, k=2)) for _ in range(40)]:
        yield low, high, [x for end in (low, high) for x in (end - 1, end, end + 1) if 0 <= x < 2**64]


@pytest.mark.parametrize("ends", ["Inclusive", "Exclusive"])
def test_the_ends_of_valid_ranges_are_exact(tmp_path, ends):
    below = operator.le if ends == "Inclusive" else operator.lt
    for low, high, values in bounds():
        around = (f"<ValidRangeSet><ValidRange min{ends}='{low}' max{ends}='{high:#x}'/></ValidRangeSet>")
        database = command(tmp_path, integer("V", kind="Argument", around=around), {"v": ("V", None)}, entry("v"))
        form = database.forms()[0]["arguments"][0]
        assert (form["low"], form["high"]) == (low, high)
        for x in values:
            if below(low, x) and below(x, high):
                assert database.encode("C", v=x) == database.encode("C", v=str(x)) == x.to_bytes(8, "big")
            else:
                with pytest.raises(SetupError, match=f" {low} to .*{high}; found {x}$"):
                    database.encode("C", v=x)


@pytest.mark.parametrize("ends", ["Inclusive", "Exclusive"])
def test_the_ends_of_alarms_are_exact(tmp_path, ends):
    below = operator.le if ends == "Inclusive" else operator.lt
    for low, high, values in bounds():
        around = (f"<DefaultAlarm><StaticAlarmRanges><WarningRange min{ends}='{low}' max{ends}='{high}'/>"
                  "</StaticAlarmRanges></DefaultAlarm>")
        database = telemetry(tmp_path, integer("U", around=around), {"u": "U"}, "")
        for x in values:
            monitor = database.monitor()
            monitor.take([(0, 0, (x).to_bytes(8, "big"))])
            calm = below(low, x) and below(x, high)
            assert monitor.newest(0)[5] == (0 if calm else 2), (low, high, x)
    monitor = telemetry(tmp_path, integer("U"), {"u": "U"}, "").monitor()
    monitor.take([(0, 0, (2**53 + 1).to_bytes(8, "big"))])
    for end in (2**53, 2**53 + 1, 2**64 - 1):
        monitor.set_limits(0, {"warning": [None, end]})
        assert monitor.newest(0)[5] == (2 if end == 2**53 else 0)
        assert monitor.slots(0)[0]["limits"] == {"warning": [None, end]}


def test_limits_of_a_label_judge_its_raw_number(tmp_path):
    types = f"<EnumeratedParameterType name='K'>{U8}{LABELS}</EnumeratedParameterType>"
    monitor = telemetry(tmp_path, types, {"k": "K"}, "").monitor()
    monitor.take([(0, 0, b"\0")])
    monitor.set_limits(0, {"warning": [-1, 0]})
    for raw, concern in [(0, 0), (1, 2), (0, 0), (9, 2)]:
        monitor.take([(0, 0, bytes([raw]))])
        assert monitor.newest(0)[5] == concern, raw


def test_labels_are_in_the_order_of_their_numbers(tmp_path):
    labels = [("SAFE", 0, 3), ("NADIR", 4, 4), ("BURN", 2**63 - 1, 2**63 - 1)]      # not of the alphabet
    types = "<EnumeratedParameterType name='K'><IntegerDataEncoding sizeInBits='64'/><EnumerationList>" + "".join(
        f"<Enumeration value='{low}' maxValue='{high}' label='{label}'/>" for label, low, high in labels) + \
        "</EnumerationList></EnumeratedParameterType>"
    for label, low, high in labels:
        database = telemetry(tmp_path, types, {"k": "K"}, "".join(
            heir(name, ("k", op, label)) for op, name in {"==": "SAME", "<": "LESS", ">": "MORE"}.items()))
        for raw in (0, 1, 3, 4, 5, 2**63 - 2, 2**63 - 1):
            own = next((first for _, first, last in labels if first <= raw <= last), raw)
            expected = "SAME" if own == low else "LESS" if own < low else "MORE"
            assert database.decode(raw.to_bytes(8, "big")).container == f"/S/{expected}", (label, raw)


def test_comparisons_of_whole_numbers_are_exact_in_each_notation(tmp_path):
    chance = random.Random(5)
    whole = [number for number in SPECIAL if 0 <= number < 2**64]
    for literal in chance.sample(whole, 12):
        for written in (str(literal), hex(literal), oct(literal), bin(literal), f" {literal} ", f"{literal}.00"):
            names = {"==": "SAME", "<": "LESS", ">": "MORE"}
            database = telemetry(tmp_path, integer("U"), {"u": "U"},
                                 "".join(heir(name, ("u", op, written)) for op, name in names.items()))
            for x in (literal - 1, literal, literal + 1):
                if 0 <= x < 2**64:
                    found = database.decode(x.to_bytes(8, "big")).container
                    assert found == f"/S/{names['==' if x == literal else '<' if x < literal else '>']}", (written, x)


def test_doubles_and_whole_numbers_compare_exactly(tmp_path):
    types = integer("U") + "<FloatParameterType name='F'><FloatDataEncoding sizeInBits='64'/></FloatParameterType>"
    order = "".join(
        f"<SequenceContainer name='{name}'><EntryList/><BaseContainer containerRef='R'><RestrictionCriteria>"
        "<BooleanExpression><Condition><ParameterInstanceRef parameterRef='u'/><ComparisonOperator>"
        f"{escape(op)}</ComparisonOperator><ParameterInstanceRef parameterRef='f'/></Condition></BooleanExpression>"
        "</RestrictionCriteria></BaseContainer></SequenceContainer>"
        for name, op in (("LESS", "<"), ("SAME", "=="), ("MORE", ">")))
    database = telemetry(tmp_path, types, {"u": "U", "f": "F"}, order)
    for u in [number for number in SPECIAL if 0 <= number < 2**64]:
        for f in (float(u), u + 0.5, -1.5, 1e300, float("-inf"), float("nan")):
            expected = "R" if f != f else "LESS" if u < f else "SAME" if u == f else "MORE"
            assert database.decode(struct.pack(">Qd", u, f)).container == f"/S/{expected}", (u, f)


def test_a_binary_value_compares_with_hexadecimal_digits(tmp_path):
    types = ("<BinaryParameterType name='B'><BinaryDataEncoding><SizeInBits><FixedValue>24</FixedValue></SizeInBits>"
             "</BinaryDataEncoding></BinaryParameterType>")
    for written in ("001FfE", "0x1FFE"):
        database = telemetry(tmp_path, types, {"b": "B"}, heir("K", ("b", "==", written)))
        assert database.decode(b"\x00\x1f\xfe").container == "/S/K"
        assert database.decode(b"\x01\x1f\xfe").container == "/S/R"


def fixed(kind, encoding, bits, more=""):
    size = f"<FixedValue>{bits}</FixedValue>"
    size = f"<Fixed>{size}</Fixed>" if encoding.startswith("String") else size
    return (f"<{kind}ArgumentType name='V'><{encoding}><SizeInBits>{size}</SizeInBits></{encoding.split()[0]}>{more}"
            f"</{kind}ArgumentType>")


@pytest.mark.parametrize("types, value, packed", [
    (fixed("String", "StringDataEncoding", 32), "ab", b"ab\0\0"),
    (fixed("String", "StringDataEncoding", 32), "", bytes(4)),
    (fixed("String", "StringDataEncoding", 32), "a\0b", b"a\0b\0"),
    (fixed("String", "StringDataEncoding", 32), "\u20aca", b"\xe2\x82\xaca"),
    (fixed("String", "StringDataEncoding encoding='UTF-16BE'", 56), "ab", b"\0a\0b\0\0\0"),
    (fixed("String", "BinaryDataEncoding", 32), "ab", b"ab\0\0"),
    (fixed("Integer", "StringDataEncoding", 32), 12, b"12\0\0"),
    (fixed("Enumerated", "StringDataEncoding", 48, LABELS), "X_HI", b"X_HI\0\0")])
def test_a_text_of_a_fixed_size_is_padded_with_zeros_which_are_not_shown(tmp_path, types, value, packed):
    sent = command(tmp_path, types, {"v": ("V", None)}, entry("v"))
    assert sent.encode("C", v=value) == packed
    assert sent.decode_command(packed).arguments == {"v": value}
    back = telemetry(tmp_path, types.replace("Argument", "Parameter"), {"v": "V"},
                     heir("K", ("v", "==", value)) if value == "ab" else "")
    packet = back.decode(packed)
    assert (packet.values, packet.container) == ({"v": value}, "/S/K" if value == "ab" else "/S/R")
    with pytest.raises(SetupError, match=f"v must have at most {len(packed)} bytes; found|must be one of"):
        sent.encode("C", v="123456789")


def test_a_text_whose_size_is_no_whole_number_of_bytes_is_not_padded(tmp_path):
    database = command(tmp_path, fixed("String", "StringDataEncoding", 12), {"v": ("V", None)}, entry("v"))
    with pytest.raises(SetupError, match="v must have 2 bytes; found 1"):
        database.encode("C", v="A")


def test_a_binary_value_of_a_fixed_size_is_not_padded(tmp_path):
    database = command(tmp_path, TYPES["bytes"], {"v": ("K", None)}, entry("v"))
    with pytest.raises(SetupError, match="v must have 2 bytes; found 1"):
        database.encode("C", v=b"\x01")
    assert database.decode_command(b"\x01\0").arguments == {"v": b"\x01\0"}


@pytest.mark.parametrize("signed", [False, True])
def test_whole_numbers_as_text_have_all_digits(tmp_path, signed):
    text = f"<IntegerArgumentType name='V' signed='{str(signed).lower()}'>{STRING}</IntegerArgumentType>"
    sent = command(tmp_path, text, {"v": ("V", None)}, entry("v"))
    back = telemetry(tmp_path, text.replace("Argument", "Parameter"), {"v": "V"}, "")
    for x in SPECIAL:
        if (-2**63 if signed else 0) <= x < (2**63 if signed else 2**64):
            for way in (x, str(x), hex(x)):
                packet = sent.encode("C", v=way)
                assert packet == b"%d\0" % x, way
            assert back.decode(packet).values["v"] == x
    beyond = 2**63 if signed else 2**64
    assert back.decode(b"%d\0" % beyond).values["v"] is None


def test_a_value_that_a_whole_number_cannot_hold_is_none(tmp_path):
    types = "<IntegerParameterType name='T'><FloatDataEncoding sizeInBits='64'/></IntegerParameterType>"
    database = telemetry(tmp_path, types, {"a": "T"}, "")
    for x, expected in [(2.0**63, None), (-2.0**63, -2**63), (float("nan"), None), (2.5, 3), (-1e300, None)]:
        packet = database.decode(struct.pack(">d", x))
        assert packet.values["a"] == expected and (packet.raw["a"] == x or x != x), x


def test_initial_values_are_dates_durations_and_numbers_of_each_notation(tmp_path):
    times = "<{0}TimeArgumentType name='{1}'><Encoding units='{2}'>{3}</Encoding>{4}</{0}TimeArgumentType>"
    wide = "<IntegerDataEncoding sizeInBits='32'/>"
    since = "<ReferenceTime><Epoch>{}</Epoch></ReferenceTime>"
    for kind, units, epoch, initial, raw in [
            ("Relative", "seconds", "", "PT10S", 10), ("Relative", "seconds", "", "P1DT1H1M2S", 90062),
            ("Absolute", "seconds", since.format("UNIX"), "2001-09-09T01:46:40Z", 10**9),
            ("Absolute", "days", since.format("UNIX"), "1970-01-11T00:00:00", 10),
            ("Absolute", "seconds", since.format("2000-01-01T12:00:00"), "2000-01-02T12:00:00.0Z", 86400)]:
        database = command(tmp_path, times.format(kind, "V", units, wide, epoch), {"v": ("V", initial)}, entry("v"))
        assert database.encode("C") == database.encode("C", v=initial) == raw.to_bytes(4, "big"), initial
    database = command(tmp_path, integer("V", 16, kind="Argument"), {"v": ("V", "0x1A")}, entry("v"))
    assert database.encode("C") == b"\x00\x1a"


def test_a_condition_takes_an_initial_value_in_each_way(tmp_path):
    """Of a parameter that no packet had yet."""
    types = (f"<EnumeratedParameterType name='K'>{U8}{LABELS}</EnumeratedParameterType>" + integer("V", 8)
             + "<RelativeTimeParameterType name='D'><Encoding><IntegerDataEncoding sizeInBits='8'/></Encoding>"
             "</RelativeTimeParameterType>" + integer("U"))
    path = tmp_path / "i.xml"
    for kind, initial, value, more in [
            ("K", "X_HI", "1", ""), ("K", "X_HI", "X_HI", ""), ("K", "1", "X_HI", ""), ("K", "0b1", "1", ""),
            ("K", "X_HI", "1", "useCalibratedValue='false'"), ("D", "PT10S", "10", ""), ("D", "PT10S", "PT10S", ""),
            ("D", "10", "PT10S", ""), ("U", str(2**64 - 1), str(2**64 - 1), ""), ("U", "0x1F", "31", "")]:
        for op, included in (("==", True), ("!=", False)):
            path.write_text(
                f"<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>{types}</ParameterTypeSet><ParameterSet>"
                f"<Parameter name='k' parameterTypeRef='{kind}' initialValue='{initial}'/>"
                "<Parameter name='v' parameterTypeRef='V'/></ParameterSet><ContainerSet><SequenceContainer name='R'>"
                "<EntryList><ParameterRefEntry parameterRef='v'><IncludeCondition><Comparison parameterRef='k' "
                f"comparisonOperator='{op}' value='{value}' {more}/></IncludeCondition></ParameterRefEntry></EntryList>"
                "</SequenceContainer></ContainerSet></TelemetryMetaData></SpaceSystem>")
            assert ("v" in Database.load(path).decode(b"\x07").values) == included, (kind, initial, value, op)
