# SPDX-License-Identifier: Apache-2.0
"""Flight on a board at a serial line: a process of this machine at the other end of a cable of pseudo terminals."""
import contextlib
import os
import pty
import select
import shutil
import socket
import subprocess
import threading
import tty

import pytest

from fledge import cli, elf
from fledge.archive import Archive
from fledge.archive.compare import compare, digest
from fledge.errors import Failure
from fledge.targets import Job, serial
from tests.board_process import Process
from tests.waiting import wait_for


class Cable:
    """A serial device of this machine, `device`, and a board at its end, or none."""

    def __init__(self, board=None):
        self.end, theirs = pty.openpty()
        tty.setraw(theirs)
        self.device = os.ttyname(theirs)
        os.close(theirs)        # a device that another program holds would be refused
        self.ours, other = socket.socketpair()
        self.cut = False        # no byte passes
        self.carried = 0        # [bytes] of both ways
        self.damage = lambda byte: byte     # what becomes of a byte of the board
        self.process = subprocess.Popen([board, str(other.fileno())], pass_fds=[other.fileno()]) if board else None
        other.close()
        self.open = True
        self.thread = threading.Thread(target=self._carry)
        self.thread.start()

    def _carry(self):
        while self.open:
            ready = select.select([self.end, self.ours], [], [], 0.05)[0]
            with contextlib.suppress(OSError):      # nobody has the device open, or the board is being reset
                if self.ours in ready and (data := self.ours.recv(4096)) and not self.cut:
                    os.write(self.end, bytes(map(self.damage, data)))
                    self.carried += len(data)
            try:
                if self.end in ready and (data := os.read(self.end, 4096)) and not self.cut:
                    self.ours.sendall(data)
                    self.carried += len(data)
            except OSError:
                threading.Event().wait(0.01)

    def close(self):
        self.open = False
        self.thread.join()
        os.close(self.end)
        self.ours.close()
        if self.process:
            self.process.wait()


@pytest.fixture
def cables():
    """cables(board) makes one."""
    made = []
    yield lambda board=None: made.append(Cable(board)) or made[-1]
    for one in made:
        one.close()


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """The program of a board of nadir_spin."""
    return built("nadir_spin", tmp_path_factory.mktemp("board"))


def built(mission, folder, process=None):
    job = Job(mission, None, 1.0, folder=folder)
    return Process().build(job.part(process) if process else job.parts[0])


def fly(capfd, *words):
    """(exit code, what it said)."""
    code = cli.main(["fly", *map(str, words)])
    said = capfd.readouterr()
    return code, said.out + said.err


def test_a_board_at_a_line_flies_the_desktops_bits(board, cables, tmp_path, capfd):
    cable = cables(board)
    code, said = fly(capfd, "nadir_spin", "--on", f"serial:{cable.device}", "--elf", board, "--for", "20s", "--out",
                     tmp_path)
    name = serial.name_of(f"serial:{cable.device}")
    assert code == 0 and f"passed   desktop, {name}" in said, said
    with Archive(tmp_path / "desktop.mcap") as desktop, Archive(tmp_path / f"{name}.mcap") as flown:
        topics = [topic for topic in desktop.topics if topic in flown.topics]
        assert topics and not compare(desktop, flown, topics) and digest(desktop, topics) == digest(flown, topics)
    assert f"line     {name}: " in said and " bytes a step to the board" in said and "late " not in said
    assert cable.process.wait() == 0        # flight has ended with the run


def test_by_the_clock_each_step_is_in_the_histogram_of_lateness(board, cables, tmp_path, capfd):
    cable = cables(board)
    code, said = fly(capfd, "nadir_spin", "--on", f"serial:{cable.device}?baud=115200", "--for", "10s", "--pace", "20",
                     "--out", tmp_path)
    assert code == 0, said
    bins = [line.split() for line in said.splitlines() if line.split()[:1] in (["under"], ["over"])]
    assert sum(int(one[3]) for one in bins) == 21 and f"of 21 steps were answered" in said
