# SPDX-License-Identifier: Apache-2.0
"""Stations, radio and predicted passes of a spacecraft, against what the simulation then does."""
from types import SimpleNamespace

import numpy as np
import pytest

import fledge
from fledge.ground.server import contacts
from fledge.ground.server.contacts import Contacts
from fledge.ground.server.room import Room
from fledge.ground.server.scene import Feed
from fledge.ground.server.settings import read
from fledge.units import hour, s
from tests.waiting import wait_for


@pytest.mark.long("flies half a day")
def test_the_passes_of_half_a_day_are_those_that_are_flown():
    """Rise and set within 0.1 s, although the truth has J3, J4 and the Sun, which the prediction leaves out."""
    sim = fledge.load("earth_imager")
    log = sim.record(sim.world.station.contact, every=1 * s)
    sim.run(10 * s)
    contacts = Contacts(Feed("imager", sim), sim)
    assert contacts.passes() == [], "nothing is known yet"
    contacts.poll()
    contacts._predicted = (-np.inf, [])
    passes = contacts.passes()
    sim.run(12 * hour)
    t, seen, elevation = log.time, log["contact.visible"] == 1, log["contact.elevation"]
    rises, sets = (t[1:][np.diff(seen.astype(int)) == way] for way in (1, -1))
    assert len(rises) == len(sets) > 4
    for rise, end, row in zip(rises, sets, passes):
        assert row["station"] == "station"
        for predicted, after in ((row["rise"], rise), (row["set"], end)):   # the first sample of 1 s behind it
            assert -1.1 < predicted - after < 0.1
        highest = elevation[(t >= rise) & (t <= end)].max()
        assert row["elevation"] == pytest.approx(highest, abs=2e-4)
        assert row["highest"] == pytest.approx(t[(t >= rise) & (t <= end)][np.argmax(elevation[
            (t >= rise) & (t <= end)])], abs=1.5)
    assert not seen[t > sets[-1]].any() and len([pass_ for pass_ in passes if pass_["rise"] < 12 * 3600]) == len(rises)


def test_what_is_now_is_the_truth_and_a_pass_that_goes_on_has_no_rise():
    sim = fledge.load("earth_imager")
    sim.run(20 * 60 * s)
    contacts = Contacts(Feed("imager", sim), sim)
    contacts.poll()
    [station], [radio], w = contacts.state["stations"], contacts.state["radios"], sim.world
    assert station["elevation"] == pytest.approx(w.station.contact.elevation, abs=1e-5)
    assert station["range"] == pytest.approx(w.station.contact.range, abs=5) and station["seen"]
    assert radio["station"] == "station" and radio["down"]["lock"] == bool(w.radio.down.lock)
    assert radio["up"]["state"] == "locked" and radio["up"]["eb_n0_dB"] == w.radio.up.eb_n0_dB
    assert (radio["down"]["rate"], radio["down"]["lost"]) == (2e6, 0)
    first = contacts.passes()[0]
    assert first["rise"] is None and 20 * 60 < first["highest"] < first["set"] < 30 * 60


def test_without_a_sky_the_body_turns_by_its_spin():
    """An orbit about the Earth without a Sky, and a point mass."""
    sim = fledge.Simulation("bare")
    w, world = sim.world, fledge.world
    w.craft = world.Spacecraft(I_B=[1, 1, 1], gravity=[world.EARTH], orbit=fledge.Orbit(world.EARTH, a=7.5e6, i=1.0))
    w.station = world.GroundStation(body=world.EARTH, latitude=0.5, longitude=1.0, mask=0.1, spin=7.3e-5)
    w.connect(w.craft.state >> w.station.truth)
    w.task("dynamics", every=1 * s, run=[w.craft, w.station])
    log = sim.record(w.station.contact, every=1 * s)
    sim.run(2 * s)
    contacts = Contacts(Feed("bare", sim), sim)
    contacts.poll()
    passes = contacts.passes()
    sim.run(24 * hour)
    rises = log.time[1:][np.diff(log["contact.visible"].astype(int)) == 1]
    assert len(rises) > 3
    np.testing.assert_allclose([pass_["rise"] for pass_ in passes][:len(rises)], rises, atol=1.2)


def test_a_spacecraft_of_a_database_has_no_stations_and_a_silent_one_no_state():
    assert Contacts(Feed("x", None), None).state == {"stations": [], "radios": []}
    sim = fledge.load("earth_imager")
    contacts = Contacts(Feed("imager", sim, flown=False, link=lambda: SimpleNamespace(topics={})), sim)
    contacts.poll()
    assert contacts.state["stations"] == [] and contacts.passes() == []
    assert contacts.state["radios"][0]["down"] == {"rate": 2e6}, "nothing is made up"


def test_the_server_says_it(tmp_path, monkeypatch):
    monkeypatch.setattr(contacts, "AGAIN", 0.0)
    (tmp_path / "ground.toml").write_text('port = 0\nfolder = "runs"\n[[craft]]\nname = "imager"\n'
                                          'mission = "earth_imager"\nspeed = 0\n')
    room = Room(read(tmp_path / "ground.toml"))
    try:
        craft = room.crafts["imager"]
        craft.start()
        state = wait_for(lambda: (now := craft.describe())["stations"] and int(now["t_ns"]) > 10**9 and now)
        assert state["bytes"] > 0 and state["stations"][0]["name"] == "station" and craft.contacts.passes()
    finally:
        room.close()


def test_the_radio_of_a_link_carries(tmp_path):
    (tmp_path / "ground.toml").write_text('folder = "runs"\n' + "".join(
        f'[[craft]]\nname = "{name}"\nmission = "earth_imager"\nlink = "cosim:flight{more}"\n'
        for name, more in (("by_radio", "?radio=world.radio"), ("beside", ""))))
    room = Room(read(tmp_path / "ground.toml"))
    try:
        for craft in room.crafts.values():
            craft.contacts.poll()
            radio, = craft.describe()["radios"]
            assert radio["name"] == "world.radio" and radio["carries"] == (craft.name == "by_radio")
    finally:
        room.close()
