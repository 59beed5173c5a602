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
from fledge.targets.micropython.export.tables import emit_tables, visible
from fledge.export.read import Mission, Module
from fledge.disk import write_files
from fledge.objects.testing import kinds
from fledge.targets import build
from fledge.targets.micropython import toolchain

pytestmark = pytest.mark.long("builds MicroPython with the sanitizers: half a minute")

# Macros of MicroPython shift negative numbers, and its exceptions leave frames on the stack without a word.
SANITIZE = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", "-fno-sanitize=shift-base",
            "--param", "asan-stack=0"]
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
        unit = str(x).split("]")[-1].split(" ", 1)[-1].strip("0123456789.e-")
        return numbers(x.value) + " " + str(x.dims) + " " + unit
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
    modules = [Module(names.snake(name), f"flight.{names.snake(name)}", objects.struct(type_), objects.memory(type_()))
               for name, type_ in known.items() if objects.struct(type_).kind == "module"]
    mission = Mission(name="every", folder="every", process="flight", several=False, about="", modules=modules,
                      configuration=modules, tasks=[], modes=[], mode_titles={}, initial_mode=None, events=[],
                      inputs=[], outputs=[], wires={m.name: [] for m in modules},
                      published={m.name: [] for m in modules}, left_out=[])
    library = toolchain.library("host", True)
    write_files({"every.h": c_source.header(mission), **commands.emit_commands(mission),
                 "every.c": "".join(f"{line}\n" for line in (
                     '#include "every.h"', *(f"void every_publish_{m.name}(Every *m, int64_t t);\n"
                                             f"void every_publish_{m.name}(Every *m, int64_t t) {{ (void)m; (void)t; }}"
                                             for m in modules),
                     "void every_restart(Every *m, int64_t t) { (void)m; (void)t; }",
                     c_source.parameters(mission))),
                 **emit_tables(mission, "every", False, ["flight"]),
                 "every_frozen.c": toolchain.freeze({}, library)}, folder)
    roots = [folder, kinds_folder, build.ROOT]
    program = build.program(
        folder / "program", "every",
        [build.ROOT / "targets/micropython/testing/objects.c", *toolchain.PORT.glob("*.c"),
         *folder.glob("every*.c"),
         *build.module_sources(mission, roots), *build.math_sources(), *(build.ROOT / path for path in build.COMMAND)],
        roots, library.compiler, [*library.flags, "-std=gnu99", *SANITIZE],
        [*SANITIZE, library.archive, "-no-pie", "-lm"])

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
    ours, theirs = [], []
    for first in range(0, len(cases), 200):     # the interpreter reads a long script slowly
        text = HEAD + "\n".join(cases[first:first + 200])
        ours += run("from fledge import flight as fsw\n" + text)
        theirs += desktop(text, known)
    for a, b in zip(ours, theirs):
        if a != b:
            case = next(c for c in cases if f"print({a.split()[0]}," in c)
            matches = [[line for line in lines if line.split()[0] == a.split()[0]] for lines in (ours, theirs)]
            raise AssertionError("\n".join([case, "", "MicroPython:", *matches[0], "", "desktop:", *matches[1]]))
    assert len(ours) == len(theirs)
    return ours


# --- units -----------------------------------------------------------------------------------------

class Expressions:
    def __init__(self, seed):
        self.dice = Random(seed)

    def real(self, low, high):
        return repr(self.dice.uniform(low, high))

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
            unit = dice.choice(units.UNITS)
            return dice.choice([unit, f"{self.value()} * {unit}", "kg * m / s**2", f"{self.number()} * deg",
                                "Quantity(2.5, (1, 0, -1, 0, 0, 0, 0, 1))"])
        a, b = (f"({self.quantity(dice.randint(0, depth - 1))})" for _ in range(2))
        return dice.choice([
            lambda: f"{a} * {b}", lambda: f"{a} / {b}", lambda: f"{a} + {b}", lambda: f"{a} - {b}",
            lambda: f"{a} + {a}",
            lambda: f"{a} ** {dice.randint(-3, 4)}", lambda: f"-{a}", lambda: f"abs({a})", lambda: f"+{a}",
            lambda: f"{self.value()} * {a}", lambda: f"{self.value()} / {a}", lambda: f"{a} * {self.value()}",
            lambda: f"{a} / {self.value()}", lambda: f"{self.number()} + {a} / {a}", lambda: f"3 - {a} / {a}",
            lambda: f"{a}[{dice.randint(-2, 2)}]", lambda: f"(m**{dice.randint(1, 4)} * s) ** 0.5",
            lambda: f"[x for x in {a}][0]"])()

    def any(self):
        dice = self.dice
        a, b = f"({self.quantity(2)})", f"({self.quantity(1)})"
        return dice.choice([
            lambda: self.quantity(3), lambda: f"{a}.to({b})", lambda: f"{a}.to({a})", lambda: f"{a} == {b}",
            lambda: f"{a} != {a}", lambda: f"{a} < {b}", lambda: f"{a} >= {a}", lambda: f"float({a})",
            lambda: f"float({a} / {a})", lambda: f"len({a})", lambda: f"bool({a})", lambda: f"nanoseconds({a})",
            lambda: f"nanoseconds({self.number()} * {dice.choice(['s', 'ms', 'us', 'ns', 'minute', 'day', 'm'])})",
            lambda: f"nanoseconds({dice.choice(['0.5e-9', '1.5e-9', '2.5e-9', '1e11', 'True', '9223372036', '[1]'])})",
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
        self.modules = [name for name, type_ in known.items() if objects.struct(type_).kind == "module"]

    def unit(self, field):
        return " * ".join(f"{base}**{n}" for base, n in zip(units.BASE, field.dims) if n)

    def element(self, field):
        dice = self.dice
        if field.type == "enum":
            name, number = dice.choice(field.enumerators)
            return dice.choice([repr(name), repr(name.partition("_")[2]), repr(name.rpartition("_")[2]), repr(number),
                                repr(dice.choice(["NO", "good", 99, 1.0, True, None]))])
        if field.type in ("f64", "f32"):
            odd = ["1e300", "1e-120", "float('nan')", "float('inf')", "True", "'1'", "None"]
            return dice.choice([self.number, lambda: self.real(0, 5), lambda: self.real(0, 5),
                                lambda: dice.choice(odd)])()
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
        elif shape and shape[0] > 256:      # the interpreter's stack has no room for a longer list in a script
            shape[0] = 256
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
            def element(): return self.structure(field.struct)
            return "[" + ", ".join(element() for _ in range(n)) + "]" if field.shape else element()
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


def test_a_refusal_has_the_words_of_the_desktop(run, types):
    statements = [f"x = fsw.{line}" for line in (
        "MrpFeedback(K='high')", "MrpFeedback(P=[1, 2])", "WheelConfig(axes_B=[[1, 2]])", "WheelConfig(J=[])",
        "WheelConfig(n=-1)", "Noise(level=256)", "Noise(wide=[0, 1.5])", "Noise(counts=[70000, 0])", "Noise(part=[])",
        "Noise(parts=[{}])", "Noise(phases=['SAFE'])")]
    text = HEAD + "".join(f"try:\n    {statement}\nexcept ValueError as e:\n    print(str(e).split('; found')[0])\n"
                          for statement in statements)
    here, there = desktop(text, types[0]), run("from fledge import flight as fsw\n" + text)
    assert there[:-1] == here[:-1] and len(here) == len(statements)
    assert there[-1].startswith(here[-1])   # that of an enumeration names its enumerators, too


# --- what the desktop has no equal of ----------------------------------------------------------------

def errors(run, *statements):
    """The text of each statement's error."""
    text = "from fledge import flight as fsw, world, Orbit, SetupError\nimport fledge\n" + HEAD + """
a = place(fsw.TrackingError(sigma_BcB=[0, 0, 1]), "tracking_error")
b = place(fsw.MrpFeedback(K=1, P=2), "mrp_feedback")
c = fsw.WheelConfig()
"""
    for statement in statements:
        text += (f"try:\n    {statement}\n    print('no error')\n"
                 "except Exception as e:\n    print(type(e).__name__ + ': ' + str(e))\n")
    return run(text)


def test_errors_name_the_place_and_what_is_allowed(run):
    messages = errors(
        run, "b.K = 'high'", "b.K = -2 * N * m", "b.K = 3 * kg", "b.gain = 1", "b.K2", "fsw.MrpFeedback(1)",
        "fsw.MrpFeedback(gain=1)", "b.error.head.quality = 'BEST'", "c.J = 1", "c.axes_B = [[1, 2]]",
        "b.torque.torque_B = [1, 2, 3]", "b.torque.torque_B[0] = 1", "place(b, 'mrp_feedback')",
        "place(fsw.WheelConfig(), 'mrp_feedback')", "fsw.Unknown", "from fledge.units import furlong",
        "b.wheels.axes_B[9]", "b.P[0][1] = 'x'", "del b.K", "b.P[0:2] = [1]")
    assert messages[:4] == [
        "SetupError: flight.mrp_feedback.K: expected a number, in N m; found 'high'",
        "SetupError: flight.mrp_feedback.K must be 0 or of size 1e-100 to 1e100, > 0 N m, found -2.0",
        "SetupError: flight.mrp_feedback.K: expected a quantity in N m; found 3.0 kg",
        "AttributeError: flight.mrp_feedback has no attribute 'gain'; parameters: K, P, K_I, u_I_max, hold; inputs: "
        "error, vehicle, wheels, speeds, external; outputs: torque; memory: z, sigma_BR, newest, running"]
    starts = ["AttributeError: flight.mrp_feedback has no attribute 'K2'", "TypeError: MrpFeedback takes keywords only",
              "TypeError: MrpFeedback has no attribute 'gain'",
              "SetupError: flight.mrp_feedback.error.head.quality: expected QUALITY_NONE, ",
              "SetupError: WheelConfig.J: one number fills the rows that count, and there are none yet; set n",
              "SetupError: WheelConfig.axes_B: expected shape (n <= 8, 3); found [[1, 2]]",
              "SetupError: flight.mrp_feedback.torque.torque_B is in an output",
              "SetupError: flight.mrp_feedback.torque.torque_B is in an output",
              "SetupError: flight.mrp_feedback: this module is flight.mrp_feedback already",
              "SetupError: flight.mrp_feedback: on the desktop it is a MrpFeedback; found a WheelConfig",
              "AttributeError: fledge.flight has no 'Unknown' on this target; there are ArrayDriveCommandChoice, "
              "ArrayPointing, AttitudeMekf, ",
              "ImportError: fledge.units has no unit 'furlong'; the units are m, km, ",
              "IndexError: ", "SetupError: flight.mrp_feedback.P: expected ",
              "AttributeError: flight.mrp_feedback.K cannot be deleted", "SetupError: expected 2 items, or one number"]
    assert len(messages) == 4 + len(starts)
    for text, start in zip(messages[4:], starts):
        assert text.startswith(start), text


def test_wires_join_an_output_to_inputs_of_its_type(run):
    messages = errors(
        run, "print(a.error >> b.error)", "print((a.error >> [b.error, world.x.y]).latency(1).stale_after(2 * s))",
        "a.error >> b", "a.error >> b.vehicle", "b.error >> b.error", "a.error >> a.error", "a.error >> 3",
        "a.error.head >> b.error", "a >> b.error", "(a.error >> b.error) >> b.error",
        "(a.error >> b.error).latency(2)", "(a.error >> b.error).stale_after(2 * m)",
        "fsw.AttError() >> b.error")
    assert messages[:4] == ["flight.tracking_error.error >> flight.mrp_feedback.error", "no error"] * 2
    starts = ["SetupError: flight.tracking_error.error >> flight.mrp_feedback: name an input, not the module; it has "
              "the inputs error, vehicle, wheels, speeds, external",
              "SetupError: flight.tracking_error.error >> flight.mrp_feedback.vehicle: the output is AttError, the "
              "input takes VehicleData",
              "SetupError: flight.mrp_feedback.error >> flight.mrp_feedback.error: flight.mrp_feedback.error is no "
              "output; flight.mrp_feedback has the outputs torque",
              "SetupError: flight.tracking_error.error >> flight.tracking_error.error: flight.tracking_error.error is "
              "no input; ", "SetupError: flight.tracking_error.error >> 3: expected an input or a list of inputs",
              "SetupError: flight.tracking_error.error.head >> flight.mrp_feedback.error: "
              "flight.tracking_error.error.head is no output", "TypeError: ", "TypeError: ",
              "SetupError: flight.tracking_error.error >> flight.mrp_feedback.error: latency must be 0 or 1",
              "SetupError: stale_after: expected a time, found 2.0 m", ""]
    for text, start in zip(messages[4:], starts):
        assert text.startswith(start) and text != "no error", text


def test_what_stands_in_for_the_world_accepts_all_and_allocates_nothing(run):
    messages = errors(
        run, "w = fledge.anything", "w.wheels = world.ReactionWheels(axes_B=c.axes_B, J=2 * kg)",
        "w.craft = Orbit(world.MARS, a=7471 * km, f=270 * deg)",
        "w.connect(w.craft.state >> a.attitude, b.torque >> w.craft.torque, w.x >> [b.error])",
        "print([x for x in w.list], len(w), -w * 3 * m + 2 - w[3] is w, 3 * m / w is w, [2] * w is w)",
        "b.K = w.gain", "b.P = [w, w, w]", "b.P[0][0] = w", "b.error = w", "fsw.RasterManager(angles=[[w, 0, 0]])",
        "used = lock(True)\n    for i in range(100):\n        w.task(w.a[3], run=w.b >> w.c)\n"
        "    print(lock(False) - used)")
    assert messages[:3] == ["no error"] * 3 and messages[3] == "no error"
    assert messages[4:6] == ["[] 0 True True True", "no error"]
    for text in messages[6:11]:
        assert "a value of the world or of another process is not known on the target" in text
    assert messages[11:] == ["0", "no error"]


def test_attributes_and_items_allocate_nothing_under_the_lock(run):
    result = run("""
from fledge import flight as fsw
a, b = place(fsw.TrackingError(), "tracking_error"), place(fsw.MrpFeedback(K=1, P=2), "mrp_feedback")
w = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=1)
def loop():
    for i in range(3):
        b.error.sigma_BR[i] = b.K * b.P[i][i] + len(w.axes_B)
        b.error.head.t = i
        b.K = 2.5 + i
        b.z = a.sigma_BcB
        w.J[i] = w.axes_B[i][2] * w.axes_B[i][2] + w.n
        w.axes_B[i][0] = 0.25
    total = 0.0
    for x in w.J:
        total += x
    for row in w.axes_B:
        total += row[0]
    return total
loop()
used = lock(True)
for i in range(50):
    loop()
print(lock(False) - used, loop())
lock(True)
try:
    b.K = -1
except Exception as e:
    lock(False)
    print(e)
""")
    assert result == ["0 14.75", "flight.mrp_feedback.K must be 0 or of size 1e-100 to 1e100, > 0 N m, found -1.0"]


def test_rules_hold_for_elements_and_a_missing_parameter_is_named(run):
    messages = errors(
        run, "w = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=1)", "w.J[1] = -1", "print(w.J)", "w.reset()",
        "fsw.WheelConfig(J=[1]).reset()", "print(w)")
    assert messages[0] == "no error" and messages[1].startswith("SetupError: WheelConfig.J must be ")
    assert messages[1].endswith("found -1.0 at [1]")
    assert messages[2:5] == ["[1.0, 1.0, 1.0, 1.0]", "no error", "no error"]
    assert messages[5] == "SetupError: WheelConfig.axes_B is required"
    assert messages[6].startswith("WheelConfig(wheels=WheelSet, n=4, axes_B=[[-0.5, 0.5, -0.70710")


def test_a_field_in_any_unit_takes_one_on_both(run, types):
    values = ["[1, 2, 3, 4] * W", "[1 * N, 2, 3 * m, 4]", "2 * kg * [1, 2, 3, 4]", "[1, 2] * W", "3 * W"]
    cases = [f"x = fsw.FlightEvent()\nprint({i}, put(x, 'arguments', lambda: {value}), memory(x))"
             for i, value in enumerate(values)]
    lines = check(run, types[0], cases)
    assert [line.split()[1] for line in lines] == ["stored"] * 3 + ["refused"] * 2
