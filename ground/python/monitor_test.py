# SPDX-License-Identifier: Apache-2.0
"""The monitor of telemetry, against the decoder, limits in a few lines of Python and a second reader of its frames."""
import os
import random
import struct
import threading

import pytest

from fledge import SetupError, _ground
from fledge.ground.testing.databases import Random, same

CASES = int(os.environ.get("FLEDGE_CASES", 1500))
HEAD = struct.Struct("<IIQqII")
ROW = struct.Struct("<IBBHqQ")


def read(tmp_path, text):
    path = tmp_path / "s.xml"
    path.write_text(text, encoding="utf-8")
    return _ground.Database.read([(str(path), "")])


def values_of(monitor, frame):
    """A frame's values by slot: (t, concern, status, value)."""
    magic, craft, version, t, n, texts = HEAD.unpack_from(frame)
    assert magic == 0x31444C46 and craft == 0 and len(frame) == 32 + 24 * n + texts
    slots = monitor.slots()
    values_by_slot = {}
    for i in range(n):
        slot, concern, status, zero, when, word = ROW.unpack_from(frame, 32 + 24 * i)
        assert zero == 0 and slot not in values_by_slot
        kind, labels = slots[slot]["kind"], slots[slot]["labels"]
        signed = word - (word >> 63 << 64)
        if status in (1, 3):
            value = None
        elif kind == "real":
            value = struct.unpack("<d", struct.pack("<Q", word))[0]
        elif kind in ("integer", "time"):
            value = signed
        elif kind == "boolean":
            value = word == 1
        elif kind == "label":
            value = signed if status == 2 else labels[word]
        elif kind in ("text", "binary"):
            start = 32 + 24 * n + (word >> 32)
            value = frame[start:start + (word & 0xFFFFFFFF)]
            value = value.decode("utf-8", "replace") if kind == "text" else value
        else:
            value = word
        values_by_slot[slot] = (when, concern, status, value)
    return version, t, values_by_slot


def test_newest_values_and_frames_of_random_packets_are_what_the_decoder_gives(tmp_path):
    seen = undecoded = grown = 0
    for seed in range(CASES // 50):
        random = Random(seed)
        database = read(tmp_path, random.text)
        monitor = _ground.Monitor(database, "Root")
        newest, known, t = {}, len(monitor.slots()), 0
        for _ in range(25):
            batch = [(t := t + 1, 10 * t, random.packet()) for _ in range(2)]
            since = monitor.version
            notes = monitor.take(batch)
            before = dict(newest)
            for when, received, packet in batch:
                decoded = database.decode(packet, "Root")
                bad = [note for note in notes if note[:3] == ("undecoded", when, received)]
                assert [note[3:] for note in bad] == ([] if not decoded.reason else [(packet, decoded.reason)])
                undecoded += len(bad)
                if not decoded.reason:
                    newest.update({name: (when, received, raw, value) for name, raw, value in decoded.rows})
            first = [note[1] for note in notes if note[0] == "slots"]
            assert first[:1] == ([known] if len(monitor.slots()) > known else [])
            grown += len(first)
            known = len(monitor.slots())
            _, last, frame = values_of(monitor, monitor.changes(since)[1])
            for name, (when, received, raw, value) in newest.items():
                slot = monitor.slot(name)
                row = monitor.newest(slot)
                assert row[:2] == (when, received) and same(row[2], raw) and same(row[3], value), (seed, name)
                if before.get(name) != newest[name]:
                    assert frame[slot][0] == when and (same(frame[slot][3], value) or row[4] == "unlabelled"), name
                seen += 1
            assert not newest or last == t
            missing = {slot for first, end in monitor.missing() for slot in range(first, end + 1)}
            assert missing == {slot for slot in range(known) if monitor.newest(slot) is None}
    assert seen > 3 * CASES and undecoded > CASES / 20 and grown > 5


# --- limits

LEVELS = ["normal", "watch", "warning", "distress", "critical", "severe"]
NUMBERS = {"integer": ("Integer", "<IntegerDataEncoding sizeInBits='16' encoding='twosComplement'/>", lambda x: x),
           "calibrated": ("Float", "<IntegerDataEncoding sizeInBits='16' encoding='twosComplement'><DefaultCalibrator>"
                          "<PolynomialCalibrator><Term exponent='1' coefficient='0.5'/></PolynomialCalibrator>"
                          "</DefaultCalibrator></IntegerDataEncoding>", lambda x: x / 2)}


def spacecraft(types, parameters, more=""):
    """A database of one packet with these parameters, after their types: name -> type."""
    entries = "".join(f"<ParameterRefEntry parameterRef='{name}'/>" for name in parameters)
    return "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>" + types + "</ParameterTypeSet><ParameterSet>" \
        + "".join(f"<Parameter name='{name}' parameterTypeRef='{kind}'/>" for name, kind in parameters.items()) \
        + f"</ParameterSet><ContainerSet><SequenceContainer name='P'><EntryList>{entries}</EntryList>" \
        f"</SequenceContainer>{more}</ContainerSet></TelemetryMetaData></SpaceSystem>"


def integer(name, bits=8, attributes="", alarms=""):
    return f"<IntegerParameterType name='{name}'><IntegerDataEncoding sizeInBits='{bits}' {attributes}/>{alarms}" \
        "</IntegerParameterType>"


class Alarm:
    """A random alarm: its XML, and the level of a sample."""

    def __init__(self, r, calibrated):
        self.inside, self.change = r.random() < 0.3, r.random() < 0.2
        self.violations = r.choice([1, 1, 2, 3, 5])
        self.ranges = {}
        for level in r.sample(LEVELS[1:], r.randint(1, 5)):
            low, high = sorted(r.uniform(-40, 40) for _ in range(2))
            self.ranges[level] = (r.choice([None, low, round(low)]), r.choice([None, high, round(high)]),
                                  r.random() < 0.3, r.random() < 0.3, calibrated and r.random() < 0.3)
        tag = "ChangeAlarmRanges" if self.change else "StaticAlarmRanges"
        self.inside_xml = f"<{tag} rangeForm='{'inside' if self.inside else 'outside'}'>" + "".join(
            f"<{level.capitalize()}Range {self.ends(*self.ranges[level])}/>" for level in LEVELS
            if level in self.ranges) + f"</{tag}>"

    @staticmethod
    def ends(low, high, low_open, high_open, raw):
        attributes = "" if low is None else f"min{'Ex' if low_open else 'In'}clusive='{low!r}' "
        attributes += "" if high is None else f"max{'Ex' if high_open else 'In'}clusive='{high!r}' "
        return attributes + ("rangeAppliesToCalibrated='false'" if raw else "")

    def level(self, raw, value, last):
        """last: the raw value and the value before, or None."""
        worst = 0
        for level, (low, high, low_open, high_open, of_raw) in self.ranges.items():
            x = raw if of_raw else value
            if self.change:
                if last is None:
                    continue
                x -= last[0] if of_raw else last[1]
            above = low is None or (x > low if low_open and low is not None else x >= low)
            below = high is None or (x < high if high_open and high is not None else x <= high)
            if (above and below) == self.inside:
                worst = max(worst, LEVELS.index(level))
        return worst


def test_limits_of_random_alarms_with_contexts_and_persistence_are_those_of_a_few_lines_of_python(tmp_path):
    changes = 0
    for seed in range(CASES // 15):
        r = random.Random(seed)
        kind, encoding, calibrate = NUMBERS[r.choice(list(NUMBERS))]
        alarm, contexts = Alarm(r, encoding != NUMBERS["integer"][1]), \
            [Alarm(r, encoding != NUMBERS["integer"][1]) for _ in range(r.choice([0, 0, 1, 2]))]
        default = r.random() < 0.9
        xml = f"<DefaultAlarm minViolations='{alarm.violations}'>{alarm.inside_xml}</DefaultAlarm>" * default
        xml += "<ContextAlarmList>" + "".join(
            f"<ContextAlarm minViolations='{context.violations}'>{context.inside_xml}<ContextMatch><Comparison "
            f"parameterRef='mode' value='{i}'/></ContextMatch></ContextAlarm>"
            for i, context in enumerate(contexts)) + "</ContextAlarmList>"
        types = f"<{kind}ParameterType name='x'>{encoding}{xml}</{kind}ParameterType>" + integer("u8")
        monitor = _ground.Monitor(read(tmp_path, spacecraft(types, {"mode": "u8", "x": "x"})))
        slot, levels, concern, last = monitor.slot("x"), [], 0, None
        for t in range(150):
            mode, raw = r.choice([0, 0, 1, 2]), r.randint(-90, 90) if r.random() < 0.3 else \
                (last or [0])[0] + r.randint(-3, 3)
            active = contexts[mode] if mode < len(contexts) else alarm if default else None
            value = calibrate(raw)
            levels.append(active.level(raw, value, last) if active else 0)
            n = active.violations if active else 1
            now = min(levels[-n:]) if len(levels) >= n else 0
            assert monitor.take([(t, 0, struct.pack(">Bh", mode, raw))]) == \
                ([("concern", slot, t, concern, now)] if now != concern else []), f"seed {seed}, packet {t}"
            assert monitor.newest(slot)[5] == now
            changes += now != concern
            concern, last = now, (raw, value)
    assert changes > CASES


def test_labels_texts_and_numbers_that_are_none_have_their_concern(tmp_path):
    types = "<EnumeratedParameterType name='e'><IntegerDataEncoding sizeInBits='8'/><EnumerationList>" \
        "<Enumeration value='0' label='OFF'/><Enumeration value='1' label='ON'/><Enumeration value='2' label='SAFE'/>" \
        "</EnumerationList><DefaultAlarm defaultAlarmLevel='watch'><EnumerationAlarmList><EnumerationAlarm " \
        "enumerationLabel='ON' alarmLevel='normal'/><EnumerationAlarm enumerationLabel='SAFE' alarmLevel='critical'/>" \
        "</EnumerationAlarmList></DefaultAlarm></EnumeratedParameterType>" \
        "<StringParameterType name='s'><StringDataEncoding encoding='UTF-8'><SizeInBits><Fixed><FixedValue>32" \
        "</FixedValue></Fixed></SizeInBits></StringDataEncoding><DefaultAlarm><StringAlarmList><StringAlarm " \
        "matchPattern='A+.*' alarmLevel='warning'/></StringAlarmList></DefaultAlarm></StringParameterType>" \
        "<FloatParameterType name='f'><FloatDataEncoding sizeInBits='32'/><DefaultAlarm><StaticAlarmRanges>" \
        "<SevereRange minInclusive='-1' maxInclusive='1'/></StaticAlarmRanges></DefaultAlarm></FloatParameterType>"
    monitor = _ground.Monitor(read(tmp_path, spacecraft(types, {"e": "e", "s": "s", "f": "f"})))
    assert [(row["name"], row["kind"], row["labels"], row["limits"]) for row in monitor.slots()] == [
        ("e", "label", ["OFF", "ON", "SAFE"], {}), ("s", "text", [], {}), ("f", "real", [], {"severe": [-1, 1]})]
    for e, s, f, expected in [(1, b"BAAA", 1.0, (0, 0, 0)), (0, b"AAAB", -1.0, (1, 2, 0)),
                              (2, b"xA\xFF\0", 1.5, (4, 0, 5)), (7, b"\0\0\0\0", float("nan"), (1, 0, 5))]:
        monitor.take([(0, 0, struct.pack(">B4sf", e, s, f))])
        assert tuple(monitor.newest(slot)[5] for slot in range(3)) == expected
        frame = values_of(monitor, monitor.changes(0)[1])[2]
        assert frame[1][3] == s.rstrip(b"\0").decode("utf-8", "replace")
        assert tuple(frame[i][1] for i in range(3)) == expected
    assert monitor.newest(0)[3:5] == (7, "unlabelled") and frame[0][2:] == (2, 7)
    for slot in range(3):        # a person's limits, and those of the database again
        monitor.take([(1, 0, struct.pack(">B4sf", 2, b"AA\0\0", 9.0))])
        assert monitor.newest(slot)[5] == (4, 2, 5)[slot]
        assert [note[4] for note in monitor.set_limits(slot, {})] == [0] and monitor.slots()[slot]["replaced"] == (
            {"severe": [-1, 1]} if slot == 2 else {})
        assert [note[4] for note in monitor.set_limits(slot, None)] == [(4, 2, 5)[slot]]
    with pytest.raises(SetupError, match="pattern that is no regular expression"):
        _ground.Monitor(read(tmp_path, spacecraft(types.replace("A+.*", "A(+"), {"s": "s"})))


def test_an_administrator_sets_limits_and_they_count_at_once(tmp_path):
    monitor = _ground.Monitor(read(tmp_path, spacecraft(integer("u8"), {"x": "u8"})))
    monitor.take([(1, 0, b"\x20")])
    assert monitor.set_limits(0, {"warning": [None, 31], "critical": [0, 40]}) == [("concern", 0, 1, 0, 2)]
    assert monitor.slots()[0]["limits"] == {"warning": [None, 31], "critical": [0, 40]}
    assert values_of(monitor, monitor.changes(1)[1])[2] == {0: (1, 2, 0, 32)}
    assert monitor.take([(2, 0, b"\x50")]) == [("concern", 0, 2, 2, 4)]
    assert monitor.set_limits(0, {"warning": [0, 31]}, 3) == [("concern", 0, 2, 4, 0)]
    assert monitor.take([(3, 0, b"\x50")]) == [] and monitor.take([(4, 0, b"\x50")]) == [("concern", 0, 4, 0, 2)]
    assert monitor.slots()[0]["persistence"] == 3
    assert monitor.set_limits(0, {}) == [("concern", 0, 4, 2, 0)] and monitor.slots()[0]["limits"] == {}
    assert monitor.take([(5, 0, b"\x50")]) == []
    assert monitor.slots()[0]["replaced"] == {} and monitor.set_limits(0, None) == []
    assert monitor.slots()[0]["replaced"] is None and monitor.set_limits(0, None) == []
    for limits, why in [({"warning": [3, 2]}, "from the lower to the higher number; found 3 to 2"),
                        ({"warning": [float("nan"), 2]}, "found nan"), ({"loud": [1, 2]}, "found loud")]:
        with pytest.raises(SetupError, match=why):
            monitor.set_limits(0, limits)
    with pytest.raises(SetupError, match="no slot 7; there are 1"):
        monitor.set_limits(7, {})


# --- what else a monitor does

def test_derived_parameters_come_from_rows_of_their_inputs_in_the_order_of_packets(tmp_path):
    more = "<SequenceContainer name='Q'><EntryList><ParameterRefEntry parameterRef='tag'/><ParameterRefEntry " \
        "parameterRef='y'/></EntryList></SequenceContainer>"
    text = spacecraft(integer("u8"), {"tag": "u8", "x": "u8"}, more).replace(
        "</ParameterSet>", "<Parameter name='y' parameterTypeRef='u8'/></ParameterSet>")
    text = text.replace("</SequenceContainer>", "<BaseContainer containerRef='R'><RestrictionCriteria><Comparison "
                        "parameterRef='tag' value='1'/></RestrictionCriteria></BaseContainer></SequenceContainer>", 1)
    text = text.replace("<SequenceContainer name='P'><EntryList><ParameterRefEntry parameterRef='tag'/>",
                        "<SequenceContainer name='R' abstract='true'><EntryList><ParameterRefEntry parameterRef='tag'"
                        "/></EntryList></SequenceContainer><SequenceContainer name='P'><EntryList>")
    text = text.replace("<EntryList><ParameterRefEntry parameterRef='tag'/><ParameterRefEntry parameterRef='y'/>"
                        "</EntryList>", "<EntryList><ParameterRefEntry parameterRef='y'/></EntryList><BaseContainer "
                        "containerRef='R'><RestrictionCriteria><Comparison parameterRef='tag' value='2'/>"
                        "</RestrictionCriteria></BaseContainer>")
    monitor = _ground.Monitor(read(tmp_path, text))
    x, y = monitor.slot("x"), monitor.slot("/S/y")
    both, ys = monitor.trigger([x, y]), monitor.trigger([y])
    product = monitor.derive("product", "V", "of both", {"warning": [0, 50]}, 2)
    twice = monitor.trigger([product])
    monitor.take([(1, 0, b"\1\5"), (2, 9, b"\2\6"), (3, 9, b"\1\7"), (4, 9, b"\2\x08")])
    rows = list(struct.iter_unpack("<qdd", monitor.rows(both)))
    assert rows == [(2, 5, 6), (3, 7, 6), (4, 7, 8)] and monitor.rows(both) == b""
    assert list(struct.iter_unpack("<qd", monitor.rows(ys))) == [(2, 6), (4, 8)]
    t, values = struct.pack("<3q", *[row[0] for row in rows]), struct.pack("<3d", 30, 60, 56)
    assert monitor.put(product, t, values) == [("concern", product, 4, 0, 2)]
    assert monitor.newest(product) == (4, 9, 56, 56, "good", 2, 3)
    assert monitor.slots(product)[0] == {
        "slot": product, "name": "product", "path": "product", "container": None, "header": False, "kind": "real",
        "single": False, "unit": "V", "labels": [], "description": "of both", "limits": {"warning": [0, 50]},
        "persistence": 2, "replaced": None}
    assert monitor.put(product, t[:8], struct.pack("<d", float("nan"))) == []
    assert monitor.newest(product)[3:6] == (None, "uncalibrated", 2)
    assert len(monitor.rows(twice)) == 16 * 4
    for bad, why in [(lambda: monitor.put(x, t, values), "x comes in packets"),
                     (lambda: monitor.put(product, t, values[:8]), "found 3 and 1"),
                     (lambda: monitor.put(product, b"123", b""), "8 bytes each; found 3"),
                     (lambda: monitor.derive("x"), "there is a parameter x already"),
                     (lambda: monitor.trigger([99]), "no slot 99"), (lambda: monitor.rows(9), "no trigger 9"),
                     (lambda: monitor.changes(0, struct.pack("<I", 99)), "no slot 99"),
                     (lambda: monitor.slot("prodct"), "no parameter prodct; near it: product"),
                     (lambda: monitor.watch(["Z"]), "no container Z")]:
        with pytest.raises(SetupError, match=why):
            bad()


def test_packets_of_watched_containers_and_of_their_heirs_get_a_note(tmp_path):
    heir = "<SequenceContainer name='H'><EntryList/><BaseContainer containerRef='P'><RestrictionCriteria><Comparison " \
        "parameterRef='x' value='1'/></RestrictionCriteria></BaseContainer></SequenceContainer>"
    monitor = _ground.Monitor(read(tmp_path, spacecraft(integer("u8"), {"x": "u8"}, heir)))
    batch = [(1, 10, b"\1"), (2, 20, b"\2")]
    assert monitor.take(batch) == []
    assert [slot["header"] for slot in monitor.slots()] == [True]     # of P, where all packets begin
    monitor.watch(["P"])
    assert monitor.take(batch) == [("watched", "/S/H", 1, 10, b"\1"), ("watched", "/S/P", 2, 20, b"\2")]
    monitor.watch(["/S/H"])
    assert monitor.take(batch) == [("watched", "/S/H", 1, 10, b"\1")]


def test_an_inspection_says_where_values_lie_and_which_comparison_failed(tmp_path):
    rows = stopped = 0
    for seed in range(CASES // 50):
        random = Random(seed)
        database = read(tmp_path, random.text)
        monitor = _ground.Monitor(database, "Root")
        for _ in range(20):
            packet = random.packet()
            inspected, plain = monitor.inspect(packet), database.decode(packet, "Root")
            assert (inspected["container"], inspected["nearest"], inspected["reason"]) == \
                (plain.container, plain.nearest, plain.reason)
            assert len(inspected["rows"]) == len(plain.rows) and (inspected["bit"] is None or inspected["reason"])
            bits = int.from_bytes(packet, "big")
            for (name, raw, value, status, at, n), (wanted, raw_too, value_too) in zip(inspected["rows"], plain.rows):
                assert name == wanted and same(raw, raw_too) and same(value, value_too)
                assert at + n <= 8 * len(packet)
                if isinstance(raw, bytes):
                    assert int.from_bytes(raw, "big") == bits >> 8 * len(packet) - at - n & (1 << n) - 1
                rows += 1
            stopped += inspected["bit"] is not None
    assert rows > CASES and stopped > CASES / 50
    text = spacecraft(integer("u8") + integer("u4", 4), {"a": "u4", "b": "u4", "c": "u8"}).replace(
        "name='P'", "name='P' abstract='true'").replace("</ContainerSet>", "".join(
            f"<SequenceContainer name='H{i}'><EntryList><ParameterRefEntry parameterRef='c'/></EntryList>"
            f"<BaseContainer containerRef='P'><RestrictionCriteria><ComparisonList><Comparison parameterRef='a' "
            f"value='{i}'/><Comparison parameterRef='b' value='3'/></ComparisonList></RestrictionCriteria>"
            "</BaseContainer></SequenceContainer>" for i in range(2)) + "</ContainerSet>")
    monitor = _ground.Monitor(read(tmp_path, text))
    inspected = monitor.inspect(b"\x14\x99")
    assert (inspected["nearest"], inspected["bit"]) == ("/S/H1", 4) and "b == 3 (found 4)" in inspected["reason"]
    assert monitor.inspect(b"\x73\x99")["bit"] == 0
    short = monitor.inspect(b"\x13\x05")
    assert short["bit"] == 16 and "ends within c" in short["reason"] and short["rows"][1][4:] == (4, 4)


def test_readers_see_whole_batches_while_another_thread_takes(tmp_path):
    monitor = _ground.Monitor(read(tmp_path, spacecraft(integer("u32", 32), {f"p{i}": "u32" for i in range(50)})))
    taken, problems, over = 100, [], threading.Event()

    def reads():
        try:
            version = 0
            while not over.is_set() or version < taken:
                version, frame = monitor.changes(version)
                seen_values = {value for _, _, _, value in values_of(monitor, frame)[2].values()}
                if len(seen_values) > 1 or seen_values - {(version & 0xFFFFFF) * 10 + 9}:
                    problems.append((version, seen_values))
                monitor.newest(7), monitor.version, monitor.inspect(bytes(200))
        except Exception as error:              # it is the main thread's to tell
            problems.append(error)

    threads = [threading.Thread(target=reads) for _ in range(3)]
    for thread in threads:
        thread.start()
    for i in range(1, taken + 1):
        monitor.take([(i, i, struct.pack(">I", 10 * i + j) * 50) for j in range(10)])
    over.set()
    for thread in threads:
        thread.join()
    assert problems == []


def test_strange_batches_and_packets_are_refused_or_get_a_note(tmp_path):
    types = integer("u8") + "<ArrayParameterType name='l' arrayTypeRef='u8'><DimensionList><Dimension><StartingIndex>" \
        "<FixedValue>0</FixedValue></StartingIndex><EndingIndex><DynamicValue><ParameterInstanceRef " \
        "parameterRef='n'/></DynamicValue></EndingIndex></Dimension></DimensionList></ArrayParameterType>" \
        + integer("u16", 16)
    monitor = _ground.Monitor(read(tmp_path, spacecraft(types, {"n": "u16", "l": "l"})))
    for batch in [[(1, 2)], [(1, 2, "text")], [(1.5, 2, b"")], [None], [(1, 2, bytearray(3))], [(1 << 70, 2, b"")]]:
        with pytest.raises((TypeError, RuntimeError, ValueError)):
            monitor.take(batch)
    assert monitor.take([]) == [] and monitor.version == 0 and [slot["name"] for slot in monitor.slots()] == ["n"]
    assert monitor.take([(1, 0, b"")])[0][::4] == ("undecoded", "the packet ends within n")
    assert monitor.take([(1, 0, struct.pack(">H", 60000))])[0][0] == "undecoded" and monitor.newest(0) is None
    notes = monitor.take([(n, 0, struct.pack(">H", n) + bytes(n + 1)) for n in (2, 0, 5000)])
    assert notes == [("slots", 1), ("slots", 4)] and len(monitor.slots()) == 5002
    assert monitor.newest(monitor.slot("l[2]"))[::6] == (5000, 2)
    assert len(values_of(monitor, monitor.changes(0)[1])[2]) == 5002
    assert values_of(monitor, monitor.changes(0, struct.pack("<2I", 5, 0))[1])[2].keys() == {5, 0}
