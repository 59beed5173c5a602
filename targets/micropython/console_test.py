# SPDX-License-Identifier: Apache-2.0
"""The prompt of `fledge console`: lines go to flight as commands, and its answers come back."""
import os
import pty
import subprocess
import sys

import pytest

from fledge.targets.micropython.procedure_test import MISSION, WORLD

PROCEDURE = """
def main(f):
    print("begun")
    while f.control.K < 5:
        yield
    print("seen")
"""


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """Its words, for a mission with 20 instants in a second."""
    folder = tmp_path_factory.mktemp("console")
    (folder / "flight.py").write_text(MISSION.replace("every=1 * s", "every=0.05 * s"))
    (folder / "world.py").write_text(WORLD)
    (folder / "check.py").write_text(PROCEDURE)
    return [sys.executable, "-m", "fledge.cli", "console", folder, "--out", folder / "out"]


@pytest.mark.long("flies by the wall clock")
def test_lines_of_a_pipe_are_answered(command):
    lines = ["f.control.K", "f.control.K = 3 * N * m", "f.control.K, f.active_mode", "f.enter('science')",
             "for i in range(2):", "    print(i * f.control.K)", "", "1 / 0", "f.control.K = -1", "f.active_mode",
             f":run {command[4]}/check.py", f":run {command[4]}/check.py", ":run none.py", ":what",
             "f.control.K = 6", "1", "1", ":stop"]
    done = subprocess.run([*command, "--turns", "1000"], input="\n".join(lines), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    output = done.stdout.splitlines()
    assert output[:4] == ["2.5", "(3.0, 'rest')", "0.0", "3.0"]
    assert output[4] == "text, line 1: ZeroDivisionError: divide by zero"
    assert output[5].startswith("text, line 1: SetupError: flight.control.K must be ")
    assert output[6] == "'science'"
    assert output[7].endswith(" s: procedure started")
    rest = [line.partition(" s: ")[2] or line for line in output[8:-1]]      # without the time
    assert sorted(rest) == sorted(["begun", "refused: running", "seen", "procedure ended", "1", "1",
                                   "[Errno 2] No such file or directory: 'none.py'",
                                   "there is no :what; :help shows what there is"])
    assert output[-1] == "refused: running"          # it has ended


def test_a_terminal_is_read_until_ctrl_d(command):
    ours, theirs = pty.openpty()
    process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs)
    os.close(theirs)
    output = ""

    def until(text):
        nonlocal output
        while text not in output:
            output += os.read(ours, 1000).decode()
        output = output.partition(text)[2]

    until("Ctrl-D ends")
    until(">>> ")
    os.write(ours, b"f.control.P[0][0]\n")
    until("45.0")
    until(">>> ")
    os.write(ours, b"\x04")
    assert process.wait() == 0
    os.close(ours)
