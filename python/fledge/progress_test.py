# SPDX-License-Identifier: Apache-2.0
"""When progress is shown, and what is left by it, by a clock of the tests."""
import io
from types import SimpleNamespace

import pytest

from fledge import progress
from fledge.progress import Bar, Progress


class Clock(io.StringIO):
    """stderr, with the time of the work."""
    now = 0.0
    terminal = False

    def isatty(self):
        return self.terminal


@pytest.fixture
def clock(monkeypatch):
    found = Clock()
    monkeypatch.setattr(progress, "sys", SimpleNamespace(stderr=found))     # pytest changes that of all modules
    monkeypatch.setattr(progress.time, "monotonic", lambda: found.now)
    return found


def lines(clock, bar, seconds, done):
    """The times at which a line is written, and the lines, if `done(t)` is called every half second."""
    found = []
    for half in range(2 * seconds + 1):
        clock.now = half / 2
        bar.at(done(clock.now), "some")
        if text := clock.getvalue():
            found.append((clock.now, text))
            clock.seek(0)
            clock.truncate()
    return found


def test_a_file_gets_a_line_once_the_work_is_known_to_be_long_and_then_ever_fewer(clock):
    with Bar("work") as bar:
        found = lines(clock, bar, 2000, lambda t: t / 2000)
    assert [t for t, _ in found] == [2, 10, 20, 40, 80, 160, 320, 620, 920, 1220, 1520, 1820]
    assert found[1][1] == "work   0%  some, 33:10 left\n" and found[-1][1] == "work  91%  some, 3:00 left\n"
    assert clock.getvalue() == ""


def test_short_work_writes_nothing_into_a_file(clock):
    with Bar("work") as bar:
        assert lines(clock, bar, 9, lambda t: t / 9) == []


def test_work_of_which_nothing_is_done_is_not_silent_and_its_first_estimate_comes_at_once(clock):
    with Bar("work") as bar:
        found = lines(clock, bar, 60, lambda t: 0.0 if t < 47 else 0.25)
    assert found == [(10, "work   0%  some\n"), (20, "work   0%  some\n"), (40, "work   0%  some\n"),
                     (47, "work  25%  some, 2:21 left\n")]


def test_what_is_expected_is_the_estimate_until_something_is_done(clock):
    with Bar("work", expected=100.0) as bar:
        found = lines(clock, bar, 12, lambda t: 0.0)
    assert found == [(2, "work   0%  some, 1:38 left\n"), (10, "work   0%  some, 1:30 left\n")]


def test_what_an_earlier_program_did_does_not_make_this_one_fast(clock):
    with Bar("work") as bar:
        found = lines(clock, bar, 10, lambda t: 0.5 + t / 200)
    assert found[-1] == (10, "work  55%  some, 1:30 left\n")


def test_a_terminal_has_a_bar_that_is_cleared(clock):
    clock.terminal = True
    with Progress("run", 0, 100 * 10**9) as bar:
        bar.reaches(0)
        clock.now = 0.2
        bar.reaches(10**9)      # too early for an estimate
        assert clock.getvalue() == ""
        clock.now = 1.0
        bar.reaches(25 * 10**9)
        assert clock.getvalue().startswith("\rrun [#######.....................]  25%  25 s of 1:40, 25x, 3 s left")
    assert clock.getvalue().endswith(" \r")


def test_a_run_that_ends_soon_has_no_bar_on_a_terminal(clock):
    clock.terminal = True
    with Progress("run", 0, 100 * 10**9) as bar:
        for tenth in range(1, 11):
            clock.now = tenth / 10
            bar.reaches(tenth * 10 * 10**9)
    assert clock.getvalue() == ""
