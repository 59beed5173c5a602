# SPDX-License-Identifier: Apache-2.0
"""Times of XTCE by their epochs: the time scales of Fledge's world are the second computation, for leap seconds."""
import random
import struct
from datetime import datetime, timedelta

import pytest

from fledge import SetupError
from fledge.cli import main
from fledge.ground import Database
from fledge.scene.testing.node import in_node, needs_node
from fledge.world import Sky

S = 10**9
EPOCHS = ["UNIX", "J2000", "TAI", "GPS", "2000-01-01T12:00:00", "1980-01-06", "2015-07-01T00:00:00Z"]
SCALES = {"J2000": "2000-01-01T12:00:00 TT", "TAI": "1958-01-01T00:00:00 TAI", "GPS": "1980-01-06T00:00:00 GPS"}


def database(tmp_path, times=EPOCHS):
    """A packet and a command with a time of each epoch, 64 bits of ns, and a duration of 64 bits of ms."""
    encoding = '<Encoding scale="{}"><IntegerDataEncoding sizeInBits="64" encoding="twosComplement"/></Encoding>'
    names = [f"t{i}" for i in range(len(times))]

    def types(kind):
        return "".join(f'<AbsoluteTime{kind}Type name="{name}">{encoding.format("1e-9")}<ReferenceTime><Epoch>{epoch}'
                       f"</Epoch></ReferenceTime></AbsoluteTime{kind}Type>" for name, epoch in zip(names, times)) + \
            f'<RelativeTime{kind}Type name="d">{encoding.format("0.001")}</RelativeTime{kind}Type>'

    names.append("d")
    (tmp_path / "s.xml").write_text(
        f'<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>{types("Parameter")}</ParameterTypeSet>'
        f'<ParameterSet>{"".join(f"<Parameter name={n!r} parameterTypeRef={n!r}/>" for n in names)}</ParameterSet>'
        '<ContainerSet><SequenceContainer name="P"><EntryList>'
        f'{"".join(f"<ParameterRefEntry parameterRef={n!r}/>" for n in names)}</EntryList></SequenceContainer>'
        f'</ContainerSet></TelemetryMetaData><CommandMetaData><ArgumentTypeSet>{types("Argument")}</ArgumentTypeSet>'
        f'<MetaCommandSet><MetaCommand name="C"><ArgumentList>'
        f'{"".join(f"<Argument name={n!r} argumentTypeRef={n!r}/>" for n in names)}</ArgumentList>'
        '<CommandContainer name="CC"><EntryList>'
        f'{"".join(f"<ArgumentRefEntry argumentRef={n!r}/>" for n in names)}'
        "</EntryList></CommandContainer></MetaCommand></MetaCommandSet></CommandMetaData></SpaceSystem>")
    return Database.load(tmp_path / "s.xml")


def test_times_are_those_of_the_worlds_scales_back_and_forth(tmp_path):
    chance, craft, sky = random.Random(1), database(tmp_path), Sky("2000-01-01T12:00:00 TDB", center="earth")
    for _ in range(300):
        date = datetime(1972, 1, 2) + timedelta(seconds=chance.randrange(63 * 365 * 86400))
        if chance.random() < 0.3:       # near the leap seconds
            date = datetime(chance.choice([1980, 1999, 2006, 2009, 2017]), 1, 1) + timedelta(
                seconds=chance.randrange(-3, 3))
        now, texts = sky.time_ns_of(f"{date.isoformat()} UTC"), f"{date.isoformat()}.25Z"
        unix = (date - datetime(1970, 1, 1)) // timedelta(seconds=1) * S + S // 4
        counts = []
        for epoch in EPOCHS:
            if epoch == "UNIX":
                counts.append(unix)
                continue
            if epoch in SCALES:     # the readings of two clocks of a scale, for TDB's seconds are not those of TAI
                tai = sky._core.text(now, "TAI").removesuffix(" TAI")
                begin = sky._core.text(sky.time_ns_of(SCALES[epoch]), "TAI").removesuffix(" TAI")
            else:
                tai, begin = (sky._core.text(sky.time_ns_of(f"{text} UTC"), "TAI").removesuffix(" TAI")
                              for text in (date.isoformat(), epoch.removesuffix("Z")))
            counts.append((datetime.fromisoformat(tai) - datetime.fromisoformat(begin)) // timedelta(microseconds=1)
                          * 1000 + S // 4)
        packet = struct.pack(f">{len(EPOCHS) + 1}q", *counts, -1500)
        decoded = craft.decode(packet)
        assert list(decoded.values.values()) == [unix] * len(EPOCHS) + [-1500 * 10**6], date
        assert decoded.fields == [("time", "UTC")] * len(EPOCHS) + [("duration", "s")]
        for given in (unix, texts):
            times = dict.fromkeys([f"t{i}" for i in range(len(EPOCHS))], given)
            command = craft.encode("C", **times, d=-1500 * 10**6 if given == unix else "-1.5 s")
            assert command == packet, (date, given)
            assert craft.decode_command(command).arguments == dict.fromkeys(times, unix) | {"d": -1500 * 10**6}


def test_a_leap_second_has_a_count_of_its_own(tmp_path):
    craft = database(tmp_path)

    def counts(text):
        times = {f"t{i}": text for i in range(len(EPOCHS))}
        return struct.unpack(f">{len(EPOCHS)}q", craft.encode("C", **times, d=0)[:-8])

    for year in (1979, 1998, 2005, 2008, 2016):
        before, within, behind = map(counts, (f"{year}-12-31T23:59:59.25Z", f"{year}-12-31T23:59:60.25Z",
                                              f"{year + 1}-01-01T00:00:00.25Z"))
        assert [b - a for a, b in zip(before, within)] == [S] * len(EPOCHS)
        assert [b - a for a, b in zip(within, behind)] == [0 if epoch == "UNIX" else S for epoch in EPOCHS]


def test_what_is_no_time_is_refused_in_words(tmp_path):
    craft = database(tmp_path, ["GPS"])
    assert [(form["name"], form["type"], form["unit"]) for form in craft.forms()[0]["arguments"]] == [
        ("t0", "time", "UTC"), ("d", "duration", "ns")]
    for arguments, why in [({"t0": "noon", "d": 0}, "t0 must be a date, as 2026-03-01T12:00:00.5Z, or .ns. since 1970"),
                           ({"t0": 0, "d": "1 h"}, "d must be a duration, as 1.5 s or PT1.5S, or .ns.; found 1 h"),
                           ({"t0": float("nan"), "d": 0}, "t0 must be a"),
                           ({"t0": float("inf"), "d": 0}, "t0 must be a time; found inf")]:
        with pytest.raises(SetupError, match=why):
            craft.encode("C", **arguments)


def test_packets_as_text_have_dates_and_durations(tmp_path, capsys):
    database(tmp_path, ["GPS"])
    (tmp_path / "p.bin").write_bytes(struct.pack(">qq", 1_000_000_000 * S + 5, 90_500))
    craft = Database.load(tmp_path / "s.xml")
    assert craft.decode((tmp_path / "p.bin").read_bytes()).values == {"t0": 1_315_964_785 * S + 5, "d": 90_500 * 10**6}
    words = craft.monitor().inspect((tmp_path / "p.bin").read_bytes())["rows"]
    assert [row[2] for row in words] == ["2011-09-14T01:46:25.000000005Z", "90.5 s"]
    packet = struct.pack(">HHH", 0x0805, 0xC000, 15) + struct.pack(">qq", 1_000_000_000 * S, 90_500)
    text = (tmp_path / "s.xml").read_text().replace('<EntryList><ParameterRefEntry parameterRef=\'t0\'/>', (
        "<EntryList><ParameterRefEntry parameterRef='h'/><ParameterRefEntry parameterRef='t0'/>"), 1).replace(
        "<ParameterSet>", "<ParameterSet><Parameter name='h' parameterTypeRef='h'/>").replace(
        "<ParameterTypeSet>", "<ParameterTypeSet><IntegerParameterType name='h'><IntegerDataEncoding sizeInBits='48'/>"
        "</IntegerParameterType>")
    (tmp_path / "s.xml").write_text(text)
    (tmp_path / "p.bin").write_bytes(packet)
    assert main(["packets", str(tmp_path / "p.bin"), "--database", str(tmp_path / "s.xml")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:3] for line in lines[2:]] == [
        ["t0", "2011-09-14T01:46:25Z", "(raw"], ["d", "90.5", "s"]]


@needs_node
def test_the_console_shows_dates_and_durations_with_all_digits():
    web = "SOURCES/../../../ground/console/web"
    times = [0, 1_315_964_785 * S + 5, 1_790_000_000_123 * 10**6, -1, 1_500_000_001_000, -12_345 * 10**6, -S]
    dates = [(datetime(1970, 1, 1) + timedelta(seconds=t // S)).isoformat(" ") + "." + f"{t % S:09}" for t in times]
    shown = in_node(f"""
        import {{clock, dateText, secondsText}} from "{web}/format.js";
        const times = {list(map(str, times))}.map(BigInt);
        console.log(JSON.stringify([times.map((t) => clock(t, true, 9)), times.map(dateText),
            times.map(secondsText), times.map((t) => clock(t, true, 0))]));
    """)
    assert shown[0] == dates and shown[3] == [date[:19] for date in dates]
    assert [date.ljust(29, "0") for date in shown[1]] == dates and shown[1][0] == "1970-01-01 00:00:00.000"
    assert shown[2] == ["0", "1315964785.000000005", "1790000000.123", "\N{MINUS SIGN}0.000000001", "1500.000001",
                        "\N{MINUS SIGN}12.345", "\N{MINUS SIGN}1"]


@needs_node
def test_the_console_takes_the_dates_and_durations_that_the_encoder_takes(tmp_path):
    craft = database(tmp_path, ["GPS"])
    texts = {"time": ["2026-03-01", "2026-03-01 12:00:00.5", "2026-03-01T12:00:00Z", "2026-03-01T12:00:00.5+01:00",
                      "+5", "1790000000000000000", "noon", "2026-03-01 12:00", "1.5", ""],
             "duration": ["1.5 s", "20ms", "-3 us", "+1 ns", "5", "-PT1.5S", "P1DT1H", "1.5", "1 h", "s", "2026-03-01"]}
    given = in_node(f"""
        import {{timeGiven}} from "SOURCES/../../../ground/console/web/format.js";
        const texts = {texts};
        console.log(JSON.stringify(Object.entries(texts).map(
            ([kind, all]) => all.map((text) => timeGiven(kind, text)))));
    """)
    for (kind, all_), found in zip(texts.items(), given):
        good = [text for text, answer in zip(all_, found) if "value" in answer]
        assert len(good) == {"time": 6, "duration": 7}[kind], good
        for text, answer in zip(all_, found):
            arguments = {"t0": 315964800 * S, "d": 0} | {"time": {"t0": answer.get("value", text)},
                                                         "duration": {"d": answer.get("value", text)}}[kind]
            if "value" in answer:
                craft.encode("C", **arguments)
            else:
                assert "is needed" in answer["problem"]
                with pytest.raises(SetupError):
                    craft.encode("C", **arguments)
