# SPDX-License-Identifier: Apache-2.0
"""What the tests of `fledge up` share: programs that take part, and what is left of them."""
import os
import subprocess
import sys
import time
import uuid
from pathlib import Path

import pytest

from fledge.disk import build_folder
from tests.waiting import PATIENCE

ROOT = Path(__file__).resolve().parents[4]
BUILT = build_folder() / "cosim"
GUARD = str(BUILT / "fledge_guard")

# A mass and a spring that pulls it back: two programs that wait for one another at each instant.
MASS = """
import os, sys, time
from fledge_node import Node, ms
if "CHILD" in os.environ:  # that has to be killed, in a session of its own
    import subprocess
    subprocess.Popen(["sh", "-c", "trap '' TERM; sleep 600 & sleep 600"], start_new_session=True)
node = Node(every=10 * ms)
node.reads("/spring/force", "next_instant")
node.writes("/mass/state", "State", "float64[2] x  # x [m] (2) position", initial={"x": [1, 2]})
x, v = [1.0, 2.0], [0.0, 0.0]

@node.step
def step(t):
    global x, v
    if not os.path.exists("go"):
        time.sleep(float(os.environ.get("NAP", 0)))
    force = node["/spring/force"]["F"]
    v = [v[i] + 0.01 * force[i] for i in range(2)]
    x = [x[i] + 0.01 * v[i] for i in range(2)]
    node["/mass/state"] = {"x": x}
    if t % 10**8 == 0:
        print("the mass is at", x[0])
    if t == int(os.environ.get("STAYS_AT", -1)) * 10**9:  # until the test lets it go on
        while not os.path.exists("go"):
            time.sleep(0.01)

node.run()
print("the mass leaves")
time.sleep(float(os.environ.get("LINGERS", 0)))
"""
SPRING = """
import atexit, os, sys, time
from fledge_node import Node, ms
print("the spring is there")
node = Node(every=10 * ms)
node.reads("/mass/state", "same_instant")
node.writes("/spring/force", "Force", "float64[2] F  # F [N] (2) force")

@node.step
def step(t):
    if t == int(os.environ.get("BREAKS_AT", -1)) * 10**9:
        atexit.register(time.sleep, 1.5)  # the program ends later than its node, as on a loaded machine
        raise ValueError("the spring breaks")
    if t == int(os.environ.get("HANGS_AT", -1)) * 10**9 and not os.path.exists("hung"):
        open("hung", "w").close()
        time.sleep(600)
    node["/spring/force"] = {"F": [-x for x in node["/mass/state"]["x"]]}

node.run()
"""
PAIR = """
simulation = "{simulation}"
until = {until}
{top}
[[node]]
name = "mass"
command = ["{python}", "mass.py"]
{mass}
[[node]]
name = "spring"
command = ["{python}", "spring.py"]
{spring}
"""


# Sets the pace of a run to what a test writes. A test that acts while a run flies gives it a slow pace until it has
# acted: so the run does not end before, however busy the machine is.
HAND = """
import os, time
from fledge.cosim.steering import Steering
hand = Steering.of_run()
while True:
    if os.path.exists("pace"):
        hand.pace(float(open("pace").read()))
        os.remove("pace")
    time.sleep(0.01)
"""


def steered(folder):
    """Of a file for `fledge up`: the program that does so."""
    (folder / "hand.py").write_text(HAND)
    return f'\n[[asynchronous]]\nname = "hand"\ncommand = ["{sys.executable}", "hand.py"]\nsteers = true\n'


def set_pace(folder, speed):
    """0: from here on as fast as possible."""
    (folder / "pace.new").write_text(str(speed))
    (folder / "pace.new").rename(folder / "pace")


def write_pair(folder, until=2, simulation="pair", top="", mass="", spring=""):
    """A SIM.toml with the two programs, in a folder."""
    (folder / "mass.py").write_text(MASS)
    (folder / "spring.py").write_text(SPRING)
    file = folder / "pair.toml"
    file.write_text(PAIR.format(until=until, simulation=simulation, top=top, mass=mass, spring=spring,
                                python=sys.executable))
    return file


class Mark:
    """Finds whatever was started, by a variable that all descendants inherit."""

    def __init__(self):
        self.value = f"FLEDGE_MARK={uuid.uuid4().hex}"
        self.env = os.environ | dict([self.value.split("=")])

    def processes(self):
        """(pid, command line) of all that live."""
        lines = []
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit() or int(entry.name) == os.getpid():
                continue
            try:
                if self.value.encode() in (entry / "environ").read_bytes().split(b"\0"):
                    if (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[0] not in "ZX":
                        words = (entry / "cmdline").read_bytes().split(b"\x00")
                        lines.append((int(entry.name), b" ".join(words).decode(errors="replace").strip()))
            except OSError:
                continue
        return lines

    def gone(self, seconds=PATIENCE):
        """What still lives after so long; [] as soon as nothing does."""
        until = time.monotonic() + seconds
        while (left := self.processes()) and time.monotonic() < until:
            time.sleep(0.02)
        return left

    def kill(self):
        for pid, _ in self.processes():
            try:
                os.kill(pid, 9)
            except OSError:
                pass


def sockets_and_memory(simulation):
    """What there is of a simulation besides processes: sockets, with a file or without, and memory."""
    sockets = [line for line in Path("/proc/net/unix").read_text().splitlines() if simulation in line]
    files = [str(path) for folder in ("/dev/shm", "/tmp") for path in Path(folder).glob(f"*{simulation}*")]
    return sockets + files


def up(file, *options, mark=None, folder=None, **kwargs):
    """Run `fledge up`; returns the finished process."""
    env = (mark.env if mark else os.environ) | kwargs.pop("env", {})
    return subprocess.run([sys.executable, "-m", "fledge.cli", "up", str(file), *options], cwd=folder or file.parent,
                          env=env, capture_output=True, text=True, **kwargs)


@pytest.fixture
def mark():
    """All that a test starts has ended when it has."""
    marker = Mark()
    yield marker
    left = marker.gone()
    marker.kill()
    assert not left
