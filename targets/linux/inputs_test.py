# SPDX-License-Identifier: Apache-2.0
"""What the desktop's flight reads, played from a file: the same bits, with commands, and without the world."""
import json
import re
import shutil
import struct
import subprocess

import pytest

from fledge import cli
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.targets import TARGETS, Job, build
from fledge.targets.linux import clock, inputs
from fledge.targets.table import cpu
from tests.needs import skip_unless_on

FREE = {"duration": 30.0, "free": True}


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return Job("nadir_spin", folder=tmp_path_factory.mktemp("inputs"), **FREE)


@pytest.fixture(scope="module")
def captured(job):
    part = job.parts[0]
    record = TARGETS["desktop"].fly(job)[part.process].record
    return part, record, inputs.capture(part, record)


def play(part, file, *words):
    built = TARGETS["linux"].build(part)
    return subprocess.run([built.resolve(), "--inputs", file, "--record", "played.mcap", *words],
                          cwd=part.folder, capture_output=True, text=True)


@pytest.mark.parametrize("clock", [False, True])
def test_it_puts_out_the_bits_of_the_closed_loop(captured, tmp_path, clock):
    part, record, instants = captured
    assert [t for t, _ in instants] == [500_000_000 * i for i in range(61)]
    file = inputs.write(tmp_path / "inputs", instants, [0, 10, 60])
    done = play(part, file, *(("--clock", "--for", "1") if clock else ()))
    assert done.returncode == 0 and f"ticks {3 if clock else 61}\n" in done.stdout, done.stderr
    with Archive(record) as ours, Archive(part.folder / "played.mcap") as its:
        ends = 1_000_000_000 if clock else 30_000_000_000
        assert not compare(ours, its, part.outputs, times=lambda t: t <= ends)
        assert its.time_ns("motor.command")[-1] == ends


def test_other_inputs_give_other_outputs(captured, tmp_path):
    part, record, instants = captured
    first = [(t, [(what, bytes(len(content))) for what, content in rows]) for t, rows in instants]
    assert play(part, inputs.write(tmp_path / "inputs", first)).returncode == 0
    with Archive(record) as ours, Archive(part.folder / "played.mcap") as its:
        assert compare(ours, its, part.outputs)


def test_commands_play_at_their_instants(tmp_path):
    mission = tmp_path / "stiffer"
    shutil.copytree(build.ROOT / "missions/nadir_spin", mission)
    (mission / "scenarios.py").write_text("def stiffer(sim):\n    sim.run(5)\n    sim.flight.control.K = 5.0\n"
                                          "    sim.run(5)\n")
    job = Job(str(mission), folder=tmp_path)
    part = job.parts[0]
    record = TARGETS["desktop"].fly(job)[part.process].record
    instants = inputs.capture(part, record)
    sent = [t for t, rows in instants for what, _ in rows if what == inputs.COMMAND]
    assert len(sent) == len(part.script) > 0
    assert play(part, inputs.write(tmp_path / "inputs", instants)).returncode == 0
    with Archive(record) as ours, Archive(tmp_path / "played.mcap") as its:
        assert not compare(ours, its, part.outputs, times=part.is_instant)


@pytest.mark.parametrize("content, wrong", [
    (b"", "it holds no inputs of flight"),
    (b"something", "it holds no inputs of flight, or those of a machine of another byte order"),
    (inputs.MAGIC + bytes(8), "the file ends within a record"),
    (inputs.MAGIC + struct.pack("=qII", 0, 0, 1 << 20), "the file ends within a record"),
    (inputs.MAGIC + struct.pack("=qII", 0, 0, 0), "it is of another mission"),
    (inputs.MAGIC + struct.pack("=qII", 0, 77777, 0), "it is of another mission"),
    (inputs.MAGIC + struct.pack("=qII", 0, inputs.MARK, 0), "the last instant is not whole"),
    (inputs.MAGIC + 2 * struct.pack("=qII", 0, inputs.INSTANT, 0), "the times do not rise"),
    (inputs.MAGIC + struct.pack("=qII", 0, inputs.MARK, 0) + struct.pack("=qII", 1, inputs.INSTANT, 0),
     "the times do not rise")])
def test_a_damaged_file_is_refused(job, tmp_path, content, wrong):
    file = tmp_path / "inputs"
    file.write_bytes(content)
    done = play(job.parts[0], file)
    assert (done.returncode, done.stderr) == (1, f"nadir_spin: {file}: {wrong}\n")


def test_a_file_that_is_not_there(job, tmp_path):
    done = play(job.parts[0], tmp_path / "none")
    assert (done.returncode, done.stderr) == (1, f"nadir_spin: {tmp_path / 'none'}: No such file or directory\n")


# --- by the machine's clock ------------------------------------------------------------------------

@pytest.mark.long("flies by the wall clock")
@pytest.mark.parametrize("target", ["linux", "micropython"])
def test_a_flight_by_the_clock_is_reported(tmp_path, capsys, target):
    skip_unless_on(target)
    out = str(tmp_path / "out")
    assert cli.main(["fly", "nadir_spin", "--on", target, "--clock", "--for", "1s", "--out", out]) == 0
    output = capsys.readouterr().out
    assert re.search(r"^  scheduling  (SCHED_FIFO 50|shared, not real-time: the system refused SCHED_FIFO)",
                     output, re.M)
    assert re.search(r"^  memory      (not )?locked.*; page faults in the loop: \d+$", output, re.M)
    assert "  cycles      3, of which " in output and "  outputs     as on the desktop\n" in output
    facts = json.loads((tmp_path / f"out/{target}_clock.json").read_text())
    for key, name in clock.DURATIONS.items():
        assert sum(n for _, n in facts["histograms"][key]) == 3
        assert re.search(f"^  {name} +{cpu(facts['quantiles'][key]['least'] / 1e9)} ", output, re.M)
    assert (tmp_path / f"out/{target}_clock.png").stat().st_size > 10_000


def test_bins_of_a_histogram_have_their_width():
    # As TEST(Pace, ...): eight bins in each power of two, one nanosecond wide below 8 ns.
    assert [clock._width(end) for end in (0, 7, 8, 15, 17, 31, 1023, 1151)] == [1, 1, 1, 1, 2, 2, 64, 128]


@pytest.mark.parametrize("arguments, wrong", [
    (["--on", "linux"], "--clock: give a duration with --for; each second takes one"),
    (["--on", "sparc64", "--for", "1s"], "--clock: sparc64 does not run by the clock of this machine"),
    (["--on", "desktop", "--for", "1s"], "--clock: name one target of one flight process with --on; found 0"),
    (["--on", "linux,sparc64", "--for", "1s"], "--clock: name one target of one flight process with --on; found 2")])
def test_only_one_process_flies_by_the_clock(tmp_path, capsys, arguments, wrong):
    if "sparc64" in arguments[1]:
        skip_unless_on("sparc64")
    assert cli.main(["fly", "nadir_spin", "--clock", "--out", str(tmp_path), *arguments]) == 2
    assert wrong in capsys.readouterr().err
