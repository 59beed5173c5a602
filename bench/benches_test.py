# SPDX-License-Identifier: Apache-2.0
"""Each bench builds and starts."""
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fledge.cli.bench import benches

TREE = Path(__file__).resolve().parents[1]


@pytest.mark.long("compiles what the benches measure in C++, and starts each bench")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="benches measure the release build")
def test_benches_build_and_start(tmp_path):
    built = subprocess.run(["ninja", "-C", TREE / "build/release", "fledge_bench"], capture_output=True, text=True)
    assert built.returncode == 0, built.stdout[-5000:]

    def bench(*arguments):
        done = subprocess.run([sys.executable, "-P", "-m", "fledge.cli", "bench", *arguments], cwd=tmp_path,
                              capture_output=True, text=True)
        assert done.returncode == 0, (arguments, done.stderr)

    assert len(benches()) > 20
    for name in benches():
        bench(name, "--help")
    bench("sim", "--runs", "1", "--json", "sim.json")
    rows = json.loads((tmp_path / "sim.json").read_text(encoding="utf-8"))
    assert all(math.isfinite(row["value"]) for row in rows)     # a difference of two times may be 0 or less
    assert {"hand_written_loop", "nadir_spin", "MrpFeedback", "world alone"} <= {row["case"] for row in rows}
