# SPDX-License-Identifier: Apache-2.0
"""Each program of up.toml is lost once and comes again: the run has the bits of one in which none was lost."""
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.cosim.up.testing import mark, set_pace, steered
from fledge.targets import TARGETS
from tests.waiting import wait_for

HERE = Path(__file__).resolve().parent
TARGET = "linux" if TARGETS["leon3"].missing() else "leon3"
LOST = {"panel": 12, "world": 24, "flight": 36}     # [s]


def fly(folder, mark, lost, room=False):
    """Fly 48 s of it in a folder, in which programs are lost at these times, and the control room when it serves.
    Returns what was said, and the folder of the run."""
    folder.mkdir()
    for file in ("up.toml", "control_room.toml"):
        text = (HERE / file).read_text().replace("../../runs", "runs").replace('"leon3"', f'"{TARGET}"')
        text = text.replace("until = 86400", 'until = 48\nsimulation = "orbiter"\nexchange = true')
        text = text.replace("save_every = 60", "save_every = 10").replace("pace  = 50", f"pace = {1 if room else 0}")
        for name, t in lost.items():
            text = text.replace(f'process = "{name}"\n', f'process = "{name}"\nkilled = {t}\n')
        (folder / file).write_text(text + steered(folder) if file == "up.toml" else f'port = 0\n{text}')
    run = folder / "runs/orbiter"
    with subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", "up.toml"], cwd=folder, env=mark.env, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        if room:
            log = run / "log/ground.log"
            wait_for(lambda: log.exists() and "the console is at" in log.read_text(), process)
            os.kill(next(pid for pid, command in mark.processes() if " ground serve " in command
                         and "guard" not in command), signal.SIGKILL)
            wait_for(lambda: log.read_text().count("the console is at") == 2, process)
            set_pace(folder, 0)
        out, _ = process.communicate()
    assert process.returncode == 0, out
    return out, run


@pytest.mark.long("kills each program in turn: 30 s")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="the release build shows it")
def test_each_program_may_be_killed(mark, tmp_path):
    _, alone = fly(tmp_path / "alone", mark, {})
    out, run = fly(tmp_path / "lost", mark, LOST, room=True)
    for name in (*LOST, "ground"):
        assert f"  {name} was killed by SIGKILL; it is started again (1 of 3)\n" in out, out
    text = (run / "log/ground.log").read_text()
    assert text.count("the console is at") == 2 and "  missing  " not in out and "  left     " not in out
    # Of one instant the controller writes in the order in which programs answer.
    assert compare(Archive(run / "exchange.mcap"), Archive(alone / "exchange.mcap")) == []
    files = ["world.mcap", "panel.mcap", f"flight/{TARGET}.mcap", f"flight/{TARGET}.telemetry.txt"]
    for file in files:
        assert (run / file).read_bytes() == (alone / file).read_bytes(), file
