# SPDX-License-Identifier: Apache-2.0
"""Small files of each kind that Fledge reads, damaged in ways that are the same for the same seed. Hours of it:
tests/mutants.py.
"""
import os
import signal
import subprocess
import sys
import time

import pytest

from tests import mutants
from tests.tree import ROOT

pytestmark = pytest.mark.spread


def verdict(tmp_path, read):
    return mutants.judge(read, tmp_path, mutants.REFUSALS).word


def test_the_judge_sees_what_a_reader_may_not_do(tmp_path, monkeypatch):
    def forever():
        while True:
            pass

    def refuses(text):
        raise mutants.SetupError(text)

    monkeypatch.setattr(mutants, "BYTES", mutants.judge(len, tmp_path, ()).bytes + 50_000_000)
    assert verdict(tmp_path, lambda path: None) == "read"
    assert verdict(tmp_path, lambda path: refuses("a.bsp: a word of it is damaged")) == "refused"
    assert verdict(tmp_path, lambda path: refuses("x" * 10_000)) == "refused in a line that is too long"
    assert verdict(tmp_path, lambda path: refuses("\x1b[2J")) == "refused by characters that are not shown"
    assert verdict(tmp_path, lambda path: int("x")) == "ValueError"
    assert verdict(tmp_path, lambda path: bytearray(b"1") * 10**8).startswith("takes ")
    assert verdict(tmp_path, lambda path: bytearray(b"1") * 10**10) == "MemoryError"
    assert verdict(tmp_path, lambda path: os.kill(os.getpid(), signal.SIGKILL)) == "ended by SIGKILL"
    monkeypatch.setattr(mutants, "SECONDS", 1)
    monkeypatch.setattr(mutants, "PATIENCE", 1)
    assert verdict(tmp_path, lambda path: time.sleep(5)) == "no end within 1 s"
    monkeypatch.setattr(mutants, "PATIENCE", 60)
    assert verdict(tmp_path, lambda path: forever()) == "no end within 1 s"


@pytest.mark.parametrize("count, kind", [pytest.param(4, (), id="each"), *(
    pytest.param(300, (kind,), marks=pytest.mark.long("300 copies"), id=kind) for kind in mutants.kinds())])
def test_each_copy_is_read_or_refused_in_a_line(count, kind):
    done = subprocess.run([sys.executable, "-m", "tests.mutants", "1", str(count), *kind], cwd=ROOT, text=True,
                          stdout=subprocess.PIPE, timeout=3600)
    assert done.returncode == 0, done.stdout
