# SPDX-License-Identifier: Apache-2.0
"""Programs in Python and C as nodes: real processes around the real controller, and what happens when one dies."""
import ctypes
import functools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest
import zmq

import _core
from tests.needs import skip_without
from tests.waiting import PATIENCE, wait_for

HERE = Path(__file__).resolve().parent
CONTROLLER = Path(_core.__file__).resolve().parents[1] / "cosim/fledge_controller"
SPRING_IN_C = CONTROLLER.with_name("fledge_spring")
pytestmark = pytest.mark.skipif(not CONTROLLER.exists(), reason="the controller is not built")

sys.path.insert(0, str(HERE))
from fledge_node import Node, NodeError, Observer, Schema, _Reader, _Writer, ms, text  # noqa: E402

# The two programs of most tests: a mass, and a spring that pulls it back.
MASS = """
from fledge_node import Node, ms
import sys, json
node = Node("spring", "mass", sys.argv[1], every=10 * ms)
node.reads("/spring/force", sys.argv[2])
node.writes("/mass/state", "State", '''
    fledge/Head head  # head
    float64[2] x  # x [m] (2) position
    float64[2] v  # v [m/s] (2) velocity
    ''' + '=' * 80 + '''
    MSG: fledge/Head
    int64 t  # t [ns]
    uint32 quality  # quality [-]
    uint32 sequence  # sequence [-]
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

print(json.dumps({"reason": node.run(), "seen": seen, "seed": node.seed}))
"""
SPRING = """
from fledge_node import Node, ms
import sys, json
node = Node("spring", "spring", sys.argv[1], every=10 * ms)
node.reads("/mass/state", sys.argv[2])
node.writes("/spring/force", "Force", "float64[2] F  # F [N] (2) force")
seen = []

@node.step
def step(t):
    state = node["/mass/state"]
    node["/spring/force"] = {"F": [-x for x in state["x"]]}
    seen.append([t, state["head.t"], state["head.sequence"], state["x"][0]])

print(json.dumps({"reason": node.run(), "seen": seen}))
"""


def start(code, *args):
    return subprocess.Popen([sys.executable, "-c", code, *args], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            text=True, env=os.environ | {"PYTHONPATH": str(HERE)})


class Controller:
    """The controller's program. `address` is where it listens."""

    def __init__(self, *options, address="tcp://127.0.0.1:*", until="1"):
        status, writer = os.pipe()
        self.process = subprocess.Popen(
            [CONTROLLER, "--simulation", "spring", "--until", until, "--address", address, "--seed", "7",
             "--status", str(writer), *options],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, pass_fds=[writer])
        os.close(writer)
        self._status = os.fdopen(status)
        self.address = self.process.stdout.readline().removeprefix("listening at ").strip()

    def wait_for(self, **states):
        """Until these nodes are so: "greeted" (not yet on its own socket), "joining", "running" (has stepped)."""
        for line in self._status:
            nodes = {node["name"]: node for node in json.loads(line).get("nodes", [])}
            if nodes and all(nodes[name]["state"] == state and (state != "running" or nodes[name]["ticks"] > 0)
                             for name, state in states.items()):
                return
        raise AssertionError(f"the run is over, and it was never {states}")

    def end(self):
        """(exit code, what it complained of)"""
        _, errors = self.process.communicate()
        self._status.close()
        return self.process.returncode, errors.strip()


@pytest.fixture
def programs():
    """Started programs; all have ended when the test has, or are killed and the test fails."""
    started = []
    yield started
    alive = []
    for p in started:
        try:
            p.wait(PATIENCE)    # it may be about to end
        except subprocess.TimeoutExpired:
            alive.append(p)
            p.kill()
            p.communicate()
    assert not alive, "a program outlived its run"


def start_spring(language, address, latency="same_instant", how="", **environment):
    """SPRING in Python; in C, as cosim/bindings/c/spring.c says."""
    if language == "python":
        return start(SPRING, address, latency)
    number = ["same_instant", "next_instant", "next_exchange"].index(latency)
    return subprocess.Popen([SPRING_IN_C, address, str(number), "prints " + how], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True, env=os.environ | environment)


def spring(programs, controller, latencies=("next_instant", "same_instant"), language="python", how=""):
    pair = [start(MASS, controller.address, latencies[0]),
            start_spring(language, controller.address, latencies[1], how)]
    programs += [*pair, controller.process]
    return pair


in_both = pytest.mark.parametrize("language", ["python", "c"])


def result(program):
    out, errors = program.communicate()
    assert program.returncode == 0, errors
    return json.loads(out)


def alone(n):
    """The same by hand: the mass feels the force of the instant before."""
    x, v, force, seen = 1.0, 0.0, 0.0, []
    for k in range(n):
        v = v + 0.01 * force
        x = x + 0.01 * v
        seen.append([k * 10 * ms, force, x])
        force = -x
    return seen


@in_both
@pytest.mark.parametrize("transport", ["tcp", "ipc"])
def test_two_programs_give_the_bits_of_one(programs, transport, language):
    address = "tcp://127.0.0.1:*" if transport == "tcp" else f"ipc://@fledge-{language}-{os.getpid()}"
    controller = Controller("--node", "mass", "--node", "spring", address=address)
    mass, force = spring(programs, controller, language=language)
    assert controller.end() == (0, "")
    mass, force = result(mass), result(force)
    assert mass["seen"] == alone(101)
    assert mass["reason"] == "" and mass["seed"] == 7
    assert language == "python" or (force["seed"], force["end"]) == (7, 10**9)
    # The head of what it reads was filled in: the time, and a count from 1.
    assert force["seen"] == [[t, t, k + 1, x] for k, (t, _, x) in enumerate(mass["seen"])]


def test_a_program_in_c_reports_its_errors(programs):
    controller = Controller("--node", "mass", "--node", "spring")
    short = MASS.replace("float64[2] v  # v [m/s] (2) velocity", "").replace(', "v": v}', "}")
    programs += [start(short, controller.address, "next_instant"),
                 subprocess.Popen([SPRING_IN_C, controller.address], stderr=subprocess.PIPE),
                 controller.process]
    code, errors = controller.end()
    why = "/mass/state has 32 bytes where it is written, which is not the size of the struct here"
    assert (code, errors) == (1, "the run ended early: spring: it failed: " + why)
    assert programs[1].communicate()[1].decode() == f"spring: {why}\n" and programs[1].returncode == 1
    programs[0].communicate()


@in_both
def test_a_definition_is_needed_on_one_side_only(programs, language):
    controller = Controller("--node", "mass", "--node", "spring")
    force = '"float64[2] F  # F [N] (2) force"'
    reader = MASS.replace('sys.argv[2])', f'sys.argv[2], name="Force", text={force})')
    writer = SPRING.replace(f', "Force", {force}', "")
    assert reader != MASS and writer != SPRING
    programs += [start(reader, controller.address, "next_instant"),
                 start(writer, controller.address, "same_instant") if language == "python" else
                 start_spring("c", controller.address, how="reader"), controller.process]
    assert controller.end() == (0, "")
    assert result(programs[0])["seen"] == alone(101)


@in_both
def test_at_exchanges_each_node_sees_the_message_of_the_step_before(programs, language):
    controller = Controller("--node", "mass", "--node", "spring")
    mass, force = spring(programs, controller, ("next_exchange", "next_exchange"), language)
    assert controller.end() == (0, "")
    positions = [x for _, _, x in result(mass)["seen"]]
    assert [x for *_, x in result(force)["seen"]] == [1.0] + positions[:-1]


@in_both
@pytest.mark.parametrize("victim", [0, 1])
def test_a_killed_program_ends_the_run_for_all(programs, victim, language):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    pair = spring(programs, controller, language=language)
    controller.wait_for(mass="running", spring="running")
    pair[victim].kill()
    code, errors = controller.end()
    name = ["mass", "spring"][victim]
    assert code == 1 and re.match(f"the run ended early: {name}: its connection is gone", errors), errors
    out, _ = pair[1 - victim].communicate()
    assert name + ": its connection is gone" in json.loads(out)["reason"]


def test_the_controller_names_a_node_that_is_killed_before_the_run(programs):
    controller = Controller("--node", "mass", "--node", "spring")
    programs += [start(MASS, controller.address, "next_instant"), controller.process]
    controller.wait_for(mass="joining")
    programs[0].kill()
    assert controller.end() == (1, "the run ended early: mass: its connection is gone")


@pytest.mark.long("a node stands still for 10 s")
@pytest.mark.parametrize("transport", ["tcp", "ipc"])
def test_a_debugger_may_stop_a_node_for_long(programs, transport):
    address = "tcp://127.0.0.1:*" if transport == "tcp" else f"ipc://@fledge-stopped-{os.getpid()}"
    controller = Controller("--node", "mass", "--node", "spring", "--reply", "0", until="40", address=address)
    mass, force = spring(programs, controller)
    controller.wait_for(mass="running", spring="running")
    force.send_signal(signal.SIGSTOP)
    time.sleep(8)  # a heartbeat of libzmq would miss an answer after 5 s
    force.send_signal(signal.SIGCONT)
    force.communicate()
    assert controller.end() == (0, "")
    assert result(mass)["seen"] == alone(4001)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can start programs of another user")
@pytest.mark.parametrize("allows", ["neither", "the node", "both"])
def test_over_ipc_another_user_takes_part_where_both_sides_allow_it(programs, allows):
    with tempfile.TemporaryDirectory() as folder:  # which the other user can read
        os.chmod(folder, 0o755)
        shutil.copy(HERE / "fledge_node.py", folder)
        controller = Controller("--node", "mass", "--node", "spring", *(["--any-user"] if allows == "both" else []),
                                address=f"ipc://@fledge-users-{os.getpid()}-{allows[-4:]}")
        programs.append(subprocess.Popen(
            [sys.executable, "-c", MASS, controller.address, "next_instant"], stdout=subprocess.PIPE, cwd=folder,
            stderr=subprocess.PIPE, text=True, user=65534, group=65534, extra_groups=[],
            env={"PYTHONPATH": folder, "FLEDGE_ANY_USER": str(int(allows != "neither"))}))
        programs += [start(SPRING, controller.address, "same_instant"), controller.process]
        if allows == "both":
            assert controller.end() == (0, "")
            assert result(programs[0])["seen"] == alone(101)
            return
        _, errors = programs[0].communicate()
        # If the controller is quick to break off, the node cannot ask whose the connection was.
        assert ("another user" if allows == "neither" else "breaks off") in errors
        controller.wait_for(spring="joining")       # a program that connects after the end would wait
        controller.process.send_signal(signal.SIGTERM)
        assert controller.end() == (1, "the run ended early: the user ended it")


@pytest.fixture
def network():
    """(the command that starts a program behind a network, the address on this side, what breaks the network)"""
    name = f"fledge-{os.getpid()}"
    near = f"fl{os.getpid() % 10**6}a"
    far = near[:-1] + "b"

    def ip(*words):
        return subprocess.run(["ip", *words], capture_output=True).returncode

    skip_without("iproute2")
    if ip("netns", "add", name):
        pytest.skip("no network namespace can be made here")
    try:
        failed = [ip(*words.split()) for words in (
            f"link add {near} type veth peer name {far} netns {name}", f"addr add 198.18.9.1/30 dev {near}",
            f"link set {near} up", f"-n {name} addr add 198.18.9.2/30 dev {far}", f"-n {name} link set {far} up")]
        assert not any(failed)
        yield ["ip", "netns", "exec", name], "198.18.9.1", lambda: ip("-n", name, "link", "set", far, "down")
    finally:
        ip("link", "del", near)     # at once; with its namespace it would go some time later
        ip("netns", "del", name)


@pytest.mark.long("waits until the network is given up")
@pytest.mark.parametrize("computes, limit", [(False, "60"), (True, "60"), (True, "0")])
def test_both_sides_notice_a_lost_network(programs, network, computes, limit):
    launcher, here, break_it = network
    controller = Controller("--node", "mass", "--node", "spring", "--reply", limit, "--unencrypted-beyond-machine",
                            until="1e6", address=f"tcp://{here}:*")
    slow = SPRING.replace("    state =", "    import time\n    time.sleep(60 if t else 0)\n    state =", 1)
    programs += [start(MASS, controller.address, "next_instant"), subprocess.Popen(
        [*launcher, sys.executable, "-c", slow if computes else SPRING, controller.address, "same_instant"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": str(HERE)}),
        controller.process]
    controller.wait_for(mass="running", spring="running")
    if limit == "0":
        time.sleep(2)       # the tick has arrived: without a limit, the kernel sends what did not arrive for minutes
    break_it()
    code, errors = controller.end()
    assert code == 1 and "spring: its connection is gone" in errors
    programs[0].communicate()   # the address that it had gone to is gone, too
    if computes:
        programs[1].kill()  # it would notice after its step
    else:
        assert "NodeError: the controller is gone" in programs[1].communicate()[1]


@in_both
def test_ctrl_c_of_the_controller_ends_all(programs, language):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    pair = spring(programs, controller, language=language)
    controller.wait_for(mass="running", spring="running")
    controller.process.send_signal(signal.SIGINT)
    assert controller.end() == (1, "the run ended early: the user ended it")
    assert [result(program)["reason"] for program in pair] == ["the user ended it"] * 2


@pytest.mark.parametrize("number, why", [(signal.SIGINT, "its connection is gone"),
                                         (signal.SIGTERM, "it failed: the program ended it")])
def test_a_program_in_c_is_killed_by_a_signal_or_handles_it(programs, number, why):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    mass, force = spring(programs, controller, language="c")
    controller.wait_for(mass="running", spring="running")
    force.send_signal(number)
    mass.communicate()
    code, errors = controller.end()
    assert code == 1 and "spring: " + why in errors
    _, errors = force.communicate()
    assert (force.returncode, errors) == ((-number, "") if number == signal.SIGINT
                                          else (1, "spring: the program ended it\n"))


@in_both
def test_a_node_reports_that_the_controller_was_killed(programs, language):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    pair = spring(programs, controller, language=language)
    controller.wait_for(mass="running", spring="running")
    controller.process.kill()
    controller.process.communicate()
    for program, prefix in zip(pair, ("NodeError: ", "NodeError: " if language == "python" else "spring: ")):
        _, errors = program.communicate()
        assert program.returncode == 1 and prefix + "the controller is gone" in errors


@pytest.mark.long("waits for a limit of time")
def test_the_reply_timeout_ends_a_step_that_hangs(programs):
    controller = Controller("--node", "mass", "--node", "spring", "--reply", "4")
    mass, force = spring(programs, controller, language="c", how="hangs")
    code, errors = controller.end()
    assert code == 1 and "spring: it did not answer within 4 s" in errors
    mass.communicate()
    force.kill()
    force.communicate()


def test_a_run_goes_on_without_a_node_if_the_policy_allows_it(programs):
    controller = Controller("--node", "mass", "--node", "spring:hold", until="200")
    mass, force = spring(programs, controller)
    controller.wait_for(mass="running", spring="running")
    force.kill()
    code, errors = controller.end()
    assert code == 0
    assert re.fullmatch(r"spring: its connection is gone \(it had reached .*\); its messages keep their last values",
                        errors)
    seen = result(mass)["seen"]
    assert len(seen) == 20001 and len({force for _, force, _ in seen[-1000:]}) == 1


@pytest.mark.parametrize("way", ["from the beginning", "from a snapshot"])
def test_a_new_program_goes_on_for_a_killed_one(programs, way):
    saving = MASS.replace("@node.step\n", """
import os, struct
@node.saves
def save():
    return struct.pack("<4d", *x, *v)

@node.restores
def restore(snapshot):
    numbers = struct.unpack("<4d", snapshot)
    x[:], v[:] = numbers[:2], numbers[2:]

@node.step
""") if way == "from a snapshot" else MASS
    dying = saving.replace("    seen.append", "    if t == 3 * 10**9: os.kill(os.getpid(), 9)\n    seen.append")
    controller = Controller("--node", "mass:restart,save=1", "--node", "spring", until="5")
    force = start(SPRING, controller.address, "same_instant")
    mass = start(dying.replace("import sys", "import os, sys"), controller.address, "next_instant")
    programs += [force, mass, controller.process]
    mass.communicate()
    assert mass.returncode == -signal.SIGKILL
    programs.append(start(saving, controller.address, "next_instant"))
    steps = result(programs[-1])["seen"]
    assert controller.end()[0] == 0
    whole = alone(501)
    # Its reader sees no difference.
    assert [row[3] for row in result(force)["seen"]] == [x for _, _, x in whole]
    first = 0 if way == "from the beginning" else steps[0][0] // (10 * ms)
    assert steps == whole[first:] and (way == "from the beginning" or 200 < first <= 300)


PROBE = """
from fledge_node import Node, ms
import sys, json
node = Node("spring", "probe", sys.argv[1], every=20 * ms)
node.reads("/mass/state", "same_instant")
node.reads("/spring/force", "next_instant")
seen = []

@node.step
def step(t):
    seen.append([t, node["/mass/state"]["x"][0], node["/spring/force"]["F"][0]])
    if t == 800 * ms:
        node.leave()

print(json.dumps({"reason": node.run(), "seen": seen}))
"""


@pytest.mark.parametrize("how", ["integral", "saves"])
def test_a_program_in_c_goes_on_for_a_killed_one(programs, how):
    def fly(policy, *ways):
        controller = Controller("--node", "mass", "--node", f"spring:{policy}", until="5")
        mass = start(MASS, controller.address, "next_instant")
        programs.extend([mass, controller.process])
        for way in ways:
            force = start_spring("c", controller.address, how=way)
            programs.append(force)
            if "dies" in way:
                force.communicate()
                assert force.returncode == -signal.SIGKILL
        seen = result(mass)["seen"]
        assert controller.end()[0] == 0
        return seen, result(force)["seen"]

    undisturbed, _ = fly("abort", how)
    restarted, steps = fly("restart" + (",save=1" if how == "saves" else ""), how + " dies", how)
    assert restarted == undisturbed and len(restarted) == 501
    assert steps[0][0] == 0 if how == "integral" else 2 * 10**9 < steps[0][0] <= 3 * 10**9


def test_a_program_in_c_joins_late_and_leaves(programs):
    controller = Controller("--node", "mass", "--node", "spring:abort,joins=0.1")
    free = MASS.replace("sys.argv[2])", "sys.argv[2], optional=True)")
    free = free.replace('node["/spring/force"]["F"]', '(node["/spring/force"] or {"F": [0, 0]})["F"]')
    programs += [start(free, controller.address, "next_instant"),
                 start_spring("c", controller.address, how="leaves"), controller.process]
    mass = result(programs[0])["seen"]
    assert controller.end() == (0, "spring joins after 0.1 s\n"
                                   "spring leaves at 0.3 s; its messages keep their last values")
    steps = result(programs[1])["seen"]
    assert 100 * ms < steps[0][0] < 300 * ms and steps[-1][0] == 300 * ms
    assert {force for t, force, _ in mass if t <= steps[0][0]} == {0}
    assert {force for t, force, _ in mass if t > 300 * ms} == {-steps[-1][3]}


def test_a_program_joins_late_and_leaves_and_the_others_see_nothing_of_it(programs):
    controller = Controller("--node", "mass", "--node", "spring", "--node", "probe,joins=0.5")
    mass, force = spring(programs, controller)
    programs.append(start(PROBE, controller.address))
    code, errors = controller.end()
    assert code == 0
    assert errors == "probe joins after 0.5 s\nprobe leaves at 0.8 s; its messages keep their last values"
    whole = alone(101)
    assert result(mass)["seen"] == whole
    # The force of an instant is seen at the next; it is minus the position.
    assert result(programs[3])["seen"] == [[t, x, force] for t, force, x in whole if 500 * ms < t <= 800 * ms
                                           and t % (20 * ms) == 0]


def test_a_killed_program_starts_again_and_gets_all_messages_again(programs):
    # It makes no snapshots, so it begins anew; the others see nothing of it.
    controller = Controller("--node", "mass", "--node", "spring:restart", until="2")
    waits = "    t != 500 * ms or print(flush=True) or __import__('time').sleep(600)\n"
    tells = SPRING.replace("    state = node", f"{waits}    state = node", 1)
    mass, force = [start(MASS, controller.address, "next_instant"), start(tells, controller.address, "same_instant")]
    programs += [mass, force, controller.process]
    force.stdout.readline()
    force.kill()
    controller.wait_for(spring="lost")
    again = start(SPRING, controller.address, "same_instant")
    programs.append(again)
    code, errors = controller.end()
    assert code == 0 and re.search(r"spring: its connection is gone \(it had reached .*\); restarted, it goes on "
                                   r"from the start\nspring is back at ", errors), errors
    assert result(mass)["seen"] == alone(201)
    assert [t for t, *_ in result(again)["seen"]] == [k * 10 * ms for k in range(201)]


def test_an_error_of_a_step_reaches_the_user(programs):
    controller = Controller("--node", "mass", "--node", "spring")
    broken = SPRING.replace("state = node", "1 / (30 - len(seen)); state = node")
    programs += [start(MASS, controller.address, "next_instant"), start(broken, controller.address, "same_instant")]
    code, errors = controller.end()
    assert code == 1
    assert errors == ("the run ended early: spring: it failed: ZeroDivisionError: division by zero "
                      "(it had reached 0.29 s)")
    out, _ = programs[0].communicate()
    assert json.loads(out)["reason"] == errors.removeprefix("the run ended early: ")
    assert "ZeroDivisionError" in programs[1].communicate()[1]


def test_an_error_of_a_step_in_c_reaches_the_user(programs):
    controller = Controller("--node", "mass", "--node", "spring")
    mass, force = spring(programs, controller, language="c", how="broken")
    why = "spring: it failed: a pole (it had reached 0.29 s)"
    assert controller.end() == (1, "the run ended early: " + why)
    assert result(mass)["reason"] == why
    assert force.communicate() == ("", "spring: a pole\n") and force.returncode == 1


@in_both
def test_definitions_that_differ_are_refused_with_the_field(programs, language):
    controller = Controller("--node", "mass", "--node", "spring")
    other = SPRING.replace('node.reads("/mass/state", sys.argv[2])',
                           'node.reads("/mass/state", sys.argv[2], text="float64[2] x  # x [km] (2)")')
    programs += [start(MASS, controller.address, "next_instant"),
                 start(other, controller.address, "same_instant") if language == "python" else
                 start_spring("c", controller.address, how="other")]
    code, errors = controller.end()
    assert code == 1 and "field head.t is at another place" not in errors
    assert "spring subscribes to /mass/state of mass, but field " in errors
    for program in programs[:2]:
        program.communicate()


RATES = [(0, 0), (-1, 0), (10, -1), (10**18 + 1, 0), (1, 10**18 + 1), (2**63, 0)]


@pytest.mark.parametrize(("every", "offset"), [*RATES, (0.5, 0), (1e300, 0), (float("nan"), 0), (float("inf"), 0)])
def test_a_rate_that_makes_no_sense_is_refused_at_once(every, offset):
    with pytest.raises(NodeError, match="every has to be a whole number of nanoseconds > 0 and offset one >= 0"):
        Node("spring", "mass", "ipc://@nowhere", every=every, offset=offset)
    assert Node("spring", "mass", "ipc://@nowhere", every=0.25 * 10**9).every == 250 * ms


def c_library():
    library = ctypes.CDLL(str(CONTROLLER.with_name("bindings") / "libfledge_node.so"))
    for function in ("fledge_node_create", "fledge_observer_create"):
        getattr(library, function).restype = ctypes.c_void_p
    for function in ("fledge_error", "fledge_node_simulation", "fledge_node_name", "fledge_observer_topics",
                     "fledge_observer_type", "fledge_observer_definition", "fledge_observer_reason"):
        getattr(library, function).restype = ctypes.c_char_p
    return library


def test_the_c_library_takes_names_from_the_environment_and_limits_of_time(monkeypatch):
    library = c_library()
    monkeypatch.setenv("FLEDGE_SIMULATION", "spring")
    monkeypatch.setenv("FLEDGE_NODE", "mass")
    node = ctypes.c_void_p(library.fledge_node_create(None, None, b"ipc://@fledge-c-none", ctypes.c_int64(ms),
                                                      ctypes.c_int64(0)))
    assert (library.fledge_node_simulation(node), library.fledge_node_name(node)) == (b"spring", b"mass")
    assert library.fledge_node_set(node, None, ctypes.c_double(0.2)) == 0
    assert library.fledge_node_run(node, None, None) == -1 and b"no controller answers" in library.fledge_error()
    library.fledge_node_destroy(node)
    assert library.fledge_node_create(None, None, None, ctypes.c_int64(ms), ctypes.c_int64(0)) is None
    assert library.fledge_node_run(None, None, None) == -1 and b"a node needs its address" in library.fledge_error()


@pytest.mark.parametrize(("every", "offset"), [rate for rate in RATES if rate[0] < 2**63])
def test_the_c_library_refuses_the_same_rates(every, offset):
    library = c_library()
    create = functools.partial(library.fledge_node_create, b"spring", b"mass", b"ipc://@nowhere")
    why = ("mass: it steps at offset + k every, with every > 0 and offset >= 0, both up to 31 years; found "
           f"{offset} and {every} ns").encode()
    assert create(ctypes.c_int64(every), ctypes.c_int64(offset)) is None and library.fledge_error() == why
    node = ctypes.c_void_p(create(ctypes.c_int64(5), ctypes.c_int64(0)))
    assert library.fledge_node_also_steps(node, ctypes.c_int64(every), ctypes.c_int64(offset)) == -1
    assert library.fledge_error() == why
    library.fledge_node_destroy(node)


def test_a_program_that_is_not_expected_gets_the_reason(programs):
    controller = Controller("--node", "mass")
    programs.append(start_spring("c", controller.address))
    assert programs[0].communicate()[1] == \
        "spring: the controller refuses spring: spring has no node spring; it has mass\n"
    with pytest.raises(NodeError, match="refuses sprong: spring has no node sprong; it has mass"):
        node = Node("spring", "sprong", controller.address, every=ms)
        node.step(lambda t: None)
        node.run()
    controller.process.send_signal(signal.SIGTERM)
    assert controller.end() == (1, "the run ended early: the user ended it")


def fledge_keys(folder, *arguments):
    subprocess.run([sys.executable, "-m", "fledge.cli", "keys", *map(str, arguments), "--keys", folder], check=True,
                   stdout=subprocess.DEVNULL)


def test_with_keys_programs_in_python_and_c_take_part(programs, tmp_path, monkeypatch):
    fledge_keys(tmp_path, "new", "controller", "mass", "spring")
    fledge_keys(tmp_path, "allow", "mass", "spring")
    monkeypatch.setenv("FLEDGE_KEYS", str(tmp_path))
    controller = Controller("--node", "mass", "--node", "spring", address="tcp://0.0.0.0:*")
    address = controller.address.replace("0.0.0.0", "127.0.0.1")
    programs += [start(MASS, address, "next_instant"),
                 subprocess.Popen([SPRING_IN_C, address], stderr=subprocess.PIPE),
                 controller.process]
    assert controller.end() == (0, "")
    assert result(programs[0])["seen"] == alone(101)
    assert programs[1].communicate() == (None, b"")


def test_without_the_right_key_a_program_gets_the_reason_at_once(programs, tmp_path, monkeypatch):
    fledge_keys(tmp_path, "new", "controller", "mass", "stranger")
    fledge_keys(tmp_path / "else", "new", "controller", "mass")
    fledge_keys(tmp_path, "allow", "mass")
    controller = Controller("--node", "mass", "--node", "spring", "--keys", tmp_path)
    programs.append(controller.process)

    def refusal(node, *key):
        with pytest.raises(NodeError) as error:
            Node("spring", node, controller.address, every=ms, keys=tmp_path.joinpath(*key) if key else None).run()
        return str(error.value)

    assert "it does not know this key" in refusal("mass", "stranger.secret")
    assert refusal("spring", "mass.secret") == (
        "the controller refuses spring: its key mass is not allowed to speak as spring")
    assert "it asks for keys" in refusal("mass")
    assert "controller.public here is not that of this controller" in refusal("mass", "else", "mass.secret")

    def refusal_in_c(**keys):
        programs.append(start_spring("c", controller.address, **keys))
        return programs[-1].communicate()[1]

    assert "it asks for keys" in refusal_in_c()
    assert "it does not know this key" in refusal_in_c(FLEDGE_KEYS=str(tmp_path / "stranger.secret"))
    assert "its key mass is not allowed to speak as spring" in refusal_in_c(FLEDGE_KEYS=str(tmp_path / "mass.secret"))
    assert "holds no spring.secret but several others" in refusal_in_c(FLEDGE_KEYS=str(tmp_path))
    controller.process.send_signal(signal.SIGTERM)
    code, errors = controller.end()
    stranger = re.search('public-key = "(.*)"', (tmp_path / "stranger.public").read_text())[1]
    assert "its public key is not allowed here: " + stranger in errors
    assert "its key mass is not allowed to speak as spring" in errors and errors.endswith("the user ended it")


def test_a_secret_that_others_may_read_is_not_used(tmp_path):
    fledge_keys(tmp_path, "new", "controller", "mass")
    (tmp_path / "mass.secret").chmod(0o640)
    with pytest.raises(NodeError, match="mass.secret: others may read this secret key; chmod 600"):
        Node("spring", "mass", "ipc://@x", every=ms, keys=tmp_path)
    with pytest.raises(NodeError, match="holds no mass.secret; ./fledge keys new mass makes a pair of keys"):
        Node("spring", "mass", "ipc://@x", every=ms, keys=tmp_path / "..")


def test_beyond_the_machine_needs_keys():
    process = subprocess.run([CONTROLLER, "--simulation", "spring", "--until", "1", "--node", "mass", "--address",
                              "tcp://0.0.0.0:*"], stderr=subprocess.PIPE, text=True)
    assert process.returncode == 1 and "needs keys: ./fledge keys new controller" in process.stderr


# A mass on a spring that is commanded: how strongly it pulls comes from outside.
COMMANDED = SPRING.replace(
    'node.writes(', 'node.reads("/ground/stiffness", text="float64 k  # k [N/m]")\nnode.writes(', 1).replace(
        '-x for x', 'node["/ground/stiffness"]["k"] * -x for x')


def test_an_observer_sees_what_nodes_write_and_a_ground_system_writes(programs):
    controller = Controller("--node", "mass", "--node", "spring", "--asynchronous", "ground", until="1e6")
    programs += [start(MASS, controller.address, "next_instant"),
                 start(COMMANDED, controller.address, "same_instant"), controller.process]
    with Observer("spring", "ground", controller.address) as ground, \
            Observer("spring", "viewer", controller.address) as viewer:
        assert set(viewer.topics) == {"/ground/stiffness", "/mass/state", "/spring/force"}
        viewer.subscribe("/spring/", "/ground/")
        for message in viewer:
            assert message.topic in ("/spring/force", "/ground/stiffness")
            if message.count > 10:
                assert message["F"] == [0, 0] and message.node == "spring"
                break
        ground.write("/ground/stiffness", {"k": 2.0})
        written = None
        for message in viewer:
            if message.topic == "/ground/stiffness" and message.count:
                written = message
                assert (message["k"], message.count, message.node) == (2.0, 1, "ground")
            if message.topic == "/spring/force" and any(message["F"]):
                assert written and message.t >= written.t
                break
        # A new observer gets the last message of a topic at once.
        with Observer("spring", "late", controller.address) as late:
            late.subscribe("/ground/stiffness")
            message = late.next(PATIENCE)
            assert (message["k"], message.t, message.missed) == (2.0, written.t, 0)
        with pytest.raises(NodeError, match="there is no topic /ground/x; there are /ground/stiffness, /mass/state"):
            ground.write("/ground/x", {})
        with pytest.raises(NodeError, match="has no field q; it has k"):
            ground.write("/ground/stiffness", {"q": 1})
        viewer.write("/ground/stiffness", {"k": 3.0})
        viewer.subscribe("/mass/")      # the controller reads this after the write, and answers it
        while viewer.next(PATIENCE).topic != "/mass/state":
            pass
        controller.process.send_signal(signal.SIGINT)
        code, errors = controller.end()
        assert "viewer writes /ground/stiffness: /ground/stiffness is not written by viewer" in errors
        for message in viewer:
            pass
        assert viewer.reason == "the user ended it"
    assert [program.wait() for program in programs[:2]] == [0, 0]


def test_an_observer_on_a_second_thread_beside_a_node():
    controller = Controller("--node", "mass", "--watch", "/mass/state", until="0.5")
    node = Node("spring", "mass", controller.address, every=ms)
    node.writes("/mass/state", "State", "float64 x  # x [m]")
    ready = threading.Event()

    @node.step
    def step(t):
        assert ready.wait(PATIENCE)
        node["/mass/state"] = {"x": t}

    seen = []

    def watch():
        with Observer("spring", "viewer", controller.address) as observer:
            observer.subscribe("/mass/")
            seen.append(observer.next(PATIENCE))
            ready.set()
            seen.extend(observer)

    thread = threading.Thread(target=watch)
    thread.start()
    assert node.run() == ""
    thread.join()
    assert controller.end() == (0, "")
    assert [(m.t, m.count, m["x"]) for m in seen] == [(-1, 0, 0)] + [(k * ms, k + 1, k * ms) for k in range(501)]


def test_an_observer_reports_that_the_controller_was_killed(programs):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    programs += spring(programs, controller)
    with Observer("spring", "viewer", controller.address) as viewer:
        viewer.subscribe("")
        assert viewer.next(PATIENCE)
        controller.process.kill()
        controller.process.communicate()
        with pytest.raises(NodeError, match="the controller is gone"):
            for _ in viewer:
                pass


def test_an_observer_is_refused_with_the_reason(tmp_path):
    controller = Controller("--node", "mass", "--no-broker")
    with pytest.raises(NodeError, match="refuses viewer: this controller has no broker"):
        Observer("spring", "viewer", controller.address)
    with pytest.raises(NodeError, match="this is the simulation spring, not string"):
        Observer("string", "viewer", controller.address)
    controller.process.send_signal(signal.SIGTERM)
    controller.end()
    fledge_keys(tmp_path, "new", "controller", "viewer")
    controller = Controller("--node", "mass", "--keys", tmp_path)
    with pytest.raises(NodeError, match="it does not know this key"):
        Observer("spring", "viewer", controller.address, keys=tmp_path)
    fledge_keys(tmp_path, "allow", "viewer", "--as", "ground")

    def refused(name, why, **options):
        with pytest.raises(NodeError) as refusal:
            Observer("spring", name, controller.address, keys=tmp_path / "viewer.secret", **options)
        return why in str(refusal.value)

    wait_for(lambda: refused("viewer", "its key viewer is not allowed to speak as viewer"))    # the keys are read again
    wait_for(lambda: refused("ground", "has no answer: not all nodes are there", timeout=0.5))
    controller.process.send_signal(signal.SIGTERM)
    controller.end()


class SeenInC(ctypes.Structure):
    """FledgeSeen of cosim/bindings/c/fledge_node.h."""
    _fields_ = [("topic", ctypes.c_char_p), ("node", ctypes.c_char_p), ("message", ctypes.POINTER(ctypes.c_double)),
                ("size", ctypes.c_size_t), ("t", ctypes.c_int64), ("count", ctypes.c_uint32),
                ("missed", ctypes.c_uint32)]


def observer_in_c(library, name, address, timeout=60.0):
    return ctypes.c_void_p(library.fledge_observer_create(b"spring", name, address.encode(), None,
                                                          ctypes.c_double(timeout)))


def test_an_observer_in_c_sees_what_nodes_write_and_writes(programs):
    controller = Controller("--node", "mass", "--node", "spring", "--asynchronous", "ground", until="1e6")
    programs += [start(MASS, controller.address, "next_instant"),
                 start(COMMANDED, controller.address, "same_instant"), controller.process]
    library = c_library()
    ground, seen = observer_in_c(library, b"ground", controller.address), SeenInC()

    def watch(topic, until):
        while until(seen) or seen.topic != topic:
            assert library.fledge_observer_next(ground, ctypes.c_double(-1), ctypes.byref(seen)) == 1

    def write(topic, *numbers):
        message = (ctypes.c_double * len(numbers))(*numbers)
        return library.fledge_observer_write(ground, topic, message, ctypes.c_size_t(ctypes.sizeof(message)))

    assert library.fledge_observer_topics(ground) == b"/ground/stiffness\n/mass/state\n/spring/force\n"
    assert library.fledge_observer_type(ground, b"/spring/force") == b"Force"
    assert library.fledge_observer_definition(ground, b"/spring/force").startswith(b"float64[2] F")
    assert [library.fledge_observer_subscribe(ground, topic) for topic in (b"/spring/", b"/ground/")] == [0, 0]
    watch(b"/spring/force", lambda seen: seen.count <= 10)
    assert (seen.node, seen.size, seen.message[:2]) == (b"spring", 16, [0, 0])
    other = threading.Thread(target=write, args=(b"/ground/stiffness", 2.0))    # any thread may
    other.start()
    watch(b"/ground/stiffness", lambda seen: seen.count == 0)
    assert (seen.node, seen.count, seen.message[0]) == (b"ground", 1, 2)
    other.join()
    written = seen.t
    watch(b"/spring/force", lambda seen: seen.size != 16 or seen.message[0] == 0)
    assert 0 < written <= seen.t
    assert write(b"/ground/x") == -1 and library.fledge_error() == b"no node reads /ground/x"
    assert library.fledge_observer_type(ground, b"/ground/x") is None
    assert library.fledge_error() == b"there is no topic /ground/x"
    assert library.fledge_observer_reason(ground) is None
    controller.process.send_signal(signal.SIGINT)
    assert controller.end() == (1, "the run ended early: the user ended it")
    while library.fledge_observer_next(ground, ctypes.c_double(-1), ctypes.byref(seen)):
        pass
    assert library.fledge_observer_reason(ground) == b"the user ended it"
    library.fledge_observer_destroy(ground)


@pytest.mark.long("compiles an observer and waits for connections to fail")
def test_an_observer_in_c_is_refused_with_the_reason_and_reports_that_the_controller_was_killed(programs):
    controller = Controller("--node", "mass", "--no-broker")
    library, seen = c_library(), SeenInC()
    assert not observer_in_c(library, b"viewer", controller.address)
    assert b"refuses viewer: this controller has no broker" in library.fledge_error()
    controller.process.send_signal(signal.SIGTERM)
    controller.end()
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    programs += spring(programs, controller)
    viewer = observer_in_c(library, b"viewer", controller.address)
    assert library.fledge_observer_next(viewer, ctypes.c_double(0.01), ctypes.byref(seen)) == 0   # no subscription yet
    library.fledge_observer_subscribe(viewer, b"")
    assert library.fledge_observer_next(viewer, ctypes.c_double(20), ctypes.byref(seen)) == 1
    controller.process.kill()
    controller.process.communicate()
    while (found := library.fledge_observer_next(viewer, ctypes.c_double(-1), ctypes.byref(seen))) == 1:
        pass
    assert found == -1 and library.fledge_error() == b"the controller is gone"
    library.fledge_observer_destroy(viewer)


def request(start=-2**63, end=0, backend=""):
    """An Initialize."""
    w = _Writer()
    w.numbers("Qqq", 0, end, start)
    w.text("")
    w.text(backend)
    w.bytes(b"")
    return w.frame("Initialize", 1)


@pytest.mark.parametrize("frame, why", [
    (b"", "this is no frame of a co-simulation"),
    (b"FLCS\1\x09" + bytes(18), "version 9 of the format, while this program speaks version 1"),
    (b"FLCS\1\1\4\0" + bytes(3) + b"\1" + bytes(12), "a body of 0 bytes, while the header says 16777216"),
    (b"FLCS\1\1\4\0" + bytes(16), "Initialize: byte 0 of the body: it ends here, 8 bytes too early"),
    (b"FLCS\1\1\x0a\0" + bytes(16), "Start: byte 0 of the body: it ends here, 4 bytes too early"),
    (b"FLCS\1\1\x0b\0" + bytes(16), "the controller sent Ready, which is no request"),
    ([b"FLCS", b"more"], "a frame is one part, not 2"),
    (request(), "Initialize: byte 24 of the body: start is -9223372036854775808 ns; expected -1 to"),
    (request(start=10**18 + 1), "Initialize: byte 24 of the body: start is 1000000000000000001 ns; expected -1 to"),
    (request(start=0, end=-1), "Initialize: byte 16 of the body: end is -1 ns; expected 0 to 1000000000000000000"),
    (request(start=0, backend="\x1b[2J"),
     "Initialize: byte 36 of the body: backend holds the control character U+001B"),
])
@in_both
def test_garbage_from_a_controller_is_refused(programs, language, frame, why):
    """A controller that welcomes the program, and then says this."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as admission, context.socket(zmq.DEALER) as link:
        for socket in (admission, link):
            socket.linger, socket.rcvtimeo = 0, round(1e3 * PATIENCE)
        admission.bind("tcp://127.0.0.1:*")
        link.bind("tcp://127.0.0.1:*")
        address = admission.last_endpoint.decode()
        programs.append(start_spring(language, address))
        peer, hello = admission.recv_multipart()
        r = _Reader(hello)
        assert r.kind == "Hello"
        w = _Writer()
        w.text(link.last_endpoint.decode())
        w.text("")
        w.number("Q", 0)
        admission.send_multipart([peer, w.frame("Welcome", 1)])
        assert _Reader(link.recv()).kind == "Hello"
        link.send_multipart(frame if isinstance(frame, list) else [frame])
        failed = _Reader(link.recv())
        assert failed.kind == "Failed"
        assert why in failed.lines("reason")
        assert why in programs[0].communicate()[1] and programs[0].returncode == 1


def test_without_a_controller_it_gives_up():
    node = Node("spring", "mass", f"ipc://@fledge-none-{os.getpid()}", every=ms, timeout=0.2)
    with pytest.raises(NodeError, match="no controller answers"):
        node.run()


def test_messages_are_packed_and_read_in_both_byte_orders():
    schema = Schema("M", "int64 t  # t\nfloat32[2] s_bn  # s_BN [-] (2)\nuint8[8] c\n")
    assert schema.size == 24
    values = {"t": -3, "s_BN": [0.5, -2.0], "c": [1, 2, 3, 4, 5, 6, 7, 255]}
    little = schema.pack(values)
    assert schema.unpack(b"\0\1\0\0" + little) == values
    big = little[7::-1] + little[11:7:-1] + little[15:11:-1] + little[16:]
    assert schema.unpack(b"\0\0\0\0" + big) == values
    assert schema.unpack(b"\0\1\0\0" + schema.pack({})) == {"t": 0, "s_BN": [0, 0], "c": [0] * 8}
    with pytest.raises(NodeError, match="M has no field s; it has t, s_BN, c"):
        schema.pack({"s": 1})
    with pytest.raises(NodeError, match="M.s_BN takes 2 numbers, found 3"):
        schema.pack({"s_BN": [1, 2, 3]})
    with pytest.raises(NodeError, match="of 5 bytes, expected a CDR header and 24"):
        schema.unpack(b"\0\1\0\0x")
    with pytest.raises(NodeError, match="padding"):
        Schema("M", "int32 a\nfloat64 b\n")
    nested = "p/A[60000] a\n" + "=" * 80 + "\nMSG: p/A\nint8 x\nint8 y\n"
    for large in ("float64[4000000000] a\n", nested, nested.replace("60000", "4000000000"), "int8[16777217] a\n"):
        with pytest.raises(NodeError, match="M: the message is too large"):
            Schema("M", large)
    with pytest.raises(NodeError, match="string is not of fixed size"):
        Schema("M", "string a\n")


def test_texts_and_enumerations_are_given_by_name():
    schema = Schema("M", "char[6] label  # label\nuint8 on  # on what {OFF=0, ON=1}\nbyte b\n")
    payload = b"\0\1\0\0" + schema.pack({"label": "hé", "on": "ON"})
    assert payload[4:] == "hé".encode() + b"\0\0\0\1\0"
    values = schema.unpack(payload)
    assert text(values["label"]) == "hé" and values["on"] == 1 and values["on"].name == "ON"
    assert schema.unpack(payload[:10] + b"\7\0")["on"].name is None
    with pytest.raises(NodeError, match="M.on has no value ONN; it has OFF, ON"):
        schema.pack({"on": "ONN"})
    with pytest.raises(NodeError, match="M.b has no value 1; it has only numbers"):
        schema.pack({"b": "1"})
    with pytest.raises(NodeError, match="M.label takes 6 bytes of text, found 7"):
        schema.pack({"label": "1234567"})


def test_counts_begin_again_after_four_thousand_million_messages():
    node = Node("spring", "mass", "ipc://@x", every=10)
    node.reads("/a", text="uint32 x\n")
    node.writes("/b", "B", "fledge/Head head  # head\n" + "=" * 80 + "\nMSG: fledge/Head\nint64 t  # t\n"
                "uint32 quality  # quality\nuint32 sequence  # sequence\n")
    written, last = node._publications["/b"], 2**32 - 1
    node._channels = {0: node._subscriptions["/a"]}
    node._subscriptions["/a"].count = written.count = written.sequence = last
    written.channel, node._next = 1, 0

    @node.step
    def step(t):
        node["/b"] = {}

    tick, tock = _Writer(), _Writer()
    tick.numbers("qIqII", 0, 1, 0, 0, 0)
    tick.bytes(b"\0\1\0\0" + bytes(4))
    assert node._on_Tick(_Reader(tick.frame("Tick", 1)), tock) == "Tock"
    assert node["/a"] == {"x": 0} and node._subscriptions["/a"].count == 0
    r = _Reader(tock.frame("Tock", 1))
    r.time("reached"), r.time("compute_ns"), r.number("B")
    (*head, payload), = r.records()
    assert head == [0, 1, 0] and written.schema.unpack(payload)["head.sequence"] == 1


def test_mistakes_in_a_node_are_named():
    node = Node("spring", "mass", "ipc://@x", every=ms)
    node.reads("/a")
    with pytest.raises(NodeError, match="there is no latency soon; there are same_instant, next_instant"):
        node.reads("/b", "soon")
    with pytest.raises(NodeError, match="mass does not read /b; it reads /a"):
        node["/b"]
    with pytest.raises(NodeError, match="mass does not write /a; it writes nothing"):
        node["/a"] = {}
