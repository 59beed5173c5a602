# SPDX-License-Identifier: Apache-2.0
"""Flight on the emulated LEON3 goes back in time, and on after it was killed: from snapshots, with the same bits."""
import contextlib
import hashlib
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fledge import cli
from fledge.archive import Archive
from fledge.cosim.up.testing import BUILT, Mark
from fledge.export.run_test import FLIGHT, WORLD
from tests.needs import flies_on
from tests.waiting import wait_for

pytestmark = [
    pytest.mark.skipif(not (BUILT / "fledge_controller").exists(), reason="the controller is not built"),
    pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="the release build shows it"),
    flies_on("leon3")]

COUNTING = FLIGHT + '''
    f.files = fsw.Files(entity=2, ground=1, rate=2000 / s, ack_timer=2 * s, nak_timer=2 * s)
    f.count = fsw.BootCount()
    f.task("services", every=400 * ms, run=[f.files, f.count])
    f.reset_by(f.count.computer, down=2.4 * s)
'''
RESETTING = WORLD + '''
    from fledge.units import A, V, ohm
    w.power  = world.PowerUnit(n=1, volts=30 * V, load=10 * ohm, count_current=1e-3 * A, count_volts=1e-3 * V,
                               reset_at=[14.3, 0, 0, 0] * s)
    w.memory = world.Interconnect(slots=1)
    w.connect(w.power.computer >> f.count.computer, w.memory.reply >> f.count.reply,
              f.count.request >> w.memory.request)
    w.task("avionics", every=100 * ms, run=[w.power, w.memory])
'''
# A file goes up from 2.3 s to 8 s, then another; the computer is reset at 14.4 s, and is down until 16.8 s, while
# commands come that wait for it.
SCRIPT = '''
import time
from pathlib import Path
from fledge.units import s


def pause(number):      # the run waits, until the test lets it go on
    if Path("hold").exists():
        Path(f"at{{number}}").touch()
        while not Path(f"go{{number}}").exists():
            time.sleep(0.01)


def run(craft, script):
    Path("plan").write_bytes(bytes(i * i % 251 for i in range(20000)))
    craft.command("telemetry").completed()
    craft.command("mode", "point").completed()
    script.hold(2 * s)
    sent = craft.put("plan", to="next")
    craft.listen(2.5 * s)
    pause(1)
    sent.completed(within=20 * s)
    craft.put("plan", to="other")
    craft.listen(7 * s)
    for K in (3.1, 3.2, 3.3):
        craft.command("write", "flight.control", K=K)
    craft.listen(0.5 * s)
    pause(2)
    craft.listen(3 * s)
    pause(3)
    craft.listen(1 * s)
    craft.command("mode", "{mode}")
    script.hold(4 * s)
'''
FILE = '''
until = 24
keep_every = 1
join = 300
watch = ["/flight/telemetry"]

[[node]]
mission = "./counts"
process = "world"
free = true

[[node]]
mission = "./counts"
process = "flight"
free = true
target = "{target}"
{flight}

[[node]]
name = "ground"
command = ["{python}", "-m", "fledge.cli", "ground", "run", "{script}.py", "--yes", "--out", "{script}",
           "--to", "cosim:flight?every=0.1", "--mission", "./counts"]
'''


def write(name, mode="rest", flight="", target="leon3"):
    Path(f"{name}.py").write_text(SCRIPT.format(mode=mode))
    Path(f"{name}.toml").write_text(FILE.format(python=sys.executable, script=name, target=target,
                                                flight=flight))
    return f"{name}.toml"


def messages(run, begin=-1, end=100):
    """Of the record of what the programs wrote to each other in a time [s]: topic -> times and bytes."""
    with Archive(run / "exchange.mcap") as record:
        chosen = {topic: (record.time_ns(topic) >= begin * 1e9) & (record.time_ns(topic) < end * 1e9)
                  for topic in record.topics}
        return {topic: (record.time_ns(topic)[chosen[topic]].tolist(), record[topic][chosen[topic]].tobytes())
                for topic in record.topics}


def hashes(run):
    """Of these messages, of the records of the world and of flight, and of the file of flight's telemetry."""
    return {"exchange": hashlib.sha256(repr(messages(run)).encode()).hexdigest(),
            **{name: hashlib.sha256((run / name).read_bytes()).hexdigest()
               for name in ("world.mcap", "flight/leon3.mcap", "flight/leon3.telemetry.txt")}}


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A run that never goes back, in the folder of the tests."""
    folder = tmp_path_factory.mktemp("boards")
    (folder / "counts").mkdir()
    (folder / "counts/flight.py").write_text(COUNTING)
    (folder / "counts/world.py").write_text(RESETTING)
    with contextlib.chdir(folder):
        assert cli.main(["up", write("first")]) == 0
        run = Path("runs/first")
        downs = [line for line in (run / "flight/leon3.log").read_text().splitlines() if "has reset the board" in line]
        assert len(downs) == 1 and (run / "flight/leon3.telemetry.txt").stat().st_size > 10_000
        yield run


def rewound(t, *options, code=0, out="again", run="runs/first"):
    assert cli.main(["rewind", run, "--to", str(t), "--out", f"runs/{out}", *options]) == code
    return Path("runs") / out


# Before the first snapshot; while a file goes up; while the computer is down, before and after commands have come that
# wait for it; afterwards.
@pytest.mark.long("flies on the LEON3, for each instant again")
@pytest.mark.parametrize("t", [0.7, 5.3, 14.75, 16.2, 18])
def test_from_any_instant_flight_on_the_leon3_goes_on_with_the_same_bytes(t, flown, capfd):
    assert hashes(rewound(t)) == hashes(flown)
    output = capfd.readouterr().out
    start = "from     the start: " + ("ground" if t > 1 else "world, flight, ground")
    assert (f"from     {int(t)} s: world, flight\n" in output) == (t > 1) and start in output


@pytest.mark.long("flies on the LEON3 twice")
def test_another_command_makes_another_branch_from_its_instant_on(flown):
    branch = rewound(15.2, "--with", write("second", mode="point"), "--changed")
    assert messages(branch, end=19.5) == messages(flown, end=19.5)
    before, after = messages(flown, begin=19.5), messages(branch, begin=19.5)
    assert {topic for topic in before if before[topic] != after[topic]} >= {
        "/flight/commands", "/flight/motor/command", "/world/nav/attitude", "/world/wheels/speeds"}
    assert hashes(rewound(21, run=str(branch), out="more")) == hashes(branch)


@pytest.mark.long("flies on the LEON3 twice")
def test_what_a_snapshot_needs_besides_itself(flown, capfd):
    """Without the record of flight it flies from the start; on another one it does not go on."""
    copy = Path("runs/copy")
    shutil.copytree(flown, copy, ignore=shutil.ignore_patterns("[0-9].*", "1*.snapshots"))
    record = copy / "flight/leon3.mcap"
    whole = record.read_bytes()
    record.write_bytes(whole[:60] + b"!" + whole[61:])
    rewound(20.5, run=str(copy), code=1)
    assert "flight: it failed: leon3.mcap.part is not what was recorded until the snapshot" in capfd.readouterr().err
    record.unlink()
    assert hashes(rewound(20.5, run=str(copy))) == hashes(flown)
    assert "from     the start: flight, ground" in capfd.readouterr().out


class Paused:
    """A run that waits for the test where its script pauses."""

    def __init__(self, file, out):
        for old in (*Path().glob("at?"), *Path().glob("go?")):
            old.unlink()
        Path("hold").touch()
        self.mark = Mark()
        self.process = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", file, "--out", f"runs/{out}"],
                                        env=self.mark.env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        Path("hold").unlink()
        self.mark.kill()

    def at(self, number):
        wait_for(Path(f"at{number}").exists, self.process)

    def programs(self, command):
        found = [pid for pid, line in self.mark.processes() if command in line.partition(" -- ")[0]]
        assert found, "\n".join(line for _, line in self.mark.processes())
        return found

    def ends(self, *paused, code=0):
        for number in paused:
            Path(f"go{number}").touch()
        output, _ = self.process.communicate()
        assert self.process.returncode == code and not self.mark.gone(), output
        return output


@pytest.mark.long("flies on targets twice")
@pytest.mark.parametrize("target, programs", [
    ("leon3", ("fledge_leon3 ", "fledge_board_node ", " -m fledge.cli fly ")), ("linux", ("fledge_board_node ",))])
def test_flight_that_is_killed_goes_on_with_the_same_bits(target, programs, flown):
    """Nothing is lost, nothing doubled: on the LEON3 from its last snapshot, on Linux from the start."""
    file = write("first", flight=f'on_loss = "restart"\nsave_every = 2\nrestarts = {len(programs)}', target=target)
    with Paused(file, "killed") as run:
        for number, program in enumerate(programs, 1):
            run.at(number)
            for pid in run.programs(program):
                os.kill(pid, 9)
            Path(f"go{number}").touch()
        output = run.ends(2, 3)
    assert output.count("; restarted, it ") == len(programs), output
    assert ("it goes on from 4 s" in output) == (target == "leon3"), output
    if target == "leon3":
        assert hashes(Path("runs/killed")) == hashes(flown)
    else:
        assert messages(Path("runs/killed")) == messages(flown)


@pytest.mark.long("flies on the LEON3 twice")
def test_a_full_disk_ends_the_run_and_it_goes_on_from_before(flown, capfd):
    with Paused(write("first"), "full") as run:
        run.at(1)
        record = Path("runs/full/flight/leon3.mcap.part")
        pid, = run.programs("fledge_leon3 ")
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (record.stat().st_size + 1,) * 2)
        output = run.ends(1, 2, 3, code=1)
    assert "flight: it failed: leon3.mcap: File too large" in output
    assert hashes(rewound(3.9, run="runs/full")) == hashes(flown)
    with Paused(write("first"), "full") as run:
        run.at(1)
        Path("runs/full/snapshots/6000000000.snapshots.part").mkdir()   # so that no file can be written
        output = run.ends(1, 2, 3, code=1)
    assert "cannot write the snapshots " in output and "is there room in the file system?" in output
    assert hashes(rewound(5.5, run="runs/full")) == hashes(flown)
    assert "from     5 s: world, flight" in capfd.readouterr().out
