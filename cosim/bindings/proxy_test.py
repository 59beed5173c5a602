# SPDX-License-Identifier: Apache-2.0
"""Nodes in Python and C++ behind a bad network (testing/proxy.py): delays and pieces of any size change no bit, and a
network that breaks ends the run with the name of the node."""
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import _core

from tests.circles import long_after

HERE = Path(__file__).resolve().parent
CONTROLLER = Path(_core.__file__).resolve().parents[1] / "cosim/fledge_controller"
pytestmark = pytest.mark.skipif(not CONTROLLER.exists(), reason="the controller is not built")

sys.path[:0] = [str(HERE / "python"), str(HERE / "testing")]
from proxy import Proxy  # noqa: E402

MASS = """
from fledge_node import Node, ms
import sys, json
node = Node("spring", "mass", sys.argv[1], every=10 * ms)
node.reads("/spring/force", "next_instant")
node.writes("/mass/state", "State", '''
    int64 t  # t [ns]
    uint32 quality  # quality [-]
    uint32 sequence  # sequence [-]
    float64[2] x  # x [m] (2) position
    float64[2] v  # v [m/s] (2) velocity
''', initial={"x": [1, 2]})
x, v, seen = [1.0, 2.0], [0.0, 0.0], []

@node.step
def step(t):
    global x, v
    force = node["/spring/force"]["F"]
    v = [v[i] + 0.01 * force[i] for i in range(2)]
    x = [x[i] + 0.01 * v[i] for i in range(2)]
    node["/mass/state"] = {"x": x, "v": v}
    seen.append([t, force[0], x[0]])

node.run()
print(json.dumps(seen))
"""
SPRING = """
from fledge_node import Node, ms
import sys
node = Node("spring", "spring", sys.argv[1], every=10 * ms)
node.reads("/mass/state")
node.writes("/spring/force", "Force", "float64[2] F  # F [N] (2) force")

@node.step
def step(t):
    node["/spring/force"] = {"F": [-x for x in node["/mass/state"]["x"]]}

node.run()
"""
SPRINGS = {"python": [sys.executable, "-c", SPRING], "c++": [CONTROLLER.with_name("fledge_spring")]}


def by_hand(n):
    x, v, force, seen = 1.0, 0.0, 0.0, []
    for k in range(n):
        v = v + 0.01 * force
        x = x + 0.01 * v
        seen.append([k * 10_000_000, force, x])
        force = -x
    return seen


@pytest.fixture
def start():
    started = []

    def popen(*command):
        started.append(subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONPATH": str(HERE / "python")}))
        return started[-1]

    yield popen
    for program in started:
        program.kill()
        program.communicate()


def fly(start, spring, until=1.0, options=(), mass_network=None, **network):
    """(complaints of the controller, what the mass saw in a whole run, the spring's exit code and complaint)"""
    controller = start(CONTROLLER, "--simulation", "spring", "--until", str(until), "--address", "tcp://127.0.0.1:*",
                       "--shared-memory", "forbidden", "--node", "mass", "--node", "spring", *options)
    address = controller.stdout.readline().removeprefix("listening at ").strip()
    with Proxy(address, **(mass_network or {})) as near_mass, Proxy(address, **network) as near_spring:
        mass = start(sys.executable, "-c", MASS, near_mass.address)
        other = start(*SPRINGS[spring], near_spring.address)
        complaints = controller.communicate()[1]
        seen = None if complaints else json.loads(mass.communicate()[0])
    output = other.communicate()[1]
    return complaints, seen, other.returncode, output


@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize("piece, delay, jitter", long_after(
    1, [(7, 0.0, 0.0), (100, 0.0, 0.002), (65536, 0.005, 0.01)], "delays of milliseconds, each step"))
def test_delays_and_pieces_change_no_bit(start, spring, piece, delay, jitter):
    network = {"piece": piece, "delay": delay, "jitter": jitter}
    complaints, seen, code, _ = fly(start, spring, seed=1, mass_network={**network, "seed": 2}, **network)
    assert (complaints, code) == ("", 0)
    assert seen == by_hand(101)


@pytest.mark.long("each waits 10 s for the node to leave")
@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize("cut_after", [0, 40, 100, 200, 1000, 3000, 20_000])
def test_a_connection_that_breaks_ends_the_run_with_the_nodes_name(start, spring, cut_after):
    # Until it has its own socket, another program may take its place: the run waits for one.
    complaints, _, code, output = fly(start, spring, until=1e6, options=("--join", "10"), cut_after=cut_after, piece=50)
    assert "spring: its connection is gone" in complaints, complaints
    assert code == 1 and "the controller is gone" in output


@pytest.mark.parametrize("stall_after, found", [
    (20, "spring: it did not answer within 1 s of its greeting"),
    pytest.param(5000, "spring: it did not answer within 5 s (", marks=pytest.mark.long("waits 5 s"))])
def test_a_connection_that_falls_silent_ends_the_run_with_the_nodes_name(start, stall_after, found):
    def silent(spring):
        return fly(start, spring, until=1e6, options=("--greet", "1", "--join", "5", "--reply", "5"),
                   stall_after=stall_after)

    with ThreadPoolExecutor() as pool:      # they wait
        for complaints, _, code, _ in pool.map(silent, SPRINGS):
            assert found in complaints, complaints
            assert code == 1
