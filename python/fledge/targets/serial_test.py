# SPDX-License-Identifier: Apache-2.0
"""Flight on a board at a serial line: a process of this machine at the other end of a cable of pseudo terminals."""
import contextlib
import os
import pty
import re
import select
import shutil
import signal
import socket
import subprocess
import threading
import tty

import pytest

from fledge import cli, elf
from fledge.archive import Archive
from fledge.archive.compare import compare, digest
from fledge.serial_line import name_of
from fledge.targets import TARGETS, Job
from tests.board_process import Process
from tests.needs import flies_on
from tests.waiting import wait_for


class Cable:
    """A serial device of this machine, `device`, and a board at its end, or none: a function gives its command with a
    descriptor, the other end of the cable."""

    def __init__(self, board=None):
        self.end, theirs = pty.openpty()
        tty.setraw(theirs)
        self.device = os.ttyname(theirs)
        os.close(theirs)        # a device that another program holds would be refused
        self.ours, other = socket.socketpair()
        self.cut = False        # no byte passes
        self.carried = 0        # [bytes] of both ways
        self.damage = lambda byte: byte     # what becomes of a byte of the board
        self.process = subprocess.Popen(board(other.fileno()), pass_fds=[other.fileno()]) if board else None
        other.close()
        self.open = True
        self.thread = threading.Thread(target=self._carry)
        self.thread.start()

    def _carry(self):
        while self.open:
            ready = select.select([self.end, self.ours], [], [], 0.05)[0]
            with contextlib.suppress(OSError):      # no program has the device open, or the board is being reset
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
            self.process.terminate()
            self.process.wait()


@pytest.fixture
def cables():
    """cables(program) makes one, to a program of Process, or by a function as Cable has it."""
    devices = []

    def make(board=None):
        devices.append(Cable((lambda fd: [board, str(fd)]) if isinstance(board, os.PathLike) else board))
        return devices[-1]

    yield make
    for device in devices:
        device.close()


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """The program of a board of nadir_spin."""
    return built("nadir_spin", tmp_path_factory.mktemp("board"))


def built(mission, folder, process=None):
    job = Job(mission, None, 1.0, folder=folder)
    return Process().build(job.part(process) if process else job.parts[0])


def fly(capfd, *words):
    """(exit code, output)."""
    code = cli.main(["fly", *map(str, words)])
    captured = capfd.readouterr()
    return code, captured.out + captured.err


def test_a_board_at_a_line_flies_the_desktops_bits(board, cables, tmp_path, capfd):
    cable = cables(board)
    code, output = fly(capfd, "nadir_spin", "--on", f"serial:{cable.device}", "--elf", board, "--for", "20s", "--out",
                       tmp_path)
    name = name_of(f"serial:{cable.device}")
    assert code == 0 and f"passed   desktop, {name}" in output, output
    with Archive(tmp_path / "desktop.mcap") as desktop, Archive(tmp_path / f"{name}.mcap") as flown:
        topics = [topic for topic in desktop.topics if topic in flown.topics]
        assert topics and not compare(desktop, flown, topics) and digest(desktop, topics) == digest(flown, topics)
    assert f"line     {name}: " in output and " bytes a step to the board" in output and "late " not in output
    assert cable.process.wait() == 0        # flight has ended with the run


@flies_on("cortex-m7")
def test_the_program_of_a_bare_board_flies_at_a_line(cables, tmp_path, capfd):
    """As on a desk: what QEMU runs is at a serial device, and nothing but its program and its line is known."""
    target = TARGETS["cortex-m7"]
    program = target.build(Job("nadir_spin", None, 1.0, folder=tmp_path / "board").parts[0])

    def emulator(fd):
        words = [word.format(program=program, line="chardev:line") for word in target.emulator]
        return [words[0], "-chardev", f"socket,id=line,fd={fd}", *words[1:]]

    cable = cables(emulator)
    code, output = fly(capfd, "nadir_spin", "--on", f"serial:{cable.device}", "--elf", program, "--for", "5s", "--out",
                       tmp_path / "fly")
    assert code == 0 and f"build {elf.read(program).build_id}" in output, output


def test_by_the_clock_each_step_is_in_the_histogram_of_lateness(board, cables, tmp_path, capfd):
    cable = cables(board)
    line = f"serial:{cable.device}?baud=115200"
    code, output = fly(capfd, "nadir_spin", "--on", line, "--for", "10s", "--pace", "20",
                       "--out", tmp_path)
    assert code == 0, output
    bins = [line.split() for line in output.splitlines() if line.split()[:1] in (["under"], ["over"])]
    assert [bin[:3] for bin in bins[:2]] == [["under", "1", "ms"], ["under", "2", "ms"]]
    assert sum(int(bin[3]) for bin in bins) == 21 and "of 21 steps were answered when the next was due" in output
    assert (tmp_path / f"{name_of('serial:' + cable.device)}_late.png").stat().st_size > 0


# --- what is wrong is one line with its remedy -------------------------------------------------------

def refused(capfd, tmp_path, *words):
    """Why a board did not fly: the line about it."""
    code, output = fly(capfd, "nadir_spin", *words, "--for", "2s", "--out", tmp_path)
    lines = [line for line in output.splitlines() if re.match(r"  serial-\S*: |fledge: ", line)]
    assert code in (1, 2) and len(lines) == 1, output
    return lines[0]


def test_an_elf_that_is_not_the_boards_program_is_refused_before_the_line_is_opened(board, cables, tmp_path, capfd):
    on = ("--on", f"serial:{cables().device}", "--elf")
    (tmp_path / "a.bin").write_bytes(b":020000040800F2")
    assert "a.bin is no ELF file; name the program" in refused(capfd, tmp_path, *on, tmp_path / "a.bin")
    assert "no such file or directory" in refused(capfd, tmp_path, *on, tmp_path / "none.elf")
    shutil.copy(f"{board}.o", tmp_path / "board.o")
    assert "board.o is no linked program" in refused(capfd, tmp_path, *on, tmp_path / "board.o")
    other = board.read_bytes().replace(b"nadir_spin\0", b"radir_spin\0")
    (tmp_path / "other.elf").write_bytes(other)
    assert "is the program of another mission: it has no nadir_spin" in refused(capfd, tmp_path, *on,
                                                                                tmp_path / "other.elf")
    stripped = board.read_bytes().replace(b"GNU\0" + bytes.fromhex(elf.read(board).build_id), b"NOT\0" + bytes(20))
    (tmp_path / "stripped.elf").write_bytes(stripped)
    assert "has no build id" in refused(capfd, tmp_path, *on, tmp_path / "stripped.elf")


def test_a_board_with_another_program_than_the_elf_is_refused(board, cables, tmp_path, capfd):
    own = bytes.fromhex(elf.read(board).build_id)
    (tmp_path / "newer.elf").write_bytes(board.read_bytes().replace(own, own[::-1]))
    error = refused(capfd, tmp_path, "--on", f"serial:{cables(board).device}", "--elf", tmp_path / "newer.elf")
    assert f"its build is {own.hex()}, not {own[::-1].hex()}; load it again" in error


def test_a_board_with_another_mission_is_refused(cables, tmp_path, capfd):
    cable = cables(built("sun_safe", tmp_path / "board"))
    assert "flies sun_safe, not nadir_spin" in refused(capfd, tmp_path, "--on", f"serial:{cable.device}")


@pytest.mark.parametrize("words, reason", [
    (["--on", "serial:ttyACM0"], "serial:ttyACM0: expected serial:DEVICE, as in serial:/dev/ttyACM0?baud=921600"),
    (["--on", "serial:///dev/none?reset=goon"], "reset is end or go-on; found 'goon'"),
    (["--on", "serial:/dev/none?cuts=3"], "has no 'cuts'; did you mean 'cut'?"),
    (["--on", "serial:/dev/none?baud=9e9"], "baud is bits per second, from 300 to 20000000; found '9e9'"),
    (["--on", "serial:/dev/none", "--baud", "12"], "baud is bits per second"),
    (["--on", "serial:/dev/none,flight=serial:/dev/none"], "--on names /dev/none twice"),
    (["--on", "serial:/dev/none", "--elf", "a", "--elf", "b"], "--elf names 2 programs; give one, or PROCESS=FILE"),
    (["--on", "serial:/dev/none", "--elf", "fligt=a"], "has no flight process 'fligt'"),
    (["--on", "linux", "--pace", "1"], "--pace is for a board at a serial line"),
    (["--on", "linux", "--elf", "a.elf"], "--elf is for a board at a serial line"),
    (["--on", "serial:/dev/none"], "there is no device /dev/none: is the board connected"),
])
def test_wrong_words_are_refused(words, reason, tmp_path, capfd):
    assert reason in refused(capfd, tmp_path, *words)


def test_a_device_that_another_program_holds_is_named_with_the_program(board, cables, tmp_path, capfd):
    cable = cables(board)
    with open(cable.device, "rb", buffering=0):
        error = refused(capfd, tmp_path, "--on", f"serial:{cable.device}")
    assert f"{cable.device} is held by " in error and f"(process {os.getpid()}): end that program first" in error


def test_a_board_that_is_reset_ends_the_run_and_is_named(board, cables, tmp_path, capfd):
    cable = cables(board)

    def reset():
        wait_for(lambda: cable.carried > 20_000 or not cable.open)
        cable.process.send_signal(signal.SIGUSR1)

    thread = threading.Thread(target=reset)
    thread.start()
    code, output = fly(capfd, "nadir_spin", "--on", f"serial:{cable.device}?reset=end", "--out", tmp_path)
    thread.join()
    assert code == 1 and re.search(r"^  serial-\S*: /dev/\S*: the board was reset in the tick at .* s, which ends the "
                                   r"run \(reset=end\)", output, re.MULTILINE), output


def test_two_boards_fly_two_processes_of_one_run(cables, tmp_path, capfd):
    programs = {process: built("formation", tmp_path / process, process) for process in ("chief", "deputy")}
    lines = {program: cables(programs[program]) for program in programs}
    on = ",".join(f"{line}=serial:{lines[line].device}" for line in lines)
    elves = [word for program in programs for word in ("--elf", f"{program}={programs[program]}")]
    code, output = fly(capfd, "formation", "--on", on, *elves, "--for", "5s", "--out", tmp_path / "fly")
    assert code == 0 and all(f"line     {line} on serial-" in output for line in lines), output
    # The program of the other process is another one.
    for line in lines:
        lines[line] = cables(programs[line])
    on = ",".join(f"{line}=serial:{lines[line].device}" for line in lines)
    swapped = ["--elf", f"chief={programs['deputy']}", "--elf", f"deputy={programs['chief']}"]
    code, output = fly(capfd, "formation", "--on", on, *swapped, "--for", "5s", "--out", tmp_path / "fly")
    assert code == 1 and "the board's program of formation is not the given one: its build is " in output, output


# --- several programs ------------------------------------------------------------------------------

def up_file(tmp_path, target, more=""):
    (tmp_path / "desk.toml").write_text(f"""\
until = 10
[[node]]
name = "world"
mission = "nadir_spin"
process = "world"
[[node]]
name = "flight"
mission = "nadir_spin"
target = "{target}"
{more}
""")
    return tmp_path / "desk.toml"


def test_a_node_of_a_run_is_a_board_at_a_line(board, cables, tmp_path, capfd):
    """The form of the address with an authority, which is empty, is the same."""
    cable = cables(board)
    file = up_file(tmp_path, f"serial://{cable.device}?baud=921600&reset=go-on&cut=60", f'elf = "{board}"')
    code = cli.main(["up", str(file), "--pace", "10", "--out", str(tmp_path / "run")])
    captured = capfd.readouterr()
    assert code == 0, captured
    log = (tmp_path / "run/log/flight.log").read_text()
    assert " bytes a step to the board" in log and "of 21 steps were answered when the next was due" in log, log
    with Archive(tmp_path / f"run/flight/{name_of('serial:' + cable.device)}.mcap") as flown:
        assert any(topic.startswith("/flight/") for topic in flown.topics)


@pytest.mark.parametrize("resets", [0, 1])
def test_a_run_goes_on_after_a_cut_as_its_file_says(board, cables, tmp_path, capfd, resets):
    cable = cables(board)
    file = up_file(tmp_path, f"serial:{cable.device}?reset=go-on&cut=60").rename(tmp_path / "on.toml")
    file.write_text(file.read_text().replace("until = 10", "until = 400"))
    log = tmp_path / "run/log/flight.log"

    def reported(text):
        return log.exists() and text in log.read_text()

    def hurt():
        wait_for(lambda: cable.carried > 50_000)
        cable.cut = True
        wait_for(lambda: reported("has been silent for 1 s in the tick at "))
        cable.cut = False
        wait_for(lambda: reported("is heard again"))
        if resets:
            cable.process.send_signal(signal.SIGUSR1)

    thread = threading.Thread(target=hurt)
    thread.start()
    code = cli.main(["up", str(file), "--out", str(tmp_path / "run")])
    thread.join()
    output = log.read_text()
    # The reset hits flight or its record, whose loss is reported.
    whole = not resets or "the record failed: the board was reset while it was sent" not in output
    assert code == (0 if whole else 1) and reported("begins flight there") == bool(resets), output
    assert not whole or re.search(rf"[1-9]\d* cuts, {resets} resets", output), output


@pytest.mark.parametrize("target, more, complaints", [
    ("serial:///dev/none?baud=921600", "", ["desk.toml:9: the board is connected; there is no device /dev/none"]),
    ("serial:/dev/null?bauds=9", "", ["desk.toml:9: a serial line is serial:DEVICE?baud=N", "did you mean 'baud'?"]),
    ("serial:/dev/null", 'elf = "none.elf"', ["desk.toml:10: `elf` is the program that the board has", "none.elf"]),
    ("linux", 'elf = "none.elf"', ["desk.toml:10: `elf` is of a target at a serial line; flight has \"linux\""]),
])
def test_a_wrong_line_in_the_file_of_a_run_is_refused_by_its_line(target, more, complaints, tmp_path, capfd):
    assert cli.main(["up", str(up_file(tmp_path, target, more)), "--check"]) == 2
    error = capfd.readouterr().err
    assert all(complaint in error for complaint in complaints), error


def test_a_board_flies_one_process(tmp_path, capfd):
    file = up_file(tmp_path, "serial:/dev/null", """\
[[node]]
name = "other"
mission = "nadir_spin"
process = "flight"
prefix = "b"
target = "serial:///dev/null"
""")
    assert cli.main(["up", str(file), "--check"]) == 2
    assert "desk.toml:15: a board flies one process; flight flies on /dev/null, too" in capfd.readouterr().err
