# SPDX-License-Identifier: Apache-2.0
"""Procedures that mean harm: made of a grammar, and bytecode with changed bytes. Flight goes on, with the bits that it
has without them. FLEDGE_CASES=10000 tries as many; FLEDGE_SEED begins elsewhere."""
import os
import random
from threading import Timer

import pytest

from fledge.commands import Reason
from fledge.errors import Failure
from fledge.targets.micropython import toolchain
from targets.micropython.procedure_test import Flying, flight, programs  # noqa: F401

CASES, SEED = int(os.environ.get("FLEDGE_CASES", "250")), int(os.environ.get("FLEDGE_SEED", "1"))
PLACES = 10             # of what a procedure keeps
ANSWER = 20             # [s] that flight may take for one instant

NUMBERS = [
    '0', '1', '-1', '2', '7', '255', '-2**40', '2**62', '10**12', '1.5', '-0.0', '1e308', '1e308 * 10',
    '1e999 - 1e999', 'True', 'None', '...',
]
TEXTS = [
    "''", "'a'", "'ab' * 200", "b'xyz'", "'%s %r %d'", "'{} {0!r:>9}'", "'%*d'", "'__class__'", "b'\\x00\\x80'",
]
MADE = [
    '[]', '[1, 2, 3]', '[3, 1, 2] * 9', '()', "(1, 'a')", '{}', '{1: 2}', "{'a': []}", '{1, 2}', 'set()', 'range(5)',
    'range(10**12)', 'bytearray(9)', 'memoryview(bytearray(9))', "array.array('d', [1, 2])", 'slice(1, 9, 2)',
    'lambda *a, **k: act(0)', 'H()', 'H(1)', 'L()', "E('x')", 'g()', 'object()', 'f', 'f.control',
    'f.spin.reference.sigma_RN', 'f.spin.reference', 'm', '2 * m', '[1, [2]] * m', 'math.pi', 'ValueError(H())',
    'super', 'property(lambda o: act(1))', 'staticmethod(act)', 'iter([1, 2])', 'enumerate(G)', 'zip(G, G)',
    'map(str, G)', 'reversed(G)', "array.array('d', b'\\xff' * 16)", 'bytes(5)', 'G', 'act', 'next', 'type',
]
TYPES = [
    'int', 'float', 'str', 'bytes', 'list', 'tuple', 'dict', 'set', 'object', 'type', 'H', 'L', 'E', 'T', 'bytearray',
    'memoryview', 'range', 'slice', 'Exception', 'property', 'super', 'map', 'filter', 'zip', 'enumerate', 'reversed',
    'array.array', 'type(g())', 'type(act)', 'type(m)', 'type(f)', 'type(f.control)', 'bool', 'StopIteration',
]
CALLED = """
    print repr str hash len sorted sum min max list tuple set dict iter next all any abs bool int float bytes
    bytearray memoryview enumerate id reversed type callable dir chr ord bin hex round divmod pow isinstance
    issubclass getattr hasattr setattr delattr map filter zip range slice norm max_abs array.array super
    __build_class__ math.sqrt math.floor globals locals f.enter object.__new__ int.from_bytes int.to_bytes
    str.format list.append dict.update tuple.index
""".split()
METHODS = """
    append extend pop insert remove sort reverse clear copy count index update add discard get setdefault popitem
    keys values items format join split find replace strip encode decode startswith upper partition center send
    throw close union intersection difference issubset symmetric_difference_update to_bytes from_bytes __init__
    __new__ __class__ __next__ __call__ __setattr__ __getattr__ getter setter norm tolist update reset publish held
    enter args value __name__ __dict__ __bases__ __traceback__ rsplit isdigit rindex lower fromkeys isdisjoint
""".split()
SPECIAL = """
    __eq__ __lt__ __hash__ __len__ __bool__ __getitem__ __setitem__ __iter__ __next__ __call__ __repr__ __str__
    __add__ __radd__ __contains__ __getattr__ __setattr__ __del__ __int__ __float__ __enter__ __exit__ __get__
    __set__ __new__ __init__ __delattr__ __mul__ __neg__ __abs__ __iadd__ __delitem__ __gt__ __le__ keys
""".split()
OPERATORS = ["not in", *"+ - * / // % ** << >> & | ^ == != < >= in is and or + * == <".split()]
# What crashed or hung an interpreter that trusts its scripts. A line with @ may stand in a `try`.
WHOLE = """
a = []
a.append(a)
b = [a]
a.append(b)
@a == b

a = []
a.append(a)
@raise ValueError(a)

a = []
a.append(a)
@print(a)

t = (1,)
for i in range(45): t = (t, t)
@print(hash(t))

t = [1]
for i in range(45): t = [t, t]
@print(t)

t = u = [1]
for i in range(45): t, u = [t, t], [u, u]
@t == u

d = e = {}
for i in range(45): d, e = {0: d, 1: d}, {0: e, 1: e}
@d == e

t = [1]
for i in range(45): t = [t, t]
@raise KeyError(t)

@G[0] = [A(), A(), A(), A(), A(), A()]
@G[0].sort()

@G[0] = [A()] * 40
@G[0].count(3)

@G[0] = [A()] * 40
@G[0].index(3)

@G[0] = [A()] * 40
@G[0] == [A()] * 40

@G[0] = [3] * 40
@G[0].remove(A())

@G[0] = {A(): 1, 2: 3}
@G[0][A()]

@G[0] = {A(), 1, 2}
@A() in G[0]

@[1, 2].sort(key=lambda x: G.clear())

class C: pass
c = C()
C.__call__ = c
@c()

class C: pass
for i in range(40):
    class D(C, C): pass
    C = D
@C().nothing

class C: pass
for i in range(40):
    class D(C, C): pass
    C = D
@isinstance(C(), list)

@array.array('O', b'\\x08' * 8)[0]

@array.array('S', b'\\x08' * 8)[0]

@print(array.array('d', b'\\xff\\x7f' * 8))

@array.array('d', A())

@act(*A(), *[1] * 30)

@act(*iter(range(10)), *[1] * 20)

class C(Exception):
    def __init__(s): raise s
@C()

class C(tuple):
    def __init__(s): (1,) == s
@C()

class C(list):
    def h(s):
        s = 5
        super().append(1)
@C().h()

class C(list):
    @classmethod
    def h(c): super().append(1)
@C.h()

@__build_class__(lambda: 5, 'C')

@type('C', (list,), {}).pop(f)

@list.__dict__['append'](5, 1)

@property.getter(5, 6)

@int.to_bytes('x', 3, 'big')

@('a' * 5000 + 'b').find('a' * 2500 + 'c')

@[] * 10**12

@'' * 2**62

@[1, 2, 3, 4] * 2**62

@(1, 2) * 2**63

@'abcd' * 2**62

s = set()
for i in range(9999): s.add(i)

@G[0] = bytearray(8)
v = memoryview(G[0])
@G[0].extend(bytes(500))
for i in range(8): v[i] = 255

for x in range(3):
    try:
        break
    except: pass
@print(x)

def h():
    try: pass
    finally:
        for x in [1, 2]: return x
@h()
""".strip().split("\n\n")


class Hostile:
    """Writes procedures."""

    def __init__(self, seed):
        self.random = random.Random(seed)

    def any(self, words):
        return self.random.choice(words)

    def value(self, depth=0):
        """An expression."""
        kind = self.random.random()
        if depth > 2 or kind < 0.35:
            return f"G[{self.random.randrange(PLACES)}]"
        if kind < 0.55:
            return self.any(self.any([NUMBERS, TEXTS, MADE, MADE]))
        if kind < 0.65:
            return f"({self.value(depth + 1)} {self.any(OPERATORS)} {self.value(depth + 1)})"
        if kind < 0.75:
            return f"{self.any(CALLED)}({self.arguments(depth)})"
        if kind < 0.85:
            return f"{self.value(depth + 1)}.{self.any(METHODS)}({self.arguments(depth)})"
        if kind < 0.9:
            return f"{self.any(TYPES)}({self.arguments(depth)})"
        return self.any([f"{self.value(depth + 1)}[{self.value(depth + 1)}]", f"-{self.value(depth + 1)}",
                         f"[{self.value(depth + 1)}, {self.value(depth + 1)}]", f"({self.value(depth + 1)},)",
                         f"{{{self.value(depth + 1)}: {self.value(depth + 1)}}}", f"not {self.value(depth + 1)}",
                         f"[{self.value(depth + 1)} for x in {self.value(depth + 1)}]",
                         f"{self.value(depth + 1)}[{self.any(NUMBERS)}:{self.value(depth + 1)}]",
                         f"{self.any(TYPES)}.{self.any(METHODS)}", f"type('C', ({self.any(TYPES)},), {{}})",
                         f"(yield_ for yield_ in {self.value(depth + 1)})", f"{{{self.value(depth + 1)}}}"])

    def arguments(self, depth):
        stars = self.any(["", "", "", "", "", "", "*", "**"])
        values = [self.value(depth + 1) for _ in range(self.any([0, 1, 1, 1, 2, 2, 3]))]
        return ", ".join(values[:-1] + [stars + values[-1]] if values else values) + self.any(
            ["", "", "", "", ", key=act", ", reverse=True"] if values and stars != "**" else [""])

    def statement(self):
        g = f"G[{self.random.randrange(PLACES)}]"
        return self.any([
            f"{g} = {self.value()}", f"{g} = {self.value()}", f"{self.value()}", f"{g}.append({g})", f"del {g}",
            f"{g} {self.any(['+', '-', '*', '|'])}= {self.value()}", f"{g}[{self.value()}] = {self.value()}",
            f"for x in {self.value()}: {g} = x; G.append(x)", f"while {self.value()}: {self.value()}",
            f"a, *b = {self.value()}", f"raise {self.value()}", f"with {self.value()} as x: {self.value()}",
            f"{self.any(TYPES)}.{self.any(SPECIAL)} = {self.value()}", f"{g}.{self.any(METHODS)} = {self.value()}",
            f"try: {self.value()}\n    finally: {self.value()}", f"assert {self.value()}", f"print({self.value()})",
            f"{g} = [{g}, {g}]", f"{g} = ({g}, {g})", "f.control = 1", f"f.control.{self.any(METHODS)}",
            f"f.control.K = {self.value()} if 0 else 'x'", f"f.spin.reference.sigma_RN[0] = {self.value()}"])

    def attempt(self, text, caught=0.8):
        if self.random.random() > caught:
            return f"    {text}\n"
        lines = text.replace("\n    ", "\n        ")
        return f"    try:\n        {lines}\n    except {self.any(['Exception as e', 'Exception', ''])}: pass\n".replace(
            " as e: pass", " as e: G.append(e)")

    def of_a_class(self, name, base):
        return f"class {name}({base}):\n" + "".join(
            f"    def {name}(self, *a):\n        {self.any([self.statement(), 'act(2)', 'pass'])}\n"
            f"        return {self.any([self.value(), 'True', '3', 'self', 'a'])}\n".replace(
                "\n    finally", "\n        finally")
            for name in self.random.sample(SPECIAL, self.random.randrange(4))) + "    x = 1\n"

    def procedure(self):
        act = "".join(self.attempt(self.statement()) for _ in range(2))
        head = ("import math, array\nfrom fledge.units import m, s\n"
                "def act(*a, **k):\n    global G\n" + act + f"    return {self.any(['a', 'True', '1', 'G'])}\n"
                "def g():\n    x = yield 1\n    while 1: x = yield act(x)\n"
                "class A:\n" + "".join(
                    f"    def {name}(s, *a):\n        for x in G:\n"
                    "            if hasattr(x, 'clear'): x.clear()\n        return 1\n"
                    for name in self.random.sample(["__eq__", "__lt__", "__hash__", "__len__", "__int__"], 3)))
        if self.random.random() < 0.3:
            body = "".join(f"    {line.removeprefix('@')}\n" if not line.startswith("@") or self.random.random() < 0.5
                           else f"    try: {line[1:]}\n    except Exception as e: print(e)\n"
                           for line in self.any(WHOLE).split("\n"))
            return f"{head}G = [1]\ndef main(f):\n{body}    yield\n    print(G)\n"
        classes = (("H", "object"), ("L", "list"), ("E", "Exception"), ("T", "tuple"))
        return (head + "".join(self.of_a_class(*cls_) for cls_ in classes)
                + "f = None\nG = []\ndef main(f_):\n    global f, G\n    f = f_\n"
                f"    G = [{', '.join(self.any(self.any([NUMBERS, TEXTS, MADE, MADE])) for _ in range(PLACES))}]\n"
                + "".join(self.attempt(self.statement()) for _ in range(self.random.randrange(3, 12)))
                + self.any(["", "    yield\n", "    yield wait(1)\n", "    yield G\n"])
                + "".join(self.attempt(self.statement()) for _ in range(3)))


def compiled(writer):
    """A procedure that the compiler takes and that fits into a slot, with its bytecode."""
    while True:
        source = writer.procedure()
        try:
            code = toolchain.compile_mpy(source, "x.py")
        except Failure:
            continue
        if len(code) <= 2048:
            return source, code


def survives(flight, code, what):
    """Run bytecode for some instants. Returns the reason of its refusal, or OK."""
    timer = Timer(ANSWER, flight.process.kill)
    timer.start()
    try:
        reason = flight.start(code, turns=1500)
        flight.fly(2)
        flight.send(flight.packets.stop(0))
        flight.fly()
    except (AssertionError, BrokenPipeError) as error:
        pytest.fail(f"{error} after:\n{what}")
    finally:
        timer.cancel()
    flight.texts.clear()
    flight.reports.clear()
    return reason


@pytest.fixture
def undisturbed(programs):  # noqa: F811
    """The same flight without procedures."""
    flight = Flying(programs.built[False], programs.dictionary)
    yield flight
    flight.process.stdin.close()
    assert flight.process.wait() == 0


def check_bits(flight, undisturbed):  # noqa: F811
    undisturbed.fly((flight.t - undisturbed.t) // 1_000_000_000)
    assert flight.memory == undisturbed.memory


@pytest.mark.long("many hostile programs")
def test_hostile_procedures_leave_flight_as_it_was(flight, undisturbed):  # noqa: F811
    for seed in range(SEED, SEED + CASES):
        source, code = compiled(Hostile(seed))
        assert survives(flight, code, f"# {seed}\n{source}") == Reason.OK, source
        check_bits(flight, undisturbed)


@pytest.mark.long("hundreds of mutants")
def test_mutated_bytecode_is_refused_or_does_no_harm(flight, undisturbed):  # noqa: F811
    chance, refused = random.Random(SEED), 0
    for seed in range(SEED, SEED + CASES):
        source, code = compiled(Hostile(seed % 40))
        changed = bytearray(code)
        for _ in range(chance.choice([1, 1, 1, 2, 4])):
            changed[chance.randrange(4, len(code))] = chance.choice([chance.randrange(256), chance.choice(code)])
        refused += survives(flight, bytes(changed), f"# {seed}: {changed.hex()}\n{source}") == Reason.BYTECODE
        check_bits(flight, undisturbed)
    assert refused > CASES / 5
