# SPDX-License-Identifier: Apache-2.0
"""Programs on a LEON3 board: its support, on two computers that know nothing of each other; and flights on it. What all
targets have in common is in fly_test.py, which flies these targets, too."""

import re
import signal
import subprocess

import pytest

from fledge import cli
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.targets import TARGETS, Job, build
from fledge.targets.fly_test import WHOLE, nothing_is_left, processes, started
from fledge.targets.leon3 import Leon3, board as boards
from tests.needs import flies_on, skip_unless_on
from tests.waiting import wait_for

pytestmark = flies_on("leon3")
QEMU = pytest.param("qemu", marks=flies_on("leon3-qemu"))


def ran(computer, program, *options):
    """A program on a computer until it ends."""
    command = {"qemu": ["qemu-system-sparc", "-M", "leon3_generic", "-m", "8M", "-nographic", "-kernel", program],
               "leon3": [build.native("fledge_leon3", "emulator/tools"), boards.BOARD, program, *options]}[computer]
    return subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)


@pytest.fixture(scope="module", params=[False, True])
def check(request, tmp_path_factory):
    """testing/check.c, and whether it ends with a fault."""
    folder = tmp_path_factory.mktemp("check")
    return boards.program(folder, "check", [boards.FOLDER / "testing/check.c"], [],
                          ["-Werror", *(["-DFAULT"] if request.param else [])]), request.param


@pytest.mark.parametrize("computer", ["leon3", QEMU])
def test_the_board_support_does_what_a_program_needs(check, computer):
    """Windows, interrupts, setjmp, contexts, numbers of 64 bits, the C library; and the report of a fault."""
    program, faulty = check
    done = ran(computer, program)
    first, _, rest = done.stdout.partition("\n")
    assert first == "checked", done.stdout + done.stderr
    if not faulty:
        assert rest == "" and done.returncode == 0
        return
    lines = rest.splitlines()
    place = subprocess.run(["sparc64-linux-gnu-nm", program], capture_output=True, text=True).stdout
    main = int(re.search(r"^(\w+) T main$", place, re.MULTILINE)[1], 16)
    pc = int(re.fullmatch(r"trap 0x00000007 at 0x(\w{8}): the program stops", lines[0])[1], 16)
    assert main <= pc < main + 0x2000
    assert [line.split()[0] for line in lines[-4:]] == ["g", "o", "l", "i"] and "40000002" in rest
    assert computer == "qemu" or done.returncode == 1


def test_a_program_resets_its_board_and_so_does_the_watchdog(tmp_path):
    """Initial data are fresh after each start; what is kept, is kept."""
    program = boards.program(tmp_path, "check", [boards.FOLDER / "testing/check.c"], [], ["-DRESET"])
    done = ran("leon3", program, "--figures")
    assert done.stdout.splitlines()[:4] == ["start 1", "start 2", "start 3", "checked"], done.stdout + done.stderr
    assert "resets 2\nwatchdog 2\n" in done.stdout and done.returncode == 0


@pytest.mark.long("builds and flies five images")
def test_a_reset_of_the_computer_in_flight(tmp_path, capsys):
    """By the power unit's watchdog; the record goes on, and all bits are the desktop's."""
    on = "leon3,leon3-cfs,leon3-micropython" + ("" if TARGETS["leon3-qemu"].missing() else ",leon3-qemu")
    assert cli.main(["fly", "flatsat", "silent", "--on", on, "--out", str(tmp_path)]) == 0, capsys.readouterr()
    rows = [line for line in capsys.readouterr().out.partition("  heap")[0].splitlines() if "  leon3" in line]
    assert len(rows) == len(on.split(",")) and all(" none " in row for row in rows)
    for name in ("leon3", "leon3-cfs", "leon3-micropython"):
        log = (tmp_path / f"{name}.log").read_text()
        assert "flight: resets 2\n" in log and "flight: watchdog 0\n" in log and "flight: recorded 589\n" in log


@pytest.mark.long("builds images of two boards")
@pytest.mark.parametrize("on", ["deputy=leon3,chief=leon3-cfs", "deputy=leon3-cfs,chief=leon3"])
def test_several_boards_fly_in_one_run(on, tmp_path, capsys):
    span = [] if WHOLE else ["--for", "30s"]
    assert cli.main(["fly", "formation", "sensed", *span, "--on", on, "--out", str(tmp_path)]) == 0, capsys.readouterr()
    rows = [line for line in capsys.readouterr().out.splitlines() if " on leon3" in line]
    assert len(rows) == 2 and all(" none " in row and "s, simulated" in row for row in rows)
    for process, target in (word.split("=") for word in on.split(",")):
        desktop, board = Archive(tmp_path / "desktop.mcap"), Archive(tmp_path / process / f"{target}.mcap")
        assert board.complete
        assert compare(desktop, board, [t for t in board.topics if t.startswith(f"/{process}/")]) == []


@pytest.mark.long("builds and flies an image")
def test_a_flight_prints_what_it_needed(tmp_path, capsys):
    """The figures at its end are those of the program, and of the processor: flight needs little of an 80 MHz LEON3."""
    assert cli.main(["fly", "nadir_spin", "--for", "10s", "--on", "leon3,leon3-cfs", "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    for name in ("leon3", "leon3-cfs"):
        figures = dict(re.findall(r"flight: (\w+) (\d+)", (tmp_path / f"{name}.log").read_text()))
        assert figures["ticks"] == figures["recorded"] == "21"
        assert figures["missed"] == figures["refused"] == figures["resets"] == "0"
        assert 0 < int(figures["cpu_ns"]) < 10_000_000
        assert int(figures["program_bytes"]) < int(figures["ram_bytes"]) < 1_000_000
        assert 500 < int(figures["stack_bytes"]) < 20_000 and 1000 < int(figures["data_bytes"]) < 1_000_000
    assert 1000 < int(figures["task_stack_bytes"]) < 20_000 and figures["events_errors"] == "0"


@pytest.mark.long("compiles for several boards")
def test_no_compiler_warns(tmp_path, monkeypatch):
    monkeypatch.setattr(build, "FLAGS", [*build.FLAGS, "-Werror"])
    job = Job("nadir_spin", folder=tmp_path, duration=10.0)
    for name in ("leon3-qemu", "leon3-cfs"):
        TARGETS[name].build(job.parts[0])


@pytest.mark.long("links several programs")
def test_a_board_without_the_room_is_reported(tmp_path, monkeypatch, capsys):
    board = tmp_path / "board.toml"
    text = boards.BOARD.read_text()
    assert "size  = 0x800000" in text
    board.write_text(text.replace("size  = 0x800000", "size  = 0x110000"))
    monkeypatch.setattr(TARGETS["leon3"], "board", board)
    assert cli.main(["fly", "nadir_spin", "--for", "10s", "--on", "leon3", "--out", str(tmp_path)]) == 1
    assert "the program does not fit into the RAM of the board" in capsys.readouterr().err


@pytest.mark.long("builds an image")
def test_a_flight_is_refused_by_a_board_without_registers(tmp_path):
    job = Job("nadir_spin", folder=tmp_path, duration=10.0)
    target = Leon3(["--figures"])   # so that no node needs to give it a socket for snapshots
    target.board = build.ROOT / "emulator/boards/leon3_generic.toml"
    command = target.command(target.build(job.parts[0]), "record.mcap")
    job.parts[0].tables()
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 1
    assert "--record needs a device of the kind `grspw2`, or a second one of `apbuart`" in done.stderr
    assert not (tmp_path / "record.mcap").exists()


@pytest.mark.long("builds an image")
def test_a_uart_sends_the_record_of_a_board_without_spacewire(tmp_path, monkeypatch, capsys):
    """Byte by byte, and the same bytes as packets."""
    sent = []
    text = boards.BOARD.read_text()
    for content in (text, text.replace('"grspw2"', '"report"')):
        (tmp_path / "board.toml").write_text(content)
        monkeypatch.setattr(TARGETS["leon3"], "board", tmp_path / "board.toml")
        assert cli.main(["fly", "nadir_spin", "--for", "10s", "--on", "leon3", "--out", str(tmp_path)]) == 0
        instructions = int(re.search(r"flight: instructions (\d+)", (tmp_path / "leon3.log").read_text())[1])
        sent.append((instructions, (tmp_path / "leon3.mcap").read_bytes()))
    capsys.readouterr()
    (by_link, packets), (by_uart, record) = sent
    assert packets == record and by_link < by_uart


@pytest.mark.long("builds images")
@pytest.mark.parametrize("name, program", [("leon3", b"fledge_leon3"), ("leon3-qemu", b"qemu-system-sparc")])
def test_an_interrupt_ends_the_computer_too(name, program, tmp_path):
    skip_unless_on(name)
    process = started(tmp_path, "--on", name)
    try:
        part = tmp_path / f"{name}.mcap.part"
        wait_for(lambda: part.exists() and part.stat().st_size > 100_000, process)
        assert [words for _, words in processes(tmp_path) if words[0].endswith(program)]
        process.send_signal(signal.SIGINT)
        process.communicate()
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130
    assert nothing_is_left(tmp_path) and not (tmp_path / f"{name}.mcap").exists()
