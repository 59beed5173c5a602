# SPDX-License-Identifier: Apache-2.0
"""Procedures and texts of the ground in flight under MicroPython: what they do, what they may not, and that flight goes
on as without them."""
import struct
import subprocess
from types import SimpleNamespace

import pytest

import fledge
from fledge import cli, export
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.commands import Dictionary, Kind, Packets, Reason, decoded, read_script
from fledge.errors import SetupError
from fledge.targets import TARGETS, build, procedure
from fledge.targets.linux import RUNNER
from fledge.targets.micropython import program, toolchain
from fledge.targets.micropython.export import compose
from fledge.units import s

MISSION = '''
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s


def build(f):
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], J=0.15 * kg * m**2, u_max=0.2 * N * m)
    f.guidance = fsw.InertialPointing(sigma_RN=[0.1, 0.2, 0.3])
    f.spin     = fsw.EulerRotation(angles=[0.1, 0, 0], rates=[0, 0, 0.3] * deg / s)
    f.tracking = fsw.TrackingError()
    f.control  = fsw.MrpFeedback(K=2.5 * N * m, P=45.0 * N * m * s)
    f.connect(f.guidance.reference >> f.spin.base, f.spin.reference >> f.tracking.reference,
              f.tracking.error >> f.control.error, f.vehicle.vehicle >> f.control.vehicle,
              f.wheels.wheels >> f.control.wheels)
    f.task("guide", every=1 * s, run=[f.guidance, f.spin, f.tracking])
    f.task("control", every=1 * s, run=[f.control])
    f.mode("rest", ["guide"])
    f.mode("science", ["guide", "control"])
    f.mode("locked", [], when=f.watch(f.control.torque).torque_B.norm() > 9, after="science")
    f.start_in("rest")
'''
WORLD = '''
from fledge import world
from fledge.units import N, kg, m, s


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)
    w.craft  = world.Spacecraft(I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels])
    w.nav    = world.Navigation()
    w.connect(w.craft.state >> w.nav.truth, w.nav.attitude >> f.tracking.attitude, w.wheels.speeds >> f.control.speeds)
    w.task("dynamics", every=1 * s, run=[w.craft, w.nav])
'''
NS = 1_000_000_000


class Flying:
    """A mission that flies by lines (targets/micropython/testing/link.c)."""

    def __init__(self, program, dictionary):
        self.dictionary, self.packets, self.t = dictionary, Packets(dictionary), -NS
        self.process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.memory, self.heap, self.reports, self.texts = "", (0, 0), [], []

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        while (answer := self.process.stdout.readline().rstrip()) != ".":
            kind, _, rest = answer.partition(" ")
            assert kind, f"the program ended with {self.process.wait()}"
            if kind == "p":
                packet = decoded(self.dictionary, bytes.fromhex(rest))
                {"reports": self.reports, "texts": self.texts}[packet.path].append(packet.content)
            elif kind == "m":
                self.memory = rest
            else:
                self.heap = tuple(map(int, rest.split()))

    def send(self, *packets):
        for packet in packets:
            self.say(f"c {packet.hex()}")

    def fly(self, n=1):
        """Returns the memory after each instant."""
        values = []
        for _ in range(n):
            self.t += NS
            self.say(f"t {self.t}")
            values.append(self.memory)
        return values

    def start(self, source, turns=1000, slot=0):
        """Send a procedure, and let it begin; returns why it is refused, or OK."""
        code = source if isinstance(source, bytes) else toolchain.compile_mpy(source, "check.py")
        self.send(*self.packets.procedure(code, turns, slot))
        self.fly()
        return next(r.reason for r in reversed(self.reports) if r.code == 12)

    def results(self):
        """[(kind, line, text)] since the last time."""
        texts = [(text.kind, text.line, text.text) for text in self.texts]
        self.texts.clear()
        return texts

    def read(self, module, field):
        """The first number of a parameter."""
        self.send(*self.packets.read(f"flight.{module}", field))
        self.fly()
        return struct.unpack(">d", self.reports[-1].data[:8])[0]


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """By whether it is the development build."""
    folder = tmp_path_factory.mktemp("procedures")
    (folder / "flight.py").write_text(MISSION)
    (folder / "world.py").write_text(WORLD)
    sim = fledge.load(folder)
    mission = export.read(sim)
    composed = compose(sim, mission)
    values = {}
    for development in (False, True):
        library = toolchain.library("host", development)
        sources = [*program.sources(composed, folder / str(development), [build.ROOT], library),
                   *(build.ROOT / path for path in RUNNER if path != "targets/linux/main.c"),
                   build.ROOT / "targets/micropython/testing/link.c"]
        values[development] = build.program(
            folder / str(development), "link", sources, [(folder / str(development) / "c").resolve(), build.ROOT],
            library.compiler, library.flags, ["-no-pie", "-lm"], archives=[library.archive])
    dictionary = Dictionary.load(next((folder / "False" / "c").glob("*_packets.json")))
    return SimpleNamespace(built=values, dictionary=dictionary)


@pytest.fixture
def flight(programs):
    program = Flying(programs.built[False], programs.dictionary)
    yield program
    program.process.stdin.close()
    assert program.process.wait() == 0


def test_a_procedure_waits_changes_a_mode_and_a_gain(flight):
    assert flight.start("""
from fledge.units import s

def main(f):
    print("mode", f.active_mode, f.control.K)
    f.enter("science")
    yield wait(3 * s)
    f.control.K = 3.0
    f.wheels.u_max = 0.5
    while f.spin.reference.head.sequence < 9:
        yield
    print(f.active_mode)
""") == Reason.OK
    assert flight.results() == [(Kind.PROCEDURE_STARTED, 0, ""), (Kind.PRINTED, 0, "mode rest 2.5")]
    flight.fly(2)
    assert flight.read("control", "K") == 2.5          # it is written at the end of this instant, the third
    assert flight.read("control", "K") == 3.0
    flight.fly(20)
    assert flight.results() == [(Kind.PRINTED, 0, "science"), (Kind.PROCEDURE_ENDED, 0, "")]


def without(program, dictionary, n):
    """The memory after each instant of a flight without commands."""
    flight = Flying(program, dictionary)
    result = flight.fly(n)
    flight.process.stdin.close()
    flight.process.wait()
    return result


KILLED = {
    "an endless loop": ("while True: pass", 2, "turns"),
    "an endless loop that catches": ("while True:\n        try:\n            while True: pass\n"
                                     "        except: pass", 4, "turns"),
    "endless calls": ("def g():\n        try: g()\n        except RuntimeError: pass\n        g()\n    g()", 0, ""),
    "a long sum": ("sum(range(10**12))", 2, "turns"),
    "memory": ("a = []\n    for i in range(9999): a.append([i] * 100)", 3, "the heap of 16384 bytes has no"),
    "an exception": ("x = 1\n    1 / 0", 3, "ZeroDivisionError"),
    "an unknown name": ("f.control.KK = 3", 2, "flight.control has no attribute 'KK'"),
    "an unknown module": ("f.contrl.K = 3", 2, "flight has no 'contrl' here"),
    "an unknown mode": ("f.enter('sciense')", 2, "flight has no mode 'sciense'; it has rest, science"),
    "a mode's condition": ("f.enter('locked')", 2, "mode flight.locked: its condition does not hold"),
    "an output": ("f.control.torque.torque_B = [1, 2, 3]", 2, "is in an output"),
    "an input": ("f.control.error.sigma_BR[0] = 1", 0, "flight.control.error is no parameter"),
    "a bound": ("f.control.K = -3.0", 2, "flight.control.K must be"),
    "a wrong size": ("f.wheels.J = [1, 2]", 2, "flight.wheels.J"),
    "a module of the process": ("f.control = 3", 2, "cannot be set here"),
    "a wire": ("f.connect(f.spin.reference >> f.tracking.reference)", 2, "flight has no 'connect' here"),
    "flight's own script": ("import flight", 2, "no module named"),
    "a negative wait": ("yield wait(-1)", 2, "wait: the time must be >= 0"),
    "a wait without a yield": ("wait(1)\n    yield", 0, "yields nothing, or wait(time)"),
    "a norm of a number": ("norm(3)", 2, "norm: expected an array of a module or message; found 3"),
    "a value": ("yield 3", 0, "yields nothing, or wait(time)"),
    "an update of a module": ("f.spin.update(5.0)", 0, "is no parameter"),
    "a list in itself, compared": ("a, b = [], []; a.append(a); b.append(b)\n    a == b", 3, "maximum recursion depth"),
    "a list in itself, printed": ("a = []; a.append(a)\n    print(a)", 3, "maximum recursion depth"),
    "a list in itself, raised": ("a = []; a.append(a)\n    raise ValueError(a)", 3, "ValueError: [[[[[["),
    "a doubled list, compared": ("t = u = [1]\n    for i in range(45): t, u = [t, t], [u, u]\n    t == u", 4, "turns"),
    "a doubled list, printed": ("t = [1]\n    for i in range(45): t = [t, t]\n    str(t)", 4, ""),
    "a doubled list, raised": ("t = [1]\n    for i in range(45): t = [t, t]\n    raise ValueError(t)", 4, "[[[[[["),
    "a doubled tuple, hashed": ("t = 1,\n    for i in range(45): t = t, t\n    hash(t)", 4, "turns"),
    "doubled bases": ("class C: pass\n    for i in range(30):\n        class C(C, C): pass\n    C().x", 0, "turns"),
    "a call of itself": ("class C: pass\n    C.__call__ = C()\n    C()()", 4, "RuntimeError"),
    "a method of another class": ("type('C', (list,), {}).pop(f)", 2, "TypeError"),
    "a set that changes": ("class C:\n        def __hash__(c): s.clear()\n    s = {1}\n    C() in s", 0, ""),
}


@pytest.mark.parametrize("what", KILLED)
def test_a_procedure_that_goes_wrong_is_killed_and_flight_goes_on(flight, programs, what):
    body, line, text = KILLED[what]
    assert flight.start(f"def main(f):\n    {body}\n    yield\n", turns=2000) == Reason.OK
    (kind, _, _), *_, (killed, at, why) = flight.results()
    assert (kind, killed) == (Kind.PROCEDURE_STARTED, Kind.PROCEDURE_KILLED)
    assert text in why and (not line or at == line and f"check.py, line {line}: " in why)
    assert flight.start("def main(f):\n    yield\n    print('alive')\n") == Reason.OK       # and so does the next one
    flight.fly(3)
    assert flight.results()[1] == (Kind.PRINTED, 0, "alive")
    assert flight.memory == without(programs.built[False], programs.dictionary, 5)[-1]


def test_what_does_not_raise_until_later_is_killed_at_its_line(flight):
    assert flight.start(
        "def main(f):\n    for i in range(3):\n        yield\n    g()\n\n\ndef g():\n    [][0]\n") == Reason.OK
    flight.fly(3)
    assert flight.results()[1] == (Kind.PROCEDURE_KILLED, 8, "check.py, line 8: IndexError: list index out of range")


def test_a_budget_is_of_one_instant(flight):
    source = "def main(f):\n    for k in range(20):\n        for i in range(80):\n            pass\n        yield\n"
    assert flight.start(source, turns=100) == Reason.OK
    flight.fly(25)
    assert [kind for kind, _, _ in flight.results()] == [Kind.PROCEDURE_STARTED, Kind.PROCEDURE_ENDED]
    assert flight.start(source, turns=70) == Reason.OK
    assert [kind for kind, _, _ in flight.results()] == [Kind.PROCEDURE_STARTED, Kind.PROCEDURE_KILLED]


GOOD = "def main(f):\n    f.control.K = 3.0\n    yield\n"


def test_damaged_bytecode_is_refused(flight, programs):
    code = toolchain.compile_mpy(GOOD, "check.py")
    for wrong in (b"M" + bytes([5]) + code[2:], b"N" + code[1:],
                  code[:2] + b"\x2b" + code[3:], code[:3] + b"\x3f" + code[4:],
                  b"M", bytes(100), code + b"\0", *(code[:n] for n in range(4, len(code), 7))):
        assert flight.start(wrong) == Reason.BYTECODE, wrong.hex()
    packets = flight.packets.procedure(code)
    changed = flight.packets.procedure(code[:-3] + b"abc")
    flight.send(*packets[:-1], changed[-1])
    flight.fly()
    assert flight.reports[-1].reason == Reason.CRC
    assert flight.results() == []
    assert flight.read("control", "K") == 2.5


SORTED = """
class C:
    def __lt__(self, other):
        kept.clear()
        return True

    __eq__ = __lt__

def main(f):
    global kept
    for use in (list.sort, lambda l: l.count(1), lambda l: l.index(1), lambda l: l == other, lambda l: max(l)):
        kept = [C() for i in range(9)]
        other = list(kept)
        try:
            use(kept)
        except Exception:
            pass
        "x" * 100
    print("done")
"""


def test_a_list_that_its_elements_clear_while_it_is_used_does_no_harm(flight):
    assert flight.start(SORTED) == Reason.OK
    assert flight.results()[1] == (Kind.PRINTED, 0, "done")


def test_one_procedure_runs_at_a_time_and_stops_by_command(flight):
    forever = "def main(f):\n    while True:\n        yield\n"
    assert flight.start(forever, slot=1) == Reason.OK
    assert flight.start(GOOD) == Reason.RUNNING
    flight.send(flight.packets.stop(0))
    flight.fly()
    assert flight.reports[-1].reason == Reason.RUNNING
    flight.send(flight.packets.stop(1))
    flight.fly()
    assert flight.reports[-1].reason == Reason.OK
    assert flight.results() == [(Kind.PROCEDURE_STARTED, 0, ""), (Kind.PROCEDURE_STOPPED, 0, "by command")]
    assert flight.start(forever) == Reason.OK
    flight.send(flight.packets.reset())
    flight.fly()
    assert flight.results()[1] == (Kind.PROCEDURE_STOPPED, 0, "flight begins anew")
    assert flight.start(forever) == Reason.OK
    flight.say(f"r {flight.t + NS}")                # so does a reset of the computer, without a word
    assert flight.start(GOOD) == Reason.OK


def test_a_thousand_procedures_leave_flight_as_it_was(flight):
    flight.fly()
    before = flight.heap
    codes = [toolchain.compile_mpy(f"""
from fledge.units import N, m

class Name{i}:
    pass

def main(f):
    names = ["name{i}_%d" % k for k in range(5)]
    f.control.K = {i}.5 * N * m
    yield
    {"1 / 0" if i % 2 else "f.enter('rest')"}
""", f"p{i}.py") for i in range(1, 9)]
    for i in range(1000):
        flight.send(*flight.packets.procedure(codes[i % len(codes)]))
        flight.fly(2)
        assert flight.heap[0] == before[0]
    assert len(flight.results()) == 2000
    assert not [r for r in flight.reports if not r.good]


# --- texts -----------------------------------------------------------------------------------------

@pytest.fixture
def console(programs):
    flight = Flying(programs.built[True], programs.dictionary)

    def ask(text, turns=5000):
        flight.send(flight.packets.evaluate(text, turns))
        flight.fly()
        (kind, line, answer), = flight.results()
        return kind, answer

    flight.ask = ask
    yield flight
    flight.process.stdin.close()
    assert flight.process.wait() == 0


def test_a_text_reads_and_sets_what_flies(console):
    result, error = Kind.RESULT, Kind.ERROR
    assert console.ask("norm(f.guidance.sigma_RN) ** 2 - 0.14 < 1e-15, max_abs(f.vehicle.I_B)") == (
        result, "(True, 800.0)\n")
    assert console.ask("1 + 1") == (result, "2\n")
    assert console.ask("f.control.K") == (result, "2.5\n")
    assert console.ask("f.control.K = 3 * N * m") == (result, "")
    assert console.ask("f.control.K, f.active_mode") == (result, "(3.0, 'rest')\n")
    assert console.ask("f.wheels.J = 0.2 * kg * m**2; f.enter('science')") == (result, "")
    assert console.ask("f.control.wheels.J[:3], f.active_mode") == (result, "([0.2, 0.2, 0.2], 'science')\n")
    assert console.ask("for i in range(2):\n    print(i)\n") == (result, "0\n1\n")
    kind, text = console.ask("f.control.K = -1")
    assert kind == error and "flight.control.K must be" in text
    assert console.ask("f.control.K") == (result, "3.0\n")
    for wrong, expected in (("f.control.", "SyntaxError"), ("1 / 0", "ZeroDivisionError"), ("x", "name 'x'"),
                            ("while True: pass", "turns"), ("[0] * 100000", "the heap of"), ("f.x", "has no 'x'")):
        kind, text = console.ask(wrong)
        assert kind == error and expected in text
    assert console.ask("f.enter('rest')") == (result, "")
    assert console.ask("f.control.torque.torque_B[1] = 7; f.control.error.sigma_BR = [1, 2, 3]") == (result, "")
    assert console.ask("f.control.torque.torque_B, f.control.error.sigma_BR") == (
        result, "([0.0, 7.0, 0.0], [1.0, 2.0, 3.0])\n")


def test_the_flight_build_evaluates_nothing(flight):
    flight.send(flight.packets.evaluate("1"))
    flight.fly()
    assert flight.reports[-1].reason == Reason.ABSENT


def test_texts_and_a_procedure_do_not_disturb_each_other(console):
    assert console.start("def main(f):\n    a = 0\n    while True:\n        a += 1\n        yield\n"
                         "        print('name_of_procedure' + str(a))\n") == Reason.OK
    console.results()
    heap = console.heap[0]
    for i in range(50):
        console.send(console.packets.evaluate(f"text{i} = 'other_name{i}'; text{i}"))
        console.fly()
        (first, _, answer), (second, _, printed) = console.results()
        assert (first, second) == (Kind.RESULT, Kind.PRINTED)
        assert (answer, printed) == (f"'other_name{i}'\n", f"name_of_procedure{i + 1}")
    assert console.heap[0] == heap


# --- of a scenario ---------------------------------------------------------------------------------

@pytest.mark.parametrize("body", ["while True: pass", "while True:\n        try:\n            while True: pass\n"
                                  "        except: pass", "[0 for i in iter(int, 1)]",
                                  "f = lambda n: n and f(n - 1) + f(n - 1)\n    f(60)"])
def test_an_endless_procedure_is_killed_on_the_desktop(tmp_path, body):
    for name, text in (("flight", MISSION), ("world", WORLD)):
        (tmp_path / f"{name}.py").write_text(text)
    (tmp_path / "check.py").write_text(f"def main(f):\n    f.control.K = 4.0\n    yield\n    {body}\n")
    sim = fledge.load(tmp_path)
    procedure(sim.flight, tmp_path / "check.py", turns=1000)
    sim.run(3 * s)
    started, killed = sim.flight.commands.texts
    assert (started.kind, killed.kind) == (Kind.PROCEDURE_STARTED, Kind.PROCEDURE_KILLED)
    assert killed.text == "it takes more than 1000 turns of loops and returns" and killed.line >= 4
    assert sim.flight.control.K == 4


CHECK = """
import math
from fledge.units import N, kg, m, s

def main(f):
    f.enter("science")
    yield wait(3 * s)
    while f.tracking.error.head.sequence < 9 or norm(f.tracking.error.sigma_BR) > 9:
        yield
    f.control.K = 3 * N * m
    f.control.K_I = norm(f.tracking.error.sigma_BR) + max_abs(f.vehicle.I_B)
    f.vehicle.I_B = [710, 700, 800] * kg * m**2
    print("error", f.tracking.error.sigma_BR[0] != 0, f.active_mode)
    yield
    f.control.P[1][1] = 40.0
    a = f.vehicle.I_B[0]
    x = a[0] / 3
    x **= 1.5
    print(math.sin(a[0]), round(2.675, 2), x, sum([0.1] * 10), repr(a[0]))
"""
# sin(710) and (710/3)^1.5 rounded from 50 digits; the double 2.675 is less than it looks
NUMBERS = "6.0288706691585265e-05 2.67 3640.873928463187 0.9999999999999999 710.0"
SCENARIOS = """
from pathlib import Path

from fledge.targets import procedure
from fledge.units import s


def check(sim):
    sim.run(3 * s)
    procedure(sim.flight, Path(__file__).with_name("check.py"))
    sim.run(20 * s)
    assert sim.flight.control.K == 3 and sim.flight.control.P[1, 1] == 40
"""


def test_a_procedure_computes_on_the_desktop_as_on_a_target(tmp_path):
    for name, text in (("flight", MISSION), ("world", WORLD), ("check", CHECK)):
        (tmp_path / f"{name}.py").write_text(text)
    sim = fledge.load(tmp_path)
    procedure(sim.flight, tmp_path / "check.py")
    sim.run(20 * s)
    assert [text.text for text in sim.flight.commands.texts] == ["", "error True science", NUMBERS, ""]


@pytest.mark.long("builds and flies on targets")
def test_a_procedure_flies_the_same_bits_on_the_desktop_and_on_targets(tmp_path, capsys):
    targets = [name for name in ("micropython", "leon3-micropython") if not TARGETS[name].missing()]
    mission, out = tmp_path / "mission", tmp_path / "out"
    mission.mkdir()
    for name, text in (("flight", MISSION), ("world", WORLD), ("check", CHECK), ("scenarios", SCENARIOS)):
        (mission / f"{name}.py").write_text(text)
    assert cli.main(["fly", str(mission), "--on", ",".join(targets), "--out", str(out)]) == 0, capsys.readouterr()
    dictionary = Dictionary.load(next((out / "c").glob("*_packets.json")))
    for target in targets:
        assert compare(Archive(out / "desktop.mcap"), Archive(out / f"{target}.mcap")) == []
        script = read_script((out / f"{target}.telemetry.txt").read_text())
        packets = [decoded(dictionary, timed.packet) for timed in script]
        assert [(packet.content.kind, packet.content.text) for packet in packets if packet.path == "texts"] == [
            (Kind.PROCEDURE_STARTED, ""), (Kind.PRINTED, "error True science"), (Kind.PRINTED, NUMBERS),
            (Kind.PROCEDURE_ENDED, "")]


HARM = {        # on a target; the desktop, where f has _seen, kills them before
    "compared": "a, b = [], []; a.append(a); b.append(b)\n    a == b",
    "raised": "a = []; a.append(a)\n    raise ValueError(a)",
    "printed": "t = [1]\n    for i in range(45): t = [t, t]\n    print(t)",
    "hashed": "t = 1,\n    for i in range(45): t = t, t\n    hash(t)",
    "nested": "t = 1,\n    for i in range(400): t = t,\n    hash(t) / 0",
    "called": "class C: pass\n    C.__call__ = C()\n    C()()",
    "doubled": "class C: pass\n    for i in range(30):\n        class C(C, C): pass\n    C().x",
    "searched": "('a' * 5000 + 'b').find('a' * 2500 + 'c')\n    1 / 0",
}


@pytest.mark.long("flies on two targets many times")
def test_what_harms_an_interpreter_does_no_harm_to_a_target(tmp_path, capsys):
    targets = [name for name in ("micropython", "leon3-micropython") if not TARGETS[name].missing()]
    mission, out = tmp_path / "mission", tmp_path / "out"
    mission.mkdir()
    scenario = "".join(f'    procedure(sim.flight, Path(__file__).with_name("{name}.py"))\n    sim.run(2 * s)\n'
                       for name in HARM)
    scenario = SCENARIOS.partition("    sim.run")[0] + scenario
    for name, text in (("flight", MISSION), ("world", WORLD), ("scenarios", scenario)):
        (mission / f"{name}.py").write_text(text)
    for name, text in HARM.items():
        (mission / f"{name}.py").write_text(
            f"def main(f):\n    if hasattr(f, '_seen'): raise ValueError\n    {text}\n")
    assert cli.main(["fly", str(mission), "--on", ",".join(targets), "--out", str(out)]) == 0, capsys.readouterr()
    dictionary = Dictionary.load(next((out / "c").glob("*_packets.json")))
    for target in targets:
        script = read_script((out / f"{target}.telemetry.txt").read_text())
        packets = [decoded(dictionary, timed.packet) for timed in script]
        kinds = [packet.content.kind for packet in packets if packet.path == "texts"]
        assert kinds.count(Kind.PROCEDURE_STARTED) == kinds.count(Kind.PROCEDURE_KILLED) == len(HARM)


def test_a_procedure_that_is_no_file(tmp_path):
    with pytest.raises(SetupError, match="procedure: .*none.py: No such file"):
        procedure(None, tmp_path / "none.py")
