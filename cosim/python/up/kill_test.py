# SPDX-License-Identifier: Apache-2.0
"""A run leaves no process, no socket and no memory, whichever of its processes a signal kills, at any time.

A few cycles by default; as many as you like of both kinds, of kills and of restarts, are run by

    FLEDGE_KILL_CYCLES=100 ./fledge exec /usr/bin/python3 -m pytest cosim/python/up/kill_test.py
"""
import codecs
import os
import pty
import random
import re
import signal
import subprocess
import sys
import time

import pytest

from fledge.cosim.up.testing import BUILT, mark, set_pace, sockets_and_memory, steered, write_pair
from tests.waiting import wait_for

pytestmark = pytest.mark.skipif(not (BUILT / "fledge_guard").exists() or not (BUILT / "fledge_controller").exists(),
                                reason="the controller is not built")

CYCLES = int(os.environ.get("FLEDGE_KILL_CYCLES", 0))
SHORT = 3 if os.environ.get("FLEDGE_PRESET") == "asan" else 7     # programs start slowly under the sanitizer
SEED = int(os.environ.get("FLEDGE_KILL_SEED", 1))

VICTIMS = {     # by what stands in the command line
    "up": r"-m fledge\.cli up", "controller": r"\S*fledge_controller ",
    "its guard": r"\S*fledge_guard -- \S*controller ",
    "mass": r"\S+ mass\.py$", "spring": r"\S+ spring\.py$", "guard": r"\S*fledge_guard -- \S+ mass\.py$",
    "child": r"sh -c trap|sleep 600"}
PHASES = ("starting", "gathering", "running", "ending")


def start(file, mark):
    return subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", str(file)], cwd=file.parent, env=mark.env,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def output_of(folder, simulation, name):
    file = folder / "runs" / simulation / "log" / f"{name}.log"
    return file.read_text() if file.exists() else ""


def named(mark, pattern):
    return [pid for pid, command in mark.processes() if re.match(rf"(?:\S*python\S* )?(?:{pattern})", command)]


def cycle(folder, mark, phase, victim, rng):
    """Kill a program in a phase; returns the output of `fledge up` and how it ended."""
    simulation = f"kill-{os.getpid()}-{rng.getrandbits(32):x}"
    file = write_pair(folder, until=0.3 if phase == "ending" else 1e6, simulation=simulation,
                      mass=f'env = {{ CHILD = "1", LINGERS = "{3 if phase == "ending" else 0}" }}')
    process = start(file, mark)
    try:
        if phase == "gathering":
            wait_for(lambda: named(mark, VICTIMS["mass"]))
        elif phase == "running":
            wait_for(lambda: "the mass is at" in output_of(folder, simulation, "mass"))
        elif phase == "ending":
            wait_for(lambda: "the mass leaves" in output_of(folder, simulation, "mass"))
        time.sleep(rng.uniform(0, 0.3) if phase == "starting" else rng.uniform(0, 0.05))
        for pid in named(mark, VICTIMS[victim])[:1]:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        if phase in ("starting", "gathering") or victim == "child":
            time.sleep(0.2)
            process.send_signal(signal.SIGTERM)     # the kill may have hit no process, or an unimportant one
        out, _ = process.communicate()
        left = mark.gone()
        assert not left, f"killing {victim} while {phase} leaves {left}; {out}"
        assert not sockets_and_memory(simulation)
        return out, process.returncode
    finally:
        process.kill()
        process.wait()


def chosen():
    """(phase, victim) of each cycle: all there are, in an order by the seed."""
    rng = random.Random(SEED)
    pairs = [(phase, victim) for phase in PHASES for victim in VICTIMS]
    picked = []
    while len(picked) < (CYCLES or SHORT):
        rng.shuffle(pairs)
        if CYCLES:
            picked += pairs
        else:       # each victim once
            picked += {victim: (phase, victim) for phase, victim in pairs}.values()
    return picked[:CYCLES or SHORT]


@pytest.mark.long("kills each process in turn: 30 s")
def test_a_run_leaves_nothing_whichever_process_is_killed(mark, tmp_path):
    rng = random.Random(SEED)
    for phase, victim in chosen():
        out, code = cycle(tmp_path, mark, phase, victim, rng)
        if victim == "up" and code != -signal.SIGKILL:
            assert phase in ("starting", "ending"), (phase, code)      # it was not there yet, or not any more
        elif victim in ("controller", "its guard", "mass", "spring", "guard") and phase == "running":
            assert code == 1, out
            assert "was killed by SIGKILL" in out, out


@pytest.mark.long("flies twice, with a process killed")
def test_a_program_that_is_killed_goes_on_as_if_nothing_had_been(mark, tmp_path):
    """on_loss = "restart": the one that goes on brings the others to where they would have come."""
    rng = random.Random(SEED)
    kills = CYCLES or 4
    simulation = f"again-{os.getpid()}"
    until = kills + 2
    (tmp_path / "alone").mkdir()
    alone = start(write_pair(tmp_path / "alone", until=until, simulation=simulation), mark)
    out, _ = alone.communicate()
    assert alone.returncode == 0, out
    file = write_pair(tmp_path, until=until, simulation=simulation,
                      mass=f'env = {{ STAYS_AT = "{until - 1}", NAP = "0.02" }}',
                      spring=f'on_loss = "restart"\nrestarts = {kills}')
    process = start(file, mark)
    lines = 0
    for k in range(kills):      # one that does not get further would be given up
        wait_for(lambda: output_of(tmp_path, simulation, "spring").count("the spring is there") > k)
        wait_for(lambda: output_of(tmp_path, simulation, "mass").count("\n") > lines)
        time.sleep(rng.uniform(0.0, 0.2))
        os.kill(wait_for(lambda: named(mark, VICTIMS["spring"]))[0], signal.SIGKILL)
        lines = output_of(tmp_path, simulation, "mass").count("\n")
    wait_for(lambda: output_of(tmp_path, simulation, "spring").count("the spring is there") > kills)
    (tmp_path / "go").touch()
    out, _ = process.communicate()
    assert process.returncode == 0, out
    assert out.count("spring was killed by SIGKILL; it is started again") == kills
    assert output_of(tmp_path, simulation, "mass") == output_of(tmp_path / "alone", simulation, "mass")
    assert not sockets_and_memory(simulation)


PROCESSES = """
simulation = "{simulation}"
until = 6000
pace = {pace}
[[node]]
mission = "nadir_spin"
process = "world"
[[node]]
mission = "nadir_spin"
process = "flight"
on_loss = "{on_loss}"
save_every = 20
"""


def fly_processes(folder, mark, on_loss, kills):
    """Fly nadir_spin in two programs, and kill flight so often; returns the output of `fledge up`, and how it ended."""
    folder.mkdir()
    simulation = f"{folder.name}-{os.getpid()}"
    file = folder / "pair.toml"
    file.write_text(PROCESSES.format(simulation=simulation, on_loss=on_loss, pace=60 if kills else 0)
                    + steered(folder))
    process = start(file, mark)
    record = folder / "runs" / simulation / "flight.mcap.part"
    least = 40_000              # of at least 50 s

    def grown():
        return record.exists() and record.stat().st_size > least

    for _ in range(kills):
        wait_for(grown, process)
        least = record.stat().st_size + 20_000      # it has to get further, or it is given up
        os.kill(wait_for(lambda: named(mark, r"-P -m fledge\.cli node nadir_spin flight"))[0], signal.SIGKILL)
    set_pace(folder, 0)
    out, _ = process.communicate()
    return out, process.returncode, folder / "runs" / simulation


@pytest.mark.long("flies twice, with a process killed")
def test_the_record_of_a_process_that_is_killed_and_goes_on_is_whole(mark, tmp_path):
    from fledge.archive import Archive

    out, code, alone = fly_processes(tmp_path / "alone", mark, "restart", 0)
    assert code == 0, out
    out, code, killed = fly_processes(tmp_path / "killed", mark, "restart", 2)
    assert code == 0 and out.count("flight was killed by SIGKILL; it is started again") == 2, out
    assert sorted(p.name for p in killed.glob("*.mcap*")) == ["flight.mcap", "world.mcap"]
    assert (killed / "flight.mcap").read_bytes() == (alone / "flight.mcap").read_bytes()
    assert Archive(killed / "flight.mcap").complete and "  missing  " not in out and "  left     " not in out


@pytest.mark.long("kills each process in turn: 100 s")
def test_what_is_left_of_a_process_that_was_killed_is_named(mark, tmp_path):
    from fledge.archive import Archive

    out, code, folder = fly_processes(tmp_path / "held", mark, "hold", 1)
    assert code == 1, out
    part = folder / "flight.mcap.part"
    there = re.search(rf"  left     \S*{part.name}: its program was lost; it has the data up to t = ([\d.]+) s\n", out)
    with Archive(part) as archive:
        assert f"{archive.good_until:g}" == there[1] and archive.good_until > 30
        assert archive.topics["/flight/tracking/error"].count > 30
    start(folder.parents[1] / "pair.toml", mark).communicate()
    assert not part.exists() and (folder / "flight.mcap").exists()       # each run begins with what is its own


@pytest.mark.long("kills a process until it is given up")
def test_restarts_come_to_an_end(mark, tmp_path):
    file = write_pair(tmp_path, simulation=f"worn-{os.getpid()}", spring='on_loss = "restart"\nrestarts = 1\n'
                      'env = { BREAKS_AT = "1" }')
    out, _ = (process := start(file, mark)).communicate()
    assert process.returncode == 1
    assert "spring ended with exit code 1; it is started again (1 of 1)\n" in out
    assert "  | ValueError: the spring breaks\n" in out and "ended early: spring" in out


@pytest.mark.long("waits for a limit of time")
def test_one_that_hangs_is_started_again(mark, tmp_path):
    file = write_pair(tmp_path, simulation=f"hung-{os.getpid()}", spring='on_loss = "restart"\nreply = 3\n'
                      'env = { HANGS_AT = "1" }')
    out, _ = (process := start(file, mark)).communicate()
    assert process.returncode == 0, out
    assert "it did not answer within 3 s" in out and "it is started again (1 of 3)" in out


class Terminal:
    """`fledge up` with a terminal of its own."""

    def __init__(self, file, mark):
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.chdir(file.parent)
            os.execve(sys.executable, [sys.executable, "-m", "fledge.cli", "up", str(file)],
                      mark.env | {"TERM": "xterm"})
        self.text, self._decode = "", codecs.getincrementaldecoder("utf-8")().decode

    def read(self, until=None):
        """Until something is there, or its other side is closed."""
        while until is None or not re.search(until, self.text):
            try:
                self.text += self._decode(os.read(self.fd, 65536))
            except OSError:
                return

    def press(self, key):
        os.write(self.fd, key)

    def end(self):
        self.read()
        os.close(self.fd)
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def test_ctrl_c_ends_all_in_order(mark, tmp_path):
    simulation = f"keys-{os.getpid()}"
    terminal = Terminal(write_pair(tmp_path, until=1e6, simulation=simulation, mass='env = { CHILD = "1" }'), mark)
    terminal.read(r"mass +running .*spring +running .*the mass is at".replace(" .*", r"[\s\S]*"))
    terminal.press(b"\x03")
    assert terminal.end() == 130
    assert f"{simulation} ended early: the user ended it" in terminal.text
    assert terminal.text.count("\x1b[?25h") and terminal.text.rindex("\x1b[?25h") > terminal.text.rindex("\x1b[?25l")
    assert "the mass leaves" in output_of(tmp_path, simulation, "mass"), "the controller did not announce the end"
    assert mark.gone() == [] and not sockets_and_memory(simulation)


@pytest.mark.long("waits for programs that do not end")
def test_ctrl_c_twice_waits_for_no_program(mark, tmp_path):
    simulation = f"twice-{os.getpid()}"
    terminal = Terminal(write_pair(tmp_path, until=1e6, simulation=simulation, spring='env = { HANGS_AT = "0" }'), mark)
    terminal.read(r"busy \d+ s")
    terminal.press(b"\x03")
    time.sleep(1.0)             # two at once may be one signal
    terminal.press(b"\x03")
    assert terminal.end() == 130 and "ended early: interrupted twice, so all was ended at once" in terminal.text
    assert mark.gone() == [] and not sockets_and_memory(simulation)


@pytest.mark.long("ends a run by a terminal")
def test_a_terminal_that_is_closed_ends_all(mark, tmp_path):
    simulation = f"closed-{os.getpid()}"
    terminal = Terminal(write_pair(tmp_path, until=1e6, simulation=simulation, mass='env = { CHILD = "1" }'), mark)
    terminal.read("the mass is at")
    os.close(terminal.fd)
    os.waitpid(terminal.pid, 0)
    assert mark.gone() == [] and not sockets_and_memory(simulation)
