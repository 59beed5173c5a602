# SPDX-License-Identifier: Apache-2.0
"""Programs that others have published as binaries, on the LEON3. The tester fetches them and names the files:

    FLEDGE_LEON3_IMAGES=hello.exe:gr712rc-prom.elf /usr/bin/python3 -m pytest tests/leon3_images_test.py

docs/leon3.md lists them and their output. Any other program must end with status 0 within a minute of the
board's time.
"""

import os
import re
import subprocess
from pathlib import Path

import pytest

from fledge.targets.build import native
from tests.tree import ROOT

# By the end of the path: the board, the seconds of its time, its output, in this order, and the status if not 0.
SYSTEST = [r"device 1:3", r"subtest 8\n  subtest 13\n  subtest 6\n(test failed[^\n]*\n){5}device 1:13\ndevice 1:17\n",
           r"device 1:12\n", r"test ends, errors: 5"]    # all of caches, which the board does not have
KNOWN = {
    "hello.exe": ("gr712rc", 5, [r"RTEMS Hello World", r"END OF TEST"]),
    "dual_core_timer.exe": ("gr712rc", 5, [r"Core 0: 10", r"Core 1: 21"]),
    "mkprom_boot.exe": ("gr712rc", 5, [r"CPU 0: 100", r"CPU 1: 201"]),
    "gr712rc-prom.elf": ("gr712rc", 5, [r"MKPROM2 boot loader", r"decompressing .text", r"CPU 0: 100", r"CPU 1: 201"]),
    "rtems_testdrv_gpio": ("gr712rc", 5, [r"Failed to open gpio port 6"]),
    "rtems_testdrv_uart": ("gr712rc", 5, [r"task init", r"open port 2 error", r"read error: Bad file number"]),
    "mem_test": ("gr712rc", 30, [r"Initializing memory", r"\[Cpy 8-bit\]Time Elapsed: 13107\d\d us", r"End of test"]),
    "stanford/main.exe": ("gr712rc", 5, [r"Perm  Towers", r"Floating point composite is  +\d+"], 145),
    "nmea_checksum/main.exe": ("gr712rc", 5, []),
    "mpctst.elf": ("gr712rc", 5, [r"total iter: 22", r"3.000000 0.000000", r"7.999969"], 8),
    # Newer builds test no cache of one way, as which a board without caches presents itself.
    "kcu105/systest.srec": ("leon3mp", 5, [r"subtest 6\ndevice 1:13\n", r"test ends, errors: 0"]),
    "systest.srec": ("leon3mp", 5, SYSTEST),
    "prom.out": ("leon3mp", 5, SYSTEST),
}
FILES = [Path(name) for name in os.environ.get("FLEDGE_LEON3_IMAGES", "").split(":") if name]


@pytest.mark.skipif(not FILES, reason="FLEDGE_LEON3_IMAGES names no files")
@pytest.mark.parametrize("file", FILES, ids=lambda path: path.name)
@pytest.mark.parametrize("engine", ["threaded", "translator"])
def test_a_published_program_runs(file, engine):
    known = next((known for end, known in KNOWN.items() if str(file).endswith(end)), ("gr712rc", 60, []))
    board, seconds, says, status = (*known, 0)[:4]
    done = subprocess.run([native("fledge_leon3", "emulator/tools"), ROOT / f"emulator/boards/{board}.toml", file,
                           "--engine", engine, "--for", str(seconds)], capture_output=True, text=True, errors="replace")
    printed = done.stdout.replace("\0", "").replace("\r", "")
    assert done.returncode == status, done.stdout + done.stderr
    assert re.search("(?s)" + ".*".join(says), printed), printed + done.stderr
