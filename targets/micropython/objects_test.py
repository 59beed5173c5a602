# SPDX-License-Identifier: Apache-2.0
"""The objects and units of a script, beside those of the desktop: random assignments to all modules, and random
expressions, in one script that both run. Its lines must be equal: bytes, values, and what is refused.

    FLEDGE_CASES=20000 FLEDGE_SEED=7 /usr/bin/python3 -m pytest targets/micropython/objects_test.py
"""

import os
import struct as packing
import subprocess
from random import Random
from types import SimpleNamespace

import pytest

from fledge import flight, objects, units
from fledge.export import c_source, commands, names
from fledge.export.micropython_tables import emit_tables, visible
from fledge.export.read import Mission, Module
from fledge.export.write import write_files
from fledge.objects.testing import kinds
from fledge.targets import build, micropython_toolchain

CASES, SEED = int(os.environ.get("FLEDGE_CASES", "600")), int(os.environ.get("FLEDGE_SEED", "1"))

PRELUDE = """
def numbers(x):
    if isinstance(x, (list, tuple)):
        return "[" + ", ".join([numbers(y) for y in x]) + "]"
    if isinstance(x, float):
        return bits(x)
    return str(x)


def shown(x):
    if hasattr(x, "dims"):
        return numbers(x.value) + " " + str(x.dims) + " " + str(x).split("]")[-1].split(" ", 1)[-1].strip("0123456789.e-")
    return numbers(x.tolist() if hasattr(x, "tolist") else x)


def tried(function, *arguments):
    try:
        return function(*arguments)
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError, ZeroDivisionError, KeyError):
        return "refused"


def put(x, name, value):
    try:
        setattr(x, name, value())
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError, ZeroDivisionError):
        return "refused"
    return "stored"
"""


@pytest.fixture(scope="module")
def types():
    """All modules and messages by name, and the folder of those of the test."""
    folder, own = kinds()
    return {**flight.TYPES, **own}, folder


@pytest.fixture(scope="module")
def run(types, tmp_path_factory):
    """Runs a script under MicroPython, with all types; returns what it printed."""
    known, kinds_folder = types
    folder = tmp_path_factory.mktemp("objects")
    modules = [Module(names.snake(name), f"flight.{names.snake(name)}", objects.struct(made), objects.memory(made()))
               for name, made in known.items() if objects.struct(made).kind == "module"]
    mission = Mission(name="every", folder="every", process="flight", several=False, about="", modules=modules,
                      configuration=modules, tasks=[], modes=[], mode_titles={}, initial_mode=None, events=[], inputs=[],
                      outputs=[], wires={m.name: [] for m in modules}, published={m.name: [] for m in modules},
                      left_out=[])
    library = micropython_toolchain.library("host", True)
    write_files({"every.h": c_source.header(mission), **commands.emit_commands(mission),
                 "every.c": "".join(f"{line}\n" for line in (
                     '#include "every.h"', *(f"void every_publish_{m.name}(Every *m, int64_t t);\n"
                                             f"void every_publish_{m.name}(Every *m, int64_t t) {{ (void)m; (void)t; }}"
                                             for m in modules),
                     "void every_restart(Every *m, int64_t t) { (void)m; (void)t; }",
                     c_source.parameters(mission))),
                 **emit_tables(mission, "every", False, ["flight"]),
                 "every_frozen.c": micropython_toolchain.freeze({}, library)}, folder)
    roots = [folder, kinds_folder, build.ROOT]
    program = build.program(
        folder / "program", "every",
        [build.ROOT / "targets/micropython/testing/objects.c", *folder.glob("every*.c"),
         *build.module_sources(mission, roots), *build.math_sources(), *(build.ROOT / one for one in build.COMMAND)],
        roots, library.compiler, library.flags, [library.archive, "-no-pie", "-lm"])

    def run(text):
        (folder / "script.py").write_text(PRELUDE + text)
        done = subprocess.run([program, folder / "script.py"], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    return run


def desktop(text, known):
    """The same under CPython."""
    lines = []
    space = {"fsw": SimpleNamespace(**known, PYRAMID=flight.PYRAMID), "memory": lambda x: objects.memory(x).hex(),
             "bits": lambda x: f"{packing.unpack('=Q', packing.pack('=d', x))[0]:016x}",
             "print": lambda *x: lines.append(" ".join(map(str, x))), "nanoseconds": units.nanoseconds,
             "lock": lambda on: 0, "place": lambda x, name: x}
    exec(compile(PRELUDE + text, "script", "exec"), space)
    return lines


HEAD = f"from fledge.units import {', '.join(units.UNITS)}, Quantity, UnitError, nanoseconds\n"


def check(run, known, cases):
    """cases: statements each, which begin with `print(number, ...)`."""
    text = HEAD + "\n".join(cases)
    ours, theirs = run("from fledge import flight as fsw\n" + text), desktop(text, known)
    for a, b in zip(ours, theirs):
        if a != b:
            case = next(c for c in cases if f"print({a.split()[0]}," in c)
            found = [[line for line in lines if line.split()[0] == a.split()[0]] for lines in (ours, theirs)]
            raise AssertionError("\n".join([case, "", "MicroPython:", *found[0], "", "desktop:", *found[1]]))
    assert len(ours) == len(theirs)
    return ours


# --- units -----------------------------------------------------------------------------------------

class Expressions:
    def __init__(self, seed):
        self.dice = Random(seed)

    def real(self, low, high):
        return repr(round(self.dice.uniform(low, high), 4))

    def number(self):
        dice = self.dice
        return dice.choice([lambda: repr(dice.randint(-20, 20)), lambda: self.real(-3, 3),
                            lambda: repr(dice.choice([0.0, 1.0, -2.0, 1e-3, 2.5, 1e9, 0.1]))])()

    def value(self, depth=0):
        if depth < 2 and self.dice.random() < 0.25:
            items = ", ".join(self.value(depth + 1) for _ in range(self.dice.randint(0, 3)))
            return f"[{items}]"
        return self.number()

    def quantity(self, depth):
        dice = self.dice
        if depth == 0:
            return dice.choice([dice.choice(units.UNITS), f"{self.value()} * {dice.choice(units.UNITS)}", "kg * m / s**2",
                                f"{self.number()} * deg", "Quantity(2.5, (1, 0, -1, 0, 0, 0, 0, 1))"])
        a, b = (f"({self.quantity(dice.randint(0, depth - 1))})" for _ in range(2))
        return dice.choice([
            lambda: f"{a} * {b}", lambda: f"{a} / {b}", lambda: f"{a} + {b}", lambda: f"{a} - {b}", lambda: f"{a} + {a}",
            lambda: f"{a} ** {dice.randint(-3, 4)}", lambda: f"-{a}", lambda: f"abs({a})", lambda: f"+{a}",
            lambda: f"{self.value()} * {a}", lambda: f"{self.value()} / {a}", lambda: f"{a} * {self.value()}",
            lambda: f"{a} / {self.value()}", lambda: f"{self.number()} + {a} / {a}", lambda: f"3 - {a} / {a}",
            lambda: f"{a}[{dice.randint(-2, 2)}]", lambda: f"(m**{dice.randint(1, 4)} * s) ** 0.5", lambda: f"[x for x in {a}][0]"])()

    def any(self):
        dice = self.dice
        a, b = f"({self.quantity(2)})", f"({self.quantity(1)})"
        return dice.choice([
            lambda: self.quantity(3), lambda: f"{a}.to({b})", lambda: f"{a}.to({a})", lambda: f"{a} == {b}",
            lambda: f"{a} != {a}", lambda: f"{a} < {b}", lambda: f"{a} >= {a}", lambda: f"float({a})",
            lambda: f"float({a} / {a})", lambda: f"len({a})", lambda: f"bool({a})", lambda: f"nanoseconds({a})",
            lambda: f"nanoseconds({self.number()} * {dice.choice(['s', 'ms', 'us', 'ns', 'minute', 'day', 'm'])})",
            lambda: f"nanoseconds({dice.choice(['0.5e-9', '1.5e-9', '2.5e-9', '1e11', 'True', '3', '9223372036', '[1]'])})",
            lambda: f"{a}.value", lambda: f"{a}.dims"])()


def test_units_have_the_bits_and_dimensions_of_the_desktop(run, types):
    make = Expressions(SEED)
    cases = [f"print({i}, shown(tried(lambda: {make.any()})))" for i in range(CASES)]
    lines = check(run, types[0], cases)
    refused = sum(line.endswith("refused") for line in lines)
    assert CASES / 10 < refused < CASES * 0.8


def test_all_units_are_those_of_the_desktop(run, types):
    cases = [f"print({i}, shown({name}), {name})" for i, name in enumerate(units.UNITS)]
    check(run, types[0], [case.replace(f", {name})", ")") for case, name in zip(cases, units.UNITS)])


# --- assignments -----------------------------------------------------------------------------------

class Assignments(Expressions):
    def __init__(self, seed, known):
        super().__init__(seed)
        self.known = known
        self.modules = [name for name, made in known.items() if objects.struct(made).kind == "module"]

    def unit(self, field):
        return " * ".join(f"{base}**{n}" for base, n in zip(units.BASE, field.dims) if n)

    def element(self, field):
        dice = self.dice
        if field.type == "enum":
            name, number = dice.choice(field.enumerators)
            return dice.choice([repr(name), repr(name.partition("_")[2]), repr(name.rpartition("_")[2]), repr(number),
                                repr(dice.choice(["NO", "good", 99, 1.0, True, None]))])
        if field.type in ("f64", "f32"):
            return dice.choice([self.number, lambda: self.real(0, 5), lambda: self.real(0, 5), lambda:
                                dice.choice(["1e300", "1e-120", "float('nan')", "float('inf')", "True", "'1'", "None"])])()
        bits = min(int(field.type[1:]), 62)
        least, most = (0, 2**bits - 1) if field.type[0] == "u" else (-2**(bits - 1), 2**(bits - 1) - 1)
        return repr(dice.choice([0, 1, 2, 3, dice.randint(0, 9), least, most, least - 1, most + 1,
                                 1.0, 2.5, True, "1", -1]))

    def array(self, field, shape):
        if not shape:
            return self.element(field)
        return "[" + ", ".join(self.array(field, shape[1:]) for _ in range(shape[0])) + "]"

    def plain(self, field):
        """Numbers of a field, with its unit or another."""
        dice, shape = self.dice, list(field.shape)
        if shape and field.count and dice.random() < 0.7:
            shape[0] = dice.randint(1, min(shape[0], 5))
        if dice.random() < 0.2:
            shape = dice.choice([[], [shape[0]] if shape else [2], [3], [3, 3], [2, 3], [0], [1], [2, 0], shape + [1],
                                 [9, 3], [4]])
        elif shape and dice.random() < 0.3:
            shape = []
        if len(shape) == 2 and shape[0] > 8:
            shape[0] = 8
        text = self.array(field, shape) if dice.random() < 0.5 else self.good(field, shape)
        if dice.random() < 0.1:
            text = text.replace("[", "(").replace("]", ",)").replace("(,)", "()")
        unit = self.unit(field)
        if dice.random() < 0.3 and unit and field.type != "enum":
            text = f"{text} * ({unit})"
        elif dice.random() < 0.05:
            text = f"{text} * {dice.choice(units.UNITS)}"
        return text

    def good(self, field, shape):
        if shape:
            return "[" + ", ".join(self.good(field, shape[1:]) for _ in range(shape[0])) + "]"
        if field.type == "enum":
            return repr(self.dice.choice(field.enumerators)[0])
        if field.type in ("f64", "f32"):
            return self.dice.choice([self.real(0, 2), repr(self.dice.randint(1, 5))])
        return repr(self.dice.randint(0, 5))

    def value_of(self, field):
        dice = self.dice
        if dice.random() < 0.04:
            return dice.choice(["None", "'x'", "{}", "[]", "[[]]", "[[1], [2, 3]]", "[[1, 2], 3]", "[None]", "3 * kg",
                                "[1 * m, 2]", "fsw.PYRAMID", "[[[[[1]]]]]", "lambda: 0", "fsw"])
        if field.type == "char":
            return repr(dice.choice(["", "a", "seven77", "eight888", "much too long", 3]))
        if field.type == "struct":
            n = field.shape[0] if field.shape else 0
            n = dice.randint(0, n) if field.count or dice.random() < 0.2 else n
            one = lambda: self.structure(field.struct)
            return "[" + ", ".join(one() for _ in range(n)) + "]" if field.shape else one()
        return self.plain(field)

    def structure(self, struct):
        dice = self.dice
        if struct.name in self.known and dice.random() < 0.3:
            return f"fsw.{struct.name}({self.keywords(struct, 3)})"
        if dice.random() < 0.05:
            return dice.choice(["None", "3", "fsw.NavOrbit()", "{'none': 1}", "[]"])
        fields = [f for f in visible(struct) if dice.random() < 0.4]
        return "{" + ", ".join(f"'{f.name}': {self.value_of(f)}" for f in fields) + "}"

    def keywords(self, struct, most):
        dice = self.dice
        fields = [f for f in visible(struct) if f.group in ("par", "") or dice.random() < 0.1]
        chosen = dice.sample(fields, min(len(fields), dice.randint(0, most)))
        words = [f"{f.name}={self.value_of(f)}" for f in chosen]
        return ", ".join(words + (["nothing=1"] if dice.random() < 0.02 else []))

    def case(self, i):
        """A module is made, changed, and read."""
        dice = self.dice
        name = dice.choice(self.modules)
        struct = objects.struct(self.known[name])
        lines = [f"x = tried(lambda: fsw.{name}({self.keywords(struct, 4)}))",
                 f"print({i}, x == 'refused')", "if x == 'refused':", f"    x = fsw.{name}()"]
        for _ in range(dice.randint(1, 4)):
            path, field = self.path(struct)
            if dice.random() < 0.1 and field.type == "f64" and field.shape and field.group != "par":
                item = "[0]" * len(field.shape)
                lines.append(f"y = x{path}.{field.name}\nif len(y):\n    y{item} = {self.real(-3, 3)}")
                continue
            lines.append(f"print({i}, put(x{path}, '{field.name}', lambda: {self.value_of(field)}))")
            if dice.random() < 0.3 and field.type not in ("struct", "enum"):
                lines.append(f"print({i}, shown(x{path}.{field.name}))")
        lines.append(f"print({i}, memory(x))")
        return "\n".join(lines)

    def path(self, struct):
        """A field of the struct, or of one in it."""
        fields = visible(struct)
        field = self.dice.choice(fields)
        if field.type == "struct" and not field.count and self.dice.random() < 0.8:
            inner, last = self.path(field.struct)
            return f".{field.name}" + (f"[{self.dice.randrange(field.shape[0])}]" if field.shape else "") + inner, last
        return "", field


def test_assignments_have_the_bytes_and_refusals_of_the_desktop(run, types):
    known = types[0]
    make = Assignments(SEED, known)
    lines = check(run, known, [make.case(i) for i in range(CASES)])
    stored = sum(line.endswith("stored") for line in lines)
    refused = sum(line.endswith("refused") for line in lines)
    assert stored > CASES / 2 and refused > CASES / 4
