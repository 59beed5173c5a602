# SPDX-License-Identifier: Apache-2.0
"""Fledge answers the mistakes of tests/mistakes.txt with the text of the file, which was reviewed."""

import subprocess
import sys
from difflib import unified_diff

from tests import mistakes
from tests.tree import ROOT


def test_each_mistake_is_answered_as_the_file_says():
    done = subprocess.run([sys.executable, "-m", "tests.mistakes", "--print"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    there = mistakes.FILE.read_text(encoding="utf-8")
    different = [*unified_diff(there.splitlines(), done.stdout.splitlines(), "tests/mistakes.txt", "now", lineterm="")]
    assert not different, "\n".join(["", *different, "Read it; /usr/bin/python3 -m tests.mistakes writes it anew."])


def test_the_list_is_long_and_no_answer_is_a_traceback():
    text = mistakes.FILE.read_text(encoding="utf-8")
    assert len(mistakes.read(text)[1]) >= 60
    for internal in ("Traceback", "This is a defect of fledge", "__init__() "):
        assert internal not in text
