# SPDX-License-Identifier: Apache-2.0
"""`fledge up` from outside: real programs around the real controller."""
import os
import re
import signal
import subprocess
import sys

import pytest

from fledge.cosim.up.testing import BUILT, mark, up, write_pair
from tests.needs import skip_without
from tests.waiting import wait_for

pytestmark = pytest.mark.skipif(not (BUILT / "fledge_guard").exists() or not (BUILT / "fledge_controller").exists(),
                                reason="the controller is not built")


def logs(folder, name="pair"):
    return {path.stem: path.read_text() for path in (folder / "runs" / name / "log").glob("*")}


def test_two_programs_fly_to_the_end(mark, tmp_path):
    done = up(write_pair(tmp_path), mark=mark)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.startswith("pair: 2 nodes, 2 s\n")
    assert re.search(r"\nmass +finished +2\.00 s .*\nspring +finished +2\.00 s ", done.stdout)
    assert re.search(r"\n  flown    2 s in [\d.]+ s, [\d.]+ times real time\n", done.stdout)
    assert done.stdout.endswith("  logs     runs/pair/log\n")
    output = logs(tmp_path)
    assert output["mass"].splitlines()[0] == "the mass is at 1.0" and output["mass"].endswith("the mass leaves\n")
    assert sorted(output) == ["all", "controller", "mass", "spring"]
    assert re.search(r"^ +\d+\.\d{3} spring     \| the spring is there$", output["all"], re.M)


@pytest.mark.long("flies three missions")
def test_two_missions_fly_in_one_run(mark, tmp_path):
    """Both nadir spins, one under a prefix, and a third flight computer that hears the first world: all as alone."""
    from fledge.archive import Archive
    from fledge.archive.compare import compare
    from fledge.cosim.replay import Exchange
    from fledge.cosim.up.description_test import NADIR

    third = """
[[node]]
name = "listener"
mission = "nadir_spin"
process = "flight"
prefix = "c"
topics = { "/world/nav/orbit" = "/a/world/nav/orbit", "/world/nav/attitude" = "/a/world/nav/attitude", \
"/world/wheels/speeds" = "/world/wheels/speeds" }
"""
    (tmp_path / "pair.toml").write_text("until = 20\n" + NADIR + third.replace("\\\n", ""))
    done = up(tmp_path / "pair.toml", "--exchange", mark=mark)
    assert done.returncode == 0, done.stdout + done.stderr
    runs = tmp_path / "runs/pair"
    alone = Archive(runs / "flight.mcap")
    for other in ("a_flight", "listener"):
        assert compare(alone, Archive(runs / f"{other}.mcap")) == []       # a process records by its own names
    exchange = Exchange(runs / "exchange.mcap")
    assert {t for t in exchange.archive.topics if t.endswith("command")} == {"/a/flight/motor/command",
                                                                             "/flight/motor/command"}
    assert exchange.nodes["a_flight"].prefix == "a" and exchange.nodes["listener"].topics["/world/nav/orbit"] == \
        "/a/world/nav/orbit"


def test_over_tcp_and_with_a_record_of_the_exchange(mark, tmp_path):
    (tmp_path / "here").mkdir()
    (tmp_path / "here/other.mcap").write_text("somebody else's")
    done = up(write_pair(tmp_path, until=0.5), "--tcp", "--exchange", "--out", "here", mark=mark)
    assert (tmp_path / "here/other.mcap").exists()
    assert done.returncode == 0, done.stderr
    assert "listening at tcp://127.0.0.1:" in (tmp_path / "here/log/controller.log").read_text()
    assert re.search(r"  record   here/exchange.mcap \([\d.]+ kB\)", done.stdout)


def test_options_win_over_the_file(mark, tmp_path):
    done = up(write_pair(tmp_path, until=100), "--until", "500ms", mark=mark)
    assert done.returncode == 0 and done.stdout.startswith("pair: 2 nodes, 0.5 s\n")


@pytest.mark.long("flies by the wall clock")
def test_a_pace_holds_or_its_loss_is_reported(mark, tmp_path):
    file = write_pair(tmp_path, until=1, top="pace = 2")
    done = up(file, mark=mark)
    assert done.returncode == 0, done.stderr
    wall = float(re.search(r"\n  flown    1 s in ([\d.]+) s, ", done.stdout)[1])
    assert wall >= 0.49
    paced = logs(tmp_path)["mass"]
    done = up(file, "--pace", "1000", mark=mark, env={"NAP": "0.002"})
    assert done.returncode == 0, done.stderr
    assert re.search(r"\n  pace     \d+ instants were late, by up to [\d.]+ ms\n", done.stdout)
    assert logs(tmp_path)["mass"] == paced


def test_a_slow_program_is_named(mark, tmp_path):
    done = up(write_pair(tmp_path, until=0.5, mass='env = { NAP = "0.05" }'), mark=mark)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\nmass .* slowest\n", done.stdout)
    row = re.search(r"\nspring +finished .* ([\d.]+) (m?)s  [#=.]+\n", done.stdout)
    assert float(row[1]) * (1e-3 if row[2] else 1) > 2.3     # it waited for 51 naps


def test_mistakes_are_reported_before_anything_starts(mark, tmp_path):
    file = write_pair(tmp_path, spring='on_los = "hold"')
    done = up(file, mark=mark)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == (f"fledge: up: the simulation cannot be started\n{file}:12: only known keys count; there is "
                           "`on_los`; did you mean `on_loss`?\n")
    assert not (tmp_path / "runs").exists()
    done = up(tmp_path / "nothing.toml", mark=mark)
    assert done.returncode == 2 and done.stderr == f"fledge: up: there is no file {tmp_path / 'nothing.toml'}\n"
    file = write_pair(tmp_path)
    assert up(file, "--check", mark=mark).stdout == f"{file}: correct: 2 nodes, 2 s\n"
    assert not (tmp_path / "runs").exists()
    file.write_text(file.read_text().replace("until", "#"))
    done = up(file, mark=mark)
    assert done.returncode == 2 and "how long? write until = SECONDS, or give --until" in done.stderr


def test_a_program_that_fails_is_shown_with_its_last_lines(mark, tmp_path):
    done = up(write_pair(tmp_path, spring='env = { BREAKS_AT = "1" }'), mark=mark)
    assert done.returncode == 1
    assert "spring ended with exit code 1; the end of its log:\n" in done.stdout
    assert "  | ValueError: the spring breaks\n" in done.stdout
    assert "\nmass " not in done.stdout.partition("logs  ")[2], "mass did nothing wrong"
    assert done.stderr == ("fledge: pair ended early: spring: it failed: ValueError: the spring breaks "
                           "(it had reached 0.99 s)\n")


BAD = "\\x1b[2J\\x1b]0;title\\x07\\x9b31m\\ud800\\u202e\\u885b"     # what would drive a terminal, in Python's escapes


@pytest.mark.parametrize("options", [[], ["--logs"]])
def test_no_text_of_a_program_drives_the_terminal_or_ends_the_command(mark, tmp_path, options):
    file = write_pair(tmp_path, until=0.2)
    mass, spring = (tmp_path / "mass.py").read_text(), (tmp_path / "spring.py").read_text()
    (tmp_path / "mass.py").write_text(mass.replace("node = Node", f"""
sys.stdout.reconfigure(encoding="utf-8", errors="surrogatepass")
print("{BAD}", flush=True)
sys.stdout.buffer.write(b"\\xff\\xfe\\x00 raw\\r\\n" + b"x" * 100_000 + b"\\n")
node = Node""", 1))
    (tmp_path / "spring.py").write_text(spring.replace("node[", f"raise ValueError('a {BAD} pole')\n    node[", 1))
    done = up(file, *options, mark=mark, env={"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 1
    assert "spring: it failed: ValueError: a ?[2J?]0;title??31m??\\u885b pole" in done.stderr
    output = (done.stdout + done.stderr).replace("\n", "")
    assert all(character.isprintable() for character in output), ascii(output)
    assert "Traceback" not in done.stderr.replace("  | ", "") and "defect" not in done.stderr
    assert b"\x1b[2J" in (tmp_path / "runs/pair/log/mass.log").read_bytes()     # the file has what the program wrote


def test_one_that_fails_at_once_ends_the_run_at_once(mark, tmp_path):
    file = write_pair(tmp_path, top="join = 1e6")
    (tmp_path / "spring.py").write_text("import nothing_of_that_name")
    done = up(file, mark=mark)
    assert done.returncode == 1
    assert done.stderr == "fledge: pair ended early: spring ended with exit code 1 before it took part\n"
    assert "  | ModuleNotFoundError: No module named 'nothing_of_that_name'\n" in done.stdout


def test_one_that_fails_after_the_end_is_not_overlooked(mark, tmp_path):
    file = write_pair(tmp_path, until=0.2)
    with open(tmp_path / "spring.py", "a") as program:
        program.write("sys.exit('the orbit is wrong')\n")
    done = up(file, mark=mark)
    assert done.returncode == 1
    assert done.stderr == "fledge: pair came to its end, but spring failed\n"
    assert "spring ended with exit code 1; the end of its log:\n" in done.stdout
    assert "  | the orbit is wrong\n" in done.stdout


@pytest.mark.long("flies by the wall clock")
def test_asynchronous_programs_end_with_the_run(mark, tmp_path):
    file = write_pair(tmp_path, until=0.5)
    with open(file, "a") as text:
        text.write('\n[[asynchronous]]\nname = "viewer"\ncommand = ["sh", "-c", "echo sees $FLEDGE_NODE; sleep 600"]\n')
    done = up(file, mark=mark)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("pair: 2 nodes and 1 asynchronous program, 0.5 s\n")
    assert logs(tmp_path)["viewer"] == "sees viewer\n"


VIEWER = """
from fledge_node import Observer
with Observer() as viewer:
    viewer.subscribe("/mass/")
    seen = 0
    for message in viewer:
        seen += message.topic == "/mass/state" and message.node == "mass"
    print("saw some" if seen else "saw nothing", repr(viewer.reason))
"""


def test_a_viewer_sees_what_passes(mark, tmp_path):
    file = write_pair(tmp_path, mass='env = { NAP = "0.003" }')
    (tmp_path / "viewer.py").write_text(VIEWER)
    with open(file, "a") as text:
        text.write(f'\n[[asynchronous]]\nname = "viewer"\ncommand = ["{sys.executable}", "viewer.py"]\n')
    done = up(file, mark=mark)
    assert done.returncode == 0, done.stderr
    assert logs(tmp_path)["viewer"] == "saw some ''\n"


@pytest.mark.parametrize("any_user", [True, False])
def test_the_limits_and_users_of_the_file_are_the_controllers_and_nodes(mark, tmp_path, any_user):
    file = write_pair(tmp_path, until=0.5, top=f"greet = 7.5\nreply = 0\nany_user = {str(any_user).lower()}",
                      mass='env = { STAYS_AT = "0" }')
    spring = tmp_path / "spring.py"
    spring.write_text('import os\nprint("others:", os.environ.get("FLEDGE_ANY_USER"))' + spring.read_text())
    process = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", str(file)], cwd=tmp_path, env=mark.env,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        wait_for(lambda: "others:" in logs(tmp_path).get("spring", ""), process)
        command = next(line for _, line in mark.processes() if re.match(r"\S*fledge_controller ", line))
        (tmp_path / "go").touch()
        out, _ = process.communicate()
        assert process.returncode == 0, out
    finally:
        process.kill()
        process.wait()
        mark.kill()
    assert "--greet 7.5 --reply 0.0 " in command and ("--any-user" in command) == any_user
    assert f"others: {'1' if any_user else None}\n" in logs(tmp_path)["spring"]


def test_one_line_per_host(mark, tmp_path):
    """A shell takes the place of ssh: it reads the same text from the same place."""
    there = tmp_path / "there"
    there.mkdir()
    host = f'host = "me@127.0.0.1"\nlauncher = ["sh", "-c"]\ndirectory = "{there}"\nfledge = "{{fledge}}"'
    root = BUILT.parents[2]
    preset = BUILT.parent.name
    file = write_pair(tmp_path, until=0.5, top="unencrypted = true", spring=host.format(fledge=root))
    (there / "spring.py").write_text((tmp_path / "spring.py").read_text())
    (tmp_path / "spring.py").unlink()
    done = up(file, mark=mark, env={"FLEDGE_PRESET": preset})
    assert done.returncode == 0, done.stderr + done.stdout
    assert "listening at tcp://127.0.0.1:" in logs(tmp_path)["controller"]


EYE = """
import os
from fledge_node import Node, s
node = Node(every=1 * s)
node.reads("/mass/state", "same_instant")

@node.step
def step(t):
    print("at", t // 10**9, node["/mass/state"]["x"][0])
    if t == int(os.environ.get("LEAVES_AT", -1)) * 10**9:
        node.leave()

node.run()
"""


def with_eye(folder, more="", **kwargs):
    file = write_pair(folder, **kwargs)
    (folder / "eye.py").write_text(EYE)
    with open(file, "a") as text:
        text.write(f'\n[[node]]\nname = "eye"\ncommand = ["{sys.executable}", "eye.py"]\n{more}\n')
    return file


def test_one_that_joins_later_sees_what_it_would_have_seen(mark, tmp_path):
    (tmp_path / "late").mkdir()
    assert up(with_eye(tmp_path, until=5), mark=mark).returncode == 0
    whole = logs(tmp_path)["eye"].splitlines()
    done = up(with_eye(tmp_path / "late", "joins = 2", until=5), mark=mark)
    assert done.returncode == 0, done.stderr
    assert [line.split()[1] for line in whole] == ["0", "1", "2", "3", "4", "5"]
    assert logs(tmp_path / "late")["eye"].splitlines() == whole[3:]
    done = up(with_eye(tmp_path / "late", "joins = 2", until=5, top="pace = 20"), mark=mark)    # none waits for it
    assert done.returncode == 0, done.stderr
    assert logs(tmp_path / "late")["eye"].splitlines() == whole[3:]


def test_a_late_one_that_fails_ends_the_run_at_once(mark, tmp_path):
    file = with_eye(tmp_path, "joins = 500", until=1e6)
    (tmp_path / "eye.py").write_text("exit(3)")
    done = up(file, mark=mark)
    assert done.returncode == 1
    assert done.stderr == "fledge: pair ended early: eye ended with exit code 3 before it took part\n"


def test_a_node_that_leaves_delays_no_other(mark, tmp_path):
    done = up(with_eye(tmp_path, 'env = { LEAVES_AT = "2" }', until=5), mark=mark)
    assert done.returncode == 0, done.stderr + done.stdout
    assert len(logs(tmp_path)["eye"].splitlines()) == 3
    assert re.search(r"\neye +(left|finished) +2\.00 s ", done.stdout), done.stdout


def test_the_run_continues_without_a_node_that_no_other_needs(mark, tmp_path):
    file = with_eye(tmp_path, 'on_loss = "hold"', until=5)
    (tmp_path / "eye.py").write_text(EYE.replace("    print", "    1 / (t - 2 * 10**9)\n    print"))
    done = up(file, mark=mark)
    assert done.returncode == 1, "something failed, though the run came to its end"
    assert "eye: it failed: ZeroDivisionError" in done.stdout
    assert re.search(r"\nmass +finished +5\.00 s", done.stdout), done.stdout
    assert done.stderr == "fledge: pair came to its end, but eye failed\n"


def test_one_may_be_started_by_hand_and_again(mark, tmp_path):
    """What it needs is shown; with a pause, the run waits for it."""
    file = write_pair(tmp_path, until=2, mass='env = { STAYS_AT = "1" }', spring='on_loss = "pause"')
    text = file.read_text()
    file.write_text(re.sub(r"command = .*spring.py.*", "by_hand = true", text))
    process = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", str(file)], cwd=tmp_path, env=mark.env,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert process.stdout.readline() == "pair: 2 nodes, 2 s\n"
        shown = re.fullmatch(r"  start spring with (FLEDGE_SIMULATION=pair FLEDGE_NODE=spring FLEDGE_ADDRESS=\S+)\n",
                             process.stdout.readline())
        variables = dict(word.split("=", 1) for word in shown[1].split())
        path = os.pathsep.join([str(BUILT.parents[2] / "cosim/bindings/python"), os.environ.get("PYTHONPATH", "")])
        spring = [sys.executable, str(tmp_path / "spring.py")]
        first = subprocess.Popen(spring, env=mark.env | variables | {"PYTHONPATH": path})
        wait_for(lambda: "the mass is at" in logs(tmp_path).get("mass", ""), process)
        first.kill()
        first.wait()
        assert "; the run waits for it" in process.stdout.readline()
        second = subprocess.Popen(spring, env=mark.env | variables | {"PYTHONPATH": path})
        (tmp_path / "go").touch()
        out, _ = process.communicate()
        assert process.returncode == 0, out
        assert second.wait() == 0
    finally:
        process.kill()
        process.wait()
        mark.kill()


STRANGER = """
import time, zmq
from fledge_node import Node, NodeError, ms
for _ in range(3):
    socket = None
    while socket is None:
        socket = zmq.Context.instance().socket(zmq.DEALER)
        try:
            Node(every=10 * ms)._greet(socket, "Welcome")
        except NodeError:       # the place is not free again yet
            socket.close(0)
            socket = None
            time.sleep(0.05)
    print("greeted", flush=True)
    socket.close(0)
"""


def test_a_stranger_that_greets_and_hangs_up_ends_no_run(mark, tmp_path):
    """Over TCP without keys, in place of a node that has not come yet; and the first line says that anyone may."""
    file = write_pair(tmp_path, until=1, top='address = "tcp://0.0.0.0:*"\nunencrypted = true', mass='')
    file.write_text(re.sub(r"command = .*spring.py.*", "by_hand = true", file.read_text()))
    process = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", str(file)], cwd=tmp_path, env=mark.env,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert process.stdout.readline() == (
            "pair: 2 nodes, 1 s; warning: without keys, any program that reaches tcp://0.0.0.0:* reads all messages "
            "and may take any part (fledge help keys)\n")
        shown = re.search(r"FLEDGE_ADDRESS=tcp://0.0.0.0:(\d+)\n", process.stdout.readline())
        address = f"tcp://127.0.0.1:{shown[1]}"
        path = os.pathsep.join([str(BUILT.parents[2] / "cosim/bindings/python"), os.environ.get("PYTHONPATH", "")])
        variables = {"FLEDGE_SIMULATION": "pair", "FLEDGE_NODE": "spring", "FLEDGE_ADDRESS": address,
                     "PYTHONPATH": path}
        stranger = subprocess.Popen([sys.executable, "-c", STRANGER], env=mark.env | variables, text=True,
                                    stdout=subprocess.PIPE)
        assert stranger.communicate()[0] == "greeted\n" * 3
        spring = subprocess.Popen([sys.executable, str(tmp_path / "spring.py")], env=mark.env | variables)
        out, _ = process.communicate()
        assert process.returncode == 0, out
        assert out.count("spring: its connection is gone; another program may take its place") == 3
        assert spring.wait() == 0
        assert logs(tmp_path)["controller"].startswith("warning: without keys, any program that reaches tcp://0.0.0.0:")
    finally:
        process.kill()
        process.wait()
        mark.kill()


def test_a_mission_without_a_file(mark, tmp_path):
    done = up("nadir_spin", "--until", "60s", mark=mark, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("nadir_spin: 2 nodes, 60 s\n")
    assert re.search(r"\nworld +finished +60\.00 s .*\nflight +finished +60\.00 s ", done.stdout)
    assert "  record   runs/nadir_spin/flight.mcap (" in done.stdout
    whole = up("nadir_spin", "--check", mark=mark, folder=tmp_path)
    assert whole.stdout == "nadir_spin: correct: 2 nodes, 9600 s\n"
    wrong = up("nadir_spin", "spun", mark=mark, folder=tmp_path)
    assert wrong.returncode == 2 and "has no scenario 'spun'; did you mean 'spin'? it has spin" in wrong.stderr


@pytest.fixture
def namespace():
    """Another network namespace, and the address by which it reaches this one."""
    name, near, far = f"fledge-{os.getpid()}", f"fl{os.getpid()}a", f"fl{os.getpid()}b"

    def ip(*words):
        return subprocess.run(["ip", *words], capture_output=True, text=True)

    skip_without("iproute2")
    if (made := ip("netns", "add", name)).returncode:
        pytest.skip("no network namespace can be made: " + made.stderr.strip())
    try:
        for words in (f"link add {near} type veth peer name {far} netns {name}", f"addr add 198.18.7.1/30 dev {near}",
                      f"link set {near} up", f"-n {name} addr add 198.18.7.2/30 dev {far}",
                      f"-n {name} link set {far} up"):
            done = ip(*words.split())
            if done.returncode:
                pytest.skip(f"ip {words}: {done.stderr.strip()}")
        yield name, "198.18.7.1"
    finally:
        ip("link", "del", near)
        ip("netns", "del", name)


def test_beyond_the_network_with_keys(mark, tmp_path, namespace):
    from fledge.cosim import keys

    name, address = namespace
    keys.new(tmp_path / "keys", ["controller", "mass", "spring"])
    keys.allow(tmp_path / "keys", ["mass", "spring"])
    file = write_pair(tmp_path, until=1, top=f'address = "tcp://{address}:*"\nkeys = "keys"',
                      spring=f'launcher = "ip netns exec {name}"')
    done = up(file, mark=mark)
    assert done.returncode == 0, done.stderr + done.stdout
    assert f"listening at tcp://{address}:" in logs(tmp_path)["controller"]
    keys.deny(tmp_path / "keys", ["spring"])
    done = up(file, mark=mark)
    assert done.returncode == 2 and "a node is let in by its key; no key in " in done.stderr


def test_a_folder_is_one_runs_at_a_time(mark, tmp_path):
    file = write_pair(tmp_path, until=1e6)
    first = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", str(file)], cwd=tmp_path, env=mark.env,
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for((tmp_path / "runs/pair/log/controller.log").exists, first)
    second = up(file, mark=mark)
    assert second.returncode == 2
    assert second.stderr == ("fledge: up: runs/pair is in use by another run; end that, or give another folder by "
                             "--out\n")
    first.send_signal(signal.SIGTERM)
    _, errors = first.communicate()
    assert (first.returncode, errors) == (143, "fledge: pair ended early: the user ended it\n")


def test_help_names_what_there_is():
    done = subprocess.run([sys.executable, "-m", "fledge.cli", "up", "--help"], capture_output=True, text=True,
                          env=os.environ)
    assert done.returncode == 0 and "example: ./fledge up spring.toml" in done.stdout


@pytest.mark.long("flies by the wall clock")
def test_a_program_steers_the_run(mark, tmp_path):
    """It pauses the run at a time, lets it go on as fast as possible, and the messages are those of a run alone."""
    from fledge.archive import Archive
    from fledge.archive.compare import compare

    (tmp_path / "hand.py").write_text("""
import time
from fledge.cosim.steering import Steering

hand = Steering.of_run()
hand.until(0.505)
hand.pace(0)
def paused(least):
    while not hand.state.get("paused") or hand.state["t"] < least:
        time.sleep(0.01)
    return hand.state["t"]
print("paused at", paused(0.1))
hand.until(1)
print("paused at", paused(0.6), flush=True)
hand.go()
time.sleep(60)
""")
    steered = write_pair(tmp_path, simulation="paced", top="pace = 0.001")      # until the hand is there
    steered.write_text(steered.read_text() + f"""
[[asynchronous]]
name = "hand"
command = ["{sys.executable}", "hand.py"]
steers = true
""")
    done = up(steered, "--exchange", mark=mark)
    assert done.returncode == 0, done.stdout + done.stderr
    assert logs(tmp_path, "paced")["hand"] == "paused at 0.5\npaused at 1\n"
    done = up(write_pair(tmp_path), "--exchange", mark=mark)
    runs = tmp_path / "runs"
    assert compare(Archive(runs / "paced/exchange.mcap"), Archive(runs / "pair/exchange.mcap")) == []


HAND = """
import time
from fledge.cosim.steering import Steering

hand = Steering.of_run()
hand.until(0.5)
while not hand.state.get("paused"):
    time.sleep(0.01)
hand.go()
time.sleep(60)
"""


@pytest.mark.long("flies with each answer to a loss")
@pytest.mark.parametrize("policy", ["hold", "drop", "restart"])
def test_one_that_is_killed_at_a_time_is_lost_there(mark, tmp_path, policy):
    """Whatever the speed of the programs, and of any program that lets the run go on."""
    import numpy as np
    from fledge.archive import Archive
    from fledge.archive.compare import compare

    (tmp_path / "hand.py").write_text(HAND)
    file = write_pair(tmp_path, spring=f'killed = 1\non_loss = "{policy}"', mass="env = { NAP = \"0.001\" }")
    hand = f'[[asynchronous]]\nname = "hand"\ncommand = ["{sys.executable}", "hand.py"]\nsteers = true\n'
    file.write_text(file.read_text() + hand)
    done = up(file, "--exchange", mark=mark)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "spring is killed at 1 s, as the file says" in done.stdout
    first = tmp_path / "runs/first"
    (tmp_path / "runs/pair").rename(first)
    file = write_pair(tmp_path, spring="" if policy == "restart" else f'killed = 1\non_loss = "{policy}"')
    done = up(file, "--exchange", mark=mark)
    assert done.returncode == 0, done.stdout + done.stderr
    whole, again = (Archive(folder / "exchange.mcap") for folder in (first, tmp_path / "runs/pair"))
    assert compare(whole, again) == []
    x = whole["/mass/state"]["x"][:, 0]
    assert len(x) == 201
    steps = np.diff(x, 2) / 1e-4        # the force at each instant
    if policy == "restart":
        assert np.ptp(steps[110:]) > 0.01
    else:       # the last one counts on, or none
        assert steps[105:] == pytest.approx(-x[100] if policy == "hold" else 0.0, abs=1e-9)
        assert abs(steps[90]) > 0.1 and whole.time("/spring/force")[-1] == (1 if policy == "hold" else 1.01)
