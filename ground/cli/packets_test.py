# SPDX-License-Identifier: Apache-2.0
"""fledge packets: captures, frames and packets one behind the other, with damage between them."""
import binascii
import csv
import io
import json
import os
import random
import struct
import subprocess
from decimal import Decimal
from itertools import accumulate
from pathlib import Path

import pytest

from fledge.archive.archive_test import Maker
from fledge.cli import main
from fledge.errors import Failure
from fledge.ground.captures import Format, Joiner, Piece, encapsulated, header, pieces, read
from fledge.programs import without_preload
from tests.needs import needs

DATA = Path(os.environ.get("FLEDGE_TEST_DATA", Path(__file__).parents[3] / "shared" / "data"))
XTCE = """<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>
  <IntegerParameterType name='u16'><IntegerDataEncoding sizeInBits='16'/></IntegerParameterType>
  <FloatParameterType name='volt'><UnitSet><Unit>V</Unit></UnitSet><IntegerDataEncoding><DefaultCalibrator>
    <PolynomialCalibrator><Term exponent='1' coefficient='0.5'/></PolynomialCalibrator></DefaultCalibrator>
  </IntegerDataEncoding></FloatParameterType></ParameterTypeSet><ParameterSet>
  <Parameter name='id' parameterTypeRef='u16'/><Parameter name='count' parameterTypeRef='u16'/>
  <Parameter name='size' parameterTypeRef='u16'/><Parameter name='bus' parameterTypeRef='volt'/></ParameterSet>
  <ContainerSet><SequenceContainer name='P' abstract='true'><EntryList><ParameterRefEntry parameterRef='id'/>
    <ParameterRefEntry parameterRef='count'/><ParameterRefEntry parameterRef='size'/></EntryList></SequenceContainer>
  <SequenceContainer name='Q'><EntryList><ParameterRefEntry parameterRef='bus'/></EntryList>
    <BaseContainer containerRef='P'><RestrictionCriteria><Comparison parameterRef='id' value='5'/></RestrictionCriteria>
    </BaseContainer></SequenceContainer></ContainerSet></TelemetryMetaData></SpaceSystem>"""


def packet(count, content=b"\x14", application=5):
    return struct.pack(">3H", application, 0xC000 | count, len(content) - 1) + content


ALL = [packet(i, bytes([i + 1] * (1 + 3 * i))) for i in range(8)]


def parsed(data, **options):
    """(the packets, the places and texts of problems)"""
    all_ = list(pieces(data, Format(**options)))
    return [p.packet for p in all_ if p.packet], [(p.at, p.problem) for p in all_ if p.problem]


def test_packets_may_have_bytes_in_front_and_padding_behind():
    assert parsed(b"".join(ALL)) == (ALL, [])
    assert parsed(b"".join(b"mark" + packet for packet in ALL), skip=4) == (ALL, [])
    assert parsed(b"".join(packet + bytes(5) for packet in ALL)) == (ALL, [])
    assert parsed(b"") == ([], [])
    assert header(ALL[3]) == (False, False, 5, 3, 3, 16)


def test_reading_goes_on_behind_damage():
    assert parsed(ALL[0] + b"\xff" * 9 + b"".join(ALL[1:])) == (
        ALL, [(7, "9 bytes are no packet: a packet of 4294967295 bytes would begin there")])
    cut = b"".join(ALL)[:-1]
    assert parsed(cut) == (ALL[:-1], [
        (len(cut) - len(ALL[-1]) + 1, "27 bytes are no packet: a packet of 28 bytes would "
                                      "begin there")])
    notes = [piece.note for piece in pieces(ALL[0] + b"\x9a\0" + b"".join(ALL[1:]))]
    assert notes == ["what follows it is no packet: it may be damaged, too", *[""] * 8]


def parts_of(data, sizes, count, application=5, step=1, header=b""):
    """The packets of a unit of data, each with a secondary header if there is one."""
    ends = list(accumulate(sizes, initial=0))
    return [struct.pack(">3H", (0x800 if header else 0) | application, (
        (i == 0) | 2 * (i == len(sizes) - 1)) << 14 | (count + step * i) % 0x4000, len(header) + sizes[i] - 1)
        + header + data[ends[i]:ends[i + 1]] for i in range(len(sizes))]


def joined(given, secondary=0):
    joiner = Joiner(secondary)
    units = [joiner.take(piece) for piece in given]
    return [(unit.packet, [part.packet for part in unit.parts]) for unit in units if unit], joiner.note()


@pytest.mark.parametrize("step", [0, 1])
def test_units_are_joined_above_their_packets(step):
    """Of three applications by turns, also with one count in each unit; a unit without one of its parts is none."""
    draw = random.Random(step)
    for case in range(200):
        counts, queues, units = [draw.randrange(0x4000) for _ in range(3)], [[], [], []], []
        for _ in range(12):
            app, data = draw.randrange(3), draw.randbytes(draw.randrange(40, 90))
            sizes = [10] * draw.randrange(1, 4)
            sizes.append(len(data) - sum(sizes))
            parts = parts_of(data, sizes, counts[app], app, step)
            lost = len(parts)
            if case % 2:    # the counts show which; without them only the end of a unit
                lost = draw.randrange(3 * len(parts)) if step else lost - draw.randrange(2)
            counts[app] += len(parts) if step else 1
            queues[app] += parts[:lost] + parts[lost + 1:]
            if lost >= len(parts):
                whole = struct.pack(">2H", app, int.from_bytes(parts[0][2:4], "big") | 0xC000)
                units.append((whole + struct.pack(">H", len(data) - 1) + data, parts))
        file = b""
        while any(queues):
            queue = draw.choice([queue for queue in queues if queue])
            file += queue.pop(0)
        found, note = joined(pieces(file))
        assert sorted(found) == sorted(units)
        assert f"; {len(units)} units are whole, of {sum(len(parts) for _, parts in units)} parts" in note


def test_a_unit_has_its_secondary_header_once_and_a_repeated_part_once():
    parts = parts_of(b"abcdefghi", [3, 2, 4], 0x3FFF, header=b"12")
    twice = [Piece(0, part) for part in parts for _ in range(2)]
    unit = struct.pack(">3H", 0x805, 0xFFFF, 10)
    assert joined(twice, 2) == ([(unit + b"12abcdefghi", parts)], "3 packets are parts of longer units of data; "
                                "1 units are whole, of 3 parts")
    (packet, _), = joined(twice)[0]
    assert packet[6:] == b"12abc12de12fghi" and "--secondary N" in joined(twice)[1]
    assert joined(map(twice.__getitem__, (0, 2, 0, 2, 4)), 2)[0] == [(unit + b"12abcdefghi", parts)]
    assert joined(twice, 4)[0][0][0][6:] == b"12abchi"      # of the middle part nothing is left
    joiner = Joiner(5)
    assert [unit.problem for piece in twice if (unit := joiner.take(piece))] == [
        "a part of it is shorter than a secondary header of 5 bytes: it is not decoded"]
    long = [Piece(0, part) for part in parts_of(bytes(70000), [65536, 4464], 0)]
    joiner = Joiner()
    joiner.take(long[0])
    assert joiner.take(long[1]).problem == "it has 70006 bytes, more than the length of a packet can say: it is not " \
        "decoded"


def test_units_are_decoded_by_the_database(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    far, entry = "<Parameter name='far' parameterTypeRef='u16'/>", "<ParameterRefEntry parameterRef='bus'/>"
    Path("s.xml").write_text(XTCE.replace("</ParameterSet>", far + "</ParameterSet>")
                             .replace(entry, entry + entry.replace("bus", "far")))
    parts = parts_of(b"\x14\x01\x02", [1, 1, 1], 7)
    Path("all.bin").write_bytes(packet(6, b"\x04\0\x06") + b"".join(parts))
    assert main(["packets", "all.bin"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[1:] == [
        "byte 9: telemetry, application 5, count 7, first part, 7 bytes",
        "byte 16: telemetry, application 5, count 8, middle part, 7 bytes",
        "byte 23: telemetry, application 5, count 9, last part, 7 bytes",
        "  = unit of 3 parts from byte 9 on, 9 bytes"]
    assert err == "fledge: all.bin: 3 packets are parts of longer units of data; 1 units are whole, of 3 parts\n"
    assert main(["packets", "all.bin", "--database", "s.xml", "--json"]) == 0       # what a part lacks, its unit has
    unit = json.loads(capsys.readouterr().out.splitlines()[3])["unit"]
    assert unit == {"byte": 9, "kind": "telemetry", "application": 5, "count": 7, "bytes": 9, "parts": 3,
                    "container": "/S/Q", "reason": None,
                    "values": {"id": 5, "count": 0xC007, "size": 2, "bus": 10.0, "far": 258},
                    "raw": {"id": 5, "count": 0xC007, "size": 2, "bus": 20, "far": 258}}
    assert main(["packets", "all.bin", "--database", "s.xml"]) == 0
    assert capsys.readouterr().out.endswith("\n  = unit of 3 parts from byte 9 on, 9 bytes, /S/Q\n  id     5\n"
                                            "  count  49159\n  size   2\n  bus    10.0 V  (raw 20)\n  far    258\n")
    assert main(["packets", "all.bin", "--database", "s.xml", "--csv"]) == 0
    assert capsys.readouterr().out.endswith("9,5,7,/S/Q,far,258,258,telemetry unit of 3 parts,\n")
    Path("all.bin").write_bytes(b"".join(parts[1:]))
    assert main(["packets", "all.bin", "--database", "s.xml"]) == 1
    assert main(["packets", "all.bin", "--secondary", "-1"]) == 2


def datagram(payload, version=4):
    udp = struct.pack(">4H", 1234, 10015, 8 + len(payload), 0) + payload
    if version == 6:
        return bytes(12) + b"\x86\xdd" + struct.pack(">IHBB", 6 << 28, len(udp), 17, 64) + bytes(32) + udp
    ip = struct.pack(">BBHHHBBHII", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, 0, 0)
    return bytes(12) + b"\x81\x00\0\1\x08\x00" + ip + udp + b"\0\0"     # with a tag, and filled


def pcap(frames, order="<", magic=0xA1B2C3D4, link=1):
    return struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link) + b"".join(
        struct.pack(order + "4I", 100 + i, 7, len(frame), len(frame)) + frame for i, frame in enumerate(frames))


def pcapng(frames, order="<", offset=0, old=False):
    def block(kind, body):
        body += bytes(-len(body) % 4)
        return struct.pack(order + "2I", kind, len(body) + 12) + body + struct.pack(order + "I", len(body) + 12)

    clock = struct.pack(order + "2HB3x2Hq2H", 9, 1, 9, 14, 8, offset, 0, 0)
    head = order + ("2H4I" if old else "5I")
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1)) + \
        block(1, struct.pack(order + "HHI", 1, 0, 65535) + clock) + b"".join(
            block(2 if old else 6, struct.pack(head, *[0] * (1 + old), *divmod((100 + i) * 10**9 + 7, 1 << 32),
                                               *2 * [len(frame)]) + frame)
            for i, frame in enumerate(frames))


def by_tshark(path):
    """(time [ns], payload) of each UDP datagram, as Wireshark reads the file."""
    text = subprocess.run(["tshark", "-r", path, "-T", "fields", "-e", "frame.time_epoch", "-e", "udp.payload"],
                          check=True, capture_output=True, text=True, env=without_preload(os.environ)).stdout
    return [(int(Decimal(time) * 10**9), bytes.fromhex(payload))
            for time, payload in map(str.split, filter(None, text.split("\n")))]


@needs("tshark")
def test_captures_of_all_kinds_have_the_datagrams_that_wireshark_finds(tmp_path):
    ip = datagram(ALL[1])[18:-2]
    kinds = {0: b"\2\0\0\0", 1: bytes(12) + b"\x08\0", 12: b"", 101: b"", 108: b"\0\0\0\2",
             113: bytes(14) + b"\x08\0", 228: b"", 276: b"\x08\0" + bytes(18)}
    captures = [pcap([front + ip], link=link) for link, front in kinds.items()]
    captures += [pcapng([datagram(packet) for packet in ALL], order, offset, old)
                 for order, offset, old in (("<", 0, True), (">", 1000, False), (">", -90, True))]
    files = [tmp_path / f"{i}.pcap" for i in range(len(captures))]
    for file, data in zip(files, captures):
        file.write_bytes(data)
    # Wireshark is slow to start: it reads all as one file, whose interfaces are of several kinds.
    subprocess.run(["mergecap", "-a", "-w", tmp_path / "all.pcapng", *files], check=True,
                   env=without_preload(os.environ))     # else it may not end under the sanitizers
    found = [[(piece.time, piece.packet) for piece in pieces(data)] for data in captures]
    assert all(found) and sum(found, []) == by_tshark(tmp_path / "all.pcapng")
    problem, = (piece.problem for piece in pieces(pcap([ip, ip], link=127)))
    assert problem == "2 packets of a network of kind 127 (LINKTYPE), which is not read: they are left out"


@pytest.mark.parametrize("order", "<>")
def test_captures_of_a_network(order):
    frames = [datagram(packet, 4 + 2 * (i % 2)) for i, packet in enumerate(ALL)]
    for data, nanoseconds in [(pcap(frames, order), 7000), (pcap(frames, order, 0xA1B23C4D), 7),
                              (pcapng(frames, order), 7)]:
        assert parsed(data) == (ALL, [])
        first = next(pieces(data))
        assert first.time == 100 * 10**9 + nanoseconds and data[first.at:first.at + len(ALL[0])] == ALL[0]
        whole, problems = parsed(data[:-20])
        assert whole == ALL[:-1] and "the file ends within" in problems[0][1]
    assert parsed(pcap(ALL, order, link=147)) == (ALL, [])
    other = pcap([b"\0" * 60, *frames], order)
    assert parsed(other) == (ALL, [(0, "1 packets of the network are no whole UDP datagrams: they are left out")])


def frames_of(data, size=64, check=True):
    """Frames of one virtual channel with all the packets."""
    room = size - 6 - 2 * check
    starts = [sum(map(len, ALL[:i])) for i in range(len(ALL))]
    packets = []
    for i in range(0, len(data), room):
        zone = data[i:i + room].ljust(room, b"\0") if i + room <= len(data) else \
            data[i:] + packet(0, bytes(room - len(data[i:]) - 6), 0x7FF)
        first = next((start - i for start in starts if i <= start < i + room), 0x7FF)
        frame = struct.pack(">HBBH", 77 << 4, len(packets), len(packets), 3 << 11 | first) + zone
        packets.append(frame + struct.pack(">H", binascii.crc_hqx(frame, 0xFFFF)) * check)
    return packets


def test_telemetry_frames():
    for check in (True, False):
        frames = frames_of(b"".join(ALL), check=check)
        assert len(frames) > 2
        assert parsed(b"".join(frames), frames=64) == (ALL, [])
        assert parsed(b"".join(b"mark" + frame for frame in frames), frames=64, skip=4) == (ALL, [])
        whole, problems = parsed(frames[0] + b"".join(frames[2:]), frames=64)
        assert whole == [packet for packet in ALL if packet in whole] and 0 < len(whole) < len(ALL)
        assert problems == [(64, "1 frames of virtual channel 0 are missing in front of this one")]
    frames = frames_of(b"".join(ALL))
    frames[1] = frames[1][:20] + b"\xff" + frames[1][21:]
    assert (64, "a frame is passed over: its CRC does not hold") in parsed(b"".join(frames), frames=64)[1]
    assert parsed(b"".join(frames)[:-1], frames=64)[1][-1][1] == "the file ends within a frame"
    for wrong, why in [({"frames": 5}, "a frame has 13 to 2048 bytes, not 5"),
                       ({"frames": 64, "reed_solomon": 3}, "the depth is 1 to 16, divides the size"),
                       ({"frames": 892, "reed_solomon": 2}, "223 bytes or fewer"),
                       ({"frames": 64, "insert": 70}, "an insert zone of 70 bytes does not fit")]:
        with pytest.raises(Failure, match=why):
            parsed(b"x" * 2000, **wrong)


def test_a_repeated_frame_is_a_repetition():
    for room in (20, 56):       # packets span 20 bytes
        zones = frames_of(b"".join(ALL), room + 6, False)
        for frames in (zones, frames_of(b"".join(ALL), room + 8), aos(zones), aos(zones, check=False)):
            for given, repeated in ([frame for frame in frames for _ in range(2)], len(frames)), (
                    frames[:3] + frames[1:3] + frames[1:], 4):
                all_ = list(pieces(b"".join(given), Format(frames=len(frames[0]))))
                assert [piece.packet for piece in all_ if piece.packet] == ALL
                assert not any(piece.problem for piece in all_)
                assert f", {repeated} repeated frames passed over" in all_[-1].note


def aos(frames, insert=0, check=True, header_check=False, control=False, channel=5):
    """The same packets in AOS frames, 732.0-B-4: each is as much longer as it has more fields."""
    packets = []
    for i, frame in enumerate(frames):
        head = struct.pack(">HI", 1 << 14 | 157 << 6 | channel, i << 8)
        if header_check:
            head += fhec(head)
        full = head + b"\xa5" * insert + frame[4:6] + frame[6:] + b"\1\2\3\4" * control
        packets.append(full + struct.pack(">H", binascii.crc_hqx(full, 0xFFFF)) * check)
    return packets


def fhec(head):
    """The header error control: the remainder of six symbols by x^4 + a^3 x^3 + a x^2 + a^3 x + 1 (4.1.2.6)."""
    def times(a, b):
        product = 0
        for bit in range(4):
            product ^= (a << bit) * (b >> bit & 1)
        for bit in (6, 5, 4):
            product ^= (0b10011 << bit - 4) * (product >> bit & 1)
        return product

    rest = [nibble for byte in (head[0], head[1], head[5]) for nibble in (byte >> 4, byte & 15)] + [0] * 4
    for i in range(6):
        for k, term in enumerate((1, 8, 2, 8, 1)):
            rest[i + k] ^= times(term, rest[i]) if k else 0
    return bytes([rest[6] << 4 | rest[7], rest[8] << 4 | rest[9]])


def test_aos_frames():
    zones = frames_of(b"".join(ALL), check=False)
    for options in ({}, {"insert": 5}, {"check": False}, {"header_check": True}, {"control": True},
                    {"insert": 3, "header_check": True, "control": True, "check": False}):
        frames = aos(zones, **options)
        how = {"frames": len(frames[0]), "insert": options.get("insert", 0), "control": options.get("control", False)}
        fill = aos(zones[:1], **options, channel=63)
        assert parsed(b"".join(frames + fill), **how) == (ALL, []), options
        assert parsed(b"".join(frame + b"code" for frame in frames), **how, trailer=4) == (ALL, [])
        note = list(pieces(b"".join(frames), Format(**how)))[-1].note
        assert note == f"{len(frames)} AOS frames of spacecraft 157, 1 idle packets"
    frames = aos(zones, check=False, header_check=True)
    damaged = frames[1][:5] + b"\x30" + frames[1][6:]
    assert (68, "a frame is passed over: the check of its header does not hold") in parsed(
        frames[0] + damaged + b"".join(frames[2:]), frames=68)[1]
    mixed = aos(zones, check=False)
    longer = [zone + b"\0\0" for zone in zones]
    both = parsed(b"".join(mixed[:2]) + longer[0] + b"".join(mixed[2:]), frames=len(mixed[0]))
    assert both == (ALL, [(2 * len(mixed[0]), "a frame is passed over: it is of TM, the others are of AOS")])
    uslp = b"\xc0" + bytes(63)
    assert parsed(uslp, frames=64)[1] == [(0, "the frames are of USLP, which is not read: TM and AOS are")]


ENCAPSULATED = [b"\xe0", b"\xe9\x05abc", b"\xee\x12\0\x08wxyz", b"\xff" + bytes(5) + b"\0\x0az!", b"\xe1\2"]
PROTOCOLS = ["idle", "IPE", "CFDP", "mission", "idle"]


def test_encapsulation_packets():
    assert [encapsulated(packet) for packet in ENCAPSULATED] == PROTOCOLS and encapsulated(ALL[0]) is None
    assert encapsulated(b"\xfa\x57\0\4") == "extended 7"
    named = [packet for packet in ENCAPSULATED if packet[0] >> 2 & 7]
    stream = b"".join(x + y for x, y in zip(ALL, ENCAPSULATED)) + b"".join(ALL[5:])
    given = [packet for pair in zip(ALL, ENCAPSULATED) for packet in pair if len(packet) > 1] + ALL[5:]
    assert parsed(stream) == (given, [])
    assert parsed(pcap(named, link=147)) == (named, [])
    zone = b"".join(ENCAPSULATED) + ALL[0]
    size = len(zone) + 6
    frame = struct.pack(">HBBH", 77 << 4, 0, 0, 3 << 11) + zone
    assert list(pieces(frame, Format(frames=size))) == [(0, packet, None, "", "") for packet in [*named, ALL[0]]] + [
        (size, b"", None, "", "1 TM frames of spacecraft 77, 2 idle packets")]
    other = struct.pack(">HBBH", 77 << 4, 0, 0, 3 << 11) + b"\x40" + zone[:-1]
    assert parsed(other + frame[:3] + b"\1" + frame[4:], frames=size) == ([*named, ALL[0]], [
        (0, "virtual channel 0 has a packet of version 2, which is not read: what is behind it is left out up to the "
            "next packet that a frame points to")])


def test_encapsulation_packets_are_named(tmp_path, capsys):
    (tmp_path / "all.bin").write_bytes(ALL[0] + ENCAPSULATED[1] + ALL[1])
    assert main(["packets", str(tmp_path / "all.bin")]) == 0
    assert capsys.readouterr().out.splitlines()[1] == "byte 7: encapsulation, protocol IPE, 5 bytes"
    main(["packets", str(tmp_path / "all.bin"), "--json"])
    assert json.loads(capsys.readouterr().out.splitlines()[1]) == {
        "byte": 7, "kind": "encapsulation", "protocol": "IPE", "bytes": 5}
    main(["packets", str(tmp_path / "all.bin"), "--csv"])
    assert capsys.readouterr().out.splitlines()[2] == "7,,,,,,,encapsulation IPE,"


def test_the_code_of_real_frames(capsys):
    cadus = DATA / "ccsds/snpp_synchronized_cadus.dat"
    if not cadus.exists():
        pytest.skip(f"not here: {cadus}")
    options = ["--frames", "892", "--skip", "4", "--randomized"]
    assert main(["packets", str(cadus), *options, "--trailer", "128", "--json"]) == 1     # a frame is missing
    plain = capsys.readouterr()
    assert main(["packets", str(cadus), *options, "--reed-solomon", "4", "--json"]) == 1
    coded = capsys.readouterr()
    assert coded.out == plain.out and "65 AOS frames of spacecraft 157, 0 idle packets, 0 symbols" in coded.err
    data = bytearray(cadus.read_bytes())
    for i in range(64):         # 16 of each code word of the third frame
        data[2 * 1024 + 4 + 7 * i] ^= 0x55 + i
    assert [piece.packet for piece in pieces(bytes(data), Format(4, 892, 0, 4, randomized=True)) if piece.packet] == [
        piece.packet for piece in pieces(cadus.read_bytes(), Format(4, 892, 0, 4, randomized=True)) if piece.packet]
    data[2 * 1024 + 4 + 7 * 64] ^= 1
    assert (2052, "a frame is passed over: its Reed-Solomon code has too many wrong symbols") in parsed(
        bytes(data), skip=4, frames=892, reed_solomon=4, randomized=True)[1]


def test_the_record_of_an_exchange_has_the_packets_of_its_queues(tmp_path):
    maker = Maker(tmp_path / "exchange.mcap")
    queues = [maker.channel(f"/flight/{name}", "fledge/Bytes", "uint32 n\nuint8[64] bytes\n") for name in "ab"]
    other = maker.channel("/flight/rate", "fledge/Rate", "float64 rate\n")
    for i, two in enumerate(zip(ALL[::2], ALL[1::2])):
        whole = b"".join(two)
        maker.message(other, 10 * i, i, struct.pack("<d", 1.5))
        maker.message(queues[1 - i % 2], 10 * i, i, struct.pack("<I", len(whole)) + whole.ljust(64, b"\xff"))
    maker.close()
    all_ = list(read(maker.path))
    assert [piece.packet for piece in all_] == ALL and [piece.time for piece in all_] == [0, 0, 10, 10, 20, 20, 30, 30]
    maker = Maker(tmp_path / "run.mcap")
    maker.message(maker.channel("/flight/rate", "fledge/Rate", "float64 rate\n"), 0, 0, struct.pack("<d", 1.5))
    maker.close()
    problem, = (piece.problem for piece in read(maker.path))
    assert problem == "a record without packets: fledge convert writes its values"


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "all.bin").write_bytes(ALL[0] + ALL[1] + packet(9, application=6) + b"\x9a\xff" + ALL[2] + ALL[3])
    (tmp_path / "s.xml").write_text(XTCE, encoding="utf-8")


def test_each_packet_is_printed_with_its_fields(files, capsys):
    assert main(["packets", "all.bin", "--database", "s.xml"]) == 1
    out, err = capsys.readouterr()
    assert out.startswith("byte 0: telemetry, application 5, count 0, 7 bytes, /S/Q\n  id     5\n")
    assert "  bus    0.5 V  (raw 1)\n" in out
    assert "not decoded\n  ! what follows it is no packet: it may be damaged, too; no container that extends /S/P " \
        "fits; the nearest, /S/Q, needs id == 5 (found 6)\n" in out
    assert err == "fledge: all.bin, byte 24: 2 bytes are no packet: byte 24 is 0x9a, of packet version 4\n"
    assert main(["packets", "all.bin"]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "byte 39: telemetry, application 5, count 3, 16 bytes"


def test_tables_and_json(files, capsys):
    main(["packets", "all.bin", "--database", "s.xml", "--csv"])
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert rows[3] == {"byte": "0", "application": "5", "count": "0", "container": "/S/Q", "field": "bus",
                       "value": "0.5", "raw": "1", "kind": "telemetry", "reason": ""}
    main(["packets", "all.bin", "--database", "s.xml", "--json"])
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines[0]["values"] == {"id": 5, "count": 0xC000, "size": 0, "bus": 0.5} and lines[0]["reason"] is None
    assert lines[2]["container"] is None and "may be damaged" in lines[2]["reason"] and "found 6" in lines[2]["reason"]


def test_json_has_numbers_that_are_not_finite_as_texts(tmp_path, capsys):
    def constant(name):
        raise ValueError(f"{name} is no JSON")

    kind = "<FloatParameterType name='f64' sizeInBits='64'><FloatDataEncoding sizeInBits='64'/></FloatParameterType>"
    parameters = "".join(f"<Parameter name='{name}' parameterTypeRef='f64'/>" for name in "abcd")
    entries = "".join(f"<ParameterRefEntry parameterRef='{name}'/>" for name in "abcd")
    (tmp_path / "s.xml").write_text(XTCE.replace("</ParameterTypeSet>", f"{kind}</ParameterTypeSet>").replace(
        "</ParameterSet>", f"{parameters}</ParameterSet>").replace("<ParameterRefEntry parameterRef='bus'/>", entries))
    numbers = (float("nan"), float("inf"), float("-inf"), 0.5)
    (tmp_path / "a.bin").write_bytes(packet(0, struct.pack(">4d", *numbers)))
    assert main(["packets", str(tmp_path / "a.bin"), "--database", str(tmp_path / "s.xml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out, parse_constant=constant)
    assert [found["values"][name] for name in "abcd"] == ["NaN", "Infinity", "-Infinity", 0.5]
    assert [found["raw"][name] for name in "abcd"] == ["NaN", "Infinity", "-Infinity", 0.5]


@pytest.mark.parametrize("form", [[], ["--csv"], ["--json"]])
def test_no_text_of_a_database_or_a_packet_drives_the_terminal_or_a_table(form, files, tmp_path, capsys):
    (tmp_path / "s.xml").write_text(
        XTCE.replace("'bus'", "'bus\x7f\u202e\x9b2J'").replace("<Unit>V<", "<Unit>\x9b2J<")
        .replace("'Q'", "'=Q\x7f\u2066'").replace("<FloatParameterType name='volt'>", """
        <StringParameterType name='text'><StringDataEncoding><SizeInBits><Fixed><FixedValue>128</FixedValue></Fixed>
        </SizeInBits></StringDataEncoding></StringParameterType><FloatParameterType name='volt'>""")
        .replace("<Parameter name='id'", "<Parameter name='said' parameterTypeRef='text'/><Parameter name='id'")
        .replace("<EntryList><ParameterRefEntry parameterRef='bus", """<EntryList>
        <ParameterRefEntry parameterRef='said'/><ParameterRefEntry parameterRef='bus"""), encoding="utf-8")
    (tmp_path / "all.bin").write_bytes(packet(0, b"=1+1;\x1b[2J\nbyt\7\x7fx"))
    main(["packets", "all.bin", "--database", "s.xml", *form])
    out = capsys.readouterr().out
    assert out.replace("\n", "").isprintable() and "=1+1" in out
    if not form:
        assert len(out.splitlines()) == 6 and "=1+1;\u27e81B\u27e9[2J\u27e80A\u27e9byt" in out
    if form == ["--csv"]:
        text, = [row for row in csv.DictReader(io.StringIO(out)) if row["field"] == "said"]
        assert text["value"].startswith("'=1+1;\u27e81B\u27e9[2J\nbyt") and text["container"].startswith("/S/=Q")


def test_a_database_with_faults_lists_them_all_and_leniently_the_rest_is_read(files, capsys):
    faulty = XTCE.replace("</ParameterSet>", "<Parameter name='x' parameterTypeRef='no'/>\n<Odd/></ParameterSet>")
    Path("faulty.xml").write_text(faulty)
    assert main(["packets", "all.bin", "--database", "faulty.xml"]) == 2
    assert "faulty.xml:7: there is no type no\nfaulty.xml:8: <Odd> is not known in <" in capsys.readouterr().err
    code = main(["packets", "all.bin", "--database", "faulty.xml", "--lenient", "--csv"])
    lenient = capsys.readouterr()
    assert main(["packets", "all.bin", "--database", "s.xml", "--csv"]) == code
    assert capsys.readouterr().out == lenient.out
    assert "fledge: faulty.xml:7: there is no type no; /S/x is left out\n" in lenient.err


def test_bad_input_gets_one_line(files, capsys):
    assert main(["packets", "absent.bin"]) == 2
    assert main(["packets", "all.bin", "--database", "all.bin"]) == 2
    assert main(["packets", "all.bin", "--skip", "-1"]) == 2
    assert main(["packets", "all.bin", "--trailer", "128"]) == 2
    assert main(["packets", "all.bin", "--frames", "5"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 5


def test_names_with_dots_and_members_have_their_units(tmp_path, capsys):
    (tmp_path / "s.xml").write_text("""<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>
        <IntegerParameterType name='h'><IntegerDataEncoding sizeInBits='48'/></IntegerParameterType>
        <IntegerParameterType name='v'><UnitSet><Unit>V</Unit></UnitSet><IntegerDataEncoding/></IntegerParameterType>
        <IntegerParameterType name='i'><UnitSet><Unit>A</Unit></UnitSet><IntegerDataEncoding/></IntegerParameterType>
        <AggregateParameterType name='g'><UnitSet><Unit>W</Unit></UnitSet><MemberList><Member name='v' typeRef='v'/>
        <Member name='i' typeRef='i'/></MemberList></AggregateParameterType></ParameterTypeSet><ParameterSet>
        <Parameter name='h' parameterTypeRef='h'/><Parameter name='A' parameterTypeRef='i'/>
        <Parameter name='A.X' parameterTypeRef='v'/><Parameter name='g' parameterTypeRef='g'/></ParameterSet>
        <ContainerSet><SequenceContainer name='P'><EntryList><ParameterRefEntry parameterRef='h'/>
        <ParameterRefEntry parameterRef='A.X'/><ParameterRefEntry parameterRef='g'/></EntryList></SequenceContainer>
        </ContainerSet></TelemetryMetaData></SpaceSystem>""")
    (tmp_path / "p.bin").write_bytes(packet(0, b"\1\2\3"))
    assert main(["packets", str(tmp_path / "p.bin"), "--database", str(tmp_path / "s.xml")]) == 0
    assert [line.split() for line in capsys.readouterr().out.splitlines()[2:]] == [
        ["A.X", "1", "V"], ["g.v", "2", "V"], ["g.i", "3", "A"]]


def test_the_time_of_a_capture_has_all_its_digits(tmp_path, capsys):
    (tmp_path / "p.pcap").write_bytes(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, 147) + struct.pack(
        "<4I", 1_790_000_000, 123_456_789, 7, 7) + packet(0))
    assert main(["packets", str(tmp_path / "p.pcap")]) == 0
    assert ", 1790000000.123456789 s: telemetry" in capsys.readouterr().out
