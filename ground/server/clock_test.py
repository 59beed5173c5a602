# SPDX-License-Identifier: Apache-2.0
"""The time of a spacecraft, against clocks that the test sets."""
from types import SimpleNamespace

import pytest

from fledge.commands import Timed
from fledge.ground.server import clock as module
from fledge.ground.server.clock import BACK, Clock

UTC = 1_700_000_000 * 10**9


@pytest.fixture
def machine(monkeypatch):
    """The machine's clocks [ns]: steady, utc."""
    clock = SimpleNamespace(steady=0, utc=UTC)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic_ns=lambda: clock.steady, time_ns=lambda: clock.utc))
    return clock


def test_utc_goes_on_and_a_clock_that_is_set_is_a_step(machine):
    clock = Clock(simulated=False)
    assert clock.advance() == 0 and clock.now == UTC
    for steady, utc, step, now in ((5, 5, 0, 5), (10, 10 - BACK // 2, 0, 5),
                                   (20, 20 + 3 * BACK, 3 * BACK, 20 + 3 * BACK),
                                   (30, 30 - 7 * BACK, -10 * BACK, 20 - 7 * BACK)):
        machine.steady, machine.utc = steady, UTC + utc
        assert clock.advance() == step and abs(clock.now - UTC - now) <= 10


@pytest.mark.parametrize("clock", [Clock(simulated=True), Clock(simulated=False, live=False)])
def test_simulated_time_and_that_of_a_replay_stand_without_packets(machine, clock):
    assert clock.advance() == 0 and clock.now == 0


def test_packets_have_the_time_of_the_link_or_of_utc_which_does_not_go_back_a_little(machine):
    arrived = [Timed(-5, b"a"), Timed(70, b"b")]
    assert Clock(simulated=True).timed(arrived, 100) == [(0, UTC, b"a"), (70, UTC, b"b")]
    clock = Clock(simulated=False)
    assert clock.timed(arrived, 100) == [(UTC - 105, UTC - 105, b"a"), (UTC - 30, UTC - 30, b"b")]
    assert clock.timed([], 100) == []
    clock.now = UTC
    assert [t for t, _, _ in clock.timed(arrived, 100)] == [UTC, UTC]
    clock.now = UTC + 2 * BACK      # another session
    assert [t for t, _, _ in clock.timed(arrived, 100)] == [UTC - 105, UTC - 30]


def test_what_is_missing_is_in_words():
    clock = Clock(simulated=True)
    clock.gaps += [(10**9, 2 * 10**9), (5 * 10**9, 6 * 10**9)]
    assert clock.missing(0, 10**9) == "" and clock.missing(2 * 10**9, 5 * 10**9) == ""
    assert clock.missing(0, 10**10) == "telemetry is missing from 1 s to 2 s, from 5 s to 6 s"
    assert Clock(simulated=False).text(UTC) == "2023-11-14 22:13:20 UTC"
