# SPDX-License-Identifier: Apache-2.0
"""Commands and telemetry as packets: what Python makes and reads, byte by byte, and on the desktop's C."""
import binascii
import struct
from dataclasses import replace

import pytest

import fledge
from fledge import export, objects
from fledge.commands import (Block, Code, Dictionary, Field, Kind, Packets, Reason, Report, Stage, Text, decoded,
                             encoded, moved, read_script, script, values)
from fledge.errors import SetupError
from fledge.export.run_test import FLIGHT, WORLD
from fledge.units import N, kg, m, s


def by_hand(code, rest=b"", sequence=0, stream=0x1880):
    """A command, put together without the module under test."""
    head = struct.pack(">HHHBB", stream, 0xC000 + sequence, len(rest) + 1, code, 0)
    checksum = 0xFF
    for byte in head + rest:
        checksum ^= byte
    return head[:7] + bytes([checksum]) + rest


@pytest.fixture
def mission(tmp_path):
    (tmp_path / "flight.py").write_text(FLIGHT)
    (tmp_path / "world.py").write_text(WORLD)
    return fledge.load(tmp_path)


def test_packets_are_those_of_the_header(mission):
    dictionary = mission.flight.commands.dictionary
    packets, version = Packets(dictionary), dictionary.version.to_bytes(2, "big")
    modules = [name for name, instance in mission.flight.instances.items()
               if any(f.group == "par" for f in objects.struct(instance).fields)]
    control = modules.index("control").to_bytes(2, "big")
    wheels = modules.index("wheels").to_bytes(2, "big")
    place = {f.name: f.offset - objects.struct(mission.flight.control).fields[0].offset
             for f in objects.struct(mission.flight.control).fields if f.group == "par"}
    first = min(place.values())
    for built, expected in (
            (packets.noop(), (0, b"")), (packets.reset_counters(), (1, b"")),
            (packets.mode("rest"), (2, version + b"\0\2")),
            (packets.write("flight.control", K=2.0, P=[[1, 0, 0], [0, 2, 0], [0, 0, 3]])[0],
             (3, version + control + struct.pack(">I10d", place["K"] - first, 2, 1, 0, 0, 0, 2, 0, 0, 0, 3))),
            (packets.publish("flight.wheels"), (6, version + wheels)), (packets.reset(), (7, version)),
            (packets.arm("late"), (8, version + b"\0\2\0\1")), (packets.arm("wide", False), (8, version + b"\0\4\0\0")),
            (packets.read("flight.control", "K")[0], (9, version +
             control + struct.pack(">IH", place["K"] - first, 8))),
            (packets.telemetry(), (10, version + b"\xFF\xFF\0\1\0\1")),
            (packets.telemetry("flight.vehicle.vehicle", False, 7), (10, version + b"\0\0\0\0\0\7"))):
        assert built == by_hand(*expected, sequence=built[3])
    code = bytes(range(256)) * 3
    first, second, start = packets.procedure(code, turns=70000, slot=1)
    assert first == by_hand(11, version + struct.pack(">HI", 1, 0) + code[:512], first[3])
    assert second == by_hand(11, version + struct.pack(">HI", 1, 512) + code[512:], first[3] + 1)
    assert start == by_hand(12, version + struct.pack(">HIHI", 1, 768,
                            binascii.crc_hqx(code, 0xFFFF), 70000), first[3] + 2)
    assert packets.stop(1) == by_hand(13, version + b"\0\1", start[3] + 1)
    assert packets.evaluate("f.K", 9) == by_hand(14, version + b"\0\0\0\0\0\x09f.K", start[3] + 2)
    for wrong, text in ((lambda: packets.procedure(b""), "1 to 2048 bytes of bytecode; found 0"),
                        (lambda: packets.procedure(bytes(2049)), "found 2049"),
                        (lambda: packets.evaluate("x" * 513), "1 to 512 bytes; found 513")):
        with pytest.raises(SetupError, match=text):
            wrong()
    two = packets.write("flight.control", K=2.0, u_I_max=1.0)       # other fields are between them
    assert [command[6] for command in two] == [3, 3] and [
        struct.unpack(">d", command[16:])[0] for command in two] == [2, 1]


def test_the_live_dictionary_is_that_of_the_export(mission, tmp_path):
    live = mission.flight.commands.dictionary
    for sim in (mission, fledge.load("nadir_spin"), fledge.load("asterisk_scan")):
        exported = export.read(sim)
        assert export.dictionary(exported).version == sim.flight.commands.dictionary.version
        file = tmp_path / "packets.json"
        file.write_text(export.emit_commands(exported)[f"{exported.name}_packets.json"])
        read = Dictionary.load(file)
        assert read == export.dictionary(exported)
    file.write_text(file.read_text().replace('"unit": "N m"', '"unit": "N"', 1))
    with pytest.raises(SetupError, match="its version is .* but that of its lists"):
        Dictionary.load(file)
    mission.flight.control.K = 7                    # values are not of the dictionary
    assert fledge.load(mission.mission.folder).flight.commands.dictionary == live


def test_the_version_changes_with_names_and_layouts(tmp_path):
    versions = set()
    for change in (("", ""), ('"settled"', '"calm"'), ('"rest"', '"idle"'), ("f.switch ", "f.turn "),
                   ("f.spin     = fsw.InertialSpin(omega_RR0_R0=[0.001, 0, 0])", "f.spin = fsw.EulerRotation()")):
        text = FLIGHT.replace(*change).replace("f.rest)", "'idle')" if change[0] == '"rest"' else "f.rest)")
        text = text.replace("f.switch", "f.turn") if change[0] == "f.switch " else text
        folder = tmp_path / str(len(versions))
        folder.mkdir()
        (folder / "flight.py").write_text(text)
        (folder / "world.py").write_text(WORLD)
        versions.add(fledge.load(folder).flight.commands.dictionary.version)
    assert len(versions) == 5


# --- the desktop's process -------------------------------------------------------------------------

def test_commands_do_what_the_attributes_do(mission):
    sim, other = mission, mission.clone()
    f, g = sim.flight, other.flight
    for twin in (sim, other):
        twin.run(5 * s)
    f.commands.mode("rest")
    f.commands.write(f.control, K=3 * N * m)
    f.commands.write("vehicle", I_B=[700, 700, 801] * kg * m**2)
    f.commands.write("flight.switch", rates=[0, 0, 0.01])
    f.commands.arm(f.wide, False)
    assert f.control.K == 2.5 and f.active_mode == "wait" and f.wide.armed       # until the next instant
    g.enter("rest")
    g.control.K, g.vehicle.I_B, g.switch.rates, g.late.armed = 3, [700, 700, 801], [0, 0, 0.01], False
    for twin in (sim, other):
        twin.run(2 * s)
    assert f.control.K == 3 and f.active_mode == "rest" and not f.wide.armed
    for name, twin in f.instances.items():
        assert objects.memory(twin) == objects.memory(g.instances[name]), name
    assert objects.memory(sim.world.craft) == objects.memory(other.world.craft)
    assert f.vehicle.vehicle.head.t == 5_100_000_000                              # track is every 0.1 s
    assert f.commands.counters[:3] == (5, 5, 0)


def test_a_reset_restarts_flight_alone(mission):
    mission.run(30 * s)
    f = mission.flight
    assert f.active_mode != "wait" and f.start.fired_at
    attitude = objects.memory(mission.world.craft)
    f.commands.reset()
    mission.run(0.1 * s)
    assert f.active_mode == "wait" and f.start.fired_at is None and f.start.armed
    assert objects.memory(mission.world.craft) != attitude and mission.time == pytest.approx(30.1)
    assert f.wheels.wheels.head.sequence == 1 and f.wheels.wheels.head.t == 30_100_000_000
    assert f.control.torque.head.sequence == 0                                   # not in this mode
    mission.run(10 * s)
    assert f.spin.reference.head.t == 39_900_000_000                             # on its grid of 0.7 s


@pytest.mark.parametrize("packet, reason", [
    (b"", Reason.LENGTH), (by_hand(2, b"\0\0\0\1")[:-1], Reason.LENGTH), (by_hand(0, b"\0"), Reason.LENGTH),
    (by_hand(0)[:7] + b"\0", Reason.CHECKSUM), (by_hand(0, stream=0x1881),
                                                Reason.STREAM), (by_hand(99), Reason.UNKNOWN),
    (by_hand(2, b"\0\0\0\1"), Reason.VERSION)])
def test_a_wrong_packet_is_reported_and_counted(mission, packet, reason):
    mission.run(2 * s)
    before = mission.snapshot()
    report, = mission.flight.commands.send(packet)
    assert report.reason == reason and not report.executed and not report.good
    assert mission.flight.commands.counters == (0, 0, 1, {reason: 1})
    other = mission.clone()
    mission.run(5 * s)
    other.restore(before)
    other.run(5 * s)
    for name, instance in mission.flight.instances.items():
        assert objects.memory(instance) == objects.memory(other.flight.instances[name])


@pytest.mark.parametrize("axis, good", [([0, 0, 2], True), ([0, 0, 0], False)])
def test_a_vector_that_must_have_a_length_may_have_zeros(axis, good):
    sim = fledge.load("sun_safe")
    c = sim.flight.commands
    c.send(c.packets.write("flight.safe", axis_B=axis)[0])
    sim.run(1 * s)
    assert [r.reason for r in c.reports if not r.good] == ([] if good else [Reason.RULE])
    assert list(sim.flight.safe.axis_B) == (axis if good else [1, 0, 0])


def test_refusals_of_what_was_accepted(mission):
    c = mission.flight.commands
    version = c.dictionary.version
    control = c.dictionary.block("flight.control")[0]
    mission.run(2 * s)
    with pytest.raises(SetupError, match="flight has no mode 'nap'; it has wait, point, rest"):
        c.mode("nap")
    assert c.send(c.packets.packet(Code.MODE, b"\0\3"))[0].reason == Reason.PLACE
    c.send(c.packets.write("flight.control", K=-2.0)[0])
    c.load(mission.flight.control, mission.flight.control)      # staged, and committed
    c.send(c.packets.packet(Code.STAGE, struct.pack(">HI8s", control, 0, bytes(8))))
    c.reset()                                                   # forgets it
    c.send(c.packets.packet(Code.COMMIT, struct.pack(">HH", control, 0)))
    c.send(c.packets.packet(Code.MODE, b"\0\1", version ^ 1))
    mission.run(1 * s)
    refusals = [(Code(r.code).name, r.reason) for r in c.reports if not r.good]
    assert refusals == [("MODE", Reason.PLACE), ("MODE", Reason.VERSION), ("WRITE", Reason.RULE),
                        ("COMMIT", Reason.NOT_STAGED)]
    rule = next(r for r in c.reports if r.reason == Reason.RULE)
    assert c.dictionary.block("flight.control")[1].rules[rule.detail].name == "K"
    assert mission.flight.control.K == 2.5


def test_a_command_that_comes_again_is_refused_and_a_clone_counts_on(mission):
    c = mission.flight.commands
    packet = c.packets.write("flight.control", K=3.0)[0]
    assert c.send(packet)[0].good
    mission.run(2 * s)
    mission.flight.control.K = 2.5
    again, = c.send(packet)
    assert again.reason == Reason.SEQUENCE and again.detail == again.sequence == 0
    assert repr(again) == "<write 0 refused: sequence, the last was 0, t = 2 s>"
    mission.run(2 * s)
    assert mission.flight.control.K == 2.5 and c.counters.executed == 1
    before, other = mission.snapshot(), mission.clone()
    for commands in (c, c, other.flight.commands):                   # the clone's commands have made no packet yet
        assert commands.mode("rest")[0].good
    other.run(1 * s)
    assert other.flight.active_mode == "rest"
    new = fledge.load(mission.mission.folder)
    new.restore(before)
    assert new.flight.commands.write("control", K=4)[0].good and new.flight.commands.noop()[0].sequence == 2
    mission.reset()
    assert c.send(packet)[0].good                               # flight begins anew, and with it the link


def test_the_sequence_of_a_packet_moves_with_its_checksum():
    packet = by_hand(2, b"\0\1\0\2", sequence=16382)
    assert moved(packet, 5) == by_hand(2, b"\0\1\0\2", sequence=3) and moved(packet, 0) == packet
    assert moved(by_hand(2, sequence=1), -2) == by_hand(2, sequence=0x3FFF)
    wrong = packet[:7] + bytes([packet[7] ^ 4]) + packet[8:]
    right = by_hand(2, b"\0\1\0\2", sequence=3)
    assert moved(wrong, 5) == right[:7] + bytes([right[7] ^ 4]) + right[8:]
    assert moved(b"nonsens", 3) == b"nonsens"


def test_a_full_queue_is_reported_and_survived(mission):
    c = mission.flight.commands
    mission.run(1 * s)
    reasons = [c.noop()[0].reason for _ in range(c.dictionary.room // 8 + 2)]
    assert reasons[:-2] == [Reason.OK] * (len(reasons) - 2) and reasons[-2:] == [Reason.BUSY] * 2
    mission.run(1 * s)
    assert c.counters.executed == len(reasons) - 2 and c.noop()[0].good


def test_snapshots_and_clones_keep_commands_that_wait(mission):
    f = mission.flight
    mission.run(3 * s)
    plain = mission.snapshot()
    f.commands.write("control", K=3)
    f.vehicle.I_B = [700, 700, 801]
    waiting, other, fresh = mission.snapshot(), mission.clone(), fledge.load(mission.mission.folder)
    mission.run(5 * s)
    end = mission.snapshot()
    assert other.flight.commands.counters.accepted == 1
    other.run(5 * s)
    fresh.restore(waiting)
    fresh.run(5 * s)
    assert other.snapshot() == end and fresh.snapshot() == end
    mission.restore(plain)
    mission.run(5 * s)
    assert f.control.K == 2.5 and mission.snapshot() != end


def test_what_is_read_back_is_what_was_written(mission):
    c = mission.flight.commands
    c.write("control", K=3, P=[[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    c.read("control")
    mission.run(1 * s)
    block = c.dictionary.block("flight.control")[1]
    parameters = values(block.fields, c.reports[-1].data)
    assert parameters["K"] == 3 and parameters["P"] == [
        [1, 2, 3], [4, 5, 6], [7, 8, 9]] and parameters["u_I_max"] == 0.1


# --- values and telemetry --------------------------------------------------------------------------

FIELDS = [Field("a", "f64", 0, 16, [2], "m", ""), Field("e", "enum", 16, 4, [], "", "", {"LOW": -1, "HIGH": 4}),
          Field("t", "char", 20, 4, [4], "", ""),
          Field("s", "struct", 24, 16, [2], "", "", {}, [Field("u", "u16", 0, 4, [2], "", ""),
                                                         Field("i", "i32", 4, 4, [], "", "")])]


def test_any_value_is_encoded_and_decoded():
    given = {"a": [1.5, -2.0], "e": "HIGH", "t": "ab", "s": [{"u": [1, 65535], "i": -7}, {"u": [2, 3], "i": 8}]}
    raw = b"".join(encoded(f, given[f.name]) for f in FIELDS)
    assert raw == struct.pack(">2di4s", 1.5, -2, 4, b"ab") + struct.pack(">HHiHHi", 1, 65535, -7, 2, 3, 8)
    assert values(FIELDS, raw) == given


def test_an_enumerator_is_encoded_and_compared_by_its_short_and_its_whole_name():
    level = Field("e", "enum", 0, 4, [], "", "", {"LEVEL_LOW": -1, "LEVEL_HIGH": 4})
    assert encoded(level, "HIGH") == encoded(level, "LEVEL_HIGH") == struct.pack(">i", 4)
    label = values([level], struct.pack(">i", 4))["e"]
    assert label == "HIGH" and label == "LEVEL_HIGH" and label != "LOW" and label != 4 and {label: 1}["LEVEL_HIGH"]
    with pytest.raises(SetupError, match="e has no enumerator 'HIHG'; did you mean 'HIGH'. it has LOW, HIGH"):
        encoded(level, "HIHG")


@pytest.mark.parametrize("field, value, complaint", [
    (0, [1.0], "a has the shape"), (0, 3.0, "a has the shape"), (1, "MIDDLE", "e has no enumerator 'MIDDLE'"),
    (2, "abcde", "t has room for 4 bytes"), (3, [{"u": [1, 2]}, {"u": [1, 2], "i": 1}], "s: give i too"),
    (3, [{"u": [1, 70000], "i": 1}] * 2, "u is a uint16_t")])
def test_a_value_that_does_not_fit_is_refused(field, value, complaint):
    with pytest.raises(SetupError, match=complaint):
        encoded(FIELDS[field], value)


def test_long_parts_of_a_block_are_cut_between_numbers():
    fields = [Field("n", "u32", 0, 4, [], "-", ""), Field("k", "u32", 4, 4, [], "-", ""),
              Field("table", "f64", 8, 1600, [200], "-", "")]
    block = Block("flight.part", "Part", 1608, False, fields, [(4, 2), (8, 200)], [])
    packets = Packets(Dictionary("cut", 0x1880, 0x0880, [], [], [block], []))
    written = packets.write("flight.part", k=7, table=[float(i) for i in range(200)])
    places = [(int.from_bytes(packet[12:16], "big"), len(packet) - 16) for packet in written]
    reads = [(int.from_bytes(packet[12:16], "big"), int.from_bytes(packet[16:18], "big"))
             for packet in packets.read("flight.part", "table")]
    for parts, begin in ((places, 4), (reads, 8)):
        assert parts[0][0] == begin and sum(n for _, n in parts) == 1608 - begin and len(parts) == 4
        assert all(at in (4, 8) or at % 8 == 0 for at, _ in parts) and max(n for _, n in parts) <= 512
    data = b"".join(packet[16:] for packet in written)
    assert data == struct.pack(">I200d", 7, *range(200))


def test_a_command_tells_which_parameters_it_writes_also_in_part():
    packets = Packets(Dictionary("d", 0x1880, 0x0880, [], [], [Block("flight.part", "Part", 40, False, FIELDS, [], [])],
                                 []))
    for at, n, paths in ((0, 40, "a e t s[0].u s[0].i s[1].u s[1].i"), (8, 8, "a"), (8, 12, "a e"),
                         (26, 6, "s[0].u s[0].i"), (36, 4, "s[1].i"), (40, 4, "")):
        packet, = packets.write_bytes("flight.part", {at: bytes(n)})
        assert packets.dictionary.written(packet) == [f"flight.part.{path}" for path in paths.split()]
        stage = packet[:6] + bytes([Code.STAGE]) + packet[7:]
        assert packets.dictionary.written(stage) == packets.dictionary.written(packet)
        for code in (Code.COMMIT, Code.TABLE_LOAD):     # of the whole module
            whole = packets.dictionary.written(packet[:6] + bytes([code]) + packet[7:])
            assert whole == [f"flight.part.{path}" for path in "a e t s[0].u s[0].i s[1].u s[1].i".split()]
        for other in (packet[:6] + bytes([Code.READ]) + packet[7:], packet[:8] + b"\0\0" + packet[10:],
                      b"\x18\x81" + packet[2:], packet[:10] + b"\0\1" + packet[12:]):
            assert packets.dictionary.written(other) == []


def test_a_script_is_read_as_it_was_written():
    lines = "-1 1880c000\n5000000000 00ff\n"
    assert script(read_script(lines)) == lines


def test_a_packet_that_is_none_is_refused(mission):
    dictionary = mission.flight.commands.dictionary
    good = struct.pack(">HHHIH4x", 0x0881, 0xC000 + 3, 16 + 24 - 7, 7, 0x8000) + struct.pack(
        ">qHHHHHH4x", 5, 9, 2, 1, 8, 4, 0)
    telemetry = decoded(dictionary, good)
    assert telemetry[:3] == ("reports", 3, 7.5)
    assert telemetry.content == Report(5, 9, 2, Stage.DONE, Reason.RULE, 4, b"")
    for bad in (good[:-1], good[:10], b"\x08\xFF" + good[2:]):
        with pytest.raises(SetupError, match="packet"):
            decoded(dictionary, bad)


def test_texts_of_flight_are_read_in_both_byte_orders(mission):
    for mark, order in (("<", "little"), (">", "big")):
        dictionary = replace(mission.flight.commands.dictionary, order=order)
        body = struct.pack(mark + "qHHHHIi", 2_500_000_000, 4, 9, 12, 4, 3, 0) + b"over"
        packet = struct.pack(">HHHIH4x", dictionary.texts, 0xC005, 16 + len(body) - 7, 2, 0x8000) + body
        read = decoded(dictionary, packet)
        assert read[:3] == ("texts", 5, 2.5)
        assert read.content == Text(2_500_000_000, Kind.PROCEDURE_KILLED, 9, 12, "over", 3)
        assert repr(read.content) == "<procedure killed, line 12: 'over', t = 2.5 s>"


def test_the_desktop_runs_only_procedures_whose_source_it_knows(mission):
    commands = mission.flight.commands
    for packet in (*commands.packets.procedure(b"bytecode"), commands.packets.stop(), commands.packets.evaluate("1")):
        commands.send(packet)
    mission.run(1 * s)
    assert [r.reason for r in commands.reports if not r.good] == [Reason.ABSENT, Reason.BYTECODE, Reason.RUNNING]


PROCEDURE = """
from fledge.units import N, m, s

def main(f):
    print("mode", f.active_mode)
    f.enter("rest")
    yield wait(2 * s)
    f.control.K = 3 * N * m
    f.vehicle.I_B = [700, 700, 801]
    yield
    print(f.control.K, f.active_mode)
"""


def test_a_procedure_on_the_desktop(mission):
    commands, f = mission.flight.commands, mission.flight
    commands.procedure(b"1", PROCEDURE, "check.py")
    mission.run(1 * s)
    assert f.active_mode == "rest" and f.control.K == 2.5
    mission.run(2 * s)
    assert f.control.K == 3 and f.vehicle.vehicle.I_B[2, 2] == 801 and f.vehicle.vehicle.head.t == 2_000_000_000
    assert [(text.kind, text.text) for text in commands.texts] == [
        (Kind.PROCEDURE_STARTED, ""), (Kind.PRINTED, "mode wait"), (Kind.PRINTED, "3.0 wait"),
        (Kind.PROCEDURE_ENDED, "")]
    assert commands.counters.executed == 2 + 3      # of the procedure: a mode, and parameters of two modules


@pytest.mark.parametrize("body, text, line", [
    ("1 / 0", "ZeroDivisionError: division by zero", 4),
    ("f.control.K = -1.0", "SetupError: flight.control.K must be > 0 N m, found -1", 4),
    ("f.control.error.sigma_BR[0] = 1", "ValueError: assignment destination is read-only", 4),
    ("f.control.newest = 1", "flight.control.newest is no parameter: a procedure cannot set it", 0),
    ("f.spin = 3", "SetupError: flight.spin cannot be set here; set parameters, as in f.control.K = 3", 4),
    ("f.enter('x')", "SetupError: ", 4), ("yield 3", "SetupError: a procedure yields nothing, or wait(time)", 0)])
def test_a_procedure_that_goes_wrong_on_the_desktop_changes_nothing(mission, body, text, line):
    commands = mission.flight.commands
    commands.procedure(b"2", f"def main(f):\n    yield\n    f.control.u_I_max = 2\n    {body}\n    yield\n", "check.py")
    mission.run(2 * s)
    started, killed = commands.texts
    assert started.kind == Kind.PROCEDURE_STARTED and killed.kind == Kind.PROCEDURE_KILLED
    assert text in killed.text and killed.line == line
    assert mission.flight.control.u_I_max == 0.1


def test_a_procedure_on_the_desktop_is_stopped(mission):
    commands = mission.flight.commands
    for stop in (commands.stop_procedure, commands.reset):
        commands.procedure(b"3", "def main(f):\n    while True:\n        yield\n", "check.py")
        mission.run(2 * s)
        stop()
        mission.run(2 * s)
    assert [text.text for text in commands.texts] == ["", "by command", "", "flight begins anew"]
    assert commands.counters.refused == 0
