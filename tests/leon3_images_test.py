# SPDX-License-Identifier: Apache-2.0
"""Programs that others have published as binaries, on the LEON3. The tester fetches them and names the files:

    FLEDGE_LEON3_IMAGES=hello.exe:gr712rc-prom.elf /usr/bin/python3 -m pytest tests/leon3_images_test.py

docs/leon3.md says which there are, and what they print. Any other program must end with status 0 within a minute of the
board's time.
"""

import os
import re
import subprocess
from pathlib import Path

import pytest

from fledge.targets.build import native
from tests.tree import ROOT

# By the end of the name: the board, the seconds of its time, and what is printed, in this order.
KNOWN = {
    "hello.exe": ("gr712rc", 5, [r"RTEMS Hello World", r"END OF TEST"]),
    "dual_core_timer.exe": ("gr712rc", 5, [r"Core 0: 10", r"Core 1: 21"]),
    "gr712rc-prom.elf": ("gr712rc", 5, [r"MKPROM2 boot loader", r"decompressing .text", r"CPU 0: 100", r"CPU 1: 201"]),
    # Of the errors, all are of caches, which the board does not have.
    "systest.srec": ("leon3mp", 5, [r"device 1:3", r"subtest 8\n  subtest 13\n  subtest 6\n(test failed[^\n]*\n){5}"
                                    r"device 1:13\ndevice 1:17\n", r"device 1:12\n", r"test ends, errors: 5"]),
}
FILES = [Path(name) for name in os.environ.get("FLEDGE_LEON3_IMAGES", "").split(":") if name]


@pytest.mark.skipif(not FILES, reason="FLEDGE_LEON3_IMAGES names no files")
@pytest.mark.parametrize("file", FILES, ids=lambda path: path.name)
@pytest.mark.parametrize("engine", ["threaded", "translator"])
def test_a_published_program_runs(file, engine):
    board, seconds, says = next((known for end, known in KNOWN.items() if file.name.endswith(end)), ("gr712rc", 60, []))
    done = subprocess.run([native("fledge_leon3", "emulator/tools"), ROOT / f"emulator/boards/{board}.toml", file,
                           "--engine", engine, "--for", str(seconds)], capture_output=True, text=True, errors="replace")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search("(?s)" + ".*".join(says), done.stdout), done.stdout + done.stderr
