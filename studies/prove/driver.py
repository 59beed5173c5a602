# SPDX-License-Identifier: Apache-2.0
"""The driver of a module in C: the program that calls it as an executive may, with all that its header allows.

    parameters  each within its bounds, any others again before each update (`initial` ones but at the start)
    inputs      any bits; or, as `declared`: numbers within their ranges or bounds, else finite, counts that fit their
                arrays, enumerators; in both, a head is one that an executive writes: a Quality, any time, any sequence
    arrays      rows that do not count are any bits; each number of rows is analysed by itself (Eva's `split`)
    calls       a reset, then any number of updates, and of resets between them
    ticks       0 <= t and 0 <= dt, up to 73 years

Between updates the module's memory and outputs persist. After each, the numbers of an output that is GOOD are finite.
"""
from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

from introspect.model import Field, Group, Struct, Type

LARGEST = 1.7976931348623157e308
COMPUTABLE = 1e100          # exec_computable() of flight/exec/bounds.h: no parameter is larger, or smaller but 0


def write(module: Struct, declared: bool) -> str:
    """The source of the driver: its main() is the entrance."""
    parts = Parts(declared, rows=True)
    par = [f for f in module.fields if f.group is Group.PAR]
    ports = [f for f in module.fields if f.group is Group.IN]
    name, snake = module.name, module.snake_name
    start = [*parts.draw(par, "m.", parameter=True)]
    again = [*parts.draw([f for f in par if "initial" not in f.clauses], "m.", parameter=True)]
    inputs = []
    merged = [f"m.{f.path}" for f in par if f.name in _counts(par) and "initial" not in f.clauses]
    for port in ports:
        inputs.append(f"any_bits(&m.in.{port.name}, sizeof m.in.{port.name});")
        inputs += parts.fields(port, f"m.in.{port.name}")
        members = port.struct.fields if port.struct else ()
        inputs += [line for f in members for line in _split(f, f"m.in.{port.name}.{f.name}", _counts(members))]
        merged += [f"m.in.{port.name}.{f.name}" for f in members if f.name in _counts(members)]
    checks = [line for port in module.fields if port.group is Group.OUT for line in _checks(port)]
    body = [*start, f"{snake}_reset(&m);", "while (any) {",
            *(f"    {line}" for line in (*again, *inputs)),
            "    if (any) {", f"        {snake}_reset(&m);", "    }",
            "    const Tick tick = {.t = any_integer(0, PROVE_TIME), .dt = any_integer(0, PROVE_TIME)};",
            f"    {snake}_update(&m, tick);", "    Frama_C_show_each_returned();",
            *(f"    {line}" for line in checks), *(f"    /*@ merge {place}; */" for place in merged), "    ;", "}"]
    return "\n".join([
        f"/* {name}: any parameters, inputs, resets and updates. Written by `fledge prove`. */",
        f'#include "{module.header}"', "", f"static {name} m;", "",
        *parts.functions,
        "void main(void)", "{", *(f"    {line}" for line in body), "}", ""])


class Parts:
    """The functions that draw a struct, each once."""

    def __init__(self, declared: bool, rows: bool = False) -> None:
        """rows: those that do not count are any bits, else as those that do."""
        self.declared, self.rows = declared, rows
        self.functions: list[str] = []
        self._written: dict[tuple[str, bool], bool] = {}

    def draw(self, fields: list[Field], to: str, parameter: bool = False) -> Iterator[str]:
        """Statements that give each field any value that it may have; counts come before the arrays that they count."""
        counts = _counts(fields)
        for f in sorted(fields, key=lambda f: f.name not in counts):
            place = f"{to}{f.path}"
            if not f.is_spare and (parameter or self.declared):
                rows = f"{place.removesuffix(f.name)}{f.count}" if f.count and self.rows else ""
                if rows:
                    yield f"any_bits(&{place}, sizeof {place});"
                yield from self._value(f, place, parameter, None if parameter else counts.get(f.name), rows)
            if parameter and self.rows:
                yield from _split(f, place, counts)

    def fields(self, f: Field, place: str, parameter: bool = False) -> list[str]:
        """Statements for a field of a struct, or for each of an array; none where all bits are allowed."""
        assert f.struct
        if not (function := self._function(f.struct, parameter)):
            return []
        lines = [f"{function}(&{place}{''.join(f'[i{k}]' for k in range(len(f.shape)))});"]
        for k in reversed(range(len(f.shape))):
            lines = [f"/*@ loop unroll {f.shape[k]}; */",
                     f"for (size_t i{k} = 0u; i{k} < {f.shape[k]}u; i{k}++) {{", *("    " + s for s in lines), "}"]
        return lines

    def _function(self, struct: Struct, parameter: bool) -> str:
        """The name of the function that draws a struct; empty where all bits are allowed."""
        name = f"any_{struct.name}" + "_parameter" * parameter
        if (struct.name, parameter) not in self._written:
            if struct.name == "Head":
                lines = ["x->quality = (Quality)any_integer(QUALITY_NONE, QUALITY_GOOD);"]
            else:
                lines = [*self.draw(list(struct.fields), "x->", parameter)]
                if not parameter and not self.declared and struct.fields and struct.fields[0].name == "head":
                    lines = self.fields(struct.fields[0], "x->head")
            self._written[struct.name, parameter] = bool(lines)
            if lines:
                self.functions += [f"static void {name}({struct.name} *x)", "{", *("    " + s for s in lines), "}", ""]
        return name if self._written[struct.name, parameter] else ""

    def _value(self, f: Field, place: str, parameter: bool, most_rows: int | None, rows: str) -> Iterator[str]:
        """most_rows: where the field counts those of an array; rows: how many of this array count, if not all."""
        if f.struct:
            yield from self.fields(f, place, parameter)
            return
        n = f"{math.prod(f.shape[1:])}u * {rows}" if rows else f"{math.prod(f.shape)}u"
        if f.type in (Type.F64, Type.F32):
            lo, hi = floats(f, parameter)
            if f.type is Type.F64:
                yield f"any_numbers((double *)&{place}, {n}, {lo!r}, {hi!r});" if f.shape else \
                    f"{place} = any_number({lo!r}, {hi!r});"
            else:
                lo, hi = max(lo, -3.4028234e38), min(hi, 3.4028234e38)
                yield from _each(f, place, rows, f"(float)any_number({lo!r}, {hi!r})")
        elif f.type is Type.ENUM:
            assert f.enum
            values = [e.value for e in f.enum.values]
            yield from _each(f, place, rows, f"({f.ctype})any_integer({min(values)}, {max(values)})")
        elif f.type.is_integer:
            bits = 8 * f.element_size
            least, most = (0, 2**bits - 1) if f.type.is_unsigned else (-2**(bits - 1), 2**(bits - 1) - 1)
            lo, hi = integers(f, least, most, most_rows)
            if (lo, hi) != (least, most) or parameter:
                kind = "unsigned" if f.type.is_unsigned else "integer"
                low = f"{lo}u" if f.type.is_unsigned else f"(int64_t)({lo + 1} - 1)" if lo == -2**63 else f"{lo}"
                high = f"{hi}u" if f.type.is_unsigned else f"{hi}"
                yield from _each(f, place, rows, f"({f.ctype})any_{kind}({low}, {high})")
        elif parameter:
            yield f"any_bits({place}, sizeof {place});"


def _each(f: Field, place: str, rows: str, value: str) -> Iterator[str]:
    for k, n in enumerate(f.shape):
        yield f"/*@ loop unroll {n}; */"
        yield f"for (size_t i{k} = 0u; i{k} < {rows if rows and k == 0 else f'{n}u'}; i{k}++)"
    yield f"{place}{''.join(f'[i{k}]' for k in range(len(f.shape)))} = {value};"


def _counts(fields: Sequence[Field]) -> dict[str, int]:
    """How many rows the arrays have that a field counts, by its name."""
    return {f.count: f.shape[0] for f in fields if f.count}


def _split(f: Field, place: str, counts: dict[str, int]) -> list[str]:
    """Statements that let the analyser go on with each number of rows by itself."""
    if f.name not in counts:
        return []
    return [f"if ({place} <= {counts[f.name]}u) {{", f"    /*@ split {place}; */", "    ;", "}"]


def floats(f: Field, parameter: bool) -> tuple[float, float]:
    most = COMPUTABLE if parameter else LARGEST
    lo, hi = -most, most
    for b in (f.bounds, f.range):
        if b and b.lo is not None:
            lo = max(lo, math.nextafter(b.lo, math.inf) if b.lo_open else b.lo)
        if b and b.hi is not None:
            hi = min(hi, math.nextafter(b.hi, -math.inf) if b.hi_open else b.hi)
    if parameter and 0.0 < lo < 1 / COMPUTABLE:
        lo = 1 / COMPUTABLE
    return lo, hi


def integers(f: Field, least: int, most: int, rows: int | None) -> tuple[int, int]:
    """rows: of the arrays that the field counts."""
    if rows is not None:
        most = min(most, rows)
    for b in (f.bounds, f.range):
        if b and b.lo is not None:
            least = max(least, math.floor(b.lo) + 1 if b.lo_open else math.ceil(b.lo))
        if b and b.hi is not None:
            most = min(most, math.ceil(b.hi) - 1 if b.hi_open else math.floor(b.hi))
    if "non-zero" in f.clauses and least == 0:
        least = 1
    return least, most


def _checks(port: Field) -> Iterator[str]:
    """That an output has a Quality, and that its numbers are finite while it is GOOD."""
    assert port.struct
    lines = [line for f in port.struct.fields for line in _finite(f, f"m.out.{port.name}.{f.name}", 0)]
    yield f"/*@ assert quality: m.out.{port.name}.head.quality <= QUALITY_GOOD; */"
    if lines:
        yield f"if (m.out.{port.name}.head.quality == QUALITY_GOOD) {{"
        yield from ("    " + line for line in lines)
        yield "}"


def _finite(f: Field, place: str, depth: int) -> Iterator[str]:
    """A loop reads all elements of an array at once: whether one may be not finite is all that counts."""
    if f.type not in (Type.F64, Type.F32, Type.STRUCT):
        return
    inner: list[str] = []
    if f.struct:
        index = "".join(f"[i{depth + k}]" for k in range(len(f.shape)))
        inner = [line for g in f.struct.fields
                 for line in _finite(g, f"{place}{index}.{g.name}", depth + len(f.shape))]
        for k in reversed(range(len(f.shape))) if inner else ():
            inner = [f"for (size_t i{depth + k} = 0u; i{depth + k} < {f.shape[k]}u; i{depth + k}++) {{",
                     *("    " + line for line in inner), "}"]
    else:
        number = "double" if f.type is Type.F64 else "float"
        name = re.sub(r"\[i\d+\]", "", place).removeprefix("m.").replace(".", "__")
        inner = [f"const {number} {name} = ((const {number} *)&{place})[i{depth}];",
                 f"/*@ assert \\is_finite({name}); */"]
        inner = [f"for (size_t i{depth} = 0u; i{depth} < {math.prod(f.shape)}u; i{depth}++) {{",
                 *("    " + line for line in inner), "}"]
    yield from inner
