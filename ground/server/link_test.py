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
    clock = SimpleNamespace(t=100.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock.t))
    return clock


def connection(link="", flown=False, control=None):
    return Connection(CraftSettings("craft", link=link), Clock(False), None, flown, control)


def test_a_link_that_breaks_is_opened_again_after_a_while(now):
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = connection(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        assert link.silent == "the link is down: not started" and link.due
        assert link.open() is False and not link.due and not link.silent
        assert link.describe().items() >= {"state": "up", "up": True, "skipped": 0, "dropped": 0}.items()
        with pytest.raises(SetupError, match="craft is no mission of Fledge"):
            link.reach()
        assert link.broke("gone") and not link.broke("gone") and link.broke("still gone")
        assert link.silent == "the link is down: still gone" and not link.due
        now.t += AGAIN
        assert link.due
        link.open()
        link.close()
        assert link.link is None


def test_damage_of_a_stream_is_reported_once(now):
    packets = [b"\x01\x23\xc0" + bytes([i]) + b"\0\x09" + b"0123456789" for i in range(30)]
    damaged = packets[9][:4] + b"\xff\xff" + packets[9][6:]
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = connection(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        assert link.damages() == []
        link.open()
        end, _ = server.accept()
        with end:
            end.sendall(b"".join([*packets[:9], damaged, *packets[10:]]))
            got = []
            while len(got) < 29:
                got += [packet.packet for packet in link.receive(link.link.t + 10**8)]
        assert got == packets[:9] + packets[10:]
        assert link.damages() == [
            "16 bytes of the stream from byte 144 on are no packet: a packet of 65542 bytes would begin there, but "
            "others that continue those before stand inside of it"]
        assert link.damages() == [] and link.describe()["skipped"] == 16
        link.close()


def test_a_simulation_that_has_failed_is_not_flown_on(now):
    link = connection(flown=True)
    assert link.broke("an error")
    now.t += 1e9
    assert not link.due


def test_nothing_is_sent_while_the_run_repeats_an_earlier_one(now):
    link = connection(control=SimpleNamespace(repeats=lambda received: f"it repeats, at {received:g} s"))
    link.link = SimpleNamespace()
    assert link.silent == "it repeats, at 0 s"
