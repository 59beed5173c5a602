# SPDX-License-Identifier: Apache-2.0
"""Programs that others have published as binaries, on the LEON3. The tester fetches them and names the files:

    FLEDGE_LEON3_IMAGES=hello.exe:gr712rc-prom.elf /usr/bin/python3 -m pytest tests/leon3_images_test.py

docs/leon3.md says which there are.
"""

import os
import re
import subprocess
from pathlib import Path

import pytest

from fledge.targets.build import native
from tests.tree import ROOT

# By the end of the name: the seconds of the board that it may take, its exit status, and what it prints, in order.
KNOWN = {
    "hello.exe": (5, 0, [r"RTEMS Hello World", r"END OF TEST"]),
    "gr712rc-prom.elf": (5, 0, [r"MKPROM2 boot loader", r"decompressing .text", r"CPU 0: 100", r"CPU 1: 201"]),
    "ram.srec": (5, 0, [r"[Ss]tart", r"[Pp]ass"]),
}
FILES = [Path(name) for name in os.environ.get("FLEDGE_LEON3_IMAGES", "").split(":") if name]


@pytest.mark.skipif(not FILES, reason="FLEDGE_LEON3_IMAGES names no files")
@pytest.mark.parametrize("file", FILES, ids=lambda path: path.name)
@pytest.mark.parametrize("engine", ["threaded", "translator"])
def test_a_published_program_runs(file, engine):
    seconds, status, says = next((known for end, known in KNOWN.items() if file.name.endswith(end)), (60, 0, []))
    done = subprocess.run([native("fledge_leon3", "emulator/tools"), ROOT / "emulator/boards/gr712rc.toml", file,
                           "--engine", engine, "--for", str(seconds)], capture_output=True, text=True, errors="replace")
    assert done.returncode == status, done.stdout + done.stderr
    assert re.search("(?s)" + ".*".join(says), done.stdout), done.stdout + done.stderr
