# SPDX-License-Identifier: Apache-2.0
"""The server as a program of a co-simulation, whose flight software is on a target."""
import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from fledge.ground.server.run_control import Steered
from fledge.ground.console.testing.console import browse, checks
from fledge.cosim.steering import Steering
from fledge.errors import SetupError
from tests.needs import skip_unless_on
from tests.waiting import wait_for

SCRIPT = Path(__file__).with_suffix(".mjs")
SIMULATION = """
simulation = "room"
until = {until}
pace = {pace}
{settings}
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


class Flown:
    """A co-simulation that `fledge up` flies meanwhile, with a server at a port."""

    def __init__(self, folder, target, port=0, until=36000, pace=20, settings="keep_every = 10", server=""):
        skip_unless_on(target)
        self.folder = folder
        (folder / "sim.toml").write_text(
            SIMULATION.format(target=target, until=until, pace=pace, settings=settings) + server)
        (folder / "room.toml").write_text(f'port = {port}\nfolder = "room"\n[[craft]]\nmission = "nadir_spin"\n'
                                          'link = "cosim:flight"\n')

    def __enter__(self):
        with open(self.folder / "up.log", "w") as printed:
            self.run = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", "sim.toml"], cwd=self.folder,
                                        stdout=printed, stderr=printed)
        return self

    def __exit__(self, *_):
        self.run.send_signal(signal.SIGINT)
        self.run.wait()

    def until(self, holds):
        return wait_for(holds, self.run)

    def address(self, run="room"):
        """Of the server, when it has said it."""
        log = self.folder / f"runs/{run}/log/ground.log"
        return self.until(lambda: log.exists() and re.search(r"http://\S+/", log.read_text()))[0]


@pytest.mark.long("a co-simulation with a target")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="the release build shows it")
@pytest.mark.parametrize("target", ["linux", "leon3"])
def test_a_command_is_verified_on_a_target_and_the_run_is_controlled(target, tmp_path):
    with Flown(tmp_path, target) as flown:
        address, until = flown.address(), flown.until

        def ask(path, content=None):
            body = None if content is None else json.dumps(content).encode()
            return json.loads(urlopen(Request(f"{address}api/{path}", body, headers)).read())

        headers = {}
        headers["X-Fledge-CSRF"] = ask("session")["csrf"]
        until(lambda: ask("crafts")[0]["link"]["up"])
        gain = {"name": "flight.write.control.K", "arguments": {"K": 3}}
        number = ask("crafts/nadir_spin/send", gain)["id"]

        def verified():
            row, = [row for row in ask("crafts/nadir_spin/sent") if row["id"] == number]
            stages = [stage["stage"] for stage in row["stages"]]
            return stages[-1] == "completed" and stages

        assert until(verified) == ["released", "accepted", "completed"]

        run_control = "crafts/nadir_spin/run"
        ask(run_control, {"action": "pause"})
        assert f"the console is at {address}\n" in (tmp_path / "up.log").read_text()
        paused = until(lambda: (state := ask(run_control))["state"] == "paused" and state)
        ask(run_control, {"action": "step", "seconds": 5})
        begin = int(paused["t_ns"])
        later = until(lambda: (state := ask(run_control))["state"] == "paused" and int(state["t_ns"]) > begin
                      and state)
        assert 4 * 10**9 <= int(later["t_ns"]) - begin <= 6 * 10**9
        ask(run_control, {"action": "go", "speed": 0})
        until(lambda: int(ask(run_control)["t_ns"]) > begin + 500 * 10**9)

        # Back in time: another run repeats this one until then, and goes on; only then it can be commanded.
        t = begin // 10**9 + 400
        with pytest.raises(HTTPError) as wrong:
            ask(run_control, {"action": "rewind", "seconds": 35999})
        assert "an instant from 0 s to" in wrong.value.read().decode()
        assert ask(run_control, {"action": "rewind", "seconds": t})["rewinds"]
        address = flown.address(f"room@{t}s")
        headers["X-Fledge-CSRF"] = ask("session")["csrf"]
        until(lambda: ask("crafts")[0]["link"]["up"])

        def sent():
            try:
                return ask("crafts/nadir_spin/send", gain)["id"]
            except HTTPError as refused:
                assert f"repeats an earlier one until {t} s; so nothing was sent" in refused.read().decode()

        number = until(sent)
        assert ask(run_control)["text"] == "" and t * 10**9 <= int(ask(run_control)["t_ns"])
        assert until(verified) == ["released", "accepted", "completed"]
        assert [row["text"] for row in ask("crafts/nadir_spin/events") if row["source"] == "run"] == [
            f"operator asked the run to go back to {t} s"]
        ended = [row["ended"] for row in ask("crafts/nadir_spin/sessions")]
        assert ended[:-1] == ["closed"], ended


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """What the browser found: check -> what went wrong."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    with Flown(tmp_path_factory.mktemp("flown"), "linux", port) as flown:
        return browse(SCRIPT, flown.address().rstrip("/"), flown.folder)


@pytest.mark.long("a browser on a co-simulation: 25 s")
@pytest.mark.parametrize("check", checks(SCRIPT))
def test_in_the_browser(results, check):
    assert results[check] == "", results[check]


def test_a_run_goes_back_only_where_it_may_and_takes_no_command_before_it_is_there():
    ours, theirs = socket.socketpair(type=socket.SOCK_SEQPACKET)
    with ours, theirs:
        run = Steered(Steering(theirs))

        def state(**given):
            ours.send(json.dumps(given).encode())

        for known in ({}, {"t": -1.0, "past": 0.0}, {"t": 50.0, "past": 50.0, "rewinds": False}):
            state(**known)
            assert run.repeats() == "" and run.describe()["text"] == ""
            with pytest.raises(SetupError, match="keeps no record to go back in: write keep_every = 60"):
                run.command("rewind", 0.0)
        state(t=49.5, past=50.0, rewinds=True)
        assert run.repeats() == run.describe()["text"] == "the run repeats an earlier one until 50 s"
        state(t=50.5, past=50.0, rewinds=True)
        assert run.repeats() == run.repeats(50.0) == ""
        assert run.repeats(49.0) == "the run repeats an earlier one until 50 s"
        state(t=49.5, past=50.0, rewinds=True)
        assert run.describe("the link broke")["text"] == "the link broke"
        for wrong in (-1.0, 49.6):
            with pytest.raises(SetupError, match=f"from 0 s to 49.5 s; found {wrong:g} s"):
                run.command("rewind", wrong)
        run.command("rewind", 12.25)
        assert ours.recv(100) == b"rewind 12.25"
