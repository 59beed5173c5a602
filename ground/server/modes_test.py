# SPDX-License-Identifier: Apache-2.0
"""Events of the modes that telemetry shows."""
from types import SimpleNamespace

import pytest

from fledge.ground import Database
from fledge.ground.server import modes
from fledge.ground.server.modes import Modes
from fledge.ground.server.verifying_test import DATABASE, STATUS, packet


@pytest.fixture
def monitor(tmp_path):
    (tmp_path / "sat.xml").write_text(DATABASE)
    return Database.load(tmp_path / "sat.xml").monitor("/Sat/Packet")


def followed(monitor, *batches):
    """(severity, source, text, t) of each event after batches of (t, mode)."""
    events = []
    watched = Modes(monitor, SimpleNamespace(event=lambda *event: events.append(event)))
    for batch in batches:
        monitor.take([(t, t, packet(STATUS, mode, 9, 1)) for t, mode in batch])
        watched.poll()
    return events


def test_the_first_mode_and_each_change_are_events_with_their_times(monitor):
    assert followed(monitor, [(5, 0), (6, 0)], [], [(7, 0), (8, 1), (9, 1), (10, 0)], [(11, 7)]) == [
        ("info", "mode", "the mode is SAFE", 5),
        ("watch", "mode", "the mode is WORK; before, it was SAFE", 8),
        ("watch", "mode", "the mode is SAFE; before, it was WORK", 10),
        ("watch", "mode", "the mode is 7; before, it was SAFE", 11)]


def test_a_mode_that_flaps_fills_no_journal(monitor):
    events = followed(monitor, [(t, t % 2) for t in range(1000)], [(1000, 1), (1001, 0)])
    assert len(events) == modes.MOST + 2
    assert events[-2:] == [("watch", "mode", f"the mode changed {1000 - modes.MOST} times more at once; now it is WORK",
                            999), ("watch", "mode", "the mode is SAFE; before, it was WORK", 1001)]


def test_a_new_database_goes_on_from_the_mode_that_was(monitor, tmp_path):
    events = []
    watched = Modes(monitor, SimpleNamespace(event=lambda *event: events.append(event[2])))
    monitor.take([(5, 5, packet(STATUS, 1, 9, 1))])
    watched.poll()
    (tmp_path / "other.xml").write_text(DATABASE)
    other = Database.load(tmp_path / "other.xml").monitor("/Sat/Packet")
    watched.begin(other)
    other.take([(6, 6, packet(STATUS, 1, 9, 1)), (7, 7, packet(STATUS, 0, 9, 1))])
    watched.poll()
    assert events == ["the mode is WORK", "the mode is SAFE; before, it was WORK"]
