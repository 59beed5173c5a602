# SPDX-License-Identifier: Apache-2.0
"""Scripts of the ground over frames, to flight on the desktop; the frames of others; what is refused."""
import binascii
import os
import random
import struct
from dataclasses import replace

import pytest

import fledge
from fledge import _ground, cli, flight as fsw, ground
from fledge.commands import Dictionary, Reason
from fledge.errors import SetupError
from fledge.export import emit_commands, read, write
from fledge.export.run_test import FLIGHT, WORLD
from fledge.frames import Frames
from fledge.ground.scripts import radio_test
from fledge.ground.scripts.address import link_of, open_link
from fledge.targets import reset_test
from fledge.units import minute, s
from tests.needs import skip_unless_on

LINK = """
    f.link = fsw.SpaceLink(spacecraft=68{more})
    f.task("link", every=500 * ms, run=[f.link])
"""
FULL = ", command_channel=1, cop1=1, cltu=1, segments=1, idle=2"


@pytest.fixture
def load(tmp_path):
    def mission(more=FULL, flight=FLIGHT):
        folder = tmp_path / "plays"
        folder.mkdir(exist_ok=True)
        (folder / "flight.py").write_text(flight + LINK.format(more=more))
        (folder / "world.py").write_text(WORLD)
        return fledge.load(folder)

    return mission


def test_a_command_is_confirmed_by_the_link_and_executed(load):
    sim = load()
    with ground.connect(sim) as craft:
        assert isinstance(craft.link, ground.Framed)
        sent = craft.command("write", "flight.control", K=3.0)
        assert sent.delivered(within=3 * s).arrived == sent.packets and sim.flight.control.K == 3
        assert sent.completed(within=1 * s)
        craft.command("telemetry").completed()
        state = craft.wait(lambda t: t["flight.link.state.packets"] == 2, within=5 * s)["flight.link.state"]
        assert state["accepted"] == 3 and state["next"] == 2 and not any(state["faults"])     # one asks for the CLCW
        assert craft.missed == craft.refused == 0 and craft.link.counts["missing"] == 0
        assert craft.link.cop1 == {"state": "active", "ended": "", **dict.fromkeys(
            ("no_rf", "no_bit_lock", "lockout", "wait", "retransmit"), False)}
        with pytest.raises(ground.NoAnswer, match="refused write flight.control.K"):
            craft.command("write", "flight.control", K=-1.0).completed()


def test_what_never_arrives_is_given_up(load):
    craft = ground.connect(load())
    craft.command("noop").completed()
    link = craft.link.link
    craft.link = ground.Framed(link, craft.dictionary.frames, timer=1, limit=3)
    craft.command("noop").delivered()
    lost, link.send = link.send, lambda unit: None
    with pytest.raises(ground.NoAnswer, match="the link gave <noop: sent> up after its last transmission"):
        craft.command("noop").completed(within=10 * s)
    assert (craft.link.cop1["state"], craft.link.cop1["ended"]) == ("initial", "no confirmation of a frame came")
    link.send = lost
    assert craft.command("noop").completed(within=20 * s)


def test_flight_takes_the_frames_of_others_and_its_own_ground_makes_the_same(load):
    """Those that F Prime's ground system sends: expedited, number 0, without segments and CLTU."""
    sim = load(", command_channel=1, telemetry_channel=1")
    commands = sim.flight.commands
    commands.take_units()
    packet = commands.packets.noop()
    body = bytes.fromhex("2044040e00") + packet
    unit = body + binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "big")
    assert commands.dictionary.frames == Frames() and Frames().command(packet) == unit
    commands.send_unit(unit)
    sim.run(1 * s)
    assert commands.counters.executed == 1
    frames = commands.take_units()
    assert frames and all(len(frame.packet) == 1024 and frame.packet[:2] == b"\x04\x42" for frame in frames)
    commands.send_unit(packet)      # no frame
    sim.run(1 * s)
    assert commands.counters.executed == 1 and sum(sim.flight.link.state.faults) == 1


def test_both_makers_of_frames_agree():
    chance = random.Random(3)
    for _ in range(60):
        segments = chance.randrange(2)
        frames = Frames(chance.randrange(1024), chance.randrange(64), cltu=chance.randrange(2), segments=segments,
                        map=chance.randrange(64) * segments, tc_random=chance.randrange(2))
        end = _ground.SpaceLink(frames.options, 1, 1)
        packet = bytes.fromhex("1880c000") + chance.randbytes(chance.randrange(3, 900))
        assert end.send(1, packet) and end.units() == [frames.command(packet)]
        assert end.answers() == [(1, True)]
    with pytest.raises(SetupError, match="at most 1024 bytes; this packet's has 1107"):
        Frames().command(bytes(1100))
    with pytest.raises(ValueError, match="1018 bytes does not fit into a frame"):
        _ground.SpaceLink(Frames().options, 1, 1).send(1, bytes(1018))


def test_encapsulation_packets_of_others_are_counted_and_lose_nothing():
    frames = Frames(spacecraft=77, frame_size=64)
    end = _ground.SpaceLink(frames.options, 1, 1)
    packet = struct.pack(">3H", 5, 0xC000, 9) + bytes(10)
    for i, zone in enumerate((b"\xe9\x05abc\xe0" + packet + b"\xee\x12\0\x06zz\xe1\x1c".ljust(34, b"\0"),
                              b"\x40".ljust(56, b"x"), b"\xe0" * 40 + packet)):
        frame = struct.pack(">HBBH", 77 << 4 | 2, i, i, 3 << 11) + zone
        assert end.take(frame + struct.pack(">H", binascii.crc_hqx(frame, 0xFFFF))) == [packet] * (i != 1)
    counts = end.counts
    assert (counts["frames"], counts["missing"], counts["encapsulated"], counts["unread"]) == (3, 0, 2, 1)


def test_the_dictionary_says_which_frames_a_mission_speaks(load, tmp_path):
    sim = load()
    mission = read(sim)
    paths = write(mission, tmp_path / "out", emit_commands(mission))
    dictionary = Dictionary.load(next(path for path in paths if path.suffix == ".json"))
    assert dictionary.frames == Frames(68, 1, 0, cop1=1, cltu=1, segments=1) and dictionary.uplink == 1186
    assert dictionary.downlink == 1024
    opener = link_of("udp://127.0.0.1:1?listen=2&timer=2&limit=3", None, dictionary.frames)
    assert opener.__closure__
    there, here = 20123, 20124
    with open_link(f"udp://127.0.0.1:{here}?listen={there}", None, dictionary.frames) as link:
        assert isinstance(link, ground.Framed) and link.frames == dictionary.frames
    with open_link(f"udp://127.0.0.1:{here}?listen={there}&frames=68") as link:
        assert isinstance(link, ground.Framed) and link.frames == Frames()


@pytest.mark.parametrize("address, says", [
    ("udp://127.0.0.1:1?listen=2&frames=spacecraft:70000", "spacecraft is 70000; it is 0 to 1023"),
    ("udp://127.0.0.1:1?listen=2&frames=window:41", "window is 41; it is even"),
    ("udp://127.0.0.1:1?listen=2&frames=frame_size:10", "frame_size is 10; a frame has 19 to 2048 bytes"),
    ("udp://127.0.0.1:1?listen=2&frames=map:3", "a map needs segments=1"),
    ("udp://127.0.0.1:1?listen=2&frames=colour:3", "expected numbers, as in frames=spacecraft:68,cop1:1"),
    ("udp://127.0.0.1:1?listen=2&frames=68&timer=soon", "timer is a number of seconds"),
    ("udp://127.0.0.1:1?listen=2&timer=3", "there is no option timer"),
])
def test_wrong_frames_of_an_address_are_refused(address, says):
    with pytest.raises(SetupError, match=says):
        link_of(address)


def test_a_mission_with_an_impossible_link_is_refused(load):
    with pytest.raises(SetupError, match="window is 41; it is even"):
        ground.connect(load(", window=41"))


def test_a_clone_and_a_snapshot_go_on_with_the_same_frames(load):
    sim = load()
    craft = ground.connect(sim)
    craft.command("telemetry").completed()
    snapshot, other = sim.snapshot(), sim.clone()
    units = sim.flight.commands.take_units, other.flight.commands.take_units
    for unit in units:
        unit()
    sim.run(5 * s)
    other.run(5 * s)
    sent = units[0]()
    assert len(sent) > 8 and units[1]() == sent
    sim.restore(snapshot)
    sim.run(5 * s)
    assert units[0]() == sent and Reason.ROLE not in sim.flight.commands.counters.reasons


class Lossy(ground.Link):
    """Loses 20 % of the units both ways, and now and then replays any that it has heard."""

    def __init__(self, link):
        self.link, self.random, self.received = link, random.Random(2), ([], [])

    @property
    def t(self):
        return self.link.t

    def _passed(self, received, units):
        for unit in units:
            received.append(unit)
            if self.random.random() > 0.2:
                yield unit
            if self.random.random() < 0.3:
                yield self.random.choice(received)

    def send(self, unit):
        for passed in self._passed(self.received[0], [unit]):
            self.link.send(passed)

    def receive(self, until):
        return list(self._passed(self.received[1], self.link.receive(until)))


class Forging(Lossy):
    """Beside each unit of telemetry come forged ones: of before, or changed, with a CRC that holds again; but for the
    pointer to the first packet, which is under no code of the standard."""

    forged = 3

    def receive(self, until):
        units = []
        for unit in self.link.receive(until):
            self.received[1].append(unit)
            for _ in range(self.forged):
                old = bytearray(self.random.choice(self.received[1]).packet)
                for _ in range(self.random.randrange(3)):
                    place = self.random.choice([self.random.randrange(6, len(old)), self.random.randrange(4),
                                                len(old) - 3 - self.random.randrange(4)])
                    old[place] ^= 1 << self.random.randrange(8)
                if self.random.random() < 0.8:
                    old[-2:] = binascii.crc_hqx(bytes(old[:-2]), 0xFFFF).to_bytes(2, "big")
                units.append(unit._replace(packet=bytes(old)))
            units.append(unit)
        return units


@pytest.mark.parametrize("seed", range(int(os.environ.get("FLEDGE_CASES", "2"))))
def test_no_forged_frame_is_authentic_and_commands_go_on(secured, seed):
    """FLEDGE_CASES: how many seeds. Nor is the CLCW: its lies cost commands, as long as they last."""
    sim = secured()
    craft = ground.connect(sim, sequence=1)
    taken, take = set(), craft.take
    forging = craft.link.link = Forging(craft.link.link)
    forging.random = random.Random(seed)
    craft.take = lambda packet: (taken.add(packet), take(packet))[1]
    for i in range(8):
        craft.command("write", "flight.loads", clear_after=(i + 1) * s)
        craft.listen(4 * s)
    forging.forged = 0
    craft.listen(30 * s)
    craft.command("noop").completed(within=60 * s)
    order = [report.sequence for report in sim.flight.commands.reports if report.executed == 1 and report.good]
    assert order == sorted(set(order)) and len(order) >= 2
    counts = craft.link.counts
    assert counts["tag"] + counts["replay"] > 5
    alone = ground.Framed(forging.link, craft.dictionary.frames, sim.mission.folder / "link.keys")
    sent = {packet for unit in forging.received[1] for packet in alone._end.take(unit.packet)}
    assert taken and taken <= sent, "only what flight has sent"


SECURED = """
    f.link = fsw.SpaceLink(spacecraft=68, cop1={cop1}, cltu=1, secured=2, telemetry_key=1, idle=2,
                           roles=[{{"key": 1}}, {{"key": 2, "barred": 1 << 2 | 1 << 3}}, {{}}, {{}}])
    f.task("link", every=0.5 * s, run=[f.link])
"""


@pytest.fixture
def secured(tmp_path):
    def secure(at=(0,), cop1=1):
        folder = tmp_path / f"resets{cop1}"
        folder = reset_test.mission(folder, at, 3.0)
        file = folder / "flight.py"
        file.write_text(file.read_text() + SECURED.format(cop1=cop1))
        for _ in range(2):
            assert cli.main(["keys", "link", str(folder / "link.keys")]) == 0
        return fledge.load(folder)

    return secure


@pytest.mark.parametrize("cop1", [0, 1])
def test_resets_of_the_computer_let_nothing_old_pass_and_lock_no_ground_out(secured, cop1):
    """Over a link that loses and replays: each command is executed once and in order, or reported."""
    sim = secured([40.2, 90.0, 90.6], cop1)
    commands = sim.flight.commands
    craft = ground.connect(sim, sequence=1)
    link = craft.link.link = Lossy(craft.link.link)
    delivered, failed = [], 0
    while sim.time_ns < 140e9:
        sent = craft.command("write", "flight.loads", clear_after=len(craft.sent) * s)
        try:
            sent.delivered(within=15 * s) if cop1 else craft.listen(1 * s)
            delivered += sent.packets
        except ground.NoAnswer:
            failed += 1
        if len(craft.sent) % 10 == 0:                       # all that was heard comes once more
            for unit in list(link.received[0]):
                link.link.send(unit)
    assert len(sim.flight.outages) == 2 and len(craft.sent) > 40
    order = [report.sequence for report in commands.reports if report.executed == 1 and report.good]
    assert order == sorted(set(order)) and len(order) > 30, "once and in order, whatever came again"
    assert sim.flight.link.state.faults[13] > 50, "replays are counted"
    if cop1:
        assert failed < 12 and len(delivered) >= len(craft.sent) - failed
        assert craft.command("noop").delivered(within=60 * s)


def test_a_command_without_its_key_or_of_the_wrong_role_changes_nothing_and_is_counted(secured, tmp_path):
    sim = secured(cop1=0)
    assert [cli.main(["keys", "link", str(tmp_path / "other.keys")]) for _ in range(2)] == [0, 0]
    other = ground.connect(sim, role=1)
    other.command("noop").completed()
    with pytest.raises(ground.NoAnswer, match="whose key protected its frame may not give it"):
        other.command("write", "flight.loads", clear_after=9 * s).completed()
    craft, commands = ground.connect(sim, sequence=5), sim.flight.commands
    craft.command("write", "flight.loads", clear_after=4 * s).completed()
    with pytest.raises(ground.NoAnswer, match="initial value"):     # no role gives itself more
        craft.send(craft._packets.write("flight.link", roles=[{"key": 1, "barred": 0, "spare": 0}] * 4)).completed()
    accepted = commands.counters.accepted
    frames = commands.dictionary.frames
    plain = replace(frames, secured=0, keys=()).command(commands.packets.write("flight.loads", clear_after=8)[0])
    before = sum(sim.flight.link.state.faults)
    commands.send_unit(plain)
    sim.run(1 * s)
    assert sum(sim.flight.link.state.faults) == before + 1
    thief = ground.connect(sim, keys=tmp_path / "other.keys")
    with pytest.raises(ground.NoAnswer, match="not reported"):
        thief.command("noop").completed(within=9 * s)
    assert thief.link.counts["tag"] > 0
    assert sim.flight.loads.clear_after == 4 * 10**9 and commands.counters.accepted == accepted
    assert commands.counters.reasons[Reason.ROLE] == 1
    assert craft.command("noop").completed()
    with pytest.raises(SetupError, match="role 2 has no key"):
        ground.connect(sim, role=2)


def test_frames_pass_by_a_radio_with_wrong_bits():
    """Which packets alone do not survive: all commands arrive, once and in order, and no wrong packet does."""
    sim = radio_test.passing(up_eirp_dBW=-8, down_eirp_dBW=-33)
    f, radio = sim.flight, sim.world.radio
    f.link = fsw.SpaceLink(spacecraft=9, frame_size=128, cop1=1, cltu=1, marker=1, idle=5 * s)
    f.task("link", every=0.5 * s, run=[f.link])
    sim.run(9 * minute)
    craft = ground.connect(sim, radio=radio)
    sent = [craft.command("noop") for _ in range(60)]
    for command in sent:
        command.delivered(within=2 * minute)
    done = [report.sequence for report in f.commands.reports if report.executed]
    assert done == sorted(set(done)) and len(done) == 60
    assert radio.up_traffic.damaged > 10 and radio.down_traffic.damaged > 10
    assert f.link.state.corrected > 10 and sum(f.link.state.faults) > 5 and craft.link.counts["crc"] > 5
    assert craft.refused == 0 and f.commands.counters.refused == 0


@pytest.mark.parametrize("target, cop1, says", [
    ("cfs", 0, "cfs: its bus carries packets; fly resets0 without its SpaceLink there"),
    ("leon3", 1, "leon3: there is no BearSSL for it, which has the cipher of a secured link")])
def test_what_a_target_cannot_frame_is_refused(secured, target, cop1, says, capsys, tmp_path):
    skip_unless_on(target)
    secured(cop1=cop1)
    assert cli.main(["fly", str(tmp_path / f"resets{cop1}"), "--for", "1s", "--on", target,
                     "--out", str(tmp_path / "out")]) != 0
    assert says in capsys.readouterr().err


def test_a_scenario_that_speaks_frames_is_not_flown_without_them(load, capsys, tmp_path):
    load()
    (tmp_path / "plays/scenarios.py").write_text(
        'from fledge import ground\n\n\ndef play(sim):\n    """Command."""\n'
        '    ground.connect(sim).command("noop").completed()\n')
    assert cli.main(["fly", str(tmp_path / "plays"), "play", "--on", "linux", "--out", str(tmp_path / "out")]) != 0
    assert "the scenario commands flight by frames, which no target gets from it" in capsys.readouterr().err
