# SPDX-License-Identifier: Apache-2.0
"""MicroPython as flight has it: the source, exact numbers, no memory in the loop, the same bits on the board.

    FLEDGE_CASES=20000 FLEDGE_SEED=7 /usr/bin/python3 -m pytest targets/micropython/toolchain_test.py
"""

import hashlib
import os
import re
import subprocess
from pathlib import Path
from random import Random
from struct import pack, unpack

import pytest

from fledge.errors import Failure
from fledge.mission import flying
from fledge.targets import build
from fledge.targets.leon3 import board
from fledge.targets.micropython import toolchain
from tests.needs import flies_on

CASES, SEED = int(os.environ.get("FLEDGE_CASES", "300")), int(os.environ.get("FLEDGE_SEED", "1"))


@pytest.fixture(scope="module")
def interpreter(tmp_path_factory):
    """The interpreter of development, which reads scripts."""
    return toolchain.interpreter(tmp_path_factory.mktemp("interpreter"), development=True, cycles=1000,
                                 heap=1 << 22)


@pytest.fixture
def run(interpreter, tmp_path):
    """run(text) -> (what the script printed, its error), line by line."""
    def run(text):
        (tmp_path / "script.py").write_text(text)
        done = subprocess.run([interpreter, "script.py"], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == bool(done.stderr)
        return done.stdout.splitlines(), done.stderr.strip()
    return run


def numbers(random, n):
    """Floats of all kinds: any bits, and as people write them."""
    for i in range(n):
        bits = random.getrandbits(64) & ~(1 << 62 if i % 2 else 0)
        value, = unpack("<d", pack("<Q", bits))
        yield round(random.uniform(-1e4, 1e4), random.randrange(8)) if i % 3 == 0 or value != value else value


# --- numbers -----------------------------------------------------------------------------------------

def test_floats_are_exact_in_scripts_in_texts_and_in_print(run):
    values = [x for x in numbers(Random(SEED), CASES) if abs(x) != float("inf")]
    values += [5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, 9007199254740993.0, 0.1 + 0.2, -0.0]
    text = ["import array", *(f"print(list(bytes(array.array('d', [{x!r}, float('{x!r}')]))), {x!r})" for x in values)]
    printed, error = run("\n".join(text))
    assert error == ""
    for line, x in zip(printed, values):
        stored, _, shown = line.rpartition(" ")
        assert stored == str(list(pack("=dd", x, x))), repr(x)
        assert pack("d", float(shown)) == pack("d", x)
        assert shown == repr(x) or len(shown) <= len(repr(x))
    assert len(printed) == len(values) + 1


def test_frozen_floats_are_exact():
    values = list(numbers(Random(SEED + 1), 40)) + [1.7976931348623157e308, 5e-324]
    values = [abs(x) for x in values if abs(x) != float("inf")]
    frozen = toolchain.freeze({"script.py": f"x = [{', '.join(map(repr, values))}]\n"}, toolchain.library())
    bits = [(int(word, 16) - 0x8004000000000000) % 2**64 for word in
            re.findall(r"#define \w+ \(\(mp_rom_obj_t\)\(0x(\w{16})\)\)", frozen)]
    assert bits == [unpack("<Q", pack("<d", x))[0] for x in dict.fromkeys(values)]


# What a script may compute with floats x and y, integers i and j, and a number of digits n.
EXPRESSIONS = """
math.sin(x); math.cos(x); math.tan(x); math.atan(x); math.exp(x); math.log(x); math.log(abs(x), 10); math.sqrt(abs(x))
math.asin(x); math.acos(x); math.asin(math.sin(x)); math.acos(math.cos(x)); math.exp(-abs(x)); math.atan2(x, y)
math.pow(x, y); math.pow(abs(x), y); math.fmod(x, y); math.copysign(x, y); math.fabs(x); math.isnan(x - x)
math.floor(x % 1e9); math.ceil(y % 1e9); math.trunc(x % 1e9); math.isfinite(x * y); math.isinf(x * 1e300 * y)
math.degrees(x); math.radians(x); math.pi * math.e - math.tau; x * math.inf; math.nan + x; x ** y; abs(x) ** y
abs(x) ** (y % 3); x ** 2; x ** -1; x ** 3; x ** 7; x ** -2; abs(x) ** 0.5; abs(x) ** -0.25; 2.0 ** y; 2 ** x; x ** i
3 ** (j % 39); 3 ** -abs(j)
(-0.0) ** j; 0.0 ** i; 0.0 ** -1.0; pow(x, y); pow(j, 3); x ** 0; math.inf ** y; math.nan ** 0; round(x, 2)
round(x, 1); round(x, n); round(y, n); round(x, -1); round(x, 0); round(-x, 3); round(x % 1e9); round(j + 0.5)
round(j / 8, 2); round(j * 0.05 + 0.025, 2); round(j + 0.005, 2); round(j * 1e15 + 0.5, 1); round(j * 137.5, -1)
round(i, -2); round(j, -1); round(j, 3); round(1.7e308, -308); round(math.inf, 2); round(math.nan, n); x + y; x - y
x * y; x / y; x % y; x // y; divmod(x, y); -x % 0.7; x % -0.3; -x // 0.7; x / 0.0; x % 0.0; x // 0; 0.0 * -x
x % math.inf; -5.0 % math.inf; x // math.inf; math.inf % y; y % 1; -0.0 % 1; j % 0.7; 7.5 // j; int(x % 1e15)
int(-y % 1e9); i % j; i // j; i / j; j / i; -i % j; divmod(i, j); i >> 3; (j << 5) ^ 12345; ~j & 0xff; i / 7; i * 1e-9
x * j; i - x; j / 0; x < y; x == y; i < x; 2 * j == j + j; min(x, y); max(x, y); max(-x, -0.0); min(math.nan, x)
min(x, math.nan); abs(x); max([x, y, 0.5]); sum([x, y, 0.1, -x]); sum([0.1] * 10); sum([j, x, j]); sorted([x, y, 0.0])
x and y; x or y; not x; bool(x); str(x); repr(y); "%.3f" % (x % 1e9); "%g" % x; "%.12e" % y; "{:.5f}".format(x % 1e9)
"%d %s" % (j, x); float(str(x)) == x; float("1_0.5"); float("-1e-3"); float("inf"); float("1e400"); int("12")
int("-0x1f", 16); float(j); float("x")
""".strip().replace("\n", "; ").split("; ")


def given(random):
    """x, y, i, j, n of EXPRESSIONS."""
    x, y = (random.choice([
        random.uniform(-1, 1), random.uniform(-30, 30), random.uniform(-1e6, 1e6), random.randrange(-9, 9) + 0.5,
        random.uniform(-9, 9) * 10.0 ** random.randrange(-300, 300), round(random.uniform(-9, 9), 2)]) for _ in "xy")
    return x, y, random.choice([1, -1]) * random.getrandbits(random.randrange(1, 63)), random.randrange(-50, 51), \
        random.randrange(-4, 20)


def test_a_script_computes_the_bits_of_the_desktop(run):
    random = Random(SEED)
    inputs = [given(random) for _ in range(max(3, CASES // 20))]
    text = "\n".join(["import math", "E = [", *(f"    lambda x, y, i, j, n: {text}," for text in EXPRESSIONS), "]", f"""
for given in {inputs!r}:
    for e in E:
        try:
            print(repr(e(*given)))
        except Exception as error:
            print(type(error).__name__)
"""])
    here = []
    flying.execute(text, "script.py", {"print": here.append})
    there, error = run(text)
    assert error == ""
    unequal = {EXPRESSIONS[i % len(EXPRESSIONS)]: (inputs[i // len(EXPRESSIONS)], *pair)
               for i, pair in enumerate(zip(here, there)) if pair[0] != pair[1]}
    assert len(there) == len(here) + 1
    assert not unequal, "\n".join(f"{text}: {values}" for text, values in unequal.items())


def whole(random):
    """Integers near the ends of what fits into an object, into 64 bits, and small ones."""
    edge = random.choice([2**46, 2**62, 2**63 - 1, 2**31, 100])
    return random.choice([-1, 1]) * max(0, min(2**63 - 1, edge + random.randrange(-3, 4)))


def test_integers_are_right_or_refused(run):
    random = Random(SEED)
    cases, expected = [], []
    for i in range(CASES):
        a, b, op = whole(random), whole(random), random.choice("+ - * / // % & | ^ << >> ** < ==".split())
        b = b % 70 - 3 if op in ("<<", ">>", "**") else b
        try:
            value = a ** b if op == "**" and b < 40 else eval(f"a {op} b", {"a": a, "b": b}) if op != "**" else 2**999
            shown = repr(value) if not isinstance(value, int) or -2**63 <= value < 2**63 else "OverflowError"
        except (ZeroDivisionError, ValueError) as error:
            shown = type(error).__name__
        cases.append(f"try:\n    print(a({a}) {op} a({b}))\n"
                     "except (OverflowError, ZeroDivisionError, ValueError) as e:\n    print(type(e).__name__)")
        expected.append(shown)
    printed, error = run("def a(x):\n    return x\n" + "\n".join(cases))
    assert error == ""
    for case, printed_, right in zip(cases, printed, expected):
        assert printed_ == right or (right.startswith("0.") or "e-" in right or right == "inf"), case
    assert run("print(0x8000000000000000)")[1] == "OverflowError: integer beyond 64 bits"
    assert run("print(int(1e14), int(-1e18), int(2.0**46), int(-2.0**46))")[0][0] == \
        "100000000000000 -1000000000000000000 70368744177664 -70368744177664"
    assert "float too big" in run("int(1e19)")[1]


@pytest.mark.parametrize("expression, says", [
    ("array.array('B', [256])", "an element of 8 bits cannot be 256"),
    ("array.array('b', [-129])", "an element of 8 bits cannot be -129"),
    ("array.array('i', [1 << 40])", "an element of 32 bits cannot be 1099511627776"),
    ("array.array('Q', [-1])", "an element of 64 bits cannot be -1"),
    ("bytearray([1, 300])", "an element of 8 bits cannot be 300"), ("range(a(1 << 50))", "a range ends at 2**45"),
    ("[1, 2] * a(1 << 62)", "the heap of "), ("'ab' * a(1 << 62)", "the heap of "),
    ("(1,) * a(1 << 62)", "the heap of "),
])
def test_an_integer_is_never_cut_to_fewer_bits(run, expression, says):
    _, error = run(f"import array\ndef a(x):\n    return x\nx = {expression}\n")
    assert re.match(r"script.py, line 4: \w+Error: ", error) and says in error


def test_the_integers_at_the_ends_of_an_array_fit(run):
    printed, error = run("import array\nprint(array.array('b', [-128, 127]), array.array('H', [0, 65535]), [1] * 2, "
                         "len(range(1 << 44)), array.array('q', [-(1 << 62), (1 << 62)]), bytearray([0, 255]))")
    assert (printed[0], error) == ("array('b', [-128, 127]) array('H', [0, 65535]) [1, 1] 17592186044416 "
                                   "array('q', [-4611686018427387904, 4611686018427387904]) "
                                   "bytearray(b'\\x00\\xff')", "")


def test_an_integer_that_has_no_64_bits_is_not_frozen():
    with pytest.raises(Failure, match="have the integer 18446744073709551616; MicroPython has 64 bits"):
        toolchain.freeze({"a.py": "x = 1 << 64\n"}, toolchain.library())


# --- memory ------------------------------------------------------------------------------------------

@pytest.mark.parametrize("body", [
    "i = 0\n    while i < 10:\n        i += 1", "for i in range(10):\n        x = i", "for y in L:\n        pass",
    "s = 0.0\n    for i in range(9):\n        s += i * 0.5 / 3.0 - s", "V.x = V.x + 1.0\n    V.x = L[2]\n    L[0] = 5",
    "f(1, 2.0)", "V.step(3)", "try:\n        f(1, 2)\n    except ValueError:\n        pass", "math.sin(math.sqrt(2.0))",
    "abs(min(L[1], max(3, 4)))", "x = L[1] if L[0] > 2 and not L[2] else -L[1]", "x = 2.5 ** 3 // 1.5 % 7",
    "isinstance(V, list)", "global G\n    G = G + 1", "x = D['a']\n    D['a'] = x + 1",
])
def test_what_flight_does_in_its_loop_takes_no_memory(run, body):
    printed, error = run("import math\nL = [1, 2, 3]\nD = {'a': 1}\nG = 0\ndef f(a, b):\n    return a * b\n"
                         "class C:\n    x = 1.0\n    def step(self, n):\n        self.x = self.x + n\n"
                         "V = C()\nV.x = 0.5\n"
                         f"def loop():\n    {body}\n")
    assert error == ""
    match = re.fullmatch(r"heap: \d+ bytes at the start, \d+ at most until the loop, (\d+) in the loop, (\d+) after it",
                         printed[-1])
    assert match[1] == match[2]


@pytest.mark.parametrize("body", ["[1, 2]", "x = 'a' + s", "lambda: L", "L[0:1]", "{}", "[x for x in L]", "list(L)",
                                  "L[0] << 60"])
def test_memory_in_the_loop_is_an_error_with_the_line_of_the_script(run, body):
    _, error = run(f"s = 'b'\nL = [1, 2, 3]\ndef inner():\n    {body}\ndef loop():\n    inner()\n")
    assert re.fullmatch(r"script.py, line 4: MemoryError: this allocates \d+ bytes, but after the start nothing may "
                        r"allocate", error)


def test_an_error_under_the_lock_keeps_its_text_and_line(run):
    _, error = run("def loop():\n    raise ValueError('too hot')\n")
    assert error == "script.py, line 2: ValueError: too hot"
    _, error = run("class C:\n    pass\nc = C()\ndef loop():\n    return c.reach\n")
    assert error == "script.py, line 5: AttributeError: 'C' object has no attribute 'reach'"
    _, error = run("def loop():\n    loop()\n")
    assert re.match(r"script.py, line 2: RuntimeError: (pystack|maximum recursion)", error)


def test_a_script_that_needs_more_than_the_heap_fails_with_its_line(run):
    assert run("L = []\nwhile True:\n    L.append(bytes(1000))\n")[1].startswith(
        "script.py, line 3: MemoryError: the heap of 4194304 bytes has no ")


def test_start_takes_less_memory_when_the_script_is_frozen(tmp_path, run):
    text = "def loop():\n    pass\nX = [i for i in range(20)]\n"
    frozen = toolchain.interpreter(tmp_path / "frozen", {"script.py": text})
    printed = subprocess.run([frozen], capture_output=True, text=True, check=True).stdout
    peaks = [int(re.search(r"(\d+) at most", line)[1]) for line in (printed, run(text)[0][-1])]
    assert peaks[0] < peaks[1] and peaks[0] < 4096


# --- scripts -----------------------------------------------------------------------------------------

def test_packages_and_their_relative_imports_are_frozen(tmp_path):
    scripts = {"script.py": "from sat import flight\nfrom sat.flight import g\nprint(flight.g(2), g.__name__)\n",
               "sat/__init__.py": "", "sat/flight.py": "from .parts import gain\nfrom . import parts\n\n\n"
               "def g(x, *rest, k=1, **more):\n    return x * gain * parts.gain * k\n",
               "sat/parts.py": "gain = 2.5\n"}
    built = toolchain.interpreter(tmp_path / "a", scripts)
    done = subprocess.run([built], capture_output=True, text=True)
    assert (done.stdout.splitlines()[0], done.stderr) == ("12.5 g", "")
    for folder in (tmp_path, build.ROOT):
        assert str(folder).encode() not in built.read_bytes()
        assert str(folder) not in toolchain.freeze(scripts, toolchain.library())
    assert toolchain.freeze(scripts, toolchain.library()) == toolchain.freeze(scripts, toolchain.library())


def test_the_language_that_missions_use(run):
    text = """
def decorate(f):
    return lambda *a, **k: f(*a, **k) + 1
@decorate
def add(a, b=2, *, c=3): return a + b + c
class Base:
    def __init__(self, x): self.x = x
    def __repr__(self): return "B(%r)" % self.x
class Unit(Base):
    def __rmul__(self, k): return Unit(k * self.x)
    @property
    def twice(self): return 2 * self.x
def count(n):
    for i in range(n):
        yield i
print(add(1), add(*[1, 2], **{"c": 4}), (3.0 * Unit(2)), Unit(4).twice, isinstance(Unit(1), Base))
print([x * x for x in range(4)], {k: v for k, v in zip("ab", (1, 2))}, sum(count(5)), sorted([3, 1, 2], reverse=True))
print("%s %5.2f %d" % ("a", 1.005, 7), "{:>4}|{:.3f}".format("b", 2.0), ",".join(["x", "y"]), "A b".split())
print(list(enumerate("xy")), any([0, 1]), all([]), round(2.567, 1), min(3, 1), max([1, 5]), abs(-2.5), divmod(7, 2))
a, *b = (1, 2, 3); a, c = b[::-1]; print(a, b, c, 1 < 2 <= 2, b if a else c)
try:
    {}["missing"]
except KeyError as error:
    print(type(error).__name__, error.args)
finally:
    print("done")
print((y := 5) + y, bytes([1, 2]), "abc"[1:], "x" in "xyz", (1,) + (2,), [0] * 3, not None, 0x10, 1_000)
"""
    printed, error = run(text)
    assert error == ""
    lines = []
    exec(text, {"print": lambda *x: lines.append(" ".join(map(str, x)))})
    assert printed[:-1] == lines


def test_a_script_that_python_cannot_read_is_refused_with_its_line():
    with pytest.raises(Failure, match=r'(?s)sat/flight.py cannot be compiled.*sat/flight.py", line 2.*SyntaxError'):
        toolchain.compile_mpy("x = 1\nif x\n", "sat/flight.py")


# --- the board ---------------------------------------------------------------------------------------

@flies_on("leon3")
def test_the_board_computes_the_same_bits(tmp_path):
    random = Random(SEED)
    values = [x for x in numbers(random, 60) if abs(x) < 1e150]
    text = f"""
import math
V = {values!r}
print(V)
print([math.sin(x) for x in V], [math.atan2(x, 2.0) for x in V])
print([x * 1.7 / 3.3 - 0.1 for x in V], [x ** 2 for x in V], [math.sqrt(abs(x)) for x in V])
print([abs(x) ** 0.3 for x in V], [round(x, 2) for x in V], [(1 << 62) / int(x) for x in V if 1 <= abs(x) < 1e18])
print([int(x) for x in V if abs(x) < 1e18], [x // 7.0 for x in V], [x % 7.0 for x in V])
print(1 << 45, (1 << 46) * 3, -(1 << 62), 12345678901234567 // 1000, -7 // 2, -7 % 5, hash("a"), "%.10g" % 0.1)
print(bytes([1, 2, 255]), "%05d %x" % (42, 255), {{"a": 1}}, (1, 2.5), float("1e23"))
"""
    outputs = []
    for machine in ("host", "leon3"):
        built = toolchain.interpreter(tmp_path, {"script.py": text}, machine)
        command = [built] if machine == "host" else \
            [build.native("fledge_leon3", "emulator/tools"), board.BOARD, built]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        outputs.append(done.stdout.splitlines()[:-1])
    assert outputs[0] == outputs[1]
    assert len(outputs[0]) == 7


# --- the source --------------------------------------------------------------------------------------

@pytest.fixture
def elsewhere(tmp_path):
    """A folder for the source, with nothing in it."""
    return tmp_path


def test_a_source_of_other_bytes_is_refused(elsewhere):
    (elsewhere / toolchain.ARCHIVE).write_bytes(b"something else")
    with pytest.raises(Failure, match=f"is {hashlib.sha256(b'something else').hexdigest()}, not {toolchain.SHA256}"):
        toolchain._archive(elsewhere)


def apt(folder, monkeypatch, script):
    """An apt-get that runs this script."""
    (folder / "bin").mkdir()
    (folder / "bin/apt-get").write_text(f"#!/bin/sh\n{script}\n")
    (folder / "bin/apt-get").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}/bin", prepend=":")


URIS = """case "$*" in *--print-uris*) echo "'http://s.example/debian-security/dists/bookworm-security/InRelease' a 0 "
echo "'http://m.example/debian/dists/bookworm/InRelease' b 0 "; exit ;; esac
"""


def test_the_source_comes_from_the_mirror_of_this_machine(elsewhere, monkeypatch):
    apt(elsewhere, monkeypatch, URIS + f"""echo "$*" >> {elsewhere}/said
case "$*" in *source*) cat {elsewhere}/apt/sources.list > {elsewhere}/list; echo wrong > {toolchain.ARCHIVE} ;; esac""")
    with pytest.raises(Failure, match="is not MicroPython's source of Debian"):
        toolchain._archive(elsewhere)
    assert (elsewhere / "list").read_text() == \
        f"deb-src [signed-by={toolchain.KEYRING}] http://m.example/debian trixie main\n"
    update, source = (elsewhere / "said").read_text().splitlines()
    assert update.endswith(" update") and source.endswith(" source --download-only micropython=1.25.0+ds-1")
    for file in (update, source):       # nothing of the machine's own lists is read or written
        for option in ("Dir::Etc::sourcelist", "Dir::State::Lists", "Dir::Cache"):
            assert f"{option}={elsewhere}/apt/" in file
        assert "Dir::Etc::sourceparts=-" in file


@pytest.mark.parametrize("script, says", [
    (URIS + "echo 'E: Failed to fetch: unplugged'; exit 100", "without a network, put .*orig.tar.xz into .*unplugged"),
    (URIS + "echo 'W: Some index files failed to download.'", "Some index files failed"),
    ("exit 0", "names no mirror")])
def test_without_a_network_it_says_what_is_missing(elsewhere, monkeypatch, script, says):
    apt(elsewhere, monkeypatch, script)
    with pytest.raises(Failure, match=f"(?s){says}"):
        toolchain._archive(elsewhere)


def test_an_archive_that_is_there_is_used_without_apt(elsewhere, monkeypatch):
    archive = Path(toolchain._source().parent) / toolchain.ARCHIVE
    (elsewhere / toolchain.ARCHIVE).symlink_to(archive)
    apt(elsewhere, monkeypatch, "exit 100")
    assert toolchain._archive(elsewhere) == elsewhere / toolchain.ARCHIVE


def test_another_version_of_the_source_is_refused(tmp_path):
    (tmp_path / "obj.h").write_text("int x, x;\n")
    for old, times in (("y", 0), ("x", 2)):
        with pytest.raises(Failure, match=f"is not that of MicroPython .*: '{old}' is there {times} times"):
            toolchain._edit(tmp_path, {"obj.h": [("int", "long"), (old, "z")]})
