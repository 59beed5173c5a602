# SPDX-License-Identifier: Apache-2.0
"""Scripts of the ground by the server: the same calls, logged and verified as an operator's."""
import asyncio
import json
from unittest.mock import patch

import pytest

from fledge import cli, ground
from fledge.commands import Packets
from fledge.ground.server.spacecraft import Spacecraft
from fledge.ground.server.uplink_test import mission
from fledge.ground.server.passwords import token
from fledge.ground.server.web_test import console, flown
from fledge.errors import Failure, SetupError
from fledge.export.run_test import FLIGHT, WORLD
from fledge.units import N, m, minute, s
from tests.waiting import wait_for

FILE = """
folder = "kept"
[[craft]]
mission = "nadir_spin"
speed = 200
"""
SCRIPT = '''
from fledge.units import N, m, minute, s


def run(craft, script):
    with script.step("gain"):
        craft.command("telemetry", "flight.tracking.error", every=2).completed(within=20 * minute)
        craft.command("write", "flight.control", K=3 * N * m).completed(within=20 * minute)
        seen = craft.wait(lambda t: t.flight.tracking.error.head.t > 0, within=20 * minute)
    script.hold(10 * s)
    craft.command("write", "flight.control", K=-3 * N * m).completed(within=20 * minute)
'''


def address(page, craft="nadir_spin"):
    return f"http://127.0.0.1:{page.client.server.port}/{craft}"


@flown
async def test_a_script_commands_by_the_server(folder):
    async with console(folder, FILE) as page:
        (folder / "script.py").write_text(SCRIPT)
        await page.verified("nadir_spin", "flight.write.control.K", {"K": 2})
        code = await asyncio.to_thread(cli.main, ["ground", "run", str(folder / "script.py"), "--to", address(page),
                                                  "--out", str(folder / "out")])
        log = [json.loads(line) for line in (folder / "out/script.jsonl").read_text().splitlines()]
        assert code == 1 and "flight refused write flight.control.K" in log[-1]["why"], log[-1]
        assert [entry["stage"] for entry in log if entry["kind"] == "stage" and entry["id"] == 2 and
                entry["stage"] != "numbered"] == ["accepted", "executed"]
        rows = [sent for sent in await page.get("crafts/nadir_spin/sent") if sent["name"] == "write flight.control.K"]
        assert [row["user"] for row in rows] == ["operator"] * 2
        assert [stage["stage"] for stage in (await page.row("nadir_spin", rows[1]["id"]))["stages"]][-1] == "completed"
        assert [sent["action"] for sent in await page.get("log")].count("POST /api/crafts/nadir_spin/raw") == 3
        await page.verified("nadir_spin", "flight.write.control.K", {"K": 4})   # others go on behind it


@flown
async def test_two_scripts_and_an_operator_share_a_spacecraft(folder):
    def commands():
        with ground.connect(address(page)) as craft:
            for _ in range(10):
                craft.command("noop").completed(within=60 * minute)
            return craft.sent

    async with console(folder, FILE) as page:
        first, second = await asyncio.gather(asyncio.to_thread(commands), asyncio.to_thread(commands))
        sequences = [sent.reports[0].sequence for sent in first + second]
        assert len(set(sequences)) == 20


@flown
async def test_a_packet_that_comes_before_the_link_is_open_waits_for_it(folder):
    opened = Spacecraft._open

    def late(craft):
        wait_for(lambda: not craft._requests.empty() or craft._over.is_set())
        opened(craft)

    with patch.object(Spacecraft, "_open", late):
        async with console(folder, FILE) as page:
            preview = await page.post("crafts/nadir_spin/preview", {"name": "flight.noop"})
            await page.post("crafts/nadir_spin/raw", {"hex": preview["hex"]})
            assert page.room.crafts["nadir_spin"].connection.state == "up"


@flown
async def test_a_script_behind_the_commands_of_another_ground_is_executed_once(folder):
    def commands():
        with ground.connect(address(page)) as craft:
            return craft.command("write", "flight.control", K=3 * N * m).completed(within=60 * minute)

    async with console(folder, FILE) as page:
        craft = page.room.craft("nadir_spin")
        await page.until("crafts/nadir_spin/sent", lambda rows: rows and rows[0]["stages"][-1]["stage"] == "completed")

        def behind():       # as if the server had begun anew
            flight = craft.connection.craft
            flight.in_step, flight._packets.sequence = False, 0
            return craft.simulation.flight.commands.counters.accepted

        before = await asyncio.wrap_future(craft.call(behind))
        sent = await asyncio.to_thread(commands)
        assert [report.executed for report in sent.reports] == [0, 1] and all(report.good for report in sent.reports)
        after = await asyncio.wrap_future(craft.call(lambda: craft.simulation.flight.commands.counters.accepted))
        assert after == before + 2      # the server's noop, by which it learned the number, and this


@flown
async def test_a_script_asks_the_operators_of_the_console(folder):
    async with console(folder, FILE) as page:
        (folder / "script.py").write_text("def run(craft, script):\n    script.confirm('go <b>now</b>?')\n")
        live, here = await page.client.ws_connect("/api/live"), "crafts/nadir_spin/questions"
        for answer in (True, False):
            run = asyncio.create_task(asyncio.to_thread(cli.main, [
                "ground", "run", str(folder / "script.py"), "--to", address(page), "--out", str(folder / f"{answer}")]))
            question = (await page.until(here, lambda rows: rows))[0]
            assert (question["text"], question["user"], question["answer"]) == ("go <b>now</b>?", "operator", None)
            await page.post(f"{here}/{question['id']}", {"answer": "yes"}, 400)
            await page.get(f"{here}/{question['id']}")
            assert (await page.post(f"{here}/{question['id']}", {"answer": answer}))["by"] == "operator"
            assert await page.get(here) == [] and (await page.get(f"{here}/{question['id']}"))["answer"] is answer
            assert await run == (0 if answer else 1)
            log = [json.loads(line) for line in (folder / f"{answer}/script.jsonl").read_text().splitlines()]
            assert [(entry["good"], entry["why"]) for entry in log if entry["kind"] == "confirm"] == [
                (answer, "by operator")]
            await page.post(f"{here}/{question['id']}", {"answer": True}, 400)
        published = []
        while len(published) < 4:
            message = (await live.receive()).data
            content = json.loads(message) if isinstance(message, str) else {}
            if content.get("kind") == "question":
                published.append((content["craft"], content["answer"]))
        assert published == [("nadir_spin", None), ("nadir_spin", True), ("nadir_spin", None), ("nadir_spin", False)]
        for text in ("", "x" * 1001):
            await page.post(here, {"text": text}, 400)
        await page.post(here, {"text": "left alone?"})
        with patch("fledge.ground.server.questions.POLLED", 0.0):     # its script has ended
            assert await page.get(here) == []


STORED = """
    f.stored = fsw.StoredCommands()
    f.task("stored", every=1 * s, run=[f.stored])
"""
HAZARDS = """
[commands."flight.write.control.K"]
hazardous = "the loop may oscillate"
[commands."flight.reset_flight"]
hazardous = "flight begins again"
[commands."flight.write.vehicle.I_B"]
hazardous = "the body is another one"
"""


@flown
async def test_what_is_hazardous_is_refused_unless_the_script_means_it(folder):
    mission(folder / "plays", FLIGHT + STORED, WORLD)
    (folder / "plays/ground.toml").write_text(HAZARDS)

    def commands():
        with ground.connect(address(page, "plays")) as craft:
            for what, given, why in ((("write", "flight.control"), {"K": 3 * N * m}, "the loop may oscillate"),
                                     (("reset",), {}, "flight begins again")):
                with pytest.raises(Failure, match=f"hazardous: {why}; a script says confirmed=True"):
                    craft.command(*what, **given)
                with pytest.raises(Failure, match=f"hazardous: {why}"):
                    craft.command("store", 1, 0, 0, craft.packets(*what, **given)[0])
            craft.command("write", "flight.control", K_I=0.02 * N * m / s).completed(within=60 * minute)
            craft.command("write", "flight.control", K=3 * N * m, confirmed=True).completed(within=60 * minute)
            with pytest.raises(Failure, match="hazardous"):     # it was for the one command
                craft.command("write", "flight.control", K=3 * N * m)

    async with console(folder, '[[craft]]\nmission = "./plays"\nspeed = 200\n') as page:
        await asyncio.to_thread(commands)
        step = {"list": 1, "step": 0, "time_ns": "0", "name": "flight.write.control.K", "arguments": {"K": 2}}
        assert (await page.post("crafts/plays/stored", step, 409))["hazardous"] == "the loop may oscillate"
        number, = (await page.post("crafts/plays/stored", step | {"confirmed": True}))["ids"]
        await page.row("plays", number)
        await page.row("plays", (await page.post("crafts/plays/tables/flight.control", {"read": True}))["ids"][0])
        load = {"values": {"K": 9, "K_I": 0.02}}
        answer = await page.post("crafts/plays/tables/flight.control", load, 409)
        assert answer["hazardous"] == "the loop may oscillate"
        flight = page.room.crafts["plays"].simulation.flight
        assert (flight.control.K, flight.control.K_I) == (3, 0.02)
        refused = [entry for entry in await page.get("log") if entry["action"] == "refused"]
        assert len(refused) == 7 and all("hazardous" in entry["text"] for entry in refused)
        reset = (await page.post("crafts/plays/preview", {"name": "flight.reset_flight"}))["hex"]
        nested = (reset[:12] + "0f" + "00" * 17) * 2700 + reset     # stored by one that is stored by one ...
        refusal = await page.post("crafts/plays/raw", {"hex": nested}, 409)
        assert refusal["hazardous"].startswith("flight begins again")
        packets = Packets(page.room.crafts["plays"].mission.dictionary)
        fields = {field.name: field for field in packets.dictionary.block("flight.vehicle")[1].fields}
        row, = packets.write_bytes("flight.vehicle", {fields["I_B"].offset + 24: bytes(24)})    # a part of it
        refusal = await page.post("crafts/plays/raw", {"hex": row.hex()}, 409)
        assert refusal["hazardous"].startswith("the body is another one")
        block = packets.dictionary.block("flight.vehicle")[1]
        load = [*packets.load("flight.vehicle", bytes(block.size)), packets.load_table("flight.vehicle", "body")]
        for packet in (*load, packets.store(1, 0, 0, load[-1])):    # stages, commit, table, and a stored one
            refusal = await page.post("crafts/plays/raw", {"hex": packet.hex()}, 409)
            assert refusal["hazardous"].startswith("the body is another one")
        texts = [event["text"] for event in await page.get("crafts/plays/events") if event["source"] == "commands"]
        assert sum("not confirmed" in text for text in texts) == 7 + 6
        assert [text for text in reversed(texts) if "sends" in text] == [
            "operator sends write flight.control.K, which is hazardous: the loop may oscillate",
            "operator sends store, which is hazardous: the loop may oscillate"]
        names = [sent["name"] for sent in await page.get("crafts/plays/sent")
                 if sent["name"].startswith(("write", "res"))]
        assert names == ["write flight.control.K", "write flight.control.K_I"]


@flown
async def test_scripts_without_the_role_are_refused(folder):
    word, kept = token()
    text = FILE + f'[[token]]\nname = "night"\nhash = "{kept}"\nroles = ["view"]\n'
    async with console(folder, text) as page:
        def connected(given, craft="nadir_spin"):
            with ground.connect(address(page, craft), token=given) as client:
                client.listen(1 * s)
                return client.command("write", "flight.control", K=3 * N * m)

        for given, craft, error, says in (
                (None, "nadir_spin", Failure, "log in first.*FLEDGE_TOKEN"),
                ("x", "nadir_spin", Failure, "token is none"),
                (word, "nadir_span", SetupError, "did you mean 'nadir_spin'"),
                (word, "nadir_spin", Failure, "night lacks the role 'command' for nadir_spin")):
            with pytest.raises(error, match=says):
                await asyncio.to_thread(connected, given, craft)
        (folder / "script.py").write_text("def run(craft, script):\n    script.hold(1)\n")
        assert await asyncio.to_thread(cli.main, ["ground", "run", str(folder / "script.py"), "--to", address(page),
                                                  "--out", str(folder / "out"), f"--token={word}"]) == 0
        assert (folder / "out").stat().st_mode & 0o77 == 0
        assert not any(word in path.read_text() for path in (folder / "out").iterdir())
    with pytest.raises(OSError):
        await asyncio.to_thread(connected, word)
