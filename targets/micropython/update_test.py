# SPDX-License-Identifier: Apache-2.0
"""Modules whose update is Python, in flight: on the desktop and under MicroPython with the same bits; and what such an
update may do wrong there, which its module alone bears."""

import re
import shutil
import subprocess

import pytest

from fledge import cli
from fledge.commands import Dictionary, decoded, read_script
from tests.needs import skip_unless_on

pytestmark = pytest.mark.long("flies on two targets many times")

WORLD = """
from fledge import world
from fledge.units import kg, m, ms, rad, s


def build(w, f):
    w.craft = world.Spacecraft(I_B=[700, 700, 800] * kg * m**2, sigma_BN=[0.1, 0.2, -0.3],
                               omega_BN_B=[0.001, -0.01, 0.03] * rad / s)
    w.nav = world.Navigation()
    w.connect(w.craft.state >> w.nav.truth, w.nav.attitude >> f.tracking.attitude)
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
"""

FLIGHT = """
from fledge import flight as fsw
from fledge.units import N, m, s

ON_DESKTOP = hasattr(fsw, "TYPES")      # where the first error would end the run: there a module holds its output


def begin(m):
    m.z[0] = 0.25


def feedback(m, t, dt):
    if m.error.head.quality == 0:
        m.held(m.torque)
        return
    for i in range(3):
        m.z[i] += m.error.sigma_BR[i] * dt
        m.torque.torque_B[i] = -m.K * (m.error.sigma_BR[i] + 1e-4 * m.z[i]) - m.P[i][i] * m.error.omega_BR_B[i]
    m.publish(m.torque, quality="DEGRADED" if t < 5 else "GOOD")


def weigh(m, t, dt):
    for i in range(3):
        m.vehicle.I_B[i][i] = 2.0 * m.I_B[i][i]
    m.publish(m.vehicle)


def allocates(m, t):
    m.reference.omega_RN_N = [t, 0, 0]


def overruns(m, t):
    while True:
        pass


def clings(m, t):
    while True:
        try:
            overruns(m, t)
        except Exception:
            pass


def dives(m, t):
    dives(m, t)


def divides(m, t):
    m.reference.sigma_RN[1] = 1 / (t - t)


def misnames(m, t):
    m.reference.sigma_RM = t


def missizes(m, t):
    m.reference.sigma_RN = (1, 2)


def mistypes(m, t):
    m.reference.sigma_RN = "north"


def mispublishes(m, t):
    m.publish(m.sigma_RN)


def meddles(m, t):
    others[0].K = 1.0


def grows(m, t):
    others.extend(WRONGS)


WRONGS = (allocates, overruns, clings, dives, divides, misnames, missizes, mistypes, mispublishes, meddles, grows)
others = []


def failing(wrong):
    \"\"\"An update that goes wrong from 2 s to 4 s, after it has begun to write.\"\"\"
    def update(m, t, dt):
        wrongly = 2 <= t < 4
        if wrongly and ON_DESKTOP:
            m.held(m.reference)
            return
        m.reference.sigma_RN[0] = 0.001 * t
        if wrongly:
            wrong(m, t)
        m.publish(m.reference)

    return update


def build(f):
    f.still = fsw.InertialPointing(sigma_RN=[0.1, -0.1, 0.2])
    f.tracking = fsw.TrackingError()
    f.control = fsw.MrpFeedback(K=2.5 * N * m, P=45.0, update=feedback, reset=begin)
    others.append(f.control)
    f.vehicle = fsw.VehicleConfig(I_B=700.0, update=weigh)
    f.connect(f.still.reference >> f.tracking.reference, f.tracking.error >> f.control.error,
              f.vehicle.vehicle >> f.control.vehicle)
    wrong = []
    for one in WRONGS:
        name = one.__name__
        setattr(f, name, fsw.InertialPointing(update=failing(one), turns=500))
        wrong.append(getattr(f, name))
    f.task("wrong", every=0.5 * s, run=wrong)
    gnc = f.task("gnc", every=0.5 * s, run=[f.still, f.tracking, f.control])
    f.mode("work", [gnc])
    f.mode("rest", [])
    seconds = f.watch(f.divides.reference).sigma_RN[0]      # in milliradians
    f.event("tired", when=seconds > 0.006, enter=f.rest)
    f.event("awake", when=seconds > 0.008, enter=f.work)     # what is active again is reset first: begin()
"""

SCENARIOS = """
from fledge.units import s


def fly(sim):
    sim.run(10 * s)
"""

# What the ground reads of each, at the line of that error in flight.py.
REASONS = {
    "allocates": ("omega_RN_N = [", r"MemoryError: this allocates \d+ bytes, but after the start nothing may allocate"),
    "overruns": ("        pass", "it takes more than 500 turns of loops and returns"),
    "clings": ("        pass", "it takes more than 500 turns of loops and returns"),
    "dives": ("    dives(m, t)", "RuntimeError: "),
    "divides": ("1 / (t - t)", "ZeroDivisionError: "),
    "misnames": ("sigma_RM", r"AttributeError: flight.misnames.reference has no attribute 'sigma_RM'"),
    "missizes": ("= (1, 2)", r"SetupError: flight.missizes.reference.sigma_RN: expected shape \(3\)"),
    "mistypes": ('"north"', r"SetupError: flight.mistypes.reference.sigma_RN: expected shape \(3\)"),
    "mispublishes": ("m.publish(m.sigma_RN)", r"SetupError: flight.mispublishes.publish: expected an output of"),
    "meddles": (".K = 1.0", "SetupError: flight.control.K is of another module: an update writes its own alone"),
    "grows": ("others.extend(WRONGS)", "MemoryError: "),
}


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    folder = tmp_path_factory.mktemp("missions") / "unruly"
    folder.mkdir()
    for name, text in (("flight.py", FLIGHT), ("world.py", WORLD), ("scenarios.py", SCENARIOS)):
        (folder / name).write_text(text)
    return folder


@pytest.fixture(scope="module", params=["micropython", "leon3-micropython"])
def flown(request, mission):
    """The name of a target, and the folder with what the flight there left."""
    skip_unless_on(request.param)
    out = mission.parent / request.param
    assert cli.main(["fly", str(mission), "--on", request.param, "--out", str(out)]) == 0
    return request.param, out


def test_what_goes_wrong_in_an_update_stays_in_its_module(flown):
    """The flight was compared with the desktop's, where the same modules hold their outputs at the same times."""
    name, out = flown
    log = (out / f"{name}.log").read_text()
    assert "flight.control 17 updates of the script, 0 calls failed; at most 9 of 5000 turns; longest " in log
    for module in REASONS:
        assert f"flight.{module} 21 updates of the script, 4 calls failed; at most " in log


def test_a_module_that_is_python_only_there_is_refused(mission, tmp_path, capfd):
    folder = tmp_path / "unruly"
    shutil.copytree(mission, folder)
    (folder / "flight.py").write_text(FLIGHT.replace(
        "fsw.TrackingError()", "fsw.TrackingError(update=None if ON_DESKTOP else feedback)"))
    assert cli.main(["fly", str(folder), "--on", "micropython", "--out", str(tmp_path / "out")]) == 1
    assert "the update of tracking is Python only there" in capfd.readouterr().err


@pytest.mark.parametrize("wrong, why", [
    ("1 / 0 if not ON_DESKTOP else 0", "ZeroDivisionError: divide by zero"),
    ("m.publish(m.torque) if not ON_DESKTOP else 0",
     "SetupError: flight.control.publish() is for its own update in Python, while it runs"),
])
def test_a_reset_that_fails_at_the_start_is_refused_before_flight(mission, tmp_path, capfd, wrong, why):
    folder = tmp_path / "unruly"
    shutil.copytree(mission, folder)
    (folder / "flight.py").write_text(FLIGHT.replace("m.z[0] = 0.25", wrong))
    assert cli.main(["fly", str(folder), "--on", "micropython", "--out", str(tmp_path / "out")]) == 1
    assert f"{folder}/flight.py, line 9: {why}" in capfd.readouterr().err
    done = subprocess.run([tmp_path / "out/micropython/unruly", "--clock"], capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr == f"unruly: script: unruly/flight.py, line 9: {why}\n"


@pytest.mark.parametrize("module", REASONS)
def test_the_ground_reads_module_line_and_reason(flown, module):
    name, out = flown
    where, why = REASONS[module]
    line = 1 + next(i for i, text in enumerate(FLIGHT.splitlines()) if where in text)
    dictionary = Dictionary.load(out / "c/unruly_packets.json")
    packets = read_script((out / f"{name}.telemetry.txt").read_text())
    texts = [text for text in (decoded(dictionary, packet.packet).content for packet in packets)
             if text.text.startswith(f"flight.{module}, ")]
    assert [(text.t, text.kind.name, text.line, text.lost) for text in texts] == [
        (t, "SCRIPT", line, 0) for t in (2_000_000_000, 2_500_000_000, 3_500_000_000)]
    for text, failure in zip(texts, (1, 2, 4)):
        assert re.match(rf"flight.{module}, failure {failure}: unruly/flight.py, line {line}: {why}", text.text)
    assert re.search(rf"flight.{module}.failure unruly/flight.py, line {line}: {why}",
                     (out / f"{name}.log").read_text())


# --- bits --------------------------------------------------------------------------------------------

BITS = """
import math
from math import atan2
from fledge import flight as fsw
from fledge.units import deg, s
from .shapes import bump

GAIN = 2.0 ** 0.5 * math.sin(0.7)


def angles(m, t, dt):
    x = t * 0.7310585786 + 0.1
    m.reference.sigma_RN[0] = math.sin(x) + math.asin(x / 100)
    m.reference.sigma_RN[1] = math.cos(x) * math.acos(x / 100)
    m.reference.sigma_RN[2] = math.tan(x) + bump(x)
    m.reference.omega_RN_N[0] = atan2(x, 0.3) + math.atan(x)
    m.reference.omega_RN_N[1] = math.exp(x * 0.1)
    m.reference.omega_RN_N[2] = math.log(x + 1)
    m.reference.domega_RN_N[0] = math.log(x + 1, 10)
    m.reference.domega_RN_N[1] = math.degrees(x) + math.radians(x)
    m.reference.domega_RN_N[2] = GAIN * math.fmod(x, 0.3)
    m.publish(m.reference)


def powers(m, t, dt):
    x = t * 0.7310585786 + 0.1
    m.reference.sigma_RN[0] = x ** 1.5
    m.reference.sigma_RN[1] = x ** 0.5 + x ** 3
    m.reference.sigma_RN[2] = x ** -2
    m.reference.omega_RN_N[0] = 2.0 ** x
    m.reference.omega_RN_N[1] = math.pow(x, 2.2) + pow(x, -0.25)
    m.reference.omega_RN_N[2] = m.reference.sigma_RN[0]
    m.reference.omega_RN_N[2] **= 3
    m.reference.domega_RN_N[0] = x
    m.reference.domega_RN_N[0] **= m.reference.sigma_RN[2]
    m.reference.domega_RN_N[1] = 3 ** -int(x)
    x **= 7
    m.reference.domega_RN_N[2] = x
    m.publish(m.reference)


def rounds(m, t, dt):
    k = int(t * 2)
    x = t * 0.7310585786 + 0.1
    m.reference.sigma_RN[0] = round(k + 0.005, 2) + round(x, 1)
    m.reference.sigma_RN[1] = round(k / 8 + 0.0125, 3)
    m.reference.sigma_RN[2] = round(k * 0.05 + 0.025, 2)
    m.reference.omega_RN_N[0] = round(k * 1e15 + 0.5, 1)
    m.reference.omega_RN_N[1] = round(k * 137.5, -1) + round(k * 137, -1)
    m.reference.omega_RN_N[2] = round(k + 0.5) + round(-x, 2)
    m.reference.domega_RN_N[0] = x % 0.3 + -x % 0.7
    m.reference.domega_RN_N[1] = x // 0.3 - -x // 0.7
    m.reference.domega_RN_N[2] = int(x * 1e6) % 1000003 // -7 / 9
    m.publish(m.reference)


def counts(m, t, dt):
    n = m.times.burns
    n[0], n[1] = int(t), 7.0
    m.times.off[0] = (n[0] - n[1]) * 1000000007 // 3
    m.times.on[0] = round(1e9 * ((n[0] - n[1]) ** 3 / 7 + sum(n) * 2 ** -n[1] + m.start[1] / n[1]))
    m.publish(m.times)


def rest(m, t, dt):
    a = m.reference.sigma_RN
    for i in range(3):
        a[i] = 0.1 * i - t
    m.reference.omega_RN_N[0] = sum(a)
    m.reference.omega_RN_N[1] = max(a) - min(a)
    for x in a:
        m.reference.omega_RN_N[2] += x ** 2
    m.publish(m.reference)


def build(f):
    f.angles = fsw.InertialPointing(update=angles, sigma_RN=[GAIN / 9, 0.1 ** 1.5, math.cos(20 * deg)])
    f.powers = fsw.InertialPointing(update=powers)
    f.rounds = fsw.InertialPointing(update=rounds)
    f.rest = fsw.InertialPointing(update=rest)
    f.counts = fsw.BurnSchedule(update=counts, n=2, start=[1, 2] * s, duration=1 * s, thruster=[0, 7])
    f.task("gnc", every=0.5 * s, run=[f.angles, f.powers, f.rounds, f.rest, f.counts])
"""
SHAPES = """
import math

root = lambda y: y ** 0.3


def bump(x):
    return math.exp(-x ** 2) + root(abs(math.sin(x)))
"""


@pytest.mark.parametrize("name", ["micropython", "leon3-micropython"])
def test_an_update_has_the_bits_of_the_desktop(name, tmp_path, capfd):
    """Flying compares what both record."""
    skip_unless_on(name)
    folder = tmp_path / "bits"
    folder.mkdir()
    for file, text in (("flight.py", BITS), ("shapes.py", SHAPES), ("world.py", "def build(w, f):\n    pass\n"),
                       ("scenarios.py", SCENARIOS)):
        (folder / file).write_text(text)
    assert cli.main(["check", str(folder)]) == 0
    assert cli.main(["fly", str(folder), "--on", f"desktop,{name}", "--out", str(tmp_path / "out")]) == 0
    printed = capfd.readouterr().out
    assert " none " in printed and printed.count(" 21 updates of the script, 0 calls failed") == 5
