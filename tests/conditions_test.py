# SPDX-License-Identifier: Apache-2.0
"""Tests do not depend on the program that starts them."""

import os
import subprocess
import sys
from pathlib import Path

from tests.tree import ROOT


def test_what_tests_start_has_default_signals():
    status = subprocess.run(["cat", "/proc/self/status"], capture_output=True, text=True, check=True).stdout
    masks = dict(line.split(":\t") for line in status.splitlines() if line.startswith(("SigBlk", "SigIgn")))
    assert {name: int(mask, 16) for name, mask in masks.items()} == {"SigBlk": 0, "SigIgn": 0}


def test_also_in_the_background_of_a_script_and_under_nohup():
    name = f"{Path(__file__).relative_to(ROOT)}::{test_what_tests_start_has_default_signals.__name__}"
    for start in (["--ignore-signal"], ["--ignore-signal=INT,QUIT,HUP", "--block-signal=TERM,INT"]):
        done = subprocess.run(["env", *start, sys.executable, "-m", "pytest", "-q", name], cwd=ROOT, text=True,
                              stdin=subprocess.DEVNULL, capture_output=True, env={**os.environ, "PYTEST_ADDOPTS": ""})
        assert done.returncode == 0 and "1 passed" in done.stdout, done.stdout
