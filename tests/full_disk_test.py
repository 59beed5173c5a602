# SPDX-License-Identifier: Apache-2.0
"""Commands on a full disk: each names the file that it cannot write, and what is kept. The disk is a file system in
memory, mounted in a namespace of its own.
"""
import os
import subprocess
import sys

import pytest

FULL = "No space left on device"
# Size of the disk, command line, exit code, what is on stderr.
COMMANDS = [
    ("100k", "run nadir_spin --for 60s --no-plots", 1, [
        f"cannot write runs/nadir_spin/free/run.mcap: {FULL}; what was written before is in "
        "runs/nadir_spin/free/run.mcap.part", f"runs/nadir_spin/free/summary.json: cannot be written: {FULL}"]),
    ("40k", "montecarlo nadir_spin --runs 20", 2, [
        "20 runs need 0.8 MB, more than what is left of the disk of runs/nadir_spin/montecarlo/release, 0.0 MB"]),
    ("900k", "montecarlo nadir_spin --runs 20", 1, [
        f"montecarlo/release/runs.h5: cannot be written: {FULL}; the 20 runs that were flown are kept in "
        "runs/nadir_spin/montecarlo/release/unfinished: once that is mended, the same command writes the report"]),
    ("40k", "montecarlo nadir_spin --only 3", 1, [
        f"cannot write runs/nadir_spin/montecarlo/release/3/run.mcap: {FULL}",
        f"3/retained.png: cannot be written: {FULL}"]),
    ("100k", "verify nadir_spin", 1, [
        "spin on desktop: ", f"RunError: cannot write verification/nadir_spin/flights/spin/desktop/run.mcap: {FULL}"]),
    ("8k", "export xtce earth_imager", 2, [f"runs/earth_imager/xtce/earth_imager.xml: cannot be written: {FULL}"]),
    ("8k", "export c nadir_spin", 2, [f"runs/nadir_spin/c/nadir_spin.c: cannot be written: {FULL}"]),
]


@pytest.mark.long("flies on full disks")
@pytest.mark.parametrize("size, words, code, texts", COMMANDS, ids=[f"{row[1]} in {row[0]}" for row in COMMANDS])
def test_a_full_disk_is_named(tmp_path, size, words, code, texts):
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["unshare", "-m", "sh", "-c", 'mount -t tmpfs -o size="$1" none "$0" && cd "$0" && shift && exec "$@"',
             str(disk), size]
    if subprocess.run([*mount, "true"], capture_output=True).returncode:
        pytest.skip("this user may not mount a file system")
    path = os.pathsep.join(map(os.path.abspath, filter(None, sys.path)))
    done = subprocess.run([*mount, sys.executable, "-m", "fledge.cli", *words.split()], capture_output=True, text=True,
                          env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == code, done.stderr
    assert not [text for text in texts if text not in done.stderr], done.stderr
    assert "This is a defect" not in done.stderr
