# SPDX-License-Identifier: Apache-2.0
"""Time travel through `fledge up` and `fledge rewind`: a run that goes on writes what the first one wrote."""
import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fledge import cli
from fledge.archive import Archive
from fledge.cosim.up.testing import BUILT, Mark
from tests.needs import skip_unless_on

pytestmark = pytest.mark.skipif(not (BUILT / "fledge_controller").exists(), reason="the controller is not built")

# A mass that makes snapshots, and draws random numbers; a spring that makes none; and commands that push the mass.
MASS = """
import os, pickle, random
from fledge_node import Node, ms
node = Node(every=20 * ms)
node.reads("/spring/force", "next_instant")
node.reads("/ground/push", "next_instant", optional=True, name="Push", text="float64 F  # F [N] force")
node.writes("/mass/state", "State", "float64 x  # x [m] position", initial={"x": 1.0})
dice, x, v = random.Random(7), 1.0, 0.0

@node.saves
def save():
    return pickle.dumps((dice.getstate(), x, v, bytes(int(os.environ.get("LARGE", 0)))))

@node.restores
def restore(snapshot):
    global x, v
    state, x, v, _ = pickle.loads(snapshot)
    dice.setstate(state)
    print("restored")

@node.step
def step(t):
    global x, v
    push = node["/ground/push"]
    v += 0.02 * (node["/spring/force"]["F"] + dice.gauss(0, 0.1) + (push["F"] if push else 0.0))
    x += 0.02 * v
    node["/mass/state"] = {"x": x}

node.run()
"""
SPRING = """
import os, sys, time
from fledge_node import Node, ms
node = Node(every=20 * ms)
node.reads("/mass/state", "same_instant")
node.writes("/spring/force", "Force", "float64 F  # F [N] force")
softer = float(sys.argv[1]) * 10**9

@node.step
def step(t):
    while t == 4 * 10**9 and os.path.exists("hold") and not os.path.exists("pushed"):
        time.sleep(0.01)
    node["/spring/force"] = {"F": (-1.0 if t < softer else -0.5) * node["/mass/state"]["x"]}

node.run()
"""
# Pushes once, and again when the other program says so.
GROUND = """
import os, sys, time
from fledge_node import Observer
with Observer() as ground:
    ground.subscribe("/mass/")
    for message in ground:
        print(message.t)
        if message.t >= float(sys.argv[1]) * 10**9:
            ground.write("/ground/push", {"F": 3.0})
            open("pushed", "w").close()
            break
    for message in ground:
        pass
"""
FILE = """
until = 6
keep_every = 0.5

[[node]]
name = "mass"
command = ["{python}", "mass.py"]

[[node]]
name = "spring"
command = ["{python}", "spring.py", "{softer}"]

[[node]]
mission = "nadir_spin"
process = "world"

[[node]]
mission = "nadir_spin"
process = "flight"
{flight}
"""
PUSHES = """
[[asynchronous]]
name = "ground"
command = ["{python}", "ground.py", "{when}"]
"""

# Lets the run go back from 4 s to 1.2 s, once.
STEERS = """
[[asynchronous]]
name = "hand"
steers = true
command = ["{python}", "hand.py"]
"""
HAND = """
import os, time
from fledge.cosim.steering import Steering
hand = Steering.of_run()
while hand.state.get("t", 0) < 3.9:
    time.sleep(0.01)
if not os.path.exists("pushed"):
    hand.rewind(5.5)
    text = open("spring.py").read()
    open("spring.py", "w").write(text + "#")
    hand.rewind(1.0)
    while "changed" not in hand.state["refused"]:
        time.sleep(0.01)
    print(hand.state["refused"])
    open("spring.py", "w").write(text)
    hand.rewind(1.2)
    hand.rewind(9)      # is read after the other one
    while "back to 9 s" not in hand.state["refused"]:
        time.sleep(0.01)
    open("pushed", "w").close()
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("mass", MASS), ("spring", SPRING), ("ground", GROUND), ("hand", HAND)):
        (tmp_path / f"{name}.py").write_text(text)
    return tmp_path


def write(name="pair", softer=100, flight="", ground=None):
    with open(f"{name}.toml", "w", encoding="utf-8") as file:
        file.write(FILE.format(python=sys.executable, softer=softer, flight=flight)
                   + (PUSHES.format(python=sys.executable, when=ground) if ground is not None else ""))
    return f"{name}.toml"


def messages(record, until=1e9):
    """All messages of a record up to a time [s]: topic -> times and bytes."""
    with Archive(record) as archive:
        chosen = {topic: archive.time_ns(topic) <= until * 1e9 for topic in archive.topics}
        return {topic: (archive.time_ns(topic)[chosen[topic]].tolist(), archive[topic][chosen[topic]].tobytes())
                for topic in archive.topics}


def run(*words, code=0):
    assert cli.main([*map(str, words)]) == code


def again(t, code=0, *options, first="pair", out="again"):
    """Rewind a run; returns the folder of the new one."""
    run("rewind", f"runs/{first}", "--to", t, "--out", f"runs/{out}", *options, code=code)
    return Path("runs") / out


def same(first, second, names=("exchange", "world", "flight"), until=1e9):
    return all(messages(first / f"{name}.mcap", until) == messages(second / f"{name}.mcap", until) for name in names)


@pytest.fixture
def flown(place, capfd):
    """A run until 6 s, with a ground that writes nothing."""
    run("up", write(ground=100))
    capfd.readouterr()
    return place / "runs/pair"


@pytest.mark.long("flies and goes back several times")
def test_from_random_instants_a_run_goes_on_with_the_same_bytes(flown, capfd):
    assert len(list((flown / "snapshots").iterdir())) == 11
    dice = random.Random(time.time_ns())
    for t in (0.3, *(round(dice.uniform(0.5, 5.9), 3) for _ in range(3))):
        new = again(t)
        assert same(new, flown), t
        assert (new / "exchange.mcap").read_bytes() == (flown / "exchange.mcap").read_bytes(), t
        assert len(list((new / "snapshots").iterdir())) == 11 - int(2 * t)
        output = capfd.readouterr().out
        assert (f"from     {int(2 * t) / 2:g} s: mass, world, flight\n" in output) == (t >= 0.5), output
        assert "from     the start: " + ("spring" if t >= 0.5 else "mass, spring, world, flight") in output
        assert ("restored" in (new / "log/mass.log").read_text()) == (t >= 0.5)
        assert json.loads((new / "run.json").read_text())["from"] == {"run": str(flown), "t": t}


@pytest.mark.long("flies and goes back several times")
def test_another_command_makes_a_branch_which_can_be_rewound_too(flown):
    Path("hold").touch()
    branch = again(2.5, 0, "--with", write("other", ground=0), "--pace", 3)
    pushed = Archive(branch / "exchange.mcap").time_ns("/ground/push")
    assert len(pushed) == 1 and pushed[0] > 2.5e9
    t = float(pushed[0]) / 1e9
    assert same(branch, flown, until=t - 1e-9)
    assert messages(flown / "exchange.mcap")["/mass/state"] != messages(branch / "exchange.mcap")["/mass/state"]
    seen = [int(t) for t in (branch / "log/ground.log").read_text().split()]
    assert all(t < 0 for t in seen[:-1]) and seen[-1] >= 2.5e9    # the past is not seen again, but its last messages
    Path("hold").unlink()
    assert same(again(5.5, 0, "--with", "pair.toml", first="again", out="more"), branch)


@pytest.mark.long("flies and goes back several times")
def test_a_program_that_steers_lets_the_run_go_back(flown, capfd):
    Path("hold").touch()
    with open(write("steered", ground=None), "a", encoding="utf-8") as file:
        file.write(STEERS.format(python=sys.executable))
    run("up", "steered.toml", "--pace", 4)
    output = capfd.readouterr().out
    assert "hand asks for the instant 5.5 s, but the run is at" in output
    assert "hand asks for the instant 1 s, but spring has changed since the run began" in output
    assert "steered: back to 1.2 s, in runs/steered@1.2s\n" in output
    first, second = (messages(Path(f"runs/{name}/exchange.mcap")) for name in ("steered", "steered@1.2s"))
    flown = messages(flown / "exchange.mcap")
    del flown["/ground/push"]
    assert second == flown and max(first["/mass/state"][0]) < 5.5e9


def test_a_changed_program_flies_from_the_start_and_must_repeat_the_past(flown, capfd):
    file = write("softer", softer=3, ground=100)
    again(2, 2, "--with", file)
    assert "since that run, these have changed: spring, its command; restore them, or give --changed" in \
        capfd.readouterr().err
    branch = again(2, 0, "--with", file, "--changed")
    assert same(branch, flown, until=2.99) and not same(branch, flown)
    again(4, 1, "--with", file, "--changed")
    assert "spring does not repeat what it wrote before: /spring/force at 3 s differs" in capfd.readouterr().err


@pytest.mark.long("flies several times")
def test_what_cannot_be_rewound_is_refused_with_what_to_do(flown, capfd):
    def refused(*words, run="runs/pair", to="2"):
        assert cli.main(["rewind", run, "--to", to, *words]) == 2
        return capfd.readouterr().err

    assert "runs is no folder of a run: it has no run.json" in refused(run="runs")
    assert "is to go on from 7 s, but it ends at 6 s; give a later --until" in refused(to="7")
    assert "runs/pair is known until 6 s, because there it ended; found --to 7 s" in refused("--until", "9", to="7")
    assert "--to: expected a duration" in refused(to="soon")
    assert "would overwrite the run" in refused("--out", "runs/pair")
    newest = flown / "snapshots/2000000000.snapshots"
    whole = newest.read_bytes()
    for damaged, why in ((whole[:-9], "it is cut off"), (whole[:-300] + b"!" + whole[-299:], "the checksum of flight"),
                         (b"", "it does not begin as such a file")):
        newest.write_bytes(damaged)
        output = refused()
        assert f"{newest.relative_to(Path.cwd())} is damaged: {why}" in output
        assert "; delete it, and the run goes on from the snapshots before" in output
    newest.unlink()
    assert same(again(2), flown)
    assert "from     1.5 s: mass" in capfd.readouterr().out
    (flown / "exchange.mcap").rename("moved")
    assert "has no record of its messages" in refused()
    Path("moved").rename(flown / "exchange.mcap")
    Path("mass.py").write_text(MASS + "# changed\n")
    assert "these have changed: mass, its files;" in refused()
    note = json.loads((flown / "run.json").read_text())
    (flown / "run.json").write_text(json.dumps({**note, "fledge": "0.0"}))
    assert "fledge, it was 0.0 and is " in refused()
    assert same(again(2, 0, "--changed"), flown)        # all from the start
    (flown / "run.json").write_text("{")
    assert "run.json is damaged" in refused()


@pytest.mark.long("kills a run many times")
def test_a_run_that_was_killed_while_it_wrote_snapshots_loses_at_most_the_newest(flown):
    mark = Mark()
    large = Path("pair.toml").read_text().replace('"mass.py"]', '"mass.py"]\nenv = { LARGE = "20000000" }')
    Path("large.toml").write_text(large)
    process = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", "large.toml", "--out", "runs/killed",
                                "--pace", "0.5"], env=mark.env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    snapshots = Path("runs/killed/snapshots")
    while len(list(snapshots.glob("*.snapshots"))) < 2 or not (writing := list(snapshots.glob("*.part"))):
        assert process.poll() is None
    for pid, command in mark.processes():
        if "fledge_controller" in command and "guard" not in command:
            os.kill(pid, 9)
    assert process.wait() == 1 and not mark.gone()
    newest = max(int(path.stem) for path in snapshots.glob("*.snapshots")) / 1e9
    assert newest >= float(writing[0].name.split(".")[0]) / 1e9 - 0.5
    assert (Path("runs/killed") / "exchange.mcap.part").exists()
    assert same(again(newest, first="killed"), flown)


@pytest.mark.long("flies and goes back several times")
def test_flight_without_snapshots_repeats_what_it_wrote(place, capfd):
    """As a real process; on the LEON3: board_rewind_test.py."""
    skip_unless_on("linux")
    run("up", write(flight='target = "linux"'))
    new = again(round(random.uniform(0.6, 5.9), 3))
    assert same(new, place / "runs/pair", ["exchange", "world"])
    assert "from     the start: spring, flight" in capfd.readouterr().out


@pytest.mark.parametrize("text, seconds", [("1h23m", 4980), ("1h 2min 3.5s", 3723.5), ("2m5s", 125), ("90s", 90),
                                           ("2.5h", 9000), ("4.25", 4.25)])
def test_an_instant_has_hours_minutes_and_seconds(text, seconds):
    from fledge.cli.arguments import parse_duration

    assert parse_duration(text, "--to") == seconds
