# SPDX-License-Identifier: Apache-2.0
"""C# programs as nodes, under Mono: beside Python around the real controller, and what happens when one dies."""
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import zmq

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "python"))
from fledge_node import _Reader, _Writer  # noqa: E402
from fledge_node_test import (COMMANDED, CONTROLLER, MASS, Controller, alone, fledge_keys,  # noqa: E402, F401
                              programs, result, start)

pytestmark = [pytest.mark.skipif(not CONTROLLER.exists(), reason="the controller is not built"),
              pytest.mark.skipif(not shutil.which("mcs"), reason="mono-mcs is not installed"),
              pytest.mark.skipif(os.environ.get("FLEDGE_PRESET") == "asan",
                                 reason="Mono takes no sanitizer in its memory")]

LATENCIES = {"same_instant": "0", "next_instant": "1", "next_exchange": "2"}


def clean():
    """The environment, with the C library and without libraries that are loaded first: Mono takes no other memory."""
    return {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"} | {
        "LD_LIBRARY_PATH": str(CONTROLLER.with_name("bindings"))}


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """Compiles a program of testing/."""
    folder = tmp_path_factory.mktemp("csharp")

    def build(name):
        program = folder / f"{name}.exe"
        done = subprocess.run(["mcs", "-warn:4", "-warnaserror", f"-out:{program}", HERE / f"testing/{name}.cs",
                               HERE / "FledgeNode.cs"], capture_output=True, text=True, env=clean())
        assert done.returncode == 0 and not done.stderr, done.stdout + done.stderr
        return program

    return build


@pytest.fixture(scope="session")
def spring(built):
    return built("spring")


def test_values_convert_and_are_refused_with_the_reason(built):
    done = subprocess.run(["mono", built("values")], env=clean(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def start_spring(program, controller, latency="same_instant", how="", **environment):
    return subprocess.Popen(["mono", program, controller.address, LATENCIES[latency], how], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True, env=clean() | environment)


def pair(programs, spring, controller, latencies=("next_instant", "same_instant"), how=""):
    both = [start(MASS, controller.address, latencies[0]), start_spring(spring, controller, latencies[1], how)]
    programs += [*both, controller.process]
    return both


def seen(program):
    """(reason, [[t, head.t, head.sequence, x]]) of a spring."""
    out, errors = program.communicate(timeout=60)
    assert program.returncode == 0, errors
    reason, run, *lines = out.splitlines()
    assert run.startswith("seed 7 end ")
    rows = [list(map(int, line.split())) for line in lines]
    return reason.removeprefix("reason "), [[*row[:3], struct.unpack("d", struct.pack("q", row[3]))[0]] for row in rows]


@pytest.mark.parametrize("transport", ["tcp", "ipc"])
def test_a_node_beside_python_gives_the_bits_of_one_program(programs, spring, transport):
    address = "tcp://127.0.0.1:*" if transport == "tcp" else f"ipc://@fledge-csharp-{os.getpid()}"
    controller = Controller("--node", "mass", "--node", "spring", address=address)
    mass, force = pair(programs, spring, controller)
    assert controller.end() == (0, "")
    mass = result(mass)
    assert mass["seen"] == alone(101)
    # The head of what it reads was filled in: the time, and a count from 1.
    assert seen(force) == ("", [[t, t, k + 1, x] for k, (t, _, x) in enumerate(mass["seen"])])


def test_at_exchanges_each_node_sees_the_message_of_the_step_before(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring")
    mass, force = pair(programs, spring, controller, ("next_exchange", "next_exchange"))
    assert controller.end() == (0, "")
    assert [x for *_, x in seen(force)[1]] == [1.0] + [x for _, _, x in result(mass)["seen"]][:-1]


def test_a_definition_is_needed_on_one_side_only(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring")
    reader = MASS.replace('sys.argv[2])', 'sys.argv[2], name="Force", text="float64[2] F  # F [N] (2) force")')
    programs += [start(reader, controller.address, "next_instant"),
                 start_spring(spring, controller, how="reader"), controller.process]
    assert controller.end() == (0, "")
    assert result(programs[0])["seen"] == alone(101)


@pytest.mark.parametrize("victim", [0, 1])
def test_a_killed_program_ends_the_run_for_all(programs, spring, victim):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    both = pair(programs, spring, controller)
    controller.wait_for(mass="running", spring="running")
    both[victim].kill()
    code, errors = controller.end()
    name = ["mass", "spring"][victim]
    assert code == 1 and re.match(f"the run ended early: {name}: its connection is gone", errors), errors
    if victim == 0:
        assert "mass: its connection is gone" in seen(both[1])[0]
    else:
        assert "spring: its connection is gone" in result(both[0])["reason"]


def test_the_controller_names_a_node_that_is_killed_before_the_run(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring")
    programs += [start_spring(spring, controller), controller.process]
    controller.wait_for(spring="joining")
    programs[0].kill()
    assert controller.end() == (1, "the run ended early: spring: its connection is gone")


def test_ctrl_c_of_the_controller_ends_the_node(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    both = pair(programs, spring, controller)
    controller.wait_for(mass="running", spring="running")
    controller.process.send_signal(signal.SIGINT)
    assert controller.end() == (1, "the run ended early: the user ended it")
    assert seen(both[1])[0] == "the user ended it"
    both[0].communicate(timeout=60)


def test_the_controller_notices_ctrl_c_of_the_node_at_once(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    both = pair(programs, spring, controller)
    controller.wait_for(mass="running", spring="running")
    both[1].send_signal(signal.SIGINT)
    both[0].communicate(timeout=60)
    code, errors = controller.end()
    assert code == 1 and "spring: its connection is gone" in errors
    assert both[1].communicate(timeout=60) == ("", "") and both[1].returncode == -signal.SIGINT


def test_another_thread_ends_the_node(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    both = pair(programs, spring, controller, how="stops")
    both[0].communicate(timeout=60)
    code, errors = controller.end()
    assert code == 1 and "spring: it failed: the program ended it" in errors
    assert both[1].communicate(timeout=60) == ("", "spring: the program ended it\n")


def test_a_node_reports_that_the_controller_is_gone(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring", until="1e6")
    both = pair(programs, spring, controller)
    controller.wait_for(mass="running", spring="running")
    controller.process.kill()
    controller.process.communicate()
    assert both[1].communicate(timeout=60) == ("", "spring: the controller is gone\n") and both[1].returncode == 1
    both[0].communicate(timeout=60)


def test_an_error_of_a_step_reaches_the_user(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring")
    both = pair(programs, spring, controller, how="broken")
    why = "spring: it failed: DivideByZeroException: a pole (it had reached 0.29 s)"
    assert controller.end() == (1, "the run ended early: " + why)
    assert result(both[0])["reason"] == why
    assert "DivideByZeroException: a pole" in both[1].communicate(timeout=60)[1] and both[1].returncode != 0


def test_the_reply_timeout_ends_a_step_that_hangs(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring", "--reply", "4")
    both = pair(programs, spring, controller, how="hangs")
    code, errors = controller.end()
    assert code == 1 and "spring: it did not answer within 4 s" in errors
    both[0].communicate(timeout=60)
    both[1].kill()


def test_definitions_that_differ_are_refused_with_the_field(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring")
    both = pair(programs, spring, controller, how="other")
    code, errors = controller.end()
    assert code == 1 and "spring subscribes to /mass/state of mass, but field " in errors
    assert errors.endswith(seen(both[1])[0])
    both[0].communicate(timeout=60)


def test_a_program_that_is_not_expected_gets_the_reason(programs, spring):
    controller = Controller("--node", "mass")
    programs += [start_spring(spring, controller), controller.process]
    assert programs[0].communicate(timeout=60)[1] == \
        "spring: the controller refuses spring: spring has no node spring; it has mass\n"
    controller.process.send_signal(signal.SIGTERM)
    controller.end()


def test_a_node_with_keys_takes_part(programs, spring, tmp_path, monkeypatch):
    fledge_keys(tmp_path, "new", "controller", "mass", "spring")
    fledge_keys(tmp_path, "allow", "mass", "spring")
    monkeypatch.setenv("FLEDGE_KEYS", str(tmp_path))
    controller = Controller("--node", "mass", "--node", "spring")
    both = pair(programs, spring, controller)
    assert controller.end() == (0, "")
    assert result(both[0])["seen"] == alone(101) and seen(both[1])[0] == ""


def test_a_node_without_the_right_key_gets_the_reason_at_once(programs, spring, tmp_path):
    fledge_keys(tmp_path, "new", "controller", "mass", "stranger")
    fledge_keys(tmp_path / "else", "new", "controller", "mass")
    fledge_keys(tmp_path, "allow", "mass")
    controller = Controller("--node", "mass", "--node", "spring", "--keys", tmp_path)
    programs.append(controller.process)

    def refusal(*key):
        keys = {"FLEDGE_KEYS": str(tmp_path.joinpath(*key))} if key else {}
        program = start_spring(spring, controller, **keys)
        programs.append(program)
        return program.communicate(timeout=60)[1]

    assert "it does not know this key" in refusal("stranger.secret")
    assert "the controller refuses spring: its key mass is not allowed to speak as spring" in refusal("mass.secret")
    assert "it asks for keys" in refusal()
    assert "controller.public here is not that of this controller" in refusal("else", "mass.secret")
    assert "there are no keys; ./fledge keys new spring makes a pair" in refusal("nothing.secret")
    assert "holds no spring.secret but several others" in refusal("")
    (tmp_path / "mass.secret").chmod(0o640)
    assert "mass.secret: others may read this secret key; chmod 600" in refusal("mass.secret")
    (tmp_path / "mass.secret").write_text("nonsense")
    (tmp_path / "mass.secret").chmod(0o600)
    assert "mass.secret: it holds no public-key" in refusal("mass.secret")
    controller.process.send_signal(signal.SIGTERM)
    controller.end()


def test_a_node_that_leaves_ends(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring")
    both = pair(programs, spring, controller, how="leaves")
    mass = result(both[0])["seen"]
    assert controller.end()[0] == 0
    reason, rows = seen(both[1])
    assert reason == "" and rows[-1][0] == 300_000_000
    assert mass[:32] == alone(32) and {force for _, force, _ in mass[31:]} == {mass[31][1]}


def test_a_node_joins_late(programs, spring):
    controller = Controller("--node", "mass", "--node", "spring:abort,joins=0.5")
    free = MASS.replace('sys.argv[2])', 'sys.argv[2], optional=True)')
    free = free.replace('node["/spring/force"]["F"]', '(node["/spring/force"] or {"F": [0, 0]})["F"]')
    programs += [start(free, controller.address, "next_instant"), start_spring(spring, controller), controller.process]
    mass = result(programs[0])["seen"]
    assert controller.end() == (0, "spring joins after 0.5 s")
    reason, rows = seen(programs[1])
    first = rows[0][0]
    assert reason == "" and first > 500_000_000 and rows[-1][0] == 10**9
    assert {force for t, force, _ in mass if t <= first} == {0} and mass[-1][1] == -mass[-2][2]


@pytest.mark.parametrize("how", ["integral", "saves"])
def test_a_new_program_goes_on_for_a_killed_one(programs, spring, how):
    def fly(policy, ways):
        controller = Controller("--node", "mass", "--node", f"spring:{policy}", until="20")
        mass = start(MASS, controller.address, "next_instant")
        programs.extend([mass, controller.process])
        springs = []
        for way in ways:
            springs.append(start_spring(spring, controller, how=way))
            programs.append(springs[-1])
            if way.endswith("dies"):
                springs[-1].communicate(timeout=60)
                assert springs[-1].returncode == -signal.SIGKILL
        out = result(mass)
        assert controller.end()[0] == 0
        return out["seen"], springs[-1].communicate(timeout=60)[0]

    undisturbed, _ = fly("abort", [how])
    restarted, said = fly("restart" + (",save=2" if how == "saves" else ""), [how + " dies", how])
    assert restarted == undisturbed and len(restarted) == 2001
    assert ("goes on" in said) == (how == "saves")  # from a snapshot, else from the beginning


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
@pytest.mark.parametrize("language", ["python", "csharp"])
def test_garbage_from_a_controller_is_refused(programs, spring, language, frame, why):
    """A controller that welcomes the program, and then says this."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as admission, context.socket(zmq.DEALER) as link:
        for socket in (admission, link):
            socket.linger, socket.rcvtimeo = 0, 20_000
        admission.bind("tcp://127.0.0.1:*")
        link.bind("tcp://127.0.0.1:*")
        address = admission.last_endpoint.decode()
        fake = SimpleNamespace(address=address)
        programs.append(start_spring(spring, fake) if language == "csharp" else start(MASS, address, "same_instant"))
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
        assert why in programs[0].communicate(timeout=60)[1] and programs[0].returncode == 1


def start_ground(program, address):
    return subprocess.Popen(["mono", program, address], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            stdin=subprocess.DEVNULL, text=True, env=clean())


def test_an_observer_sees_what_nodes_write_and_writes_itself(programs, built):
    controller = Controller("--node", "mass", "--node", "spring", "--asynchronous", "ground", until="1e6")
    programs += [start(MASS, controller.address, "next_instant"),
                 start(COMMANDED, controller.address, "same_instant"), controller.process]
    programs.append(start_ground(built("ground"), controller.address))
    ground = programs[-1]
    assert ground.stdout.readline() == "topics /ground/stiffness /mass/state /spring/force\n"
    assert ground.stdout.readline() == "pulls\n", ground.communicate()
    assert ground.stdout.readline() == "there is no topic /ground/x; there are /ground/stiffness, /mass/state, " \
                                       "/spring/force\n"
    assert ground.stdout.readline() == "ready\n"
    controller.process.send_signal(signal.SIGINT)
    assert controller.end() == (1, "the run ended early: the user ended it")
    assert ground.communicate(timeout=60) == ("reason the user ended it\n", "") and ground.returncode == 0
    for program in programs[:2]:
        program.communicate(timeout=60)


def test_an_observer_gets_the_reason_why_it_sees_nothing(programs, built):
    controller = Controller("--node", "mass", "--node", "spring", "--no-broker")
    programs += [start_ground(built("ground"), controller.address), controller.process]
    assert "the controller refuses ground: this controller has no broker" in programs[0].communicate(timeout=60)[1]
    controller.process.kill()
    controller.process.communicate()


def test_an_observer_reports_that_the_controller_is_gone(programs, built):
    controller = Controller("--node", "mass", "--node", "spring", "--asynchronous", "ground", until="1e6")
    programs += [start(MASS, controller.address, "next_instant"),
                 start(COMMANDED, controller.address, "same_instant"), controller.process]
    programs.append(start_ground(built("ground"), controller.address))
    assert any(line == "ready\n" for line in programs[-1].stdout)
    controller.process.kill()
    controller.process.communicate()
    assert programs[-1].communicate(timeout=60)[1] == "ground: the controller is gone\n"
    for program in programs[:2]:
        program.communicate(timeout=60)
