# SPDX-License-Identifier: Apache-2.0
"""What the desktop's flight reads, played from a file: the same bits, with commands, and without the world."""
import struct
import subprocess

import pytest

from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.targets import TARGETS, Job, inputs

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
                          cwd=part.folder, capture_output=True, text=True, timeout=60)


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
    job = Job("two_body_pointing", folder=tmp_path)
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
