# SPDX-License-Identifier: Apache-2.0
"""The server as a program of a co-simulation, whose flight software is on a target."""
import json
import os
import re
import signal
import subprocess
import sys
import time
from urllib.request import Request, urlopen

import pytest

from fledge.targets import TARGETS

PATIENCE = 120      # [s]
SIMULATION = """
simulation = "room"
until = 36000
pace = 20
join = 300
[[node]]
mission = "nadir_spin"
process = "world"
[[node]]
mission = "nadir_spin"
process = "flight"
target = "{target}"
[[asynchronous]]
name = "ground"
serve = "room.toml"
"""


@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="the release build shows it")
@pytest.mark.parametrize("target", ["linux", "leon3"])
def test_a_command_is_verified_on_a_target_and_the_run_is_controlled(target, tmp_path):
    if missing := TARGETS[target].missing():
        pytest.skip(f"not here: {', '.join(missing)}")
    (tmp_path / "sim.toml").write_text(SIMULATION.format(target=target))
    (tmp_path / "room.toml").write_text('port = 0\nfolder = "room"\n[[craft]]\nmission = "nadir_spin"\n'
                                        'link = "cosim:flight"\n')
    log = tmp_path / "runs/room/log/ground.log"

    def until(holds):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and run.poll() is None:
            if found := holds():
                return found
            time.sleep(0.1)
        raise AssertionError(f"{log.read_text() if log.exists() else 'no log'}, exit code {run.poll()}")

    with open(tmp_path / "up.log", "w") as printed, subprocess.Popen(
            [sys.executable, "-m", "fledge.cli", "up", "sim.toml"], cwd=tmp_path, stdout=printed,
            stderr=printed) as run:
        try:
            address = until(lambda: log.exists() and re.search(r"http://\S+/", log.read_text()))[0]

            def ask(path, content=None):
                body = None if content is None else json.dumps(content).encode()
                return json.loads(urlopen(Request(f"{address}api/{path}", body, headers)).read())

            headers = {}
            headers["X-Fledge-CSRF"] = ask("session")["csrf"]
            until(lambda: ask("crafts")[0]["link"]["up"])
            number = ask("crafts/nadir_spin/send", {"name": "flight.write.control.K", "arguments": {"K": 3}})["id"]

            def verified():
                one, = [one for one in ask("crafts/nadir_spin/sent") if one["id"] == number]
                stages = [each["stage"] for each in one["stages"]]
                return stages[-1] == "completed" and stages

            assert until(verified) == ["released", "accepted", "completed"]

            run_control = "crafts/nadir_spin/run"
            ask(run_control, {"action": "pause"})
            paused = until(lambda: (found := ask(run_control))["state"] == "paused" and found)
            ask(run_control, {"action": "step", "seconds": 5})
            begin = int(paused["t_ns"])
            later = until(lambda: (found := ask(run_control))["state"] == "paused" and int(found["t_ns"]) > begin
                          and found)
            assert 4 * 10**9 <= int(later["t_ns"]) - begin <= 6 * 10**9
            ask(run_control, {"action": "go", "speed": 0})
            until(lambda: int(ask(run_control)["t_ns"]) > begin + 25 * 10**9)
        finally:
            run.send_signal(signal.SIGINT)
            run.wait(PATIENCE)
