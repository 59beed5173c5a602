# SPDX-License-Identifier: Apache-2.0
"""Telemetry in PostgreSQL, whose server the test starts: all that the archive has, and nothing twice."""
import os
import random
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace
from xml.sax.saxutils import quoteattr

import pytest

from tests.needs import module, skip_without

psycopg = module("psycopg")

from fledge.ground.server.postgres import Postgres, PostgresSettings
from fledge.ground.server.room import Room
from fledge.ground.server.settings import read
from fledge.errors import SetupError
from fledge.ground import Database
from tests.circles import long_after
from tests.tree import ROOT
from tests.waiting import wait_for

PROGRAMS = sorted(Path("/usr/lib/postgresql").glob("*/bin"))
S = 10**9
T0 = 1_700_000_000 * S
DATABASE = """<?xml version="1.0" encoding="UTF-8"?>
<SpaceSystem xmlns="http://www.omg.org/spec/XTCE/20180204" name="craft">
<TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="u8" signed="false">
<IntegerDataEncoding sizeInBits="8"/></IntegerParameterType>
<IntegerParameterType name="u32" signed="false">
<IntegerDataEncoding sizeInBits="32"/></IntegerParameterType>
<IntegerParameterType name="i64">
<IntegerDataEncoding sizeInBits="64" encoding="twosComplement"/></IntegerParameterType>
<FloatParameterType name="volt" sizeInBits="64"><UnitSet><Unit>V</Unit></UnitSet>
<FloatDataEncoding sizeInBits="64"/><DefaultAlarm><StaticAlarmRanges>
<WarningRange minInclusive="-1" maxInclusive="1"/></StaticAlarmRanges></DefaultAlarm></FloatParameterType>
<EnumeratedParameterType name="mode">
<IntegerDataEncoding sizeInBits="8"/>
<EnumerationList>
<Enumeration value="3" label="SAFE"/><Enumeration value="7" label="SCIENCE"/></EnumerationList>
</EnumeratedParameterType>
<StringParameterType name="word"><StringDataEncoding><SizeInBits><Fixed><FixedValue>48</FixedValue></Fixed>
</SizeInBits></StringDataEncoding></StringParameterType>
</ParameterTypeSet><ParameterSet><Parameter name="id" parameterTypeRef="u8"/>
<Parameter name="count" parameterTypeRef="u32"/>
<Parameter name="voltage" parameterTypeRef="volt"/>
<Parameter name="mode" parameterTypeRef="mode"/>
<Parameter name="big" parameterTypeRef="i64"/><Parameter name="note" parameterTypeRef="word"/></ParameterSet>
<ContainerSet>
<SequenceContainer name="packet" abstract="true"><EntryList><ParameterRefEntry parameterRef="id"/>
<ParameterRefEntry parameterRef="count"/></EntryList></SequenceContainer>
<SequenceContainer name="power"><EntryList><ParameterRefEntry parameterRef="voltage"/>
<ParameterRefEntry parameterRef="mode"/>
</EntryList>
<BaseContainer containerRef="packet"><RestrictionCriteria><Comparison parameterRef="id" value="1"/>
</RestrictionCriteria></BaseContainer></SequenceContainer>
<SequenceContainer name="words"><EntryList>
<ParameterRefEntry parameterRef="big"/><ParameterRefEntry parameterRef="note"/>
</EntryList>
<BaseContainer containerRef="packet"><RestrictionCriteria><Comparison parameterRef="id" value="2"/>
</RestrictionCriteria></BaseContainer></SequenceContainer></ContainerSet></TelemetryMetaData></SpaceSystem>
"""


class Base:
    """A server of PostgreSQL on a socket in a folder of its own, by a user that is not root."""

    def __init__(self, folder):
        self.folder = folder
        self.user = ["setpriv", "--reuid=65534", "--clear-groups", "--"] if os.getuid() == 0 else []
        self.url = f"host={folder} dbname=postgres user=fledge"
        if self.user:
            shutil.chown(folder, 65534)
        self.run("initdb", "-D", folder / "data", "-U", "fledge", "-A", "trust", "-N", "--no-locale", "-E", "UTF8")

    def run(self, program, *arguments):
        subprocess.run([*self.user, PROGRAMS[-1] / program, *map(str, arguments)], check=True, cwd="/",
                       stdout=subprocess.DEVNULL, env={"PATH": "/usr/bin:/bin", "LC_ALL": "C"})

    def start(self):
        self.run("pg_ctl", "-D", self.folder / "data", "-w", "-l", self.folder / "log", "-o",
                 f"-c listen_addresses= -c unix_socket_directories={self.folder} -c fsync=off", "start")

    def stop(self):
        self.run("pg_ctl", "-D", self.folder / "data", "-w", "-m", "immediate", "stop")

    def rows(self, query, *values):
        with psycopg.connect(self.url, autocommit=True) as connection:
            done = connection.execute(query, values)
            return done.fetchall() if done.description else []


@pytest.fixture(scope="module")
def started():
    skip_without("postgresql")
    with tempfile.TemporaryDirectory(prefix="pg", dir="/tmp") as folder:    # the path of a socket is short
        os.chmod(folder, 0o755)
        base = Base(Path(folder))
        base.start()
        yield base
        base.stop()


@pytest.fixture
def base(started):
    started.rows("drop schema if exists fledge cascade")
    return started


class Server:
    """What postgres.py knows of a control room: an archive that a test fills, and who hears of events."""

    def __init__(self, folder, base, **more):
        (folder / "craft.xml").write_text(DATABASE, encoding="utf-8")
        self.database = Database.load(folder / "craft.xml")
        self.craft = craft = SimpleNamespace(name="craft", telemetry=SimpleNamespace(database=self.database),
                                             settings=SimpleNamespace(root=None), epoch_ns=None, source=None,
                                             clock=SimpleNamespace(simulated=False), limits=SimpleNamespace(changes=[]))
        self.events = []
        room = SimpleNamespace(settings=SimpleNamespace(folder=folder), crafts={"craft": craft},
                               report=lambda *words: self.events.append(words))
        self.monitor = self.database.monitor()
        self.archive = self.database.archive(folder / "archive", "craft")
        self.monitor.sink(self.archive)
        self.postgres = Postgres(PostgresSettings.read({"url": base.url, "partition": "1 hour", **more}), room)

    def __enter__(self):
        self.postgres.start()
        return self

    def __exit__(self, *_):
        self.postgres.close()


def power(count, voltage=0.5, mode=3):
    return struct.pack(">BIdB", 1, count, voltage, mode)


def written(base):
    """Whether there is a table, and how many values."""
    try:
        return base.rows("select count(*) from fledge.value")[0][0]
    except psycopg.Error:
        return 0


def folder_of(path, name):
    (path / name).mkdir()
    return path / name


def test_all_kinds_of_values_are_as_they_were_decoded(tmp_path, base):
    with Server(tmp_path, base) as server:
        server.monitor.take([(T0 + 7, T0 + 1007, power(1)), (T0 + S + 8, T0 + S, power(2, 1.5, 7)),
                             (T0 + S + 8, T0 + S, power(3, float("nan"), 9)), (T0 + 2 * S, T0 + 2 * S, b"\5\0\0"),
                             (T0 + 3 * S, T0 + 3 * S, struct.pack(">BIq6s", 2, 4, -2**40, b'<"\xc3\xa9 1'))])
        wait_for(lambda: written(base) == 16)
    rows = base.rows("""select extract(epoch from t)::bigint, ns, parameter, unit, value, text, concern
                        from fledge.telemetry where parameter <> 'id' order by t, parameter""")
    assert sorted(rows[:3]) == [(T0 // S, 7, "count", "", 1.0, None, 0), (T0 // S, 7, "mode", "", 0.0, "SAFE", 0),
                                (T0 // S, 7, "voltage", "V", 0.5, None, 0)]
    second = {(name, value, text, concern) for _, _, name, _, value, text, concern in rows[3:9]}
    assert second == {("count", 2.0, None, 0), ("mode", 1.0, "SCIENCE", 0), ("voltage", 1.5, None, 2),
                      ("count", 3.0, None, 0), ("mode", None, "9", 0), ("voltage", None, None, 2)}
    assert {(row[2], row[4], row[5]) for row in rows[9:]} == {
        ("count", 4.0, None), ("big", -2.0**40, None), ("note", None, '<"é 1')}


def test_texts_of_a_database_and_of_packets_are_data_and_of_any_length(tmp_path, base, monkeypatch):
    """Also where an index would have no room for them; those of before are found again."""
    evil = "'); drop schema fledge cascade; --\x9b\u202e"
    words = random.Random(1).randbytes(8000).hex()
    monkeypatch.setattr(sys.modules[__name__], "DATABASE", DATABASE.replace(
        'label="SAFE"', f"label={quoteattr(evil + words)}"))
    for count in (1, 2):        # the parameters are the same at the second start
        with Server(folder_of(tmp_path, str(count)), base, server="one") as server:
            server.monitor.take([(T0 + count, T0 + count, power(count, 0.5, 3)), (
                T0 + count, T0 + count, struct.pack(">BIq6s", 2, 4, 1, b"a\0\xff'\x1b\\"))])
            wait_for(lambda: written(base) >= 4 if count == 1 else not server.events and server.postgres.problem == "")
            assert not server.events
    assert base.rows("select distinct text from fledge.telemetry where parameter = 'mode'") == [(evil + words,)]
    assert base.rows("select text from fledge.telemetry where parameter = 'note'")[0][0].startswith("a")
    assert base.rows("select count(*) from fledge.parameter where name = 'mode'") == [(1,)]


def test_the_concern_is_that_of_the_limits_in_force_when_a_packet_was_received(tmp_path, base):
    """Also of packets that the server had before the limits were changed, and the database has not yet."""
    server = Server(tmp_path, base)
    changes = [{"name": name, "kind": "real", "unit": "V", "limits": limits, "persistence": 1,
                "time_ns": str(T0 + at * S)}
               for at, name, limits in ((10, "voltage", {"critical": [0, 20]}), (20, "other", {"severe": [0, 0]}),
                                        (30, "voltage", {}), (40, "voltage", None))]
    server.craft.limits.changes += changes[:2]
    server.monitor.take([(T0 + i * S, T0 + i * S, power(i, i)) for i in range(30)])
    with server:
        wait_for(lambda: written(base) == 120)
        server.craft.limits.changes += changes[2:]
        server.monitor.take([(T0 + i * S, T0 + i * S, power(i, i)) for i in range(30, 50)])
        wait_for(lambda: written(base) == 200)
    rows = base.rows("select concern::int from fledge.telemetry where parameter = 'voltage' order by t")
    assert [row[0] for row in rows] == [2 * (i > 1) if i < 10 or i >= 40 else 4 * (i > 20) if i < 30 else 0
                                        for i in range(50)]


@pytest.mark.parametrize("seed", long_after(1, [1, 2], "more draws"))
def test_nothing_is_missing_or_twice_after_outages_of_either_side(tmp_path, base, seed):
    """The database is stopped without notice, the writer ends and begins, the archive goes on in sessions."""
    chance = random.Random(seed)
    server = Server(tmp_path, base)
    server.__enter__()
    sent, t = 0, T0
    try:
        for turn in range(8):
            batch = []
            for _ in range(chance.randrange(1, 400)):
                t += chance.choice([0, 0, 1, 10**6, 60 * S])        # some at the same time, some hours apart
                sent += 1
                batch.append((t, t, power(sent)))
            server.monitor.take(batch)
            if turn in (2, 5):
                base.stop()
                server.monitor.take([(t, t, power(sent + 1))])
                sent += 1
                base.start()
            elif turn == 3:
                wait_for(lambda: written(base) > 0)
                server.postgres.close()
                server.postgres = Postgres(server.postgres.settings, server.postgres.room)
                server.postgres.start()
            elif turn == 6:         # another session, whose times begin before
                t -= 3000 * S
        wait_for(lambda: written(base) == 4 * sent)
    finally:
        server.__exit__()
    assert base.rows("select value from fledge.telemetry where parameter = 'count' order by value") == [
        (float(i + 1),) for i in range(sent)]
    ends = base.rows("select count(*) from pg_inherits where inhparent = 'fledge.value'::regclass")
    assert ends[0][0] > 1 and [event for event in server.events if "caught up" in event[3]]


def test_two_servers_of_one_spacecraft_are_distinguished_and_a_view_has_each_packet_once(tmp_path, base):
    """Each misses some packets, and receives the others at its own times."""
    chance = random.Random(3)
    names = ["north", "south"]
    servers = [Server(folder_of(tmp_path, name), base, server=name, parameters=["c?unt", "volt*"]) for name in names]
    received = [[i for i in range(1, 300) if chance.random() < 0.7] for _ in servers]
    for server, mine in zip(servers, received):
        t = [T0 + i * S + chance.randrange(10**8) for i in mine]
        server.monitor.take([(at, at, power(i)) for at, i in zip(t, mine)])
    with servers[0], servers[1]:
        wait_for(lambda: written(base) == 2 * sum(map(len, received)))
    rows = base.rows("select value::int from fledge.telemetry where parameter = 'count' order by 1")
    assert [row[0] for row in rows] == sorted({*received[0], *received[1]})
    assert base.rows("select s.name, count(*)::int from fledge.value v join fledge.server s on s.id = v.server "
                     "group by 1 order by 1") == [(name, 2 * len(mine)) for name, mine in zip(names, received)]


def test_the_queries_of_the_document_run(tmp_path, base):
    """As Grafana sends them: its macros become what its documents say."""
    with Server(tmp_path, base) as server:
        server.monitor.take([(T0 + i * S, T0 + i * S, power(i, i / 50)) for i in range(100)])
        wait_for(lambda: written(base) == 400)
    text = (ROOT / "docs/control-room.md").read_text(encoding="utf-8")
    queries = [part.split("```")[0] for part in text.split("```mysql\n")[1:]]
    assert len(queries) >= 4
    for query in queries:
        for old, new in (("$__timeFilter(t)", "t between '2023-11-14T22:13:20Z' and '2023-11-14T22:20:00Z'"),
                         ("$__timeGroup(t, '10s')", "floor(extract(epoch from t) / 10) * 10"),
                         ("flight.power.voltage", "voltage"), ("imager", "craft")):
            query = query.replace(old, new)
        assert base.rows(query), query


def test_a_flight_of_the_server_is_in_the_database_as_in_its_archive(tmp_path, base):
    (tmp_path / "ground.toml").write_text(
        f'folder = "out"\n[postgres]\nurl = "{base.url}"\n'
        'parameters = ["flight.tracking.*", "flight.housekeeping.mode"]\n[[craft]]\nname = "imager"\n'
        'mission = "earth_imager"\nspeed = 0\n')
    room = Room(read(tmp_path / "ground.toml"))
    craft = room.crafts["imager"]
    try:
        room.start()
        wait_for(lambda: craft.clock.now > 60 * S)
        craft.call(lambda: craft.run.command("pause", 1.0, None)).result(60)
        name = "flight.tracking.error.sigma_BR[1]"
        t, value, *_ = craft.telemetry.history.series([name])[name]
        wait_for(lambda: base.rows("select count(*) from pg_tables where tablename = 'progress'")[0][0] and base.rows(
            "select t_ns from fledge.progress") == [(int(craft.telemetry.history.sessions()[-1]["last"]),)])
        assert len(t) > 50 and base.rows(
            "select (extract(epoch from t) * 1000000)::bigint * 1000 + ns - %s, value from fledge.telemetry "
            "where spacecraft = 'imager' and parameter = %s order by t, ns", craft.epoch_ns, name) == list(
                zip(t.tolist(), value.tolist()))
        assert base.rows("select distinct parameter from fledge.telemetry where parameter !~ '^flight.tracking'") == [
            ("flight.housekeeping.mode",)]
    finally:
        room.close()


@pytest.mark.parametrize("table, says", [
    ({}, "has a url"), ({"url": "host=a", "table": 1}, "not table"), ({"url": "what is it"}, "no address"),
    ({"url": "host=a", "parameters": "x"}, "list of names"), ({"url": "host=a", "partition": "1 month"}, "1 month"),
    ({"url": "host=a", "partition": 3}, "3"), ({"url": "host=a", "server": 3}, "3")])
def test_wrong_settings_are_refused(table, says):
    with pytest.raises(SetupError, match=says):
        PostgresSettings.read(table)


def test_what_is_wrong_in_the_database_is_reported_and_the_server_goes_on(tmp_path, base):
    with Server(tmp_path, base):
        wait_for(lambda: base.rows("select to_regclass('fledge.setting')")[0][0] is not None)
    with Server(folder_of(tmp_path, "other"), base, partition="2 days") as other:
        wait_for(lambda: other.events)
        assert "partitions of 1 hours" in other.events[0][3]
    third = Server(folder_of(tmp_path, "third"), base, parameters=["volt*"])
    third.monitor.take([(T0, T0, power(1))])
    (tmp_path / "foreign.xml").write_text(DATABASE.replace("voltage", "current"), encoding="utf-8")
    foreign = SimpleNamespace(**{**vars(third.postgres.room.crafts["craft"]), "name": "foreign",
                                 "telemetry": SimpleNamespace(
                                     database=Database.load(tmp_path / "foreign.xml"))})
    third.postgres.room.crafts = {"foreign": foreign, **third.postgres.room.crafts}
    with third:
        wait_for(lambda: written(base) == 1)
    (name, *_, text), = third.events
    assert name == "foreign" and "no parameter as volt*; one is id" in text
