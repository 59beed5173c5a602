# SPDX-License-Identifier: Apache-2.0
"""A second reader of XTCE, decoder and encoder, for tests: written from the standard's tables, with ElementTree, whole
packets as one integer, and no thought of speed. It takes one file without references to others."""
from __future__ import annotations

import operator
import struct
from fractions import Fraction
from typing import Any
from xml.etree import ElementTree

COMPARE = {"==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt,
           ">=": operator.ge}
CODECS = {"UTF-8": "utf-8", "US-ASCII": "ascii", "ISO-8859-1": "latin-1", "Windows-1252": "cp1252",
          "UTF-16LE": "utf-16-le", "UTF-16BE": "utf-16-be", "UTF-32BE": "utf-32-be"}
NUMBER = ("IntegerDataEncoding", "FloatDataEncoding")


class Ends(Exception):
    """The packet ends within an entry."""


class Second:
    def __init__(self, text: str) -> None:
        root = ElementTree.fromstring(text)
        for node in root.iter():
            node.tag = node.tag.split("}")[-1]
        self.types = {name.get("name"): name for kind in ("ParameterTypeSet", "ArgumentTypeSet")
                      for names in root.iter(kind) for name in names}
        self.parameters = {node.get("name"): node.get("parameterTypeRef") for node in root.iter("Parameter")}
        self.containers = {node.get("name"): node for node in root.iter("SequenceContainer")}
        self.commands = {node.get("name"): node for node in root.iter("MetaCommand")}

    # --- packets to rows

    def decode(self, packet: bytes, root: str) -> tuple[str | None, list[tuple[str, Any, Any]]]:
        """(name of the container, rows); of a packet that fits none, None and no row."""
        self.bits, self.size = int.from_bytes(packet, "big"), 8 * len(packet)
        self.rows: list[tuple[str, Any, Any]] = []
        self.last, self.whole = "", True
        self.most, self.tail = 0, self.size     # behind what is placed from the front; in front of what is from the end
        try:
            container = self._fit(root, 0)
            self.whole = container is not None
            return container, self.rows
        except Ends:
            self.whole = False
            return self.last, self.rows

    def _fit(self, name, at):
        container, before, bounds = self.containers[name], len(self.rows), (self.most, self.tail)
        self.last = name
        at = self._entries(container, at)
        for heir, element in self.containers.items():
            base = element.find("BaseContainer")
            if base is not None and base.get("containerRef") == name:
                criteria = base.find("RestrictionCriteria")
                if criteria is None or self._holds(criteria[0]):
                    heir_name = self._fit(heir, at)
                    if heir_name:
                        return heir_name
        if container.get("abstract") == "true":
            del self.rows[before:]
            self.most, self.tail = bounds
            return None
        self.last = name
        if self.most > self.tail:
            raise Ends
        return name

    def _entries(self, container, at, start=0):
        front = None    # behind an entry that is placed from the end: where heirs go on
        for entry in container.find("EntryList"):
            include = entry.find("IncludeCondition")
            if include is not None and not self._holds(include[0]):
                continue
            count = entry.find("RepeatEntry/Count")
            gap = entry.find("RepeatEntry/Offset")
            place = entry.find("LocationInContainerInBits")
            offset = 0 if place is None else self._number(place)
            origin = "previousEntry" if place is None else place.get("referenceLocation")
            n, gap = 1 if count is None else self._number(count), 0 if gap is None else self._number(gap)
            position = (start if origin == "containerStart" else at) + offset
            if origin == "containerEnd":
                position = self.size - offset - n * self._size(self.types[self.parameters[entry.get("parameterRef")]]) \
                    - max(n - 1, 0) * gap
                front, self.tail = at if front is None else front, min(self.tail, max(position, 0))
            elif origin == "containerStart":
                front = None
            for _ in range(n):
                if not 0 <= position <= self.size:
                    raise Ends
                at = position
                if entry.tag == "ContainerRefEntry":
                    most = self.most
                    at = self._entries(self.containers[entry.get("containerRef")], at, at)
                    self.most = most
                else:
                    name = entry.get("parameterRef")
                    at = self._take(name, self.types[self.parameters[name]], at)
                position = at + gap
            if front is None:
                self.most = max(self.most, at)
        return at if front is None else front

    def _size(self, kind):
        """The bits of a type that has a size."""
        if kind.tag.startswith("Aggregate"):
            return sum(self._size(self.types[member.get("typeRef")]) for member in kind.find("MemberList"))
        if kind.tag.startswith("Array"):
            return self._elements(kind) * self._size(self.types[kind.get("arrayTypeRef")])
        encoding = next(child for child in kind if child.tag.endswith("DataEncoding"))
        if encoding.tag in NUMBER:
            return int(encoding.get("sizeInBits", "32" if encoding.tag == "FloatDataEncoding" else "8"))
        size = encoding.find("SizeInBits")
        n = self._number(size if size is not None else encoding.find("Variable"))
        if not 0 <= n <= self.size:
            raise Ends
        return n

    def _elements(self, kind):
        n = 1
        for dimension in kind.iter("Dimension"):
            n *= self._number(dimension.find("EndingIndex")) - self._number(dimension.find("StartingIndex")) + 1
        return n

    def _bits(self, at, n):
        if at + n > self.size:
            raise Ends
        return self.bits >> (self.size - at - n) & ((1 << n) - 1)

    def _bytes(self, at, n):
        return self._bits(at, n).to_bytes((n + 7) // 8, "big")

    def _take(self, path, kind, at):
        if kind.tag.startswith("Aggregate"):
            for member in kind.find("MemberList"):
                at = self._take(f"{path}.{member.get('name')}", self.types[member.get("typeRef")], at)
            return at
        if kind.tag.startswith("Array"):
            for i in range(self._elements(kind)):
                at = self._take(f"{path}[{i}]", self.types[kind.get("arrayTypeRef")], at)
            return at
        encoding = next(child for child in kind if child.tag.endswith("DataEncoding"))
        if encoding.tag in NUMBER:
            n = int(encoding.get("sizeInBits", "32" if encoding.tag == "FloatDataEncoding" else "8"))
            raw = number(encoding, n, self._bits(at, n))
            self.rows.append((path, raw, None if raw is None else self._value(kind, encoding, raw)))
            return at + n
        if encoding.tag == "BinaryDataEncoding":
            n = self._number(encoding.find("SizeInBits"))
            if n < 0:
                raise Ends
            value = self._bytes(at, n)
            self.rows.append((path, value, value))
            return at + n
        return self._text(path, encoding, at)

    def _text(self, path, encoding, at):
        size = encoding.find("SizeInBits")
        box = size if size is not None else encoding.find("Variable")
        sized = box.find("Fixed") is not None or not any(
            reference.get("parameterRef") == "_yamcs_ignore" for reference in box.iter("ParameterInstanceRef"))
        room = self.size - at
        if sized:
            room = int(box.findtext("Fixed/FixedValue")) if size is not None else self._number(box)
            if not 0 <= room <= self.size - at:
                raise Ends
        most = min(room, int(box.get("maxSizeInBits", room)))
        tag, end = box.find("LeadingSize"), box.findtext("TerminationChar")
        codec = CODECS[encoding.get("encoding", "UTF-8")]
        unit = 4 if "32" in codec else 2 if "16" in codec else 1
        good = most == room or not sized
        if tag is not None:
            width = int(tag.get("sizeInBitsOfSizeTag", "16"))
            if width > most:
                raise Ends
            n = 8 * self._bits(at, width)
            if n > most - width:
                if not sized:
                    raise Ends
                good, n = False, (most - width) // 8 * 8
            raw, used = self._bytes(at + width, n), width + n
        else:
            raw = b"".join(self._bytes(at + i, 8 * unit) for i in range(0, most - 8 * unit + 1, 8 * unit))
            used = 0
            if end:
                mark = bytes.fromhex(end)
                for i in range(0, most // 8 - len(mark) + 1, unit):
                    if b"".join(self._bytes(at + 8 * (i + j), 8) for j in range(len(mark))) == mark:
                        raw, used = raw[:i], 8 * (i + len(mark))
                        break
            elif size is not None:      # what is behind a fixed text is padding
                while raw[-unit:] == bytes(unit):
                    raw = raw[:-unit]
            if not sized and not used:
                raise Ends
        value = raw.decode(codec, "replace") if good else None
        self.rows.append((path, raw.decode("utf-8", "replace"), value))
        return at + (room if sized else used)

    def _value(self, kind, encoding, raw):
        if kind.tag.startswith("Enumerated"):
            return next((label.get("label") for label in kind.iter("Enumeration")
                         if int(label.get("value")) <= raw <= int(label.get("maxValue", label.get("value")))), raw)
        if kind.tag.startswith("Boolean"):
            return raw != 0
        calibrator = encoding.find("DefaultCalibrator")
        if calibrator is not None:
            raw = calibrated(calibrator[0], float(raw))
        if kind.tag.startswith("Float") or raw is None:
            return None if raw is None else float(raw)
        return round_half_out(raw) if isinstance(raw, float) else raw

    def _find(self, reference):
        name = reference.get("parameterRef", "").replace("/", ".")
        rows = [row for row in self.rows if row[0] == name or row[0].endswith("." + name)]
        return None if not rows else rows[-1][2 if reference.get("useCalibratedValue", "true") == "true" else 1]

    def _holds(self, criterion):
        if criterion.tag in ("ComparisonList", "ANDedConditions"):
            return all(self._holds(each) for each in criterion)
        if criterion.tag in ("BooleanExpression", "ORedConditions"):
            return any(self._holds(each) for each in criterion)
        if criterion.tag == "Condition":
            left, op, right = criterion
            left, op, right = self._find(left), op.text, \
                right.text if right.tag == "Value" else self._find(right)
        else:
            left, op, right = self._find(criterion), criterion.get("comparisonOperator", "=="), criterion.get("value")
        if left is None or right is None:
            return False
        if isinstance(right, str) and not isinstance(left, str):
            right = float(right) if isinstance(left, float) else int(right)
        return COMPARE[op](left, right)

    def _number(self, element):
        for child in element.iter():
            if child.tag == "FixedValue":
                return int(child.text)
            if child.tag == "DynamicValue":
                value = self._find(child[0])
                if value is None:
                    raise Ends
                by = child.find("LinearAdjustment")
                slope, intercept = (1, 0) if by is None else (float(by.get("slope", 1)), float(by.get("intercept", 0)))
                return round_half_out(value * slope + intercept)
        raise Ends

    # --- commands to bytes

    def encode(self, name: str, given: dict[str, Any]) -> bytes:
        self.bits = self.size = 0
        self._write(self.commands[name], given)
        return (self.bits << -self.size % 8).to_bytes((self.size + 7) // 8, "big")

    def _write(self, command, given):
        arguments = {argument.get("name"): argument.get("argumentTypeRef") for argument in command.iter("Argument")}
        own = command.find("CommandContainer")
        base, tails = own.find("BaseContainer"), []
        for entry in [*(self.containers[base.get("containerRef")] if base is not None else own).find("EntryList"),
                      *(own.find("EntryList") if base is not None else ())]:
            front = self.bits, self.size
            place = entry.find("LocationInContainerInBits")
            if place is not None:
                self.bits = self.size = 0
            if entry.tag == "FixedValueEntry":
                n = int(entry.get("sizeInBits"))
                self._put(n, int(entry.get("binaryValue"), 16) & ((1 << n) - 1))
            elif entry.tag == "ParameterRefEntry":
                self._give(self.types[self.parameters[entry.get("parameterRef")]], given[entry.get("parameterRef")])
            else:
                self._give(self.types[arguments[entry.get("argumentRef")]], given[entry.get("argumentRef")])
            if place is not None:   # of commands here: from the end alone
                tails.append((int(place.findtext("FixedValue")), self.bits, self.size))
                self.bits, self.size = front
        if tails:
            size = self.size + max(offset + n for offset, _, n in tails)
            size += -size % 8
            self.bits <<= size - self.size
            self.size = size
            for offset, bits_, _ in tails:
                self.bits |= bits_ << offset

    def _put(self, n, value):
        self.bits, self.size = self.bits << n | value, self.size + n

    def _give(self, kind, value):
        if kind.tag.startswith("Aggregate"):
            for member in kind.find("MemberList"):
                self._give(self.types[member.get("typeRef")], value[member.get("name")])
            return
        if kind.tag.startswith("Array"):
            for item in value:
                self._give(self.types[kind.get("arrayTypeRef")], item)
            return
        encoding = next(child for child in kind if child.tag.endswith("DataEncoding"))
        if encoding.tag in NUMBER:
            if kind.tag.startswith("Enumerated"):
                value = next(int(label.get("value"))
                             for label in kind.iter("Enumeration") if label.get("label") == value)
            n = int(encoding.get("sizeInBits", "32" if encoding.tag == "FloatDataEncoding" else "8"))
            calibrator = encoding.find("DefaultCalibrator")
            if calibrator is not None:
                value = calibrated(calibrator[0], float(value))
            if encoding.tag == "IntegerDataEncoding":
                value = round_half_out(value)
            self._put(n, bits(encoding, n, value))
            return
        if encoding.tag == "BinaryDataEncoding":
            n = int(encoding.findtext("SizeInBits/FixedValue"))
            self._put(n, int.from_bytes(value, "big") & ((1 << n) - 1))
            return
        size = encoding.find("SizeInBits")
        box = size if size is not None else encoding.find("Variable")
        raw = value.encode(CODECS[encoding.get("encoding", "UTF-8")])
        room = int(box.findtext("Fixed/FixedValue")) if size is not None else None
        tag, end = box.find("LeadingSize"), box.findtext("TerminationChar")
        if tag is not None:
            raw = len(raw).to_bytes(int(tag.get("sizeInBitsOfSizeTag")) // 8, "big") + raw
        elif end and (room is None or 8 * (len(raw) + len(end) // 2) <= room):
            raw += bytes.fromhex(end)
        raw = raw.ljust(0 if room is None else room // 8, b"\0")
        self._put(8 * len(raw), int.from_bytes(raw, "big"))


def round_half_out(x):
    """The nearest whole number, away from zero where two are."""
    exact = Fraction(x)
    return (1 if exact > 0 else -1) * int(abs(exact) + Fraction(1, 2))


def order(encoding, n):
    """The significance of each byte in memory."""
    given = encoding.get("byteOrder", "mostSignificantByteFirst")
    size = (n + 7) // 8
    return list(range(size)) if given.startswith("least") else \
        list(range(size))[::-1] if given.startswith("most") else [int(word) for word in given.split(",")]


def number(encoding, n, raw):
    """The value of n bits; None: they have none."""
    if encoding.get("bitOrder") == "leastSignificantBitFirst":
        raw = int(f"{raw:0{n}b}"[::-1], 2)
    if n % 8 == 0:
        raw = sum(byte << 8 * place for byte, place in zip(raw.to_bytes(n // 8, "big"), order(encoding, n)))
    kind = encoding.get("encoding", "IEEE754_1985" if encoding.tag == "FloatDataEncoding" else "unsigned")
    top = 1 << n - 1
    if kind == "twosComplement":
        return raw - 2 * top if raw & top else raw
    if kind == "onesComplement":
        return -(raw ^ 2 * top - 1) if raw & top else raw
    if kind == "signMagnitude":
        return -(raw - top) if raw & top else raw
    if kind in ("BCD", "packedBCD"):
        step = 8 if kind == "BCD" else 4
        digits = [raw >> i & (1 << step) - 1 for i in range(n - step, -1, -step)]
        return int("".join(map(str, digits))) if max(digits) <= 9 else None
    if kind == "MILSTD_1750A":
        fraction = raw >> 8 if n == 32 else raw >> 24 << 16 | raw & 0xFFFF
        exponent = raw & 0xFF if n == 32 else raw >> 16 & 0xFF
        fraction -= (1 << n - 8) if fraction >> n - 9 else 0
        exponent -= 256 if exponent > 127 else 0
        return float(Fraction(fraction) * Fraction(2) ** (exponent - (n - 9)))
    if kind.startswith("IEEE"):
        return struct.unpack({16: ">e", 32: ">f", 64: ">d"}[n], raw.to_bytes(n // 8, "big"))[0]
    return raw


def bits(encoding, n, value):
    """The other way, by search: the bits whose number is the value, for what rounding does not matter."""
    kind = encoding.get("encoding", "IEEE754_1985" if encoding.tag == "FloatDataEncoding" else "unsigned")
    top = 1 << n - 1
    if kind.startswith("IEEE"):
        raw = int.from_bytes(struct.pack({16: ">e", 32: ">f", 64: ">d"}[n], value), "big")
    elif kind == "MILSTD_1750A":
        exponent = 0
        exact = Fraction(value)
        while exact and exponent > -128 and not (Fraction(1, 2) <= exact < 1 or -1 <= exact < Fraction(-1, 2)):
            exponent, exact = (exponent + 1, exact / 2) if abs(exact) >= 1 else (exponent - 1, exact * 2)
        fraction = int(exact * 2 ** (n - 9)) % (1 << n - 8)
        raw = fraction << 8 | exponent % 256 if n == 32 else \
            fraction >> 16 << 24 | exponent % 256 << 16 | fraction & 0xFFFF
    elif kind in ("BCD", "packedBCD"):
        raw = sum(int(digit) << (8 if kind == "BCD" else 4) * i for i, digit in enumerate(reversed(str(value))))
    elif value >= 0:
        raw = value
    else:
        raw = {"twosComplement": 2 * top + value, "onesComplement": 2 * top - 1 + value,
               "signMagnitude": top - value}[kind]
    if n % 8 == 0:
        raw = int.from_bytes(bytes(raw >> 8 * place & 0xFF for place in order(encoding, n)), "big")
    return int(f"{raw:0{n}b}"[::-1], 2) if encoding.get("bitOrder") == "leastSignificantBitFirst" else raw


def calibrated(calibrator, x):
    """The value of a calibrator, exact up to one rounding at its end; None: it has none."""
    if calibrator.tag == "PolynomialCalibrator":
        return float(sum(Fraction(float(term.get("coefficient"))) * Fraction(x) ** int(term.get("exponent"))
                         for term in calibrator))
    if calibrator.tag == "SplineCalibrator":
        points = sorted((float(point.get("raw")), float(point.get("calibrated"))) for point in calibrator)
        degree = int(calibrator.get("order", "1"))
        if calibrator.get("extrapolate", "false") != "true" and not points[0][0] <= x <= points[-1][0]:
            return None
        below = max((i for i, point in enumerate(points) if point[0] <= x), default=0)
        if degree == 0:
            return points[below][1]
        first = min(below, len(points) - 1 - degree)
        used, sum_ = points[first:first + degree + 1], Fraction(0)
        for a, y in used:
            term = Fraction(y)
            for b, _ in used:
                term *= (Fraction(x) - Fraction(b)) / (Fraction(a) - Fraction(b)) if b != a else 1
            sum_ += term
        return float(sum_)
    stack: list[Any] = []
    for step in calibrator:
        if step.tag == "Operator":
            b, a = stack.pop(), stack.pop()
            stack.append({"+": a + b, "-": a - b, "*": a * b, "max": max(a, b), ">": float(a > b)}[step.text])
        else:
            stack.append(x if step.tag == "ThisParameterOperand" else float(step.text))
    return stack[0]
