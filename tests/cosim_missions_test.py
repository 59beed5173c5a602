# SPDX-License-Identifier: Apache-2.0
"""Two missions give the same bits in one program and in two, whatever lies between the programs.

Each mission is flown in one program, and with world and flight in two: over every transport, with both
latencies, in any order of starting, with random delays, and in two network namespaces with addresses of
their own. All outputs at all instants must be the same, byte for byte. FLEDGE_LONG=1 flies 20 minutes
instead of half a minute, and more draws.
"""

import hashlib
import os
import pickle
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import traceback
from pathlib import Path

import pytest

import fledge
from fledge import cosim
from fledge.disk import build_folder
from tests.circles import long_after
from tests.needs import skip_without
from tests.waiting import PATIENCE

CONTROLLER = build_folder() / "cosim" / "fledge_controller"
MISSIONS = Path(__file__).resolve().parents[1] / "missions"
LONG = os.environ.get("FLEDGE_LONG", "") not in ("", "0")
SPAN = 1200 if LONG else 30
SEED = 11
TRANSPORTS = ["ipc", "tcp", "shared memory"]
DELAY = 0.002  # [s] at most, before each step

ALL = '''
def all(sim):
    """Every output at every step."""
    for process in sim.processes:
        for _, period, _, _, _ in process.tasks[:1]:
            sim.record(*process, every=period / 1e9)
    sim.run({span})
'''


# --- missions, and their records -------------------------------------------------------------------

@pytest.fixture(scope="module", params=long_after(
    1, [((name, latency),) for name in ("inertial_pointing", "nadir_spin") for latency in (0, 1)],
    "another mission or latency"), ids=lambda p: f"{p[0]}-{p[1]}")
def mission(request, tmp_path_factory):
    """The folder of a mission with noise in its sensor, so that random draws count, and the latency."""
    name, latency = request.param
    folder = tmp_path_factory.mktemp("missions") / name
    shutil.copytree(MISSIONS / name, folder, ignore=shutil.ignore_patterns("*_test.py", "__pycache__"))
    text = (folder / "world.py").read_text()
    noisy = text.replace("world.Navigation()", "world.Navigation(rate_noise=[1e-5] * 3, attitude_noise=[1e-4] * 3)")
    assert noisy != text
    # Some missions take the latency as an argument; in the others, the wires are replaced.
    late = re.sub(r"latency=0\)", f"latency={latency})", noisy)
    if late == noisy:
        late = re.sub(r"^( +)(w\.[\w.]+ +>> f\.[\w.]+|f\.[\w.]+ +>> w\.[\w.]+),", rf"\1(\2).latency({latency}),",
                      noisy, flags=re.MULTILINE)
    (folder / "world.py").write_text(late)
    (folder / "scenarios.py").write_text(ALL.format(span=SPAN))
    crossing = {w.latency for w in cosim.crossing_wires(fledge.load(str(folder)))}
    assert crossing == ({"next_exchange"} if latency else {"same_instant", "next_instant"})
    return folder


def prepared(folder, seed=0):
    """The simulation with all outputs recorded at all steps."""
    sim = fledge.load(str(folder), seed)
    for process in sim.processes:
        period = process.tasks[0].period
        sim.record(*process, every=period / 1e9)
    return sim


def hashes(sim):
    """Path of each message -> digest of all its times and bytes."""
    return {log.path: hashlib.sha256(log.times() + log.bytes()).hexdigest() for log in sim.records}


def archived(*files):
    """The same digests of records: topic -> that of its times and bytes."""
    from fledge.archive import Archive

    digests = {}
    for file in files:
        archive = Archive(file)
        assert archive.complete
        for topic in archive.topics:
            times = archive.time(topic).tobytes()
            digests[topic] = hashlib.sha256(times + archive[topic].tobytes()).hexdigest()
    return digests


@pytest.fixture(scope="module")
def together(mission):
    sim = prepared(mission, SEED)
    sim.run(SPAN)
    digests = hashes(sim)
    assert len(digests) > 8 and len(set(digests.values())) == len(digests)
    return digests


# --- programs --------------------------------------------------------------------------------------

class Fork:
    """A process that does `work()` and returns its result through a pipe. It ends with the test."""

    def __init__(self, work):
        self.reader, writer = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self.reader)
            try:
                answer = (work(), "")
            except BaseException:
                answer = (None, traceback.format_exc())
            with os.fdopen(writer, "wb") as out:
                pickle.dump(answer, out)
            os._exit(0)
        os.close(writer)

    def result(self):
        with os.fdopen(self.reader, "rb") as answer:
            value, problem = pickle.load(answer)
        assert not problem, problem
        return value

    def killed(self):
        """Wait for the process, which must end by SIGKILL."""
        os.close(self.reader)
        assert os.WTERMSIG(os.waitpid(self.pid, 0)[1]) == signal.SIGKILL
        self.pid = None

    def end(self):
        if self.pid is not None:
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)


def be_node(folder, process, address, wait, delay):
    def work():
        time.sleep(wait)
        sim = prepared(folder)
        assert cosim.split(sim, process).serve(address, simulation="identity", timeout=PATIENCE, delay=delay) == ""
        return hashes(sim)
    return Fork(work)


def be_controller(address, wait, sharing, on_loss="abort", save_every=0):
    def work():
        time.sleep(wait)
        return cosim.Controller("identity", [("flight", on_loss), ("world", on_loss)], SPAN, seed=SEED, address=address,
                                sharing=sharing, save_every=save_every).run()
    return Fork(work)


def free_port():
    import socket

    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def address_of(transport):
    if transport == "tcp":
        return f"tcp://127.0.0.1:{free_port()}"
    return f"ipc://@fledge-identity-{os.getpid()}-{random.randrange(1 << 40)}"


def apart(folder, transport, draw):
    """The hashes of a run in two programs and a controller, which start in the order that is drawn."""
    dice = random.Random(draw)
    address = address_of(transport)
    waits = [0.0, 0.02, 0.04]
    dice.shuffle(waits)
    programs = [be_controller(address, waits[0], "required" if transport == "shared memory" else "forbidden")]
    try:
        for process, wait in zip(("flight", "world"), waits[1:]):
            programs.append(be_node(folder, process, address, wait, dice.choice([0.0, DELAY])))
        digests = {}
        for program in programs[1:]:
            digests.update(program.result())
        assert programs[0].result() == ""
        return digests
    finally:
        for program in programs:
            program.end()


# --- the proof -------------------------------------------------------------------------------------

@pytest.mark.parametrize("transport", TRANSPORTS)
def test_two_programs_give_the_bits_of_one(mission, together, transport):
    for draw in range(6 if LONG else 2):
        digests = apart(mission, transport, f"{mission.name} {transport} {draw}")
        assert sorted(digests) == sorted(together)
        assert {p for p in digests if digests[p] != together[p]} == set(), f"draw {draw}"


@pytest.mark.parametrize("save_every, finds_record", [(0, True), (4, True), (4, False)],
                         ids=["from the beginning", "from a snapshot", "from a snapshot, without the lost record"])
@pytest.mark.parametrize("lost", ["flight", "world"])
def test_a_program_that_is_killed_and_started_again_goes_on_with_the_same_bits(
        mission, lost, save_every, finds_record, tmp_path):
    reference = prepared(mission, SEED)
    reference.run(SPAN)
    address, other = address_of("ipc"), {"flight": "world", "world": "flight"}[lost]

    def be_killed():
        sim = prepared(mission)
        node = cosim.split(sim, lost)
        sim.archive(tmp_path / "lost.mcap")

        def kill():
            while sim.time_ns < SPAN * 1e9 / 2:
                time.sleep(0.001)
            os.kill(os.getpid(), signal.SIGKILL)

        threading.Thread(target=kill, daemon=True).start()
        node.serve(address, simulation="identity", delay=0.01)

    def be_again():
        sim = prepared(mission)
        assert (tmp_path / "lost.mcap.part").exists()
        if not finds_record:
            (tmp_path / "lost.mcap.part").write_text("another's")
        sim.archive(tmp_path / "lost.mcap")
        reason = cosim.split(sim, lost).serve(address, simulation="identity")
        assert sim.close_archive() == str(tmp_path / ("lost.mcap" if finds_record else "lost-2.mcap"))
        return reason, {log.path: (log.times(), log.bytes()) for log in sim.records}

    programs = [be_controller(address, 0, "allowed", "restart", save_every), be_node(mission, other, address, 0, 0),
                Fork(be_killed)]
    try:
        programs[2].killed()
        programs.append(Fork(be_again))
        reason, records = programs[3].result()
        assert (reason, programs[0].result()) == ("", "")
        whole = programs[1].result()
    finally:
        for program in programs:
            program.end()
    together = hashes(reference)
    assert {path for path in whole if whole[path] != together[path]} == set() and whole
    for log in reference.records:
        if log.path.startswith(lost):
            times, messages = records[log.path]
            assert len(times) < len(log.times()) if save_every else len(times) == len(log.times())
            assert log.times().endswith(times) and log.bytes().endswith(messages), log.path
    if not finds_record:
        assert (tmp_path / "lost.mcap.part").read_text() == "another's"
        archive = fledge.Archive(tmp_path / "lost-2.mcap")
        assert not archive.complete and re.search(
            r"lost-2.mcap: the data up to t = [\d.]+ s are missing: a program was lost, and lost.mcap.part was not its "
            "record", archive.problem)
        return
    archive = fledge.Archive(tmp_path / "lost.mcap")
    assert archive.complete and [p.name for p in tmp_path.glob("lost*")] == ["lost.mcap"]
    for log in reference.records:
        if log.path.startswith(lost):
            topic = "/" + log.path.replace(".", "/")
            assert (archive.time_ns(topic).tobytes(), archive[topic].tobytes()) == (log.times(), log.bytes()), log.path


def test_latencies_noise_and_seeds_do_matter(mission, together):
    """Otherwise the equality of the bits would show nothing."""
    other = prepared(mission, SEED + 1)
    other.run(SPAN)
    assert not set(hashes(other).values()) & {together["world.nav.attitude"], together["flight.motor.command"]}
    sim = fledge.load("nadir_spin" if mission.name == "nadir_spin" else "inertial_pointing", SEED)
    for process in sim.processes:
        sim.record(*process, every=process.tasks[0].period / 1e9)
    sim.run(SPAN)
    assert hashes(sim)["flight.motor.command"] != together["flight.motor.command"]


# --- two network namespaces ------------------------------------------------------------------------

class Namespaces:
    """Two network namespaces with an address each, joined by a cable.

    Each lasts as long as the process that holds it, a cat which ends with its input; so nothing remains.
    A user other than root gets them in a user namespace, where the system allows that.
    """

    addresses = ("10.77.0.1", "10.77.0.2")

    def __init__(self):
        self.held = []
        self.user = os.geteuid() != 0
        try:
            self._hold(["unshare", *(["--user", "--map-root-user"] if self.user else []), "--net", "cat"])
            self._hold([*self.enter(0), "unshare", "--net", "cat"])
            self._ip(0, "link", "add", "name", "fledge0", "type", "veth", "peer", "name", "fledge1",
                     "netns", str(self.held[1].pid))
            for i, address in enumerate(self.addresses):
                self._ip(i, "address", "add", f"{address}/24", "dev", f"fledge{i}")
                self._ip(i, "link", "set", f"fledge{i}", "up")
                self._ip(i, "link", "set", "lo", "up")
        except BaseException:
            self.end()
            raise

    def _hold(self, command):
        holder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.held.append(holder)
        holder.stdin.write(b"there\n")  # the cat returns the line once it runs
        holder.stdin.flush()
        if holder.stdout.readline() != b"there\n":
            raise OSError(holder.stderr.read().decode().strip() or f"{command[0]} does not start")

    def _ip(self, i, *arguments):
        done = subprocess.run([*self.enter(i), "ip", *arguments], capture_output=True, text=True)
        if done.returncode:
            raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")

    def enter(self, i):
        """The words before a command that run it in namespace i."""
        into = ["--user", "--preserve-credentials"] if self.user else []
        return ["nsenter", "--target", str(self.held[i].pid), *into, "--net"]

    def end(self):
        for holder in self.held:
            holder.stdin.close()
            holder.stdout.close()
            holder.stderr.close()
        for holder in self.held:
            try:
                holder.wait(5)
            except subprocess.TimeoutExpired:
                holder.kill()
                holder.wait()


@pytest.fixture(scope="module")
def namespaces():
    skip_without("iproute2")
    try:
        both = Namespaces()
    except OSError as error:
        pytest.skip(f"network namespaces cannot be made here: {error}")
    yield both
    both.end()


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """Keys of a controller and of two computers, as `fledge keys` makes them."""
    folder = tmp_path_factory.mktemp("keys")

    def fledge_keys(*arguments):
        subprocess.run([sys.executable, "-m", "fledge.cli", "keys", *arguments], check=True, cwd=folder,
                       env=environment(), capture_output=True)

    fledge_keys("new", "controller", "flight", "world")
    for node in ("flight", "world"):
        fledge_keys("allow", node, "--as", node)
    return folder / "keys"


def environment():
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


@pytest.mark.skipif(not CONTROLLER.exists(), reason="the controller is not built")
@pytest.mark.parametrize("host", [0, 1], ids=["controller beside the world", "controller beside flight"])
def test_two_namespaces_give_the_bits_of_one(mission, namespaces, keys, host, tmp_path):
    """The programs of the command line, over TCP between two addresses, with keys; the records are compared."""
    address = f"tcp://{namespaces.addresses[host]}:7{host}77"
    commands = {"flight": (1, [sys.executable, "-m", "fledge.cli", "node", str(mission), "flight"]),
                "world": (0, [sys.executable, "-m", "fledge.cli", "node", str(mission), "world"])}
    programs = []
    try:
        for where, command in commands.values():
            command += ["--simulation", "identity", "--address", address, "--record", str(tmp_path / "apart"),
                        "--keys", str(keys), "--delay", "0.001"]
            programs.append(subprocess.Popen([*namespaces.enter(where), *command], env=environment(),
                                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True))
        programs.append(subprocess.Popen(
            [*namespaces.enter(host), CONTROLLER, "--simulation", "identity", "--until", str(SPAN), "--seed", str(SEED),
             "--node", "world", "--node", "flight", "--address", address, "--keys", str(keys)],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True))
        for program in programs:
            text = program.communicate()[0]
            assert program.returncode == 0, text
    finally:
        for program in programs:
            program.kill()
            program.wait()
            program.stdout.close()

    subprocess.run([sys.executable, "-m", "fledge.cli", "run", str(mission), "--seed", str(SEED), "--no-plots",
                    "--out", str(tmp_path / "one")], env=environment(), check=True, capture_output=True)
    together = archived(tmp_path / "one" / "run.mcap")
    assert len(together) > 8
    assert archived(tmp_path / "apart" / "flight.mcap", tmp_path / "apart" / "world.mcap") == together
