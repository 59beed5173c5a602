# SPDX-License-Identifier: Apache-2.0
"""Flight and ground by a radio: a pass, bit errors, clones; geometry against JPL's ephemeris by other libraries."""
import os
from pathlib import Path

import numpy as np
import pytest

from fledge import Orbit, Simulation, flight as fsw, ground, world
from fledge.commands import Reason, Timed
from fledge.errors import SetupError
from fledge.units import Hz, K, deg, kg, km, m, minute, rad, s
from tests.needs import module, needs

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("FLEDGE_TEST_DATA", ROOT.parent / "shared" / "data"))
needs_de405 = needs("casacore-data-jpl-de405")
C = 299792458.0
S_BAND = dict(down_frequency=2.2e9 * Hz, up_frequency=2.0e9 * Hz, down_eirp_dBW=0, up_eirp_dBW=40, down_g_t_dBK=15,
              up_g_t_dBK=-25, down_rate=64e3 / s, up_rate=4e3 / s)
X_BAND = dict(down_frequency=8.4e9 * Hz, up_frequency=7.2e9 * Hz, down_eirp_dBW=80, up_eirp_dBW=110, down_g_t_dBK=54,
              up_g_t_dBK=10, down_rate=10e3 / s, up_rate=1e3 / s)


def passing(every=1 * s, **changes):
    """A craft that will rise over a station on the equator of an Earth that stands still, and its radio."""
    sim = Simulation("passing", seed=3)
    w, f = sim.world, sim.flight
    f.hill = fsw.HillPointing()
    f.task("gnc", every=0.5 * s, run=[f.hill])
    w.craft = world.Spacecraft(mass=10 * kg, I_B=[1, 1, 1] * kg * m**2, gravity=[world.EARTH],
                               orbit=Orbit(world.EARTH, altitude=500 * km, f=-40 * deg))
    w.nav = world.Navigation()
    w.station = world.GroundStation(body=world.EARTH, latitude=0 * deg, longitude=0 * deg, mask=5 * deg)
    w.radio = world.Radio(station=w.station, **S_BAND | changes)
    w.connect(w.craft.state >> [w.nav.truth, w.station.truth, w.radio.truth], w.nav.orbit >> f.hill.orbit)
    w.task("world", every=every, run=[w.craft, w.nav, w.station, w.radio])
    return sim


def test_a_pass_with_commands_before_it_and_telemetry_after_one_light_time():
    sim = passing()
    radio = sim.world.radio
    log = sim.record(sim.world.station.contact, radio.down, radio.up, every=1 * s)
    craft = ground.connect(sim, radio=radio)
    with pytest.raises(ground.NoAnswer):        # below the horizon
        craft.command("noop").completed(within=20 * s)
    while not radio.up.lock:
        sim.run(10 * s)
    craft.command("telemetry", "flight.hill.reference", every=2).completed(within=10 * s)
    risen = sim.time
    craft.listen(5 * minute)
    assert radio.up_traffic.lost == 1 and radio.up_traffic.received == 1 and craft.missed == 0
    assert craft.telemetry.flight.hill.reference.head.t > (risen + 295) * 1e9

    # What comes by hand: each second one packet, when its last bit has come.
    _, take = sim.flight.commands.by(radio)
    sim.run(20 * s)
    came = take()
    assert len(came) == 20
    for t, packet in came:
        sent = round(t / 1e9 - 0.3)
        link = log["radio.down.light_time"][int(sent)]
        assert t / 1e9 == pytest.approx(sent + 8 * len(packet) / 64e3 + link, abs=2e-9)
    assert 0.0017 < radio.down.light_time < 0.008

    # When it has set, all is lost, and housekeeping by the wire shows that flight goes on.
    sim.run(10 * minute)
    assert not radio.down.lock and radio.down_traffic.lost > 100 and take() and not take()
    visible = log["station.contact.visible"] == 1
    assert (visible == (log["down.lock"] == 1)).mean() > 0.998 and 300 < visible.sum() < 700
    with pytest.raises(ground.NoAnswer):
        craft.command("noop").completed(within=20 * s)
    assert sim.flight.commands.counters.executed == 1


def test_the_packets_of_a_target_that_flew_go_by_radio():
    sim, at = passing(), 480 * 10**9
    packets = [Timed(-1, b"first"), Timed(at, b"second"), Timed(at, b"third")]
    sim.flight.commands.play(packets)
    _, take = sim.flight.commands.by(sim.world.radio)
    sim.flight.commands.telemetry("flight.hill.reference")      # of the desktop's, which is not sent
    other = sim.clone()
    for twin in (sim, other):
        twin.run(10 * minute)
    came = take()
    assert sim.snapshot() == other.snapshot()
    assert [unit.packet for unit in came] == [b"second", b"third"] and sim.world.radio.down_traffic.lost == 1
    assert 2e6 < came[0].t - at < 10e6 and came[1].t - came[0].t == 8 * 5 / 64e3 * 1e9
    assert sim.flight.commands.take_packets() == packets


def test_a_wrong_bit_is_refused_by_flight_and_counted():
    sim = passing(up_eirp_dBW=-10)
    radio = sim.world.radio
    sim.run(10 * minute)
    assert 3e-3 < radio.up.bit_error_rate < 2e-2
    send, _ = sim.flight.commands.by(radio)
    noop = sim.flight.commands.packets.noop()
    for _ in range(400):
        send(noop)
    sim.run(1 * minute)
    traffic, counters = radio.up_traffic, sim.flight.commands.counters
    assert traffic.received == 400 and 60 < traffic.damaged < 340
    by_sequence = counters.reasons.get(Reason.SEQUENCE, 0)      # the same packet again and again
    assert counters.accepted + counters.refused == 400
    assert 0.9 * traffic.damaged < counters.refused - by_sequence <= traffic.damaged


def test_telemetry_with_wrong_bits_is_found_by_the_ground_as_far_as_packets_show_it():
    sim = passing(down_eirp_dBW=-35)
    craft = ground.connect(sim, radio=sim.world.radio)
    sim.run(8 * minute)
    craft.command("telemetry", "flight.hill.reference")
    craft.listen(3 * minute)
    traffic = sim.world.radio.down_traffic
    assert traffic.received > 300 and traffic.damaged > 100
    assert 0 < craft.refused < traffic.damaged      # of a packet in the middle, only the header has a check


def test_files_are_whole_behind_wrong_bits_both_ways(tmp_path):
    sim = passing(up_eirp_dBW=0, down_eirp_dBW=-31)
    sim.flight.files = fsw.Files(entity=2, ground=1, rate=4000 / s, allowed=15, ack_timer=2 * s, nak_timer=2 * s, crc=1)
    sim.flight.task("files", every=0.5 * s, run=[sim.flight.files])
    craft, radio = ground.connect(sim, radio=sim.world.radio), sim.world.radio
    (tmp_path / "plan").write_bytes(bytes(range(256)) * 80)
    sim.run(8 * minute)
    craft.put(tmp_path / "plan", within=2 * minute)
    craft.fetch("plan", to=tmp_path / "back", within=2 * minute)
    assert (tmp_path / "back").read_bytes() == (tmp_path / "plan").read_bytes()
    assert radio.up_traffic.damaged > 10 and radio.down_traffic.damaged > 5


def test_a_slow_transmitter_drops_what_it_has_no_room_for():
    sim = passing(down_rate=800 / s, down_room=4000)
    craft = ground.connect(sim, radio=sim.world.radio)
    sim.run(8 * minute)
    craft.command("telemetry", "flight.hill.reference")
    craft.listen(2 * minute)
    traffic = sim.world.radio.down_traffic
    assert traffic.dropped > 50 and 2500 < traffic.waiting <= 4000 and craft.missed > 0
    assert traffic.bytes == pytest.approx(800 / 8 * 120, rel=0.05)


def test_a_clone_and_a_snapshot_have_what_is_on_the_way():
    sim = passing(down_eirp_dBW=-53, down_rate=800 / s)
    send, take = sim.flight.commands.by(sim.world.radio)
    sim.run(8 * minute)
    send(sim.flight.commands.packets.telemetry("flight.hill.reference"))
    sim.run(30 * s)
    assert sim.world.radio.down_traffic.waiting > 1000
    send(sim.flight.commands.packets.mode("none") if sim.flight.modes else sim.flight.commands.packets.noop())
    take()
    other, snapshot = sim.clone(), sim.snapshot()
    _, take_other = other.flight.commands.by(other.world.radio)
    for twin in (sim, other):
        twin.run(60 * s)
    first = take()
    assert take_other() == first and len(first) > 10 and sim.snapshot() == other.snapshot()
    sim.restore(snapshot)
    take()
    sim.run(60 * s)
    assert take() == first and sim.snapshot() == other.snapshot()


def test_a_tumbling_antenna_fades():
    sim = passing(axis_B=[0, 0, 1], beam=60 * deg, down_required_dB=18)
    radio, craft = sim.world.radio, ground.connect(sim)
    sim.world.craft.omega_BN_B = [0.2, 0.05, 0] * rad / s
    craft.command("telemetry", "flight.hill.reference", every=2)
    log = sim.record(radio.down, radio.down_traffic, every=1 * s)
    sim.run(11 * minute)
    seen = log["down.elevation"] > 5.1 * np.pi / 180
    lock = log["down.lock"][seen] == 1
    assert 0.1 < lock.mean() < 0.7 and np.abs(np.diff(lock.astype(int))).sum() > 10
    assert log["down.gain_dB"][seen].min() == -30 and log["down.gain_dB"][seen].max() > -3
    assert (log["down.state"][seen][~lock] == 4).all()
    got = np.diff(log["down_traffic.received"].astype(int))[seen[1:]]
    assert abs(got.sum() - lock.sum()) <= 2


def test_what_is_no_radio_of_flight_is_refused():
    sim = passing()
    with pytest.raises(SetupError, match="world.station carries no packets of flight: give a model that serves it"):
        ground.connect(sim, radio=sim.world.station)
    sim = passing(serves="other")
    assert sim.world.radio.serves == "other"
    with pytest.raises(SetupError, match="world.radio carries no packets of flight"):
        ground.connect(sim, radio=sim.world.radio)
    sim = passing(beam=1 * deg, serves=sim.flight, sun=world.SUN.at([1.5e11, 0, 0]))
    with pytest.raises(SetupError, match="world.radio.sun: give station_beam, station_noise and sun_brightness"):
        sim.run(1 * s)


# --- in the solar system ---------------------------------------------------------------------------

def at_mars(sky, orbit, every, **changes):
    sim = Simulation("at_mars")
    w = sim.world
    w.craft = world.Spacecraft(mass=10 * kg, I_B=[1, 1, 1] * kg * m**2, gravity=[world.MARS], sky=sky, orbit=orbit)
    w.station = world.GroundStation(body=world.EARTH, latitude=-35.4 * deg, longitude=148.98 * deg, altitude=690 * m,
                                    mask=10 * deg, sky=sky)
    w.radio = world.Radio(station=w.station, sky=sky, **X_BAND | changes)
    w.connect(w.craft.state >> [w.station.truth, w.radio.truth])
    w.task("world", every=every, run=[w.craft, w.station, w.radio])
    return sim


def test_elevation_occultation_and_light_time_are_those_of_other_libraries():
    erfa, SPK = module("erfa"), module("jplephem.spk").SPK
    kernel, eop = DATA / "de430-2015-03-02.bsp", DATA / "eopc04-2000-2020.txt"
    if not kernel.exists() or not eop.exists():
        pytest.skip(f"not here: {kernel}, {eop}")
    sky = world.Sky("2015-03-02T02:00:00", center=world.MARS, kernels=[str(kernel)],
                    earth=world.EarthOrientation(str(eop)))
    sim = at_mars(sky, Orbit(world.MARS, a=4000 * km, e=0.1, i=70 * deg), 30 * s, shadows=[world.MARS, world.MOON])
    log = sim.record(sim.world.craft.state, sim.world.radio.down, sim.world.radio.up, every=30 * s)
    sim.run(16 * 3600 * s)

    spk = SPK.open(str(kernel))
    segments = {(segment.center, segment.target): segment for segment in spk.segments}

    def place(body, jd, day):
        """[m] from the barycentre of the solar system."""
        if body == 0:
            return np.zeros(3)
        center = next(c for c, target in segments if target == body)
        return 1e3 * segments[center, body].compute(jd, day) + place(center, jd, day)

    mars = 499 if any(target == 499 for _, target in segments) else 4
    days = {int(line.split()[3]): [float(x) for x in line.split()[4:7]] for line in eop.read_text().splitlines()
            if len(line.split()) > 10 and line.split()[0].isdigit()}
    lat, lon = np.radians([-35.4, 148.98])
    r_ITRS, up_ITRS = erfa.gd2gc(1, lon, lat, 690.0), np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon),
                                                                np.sin(lat)])
    jd0, tdb0 = 2457083.5, 2 / 24 + 67.184 / 86400      # 2 March 2015; TDB is TT but for 2 ms

    def station(t):
        """(place from the barycentre, zenith) at t [s] of the run."""
        utc = 2 / 24 + t / 86400
        a, b = days[57083], days[57084]
        x, y, dut1 = (p + utc * (q - p) for p, q in zip(a, b))
        c2t = erfa.c2t06a(jd0, tdb0 + t / 86400, jd0, utc + dut1 / 86400, *np.radians(np.array([x, y]) / 3600))
        return place(399, jd0, tdb0 + t / 86400) + c2t.T @ r_ITRS, c2t.T @ up_ITRS

    states = set()
    for k in range(0, len(log.time), 16):
        t = log.time[k]
        here = place(mars, jd0, tdb0 + t / 86400) + log["state.r_BN_N"][k]
        for name, sense in (("down", 1), ("up", -1)):
            tau = 0.0
            for _ in range(5):
                there, zenith = station(t + sense * tau)
                tau = np.linalg.norm(there - here) / C
            way = (there - here) / np.linalg.norm(there - here)
            elevation = np.arcsin(-way @ zenith)
            off = np.linalg.norm(np.cross(log["state.r_BN_N"][k], way))
            behind = log["state.r_BN_N"][k] @ way < 0 and off < world.MARS.radius
            assert log[f"{name}.light_time"][k] == pytest.approx(tau, abs=2e-7)
            assert log[f"{name}.elevation"][k] == pytest.approx(elevation, abs=2e-7)
            if abs(elevation - np.radians(10)) > 1e-6 and abs(off - world.MARS.radius) > 2e3:
                states.add(state := 2 if elevation < np.radians(10) else 3 if behind else 1)
                assert log[f"{name}.state"][k] == state, t
    assert states == {1, 2, 3}


@needs_de405
def test_near_conjunction_the_sun_raises_the_noise_and_hides_the_craft():
    """On 18 November 2023 Mars passed behind the Sun."""
    sky = world.Sky("2023-11-13T00:00:00", center=world.MARS)
    sim = at_mars(sky, Orbit(world.MARS, a=100e3 * km), 900 * s, sun=world.SUN, shadows=[world.SUN],
                  station_beam=0.5 * deg, station_noise=30 * K, sun_brightness=23e3 * K, down_rate=1e5 / s,
                  down_required_dB=12, down_code="BLOCK")
    sim.world.station.mask = 10 * deg
    log = sim.record(sim.world.radio.down, every=900 * s)
    sim.run(10 * 86400 * s)
    angle, noise, state = np.degrees(log["sun_angle"]), log["noise_dB"], log["down.state"]
    assert 0.05 < angle.min() < 0.2 and 4 < log.time[angle.argmin()] / 86400 < 6.5
    assert noise[angle > 1.2].max() < 0.2 and noise.max() > 25
    over = log["elevation"] > np.radians(10)
    assert {int(x) for x in state[over]} == {1, 3, 4} and (state[~over] == 2).all()
    assert (angle[over & (state == 3)] < 0.28).all() and (angle[over & (state == 1)] > 0.5).all()
