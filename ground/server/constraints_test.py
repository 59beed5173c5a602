# SPDX-License-Identifier: Apache-2.0
"""The constraints of a database, at the desk of a spacecraft whose mode the test sets."""
import asyncio

import pytest

from fledge.ground import Database
from fledge.ground.server import verifying_test
from fledge.ground.server.verifying_test import STATUS, command, packet, stages
from fledge.ground.server.web_test import console
from tests.waiting import PATIENCE

WORK = '<Comparison parameterRef="mode" value="WORK"/>'
MANY = '<Comparison parameterRef="counter" comparisonOperator="&gt;" value="0x8"/>'
ARGUMENT = ('<BooleanExpression><Condition><ParameterInstanceRef parameterRef="counter"/><ComparisonOperator>=='
            '</ComparisonOperator><ParameterInstanceRef parameterRef="/yamcs/cmd/arg/n"/></Condition>'
            '</BooleanExpression>')


def constrained(text, *constraints):
    """The command's text with constraints (what must hold, attributes)."""
    inside = "".join(f"<TransmissionConstraint {more}>{what}</TransmissionConstraint>" for what, more in constraints)
    return text.replace("<CommandContainer", f"<TransmissionConstraintList>{inside}</TransmissionConstraintList>"
                        "<CommandContainer")


def significant(text, level):
    return text.replace("<CommandContainer", f'<DefaultSignificance consequenceLevel="{level}"/><CommandContainer')


CALM = 27       # the code of a command that always leaves
COMMANDS = (
    constrained(command("FIRE", 20, ""), (WORK, ""))
    + constrained(command("SOFT", 21, ""), (WORK, 'suspendable="true"'))
    + constrained(command("PATIENT", 22, ""), (WORK, 'timeOut="PT60S"'))
    + constrained(command("HASTY2", 23, ""), (WORK, 'timeOut="PT0.3S"'))
    + constrained(command("TWO", 24, ""), (WORK, ""), (MANY, 'suspendable="true"'))
    + constrained(command("THEIRS", 25, ""), ('<CustomAlgorithm name="theirs"/>', ""))
    + constrained(command("ECHOED", 26, "", arguments=[("n", "n")]), (ARGUMENT, ""))
    + significant(command("CALM", CALM, ""), "normal") + significant(command("GRAVE", 28, ""), "critical"))
DATABASE = verifying_test.DATABASE.replace('<MetaCommand name="Sound"', COMMANDS + '<MetaCommand name="Sound"')


def test_constraints_are_judged_by_the_newest_values(tmp_path):
    (tmp_path / "sat.xml").write_text(DATABASE)
    database = Database.load(tmp_path / "sat.xml")
    assert "theirs" not in str(database.left_out) and any("constrains a command" in note for note in database.notes)
    forms = {form["name"]: form for form in database.forms()}
    assert forms["/Sat/TWO"]["constraints"] == ["mode == WORK", "counter > 0x8"]
    assert forms["/Sat/CALM"]["hazardous"] == "" and forms["/Sat/GRAVE"]["hazardous"] == "critical"
    monitor = database.monitor("/Sat/Packet")

    def judged(name, **arguments):
        return [row[:2] for row in monitor.judge(f"/Sat/{name}", arguments)]

    unknown = "mode == WORK (not known: no packet had it)"
    assert judged("FIRE") == [(None, unknown)]
    assert judged("THEIRS") == [(None, "the algorithm theirs (not known: it is not computed here)")]
    for mode, counter in [(0, 8), (1, 8), (1, 9), (0, 9)]:
        monitor.take([(0, 0, packet(STATUS, mode, counter, 1))])
        first = (True, "") if mode else (False, "mode == WORK (found SAFE)")
        second = (True, "") if counter > 8 else (False, f"counter > 0x8 (found {counter})")
        assert judged("FIRE") == [first] and judged("TWO") == [first, second]
        assert judged("ECHOED", n=str(counter)) == [(True, "")] and judged("ECHOED", n="3")[0][0] is False
    assert judged("ECHOED")[0][0] is None


@pytest.fixture
def desk(tmp_path, monkeypatch):
    monkeypatch.setattr(verifying_test, "DATABASE", DATABASE)

    async def run(test):
        craft = await verifying_test.Craft.begin()
        (tmp_path / "sat.xml").write_text(DATABASE)
        text = f'[[craft]]\nname = "sat"\ndatabase = ["sat.xml"]\nroot = "/Sat/Packet"\nlink = "{craft.link}"\n'
        async with console(tmp_path, text) as c:
            await c.until("crafts", lambda rows: rows[0]["link"]["up"])
            await test(Desk(c, craft), craft)
        craft.wire.close()

    return lambda test: asyncio.run(asyncio.wait_for(run(test), PATIENCE))


class Desk(verifying_test.Desk):
    async def mode(self, mode, counter=9):
        self.craft.say(STATUS, mode, counter, 1)
        n = (await self.c.get("crafts"))[0]["packets"]
        while (await self.c.get("crafts"))[0]["packets"] == n:
            self.craft.say(STATUS, mode, counter, 1)
            await asyncio.sleep(0.05)

    async def refused(self, name, **more):
        """The answer that says why it did not leave."""
        answer = await self.c.post("crafts/sat/send", {"name": f"/Sat/{name}"} | more, status=409)
        await self.nothing_left(name)
        return answer

    async def nothing_left(self, name):
        """The link keeps the order: the packet that comes next is that of the next command."""
        _, got = await self.send("CALM")
        assert got[6] == CALM, name

    async def unchecked(self, name):
        """The note in the journal."""
        number = (await self.c.post("crafts/sat/send", {"name": f"/Sat/{name}", "unchecked": True}))["id"]
        await asyncio.wait_for(self.craft.got.get(), PATIENCE)
        row = next(row for row in await self.c.get("crafts/sat/sent") if row["id"] == number)
        assert stages(row) == [("released", True)]
        return row["stages"][0]["text"]


def test_a_command_leaves_when_its_constraints_hold(desk):
    async def test(console, craft):
        unknown = "mode == WORK (not known: no packet had it)"
        assert unknown in str(await console.refused("FIRE"))
        assert await console.unchecked("FIRE") == f"not checked: {unknown}"
        await console.mode(0)
        for more in ({}, {"unchecked": True}):      # the database does not let it go
            assert "mode == WORK (found SAFE)" in str(await console.refused("FIRE", **more))
        assert "found SAFE" in str(await console.refused("SOFT"))
        assert await console.unchecked("SOFT") == "not checked: mode == WORK (found SAFE)"
        assert await console.unchecked("THEIRS") == (
            "not checked: the algorithm theirs (not known: it is not computed here)")
        assert "found SAFE" in str(await console.refused("HASTY2"))
        await console.mode(1, 8)
        await console.send("FIRE")
        assert "counter > 0x8 (found 8)" in str(await console.refused("TWO"))
        assert await console.unchecked("TWO") == "not checked: counter > 0x8 (found 8)"
        await console.send("ECHOED", n=8)
        assert "hazardous" in str(await console.refused("GRAVE"))
        assert sum("unchecked" in str(line) for line in await console.c.get("log")) >= 4

    desk(test)


def test_a_command_waits_for_its_constraint_until_its_timeout(desk):
    async def test(console, craft):
        await console.mode(0)
        waits = asyncio.ensure_future(console.send("PATIENT"))
        for _ in range(3):
            await console.nothing_left("PATIENT")
        assert not waits.done()
        await console.mode(1)
        _, got = await waits
        assert got[6] == 22

    desk(test)


def test_modes_and_hazardous_commands_are_events(desk):
    async def test(console, craft):
        await console.mode(0)
        await console.mode(1)
        await console.refused("GRAVE")
        await console.c.post("crafts/sat/send", {"name": "/Sat/GRAVE", "confirmed": True})
        await console.send("CALM")
        events = await console.c.get("crafts/sat/events")
        assert [(event["severity"], event["source"], event["text"]) for event in reversed(events)][1:] == [
            ("info", "mode", "the mode is SAFE"), ("watch", "mode", "the mode is WORK; before, it was SAFE"),
            ("info", "commands", "operator asks for /Sat/GRAVE, which is hazardous: critical; not sent, for it is not "
             "confirmed"),
            ("watch", "commands", "operator sends /Sat/GRAVE, which is hazardous: critical")]

    desk(test)
