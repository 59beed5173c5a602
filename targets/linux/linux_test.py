# SPDX-License-Identifier: Apache-2.0
"""The program of the Linux target: its size, what it says of itself, and how it flies by the machine's clock. What all
targets have in common is in python/fledge/targets/fly_test.py."""

import os
import shutil
import signal
import subprocess

import pytest

from fledge.archive import Archive
from fledge.targets import TARGETS, Job
from tests.waiting import wait_for


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of one mission: built once."""
    return tmp_path_factory.mktemp("linux")


# --- size ------------------------------------------------------------------------------------------

def test_nadir_spin_is_small(folder):
    """Flight modules, generated code, commands and telemetry, runner and record: under 58 KiB of text, 61 where
    the compiler fortifies by default, as Ubuntu's does, and 16 KiB of memory, without the C library. The generated code
    is under 4.375 KiB, 4.5 there, its messages' definitions, for the record, aside."""
    macros = subprocess.run(["gcc", "-O2", "-dM", "-E", "-x", "c", "/dev/null"], capture_output=True, text=True,
                            check=True)
    most, most_written = (61, 4608) if "_FORTIFY_SOURCE" in macros.stdout else (58, 4480)
    job = Job("nadir_spin", duration=1.0, folder=folder / "nadir_spin")
    target = TARGETS["linux"]
    code, memory = target.sizes(target.build(job.parts[0]))
    assert 20 * 1024 < code < most * 1024 and 4 * 1024 < memory <= 17 * 1024
    objects = {path.stem.partition("_")[2]: path for path in (job.folder / "linux/o").glob("*.o")}
    written = 0
    for name in ("nadir_spin", "nadir_spin_board", "nadir_spin_io", "nadir_spin_host"):
        out = subprocess.run(["size", objects[name]], capture_output=True, text=True, check=True).stdout
        written += int(out.splitlines()[1].split()[0])
    assert 1024 < written < most_written


def test_only_what_changed_is_built(folder):
    job = Job("nadir_spin", duration=1.0, folder=folder / "nadir_spin")
    built = TARGETS["linux"].build(job.parts[0])
    before = built.stat().st_mtime_ns
    job = Job("nadir_spin", duration=2.0, folder=folder / "nadir_spin")
    assert TARGETS["linux"].build(job.parts[0]) == built and built.stat().st_mtime_ns == before


def test_it_takes_nothing_from_the_heap(folder):
    """None of its own code calls the allocator; the C library's that it calls in the loop do not either: clocks,
    futexes, locks and writes."""
    job = Job("nadir_spin", duration=1.0, folder=folder / "nadir_spin")
    TARGETS["linux"].build(job.parts[0])
    out = subprocess.run(["nm", "-u", job.folder / "linux/nadir_spin.o"], capture_output=True, text=True, check=True)
    wanted = {line.split()[-1] for line in out.stdout.splitlines()}
    assert "write" in wanted and not wanted & {"malloc", "calloc", "realloc", "free", "alloca", "strdup"}


# --- by the machine's clock ------------------------------------------------------------------------

def test_by_the_clock_it_says_how_late_it_was(folder):
    job = Job("nadir_spin", duration=1.0, folder=folder / "nadir_spin")
    built = TARGETS["linux"].build(job.parts[0])
    done = subprocess.run([built.resolve(), "--clock", "--for", "1.2", "--record", "clock.mcap"], cwd=job.folder,
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    figures = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
    assert figures["ticks"] == "3"
    late = [int(figures[f"late_ns_{n}"]) for n in ("least", "median", "p99", "most")]
    assert 0 <= late[0] and late == sorted(late) and int(figures["overruns"]) <= 3
    assert int(figures["faults"]) >= 0
    for name in ("late_ns", "cycle_cpu_ns", "cycle_wall_ns"):
        bins = [tuple(map(int, word.split(":"))) for word in figures[f"{name}_histogram"].split()]
        assert sum(n for _, n in bins) == 3 and bins == sorted(bins) and all(n > 0 for _, n in bins)
        assert bins[-1][0] >= int(figures[f"{name}_most"]) or bins[-1][0] >= 1 << 29
    assert figures["scheduling"].startswith(("SCHED_FIFO 50", "shared, not real-time: the system refused SCHED_FIFO ("))
    assert figures["memory"].startswith(("locked", "not locked: the system refused mlockall ("))
    with Archive(job.folder / "clock.mcap") as record:
        assert record.complete and record.time_ns("motor.command").tolist() == [0, 500_000_000, 1_000_000_000]


def test_without_the_privilege_it_says_so(folder):
    if os.geteuid() or not shutil.which("setpriv"):
        pytest.skip("needs root, to give up what it may")
    job = Job("nadir_spin", duration=1.0, folder=folder / "nadir_spin")
    built = TARGETS["linux"].build(job.parts[0])
    done = subprocess.run(["setpriv", "--bounding-set", "-all", "--inh-caps", "-all", "prlimit", "--memlock=0",
                           "--rtprio=0", built.resolve(), "--clock", "--for", "0.1"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "scheduling shared, not real-time: the system refused SCHED_FIFO (Operation not permitted)\n" in done.stdout
    assert "memory not locked: the system refused mlockall (" in done.stdout
    for name in ("late_ns", "cycle_cpu_ns", "cycle_wall_ns"):       # the report is the same
        assert f"\n{name}_histogram " in done.stdout


def test_stopped_by_the_clock_it_leaves_a_whole_record(folder):
    job = Job("nadir_spin", duration=1.0, folder=folder / "nadir_spin")
    built = TARGETS["linux"].build(job.parts[0])
    with subprocess.Popen([built.resolve(), "--clock", "--record", "stopped.mcap"], cwd=job.folder,
                          stdout=subprocess.PIPE, text=True) as process:
        try:
            part = job.folder / "stopped.mcap.part"
            wait_for(lambda: part.exists() and part.stat().st_size > 8000, process)
            process.send_signal(signal.SIGTERM)
            assert process.wait() == 0
        finally:
            process.kill()
    with Archive(job.folder / "stopped.mcap") as record:
        assert record.complete and len(record.time_ns("motor.command")) >= 1


@pytest.mark.parametrize("arguments, wrong", [
    ([], None), (["--clock", "--for", "-1"], "--for"), (["a", "b"], "b"), (["--record"], "--record"),
    (["--bogus", "1", "a"], "--bogus"), (["--clock", "--priority", "100"], "--priority")])
def test_it_says_how_it_is_called(folder, arguments, wrong):
    job = Job("nadir_spin", duration=1.0, folder=folder / "nadir_spin")
    built = TARGETS["linux"].build(job.parts[0])
    done = subprocess.run([built.resolve(), *arguments], capture_output=True, text=True)
    first, *others = done.stderr.splitlines()
    assert done.returncode == 2 and not done.stdout
    assert first.startswith("usage: ") if wrong is None else f": cannot use {wrong} here" in first
    assert wrong is None or others[0].startswith("usage: ")


def test_registers_that_are_not_there_or_of_another_board(folder, tmp_path):
    job = Job("nadir_spin", duration=1.0, folder=folder / "nadir_spin")
    built = TARGETS["linux"].build(job.parts[0]).resolve()
    done = subprocess.run([built, "--wait", "0.05", tmp_path / "none"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (1, f"nadir_spin: {tmp_path}/none: the file is not there yet\n")
    (tmp_path / "other").write_bytes(bytes(100))
    done = subprocess.run([built, "--record", tmp_path / "r.mcap", tmp_path / "other"], capture_output=True, text=True)
    assert done.returncode == 1 and "of other boards or of another version" in done.stderr
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith("r.")] == ["r.mcap.part"]
