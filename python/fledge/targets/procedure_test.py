# SPDX-License-Identifier: Apache-2.0
"""Procedures and texts of the ground in flight under MicroPython: what they do, what they may not, and that flight goes
on as without them."""
import subprocess
from types import SimpleNamespace

import pytest

import fledge
from fledge import export
from fledge.commands import Dictionary, Kind, Packets, Reason, decoded
from fledge.targets import build, micropython
from fledge.targets import micropython_toolchain as toolchain

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
        found = []
        for _ in range(n):
            self.t += NS
            self.say(f"t {self.t}")
            found.append(self.memory)
        return found

    def start(self, source, turns=1000, slot=0):
        """Send a procedure, and let it begin; returns why it is refused, or OK."""
        code = source if isinstance(source, bytes) else toolchain.compile_mpy(source, "check.py")
        self.send(*self.packets.procedure(code, turns, slot))
        self.fly()
        return next(r.reason for r in reversed(self.reports) if r.code == 12)

    def said(self):
        """[(kind, line, text)] since the last time."""
        found = [(one.kind, one.line, one.text) for one in self.texts]
        self.texts.clear()
        return found

    def read(self, module, field):
        """The first number of a parameter."""
        self.send(*self.packets.read(f"flight.{module}", field))
        self.fly()
        import struct
        return struct.unpack(">d", self.reports[-1].data[:8])[0]


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """By whether it is the development build."""
    folder = tmp_path_factory.mktemp("procedures")
    (folder / "flight.py").write_text(MISSION)
    (folder / "world.py").write_text(WORLD)
    sim = fledge.load(folder)
    mission = export.read(sim)
    composed = export.compose(sim, mission)
    found = {}
    for development in (False, True):
        library = toolchain.library("host", development)
        sources = [*micropython._sources(composed, folder / str(development), [build.ROOT], library),
                   *(build.ROOT / path for path in build.RUNNER if path != "targets/linux/main.c"),
                   build.ROOT / "targets/micropython/testing/link.c"]
        found[development] = build.program(
            folder / str(development), "link", sources, [(folder / str(development) / "c").resolve(), build.ROOT],
            library.compiler, library.flags, ["-no-pie", "-lm"], archives=[library.archive])
    dictionary = Dictionary.load(next((folder / "False" / "c").glob("*_packets.json")))
    return SimpleNamespace(built=found, dictionary=dictionary)


@pytest.fixture
def flight(programs):
    one = Flying(programs.built[False], programs.dictionary)
    yield one
    one.process.stdin.close()
    assert one.process.wait() == 0


def test_a_procedure_waits_changes_a_mode_and_a_gain(flight):
    assert flight.start("""
from fledge.units import s

def main(f):
    print("mode", f.active_mode, f.control.K)
    f.enter("science")
    yield wait(3 * s)
    f.control.K = 3.0
    f.wheels.u_max = 0.5
    while f.control.torque.head.sequence < 9:
        yield
    print(f.active_mode)
""") == Reason.OK
    assert flight.said() == [(Kind.PROCEDURE_STARTED, 0, ""), (Kind.PRINTED, 0, "mode rest 2.5")]
    flight.fly(2)
    assert flight.read("control", "K") == 2.5          # it is written at the end of this instant, the third
    assert flight.read("control", "K") == 3.0
    flight.fly(20)
    assert flight.said() == [(Kind.PRINTED, 0, "science"), (Kind.PROCEDURE_ENDED, 0, "")]
