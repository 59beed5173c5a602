# SPDX-License-Identifier: Apache-2.0
"""Programs under guards leave nothing, whichever process a signal kills."""
import os
import signal
import subprocess
import sys

import pytest

from fledge.cosim.up.processes import Process, descendants, end_strays, in_words
from fledge.cosim.up.testing import GUARD, Mark
from tests.waiting import wait_for

pytestmark = pytest.mark.skipif(not os.path.exists(GUARD), reason="the guard is not built")

# A program with a child, and one that has left it for a session of its own and hears of nothing.
FAMILY = ["sh", "-c", "trap '' TERM; setsid sh -c \"trap '' TERM HUP; sleep 600\" & sleep 600 & "
                      "( setsid sleep 600 & ); echo there; wait"]


@pytest.fixture
def mark():
    marker = Mark()
    yield marker
    left = marker.gone(0)
    marker.kill()
    assert not left


def start(command, mark, **options):
    return Process(command, GUARD, subprocess.PIPE, env=mark.env, **options)


def wait(process):
    wait_for(process.poll)
    return process.code


def there(process):
    assert process._process.stdout.readline() == b"there\n"
    return process


def all_there(mark):
    """Wait for the whole family: its three sleeps, in three sessions."""
    def there():
        commands = [command for _, command in mark.processes()]
        return commands.count("sleep 600") >= 3 and not any(command.startswith("setsid ") for command in commands)

    wait_for(there)


def family(mark):
    process = there(start(FAMILY, mark))
    all_there(mark)
    return process


@pytest.mark.parametrize("command, code, words", [
    ("exit 0", 0, "ended with exit code 0"), ("exit 3", 3, "ended with exit code 3"),
    ("kill -9 $$", 137, "was killed by SIGKILL"), ("kill -10 $$", 138, "was killed by SIGUSR1")])
def test_it_ends_as_its_command_does(mark, command, code, words):
    assert wait(start(["sh", "-c", command], mark)) == code
    assert in_words(code) == words


def test_a_command_that_is_not_there(mark):
    process = start(["/no/such/program"], mark)
    assert wait(process) == 127
    assert process._process.stdout.read() == b"fledge_guard: cannot start /no/such/program: No such file or directory\n"


def test_standard_input_is_empty_and_signals_are_as_usual(mark):
    process = start(["sh", "-c", "cat; kill -TERM $$; sleep 600"], mark)
    assert wait(process) == 128 + signal.SIGTERM


def test_all_descendants_end_with_it(mark):
    process = family(mark)
    assert len(mark.processes()) >= 5
    process.end()
    wait(process)
    assert mark.gone(0) == []


@pytest.mark.long("waits 5 s")
def test_what_a_program_leaves_behind_ends_too(mark):
    wait(start(["sh", "-c", "(setsid sleep 600 &); setsid sh -c \"trap '' TERM; sleep 600\" & exit 0"], mark))
    assert mark.gone(0) == []


def test_one_that_is_stopped_ends(mark):
    process = start(["sh", "-c", "echo there; kill -STOP $$; sleep 600"], mark)
    there(process).end()
    wait(process)
    assert mark.gone(0) == []


def test_a_program_that_is_to_end_may_end_in_its_own_way(mark):
    process = there(start(["sh", "-c", "trap 'exit 5' TERM; echo there; while :; do sleep 0.01; done"], mark))
    process.end()
    assert wait(process) == 5


@pytest.mark.long("waits 5 s each time")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_to_the_guard_ends_all(mark, number):
    process = family(mark)
    os.kill(process.pid, number)
    wait(process)
    assert mark.gone(0) == []


# As `fledge up` does: it adopts what has lost its guard.
OWNER = """
import sys, time
from fledge.cosim.up.processes import Process, adopt_strays, end_strays
adopt_strays()
process = Process(sys.argv[2:], sys.argv[1], None)
print(process.pid, flush=True)
while not process.poll():
    time.sleep(0.01)
while end_strays(set()):
    time.sleep(0.01)
print("no strays", flush=True)
"""


@pytest.fixture
def owner(mark):
    process = subprocess.Popen([sys.executable, "-c", OWNER, GUARD, *FAMILY], env=mark.env, stdout=subprocess.PIPE,
                               text=True)
    # The owner writes the process id of the guard and the family writes "there", in either order.
    there, pid = sorted((process.stdout.readline() for _ in range(2)), reverse=True)
    assert there == "there\n"
    process.guard = int(pid)
    all_there(mark)
    yield process
    process.kill()
    process.communicate()


def test_nothing_is_left_of_a_killed_guard(mark, owner):
    os.kill(owner.guard, signal.SIGKILL)
    assert owner.stdout.read() == "no strays\n"
    assert mark.gone() == []


@pytest.mark.long("waits 5 s")
def test_nothing_is_left_when_the_starter_is_killed(mark, owner):
    owner.kill()
    assert mark.gone() == []


@pytest.mark.long("waits 5 s")
def test_descendants_are_found_parents_first(mark):
    process = family(mark)
    found = descendants(os.getpid())
    marked = [pid for pid, _ in mark.processes()]
    assert set(marked) <= set(found)
    assert found.index(process.pid) < min(found.index(pid) for pid in marked if pid != process.pid)
    process.end()
    wait(process)


@pytest.mark.long("waits 5 s")
def test_what_was_started_here_is_no_stray(mark):
    process = family(mark)
    others = set(descendants(os.getpid())) - {pid for pid, _ in mark.processes()}
    assert end_strays(others | {process.pid}) == 0
    assert process.poll() is False
    process.end()
    wait(process)


def test_a_shell_elsewhere_reads_folder_variables_and_command(mark, tmp_path):
    place = tmp_path / "a folder"
    place.mkdir()
    process = Process(["sh", "-c", 'pwd; echo "$LEVEL" "$1"', "name", "two words $x"], GUARD, subprocess.PIPE,
                      launcher=["sh", "-c"], env=mark.env, remote=(str(place), {"LEVEL": "it's \"2\""}))
    assert wait(process) == 0
    assert process._process.stdout.read().decode() == f"{place}\nit's \"2\" two words $x\n"


def test_a_home_folder_is_filled_in_there(mark, tmp_path):
    mark.env["HOME"] = str(tmp_path)
    (tmp_path / "a b").mkdir()
    process = Process(["pwd"], GUARD, subprocess.PIPE, launcher=["sh", "-c"], env=mark.env, remote=("~/a b", {"A": ""}))
    assert wait(process) == 0
    assert process._process.stdout.read().decode() == f"{tmp_path}/a b\n"
