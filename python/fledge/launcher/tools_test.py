# SPDX-License-Identifier: Apache-2.0
import os
import signal

import pytest

from fledge.launcher import tools


def test_a_disk_that_is_full_is_seen_without_a_log(tmp_path, monkeypatch):
    log = tmp_path / "build.log"
    log.touch()
    assert "the disk is full" not in str(tools.failure(log, "the build", 1))
    disk = os.statvfs(tmp_path)
    fields = list(disk)
    fields[4] = 1000        # f_bavail: free blocks
    monkeypatch.setattr(os, "statvfs", lambda _: os.statvfs_result([4096, 4096, *fields[2:]]))
    assert str(tools.failure(log, "the build", 1)).startswith("the build failed: the disk is full: free some space")


def test_the_last_line_of_a_log_is_its_progress(tmp_path):
    log = tmp_path / "a.log"
    log.write_bytes(b"one\n" + 9000 * b"x" + b"\n10%\rtwo\xff")
    assert tools.last_line(log) == "10%two\ufffd"


def test_a_signal_during_a_tool_takes_effect_after_it_as_it_did_before():
    """Of its caller: a program of Python gets its KeyboardInterrupt."""
    before, ended = signal.getsignal(signal.SIGINT), False
    with pytest.raises(KeyboardInterrupt):
        with tools.delayed_stops():
            signal.raise_signal(signal.SIGINT)
            ended = True
    assert ended and signal.getsignal(signal.SIGINT) == before == signal.default_int_handler
