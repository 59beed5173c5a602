# SPDX-License-Identifier: Apache-2.0
"""The connection of a spacecraft to a link that the test breaks."""
import socket
from types import SimpleNamespace

import pytest

from fledge.errors import SetupError
from fledge.ground.server import link as module
from fledge.ground.server.clock import Clock
from fledge.ground.server.link import AGAIN, Connection
from fledge.ground.server.settings import CraftSettings


@pytest.fixture
def now(monkeypatch):
    """[s], which the test sets."""
    made = SimpleNamespace(t=100.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: made.t))
    return made


def connection(link="", flown=False, control=None):
    return Connection(CraftSettings("craft", link=link), Clock(False), None, flown, control)


def test_a_link_that_breaks_is_opened_again_after_a_while(now):
    with socket.create_server(("127.0.0.1", 0)) as server:
        one = connection(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        assert one.silent == "the link is down: not started" and one.due
        assert one.open() is False and not one.due and not one.silent
        assert one.describe().items() >= {"state": "up", "up": True, "skipped": 0, "dropped": 0}.items()
        with pytest.raises(SetupError, match="craft is no mission of Fledge"):
            one.reach()
        assert one.broke("gone") and not one.broke("gone") and one.broke("still gone")
        assert one.silent == "the link is down: still gone" and not one.due
        now.t += AGAIN
        assert one.due
        one.open()
        one.close()
        assert one.link is None


def test_a_simulation_that_has_failed_is_not_flown_on(now):
    one = connection(flown=True)
    assert one.broke("an error")
    now.t += 1e9
    assert not one.due


def test_nothing_is_sent_while_the_run_repeats_an_earlier_one(now):
    one = connection(control=SimpleNamespace(repeats=lambda received: f"it repeats, at {received:g} s"))
    one.link = SimpleNamespace()
    assert one.silent == "it repeats, at 0 s"
