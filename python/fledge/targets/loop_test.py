# SPDX-License-Identifier: Apache-2.0
"""How long the programs of a flight may outlive the first that ends; with a clock that is moved by hand."""

from types import SimpleNamespace

import pytest

from fledge.errors import Failure
from fledge.targets import loop

NEVER = 1e9
LINE = ["--line", "/dev/ttyACM0?baud=9600"]


class Clock:
    def __init__(self):
        self.now = 100.0

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


@pytest.mark.parametrize("controller, board, ends", [
    ((1.0, 1), (NEVER, 0), 6.0),
    ((1.0, 0), (NEVER, 0), 21.0),
    ((NEVER, 0), (1.0, 3), 21.0),
    ((2.0, 1), (1.0, 3), 2.0),
    ((NEVER, 0), (1.0, 3, *LINE), 1.5),
    ((1.0, 0), (20.5, 0), 20.5)],
    ids=["the controller fails", "the controller ends", "a board fails", "both fail",
         "a board fails at its line", "all end"])
def test_the_others_have_some_seconds_which_depend_on_what_ended(tmp_path, monkeypatch, controller, board, ends):
    clock = Clock()

    class Program:
        def __init__(self, name, command, log, folder, descriptors=()):
            self.end, self.code, *words = command
            self.device = loop._device(words)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def poll(self):
            return None if clock.now < 100.0 + self.end else self.code

        def line_problems(self):
            return []

        def figures(self):
            return {"ticks": "0"}

    monkeypatch.setattr(loop, "time", clock)
    monkeypatch.setattr(loop, "Program", Program)
    job = SimpleNamespace(folder=tmp_path, parts=[], duration=1.0, title="demo")
    commands = {loop.CONTROLLER: list(controller), "flight": list(board)}
    if controller[1] == board[1] == 0 and NEVER not in (controller[0], board[0]):
        assert loop._run(job, "linux", commands).keys() == commands.keys()
    else:
        with pytest.raises(Failure, match="the flight of demo ended early: "):
            loop._run(job, "linux", commands)
    assert clock.now - 100.0 == pytest.approx(ends, abs=0.05)
