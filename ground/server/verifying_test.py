# SPDX-License-Identifier: Apache-2.0
"""The verifiers of a database, against a spacecraft that answers by UDP as the test says."""
import asyncio
import struct
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from fledge import SetupError
from fledge.ground.server import clock as clock_module
from fledge.ground.server.web_test import console
from fledge.ground import Database
from tests.waiting import PATIENCE

SHORT, LONG = "PT0.2S", "PT60S"
ACCEPT, REJECT, STATUS = 1, 2, 3        # APIDs
MODES = ("SAFE", "WORK")


def container(name, apid, *entries):
    inside = "".join(f'<ParameterRefEntry parameterRef="{entry}"/>' for entry in entries)
    return (f'<SequenceContainer name="{name}"><EntryList>{inside}</EntryList><BaseContainer containerRef="Packet">'
            f'<RestrictionCriteria><Comparison parameterRef="head" value="{2048 + apid}"/></RestrictionCriteria>'
            '</BaseContainer></SequenceContainer>')


def verifier(stage, what, stop=LONG, more="", relative="timeLastVerifierPassed"):
    window = f'<CheckWindow timeToStopChecking="{stop}" timeWindowIsRelativeTo="{relative}"/>' * bool(stop)
    return f"<{stage}Verifier>{what}{window}{more}</{stage}Verifier>"


def command(name, code, verifiers, base="Base", arguments=()):
    given = "".join(f'<Argument name="{name}" argumentTypeRef="{kind}"/>' for name, kind in arguments)
    entries = "".join(f'<ArgumentRefEntry argumentRef="{name}"/>' for name, _ in arguments)
    return (f'<MetaCommand name="{name}"><BaseMetaCommand metaCommandRef="{base}"/>'
            + f"<ArgumentList>{given}</ArgumentList>" * bool(given)
            + f'<CommandContainer name="{name}"><EntryList><FixedValueEntry binaryValue="{code:02X}" sizeInBits="8"/>'
            f'{entries}</EntryList><BaseContainer containerRef="Base"/></CommandContainer>'
            + f"<VerifierSet>{verifiers}</VerifierSet>" * bool(verifiers) + "</MetaCommand>")


ACCEPTED = '<ContainerRef containerRef="Accept"/>'
HEALTHY = '<Comparison parameterRef="healthy" value="1"/>'
ECHO = ('<BooleanExpression><Condition><ParameterInstanceRef parameterRef="token"/><ComparisonOperator>=='
        '</ComparisonOperator><ParameterInstanceRef parameterRef="{}"/></Condition></BooleanExpression>')
DATABASE = f"""<?xml version="1.0"?>
<SpaceSystem name="Sat" xmlns="http://www.omg.org/spec/XTCE/20180204"><TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="u16" signed="false"><IntegerDataEncoding sizeInBits="16"/></IntegerParameterType>
<EnumeratedParameterType name="mode"><IntegerDataEncoding sizeInBits="16"/><EnumerationList>
<Enumeration value="0" label="SAFE"/><Enumeration value="1" label="WORK"/></EnumerationList></EnumeratedParameterType>
</ParameterTypeSet><ParameterSet>
{"".join(f'<Parameter name="{one}" parameterTypeRef="u16"/>'
         for one in ("head", "count", "size", "token", "reason", "counter", "healthy"))}
<Parameter name="mode" parameterTypeRef="mode"/></ParameterSet><ContainerSet>
<SequenceContainer name="Packet" abstract="true"><EntryList><ParameterRefEntry parameterRef="head"/>
<ParameterRefEntry parameterRef="count"/><ParameterRefEntry parameterRef="size"/></EntryList></SequenceContainer>
{container("Accept", ACCEPT, "token")}{container("Reject", REJECT, "reason")}
{container("Status", STATUS, "mode", "counter", "healthy")}</ContainerSet></TelemetryMetaData>
<CommandMetaData><ArgumentTypeSet><IntegerArgumentType name="n" signed="false"><IntegerDataEncoding sizeInBits="16"/>
</IntegerArgumentType><EnumeratedArgumentType name="m"><IntegerDataEncoding sizeInBits="16"/><EnumerationList>
<Enumeration value="0" label="SAFE"/><Enumeration value="1" label="WORK"/></EnumerationList></EnumeratedArgumentType>
</ArgumentTypeSet><MetaCommandSet>
<MetaCommand name="Base" abstract="true"><CommandContainer name="Base"><EntryList>
<FixedValueEntry binaryValue="1864C0000000" sizeInBits="48"/></EntryList></CommandContainer><VerifierSet>
{verifier("Accepted", ACCEPTED, relative="commandRelease")}
{verifier("Failed", '<ContainerRef containerRef="Reject"/>', more='<ReturnParmRef parameterRef="reason"/>')}
</VerifierSet></MetaCommand>
<MetaCommand name="Sound" abstract="true"><BaseMetaCommand metaCommandRef="Base"/><VerifierSet>
{verifier("Complete", HEALTHY)}</VerifierSet></MetaCommand>
{command("SET", 1, verifier("Complete", ECHO.format("/yamcs/cmd/arg/mode").replace("token", "mode")), "Base",
         [("mode", "m")])}
{command("COUNT", 2, verifier("Execution", ACCEPTED, more="<PercentComplete><FixedValue>50</FixedValue>"
                              "</PercentComplete>") + verifier("Complete", '<ParameterValueChange><ParameterRef '
         'parameterRef="counter"/><Change value="2"/></ParameterValueChange>'), "Sound")}
{command("OWN", 3, verifier("Accepted", ECHO.format("/yamcs/cmd/arg/n")), "Base", [("n", "n")])}
{command("NUMBERED", 4, verifier("Accepted", ECHO.format("/yamcs/cmdHist/ccsds-seqcount")))}
{command("HASTY", 5, verifier("Accepted", ACCEPTED, SHORT, relative="commandRelease") + verifier("Complete", HEALTHY))}
{command("NEVER", 6, verifier("Complete", HEALTHY, SHORT))}
{command("BOTH", 7, verifier("Complete", '<ComparisonList><Comparison parameterRef="mode" value="WORK"/><Comparison '
         'parameterRef="counter" comparisonOperator="&gt;=" value="10"/></ComparisonList>'))}
{command("OTHER", 8, verifier("Accepted", '<Comparison parameterRef="/yamcs/x" value="1"/>')
         + verifier("Queued", '<CustomAlgorithm name="theirs"/>'))}
</MetaCommandSet></CommandMetaData></SpaceSystem>"""


def packet(apid, *words):
    return struct.pack(f">{3 + len(words)}H", 2048 + apid, 0xC000, 2 * len(words) - 1, *words)


class Craft(asyncio.DatagramProtocol):
    """The spacecraft: what it got, and what it says."""

    def __init__(self):
        self.got = asyncio.Queue()

    @classmethod
    async def begin(cls):
        loop = asyncio.get_running_loop()
        other, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, ("127.0.0.1", 0))
        _, port = other.get_extra_info("sockname")
        other.close()
        craft = (await loop.create_datagram_endpoint(cls, ("127.0.0.1", 0), ("127.0.0.1", port)))[1]
        craft.link = f"udp://127.0.0.1:{craft.wire.get_extra_info('sockname')[1]}?listen={port}"
        return craft

    def connection_made(self, transport):
        self.wire = transport

    def datagram_received(self, data, _):
        self.got.put_nowait(data)

    def error_received(self, _):
        """No client listens yet."""

    def say(self, apid, *words):
        self.wire.sendto(packet(apid, *words))


def stages(row):
    return [(stage["stage"], stage["good"]) for stage in row["stages"]]


class Desk:
    """The console of the one spacecraft."""

    def __init__(self, c, craft):
        self.c, self.craft = c, craft

    async def send(self, name, **arguments):
        """Its number in the journal, and the packet as the spacecraft got it."""
        number = (await self.c.post("crafts/sat/send", {"name": f"/Sat/{name}", "arguments": arguments}))["id"]
        return number, await asyncio.wait_for(self.craft.got.get(), PATIENCE)

    async def row(self, number, *wanted):
        """The row when it has these stages behind the release."""
        rows = await self.c.until("crafts/sat/sent", lambda rows: [
            row for row in rows if row["id"] == number and stages(row) == [("released", True), *wanted]])
        return next(row for row in rows if row["id"] == number)


@pytest.fixture
def desk(tmp_path):
    """Run a test at the desk of the spacecraft."""
    async def run(test):
        craft = await Craft.begin()
        (tmp_path / "sat.xml").write_text(DATABASE)
        text = f'[[craft]]\nname = "sat"\ndatabase = ["sat.xml"]\nroot = "/Sat/Packet"\nlink = "{craft.link}"\n'
        async with console(tmp_path, text) as c:
            await c.until("crafts", lambda rows: rows[0]["link"]["up"])
            await test(Desk(c, craft), craft)
        craft.wire.close()

    return lambda test: asyncio.run(asyncio.wait_for(run(test), PATIENCE))


def test_a_command_is_accepted_and_completed(desk):
    async def test(console, craft):
        craft.say(STATUS, 1, 5, 0)      # WORK already: what was before the command verifies nothing
        await console.c.until("crafts", lambda rows: rows[0]["packets"] == 1)
        number, got = await console.send("SET", mode="WORK")
        assert got == bytes.fromhex("1864c0000002010001")   # the length is filled in
        craft.say(STATUS, 0, 5, 0)
        craft.say(ACCEPT, 0)
        row = await console.row(number, ("accepted", True))
        craft.say(STATUS, 1, 5, 0)
        row = await console.row(number, ("accepted", True), ("completed", True))
        assert [stage["text"] for stage in row["stages"][1:]] == ["/Sat/Accept", "mode == argument mode"]
        times = [int(stage["t_ns"]) for stage in row["stages"]]
        packets = await console.c.get("crafts/sat/packets")
        assert times == sorted(times) and [times[2], times[1]] == [int(packets[0]["t_ns"]), int(packets[1]["t_ns"])]

    desk(test)


def test_complete_verifiers_are_added_and_others_replace(desk):
    async def test(console, craft):
        craft.say(STATUS, 0, 5, 0)
        await console.c.until("crafts", lambda rows: rows[0]["packets"] == 1)
        number, _ = await console.send("COUNT")
        craft.say(ACCEPT, 0)
        row = await console.row(number, ("accepted", True), ("progress", True))
        assert row["stages"][-1]["percent"] == 50
        for counter, healthy in ((6, 1), (6, 0)):       # healthy, but only one more
            craft.say(STATUS, 0, counter, healthy)
        await console.c.until("crafts", lambda rows: rows[0]["packets"] == 4)
        await console.row(number, ("accepted", True), ("progress", True))
        craft.say(STATUS, 0, 7, 0)
        await console.row(number, ("accepted", True), ("progress", True), ("completed", True))
        both, _ = await console.send("BOTH")        # its own Accepted is that of Base
        for mode, counter in ((1, 9), (0, 10)):
            craft.say(STATUS, mode, counter, 0)
        await console.c.until("crafts", lambda rows: rows[0]["packets"] == 7)
        await console.row(both)
        craft.say(STATUS, 1, 10, 0)
        row = await console.row(both, ("completed", True))
        assert row["stages"][-1]["text"] == "mode == WORK and counter >= 10"

    desk(test)


def test_a_refusal_says_why_and_ends_the_ladder(desk):
    async def test(console, craft):
        number, _ = await console.send("SET", mode="SAFE")
        craft.say(ACCEPT, 0)
        craft.say(REJECT, 42)
        row = await console.row(number, ("accepted", True), ("failed", False))
        assert row["stages"][-1]["text"] == "/Sat/Reject: 42"
        craft.say(STATUS, 0, 0, 0)
        await console.c.until("crafts", lambda rows: rows[0]["packets"] == 3)
        await console.row(number, ("accepted", True), ("failed", False))

    desk(test)


def test_a_window_that_ends_fails_its_stage_and_its_text_gets_a_late_answer(desk):
    async def test(console, craft):
        number, _ = await console.send("HASTY")
        row = await console.row(number, ("accepted", False))        # while nothing arrives
        assert row["stages"][-1]["text"] == "no /Sat/Accept within 0.2 s of the release"
        assert int(row["stages"][-1]["t_ns"]) == int(row["t_ns"]) + 200_000_000
        craft.say(ACCEPT, 0)
        await console.c.until("crafts/sat/sent", lambda rows: "s after the release" in rows[0]["stages"][-1]["text"])
        craft.say(STATUS, 0, 0, 1)      # its own window is longer
        row = await console.row(number, ("accepted", False), ("completed", True))
        never, _ = await console.send("NEVER")
        craft.say(ACCEPT, 0)
        row = await console.row(never, ("accepted", True), ("failed", False))
        assert row["stages"][-1]["text"] == "no healthy == 1 within 0.2 s of the verifier before"
        assert int(row["stages"][-1]["t_ns"]) == int(row["stages"][1]["t_ns"]) + 200_000_000

    desk(test)


def test_two_commands_at_once(desk):
    async def test(console, craft):
        numbers = [(await console.send("OWN", n=n))[0] for n in (7, 8)]
        craft.say(ACCEPT, 8)
        row = await console.row(numbers[1], ("accepted", True))
        await console.row(numbers[0])
        craft.say(ACCEPT, 7)
        await console.row(numbers[0], ("accepted", True))
        assert row["stages"][-1]["text"] == "token == argument n"
        sent = [await console.send("NUMBERED") for _ in range(2)]
        counts = [int.from_bytes(got[2:4], "big") & 0x3FFF for _, got in sent]
        assert counts == [2, 3]
        craft.say(ACCEPT, 3)
        await console.row(sent[1][0], ("accepted", True))
        await console.row(sent[0][0])
        rows = [await console.send("SET", mode="WORK") for _ in range(2)]   # the answer is the same for both
        craft.say(ACCEPT, 0)
        for number, _ in rows:
            assert "does not tell whose" in (await console.row(number, ("accepted", True)))["stages"][-1]["text"]

    desk(test)


def test_a_verifier_that_cannot_be_watched_says_why(desk):
    async def test(console, craft):
        forms = {form["name"]: form for form in await console.c.get("crafts/sat/commands")}
        problems = {each["stage"]: each["problem"] for each in forms["/Sat/OTHER"]["verifiers"]}
        assert problems == {"accepted": "it compares /yamcs/x, which is not known here", "failed": "",
                            "queued": "the algorithm theirs is not computed here"}
        number, _ = await console.send("OTHER")
        row = await console.row(number, ("accepted", None), ("queued", None))
        assert row["stages"][1]["text"] == "not watched: it compares /yamcs/x, which is not known here"

    desk(test)


def test_a_database_that_changes_ends_what_waits(desk, tmp_path):
    async def test(console, craft):
        number, _ = await console.send("SET", mode="SAFE")
        (tmp_path / "sat.xml").write_text(DATABASE.replace('"Accept"', '"Taken"'))
        row = await console.row(number, ("failed", False))
        assert "the database has changed" in row["stages"][-1]["text"]
        number, _ = await console.send("SET", mode="SAFE")
        craft.say(ACCEPT, 0)
        await console.row(number, ("accepted", True))

    desk(test)


@pytest.mark.parametrize(("found", "wrong", "why"), [
    ('containerRef="Reject"/><C', 'containerRef="None"/><C', "there is no container None"),
    ('<Comparison parameterRef="healthy"', '<Comparison parameterRef="sick"', "there is no parameter sick"),
    ('<ReturnParmRef parameterRef="reason"', '<ReturnParmRef parameterRef="why"', "there is no parameter why"),
    (f'timeToStopChecking="{SHORT}"', 'timeToStopChecking="soon"', "'soon' is no duration"),
    (f'timeToStopChecking="{SHORT}"', 'timeToStopChecking="PT0S"', "ends after it begins"),
    ("AcceptedVerifier>", "TakenVerifier>", "<TakenVerifier> is not known in <VerifierSet>"),
    (ACCEPTED, "", "<AcceptedVerifier> needs a Comparison"),
])
def test_a_wrong_verifier_is_refused_where_it_stands(tmp_path: Path, found, wrong, why):
    assert found in DATABASE
    (tmp_path / "sat.xml").write_text(DATABASE.replace(found, wrong))
    with pytest.raises(SetupError, match=rf"sat\.xml:\d+: .*{why}"):
        Database.load(tmp_path / "sat.xml")


@pytest.mark.parametrize("step", [-5 * 365 * 86400 * 10**9, -10**10, 10**8, 3600 * 10**9, 5 * 365 * 86400 * 10**9])
def test_a_clock_that_is_set_ends_no_window_and_no_alarm_s_shelving(desk, monkeypatch, step):
    async def test(console, craft):
        here = console.c.room.crafts["sat"]
        await console.c.post("crafts/sat/limits/3", {"limits": {"warning": [10, None]}}, method="put")
        craft.say(ACCEPT, 3)
        await console.c.until("crafts/sat/alarms", lambda rows: rows)
        shelved = (await console.c.post("crafts/sat/alarms/3", {"shelve_s": 600}))["shelved_until_ns"]
        number, _ = await console.send("COUNT")
        monkeypatch.setattr(clock_module, "time", SimpleNamespace(
            monotonic=time.monotonic, monotonic_ns=time.monotonic_ns, time_ns=lambda: time.time_ns() + step))
        word = "forward" if step > 0 else "back"
        if abs(step) > 10**9:
            await console.c.until("crafts/sat/events", lambda rows: any(f"clock went {word} by" in each["text"]
                                                                        for each in rows))
        craft.say(ACCEPT, 20)
        row = await console.row(number, ("accepted", True), ("progress", True))
        assert abs(int(row["stages"][1]["t_ns"]) - time.time_ns() - step) < 60 * 10**9
        await console.c.until("crafts/sat/alarms", lambda rows: abs(
            int(rows[0]["shelved_until_ns"]) - int(shelved) - step * (abs(step) > 10**9)) < 10**9)
        await console.c.until("crafts", lambda _: abs(here.clock.now - time.time_ns() - step) < 10 * 10**9)

    desk(test)


def test_a_server_that_starts_goes_on_with_the_commands_of_the_last_one(tmp_path, monkeypatch):
    """A stage that was passed stays; one that is waited for is passed later; the fate of one
    whose window has ended meanwhile is not known."""
    clock = SimpleNamespace(monotonic=time.monotonic, now=time.time_ns())      # which the test sets
    clock.time_ns = clock.monotonic_ns = lambda: clock.now
    monkeypatch.setattr(clock_module, "time", clock)

    async def test():
        craft = await Craft.begin()
        (tmp_path / "sat.xml").write_text(DATABASE)
        text = f'[[craft]]\nname = "sat"\ndatabase = ["sat.xml"]\nroot = "/Sat/Packet"\nlink = "{craft.link}"\n'
        async with console(tmp_path, text) as c:
            await c.until("crafts", lambda rows: rows[0]["link"]["up"])
            operator = Desk(c, craft)
            craft.say(STATUS, 0, 5, 0)
            await c.until("crafts", lambda rows: rows[0]["packets"] == 1)
            number, _ = await operator.send("SET", mode="WORK")
            craft.say(ACCEPT, 0)
            await operator.row(number, ("accepted", True))
            short, _ = await operator.send("HASTY")
        clock.now += 300_000_000
        async with console(tmp_path, text) as c:
            operator = Desk(c, craft)
            await c.until("crafts", lambda _: not c.room.crafts["sat"].commanding.left)
            craft.say(STATUS, 1, 5, 0)
            row = await operator.row(number, ("accepted", True), ("completed", True))
            assert "open" not in row
            rows = await c.until("crafts/sat/sent", lambda rows: len(rows[0]["stages"]) > 1)
            assert rows[0]["id"] == short and rows[0]["stages"][-1]["good"] is None
            assert "unknown, telemetry is missing from" in rows[0]["stages"][-1]["text"]
            assert (await operator.send("NEVER"))[1][2:4] == b"\xc0\x02"       # it counts on
        async with console(tmp_path, text) as c:
            assert number not in [row["id"] for row in c.room.journal.all("sent", "sat", True)]
            assert (await c.get("crafts/sat/sent"))[2] == row
        craft.wire.close()

    asyncio.run(asyncio.wait_for(test(), PATIENCE))
