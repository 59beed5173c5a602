# SPDX-License-Identifier: Apache-2.0
"""The archive of a spacecraft's packets: what Monitor decodes live is what History decodes again, and a second reader
finds the same messages in the files."""

import random
import struct

import numpy as np
import pytest

from fledge import SetupError, _ground, cli
from fledge.archive import Archive
from fledge.ground import captures

S = 10**9
XTCE = """<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="u8"><IntegerDataEncoding sizeInBits="8"/></IntegerParameterType>
<IntegerParameterType name="u16"><IntegerDataEncoding sizeInBits="16"/></IntegerParameterType>
<FloatParameterType name="volt"><UnitSet><Unit>V</Unit></UnitSet><IntegerDataEncoding sizeInBits="16">
<DefaultCalibrator><PolynomialCalibrator>
<Term exponent="1" coefficient="0.01"/></PolynomialCalibrator></DefaultCalibrator>
</IntegerDataEncoding></FloatParameterType></ParameterTypeSet>
<ParameterSet><Parameter name="a" parameterTypeRef="u8"/><Parameter name="b" parameterTypeRef="u8"/>
<Parameter name="sequence" parameterTypeRef="u16"/><Parameter name="size" parameterTypeRef="u16"/>
<Parameter name="bus" parameterTypeRef="volt"><AliasSet><Alias nameSpace="Fledge" alias="flight.power.bus"/></AliasSet>
</Parameter></ParameterSet><ContainerSet>
<SequenceContainer name="Packet" abstract="true"><EntryList><ParameterRefEntry parameterRef="a"/>
<ParameterRefEntry parameterRef="b"/><ParameterRefEntry parameterRef="sequence"/>
<ParameterRefEntry parameterRef="size"/></EntryList></SequenceContainer>
<SequenceContainer name="Power"><EntryList><ParameterRefEntry parameterRef="bus"/></EntryList>
<BaseContainer containerRef="Packet"><RestrictionCriteria><Comparison parameterRef="b" value="1"/></RestrictionCriteria>
</BaseContainer></SequenceContainer></ContainerSet></TelemetryMetaData></SpaceSystem>"""


def packet(i, application=1):
    return struct.pack(">4H", 0x0800 | application, 0xC000 | i % 0x4000, 1, i % 65536)


@pytest.fixture
def craft(tmp_path):
    (tmp_path / "s.xml").write_text(XTCE)
    return _ground.Database.read([(str(tmp_path / "s.xml"), "")])


@pytest.fixture
def flown(craft, tmp_path):
    """A thousand packets, of which each tenth is of no container: (monitor, packets by their times)."""
    monitor, archive = _ground.Monitor(craft), _ground.PacketArchive(str(tmp_path / "a"), "imager", craft, 300)
    monitor.sink(archive)
    sent = [(i * S, 1_790_000_000 * S + i, packet(i, 2 if i % 10 == 3 else 1)) for i in range(1000)]
    for i in range(0, 1000, 7):
        monitor.take(sent[i:i + 7])
    monitor.sink(None)
    archive.close()
    return monitor, sent, tmp_path / "a"


def test_what_was_live_is_found_again(craft, flown):
    monitor, sent, folder = flown
    history = _ground.History(str(folder), "imager", craft)
    stored = history.packets(limit=10_000)
    assert [(t, received, packet) for t, received, _, packet in stored] == sent
    assert {path for _, _, path, _ in stored} == {"/S/Power", None}
    assert [packet for *_, packet in history.packets(container="undecoded")] == [packet for *_, packet in sent[3::10]]
    assert [t for t, *_ in history.packets(t1=500 * S, limit=3, backwards=True)] == [500 * S, 499 * S, 498 * S]
    t, value, low, high, *_ = history.series(["flight.power.bus"])["flight.power.bus"]
    live = monitor.newest(monitor.slot("flight.power.bus"))
    assert (t[-1], value[-1]) == (live[0], live[3])
    decoded = [i for i in range(1000) if i % 10 != 3]
    assert t.dtype == np.int64 and (t == np.array(decoded) * S).all()
    assert value.tolist() == [0.01 * i for i in decoded] and low.tolist() == high.tolist() == value.tolist()
    t, value, low, high, *_ = history.series(["/S/bus"], 100 * S, 899 * S, points=8)["/S/bus"]
    assert t.tolist() == [i * S for i in range(199, 900, 100)]
    assert low.tolist() == [0.01 * i for i in range(100, 900, 100)]
    rows, _ = history.rows(["bus", "sequence"], 0, 5 * S)
    assert rows.shape == (5, 3) and rows[:, 0].copy().view(np.int64).tolist() == [0, S, 2 * S, 4 * S, 5 * S]
    assert history.sessions() == [{"session": 1, "first": 0, "last": 999 * S, "packets": 1000, "ended": "closed",
                                   "gaps": []}]


def test_an_input_from_before_a_query_is_found_where_the_database_has_changed(flown, tmp_path):
    """The container of the bus voltage has another name now, and packets that were of none have one."""
    text = XTCE.replace('name="Power"', 'name="Supply"').replace("</ContainerSet>", """
        <SequenceContainer name="Other"><EntryList><ParameterRefEntry parameterRef="c"/></EntryList>
        <BaseContainer containerRef="Packet"><RestrictionCriteria><Comparison parameterRef="b" value="2"/>
        </RestrictionCriteria></BaseContainer></SequenceContainer></ContainerSet>""").replace(
        "<ParameterSet>", '<ParameterSet><Parameter name="c" parameterTypeRef="u16"/>')
    (tmp_path / "new.xml").write_text(text)
    database = _ground.Database.read([(str(tmp_path / "new.xml"), "")])
    _, _, folder = flown
    for begin in (313, 310, 5):         # with the other's last value in the same file, the one before, and the first
        rows, _ = _ground.History(str(folder), "imager", database).rows(["bus", "c"], begin * S, (begin + 8) * S)
        times = [t for t in range(begin, begin + 9) if t >= 3]
        assert rows[:, 0].copy().view(np.int64).tolist() == [t * S for t in times]
        assert rows[:, 1].tolist() == [0.01 * (t - (t % 10 == 3)) for t in times]
        assert rows[:, 2].tolist() == [(t - 3) // 10 * 10 + 3 for t in times]


def test_a_replay_gives_a_second_monitor_the_same(craft, flown):
    monitor, sent, folder = flown
    history = _ground.History(str(folder), "imager", craft)
    again = _ground.Monitor(craft)
    batches = list(history.replay(most=64))
    assert max(map(len, batches)) <= 64 and all(batch[-1][0] - batch[0][0] <= S for batch in batches)
    for batch in batches:
        again.take(batch)
    assert [packet for batch in batches for packet in batch] == sent
    assert again.newest(again.slot("flight.power.bus")) == monitor.newest(monitor.slot("flight.power.bus"))
    part = [packet for batch in history.replay(100 * S, 200 * S, span_ns=10**12) for packet in batch]
    assert part == sent[100:201]


def test_packets_of_one_time_are_replayed_once_each(craft, tmp_path):
    archive = _ground.PacketArchive(str(tmp_path), "imager", craft)
    for i in range(50):
        archive.put(i // 20 * S, i, packet(i))
    archive.close()
    history = _ground.History(str(tmp_path), "imager", craft)
    for most in (1, 3, 20, 100):
        assert [received for batch in history.replay(most=most) for _, received, _ in batch] == list(range(50))


def test_a_second_reader_finds_the_same_messages(flown):
    _, sent, folder = flown
    messages = []
    for file in sorted((folder / "imager").glob("*.mcap")):
        record = Archive(file)
        assert record.complete, record.problem
        assert record.metadata["archive"]["craft"] == "imager"
        assert {*record.topics} == {"/imager/S/Power", "/imager/undecoded"}
        assert sum(topic.count for topic in record.topics.values()) == len(
            [t for topic in record.topics for t in record.time_ns(topic)])
        messages += [(piece.time, piece.packet) for piece in captures.read(file)]
    assert messages == [(t, packet) for t, _, packet in sent]


def test_the_command_line_decodes_a_file_of_the_archive(flown, tmp_path, capsys):
    file = min((flown[2] / "imager").glob("*.mcap"))
    assert cli.main(["packets", str(file), "--database", str(tmp_path / "s.xml"), "--csv"]) == 1    # some fit none
    lines = [line for line in capsys.readouterr().out.splitlines() if "bus" in line]
    assert len(lines) == 270 and "2.99" in lines[-1]


def test_what_went_lost_before_it_came_is_a_gap(craft, tmp_path):
    archive = _ground.PacketArchive(str(tmp_path), "imager", craft)
    archive.missing(3 * S, 7 * S, "no receiver listened")
    archive.save()      # there is no file yet
    for t in (1, 2, 3, 7, 8):
        archive.put(t * S, 0, packet(t))
    archive.save()
    archive.missing(8 * S, 9 * S, "it was late")
    archive.close()
    session, = _ground.History(str(tmp_path), "imager", craft).sessions()
    assert session["packets"] == 5
    assert sorted(session["gaps"]) == [(3 * S, 7 * S, "no receiver listened"), (8 * S, 9 * S, "it was late")]


def test_a_writer_is_refused_beside_another(craft, tmp_path):
    archive = _ground.PacketArchive(str(tmp_path), "imager", craft)
    with pytest.raises(SetupError, match="another program writes the archive"):
        _ground.PacketArchive(str(tmp_path), "imager", craft)
    archive.close()
    with pytest.raises(SetupError, match="no parameter flight.power.bas"):
        _ground.History(str(tmp_path), "imager", craft).series(["flight.power.bas"])


ALL_KINDS = """<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="u8" signed="false"><IntegerDataEncoding sizeInBits="8"/></IntegerParameterType>
<IntegerParameterType name="u64" signed="false" sizeInBits="64"><IntegerDataEncoding sizeInBits="64"/>
<DefaultAlarm minViolations="3"><StaticAlarmRanges><WatchRange maxInclusive="1000"/></StaticAlarmRanges></DefaultAlarm>
</IntegerParameterType>
<IntegerParameterType name="i64" sizeInBits="64"><IntegerDataEncoding sizeInBits="64" encoding="twosComplement"/>
<DefaultAlarm><ChangeAlarmRanges><SevereRange minInclusive="-9" maxInclusive="9"/></ChangeAlarmRanges></DefaultAlarm>
</IntegerParameterType>
<FloatParameterType name="f64" sizeInBits="64"><FloatDataEncoding sizeInBits="64"/><DefaultAlarm minViolations="2">
<StaticAlarmRanges><WarningRange minInclusive="-1" maxInclusive="1"/></StaticAlarmRanges></DefaultAlarm>
<ContextAlarmList>
<ContextAlarm><StaticAlarmRanges><CriticalRange minInclusive="-0.5" maxInclusive="0.5"/></StaticAlarmRanges>
<ContextMatch><Comparison parameterRef="mode" value="2"/></ContextMatch></ContextAlarm></ContextAlarmList>
</FloatParameterType>
<EnumeratedParameterType name="label"><IntegerDataEncoding sizeInBits="8"/><EnumerationList>
<Enumeration value="1" label="OFF"/><Enumeration value="7" label="ON"/></EnumerationList><DefaultAlarm>
<EnumerationAlarmList><EnumerationAlarm enumerationLabel="ON" alarmLevel="distress"/></EnumerationAlarmList>
</DefaultAlarm></EnumeratedParameterType>
<StringParameterType name="text"><StringDataEncoding encoding="UTF-8"><SizeInBits><Fixed><FixedValue>32</FixedValue>
</Fixed></SizeInBits></StringDataEncoding><DefaultAlarm><StringAlarmList><StringAlarm matchPattern="A.*"
alarmLevel="warning"/></StringAlarmList></DefaultAlarm></StringParameterType>
<BinaryParameterType name="bytes"><BinaryDataEncoding><SizeInBits><FixedValue>24</FixedValue></SizeInBits>
</BinaryDataEncoding></BinaryParameterType></ParameterTypeSet><ParameterSet>
<Parameter name="id" parameterTypeRef="u8"/><Parameter name="mode" parameterTypeRef="u8"/>
<Parameter name="natural" parameterTypeRef="u64"/><Parameter name="integer" parameterTypeRef="i64"/>
<Parameter name="real" parameterTypeRef="f64"/><Parameter name="label" parameterTypeRef="label"/>
<Parameter name="text" parameterTypeRef="text"/><Parameter name="bytes" parameterTypeRef="bytes"/></ParameterSet>
<ContainerSet><SequenceContainer name="P" abstract="true"><EntryList><ParameterRefEntry parameterRef="id"/></EntryList>
</SequenceContainer><SequenceContainer name="Mode"><EntryList><ParameterRefEntry parameterRef="mode"/></EntryList>
<BaseContainer containerRef="P"><RestrictionCriteria><Comparison parameterRef="id" value="1"/></RestrictionCriteria>
</BaseContainer></SequenceContainer><SequenceContainer name="All"><EntryList><ParameterRefEntry parameterRef="natural"/>
<ParameterRefEntry parameterRef="integer"/><ParameterRefEntry parameterRef="real"/><ParameterRefEntry
parameterRef="label"/><ParameterRefEntry parameterRef="text"/><ParameterRefEntry parameterRef="bytes"/></EntryList>
<BaseContainer containerRef="P"><RestrictionCriteria><Comparison parameterRef="id" value="2"/></RestrictionCriteria>
</BaseContainer></SequenceContainer></ContainerSet></TelemetryMetaData></SpaceSystem>"""
KINDS = ["natural", "integer", "real", "label", "text", "bytes"]


@pytest.mark.parametrize("seed", range(8))
def test_values_of_the_past_are_exact_and_have_the_state_that_they_had(tmp_path, seed):
    """The values by struct; the states as a monitor said them at each packet, while somebody set other limits."""
    chance = random.Random(seed)
    (tmp_path / "s.xml").write_text(ALL_KINDS)
    database = _ground.Database.read([(str(tmp_path / "s.xml"), "")])
    monitor, archive = _ground.Monitor(database), _ground.PacketArchive(str(tmp_path), "craft", database, 100)
    monitor.sink(archive)
    slots = {name: monitor.slot(name) for name in KINDS}
    expected, limits, last = [], {}, 0
    for t in range(400):
        received = 10**18 + 10 * t
        if chance.random() < 0.1:
            name = chance.choice(KINDS[:3])
            bands = chance.choice([None, {}, {"warning": [-300, 300], "severe": [None, 2000]}])
            persistence = chance.choice([1, 2, 4])
            monitor.set_limits(slots[name], bands, persistence)
            limits.setdefault(name, []).append((received - 5, bands, persistence))
        if chance.random() < 0.1:
            monitor.take([(t * S, received, bytes([1, chance.randrange(3)]))])
            continue
        last += chance.randrange(-12, 13)
        values = [chance.choice([2**64 - 1 - t, t, 900 + 200 * chance.randrange(2)]), chance.choice([last, -2**63 + t]),
                  chance.choice([0.1, -0.7, 3.0, float("nan")]), chance.choice([1, 1, 7, 9]),
                  chance.choice([b"ABCD", b"x,=\xc3", "né!".encode()]), chance.randbytes(3)]
        monitor.take([(t * S, received, b"\2" + struct.pack(">QqdB4s3s", *values))])
        values[3:5] = {1: "OFF", 7: "ON"}.get(values[3], values[3]), values[4].decode("utf-8", "replace")
        expected.append((t * S, values, [monitor.newest(slots[name])[5] for name in KINDS]))
    monitor.sink(None)
    archive.close()
    history = _ground.History(str(tmp_path), "craft", database)
    seen = set()
    for begin, end in [(0, 400), *(sorted(chance.sample(range(400), 2)) for _ in range(20))]:
        series = history.series(KINDS, begin * S, end * S, 0, -1, limits, True)
        part = [row for row in expected if begin * S <= row[0] <= end * S]
        for i, name in enumerate(KINDS):
            t, value, _, _, concern, worst, (kind, exact) = series[name]
            assert t.tolist() == [row[0] for row in part] and kind == {"bytes": "binary"}.get(name, name)
            assert [repr(row) for row in exact] == [repr(row[1][i]) for row in part]
            assert concern.tolist() == worst.tolist() == [row[2][i] for row in part], (name, begin, end)
            seen |= {(name, row) for row in concern.tolist()}
        few = history.series(["natural"], begin * S, end * S, 5, -1, limits)["natural"]
        assert max(few[5], default=0) == max(series["natural"][4], default=0) and len(few[0]) <= 5
        assert few[4].tolist()[-1:] == series["natural"][4].tolist()[-1:]
    assert {("integer", 5), ("label", 3), ("text", 2)} <= seen
    assert not history.series(["natural"])["natural"][4].any()
    with pytest.raises(SetupError, match="text is no number but a text"):
        history.series(["text"])


SLOW = """<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="u8"><IntegerDataEncoding sizeInBits="8"/></IntegerParameterType>
</ParameterTypeSet><ParameterSet><Parameter name="id" parameterTypeRef="u8"/>
<Parameter name="fast" parameterTypeRef="u8"/><Parameter name="slow" parameterTypeRef="u8"/>
<Parameter name="has" parameterTypeRef="u8"/><Parameter name="some" parameterTypeRef="u8"/></ParameterSet><ContainerSet>
<SequenceContainer name="P" abstract="true"><EntryList><ParameterRefEntry parameterRef="id"/></EntryList>
</SequenceContainer>""" + "".join(f"""<SequenceContainer name="C{i}"><EntryList>{entries}</EntryList>
<BaseContainer containerRef="P"><RestrictionCriteria><Comparison parameterRef="id" value="{i}"/></RestrictionCriteria>
</BaseContainer></SequenceContainer>""" for i, entries in enumerate([
    '<ParameterRefEntry parameterRef="fast"/>', '<ParameterRefEntry parameterRef="slow"/>',
    """<ParameterRefEntry parameterRef="has"/><ParameterRefEntry parameterRef="some"><IncludeCondition>
    <Comparison parameterRef="has" value="1"/></IncludeCondition></ParameterRefEntry>""",
    '<ParameterRefEntry parameterRef="fast"/><ParameterRefEntry parameterRef="slow"/>'])) + \
    "</ContainerSet></TelemetryMetaData></SpaceSystem>"


@pytest.mark.parametrize("seed", range(6))
def test_the_last_values_of_inputs_before_a_query_count(tmp_path, seed):
    """The rows of a part are those of the whole history in that part, which a few lines of Python compute: of inputs
    that are much rarer than the query is long, in several containers, behind a condition and in earlier sessions."""
    chance = random.Random(seed)
    (tmp_path / "s.xml").write_text(SLOW)
    database = _ground.Database.read([(str(tmp_path / "s.xml"), "")])
    newest, rows, t = {}, [], 10**18
    for _ in range(3):      # sessions of a clock that shows UTC
        monitor, archive = _ground.Monitor(database), _ground.PacketArchive(str(tmp_path), "craft", database, 50)
        monitor.sink(archive)
        for _ in range(300):
            t += S
            kind, value = chance.choices(range(4), [90, 2, 8, 1])[0], chance.randrange(1, 100)
            held = kind != 2 or chance.random() < 0.2
            packet = bytes({0: [0, value], 1: [1, value], 2: [2, held, value][:2 + held],
                            3: [3, value, value + 100]}[kind])
            monitor.take([(t, t, packet)])
            new = [{"fast": value}, {"slow": value}, {"some": value} if held else {},
                   {"fast": value, "slow": value + 100}][kind]
            newest |= new
            if new and len(newest) == 3:
                rows.append([t, newest["fast"], newest["slow"], newest["some"]])
        monitor.sink(None)
        archive.close()
    history = _ground.History(str(tmp_path), "craft", database)
    assert len(rows) > 100, seed
    for begin in chance.sample(range(900), 25):
        first, last = 10**18 + begin * S, 10**18 + (begin + chance.randrange(5, 60)) * S
        found, received = history.rows(["fast", "slow", "some"], first, last)
        assert [[t, *row] for t, row in zip(received.tolist(), found[:, 1:].tolist())] == \
            [row for row in rows if first <= row[0] <= last], begin
